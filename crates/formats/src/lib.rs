//! Bytes to geometry and back: every input from outside is hostile until it has passed here.
//!
//! Readers take a byte slice and a name (for messages) and give typed errors that name the place and the remedy.
//! They check declared counts against the bytes that are there before they allocate, and take what they keep from one
//! [budget](ReadLimits). One rule for all of them: what can be read without doubt is read; what is not sound costs
//! itself and not the file, and is counted ([`Dropped`]).
//!
//! [`FORMATS`] is the one list of formats: a new one is a file beside the others and a line there.
//!
//! ```
//! use visage_formats::{ReadLimits, read_surface};
//!
//! let text = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
//! let surface = read_surface("triangle.obj", text, &ReadLimits::default())?;
//! assert_eq!(surface.cloud.len(), 3);
//! let error = read_surface("scan.doc", b"", &ReadLimits::default()).expect_err("not read");
//! assert!(error.to_string().contains("send PLY"));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used))]

pub mod archive;
mod budget;
mod colors;
pub mod columns;
pub mod depth_image;
pub mod e57;
mod format;
pub mod gltf;
mod guard;
mod header_lines;
mod image;
pub mod kitti_bin;
pub mod las;
mod mesh_content;
pub mod npy;
mod number;
pub mod obj;
pub mod obj_textures;
pub mod off;
pub mod packed;
pub mod pcd;

pub mod ply;
mod points;
pub mod poses;
mod precision;
pub mod ptx;
mod reading;
mod several;
pub mod stl;
mod text;
pub mod threemf;
mod unite;
pub mod uos;
pub mod vtk;
mod weld;
pub mod written;

pub use budget::ReadLimits;
pub use format::{
    Content, Format, Reader, ScansReader, SurfaceReader, TextWriters, Writers, is_common, markdown, scan_files,
    shared_frame, surface_endings, surface_names,
};
pub use mesh_content::{MeshContent, MeshWriter, write_mesh_of};
pub use number::{NoCoordinate, checked_coordinate};
pub use poses::same_name;
pub use reading::{DeclaredUnit, Dropped, Reading, ScanReading};
pub use several::scan_names;

use visage_geometry::Surface;

/// Every format, in the order in which people read about them.
pub const FORMATS: &[&Format] = &[
    &ply::FORMAT,
    &pcd::FORMAT,
    &obj::FORMAT,
    &stl::FORMAT,
    &off::FORMAT,
    &columns::XYZ,
    &columns::XYZN,
    &columns::XYZRGB,
    &columns::PTS,
    &ptx::FORMAT,
    &vtk::FORMAT,
    &npy::NPY,
    &npy::NPZ,
    &kitti_bin::FORMAT,
    &uos::FORMAT,
    &gltf::GLB,
    &gltf::GLTF,
    &threemf::FORMAT,
    &e57::FORMAT,
    &las::LAS,
    &las::LAZ,
    &poses::JSON,
    &poses::CONF,
    &poses::ALN,
    &poses::MLP,
    &poses::LOG,
    &poses::UOS,
    &poses::TEXT,
];

/// Why a file could not be read. Messages name the place in the file and what to do.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum FormatError {
    /// The name's extension is none that is read here.
    #[error("files ending in {extension:?} are not read; send {}", surface_names())]
    UnknownExtension {
        /// The part of the name after the last dot.
        extension: String,
    },
    /// The name's extension is that of a packed file.
    #[error("files ending in {extension:?} are packed; unpack the file and send {}", surface_names())]
    Packed {
        /// The part of the name after the last dot.
        extension: String,
    },
    /// The bytes are not what the format demands.
    #[error("{place}: {problem}; {remedy}")]
    Malformed {
        /// "header line 3", "vertex 17", "byte 1024".
        place: String,
        /// What is wrong there.
        problem: String,
        /// What to do about it.
        remedy: String,
    },
    /// The file ends before what its header declares.
    #[error("the file is cut short: it declares {declared} but ends within {found}; export or upload it again")]
    Truncated {
        /// What the header promises.
        declared: String,
        /// What was being read when the bytes ran out.
        found: String,
    },
    /// The file is sound but larger than is allowed.
    #[error("{what} {found} exceeds the limit of {limit}; thin the scan or raise the limit")]
    TooLarge {
        /// The thing counted.
        what: &'static str,
        /// How many there are.
        found: u64,
        /// How many there may be.
        limit: u64,
    },
    /// The file may be sound but makes more bytes than are allowed.
    #[error("{what} {found} bytes, more than the {limit} that are allowed; thin the scan or raise the limit")]
    TooManyBytes {
        /// What takes the bytes.
        what: &'static str,
        /// How many it takes.
        found: u64,
        /// How many it may take.
        limit: u64,
    },
}

