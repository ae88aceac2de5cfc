//! Scans of a walk through a building, from the scans alone: all lie right, in whatever order they come.

use std::collections::BTreeMap;

use visage::geometry::{Motion, Point3, Surface, Unit, se3};
use visage::pipeline::{self, NamedScan, Options};
use visage::progress::Progress;
use visage::synthetic::sensors::walk;

/// How many scans lie right among `count` of a walk, taken in steps of `stride` through them.
fn right(count: usize, stride: usize) -> usize {
    let set = walk(count, 1);
    let order: Vec<usize> = (0..count).map(|k| k * stride % count).collect();
    let truth: Vec<Motion> = order.iter().map(|k| set.poses[*k]).collect();
    let samples: Vec<Vec<Point3>> =
        order.iter().map(|k| set.scans[*k].cloud.points.iter().step_by(100).copied().collect()).collect();
    let bare = |k: &usize| Surface { cloud: set.scans[*k].cloud.clone(), ..Surface::default() };
    let named = |(place, k): (usize, &usize)| NamedScan { name: format!("s{place}.ply"), surface: bare(k) };
    let scans = order.iter().enumerate().map(named).collect();
    let options = Options { cloud: false, signature: false, ..Options::default() };
    let outcome = pipeline::run(scans, &BTreeMap::new(), Unit::M, &options, &Progress::silent()).expect("sound scans");
    let found: Vec<Option<Motion>> = outcome.poses.iter().map(|(_, pose)| *pose).collect();
    let by_reference = |reference: usize| {
        let world = truth[reference] * found[reference]?.inverse();
        let is_right = |view: &usize| {
            found[*view].is_some_and(|pose| {
                let off = |p: &Point3| (world * pose * p - truth[*view] * p).norm_squared();
                let square = samples[*view].iter().map(off).sum::<f64>() / samples[*view].len() as f64;
                let turn = se3::rotation_angle(&((world * pose).rotation.inverse() * truth[*view].rotation));
                square.sqrt() < 0.1 && turn.to_degrees() < 2.0
            })
        };
        Some((0..count).filter(is_right).count())
    };
    (0..count).filter_map(by_reference).max().unwrap_or(0)
}

#[test]
fn the_first_scans_of_a_walk_are_laid_together_in_any_order() {
    for stride in [1, 3] {
        assert_eq!(right(10, stride), 10, "every {stride}th");
    }
}

mod long {
    /// More than all pairs are matched of; half a minute of CPU time in release.
    #[test]
    #[ignore = "long"]
    fn twenty_five_scans_of_a_walk_are_laid_together_in_any_order() {
        for stride in [1, 7] {
            assert_eq!(super::right(25, stride), 25, "every {stride}th");
        }
    }
}
