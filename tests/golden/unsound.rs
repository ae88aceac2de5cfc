//! Scans with points that are none, with points and scans that come twice, and with scanners that are told wrongly:
//! each has to come out as the sound scans do.

use std::collections::BTreeMap;
use std::sync::OnceLock;

use proptest::prelude::*;
use visage::geometry::{Motion, Point3, Surface, Unit, Vector3};
use visage::pipeline::{self, NamedScan, Options, PipelineError, RegisteredModel};
use visage::progress::Progress;
use visage::synthetic::head::{Proportions, head};
use visage::synthetic::objects;
use visage::synthetic::scanner::{ScanSet, Scanner};
use visage::synthetic::truth::{disturb, pose_error};

const SCANNER: Scanner = Scanner { views: 8, distance: 600.0, resolution: 3.0, noise: 0.15, grazing_angle: 75.0 };

/// Scans without what the scanner knew, from disturbed poses.
struct Set {
    scans: Vec<NamedScan>,
    truth: Vec<Motion>,
    initial: Vec<Motion>,
}

fn set() -> Set {
    let ScanSet { scans, poses } = SCANNER.scan_set(&objects::blob(1, 20_000).mesh, 1);
    let named = |(view, surface): (usize, Surface)| NamedScan {
        name: format!("scan_{view:02}.ply"),
        surface: Surface { grid: None, sensor: None, ..surface },
    };
    let initial = disturb(&poses, 0.03, 2.0, 1);
    Set { scans: scans.into_iter().enumerate().map(named).collect(), truth: poses, initial }
}

fn run(scans: &[NamedScan], initial: &[Motion]) -> Result<RegisteredModel, PipelineError> {
    let initial: BTreeMap<String, Motion> =
        scans.iter().zip(initial).map(|(scan, pose)| (scan.name.clone(), *pose)).collect();
    let options = Options { signature: false, ..Options::default() };
    pipeline::run(scans.to_vec(), &initial, Unit::Mm, &options, &Progress::silent())
}

fn registered(scans: &[NamedScan], initial: &[Motion]) -> RegisteredModel {
    run(scans, initial).unwrap_or_else(|error| panic!("{error}"))
}

/// The set as it should come out.
fn sound() -> &'static (Set, RegisteredModel) {
    static SOUND: OnceLock<(Set, RegisteredModel)> = OnceLock::new();
    SOUND.get_or_init(|| {
        let set = set();
        let outcome = registered(&set.scans, &set.initial);
        assert!(error_mm(&set, &outcome) < 0.3, "{}", error_mm(&set, &outcome));
        (set, outcome)
    })
}

fn changed(set: &Set, change: impl Fn(usize, &mut Vec<Point3>)) -> Vec<NamedScan> {
    let mut scans = set.scans.clone();
    for (view, scan) in scans.iter_mut().enumerate() {
        change(view, &mut scan.surface.cloud.points);
    }
    scans
}

fn matrices(outcome: &RegisteredModel) -> Vec<Option<pipeline::PoseMatrix>> {
    outcome.matrices.iter().map(|(_, matrix)| *matrix).collect()
}

fn error_mm(set: &Set, outcome: &RegisteredModel) -> f64 {
    let found: Vec<Motion> = outcome.poses.iter().map(|(_, pose)| pose.expect("all are placed")).collect();
    let samples: Vec<Vec<Point3>> =
        set.scans.iter().map(|scan| scan.surface.cloud.points.iter().step_by(7).copied().collect()).collect();
    pose_error(&found, &set.truth, &samples).points_rms
}

fn left_out(outcome: &RegisteredModel, what: &str) -> u64 {
    let views = outcome.report.to_json()["views"].as_array().cloned().expect("views are reported");
    views.iter().map(|view| view["left_out"][what].as_u64().expect("a count")).sum()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(8))]

    /// Whatever stands for "nothing was seen", and however often: the result is that of the points that were seen.
    #[test]
    fn no_return_of_any_value_and_share_changes_nothing(
        value in prop_oneof![
            Just([0.0; 3]), Just([-9999.0; 3]), Just([0.0, 0.0, -1.0]), Just([1e6, 0.0, 0.0]),
            prop::array::uniform3(-2000.0..2000.0f64),
        ],
        share in 0.004..0.9f64, step in 1..40usize,
    ) {
        let (set, sound) = sound();
        let mut added = 0;
        let unsound = changed(set, |_, points| {
            let count = (share / (1.0 - share) * points.len() as f64) as usize;
            for k in 0..count.max(8) {
                points.insert(k * step % points.len(), Point3::from(value));
            }
        });
        for (unsound, sound) in unsound.iter().zip(&set.scans) {
            added += unsound.surface.cloud.len() - sound.surface.cloud.len();
        }
        let outcome = registered(&unsound, &set.initial);
        prop_assert_eq!(matrices(&outcome), matrices(sound));
        prop_assert_eq!(left_out(&outcome, "no_return"), added as u64);
        prop_assert!(outcome.cloud == sound.cloud, "the clouds differ");
    }
}

