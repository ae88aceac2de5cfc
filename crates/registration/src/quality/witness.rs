//! What speaks for or against a view's pose once all poses are final: how well it is known, where other scanners looked
//! through its surface, whether colours agree, and whether a background holds it before which something moved.

use crate::covariance::Uncertainty;
use crate::outcome::Outcome;
use crate::quality::free_space::Intrusion;
use crate::view::View;
use visage_geometry::Vector3;

/// What is known of one view's final pose beside how it stands among the others. The default says nothing.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Witness {
    /// Root mean square displacement of its surface by one standard deviation of its pose, in the size of the set; for the view
    /// that keeps its pose the median of the others', which are relative to it; `None` where it is not known.
    pub displacement: Option<f64>,
    /// The same against the others as they stand, from one place of what holds it to another (`covariance/jackknife.rs`).
    pub jackknife: Option<f64>,
    /// Whether it has surface where another scanner looked through.
    pub is_looked_through: bool,
    /// How well its colours agree with the neighbour's with which they agree best, where they say anything.
    pub colours: Option<f64>,
    /// Whether it is held by what stood still, while something moved before it.
    pub stands_still: bool,
}

/// What is known of all views of a set, from which their witnesses are drawn.
pub struct Known<'a> {
    /// How well the poses are known.
    pub uncertainty: &'a Uncertainty,
    /// Where scanners looked through surface.
    pub intrusions: &'a [Intrusion],
    /// For each view the agreement of its colours.
    pub colours: &'a [Option<f64>],
    /// Whether all views were taken from one place, and what moved before it could not be placed.
    pub stands_still: bool,
}

impl Known<'_> {
    /// The witness of each view.
    pub fn witnesses(&self, views: &[View], result: &Outcome) -> Vec<Witness> {
        let size = size(views, result);
        let covariances = self.uncertainty.covariances.iter();
        let known: Vec<Option<f64>> =
            covariances.map(|pose| pose.as_ref().map(|pose| pose.displacement() / size)).collect();
        // the first view is as loose against the others as they are against it
        let first = (0..views.len()).find(|view| result.placed[*view]).filter(|view| known[*view].is_none());
        let typical = median(known.iter().flatten().copied().collect());
        let witness = |view: usize| Witness {
            displacement: known[view].or(typical.filter(|_| first == Some(view))),
            jackknife: self.uncertainty.displacements[view].map(|displacement| displacement / size),
            is_looked_through: self.intrusions.iter().any(|found| found.view == view && found.counts()),
            colours: self.colours[view],
            stands_still: self.stands_still,
        };
        (0..views.len()).map(witness).collect()
    }
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

/// The diagonal of an evenly filled box whose points are spread as those of the placed views: a length.
fn size(views: &[View], result: &Outcome) -> f64 {
    let placed = || (0..views.len()).filter(|view| result.placed[*view]);
    let weight = |view: usize| views[view].points().len() as f64;
    let place = |view: usize| result.local_poses[view].translation.vector;
    let all = placed().map(weight).sum::<f64>().max(1.0);
    let middle = placed().map(|view| place(view) * weight(view)).sum::<Vector3>() / all;
    let square = |view: usize| views[view].radius.powi(2) + (place(view) - middle).norm_squared();
    let variance = placed().map(|view| square(view) * weight(view)).sum::<f64>() / all;
    (12.0 * variance).sqrt().max(f64::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::covariance::PoseCovariance;
    use visage_geometry::{Cloud, Motion, Point3};

    #[test]
    fn the_size_is_that_of_a_box_whatever_the_frame() {
        let places = (0..1000).map(|k| [k % 10, k / 10 % 10, k / 100].map(|x| f64::from(x) + 0.5));
        let cloud = Cloud::from_points(places.map(|p| Point3::new(3.0 * p[0], p[1], 2.0 * p[2])).collect());
        let view = View::new(&cloud).expect("a box of points can be used");
        let box_of = |motion: &Motion| {
            let mut result = Outcome::alone(2);
            result.placed = vec![true; 2];
            result.local_poses = vec![view.local_pose(motion); 2];
            size(&[view.clone(), view.clone()], &result)
        };
        let diagonal = (900.0f64 + 100.0 + 400.0).sqrt();
        for motion in [Motion::identity(), Motion::new(Vector3::new(90.0, 0.0, 7.0), Vector3::new(1.0, 0.4, 0.2))] {
            assert!((box_of(&motion) / diagonal - 1.0).abs() < 0.01, "{}", box_of(&motion));
        }
    }

    #[test]
    fn the_view_that_keeps_its_pose_is_known_as_well_as_the_others_against_it() {
        let places = (0..64).map(|k| Point3::new(f64::from(k % 8), f64::from(k / 8), f64::from(k * k % 5)));
        let view = View::new(&Cloud::from_points(places.collect())).expect("a sheet can be used");
        let known = |variance: f64| PoseCovariance {
            center: Point3::origin(),
            covariance: nalgebra::Matrix6::identity() * variance,
            systematic: nalgebra::Matrix6::zeros(),
            evidence: [(1.0, nalgebra::Vector6::zeros()); 6],
            step: nalgebra::Vector6::zeros(),
            extent: nalgebra::Matrix6::identity(),
            clusters: 20,
        };
        let views = vec![view; 4];
        let covariances = [None, Some(known(1e-4)), Some(known(4e-4)), Some(known(9e-4))];
        let mut result = Outcome::alone(4);
        result.placed = vec![true; 4];
        let displacements = |covariances: &[Option<PoseCovariance>], result: &Outcome| -> Vec<Option<f64>> {
            let uncertainty = Uncertainty { covariances: covariances.to_vec(), displacements: vec![None; 4] };
            let known = Known { uncertainty: &uncertainty, intrusions: &[], colours: &[None; 4], stands_still: false };
            known.witnesses(&views, result).into_iter().map(|witness| witness.displacement).collect()
        };
        let found = displacements(&covariances, &result);
        assert!(found[0].is_some() && found[0] == found[2], "{found:?}");
        let unknown = [None, None, Some(known(1e-4)), None];
        let found = displacements(&unknown, &result);
        assert!(found[0] == found[2] && found[1].is_none() && found[3].is_none(), "{found:?}");
        assert_eq!(displacements(&[const { None }; 4], &result), [None; 4]);
    }
}