impl FormatError {
    /// Shorthand for [`FormatError::Malformed`].
    pub(crate) fn malformed(place: impl Into<String>, problem: impl Into<String>, remedy: impl Into<String>) -> Self {
        FormatError::Malformed { place: shown(place.into()), problem: shown(problem.into()), remedy: remedy.into() }
    }
}

/// A text for a message: what a parser says of a hostile file may repeat much of it.
fn shown(text: String) -> String {
    const MOST: usize = 400;
    if text.len() <= MOST && !text.contains(char::is_control) {
        return text;
    }
    let plain = text.chars().map(|c| if c.is_control() { char::REPLACEMENT_CHARACTER } else { c });
    let mut short: String = plain.take(MOST).collect();
    if short.chars().count() < text.chars().count() {
        short.push_str("...");
    }
    short
}

/// A few bytes of hostile text, fit for a message: printable and short.
pub(crate) fn quote(bytes: &[u8]) -> String {
    const MOST: usize = 24;
    let text = String::from_utf8_lossy(&bytes[..bytes.len().min(MOST)]);
    let dots = if bytes.len() > MOST { "..." } else { "" };
    format!("\"{}{dots}\"", text.escape_debug())
}

/// Where the text of a file begins: behind the mark by which some editors say that it is UTF-8.
///
/// # Errors
/// [`FormatError::Malformed`] if it is UTF-16, with or without its mark. All formats read here begin with text.
fn text_start(bytes: &[u8]) -> Result<usize, FormatError> {
    let is_utf16 = match *bytes {
        [0xff, 0xfe, ..] | [0xfe, 0xff, ..] => true,
        [0, a, 0, b, ..] | [a, 0, b, 0, ..] => a.is_ascii_graphic() && b.is_ascii(),
        _ => false,
    };
    if is_utf16 {
        return Err(FormatError::malformed("byte 0", "the text is UTF-16", "save the file as UTF-8"));
    }
    Ok(if bytes.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 })
}

/// Extensions of packed files, which may hold a scan.
const PACKED: &[&str] = &["gz", "bz2", "xz", "zst", "zip", "7z", "rar", "tar", "tgz"];

/// The extension of a file's name, lower case; empty if it has none.
pub fn extension(name: &str) -> String {
    name.rsplit_once('.').map_or("", |(_, extension)| extension).to_ascii_lowercase()
}

/// The format of a scan or model by the name of its file; a name that ends with `.gz` is that of what is packed in it.
///
/// # Errors
/// [`FormatError::UnknownExtension`] or [`FormatError::Packed`], by its ending.
pub fn check_name(name: &str) -> Result<&'static Format, FormatError> {
    let inner = packed::inner_name(name);
    let extension = extension(inner.unwrap_or(name));
    let shown = || match inner {
        Some(_) if extension.is_empty() => "gz".to_owned(),
        Some(_) => format!("{extension}.gz"),
        None => extension.clone(),
    };
    match Format::of_ending(&extension) {
        Some(format) if format.is_surface() => Ok(format),
        _ if PACKED.contains(&extension.as_str()) => Err(FormatError::Packed { extension: shown() }),
        _ if inner.is_some() && extension.is_empty() => Err(FormatError::Packed { extension: shown() }),
        _ => Err(FormatError::UnknownExtension { extension: shown() }),
    }
}

