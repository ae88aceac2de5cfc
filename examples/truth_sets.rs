//! Writes code-made scan sets with their exact truth, so that any registration program can be run on the same scans:
//! `cargo run --release --example truth_sets -- DIR [--points N] [--views N] [--seed S] [SHAPE...]`.
//!
//! A folder a shape: `scan_NN.ply` (mm, the sensor's frame), `poses_gt.txt` (the truth), `poses_init.txt` (disturbed by
//! 0.04 rad and 4 mm) and `init.json` (the same as JSON). Without names: every shape without symmetry.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use visage::formats::{ply, poses};
use visage::geometry::{Motion, se3};
use visage::synthetic::shapes::{ScanOptions, Shape, catalogue, scan_set};
use visage::synthetic::truth::disturb;

fn main() -> Result<()> {
    let mut args = std::env::args().skip(1);
    let folder = PathBuf::from(args.next().context("name the folder to write to")?);
    let (mut options, mut views, mut seed) = (ScanOptions::default(), 8, 1);
    let mut names = Vec::new();
    while let Some(arg) = args.next() {
        let mut number = || args.next().context("a number must follow")?.parse::<usize>().context("no number");
        match arg.as_str() {
            "--points" => options.points = number()?,
            "--views" => views = number()?,
            "--seed" => seed = number()? as u64,
            name => names.push(name.to_owned()),
        }
    }
    let shapes = catalogue();
    if let Some(name) = names.iter().find(|name| shapes.iter().all(|shape| shape.name != **name)) {
        bail!("there is no shape {name}");
    }
    let wanted =
        |shape: &&Shape| if names.is_empty() { !shape.is_symmetric() } else { names.iter().any(|n| n == shape.name) };
    for shape in shapes.iter().filter(wanted) {
        write_set(&folder.join(shape.name), shape, views, &options, seed)?;
    }
    Ok(())
}

fn write_set(folder: &Path, shape: &Shape, views: usize, options: &ScanOptions, seed: u64) -> Result<()> {
    std::fs::create_dir_all(folder)?;
    let set = scan_set(shape, views, options, seed);
    let initial = disturb(&set.poses, 0.04, 4.0, seed);
    let names: Vec<String> = (0..views).map(|view| format!("scan_{view:02}.ply")).collect();
    for (name, scan) in names.iter().zip(&set.scans) {
        std::fs::write(folder.join(name), ply::write_cloud(&scan.cloud, None))?;
    }
    std::fs::write(folder.join("poses_gt.txt"), blocks(&names, &set.poses))?;
    std::fs::write(folder.join("poses_init.txt"), blocks(&names, &initial))?;
    let named: Vec<_> = names.into_iter().zip(initial.into_iter().map(Some)).collect();
    std::fs::write(folder.join("init.json"), poses::write_json(&named))?;
    println!("{}", folder.display());
    Ok(())
}

/// A name line and four rows a scan.
fn blocks(names: &[String], poses: &[Motion]) -> String {
    let mut text = String::new();
    for (name, pose) in names.iter().zip(poses) {
        text.push_str(name);
        text.push('\n');
        for row in se3::to_rows(pose) {
            let _ = writeln!(text, "{} {} {} {}", row[0], row[1], row[2], row[3]);
        }
    }
    text
}
