//! The last word on a join, at full resolution: like shapes lie near each other, only equal ones touch.

use super::onto::{Foot, feet, laid_on, spread};
use crate::quality::sharpness::NEAR;
use crate::view::View;
use visage_geometry::{Motion, Point3};

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Points of a view that are laid on the other.
        samples: usize = 300,
        /// A point has a counterpart if it lies no farther than this beside its nearest one, in spacings;
        beside: f64 = 2.0,
        /// it touches it if it lies no farther than this above or below.
        on: f64 = 1.0,
        /// it meets it if it lies no farther than this many times the noise of both scans,
        meeting_noise: f64 = 3.0,
        /// but this much, in spacings, is allowed in any case.
        meeting: f64 = 0.2,
    }
}

/// How two views lie on each other at full resolution.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contact {
    /// Maps view j's local frame into view i's, improved.
    pub i_from_j: Motion,
    /// Of the points of view j that lie near view i's surface, the share that touches it.
    pub touching: f64,
    /// The share that lies as near to it as the noise of the scans lets them.
    pub meeting: f64,
    /// Root mean square distance of those that touch, in the noise of both scans.
    pub rms_noise: f64,
}

/// How view j lies on view i; `None` if none of its points is near. `i_from_j` is improved first.
pub fn contact(i: &View, j: &View, i_from_j: &Motion, spacing: f64) -> Option<Contact> {
    let samples: Vec<Point3> = spread(j, TUNING.samples).collect();
    let motion = laid_on(&[(i, Motion::identity())], &samples, i_from_j, spacing);
    let heights = heights(i, &samples, &motion, spacing);
    let noise = i.range_accuracy.hypot(j.range_accuracy).max(f64::MIN_POSITIVE);
    let within = |limit: f64| heights.iter().filter(|height| **height < limit).count() as f64;
    let touching = within(TUNING.on * spacing);
    let squares: f64 =
        heights.iter().filter(|height| **height < TUNING.on * spacing).map(|height| height * height).sum();
    let near = heights.len() as f64;
    (near > 0.0).then(|| Contact {
        i_from_j: motion,
        touching: touching / near,
        meeting: within((TUNING.meeting_noise * noise).max(TUNING.meeting * spacing)) / near,
        rms_noise: (squares / touching.max(1.0)).sqrt() / noise,
    })
}

/// Distances from the surface of the samples that have a counterpart.
fn heights(view: &View, samples: &[Point3], motion: &Motion, spacing: f64) -> Vec<f64> {
    let height = |Foot { normal, offset, .. }: Foot| {
        let height = normal.dot(&offset).abs();
        // a point that lies beside its nearest one lies beyond a rim: it has no counterpart
        (offset.norm_squared() - height * height < (TUNING.beside * spacing).powi(2)).then_some(height)
    };
    feet(view, samples, motion, NEAR * spacing).into_iter().filter_map(height).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::global::fixture::Fixture;

    #[test]
    fn equal_surfaces_touch_like_ones_do_not_and_far_ones_say_nothing() {
        let fixture = Fixture::from_around(&[0.0, 40.0]);
        let (i, j) = (&fixture.views[0], &fixture.views[1]);
        let at = |motion: &Motion| contact(i, j, motion, i.spacing);
        let right = at(&fixture.i_from_j_off(0, 1, [0.2, -0.2, 0.1], [0.0; 3])).expect("they lie on each other");
        assert!(right.touching > 0.95 && right.rms_noise < 1.0, "{right:?}");
        // the far side of the ball laid on this one: bumps of the same size at other places
        let sides = Fixture::from_around(&[0.0, 180.0]);
        let turned = Motion::rotation(visage_geometry::Vector3::z() * std::f64::consts::PI);
        let like = contact(&sides.views[0], &sides.views[1], &turned, i.spacing).expect("they lie near each other");
        assert!(like.touching < 0.8, "{like:?}");
        assert_eq!(at(&Motion::translation(0.0, 0.0, 900.0)), None);
    }
}