/// Reads a scan or model, and says what of it was not taken; the extension of `name` is that of the format. The scans of
/// a file that holds several become one surface, in the frame that they share.
pub fn read(name: &str, bytes: &[u8], limits: &ReadLimits) -> Result<Reading, FormatError> {
    match check_name(name)?.reader {
        Reader::Scans(_) => unite::unite(read_scans(name, bytes, limits)?, limits),
        _ => {
            let mut scans = read_scans(name, bytes, limits)?;
            scans.pop().map_or_else(|| unite::unite(Vec::new(), limits), |scan| Ok(scan.reading))
        }
    }
}

/// Reads the scans of a file, each in its own frame; a file of a format that holds one has one, without a name or place.
pub fn read_scans(name: &str, bytes: &[u8], limits: &ReadLimits) -> Result<Vec<ScanReading>, FormatError> {
    let reader = check_name(name)?.reader;
    let (_, bytes) = &packed::unpacked(name, bytes, limits)?;
    let mut scans = match reader {
        Reader::Surface(read) => vec![read(bytes, limits)?.into()],
        Reader::Scans(read) => read(bytes, limits)?,
        Reader::Poses(_) => Vec::new(),
    };
    for ScanReading { reading, .. } in &mut scans {
        reading.dropped.notes.extend(precision::rounding(&reading.surface.cloud.points));
    }
    Ok(scans)
}

/// The same without what was not taken.
pub fn read_surface(name: &str, bytes: &[u8], limits: &ReadLimits) -> Result<Surface, FormatError> {
    read(name, bytes, limits).map(|reading| reading.surface)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_unknown_extension_is_named_with_the_remedy() {
        for name in ["scan.doc", "scan.DOC"] {
            let error = read_surface(name, b"", &ReadLimits::default()).expect_err("no format");
            assert_eq!(error.to_string(), format!("files ending in \"doc\" are not read; send {}", surface_names()));
        }
        assert!(matches!(read_surface("ply", b"", &ReadLimits::default()), Err(FormatError::UnknownExtension { .. })));
        let packed = read_surface("scan.ply.xz", b"", &ReadLimits::default()).expect_err("packed").to_string();
        let remedy = format!("unpack the file and send {}", surface_names());
        assert_eq!(packed, format!("files ending in \"xz\" are packed; {remedy}"));
    }

    #[test]
    fn quoted_bytes_are_short_and_printable() {
        assert_eq!(quote(b"a\x00\xff\n"), "\"a\\0\u{fffd}\\n\"");
        assert_eq!(quote(&[b'x'; 100]).len(), 24 + 2 + 3);
    }

    #[test]
    fn messages_repeat_no_more_of_a_file_than_people_read() {
        let error = FormatError::malformed("a\u{1b}[2J", "x".repeat(5000), "send another").to_string();
        assert_eq!(error, format!("a\u{fffd}[2J: {}...; send another", "x".repeat(400)));
        let (place, problem) = ("line 3", "\u{e9}".repeat(150));
        assert_eq!(FormatError::malformed(place, &*problem, "r").to_string(), format!("{place}: {problem}; r"));
    }

    #[test]
    fn text_begins_behind_its_mark_and_utf16_is_refused() {
        assert_eq!(text_start(b"ply\n"), Ok(0));
        assert_eq!(text_start(b"\xef\xbb\xbfply\n"), Ok(3));
        for text in [&b"\xff\xfev\0 \0"[..], b"\xfe\xff\0v\0 ", b"v\0 \0", b"\0v\0 "] {
            let error = text_start(text).expect_err("UTF-16").to_string();
            assert_eq!(error, "byte 0: the text is UTF-16; save the file as UTF-8");
        }
    }
}
