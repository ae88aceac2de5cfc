//! glTF 2.0, the format of phones and browsers: a scene of meshes and clouds in metres, as one file (`.glb`) or as JSON
//! whose buffers are in it (`.gltf`).
//!
//! What is drawn is read: every primitive of every node of the scene, moved by the node's motion; vertices that no
//! triangle of an indexed primitive has are left out. Vertex colours are taken as they are stored, as the programs do
//! that make scans; textures are read where the vertices are.

mod accessor;
mod document;
mod scene;
mod shapes;
mod texture;
mod writer;

#[cfg(test)]
mod tests;

use super::format::{BYTES, Content, Format, Reader, Writers};
use super::{DeclaredUnit, FormatError, ReadLimits, Reading, quote, text_start};

use writer::write_content;
pub use writer::{write_cloud, write_mesh};

/// Binary glTF.
pub const GLB: Format = Format {
    name: "GLB",
    endings: &["glb"],
    media_type: BYTES,
    holds: HOLDS,
    reader: Reader::Surface(read),
    writers: Writers { cloud: Some(write_cloud), mesh: Some(write_content), ..Writers::NONE },
};

/// glTF as text.
pub const GLTF: Format = Format {
    name: "glTF",
    endings: &["gltf"],
    media_type: BYTES,
    holds: HOLDS,
    reader: Reader::Surface(read),
    writers: Writers::NONE,
};

const HOLDS: &[Content] = &[Content::Points, Content::Mesh, Content::Normals, Content::Colors, Content::Intensities];

/// Begins a binary file.
const MAGIC: &[u8] = b"glTF";
/// Bytes of the head of a binary file, and of a chunk's.
const HEAD: usize = 12;
const CHUNK_HEAD: usize = 8;
const JSON: u32 = u32::from_le_bytes(*b"JSON");
const BIN: u32 = u32::from_le_bytes(*b"BIN\0");

const REPAIR: &str = "repair the file or export it again";

/// Reads a scene, binary or as text: which it is, its first bytes say.
///
/// # Errors
/// [`FormatError::Truncated`] when the file declares more than it holds (checked before anything is allocated),
/// [`FormatError::TooLarge`] and [`FormatError::TooManyBytes`] beyond the limits, [`FormatError::Malformed`] with the
/// accessor, node or primitive for the rest: buffers in other files, compressed geometry, indices of what isn't there.
pub fn read(bytes: &[u8], limits: &ReadLimits) -> Result<Reading, FormatError> {
    let (json, binary) = if bytes.starts_with(MAGIC) { chunks(bytes)? } else { (&bytes[text_start(bytes)?..], None) };
    let mut budget = limits.budget();
    let document = document::parse(json, &mut budget)?;
    document::check_extensions(&document)?;
    let buffers = accessor::Buffers::of(&document, binary, &mut budget)?;
    let mut reading = scene::read(&document, &buffers, limits, budget)?;
    reading.unit = Some(DeclaredUnit::METRE);
    Ok(reading)
}

/// The text of a binary file, and the buffer in it.
fn chunks(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>), FormatError> {
    let number = |at: usize| bytes.get(at..at + 4).and_then(|bytes| bytes.try_into().ok()).map(u32::from_le_bytes);
    let cut = |declared: String| FormatError::Truncated { declared, found: format!("its {} bytes", bytes.len()) };
    let (Some(version), Some(length)) = (number(4), number(8)) else {
        return Err(cut(format!("a head of {HEAD} bytes")));
    };
    if version != 2 {
        let problem = format!("it is glTF {version}");
        return Err(FormatError::malformed("byte 4", problem, "export it as glTF 2.0"));
    }
    if length as usize > bytes.len() {
        return Err(cut(format!("{length} bytes")));
    }
    let (mut json, mut binary) = (None, None);
    let mut at = HEAD;
    while let (Some(size), Some(kind)) = (number(at), number(at + 4)) {
        let start = at + CHUNK_HEAD;
        let chunk = bytes.get(start..).and_then(|rest| rest.get(..size as usize));
        let chunk = chunk.ok_or_else(|| cut(format!("a chunk of {size} bytes at byte {at}")))?;
        match kind {
            JSON if json.is_none() => json = Some(chunk),
            BIN if binary.is_none() => binary = Some(chunk),
            _ => {}
        }
        at = start + size as usize;
    }
    match json {
        Some(json) => Ok((json, binary)),
        None => {
            let problem = format!("there is no chunk of JSON; behind the head stands {}", quote(&bytes[HEAD..]));
            Err(FormatError::malformed("byte 12", problem, REPAIR))
        }
    }
}
