//! Code-made signatures by the million, distributed as extracted ones are.
//!
//! Some code-made heads and other shapes are described as any model is. A new model is one of them, stretched and
//! sheared a little, with some salient regions taken from another; its dense signature is drawn from the normal
//! distribution that has the mean and the covariances of the heads' ones (and 0.1 mm of noise a point), with the unseen
//! points of one of them. The descriptor of its shape goes a part of the way to another's.

use anyhow::Context;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;

use visage::descriptor::ShapeDescriptor;
use visage::faces::dense_signature::{DenseSignature, UNSEEN};
use visage::faces::detection::{Detection, FoundFace};
use visage::faces::template::TEMPLATE_POINTS;
use visage::faces::{self, Signature, Size, TriangleCandidate};
use visage::geometry::{Cloud, Mesh, Point3, Surface, Unit};
use visage::progress::Progress;
use visage::synthetic::head::{Proportions, head};
use visage::synthetic::shapes;

/// Heads that are described.
const HEADS: u64 = 24;
/// The share of models that are heads; the others are made from the other shapes.
const SHARE_OF_HEADS: f64 = 0.9;
/// Standard deviation of the entries of the matrix that stretches and shears a model.
const STRETCH: f64 = 0.04;
/// The share of salient regions that come from another model.
const SWAPPED: f64 = 0.15;
/// How far a shape goes to that of another model at most.
const MOST_OF_OTHER: f64 = 0.5;
/// Dense signatures mixed into one.
const MIXED: usize = 8;

/// What new models are made from.
pub struct Population {
    heads: Vec<Signature>,
    others: Vec<Signature>,
    /// Of the heads' dense signatures, in steps, unseen points left out; and what each head differs from it.
    mean: Vec<f64>,
    differences: Vec<Vec<f64>>,
    unseen: Vec<Vec<bool>>,
}

impl Population {
    /// Describes the heads and shapes.
    pub fn described() -> anyhow::Result<Population> {
        let heads: Vec<Mesh> = (0..HEADS).into_par_iter().map(|seed| head(&Proportions::of(seed)).mesh).collect();
        let others: Vec<Mesh> = shapes::catalogue().par_iter().step_by(3).map(|shape| shape.mesh(1)).collect();
        let described = |meshes: Vec<Mesh>| -> anyhow::Result<Vec<Signature>> {
            meshes.into_par_iter().map(|mesh| described(&mesh)).collect()
        };
        let (heads, others) = (described(heads)?, described(others)?);
        let steps = |s: &Signature| s.dense().map(|dense| dense.to_bytes().map(|byte| byte as i8));
        let heights: Vec<[i8; TEMPLATE_POINTS]> = heads.iter().filter_map(steps).collect();
        anyhow::ensure!(heights.len() >= 2, "no face was found on the code-made heads");
        let mean: Vec<f64> = (0..TEMPLATE_POINTS)
            .map(|point| {
                let seen = heights.iter().map(|h| h[point]).filter(|h| *h != UNSEEN).map(f64::from);
                let (sum, count) = seen.fold((0.0, 0usize), |(sum, count), h| (sum + h, count + 1));
                sum / count.max(1) as f64
            })
            .collect();
        let difference = |h: &[i8; TEMPLATE_POINTS]| -> Vec<f64> {
            h.iter().zip(&mean).map(|(h, mean)| if *h == UNSEEN { 0.0 } else { f64::from(*h) - mean }).collect()
        };
        let differences = heights.iter().map(difference).collect();
        let unseen = heights.iter().map(|h| h.iter().map(|h| *h == UNSEEN).collect()).collect();
        Ok(Population { heads, others, mean, differences, unseen })
    }

    /// The model with this number.
    pub fn model(&self, number: u64) -> Signature {
        let mut rng = ChaCha8Rng::seed_from_u64(number);
        let kind =
            if rng.random::<f64>() < SHARE_OF_HEADS || self.others.is_empty() { &self.heads } else { &self.others };
        let [base, other] = [0, 1].map(|_| &kind[rng.random_range(0..kind.len())]);
        let noise = |rng: &mut ChaCha8Rng| -> f64 { StandardNormal.sample(rng) };
        let deform = nalgebra::Matrix3::from_fn(|row, column| f64::from(row == column) + STRETCH * noise(&mut rng));
        let moved = |p: &Point3| Point3::from(deform * p.coords);
        let others: Vec<_> = other.regions().collect();
        let regions: Vec<_> = base
            .regions()
            .enumerate()
            .map(|(k, own)| {
                let swapped = others.get(k).filter(|_| rng.random::<f64>() < SWAPPED);
                let mut region = swapped.copied().unwrap_or(own);
                region.center = moved(&region.center);
                region
            })
            .collect();
        let candidates: Vec<TriangleCandidate> =
            base.candidates().map(|c| TriangleCandidate { corners: c.corners.map(|p| moved(&p)), ..c }).collect();
        let face = base.fit().zip(base.landmarks()).map(|(mut fit, landmarks)| {
            fit.residual_mm *= (0.15 * noise(&mut rng)).exp();
            FoundFace { fit, landmarks, dense: self.dense(&mut rng) }
        });
        let share = rng.random_range(0.0..MOST_OF_OTHER);
        let shape = base.shape().zip(other.shape()).map(|(base, other)| between(base, other, share, &mut rng));
        let size =
            Size { origin: Point3::origin(), diagonal: base.diagonal(), radius: base.radius(), unit: Unit::Unknown };
        Signature::new(&size, &regions, &Detection { candidates, face })
            .with_shape(shape)
            .with_views(base.views().to_vec())
    }

    fn dense(&self, rng: &mut ChaCha8Rng) -> DenseSignature {
        let mut heights = self.mean.clone();
        for _ in 0..MIXED {
            let weight: f64 = StandardNormal.sample(rng);
            let difference = &self.differences[rng.random_range(0..self.differences.len())];
            for (height, difference) in heights.iter_mut().zip(difference) {
                *height += weight / (MIXED as f64).sqrt() * difference;
            }
        }
        let unseen = &self.unseen[rng.random_range(0..self.unseen.len())];
        DenseSignature::from_bytes(std::array::from_fn(|point| {
            let noise: f64 = StandardNormal.sample(rng);
            let height = (heights[point] + noise).round().clamp(-127.0, 127.0) as i8;
            (if unseen[point] { UNSEEN } else { height }) as u8
        }))
    }
}

/// A shape that has gone a share of the way from one to another, with 1 step of noise.
fn between(one: &ShapeDescriptor, other: &ShapeDescriptor, share: f64, rng: &mut ChaCha8Rng) -> ShapeDescriptor {
    let (mut bytes, other) = (one.to_bytes(), other.to_bytes());
    for (byte, other) in bytes.iter_mut().zip(&other) {
        let noise: f64 = StandardNormal.sample(rng);
        *byte =
            (f64::from(*byte) + share * (f64::from(*other) - f64::from(*byte)) + noise).round().clamp(0.0, 255.0) as u8;
    }
    ShapeDescriptor::from_bytes(&bytes)
}

fn described(mesh: &Mesh) -> anyhow::Result<Signature> {
    let surface = Surface {
        cloud: Cloud { points: mesh.vertices.clone(), ..Cloud::default() },
        faces: mesh.faces.clone(),
        ..Surface::default()
    };
    faces::describe(&surface, Unit::Unknown, &Progress::silent()).context("a code-made shape can't be described")
}
