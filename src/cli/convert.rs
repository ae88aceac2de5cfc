//! `visage convert`: a file of one format as one of another.

use std::path::{Path, PathBuf};

use anyhow::{Context, anyhow, bail, ensure};
use clap::Args;

use crate::formats::written::{Written, scaled};
use crate::formats::{self, DeclaredUnit, Format, ReadLimits, Reading, packed, poses, write_mesh_of};
use crate::geometry::{Motion, Unit};

/// What to convert.
#[derive(Debug, Args)]
pub struct ConvertArgs {
    #[arg(help = format!("A scan or model ({}, also as .gz), or a file of poses", formats::surface_names()))]
    input: PathBuf,
    #[arg(help = format!("The file to write; its ending tells the format: {} for clouds, {} for meshes, {} for poses, also \
                          with .gz behind it", Written::Cloud.endings().join(", "), Written::Mesh.endings().join(", "),
                         Written::Poses.endings().join(", ")))]
    output: PathBuf,
    /// Unit of the input: mm, cm, m, in or unknown [default: what the file declares, else unknown]
    #[arg(long)]
    unit: Option<Unit>,
    /// Write the vertices of a mesh as a cloud, with all their attributes
    #[arg(long)]
    points: bool,
    /// Write text where the format knows both text and binary files (PLY)
    #[arg(long)]
    ascii: bool,
}

/// Reads and writes.
pub fn run(args: ConvertArgs) -> anyhow::Result<()> {
    let name = args.input.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let bytes = std::fs::read(&args.input).with_context(|| format!("reading {}", args.input.display()))?;
    let output = args.output.to_string_lossy().into_owned();
    let is_packed = packed::inner_name(&output).is_some();
    let ending = formats::extension(packed::inner_name(&output).unwrap_or(&output));
    let content = match Written::Poses.of_ending(&ending) {
        Some(format) => poses_as(format, &name, &bytes),
        None => surface_as(&args, &ending, &name, &bytes),
    };
    let content = content.with_context(|| format!("converting {}", args.input.display()))?;
    write(&args.output, &if is_packed { packed::pack(&content) } else { content })
}

fn poses_as(format: &Format, name: &str, bytes: &[u8]) -> anyhow::Result<Vec<u8>> {
    let file = poses::read_scaled(name, bytes)?;
    ensure!(file.scales.is_empty(), "its poses hold scales, which {} can't", format.name);
    let has_blank = |(scan, _): &(String, Motion)| scan.chars().any(char::is_whitespace);
    ensure!(
        *format != poses::CONF || !file.poses.iter().any(has_blank),
        "{} can't hold names with blanks",
        format.name
    );
    file.notes().iter().for_each(|note| eprintln!("note: {note}"));
    let placed = file.poses.into_iter().map(|(scan, pose)| (scan, Some(pose)));
    let all: Vec<_> = placed.chain(file.unplaced.into_iter().map(|scan| (scan, None))).collect();
    Ok(format.writers.poses.map(|write| write(&all).into_bytes()).unwrap_or_default())
}

fn surface_as(args: &ConvertArgs, ending: &str, name: &str, bytes: &[u8]) -> anyhow::Result<Vec<u8>> {
    let (as_cloud, as_mesh) = (Written::Cloud.of_ending(ending), Written::Mesh.of_ending(ending));
    let Some(format) = as_cloud.or(as_mesh) else {
        let mut endings = Written::Cloud.endings();
        endings.extend(Written::Mesh.endings());
        endings.extend(Written::Poses.endings());
        endings.dedup();
        bail!("files ending in {ending:?} are not written: give one of {}", endings.join(", "));
    };
    let writers = if args.ascii {
        let able = |able| anyhow!("--ascii is for formats that are binary otherwise ({able}): leave it out");
        format.writers.as_text().map_err(able)?
    } else {
        format.writers
    };
    let Reading { surface, dropped, unit: declared } = formats::read(name, bytes, &ReadLimits::default())?;
    if !dropped.is_empty() {
        eprintln!("note: {dropped}");
    }
    // a file that declares its unit is converted by that, unless the user knows better
    let metres = args.unit.map_or(declared.map(|unit| unit.metres), |unit| unit.in_mm().map(|mm| mm / 1000.0));
    let factor = metres.zip(format.fixed_unit()).map_or(1.0, |(from, to)| from / to.metres);
    if factor != 1.0 {
        eprintln!("note: {} files are in metres: lengths are multiplied by {factor}", format.name);
    }
    let surface = scaled(surface, factor);
    let write_mesh = writers.mesh.filter(|_| !args.points && !surface.faces.is_empty());
    match (write_mesh, writers.cloud) {
        (Some(write), _) => {
            let given = args.unit.or_else(|| declared.and_then(DeclaredUnit::unit)).unwrap_or_default();
            let unit = if metres.is_some() && format.fixed_unit().is_some() { Unit::M } else { given };
            write_mesh_of(&surface, unit, write).context("it has no triangles")
        }
        (None, Some(write)) => {
            if !surface.faces.is_empty() {
                eprintln!("note: the vertices are written, without {} triangles", surface.faces.len());
            }
            Ok(write(&surface.cloud))
        }
        (None, None) => bail!("it has no triangles, and {} holds nothing else", format.name),
    }
}

