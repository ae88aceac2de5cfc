//! Free space: where a scanner saw a surface, there was nothing between it and the surface. A view that has surface
//! there lies wrong, or the other one does.

use rayon::prelude::*;

use crate::quality::limits;
use crate::sensor::Sensor;
use crate::sensor::looked_through::LookedThrough;
use crate::view::View;
use visage_geometry::neighbours::LocalPoint;
use visage_geometry::{Motion, Vector3};

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Sample points of a view, at most.
        samples: usize = 300,
    }
}

/// A view with surface where another looked through.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Intrusion {
    /// The view that has the surface.
    pub view: usize,
    /// The view that looked through it.
    pub seen_by: usize,
    /// Of the points that fall where the other saw something, the share in front of that.
    pub share: f64,
    /// How many points fell there.
    pub points: usize,
}

impl Intrusion {
    /// Whether it says something: more than noise at edges, and more than a few points.
    pub fn counts(&self) -> bool {
        self.points >= limits::LOOKED_THROUGH_POINTS && self.share > limits::LOOKED_THROUGH
    }
}

/// All pairs of placed views of which the second's scanner is known, with the share of free space.
///
/// `sensors` are positions in the views' local frames.
pub fn intrusions(
    views: &[View],
    sensors: &[Option<Vector3>],
    local_poses: &[Motion],
    placed: &[bool],
    spacing: f64,
) -> Vec<Intrusion> {
    let look = |j: usize| {
        let sensor = Sensor::At(sensors[j].filter(|_| placed[j])?);
        let look = LookedThrough::new(&views[j], &sensor, spacing);
        let others = (0..views.len()).filter(|&i| i != j && placed[i]);
        Some(others.map(|i| intrusion(&look, (i, j), &views[i], &local_poses[j].inv_mul(&local_poses[i]))).collect())
    };
    let found: Vec<Option<Vec<Intrusion>>> = (0..views.len()).into_par_iter().map(look).collect();
    found.into_iter().flatten().flatten().collect()
}

fn intrusion(look: &LookedThrough, (i, j): (usize, usize), view: &View, j_from_i: &Motion) -> Intrusion {
    let points: &[LocalPoint] = view.points();
    let (mut seen, mut free) = (0usize, 0usize);
    for point in points.iter().step_by(points.len().div_ceil(TUNING.samples).max(1)) {
        let place = j_from_i * nalgebra::Point3::from(*point).cast::<f64>();
        if let Some(is_free) = look.is_free(&place.coords.cast()) {
            seen += 1;
            free += usize::from(is_free);
        }
    }
    Intrusion { view: i, seen_by: j, share: free as f64 / seen.max(1) as f64, points: seen }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_geometry::{Cloud, Point3};

    fn sheet(z: f64) -> View {
        let points = (0..3600).map(|k| Point3::new(f64::from(k % 60) - 29.5, f64::from(k / 60) - 29.5, z));
        View::new(&Cloud::from_points(points.collect())).expect("a sheet can be used")
    }

    #[test]
    fn a_sheet_before_another_intrudes_and_one_behind_it_does_not() {
        let views = [sheet(0.0), sheet(20.0)];
        let poses: Vec<Motion> = views.iter().map(|view| view.local_pose(&Motion::identity())).collect();
        // the first view's scanner stands above both, the second's is not known
        let sensors = [Some(Vector3::new(0.0, 0.0, 300.0)), None];
        let found = intrusions(&views, &sensors, &poses, &[true; 2], 1.0);
        assert_eq!(found.len(), 1);
        assert_eq!((found[0].view, found[0].seen_by, found[0].share), (1, 0, 1.0));
        let below = [Some(Vector3::new(0.0, 0.0, -300.0)), None];
        let found = intrusions(&views, &below, &poses, &[true; 2], 1.0);
        assert!(found[0].points > 100 && found[0].share == 0.0, "{found:?}");
    }
}
