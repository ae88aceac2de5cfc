//! What turns or slides in itself is held by what is printed on it.

use std::collections::BTreeMap;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use visage_geometry::progress::Progress;
use visage_geometry::{Motion, Unit, Vector3};
use visage_pipeline::{NamedScan, Options, run};
use visage_synthetic::printed::{Printed, printed_set};
use visage_synthetic::scanner::ScanSet;

/// The set with the colours of its scans or without, from true poses turned by up to 2 degrees about each axis and shifted by up to
/// 4 mm (points lie 1.6 mm apart): for each scan by how far its points are off (root mean square, mm), in the frame of the first.
fn errors(set: &ScanSet, has_colours: bool, seed: u64) -> Vec<f64> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut number = || rng.random_range(-1.0..1.0);
    let mut scans = Vec::new();
    let mut given = BTreeMap::new();
    for (view, (scan, pose)) in set.scans.iter().zip(&set.poses).enumerate() {
        let shift = Vector3::new(number(), number(), number()) * 4.0;
        let turn = Vector3::new(number(), number(), number()) * 2f64.to_radians();
        let name = format!("{view}.ply");
        given.insert(name.clone(), Motion::new(shift, turn) * pose);
        let mut surface = scan.clone();
        surface.cloud.colors = surface.cloud.colors.filter(|_| has_colours);
        scans.push(NamedScan { name, surface });
    }
    let options = Options { cloud: false, signature: false, keep_all: true, ..Options::default() };
    let outcome = run(scans, &given, Unit::Mm, &options, &Progress::silent()).expect("it can be registered");
    let found: Vec<Motion> = outcome.poses.iter().map(|(_, pose)| pose.expect("it is placed")).collect();
    let world = set.poses[0] * found[0].inverse();
    let off = |(view, scan): (usize, &visage_geometry::Surface)| {
        let points = &scan.cloud.points;
        let squares =
            points.iter().map(|p| (world * found[view] * p - set.poses[view] * p).norm_squared()).sum::<f64>();
        (squares / points.len() as f64).sqrt()
    };
    set.scans.iter().enumerate().map(off).collect()
}

fn worst(errors: &[f64]) -> f64 {
    errors.iter().copied().fold(0.0, f64::max)
}

#[test]
fn a_printed_bottle_and_a_printed_wall_are_right_by_their_colours_alone() {
    for what in [Printed::Bottle, Printed::Wall] {
        for seed in [1, 2] {
            let set = printed_set(what, seed);
            let [without, with] = [false, true].map(|has_colours| errors(&set, has_colours, seed));
            assert!(worst(&without) > 1.0, "{what:?}: geometry alone leaves it off: {without:?}");
            assert!(worst(&with) < 0.8, "{what:?}: {with:?}");
        }
    }
}
