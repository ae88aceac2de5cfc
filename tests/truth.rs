//! Truth about itself: covariances that hold, weak axes that are named, verdicts that are right. All on code-made
//! scans, whose poses are known exactly. The long runs: `cargo test --release --test truth -- --ignored --nocapture`.

use std::collections::BTreeMap;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use visage::geometry::{Cloud, Motion, Point3, Vector3, se3};
use visage::progress::Progress;
use visage::registration::covariance::weak_axes::{AxisKind, WeakAxis, weak_axes};
use visage::registration::covariance::{self, PoseCovariance};
use visage::registration::method::Method;
use visage::registration::outcome::{MethodOptions, Outcome};
use visage::registration::quality::free_space::intrusions;
use visage::registration::quality::{Evidence, Quality, Surfaces, Verdict, judge};
use visage::registration::sensor::Sensor;
use visage::registration::view::View;
use visage::registration::view::common_spacing;
use visage::synthetic::shapes::{ScanOptions, Shape, Symmetry, catalogue, scan_set};
use visage::synthetic::truth::disturb;

/// Scans with their true local poses.
struct Truth {
    views: Vec<View>,
    poses: Vec<Motion>,
}

impl Truth {
    fn of(shape: &Shape, views: usize, points: usize, seed: u64) -> Self {
        let set = scan_set(shape, views, &ScanOptions { points, ..ScanOptions::default() }, seed);
        let views: Vec<View> =
            set.scans.iter().map(|scan| View::new(&scan.cloud).expect("a scan that can be used")).collect();
        let poses = views.iter().zip(&set.poses).map(|(view, pose)| view.local_pose(pose)).collect();
        Truth { views, poses }
    }

    /// Scan poses disturbed by 0.04 rad and 3 mm.
    fn near(&self, seed: u64) -> Vec<Motion> {
        let scans: Vec<Motion> = self.views.iter().zip(&self.poses).map(|(view, pose)| view.scan_pose(pose)).collect();
        self.views.iter().zip(disturb(&scans, 0.04, 3.0, seed)).map(|(view, pose)| view.local_pose(&pose)).collect()
    }

    /// Each chosen view turned by 45 degrees about a random axis through its own centre: all but the first, one, some.
    fn turned(&self, which: u64, seed: u64) -> Vec<Motion> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let one = 1 + seed as usize % (self.poses.len() - 1);
        let mut turn = |(view, pose): (usize, &Motion)| {
            let axis = Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0)).normalize();
            let coin: bool = rng.random();
            let hit = view > 0 && [true, view == one, coin][which as usize % 3];
            if hit { pose * Motion::rotation(axis * std::f64::consts::FRAC_PI_4) } else { *pose }
        };
        self.poses.iter().enumerate().map(&mut turn).collect()
    }

    fn register(&self, initial: &[Motion]) -> Registered {
        let options = MethodOptions::default();
        let result = Method::Joint.register(&self.views, initial, &options, &Progress::silent()).expect("not canceled");
        let names: Vec<String> = (0..self.views.len()).map(|view| format!("scan {view}")).collect();
        let spacing = common_spacing(&self.views);
        let sensors: Vec<Option<Vector3>> = self.views.iter().map(|view| Some(-view.center)).collect();
        let surfaces = Surfaces::measure(&self.views, &result);
        let (poses, placed) = (&result.local_poses, &result.placed);
        let intrusions = intrusions(&self.views, &sensors, poses, placed, surfaces.resolution);
        let known = covariance::of_result(&self.views, &result).covariances;
        let verdict = judge(&Evidence {
            intrusions: &intrusions,
            covariances: &known,
            unit: spacing,
            ..Evidence::of_surfaces(&names, &result, &surfaces)
        });
        Registered { result, verdict, known, spacing }
    }

    /// Largest root mean square displacement of a placed view, in spacings.
    fn displacement(&self, registered: &Registered) -> f64 {
        let poses = &registered.result.local_poses;
        let off = |view: usize| {
            let error = poses[view].inv_mul(&self.poses[view]);
            let points: Vec<_> = self.views[view].points().iter().step_by(17).collect();
            let moved = |p: &[f32; 3]| {
                let p = nalgebra::Point3::from(*p).cast::<f64>();
                (error * p - p).norm_squared()
            };
            (points.iter().map(|p| moved(p)).sum::<f64>() / points.len() as f64).sqrt() / registered.spacing
        };
        (0..poses.len()).filter(|&view| registered.result.placed[view]).map(off).fold(0.0, f64::max)
    }
}

struct Registered {
    result: Outcome,
    verdict: Verdict,
    known: Vec<Option<PoseCovariance>>,
    spacing: f64,
}

fn shape(name: &str) -> Shape {
    catalogue().into_iter().find(|shape| shape.name == name).expect("it is in the catalogue")
}

/// The 95 % quantile of chi-squared with six degrees of freedom.
const CHI2_95: f64 = 12.592;

