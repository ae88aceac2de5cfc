//! `visage surface`: a mesh from a cloud, whoever made it; a mesh with fewer triangles from a mesh.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};

use super::surfaces;
use super::workplace::Workplace;
use crate::formats::ply;
use crate::geometry::{Surface, Unit};
use crate::jobs::artifacts::{RunFacts, write_mesh};
use crate::pipeline::Fill;
use crate::pipeline::orient::{NormalsFrom, orient};
use crate::pipeline::report::{SimplifiedReport, SurfaceOutcome};
use crate::pipeline::surface::{Seen, SurfaceMesh, SurfaceOrder, Target, make_surface, simplify};
use crate::progress::Stage;

/// Which cloud, and what is wanted of its surface.
#[derive(Debug, Args)]
pub struct SurfaceArgs {
    /// A cloud of any format that is read; of a mesh, its triangles are taken as they are, and only made fewer or converted.
    /// The normals of a cloud are believed; without them they are estimated
    cloud: PathBuf,
    #[arg(long, value_name = "MESH", help = format!("The file to write; its ending is the format: {}", surfaces::mesh_endings()))]
    out: PathBuf,
    /// Which holes are closed: small ones are hardly wider than what the points resolve, all make it watertight
    #[arg(long, default_value = Fill::ALL[0].name(),
          value_parser = PossibleValuesParser::new(Fill::ALL.iter().map(|fill| fill.name())).try_map(|name| name.parse::<Fill>()))]
    fill: Fill,
    /// The most triangles: the mesh is made coarser where that shows least
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(4..))]
    triangles: Option<u32>,
    /// Make the mesh coarser as far as no place of it is farther off than this, in the unit of the cloud
    #[arg(long, value_name = "LENGTH", value_parser = length)]
    max_error: Option<f64>,
    /// The distance of neighbours in one scan [default: measured; of a cloud of several scans give it, unless the file says
    /// of which scan each point is, as the cloud.ply of visage does]
    #[arg(long, value_name = "LENGTH", value_parser = length)]
    spacing: Option<f64>,
    /// Unit of the coordinates: mm, cm, m, in or unknown [default: what the file declares, else unknown]
    #[arg(long)]
    unit: Option<Unit>,
    /// Worker threads [default: one per core]
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Say what was done as JSON on standard output
    #[arg(long)]
    json: bool,
}

/// A length above zero.
pub(super) fn length(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|length: &f64| length.is_finite() && *length > 0.0)
        .ok_or("give a length above 0".to_owned())
}

/// What was done.
#[derive(Debug, serde::Serialize)]
struct Report {
    /// Points of the file.
    points: usize,
    /// Where the normals come from; null for a mesh.
    normals: Option<NormalsFrom>,
    /// The distance of neighbours that was reckoned with; null for a mesh.
    spacing: Option<f64>,
    /// The unit of the coordinates.
    unit: &'static str,
    /// How the surface came about; null for a mesh whose triangles were kept.
    surface: Option<SurfaceOutcome>,
    /// What became of the triangles of a mesh, if they were to be fewer; its spacing is the mean edge.
    simplified: Option<SimplifiedReport>,
    /// Vertices and triangles that were written.
    written: [usize; 2],
}

/// Makes the surface and writes it.
pub fn run(args: SurfaceArgs) -> anyhow::Result<()> {
    let format = surfaces::mesh_format(&args.out)?;
    let place = Workplace::new(args.threads.map(usize::from))?;
    place.progress.report(Stage::Loading, 0.0);
    let (reading, bytes) = surfaces::read(&args.cloud)?;
    let unit = surfaces::unit(args.unit, &reading);
    let views = ply::views(&bytes).filter(|views| views.len() == reading.surface.cloud.len());
    drop(bytes);
    let (mesh, report) = place.pool.install(|| match reading.surface.faces.is_empty() {
        true => of_cloud(&args, &reading.surface, views.as_deref(), unit, &place),
        false => of_mesh(&args, &reading.surface, unit, &place),
    })?;
    place.progress.report(Stage::Storing, 0.0);
    let content = write_mesh(&mesh, unit, format).context("the format of --out holds no mesh")?;
    std::fs::write(&args.out, content).with_context(|| format!("writing {}", args.out.display()))?;
    place.progress.report(Stage::Storing, 1.0);
    place.done();
    say(&report, &args, unit, &place)
}

