//! A thing turns before a scanner and a background that stand still.

use visage::geometry::{Motion, Unit, se3};
use visage::pipeline::{self, NamedScan, Options, RegisteredModel, Start};
use visage::progress::Progress;
use visage::synthetic::scenery::SceneKind;
use visage::synthetic::sensors::{SensorKind, SensorSet, sensor_set};

fn registered(set: &SensorSet) -> RegisteredModel {
    let scans = set.scans.iter().enumerate();
    let scans = scans.map(|(k, scan)| NamedScan { name: format!("scan{k}.ply"), surface: scan.clone() }).collect();
    let options = Options { cloud: false, signature: false, ..Options::default() };
    pipeline::run_from(scans, &Start::default(), Unit::Unknown, &options, &Progress::silent()).expect("a usable set")
}

#[test]
fn a_background_is_cut_and_the_thing_that_turned_before_it_is_placed() {
    let set = sensor_set(SensorKind::Laser, SceneKind::Turntable, 2);
    let outcome = registered(&set);
    let poses: Vec<Motion> =
        outcome.poses.iter().map(|(name, pose)| pose.unwrap_or_else(|| panic!("{name}"))).collect();
    for view in 1..poses.len() {
        let found = poses[0].inv_mul(&poses[view]);
        let truth = set.poses[0].inv_mul(&set.poses[view]);
        let off = se3::rotation_angle(&(found.rotation.inverse() * truth.rotation)).to_degrees();
        assert!(off < 2.0, "view {view} is off by {off:.1} degrees");
        let count = set.scans[view].cloud.len() as f64;
        let still = outcome.report.to_json()["views"][view]["left_out"]["still"].as_f64().expect("a count");
        assert!((0.75 * count..0.95 * count).contains(&still), "{still} of {count} points stand still");
    }
}

#[test]
fn a_background_that_holds_the_scans_makes_them_doubtful() {
    // things of which too little is seen to place them; a phone does not show where it stood
    for kind in [SensorKind::Vehicle, SensorKind::Phone] {
        let outcome = registered(&sensor_set(kind, SceneKind::Turntable, 1));
        let verdict = &outcome.report.to_json()["verdict"];
        assert_eq!(verdict["quality"], "doubtful", "{kind:?}");
        assert!(verdict["reasons"].to_string().contains("taken from one place"), "{kind:?}: {}", verdict["reasons"]);
    }
}

#[test]
fn a_scanner_that_goes_about_a_thing_was_not_at_one_place() {
    for (kind, scene) in [(SensorKind::Laser, SceneKind::Object), (SensorKind::Panorama, SceneKind::Sculpture)] {
        let outcome = registered(&sensor_set(kind, scene, 1));
        let verdict = &outcome.report.to_json()["verdict"];
        assert_eq!(verdict["quality"], "good", "{kind:?} {scene:?}: {}", verdict["reasons"]);
        assert!(
            outcome.report.to_json()["views"]
                .as_array()
                .into_iter()
                .flatten()
                .all(|view| view["left_out"]["still"].is_null())
        );
    }
}
