//! What registering many scans costs: code-made scans of a walk through a building, or of a standing person, from the scans alone.
//!
//! `cargo run --release --example walk -- COUNT SEED` registers the first COUNT scans of a walk (200: a whole one, back to where it
//! began), `... shuffled COUNT SEED` the same in random order, `... person COUNT SEED` COUNT scans of a person, and
//! `... export COUNT SEED FOLDER` writes a walk as PLY files with their true poses in `gt.json`. One line: scans placed, of them
//! right, the verdict, the least confidence, CPU seconds, peak memory, points a scan.

use std::path::Path;

use anyhow::Context;
use nix::sys::resource::{UsageWho, getrusage};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use visage::formats::ply::write_cloud;
use visage::geometry::{Motion, Point3, Surface, Unit, se3};
use visage::pipeline::{self, NamedScan, Options, Start};
use visage::progress::Progress;
use visage::synthetic::body;
use visage::synthetic::depth_views::{ALL_AROUND, DepthCamera, depth_views, ring};
use visage::synthetic::scanner::ScanSet;
use visage::synthetic::sensors::walk;

/// A placed view is right within this share of the set's size (root mean square),
const OFF: f64 = 0.01;
/// and this angle.
const OFF_DEGREES: f64 = 2.0;
/// Points of a scan by which it is judged.
const SAMPLES: usize = 500;

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match words[..] {
        ["export", count, seed, folder] => export(&walk(count.parse()?, seed.parse()?), Path::new(folder)),
        ["person", count, seed] => measure(person(count.parse()?, seed.parse()?), Unit::Mm),
        ["shuffled", count, seed] => {
            let seed = seed.parse()?;
            measure(shuffled(walk(count.parse()?, seed), seed), Unit::M)
        }
        [count, seed] => measure(walk(count.parse()?, seed.parse()?), Unit::M),
        _ => anyhow::bail!("COUNT SEED, shuffled COUNT SEED, person COUNT SEED or export COUNT SEED FOLDER"),
    }
}

/// Scans of a standing person by a depth camera, 40 000 to 70 000 points each.
fn person(count: usize, seed: u64) -> ScanSet {
    let person = body::person(seed).mesh;
    let camera = DepthCamera { noise: 3.0, step: 3.6, sway: 3.0, resolution: 2.8, ..DepthCamera::default() };
    let turns = if count > 24 { 2 } else { 1 };
    depth_views(&person, ring(&person, &camera, count, turns, ALL_AROUND), &camera, seed)
}

fn shuffled(set: ScanSet, seed: u64) -> ScanSet {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut both: Vec<(Surface, Motion)> = set.scans.into_iter().zip(set.poses).collect();
    for last in (1..both.len()).rev() {
        both.swap(last, rng.random_range(0..=last));
    }
    let (scans, poses) = both.into_iter().unzip();
    ScanSet { scans, poses }
}

/// Processor time of this process so far, s, and its peak memory, MiB.
fn spent() -> anyhow::Result<(f64, f64)> {
    let usage = getrusage(UsageWho::RUSAGE_SELF)?;
    let seconds = |time: nix::sys::time::TimeVal| time.tv_sec() as f64 + 1e-6 * time.tv_usec() as f64;
    Ok((seconds(usage.user_time()) + seconds(usage.system_time()), usage.max_rss() as f64 / 1024.0))
}

