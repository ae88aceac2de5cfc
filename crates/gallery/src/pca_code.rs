//! The PCA code of dense signatures: 32 small numbers each, from which most distances are known to be great without
//! reading the signatures.
//!
//! The distance leaves out the `t` greatest of `n` squared differences, which may be any: a projection of the heights
//! alone bounds nothing. So each height is laid round a circle first, `f(h) = r (cos(h/r), sin(h/r))`. The square of
//! `f(a) - f(b)` is `2 r^2 (1 - cos((a - b)/r))`: at most `(a - b)^2` and at most `4 r^2`. So the squares left in sum up
//! to at least `|f(a) - f(b)|^2 - 4 r^2 t`, and a projection of `f` only makes that less. The axes are those along which
//! the segment's own signatures vary most.
//!
//! Heights are taken from the segment's mean face and their own mean, an unseen point lies on the mean face. What that
//! adds is taken off again: at the most that as many points of the probe can make.

use std::ops::Range;

use rayon::prelude::*;

use super::column::Column;
use super::columns::stored;
use super::dense_rows::DenseRows;
use super::pca_basis::{Code, Frame, SIZE};
use visage_shape::faces::dense_signature::{DenseSignature, KEPT_SHARE, LEAST_COMMON, STEP_MM, UNSEEN};
use visage_shape::faces::template::TEMPLATE_POINTS;

/// Fewer signatures are gone through without.
const LEAST_ROWS: usize = if cfg!(test) { 100 } else { 4096 };
/// Signatures that the axes are found from.
pub(super) const SAMPLE: usize = 2048;
/// What rounding in single precision may make of a length, at most.
const SLACK: f64 = 1e-3;

/// The PCA codes of a segment's dense signatures; none if they are few.
#[derive(Debug, Default)]
pub(super) struct PcaCodes {
    frame: Option<Frame>,
    codes: Column<Code>,
    /// Unseen points of each signature.
    gaps: Column<u16>,
    /// The most that rounding moved a code, in units of codes.
    rounding: f32,
}

stored!(PcaCodes { frame, codes, gaps, rounding });

impl PcaCodes {
    /// Those of the signatures at some places, in that order. Runs inside the caller's rayon pool.
    pub fn of(rows: &DenseRows, places: &[u32]) -> PcaCodes {
        if places.len() < LEAST_ROWS {
            return PcaCodes::default();
        }
        let every = places.len().div_ceil(SAMPLE);
        let sample: Vec<_> = places.iter().step_by(every).filter_map(|place| rows.signature(*place)).collect();
        let frame = Frame::of(&sample);
        let coded = |place: &u32| match rows.signature(*place) {
            Some(signature) => frame.code(&frame.heights(&signature)),
            None => ([0; SIZE], 0.0),
        };
        let coded: Vec<(Code, f32)> = places.par_iter().map(coded).collect();
        PcaCodes {
            frame: Some(frame),
            rounding: coded.iter().map(|(_, rounding)| *rounding).fold(0.0, f32::max),
            gaps: places.iter().map(|place| (TEMPLATE_POINTS - rows.seen_points(*place)) as u16).collect(),
            codes: coded.into_iter().map(|(code, _)| code).collect(),
        }
    }

    /// Whether there is one for each of so many signatures, or none at all.
    pub fn are_of(&self, signatures: usize) -> bool {
        match &self.frame {
            None => true,
            Some(frame) => {
                frame.is_sound()
                    && (self.codes.len(), self.gaps.len()) == (signatures, signatures)
                    && self.gaps.iter().all(|gaps| usize::from(*gaps) <= TEMPLATE_POINTS)
            }
        }
    }

