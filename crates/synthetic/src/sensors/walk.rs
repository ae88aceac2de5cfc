//! A depth camera carried through a building: one frame after the other, each seeing half or more of what the one before saw.

use std::f64::consts::TAU;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::super::scanner::ScanSet;
use super::super::scenery::{Building, Stop};
use super::SensorKind;
use super::depth_camera::frame;
use super::lens::Lens;
use super::stage::{Picture, Stage, Viewpoint};
use visage_geometry::{Motion, Point3, Vector3};

/// Pixels of a frame.
const PIXELS: f64 = 28_000.0;
/// Nothing is measured beyond, metres.
const FAR: f64 = 4.5;
/// The way is looked at in steps of so many metres, or this turn, or part of both.
const STEP_METRES: f64 = 0.1;
const STEP_RADIANS: f64 = 0.07;
/// Rays by which it is estimated how much the picture changes from step to step.
const FEELERS: f64 = 350.0;
/// A scan is taken whenever so much of the picture has changed.
const CHANGE: f64 = 0.36;
/// Scans for each room of the building: as many as it takes to come back to the first one.
const SCANS_A_ROOM: usize = 64;
/// Surfaces seen at a larger angle than this say little.
const GRAZING_DEG: f64 = 75.0;
/// How high the camera is held, and how it looks down, metres and radians.
const HEIGHT: f64 = 1.5;
const DOWN: f64 = 0.22;

/// The first `count` scans of a walk, each turned at random about its origin, and their true poses. From some sixty on they
/// go once around a building, and the last ones see what the first saw. The same arguments give the same bits.
pub fn walk(count: usize, seed: u64) -> ScanSet {
    let building = Building::new(count / SCANS_A_ROOM, seed);
    let stage = Stage::new(&building.scene, seed);
    let projection = SensorKind::DepthCamera.projection(building.scene.layout);
    let lens = Lens::of(projection, PIXELS);
    let feeler = Feeler { stage: &stage, lens: Lens::of(projection, FEELERS) };
    let goes_around = count >= SCANS_A_ROOM;
    let steps = feeler.steps(&building.way, if goes_around { f64::INFINITY } else { CHANGE * count as f64 });
    let all = steps.last().map_or(0.0, |(change, _)| *change);
    let change = if goes_around { all / count as f64 } else { CHANGE };
    let mut set = ScanSet { scans: Vec::new(), poses: Vec::new() };
    for view in 0..count {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(view as u64 + 1);
        let next = steps.partition_point(|(changed, _)| *changed < change * view as f64);
        let pose_world = held(&steps[next.min(steps.len() - 1)].1, &mut rng);
        let (picture, mut ranges) = frame(&stage, &still(pose_world), lens, &mut rng);
        for (pixel, range) in ranges.iter_mut().enumerate() {
            let forward = lens.ray(pixel, [0.0; 2]).1.z;
            *range = range.filter(|range| range * forward < FAR);
        }
        let mut number = || rng.random_range(-1.0..1.0);
        let turn = Motion::rotation(Vector3::new(number(), number(), number()) * 3.0);
        let mut surface = picture.surface(&ranges, false);
        surface.cloud = surface.cloud.moved(&turn);
        set.scans.push(surface);
        set.poses.push(pose_world * turn.inverse());
    }
    set
}

fn still(pose_world: Motion) -> Viewpoint {
    Viewpoint { pose_world, turn: Motion::identity(), travel: Vector3::zeros() }
}

/// Looks along the way with few rays.
struct Feeler<'a> {
    stage: &'a Stage,
    lens: Lens,
}

