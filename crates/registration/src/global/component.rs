//! Views that hang together, with poses in a world of their own.

use super::coarse_view::CoarseView;
use super::pair_hypothesis::PairHypothesis;
use crate::averaging::motion_averaging::{self, AveragingOptions, RelativeMotion};
use visage_geometry::Motion;

/// Views that hang together.
#[derive(Debug, Clone, PartialEq)]
pub struct Component {
    /// Its views, in order.
    pub views: Vec<usize>,
    /// For each of `views` its pose: local frame to the component's world.
    pub local_poses: Vec<Motion>,
    /// The pairs that hold it together.
    pub hypotheses: Vec<PairHypothesis>,
    /// The search that found it.
    pub search: usize,
}

impl Component {
    /// A view by itself.
    pub fn of(view: usize) -> Self {
        Component { views: vec![view], local_poses: vec![Motion::identity()], hypotheses: Vec::new(), search: 0 }
    }

    /// A view's pose in the component's world.
    pub fn pose_of(&self, view: usize) -> Option<Motion> {
        self.views.iter().position(|v| *v == view).map(|k| self.local_poses[k])
    }

    /// Those of its views that stand at these places of it, which rise.
    pub fn among(&self, places: &[usize]) -> Component {
        let views: Vec<usize> = places.iter().map(|k| self.views[*k]).collect();
        let local_poses = places.iter().map(|k| self.local_poses[*k]).collect();
        let holds = |hypothesis: &&PairHypothesis| {
            views.binary_search(&hypothesis.i).is_ok() && views.binary_search(&hypothesis.j).is_ok()
        };
        let hypotheses = self.hypotheses.iter().filter(holds).copied().collect();
        Component { views, local_poses, hypotheses, search: self.search }
    }

    /// The component with view k called `names[k]`, which rise, and its search called `search`.
    pub fn renamed(mut self, names: &[usize], search: usize) -> Component {
        self.search = search;
        self.views.iter_mut().for_each(|view| *view = names[*view]);
        self.hypotheses
            .iter_mut()
            .for_each(|hypothesis| (hypothesis.i, hypothesis.j) = (names[hypothesis.i], names[hypothesis.j]));
        self
    }

    /// Both components in this one's world, views in order.
    pub fn united(&self, other: &Component, motion: &Motion) -> Component {
        let own = self.views.iter().copied().zip(self.local_poses.iter().copied());
        let others = other.views.iter().copied().zip(other.local_poses.iter().map(|pose| motion * pose));
        let mut rows: Vec<(usize, Motion)> = own.chain(others).collect();
        rows.sort_by_key(|row| row.0);
        let (views, local_poses) = rows.into_iter().unzip();
        Component {
            views,
            local_poses,
            hypotheses: self.hypotheses.iter().chain(&other.hypotheses).copied().collect(),
            search: self.search,
        }
    }

    /// Spreads what the hypotheses say over all poses; the first view keeps its own.
    pub fn average(&mut self, coarse_views: &[CoarseView], edge: f64) {
        let place = |view: usize| self.views.iter().position(|v| *v == view).unwrap_or(0);
        let relative: Vec<RelativeMotion> = self
            .hypotheses
            .iter()
            .map(|hypothesis| RelativeMotion {
                i: place(hypothesis.i),
                j: place(hypothesis.j),
                i_from_j: hypothesis.i_from_j,
                weight: hypothesis.evidence.overlap().max(0.01),
            })
            .collect();
        let radius = self.views.iter().map(|v| coarse_views[*v].radius).fold(0.0, f64::max);
        let options = AveragingOptions { radius, noise: 0.25 * edge, robust: true };
        if let Ok(averaged) = motion_averaging::average(&self.local_poses, &relative, &[0], &options) {
            self.local_poses = averaged.poses;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::global::fixture::{EDGE, Fixture};

    /// Views 0 and 2 as they lie.
    fn component(fixture: &Fixture) -> Component {
        let local_poses = vec![Motion::identity(), fixture.i_from_j(0, 2)];
        Component { views: vec![0, 2], local_poses, hypotheses: vec![fixture.right(0, 2)], search: 3 }
    }

    #[test]
    fn united_components_keep_their_views_in_order_and_their_poses() {
        let fixture = Fixture::from_around(&[0.0, 40.0, 80.0]);
        let (left, right) = (component(&fixture), Component::of(1));
        let union = left.united(&right, &fixture.i_from_j(0, 1));
        assert_eq!(union.views, [0, 1, 2]);
        assert_eq!(union.pose_of(1), Some(fixture.i_from_j(0, 1)));
        assert_eq!(union.pose_of(2), left.pose_of(2));
        assert_eq!((union.pose_of(7), union.search), (None, 3));
        let among = union.among(&[0, 1]);
        assert_eq!((among.views.as_slice(), among.hypotheses.len()), ([0, 1].as_slice(), 0));
        let renamed = left.renamed(&[10, 11, 12], 5);
        assert_eq!((renamed.views.as_slice(), renamed.search), ([10, 12].as_slice(), 5));
        assert_eq!((renamed.hypotheses[0].i, renamed.hypotheses[0].j), (10, 12));
    }

    #[test]
    fn averaging_moves_poses_to_where_the_hypotheses_have_them_and_keeps_the_first() {
        let fixture = Fixture::from_around(&[0.0, 40.0, 80.0]);
        let mut component = component(&fixture);
        component.local_poses[1] = fixture.i_from_j_off(0, 2, [0.4, -0.3, 0.2], [0.0, 0.01, 0.0]);
        component.average(&fixture.coarse_views, EDGE);
        assert_eq!(component.local_poses[0], Motion::identity());
        assert!(fixture.off(0, 2, &component.local_poses[1]) < 0.01);
    }
}
