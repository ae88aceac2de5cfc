//! Scales and additions on real scans. Needs the data folder in VISAGE_DATA; run in release:
//! `cargo test --release --test real additions -- --ignored --nocapture`.

use std::collections::BTreeMap;

use visage::formats::{self, ReadLimits, poses};
use visage::geometry::{Motion, Unit};
use visage::pipeline::{self, NamedScan, Options, RegisteredModel, Scale, Start};
use visage::progress::Progress;

use crate::{data, read};

/// The bunny's scans, their coordinates divided by `factors`, in the order of the names.
fn bunny(factors: impl Fn(usize) -> f64) -> (Vec<NamedScan>, BTreeMap<String, Motion>) {
    let start = poses::read("init", &read(data("init/bunny_a0.02_o_s0.json"))).expect("sound poses").to_map();
    let scan = |(view, name): (usize, &String)| {
        let bytes = read(data(&format!("stanford/bunny/{name}")));
        let mut surface = formats::read_surface(name, &bytes, &ReadLimits::default()).expect("a sound scan");
        surface.cloud.points.iter_mut().for_each(|point| *point /= factors(view));
        NamedScan { name: name.clone(), surface }
    };
    (start.keys().enumerate().map(scan).collect(), start)
}

fn run(scans: Vec<NamedScan>, start: &Start, scale: Scale) -> RegisteredModel {
    let options = Options { scale, cloud: false, signature: false, ..Options::default() };
    pipeline::run_from(scans, start, Unit::M, &options, &Progress::silent()).expect("a sound set")
}

#[test]
#[ignore = "needs VISAGE_DATA"]
fn scaled_copies_of_the_bunny_are_scaled_back() {
    const FACTORS: [f64; 10] = [1.0, 0.8, 1.25, 1.1, 0.93, 1.2, 0.85, 1.05, 0.9, 1.15];
    let (scans, start) = bunny(|view| FACTORS[view]);
    let scaled = run(scans, &Start::from(&start), Scale::PerView);
    // what the scans say of themselves when they all have their own size: the scanner's own disagreement
    let (scans, _) = bunny(|_| 1.0);
    let plain = run(scans, &Start::from(&start), Scale::PerView);
    for (view, factor) in FACTORS.iter().enumerate() {
        let scale =
            |outcome: &RegisteredModel| outcome.report.to_json()["views"][view]["scale"].as_f64().expect("a scale");
        let (from_scaled, from_plain) = (scale(&scaled) / factor - 1.0, scale(&plain) - 1.0);
        println!("{view}: {:.4} % from scaled scans, {:.4} % from plain ones", from_scaled * 100.0, from_plain * 100.0);
        assert!((from_scaled - from_plain).abs() < 1e-3);
    }
    assert_eq!(scaled.report.to_json()["verdict"]["quality"], "good");
}

#[test]
#[ignore = "needs VISAGE_DATA"]
fn scans_are_added_to_the_bunny() {
    let (mut scans, start) = bunny(|_| 1.0);
    let all = scans.clone();
    scans.truncate(8);
    let base = run(scans, &Start::from(&start), Scale::None);
    let fixed = base.matrices.iter().filter_map(|(name, matrix)| Some((name.clone(), (*matrix)?))).collect();
    let added = run(all.clone(), &Start { base: fixed, ..Start::from(&start) }, Scale::None);
    assert_eq!(poses::write_matrices(&added.matrices[..8]), poses::write_matrices(&base.matrices));
    assert_eq!(added.report.to_json()["verdict"]["quality"], "good");
    let anew = run(all, &Start::from(&start), Scale::None);
    for view in 8..10 {
        let pose = |outcome: &RegisteredModel| outcome.poses[view].1.expect("placed");
        let off = pose(&anew).inv_mul(&pose(&added));
        println!(
            "{view}: {:.3} deg, {:.3} mm from where it lies anew",
            off.rotation.angle().to_degrees(),
            off.translation.vector.norm() * 1e3
        );
        assert!(off.rotation.angle().to_degrees() < 0.3);
    }
}
