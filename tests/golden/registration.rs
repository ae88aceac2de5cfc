//! Registration of code-made scans whose true poses are known.

use std::collections::BTreeMap;

use visage::formats::{ply, poses};
use visage::geometry::{Motion, Point3, Unit};
use visage::pipeline::{self, Method, NamedScan, Options, PipelineError, RegisteredModel};
use visage::progress::Progress;
use visage::registration::quality::Quality;
use visage::synthetic::head::{Proportions, head};
use visage::synthetic::scanner::{ScanSet, Scanner};
use visage::synthetic::truth::{PoseError, disturb, pose_error};
use visage::synthetic::{Specimen, objects};

/// About 5000 points a scan, 2.5 mm apart: coarse, so that these tests stay quick.
const SCANNER: Scanner = Scanner { views: 8, distance: 600.0, resolution: 2.5, noise: 0.15, grazing_angle: 75.0 };

fn names(views: usize) -> Vec<String> {
    (0..views).map(|view| format!("scan_{view:02}.ply")).collect()
}

fn run(set: &ScanSet, initial: &[Motion], threads: usize, options: &Options) -> Result<RegisteredModel, PipelineError> {
    let names = names(set.scans.len());
    let scans = names.iter().zip(&set.scans);
    let scans = scans.map(|(name, surface)| NamedScan { name: name.clone(), surface: surface.clone() }).collect();
    let initial: BTreeMap<String, Motion> = names.into_iter().zip(initial.iter().copied()).collect();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool of threads");
    pool.install(|| pipeline::run(scans, &initial, Unit::Mm, options, &Progress::silent()))
}

fn quick() -> Options {
    Options { cloud: false, signature: false, ..Options::default() }
}

/// Every 7th point of each scan, to measure errors on.
fn samples(set: &ScanSet) -> Vec<Vec<Point3>> {
    set.scans.iter().map(|scan| scan.cloud.points.iter().step_by(7).copied().collect()).collect()
}

fn placed(outcome: &RegisteredModel) -> Vec<Motion> {
    let pose = |(name, pose): &(String, Option<Motion>)| pose.unwrap_or_else(|| panic!("{name} is unplaced"));
    outcome.poses.iter().map(pose).collect()
}

/// Scans `specimen`, disturbs the poses by `angle` radians and `shift` mm, registers, and compares with the truth.
fn register(scanner: &Scanner, specimen: &Specimen, angle: f64, shift: f64, seed: u64) -> PoseError {
    let set = scanner.scan_set(&specimen.mesh, seed);
    let initial = disturb(&set.poses, angle, shift, seed);
    let outcome = run(&set, &initial, 2, &quick()).unwrap_or_else(|error| panic!("{error}"));
    pose_error(&placed(&outcome), &set.poses, &samples(&set))
}

fn assert_accurate(what: &str, error: PoseError, rotation_deg: f64, points_mm: f64) {
    println!("{what}: {error:?}");
    assert!(error.rotation_deg_max <= rotation_deg, "{what}: {error:?}");
    assert!(error.points_rms <= points_mm, "{what}: {error:?}");
}

#[test]
fn blobs_are_registered() {
    for seed in 1..=3 {
        let error = register(&SCANNER, &objects::blob(seed, 20_000), 0.05, 5.0, seed);
        assert_accurate(&format!("blob {seed}"), error, 0.4, 0.3);
    }
}

#[test]
fn a_head_and_a_jug_are_registered() {
    assert_accurate("head", register(&SCANNER, &head(&Proportions::of(1)), 0.06, 6.0, 1), 0.4, 0.3);
    assert_accurate("jug", register(&SCANNER, &objects::jug(), 0.05, 5.0, 2), 0.4, 0.3);
}

#[test]
fn finer_scans_give_finer_poses() {
    let scanner = Scanner { resolution: 1.25, ..SCANNER };
    assert_accurate("head", register(&scanner, &head(&Proportions::of(1)), 0.06, 6.0, 1), 0.05, 0.05);
}

#[test]
fn two_scans_are_registered_by_icp_alone() {
    let set = SCANNER.scan_set(&objects::blob(1, 20_000).mesh, 1);
    let two = ScanSet { scans: set.scans[..2].to_vec(), poses: set.poses[..2].to_vec() };
    let initial = disturb(&two.poses, 0.03, 2.0, 1);
    let mut errors = Vec::new();
    for method in [Method::Tricp, Method::Icp] {
        let outcome = run(&two, &initial, 2, &Options { method, ..quick() }).expect("two sound scans");
        errors.push(pose_error(&placed(&outcome), &two.poses, &samples(&two)).points_rms);
        assert!(outcome.report.to_json()["pairs"][0]["e_thr"].is_null());
    }
    println!("tricp {:.3}, icp {:.3} mm", errors[0], errors[1]);
    assert!(errors[0] < 1.0, "tricp: {} mm", errors[0]);
    assert!(errors[1] > errors[0], "untrimmed, the points that the other scan did not see pull");
}