/// Squared Mahalanobis lengths of the true errors of all views.
fn squared_errors(truth: &Truth, registered: &Registered) -> Vec<f64> {
    let error = |(view, known): (usize, &Option<PoseCovariance>)| {
        let known = known.as_ref()?;
        let center = Motion::from(nalgebra::Translation3::from(known.center.coords));
        let left = registered.result.local_poses[view] * truth.poses[view].inverse();
        let twist = se3::log(&(center.inverse() * left * center));
        Some(twist.dot(&(known.covariance.try_inverse()? * twist)))
    };
    registered.known.iter().enumerate().filter_map(error).collect()
}

/// Savings in the last pass or in the choice of pairs may cost what figures over surfaces don't show.
#[test]
#[ignore = "long: eleven registrations of full size"]
fn smooth_and_edged_shapes_end_at_their_true_poses() {
    let names = ["animal", "bean", "blob", "coral", "crank", "figure", "gem", "head", "pebble", "rope", "teapot"];
    for name in names {
        let truth = Truth::of(&shape(name), 8, 10_000, 1);
        let registered = truth.register(&truth.near(1));
        let off = truth.displacement(&registered);
        println!("{name}: {off:.4} spacings");
        assert!(off < 0.1, "{name} is {off} spacings off");
    }
}

