//! What lies in the data folder under names of ours; other names are nobody's to touch.

use std::fs;
use std::io;
use std::path::Path;

use visage_domain::{FileId, ModelId, ScanSetId, StandardId, StoredFile};

/// The folders that hold files under ids.
pub(super) const FOLDERS: [&str; 7] = ["staging", "uploads", "scan-sets", "models", "standards", "segments", "trash"];

/// Whether nothing is in a folder; what can't be read is not empty.
pub(super) fn is_empty(folder: &Path) -> bool {
    fs::read_dir(folder).is_ok_and(|mut entries| entries.next().is_none())
}

/// The entries of a folder whose names are ids; none if it is not there.
pub(super) fn ids<T>(folder: &Path, parse: impl Fn(&str) -> Option<T>) -> io::Result<Vec<T>> {
    let entries = match fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        Err(error) => return Err(error),
    };
    let mut ids = Vec::new();
    for entry in entries {
        ids.extend(entry?.file_name().to_str().and_then(&parse));
    }
    Ok(ids)
}

/// Everything in a data folder that has an id.
pub(super) fn of(root: &Path) -> io::Result<Vec<StoredFile>> {
    let mut files = Vec::new();
    files.extend(ids(&root.join("models"), ModelId::parse)?.into_iter().map(StoredFile::Model));
    files.extend(ids(&root.join("standards"), StandardId::parse)?.into_iter().map(StoredFile::Standard));
    let sets = root.join("scan-sets");
    for set in ids(&sets, ScanSetId::parse)? {
        let scans = ids(&sets.join(set.to_string()), FileId::parse)?;
        files.extend(scans.into_iter().map(|scan| StoredFile::Scan(set, scan)));
    }
    Ok(files)
}