#[test]
fn two_values_and_the_scanners_own_place_are_no_return_too() {
    let (set, sound) = sound();
    let mut unsound = changed(set, |_, points| {
        points.extend([Point3::origin(); 300]);
        points.extend([Point3::new(-1.0, -1.0, -1.0); 40]);
        points.push(Point3::new(10.0, 20.0, 30.0));
    });
    for scan in &mut unsound {
        scan.surface.sensor = Some(Point3::new(10.0, 20.0, 30.0));
    }
    let outcome = registered(&unsound, &set.initial);
    assert_eq!(left_out(&outcome, "no_return"), 8 * 341);
    assert_eq!(left_out(sound, "no_return"), 0);
}

#[test]
fn loose_triangles_and_repetitions_are_as_their_points() {
    let (set, sound) = sound();
    type Change = fn(&mut Vec<Point3>);
    let repeated: [(&str, Change); 3] = [
        ("one after the other", |points| *points = points.iter().flat_map(|p| [*p; 6]).collect()),
        ("all over again", |points| *points = std::iter::repeat_n(points.clone(), 3).flatten().collect()),
        ("some five times, some twice", |points| {
            *points = points.iter().enumerate().flat_map(|(k, p)| vec![*p; 2 + 3 * (k % 2)]).collect();
        }),
    ];
    for (how, repeat) in repeated {
        let outcome = registered(&changed(set, |_, points| repeat(points)), &set.initial);
        assert_eq!(matrices(&outcome), matrices(sound), "{how}");
        assert_eq!(outcome.report.to_json()["verdict"], sound.report.to_json()["verdict"], "{how}");
        assert!(left_out(&outcome, "repeated") > 0 && left_out(&outcome, "no_return") == 0, "{how}");
    }
}

#[test]
fn near_copies_are_one_point_for_spacing_noise_and_pose() {
    let (set, sound) = sound();
    let (spacing, accuracy) =
        (&sound.report.to_json()["spacing"], &sound.report.to_json()["views"][1]["range_accuracy"]);
    let close = |value: &serde_json::Value, expected: &serde_json::Value, share: f64| {
        let [value, expected] = [value, expected].map(|v| v.as_f64().expect("a length"));
        (value / expected - 1.0).abs() < share
    };
    for (copies, apart) in [(6, 1e-4), (6, 1e-3), (2, 1e-2), (3, 3e-2)] {
        let outcome = registered(
            &changed(set, |view, points| {
                let off = |k: usize, axis: usize| {
                    let mixed = (k * 3 + axis + 7 * view).wrapping_mul(2_654_435_761) & 0xffff;
                    apart * SCANNER.resolution * (mixed as f64 / 65536.0 - 0.5)
                };
                let copy = |k: usize, p: &Point3| p + Vector3::new(off(k, 0), off(k, 1), off(k, 2));
                *points = (0..copies * points.len()).map(|k| copy(k, &points[k % points.len()])).collect();
            }),
            &set.initial,
        );
        let what = format!("{copies} copies {apart} spacings apart");
        assert!(
            close(&outcome.report.to_json()["spacing"], spacing, 0.05),
            "{what}: {}",
            outcome.report.to_json()["spacing"]
        );
        assert!(close(&outcome.report.to_json()["views"][1]["range_accuracy"], accuracy, 0.2), "{what}");
        let (error, expected) = (error_mm(set, &outcome), error_mm(set, sound));
        assert!(error < expected + 0.02, "{what}: {error} mm for {expected}");
        assert_eq!(
            outcome.report.to_json()["verdict"]["quality"],
            sound.report.to_json()["verdict"]["quality"],
            "{what}"
        );
    }
}

#[test]
fn a_copy_of_a_scan_is_no_evidence() {
    let (set, _) = sound();
    let three = &set.scans[..3];
    let alone = registered(three, &[]);
    let turned = Motion::new(Vector3::new(40.0, 0.0, -7.0), Vector3::new(0.3, 1.0, -2.0));
    let copies: [(&str, Motion, bool); 3] = [
        ("byte by byte", Motion::identity(), false),
        ("in another order", Motion::identity(), true),
        ("moved", turned, true),
    ];
    for (how, motion, is_reversed) in copies {
        let mut copy = three[1].clone();
        copy.name = "again.pcd".into();
        copy.surface = copy.surface.moved(&motion);
        if is_reversed {
            copy.surface.cloud.points.reverse();
        }
        let outcome = registered(&[three, &[copy]].concat(), &[]);
        assert_eq!(outcome.report.to_json()["verdict"], alone.report.to_json()["verdict"], "{how}");
        assert_eq!(outcome.report.to_json()["confidence"], alone.report.to_json()["confidence"], "{how}");
        assert_eq!(matrices(&outcome)[..3], matrices(&alone)[..], "{how}");
        let row = &outcome.report.to_json()["views"][3];
        assert_eq!((&row["name"], &row["copy_of"]), (&"again.pcd".into(), &"scan_01.ply".into()), "{how}");
        assert_eq!(outcome.cloud.map(|model| model.cloud.len()), alone.cloud.as_ref().map(|model| model.cloud.len()));
        if let (Some(pose), Some(original)) = (outcome.poses[3].1, outcome.poses[1].1) {
            let off = (pose * motion).to_homogeneous() - original.to_homogeneous();
            assert!(off.amax() < 1e-3, "{how}: {off}");
        }
    }
}

