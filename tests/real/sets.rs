//! Scan sets of many kinds of scanner, each scan turned at random, from the scans alone. Needs the data folder in
//! VISAGE_DATA: `cargo test --release --test real sets -- --ignored --nocapture`.

use std::collections::BTreeMap;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use visage::formats::{self, ReadLimits};
use visage::geometry::{Motion, Point3, Surface, Unit, Vector3};
use visage::pipeline::{self, NamedScan, Options, RegisteredModel};
use visage::progress::Progress;

use crate::{data, read};

/// A placed view is right within this share of the set's size (root mean square),
const OFF: f64 = 0.01;
/// and this angle.
const OFF_DEGREES: f64 = 2.0;

/// A set with its scans turned at random about their own origins.
struct Set {
    scans: Vec<NamedScan>,
    /// The true poses of the turned scans, where they are known.
    truth: Option<Vec<Motion>>,
}

impl Set {
    fn read(name: &str, seed: u64) -> Set {
        let folder = data(&format!("real/{name}"));
        let files = std::fs::read_dir(&folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
        let mut names: Vec<String> =
            files.flatten().map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
        names.retain(|name| [".ply", ".pcd", ".obj"].iter().any(|ending| name.ends_with(ending)));
        names.sort();
        let file = folder.join("gt.json");
        let known = file.exists().then(|| formats::poses::read("gt.json", &read(&file)).expect("sound poses").poses);
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut truth = Vec::new();
        let scans = names.iter().map(|name| {
            let surface =
                formats::read_surface(name, &read(folder.join(name)), &ReadLimits::default()).expect("a sound scan");
            let mut number = || rng.random_range(-1.0..1.0);
            let turn = Motion::new(Vector3::zeros(), Vector3::new(number(), number(), number()) * 3.0);
            let pose = known.as_ref().and_then(|known| known.iter().find(|(file, _)| file == name));
            truth.extend(pose.map(|(_, pose)| pose * turn.inverse()));
            NamedScan {
                name: name.clone(),
                surface: Surface { cloud: surface.cloud.moved(&turn), ..Surface::default() },
            }
        });
        let scans: Vec<NamedScan> = scans.collect();
        let truth = (truth.len() == scans.len()).then_some(truth);
        Set { scans, truth }
    }

    /// For each placed view how far off it is, as a share of the set's size, and by which angle; the first of them fixes
    /// the world.
    fn errors(&self, outcome: &RegisteredModel) -> Vec<(f64, f64)> {
        let truth = self.truth.as_ref().expect("the set has true poses");
        let poses: BTreeMap<&str, Motion> =
            outcome.poses.iter().filter_map(|(name, pose)| Some((name.as_str(), (*pose)?))).collect();
        let points: Vec<Vec<Point3>> =
            self.scans.iter().map(|scan| scan.surface.cloud.points.iter().step_by(17).copied().collect()).collect();
        let mut world: Vec<Point3> = Vec::new();
        for (points, pose) in points.iter().zip(truth) {
            world.extend(points.iter().map(|point| pose * point));
        }
        let extent = |axis: usize| {
            let mut along: Vec<f64> = world.iter().map(|point| point[axis]).collect();
            along.sort_by(f64::total_cmp);
            let at = |share: f64| along[(share * (along.len() - 1) as f64) as usize];
            at(0.99) - at(0.01)
        };
        let size = Vector3::new(extent(0), extent(1), extent(2)).norm();
        let of_scan = |scan: &NamedScan| poses.get(scan.name.as_str());
        let placed = self.scans.iter().zip(truth).find_map(|(scan, truth)| Some(truth * of_scan(scan)?.inverse()));
        let Some(first) = placed else { return Vec::new() };
        let error = |((scan, points), truth): ((&NamedScan, &Vec<Point3>), &Motion)| {
            let pose = first * of_scan(scan)?;
            let squares: f64 = points.iter().map(|p| (pose * p - truth * p).norm_squared()).sum();
            let angle = pose.rotation.angle_to(&truth.rotation).to_degrees();
            Some(((squares / points.len() as f64).sqrt() / size, angle))
        };
        self.scans.iter().zip(&points).zip(truth).filter_map(error).collect()
    }
}

fn registered(set: &Set) -> RegisteredModel {
    let options = Options { cloud: false, signature: false, ..Options::default() };
    pipeline::run(set.scans.clone(), &BTreeMap::new(), Unit::Unknown, &options, &Progress::silent())
        .expect("a set that can be registered")
}

/// Each set turned in three ways. A few are not placed whole at each turn (the laser scans of a sculpture lack a view, the
/// street is once not placed), but no placed view is wrong. `geo_demo_pair` is not among them: it ends 1.2 % off
/// (docs/results/real_scans.md).
#[test]
#[ignore = "needs VISAGE_DATA"]
fn sets_of_many_scanners_are_placed_from_their_scans_alone() {
    let names = ["car_pair", "hippo", "iphone_desk3", "kitchen_pair", "lion6", "lpm_tutorial", "tsdf_office8"];
    let (mut whole, mut good) = (0, 0);
    for seed in [11, 2, 4] {
        for name in names {
            let set = Set::read(name, seed);
            let outcome = registered(&set);
            let quality = &outcome.report.to_json()["verdict"]["quality"];
            let errors = set.errors(&outcome);
            println!("{name}, turn {seed}: {quality} {errors:.4?}");
            assert!(errors.iter().all(|(off, degrees)| *off < OFF && *degrees < OFF_DEGREES), "{name}: {errors:?}");
            whole += usize::from(errors.len() == set.scans.len());
            good += usize::from(quality == "good");
        }
    }
    assert!(whole >= 16, "{whole} of 21 are placed whole");
    assert!(good >= 13, "{good} of 21 are good");
}

/// It fits itself at any turn; only what is printed on it tells that the poses are wrong.
#[test]
#[ignore = "needs VISAGE_DATA"]
fn a_bottle_that_was_turned_before_a_still_camera_is_not_called_good() {
    let outcome = registered(&Set::read("nbv_bottle7", 11));
    let verdict = &outcome.report.to_json()["verdict"];
    assert_ne!(verdict["quality"], "good");
    assert!(verdict["reasons"].to_string().contains("colours"), "{verdict}");
}
