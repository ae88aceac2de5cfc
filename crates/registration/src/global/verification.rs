//! Whether two views can lie as a motion says: the surface itself is queried, descriptions only propose.

use super::coarse_view::CoarseView;
use super::votes::SurfelVotes;
use crate::sensor::depth_image::Seen;
use visage_geometry::Motion;

/// Both directions.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct PairVotes {
    /// View j's surfels in view i.
    pub j_in_i: SurfelVotes,
    /// View i's surfels in view j.
    pub i_in_j: SurfelVotes,
}

impl PairVotes {
    /// What both say together.
    pub fn both(&self) -> SurfelVotes {
        self.j_in_i + self.i_in_j
    }

    /// The smaller share that agrees.
    pub fn overlap(&self) -> f64 {
        self.j_in_i.overlap().min(self.i_in_j.overlap())
    }
}

visage_geometry::tuning! {
    pub(super) const TUNING: Tuning {
        /// A surfel agrees within this distance along the normal, in edges,
        on: f32 = 0.35,
        /// and this cosine of the normals.
        like: f32 = 0.85,
        /// Two sides of a wall have normals of less than this cosine.
        opposed: f32 = -0.4,
        /// A surfel is near a surface within this distance, in edges.
        near: f32 = 1.6,
        /// It stands in front of a surface from this distance on, in edges.
        in_front: f32 = 1.5,
        /// A surface faces a scanner that it should be seen by from this cosine of its normal on.
        facing: f32 = 0.6,
    }
}

/// Asks both views, at most about `samples` surfels each.
pub fn verify(i: &CoarseView, j: &CoarseView, i_from_j: &Motion, edge: f64, samples: usize) -> PairVotes {
    PairVotes {
        j_in_i: votes(j, i, i_from_j, edge as f32, samples),
        i_in_j: votes(i, j, &i_from_j.inverse(), edge as f32, samples),
    }
}

/// Whether a surface in `other`'s frame faces its scanner.
fn is_facing(other: &CoarseView, place: &nalgebra::Vector3<f32>, normal: &nalgebra::Vector3<f32>) -> bool {
    let toward = other.depth_image.toward_scanner(place);
    toward.dot(normal) > TUNING.facing * toward.norm()
}

/// Puts surfels of `view` into `other`; `motion` maps the frame of the first into that of the second.
fn votes(view: &CoarseView, other: &CoarseView, motion: &Motion, edge: f32, samples: usize) -> SurfelVotes {
    let motion = motion.cast::<f32>();
    let (rotation, shift) = (motion.rotation.to_rotation_matrix(), motion.translation.vector);
    let step = view.inner.len().div_ceil(samples).max(1);
    let mut votes = SurfelVotes::default();
    for &index in view.inner.iter().step_by(step) {
        let index = index as usize;
        votes.queried += 1.0;
        let moved = rotation * view.position(index) + shift;
        let nearest = other.indexed.tree.nearest(&moved.into(), (TUNING.near * edge).powi(2));
        let Some(target) = nearest.map(|n| n.index as usize) else {
            match other.depth_image.look(&moved) {
                Seen::Surface { height } if height > TUNING.in_front * edge => votes.looked_through += 1.0,
                Seen::Nothing if is_facing(other, &moved, &(rotation * view.normals[index])) => votes.missed += 1.0,
                _ => {}
            }
            continue;
        };
        let normal = rotation * view.normals[index];
        let other_normal = other.normals[target];
        let cosine = normal.dot(&other_normal);
        let offset = moved - other.position(target);
        let mean = normal + other_normal;
        let along = if cosine > -0.9 { mean.dot(&offset) / mean.norm() } else { normal.dot(&offset) };
        if cosine > TUNING.like && along.abs() < TUNING.on * edge {
            votes.agree += 1.0;
            votes.squares += f64::from(along * along);
        } else if other.is_inner[target] {
            let is_far_side = cosine < TUNING.opposed && other_normal.dot(&offset) < 0.0;
            *(if is_far_side { &mut votes.hidden } else { &mut votes.contradict }) += 1.0;
        }
    }
    votes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::global::fixture::{EDGE, Fixture};
    use visage_geometry::Vector3;

    #[test]
    fn surfaces_bear_out_the_true_motion_and_contradict_others() {
        let fixture = Fixture::from_around(&[0.0, 50.0]);
        let [i, j] = [0, 1].map(|view| &fixture.coarse_views[view]);
        let votes = |motion: &Motion| verify(i, j, motion, EDGE, 400).both();
        let right = votes(&fixture.i_from_j(0, 1));
        assert!(right.overlap() > 0.4 && right.consistency() > 0.95, "{right:?}");
        assert_eq!((right.looked_through, right.missed), (0.0, 0.0));
        // turned by half, the bumps of one cross those of the other; apart, they lie where nothing was seen
        let turned = votes(&(fixture.i_from_j(0, 1) * Motion::rotation(Vector3::z() * 0.8)));
        assert!(turned.contradict > 3.0 * right.contradict.max(10.0), "{turned:?}");
        let sunk = votes(&fixture.i_from_j_off(0, 1, [4.0 * EDGE, 0.0, 0.0], [0.0; 3]));
        assert!(sunk.looked_through + sunk.missed > 10.0, "{sunk:?}");
        assert!(turned.score() < right.score() && sunk.score() < 0.0);
    }

    #[test]
    fn overlap_is_that_of_the_view_which_shares_less() {
        let votes = |agree: f64| SurfelVotes { queried: 100.0, agree, ..SurfelVotes::default() };
        let pair = PairVotes { j_in_i: votes(80.0), i_in_j: votes(20.0) };
        assert_eq!((pair.overlap(), pair.both().agree), (0.2, 100.0));
    }
}
