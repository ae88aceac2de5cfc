//! A quick look at whether two views can lie as a motion says: a few surfels, looked up instead of searched. What
//! [`super::verification`] asks at length of a few motions is asked briefly of thousands.

use nalgebra::Vector3;

use super::coarse_view::CoarseView;
use super::grid::NearGrid;
use crate::least_squares::descent::descend;
use crate::least_squares::robust_kernel::RobustKernel;
use crate::sensor::depth_image::Seen;
use visage_geometry::Motion;

/// Surfels of a view that can be queried.
pub const WITNESSES: usize = 120;
visage_geometry::tuning! {
    const TUNING: Tuning {
        /// A surfel's counterpart lies no farther beside it than this, in edges,
        beside: f32 = 2.2,
        /// and their normals are alike to this cosine.
        like: f32 = 0.6,
        /// A surfel stands where the scanner looked through from this height over the surface it saw on, in edges.
        in_front: f32 = 2.0,
        /// A surface faces a scanner that it should be seen by from this cosine of its normal on.
        facing: f32 = 0.6,
        /// A surfel that the other scanner should have seen counts as so many that cross.
        not_seen: f32 = 1.5,
        /// Motions are ranked by the overlap times what the share of agreement exceeds this by.
        least_consistency: f32 = 0.4,
        /// Search distances of the steps towards the surface, in edges.
        reaches: [f32; 4] = [2.0, 1.5, 1.2, 1.0],
    }
}

/// A view that can be looked at quickly.
#[derive(Debug, Clone)]
pub struct HypothesisScorer<'a> {
    /// The view.
    pub coarse_view: &'a CoarseView,
    grid: NearGrid,
    /// Places and normals of some surfels, spread over the view, and so are the first few of them.
    witnesses: Vec<(Vector3<f32>, Vector3<f32>)>,
}

/// What some surfels of one view say when they are put into another.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct HypothesisScore {
    /// Surfels queried.
    pub queried: f32,
    /// Those that lie on the other view's surface, and look the same way.
    pub agree: f32,
    /// Those that cross it, and more for those that the other scanner should have seen and did not.
    pub conflict: f32,
}

impl HypothesisScore {
    /// How much speaks for the motion, to rank motions.
    pub fn strength(&self) -> f32 {
        let consistency = self.agree / (self.agree + self.conflict).max(1.0);
        self.agree / self.queried.max(1.0) * (consistency - TUNING.least_consistency).max(0.0)
    }
}

impl<'a> HypothesisScorer<'a> {
    /// Prepares a view.
    pub fn new(coarse_view: &'a CoarseView, edge: f64) -> Self {
        let inner = &coarse_view.inner;
        // any number of multiples of the golden ratio are spread evenly over the curve along which surfels are stored
        let place = |k: usize| (k as f64 * std::f64::consts::GOLDEN_RATIO).fract() * inner.len() as f64;
        let witness = |k: usize| {
            let surfel = inner[place(k) as usize] as usize;
            (coarse_view.position(surfel), coarse_view.normals[surfel])
        };
        let witnesses = (0..WITNESSES.min(inner.len())).map(witness).collect();
        HypothesisScorer { coarse_view, grid: NearGrid::new(&coarse_view.indexed.points, edge as f32), witnesses }
    }

    /// Puts some of this view's witnesses into `other`; `motion` maps the frame of the first into that of the second.
    /// They agree within `tolerance` along the normal. Lengths but in `edge` are those of the scans.
    pub fn look(
        &self,
        range: std::ops::Range<usize>,
        other: &HypothesisScorer,
        motion: &nalgebra::IsometryMatrix3<f32>,
        edge: f32,
        tolerance: f32,
    ) -> HypothesisScore {
        let count = self.witnesses.len();
        let queried = &self.witnesses[range.start.min(count)..range.end.min(count)];
        let mut said = HypothesisScore { queried: queried.len() as f32, ..HypothesisScore::default() };
        for (place, normal) in queried {
            let (moved, turned) = (motion.rotation * place + motion.translation.vector, motion.rotation * normal);
            let Some(target) = other.grid.near(&moved) else {
                said.conflict += if other.misses(&moved, &turned, edge) { TUNING.not_seen } else { 0.0 };
                continue;
            };
            let offset = moved - other.coarse_view.position(target);
            let other_normal = other.coarse_view.normals[target];
            let along = other_normal.dot(&offset);
            let is_beside = offset.norm_squared() - along * along < (TUNING.beside * edge).powi(2);
            if is_beside && along.abs() < tolerance && other_normal.dot(&turned) > TUNING.like {
                said.agree += 1.0;
            } else if other.coarse_view.is_inner[target] {
                said.conflict += 1.0;
            }
        }
        said
    }

