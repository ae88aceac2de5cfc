//! Where sensors stand and look: a way through or around the scene on which every place has a number, so that neighbours can be
//! set as far apart as their overlap shall be.

use std::f64::consts::TAU;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::super::scenery::{Layout, Scenery};
use super::SensorKind;
use super::stage::{Stage, Viewpoint};
use visage_geometry::{Motion, Point3, Vector3};

/// A way by which a sensor goes about a scene.
pub struct Tour<'a> {
    kind: SensorKind,
    scene: &'a Scenery,
    stage: &'a Stage,
    reach: f64,
    seed: u64,
    /// The side of a street that cameras look at.
    side: f64,
}

/// How a place on the way is left at random.
struct Jitter(ChaCha8Rng);

impl Jitter {
    fn by(&mut self, most: f64) -> f64 {
        self.0.random_range(-most..most)
    }
}

impl<'a> Tour<'a> {
    /// The way of this sensor about this scene.
    pub fn new(kind: SensorKind, scene: &'a Scenery, stage: &'a Stage, seed: u64) -> Self {
        let side = if seed.is_multiple_of(2) { 1.0 } else { -1.0 };
        Tour { kind, scene, stage, reach: kind.reach(scene.layout), seed, side }
    }

    /// The longest step between neighbours: radians, or a length where the way is straight.
    pub fn longest_step(&self) -> f64 {
        match (self.scene.layout, self.kind) {
            // who sees all the way round sees much of the same until he is on the other side
            (Layout::Around | Layout::Inside, kind) if kind.is_round() => 3.0,
            (Layout::Around, _) => 1.6,
            (Layout::Inside, _) => 1.8,
            (Layout::Along, SensorKind::Carried) => 2.4 * self.reach,
            (Layout::Along, _) => 2.0 * self.reach,
            (Layout::Above, SensorKind::Carried) => 0.7 * self.reach,
            (Layout::Above, _) => 1.0,
        }
    }

    /// The place `along` the way of the view `view`, which decides how it is off the way.
    pub fn at(&self, along: f64, view: usize) -> Viewpoint {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        rng.set_stream(view as u64 + 1);
        let mut jitter = Jitter(rng);
        let pose_world = self.pose(along, &mut jitter);
        let ahead = self.pose(along + 1e-3 * self.longest_step(), &mut Jitter(ChaCha8Rng::seed_from_u64(0)));
        let here = self.pose(along, &mut Jitter(ChaCha8Rng::seed_from_u64(0)));
        let way = (ahead.translation.vector - here.translation.vector).try_normalize(1e-12).unwrap_or(Vector3::x());
        let travel = way * (0.03 * self.reach);
        if self.scene.still.is_none() {
            return Viewpoint { pose_world, turn: Motion::identity(), travel };
        }
        // the sensor stays where it is, the thing turns
        let pose_world = self.pose(0.0, &mut Jitter(ChaCha8Rng::seed_from_u64(self.seed)));
        Viewpoint { pose_world, turn: Motion::rotation(Vector3::y() * -along), travel: Vector3::zeros() }
    }

    fn pose(&self, along: f64, jitter: &mut Jitter) -> Motion {
        match self.scene.layout {
            Layout::Around => self.around(along, jitter),
            Layout::Inside => self.inside(along, jitter),
            Layout::Along => self.through(along, jitter),
            Layout::Above => self.above(along, jitter),
        }
    }

    fn around(&self, along: f64, jitter: &mut Jitter) -> Motion {
        let (center, extent) = (self.scene.center, self.scene.extent);
        let distance = self.reach * (1.0 + jitter.by(0.06));
        if self.kind.is_round() {
            let mut eye = center + level(along) * distance + Vector3::y() * (extent * (0.1 + jitter.by(0.12)));
            // beside flat things the sensor still stands on its feet
            eye.y = eye.y.max(self.height_below(&eye) + 0.3 * extent);
            return self.upright(eye, along, jitter);
        }
        let elevation = 0.4 + jitter.by(0.25);
        let outward = level(along) * elevation.cos() + Vector3::y() * elevation.sin();
        let middle = center + Vector3::new(jitter.by(0.05), jitter.by(0.05), jitter.by(0.05)) * extent;
        look(center + outward * distance, middle, -Vector3::y())
    }

