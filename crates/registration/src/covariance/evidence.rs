//! What holds the views together at given poses: the correspondences of all pairs, as sums over pieces of surface.

use nalgebra::{Matrix6, Vector6};
use rayon::prelude::*;

use super::jackknife::Held;
use crate::joint::refine::{KERNEL, LEAST_COSINE};
use crate::joint::surfels::Surfels;
use crate::least_squares::robust_kernel::RobustKernel;
use visage_geometry::{Motion, Vector3};

/// A piece of surface: a cubic cell of the world.
pub type Cell = [i32; 3];

/// A surfel of view a that has a counterpart among those of view b: all that is kept of the correspondences of all
/// pairs at once.
struct Match {
    index: u32,
    target: u32,
    residual: f64,
}

/// What a correspondence says: `residual = normal . (p_a - p_b)` at `place`, in the world about some middle.
struct Correspondence {
    /// Unit normals of view a's and view b's patch, of one sign.
    normals: [Vector3; 2],
    /// The unit vector between the two.
    normal: Vector3,
    place: Vector3,
    residual: f64,
}

/// By which the distance along `normal` of a point at `place` changes with a left twist of its view; with one of the
/// other view it changes by the opposite.
fn row(normal: &Vector3, place: &Vector3) -> Vector6<f64> {
    let turn = place.cross(normal);
    Vector6::new(normal.x, normal.y, normal.z, turn.x, turn.y, turn.z)
}

/// The correspondences of one directed pair, summed cell by cell.
pub struct PairEvidence {
    /// The view whose surfels ask.
    pub a: usize,
    /// The view whose surfels answer.
    pub b: usize,
    /// Sum of `w J J'`.
    pub information: Matrix6<f64>,
    /// The information without what noise of the normals adds to it: one normal from each view,
    /// `w (J_a J_b' + J_b J_a') / 2`.
    pub clean: Matrix6<f64>,
    /// Sums of `w J r` over the correspondences in a cell, in the order of the cells.
    pub gradients: Vec<(Cell, Vector6<f64>)>,
    /// Sum of `w`.
    pub weight: f64,
    /// Sum of the derivative of `w r` by r, less than `w`: the farther off, the less a residual is believed.
    pub slope: f64,
}

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// The scale follows from the residuals and the weights from the scale: settled after so many rounds.
        scale_rounds: usize = 3,
    }
}

/// The correspondences of directed pairs, and how residuals are believed.
pub struct Correspondences<'a> {
    surfels: &'a [Surfels],
    poses: &'a [Motion],
    pairs: &'a [(usize, usize)],
    found: Vec<Vec<Match>>,
    kernel: RobustKernel<f64>,
}

impl<'a> Correspondences<'a> {
    /// Of the directed `pairs` at `poses` (local frame to world about its middle), up to `distance`.
    pub fn search(surfels: &'a [Surfels], poses: &'a [Motion], pairs: &'a [(usize, usize)], distance: f64) -> Self {
        let between = |&(a, b): &(usize, usize)| Between { a: (&surfels[a], &poses[a]), b: (&surfels[b], &poses[b]) };
        let found: Vec<Vec<Match>> = pairs.par_iter().map(|pair| between(pair).matches(distance)).collect();
        let kernel = RobustKernel::with_squared_scale(robust_scale2(&found, distance));
        Correspondences { surfels, poses, pairs, found, kernel }
    }

    fn between(&self, (a, b): (usize, usize)) -> Between<'_> {
        Between { a: (&self.surfels[a], &self.poses[a]), b: (&self.surfels[b], &self.poses[b]) }
    }

    /// Their sums by pair and by cell of edge `cell`.
    pub fn by_pair(&self, cell: f64) -> Vec<PairEvidence> {
        let pairs = self.pairs.par_iter().zip(&self.found);
        pairs.map(|(pair, found)| self.between(*pair).summed(*pair, found, &self.kernel, cell)).collect()
    }

    /// All that a view takes part in, for twists of it about `center`.
    pub fn of_view(&self, view: usize, center: &Vector3) -> Vec<Held> {
        let mut held = Vec::new();
        for (&(a, b), found) in self.pairs.iter().zip(&self.found).filter(|((a, b), _)| *a == view || *b == view) {
            let sign = if a == view { 1.0 } else { -1.0 };
            let between = self.between((a, b));
            held.extend(found.iter().filter_map(|found| between.correspondence(found.index, found.target)).map(|c| {
                Held {
                    place: c.place,
                    row: row(&c.normal, &(c.place - center)) * sign,
                    weight: self.kernel.weight(c.residual),
                    residual: c.residual,
                }
            }));
        }
        held
    }
}

