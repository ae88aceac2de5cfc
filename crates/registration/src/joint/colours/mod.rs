//! Colours hold views where their surface does not: a bottle turns in itself and a wall slides along itself, what is printed on
//! them does not.
//!
//! Each correspondence of two surfels has a second residual: how much brighter the one is than the other's texture at its place,
//! a plane over the tangent plane (coloured ICP; Park, Zhou and Koltun, "Colored point cloud registration revisited", ICCV 2017).
//! What is compared is relief, brightness beside its surroundings in the view's own unit, so that exposure and light say nothing.
//! Unlike there, no weight is chosen between both kinds of residuals: each counts in its own noise; and colours are only heard
//! about the motions that a pair's geometry leaves free (`weak`): elsewhere poses stay those of the surface.

mod texture;
mod weak;

use nalgebra::{Matrix6, Vector6};
use rayon::prelude::*;

use self::texture::{Shade, Texture};
use self::weak::Freedom;
use super::Run;
use super::refine::{KERNEL, LEAST_COSINE};
use super::surfels::{FineSurfels, Surfels};
use crate::least_squares::pose_system::{self, PoseSystem};
use crate::least_squares::robust_kernel::RobustKernel;
use crate::outcome::{MethodOptions, Outcome};
use crate::quality::colour::Brightness;
use crate::view::{View, common_spacing};
use visage_geometry::progress::{Canceled, Progress};
use visage_geometry::{Motion, Vector3, se3};

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Edges of the surfels of each pass, in those by which results are judged: textures are followed from as far as the first
        /// are wide, and to about a spacing by the last.
        edges: [f64; 3] = [3.0, 1.0, 0.4],
        /// Largest distance of a correspondence, in edges.
        reach: f64 = 1.0,
        /// Steps of a pass, at most.
        max_steps: usize = 30,
        /// A step that moves nothing farther, in edges, ends a pass.
        settled: f64 = 0.005,
        /// What colours cost has to fall below this share of what it was,
        better: f64 = 0.95,
        /// and what geometry costs may rise by this factor: surfels are not the same places in two views.
        no_worse: f64 = 1.1,
    }
}

/// The outcome with poses refined by colour along the motions that geometry leaves free. `None` if no motion is free, fewer
/// than two views have colours, or colours do not agree better at the refined poses. Views without colours are `None` in
/// `brightness`.
pub fn by_colours(
    views: &[View],
    brightness: &[Option<Brightness>],
    result: &Outcome,
    progress: &Progress,
) -> Result<Option<Outcome>, Canceled> {
    let Some(judged) = &result.surfels else { return Ok(None) };
    if brightness.iter().flatten().count() < 2 {
        return Ok(None);
    }
    let middle = Motion::from(nalgebra::Translation3::from(middle(result)));
    let before: Vec<Motion> = result.local_poses.iter().map(|pose| middle.inverse() * pose).collect();
    let mut poses = before.clone();
    let mut is_better = false;
    for share in TUNING.edges {
        progress.check()?;
        let Some(pass) = Colouring::new(views, brightness, result, judged, &poses, share) else { return Ok(None) };
        let Some(refined) = pass.refined(&poses, progress)? else { return Ok(None) };
        is_better = pass.is_better(&before, &refined);
        poses = refined;
    }
    if !is_better {
        return Ok(None);
    }
    let mut found = result.clone();
    found.local_poses = poses.iter().map(|pose| middle * pose).collect();
    for pair in &mut found.pairs {
        pair.i_from_j = found.local_poses[pair.i].inv_mul(&found.local_poses[pair.j]);
    }
    let options = MethodOptions::default();
    let run = Run { options: &options, fixed: &[], spacing: common_spacing(views), max_steps: 0, progress };
    run.measure_pairs(views, &judged.views, &mut found)?;
    Ok(Some(found))
}

