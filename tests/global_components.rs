//! Sets that are not simply the scans of one object: mixtures, foreign scans, poses that are only partly there, objects
//! that look the same from several sides, and scenes with a turntable, floor or wall. All made by code, the truth known.

use std::collections::BTreeMap;

use visage::geometry::{Motion, Point3, Surface, Unit, Vector3, se3};
use visage::pipeline::{self, NamedScan, Options, RegisteredModel};
use visage::progress::Progress;
use visage::registration::global::placement::Origin;
use visage::synthetic::scene::{Ground, SceneOptions, scene_set};
use visage::synthetic::shapes::{ScanOptions, Shape, catalogue, scan_set};
use visage::synthetic::truth::pose_error;

fn shape(name: &str) -> Shape {
    catalogue().into_iter().find(|shape| shape.name == name).expect("it is in the catalogue")
}

/// Scans in frames of their own, with the object that each shows and its true pose in that object's frame.
#[derive(Default)]
struct Pile {
    scans: Vec<NamedScan>,
    objects: Vec<usize>,
    truth: Vec<Motion>,
}

impl Pile {
    fn add(&mut self, object: usize, scan: &Surface, pose: &Motion) {
        let place = self.scans.len() as f64;
        let axis = Vector3::new(1.0, 0.3 * place - 1.0, 0.5).normalize();
        let turn = Motion::new(Vector3::new(40.0, -7.0, 3.0) * place, axis * (0.9 * place + 0.4));
        let surface = Surface { cloud: scan.cloud.moved(&turn), ..Surface::default() };
        self.scans.push(NamedScan { name: format!("s{}.ply", self.scans.len()), surface });
        self.objects.push(object);
        self.truth.push(pose * turn.inverse());
    }

    /// Adds `count` of nine scans of a shape.
    fn shape(mut self, object: usize, name: &str, count: usize) -> Self {
        let options = ScanOptions { points: 4000, ..ScanOptions::default() };
        let set = scan_set(&shape(name), 9, &options, 31);
        set.scans.iter().zip(&set.poses).take(count).for_each(|(scan, pose)| self.add(object, scan, pose));
        self
    }

    fn run(&self, given: &[(usize, Motion)], options: &Options) -> RegisteredModel {
        let given: BTreeMap<String, Motion> = given.iter().map(|(k, pose)| (format!("s{k}.ply"), *pose)).collect();
        pipeline::run(self.scans.clone(), &given, Unit::Mm, options, &Progress::silent())
            .unwrap_or_else(|error| panic!("{error}"))
    }

    /// How far the poses of these views are from the truth, as a root mean square of their points, mm.
    fn error_mm(&self, views: &[usize], poses: &[Motion]) -> f64 {
        let truth: Vec<Motion> = views.iter().map(|k| self.truth[*k]).collect();
        let points: Vec<Vec<Point3>> =
            views.iter().map(|k| self.scans[*k].surface.cloud.points.iter().step_by(9).copied().collect()).collect();
        pose_error(poses, &truth, &points).points_rms
    }
}

const BARE: Options = Options {
    method: pipeline::Method::Joint,
    threads: None,
    min_overlap: 0.5,
    range_accuracy: None,
    max_rounds: 20,
    sensor: None,
    scale: pipeline::Scale::None,
    reference: None,
    keep_all: false,
    cloud: false,
    mesh: false,
    fill: pipeline::Fill::Small,
    triangles: None,
    max_error: None,
    preview: false,
    deface: false,
    signature: false,
};

/// The groups of a report: views and poses.
fn groups(outcome: &RegisteredModel) -> Vec<(Vec<usize>, Vec<Motion>)> {
    let groups = outcome.report.to_json()["groups"].as_array().cloned().expect("groups are told");
    groups
        .iter()
        .map(|group| {
            let names: Vec<String> = serde_json::from_value(group["views"].clone()).expect("names");
            let rows: Vec<[[f64; 4]; 4]> = serde_json::from_value(group["poses"].clone()).expect("matrices");
            let place = |name: &String| outcome.poses.iter().position(|(n, _)| n == name).expect("a known name");
            let pose = |rows| se3::from_scaled_rows(rows).expect("a pose").0;
            (names.iter().map(place).collect(), rows.iter().map(pose).collect())
        })
        .collect()
}

