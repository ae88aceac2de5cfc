//! Views of which nobody knows from which side they were seen, on things that have thin walls.
//!
//! Where the side is known the two faces of a wall are kept apart. A view without a side is free to lie on either face,
//! or partly on both: then what others saw of the surface it lies on faces one way here and the other way there.

use rayon::prelude::*;

use crate::joint::surfels::FineSurfels;
use crate::outcome::Outcome;

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Surfels of a view that are asked, at most.
        samples: usize = 400,
        /// Seen more from the side than this cosine, the axis is too rough to tell a surfel's side.
        grazing: f32 = 0.25,
        /// Surfaces with a smaller cosine between their normals are not the same, nor two faces of one wall.
        alike: f32 = 0.5,
        /// So many counterparts make a share.
        least: usize = 40,
    }
}

/// For each view the share of its counterparts that face the rarer of both ways, 0 to 0.5; `None` where its side is
/// known, or no view whose side is known lies near.
pub fn mixed_faces(result: &Outcome, surfels: &FineSurfels) -> Vec<Option<f64>> {
    (0..surfels.views.len()).into_par_iter().map(|view| mixed(result, surfels, view)).collect()
}

fn mixed(result: &Outcome, surfels: &FineSurfels, view: usize) -> Option<f64> {
    let own = &surfels.views[view];
    if !result.placed[view] || own.has_side() {
        return None;
    }
    let axis = own.viewing_axis();
    let step = own.inner.len().div_ceil(TUNING.samples).max(1);
    let reach2 = (surfels.reach * surfels.reach) as f32;
    let mut counts = [0usize; 2];
    let others = surfels.views.iter().enumerate();
    for (other, seen) in others.filter(|(other, seen)| {
        *other != view && result.placed[*other] && result.overlaps.directed(view, *other) > 0.0 && seen.has_side()
    }) {
        let motion = result.local_poses[other].inv_mul(&result.local_poses[view]).cast::<f32>();
        for index in own.inner.iter().step_by(step).map(|index| *index as usize) {
            let normal = nalgebra::Vector3::from(own.normals[index]);
            let facing = normal.dot(&axis);
            if facing.abs() < TUNING.grazing {
                continue;
            }
            let place = motion * nalgebra::Point3::from(own.indexed.points[index]);
            let Some(found) = seen.indexed.tree.nearest(&place.coords.into(), reach2) else { continue };
            let target = found.index as usize;
            let cosine =
                (motion.rotation * normal).dot(&nalgebra::Vector3::from(seen.normals[target])) * facing.signum();
            if seen.is_sided[target] && cosine.abs() > TUNING.alike {
                counts[usize::from(cosine > 0.0)] += 1;
            }
        }
    }
    let all = counts[0] + counts[1];
    (all >= TUNING.least).then(|| counts[0].min(counts[1]) as f64 / all as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::joint::judged_surfels;
    use crate::overlap::OverlapMatrix;
    use crate::sensor::Sensor;
    use crate::view::View;
    use visage_geometry::{Cloud, Motion, Point3, Vector3};

    /// A square of 60 mm about `(center, 0, z)`.
    fn plate(center: f64, z: f64, toward: Option<f64>) -> View {
        let points = (0..3600).map(|k| Point3::new(f64::from(k % 60) - 29.5 + center, f64::from(k / 60) - 29.5, z));
        let mut view = View::new(&Cloud::from_points(points.collect())).expect("a sound scan");
        view.sensor = toward.map(|toward| Sensor::Toward(Vector3::z() * toward));
        view
    }

    fn mixed_of_last(views: &[View]) -> Option<f64> {
        let poses: Vec<Motion> = views.iter().map(|view| view.local_pose(&Motion::identity())).collect();
        let overlaps = OverlapMatrix::from_rows(vec![vec![1.0; views.len()]; views.len()]);
        let result = Outcome { overlaps, ..Outcome::at(&poses) };
        *mixed_faces(&result, &judged_surfels(views)).last().expect("one a view")
    }

    #[test]
    fn a_view_on_both_faces_of_a_wall_is_mixed() {
        let (front, back) = (plate(-30.0, 1.0, Some(1.0)), plate(30.0, -1.0, Some(-1.0)));
        let mixed = mixed_of_last(&[front, back, plate(0.0, 0.0, None)]).expect("two views lie near");
        assert!(mixed > 0.4, "{mixed}");
    }

    #[test]
    fn a_view_on_one_face_is_not() {
        let (left, right) = (plate(-30.0, 0.0, Some(1.0)), plate(30.0, 0.0, Some(1.0)));
        assert_eq!(mixed_of_last(&[left, right, plate(0.0, 0.0, None)]), Some(0.0));
    }

    #[test]
    fn a_view_whose_side_is_known_is_not_asked() {
        assert_eq!(mixed_of_last(&[plate(0.0, 1.0, Some(1.0)), plate(0.0, -1.0, Some(-1.0))]), None);
    }
}