/// Registers instances of shapes and counts, shape by shape, views, views within their 95 % ellipsoid, and sets whose
/// verdict is not good: those are said to be doubtful, and their ellipsoids are not counted.
fn coverage(names: &[&'static str], seeds: std::ops::Range<u64>, points: usize) -> BTreeMap<&'static str, [usize; 3]> {
    let trials: Vec<(&'static str, u64)> = names.iter().flat_map(|name| seeds.clone().map(|s| (*name, s))).collect();
    let counts: Vec<(&str, [usize; 3])> = trials
        .into_par_iter()
        .map(|(name, seed)| {
            let truth = Truth::of(&shape(name), 8, points, seed);
            let registered = truth.register(&truth.near(seed));
            if registered.verdict.quality != Quality::Good {
                return (name, [0, 0, 1]);
            }
            let errors = squared_errors(&truth, &registered);
            (name, [errors.len(), errors.iter().filter(|e| **e < CHI2_95).count(), 0])
        })
        .collect();
    let mut sums = BTreeMap::new();
    for (name, count) in counts {
        let sum: &mut [usize; 3] = sums.entry(name).or_default();
        (0..3).for_each(|k| sum[k] += count[k]);
    }
    sums
}

/// The share of views within their ellipsoids, and of sets that were not counted.
fn shares(counts: &BTreeMap<&'static str, [usize; 3]>, sets: usize) -> (f64, f64) {
    for (name, [views, held, doubtful]) in counts {
        println!("{name}: {held} of {views} views within the 95 % ellipsoid, {doubtful} sets doubtful");
    }
    let sum = |k: usize| counts.values().map(|count| count[k]).sum::<usize>() as f64;
    (sum(1) / sum(0), sum(2) / sets as f64)
}

#[test]
fn ellipsoids_hold_the_true_poses() {
    let names = ["figure", "teapot"];
    let (held, doubtful) = shares(&coverage(&names, 3..4, 4000), 2);
    // of scans so small one may look weakly held
    assert!(held >= 0.8 && doubtful <= 0.5, "{held} {doubtful}");
}

/// `SYSTEMATIC` was set on these shapes with the seeds 100 to 119; these are others.
#[test]
#[ignore = "long: two hundred registrations"]
fn ellipsoids_of_two_hundred_registrations_hold_the_true_poses() {
    let smooth = ["blob", "head", "pebble", "bean", "animal"];
    let jagged = ["figure", "teapot", "gem", "coral", "rope"];
    for names in [smooth, jagged] {
        let (held, doubtful) = shares(&coverage(&names, 200..220, 5000), 100);
        println!("held {held:.3}, not good {doubtful:.3}");
        assert!((0.90..=0.99).contains(&held), "{held}");
        assert!(doubtful <= 0.15, "{doubtful}");
    }
}

#[test]
fn told_where_the_scanner_stood_the_sides_of_a_thin_leaf_are_kept_apart() {
    let mut truth = Truth::of(&shape("leaf"), 8, 5000, 1);
    let initial = truth.near(1);
    let untold = truth.register(&initial);
    assert!(untold.verdict.quality != Quality::Good || truth.displacement(&untold) < 1.0);
    truth.views.iter_mut().for_each(|view| view.sensor = Some(Sensor::At(-view.center)));
    let told = truth.register(&initial);
    assert!(truth.displacement(&told) < 1.0, "{} spacings", truth.displacement(&told));
}

fn weak_axes_of(name: &str) -> Vec<Vec<WeakAxis>> {
    let truth = Truth::of(&shape(name), 6, 2500, 1);
    let registered = truth.register(&truth.poses);
    assert_ne!(registered.verdict.quality, Quality::Good, "{name}");
    assert!(registered.verdict.reasons.iter().any(|reason| reason.contains(" can ")), "{:?}", registered.verdict);
    registered.known.iter().flatten().map(|pose| weak_axes(pose, registered.spacing)).collect()
}

fn is_along(axis: &WeakAxis, direction: Vector3) -> bool {
    Vector3::from(axis.direction).dot(&direction).abs() > 0.99
}

#[test]
fn a_cone_and_a_cylinder_turn_about_their_axis() {
    for name in ["cone", "cylinder"] {
        for axes in weak_axes_of(name) {
            let turn = axes.iter().find(|axis| axis.kind == AxisKind::Rotation).expect("it can turn");
            assert!(is_along(turn, Vector3::y()), "{name}: {turn:?}");
            let point = Point3::from(turn.point.expect("a turn has an axis"));
            assert!(point.x.hypot(point.z) < 5.0, "{name}: {turn:?}");
        }
    }
}

#[test]
fn a_ball_turns_about_three_axes_through_its_middle() {
    for axes in weak_axes_of("sphere") {
        assert_eq!(axes.len(), 3, "{axes:?}");
        for axis in &axes {
            assert_eq!(axis.kind, AxisKind::Rotation);
            let (point, direction) = (Vector3::from(axis.point.expect("an axis")), Vector3::from(axis.direction));
            assert!(point.cross(&direction).norm() < 3.0, "{axis:?} misses the middle");
            assert!(axis.held < 0.5);
        }
    }
}

#[test]
fn views_of_a_plane_slide_and_turn_in_it() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let mut sheet = || {
        let place = |k: usize| Point3::new((k % 50) as f64, (k / 50) as f64, rng.random_range(-0.1..0.1));
        View::new(&Cloud::from_points((0..2500).map(place).collect())).expect("a sheet can be used")
    };
    let views = vec![sheet(), sheet(), sheet()];
    let poses = views.iter().map(|view| view.local_pose(&Motion::identity())).collect();
    let truth = Truth { views, poses };
    for pose in truth.register(&truth.poses).known.iter().flatten() {
        let axes = weak_axes(pose, 1.0);
        assert_eq!(axes.len(), 3, "{axes:?}");
        let slides = axes.iter().filter(|axis| axis.kind == AxisKind::Translation);
        assert_eq!(slides.filter(|axis| axis.direction[2].abs() < 0.05).count(), 2, "{axes:?}");
        assert!(axes.iter().any(|axis| axis.kind == AxisKind::Rotation && is_along(axis, Vector3::z())), "{axes:?}");
    }
}

#[derive(Debug, Default)]
struct Tally {
    good_and_right: usize,
    good_but_wrong: Vec<String>,
    right: usize,
    trials: usize,
}

/// Registers from starts that are wrong by 45 degrees. A view more than two spacings off is wrong.
fn judge_wrong_starts(shapes: &[Shape], seeds: std::ops::Range<u64>, points: usize) -> Tally {
    let sets: Vec<(Shape, u64)> = shapes.iter().flat_map(|shape| seeds.clone().map(|seed| (*shape, seed))).collect();
    let trials: Vec<(String, Quality, f64)> = sets
        .into_par_iter()
        .flat_map_iter(|(shape, seed)| {
            let truth = Truth::of(&shape, 9, points, seed);
            (0..3).map(move |which| {
                let registered = truth.register(&truth.turned(which, seed));
                let name = format!("{} {seed}, start {which}", shape.name);
                (name, registered.verdict.quality, truth.displacement(&registered))
            })
        })
        .collect();
    let mut tally = Tally::default();
    for (name, quality, displacement) in trials {
        let (good, right) = (quality == Quality::Good, displacement <= 2.0);
        tally.trials += 1;
        tally.right += usize::from(right);
        tally.good_and_right += usize::from(good && right);
        if good && !right {
            tally.good_but_wrong.push(format!("{name}: {displacement:.1} spacings"));
        }
    }
    tally
}

#[test]
fn wrong_poses_are_not_called_good() {
    let shapes = ["teapot", "cylinder"].map(shape);
    let tally = judge_wrong_starts(&shapes, 50..51, 2500);
    println!("{tally:?}");
    assert!(tally.good_but_wrong.is_empty(), "{tally:?}");
    assert!(tally.right < tally.trials && tally.good_and_right > 0, "{tally:?}");
}

/// Shapes that a part of a turn leaves as they are can't be judged: they fit when turned.
#[test]
#[ignore = "long: two hundred registrations"]
fn wrong_poses_are_not_called_good_in_two_hundred_trials() {
    let shapes: Vec<Shape> = catalogue().into_iter().filter(|shape| shape.symmetry != Symmetry::Turns).collect();
    let tally = judge_wrong_starts(&shapes, 70..73, 5000);
    println!("{tally:?}");
    assert!(tally.trials >= 200 && tally.good_but_wrong.is_empty(), "{tally:?}");
    // of those that came out right, symmetric ones and unplaced views are doubtful
    assert!(tally.good_and_right as f64 >= 0.6 * tally.right as f64, "{tally:?}");
}