fn middle(result: &Outcome) -> Vector3 {
    let placed = || result.local_poses.iter().zip(&result.placed).filter(|(_, placed)| **placed);
    placed().map(|(pose, _)| pose.translation.vector).sum::<Vector3>() / placed().count().max(1) as f64
}

/// Two surfels that may show one place: what geometry and colours say of them, in the world about the middle.
struct Correspondence {
    place: Vector3,
    /// Of view a's and of view b's patch, of one sign.
    normals: [Vector3; 2],
    /// The distance along the normal between both.
    distance: f64,
    /// How colours change with a's place along the surface, and how much brighter b is there than a.
    shades: Option<(Vector3, f64)>,
}

impl Correspondence {
    fn normal(&self) -> Vector3 {
        (self.normals[0] + self.normals[1]).normalize()
    }
}

/// The sums of one kind of residuals of a directed pair.
struct Sums {
    information: Matrix6<f64>,
    gradient: Vector6<f64>,
    cost: f64,
    weight: f64,
}

/// How the distance along `direction` of a point at `place` changes with a left twist of its view.
fn row(direction: &Vector3, place: &Vector3) -> Vector6<f64> {
    let turn = place.cross(direction);
    Vector6::new(direction.x, direction.y, direction.z, turn.x, turn.y, turn.z)
}

fn summed(residuals: impl Iterator<Item = (Vector6<f64>, f64)>, scale2: f64) -> Sums {
    let kernel = RobustKernel::with_squared_scale(scale2);
    let mut sums = Sums { information: Matrix6::zeros(), gradient: Vector6::zeros(), cost: 0.0, weight: 0.0 };
    for (row, residual) in residuals {
        let weight = kernel.weight(residual);
        sums.information += weight * row * row.transpose();
        sums.gradient += row * (weight * residual);
        sums.cost += weight * residual * residual;
        sums.weight += weight;
    }
    sums
}

/// A pass: surfels of one edge with their textures, and what each pair leaves free at the beginning.
struct Colouring {
    surfels: Vec<Surfels>,
    textures: Vec<Option<Texture>>,
    /// Directed pairs, both ways one after the other.
    pairs: Vec<(usize, usize)>,
    /// For each two of these what geometry leaves free, where both views have a texture.
    freedoms: Vec<Option<Freedom>>,
    columns: Vec<Option<usize>>,
    edge: f64,
}

impl Colouring {
    /// `None` if no pair with textures is free.
    fn new(
        views: &[View],
        brightness: &[Option<Brightness>],
        result: &Outcome,
        judged: &FineSurfels,
        poses: &[Motion],
        share: f64,
    ) -> Option<Self> {
        let edge = share * judged.edge;
        let pairs: Vec<(usize, usize)> = result
            .pairs
            .iter()
            .filter(|pair| result.placed[pair.i] && result.placed[pair.j])
            .flat_map(|pair| [(pair.i, pair.j), (pair.j, pair.i)])
            .collect();
        let surfels = |(view, judged): (&View, &Surfels)| match share {
            1.0 => judged.clone(),
            share if share > 1.0 => judged.thinned(edge),
            _ => Surfels::new(view, edge),
        };
        let surfels: Vec<Surfels> = views.par_iter().zip(&judged.views).map(surfels).collect();
        let texture = |view: usize| Texture::new(&views[view], brightness[view].as_deref()?, &surfels[view], edge);
        let textures: Vec<Option<Texture>> = (0..views.len()).map(texture).collect();
        let first = pairs.iter().map(|pair| pair.0).min();
        let columns = pose_system::columns::<6>(views.len(), |view| {
            Some(view) != first && pairs.iter().any(|pair| pair.0 == view)
        });
        let mut colouring = Colouring { surfels, textures, pairs, freedoms: Vec::new(), columns, edge };
        let found = colouring.correspondences(poses);
        colouring.freedoms = (0..found.len() / 2).map(|pair| colouring.freedom(pair, &found)).collect();
        colouring.freedoms.iter().any(Option::is_some).then_some(colouring)
    }

