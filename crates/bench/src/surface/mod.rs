//! `visage-bench surface`: the surfaces of scans with given poses: how far points that were left out lie from them, how far they are
//! from the truth where there is one, what is closed, and what it costs.

mod set;
mod topology;
mod truth;

use std::path::PathBuf;

use anyhow::{Context, ensure};
use clap::Args;

use self::set::PlacedSet;
use self::topology::Topology;
use self::truth::Truth;
use crate::gallery::cpu_seconds;
use visage::geometry::{Cloud, Point3};
use visage::progress::Progress;
use visage::surface::nearest::TriangleTree;
use visage::surface::reconstruct::{Fill, Reconstruction, SurfaceOptions, reconstruct};

/// Stanford's sets, and simulated ones whose true surface is known.
const SETS: [&str; 7] = ["bunny", "dragon", "happy", "head_a", "head_b", "real_maxplanck", "nonface_owl"];
/// One point of so many of each scan is left out.
const LEFT_OUT: usize = 10;
/// Area farther than this from every point was seen by nobody, in spacings.
const FAR: f64 = 5.0;
/// No distance counts more than this, in spacings.
const REACH: f64 = 50.0;

/// What to measure.
#[derive(Debug, Args)]
pub struct SurfaceArgs {
    /// The folder that holds stanford/{bunny,dragon,happy} with their .conf and faces/scansets
    #[arg(long, value_name = "DIR", default_value = ".")]
    data: PathBuf,
    /// Which sets
    #[arg(long, value_delimiter = ',', default_values = SETS, value_parser = SETS)]
    sets: Vec<String>,
    /// Runs of which the cheapest counts
    #[arg(long, default_value_t = 3)]
    runs: usize,
    /// Also keep the registered clouds, their poses and the surfaces here, for other programs
    #[arg(long, value_name = "DIR")]
    keep: Option<PathBuf>,
}

/// What came of one set.
struct Row {
    name: String,
    points: usize,
    /// Distances of points that were left out, in spacings: median, and what 95 and 99 of 100 don't exceed.
    left_out: [f64; 3],
    triangles: usize,
    cpu_seconds: f64,
    far_area: f64,
    closed: Topology,
    truth: Option<Truth>,
}

/// Registers each set from its poses with `visage register`, makes its surfaces on one thread, and prints tables.
pub fn run(args: SurfaceArgs) -> anyhow::Result<()> {
    ensure!(args.runs > 0, "--runs must be at least 1");
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().context("starting the worker thread")?;
    let mut rows = Vec::new();
    for name in &args.sets {
        let temporary = tempfile::tempdir().context("making a temporary folder")?;
        let out = args.keep.as_ref().map_or_else(|| temporary.path().to_owned(), |keep| keep.join(name));
        let set = PlacedSet::register(&args.data, name, &out)?;
        rows.push(pool.install(|| measure(&set, args.runs)).with_context(|| format!("the surface of {name}"))?);
    }
    print(&rows);
    Ok(())
}

fn measure(set: &PlacedSet, runs: usize) -> anyhow::Result<Row> {
    let is_left_out = set.each(LEFT_OUT);
    let input = set.cloud.kept(&is_left_out.iter().map(|out| !out).collect::<Vec<bool>>());
    let views: Vec<u16> = set.views.iter().zip(&is_left_out).filter(|(_, out)| !**out).map(|(view, _)| *view).collect();
    let left_out: Vec<Point3> =
        set.cloud.points.iter().zip(&is_left_out).filter(|(_, out)| **out).map(|(point, _)| *point).collect();
    let (mut least, mut best) = (f64::INFINITY, None);
    for _ in 0..runs {
        let before = cpu_seconds();
        best = Some(surface(set, &input, &views, Fill::Small)?);
        least = least.min(cpu_seconds() - before);
    }
    let fitted = best.context("no run")?;
    let tree = TriangleTree::new(&fitted.mesh).context("no triangles")?;
    let mut distances = left_out.iter().map(|point| distance(&tree, point, set.spacing)).collect::<Vec<f64>>();
    let small = surface(set, &set.cloud, &set.views, Fill::Small)?;
    let closed = surface(set, &set.cloud, &set.views, Fill::All)?;
    set.keep(&small, "small")?;
    set.keep(&closed, "all")?;
    Ok(Row {
        name: set.name.clone(),
        points: input.len(),
        left_out: [0.5, 0.95, 0.99].map(|share| truth::quantile(&mut distances, share)),
        triangles: fitted.mesh.faces.len(),
        cpu_seconds: least,
        far_area: truth::far_area(&small.mesh, &set.cloud, FAR * set.spacing),
        closed: Topology::of(&closed.mesh),
        truth: set.truth.as_ref().map(|truth| Truth::of(&small.mesh, truth, &set.cloud, set.spacing)).transpose()?,
    })
}

/// The surface of a set's points, as `visage register` makes it.
fn surface(set: &PlacedSet, cloud: &Cloud, views: &[u16], fill: Fill) -> anyhow::Result<Reconstruction> {
    let free_space = (fill == Fill::All).then_some(&set.free_space);
    let options = SurfaceOptions { fill, views: Some(views), free_space, ..SurfaceOptions::default() };
    reconstruct(cloud, set.spacing, &options, &Progress::silent())?.context("there is none")
}

/// How far a point is from a surface, in spacings.
fn distance(tree: &TriangleTree, point: &Point3, spacing: f64) -> f64 {
    tree.nearest(point, (REACH * spacing).powi(2)).map_or(REACH, |found| found.distance2.sqrt() / spacing)
}

fn print(rows: &[Row]) {
    println!(
        "Every tenth point of each scan left out: distances from the surface in spacings; CPU seconds on one thread.\n"
    );
    println!("| set | points | median / p95 / p99 | triangles | CPU s | area far from points, % |");
    println!("| --- | ---: | --- | ---: | ---: | ---: |");
    for Row { name, points, left_out: [median, p95, p99], triangles, cpu_seconds, far_area, .. } in rows {
        let far = 100.0 * far_area;
        println!(
            "| {name} | {points} | {median:.3} / {p95:.3} / {p99:.3} | {triangles} | {cpu_seconds:.2} | {far:.2} |"
        );
    }
    println!("\nFrom the truth, medians / p95: lengths in spacings, angles in degrees.\n");
    println!("| set | accuracy | completeness | normals |");
    println!("| --- | --- | --- | --- |");
    for (row, truth) in rows.iter().filter_map(|row| Some((row, row.truth.as_ref()?))) {
        let [accuracy, completeness, normals] = [truth.accuracy, truth.completeness, truth.normals_deg];
        println!(
            "| {} | {:.3} / {:.3} | {:.3} / {:.3} | {:.2} / {:.1} |",
            row.name, accuracy[0], accuracy[1], completeness[0], completeness[1], normals[0], normals[1]
        );
    }
    println!("\nAll holes closed.\n");
    println!("| set | pieces | open edges | genus |");
    println!("| --- | ---: | ---: | ---: |");
    for Row { name, closed, .. } in rows {
        println!("| {name} | {} | {} | {} |", closed.pieces, closed.open_edges, closed.genus);
    }
}
