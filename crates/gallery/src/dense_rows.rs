//! The dense signatures of many models in one flat array, and a bound that rules most of them out in one pass of
//! integers ([`super::trimmed_lower_bound`]).

use bytemuck::{Pod, Zeroable};

use super::column::Column;
use super::columns::stored;
use super::trimmed_lower_bound::{LANES, Reach, Shift, capped_square, capped_squares};
use visage_shape::faces::dense_signature::{DenseSignature, KEPT_SHARE, LEAST_COMMON, STEP_MM, UNSEEN};
use visage_shape::faces::template::TEMPLATE_POINTS;

/// Heights, made positive, padded to whole vector registers; the height 0 where there is none.
type Heights = [u8; WIDTH];
const WIDTH: usize = TEMPLATE_POINTS.next_multiple_of(LANES);
/// The byte of a height of 0.
const LEVEL: u8 = 128;
/// Of two heights.
const MOST_DIFFERENCE: usize = 255;
/// A bit for each point.
type Points = [u64; TEMPLATE_POINTS.div_ceil(64)];
/// The ceiling over the reach: with normally distributed differences the least one left out is this much
/// greater than the root mean square of those left in.
const CEILING: f64 = 2.08;

/// What is known of a row beside its heights.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
struct Seen {
    sum: i32,
    points: u16,
    /// 1 if there is a signature at all.
    there: u16,
}

impl Seen {
    fn whole(&self) -> bool {
        usize::from(self.points) == TEMPLATE_POINTS
    }
}

/// What a bound reads, in five lines of cache.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C, align(64))]
struct Row {
    heights: Heights,
    seen: Seen,
    rest: [u8; REST],
}

/// Bytes up to the next line of cache.
const REST: usize = (WIDTH + size_of::<Seen>()).next_multiple_of(64) - WIDTH - size_of::<Seen>();

/// The dense signatures of a list of models, some of which have none.
#[derive(Debug, Default)]
pub(super) struct DenseRows {
    rows: Column<Row>,
    unseen: Column<Points>,
}

stored!(DenseRows { rows, unseen });

impl DenseRows {
    /// Adds a model's.
    pub fn push(&mut self, signature: Option<&DenseSignature>) {
        let (mut heights, mut seen, mut unseen) = ([LEVEL; WIDTH], Seen::default(), Points::default());
        seen.there = signature.is_some().into();
        let signed = signature.map(|signature| signature.to_bytes().map(|byte| byte as i8));
        for (point, height) in signed.iter().flatten().enumerate() {
            if *height == UNSEEN {
                unseen[point / 64] |= 1 << (point % 64);
                continue;
            }
            heights[point] = (*height as u8).wrapping_add(LEVEL);
            seen.sum += i32::from(*height);
            seen.points += 1;
        }
        self.rows.push(Row { heights, seen, rest: [0; REST] });
        self.unseen.push(unseen);
    }

    /// Adds one from another list.
    pub fn push_from(&mut self, others: &DenseRows, place: u32) {
        let place = place as usize;
        self.rows.push(others.rows[place]);
        self.unseen.push(others.unseen[place]);
    }

    /// The dense signature at a place.
    pub fn signature(&self, place: u32) -> Option<DenseSignature> {
        let place = place as usize;
        let (row, unseen) = (&self.rows[place], &self.unseen[place]);
        let byte = |point: usize| match unseen[point / 64] >> (point % 64) & 1 {
            1 => UNSEEN as u8,
            _ => row.heights[point].wrapping_sub(LEVEL),
        };
        (row.seen.there == 1).then(|| DenseSignature::from_bytes(std::array::from_fn(byte)))
    }

    /// How many points of the one at a place are seen.
    pub fn seen_points(&self, place: u32) -> usize {
        usize::from(self.rows[place as usize].seen.points).min(TEMPLATE_POINTS)
    }

    /// Whether the model at a place has none.
    pub fn is_missing(&self, place: u32) -> bool {
        self.rows[place as usize].seen.there != 1
    }