impl Feeler<'_> {
    /// The stops of the way in small steps, each with how much of the picture has changed until there, up to `most`.
    fn steps(&self, way: &[Stop], most: f64) -> Vec<(f64, Stop)> {
        let mut steps: Vec<(f64, Stop)> = Vec::new();
        let mut changed = 0.0;
        let mut seen: Vec<Point3> = Vec::new();
        for stop in way.windows(2).flat_map(|pair| between(&pair[0], &pair[1])) {
            let pose = camera(&stop, [0.0; 5]);
            if let Some((_, before)) = steps.last() {
                let now = self.seen(&pose);
                let shared = self.share(&seen, &pose).min(self.share(&now, &camera(before, [0.0; 5])));
                (changed, seen) = (changed + 1.0 - shared, now);
            } else {
                seen = self.seen(&pose);
            }
            steps.push((changed, stop));
            if changed > most {
                break;
            }
        }
        steps
    }

    /// Some places that a camera sees.
    fn seen(&self, pose: &Motion) -> Vec<Point3> {
        let picture = Picture::simple(self.stage, &still(*pose), self.lens);
        let place = |(pixel, range): (usize, &Option<f64>)| {
            let (start, way) = self.lens.ray(pixel, [0.0; 2]);
            range.filter(|range| *range < FAR).map(|range| pose * (start + way * range))
        };
        picture.ranges(GRAZING_DEG).iter().enumerate().filter_map(place).collect()
    }

    /// The share of some places that a camera sees.
    fn share(&self, places: &[Point3], pose: &Motion) -> f64 {
        let eye = Point3::from(pose.translation.vector);
        let is_seen = |place: &&Point3| {
            let local = pose.inverse_transform_point(place);
            let distance = local.coords.norm();
            distance < FAR
                && self.lens.toward(&local).is_some()
                && self.stage.is_clear(&Motion::identity(), eye, **place, 0.02 * distance)
        };
        places.iter().filter(is_seen).count() as f64 / places.len().max(1) as f64
    }
}

/// The stops from one to before the next, in small steps.
fn between(a: &Stop, b: &Stop) -> impl Iterator<Item = Stop> {
    let apart = (a.x - b.x).hypot(a.z - b.z) / STEP_METRES + (a.heading - b.heading).abs() / STEP_RADIANS;
    let (a, b, count) = (*a, *b, apart.ceil() as usize);
    (0..count).map(move |step| {
        let share = step as f64 / count as f64;
        let mixed = |from: f64, to: f64| from + (to - from) * share;
        Stop { x: mixed(a.x, b.x), z: mixed(a.z, b.z), heading: mixed(a.heading, b.heading) }
    })
}

/// The camera in a hand that is never still.
fn held(stop: &Stop, rng: &mut ChaCha8Rng) -> Motion {
    camera(stop, std::array::from_fn(|_| rng.random_range(-1.0..1.0)))
}

/// The camera at a stop, this much off (between -1 and 1): aside, up, turned, tilted, rolled.
fn camera(stop: &Stop, [aside, up, turned, tilted, rolled]: [f64; 5]) -> Motion {
    let heading = stop.heading.rem_euclid(TAU) + 0.05 * turned;
    let eye = Point3::new(stop.x + 0.06 * aside, HEIGHT + 0.08 * up, stop.z - 0.06 * aside);
    let ahead = Vector3::new(heading.sin(), 0.1 * tilted - DOWN, heading.cos());
    Motion::face_towards(&eye, &(eye + ahead), &-Vector3::y()) * Motion::rotation(Vector3::z() * (0.08 * rolled))
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_geometry::neighbours::IndexedPoints;

    /// The share of a scan's points that have one of the other scan within 6 cm.
    fn overlap(set: &ScanSet, i: usize, j: usize) -> f64 {
        let other =
            IndexedPoints::new(set.scans[j].cloud.points.iter().map(|p| p.coords.cast::<f32>().into()).collect());
        let motion = set.poses[j].inverse() * set.poses[i];
        let points: Vec<&Point3> = set.scans[i].cloud.points.iter().step_by(60).collect();
        let is_near = |p: &&&Point3| other.tree.has_within(&(motion * **p).coords.cast::<f32>().into(), 0.0036);
        points.iter().filter(is_near).count() as f64 / points.len() as f64
    }

    #[test]
    fn neighbours_on_a_walk_overlap_by_half_or_more_and_its_end_sees_its_begin() {
        let set = walk(SCANS_A_ROOM, 1);
        let mutual = |i: usize, j: usize| overlap(&set, i, j).min(overlap(&set, j, i));
        let shares: Vec<f64> = (1..set.scans.len()).map(|view| mutual(view - 1, view)).collect();
        let mean = shares.iter().sum::<f64>() / shares.len() as f64;
        assert!((0.5..0.85).contains(&mean) && shares.iter().all(|share| *share > 0.25), "{mean}: {shares:.2?}");
        assert!(mutual(0, set.scans.len() - 1) > 0.3, "{}", mutual(0, set.scans.len() - 1));
        let sizes: Vec<usize> = set.scans.iter().map(|scan| scan.cloud.len()).collect();
        assert!(sizes.iter().all(|size| (12_000..40_000).contains(size)), "{sizes:?}");
    }

    #[test]
    fn a_walk_is_the_same_again_and_another_by_seed() {
        let (set, again) = (walk(3, 1), walk(3, 1));
        assert_eq!((&set.scans, &set.poses), (&again.scans, &again.poses));
        assert_ne!(set.scans, walk(3, 2).scans);
    }
}
