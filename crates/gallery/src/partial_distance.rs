//! The points at which a segment's faces differ most. By these alone, which lie together in two lines of cache, most
//! faces that PCA codes leave are known to be too far ([`super::trimmed_lower_bound`]).

use std::cmp::Reverse;

use bytemuck::{Pod, Zeroable};
use rayon::prelude::*;

use super::column::Column;
use super::columns::stored;
use super::dense_rows::DenseRows;
use super::pca_code::SAMPLE;
use super::trimmed_lower_bound::{Reach, Shift, capped_squares};
use visage_shape::faces::dense_signature::{DenseSignature, UNSEEN};
use visage_shape::faces::template::TEMPLATE_POINTS;

/// How many points.
const COUNT: usize = 128;
/// The ceiling over the reach: greater than for all points, since those left out may all be among these. Of normally
/// distributed faces the fewest were left with this one.
const CEILING: f64 = 3.2;

/// Heights at the points at which faces differ most, made positive.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C, align(64))]
struct Heights([u8; COUNT]);

/// The points at which faces differ most, of a list of dense signatures.
#[derive(Debug, Default)]
pub(super) struct PartialDistances {
    /// Which of the template's points they are.
    points: Column<u16>,
    heights: Column<Heights>,
    /// Of all heights of each signature; [`HAS_GAPS`] if points are unseen.
    sums: Column<i32>,
}

stored!(PartialDistances { points, heights, sums });

/// No sum of heights is as small.
const HAS_GAPS: i32 = i32::MIN;

/// A probe held against them.
#[derive(Debug)]
pub(super) struct PartialProbe<'a> {
    rows: &'a [Heights],
    sums: &'a [i32],
    heights: Heights,
    sum: i32,
}

impl PartialDistances {
    /// Those of the signatures at some places, in that order. Runs inside the caller's rayon pool.
    pub fn of(rows: &DenseRows, places: &[u32]) -> PartialDistances {
        let points = most_varied(rows, places);
        let taken = |place: &u32| match rows.signature(*place).and_then(|signature| whole(&signature)) {
            Some(heights) => (partial_distance(&heights, &points), sum(&heights)),
            None => (Heights([0; COUNT]), HAS_GAPS),
        };
        let (heights, sums): (Vec<Heights>, Vec<i32>) = places.par_iter().map(taken).unzip();
        PartialDistances { points: points.into(), heights: heights.into(), sums: sums.into() }
    }

    /// Whether there is one for each of so many signatures.
    pub fn are_of(&self, signatures: usize) -> bool {
        (self.heights.len(), self.sums.len()) == (signatures, signatures)
            && self.points.iter().all(|point| usize::from(*point) < TEMPLATE_POINTS)
    }

    /// A probe held against all of them; `None` if it has gaps.
    pub fn against(&self, probe: &DenseSignature) -> Option<PartialProbe<'_>> {
        let heights = whole(probe)?;
        let (own, sum) = (partial_distance(&heights, &self.points), sum(&heights));
        Some(PartialProbe { rows: &self.heights, sums: &self.sums, heights: own, sum })
    }
}

impl PartialProbe<'_> {
    /// What distances are held against.
    pub fn reach(reach_mm: f64) -> Reach {
        Reach::new(reach_mm, CEILING)
    }

    /// Reads those with these numbers, so that their lines of cache are fetched side by side and not one after the other.
    pub fn fetch(&self, numbers: &[usize]) {
        let lines = numbers.iter().map(|&number| self.rows[number].0[0] ^ self.rows[number].0[COUNT / 2]);
        std::hint::black_box(lines.fold(0, |all, byte| all ^ byte));
    }

    /// Whether the distance to a signature, by its number, is surely greater than `reach`. A no says nothing.
    pub fn is_beyond(&self, number: usize, reach: &Reach) -> bool {
        let sum = self.sums[number];
        if sum == HAS_GAPS {
            return false;
        }
        let shift = Shift::new(sum.wrapping_sub(self.sum), TEMPLATE_POINTS);
        let squares = capped_squares(&self.rows[number].0, &self.heights.0, shift.whole, reach.ceiling);
        reach.is_exceeded(squares, COUNT, TEMPLATE_POINTS, shift.rest)
    }
}

/// All heights of a signature without gaps.
fn whole(signature: &DenseSignature) -> Option<[i8; TEMPLATE_POINTS]> {
    let heights = signature.to_bytes().map(u8::cast_signed);
    (!heights.contains(&UNSEEN)).then_some(heights)
}