fn measure(set: ScanSet, unit: Unit) -> anyhow::Result<()> {
    let count = set.scans.len();
    let points = set.scans.iter().map(|scan| scan.cloud.len()).sum::<usize>() / count.max(1);
    let sampled = |scan: &Surface| -> Vec<Point3> {
        scan.cloud.points.iter().step_by((scan.cloud.len() / SAMPLES).max(1)).copied().collect()
    };
    let samples: Vec<Vec<Point3>> = set.scans.iter().map(sampled).collect();
    // what comes from depth cameras is mostly bare points
    let bare = |surface: Surface| Surface { cloud: surface.cloud, ..Surface::default() };
    let named = |(k, scan)| NamedScan { name: format!("scan{k:03}.ply"), surface: bare(scan) };
    let scans: Vec<NamedScan> = set.scans.into_iter().enumerate().map(named).collect();
    let options = Options { cloud: false, signature: false, ..Options::default() };
    let (before, making) = spent()?;
    let outcome = pipeline::run_from(scans, &Start::default(), unit, &options, &Progress::silent())?;
    let (after, peak) = spent()?;
    let placed: Vec<Option<Motion>> = outcome.poses.iter().map(|(_, pose)| *pose).collect();
    let errors = errors(&placed, &set.poses, &samples).context("nothing is placed")?;
    let is_right = |(off, degrees): (f64, f64)| off <= OFF && degrees <= OFF_DEGREES;
    let right = errors.iter().flatten().filter(|error| is_right(**error)).count();
    let worst = errors.iter().flatten().map(|(off, _)| *off).fold(0.0, f64::max);
    println!(
        "{count} scans of {points} points: {} placed, {right} right, worst {:.2} %, {}, confidence {:.2}, {:.1} CPU s, {peak:.0} MiB \
         (making the scans {making:.0})",
        placed.iter().flatten().count(),
        100.0 * worst,
        outcome.report.to_json()["verdict"]["quality"],
        outcome.report.to_json()["confidence"].as_f64().unwrap_or(f64::NAN),
        after - before,
    );
    let wrong: Vec<String> =
        (0..count).filter(|k| errors[*k].is_some_and(|e| !is_right(e))).map(|k| k.to_string()).collect();
    if !wrong.is_empty() {
        println!("  wrong: {}", wrong.join(", "));
    }
    for reason in outcome.report.to_json()["verdict"]["reasons"].as_array().into_iter().flatten().take(12) {
        println!("  {reason}");
    }
    Ok(())
}

/// How far each placed view is off, as a share of the set's size, and by which angle, in the frame of the placed view by which
/// most are right.
fn errors(placed: &[Option<Motion>], truth: &[Motion], samples: &[Vec<Point3>]) -> Option<Vec<Option<(f64, f64)>>> {
    let world: Vec<Point3> =
        samples.iter().zip(truth).flat_map(|(points, pose)| points.iter().map(move |p| pose * p)).collect();
    let size = visage::geometry::Bounds::of(&world)?.diagonal();
    let by_reference = |reference: usize| {
        let world = truth[reference] * placed[reference]?.inverse();
        let error = |(view, pose): (usize, &Option<Motion>)| {
            let found = world * (*pose)?;
            let squares: f64 = samples[view].iter().map(|p| (found * p - truth[view] * p).norm_squared()).sum();
            let angle = se3::rotation_angle(&(found.rotation.inverse() * truth[view].rotation)).to_degrees();
            Some(((squares / samples[view].len() as f64).sqrt() / size, angle))
        };
        let errors: Vec<Option<(f64, f64)>> = placed.iter().enumerate().map(error).collect();
        let right = errors.iter().flatten().filter(|(off, degrees)| *off <= OFF && *degrees <= OFF_DEGREES).count();
        let sum: f64 = errors.iter().flatten().map(|(off, _)| off).sum();
        Some((right, sum, errors))
    };
    let all = (0..placed.len()).filter_map(by_reference);
    all.max_by(|a, b| a.0.cmp(&b.0).then(b.1.total_cmp(&a.1))).map(|(_, _, errors)| errors)
}

/// Writes a set as a folder of PLY files and `gt.json`.
fn export(set: &ScanSet, folder: &Path) -> anyhow::Result<()> {
    std::fs::create_dir_all(folder)?;
    let mut truth = serde_json::Map::new();
    for (view, (scan, pose)) in set.scans.iter().zip(&set.poses).enumerate() {
        let name = format!("scan{view:03}.ply");
        std::fs::write(folder.join(&name), write_cloud(&scan.cloud, None))?;
        truth.insert(name, serde_json::json!(se3::to_rows(pose)));
    }
    std::fs::write(folder.join("gt.json"), serde_json::to_vec(&truth)?)?;
    Ok(())
}
