//! How registration from scans alone ends on code-made sets, view by view, and how far its confidence can be trusted.
//!
//! `cargo run --release --example scans_alone -- measure SEED... > ROWS` registers a set of each shape of the catalogue
//! for each seed and writes a row for each view, which `--example confidence` takes.

use std::fmt::Write as _;

use rayon::prelude::*;
use visage::geometry::neighbours::{IndexedPoints, LocalPoint};
use visage::geometry::{Motion, Point3, Surface, Vector3};
use visage::progress::Progress;
use visage::registration::covariance;
use visage::registration::global::confidence::{confidence, features};
use visage::registration::global::placement::place;
use visage::registration::global::scan_set::Set;
use visage::registration::hinted::Hinted;
use visage::registration::method::Method;
use visage::registration::outcome::MethodOptions;
use visage::registration::quality::witness::Known;
use visage::registration::sensor::Sensor;
use visage::registration::view::View;
use visage::synthetic::shapes::{Coverage, ScanOptions, Shape, catalogue, scan_set};

/// A view that is farther off, in spacings, is wrong.
const WRONG: f64 = 2.0;
/// A point has a counterpart in another view within this many spacings.
const COUNTERPART: f64 = 2.0;

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.first().map(String::as_str) {
        Some("measure") => {
            let seeds: Vec<u64> = arguments[1..].iter().map(|seed| seed.parse()).collect::<Result<_, _>>()?;
            let sets: Vec<(usize, u64)> =
                seeds.iter().flat_map(|seed| (0..catalogue().len()).map(move |shape| (shape, *seed))).collect();
            sets.par_iter().with_max_len(1).for_each(|(shape, seed)| print!("{}", measure(*shape, *seed)));
        }
        _ => anyhow::bail!("measure SEED..."),
    }
    Ok(())
}

/// How a set is scanned: every shape meets every way, seed by seed.
fn scanned(shape: usize, seed: u64) -> (usize, ScanOptions, bool) {
    let turn = shape + seed as usize;
    let (coverage, views) =
        [(Coverage::Around, 9), (Coverage::Ring, 8), (Coverage::Around, 11), (Coverage::Front, 6), (Coverage::Ring, 7)]
            [turn % 5];
    let points = [5000, 4000, 3000][(turn / 2) % 3];
    (views, ScanOptions { coverage, points, ..ScanOptions::default() }, turn.is_multiple_of(2))
}

/// Registers a set from its scans, each in a frame of its own; a row a view.
fn measure(index: usize, seed: u64) -> String {
    let shape = &catalogue()[index];
    let (count, options, scanner_known) = scanned(index, seed);
    let set = scan_set(shape, count, &options, seed);
    let turn = |view: usize| {
        let axis = Vector3::new(1.0, 0.3 * view as f64 - 1.0, 0.5).normalize();
        Motion::new(Vector3::new(40.0, -7.0, 3.0) * view as f64, axis * (0.9 * view as f64 + 0.4))
    };
    let turned =
        |(view, scan): (usize, &Surface)| Surface { cloud: scan.cloud.moved(&turn(view)), ..Surface::default() };
    let scans: Vec<Surface> = set.scans.iter().enumerate().map(turned).collect();
    let Ok(mut views) = scans.iter().map(View::of).collect::<Result<Vec<View>, _>>() else { return String::new() };
    let truth: Vec<Motion> =
        (0..count).map(|view| views[view].local_pose(&(set.poses[view] * turn(view).inverse()))).collect();
    for (index, view) in views.iter_mut().enumerate() {
        let eye = Sensor::At((turn(index) * Point3::origin()).coords - view.center);
        view.sensor = scanner_known.then_some(eye);
    }
    let sensors: Vec<Option<Sensor>> = views.iter().map(|view| view.sensor).collect();
    let names: Vec<String> = (0..count).map(|view| view.to_string()).collect();
    let given = vec![None; count];
    let hinted = Hinted::default();
    let set = Set { names: &names, views: &views, given: &given, sensors: &sensors, hinted: &hinted, turning: None };
    let progress = Progress::silent();
    let refine_options = MethodOptions::default();
    let refine = |views: &[View], poses: &[Motion]| Method::Joint.register(views, poses, &refine_options, &progress);
    let Ok(placement) = place(&set, &refine, &progress) else { return String::new() };

    let placed: Vec<usize> = (0..count).filter(|view| placement.result.placed[*view]).collect();
    let poses: Vec<Motion> = placed.iter().map(|view| placement.result.local_poses[*view]).collect();
    let right = right_views(shape, seed, &views, &truth, &placed, &poses);
    let uncertainty = covariance::of_result(&views, &placement.result);
    let known = Known { uncertainty: &uncertainty, intrusions: &[], colours: &vec![None; count], stands_still: false };
    let witnesses = known.witnesses(&views, &placement.result);
    let mut rows = String::new();
    for (view, overlap) in best_overlaps(&views, &truth).into_iter().enumerate() {
        let is_placed = placed.contains(&view);
        let told = placement.pose_supports[view].filter(|_| is_placed);
        let told = told.map(|standing| features(&standing, &witnesses[view]));
        let told: Vec<String> = told.unwrap_or_default().iter().map(|x| format!("{x:.5}")).collect();
        let _ = writeln!(
            rows,
            "row\t{}\t{index}\t{seed}\t{:?}\t{count}\t{}\t{}\t{view}\t{}\t{}\t{}\t{overlap:.3}\t{:.5}\t{}",
            shape.name,
            options.coverage,
            options.points,
            u8::from(scanner_known),
            u8::from(is_placed),
            u8::from(right.contains(&view)),
            u8::from(placement.ambiguous[view]),
            placement.pose_supports[view].map_or(0.0, |standing| confidence(&standing, &witnesses[view])),
            told.join("\t")
        );
    }
    rows
}

