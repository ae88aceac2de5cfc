//! An axis about which something turns.

use nalgebra::{Rotation3, Unit};

use visage_geometry::{Motion, Vector3};

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// The axis of a motion that turns by less than this is not known, rad.
        least_turn: f64 = 0.12,
        /// Axes are two if they are apart by this angle, rad,
        apart_angle: f64 = 0.1,
        /// or by this share of the reach of what turns.
        apart_place: f64 = 0.06,
    }
}

/// An axis in the world of what stands still.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Axis {
    /// A place on it.
    pub point: Vector3,
    /// Of length 1.
    pub direction: Vector3,
}

/// Changes of an axis: two shifts across it, and two tilts.
pub const FREE: usize = 4;

impl Axis {
    /// The axis of a motion that turns and hardly slides along it.
    pub fn of(motion: &Motion, slides: f64) -> Option<Axis> {
        let (direction, angle) = motion.rotation.axis_angle()?;
        let shift = motion.translation.vector;
        let along = shift.dot(&direction);
        if angle < TUNING.least_turn || along.abs() > slides {
            return None;
        }
        let across = shift - along * direction.into_inner();
        let point = 0.5 * (across + direction.cross(&across) / (0.5 * angle).tan());
        Some(Axis { point, direction: direction.into_inner() })
    }

    /// The turn by an angle, rad.
    pub fn turn(&self, angle: f64) -> Motion {
        let rotation = Rotation3::from_axis_angle(&Unit::new_unchecked(self.direction), angle);
        Motion::from_parts((self.point - rotation * self.point).into(), rotation.into())
    }

    /// Shifted by two lengths across it, and tilted by two angles, rad.
    pub fn changed(&self, by: &[f64; FREE]) -> Axis {
        let mut least = Vector3::zeros();
        least[self.direction.iamin()] = 1.0;
        let u = self.direction.cross(&least).normalize();
        let v = self.direction.cross(&u);
        Axis {
            point: self.point + by[0] * u + by[1] * v,
            direction: (self.direction + by[2] * u + by[3] * v).normalize(),
        }
    }

    /// How far it passes from a place.
    pub fn distance(&self, place: &Vector3) -> f64 {
        (place - self.point).cross(&self.direction).norm()
    }

    /// Whether it is about the same axis, either way round, for what reaches so far about it.
    pub fn is_like(&self, other: &Axis, reach: f64) -> bool {
        let angle = self.direction.cross(&other.direction).norm().min(1.0).asin();
        angle < TUNING.apart_angle && self.distance(&other.point) < TUNING.apart_place * reach
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turn_has_its_axis_and_a_screw_none() {
        let axis = Axis { point: Vector3::new(3.0, -2.0, 7.0), direction: Vector3::new(1.0, 2.0, -0.5).normalize() };
        let turn = axis.turn(0.8);
        let found = Axis::of(&turn, 0.1).expect("it turns");
        assert!(found.is_like(&axis, 0.01) && found.direction.dot(&axis.direction) > 0.999);
        assert!((axis.turn(-0.8) * turn).translation.vector.norm() < 1e-9);
        let screw = nalgebra::Translation3::from(axis.direction * 0.5) * turn;
        assert_eq!(Axis::of(&screw, 0.1), None);
        assert_eq!(Axis::of(&axis.turn(0.01), 0.1), None);
        assert!(!axis.changed(&[1.0, 0.0, 0.0, 0.0]).is_like(&axis, 5.0));
        assert!(!axis.changed(&[0.0, 0.0, 0.0, 0.2]).is_like(&axis, 5.0));
    }
}
