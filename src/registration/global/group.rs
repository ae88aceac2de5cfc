//! Views that hang together, with poses in a world of their own.

use super::link::Link;
use super::sketch::Sketch;
use crate::geometry::Motion;
use crate::registration::motion_averaging::{self, AveragingOptions, RelativeMotion};

/// Views that hang together.
#[derive(Debug, Clone, PartialEq)]
pub struct Group {
    /// Its views, in order.
    pub views: Vec<usize>,
    /// For each of `views` its pose: local frame to the group's world.
    pub local_poses: Vec<Motion>,
    /// The pairs that hold it together.
    pub links: Vec<Link>,
    /// The search that found it.
    pub search: usize,
}

impl Group {
    /// A view by itself.
    pub fn of(view: usize) -> Self {
        Group { views: vec![view], local_poses: vec![Motion::identity()], links: Vec::new(), search: 0 }
    }

    /// A view's pose in the group's world.
    pub fn pose_of(&self, view: usize) -> Option<Motion> {
        self.views.iter().position(|v| *v == view).map(|k| self.local_poses[k])
    }

    /// Those of its views that stand at these places of it, which rise.
    pub fn among(&self, places: &[usize]) -> Group {
        let views: Vec<usize> = places.iter().map(|k| self.views[*k]).collect();
        let local_poses = places.iter().map(|k| self.local_poses[*k]).collect();
        let holds = |link: &&Link| views.binary_search(&link.i).is_ok() && views.binary_search(&link.j).is_ok();
        let links = self.links.iter().filter(holds).copied().collect();
        Group { views, local_poses, links, search: self.search }
    }

    /// The group with view k called `names[k]`, which rise, and its search called `search`.
    pub fn renamed(mut self, names: &[usize], search: usize) -> Group {
        self.search = search;
        self.views.iter_mut().for_each(|view| *view = names[*view]);
        self.links.iter_mut().for_each(|link| (link.i, link.j) = (names[link.i], names[link.j]));
        self
    }

    /// Both groups in this one's world, views in order.
    pub fn united(&self, other: &Group, motion: &Motion) -> Group {
        let own = self.views.iter().copied().zip(self.local_poses.iter().copied());
        let others = other.views.iter().copied().zip(other.local_poses.iter().map(|pose| motion * pose));
        let mut rows: Vec<(usize, Motion)> = own.chain(others).collect();
        rows.sort_by_key(|row| row.0);
        let (views, local_poses) = rows.into_iter().unzip();
        Group {
            views,
            local_poses,
            links: self.links.iter().chain(&other.links).copied().collect(),
            search: self.search,
        }
    }

    /// Spreads what the links say over all poses; the first view keeps its own.
    pub fn average(&mut self, sketches: &[Sketch], edge: f64) {
        let place = |view: usize| self.views.iter().position(|v| *v == view).unwrap_or(0);
        let relative: Vec<RelativeMotion> = self
            .links
            .iter()
            .map(|link| RelativeMotion {
                i: place(link.i),
                j: place(link.j),
                motion_i_j: link.motion_i_j,
                weight: link.evidence.overlap().max(0.01),
            })
            .collect();
        let radius = self.views.iter().map(|v| sketches[*v].radius).fold(0.0, f64::max);
        let options = AveragingOptions { radius, noise: 0.25 * edge, robust: true };
        if let Ok(averaged) = motion_averaging::average(&self.local_poses, &relative, &[0], &options) {
            self.local_poses = averaged.poses;
        }
    }
}
