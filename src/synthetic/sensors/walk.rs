//! A depth camera carried through a building: one frame after the other, each seeing half or more of what the one before saw.

use std::f64::consts::TAU;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::super::scanner::ScanSet;
use super::super::scenery::{Building, Stop};
use super::SensorKind;
use super::depth_camera::frame;
use super::lens::Lens;
use super::stage::{Stage, Viewpoint};
use crate::geometry::{Motion, Point3, Vector3};

/// Pixels of a frame.
const PIXELS: f64 = 28_000.0;
/// Nothing is measured beyond, metres.
const FAR: f64 = 4.5;
/// The hand goes on by one step between frames: so many metres, or this turn, or part of both.
const STEP_METRES: f64 = 0.42;
const STEP_RADIANS: f64 = 0.3;
/// Scans for each room of the building: as many as it takes to come back to the first one.
const SCANS_A_ROOM: usize = 48;
/// How high the camera is held, and how it looks down, metres and radians.
const HEIGHT: f64 = 1.5;
const DOWN: f64 = 0.22;

/// The first `count` scans of a walk, each turned at random about its origin, and their true poses. Where they are so
/// many as the building has ways, the last ones see what the first saw. The same arguments give the same bits.
pub fn walk(count: usize, seed: u64) -> ScanSet {
    let building = Building::new(count / SCANS_A_ROOM, seed);
    let stage = Stage::new(&building.scene, seed);
    let lens = Lens::of(SensorKind::DepthCamera.projection(building.scene.layout), PIXELS);
    let whole = length(&building.way);
    let step = if count >= SCANS_A_ROOM { whole / count as f64 } else { 1.0 };
    let mut set = ScanSet { scans: Vec::new(), poses: Vec::new() };
    for view in 0..count {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(view as u64 + 1);
        let pose_world = held(&at(&building.way, step * view as f64), &mut rng);
        let viewpoint = Viewpoint { pose_world, turn: Motion::identity(), travel: Vector3::zeros() };
        let (picture, mut ranges) = frame(&stage, &viewpoint, lens, &mut rng);
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

/// How far two stops are apart, in steps.
fn apart(a: &Stop, b: &Stop) -> f64 {
    (a.x - b.x).hypot(a.z - b.z) / STEP_METRES + (a.heading - b.heading).abs() / STEP_RADIANS
}

fn length(way: &[Stop]) -> f64 {
    way.windows(2).map(|pair| apart(&pair[0], &pair[1])).sum()
}

/// The place so many steps along the way.
fn at(way: &[Stop], mut along: f64) -> Stop {
    for pair in way.windows(2) {
        let part = apart(&pair[0], &pair[1]);
        if along <= part && part > 0.0 {
            let share = along / part;
            let between = |from: f64, to: f64| from + (to - from) * share;
            let (a, b) = (&pair[0], &pair[1]);
            return Stop { x: between(a.x, b.x), z: between(a.z, b.z), heading: between(a.heading, b.heading) };
        }
        along -= part;
    }
    way[way.len() - 1]
}

/// The camera in a hand that is never still.
fn held(stop: &Stop, rng: &mut ChaCha8Rng) -> Motion {
    let mut off = |most: f64| rng.random_range(-most..most);
    let eye = Point3::new(stop.x + off(0.06), HEIGHT + off(0.08), stop.z + off(0.06));
    let heading = stop.heading.rem_euclid(TAU) + off(0.05);
    let ahead = Vector3::new(heading.sin(), -DOWN + off(0.1), heading.cos());
    let roll = off(0.08);
    Motion::face_towards(&eye, &(eye + ahead), &-Vector3::y()) * Motion::rotation(Vector3::z() * roll)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registration::view::View;

    /// The share of a scan's points that have one of the other scan within 6 cm.
    fn overlap(set: &ScanSet, i: usize, j: usize) -> f64 {
        let view = View::new(&set.scans[j].cloud).expect("a frame can be used");
        let motion = view.local_pose(&set.poses[j]).inverse() * set.poses[i];
        let points: Vec<&Point3> = set.scans[i].cloud.points.iter().step_by(60).collect();
        let is_near = |p: &&&Point3| view.indexed.tree.has_within(&(motion * **p).coords.cast::<f32>().into(), 0.0036);
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
