//! Scans in different units, scans added to a finished model, and the choice of the reference: on code-made scans.

use std::collections::BTreeMap;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use visage::formats::poses;
use visage::geometry::{Cloud, Motion, Point3, Surface, Unit};
use visage::pipeline::{self, NamedScan, Options, PipelineError, RegisteredModel, Scale, Start};
use visage::progress::Progress;
use visage::synthetic::objects;
use visage::synthetic::scanner::{ScanSet, Scanner};
use visage::synthetic::shapes::catalogue;
use visage::synthetic::truth::{disturb, pose_error};

/// About 5000 points a scan, 2.5 mm apart: coarse, so that these tests stay quick.
const SCANNER: Scanner = Scanner { views: 8, distance: 600.0, resolution: 2.5, noise: 0.15, grazing_angle: 75.0 };

fn name(view: usize) -> String {
    format!("scan_{view:02}.ply")
}

fn named(scans: &[Surface]) -> Vec<NamedScan> {
    scans.iter().enumerate().map(|(view, scan)| NamedScan { name: name(view), surface: scan.clone() }).collect()
}

fn start(poses: &[Motion]) -> Start {
    Start::from(&poses.iter().enumerate().map(|(view, pose)| (name(view), *pose)).collect::<BTreeMap<_, _>>())
}

fn run(scans: Vec<NamedScan>, start: &Start, options: &Options) -> Result<RegisteredModel, PipelineError> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().expect("a pool of threads");
    pool.install(|| pipeline::run_from(scans, start, Unit::Mm, options, &Progress::silent()))
}

fn quick() -> Options {
    Options { cloud: false, signature: false, ..Options::default() }
}

fn code(refused: Result<RegisteredModel, PipelineError>) -> &'static str {
    match refused {
        Err(PipelineError::Unusable { code, .. }) => code,
        other => panic!("{other:?} instead of a refusal"),
    }
}

fn placed(outcome: &RegisteredModel) -> Vec<Motion> {
    outcome.poses.iter().map(|(name, pose)| pose.unwrap_or_else(|| panic!("{name} is unplaced"))).collect()
}

/// Every 7th point of each scan, to measure errors on.
fn samples(scans: &[Surface]) -> Vec<Vec<Point3>> {
    scans.iter().map(|scan| scan.cloud.points.iter().step_by(7).copied().collect()).collect()
}

/// The scans as scanners with other units would have given them: coordinates divided by `factors`.
fn in_other_units(set: &ScanSet, factors: &[f64]) -> Vec<Surface> {
    let scaled = |(scan, factor): (&Surface, &f64)| Surface {
        cloud: Cloud::from_points(scan.cloud.points.iter().map(|p| p / *factor).collect()),
        ..Surface::default()
    };
    set.scans.iter().zip(factors).map(scaled).collect()
}

#[test]
fn scales_are_recovered_to_a_tenth_of_a_percent() {
    let factors = [1.0, 0.8, 1.25, 1.1, 0.93, 1.2, 0.85, 1.0];
    for (seed, specimen) in [(1, objects::blob(1, 20_000)), (2, objects::jug())] {
        let set = SCANNER.scan_set(&specimen.mesh, seed);
        let scans = in_other_units(&set, &factors);
        let options = Options { scale: Scale::PerView, cloud: seed == 2, ..quick() };
        let outcome = run(named(&scans), &start(&disturb(&set.poses, 0.04, 4.0, seed)), &options).expect("a sound set");
        let views = outcome.report.to_json()["views"].as_array().cloned().expect("views are reported");
        for (view, (entry, factor)) in views.iter().zip(factors).enumerate() {
            let error = entry["scale"].as_f64().expect("scales are reported") / factor - 1.0;
            assert!(error.abs() < 1e-3, "view {view} of {seed} is off by {:.3} %", error * 100.0);
        }
        assert_eq!(outcome.report.to_json()["verdict"]["quality"], "good");
        let error = pose_error(&placed(&outcome), &set.poses, &samples(&set.scans));
        assert!(error.rotation_deg_max < 0.4 && error.points_rms < 0.4, "{error:?}");
        // matrices and cloud hold the scales: both bring the scan's own points to one place
        let Some(cloud) = outcome.cloud else { continue };
        let matrix = outcome.matrices[2].1.expect("placed");
        let first = scans[..2].iter().map(|scan| scan.cloud.len()).sum::<usize>();
        let p = scans[2].cloud.points[0];
        let x = matrix[0][0] * p.x + matrix[0][1] * p.y + matrix[0][2] * p.z + matrix[0][3];
        assert!((x - cloud.cloud.points[first].x).abs() < 1e-6);
    }
}