/// For each view why it is unplaced.
fn unplaced(outcome: &RegisteredModel) -> Vec<Option<&'static str>> {
    outcome.report.registration.views.iter().map(|scan| scan.view.unplaced).collect()
}

/// For each view where its pose came from.
fn origins(outcome: &RegisteredModel) -> Vec<Option<Origin>> {
    outcome.report.registration.views.iter().map(|scan| scan.view.pose).collect()
}

#[test]
fn two_objects_come_back_as_two_groups_each_right_in_a_frame_of_its_own() {
    let pile = Pile::default().shape(0, "figure", 7).shape(1, "animal", 9);
    let outcome = pile.run(&[], &BARE);
    let groups = groups(&outcome);
    assert_eq!(groups.len(), 2);
    for ((views, poses), (object, count)) in groups.iter().zip([(1, 9), (0, 7)]) {
        assert_eq!(views.len(), count);
        assert!(views.iter().all(|view| pile.objects[*view] == object), "{views:?} are of one object");
        let error_mm = pile.error_mm(views, poses);
        assert!(error_mm < 0.3, "object {object}: {error_mm} mm");
    }
    assert!(
        outcome.report.to_json()["groups"].as_array().into_iter().flatten().all(|group| group["quality"] == "good")
    );
    let placed: Vec<bool> = outcome.poses.iter().map(|(_, pose)| pose.is_some()).collect();
    assert_eq!(placed, pile.objects.iter().map(|object| *object == 1).collect::<Vec<_>>(), "the larger is placed");
    let reasons = unplaced(&outcome);
    assert!(reasons[..7].iter().all(|reason| reason.is_some_and(|text| text.contains("groups"))), "{reasons:?}");
    assert!(reasons[7..].iter().all(Option::is_none));
    assert_eq!(outcome.report.to_json()["views"][0]["group"], 1);
    assert_eq!(outcome.report.to_json()["views"][8]["group"], 0);
}

#[test]
fn a_foreign_scan_has_no_place_and_casts_no_doubt_on_the_others() {
    for (own, foreign) in [("animal", "mug"), ("figure", "crate")] {
        // the foreign one comes first, where it could fix the world
        let pile = Pile::default().shape(1, foreign, 1).shape(0, own, 9);
        let outcome = pile.run(&[], &BARE);
        assert!(outcome.poses[0].1.is_none(), "{own}: {foreign} is placed");
        assert!(unplaced(&outcome)[0].is_some());
        let views: Vec<usize> = (1..10).collect();
        let poses: Vec<Motion> = outcome.poses[1..].iter().map(|(name, pose)| pose.expect(name)).collect();
        let error_mm = pile.error_mm(&views, &poses);
        assert!(error_mm < 0.3, "{own} with {foreign}: {error_mm} mm");
        let reasons = &outcome.report.registration.verdict.reasons;
        assert_eq!(reasons.len(), 1, "only that one is unplaced: {reasons:?}");
    }
}

#[test]
fn poses_that_are_partly_there_are_repaired_and_each_says_what_it_was() {
    let pile = Pile::default().shape(0, "animal", 9);
    let mut given: Vec<(usize, Motion)> = pile.truth.iter().copied().enumerate().collect();
    let quarter = Motion::new(Vector3::zeros(), Vector3::x() * std::f64::consts::FRAC_PI_2);
    given[3].1 = quarter * given[3].1;
    given.retain(|(view, _)| ![1, 6].contains(view));
    let outcome = pile.run(&given, &BARE);
    let mut expected = [Some(Origin::Given); 9];
    for (view, origin) in [(1, Origin::Found), (3, Origin::Corrected), (6, Origin::Found)] {
        expected[view] = Some(origin);
    }
    assert_eq!(origins(&outcome), expected);
    for (view, (name, pose)) in outcome.poses.iter().enumerate() {
        let off = pile.truth[view].inverse() * pose.expect(name);
        assert!(off.rotation.angle() < 0.02, "{name} stands in the world of the given poses");
    }
    assert_eq!(outcome.report.to_json()["verdict"]["quality"], "good");
}

