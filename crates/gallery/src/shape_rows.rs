//! The shapes of many models in one flat array, and for each a bound of its distance that is read in one line of cache.
//!
//! The bound is made of codes: the numbers of a shape along the axes along which the segment's own shapes vary most, in small steps.
//! A projection brings shapes nearer to each other only, so what is far apart there is far apart.

use bytemuck::{Pod, Zeroable};
use nalgebra::DMatrix;
use rayon::prelude::*;

use super::column::Column;
use super::columns::stored;
use super::pca_basis::principal_axes;
use visage_shape::descriptor::{self, FRAME_BYTES, PAIR_BYTES, ShapeDescriptor};

/// Numbers of a code: of either frame, and of the pairs.
const OF_FRAME: usize = 24;
const OF_PAIRS: usize = 16;
/// Fewer shapes are gone through without codes.
const LEAST_ROWS: usize = if cfg!(test) { 100 } else { 4096 };
/// Shapes that the axes are found from.
const SAMPLE: usize = 1024;
/// What rounding in single precision may make of a length, at most.
const SLACK: f64 = 1e-3;

/// What a bound reads.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C, align(64))]
struct Code {
    frames: [[i8; OF_FRAME]; 2],
    pairs: [i8; OF_PAIRS],
}

/// The shapes of a list of models, some of which have none.
#[derive(Debug, Default)]
pub(super) struct ShapeRows {
    /// Zeros where there is none.
    rows: Column<ShapeDescriptor>,
    /// 1 where there is one.
    there: Column<u8>,
    codes: Option<Codes>,
}

stored!(ShapeRows { rows, there, codes });

#[derive(Debug)]
struct Codes {
    frames: [Axes<FRAME_BYTES, OF_FRAME>; 2],
    pairs: Axes<PAIR_BYTES, OF_PAIRS>,
    codes: Column<Code>,
    /// The most that rounding moved a code of a frame, and one of pairs, in steps of bytes.
    rounding: [f32; 2],
}

stored!(Codes { frames, pairs, codes, rounding });

/// Some axes of a part of a shape.
#[derive(Debug)]
struct Axes<const BYTES: usize, const NUMBERS: usize> {
    mean: Column<f32>,
    /// For each byte its share in each number.
    shares: Column<[f32; NUMBERS]>,
    /// Steps of bytes in one of a code.
    unit: f32,
}

stored!(impl[const BYTES: usize, const NUMBERS: usize] Axes<BYTES, NUMBERS> { mean, shares, unit });

impl<const BYTES: usize, const NUMBERS: usize> Axes<BYTES, NUMBERS> {
    fn of(sample: &[&[u8; BYTES]]) -> Axes<BYTES, NUMBERS> {
        let count = sample.len().max(1) as f32;
        let mean: Vec<f32> =
            (0..BYTES).map(|k| sample.iter().map(|row| f32::from(row[k])).sum::<f32>() / count).collect();
        let centred =
            DMatrix::from_fn(sample.len(), BYTES, |row, column| f32::from(sample[row][column]) - mean[column]);
        let shares =
            principal_axes(&centred, NUMBERS).row_iter().map(|row| std::array::from_fn(|k| row[k] as f32)).collect();
        let mut axes = Axes { mean: mean.into(), shares, unit: 1.0 };
        let most =
            sample.iter().flat_map(|row| axes.numbers(row)).fold(1.0, |most: f32, number| most.max(number.abs()));
        axes.unit = most / 127.0;
        axes
    }

    fn numbers(&self, bytes: &[u8; BYTES]) -> [f32; NUMBERS] {
        let mut numbers = [0.0; NUMBERS];
        for ((byte, mean), shares) in bytes.iter().zip(&*self.mean).zip(&*self.shares) {
            let offset = f32::from(*byte) - mean;
            numbers.iter_mut().zip(shares).for_each(|(number, share)| *number += offset * share);
        }
        numbers
    }

    /// The code, and how far rounding moved it. Cutting off what is too great only brings codes nearer.
    fn code(&self, bytes: &[u8; BYTES]) -> ([i8; NUMBERS], f32) {
        let cut = self.numbers(bytes).map(|number| (number / self.unit).clamp(-127.0, 127.0));
        let rounding: f32 = cut.iter().map(|x| (x - x.round()).powi(2)).sum();
        (cut.map(|x| x.round() as i8), rounding.sqrt() * self.unit)
    }
}