#[test]
fn scales_can_be_taken_up_again_but_not_left_out_unseen() {
    let set = SCANNER.scan_set(&objects::blob(3, 20_000).mesh, 3);
    let scans = in_other_units(&set, &[1.0, 0.9, 1.1, 1.0, 1.0, 1.0, 1.0, 1.0]);
    let options = Options { scale: Scale::PerView, ..quick() };
    let first = run(named(&scans), &start(&set.poses), &options).expect("a sound set");
    let file = poses::read_scaled("poses.json", poses::write_matrices(&first.matrices).as_bytes()).expect("our own");
    let again = Start { poses: file.to_map(), scales: file.scales, ..Start::default() };
    assert_eq!(code(run(named(&scans), &again, &quick())), "scaled_pose");
    let second = run(named(&scans), &again, &options).expect("a sound set");
    let scale = |outcome: &RegisteredModel| outcome.report.to_json()["views"][2]["scale"].as_f64().expect("a scale");
    assert!((scale(&first) / scale(&second) - 1.0).abs() < 2e-4);
    let method = Options { method: "ma-aticp".parse().expect("a method"), ..options };
    assert_eq!(code(run(named(&scans), &start(&set.poses), &method)), "bad_option");
    let far = Options { sensor: Some([0.0, 1e20, 0.0]), ..quick() };
    assert_eq!(code(run(named(&scans), &start(&set.poses), &far)), "bad_option");
}

#[test]
fn a_scan_is_added_and_the_model_stays_to_the_last_bit() {
    let set = SCANNER.scan_set(&objects::blob(5, 20_000).mesh, 5);
    let initial = disturb(&set.poses, 0.04, 4.0, 5);
    let base = run(named(&set.scans[..7]), &start(&initial[..7]), &quick()).expect("a sound set");
    let file = poses::read_scaled("poses.json", poses::write_matrices(&base.matrices).as_bytes()).expect("our own");
    let add = Start { base: file.matrices, ..start(&initial) };
    let outcome = run(named(&set.scans), &add, &quick()).expect("one is added");
    assert_eq!(poses::write_matrices(&outcome.matrices[..7]), poses::write_matrices(&base.matrices));
    let fixed: Vec<bool> = (0..8).map(|view| outcome.report.to_json()["views"][view]["fixed"] == true).collect();
    assert_eq!(fixed, [true, true, true, true, true, true, true, false]);
    let pairs = outcome.report.to_json()["pairs"].as_array().cloned().expect("pairs are reported");
    assert!(!pairs.is_empty() && pairs.iter().all(|pair| pair["j"] == 7), "only the added view was registered");
    assert_eq!(outcome.report.to_json()["verdict"]["quality"], "good");
    let error = pose_error(&placed(&outcome), &set.poses, &samples(&set.scans));
    assert!(error.rotation_deg_max < 0.4 && error.points_rms < 0.3, "{error:?}");

    let all = |outcome: &RegisteredModel| Start { base: matrices(outcome), ..start(&initial) };
    assert_eq!(code(run(named(&set.scans), &all(&outcome), &quick())), "nothing_to_add");
    let elsewhere = Start { base: [("x.ply".to_owned(), add.base["scan_00.ply"])].into(), ..start(&initial) };
    assert_eq!(code(run(named(&set.scans), &elsewhere, &quick())), "wrong_base");
    let reference = Options { reference: Some(name(1)), ..quick() };
    assert_eq!(code(run(named(&set.scans), &add, &reference)), "bad_option");
}

fn matrices(outcome: &RegisteredModel) -> BTreeMap<String, pipeline::PoseMatrix> {
    outcome.matrices.iter().filter_map(|(name, matrix)| Some((name.clone(), (*matrix)?))).collect()
}

#[test]
fn a_scan_in_another_unit_is_added_with_its_scale() {
    let set = SCANNER.scan_set(&objects::blob(6, 20_000).mesh, 6);
    let base = run(named(&set.scans[..6]), &start(&set.poses[..6]), &quick()).expect("a sound set");
    let scans = in_other_units(&set, &[1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.2, 0.85]);
    let add = Start { base: matrices(&base), ..start(&disturb(&set.poses, 0.03, 3.0, 6)) };
    let options = Options { scale: Scale::PerView, ..quick() };
    let outcome = run(named(&scans), &add, &options).expect("two are added");
    let scale = |view: usize| outcome.report.to_json()["views"][view]["scale"].as_f64().expect("scales are reported");
    assert_eq!((0..6).map(scale).collect::<Vec<_>>(), [1.0; 6]);
    assert!((scale(6) / 1.2 - 1.0).abs() < 1e-3 && (scale(7) / 0.85 - 1.0).abs() < 1e-3, "{} {}", scale(6), scale(7));
    assert_eq!(poses::write_matrices(&outcome.matrices[..6]), poses::write_matrices(&base.matrices));
}

