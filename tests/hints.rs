//! What a person says of scans, end to end; and the places of views that fit in several ways. Scans are made by code.

use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_2;

use visage::geometry::{Bounds, Cloud, Mesh, Motion, Point3, Surface, Unit, Vector3, se3};
use visage::pipeline::{self, Hints, NamedScan, Options, Outcome, PipelineError, Start};
use visage::progress::Progress;
use visage::synthetic::scanner::{ScanSet, Scanner};
use visage::synthetic::{implicit, objects, shapes, surface_nets};

const SCANNER: Scanner = Scanner { views: 6, distance: 600.0, resolution: 2.5, noise: 0.15, grazing_angle: 75.0 };

/// Scans in frames of their own, and their true poses.
struct Set {
    scans: Vec<NamedScan>,
    truth: Vec<Motion>,
}

fn name(view: usize) -> String {
    format!("s{view}.ply")
}

impl Set {
    fn of(set: &ScanSet) -> Self {
        let turn = |view: usize| {
            let axis = Vector3::new(1.0, 0.3 * view as f64 - 1.0, 0.5).normalize();
            Motion::new(Vector3::new(40.0, -7.0, 3.0) * view as f64, axis * (0.9 * view as f64 + 0.4))
        };
        let scan = |(view, surface): (usize, &Surface)| {
            let cloud = surface.cloud.moved(&turn(view));
            NamedScan { name: name(view), surface: Surface { cloud, ..Surface::default() } }
        };
        Set {
            scans: set.scans.iter().enumerate().map(scan).collect(),
            truth: set.poses.iter().enumerate().map(|(view, pose)| pose * turn(view).inverse()).collect(),
        }
    }

    fn run(&self, start: &Start) -> Result<Outcome, PipelineError> {
        let options = Options { cloud: false, signature: false, ..Options::default() };
        pipeline::run_from(self.scans.clone(), start, Unit::Mm, &options, &Progress::silent())
    }

    fn hinted(&self, hints: serde_json::Value) -> Result<Outcome, PipelineError> {
        let hints: Hints = serde_json::from_value(hints).expect("hints");
        self.run(&Start { hints, ..Start::default() })
    }

    /// The true place of a scan in the world of the outcome, which is that of view 0.
    fn true_pose(&self, outcome: &Outcome, view: usize) -> Motion {
        outcome.poses[0].1.expect("view 0 is placed") * self.truth[0].inverse() * self.truth[view]
    }

    /// How far a pose of a scan is off, in degrees and in mm at the scan's middle.
    fn error(&self, outcome: &Outcome, view: usize, pose: &Motion) -> (f64, f64) {
        let truth = self.true_pose(outcome, view);
        let middle = self.scans[view].surface.cloud.centroid();
        (truth.rotation.angle_to(&pose.rotation).to_degrees(), (truth * middle - pose * middle).norm())
    }

    /// Some places of the object as they were picked in two scans, with an error of a few mm.
    fn picked(&self, a: usize, b: usize, places: &[[f64; 3]]) -> serde_json::Value {
        let pairs: Vec<[[f64; 3]; 2]> = places
            .iter()
            .enumerate()
            .map(|(k, place)| {
                let error = Vector3::new(1.5, -1.0, 1.0) * if k % 2 == 0 { 1.0 } else { -1.0 };
                let in_scan = |view: usize| self.truth[view].inverse() * Point3::from(*place);
                [in_scan(a).coords.into(), (in_scan(b) + error).coords.into()]
            })
            .collect();
        serde_json::json!({"a": name(a), "b": name(b), "pairs": pairs})
    }
}

/// A body without symmetry that carries a square shaft.
fn shaft() -> Mesh {
    let waves =
        |p: &Point3| 5.0 * (0.09 * p.x + 1.0).sin() * (0.07 * p.z).cos() + 4.0 * (0.11 * p.z + 0.05 * p.x).sin();
    let field = |p: &Point3| {
        let body = implicit::ellipsoid(p, [0.0, -60.0, 0.0], [80.0, 50.0, 62.0]) + waves(p);
        body.min(implicit::cuboid(p, [0.0, 40.0, 0.0], [28.0, 80.0, 28.0]))
    };
    let bounds = Bounds { min: Point3::new(-105.0, -135.0, -90.0), max: Point3::new(105.0, 130.0, 90.0) };
    surface_nets::mesh(&field, &bounds, 3.0)
}

/// The region about the end of the shaft, in a scan's frame.
fn end_of_the_shaft(set: &Set, view: usize) -> serde_json::Value {
    let center: [f64; 3] = (set.truth[view].inverse() * Point3::new(0.0, 80.0, 0.0)).coords.into();
    serde_json::json!({"scan": name(view), "use": {"sphere": {"center": center, "radius": 65.0}}})
}

