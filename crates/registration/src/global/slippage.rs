//! Whether surfaces laid on each other can slide without leaving each other: a bowl turns in itself.
//!
//! Gelfand and Guibas, "Shape segmentation using local slippage analysis", SGP 2004: the motions that hardly change the
//! distances of a surface from itself are the eigenvectors of the least eigenvalues of its normal equations.

use nalgebra::{Matrix6, Vector6};

use super::coarse_view::CoarseView;
use super::pair_hypothesis::PairHypothesis;
use super::verification::verify;
use super::votes::SurfelVotes;
use crate::least_squares::normal_equations::{NormalEquations, RIGID};
use visage_geometry::{Vector3, se3};

/// How a surface holds itself. About the middle of the surface and in units of its size, turning and shifting can be
/// compared.
pub struct Slippage {
    middle: Vector3,
    /// Root mean square distance from the middle.
    spread: f64,
    /// Sum of `J J'` over the surfels, in that frame and unit.
    information: Matrix6<f64>,
    surfels: f64,
}

/// The motion that a surface holds least, about its [`middle`](Slippage::middle) and in units of its spread; at size 1.
pub struct WeakestMotion {
    /// Displacement of the middle.
    pub shift: Vector3,
    /// Rotation vector.
    pub turn: Vector3,
}

impl Slippage {
    /// Of surfels by position and unit normal; `None` if they are too few to hold anything.
    pub fn of(surfels: &[(Vector3, Vector3)]) -> Option<Self> {
        let count = surfels.len() as f64;
        let middle = surfels.iter().map(|(place, _)| place).sum::<Vector3>() / count.max(1.0);
        let spread = (surfels.iter().map(|(place, _)| (place - middle).norm_squared()).sum::<f64>() / count).sqrt();
        if surfels.len() < RIGID || spread <= 0.0 {
            return None;
        }
        let mut sums = NormalEquations::<RIGID>::default();
        for (place, normal) in surfels {
            sums.add(normal, &((place - middle) / spread), 0.0, 1.0);
        }
        Some(Slippage { middle, spread, information: sums.information(), surfels: count })
    }

    /// The mean position.
    pub fn middle(&self) -> Vector3 {
        self.middle
    }

    /// Root mean square distance from the middle.
    pub fn spread(&self) -> f64 {
        self.spread
    }

    /// How well the surface holds itself in the direction that it holds least: 0 (it slides) to about 0.3.
    pub fn hold(&self) -> f64 {
        (self.information / self.surfels).symmetric_eigenvalues().min().max(0.0).sqrt()
    }

    /// The motion that changes the distances of the surface from itself least.
    pub fn weakest(&self) -> WeakestMotion {
        let eigen = self.information.symmetric_eigen();
        let twist: Vector6<f64> = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned();
        WeakestMotion { shift: twist.fixed_rows::<3>(0).into_owned(), turn: twist.fixed_rows::<3>(3).into_owned() }
    }
}

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// How far surfaces are slid, in edges: several times what counts as lying on each other.
        slide: f64 = 4.0,
        /// Distances below this, in edges, are those of one surface sampled twice.
        flat: f64 = 0.03,
        /// They slide if of what was said this share of what it was still agrees,
        still_consistent: f64 = 0.97,
        /// at this share of the surfels at least (some leave the overlap),
        still_agree: f64 = 0.6,
        /// and those lie on each other as well: their mean square distance grows by no more than this factor.
        still_close: f64 = 1.5,
    }
}

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
    let flat = (TUNING.flat * edge).powi(2);
    before.agree > 0.0
        && after.agree > TUNING.still_agree * before.agree
        && after.consistency() > TUNING.still_consistent * before.consistency()
        && after.mean_square() < TUNING.still_close * before.mean_square().max(flat)
}

/// The move (to and fro) that changes the distances of the surfaces least, scaled to `TUNING.slide`; twists of view i's
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
    let Some(slippage) = Slippage::of(&moved) else { return Vec::new() };
    let middle = slippage.middle();
    let WeakestMotion { shift, turn } = slippage.weakest();
    let turn = turn / slippage.spread();
    let displacement = |place: &Vector3| (shift + turn.cross(&(place - middle))).norm_squared();
    let typical = (moved.iter().map(|(place, _)| displacement(place)).sum::<f64>() / moved.len() as f64).sqrt();
    let scale = TUNING.slide * edge / typical.max(f64::MIN_POSITIVE);
    // back from the middle to the origin of view i's frame
    let shift = shift - turn.cross(&middle);
    let twist = Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z) * scale;
    vec![twist, -twist]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sheet over a square with a height and its slope along x.
    fn sheet(height: fn(f64) -> (f64, f64)) -> Vec<(Vector3, Vector3)> {
        let places = (0..400).map(|k| (f64::from(k % 20), f64::from(k / 20)));
        let surfel = |(x, y)| {
            let (z, slope) = height(x);
            (Vector3::new(x, y, z), Vector3::new(-slope, 0.0, 1.0).normalize())
        };
        places.map(surfel).collect()
    }

    #[test]
    fn a_plane_slides_and_what_is_too_small_has_no_say() {
        let plane = sheet(|_| (0.0, 0.0));
        assert!(Slippage::of(&plane).expect("many surfels").hold() < 1e-9);
        assert!(Slippage::of(&plane[..5]).is_none());
        assert!(Slippage::of(&[plane[0]; 10]).is_none());
    }

    #[test]
    fn a_corrugated_sheet_slides_along_its_waves() {
        let waves = sheet(|x| (2.0 * (0.8 * x).sin(), 1.6 * (0.8 * x).cos()));
        let WeakestMotion { shift, turn } = Slippage::of(&waves).expect("many surfels").weakest();
        assert!(shift.y.abs() > 0.999 && turn.norm() < 1e-6, "{shift} {turn}");
    }
}
