//! What stands in the file: a tar archive of plain files in a fixed order.
//!
//! ```text
//! gallery.json                    Head
//! models/ID/model.json            ModelEntry, then its files in the order in which it names them
//! models/ID/mesh.ply ...
//! models/ID/signature             if it has one
//! standards/ID/standard.json      StandardEntry, after all models
//! standards/ID/model.ply
//! end.json                        Tail: without it the file was cut short
//! ```
//! A program reads a file of its own [`VERSION`] or of an earlier one. Fields that it does not know are passed over: a later program may
//! add some without counting up.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use visage_domain::AssetRecord;
use visage_shape::faces::SignatureSummary;
use visage_shape::standards::Annotation;

/// By which a file is known.
pub const FORMAT: &str = "visage-gallery";
/// The layout that is written. One that earlier programs would read wrongly has the next number.
pub const VERSION: u32 = 1;

pub const HEAD: &str = "gallery.json";
pub const TAIL: &str = "end.json";
/// The name of a signature among the files of its model.
pub const SIGNATURE: &str = "signature";

/// What the file is.
#[derive(Debug, Serialize, Deserialize)]
pub struct Head {
    pub format: String,
    pub version: u32,
    /// The version of the program that has written it, for people.
    pub program: String,
}

/// What was written before: read to its end, the file holds so many.
#[derive(Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Tail {
    pub models: u64,
    pub standards: u64,
}

/// A file that follows.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct FileEntry {
    pub name: String,
    pub bytes: u64,
    /// Of its content, hexadecimal.
    pub blake3: String,
}

impl From<&AssetRecord> for FileEntry {
    fn from(asset: &AssetRecord) -> Self {
        FileEntry { name: asset.name.clone(), bytes: asset.bytes, blake3: asset.checksum.clone() }
    }
}

impl From<&FileEntry> for AssetRecord {
    fn from(file: &FileEntry) -> Self {
        AssetRecord { name: file.name.clone(), bytes: file.bytes, checksum: file.blake3.clone() }
    }
}

/// A model.
#[derive(Debug, Serialize, Deserialize)]
pub struct ModelEntry {
    pub id: String,
    pub name: String,
    pub label: Option<String>,
    pub unit: String,
    pub points: u64,
    /// The verdict on its registration.
    pub quality: Option<String>,
    /// What of an uploaded file was not taken (JSON).
    pub reading: Option<String>,
    pub files: Vec<FileEntry>,
    pub signature: Option<SignatureEntry>,
    /// The job that made it; null for an uploaded one.
    pub job: Option<JobEntry>,
    /// What that job made it from; null where that is not a scan set.
    pub scan_set: Option<ScanSetEntry>,
}

/// A signature: taken over by a program of the same version of the operator, made anew from the model by every other.
#[derive(Debug, Serialize, Deserialize)]
pub struct SignatureEntry {
    pub version: u32,
    pub summary: SignatureSummary,
    pub file: FileEntry,
}

/// A job that has succeeded.
#[derive(Debug, Serialize, Deserialize)]
pub struct JobEntry {
    pub id: String,
    pub kind: String,
    pub label: Option<String>,
    pub options: serde_json::Value,
    pub hints: Option<serde_json::Value>,
    /// The model that it added scans to, or made a surface of.
    pub base_model_id: Option<String>,
    pub stage: Option<String>,
    pub stage_seconds: BTreeMap<String, f64>,
    pub attempts: u32,
    /// RFC 3339.
    pub started_at: Option<String>,
    pub finished_at: Option<String>,
}

/// A scan set, without its scans.
#[derive(Debug, Serialize, Deserialize)]
pub struct ScanSetEntry {
    pub id: String,
    pub name: String,
    pub unit: String,
}

/// A class that a user made. What the operator makes of it is made anew from its file.
#[derive(Debug, Serialize, Deserialize)]
pub struct StandardEntry {
    pub id: String,
    pub name: String,
    pub unit: String,
    pub annotation: Annotation,
    /// Models of the class, and others, by their ids.
    pub positive: Vec<String>,
    pub negative: Vec<String>,
    pub file: FileEntry,
}

/// The place of a file of a model.
pub fn of_model(id: &str, file: &str) -> String {
    format!("models/{id}/{file}")
}

/// The place of a file of a standard.
pub fn of_standard(id: &str, file: &str) -> String {
    format!("standards/{id}/{file}")
}