    /// Whether the scanner should have seen a surface, given in this view's frame, and did not.
    fn misses(&self, place: &Vector3<f32>, normal: &Vector3<f32>, edge: f32) -> bool {
        let depth_image = &self.coarse_view.depth_image;
        match depth_image.look(place) {
            Seen::Surface { height } => height > TUNING.in_front * edge,
            Seen::Rim | Seen::Unknown => false,
            Seen::Nothing => {
                let toward = depth_image.toward_scanner(place);
                toward.dot(normal) > TUNING.facing * toward.norm()
            }
        }
    }

    /// Improves a motion that maps this view into `other`'s frame: a few point-to-plane steps of the witnesses.
    pub fn refined(&self, other: &HypothesisScorer, motion: &Motion, edge: f32) -> Motion {
        descend(motion, TUNING.reaches.map(|reach| f64::from(reach * edge)), |motion, reach, sums| {
            let (by, reach) = (motion.cast::<f32>(), reach as f32);
            let (rotation, shift) = (by.rotation.to_rotation_matrix(), by.translation.vector);
            let kernel = RobustKernel::within(reach);
            for (place, normal) in &self.witnesses {
                let (moved, turned) = (rotation * place + shift, rotation * normal);
                let Some(target) = other.grid.near(&moved).filter(|k| other.coarse_view.is_inner[*k]) else { continue };
                let (offset, other_normal) =
                    (moved - other.coarse_view.position(target), other.coarse_view.normals[target]);
                // the surfel looked up may lie beside the nearest
                if other_normal.dot(&turned) < TUNING.like || offset.norm() > 2.0 * reach {
                    continue;
                }
                let mean = (other_normal + turned).normalize();
                let residual = mean.dot(&offset);
                sums.add(&mean.cast(), &moved.cast(), residual.into(), kernel.weight(residual).into());
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::global::fixture::{EDGE, Fixture};

    #[test]
    fn a_brief_look_tells_right_from_wrong_and_leads_nearer() {
        let fixture = Fixture::from_around(&[0.0, 40.0]);
        let [i, j] = [0, 1].map(|view| HypothesisScorer::new(&fixture.coarse_views[view], EDGE));
        let edge = EDGE as f32;
        let strength = |motion: &Motion| {
            let motion = motion.cast::<f32>();
            let motion = nalgebra::IsometryMatrix3::from_parts(motion.translation, motion.rotation.into());
            j.look(0..WITNESSES, &i, &motion, edge, 0.4 * edge).strength()
        };
        let right = fixture.i_from_j(0, 1);
        let wrong = fixture.i_from_j_off(0, 1, [0.0; 3], [0.0, 0.0, 0.9]);
        assert!(strength(&right) > 0.2 && strength(&wrong) < 0.5 * strength(&right));
        let start = fixture.i_from_j_off(0, 1, [2.0, 1.0, -1.5], [0.0; 3]);
        let refined = j.refined(&i, &start, edge);
        assert!(fixture.off(0, 1, &refined) < 0.5 * fixture.off(0, 1, &start), "{refined}");
    }

    #[test]
    fn strength_counts_overlap_only_as_far_as_it_is_consistent() {
        let score = |agree: f32, conflict: f32| HypothesisScore { queried: 100.0, agree, conflict };
        assert!(score(60.0, 0.0).strength() > score(60.0, 20.0).strength());
        assert_eq!(score(30.0, 60.0).strength(), 0.0);
        assert_eq!(HypothesisScore::default().strength(), 0.0);
    }
}