/// The placed views that are right: within [`WRONG`] of the true pose relative to the others, for the choice of world by
/// which most are; of a symmetric shape those whose points lie on its surface.
fn right_views(
    shape: &Shape,
    seed: u64,
    views: &[View],
    truth: &[Motion],
    placed: &[usize],
    poses: &[Motion],
) -> Vec<usize> {
    let limit = WRONG * visage::registration::view::common_spacing(views);
    let vertices: Vec<LocalPoint> = match shape.is_symmetric() {
        true => shape.mesh(seed).vertices.iter().map(|v| v.coords.cast::<f32>().into()).collect(),
        false => Vec::new(),
    };
    let surface = (!vertices.is_empty()).then(|| IndexedPoints::new(vertices));
    let is_right = |world: &Motion, k: usize| {
        let view = placed[k];
        let points = views[view].points();
        let found = world * poses[k];
        let squares = points.iter().step_by(17).map(|point| {
            let point = Point3::from(nalgebra::Vector3::from(*point).cast::<f64>());
            match &surface {
                None => (found * point - truth[view] * point).norm_squared(),
                Some(surface) => surface
                    .tree
                    .nearest(&(found * point).coords.cast::<f32>().into(), 1e6)
                    .map_or(1e6, |n| f64::from(n.distance2)),
            }
        });
        let mean_square = squares.sum::<f64>() / points.len().div_ceil(17) as f64;
        mean_square.sqrt() < limit
    };
    (0..placed.len())
        .map(|reference| {
            let world = truth[placed[reference]] * poses[reference].inverse();
            (0..placed.len()).filter(|k| is_right(&world, *k)).map(|k| placed[k]).collect::<Vec<usize>>()
        })
        .max_by_key(|right| right.len())
        .unwrap_or_default()
}

/// For each view its largest overlap with another at the true poses: the smaller share of both.
fn best_overlaps(views: &[View], truth: &[Motion]) -> Vec<f64> {
    let reach2 = (COUNTERPART * visage::registration::view::common_spacing(views)).powi(2) as f32;
    let share = |i: usize, j: usize| {
        let motion = truth[i].inv_mul(&truth[j]);
        let points = views[j].points();
        let met = points.iter().step_by(13).filter(|point| {
            let place = motion * Point3::from(nalgebra::Vector3::from(**point).cast::<f64>());
            views[i].indexed.tree.nearest(&place.coords.cast::<f32>().into(), reach2).is_some()
        });
        met.count() as f64 / points.len().div_ceil(13) as f64
    };
    let best =
        |i: usize| (0..views.len()).filter(|j| *j != i).map(|j| share(i, j).min(share(j, i))).fold(0.0, f64::max);
    (0..views.len()).map(best).collect()
}
