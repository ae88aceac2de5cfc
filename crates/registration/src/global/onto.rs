//! Bodies laid onto views that stand still, at full resolution.

use crate::least_squares::descent::descend;
use crate::least_squares::robust_kernel::RobustKernel;
use crate::view::View;
use visage_geometry::neighbours::LocalPoint;
use visage_geometry::normals::{self, local_planes};
use visage_geometry::{Motion, Point3, Vector3};

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Points of a body of several views that are laid on the others.
        samples: usize = 600,
        /// Search distances of the steps, in what the views resolve; the first also covers what surfels left over.
        reaches: [f64; 5] = [8.0, 6.0, 4.0, 3.0, 3.0],
    }
}

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
        .flat_map(|(view, pose)| spread(&views[*view], TUNING.samples / members.len()).map(move |point| pose * point))
        .collect();
    let placed: Vec<(&View, Motion)> = placed.iter().map(|(view, pose)| (&views[*view], *pose)).collect();
    laid_on(&placed, &samples, world_from_piece, resolution)
}

/// Some `count` points of a view, spread along its order.
pub fn spread(view: &View, count: usize) -> impl Iterator<Item = Point3> + '_ {
    let points = view.points();
    let step = points.len().div_ceil(count.max(1)).max(1);
    points.iter().step_by(step).map(|point| Point3::from(point.map(f64::from)))
}

/// Improves `start`, which maps `samples` into the world of the views that are `placed`.
pub fn laid_on(placed: &[(&View, Motion)], samples: &[Point3], start: &Motion, resolution: f64) -> Motion {
    descend(start, TUNING.reaches.map(|reach| reach * resolution), |motion, reach, sums| {
        let kernel = RobustKernel::within(reach);
        for (view, pose) in placed {
            for Foot { place, normal, offset } in feet(view, samples, &pose.inv_mul(motion), reach) {
                let residual = normal.dot(&offset);
                sums.add(&(pose * normal), &(pose * place).coords, residual, kernel.weight(residual));
            }
        }
    })
}

/// A moved sample before the surface of a view.
pub struct Foot {
    /// Where the sample is, in the view's local frame.
    pub place: Point3,
    /// The surface's normal at the view's point that is nearest to it.
    pub normal: Vector3,
    /// From that point to the sample.
    pub offset: Vector3,
}

/// The samples that have a point of the view within `reach`, moved into its local frame.
pub fn feet(view: &View, samples: &[Point3], motion: &Motion, reach: f64) -> Vec<Foot> {
    let reach2 = (reach * reach) as f32;
    let (moved, nearest): (Vec<Point3>, Vec<LocalPoint>) = samples
        .iter()
        .filter_map(|sample| {
            let moved = motion * sample;
            let near = view.indexed.tree.nearest(&moved.coords.cast::<f32>().into(), reach2)?;
            Some((moved, view.points()[near.index as usize]))
        })
        .unzip();
    let planes = local_planes(&view.indexed, &nearest, normals::NEIGHBOURS);
    let vector = |v: [f32; 3]| nalgebra::Vector3::from(v).cast::<f64>();
    let foot = |((place, nearest), plane): ((Point3, LocalPoint), &normals::LocalPlane)| Foot {
        place,
        normal: vector(plane.normal),
        offset: place.coords - vector(nearest),
    };
    moved.into_iter().zip(nearest).zip(&planes).map(foot).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::global::fixture::Fixture;

    #[test]
    fn a_body_of_two_views_settles_on_those_that_stand() {
        let fixture = Fixture::from_around(&[0.0, 40.0, 80.0, 120.0]);
        let pose = |view: usize| fixture.i_from_j(0, view);
        let placed = [(0, pose(0)), (3, pose(3))];
        let members = [(1, pose(1)), (2, pose(2))];
        let spacing = fixture.views[0].spacing;
        let off = Motion::new(Vector3::new(1.0, 0.5, -1.0), Vector3::new(0.0, 0.0, 0.03));
        let settled = settled(&fixture.views, &placed, &members, &off, spacing);
        assert!(settled.translation.vector.norm() < 0.1 * spacing && settled.rotation.angle() < 0.003, "{settled}");
    }

    #[test]
    fn points_are_spread_over_the_view() {
        let fixture = Fixture::from_around(&[0.0]);
        let count = spread(&fixture.views[0], 100).count();
        assert!((90..=100).contains(&count), "{count}");
        assert_eq!(spread(&fixture.views[0], 0).count(), 1);
    }
}
