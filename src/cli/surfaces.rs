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

/// A length in three digits, whatever its unit.
pub(super) fn short(length: f64) -> String {
    let size = if length == 0.0 { 0.0 } else { length.abs().log10().floor() };
    format!("{length:.0$}", (2.0 - size).clamp(0.0, 12.0) as usize)
}

/// How a surface came about, a line each.
pub(super) fn in_words(surface: &SurfaceOutcome, unit: Unit, without: &str) -> Vec<String> {
    let made = &surface.reconstruction;
    let unit = behind(unit);
    let wider = if made.widened { ", wider than the scans resolve, to stay within memory" } else { "" };
    let mut lines = vec![format!(
        "surface: {} triangles from cells of {}{unit}{wider}; holes: {} closed, {} left open (--fill); \
         {:.1} % of it nobody saw{without}",
        made.triangles,
        short(made.cell),
        made.closed_holes,
        made.open_holes,
        100.0 * made.unseen_area
    )];
    if let Some(simplified) = &surface.simplified {
        let (of, spacings) = (&simplified.of_surface, &simplified.error_spacings);
        lines.push(format!(
            "made coarser: {} of {} triangles are left; farthest place off {}{unit} ({:.2} spacings), mean {}{unit} \
             ({:.2})",
            of.triangles,
            of.from_triangles,
            short(of.error.max),
            spacings.max,
            short(of.error.mean),
            spacings.mean
        ));
    }
    lines.extend(surface.reasons.iter().map(|reason| format!("  {reason}")));
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_length_is_told_in_three_digits() {
        let told = [0.0, 0.000_123_45, 0.0625, 1.5, 98.76, 12_345.6, -0.01].map(short);
        assert_eq!(told, ["0.00", "0.000123", "0.0625", "1.50", "98.8", "12346", "-0.0100"]);
    }
}
