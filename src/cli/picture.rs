//! `visage picture`: a picture of a scan or a model, without a server.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::Args;

use super::surfaces;
use super::workplace::Workplace;
use crate::domain::asset::Asset;
use crate::faces::describe;
use crate::formats::ply;
use crate::geometry::Unit;
use crate::picture::camera::Side;
use crate::picture::size::Size;
use crate::progress::{Progress, Stage};
use crate::report::found::Found;
use crate::report::{Kind, Material, Plane, Source, Wish, draw};

/// Of what, and how.
#[derive(Debug, Args)]
pub struct PictureArgs {
    /// A scan, cloud or mesh of any format that is read, or the folder of a finished model
    file: PathBuf,
    /// The file to write: PNG, or SVG for plots
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    #[arg(long, default_value = "shaded", help = format!("What is shown: {}", kinds()))]
    kind: Kind,
    /// From which side: default, front, back, left, right, top or bottom; y is up, and z comes to who looks at the front
    #[arg(long, default_value = "default")]
    view: Side,
    /// Width and height in pixels [default: what is usual for the kind]
    #[arg(long, value_name = "WxH")]
    size: Option<Size>,
    /// The plane of a section: an axis, and where on it: x, y, z:12.5 [default: the middle of the shortest axis]
    #[arg(long)]
    plane: Option<Plane>,
    /// What it is compared with, for a deviation: a mesh or cloud in the same frame and unit
    #[arg(long, value_name = "FILE")]
    other: Option<PathBuf>,
    /// Unit of the coordinates: mm, cm, m, in or unknown [default: what the file declares]
    #[arg(long)]
    unit: Option<Unit>,
    /// Worker threads [default: one per core]
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
}

/// The kinds, for the help.
fn kinds() -> String {
    Kind::ALL.iter().map(|kind| kind.name()).collect::<Vec<_>>().join(", ")
}

/// Draws and writes.
pub fn run(args: PictureArgs) -> anyhow::Result<()> {
    let ending = args.out.extension().map(|ending| ending.to_ascii_lowercase());
    let as_svg = match ending.as_deref().and_then(|ending| ending.to_str()) {
        Some("png") => false,
        Some("svg") if args.kind.is_plot() => true,
        Some("svg") => bail!("{} is made of pixels; name a file that ends in .png", args.kind),
        _ => bail!("--out {}: name a file that ends in .png, or in .svg for plots", args.out.display()),
    };
    let place = Workplace::new(args.threads.map(usize::from))?;
    place.progress.report(Stage::Loading, 0.0);
    let material = place.pool.install(|| material(&args, &place.progress))?;
    let wish = Wish { size: args.size.unwrap_or(args.kind.size()), side: args.view, plane: args.plane };
    place.progress.report(Stage::Describing, 1.0);
    let made = place.pool.install(|| draw(args.kind, &material, &wish, &place.progress)).map_err(with_remedy)?;
    let bytes = match made.to_svg().filter(|_| as_svg) {
        Some(svg) => svg.into_bytes(),
        None => made.to_png()?,
    };
    std::fs::write(&args.out, bytes).with_context(|| format!("writing {}", args.out.display()))?;
    place.done();
    Ok(())
}

fn with_remedy(error: crate::report::PictureError) -> anyhow::Error {
    match error {
        crate::report::PictureError::Lacking { remedy, .. } => anyhow::anyhow!("{error}; {remedy}"),
        other => other.into(),
    }
}

/// What the picture is made of.
fn material(args: &PictureArgs, progress: &Progress) -> anyhow::Result<Material> {
    let mut material = Material::default();
    let folder = args.file.is_dir().then_some(args.file.as_path());
    let report = folder.map(|folder| folder.join(&*Asset::Report.name())).filter(|path| path.is_file());
    if let Some(path) = report {
        let bytes = std::fs::read(&path).with_context(|| format!("reading {}", path.display()))?;
        let found = Found::read(&bytes).with_context(|| format!("reading {}", path.display()))?;
        material.unit = found.result.unit.parse().unwrap_or_default();
        material.found = Some(found);
    }
    if let Some(path) = surface_of(args.kind, &args.file) {
        let (reading, bytes) = surfaces::read(&path)?;
        (material.views, material.support) = (ply::views(&bytes), ply::support(&bytes));
        if material.found.is_none() {
            material.unit = surfaces::unit(args.unit, &reading);
        }
        material.surface = reading.surface;
    }
    material.unit = args.unit.unwrap_or(material.unit);
    if let Some(path) = &args.other {
        material.other = Some(surfaces::read(path)?.0.surface);
    }
    if matches!(args.kind, Kind::Regions | Kind::Landmarks) {
        material.signature = Some(describe(&material.surface, material.unit, progress)?);
    }
    Ok(material)
}

/// The file that a kind of picture is made of: the one that is named, or the first in a model's folder that there is.
fn surface_of(kind: Kind, file: &Path) -> Option<PathBuf> {
    if !file.is_dir() {
        return (!kind.is_plot()).then(|| file.to_owned());
    }
    let asset = |source: &Source| match source {
        Source::Preview => Asset::Preview,
        Source::Mesh => Asset::Mesh,
        Source::Cloud => Asset::Cloud,
    };
    kind.sources().iter().map(|source| file.join(&*asset(source).name())).find(|path| path.is_file())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::objects;
    use clap::Parser;

    #[derive(Debug, Parser)]
    struct Line {
        #[command(flatten)]
        args: PictureArgs,
    }

    #[test]
    fn a_mesh_is_drawn_and_what_it_lacks_is_said() {
        let place = tempfile::tempdir().expect("a temporary folder");
        let at = |name: &str| place.path().join(name).to_str().expect("UTF-8").to_owned();
        std::fs::write(at("blob.ply"), ply::write_mesh(&objects::blob(1, 5_000).mesh)).expect("written");
        let draw = |arguments: &[&str]| {
            let file = at("blob.ply");
            let line: Vec<&str> = ["visage", &file].iter().chain(arguments).copied().collect();
            run(Line::try_parse_from(line).map_err(anyhow::Error::from)?.args)
        };
        draw(&["--out", &at("a.png"), "--view", "top", "--size", "80x60"]).expect("drawn");
        assert_eq!(&std::fs::read(at("a.png")).expect("there")[1..4], b"PNG");
        let said = |arguments: &[&str]| format!("{:#}", draw(arguments).expect_err("refused"));
        assert!(said(&["--out", &at("a.svg")]).contains("ends in .png"));
        assert!(said(&["--out", &at("a.gif")]).contains("ends in .png"));
        assert!(said(&["--out", &at("b.png"), "--kind", "views"]).contains("which scan each of its points is of"));
        assert!(said(&["--out", &at("b.png"), "--kind", "graph"]).contains("registered from scans"));
        assert!(said(&["--out", &at("b.png"), "--kind", "portrait"]).contains("thumbnail, shaded"));
        assert!(said(&["--out", &at("b.png"), "--size", "1x1"]).contains("16"));
        assert!(!std::path::Path::new(&at("b.png")).exists());
    }
}