fn of_cloud(
    args: &SurfaceArgs,
    surface: &Surface,
    views: Option<&[u16]>,
    unit: Unit,
    place: &Workplace,
) -> anyhow::Result<(SurfaceMesh, Report)> {
    let points = surface.cloud.len();
    place.progress.report(Stage::Preparing, 0.0);
    let made = orient(surface, views, &place.progress)?;
    let spacing = args.spacing.unwrap_or(made.spacing);
    let order = SurfaceOrder { fill: args.fill, target: target(args), preview: false };
    let seen = Seen { views: made.views.as_deref(), free_space: None };
    let Some(found) = make_surface(&made.cloud, seen, spacing, &order, &place.progress)? else {
        bail!(
            "{} makes no surface: {points} points {} apart{}; are they those of a surface? A thinned cloud needs \
             --spacing, one with wrong normals a file without them",
            args.cloud.display(),
            surfaces::short(spacing),
            surfaces::behind(unit)
        );
    };
    let written = [found.surface.mesh.vertices.len(), found.surface.mesh.faces.len()];
    let report = Report {
        points,
        normals: Some(made.normals),
        spacing: Some(spacing),
        unit: unit.name(),
        surface: Some(found.report),
        simplified: None,
        written,
    };
    Ok((found.surface, report))
}

fn of_mesh(
    args: &SurfaceArgs,
    surface: &Surface,
    unit: Unit,
    place: &Workplace,
) -> anyhow::Result<(SurfaceMesh, Report)> {
    let points = surface.cloud.len();
    let mut mesh = SurfaceMesh::of_file(surface).unwrap_or_default();
    place.progress.report(Stage::Surfacing, 0.0);
    let mut simplified = None;
    if target(args).is_given() {
        let coarser = simplify(&mesh, &target(args), &place.progress)?;
        simplified = Some(SimplifiedReport::new(coarser.report, mean_edge(&mesh)));
        mesh = coarser.surface;
    }
    let written = [mesh.mesh.vertices.len(), mesh.mesh.faces.len()];
    let (normals, spacing, surface) = (None, None, None);
    Ok((mesh, Report { points, normals, spacing, unit: unit.name(), surface, simplified, written }))
}

fn target(args: &SurfaceArgs) -> Target {
    Target { triangles: args.triangles.map(|triangles| triangles as usize), max_error: args.max_error }
}

/// What stands for the spacing of a mesh: the mean length of its edges.
fn mean_edge(surface: &SurfaceMesh) -> f64 {
    let around = |face: usize| {
        let [a, b, c] = surface.mesh.corners(face);
        (b - a).norm() + (c - b).norm() + (a - c).norm()
    };
    let faces = surface.mesh.faces.len();
    (0..faces).map(around).sum::<f64>() / (3 * faces.max(1)) as f64
}

