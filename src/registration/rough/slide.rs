//! Whether surfaces laid on each other can slide without leaving each other: a bowl turns in itself.

use nalgebra::{Matrix6, Vector6};

use super::assembly::Link;
use super::sketch::Sketch;
use super::verification::verify;
use crate::geometry::{Vector3, se3};
use crate::registration::joint::normal_equations::PairSums;

/// How far surfaces are slid, in edges: several times what counts as lying on each other.
const SLIDE: f64 = 4.0;
/// Distances below this, in edges, are those of one surface sampled twice.
const FLAT: f64 = 0.03;
/// They slide if this share of the surfels that agreed still does,
const STILL_AGREE: f64 = 0.95;
/// and those lie on each other as well: their mean square distance grows by no more than this factor.
const STILL_CLOSE: f64 = 1.5;

/// Whether the pairs of a join, each by itself, still agree after a move along the direction that holds them least.
pub fn slides(sketches: &[Sketch], measured: &[Link], edge: f64, samples: usize) -> bool {
    let (mut before, mut after) = ([0.0; 2], [0.0; 2]);
    for link in measured.iter().filter(|link| link.strength() > 0.0) {
        let (i, j) = (&sketches[link.i], &sketches[link.j]);
        let slid = weakest_moves(i, j, link, edge)
            .into_iter()
            .map(|twist| verify(i, j, &(se3::exp(&twist) * link.motion_i_j), edge, samples))
            .max_by(|a, b| a.agree().total_cmp(&b.agree()));
        let Some(slid) = slid else { continue };
        before[0] += link.evidence.agree();
        before[1] += link.evidence.squares();
        // a pair that overlaps more than before does not make up for one that is torn
        after[0] += slid.agree().min(link.evidence.agree());
        after[1] += slid.squares() * (link.evidence.agree() / slid.agree().max(1.0)).min(1.0);
    }
    let mean_square = |sums: [f64; 2]| sums[1] / f64::max(sums[0], 1.0);
    before[0] > 0.0
        && after[0] > STILL_AGREE * before[0]
        && mean_square(after) < STILL_CLOSE * mean_square(before).max((FLAT * edge).powi(2))
}

/// The move (to and fro) that changes the distances of the surfaces least, scaled to [`SLIDE`]; twists of view i's
/// frame.
fn weakest_moves(i: &Sketch, j: &Sketch, link: &Link, edge: f64) -> Vec<Vector6<f64>> {
    let motion = link.motion_i_j.cast::<f32>();
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
    let mut sums = PairSums::default();
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