    /// A probe held against all of them; `None` if there are none, or if the probe has gaps: what the rows have there
    /// is not known.
    pub fn against(&self, probe: &DenseSignature) -> Option<GistProbe<'_>> {
        let frame = self.frame.as_ref()?;
        if probe.to_bytes().contains(&(UNSEEN as u8)) {
            return None;
        }
        let heights = frame.heights(probe);
        let (code, rounding) = frame.code(&heights);
        let mut greatest: Vec<f64> = heights.iter().map(|height| f64::from(height.abs())).collect();
        greatest.sort_by(|a, b| b.total_cmp(a));
        let most_gaps = self.gaps.iter().max().map_or(0, |most| usize::from(*most));
        let (mut sum, mut of_circle) = (0.0, 0.0);
        let mut allowances = vec![(0.0, 0.0)];
        for height in &greatest[..most_gaps] {
            sum += height;
            of_circle += most_circle_square(*height, f64::from(frame.radius));
            allowances.push((sum, of_circle));
        }
        Some(GistProbe {
            pca_codes: self,
            code,
            allowances,
            most_square: 4.0 * f64::from(frame.radius).powi(2),
            rounding: f64::from(rounding + self.rounding),
            unit: f64::from(frame.unit),
        })
    }
}

/// A probe held against the PCA codes of a segment.
#[derive(Debug)]
pub(super) struct GistProbe<'a> {
    pca_codes: &'a PcaCodes,
    code: Code,
    /// For so many unseen points: the most that the probe's heights there sum up to, and that their circles add.
    allowances: Vec<(f64, f64)>,
    most_square: f64,
    rounding: f64,
    unit: f64,
}

impl GistProbe<'_> {
    /// Fills in the numbers of a range whose distances are not surely greater than that of the limits, ascending.
    pub fn within(&self, range: Range<usize>, limits: &[u32], found: &mut Vec<usize>) {
        let (codes, gaps) = (&self.pca_codes.codes[range.clone()], &self.pca_codes.gaps[range.clone()]);
        // which ones stay can't be foreseen, so there is no branch: all are written, the next over one that doesn't stay
        found.resize(codes.len(), 0);
        let mut count = 0;
        for ((number, code), gaps) in range.zip(codes).zip(gaps) {
            found[count] = number;
            count += usize::from(square(&self.code, code) <= limits[usize::from(*gaps)]);
        }
        found.truncate(count);
    }

    /// The numbers of the `count` nearest among the first, in no order.
    pub fn nearest(&self, count: usize, first: usize) -> Vec<usize> {
        let square = |number: usize| square(&self.code, &self.pca_codes.codes[number]);
        let mut nearest: Vec<(u32, usize)> = (0..first).map(|number| (square(number), number)).collect();
        if count < nearest.len() {
            nearest.select_nth_unstable(count);
            nearest.truncate(count);
        }
        nearest.into_iter().map(|(_, number)| number).collect()
    }

    /// For each number of unseen points the square beyond which a distance is surely greater than `reach_mm`.
    pub fn limits(&self, reach_mm: f64) -> Vec<u32> {
        let limit = |(gaps, (sum, of_circle)): (usize, &(f64, f64))| {
            let points = (TEMPLATE_POINTS - gaps) as f64;
            if points < LEAST_COMMON * TEMPLATE_POINTS as f64 {
                return u32::MAX;
            }
            let kept = (KEPT_SHARE * points).ceil();
            // the mean difference of the points that both have is off by that of the others
            let reach = reach_mm.max(0.0) / STEP_MM + sum / points;
            let square = kept * reach * reach + self.most_square * (points - kept) + of_circle;
            let length = square.sqrt() * (1.0 + SLACK) / self.unit + self.rounding;
            (length * length).ceil() as u32
        };
        self.allowances.iter().enumerate().map(limit).collect()
    }
}

/// The most that the square of a chord on the circle can be for heights that differ by so much or less.
fn most_circle_square(difference: f64, radius: f64) -> f64 {
    let angle = (difference / radius).min(std::f64::consts::PI);
    2.0 * radius * radius * (1.0 - angle.cos())
}

/// Half by half, which the compiler turns into vector instructions.
fn square(a: &Code, b: &Code) -> u32 {
    let difference = |k: usize| i32::from(a[k].abs_diff(b[k]));
    let of_half = |from: usize| (0..SIZE / 2).map(|k| difference(from + k) * difference(from + k)).sum::<i32>();
    (of_half(0) + of_half(SIZE / 2)) as u32
}

