//! Writes zip archives file by file, into whatever takes bytes: what is written need not be kept.

use std::io::{self, Write};

use zip::write::{SimpleFileOptions, StreamWriter};

/// Files of this size need longer numbers in the archive.
const LARGE: u64 = u32::MAX as u64;

/// A zip archive in the making. The same files always give the same bytes: no times are noted.
pub struct ZipWriter<W: Write>(zip::ZipWriter<StreamWriter<W>>);

impl<W: Write> ZipWriter<W> {
    /// An archive without files yet.
    pub fn new(out: W) -> Self {
        ZipWriter(zip::ZipWriter::new_stream(out))
    }

    /// Adds a file; its path is parted by `/`.
    ///
    /// # Errors
    /// What the output says, and a path that an archive can't hold or holds already.
    pub fn add(&mut self, path: &str, content: &[u8]) -> io::Result<()> {
        let options = SimpleFileOptions::default().large_file(content.len() as u64 >= LARGE);
        self.0.start_file(path, options)?;
        self.0.write_all(content)
    }

    /// Writes the list of files; gives back the output.
    ///
    /// # Errors
    /// What the output says.
    pub fn finish(self) -> io::Result<W> {
        Ok(self.0.finish()?.into_inner())
    }
}

#[cfg(test)]
mod tests {
    use super::super::{ArchiveLimits, entries};
    use super::*;

    #[test]
    fn what_is_packed_is_unpacked_again_and_always_the_same() {
        let write = || {
            let mut zip = ZipWriter::new(Vec::new());
            zip.add("a.ply", b"ply").expect("in memory");
            zip.add("x/\u{e9}.txt", &[7; 10_000]).expect("in memory");
            assert!(zip.add("a.ply", b"again").is_err());
            zip.finish().expect("in memory")
        };
        let bytes = write();
        assert_eq!(bytes, write());
        let read = entries("s.zip", &bytes, &ArchiveLimits::default()).expect("sound").entries;
        let read: Vec<(&str, usize)> = read.iter().map(|entry| (entry.path.as_str(), entry.bytes.len())).collect();
        assert_eq!(read, [("a.ply", 3), ("x/\u{e9}.txt", 10_000)]);
    }
}
