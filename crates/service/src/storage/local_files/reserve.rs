//! A file that is there for the space it takes: when the disk is full, it is given up so that jobs can be ended and
//! things deleted; it is filled again as soon as there is space.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use super::private;
use crate::storage::Reserve;

/// Enough for the ends of all jobs and hundreds of deletions, whatever the size of the database.
const SIZE: u64 = 8 << 20;
/// What a small write takes in the database's log: some pages of 4 KiB.
const SMALL_WRITE: u64 = 64 << 10;
/// Of a small disk no more than this share of what is free.
const SHARE: u64 = 16;

/// The reserve of a data folder.
#[derive(Debug)]
pub struct DiskReserve {
    path: PathBuf,
    is_whole: Mutex<bool>,
}

impl DiskReserve {
    /// Takes the space, if there is any; one of an earlier start is kept as it is.
    pub(super) fn open(folder: &Path) -> DiskReserve {
        let path = folder.join("reserve");
        let is_whole = fs::metadata(&path).is_ok_and(|found| found.len() > 0) || fill(&path).is_ok();
        DiskReserve { path, is_whole: Mutex::new(is_whole) }
    }
}

impl Reserve for DiskReserve {
    fn is_whole(&self) -> bool {
        let mut is_whole = self.is_whole.lock().unwrap_or_else(PoisonError::into_inner);
        if !*is_whole {
            *is_whole = fill(&self.path).is_ok();
        }
        *is_whole
    }

    fn give(&self) -> bool {
        let mut is_whole = self.is_whole.lock().unwrap_or_else(PoisonError::into_inner);
        let given = *is_whole && File::options().write(true).truncate(true).open(&self.path).is_ok();
        *is_whole &= !given;
        given
    }

    fn has_space(&self) -> bool {
        let folder = self.path.parent().unwrap_or(Path::new("."));
        // what the system does not say is not held against it
        super::free_space(folder).map_or(true, |free| free >= SMALL_WRITE)
    }
}

/// Writes the reserve anew; what could not be written whole is given back at once.
fn fill(path: &Path) -> io::Result<()> {
    let size = size(path)?;
    let write = || -> io::Result<()> {
        let mut file = private::options().write(true).create(true).truncate(true).open(path)?;
        // bytes that no file system packs
        let mut noise = blake3::Hasher::new().update(b"reserve").finalize_xof();
        let mut chunk = vec![0; 1 << 16];
        let mut left = size;
        while left > 0 {
            let length = left.min(chunk.len() as u64) as usize;
            noise.fill(&mut chunk[..length]);
            file.write_all(&chunk[..length])?;
            left -= length as u64;
        }
        // the space is what counts: it is taken now, whenever the bytes reach the disk
        file.flush()
    };
    write().inspect_err(|_| {
        let _ = File::options().write(true).truncate(true).open(path);
    })
}

fn size(path: &Path) -> io::Result<u64> {
    let folder = path.parent().unwrap_or(Path::new("."));
    let free = super::free_space(folder)?;
    let size = SIZE.min(free / SHARE);
    if size == 0 { Err(io::ErrorKind::StorageFull.into()) } else { Ok(size) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_given_once_and_taken_back_when_there_is_space() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let length = || fs::metadata(folder.path().join("reserve")).expect("there").len();
        let reserve = DiskReserve::open(folder.path());
        let whole = length();
        assert!((1..=SIZE).contains(&whole));
        assert!(reserve.give());
        assert_eq!(length(), 0);
        assert!(!reserve.give());
        assert!(reserve.is_whole(), "there is space here");
        assert!(length() > 0);
        // a crash of a full server leaves an empty one
        reserve.give();
        DiskReserve::open(folder.path());
        assert!(length() > 0);
    }
}