#[test]
fn poses_that_are_all_wrong_are_all_put_right() {
    let pile = Pile::default().shape(0, "figure", 9);
    let wrong = |view: usize| {
        let axis = Vector3::new((view as f64).sin(), (view as f64).cos(), 0.5).normalize();
        pile.truth[view] * Motion::new(Vector3::new(60.0, 0.0, -30.0) * view as f64, axis * (1.0 + 0.2 * view as f64))
    };
    let given: Vec<(usize, Motion)> = (0..9).map(|view| (view, wrong(view))).collect();
    let outcome = pile.run(&given, &BARE);
    let poses: Vec<Motion> = outcome.poses.iter().map(|(name, pose)| pose.expect(name)).collect();
    let error_mm = pile.error_mm(&(0..9).collect::<Vec<_>>(), &poses);
    assert!(error_mm < 0.3, "{error_mm} mm");
    let origins = origins(&outcome);
    assert!(origins.iter().filter(|origin| **origin == Some(Origin::Corrected)).count() >= 8, "{origins:?}");
}

#[test]
fn symmetric_objects_are_not_placed_at_random() {
    for name in ["cylinder", "torus"] {
        let outcome = Pile::default().shape(0, name, 5).run(&[], &BARE);
        assert_ne!(outcome.report.to_json()["verdict"]["quality"], "good", "{name}");
        let reasons = unplaced(&outcome);
        let told = |text: &str| reasons.iter().flatten().any(|reason| reason.contains(text));
        let weak = outcome.report.to_json()["verdict"]["reasons"].to_string();
        assert!(
            told("several ways") || weak.contains("turn about") || weak.contains("slide"),
            "{name}: {reasons:?} {weak}"
        );
    }
}

#[test]
fn on_a_turntable_on_the_floor_and_before_a_wall_the_object_is_placed_alone() {
    for (ground, name) in [(Ground::Turntable, "animal"), (Ground::Floor, "figure"), (Ground::FloorAndWall, "head")] {
        let options = SceneOptions { ground, views: 8, resolution: 3.3, specks: 9, ..SceneOptions::default() };
        let scene = scene_set(&shape(name).mesh(31), &options, 1);
        let mut pile = Pile::default();
        scene.set.scans.iter().zip(&scene.set.poses).for_each(|(scan, pose)| pile.add(0, scan, pose));
        let outcome = pile.run(&[], &Options { cloud: true, ..BARE });
        for (view, is_object) in scene.is_object.iter().enumerate() {
            let left_out = &outcome.report.to_json()["views"][view]["left_out"];
            let others = is_object.iter().filter(|is| !**is).count() as u64;
            let told = left_out["support"].as_u64().unwrap_or(0) + left_out["strays"].as_u64().unwrap_or(0);
            let lost = told.saturating_sub(others);
            assert!(told > others * 98 / 100, "{name} on {ground:?}: {told} of {others} left out of view {view}");
            assert!(lost * 20 < is_object.len() as u64 - others, "{name} on {ground:?}: {lost} points of it lost");
        }
        let poses: Vec<Motion> = outcome.poses.iter().map(|(name, pose)| pose.expect(name)).collect();
        // where the object is, not the table
        let own = |view: usize| -> Vec<Point3> {
            let points = pile.scans[view].surface.cloud.points.iter().zip(&scene.is_object[view]);
            points.filter(|(_, is)| **is).map(|(p, _)| *p).step_by(9).collect()
        };
        let points: Vec<Vec<Point3>> = (0..pile.scans.len()).map(own).collect();
        let error_mm = pose_error(&poses, &pile.truth, &points).points_rms;
        assert!(error_mm < 0.5, "{name} on {ground:?}: {error_mm} mm");
    }
}