#[cfg(test)]
mod tests {
    use super::super::dense_rows::DenseProbe;
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    /// Faces that differ along 9 directions and by a little noise; every third has up to 40 unseen points.
    fn faces(count: usize) -> Vec<DenseSignature> {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let mut face = |number: usize| {
            let weights: [f64; 9] = std::array::from_fn(|_| StandardNormal.sample(&mut rng));
            let mut heights: [u8; TEMPLATE_POINTS] = std::array::from_fn(|point| {
                let along = |k: usize| ((k + 1) as f64 * point as f64 / 50.0 + k as f64).sin();
                let varied: f64 = (0..9).map(|k| 6.0 * weights[k] * along(k)).sum();
                let noise: f64 = StandardNormal.sample(&mut rng);
                (20.0 * along(11) + varied + noise).round().clamp(-127.0, 127.0) as i8 as u8
            });
            if number % 3 == 2 {
                let (first, count) = (rng.random_range(0..260), rng.random_range(1..40));
                heights[first..first + count].fill(UNSEEN as u8);
            }
            DenseSignature::from_bytes(heights)
        };
        (0..count).map(&mut face).collect()
    }

    #[test]
    fn what_a_gist_rules_out_is_farther_and_most_of_what_is_far_is_ruled_out() {
        let faces = faces(400);
        let mut rows = DenseRows::default();
        rows.push(None);
        faces.iter().for_each(|face| rows.push(Some(face)));
        // backwards, the last left out
        let places: Vec<u32> = (1..400).rev().collect();
        let pca_codes = PcaCodes::of(&rows, &places);
        let (mut far, mut ruled_out) = (0, 0);
        for probe in faces.iter().step_by(9) {
            let against = pca_codes.against(probe).expect("whole, and there are enough");
            let dense = DenseProbe::new(probe);
            let distance_mm = |place: &u32| dense.distance_mm(&rows, *place).expect("most is seen");
            let distances_mm: Vec<f64> = places.iter().map(distance_mm).collect();
            let mut sorted = distances_mm.clone();
            sorted.sort_by(f64::total_cmp);
            for reach_mm in [0.0, sorted[1], sorted[40]] {
                let limits = against.limits(reach_mm);
                let mut within = Vec::new();
                for range in [0..150, 150..399] {
                    let mut found = vec![7];
                    against.within(range, &limits, &mut found);
                    within.extend(found);
                }
                assert!(within.is_sorted());
                for (number, distance_mm) in distances_mm.iter().enumerate() {
                    let beyond = within.binary_search(&number).is_err();
                    assert!(!beyond || *distance_mm > reach_mm, "{distance_mm} {reach_mm}");
                    if reach_mm == sorted[1] && *distance_mm > 3.0 * reach_mm {
                        far += 1;
                        ruled_out += usize::from(beyond);
                    }
                }
            }
        }
        assert!(far > 1000 && 2 * ruled_out > far, "{ruled_out} of {far}");
    }

    #[test]
    fn the_nearest_gists_are_those_of_near_faces() {
        let faces = faces(300);
        let mut rows = DenseRows::default();
        faces.iter().for_each(|face| rows.push(Some(face)));
        let places: Vec<u32> = (0..300).collect();
        let pca_codes = PcaCodes::of(&rows, &places);
        let against = pca_codes.against(&faces[60]).expect("whole, and there are enough");
        assert!(against.nearest(3, 300).contains(&60) && against.nearest(3, 300).len() == 3);
        assert!(against.nearest(3, 60).iter().all(|number| *number < 60));
        assert_eq!(against.nearest(1000, 300).len(), 300);
        assert!(pca_codes.against(&faces[2]).is_none(), "the probe has gaps");
        assert!(PcaCodes::of(&DenseRows::default(), &[]).against(&faces[0]).is_none());
    }
}