fn say(report: &Report, args: &SurfaceArgs, unit: Unit, place: &Workplace) -> anyhow::Result<()> {
    if args.json {
        let run = RunFacts::here(None, place.threads, place.tracker.snapshot());
        println!("{}", serde_json::to_string_pretty(&serde_json::json!({"result": report, "run": run}))?);
        return Ok(());
    }
    match report.normals {
        Some(NormalsFrom::Estimated) => eprintln!(
            "note: the points have no normals: they are estimated, and the outer side is guessed from the shape; look at the \
             mesh, it may be inside out"
        ),
        Some(NormalsFrom::Scanner) => {
            eprintln!("note: the points have no normals: they are estimated, towards the scanner")
        }
        _ => {}
    }
    let shown = |path: &Path| path.display().to_string();
    println!("{}: {} vertices, {} triangles", shown(&args.out), report.written[0], report.written[1]);
    if let Some(surface) = &report.surface {
        surfaces::in_words(surface, unit, "").iter().for_each(|line| println!("{line}"));
    }
    if let Some(SimplifiedReport { of_surface: of, .. }) = &report.simplified {
        let unit = surfaces::behind(unit);
        println!(
            "made coarser: {} of {} triangles are left; farthest place off {}{unit}, mean {}{unit}",
            of.triangles,
            of.from_triangles,
            surfaces::short(of.error.max),
            surfaces::short(of.error.mean)
        );
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::{self, ReadLimits};
    use crate::geometry::Cloud;
    use crate::synthetic::objects;
    use clap::Parser;

    #[derive(Debug, Parser)]
    struct Line {
        #[command(flatten)]
        args: SurfaceArgs,
    }

    fn surface(file: &Path, out: &Path, more: &[&str]) -> anyhow::Result<()> {
        let paths = [Path::new("visage"), file, Path::new("--out"), out].map(|path| path.to_str().expect("UTF-8"));
        run(Line::parse_from([&paths, more].concat()).args)
    }

    #[test]
    fn a_bare_cloud_becomes_a_mesh_of_any_format_and_that_one_a_coarser_one() {
        let place = tempfile::tempdir().expect("a temporary folder");
        let at = |name: &str| place.path().join(name);
        let blob = objects::blob(1, 20_000).mesh;
        let cloud = Cloud::from_points(blob.vertices.clone());
        std::fs::write(at("cloud.ply"), ply::write_cloud(&cloud, None)).expect("written");
        let read = |name: &str| {
            let bytes = std::fs::read(at(name)).expect("there");
            formats::read(name, &bytes, &ReadLimits::default()).expect("own files are read")
        };
        let bounds = cloud.bounds().expect("points");
        for name in ["a.ply", "a.obj", "a.stl", "a.3mf", "a.glb", "a.off"] {
            surface(&at("cloud.ply"), &at(name), &["--triangles", "4000", "--unit", "mm"]).expect(name);
            let reading = read(name);
            let scale = reading.unit.map_or(1.0, |unit| unit.metres * 1000.0);
            let mesh = reading.surface.mesh().expect("triangles");
            assert!((3900..=4000).contains(&mesh.faces.len()), "{name}: {}", mesh.faces.len());
            let found = mesh.bounds().expect("vertices");
            for (a, b) in [(found.min * scale, bounds.min), (found.max * scale, bounds.max)] {
                assert!((a - b).norm() < 0.05 * bounds.diagonal(), "{name}: {a} {b}");
            }
            assert!(mesh.signed_volume_6() > 0.0, "{name} is wound outward");
        }
        surface(&at("a.ply"), &at("b.ply"), &["--max-error", "5", "--json"]).expect("a mesh is made coarser");
        assert!(read("b.ply").surface.faces.len() < 3000);
    }

    #[test]
    fn what_can_not_be_done_is_said_with_the_remedy() {
        let place = tempfile::tempdir().expect("a temporary folder");
        let at = |name: &str| place.path().join(name);
        let cloud = Cloud::from_points(vec![crate::geometry::Point3::origin(); 3]);
        std::fs::write(at("dot.ply"), ply::write_cloud(&cloud, None)).expect("written");
        let error = |file: &str, out: &str| format!("{:#}", surface(&at(file), &at(out), &[]).expect_err("refused"));
        assert!(error("dot.ply", "out.las").contains("no mesh is written as \"las\"; give one of ply, obj, stl"));
        assert!(error("none.ply", "out.ply").contains("reading"));
        let nothing = error("dot.ply", "out.ply");
        assert!(nothing.contains("makes no surface: 3 points") && nothing.contains("--spacing"), "{nothing}");
        assert!(!at("out.ply").exists());
    }
}
