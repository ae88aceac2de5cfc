//! Whole sets: a sensor goes about a scene, its neighbouring scans overlapping by 0.3 to 0.8, each scan in a frame of its own.

use std::f64::consts::TAU;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::super::scenery::{Layout, SceneKind, Scenery};
use super::lens::Lens;
use super::stage::{Picture, Seen, Stage, Viewpoint};
use super::tour::Tour;
use super::{SensorKind, carried, depth_camera, laser, panorama, phone, vehicle};
use visage_geometry::{Motion, Point3, Surface, Vector3};

/// Scans of a scene.
#[derive(Debug, Clone)]
pub struct SensorSet {
    /// The scans, each turned at random about its origin; grids, sensor positions, colours and strengths where files of such
    /// sensors have them.
    pub scans: Vec<Surface>,
    /// The true poses: scan to scene, or to what turns if it is a turntable.
    pub poses: Vec<Motion>,
    /// Of what view i sees the share that view j sees too: `overlaps[i][j]`.
    pub overlaps: Vec<Vec<f64>>,
    /// How well what each view shares with the others holds it, see [`grip`].
    pub grips: Vec<f64>,
}

impl SensorSet {
    /// The largest overlap of a view with another: the smaller share of both.
    pub fn best_overlap(&self, view: usize) -> f64 {
        let both = |other: usize| self.overlaps[view][other].min(self.overlaps[other][view]);
        (0..self.scans.len()).filter(|other| *other != view).map(both).fold(0.0, f64::max)
    }
}

/// Rays with which overlaps are estimated.
const FEELERS: f64 = 350.0;
/// Steps that are tried to the next view, in shares of the longest.
const STEPS: [f64; 9] = [0.05, 0.09, 0.14, 0.2, 0.28, 0.4, 0.55, 0.75, 1.0];
/// The least and the most pixels of a picture.
const PIXELS: [f64; 2] = [3_000.0, 60_000.0];

/// Surface seen at a smaller cosine of its angle to the normal counts as not seen.
const GRAZING_COS: f64 = 0.15;

/// A point of the subject, in the subject's frame.
#[derive(Debug, Clone, Copy)]
struct Feeler {
    place: Point3,
    normal: Vector3,
}

/// How well surface holds itself on a copy of itself: the root mean square distance that its points get from the copy's planes
/// by the motion of size 1 that changes least. Rotations are measured at the root mean square radius. 0 for planes, cylinders
/// and balls; at most 0.58, which only surface reaches whose six motions are all held equally.
fn grip(feelers: &[Feeler]) -> f64 {
    let count = feelers.len().max(1) as f64;
    let center = feelers.iter().map(|feeler| feeler.place.coords).sum::<Vector3>() / count;
    let square: f64 = feelers.iter().map(|feeler| (feeler.place.coords - center).norm_squared()).sum();
    let radius = (square / count).sqrt().max(f64::MIN_POSITIVE);
    let mut sum = nalgebra::Matrix6::<f64>::zeros();
    for Feeler { place, normal } in feelers {
        let turning = ((place.coords - center) / radius).cross(normal);
        let row = nalgebra::Vector6::new(normal.x, normal.y, normal.z, turning.x, turning.y, turning.z);
        sum += row * row.transpose() / count;
    }
    sum.symmetric_eigenvalues().min().max(0.0).sqrt()
}

/// Scans the scene `seed` of a kind by a sensor. The same arguments give the same bits.
pub fn sensor_set(kind: SensorKind, scene: SceneKind, seed: u64) -> SensorSet {
    let studio = Studio::new(kind, scene, seed);
    studio.session().run()
}

/// What holds the scene.
struct Studio {
    kind: SensorKind,
    scene: Scenery,
    stage: Stage,
    seed: u64,
}

impl Studio {
    fn new(kind: SensorKind, place: SceneKind, seed: u64) -> Self {
        let mut life = Scenery::of(place, seed);
        if kind.is_round() && life.still.is_none() {
            life = life.with_floor(seed);
        }
        let scene = life.scaled(kind.extent(life.layout) / life.extent);
        let stage = Stage::new(&scene, seed);
        // every pair of a seed gets numbers of its own
        Studio { kind, scene, stage, seed: seed * 64 + 8 * kind as u64 + place as u64 }
    }