    /// What the geometry of a pair leaves free, if both views have a texture.
    fn freedom(&self, pair: usize, found: &[Vec<Correspondence>]) -> Option<Freedom> {
        let (i, j) = self.pairs[2 * pair];
        let _ = (self.textures[i].as_ref()?, self.textures[j].as_ref()?);
        Freedom::of(found[2 * pair..2 * pair + 2].iter().flatten().map(|c| (c.normals, c.place)))
    }

    fn correspondences(&self, poses: &[Motion]) -> Vec<Vec<Correspondence>> {
        self.pairs.par_iter().with_max_len(1).map(|&pair| self.between(pair, poses)).collect()
    }

    fn between(&self, (a, b): (usize, usize), poses: &[Motion]) -> Vec<Correspondence> {
        let (from, onto) = (&self.surfels[a], &self.surfels[b]);
        let b_from_a = poses[b].inv_mul(&poses[a]).cast::<f32>();
        let reach2 = (TUNING.reach * self.edge).powi(2) as f32;
        let vector = |v: [f32; 3]| nalgebra::Vector3::from(v).cast::<f64>();
        let ask = |&index: &u32| {
            let index = index as usize;
            let moved = b_from_a * nalgebra::Point3::from(from.indexed.points[index]);
            let target = onto.indexed.tree.nearest(&moved.coords.into(), reach2)?.index as usize;
            let normal_a = poses[a].rotation * vector(from.normals[index]);
            let normal_b = poses[b].rotation * vector(onto.normals[target]);
            let cosine = normal_a.dot(&normal_b);
            if !onto.is_inner[target] || from.likeness(index, onto, target, cosine) <= f64::from(LEAST_COSINE) {
                return None;
            }
            let normals = [normal_a * cosine.signum(), normal_b];
            let place = (poses[a] * nalgebra::Point3::from(vector(from.indexed.points[index]))).coords;
            let counterpart = (poses[b] * nalgebra::Point3::from(vector(onto.indexed.points[target]))).coords;
            let offset = place - counterpart;
            let shades = self.shades((a, index), (b, target), poses, &offset);
            let mut found = Correspondence { place, normals, distance: 0.0, shades };
            found.distance = found.normal().dot(&offset);
            Some(found)
        };
        from.inner.iter().filter_map(ask).collect()
    }

    /// What colours say where surfel a lies by `offset` from surfel b: the mean of both slopes, and how much brighter b's
    /// texture is.
    fn shades(
        &self,
        (a, index): (usize, usize),
        (b, target): (usize, usize),
        poses: &[Motion],
        offset: &Vector3,
    ) -> Option<(Vector3, f64)> {
        let shade = |view: usize, place: usize| -> Option<Shade> { self.textures[view].as_ref()?.0[place] };
        let (own, other) = (shade(a, index)?, shade(b, target)?);
        let slope = |shade: &Shade, view: usize| poses[view].rotation * shade.slope.cast::<f64>();
        // what both slopes say of the place between both surfels is exact to second order
        let slope = 0.5 * (slope(&own, a) + slope(&other, b));
        Some((slope, f64::from(other.relief - own.relief) + slope.dot(offset)))
    }

    /// The poses at which both kinds of residuals cost least; `None` if nothing holds them.
    fn refined(&self, poses: &[Motion], progress: &Progress) -> Result<Option<Vec<Motion>>, Canceled> {
        let mut poses = poses.to_vec();
        let mut scales2 = [self.edge * self.edge, f64::MAX];
        for _ in 0..TUNING.max_steps {
            progress.check()?;
            let found = self.correspondences(&poses);
            let sums: Vec<[Sums; 2]> = found.par_iter().map(|found| self.sums(found, &scales2)).collect();
            let variances = variances(&sums);
            let Some(twists) = self.solved(&sums, &variances) else { return Ok(None) };
            let mut largest = 0.0f64;
            for (view, (pose, twist)) in poses.iter_mut().zip(&twists).enumerate() {
                let turn = twist.fixed_rows::<3>(3).norm();
                let reach = pose.translation.vector.norm() + self.surfels[view].radius;
                largest = largest.max(twist.fixed_rows::<3>(0).norm() + turn * reach);
                *pose = se3::exp(twist) * *pose;
            }
            for (scale2, variance) in scales2.iter_mut().zip(variances) {
                *scale2 = scale2.min(KERNEL * KERNEL * variance).max(f64::MIN_POSITIVE);
            }
            if largest < TUNING.settled * self.edge {
                break;
            }
        }
        Ok(Some(poses))
    }