    /// Reads those at some places, so that their lines of cache are fetched side by side and not one after the other.
    pub fn fetch(&self, places: impl Iterator<Item = u32>) {
        let rows = &*self.rows;
        let lines = places.map(|place| rows[place as usize].heights.iter().step_by(64).fold(0, |all, byte| all ^ byte));
        std::hint::black_box(lines.fold(0, |all, byte| all ^ byte));
    }

    /// Gives back what was reserved but not used.
    pub fn shrink(&mut self) {
        self.rows.shrink();
        self.unseen.shrink();
    }

    /// Whether there is one for each of so many models.
    pub fn are_of(&self, models: usize) -> bool {
        (self.rows.len(), self.unseen.len()) == (models, models)
    }
}

/// A probe's dense signature, to be held against rows.
#[derive(Debug)]
pub(super) struct DenseProbe {
    signature: DenseSignature,
    /// The probe's own and only row.
    own: DenseRows,
}

impl DenseProbe {
    pub fn new(signature: &DenseSignature) -> DenseProbe {
        let mut own = DenseRows::default();
        own.push(Some(signature));
        DenseProbe { signature: signature.clone(), own }
    }

    /// The probe's own.
    pub fn signature(&self) -> &DenseSignature {
        &self.signature
    }

    /// The distance to the model at a place, mm on the standard; `None` if too few points are seen on both.
    ///
    /// That of [`DenseSignature::distance_mm`], bit by bit: differences are whole steps, so they are counted, not sorted.
    pub fn distance_mm(&self, rows: &DenseRows, place: u32) -> Option<f64> {
        let (own, other) = (&self.own, place as usize);
        if rows.is_missing(place) {
            return None;
        }
        let gaps: Points = std::array::from_fn(|k| rows.unseen[other][k] | own.unseen[0][k]);
        let mut counts = [0u16; 2 * MOST_DIFFERENCE + 1];
        let (mut sum, mut points) = (0, 0);
        for point in (0..TEMPLATE_POINTS).filter(|point| gaps[point / 64] >> (point % 64) & 1 == 0) {
            let difference = i32::from(own.rows[0].heights[point]) - i32::from(rows.rows[other].heights[point]);
            counts[(difference + MOST_DIFFERENCE as i32) as usize] += 1;
            sum += difference;
            points += 1;
        }
        if f64::from(points) < LEAST_COMMON * TEMPLATE_POINTS as f64 {
            return None;
        }
        let mean = f64::from(sum) / f64::from(points);
        let kept = (KEPT_SHARE * f64::from(points)).ceil();
        Some(STEP_MM * (least_squares(&counts, mean, kept as usize) / kept).sqrt())
    }

    /// What distances are held against.
    pub fn reach(reach_mm: f64) -> Reach {
        Reach::new(reach_mm, CEILING)
    }

    /// Whether the distance to the model at a place is surely greater than `reach`. A no says nothing.
    pub fn is_beyond(&self, rows: &DenseRows, place: u32, reach: &Reach) -> bool {
        let place = place as usize;
        let (Row { heights: probe, seen: probe_seen, .. }, Row { heights: row, seen, .. }) =
            (&self.own.rows[0], &rows.rows[place]);
        let (mut sum, mut points) = (seen.sum.wrapping_sub(probe_seen.sum), TEMPLATE_POINTS);
        let mut gaps = Points::default();
        if !(seen.whole() && probe_seen.whole()) {
            gaps = std::array::from_fn(|k| rows.unseen[place][k] | self.own.unseen[0][k]);
            for gap in each(&gaps) {
                sum -= i32::from(row[gap]) - i32::from(probe[gap]);
                points -= 1;
            }
            if (points as f64) < LEAST_COMMON * TEMPLATE_POINTS as f64 {
                return false;
            }
        }
        let shift = Shift::new(sum, points);
        let square = |point: usize| capped_square(row[point], probe[point], shift.whole, reach.ceiling);
        let of_gaps: u32 = each(&gaps).map(square).sum();
        let of_padding: u32 = (TEMPLATE_POINTS..WIDTH).map(square).sum();
        let squares = capped_squares(row, probe, shift.whole, reach.ceiling) - of_gaps - of_padding;
        reach.is_exceeded(squares, points, points, shift.rest)
    }
}

