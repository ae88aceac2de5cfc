//! Registration from scans alone: code-made scans whose true poses are known, and are not told.

use std::collections::BTreeMap;

use visage::geometry::{Motion, Point3, Surface, Unit, Vector3};
use visage::pipeline::{self, NamedScan, Options, RegisteredModel};
use visage::progress::Progress;
use visage::synthetic::objects;
use visage::synthetic::scanner::{ScanSet, Scanner};
use visage::synthetic::truth::pose_error;

const SCANNER: Scanner = Scanner { views: 8, distance: 600.0, resolution: 2.5, noise: 0.15, grazing_angle: 75.0 };

/// Scans as a stranger would bring them: each in a frame of its own, nothing known of the scanner.
struct Stranger {
    scans: Vec<NamedScan>,
    /// True poses of the turned scans.
    truth: Vec<Motion>,
}

impl Stranger {
    fn of(set: &ScanSet) -> Self {
        let turn = |view: usize| {
            let axis = Vector3::new(1.0, 0.3 * view as f64 - 1.0, 0.5).normalize();
            Motion::new(Vector3::new(40.0, -7.0, 3.0) * view as f64, axis * (0.9 * view as f64 + 0.4))
        };
        let scan = |(view, surface): (usize, &Surface)| NamedScan {
            name: format!("s{view}.ply"),
            surface: Surface { cloud: surface.cloud.moved(&turn(view)), ..Surface::default() },
        };
        Stranger {
            scans: set.scans.iter().enumerate().map(scan).collect(),
            truth: set.poses.iter().enumerate().map(|(view, pose)| pose * turn(view).inverse()).collect(),
        }
    }

    fn run(&self, given: &[(usize, Motion)], threads: usize) -> RegisteredModel {
        let given: BTreeMap<String, Motion> = given.iter().map(|(view, m)| (format!("s{view}.ply"), *m)).collect();
        let options = Options { cloud: false, signature: false, ..Options::default() };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool of threads");
        pool.install(|| pipeline::run(self.scans.clone(), &given, Unit::Mm, &options, &Progress::silent()))
            .unwrap_or_else(|error| panic!("{error}"))
    }

    /// Asserts that every view has its place, to within `points_mm`.
    fn assert_placed(&self, outcome: &RegisteredModel, points_mm: f64) {
        let found: Vec<Motion> = outcome.poses.iter().map(|(name, pose)| pose.expect(name)).collect();
        let samples: Vec<Vec<Point3>> =
            self.scans.iter().map(|scan| scan.surface.cloud.points.iter().step_by(7).copied().collect()).collect();
        let error = pose_error(&found, &self.truth, &samples);
        assert!(error.points_rms < points_mm, "{error:?}");
    }
}

fn origins(outcome: &RegisteredModel) -> Vec<String> {
    let views = outcome.report.to_json()["views"].as_array().cloned().expect("a report has views");
    views.iter().map(|view| view["pose"].as_str().unwrap_or("none").to_owned()).collect()
}

#[test]
fn scans_alone_are_placed_and_any_number_of_threads_gives_the_same() {
    let stranger = Stranger::of(&SCANNER.scan_set(&objects::blob(1, 20_000).mesh, 1));
    let outcome = stranger.run(&[], 2);
    stranger.assert_placed(&outcome, 0.3);
    assert_eq!(origins(&outcome), ["found"; 8]);
    assert_eq!(outcome.report.to_json()["verdict"]["quality"], "good");
    let first = outcome.poses[0].1.expect("view 0 is placed");
    assert!((first.to_homogeneous() - Motion::identity().to_homogeneous()).amax() < 1e-9, "view 0 fixes the world");
    let alone = stranger.run(&[], 1);
    assert_eq!((alone.poses, alone.report), (outcome.poses, outcome.report));
}

#[test]
fn a_missing_pose_is_found_and_a_wrong_one_corrected() {
    let stranger = Stranger::of(&SCANNER.scan_set(&objects::blob(2, 20_000).mesh, 2));
    let mut given: Vec<(usize, Motion)> = stranger.truth.iter().copied().enumerate().collect();
    given[5].1 = Motion::new(Vector3::new(90.0, 0.0, 50.0), Vector3::y() * 2.0) * given[5].1;
    given.remove(2);
    let outcome = stranger.run(&given, 2);
    stranger.assert_placed(&outcome, 0.3);
    let mut expected = ["given"; 8];
    (expected[2], expected[5]) = ("found", "corrected");
    assert_eq!(origins(&outcome), expected);
}

#[test]
fn two_objects_come_back_as_two_groups_and_a_foreign_scan_unplaced() {
    let scanner = Scanner { views: 6, ..SCANNER };
    let mut set = scanner.scan_set(&objects::blob(3, 20_000).mesh, 3);
    let jug = scanner.scan_set(&objects::jug().mesh, 4);
    let bump = scanner.scan_set(&objects::blob(9, 20_000).mesh, 9);
    for (other, count) in [(jug, 5), (bump, 1)] {
        set.scans.extend(other.scans.into_iter().take(count));
        set.poses.extend(other.poses.into_iter().take(count));
    }
    let outcome = Stranger::of(&set).run(&[], 2);
    assert!(outcome.poses[..6].iter().all(|(_, pose)| pose.is_some()));
    assert!(outcome.poses[6..].iter().all(|(_, pose)| pose.is_none()));
    let groups = outcome.report.to_json()["groups"].as_array().cloned().expect("groups are told");
    for (group, of_one) in groups.iter().zip([0..6, 6..11]) {
        let names: Vec<usize> = (0..12)
            .filter(|k| group["views"].as_array().into_iter().flatten().any(|n| *n == format!("s{k}.ply")))
            .collect();
        assert!(names.iter().all(|k| of_one.contains(k)), "{names:?} are of one object");
    }
    // the jug's scans may come back in more than one group: what counts is that none is mixed
    assert!((2..=3).contains(&groups.len()), "{groups:?}");
    assert!(outcome.report.to_json()["views"][11]["unplaced"].is_string());
    assert_ne!(outcome.report.to_json()["verdict"]["quality"], "good");
}
