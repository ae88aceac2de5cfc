//! How registration from scans alone ends on code-made sets, view by view, and how far its confidence can be trusted.
//!
//! `cargo run --release --example scans_alone -- measure SEED... > ROWS` registers a set of each shape of the catalogue
//! for each seed and writes a row for each view; `... -- fit ROWS [SVG]` fits the coefficients of the confidence on the
//! shapes with even places in the catalogue, and shows on the others how often views of each confidence are right.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use rayon::prelude::*;
use visage::geometry::neighbours::{IndexedPoints, LocalPoint};
use visage::geometry::{Motion, Point3, Surface, Vector3};
use visage::progress::Progress;
use visage::registration::covariance;
use visage::registration::global::confidence::{FEATURES, MODEL, SURE, confidence, features};
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
        Some("fit") => {
            let rows = std::fs::read_to_string(&arguments[1])?;
            let rows: Vec<Row> = rows.lines().filter_map(Row::read).collect();
            fit_and_show(&rows, arguments.get(2))?;
        }
        _ => anyhow::bail!("measure SEED... or fit ROWS [SVG]"),
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
    let set = Set { names: &names, views: &views, given: &given, sensors: &sensors, hinted: &hinted };
    let progress = Progress::silent();
    let refine_options = MethodOptions { min_overlap: 0.5, range_accuracy: None, max_rounds: 20 };
    let refine = |views: &[View], poses: &[Motion]| Method::Joint.register(views, poses, &refine_options, &progress);
    let Ok(placement) = place(&set, &refine, &progress) else { return String::new() };

    let placed: Vec<usize> = (0..count).filter(|view| placement.result.placed[*view]).collect();
    let poses: Vec<Motion> = placed.iter().map(|view| placement.result.local_poses[*view]).collect();
    let right = right_views(shape, seed, &views, &truth, &placed, &poses);
    let covariances = covariance::of_result(&views, &placement.result);
    let known = Known { covariances: &covariances, intrusions: &[], colours: &vec![None; count], stands_still: false };
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

/// A view's row.
struct Row {
    shape: usize,
    seed: u64,
    symmetric: bool,
    scanner_known: bool,
    placed: bool,
    right: bool,
    ambiguous: bool,
    overlap: f64,
    features: [f64; FEATURES],
}

impl Row {
    fn read(line: &str) -> Option<Row> {
        let cells: Vec<&str> = line.split('\t').collect();
        let shape: usize = cells.get(2)?.parse().ok()?;
        let numbers: Vec<f64> = cells.get(14..)?.iter().filter_map(|cell| cell.parse().ok()).collect();
        let features = numbers.try_into();
        Some(Row {
            shape,
            seed: cells[3].parse().ok()?,
            symmetric: catalogue().get(shape)?.is_symmetric(),
            scanner_known: cells[7] == "1",
            placed: cells[9] == "1" && features.is_ok(),
            right: cells[10] == "1",
            ambiguous: cells[11] == "1",
            overlap: cells[12].parse().ok()?,
            features: features.unwrap_or([0.0; FEATURES]),
        })
    }

    fn confidence(&self, model: &[f64; FEATURES]) -> f64 {
        let z: f64 = model.iter().zip(&self.features).map(|(c, x)| c * x).sum();
        1.0 / (1.0 + (-z).exp())
    }
}

/// Logistic regression by Newton's steps, its coefficients (but the constant) held near zero.
fn fit(rows: &[&Row]) -> [f64; FEATURES] {
    const HELD: f64 = 0.1;
    let mut model = nalgebra::SVector::<f64, FEATURES>::zeros();
    for _ in 0..50 {
        let mut gradient = -HELD * model;
        gradient[0] = 0.0;
        let mut curvature = nalgebra::SMatrix::<f64, FEATURES, FEATURES>::identity() * HELD;
        curvature[(0, 0)] = 1e-6;
        for row in rows {
            let x = nalgebra::SVector::from(row.features);
            let p = row.confidence(&model.into());
            gradient += x * (f64::from(u8::from(row.right)) - p);
            curvature += x * x.transpose() * (p * (1.0 - p));
        }
        let Some(step) = curvature.cholesky().map(|c| c.solve(&gradient)) else { break };
        model += step;
    }
    model.into()
}

/// Bounds of the bins of the reliability table.
const BINS: [f64; 9] = [0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 0.97, 0.99, 1.0];

fn fit_and_show(rows: &[Row], svg: Option<&String>) -> anyhow::Result<()> {
    let training: Vec<&Row> = rows.iter().filter(|row| row.placed && row.shape.is_multiple_of(2)).collect();
    let fitted = fit(&training);
    println!("fitted on {} placed views: {fitted:.3?}", training.len());
    for (name, model) in [("fitted", &fitted), ("as built in", &MODEL)] {
        for (of, parity) in [("shapes it was fitted on", 0), ("other shapes", 1)] {
            println!("\n## {name}, {of}");
            let those: Vec<&Row> = rows.iter().filter(|row| row.shape % 2 == parity).collect();
            show(&those, model);
            show_sets(&those, model);
        }
    }
    if let Some(path) = svg {
        let others: Vec<&Row> = rows.iter().filter(|row| row.placed && row.shape % 2 == 1).collect();
        std::fs::write(path, curve(&bins(&others, &MODEL)))?;
    }
    Ok(())
}