#[test]
fn a_model_whose_scans_were_converted_is_added_to() {
    let set = SCANNER.scan_set(&objects::blob(8, 20_000).mesh, 8);
    let initial = disturb(&set.poses, 0.04, 4.0, 8);
    // the second scan is in metres
    let mut factors = [1.0; 8];
    factors[1] = 1000.0;
    let all = named(&in_other_units(&set, &factors));
    let register = |count: usize, base: BTreeMap<String, pipeline::PoseMatrix>, said: bool| {
        let mut scans = all[..count].to_vec();
        let names: Vec<String> = scans.iter().map(|scan| scan.name.clone()).collect();
        let said = if said { [(name(1), Unit::M)].into() } else { BTreeMap::new() };
        let declared: Vec<_> = names.iter().map(|name| (name.as_str(), None)).collect();
        let mut settled = pipeline::units::settle(Some(Unit::Mm), &declared, &said).expect("clear");
        let mut start = Start { base, ..start(&initial[..count]) };
        settled.apply(&mut scans, &mut start);
        let mut outcome = run(scans, &start, &quick()).expect("a sound set");
        settled.undo(&names, &mut outcome);
        outcome
    };
    let base = register(7, BTreeMap::new(), true);
    assert!((base.matrices[1].1.expect("placed")[0][0].hypot(base.matrices[1].1.expect("placed")[1][0])) > 100.0);
    let file = poses::read_scaled("poses.json", poses::write_matrices(&base.matrices).as_bytes()).expect("our own");
    // whether the unit is said again or not: the matrix holds the scale
    for said in [true, false] {
        let outcome = register(8, file.matrices.clone(), said);
        assert_eq!(poses::write_matrices(&outcome.matrices[..7]), poses::write_matrices(&base.matrices), "{said}");
        assert_eq!(outcome.report.to_json()["verdict"]["quality"], "good", "{said}");
        let ends = |all: &[Motion]| [all[0], all[7]];
        let error = pose_error(
            &ends(&placed(&outcome)),
            &ends(&set.poses),
            &samples(&[set.scans[0].clone(), set.scans[7].clone()]),
        );
        assert!(error.rotation_deg_max < 0.4, "{said}: {error:?}");
    }
}

#[test]
fn the_reference_keeps_its_pose_and_comes_first() {
    let set = SCANNER.scan_set(&objects::blob(7, 20_000).mesh, 7);
    let mut initial = disturb(&set.poses, 0.04, 3.0, 7);
    initial[3] = set.poses[3];
    let options = Options { reference: Some(name(3)), ..quick() };
    let outcome = run(named(&set.scans), &start(&initial), &options).expect("a sound set");
    let order: Vec<&str> = outcome.poses.iter().map(|(name, _)| &name[5..7]).collect();
    assert_eq!(order, ["03", "00", "01", "02", "04", "05", "06", "07"]);
    let kept = outcome.poses[0].1.expect("the reference is placed");
    assert!((kept.to_homogeneous() - set.poses[3].to_homogeneous()).amax() < 1e-9);
    let moved = outcome.poses[1].1.expect("placed");
    assert!((moved.to_homogeneous() - initial[0].to_homogeneous()).amax() > 1e-3, "the first scan is free now");
    let unknown = Options { reference: Some("nobody.ply".to_owned()), ..quick() };
    assert_eq!(code(run(named(&set.scans), &start(&initial), &unknown)), "unknown_reference");
}

#[test]
#[ignore = "long: fifty-two registrations"]
fn scales_of_fifty_two_sets_are_recovered_or_doubted() {
    let blobs = (1..=20).map(|seed| (format!("blob {seed}"), seed, objects::blob(seed, 20_000).mesh));
    let names = ["head", "animal", "figure", "teapot", "coral", "gem", "crank", "house"];
    let shapes = catalogue().into_iter().filter(|shape| names.contains(&shape.name));
    let shapes =
        shapes.flat_map(|shape| (1..=4).map(move |seed| (format!("{} {seed}", shape.name), seed, shape.mesh(seed))));
    let (mut bodies, mut good, mut count): (f64, f64, usize) = (0.0, 0.0, 0);
    for (name, seed, mesh) in blobs.chain(shapes) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let factors: Vec<f64> = (0..8).map(|view| if view == 0 { 1.0 } else { rng.random_range(0.8..1.25) }).collect();
        let set = SCANNER.scan_set(&mesh, seed);
        let scans = in_other_units(&set, &factors);
        let options = Options { scale: Scale::PerView, ..quick() };
        let outcome = run(named(&scans), &start(&disturb(&set.poses, 0.04, 4.0, seed)), &options).expect("a sound set");
        let views = outcome.report.to_json()["views"].as_array().cloned().expect("views are reported");
        let error = |(entry, factor): (&serde_json::Value, &f64)| {
            (entry["scale"].as_f64().expect("scales are reported") / factor - 1.0).abs()
        };
        let largest = views.iter().zip(&factors).map(error).fold(0.0, f64::max);
        println!("{name}: {:.3} %, {}", largest * 100.0, outcome.report.to_json()["verdict"]["quality"]);
        count += 1;
        if name.starts_with("blob") || name.starts_with("head") {
            bodies = bodies.max(largest);
        }
        if outcome.report.to_json()["verdict"]["quality"] == "good" {
            good = good.max(largest);
        }
    }
    assert_eq!(count, 52);
    assert!(bodies < 1e-3, "{:.3} % on rounded bodies", bodies * 100.0);
    assert!(good < 3e-3, "{:.3} % on what is called good", good * 100.0);
}