#[test]
fn view_0_keeps_its_pose_and_fixes_the_world() {
    let set = SCANNER.scan_set(&objects::blob(4, 20_000).mesh, 4);
    let outcome = run(&set, &disturb(&set.poses, 0.04, 3.0, 4), 2, &quick()).expect("a sound set");
    assert_eq!(outcome.poses[0].0, "scan_00.ply");
    let first = outcome.poses[0].1.expect("view 0 is placed");
    assert!((first.to_homogeneous() - set.poses[0].to_homogeneous()).amax() < 1e-9);
}

#[test]
fn any_number_of_threads_gives_the_same_bytes() {
    let set = SCANNER.scan_set(&objects::blob(5, 20_000).mesh, 5);
    let initial = disturb(&set.poses, 0.05, 4.0, 5);
    let options = Options { signature: false, ..Options::default() };
    let bytes = |threads: usize| {
        let outcome = run(&set, &initial, threads, &options).expect("a sound set");
        let model = outcome.cloud.expect("a cloud was asked for");
        let cloud = ply::write_cloud(&model.cloud, Some(&model.views));
        (poses::write_json(&outcome.poses), cloud, outcome.report.to_json().to_string(), outcome.mesh)
    };
    let one = bytes(1);
    for threads in [2, 3] {
        let several = bytes(threads);
        assert_eq!(one.0, several.0, "poses with {threads} threads");
        assert!(one.1 == several.1, "cloud with {threads} threads");
        assert_eq!(one.2, several.2, "report with {threads} threads");
        assert!(one.3.is_some() && one.3 == several.3, "mesh with {threads} threads");
    }
}

#[test]
fn normals_of_the_merged_cloud_point_outward() {
    let specimen = objects::blob(6, 20_000);
    let set = SCANNER.scan_set(&specimen.mesh, 6);
    let options = Options { signature: false, sensor: Some([0.0; 3]), ..Options::default() };
    let outcome = run(&set, &disturb(&set.poses, 0.04, 3.0, 6), 2, &options).expect("a sound set");
    let model = outcome.cloud.expect("a cloud was asked for");
    assert_eq!(model.views.len(), model.cloud.len());
    let normals = model.cloud.normals.as_ref().expect("the cloud has normals");
    // the blob is star-shaped about the origin of the world
    let outward = normals.iter().zip(&model.cloud.points).filter(|(n, p)| n.cast::<f64>().dot(&p.coords) > 0.0);
    let share = outward.count() as f64 / normals.len() as f64;
    assert!(share > 0.99, "{share} of the normals point outward");
}

#[test]
fn a_scan_of_something_else_does_not_pass_unnoticed() {
    let mut set = SCANNER.scan_set(&objects::blob(7, 20_000).mesh, 7);
    set.scans[3] = SCANNER.scan_set(&objects::jug().mesh, 7).scans[3].clone();
    let outcome = run(&set, &disturb(&set.poses, 0.03, 3.0, 7), 2, &quick()).expect("the others can be registered");
    let unplaced = outcome.poses[3].1.is_none();
    let quality = outcome.report.registration.verdict.quality;
    assert!(unplaced || quality != Quality::Good, "an alien scan is placed and the verdict is {quality:?}");
}

#[test]
fn sets_that_cannot_be_registered_are_refused_with_a_code() {
    let set = SCANNER.scan_set(&objects::blob(8, 5_000).mesh, 8);
    let refused = |set: &ScanSet, initial: &[Motion]| match run(set, initial, 1, &quick()) {
        Err(PipelineError::Unusable { code, hint, .. }) => {
            assert!(!hint.is_empty());
            code
        }
        other => panic!("{other:?} instead of a refusal"),
    };
    let one = ScanSet { scans: set.scans[..1].to_vec(), poses: set.poses[..1].to_vec() };
    assert_eq!(refused(&one, &one.poses), "too_few_scans");
    let pairwise = Options { method: Method::Tricp, ..quick() };
    match run(&set, &set.poses, 1, &pairwise) {
        Err(PipelineError::Unusable { code: "wrong_scan_count", .. }) => {}
        other => panic!("{other:?}: tricp takes two scans"),
    }
    let mut degenerate = set.clone();
    let point = degenerate.scans[2].cloud.points[0];
    degenerate.scans[2].cloud.points.fill(point);
    assert_eq!(refused(&degenerate, &set.poses), "degenerate_scan");
}
