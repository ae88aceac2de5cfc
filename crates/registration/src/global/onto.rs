//! Some views refined as one body onto others that stand still, at full resolution.

use crate::joint::normal_equations::{NormalEquations, RIGID};
use crate::view::View;
use visage_geometry::neighbours::LocalPoint;
use visage_geometry::normals::{self, local_planes};
use visage_geometry::{Motion, Point3, Vector3, se3};

/// Points that are laid on the others.
const SAMPLES: usize = 600;
/// Search distances of the steps, in what the views resolve; the first also covers what surfels left over.
const REACHES: [f64; 6] = [8.0, 6.0, 4.0, 3.0, 3.0, 3.0];

/// Improves `world_from_piece`, the world of a body of `members` (each with its local frame's pose in the body), which is
/// laid on views that are `placed` in the world.
pub fn settled(
    views: &[View],
    placed: &[(usize, Motion)],
    members: &[(usize, Motion)],
    world_from_piece: &Motion,
    resolution: f64,
) -> Motion {
    let samples: Vec<Point3> = members
        .iter()
        .flat_map(|(view, pose)| {
            let points = views[*view].points();
            let step = points.len().div_ceil((SAMPLES / members.len()).max(1)).max(1);
            points.iter().step_by(step).map(move |point| pose * Point3::from(Vector3::from(point.map(f64::from))))
        })
        .collect();
    let mut world = *world_from_piece;
    for reach in REACHES.map(|reach| reach * resolution) {
        let mut sums = NormalEquations::<RIGID>::default();
        for (view, pose) in placed {
            add(&mut sums, &views[*view], pose, &samples, &world, reach);
        }
        let Some(twist) = sums.step() else { break };
        world = se3::exp(&twist) * world;
    }
    world
}

/// Adds what the samples near one placed view say, in the world.
fn add(sums: &mut NormalEquations<RIGID>, view: &View, pose: &Motion, samples: &[Point3], world: &Motion, reach: f64) {
    let (motion, reach2) = (pose.inv_mul(world), (reach * reach) as f32);
    let found: Vec<(Vector3, LocalPoint)> = samples
        .iter()
        .filter_map(|sample| {
            let moved = (motion * sample).coords;
            let near = view.indexed.tree.nearest(&moved.cast::<f32>().into(), reach2)?;
            Some((moved, view.points()[near.index as usize]))
        })
        .collect();
    let places: Vec<LocalPoint> = found.iter().map(|(_, place)| *place).collect();
    let planes = local_planes(&view.indexed, &places, normals::NEIGHBOURS);
    let scale2 = (0.5 * reach).powi(2);
    for ((moved, place), plane) in found.iter().zip(&planes) {
        let normal = nalgebra::Vector3::from(plane.normal).cast::<f64>();
        let residual = normal.dot(&(moved - nalgebra::Vector3::from(*place).cast::<f64>()));
        let robust = scale2 / (scale2 + residual * residual);
        let at = pose * Point3::from(*moved);
        sums.add(&(pose * normal), &at.coords, residual, robust * robust);
    }
}
