//! Registration of real scans, scored at full resolution. Needs the data folder in VISAGE_DATA; run in release:
//! `cargo test --release --test real registration -- --ignored --nocapture`.

use std::collections::BTreeMap;
use std::path::Path;

use rayon::prelude::*;
use visage::formats::{self, ReadLimits};
use visage::geometry::Motion;
use visage::geometry::neighbours::{IndexedPoints, LocalPoint};
use visage::pipeline::Method;
use visage::progress::Progress;
use visage::registration::objective::{Objective, ScoredPair, objective};
use visage::registration::outcome::{MethodOptions, Outcome};
use visage::registration::overlap::overlaps;
use visage::registration::quality::{Evidence, Quality, Surfaces, judge};
use visage::registration::view::View;
use visage::synthetic::truth::pose_error;

use crate::{data, read};

/// A set whose scans are in metres; figures are in millimetres.
struct StanfordSet {
    name: &'static str,
    conf: &'static str,
    /// Best figures of the strongest peer: GICP of all overlapping pairs twice, with a pose graph.
    peer_plane_mm: f64,
    peer_mutual_mm: f64,
    /// What ma-aticp must reach.
    plane_mm: f64,
    trim_mm: f64,
}

const SETS: [StanfordSet; 3] = [
    StanfordSet {
        name: "bunny",
        conf: "bun.conf",
        peer_plane_mm: 0.2001,
        peer_mutual_mm: 0.3152,
        plane_mm: 0.215,
        trim_mm: 0.423,
    },
    StanfordSet {
        name: "dragon",
        conf: "dragonStandRight.conf",
        peer_plane_mm: 0.1752,
        peer_mutual_mm: 0.2978,
        plane_mm: 0.20,
        trim_mm: 0.385,
    },
    StanfordSet {
        name: "happy",
        conf: "happyStandRight.conf",
        peer_plane_mm: 0.1293,
        peer_mutual_mm: 0.1812,
        plane_mm: 0.16,
        trim_mm: 0.25,
    },
];

/// What an independent scorer gives at the true poses, set by set: mutual, trim, plane.
const GROUND_TRUTH_MM: [[f64; 3]; 3] = [
    [0.3181265016816136, 0.41894625454995615, 0.20664147447867218],
    [0.325145824301029, 0.39860116513763233, 0.2275680944317932],
    [0.22326619089027713, 0.27404125237232396, 0.19508723430819774],
];

fn read_view(path: &Path) -> View {
    let name = path.to_string_lossy();
    let surface = formats::read_surface(&name, &read(path), &ReadLimits::default()).expect("a sound scan");
    View::new(&surface.cloud).expect("a scan that can be used")
}

fn read_poses(path: &Path) -> Vec<(String, Motion)> {
    formats::poses::read(&path.to_string_lossy(), &read(path)).expect("a sound pose file").poses
}

struct Loaded {
    names: Vec<String>,
    views: Vec<View>,
    truth: Vec<Motion>,
    pairs: Vec<ScoredPair>,
}

/// Reads a set and fixes the scored pairs by the overlaps at the true poses, within two spacings.
fn load(set: &StanfordSet) -> Loaded {
    let folder = data("stanford").join(set.name);
    let posed = read_poses(&folder.join(set.conf));
    let names: Vec<String> = posed.iter().map(|(name, _)| name.clone()).collect();
    let views: Vec<View> = names.iter().map(|name| read_view(&folder.join(name))).collect();
    let truth: Vec<Motion> = posed.iter().zip(&views).map(|((_, pose), view)| view.local_pose(pose)).collect();
    let targets: Vec<&IndexedPoints> = views.iter().map(|view| &view.indexed).collect();
    let queries: Vec<&[LocalPoint]> = views.iter().map(View::points).collect();
    let spacing = views.iter().map(mean_spacing).sum::<f64>() / views.len() as f64;
    let xi = overlaps(&targets, &queries, &truth, 2.0 * spacing, &Progress::silent()).expect("not canceled");
    let mut pairs = Vec::new();
    for i in 0..views.len() {
        for j in i + 1..views.len() {
            if xi.mutual(i, j) > 0.5 {
                pairs.push(ScoredPair { views: (i, j), overlaps: (xi.directed(i, j), xi.directed(j, i)) });
            }
        }
    }
    Loaded { names, views, truth, pairs }
}

