//! The entries of a file as they come: each has to be the one that is expected, so nothing in it chooses where anything is written.

use std::io::{self, Read};

use serde::de::DeserializeOwned;

use super::Place;
use super::import::ImportError;
use super::layout::FileEntry;
use crate::storage::StagedFile;
use crate::storage::inventory::StorageError;

/// The most bytes of an entry that is kept in memory: a description, or a signature (the largest seen has 30 kB).
const MOST_IN_MEMORY: u64 = 16 << 20;
/// How much of a file is in memory at a time.
const CHUNK: usize = 256 << 10;

/// A file that is read entry by entry.
pub(super) struct Entries<'a, R: Read> {
    entries: tar::Entries<'a, R>,
    /// One that was read to know what comes next.
    ahead: Option<Entry<'a, R>>,
}

/// An entry whose place was looked at.
struct Entry<'a, R: Read> {
    place: String,
    inner: tar::Entry<'a, R>,
}

impl<'a, R: Read> Entries<'a, R> {
    pub(super) fn of(archive: &'a mut tar::Archive<R>) -> Result<Self, ImportError> {
        // raw: what tar adds for long names is nothing that is written here, and would be read into memory whole
        Ok(Entries { entries: archive.entries()?.raw(true), ahead: None })
    }

    /// The place of what comes next.
    pub(super) fn next_place(&mut self) -> Result<String, ImportError> {
        let entry = self.take()?;
        let place = entry.place.clone();
        self.ahead = Some(entry);
        Ok(place)
    }

    fn take(&mut self) -> Result<Entry<'a, R>, ImportError> {
        if let Some(entry) = self.ahead.take() {
            return Ok(entry);
        }
        let inner = self.entries.next().ok_or(ImportError::Cut)??;
        let place = String::from_utf8_lossy(&inner.path_bytes()).into_owned();
        if !inner.header().entry_type().is_file() {
            return Err(ImportError::Unexpected { found: place, expected: "a plain file".into() });
        }
        Ok(Entry { place, inner })
    }

    fn expect(&mut self, place: &str) -> Result<Entry<'a, R>, ImportError> {
        let entry = self.take()?;
        if entry.place != place {
            return Err(ImportError::Unexpected { found: entry.place, expected: place.into() });
        }
        Ok(entry)
    }

    /// A description.
    pub(super) fn json<T: DeserializeOwned>(&mut self, place: &str) -> Result<T, ImportError> {
        let content = self.expect(place)?.small()?;
        serde_json::from_slice(&content)
            .map_err(|error| ImportError::Malformed { place: place.into(), reason: error.to_string() })
    }

    /// A file that is small, as it was announced.
    pub(super) fn content(&mut self, place: &str, file: &FileEntry) -> Result<Vec<u8>, ImportError> {
        let content = self.expect(place)?.small()?;
        check(place, file, content.len() as u64, &blake3::hash(&content))?;
        Ok(content)
    }

    /// A file of any size, as it was announced, among what is staged.
    pub(super) fn staged(&mut self, to: &Place<'_>, place: &str, file: &FileEntry) -> Result<StagedFile, ImportError> {
        let mut entry = self.expect(place)?;
        if entry.inner.size() != file.bytes {
            return Err(ImportError::Damaged { place: place.into() });
        }
        let mut writer = to.runtime.block_on(to.storage.objects.receive()).map_err(StorageError::from)?;
        let mut hasher = blake3::Hasher::new();
        each_chunk(&mut entry.inner, |chunk| {
            hasher.update(chunk);
            to.runtime.block_on(writer.write(chunk)).map_err(|error| StorageError::from(error).into())
        })?;
        let staged = to.runtime.block_on(writer.finish()).map_err(StorageError::from)?;
        check(place, file, staged.bytes, &hasher.finalize())?;
        Ok(staged)
    }

    /// Passes over a file that is not wanted; it has to be what was announced all the same.
    pub(super) fn pass_over(&mut self, place: &str, file: &FileEntry) -> Result<(), ImportError> {
        let mut entry = self.expect(place)?;
        let (mut hasher, mut bytes) = (blake3::Hasher::new(), 0);
        each_chunk(&mut entry.inner, |chunk| {
            hasher.update(chunk);
            bytes += chunk.len() as u64;
            Ok(())
        })?;
        check(place, file, bytes, &hasher.finalize())
    }
}

impl<R: Read> Entry<'_, R> {
    fn small(mut self) -> Result<Vec<u8>, ImportError> {
        let size = self.inner.size();
        if size > MOST_IN_MEMORY {
            return Err(ImportError::TooLarge { place: self.place, bytes: size, most: MOST_IN_MEMORY });
        }
        let mut content = Vec::new();
        each_chunk(&mut self.inner, |chunk| {
            content.extend_from_slice(chunk);
            Ok(())
        })?;
        Ok(content)
    }
}

/// All bytes of an entry: that there are fewer than its head says is no end.
fn each_chunk<R: Read>(
    entry: &mut tar::Entry<'_, R>,
    mut take: impl FnMut(&[u8]) -> Result<(), ImportError>,
) -> Result<(), ImportError> {
    let (mut left, mut chunk) = (entry.size(), vec![0; CHUNK]);
    while left > 0 {
        let read = match entry.read(&mut chunk) {
            Ok(0) => return Err(ImportError::Cut),
            Ok(read) => read,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
            Err(error) => return Err(error.into()),
        };
        left = left.saturating_sub(read as u64);
        take(&chunk[..read])?;
    }
    Ok(())
}

fn check(place: &str, file: &FileEntry, bytes: u64, hash: &blake3::Hash) -> Result<(), ImportError> {
    if bytes == file.bytes && hash.to_hex().as_str() == file.blake3 {
        Ok(())
    } else {
        Err(ImportError::Damaged { place: place.into() })
    }
}