fn sum(heights: &[i8; TEMPLATE_POINTS]) -> i32 {
    heights.iter().map(|height| i32::from(*height)).sum()
}

fn partial_distance(heights: &[i8; TEMPLATE_POINTS], points: &[u16]) -> Heights {
    let mut taken = Heights([0; COUNT]);
    for (slot, point) in taken.0.iter_mut().zip(points) {
        *slot = heights[usize::from(*point)].cast_unsigned().wrapping_add(128);
    }
    taken
}

/// The points whose heights vary most, ties by number.
fn most_varied(rows: &DenseRows, places: &[u32]) -> Vec<u16> {
    let every = places.len().div_ceil(SAMPLE).max(1);
    let sample = places.iter().step_by(every).filter_map(|place| whole(&rows.signature(*place)?));
    let (mut count, mut sums, mut squares) = (0, vec![0i64; TEMPLATE_POINTS], vec![0i64; TEMPLATE_POINTS]);
    for heights in sample {
        count += 1;
        for ((height, sum), square) in heights.into_iter().zip(&mut sums).zip(&mut squares) {
            *sum += i64::from(height);
            *square += i64::from(height).pow(2);
        }
    }
    let variance = |point: &u16| count * squares[usize::from(*point)] - sums[usize::from(*point)].pow(2);
    let mut points: Vec<u16> = (0..TEMPLATE_POINTS as u16).collect();
    points.sort_by_key(|point| Reverse(variance(point)));
    points.truncate(COUNT);
    points
}

#[cfg(test)]
mod tests {
    use super::super::dense_rows::DenseProbe;
    use super::*;
    use proptest::prelude::*;

    /// Heights that differ most at every second point; `seed` tells faces apart.
    fn face(seed: f64, shift: i8) -> DenseSignature {
        DenseSignature::from_bytes(std::array::from_fn(|point| {
            let most = if point % 2 == 0 { 25.0 } else { 4.0 };
            let height = most * (seed * (1.0 + point as f64 / 70.0)).sin();
            (height.round() as i8).wrapping_add(shift).cast_unsigned()
        }))
    }

    #[test]
    fn the_points_taken_are_those_that_vary_most_and_they_rule_out_what_is_far() {
        let mut rows = DenseRows::default();
        (0..50).for_each(|k| rows.push(Some(&face(0.7 * f64::from(k), 0))));
        let partial_distance = PartialDistances::of(&rows, &(0..50).collect::<Vec<u32>>());
        assert_eq!(partial_distance.points.len(), COUNT);
        assert!(partial_distance.points.iter().all(|point| point % 2 == 0));
        let probe = face(14.3, 3);
        let (against, dense) = (partial_distance.against(&probe).expect("it has no gaps"), DenseProbe::new(&probe));
        let is_beyond = |place: &u32| {
            let exact = dense.distance_mm(&rows, *place).expect("all is seen");
            against.is_beyond(*place as usize, &PartialProbe::reach(0.3 * exact))
        };
        assert!((0..50).filter(is_beyond).count() > 40);
    }

    proptest! {
        #[test]
        fn what_is_ruled_out_is_farther(
            seed in 0.0..40.0f64, shifts in prop::collection::vec(-9i8..9, 40), unseen in 0usize..300,
        ) {
            let mut rows = DenseRows::default();
            rows.push(None);
            for (k, shift) in shifts.iter().enumerate() {
                rows.push(Some(&face(seed + 0.03 * k as f64, *shift)));
            }
            let mut holed = face(seed, 0).to_bytes();
            holed[unseen] = UNSEEN.cast_unsigned();
            let holed = DenseSignature::from_bytes(holed);
            rows.push(Some(&holed));
            let places: Vec<u32> = (1..42).rev().collect();
            let partial_distance = PartialDistances::of(&rows, &places);
            prop_assert!(partial_distance.against(&holed).is_none());
            let probe = face(seed, 3);
            let against = partial_distance.against(&probe).expect("it has no gaps");
            against.fetch(&[0, 40]);
            let dense = DenseProbe::new(&probe);
            for (number, place) in places.iter().enumerate() {
                let exact = dense.distance_mm(&rows, *place).expect("most is seen");
                for reach_mm in [0.0, 0.2, 0.999 * exact, exact] {
                    let beyond = against.is_beyond(number, &PartialProbe::reach(reach_mm));
                    prop_assert!(!beyond || exact > reach_mm);
                    prop_assert!(number > 0 || !beyond, "that one has a gap");
                }
            }
        }
    }
}
