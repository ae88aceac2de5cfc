//! A bumpy ball scanned from around, for the tests of this folder: its views, where they lie, and what pairs say of motions.

use super::coarse_set::CoarseSet;
use super::coarse_view::CoarseView;
use super::pair_hypothesis::PairHypothesis;
use super::verification::verify;
use crate::sensor::Sensor;
use crate::view::View;
use visage_geometry::{Cloud, Motion, Point3, Vector3};

/// Edge of the surfels' voxels.
pub const EDGE: f64 = 3.0;
/// Surfels that are queried of a motion.
const SAMPLES: usize = 400;

/// Views of one object in one world, from scanners far off.
pub struct Fixture {
    /// The views,
    pub views: Vec<View>,
    /// and their coarse views.
    pub coarse_views: Vec<CoarseView>,
}

impl Fixture {
    /// From these directions around the object, in degrees.
    pub fn from_around(directions: &[f64]) -> Fixture {
        let toward = |degrees: &f64| Vector3::new(degrees.to_radians().cos(), degrees.to_radians().sin(), 0.0);
        let directions: Vec<Vector3> = directions.iter().map(toward).collect();
        let views: Vec<View> = directions.iter().map(seen).collect();
        let sensors = directions.iter().map(|direction| Some(Sensor::Toward(*direction)));
        let coarse_views =
            views.iter().zip(sensors).map(|(view, sensor)| CoarseView::new(view, EDGE, sensor)).collect();
        Fixture { views, coarse_views }
    }

    /// As global registration sees them.
    pub fn coarse_set(&self) -> CoarseSet<'_> {
        let (views, coarse_views) = (&self.views, &self.coarse_views);
        CoarseSet { views, coarse_views, resolution: self.views[0].spacing, edge: EDGE, noise: 0.05 }
    }

    /// The true motion of a pair: all views lie in one world, about their own middles.
    pub fn i_from_j(&self, i: usize, j: usize) -> Motion {
        Motion::from(nalgebra::Translation3::from(self.views[j].center - self.views[i].center))
    }

    /// The true motion, off by a shift and a turn (rotation vector) in view i's frame.
    pub fn i_from_j_off(&self, i: usize, j: usize, shift: [f64; 3], turn: [f64; 3]) -> Motion {
        Motion::new(shift.into(), turn.into()) * self.i_from_j(i, j)
    }

    /// What the surfaces say of a motion.
    pub fn hypothesis(&self, i: usize, j: usize, i_from_j: Motion) -> PairHypothesis {
        let evidence = verify(&self.coarse_views[i], &self.coarse_views[j], &i_from_j, EDGE, SAMPLES);
        PairHypothesis { i, j, i_from_j, evidence }
    }

    /// What they say of the true one.
    pub fn right(&self, i: usize, j: usize) -> PairHypothesis {
        self.hypothesis(i, j, self.i_from_j(i, j))
    }

    /// How far a motion of a pair is off, at the middle of view j.
    pub fn off(&self, i: usize, j: usize, found: &Motion) -> f64 {
        (found.translation.vector - self.i_from_j(i, j).translation.vector).norm()
    }
}

/// What is seen of the ball from far away.
fn seen(direction: &Vector3) -> View {
    let points = (0..9000).filter_map(|k| {
        let z = (f64::from(k) + 0.5) / 4500.0 - 1.0;
        let angle = 2.399963 * f64::from(k);
        let out = Vector3::new((1.0 - z * z).sqrt() * angle.cos(), (1.0 - z * z).sqrt() * angle.sin(), z);
        let height = 2.5 * (5.0 * out.x + 2.0).sin() * (6.0 * out.y).cos() + 2.5 * (7.0 * out.z + 4.0 * out.x).sin();
        (out.dot(direction) > 0.15).then(|| Point3::from(out * (35.0 + height)))
    });
    View::new(&Cloud::from_points(points.collect())).expect("half a ball can be used")
}