    /// Of geometry and of colours.
    fn sums(&self, found: &[Correspondence], scales2: &[f64; 2]) -> [Sums; 2] {
        let geometry = found.iter().map(|c| (row(&c.normal(), &c.place), c.distance));
        let colours = found.iter().filter_map(|c| c.shades.map(|(slope, residual)| (row(&slope, &c.place), residual)));
        [summed(geometry, scales2[0]), summed(colours, scales2[1])]
    }

    /// One Gauss-Newton step: the twist of each view.
    fn solved(&self, sums: &[[Sums; 2]], variances: &[f64; 2]) -> Option<Vec<Vector6<f64>>> {
        let mut system = PoseSystem::<6, 1>::new(&self.columns)?;
        for (index, ([geometry, colours], pair)) in sums.iter().zip(&self.pairs).enumerate() {
            let (mut information, mut gradient) =
                (geometry.information / variances[0], geometry.gradient / variances[0]);
            if let Some(Freedom { free, held }) = &self.freedoms[index / 2] {
                information = held.transpose() * information * held
                    + free.transpose() * (colours.information / variances[1]) * free;
                gradient = held.transpose() * gradient + free.transpose() * colours.gradient / variances[1];
            }
            system.add(*pair, &information, &gradient);
        }
        system.damped().solve()
    }

    /// Whether colours agree better at other poses, and surfaces as well as before.
    fn is_better(&self, before: &[Motion], after: &[Motion]) -> bool {
        let [old, new] = [before, after].map(|poses| self.correspondences(poses));
        let variances =
            variances(&new.iter().map(|found| self.sums(found, &[self.edge * self.edge, 1.0])).collect::<Vec<_>>());
        let scales2 = variances.map(|variance| (KERNEL * KERNEL * variance).max(f64::MIN_POSITIVE));
        let costs = |found: &[Vec<Correspondence>]| {
            let (mut costs, mut counts) = ([0.0; 2], [0.0; 2]);
            for (index, c) in found.iter().enumerate().flat_map(|(index, found)| found.iter().map(move |c| (index, c)))
            {
                let capped = |residual: f64, scale2: f64| residual * residual / (scale2 + residual * residual);
                (costs[0], counts[0]) = (costs[0] + capped(c.distance, scales2[0]), counts[0] + 1.0);
                if let Some((_, residual)) = c.shades.filter(|_| self.freedoms[index / 2].is_some()) {
                    (costs[1], counts[1]) = (costs[1] + capped(residual, scales2[1]), counts[1] + 1.0);
                }
            }
            [costs[0] / f64::max(counts[0], 1.0), costs[1] / f64::max(counts[1], 1.0)]
        };
        let (old, new) = (costs(&old), costs(&new));
        new[0] <= TUNING.no_worse * old[0] && new[1] < TUNING.better * old[1]
    }
}

/// The mean squared residuals of geometry and of colours, as far as they are believed.
fn variances(sums: &[[Sums; 2]]) -> [f64; 2] {
    [0, 1].map(|kind| {
        let (cost, weight) = sums.iter().fold((0.0, 0.0), |(c, w), sums| (c + sums[kind].cost, w + sums[kind].weight));
        (cost / f64::max(weight, f64::MIN_POSITIVE)).max(f64::MIN_POSITIVE)
    })
}
