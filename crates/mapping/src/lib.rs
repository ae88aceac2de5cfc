//! Files that nobody changes, read as memory.
//!
//! ```
//! use std::io::Write;
//! let mut file = tempfile::tempfile()?;
//! file.write_all(b"once and for all")?;
//! assert_eq!(&visage_mapping::map(&file)?[..4], b"once");
//! # Ok::<(), std::io::Error>(())
//! ```
//!
//! A mapped file takes no memory of its own: the system reads its pages when they are asked for and lets them go when memory is short.
//! Crates that offer this as a safe call hide an unsafe one that nothing vouches for; here it stands in the open, once, with what its
//! callers have to keep.

use std::fs::File;
use std::io;

use bytes::Bytes;

/// The content of a file, as long as it is now, without reading it. It stays readable when the file is removed.
///
/// Callers map files that are never written, nor made shorter, from then on: files in a folder of their own that only this user may
/// enter, written under another name, synced and then renamed, and removed as a whole. If somebody cuts one short all the same, or
/// if the disk fails, whoever reads there is ended by the system (SIGBUS); if somebody writes to one, readers may see either.
pub fn map(file: &File) -> io::Result<Bytes> {
    if file.metadata()?.len() == 0 {
        // the system maps nothing of no length
        return Ok(Bytes::new());
    }
    // SAFETY: the map is read-only and private to this process, and what it reads does not change: callers map only files that nobody
    // writes to or shortens after they have their name (above). The map lives as long as any part of the bytes that it lends.
    #[allow(unsafe_code)]
    let map = unsafe { memmap2::Mmap::map(file) }?;
    Ok(Bytes::from_owner(map))
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use super::*;

    #[test]
    fn a_file_is_read_where_it_lies_also_after_it_is_removed() {
        let mut file = tempfile::NamedTempFile::new().expect("a temporary file");
        let content: Vec<u8> = (0..100_000u32).flat_map(u32::to_le_bytes).collect();
        file.write_all(&content).expect("written");
        let bytes = map(file.as_file()).expect("mapped");
        let part = bytes.slice(4096..8192);
        drop((file, bytes));
        assert_eq!(part, content[4096..8192]);
        assert_eq!(part.as_ptr().align_offset(4096), 0, "pages begin where columns may");
    }

    #[test]
    fn an_empty_file_is_no_trouble() {
        assert!(map(&tempfile::tempfile().expect("a temporary file")).expect("mapped").is_empty());
    }
}