/// Two views at their poses: the first asks, the second answers.
struct Between<'a> {
    a: (&'a Surfels, &'a Motion),
    b: (&'a Surfels, &'a Motion),
}

impl Between<'_> {
    fn matches(&self, distance: f64) -> Vec<Match> {
        let ((a, pose_a), (b, pose_b)) = (self.a, self.b);
        let b_from_a = pose_b.inv_mul(pose_a).cast::<f32>();
        let distance2 = (distance * distance) as f32;
        let ask = |&index: &u32| {
            let moved = (b_from_a * nalgebra::Point3::from(a.indexed.points[index as usize])).coords;
            let target = b.indexed.tree.nearest(&moved.into(), distance2)?.index;
            let residual = self.correspondence(index, target)?.residual;
            Some(Match { index, target, residual })
        };
        a.inner.iter().filter_map(ask).collect()
    }

    /// What surfel `index` of the first and surfel `target` of the second say, if they can be of one surface.
    fn correspondence(&self, index: u32, target: u32) -> Option<Correspondence> {
        let ((a, pose_a), (b, pose_b)) = (self.a, self.b);
        let (index, target) = (index as usize, target as usize);
        let vector = |v: [f32; 3]| nalgebra::Vector3::from(v).cast::<f64>();
        let normal_a = pose_a.rotation * vector(a.normals[index]);
        let normal_b = pose_b.rotation * vector(b.normals[target]);
        let cosine = normal_a.dot(&normal_b);
        if !b.is_inner[target] || a.likeness(index, b, target, cosine) <= f64::from(LEAST_COSINE) {
            return None;
        }
        let normal_a = normal_a * cosine.signum();
        let normal = (normal_b + normal_a).normalize();
        let place = pose_a * nalgebra::Point3::from(vector(a.indexed.points[index]));
        let counterpart = pose_b * nalgebra::Point3::from(vector(b.indexed.points[target]));
        let residual = normal.dot(&(place - counterpart));
        Some(Correspondence { normals: [normal_a, normal_b], normal, place: place.coords, residual })
    }

    fn summed(&self, (a, b): (usize, usize), found: &[Match], kernel: &RobustKernel<f64>, cell: f64) -> PairEvidence {
        let (information, clean) = (Matrix6::zeros(), Matrix6::zeros());
        let mut evidence = PairEvidence { a, b, information, clean, gradients: Vec::new(), weight: 0.0, slope: 0.0 };
        let mut ordered: Vec<(Cell, Correspondence)> = found
            .iter()
            .filter_map(|found| self.correspondence(found.index, found.target))
            .map(|c| (c.place.map(|x| (x / cell).floor() as i32).into(), c))
            .collect();
        ordered.sort_by_key(|(cell, _)| *cell);
        for in_cell in ordered.chunk_by(|a, b| a.0 == b.0) {
            let mut gradient = Vector6::zeros();
            for (_, correspondence) in in_cell {
                let weight = kernel.weight(correspondence.residual);
                let [row, row_a, row_b] =
                    [&correspondence.normal, &correspondence.normals[0], &correspondence.normals[1]]
                        .map(|normal| row(normal, &correspondence.place));
                gradient += row * (weight * correspondence.residual);
                evidence.information += weight * row * row.transpose();
                evidence.clean += 0.5 * weight * (row_a * row_b.transpose() + row_b * row_a.transpose());
                evidence.weight += weight;
                evidence.slope += kernel.slope(correspondence.residual);
            }
            evidence.gradients.push((in_cell[0].0, gradient));
        }
        evidence
    }
}

fn robust_scale2(found: &[Vec<Match>], distance: f64) -> f64 {
    let mut scale2 = distance * distance;
    for _ in 0..TUNING.scale_rounds {
        let kernel = RobustKernel::with_squared_scale(scale2);
        let sums = found.iter().flatten().fold((0.0, 0.0), |(cost, weight), c| {
            let w = kernel.weight(c.residual);
            (cost + w * c.residual * c.residual, weight + w)
        });
        scale2 = scale2.min(KERNEL * KERNEL * sums.0 / f64::max(sums.1, f64::MIN_POSITIVE)).max(f64::MIN_POSITIVE);
    }
    scale2
}