impl Codes {
    fn of(rows: &[Option<&ShapeDescriptor>]) -> Option<Codes> {
        if rows.len() < LEAST_ROWS {
            return None;
        }
        let sample: Vec<&ShapeDescriptor> =
            rows.iter().step_by(rows.len().div_ceil(SAMPLE)).copied().flatten().collect();
        let frames =
            [0, 1].map(|frame| Axes::of(&sample.iter().map(|shape| &shape.frames()[frame]).collect::<Vec<_>>()));
        let pairs = Axes::of(&sample.iter().map(|shape| shape.pairs()).collect::<Vec<_>>());
        let mut codes = Codes { frames, pairs, codes: Column::default(), rounding: [0.0; 2] };
        let none = (Code { frames: [[0; OF_FRAME]; 2], pairs: [0; OF_PAIRS] }, [0.0; 2]);
        let coded: Vec<(Code, [f32; 2])> =
            rows.par_iter().map(|row| row.map_or(none, |shape| codes.code(shape))).collect();
        codes.rounding = coded.iter().fold([0.0; 2], |most, (_, one)| [most[0].max(one[0]), most[1].max(one[1])]);
        codes.codes = coded.into_iter().map(|(code, _)| code).collect();
        Some(codes)
    }

    fn code(&self, shape: &ShapeDescriptor) -> (Code, [f32; 2]) {
        let [first, second] = [0, 1].map(|frame| self.frames[frame].code(&shape.frames()[frame]));
        let pairs = self.pairs.code(shape.pairs());
        (Code { frames: [first.0, second.0], pairs: pairs.0 }, [first.1.max(second.1), pairs.1])
    }
}

impl ShapeRows {
    /// Adds a model's.
    pub fn push(&mut self, shape: Option<&ShapeDescriptor>) {
        self.rows.push(shape.copied().unwrap_or_else(Zeroable::zeroed));
        self.there.push(shape.is_some().into());
    }

    /// Adds one from another list.
    pub fn push_from(&mut self, others: &ShapeRows, place: u32) {
        self.push(others.shape(place));
    }

    /// Indexes what was pushed. Runs inside the caller's rayon pool.
    pub fn finish(&mut self) {
        self.rows.shrink();
        self.there.shrink();
        let rows: Vec<_> = (0..self.rows.len() as u32).map(|place| self.shape(place)).collect();
        self.codes = Codes::of(&rows);
    }

    /// The shape at a place.
    pub fn shape(&self, place: u32) -> Option<&ShapeDescriptor> {
        let place = place as usize;
        (self.there[place] == 1).then(|| &self.rows[place])
    }

    /// Whether there is one for each of so many models.
    pub fn are_of(&self, models: usize) -> bool {
        let codes = self.codes.as_ref();
        (self.rows.len(), self.there.len()) == (models, models) && codes.is_none_or(|codes| codes.codes.len() == models)
    }

    /// A probe held against all of them.
    pub fn against<'a>(&'a self, probe: &'a ShapeDescriptor) -> ShapeBounds<'a> {
        let coded = self.codes.as_ref().map(|codes| {
            let (code, rounding) = codes.code(probe);
            let [first, second] = [0, 1].map(|frame| codes.frames[frame].unit);
            Coded {
                codes: &codes.codes,
                code,
                squares: [first * first, second * second],
                pairs: codes.pairs.unit,
                rounding: [0, 1].map(|k| f64::from(rounding[k] + codes.rounding[k])),
            }
        });
        ShapeBounds { rows: self, probe, coded }
    }
}

/// A probe's shape held against those of a segment.
pub(super) struct ShapeBounds<'a> {
    rows: &'a ShapeRows,
    probe: &'a ShapeDescriptor,
    coded: Option<Coded<'a>>,
}

struct Coded<'a> {
    codes: &'a [Code],
    code: Code,
    /// Of the units of either frame; and the unit of the pairs.
    squares: [f32; 2],
    pairs: f32,
    rounding: [f64; 2],
}

/// A distance, and what tells that a code is beyond it.
#[derive(Debug, Clone, Copy)]
pub(super) struct ShapeReach {
    distance: f64,
    /// The square of the frames' length in codes, in steps of bytes.
    frames: f32,
}