    fn session(&self) -> Session<'_> {
        let tour = Tour::new(self.kind, &self.scene, &self.stage, self.seed);
        let projection = self.kind.projection(self.scene.layout);
        let feeler = Lens::of(projection, FEELERS);
        let first = Picture::simple(&self.stage, &tour.at(0.0, 0), feeler);
        let share = first.seen.iter().flatten().count().max(1) as f64 / feeler.pixels() as f64;
        let pixels = (self.kind.points() / share).clamp(PIXELS[0], PIXELS[1]);
        let lens = match self.kind {
            SensorKind::Vehicle => vehicle::lens(pixels),
            SensorKind::Carried if self.kind.is_aloft(self.scene.layout) => Lens::of(projection, pixels),
            SensorKind::Carried => Lens::of(projection, pixels / carried::FRAMES as f64 * 1.8),
            _ => Lens::of(projection, pixels),
        };
        Session { studio: self, tour, feeler, lens }
    }
}

/// A sensor at work.
struct Session<'a> {
    studio: &'a Studio,
    tour: Tour<'a>,
    feeler: Lens,
    lens: Lens,
}

impl Session<'_> {
    fn run(&self) -> SensorSet {
        let mut rng = ChaCha8Rng::seed_from_u64(self.studio.seed);
        rng.set_stream(u64::from(u32::MAX));
        let places = self.places(&mut rng);
        let views: Vec<Viewpoint> = places.iter().enumerate().map(|(k, along)| self.tour.at(*along, k)).collect();
        let mut set = SensorSet { scans: Vec::new(), poses: Vec::new(), overlaps: Vec::new(), grips: Vec::new() };
        for (k, view) in views.iter().enumerate() {
            rng.set_stream(k as u64);
            let (surface, pose_world) = self.scan(view, places[k], k, &mut rng);
            let mut number = || rng.random_range(-1.0..1.0);
            let turn = Motion::rotation(Vector3::new(number(), number(), number()) * 3.0);
            let sensor = surface.sensor.map(|sensor| turn * sensor);
            set.scans.push(Surface { cloud: surface.cloud.moved(&turn), sensor, ..surface });
            set.poses.push(view.turn.inverse() * pose_world * turn.inverse());
            let feelers = self.feelers(view);
            set.overlaps.push(views.iter().map(|other| self.share_seen(&feelers, other)).collect());
            let others = || views.iter().enumerate().filter(|(other, _)| *other != k);
            let shared = |feeler: &&Feeler| others().any(|(_, other)| self.sees(other, feeler));
            set.grips.push(grip(&feelers.iter().filter(shared).copied().collect::<Vec<Feeler>>()));
        }
        set
    }

    /// Places along the way whose views overlap as they shall.
    fn places(&self, rng: &mut ChaCha8Rng) -> Vec<f64> {
        let count = rng.random_range(3..=8);
        let start = match self.studio.scene.layout {
            Layout::Around | Layout::Inside => rng.random_range(0.0..TAU),
            Layout::Along | Layout::Above => 0.0,
        };
        let mut places: Vec<f64> = vec![start];
        for view in 1..count {
            let wanted = rng.random_range(0.3..0.8);
            let last = places[view - 1];
            let here = self.tour.at(last, view - 1);
            let feelers = self.feelers(&here);
            let off = |step: f64| {
                let there = self.tour.at(last + step, view);
                let share = self.share_seen(&feelers, &there).min(self.share_seen(&self.feelers(&there), &here));
                (share - wanted).abs()
            };
            let steps = STEPS.map(|share| share * self.tour.longest_step());
            let offs = steps.map(off);
            let best = (0..STEPS.len()).min_by(|a, b| offs[*a].total_cmp(&offs[*b])).unwrap_or(0);
            places.push(last + steps[best]);
        }
        places
    }

    /// Some points of what a view sees of the subject.
    fn feelers(&self, view: &Viewpoint) -> Vec<Feeler> {
        let picture = Picture::simple(&self.studio.stage, view, self.feeler);
        let feeler = |(pixel, seen): (usize, &Option<Seen>)| {
            let seen = seen.filter(|seen| seen.is_subject && seen.cos_incidence > GRAZING_COS)?;
            let (start, way) = self.feeler.ray(pixel, [0.0; 2]);
            let place = view.turn.inverse() * (view.pose_world * (start + way * seen.range));
            Some(Feeler { place, normal: seen.normal })
        };
        picture.seen.iter().enumerate().filter_map(feeler).collect()
    }

    /// Whether a view sees a point of the subject.
    fn sees(&self, view: &Viewpoint, feeler: &Feeler) -> bool {
        let local: Point3 = view.pose_world.inverse_transform_point(&(view.turn * feeler.place));
        let Some((start, way)) = self.feeler.toward(&local) else { return false };
        let range = (local - start).norm();
        let hit = self.studio.stage.first_hit(&view.turn, view.pose_world * start, view.pose_world * way);
        let is_met =
            |hit: Seen| hit.is_subject && (hit.range - range).abs() < 0.01 * range && hit.cos_incidence > GRAZING_COS;
        hit.is_some_and(is_met)
    }

    /// The share of some points that a view sees.
    fn share_seen(&self, feelers: &[Feeler], view: &Viewpoint) -> f64 {
        let seen = feelers.iter().filter(|feeler| self.sees(view, feeler)).count();
        seen as f64 / feelers.len().max(1) as f64
    }

    /// One scan, and its frame in the world.
    fn scan(&self, view: &Viewpoint, along: f64, k: usize, rng: &mut ChaCha8Rng) -> (Surface, Motion) {
        let Studio { kind, scene, stage, seed } = self.studio;
        let lens = self.lens;
        let is_rich = (seed / 64 + seed).is_multiple_of(2);
        let own = |surface: Surface| (surface, view.pose_world);
        match kind {
            SensorKind::Laser => own(laser::scan(stage, view, lens, is_rich, rng)),
            SensorKind::DepthCamera => own(depth_camera::scan(stage, view, lens, !is_rich, rng)),
            SensorKind::Phone => phone::scan(stage, view, lens, rng),
            SensorKind::Vehicle => own(vehicle::scan(stage, view, lens, is_rich, rng)),
            SensorKind::Panorama => own(panorama::scan(stage, view, lens, is_rich, rng)),
            SensorKind::Carried if kind.is_aloft(scene.layout) => carried::strip(stage, view, lens, rng),
            SensorKind::Carried => {
                let step = 0.02 * self.tour.longest_step();
                let frame =
                    |frame: usize| self.tour.at(along + step * (frame as f64 - 0.5 * (carried::FRAMES - 1) as f64), k);
                let frames: Vec<Viewpoint> = (0..carried::FRAMES).map(frame).collect();
                // on a turntable the thing is held still for a fragment
                let frames: Vec<Viewpoint> = frames.into_iter().map(|f| Viewpoint { turn: view.turn, ..f }).collect();
                carried::fragment(stage, &frames, lens, rng)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_geometry::Mesh;

    /// From a point to the nearest face.
    fn distance(p: &Point3, mesh: &Mesh) -> f64 {
        let of_face = |face: usize| {
            let [a, b, c] = mesh.corners(face);
            let normal = mesh.area_normal(face).normalize();
            let foot = p - normal * (p - a).dot(&normal);
            let is_inside =
                [(a, b), (b, c), (c, a)].iter().all(|(u, v)| (v - u).cross(&(foot - u)).dot(&normal) >= 0.0);
            let to_edge = |u: Point3, v: Point3| {
                let t = ((p - u).dot(&(v - u)) / (v - u).norm_squared()).clamp(0.0, 1.0);
                (p - (u + (v - u) * t)).norm()
            };
            if is_inside { (p - a).dot(&normal).abs() } else { to_edge(a, b).min(to_edge(b, c)).min(to_edge(c, a)) }
        };
        (0..mesh.faces.len())
            .filter(|face| mesh.area_normal(*face).norm() > 0.0)
            .map(of_face)
            .fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn true_poses_bring_the_points_of_every_sensor_onto_the_scene() {
        for &kind in SensorKind::ALL {
            for place in [SceneKind::Body, SceneKind::Terrain] {
                let studio = Studio::new(kind, place, 5);
                let set = studio.session().run();
                let reach = kind.reach(studio.scene.layout);
                // what a moving vehicle sees is off by up to half of its way
                let slack = if kind == SensorKind::Vehicle { 0.015 * reach } else { 0.0 };
                let (mut off, mut asked) = (0, 0);
                for (scan, pose) in set.scans.iter().zip(&set.poses).take(2) {
                    for point in scan.cloud.points.iter().step_by((scan.cloud.len() / 40).max(1)) {
                        let limit = 4.0 * kind.accuracy(1.3 * reach) + slack;
                        off += usize::from(distance(&(pose * point), &studio.scene.mesh) > limit);
                        asked += 1;
                    }
                }
                // flying and mixed pixels, and edges that a phone rounds
                assert!(off * 10 < asked, "{kind:?} {place:?}: {off} of {asked} points are off");
            }
        }
    }

    #[test]
    fn flat_surface_holds_nothing_and_a_corner_does() {
        let sides = |axes: &[usize]| -> Vec<Feeler> {
            let side = |axis: usize| {
                (0..100).map(move |k| {
                    let mut place = Point3::origin();
                    place[(axis + 1) % 3] = f64::from(k % 10);
                    place[(axis + 2) % 3] = f64::from(k / 10);
                    Feeler { place, normal: *Vector3::ith_axis(axis) }
                })
            };
            axes.iter().flat_map(|axis| side(*axis)).collect()
        };
        assert!(grip(&sides(&[0])) < 1e-6 && grip(&sides(&[0, 1])) < 1e-6 && grip(&[]) < 1e-6);
        assert!((0.2..0.41).contains(&grip(&sides(&[0, 1, 2]))), "{}", grip(&sides(&[0, 1, 2])));
    }

    #[test]
    fn sensors_with_a_wide_view_stand_above_the_ground() {
        for (kind, seed) in [SensorKind::Vehicle, SensorKind::Panorama].into_iter().zip(20..).cycle().take(6) {
            let studio = Studio::new(kind, SceneKind::Object, seed);
            let session = studio.session();
            for view in 0..6 {
                let eye: Point3 = session.tour.at(f64::from(view), view as usize).pose_world.translation.vector.into();
                let hit = studio.stage.first_hit(&Motion::identity(), eye, -Vector3::y());
                assert!(hit.is_some_and(|seen| seen.range > 0.2 * studio.scene.extent), "{kind:?} {seed}: {eye}");
            }
        }
    }

    #[test]
    fn of_a_turntable_the_thing_is_where_the_poses_say() {
        let studio = Studio::new(SensorKind::Laser, SceneKind::Turntable, 2);
        let set = studio.session().run();
        let on = |k: usize| {
            let world = set.scans[k].cloud.points.iter().step_by(9).map(|p| set.poses[k] * p);
            let near: Vec<f64> = world.map(|p| distance(&p, &studio.scene.mesh)).collect();
            near.iter().filter(|d| **d < 1.0).count() as f64 / near.len() as f64
        };
        for k in 0..set.scans.len() {
            assert!((0.15..0.95).contains(&on(k)), "the thing and its background: {}", on(k));
        }
    }

    #[test]
    fn the_same_seed_gives_the_same_bits_and_neighbours_overlap() {
        let (mut sum, mut count) = (0.0, 0.0);
        for &kind in SensorKind::ALL {
            for place in [SceneKind::Table, SceneKind::Street] {
                let set = sensor_set(kind, place, 7);
                let again = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
                let again = again.install(|| sensor_set(kind, place, 7));
                assert_eq!((&set.scans, &set.poses), (&again.scans, &again.poses), "{kind:?} {place:?}");
                assert_ne!(set.scans, sensor_set(kind, place, 8).scans, "{kind:?} {place:?}");
                assert!((3..=8).contains(&set.scans.len()));
                for view in 1..set.scans.len() {
                    assert!((500..40_000).contains(&set.scans[view].cloud.len()), "{kind:?} {place:?}");
                    sum += set.overlaps[view][view - 1].min(set.overlaps[view - 1][view]);
                    count += 1.0;
                }
            }
        }
        assert!((0.4..0.7).contains(&(sum / count)), "{}", sum / count);
    }
}