/// For each bin: views, their mean confidence, the share that is right.
fn bins(rows: &[&Row], model: &[f64; FEATURES]) -> Vec<(usize, f64, f64)> {
    BINS.windows(2)
        .map(|bounds| {
            let inside = |p: f64| p >= bounds[0] && (p < bounds[1] || bounds[1] == 1.0);
            let within: Vec<&&Row> = rows.iter().filter(|row| inside(row.confidence(model))).collect();
            let count = within.len().max(1) as f64;
            let mean = within.iter().map(|row| row.confidence(model)).sum::<f64>() / count;
            (within.len(), mean, within.iter().filter(|row| row.right).count() as f64 / count)
        })
        .collect()
}

fn show(rows: &[&Row], model: &[f64; FEATURES]) {
    let placed: Vec<&Row> = rows.iter().copied().filter(|row| row.placed).collect();
    println!("| confidence | views | mean confidence | right |\n| --- | ---: | ---: | ---: |");
    for (bounds, (count, mean, right)) in BINS.windows(2).zip(bins(&placed, model)) {
        println!("| {}-{} | {count} | {mean:.3} | {right:.3} |", bounds[0], bounds[1]);
    }
    println!(
        "\n| threshold | sure | of these right | sure among overlap > 0.4 | with scanner known | unknown | symmetric: placed, right, sure, sure and right, ambiguous |\n| ---: | ---: | ---: | ---: | ---: | ---: | --- |"
    );
    for threshold in [0.8, SURE, 0.95, 0.97, 0.98, 0.99, 0.995] {
        let is_sure = |row: &Row| row.placed && row.confidence(model) >= threshold;
        let sure: Vec<&&Row> = rows.iter().filter(|row| is_sure(row)).collect();
        let right = sure.iter().filter(|row| row.right).count();
        let share = |keep: &dyn Fn(&Row) -> bool| {
            let those: Vec<&&Row> =
                rows.iter().filter(|row| !row.symmetric && row.overlap > 0.4 && keep(row)).collect();
            those.iter().filter(|row| is_sure(row)).count() as f64 / those.len().max(1) as f64
        };
        let symmetric: Vec<&&Row> = rows.iter().filter(|row| row.symmetric).collect();
        let count = |keep: &dyn Fn(&Row) -> bool| symmetric.iter().filter(|row| keep(row)).count();
        println!(
            "| {threshold} | {} | {:.4} | {:.3} | {:.3} | {:.3} | of {}: {}, {}, {}, {}, {} |",
            sure.len(),
            right as f64 / sure.len().max(1) as f64,
            share(&|_| true),
            share(&|row| row.scanner_known),
            share(&|row| !row.scanner_known),
            symmetric.len(),
            count(&|row| row.placed),
            count(&|row| row.right),
            count(&|row| is_sure(row)),
            count(&|row| is_sure(row) && row.right),
            count(&|row| row.ambiguous),
        );
    }
}

/// Sets all of whose placed views are at least so sure, and how many of these have a wrong one.
fn show_sets(rows: &[&Row], model: &[f64; FEATURES]) {
    let mut sets: BTreeMap<(usize, u64), Vec<&Row>> = BTreeMap::new();
    for row in rows.iter().filter(|row| row.placed) {
        sets.entry((row.shape, row.seed)).or_default().push(row);
    }
    println!("\n| all placed views at least so sure | sets | with a wrong view |\n| ---: | ---: | ---: |");
    for threshold in [0.0, 0.3, 0.5, 0.7, 0.8, SURE, 0.97] {
        let such: Vec<&Vec<&Row>> =
            sets.values().filter(|set| set.iter().all(|row| row.confidence(model) >= threshold)).collect();
        let wrong = such.iter().filter(|set| set.iter().any(|row| !row.right)).count();
        println!("| {threshold} | {} | {wrong} |", such.len());
    }
}

/// The reliability curve: mean confidence across, share that is right upward.
fn curve(bins: &[(usize, f64, f64)]) -> String {
    let at = |mean: f64, right: f64| (40.0 + 240.0 * mean, 270.0 - 240.0 * right);
    let mut svg = String::from(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"320\" height=\"310\" font-family=\"sans-serif\" font-size=\"11\">\n\
         <rect x=\"40\" y=\"30\" width=\"240\" height=\"240\" fill=\"none\" stroke=\"#888\"/>\n\
         <path d=\"M40 270L280 30\" stroke=\"#bbb\" stroke-dasharray=\"4\"/>\n\
         <text x=\"100\" y=\"298\">mean confidence, 0 to 1</text>\n\
         <text x=\"40\" y=\"20\">share of views that are right, 0 to 1 (area: number of views)</text>\n",
    );
    for (count, mean, right) in bins.iter().filter(|bin| bin.0 > 0) {
        let (x, y) = at(*mean, *right);
        let radius = 1.5 + (*count as f64).sqrt() / 6.0;
        let _ =
            writeln!(svg, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius:.1}\" fill=\"#27c\" fill-opacity=\"0.6\"/>");
    }
    svg + "</svg>\n"
}