fn write(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    std::fs::write(path, bytes).with_context(|| format!("writing {}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn converted(from: (&str, &[u8]), to: &str, more: &[&str]) -> anyhow::Result<Vec<u8>> {
        #[derive(clap::Parser)]
        struct Line {
            #[command(flatten)]
            args: ConvertArgs,
        }
        let folder = tempfile::tempdir().expect("a temporary folder");
        let (input, output) = (folder.path().join(from.0), folder.path().join(to));
        std::fs::write(&input, from.1).expect("written");
        let paths = [input.to_str().expect("UTF-8"), output.to_str().expect("UTF-8")];
        let line: Line = clap::Parser::parse_from([&["convert"], &paths[..], more].concat());
        run(line.args).map(|()| std::fs::read(&output).expect("there"))
    }

    const OBJ: &[u8] = b"v 1000 0 0\nv 0 1000 0\nv 0 0 1000\nf 1 2 3\n";

    #[test]
    fn the_ending_tells_the_format_and_a_unit_is_converted() {
        let read =
            |name: &str, bytes: &[u8]| formats::read_surface(name, bytes, &ReadLimits::default()).expect("sound");
        let stl = converted(("a.obj", OBJ), "b.stl", &[]).expect("a mesh");
        assert_eq!(read("b.stl", &stl).faces.len(), 1);
        let glb = converted(("a.obj", OBJ), "b.glb", &["--unit", "mm"]).expect("in metres");
        assert_eq!(read("b.glb", &glb).cloud.points[0].x, 1.0);
        let las = converted(("a.obj", OBJ), "b.las", &[]).expect("the vertices");
        assert_eq!(read("b.las", &las).cloud.len(), 3);
        let packed = converted(("a.obj", OBJ), "b.xyz.gz", &[]).expect("packed");
        assert_eq!(read("b.xyz.gz", &packed).cloud.len(), 3);
        let refused =
            format!("{:#}", converted(("a.xyz", b"1 2 3\n4 5 6\n7 8 1\n"), "b.stl", &[]).expect_err("points"));
        assert!(refused.contains("it has no triangles"), "{refused}");
        let text = converted(("a.obj", OBJ), "b.ply", &["--ascii"]).expect("a mesh");
        assert!(text.starts_with(b"ply\nformat ascii") && text.ends_with(b"\n0 0 1000\n3 0 1 2\n"));
        let points = converted(("a.obj", OBJ), "b.ply", &["--ascii", "--points"]).expect("a cloud");
        assert!(points.ends_with(b"\n0 0 1000\n"));
        let refused = format!("{:#}", converted(("a.obj", OBJ), "b.glb", &["--ascii"]).expect_err("binary alone"));
        assert!(refused.contains("--ascii is for formats that are binary otherwise (PLY)"), "{refused}");
        let refused = format!("{:#}", converted(("a.obj", OBJ), "b.doc", &[]).expect_err("no format"));
        assert!(refused.contains("give one of ply, pcd"), "{refused}");
    }

    #[test]
    fn poses_are_converted_too() {
        let json = b"{\"a.ply\": [[1,0,0,4],[0,1,0,5],[0,0,1,6],[0,0,0,1]], \"b c\": null}";
        let aln = converted(("poses.json", json), "b.aln", &[]).expect("written");
        assert!(aln.starts_with(b"1\na.ply\n#\n1 0 0 4\n"), "{}", String::from_utf8_lossy(&aln));
    }
}
