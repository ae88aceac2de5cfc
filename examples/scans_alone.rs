//! How registration from scans alone ends on code-made shapes, set by set: views placed, the worst of them, the
//! confidence and the verdict. `cargo run --release --example scans_alone -- SEED...`

use std::collections::BTreeMap;

use visage::geometry::{Motion, Point3, Unit};
use visage::pipeline::{self, NamedScan, Options};
use visage::progress::Progress;
use visage::synthetic::shapes::{ScanOptions, Shape, catalogue, scan_set};

const VIEWS: usize = 9;
const POINTS: usize = 5000;
/// A view that is farther off, in spacings, is wrong.
const WRONG: f64 = 2.0;

fn main() -> anyhow::Result<()> {
    let seeds: Vec<u64> = std::env::args().skip(1).map(|seed| seed.parse()).collect::<Result<_, _>>()?;
    let (mut good, mut wrong, mut good_but_wrong, mut sets) = (0, 0, 0, 0);
    println!("| shape | seed | symmetry | placed | worst, spacings | confidence | quality |");
    println!("| --- | ---: | --- | ---: | ---: | ---: | --- |");
    for shape in catalogue() {
        for &seed in &seeds {
            let end = register(&shape, seed)?;
            let (is_good, is_wrong) = (end.quality == "good", end.worst_spacings > WRONG);
            sets += 1;
            good += usize::from(is_good);
            wrong += usize::from(is_wrong);
            good_but_wrong += usize::from(is_good && is_wrong);
            println!(
                "| {} | {seed} | {:?} | {} | {:.2} | {:.2} | {} |",
                shape.name, shape.symmetry, end.placed, end.worst_spacings, end.confidence, end.quality
            );
        }
    }
    println!("\n{sets} sets: {good} good, {wrong} with a wrong view, {good_but_wrong} good but wrong");
    Ok(())
}

/// How one set ended.
struct End {
    placed: usize,
    /// The largest root mean square displacement of a placed view, relative to the first.
    worst_spacings: f64,
    confidence: f64,
    quality: String,
}

fn register(shape: &Shape, seed: u64) -> anyhow::Result<End> {
    let set = scan_set(shape, VIEWS, &ScanOptions { points: POINTS, ..ScanOptions::default() }, seed);
    let samples: Vec<Vec<Point3>> =
        set.scans.iter().map(|scan| scan.cloud.points.iter().step_by(17).copied().collect()).collect();
    let named = |(view, surface)| NamedScan { name: format!("scan {view}"), surface };
    let scans: Vec<NamedScan> = set.scans.into_iter().enumerate().map(named).collect();
    let options = Options { cloud: false, signature: false, ..Options::default() };
    let outcome = pipeline::run(scans, &BTreeMap::new(), Unit::Mm, &options, &Progress::silent())?;
    let spacing = outcome.report["spacing"].as_f64().unwrap_or(f64::NAN);
    let placed: Vec<(usize, Motion)> =
        outcome.poses.iter().enumerate().filter_map(|(view, (_, pose))| Some((view, (*pose)?))).collect();
    let mut worst_spacings = 0.0f64;
    if let Some(&(first, found_first)) = placed.first() {
        let world = set.poses[first] * found_first.inverse();
        for &(view, found) in &placed {
            let squares = samples[view].iter().map(|p| (set.poses[view] * p - world * found * p).norm_squared());
            let mean_square = squares.sum::<f64>() / samples[view].len() as f64;
            worst_spacings = worst_spacings.max(mean_square.sqrt() / spacing);
        }
    }
    Ok(End {
        placed: placed.len(),
        worst_spacings,
        confidence: outcome.report["confidence"].as_f64().unwrap_or(0.0),
        quality: outcome.report["verdict"]["quality"].as_str().unwrap_or("unknown").to_owned(),
    })
}