impl ShapeBounds<'_> {
    /// A distance made ready.
    pub fn reach(&self, distance: f64) -> ShapeReach {
        let rounding = self.coded.as_ref().map_or(0.0, |coded| coded.rounding[0]);
        let frames = (descriptor::steps(distance) + rounding) / (1.0 - SLACK);
        // a hair more, since single precision may round it down
        ShapeReach { distance, frames: (frames * frames * (1.0 + SLACK)) as f32 }
    }

    /// What the distance at a place is no less than; `None` if it is surely beyond reach, or if there is no shape.
    #[inline]
    pub fn least_within(&self, place: u32, reach: &ShapeReach) -> Option<f64> {
        let least = match &self.coded {
            Some(coded) => coded.least_within(&coded.codes[place as usize], reach)?,
            None => self.probe.distance(self.rows.shape(place)?),
        };
        (least <= reach.distance).then_some(least)
    }
}

impl Coded<'_> {
    #[inline]
    fn least_within(&self, other: &Code, reach: &ShapeReach) -> Option<f64> {
        let [first, second] = [0, 1].map(|frame| square(&self.code.frames[frame], &other.frames[frame]) as f32);
        let frames = (first * self.squares[0]).min(second * self.squares[1]);
        if frames > reach.frames {
            return None;
        }
        let pairs = (square(&self.code.pairs, &other.pairs) as f32).sqrt() * self.pairs;
        let [frames, pairs] = [(frames.sqrt(), self.rounding[0]), (pairs, self.rounding[1])]
            .map(|(length, rounding)| (f64::from(length) * (1.0 - SLACK) - rounding).max(0.0));
        Some(descriptor::distance_of(frames, pairs))
    }
}

/// Of integers, which the compiler turns into vector instructions.
#[inline]
fn square<const N: usize>(a: &[i8; N], b: &[i8; N]) -> i32 {
    a.iter().zip(b).map(|(a, b)| i32::from(a.abs_diff(*b)) * i32::from(a.abs_diff(*b))).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Shapes that differ along 7 directions and by a little noise; every tenth is none.
    fn shapes(count: usize) -> Vec<Option<ShapeDescriptor>> {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut shape = |number: usize| {
            let weights: [f64; 7] = std::array::from_fn(|_| rng.random_range(-1.0..1.0));
            let bytes = std::array::from_fn(|k| {
                let along = |j: usize| ((j + 1) as f64 * k as f64 / 40.0 + j as f64).sin();
                let varied: f64 = (0..7).map(|j| 14.0 * weights[j] * along(j)).sum();
                (120.0 + varied + rng.random_range(-3.0..3.0)) as u8
            });
            (number % 10 != 9).then(|| ShapeDescriptor::from_bytes(&bytes))
        };
        (0..count).map(&mut shape).collect()
    }

    #[test]
    fn no_bound_is_above_the_distance_and_most_of_what_is_far_is_known_to_be() {
        let shapes = shapes(400);
        let mut rows = ShapeRows::default();
        shapes.iter().for_each(|shape| rows.push(shape.as_ref()));
        rows.finish();
        let (mut far, mut known) = (0, 0);
        for probe in shapes.iter().step_by(7).flatten() {
            let bounds = rows.against(probe);
            for reach in [0.1, 0.3, f64::INFINITY].map(|distance| bounds.reach(distance)) {
                for (place, other) in shapes.iter().enumerate() {
                    let Some(other) = other else { continue };
                    let (least, distance) = (bounds.least_within(place as u32, &reach), probe.distance(other));
                    assert!(least.map_or(distance > reach.distance, |least| least <= distance), "{least:?} {distance}");
                    far += usize::from(reach.distance == 0.3 && distance > 0.6);
                    known += usize::from(reach.distance == 0.3 && distance > 0.6 && least.is_none());
                }
            }
        }
        assert!(far > 1000 && 10 * known > 9 * far, "{known} of {far}");
    }

    #[test]
    fn a_few_are_measured_instead() {
        let shapes = shapes(20);
        let mut rows = ShapeRows::default();
        shapes.iter().for_each(|shape| rows.push(shape.as_ref()));
        rows.finish();
        let probe = shapes[0].as_ref().expect("every tenth is none");
        let bounds = rows.against(probe);
        let all = bounds.reach(f64::INFINITY);
        assert_eq!((bounds.least_within(0, &all), bounds.least_within(9, &all)), (Some(0.0), None));
        let distance = shapes[3].as_ref().map(|shape| probe.distance(shape));
        assert_eq!(bounds.least_within(3, &all), distance);
        assert_eq!(bounds.least_within(3, &bounds.reach(distance.unwrap_or(0.0) - 1e-6)), None);
    }
}
