//! What commands about surfaces share: files in, files out, words.

use std::path::Path;

use anyhow::{Context, bail};

use crate::formats::{self, FORMATS, Format, ReadLimits, Reading};
use crate::geometry::Unit;
use crate::pipeline::report::SurfaceOutcome;

/// Reads a cloud or mesh, and says on standard error what of it was not taken.
pub(super) fn read(path: &Path) -> anyhow::Result<(Reading, Vec<u8>)> {
    let bytes = std::fs::read(path).with_context(|| format!("reading {}", path.display()))?;
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let reading = formats::read(&name, &bytes, &ReadLimits::default());
    let reading = reading.with_context(|| format!("reading {}", path.display()))?;
    if !reading.dropped.is_empty() {
        eprintln!("note: {}: {}", path.display(), reading.dropped);
    }
    Ok((reading, bytes))
}

/// The unit of a file: what is said wins over what the file declares.
pub(super) fn unit(given: Option<Unit>, reading: &Reading) -> Unit {
    given.or_else(|| reading.unit.and_then(formats::DeclaredUnit::unit)).unwrap_or_default()
}

/// The format in which a mesh is written to a file of this name.
pub(super) fn mesh_format(path: &Path) -> anyhow::Result<&'static Format> {
    let ending = formats::extension(&path.file_name().unwrap_or_default().to_string_lossy());
    mesh_format_of(&ending).with_context(|| format!("--out {}", path.display()))
}

/// The format of this ending, in which meshes are written.
pub(super) fn mesh_format_of(ending: &str) -> anyhow::Result<&'static Format> {
    match Format::of_ending(&ending.to_ascii_lowercase()).filter(|format| format.writers.mesh.is_some()) {
        Some(format) => Ok(format),
        None => bail!("no mesh is written as {ending:?}; give one of {}", mesh_endings()),
    }
}

/// The endings of the formats in which meshes are written.
pub(super) fn mesh_endings() -> String {
    let written = FORMATS.iter().filter(|format| format.writers.mesh.is_some());
    written.map(|format| format.ending()).collect::<Vec<_>>().join(", ")
}

/// A unit behind a length; nothing if it is unknown.
pub(super) fn behind(unit: Unit) -> String {
    match unit {
        Unit::Unknown => String::new(),
        unit => format!(" {}", unit.name()),
    }
}

/// How a surface came about, a line each.
pub(super) fn in_words(surface: &SurfaceOutcome, unit: Unit, without: &str) -> Vec<String> {
    let made = &surface.reconstruction;
    let unit = behind(unit);
    let wider = if made.widened { ", wider than the scans resolve, to stay within memory" } else { "" };
    let mut lines = vec![format!(
        "surface: {} triangles from cells of {:.3}{unit}{wider}; holes: {} closed, {} left open (--fill); \
         {:.1} % of it nobody saw{without}",
        made.triangles,
        made.cell,
        made.closed_holes,
        made.open_holes,
        100.0 * made.unseen_area
    )];
    if let Some(simplified) = &surface.simplified {
        let (of, spacings) = (&simplified.of_surface, &simplified.error_spacings);
        lines.push(format!(
            "made coarser: {} of {} triangles are left; farthest place off {:.4}{unit} ({:.2} spacings), mean {:.4}{unit} \
             ({:.2})",
            of.triangles, of.from_triangles, of.error.max, spacings.max, of.error.mean, spacings.mean
        ));
    }
    lines
}
