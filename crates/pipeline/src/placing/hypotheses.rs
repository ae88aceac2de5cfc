//! Where a probe may lie on a model, by the frames that both give themselves: as wholes, or the probe as what a single scan of the model
//! would see. Axes have no signs, and where a shape is about as long along two of them they have no order either, so each is tried.

use std::f64::consts::FRAC_PI_6;

use nalgebra::{Matrix3, Rotation3, Unit};

use super::pose::Pose;
use visage_geometry::{Motion, Vector3, se3};
use visage_shape::descriptor::{OwnFrame, SampledShape};

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Axes may have changed places if the moment along the lesser is this share of that along the other, on either surface;
        exchangeable: f64 = 0.6,
        /// from this share on they say nothing of the turn in their plane.
        even: f64 = 0.8,
        /// A known scale that differs less from the one that sizes tell is no further hypothesis.
        same_scale: f64 = 0.03,
    }
}

/// All poses that frames tell, of the probe or of its mirror image. `known_scale`: lengths on the model in one of the probe, if it is known
/// how large both are.
pub fn hypotheses(probe: &SampledShape, model: &SampledShape, known_scale: Option<f64>, mirrored: bool) -> Vec<Pose> {
    let mut found = Vec::new();
    for (of_probe, of_model) in probe.whole.iter().zip(&model.whole) {
        let by_size = of_model.size / of_probe.size;
        let further = known_scale.filter(|known| (known / by_size).ln().abs() > TUNING.same_scale);
        for scale in std::iter::once(by_size).chain(further) {
            found.extend(laid(of_probe, of_model, scale, mirrored));
        }
    }
    let of_probe = &probe.whole[0];
    for of_model in &model.views {
        found.extend(laid(of_probe, of_model, known_scale.unwrap_or(of_model.size / of_probe.size), mirrored));
    }
    found
}

/// One frame laid onto another in every way.
fn laid(probe: &OwnFrame, model: &OwnFrame, scale: f64, mirrored: bool) -> impl Iterator<Item = Pose> {
    let flip = Matrix3::from_diagonal(&Vector3::new(if mirrored { -1.0 } else { 1.0 }, 1.0, 1.0));
    let (from, to) = (right_handed(probe.axes * flip), right_handed(model.axes));
    let (center, place) = (flip * probe.center.coords, model.center.coords);
    turns(probe, model).into_iter().map(move |turn| {
        let rotation = se3::nearest_rotation(&(to.transpose() * turn * from));
        let motion = Motion::from_parts((place - rotation * center * scale).into(), rotation);
        Pose { motion, scale, mirrored }
    })
}

fn right_handed(mut axes: Matrix3<f64>) -> Matrix3<f64> {
    if axes.determinant() < 0.0 {
        axes.row_mut(2).neg_mut();
    }
    axes
}

/// The turns between two frames whose axes may be meant otherwise.
fn turns(probe: &OwnFrame, model: &OwnFrame) -> Vec<Matrix3<f64>> {
    let share = |frame: &OwnFrame, k: usize| frame.moments[k + 1] / frame.moments[k].max(f64::MIN_POSITIVE);
    let shares = [0, 1].map(|k| share(probe, k).max(share(model, k)));
    let mut spins = vec![Matrix3::identity()];
    for (k, share) in shares.into_iter().enumerate() {
        if share > TUNING.even {
            // about the axis across both
            let axis = Unit::new_unchecked(Vector3::ith((k + 2) % 3, 1.0));
            let steps = [1.0, 2.0].map(|step| *Rotation3::from_axis_angle(&axis, step * FRAC_PI_6).matrix());
            spins.extend(steps);
        }
    }
    let proper = signed_permutations().filter(|turn| is_allowed(turn, &shares));
    proper.flat_map(|turn| spins.iter().map(move |spin| spin * turn).collect::<Vec<_>>()).collect()
}

/// The 24 turns that bring axes onto axes.
fn signed_permutations() -> impl Iterator<Item = Matrix3<f64>> {
    const ORDERS: [[usize; 3]; 6] = [[0, 1, 2], [1, 0, 2], [0, 2, 1], [2, 1, 0], [1, 2, 0], [2, 0, 1]];
    let all = ORDERS.into_iter().flat_map(|order| (0..8u8).map(move |signs| (order, signs)));
    let matrix = |(order, signs): ([usize; 3], u8)| {
        let sign = |k: usize| if signs >> k & 1 == 0 { 1.0 } else { -1.0 };
        Matrix3::from_fn(|row, column| if order[row] == column { sign(row) } else { 0.0 })
    };
    all.map(matrix).filter(|turn| turn.determinant() > 0.0)
}

fn is_allowed(turn: &Matrix3<f64>, shares: &[f64; 2]) -> bool {
    let is_exchanged = |a: usize, b: usize| turn[(a, b)] != 0.0 || turn[(b, a)] != 0.0;
    let free = shares.map(|share| share > TUNING.exchangeable);
    (free[0] || !is_exchanged(0, 1)) && (free[1] || !is_exchanged(1, 2)) && (free[0] && free[1] || !is_exchanged(0, 2))
}