/// The median over all points of the distance from the nearest other point.
fn mean_spacing(view: &View) -> f64 {
    let mut found = Vec::new();
    let mut distances: Vec<f32> = view
        .points()
        .iter()
        .map(|point| {
            view.indexed.tree.k_nearest(point, 2, f32::INFINITY, &mut found);
            found[1].distance2
        })
        .collect();
    distances.sort_by(f32::total_cmp);
    let middle = distances.len() / 2;
    f64::from(0.5 * (distances[(distances.len() - 1) / 2].sqrt() + distances[middle].sqrt()))
}

fn in_mm(o: Objective) -> Objective {
    Objective { mutual: 1e3 * o.mutual, trim: 1e3 * o.trim, plane: 1e3 * o.plane }
}

fn register_only(loaded: &Loaded, set: &StanfordSet, method: Method, level: &str, seed: u32) -> Outcome {
    let file = data("init").join(format!("{}_a{level}_o_s{seed}.json", set.name));
    let initial: BTreeMap<String, Motion> = read_poses(&file).into_iter().collect();
    let initial: Vec<Motion> =
        loaded.names.iter().zip(&loaded.views).map(|(name, view)| view.local_pose(&initial[name])).collect();
    let options = MethodOptions::default();
    method.register(&loaded.views, &initial, &options, &Progress::silent()).expect("not canceled")
}

fn register(loaded: &Loaded, set: &StanfordSet, method: Method, level: &str, seed: u32) -> (Objective, Quality) {
    let result = register_only(loaded, set, method, level, seed);
    let surfaces = Surfaces::measure(&loaded.views, &result);
    let verdict = judge(&Evidence::of_surfaces(&loaded.names, &result, &surfaces));
    let scored = in_mm(objective(&loaded.views, &result.local_poses, &loaded.pairs));
    println!("{} {method} {level} seed {seed}: {scored:.5?} {:?} {:?}", set.name, verdict.quality, verdict.reasons);
    (scored, verdict.quality)
}

#[test]
#[ignore = "needs VISAGE_DATA"]
fn the_objective_is_the_judges() {
    // figures of the independent scorer at the true poses
    for (set, [mutual, trim, plane]) in SETS.iter().zip(GROUND_TRUTH_MM) {
        let loaded = load(set);
        let scored = in_mm(objective(&loaded.views, &loaded.truth, &loaded.pairs));
        println!("{}: {scored:.7?}", set.name);
        for (ours, theirs) in [(scored.mutual, mutual), (scored.trim, trim), (scored.plane, plane)] {
            assert!((ours / theirs - 1.0).abs() < 1e-5, "{}: {ours} is not {theirs}", set.name);
        }
    }
}

#[test]
#[ignore = "needs VISAGE_DATA"]
fn joint_is_as_good_as_the_strongest_peer_from_every_start() {
    for set in &SETS {
        let loaded = load(set);
        let mut planes = Vec::new();
        for level in ["0.02", "0.04", "0.06"] {
            for seed in 0..5 {
                let (scored, quality) = register(&loaded, set, Method::Joint, level, seed);
                assert!(scored.plane <= 1.002 * set.peer_plane_mm, "{scored:?}");
                assert!(scored.mutual <= 1.002 * set.peer_mutual_mm, "{scored:?}");
                assert_eq!(quality, Quality::Good);
                planes.push(scored.plane);
            }
        }
        let (least, most) = planes.iter().fold((f64::MAX, 0.0f64), |(a, b), p| (a.min(*p), b.max(*p)));
        println!("{}: obj_plane {least:.5} to {most:.5} mm", set.name);
        assert!(most / least <= 1.002, "spread over the starts: {least} to {most}");
    }
}