    fn inside(&self, along: f64, jitter: &mut Jitter) -> Motion {
        let (center, extent) = (self.scene.center, self.scene.extent);
        let aside = Vector3::new(jitter.by(0.08), jitter.by(0.08), jitter.by(0.08)) * extent;
        if self.kind.is_round() {
            return self.upright(center + level(along) * (0.6 * extent) + aside, along, jitter);
        }
        let eye = center - level(along) * (0.5 * extent) + Vector3::y() * (0.1 * extent) + aside;
        look(eye, eye + level(along) + Vector3::y() * (jitter.by(0.12) - 0.25), -Vector3::y())
    }

    fn through(&self, along: f64, jitter: &mut Jitter) -> Motion {
        let extent = self.scene.extent;
        let length = 0.75 * self.scene.half_length;
        let z = to_and_fro(along - 0.6 * length, length);
        if self.kind == SensorKind::Carried {
            return self.downward(Point3::new(jitter.by(0.08) * extent, 0.0, z), jitter);
        }
        let eye = Point3::new(jitter.by(0.12) * extent, self.scene.center.y * (1.0 + jitter.by(0.1)), z);
        if self.kind.is_round() {
            return self.upright(eye, 0.0, jitter);
        }
        let turn = self.side * (0.95 + jitter.by(0.15));
        let eye = eye - Vector3::x() * (self.side * 0.25 * extent);
        look(eye, eye + level(turn) + Vector3::y() * jitter.by(0.08), -Vector3::y())
    }

    fn above(&self, along: f64, jitter: &mut Jitter) -> Motion {
        let extent = self.scene.extent;
        if self.kind == SensorKind::Carried {
            let x = to_and_fro(along - 0.6 * extent, 0.6 * extent);
            return self.downward(Point3::new(x, 0.0, jitter.by(0.1) * extent), jitter);
        }
        let place = self.scene.center + level(along) * (0.45 * extent);
        if self.kind.is_round() {
            let height = self.height_below(&place).max(-self.scene.extent) + 0.16 * self.reach;
            return self.upright(Point3::new(place.x, height, place.z), along, jitter);
        }
        let eye = place + Vector3::new(jitter.by(0.05), 0.75 + jitter.by(0.06), jitter.by(0.05)) * self.reach;
        let forward = level(along + 0.25 * TAU);
        let below = place + forward * ((0.25 + jitter.by(0.12)) * extent);
        look(eye, below, -forward)
    }

    /// How high the scene is at a place seen from above; far below if nothing is there.
    fn height_below(&self, place: &Point3) -> f64 {
        let top = place + Vector3::y() * (4.0 * self.scene.extent);
        let hit = self.stage.first_hit(&Motion::identity(), top, -Vector3::y());
        hit.map_or(f64::MIN, |seen| top.y - seen.range)
    }

    /// Level, but for a degree.
    fn upright(&self, eye: Point3, heading: f64, jitter: &mut Jitter) -> Motion {
        let heading = heading + jitter.by(if self.kind == SensorKind::Vehicle { 0.06 } else { 3.0 });
        let tilt = Motion::rotation(Vector3::new(jitter.by(0.02), 0.0, jitter.by(0.02)));
        look(eye, eye + level(heading), -Vector3::y()) * tilt
    }

    /// From high above, a few degrees off the vertical, flying along z.
    fn downward(&self, place: Point3, jitter: &mut Jitter) -> Motion {
        let eye = place + Vector3::y() * (2.0 * self.reach);
        let below = place + Vector3::new(jitter.by(0.3), 0.0, jitter.by(0.3)) * self.reach;
        look(eye, below, Vector3::new(jitter.by(0.15), 0.0, 1.0))
    }
}

/// The level direction at this angle from z towards x.
fn level(angle: f64) -> Vector3 {
    Vector3::new(angle.sin(), 0.0, angle.cos())
}

/// Looks at a place with the picture's y axis near a direction.
fn look(eye: Point3, at: Point3, down: Vector3) -> Motion {
    Motion::face_towards(&eye, &at, &down)
}

/// A way that turns back at both ends, `limit` from the middle.
fn to_and_fro(along: f64, limit: f64) -> f64 {
    let phase = (along / limit + 1.0).rem_euclid(4.0);
    limit * if phase < 2.0 { phase - 1.0 } else { 3.0 - phase }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_way_turns_back_at_its_ends() {
        for (along, place) in [(0.0, 0.0), (0.9, 0.9), (1.2, 0.8), (2.0, 0.0), (3.0, -1.0), (3.5, -0.5), (-1.5, -0.5)] {
            assert!((to_and_fro(2.0 * along, 2.0) - 2.0 * place).abs() < 1e-9, "{along}");
        }
    }
}