/// The sum of the `kept` least squared differences from a mean, the least first; there are `counts[d + MOST_DIFFERENCE]`
/// differences of `d`.
fn least_squares(counts: &[u16], mean: f64, kept: usize) -> f64 {
    let off = |index: usize| index as f64 - MOST_DIFFERENCE as f64 - mean;
    // outwards from the mean
    let mut above = ((mean + MOST_DIFFERENCE as f64).ceil() as usize).min(counts.len());
    let mut below = above;
    let (mut left, mut sum) = (kept, 0.0);
    while left > 0 && (below > 0 || above < counts.len()) {
        let takes_below = below > 0 && (above == counts.len() || off(below - 1).abs() <= off(above).abs());
        let index = if takes_below { below - 1 } else { above };
        let taken = left.min(usize::from(counts[index]));
        for _ in 0..taken {
            sum += off(index).powi(2);
        }
        left -= taken;
        if takes_below {
            below -= 1;
        } else {
            above += 1;
        }
    }
    sum
}

/// The points whose bits are set.
fn each(points: &Points) -> impl Iterator<Item = usize> {
    points
        .iter()
        .enumerate()
        .flat_map(|(word, bits)| {
            let mut bits = *bits;
            std::iter::from_fn(move || {
                let bit = bits.trailing_zeros() as usize;
                bits &= bits.checked_sub(1)?;
                Some(64 * word + bit)
            })
        })
        .filter(|point| *point < TEMPLATE_POINTS)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn signature(heights: &[i8]) -> DenseSignature {
        DenseSignature::from_bytes(std::array::from_fn(|k| {
            heights[k % heights.len()].wrapping_add((k % 3) as i8) as u8
        }))
    }

    proptest! {
        #[test]
        fn what_is_ruled_out_is_farther(
            a in prop::collection::vec(-60i8..60, 1..300), b in prop::collection::vec(-60i8..60, 1..300),
            near in any::<bool>(), unseen in prop::collection::vec(0usize..300, 0..90), reach_mm in 0.0..6.0f64,
        ) {
            let mut other = if near { signature(&a).to_bytes() } else { signature(&b).to_bytes() };
            for (k, byte) in b.iter().zip(other.iter_mut()) {
                *byte = byte.wrapping_add((k / 10) as u8);
            }
            for place in unseen {
                other[place] = UNSEEN as u8;
            }
            let (probe, other) = (signature(&a), DenseSignature::from_bytes(other));
            let mut rows = DenseRows::default();
            rows.push(None);
            rows.push(Some(&other));
            prop_assert_eq!(rows.signature(1), Some(other.clone()));
            let dense = DenseProbe::new(&probe);
            let exact = probe.distance_mm(&other);
            prop_assert_eq!(dense.distance_mm(&rows, 1), exact);
            for reach_mm in [reach_mm, exact.unwrap_or(0.0), exact.unwrap_or(0.0) * 0.999] {
                if dense.is_beyond(&rows, 1, &DenseProbe::reach(reach_mm)) {
                    prop_assert!(exact.is_some_and(|exact| exact > reach_mm));
                }
            }
        }
    }

    #[test]
    fn what_is_much_farther_is_ruled_out() {
        let flat = signature(&[0]);
        let mut rows = DenseRows::default();
        rows.push(Some(&signature(&[12, -12, 9, -7, 3, 0, -5])));
        let mut holed = signature(&[12, -12, 9, -7, 3, 0, -5]).to_bytes();
        holed[40..90].fill(UNSEEN as u8);
        rows.push(Some(&DenseSignature::from_bytes(holed)));
        let probe = DenseProbe::new(&flat);
        for place in [0, 1] {
            let exact = probe.distance_mm(&rows, place).expect("most is seen");
            assert!(probe.is_beyond(&rows, place, &DenseProbe::reach(0.8 * exact)), "{exact}");
            assert!(!probe.is_beyond(&rows, place, &DenseProbe::reach(exact)));
        }
    }

    #[test]
    fn a_model_without_one_is_told() {
        let mut rows = DenseRows::default();
        rows.push(None);
        assert!(rows.is_missing(0) && rows.signature(0).is_none());
        assert_eq!(DenseProbe::new(&signature(&[1])).distance_mm(&rows, 0), None);
    }
}