/// Corners of the shaft's end and a place on its edge.
const ON_THE_END: [[f64; 3]; 5] =
    [[28.0, 120.0, 28.0], [-28.0, 120.0, 28.0], [-28.0, 120.0, -28.0], [28.0, 120.0, -28.0], [28.0, 70.0, 28.0]];

#[test]
fn an_end_with_four_equal_sides_has_four_places_and_picked_points_choose_one() {
    // views of the whole body, of the last one only the end of the shaft
    let set = Set::of(&SCANNER.scan_set(&shaft(), 1));
    let region = end_of_the_shaft(&set, 5);
    let outcome = set.hinted(serde_json::json!({"regions": [region]})).expect("registers");
    assert!(outcome.poses[..5].iter().all(|(_, pose)| pose.is_some()), "{:?}", outcome.report["verdict"]);
    assert_eq!(outcome.poses[5].1, None, "{:?}", outcome.report["verdict"]);
    let row = &outcome.report["alternatives"][0];
    assert_eq!((&row["name"], &row["axis"], &row["along"]), (&name(5).into(), &().into(), &().into()));
    let poses: Vec<Motion> = row["poses"]
        .as_array()
        .expect("a list")
        .iter()
        .map(|place| serde_json::from_value(place["pose"].clone()).expect("4x4"))
        .map(|rows: [[f64; 4]; 4]| se3::from_rows(&rows).expect("rigid"))
        .collect();
    let scores: Vec<f64> = (0..4).map(|k| row["poses"][k]["score"].as_f64().expect("a score")).collect();
    assert_eq!(poses.len(), 4, "{row}");
    assert!(scores[0] == 1.0 && scores.is_sorted_by(|a, b| a >= b) && scores[3] > 0.7, "{scores:?}");
    // a quarter turn leads from each to the next, and one is the truth
    let about_the_shaft = |quarters: usize| Motion::new(Vector3::zeros(), Vector3::y() * FRAC_PI_2 * quarters as f64);
    let world = outcome.poses[0].1.expect("placed") * set.truth[0].inverse();
    for quarters in 0..4 {
        let turned = world * about_the_shaft(quarters) * world.inverse() * set.true_pose(&outcome, 5);
        let off = |pose: &Motion| turned.rotation.angle_to(&pose.rotation).to_degrees();
        assert!(
            poses.iter().any(|pose| off(pose) < 1.0),
            "{quarters}: {:?}",
            poses.iter().map(off).collect::<Vec<_>>()
        );
    }

    let hints = serde_json::json!({"regions": [region], "points": [set.picked(4, 5, &ON_THE_END)]});
    let hinted = set.hinted(hints).expect("registers");
    let (degrees, mm) = set.error(&hinted, 5, &hinted.poses[5].1.expect("placed as the points say"));
    assert!(degrees < 1.0 && mm < 1.0, "{degrees} {mm}");
    let row = &hinted.report["hints"]["points"][0];
    assert_eq!((&row["followed"], &row["pairs"]), (&true.into(), &5.into()), "{row}");
    assert!(row["residual"].as_f64().is_some_and(|mm| (0.5..5.0).contains(&mm)), "{row}");

    // one of the places, sent as an initial pose with those found, is a choice too
    let chosen = poses.iter().min_by(|a, b| set.error(&outcome, 5, a).0.total_cmp(&set.error(&outcome, 5, b).0));
    let found = outcome.poses.iter().filter_map(|(name, pose)| Some((name.clone(), (*pose)?)));
    let start: BTreeMap<String, Motion> = found.chain(chosen.map(|pose| (name(5), *pose))).collect();
    let hints = serde_json::from_value(serde_json::json!({"regions": [region]})).expect("hints");
    let settled = set.run(&Start { hints, ..(&start).into() }).expect("registers");
    let (degrees, mm) = set.error(&settled, 5, &settled.poses[5].1.expect("placed as chosen"));
    assert!(degrees < 1.0 && mm < 1.0, "{degrees} {mm}");
}

#[test]
fn a_vase_turns_about_its_axis() {
    let vase = shapes::catalogue().into_iter().find(|shape| shape.name == "vase").expect("in the catalogue");
    let set = Set::of(&SCANNER.scan_set(&vase.mesh(1), 1));
    let outcome = set.run(&Start::default()).expect("registers");
    let rows = outcome.report["alternatives"].as_array().expect("a list");
    assert!(!rows.is_empty(), "{:?}", outcome.report["verdict"]);
    let world = outcome.poses[0].1.expect("view 0 is placed") * set.truth[0].inverse();
    let (axis, middle) = (world * Vector3::y(), world * Point3::origin());
    for row in rows {
        let vector = |what: &str| -> Vector3 {
            serde_json::from_value::<[f64; 3]>(row["axis"][what].clone()).expect("an axis").into()
        };
        let (point, direction) = (vector("point"), vector("direction"));
        assert!(direction.dot(&axis).abs() > 0.999, "{row}");
        assert!((middle.coords - point).cross(&direction).norm() < 4.0, "{row}");
        assert_eq!(row["poses"].as_array().map(Vec::len), Some(1));
    }
}

