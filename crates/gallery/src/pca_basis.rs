//! How PCA codes are made of dense signatures ([`super::pca_code`]): the heights laid round circles, and the axes along which a
//! sample of them varies most.

use nalgebra::DMatrix;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::column::Column;
use super::columns::stored;
use visage_shape::faces::dense_signature::{DenseSignature, UNSEEN};
use visage_shape::faces::template::TEMPLATE_POINTS;

/// Numbers of a PCA code.
pub(super) const SIZE: usize = 32;
/// Iterations towards the axes. Any axes bound; better ones bound closer.
const ROUNDS: usize = 5;
/// The circle's radius over the root mean square of the heights: smaller, and fewer axes don't hold them; greater, and
/// what the greatest differences may take is more than it gains.
const RADIUS: f32 = 0.7;

pub(super) type Code = [i8; SIZE];
/// Heights over the mean face, their own mean removed, in steps; 0 where there is no surface.
pub(super) type Heights = [f32; TEMPLATE_POINTS];

/// How PCA codes of a segment are made.
#[derive(Debug)]
pub(super) struct Frame {
    mean: Column<f32>,
    pub radius: f32,
    /// For each coordinate of the circles what it adds to the numbers: cosines first, then sines.
    axes: Column<[f32; SIZE]>,
    /// One, of the codes.
    middle: Column<[f32; SIZE]>,
    /// The length that 1 stands for.
    pub unit: f32,
}

stored!(Frame { mean, radius, axes, middle, unit });

impl Frame {
    /// One that fits a sample.
    pub fn of(sample: &[DenseSignature]) -> Frame {
        let (mut sums, mut counts) = (vec![0f32; TEMPLATE_POINTS], vec![0f32; TEMPLATE_POINTS]);
        for signature in sample {
            for (point, height) in seen(signature) {
                sums[point] += height;
                counts[point] += 1.0;
            }
        }
        let mean = sums.iter().zip(&counts).map(|(sum, count)| sum / count.max(1.0)).collect();
        let mut frame =
            Frame { mean, radius: 1.0, axes: Column::default(), middle: vec![[0.0; SIZE]].into(), unit: 1.0 };
        let heights: Vec<Heights> = sample.iter().map(|signature| frame.heights(signature)).collect();
        let squares: f64 = heights.iter().flatten().map(|height| f64::from(height * height)).sum();
        let points: f64 = counts.iter().map(|count| f64::from(*count)).sum();
        frame.radius = (RADIUS * (squares / points.max(1.0)).sqrt() as f32).max(1.0);
        frame.axes = axes(&heights, frame.radius).into();
        let numbers: Vec<[f32; SIZE]> = heights.iter().map(|heights| frame.numbers(heights)).collect();
        let middle: [f32; SIZE] =
            std::array::from_fn(|k| numbers.iter().map(|n| n[k]).sum::<f32>() / numbers.len().max(1) as f32);
        frame.middle = vec![middle].into();
        let most = numbers.iter().flat_map(|n| n.iter().zip(&middle)).map(|(n, m)| (n - m).abs());
        frame.unit = most.fold(f32::MIN_POSITIVE, f32::max) / 127.0;
        frame
    }

    /// Whether it has a number for each point.
    pub fn is_sound(&self) -> bool {
        let counts = (self.mean.len(), self.axes.len(), self.middle.len());
        counts == (TEMPLATE_POINTS, 2 * TEMPLATE_POINTS, 1)
    }

    /// What a code is made from.
    pub fn heights(&self, signature: &DenseSignature) -> Heights {
        let (mut heights, mut sum, mut count) = ([0.0; TEMPLATE_POINTS], 0.0, 0.0);
        for (point, height) in seen(signature) {
            heights[point] = height - self.mean[point];
            sum += heights[point];
            count += 1.0;
        }
        for (point, _) in seen(signature) {
            heights[point] -= sum / f32::max(count, 1.0);
        }
        heights
    }

    fn numbers(&self, heights: &Heights) -> [f32; SIZE] {
        let mut numbers = [0f32; SIZE];
        let (cosines, sines) = self.axes.split_at(TEMPLATE_POINTS);
        for ((height, of_cosine), of_sine) in heights.iter().zip(cosines).zip(sines) {
            let (sine, cosine) = (height / self.radius).sin_cos();
            for ((number, c), s) in numbers.iter_mut().zip(of_cosine).zip(of_sine) {
                *number += self.radius * (cosine * c + sine * s);
            }
        }
        numbers
    }

    /// The code, and how far rounding moved it. Cutting off what is too great only brings codes nearer.
    pub fn code(&self, heights: &Heights) -> (Code, f32) {
        let (numbers, middle) = (self.numbers(heights), &self.middle[0]);
        let cut: [f32; SIZE] = std::array::from_fn(|k| ((numbers[k] - middle[k]) / self.unit).clamp(-127.0, 127.0));
        let rounding: f32 = cut.iter().map(|x| (x - x.round()).powi(2)).sum();
        (cut.map(|x| x.round() as i8), rounding.sqrt())
    }
}

/// Orthonormal axes along which points on the circles vary most.
fn axes(heights: &[Heights], radius: f32) -> Vec<[f32; SIZE]> {
    let mut lifted = DMatrix::from_fn(heights.len(), 2 * TEMPLATE_POINTS, |row, column| {
        let (sine, cosine) = (heights[row][column % TEMPLATE_POINTS] / radius).sin_cos();
        radius * if column < TEMPLATE_POINTS { cosine } else { sine }
    });
    for mut column in lifted.column_iter_mut() {
        column.add_scalar_mut(-column.mean());
    }
    principal_axes(&lifted, SIZE).row_iter().map(|row| std::array::from_fn(|k| row[k] as f32)).collect()
}

/// As columns, so many orthonormal axes along which rows about 0 vary most, by subspace iteration.
pub(super) fn principal_axes(rows: &DMatrix<f32>, count: usize) -> DMatrix<f64> {
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let mut axes = DMatrix::from_fn(rows.ncols(), count, |_, _| StandardNormal.sample(&mut rng));
    for _ in 0..ROUNDS {
        let next: DMatrix<f32> = rows.tr_mul(&(rows * axes.map(|x: f64| x as f32)));
        axes = next.map(f64::from).qr().q();
    }
    axes
}

fn seen(signature: &DenseSignature) -> impl Iterator<Item = (usize, f32)> {
    let heights = signature.to_bytes().map(|byte| byte as i8);
    heights.into_iter().enumerate().filter(|(_, h)| *h != UNSEEN).map(|(point, h)| (point, f32::from(h)))
}
