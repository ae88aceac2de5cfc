//! `visage-bench scale`: what a registration costs as the views of one object grow in number.

use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::Args;
use rayon::prelude::*;

use super::child::{self, Run};
use visage::domain::asset::Asset;
use visage::formats::{ply, poses};
use visage::geometry::{Motion, Point3};
use visage::synthetic::head::{Proportions, head};
use visage::synthetic::scanner::{ScanSet, Scanner};
use visage::synthetic::truth;

/// How large the code-made sets are.
#[derive(Debug, Args)]
pub struct ScaleArgs {
    /// Numbers of views, one run each
    #[arg(long, value_delimiter = ',', default_value = "25,50,100,200")]
    views: Vec<usize>,
    /// Distance of neighbouring points in mm; 0.695 makes about 100 000 points a view
    #[arg(long, default_value_t = 0.695)]
    resolution: f64,
    /// A folder for the scans and results; made if it isn't there [default: a temporary one]
    #[arg(long)]
    out: Option<PathBuf>,
}

/// How far the given poses are off: degrees and mm.
const DISTURBED_DEG: f64 = 3.0;
const DISTURBED_MM: f64 = 4.0;
const SEED: u64 = 5;
/// Points a view by which errors are measured.
const ERROR_SAMPLES: usize = 200;

/// Makes the sets, registers each in a process of its own and prints a table.
pub fn run(args: ScaleArgs) -> anyhow::Result<()> {
    let temporary = tempfile::tempdir().context("making a temporary folder")?;
    let root = args.out.unwrap_or_else(|| temporary.path().to_owned());
    println!("| views | points | pairs | CPU s | CPU ms a pair | wall s | peak MiB | error mm | quality |");
    println!("| ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | --- |");
    for views in args.views {
        let dir = root.join(format!("{views}_views"));
        let truth = make_set(&dir, views, args.resolution)?;
        let run = child::register(
            &dir,
            &dir.join("poses.json"),
            &dir.join("result"),
            &["--unit", "mm", "--no-mesh", "--no-signature", "--scans", "*.ply"],
        )?;
        println!("{}", row(&truth, &dir, &run)?);
    }
    Ok(())
}

/// What is kept of a set once its scans are written.
struct Truth {
    points: usize,
    poses: Vec<(String, Motion)>,
    samples: Vec<Vec<Point3>>,
}

fn make_set(dir: &Path, views: usize, resolution: f64) -> anyhow::Result<Truth> {
    std::fs::create_dir_all(dir).with_context(|| format!("making {}", dir.display()))?;
    let object = head(&Proportions::of(SEED));
    let ScanSet { scans, poses: true_poses } =
        Scanner { views, resolution, ..Scanner::default() }.scan_set(&object.mesh, SEED);
    let names: Vec<String> = (0..views).map(|view| format!("scan_{view:04}.ply")).collect();
    names.par_iter().zip(&scans).try_for_each(|(name, scan)| {
        let path = dir.join(name);
        std::fs::write(&path, ply::write_cloud(&scan.cloud, None))
            .with_context(|| format!("writing {}", path.display()))
    })?;
    let initial = truth::disturb(&true_poses, DISTURBED_DEG.to_radians(), DISTURBED_MM, SEED);
    let initial: Vec<(String, Option<Motion>)> = names.iter().cloned().zip(initial.into_iter().map(Some)).collect();
    let path = dir.join("poses.json");
    std::fs::write(&path, poses::write_json(&initial)).with_context(|| format!("writing {}", path.display()))?;
    let samples = |scan: &visage::geometry::Surface| {
        let step = scan.cloud.len().div_ceil(ERROR_SAMPLES).max(1);
        scan.cloud.points.iter().step_by(step).copied().collect()
    };
    Ok(Truth {
        points: scans.iter().map(|scan| scan.cloud.len()).sum(),
        samples: scans.iter().map(samples).collect(),
        poses: names.into_iter().zip(true_poses).collect(),
    })
}

fn row(truth: &Truth, dir: &Path, run: &Run) -> anyhow::Result<String> {
    let path = dir.join("result").join(&*Asset::Poses.name());
    let bytes = std::fs::read(&path).with_context(|| format!("reading {}", path.display()))?;
    let found = poses::read("poses.json", &bytes).context("reading the poses")?.to_map();
    let placed: Vec<usize> = (0..truth.poses.len()).filter(|&view| found.contains_key(&truth.poses[view].0)).collect();
    let estimated: Vec<Motion> = placed.iter().map(|&view| found[&truth.poses[view].0]).collect();
    let expected: Vec<Motion> = placed.iter().map(|&view| truth.poses[view].1).collect();
    let samples: Vec<Vec<Point3>> = placed.iter().map(|&view| truth.samples[view].clone()).collect();
    let error = truth::pose_error(&estimated, &expected, &samples).points_rms;
    let result = &run.report["result"];
    let pairs = result["pairs"].as_array().map_or(0, Vec::len);
    let peak = run.report["run"]["peak_memory_bytes"].as_f64().unwrap_or(f64::NAN) / f64::from(1 << 20);
    Ok(format!(
        "| {} | {} | {pairs} | {:.1} | {:.1} | {:.1} | {peak:.0} | {error:.3} | {} |",
        truth.poses.len(),
        truth.points,
        run.cpu_seconds,
        1000.0 * run.cpu_seconds / pairs.max(1) as f64,
        run.wall_seconds,
        result["verdict"]["quality"].as_str().unwrap_or("unknown"),
    ))
}