#[test]
fn copies_alone_are_too_few_scans() {
    let (set, _) = sound();
    let copy = NamedScan { name: "copy.ply".into(), ..set.scans[0].clone() };
    let error = run(&[set.scans[0].clone(), copy], &[]).expect_err("there is one scan");
    assert!(matches!(&error, PipelineError::Unusable { code: "too_few_scans", .. }), "{error:?}");
    assert!(error.to_string().contains("copy.ply of scan_00.ply"), "{error}");
}

#[test]
fn the_pose_of_a_copy_serves_its_original() {
    let (set, _) = sound();
    let copy = NamedScan { name: "copy.ply".into(), ..set.scans[1].clone() };
    let scans = [&set.scans[..], &[copy]].concat();
    let mut poses: BTreeMap<String, Motion> =
        set.scans.iter().zip(&set.initial).map(|(scan, pose)| (scan.name.clone(), *pose)).collect();
    let pose = poses.remove("scan_01.ply").expect("it had one");
    poses.insert("copy.ply".into(), pose);
    let options = Options { signature: false, cloud: false, ..Options::default() };
    let outcome = pipeline::run(scans, &poses, Unit::Mm, &options, &Progress::silent()).expect("a sound set");
    assert_eq!(outcome.report.to_json()["views"][1]["pose"], "given");
}

/// The share of a model's normals that look away from the scanners, which stood at the origins of the scans.
fn inward(outcome: &RegisteredModel) -> f64 {
    let model = outcome.cloud.as_ref().expect("a cloud was asked for");
    let normals = model.cloud.normals.as_ref().expect("a cloud has normals");
    let away = (0..normals.len()).filter(|k| {
        let pose = outcome.poses[usize::from(model.views[*k])].1.expect("it is placed");
        let to_scanner = Point3::from(pose.translation.vector) - model.cloud.points[*k];
        normals[*k].cast::<f64>().dot(&to_scanner) < 0.0
    });
    away.count() as f64 / normals.len() as f64
}

#[test]
fn a_viewpoint_that_is_the_pose_of_the_scan_does_not_turn_normals_inward() {
    let scanner = Scanner { views: 4, ..SCANNER };
    let ScanSet { scans, poses } = scanner.scan_set(&head(&Proportions::of(1)).mesh, 1);
    // the world of a set is mostly that of its first scan
    let poses: Vec<Motion> = poses.iter().map(|pose| poses[0].inverse() * pose).collect();
    let told = |is_in_world: bool, sensor: fn(&Motion) -> Point3| -> Vec<NamedScan> {
        let named = |(view, (surface, pose)): (usize, (&Surface, &Motion))| {
            let surface = if is_in_world { surface.moved(pose) } else { surface.clone() };
            let surface = Surface { grid: None, sensor: Some(sensor(pose)), ..surface };
            NamedScan { name: format!("scan_{view:02}.pcd"), surface }
        };
        scans.iter().zip(&poses).enumerate().map(named).collect()
    };
    let place = |pose: &Motion| Point3::from(pose.translation.vector);
    let as_pose = registered(&told(false, place), &poses);
    assert!(as_pose.report.to_json()["views"][2]["viewpoint_is_pose"] == true);
    assert!(inward(&as_pose) < 0.02, "{}", inward(&as_pose));
    // what is right is believed: the scanner's place in points that have been brought into the world
    let in_world = told(true, place);
    let outcome = registered(&in_world, &vec![Motion::identity(); 4]);
    assert!(
        outcome.report.to_json()["views"].as_array().expect("views").iter().all(|v| v["viewpoint_is_pose"].is_null())
    );
    // and an option goes before the file
    let options = Options { signature: false, sensor: Some([0.0; 3]), ..Options::default() };
    let initial = (0..4).map(|view| (format!("scan_{view:02}.pcd"), poses[view])).collect();
    let lying = told(false, |_| Point3::new(0.0, 0.0, 2000.0));
    let outcome = pipeline::run(lying, &initial, Unit::Mm, &options, &Progress::silent()).expect("a sound set");
    assert!(inward(&outcome) < 0.02, "{}", inward(&outcome));
}
