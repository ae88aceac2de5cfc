//! What a person says of scans, end to end; and the places of views that fit in several ways. Scans are made by code.

use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_3;

use visage::geometry::{Motion, Point3, Surface, Unit, Vector3, se3};
use visage::pipeline::{self, Hints, NamedScan, Options, PipelineError, RegisteredModel, Start};
use visage::progress::Progress;
use visage::synthetic::scanner::{ScanSet, Scanner};
use visage::synthetic::{objects, shapes};

const SCANNER: Scanner = Scanner { views: 6, distance: 600.0, resolution: 2.5, noise: 0.15, grazing_angle: 75.0 };

/// Scans in frames of their own, and their true poses.
struct Set {
    scans: Vec<NamedScan>,
    truth: Vec<Motion>,
}

fn read(hints: serde_json::Value) -> Hints {
    serde_json::from_value(hints).expect("hints")
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

    fn run(&self, start: &Start) -> Result<RegisteredModel, PipelineError> {
        let options = Options { cloud: false, signature: false, ..Options::default() };
        pipeline::run_from(self.scans.clone(), start, Unit::Mm, &options, &Progress::silent())
    }

    fn hinted(&self, hints: serde_json::Value) -> Result<RegisteredModel, PipelineError> {
        self.run(&Start { hints: read(hints), ..Start::default() })
    }

    /// The true place of a scan in the world of the outcome, which is that of view 0.
    fn true_pose(&self, outcome: &RegisteredModel, view: usize) -> Motion {
        outcome.poses[0].1.expect("view 0 is placed") * self.truth[0].inverse() * self.truth[view]
    }

    /// How far a pose of a scan is off, in degrees and in mm at the scan's middle.
    fn error(&self, outcome: &RegisteredModel, view: usize, pose: &Motion) -> (f64, f64) {
        let truth = self.true_pose(outcome, view);
        let middle = self.scans[view].surface.cloud.centroid();
        (truth.rotation.angle_to(&pose.rotation).to_degrees(), (truth * middle - pose * middle).norm())
    }

    /// Five places of the object that two scans see, far from each other.
    fn common(&self, a: usize, b: usize) -> Vec<[f64; 3]> {
        let of = |view: usize| {
            let points = self.scans[view].surface.cloud.points.iter().step_by(5);
            points.map(|p| self.truth[view] * p).collect::<Vec<Point3>>()
        };
        let (seen, by_b) = (of(a), of(b));
        let common: Vec<&Point3> = seen.iter().filter(|p| by_b.iter().any(|q| (q - **p).norm() < 4.0)).collect();
        let mut chosen: Vec<&Point3> = vec![common[0]];
        let away = |p: &Point3, chosen: &[&Point3]| chosen.iter().map(|q| (p - **q).norm()).fold(f64::MAX, f64::min);
        while chosen.len() < 5 {
            let next = common.iter().max_by(|p, q| away(p, &chosen).total_cmp(&away(q, &chosen)));
            chosen.push(next.expect("they overlap"));
        }
        chosen.into_iter().map(|p| p.coords.into()).collect()
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

/// Whether a motion of the object's frame turns a nut into itself: about its axis or over, by sixths of a circle.
fn is_symmetry_of_the_nut(motion: &Motion) -> bool {
    let axis = motion * Vector3::y();
    let sixths = motion.rotation.angle() / FRAC_PI_3;
    let is_turn = axis.y > 0.999 && (sixths - sixths.round()).abs() < 0.03;
    is_turn || (axis.y < -0.999 && (sixths - 3.0).abs() < 0.03)
}

#[test]
fn places_on_a_nut_are_its_symmetries_and_picked_points_or_initial_poses_choose_one() {
    let nut = shapes::catalogue().into_iter().find(|shape| shape.name == "nut").expect("in the catalogue");
    let set = Set::of(&Scanner { views: 8, ..SCANNER }.scan_set(&nut.mesh(1), 1));
    let outcome = set.run(&Start::default()).expect("registers");
    let world = outcome.poses[0].1.expect("view 0 is placed") * set.truth[0].inverse();
    let rows = outcome.report.to_json()["alternatives"].as_array().cloned().expect("a list");
    // a view that too little speaks for has no places at all
    let open: Vec<usize> = (0..8).filter(|view| rows.iter().any(|row| row["name"] == *name(*view))).collect();
    assert!(!open.is_empty(), "a nut's views fit in several ways");
    let mut start: BTreeMap<String, Motion> =
        outcome.poses.iter().filter_map(|(name, pose)| Some((name.clone(), (*pose)?))).collect();
    for view in open.iter().copied() {
        let row = rows.iter().find(|row| row["name"] == *name(view)).unwrap_or_else(|| panic!("{view}: {rows:?}"));
        let places = row["poses"].as_array().expect("a list");
        let scores: Vec<f64> = places.iter().map(|place| place["score"].as_f64().expect("a score")).collect();
        assert!((2..=8).contains(&places.len()) && scores[0] == 1.0, "{scores:?}");
        assert!(scores.is_sorted_by(|a, b| a >= b) && scores.iter().all(|score| *score >= 0.7), "{scores:?}");
        for place in places {
            let rows: [[f64; 4]; 4] = serde_json::from_value(place["pose"].clone()).expect("4x4");
            let pose = se3::from_rows(&rows).expect("rigid");
            let moved = world.inverse() * pose * set.truth[view].inverse();
            assert!(is_symmetry_of_the_nut(&moved), "{view}: {moved}");
            start.entry(name(view)).or_insert(pose);
        }
    }

    // places sent as initial poses are a choice
    let chosen = set.run(&(&start).into()).expect("registers");
    for (name, pose) in chosen.poses.iter().filter(|(name, _)| start.contains_key(name)) {
        let (found, sent) = (pose.unwrap_or_else(|| panic!("{name} is placed")), start[name]);
        // its places are 60 degrees apart; within one, little holds a view that shows one side
        assert!(sent.rotation.angle_to(&found.rotation) < 0.05, "{name} stays where it was put");
    }

    // and so are picked points
    let (view, other) = (open[0], (open[0] + 1) % 8);
    let picked = set.picked(other, view, &set.common(other, view));
    let hinted = set.hinted(serde_json::json!({"points": [picked]})).expect("registers");
    let row = &hinted.report.to_json()["hints"]["points"][0];
    assert_eq!((&row["followed"], &row["pairs"]), (&true.into(), &5.into()), "{row}");
    assert!(row["residual"].as_f64().is_some_and(|mm| (0.5..5.0).contains(&mm)), "{row}");
    let pose = |view: usize| hinted.poses[view].1.expect("placed as the points say");
    let between = (pose(other).inverse() * pose(view)).rotation;
    let true_between = (set.truth[other].inverse() * set.truth[view]).rotation;
    assert!(between.angle_to(&true_between) < 0.02, "{}", between.angle_to(&true_between));
}

#[test]
fn a_vase_turns_about_its_axis() {
    let vase = shapes::catalogue().into_iter().find(|shape| shape.name == "vase").expect("in the catalogue");
    let set = Set::of(&SCANNER.scan_set(&vase.mesh(1), 1));
    let outcome = set.run(&Start::default()).expect("registers");
    let rows = outcome.report.to_json()["alternatives"].as_array().cloned().expect("a list");
    assert!(!rows.is_empty(), "{:?}", outcome.report.to_json()["verdict"]);
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
    let row = &outcome.report.to_json()["hints"]["points"][0];
    assert_eq!(row["followed"], false, "{row}");
    assert!(row["residual"].as_f64().is_some_and(|mm| mm > 20.0), "{row}");
    let (degrees, mm) = set.error(&outcome, 1, &outcome.poses[1].1.expect("placed all the same"));
    assert!(degrees < 0.5 && mm < 0.5, "{degrees} {mm}");
    assert_eq!(outcome.report.to_json()["verdict"]["quality"], "doubtful");
    assert!(outcome.report.to_json()["verdict"]["reasons"].to_string().contains("picked in s0.ply and s1.ply"));
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
    let rows = outcome.report.to_json()["views"].as_array().cloned().expect("views");
    let row = rows.iter().find(|row| row["name"] == *name(2)).expect("a row");
    assert_eq!((&row["left_out"]["regions"], rows[0]["left_out"].get("regions")), (&1600.into(), None));
    assert!(row["points"].as_u64().is_some_and(|points| points <= before as u64), "{row}");
    assert_eq!(outcome.report.to_json()["verdict"]["quality"], "good", "{:?}", outcome.report.to_json()["verdict"]);
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
