//! Whether surfaces laid on each other can slide without leaving each other: a bowl turns in itself.

use nalgebra::{Matrix6, Vector6};

use super::coarse_view::CoarseView;
use super::pair_hypothesis::PairHypothesis;
use super::verification::verify;
use super::votes::SurfelVotes;
use crate::joint::normal_equations::NormalEquations;
use visage_geometry::{Vector3, se3};

/// How far surfaces are slid, in edges: several times what counts as lying on each other.
const SLIDE: f64 = 4.0;
/// Distances below this, in edges, are those of one surface sampled twice.
const FLAT: f64 = 0.03;
/// They slide if of what was said this share of what it was still agrees,
const STILL_CONSISTENT: f64 = 0.97;
/// at this share of the surfels at least (some leave the overlap),
const STILL_AGREE: f64 = 0.6;
/// and those lie on each other as well: their mean square distance grows by no more than this factor.
const STILL_CLOSE: f64 = 1.5;

/// Whether the pairs of a join, each by itself, still agree after a move along the direction that holds them least.
pub fn can_slip(coarse_views: &[CoarseView], measured: &[PairHypothesis], edge: f64, samples: usize) -> bool {
    let (mut before, mut after) = (SurfelVotes::default(), SurfelVotes::default());
    for hypothesis in measured.iter().filter(|hypothesis| hypothesis.score() > 0.0) {
        let (i, j) = (&coarse_views[hypothesis.i], &coarse_views[hypothesis.j]);
        let slid = weakest_moves(i, j, hypothesis, edge)
            .into_iter()
            .map(|twist| verify(i, j, &(se3::exp(&twist) * hypothesis.i_from_j), edge, samples).both())
            .max_by(|a, b| a.consistency().total_cmp(&b.consistency()));
        let Some(slid) = slid else { continue };
        (before, after) = (before + hypothesis.evidence.both(), after + slid);
    }
    let flat = (FLAT * edge).powi(2);
    before.agree > 0.0
        && after.agree > STILL_AGREE * before.agree
        && after.consistency() > STILL_CONSISTENT * before.consistency()
        && after.mean_square() < STILL_CLOSE * before.mean_square().max(flat)
}

/// The move (to and fro) that changes the distances of the surfaces least, scaled to [`SLIDE`]; twists of view i's
/// frame.
fn weakest_moves(i: &CoarseView, j: &CoarseView, hypothesis: &PairHypothesis, edge: f64) -> Vec<Vector6<f64>> {
    let motion = hypothesis.i_from_j.cast::<f32>();
    let (rotation, shift) = (motion.rotation.to_rotation_matrix(), motion.translation.vector);
    let moved: Vec<(Vector3, Vector3)> = j
        .inner
        .iter()
        .filter_map(|&index| {
            let place = rotation * j.position(index as usize) + shift;
            i.indexed.tree.nearest(&place.into(), (edge * edge) as f32)?;
            Some((place.cast::<f64>(), (rotation * j.normals[index as usize]).cast::<f64>()))
        })
        .collect();
    if moved.len() < 6 {
        return Vec::new();
    }
    let count = moved.len() as f64;
    let middle = moved.iter().map(|(place, _)| place).sum::<Vector3>() / count;
    let spread = (moved.iter().map(|(place, _)| (place - middle).norm_squared()).sum::<f64>() / count).sqrt();
    // about the middle of what overlaps and in units of its size, turning and shifting can be compared
    let mut sums = NormalEquations::default();
    for (place, normal) in &moved {
        sums.add(normal, &((place - middle) / spread), 0.0, 1.0);
    }
    let information: Matrix6<f64> = sums.information();
    let eigen = information.symmetric_eigen();
    let weakest: Vector6<f64> = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned();
    let (shift, turn) = (weakest.fixed_rows::<3>(0).into_owned(), weakest.fixed_rows::<3>(3).into_owned() / spread);
    let displacement = |place: &Vector3| (shift + turn.cross(&(place - middle))).norm_squared();
    let typical = (moved.iter().map(|(place, _)| displacement(place)).sum::<f64>() / count).sqrt();
    let scale = SLIDE * edge / typical.max(f64::MIN_POSITIVE);
    // back from the middle to the origin of view i's frame
    let shift = shift - turn.cross(&middle);
    let twist = Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z) * scale;
    vec![twist, -twist]
}