/// Scoring takes ten times as long as registering, so a fifth of the results is scored; the others lie on those.
#[test]
#[ignore = "needs VISAGE_DATA"]
fn fifty_starts_at_each_level_of_noise_end_at_the_same_poses() {
    let [bunny, ..] = &SETS;
    let loaded = load(bunny);
    let spacing = visage::registration::view::common_spacing(&loaded.views);
    let corner = nalgebra::Point3::from([0.1; 3]);
    for level in ["0.02", "0.04", "0.06"] {
        let seeds: Vec<u32> = (0..50).collect();
        let found: Vec<Vec<Motion>> = seeds
            .par_iter()
            .map(|seed| register_only(&loaded, bunny, Method::Joint, level, *seed).local_poses)
            .collect();
        let farthest = found.iter().flat_map(|poses| poses.iter().zip(&found[0]));
        let farthest = farthest.map(|(a, b)| (a * corner - b * corner).norm() / spacing).fold(0.0, f64::max);
        let scored: Vec<f64> = found
            .par_iter()
            .step_by(5)
            .map(|poses| in_mm(objective(&loaded.views, poses, &loaded.pairs)).plane)
            .collect();
        let mean = scored.iter().sum::<f64>() / scored.len() as f64;
        let squares = scored.iter().map(|plane| (plane - mean).powi(2)).sum::<f64>();
        let deviation = (squares / (scored.len() - 1) as f64).sqrt();
        println!("{level} rad: obj_plane {mean:.5} +- {deviation:.6} mm, poses within {farthest:.4} spacings");
        assert!(mean <= 1.002 * bunny.peer_plane_mm && deviation <= 0.0002, "{scored:?}");
        assert!(farthest < 0.1, "{farthest}");
    }
}

#[test]
#[ignore = "needs VISAGE_DATA"]
fn ma_aticp_reaches_its_figures_with_the_same_defaults_on_all_sets() {
    for set in &SETS {
        let loaded = load(set);
        for seed in 0..5 {
            let (scored, quality) = register(&loaded, set, Method::MaAticp, "0.04", seed);
            assert!(scored.plane <= set.plane_mm && scored.trim <= set.trim_mm, "{scored:?}");
            assert_eq!(quality, Quality::Good);
        }
    }
}

#[test]
#[ignore = "needs VISAGE_DATA"]
fn simulated_heads_are_placed_within_half_a_millimetre_of_the_truth() {
    // ma-aticp slides on the owl's smooth back (0.74 mm): point to point says little there
    let heads = ["head_a", "head_b", "real_maxplanck"];
    let cases =
        [(Method::Joint, &["head_a", "head_b", "real_maxplanck", "nonface_owl"][..]), (Method::MaAticp, &heads)];
    for (method, names) in cases {
        for name in names {
            let folder = data("faces/scansets").join(name);
            let truth = read_poses(&folder.join("poses_gt.txt"));
            let start: BTreeMap<String, Motion> = read_poses(&folder.join("poses_init.txt")).into_iter().collect();
            let views: Vec<View> = truth.iter().map(|(scan, _)| read_view(&folder.join(scan))).collect();
            let initial: Vec<Motion> =
                truth.iter().zip(&views).map(|((scan, _), view)| view.local_pose(&start[scan])).collect();
            let options = MethodOptions::default();
            let result = method.register(&views, &initial, &options, &Progress::silent()).expect("not canceled");
            let poses: Vec<Motion> =
                views.iter().zip(&result.local_poses).map(|(view, pose)| view.scan_pose(pose)).collect();
            let truth: Vec<Motion> = truth.iter().map(|(_, pose)| *pose).collect();
            let points: Vec<_> = views
                .iter()
                .map(|view| (0..view.points().len()).step_by(10).map(|k| view.in_scan_frame(k)).collect())
                .collect();
            let error = pose_error(&poses, &truth, &points);
            println!("{name} {method}: {error:?}");
            assert!(error.points_rms <= 0.5, "{name} {method}: {error:?}");
        }
    }
}