#[test]
fn wrong_points_are_not_followed_and_the_verdict_says_so() {
    let set = Set::of(&SCANNER.scan_set(&objects::blob(1, 20_000).mesh, 1));
    // places that both scans see, turned in the picture of the second one
    let seen_from = |view: usize| (set.truth[view] * set.scans[view].surface.cloud.centroid()).coords.normalize();
    let (ahead, up) = ((seen_from(0) + seen_from(1)).normalize(), Vector3::y());
    let side = ahead.cross(&up);
    let places = [ahead + 0.3 * up, ahead - 0.3 * up + 0.2 * side, ahead - 0.3 * side, ahead];
    let mut wrong = set.picked(0, 1, &places.map(|place| (90.0 * place.normalize()).into()));
    let quarter = Motion::new(Vector3::zeros(), 0.9 * seen_from(1));
    for pair in wrong["pairs"].as_array_mut().expect("pairs") {
        let place: [f64; 3] = serde_json::from_value(pair[1].clone()).expect("a place");
        let turned = set.truth[1].inverse() * quarter * set.truth[1] * Point3::from(place);
        pair[1] = serde_json::json!(<[f64; 3]>::from(turned.coords));
    }
    let outcome = set.hinted(serde_json::json!({"points": [wrong]})).expect("registers");
    let row = &outcome.report["hints"]["points"][0];
    assert_eq!(row["followed"], false, "{row}");
    assert!(row["residual"].as_f64().is_some_and(|mm| mm > 20.0), "{row}");
    let (degrees, mm) = set.error(&outcome, 1, &outcome.poses[1].1.expect("placed all the same"));
    assert!(degrees < 0.5 && mm < 0.5, "{degrees} {mm}");
    assert_eq!(outcome.report["verdict"]["quality"], "doubtful");
    assert!(outcome.report["verdict"]["reasons"].to_string().contains("picked in s0.ply and s1.ply"));
}

#[test]
fn regions_are_cut_first_and_counted() {
    let mut set = Set::of(&SCANNER.scan_set(&objects::blob(1, 20_000).mesh, 1));
    // a thing that stands still before the scanner, as a person would see it in the scan
    let before = set.scans[2].surface.cloud.len();
    let middle = set.scans[2].surface.cloud.centroid();
    let thing = |k: usize| middle + Vector3::new(200.0 + (k % 40) as f64, (k / 40) as f64, 0.1 * (k % 7) as f64);
    set.scans[2].surface.cloud.points.extend((0..1600).map(thing));
    let center: [f64; 3] = thing(820).coords.into();
    let leave = serde_json::json!({"scan": name(2), "leave": {"sphere": {"center": center, "radius": 60.0}}});
    let outcome = set.hinted(serde_json::json!({"regions": [leave]})).expect("registers");
    let rows = outcome.report["views"].as_array().expect("views");
    let row = rows.iter().find(|row| row["name"] == *name(2)).expect("a row");
    assert_eq!((&row["left_out"]["regions"], rows[0]["left_out"].get("regions")), (&1600.into(), None));
    assert!(row["points"].as_u64().is_some_and(|points| points <= before as u64), "{row}");
    assert_eq!(outcome.report["verdict"]["quality"], "good", "{:?}", outcome.report["verdict"]);
    let only = serde_json::json!({"scan": name(2), "use": {"sphere": {"center": center, "radius": 0.5}}});
    let Err(PipelineError::Unusable { code, scan, message, .. }) = set.hinted(serde_json::json!({"regions": [only]}))
    else {
        panic!("the region leaves next to nothing")
    };
    assert_eq!((code, scan), ("invalid_hints", Some(name(2))));
    assert!(message.contains("regions leave"), "{message}");
}

#[test]
fn points_off_the_scan_and_unknown_scans_are_refused() {
    let set = Set::of(&SCANNER.scan_set(&objects::blob(1, 20_000).mesh, 1));
    let refused = |hints: serde_json::Value| match set.hinted(hints) {
        Err(PipelineError::Unusable { code: "invalid_hints", scan, message, .. }) => (scan.expect("named"), message),
        other => panic!("{other:?}"),
    };
    let places = [[90.0, 0.0, 0.0], [0.0, 90.0, 0.0], [0.0, 0.0, 900.0]];
    let (scan, message) = refused(serde_json::json!({"points": [set.picked(0, 1, &places)]}));
    assert!(scan == name(0) && message.contains("from the nearest point"), "{scan}: {message}");
    let (scan, _) = refused(serde_json::json!({"overlaps": [[name(0), "x.ply"]]}));
    assert_eq!(scan, "x.ply");
}
