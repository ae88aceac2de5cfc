//! Scan sets: the ordered scans of one object and their pose file.

use super::{FileId, ScanSetId};
use visage_geometry::Unit;

/// One scan as the database knows it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ScanRecord {
    /// The user's file name; unique in its set.
    pub name: String,
    /// The file on disk.
    pub file_id: FileId,
    /// Points in the file.
    pub points: u64,
    /// Size of the file.
    pub bytes: u64,
    /// BLAKE3 of the file, hexadecimal.
    pub checksum: String,
    /// What of the file was not taken (JSON); `None` if all of it was.
    pub reading: Option<String>,
}

/// A pose file as it was sent.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PoseFile {
    /// Its name: only for messages and for telling the format.
    pub name: String,
    /// Its bytes.
    pub content: Vec<u8>,
}

/// A file that came with a scan set and was not kept.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct PassedOver {
    /// Its name, with that of the archive it was in.
    pub file: String,
    /// Why, in words that go on from "it".
    pub why: String,
}

/// A scan set that is to be stored.
#[derive(Debug, Clone)]
pub struct NewScanSet {
    /// Its id.
    pub id: ScanSetId,
    /// A name for people.
    pub name: String,
    /// The unit of all its scans.
    pub unit: Unit,
    /// Its scans.
    pub scans: Vec<ScanRecord>,
    /// Its initial poses.
    pub poses: Option<PoseFile>,
    /// What came with it and was not kept.
    pub passed_over: Vec<PassedOver>,
}

/// A stored scan set.
#[derive(Debug, Clone)]
pub struct ScanSetRecord {
    /// Its id.
    pub id: ScanSetId,
    /// A name for people.
    pub name: String,
    /// The unit of all its scans.
    pub unit: Unit,
    /// Its scans, in natural order of their names (`scan2` before `scan10`).
    pub scans: Vec<ScanRecord>,
    /// Its initial poses.
    pub poses: Option<PoseFile>,
    /// What came with it and was not kept.
    pub passed_over: Vec<PassedOver>,
}

/// What storing one scan did.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PutScan {
    /// There was none of that name.
    Created,
    /// There was one: its file is no longer used.
    Replaced(FileId),
}

/// Natural order of the names, ties by bytes: `scan2` before `scan10`.
pub fn sort_naturally(scans: &mut [ScanRecord]) {
    scans.sort_by(|a, b| natord::compare(&a.name, &b.name).then_with(|| a.name.cmp(&b.name)));
}
