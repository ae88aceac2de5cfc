//! Views that hang together, with poses in a world of their own.

use super::confidence::Grounds;
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
    /// For each of `views` how sure it is that it belongs where it is, 0 to 1.
    pub confidences: Vec<f64>,
    /// The pairs that hold it together.
    pub links: Vec<Link>,
    /// What each of its joins rested on.
    pub joins: Vec<Grounds>,
}

impl Group {
    /// A view by itself.
    pub fn of(view: usize) -> Self {
        Group {
            views: vec![view],
            local_poses: vec![Motion::identity()],
            confidences: vec![1.0],
            links: Vec::new(),
            joins: Vec::new(),
        }
    }

    /// A view's pose in the group's world.
    pub fn pose_of(&self, view: usize) -> Option<Motion> {
        self.views.iter().position(|v| *v == view).map(|k| self.local_poses[k])
    }

    /// How sure it is that a view belongs where it is.
    pub fn confidence_of(&self, view: usize) -> Option<f64> {
        self.views.iter().position(|v| *v == view).map(|k| self.confidences[k])
    }

    /// The group with view k called `names[k]`, which rise.
    pub fn renamed(mut self, names: &[usize]) -> Group {
        self.views.iter_mut().for_each(|view| *view = names[*view]);
        self.links.iter_mut().for_each(|link| (link.i, link.j) = (names[link.i], names[link.j]));
        self
    }

    /// Both groups in this one's world, views in order. A join is a doubt about the smaller side.
    pub fn united(&self, other: &Group, motion: &Motion, confidence: f64) -> Group {
        let doubts_other = other.views.len() <= self.views.len();
        let row = |group: &Group, k: usize, pose: Motion, doubted: bool| {
            let sure = group.confidences[k];
            (group.views[k], pose, if doubted { sure.min(confidence) } else { sure })
        };
        // in a pair of single views none is surer than the other
        let doubts_self = !doubts_other || self.views.len() == 1;
        let mut rows: Vec<(usize, Motion, f64)> =
            (0..self.views.len()).map(|k| row(self, k, self.local_poses[k], doubts_self)).collect();
        rows.extend((0..other.views.len()).map(|k| row(other, k, motion * other.local_poses[k], doubts_other)));
        rows.sort_by_key(|row| row.0);
        Group {
            views: rows.iter().map(|row| row.0).collect(),
            local_poses: rows.iter().map(|row| row.1).collect(),
            confidences: rows.iter().map(|row| row.2).collect(),
            links: self.links.iter().chain(&other.links).copied().collect(),
            joins: self.joins.iter().chain(&other.joins).copied().collect(),
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
