//! Files in memory: a second kind of object store, which shows that the checks take any.

use std::collections::{BTreeMap, BTreeSet};
use std::io::{self, Cursor};
use std::sync::{Arc, Mutex, MutexGuard, Weak};

use async_trait::async_trait;
use bytes::Bytes;

use super::ObjectPlace;
use crate::storage::{
    AssetReader, ObjectError, ObjectStore, PieceWriter, SegmentStore, StagedFile, StagedModel, StagedWriter, Staging,
    TRASH_DAYS,
};
use visage_domain::{AssetRecord, FileId, ModelId, ScanRecord, ScanSetId, SegmentId, StandardId, StoredFile, UploadId};

/// The name of the one file of a scan, and of an upload.
const ONLY: &str = "";

/// Named files that go together.
type Group = BTreeMap<String, Vec<u8>>;

#[derive(Debug, Default)]
struct Content {
    /// With the process that stages it.
    staged: BTreeMap<FileId, (Weak<()>, Group)>,
    published: BTreeMap<StoredFile, Group>,
    pieces: BTreeMap<UploadId, Vec<u8>>,
    trash: Vec<(jiff::Timestamp, StoredFile)>,
    segments: BTreeMap<SegmentId, Bytes>,
}

#[derive(Debug, Default)]
struct Shared(Mutex<Content>);

impl Shared {
    fn lock(&self) -> MutexGuard<'_, Content> {
        self.0.lock().expect("no panic")
    }
}

impl Staging for Shared {
    fn discard(&self, id: FileId) {
        self.lock().staged.remove(&id);
    }
}

/// A process that uses them.
#[derive(Debug)]
struct MemoryObjects {
    shared: Arc<Shared>,
    process: Arc<()>,
}

impl MemoryObjects {
    fn stage(&self) -> FileId {
        let id = FileId::new();
        self.shared.lock().staged.insert(id, (Arc::downgrade(&self.process), Group::new()));
        id
    }

    fn publish(&self, id: FileId, file: StoredFile, asset: Option<&str>) -> Result<(), ObjectError> {
        let mut content = self.shared.lock();
        let (_, mut group) = content.staged.remove(&id).ok_or_else(|| missing("publishing"))?;
        if let Some(asset) = asset {
            group = group.into_values().map(|content| (asset.to_owned(), content)).collect();
        }
        content.published.insert(file, group);
        Ok(())
    }

    fn read(&self, file: StoredFile, asset: &str) -> Option<Vec<u8>> {
        self.shared.lock().published.get(&file)?.get(asset).cloned()
    }
}

fn missing(doing: &'static str) -> ObjectError {
    ObjectError::Io { doing, source: io::ErrorKind::NotFound.into() }
}

fn checked(content: Vec<u8>, checksum: &str, what: &str) -> Result<Vec<u8>, ObjectError> {
    let is_sound = blake3::hash(&content).to_hex().as_str() == checksum;
    if is_sound { Ok(content) } else { Err(ObjectError::Damaged { what: what.to_owned() }) }
}

#[derive(Debug)]
struct MemoryWriter {
    shared: Arc<Shared>,
    staged: StagedFile,
    content: Vec<u8>,
}

#[async_trait]
impl StagedWriter for MemoryWriter {
    async fn write(&mut self, chunk: &[u8]) -> Result<(), ObjectError> {
        self.content.extend_from_slice(chunk);
        Ok(())
    }

    async fn finish(mut self: Box<Self>) -> Result<StagedFile, ObjectError> {
        self.staged.bytes = self.content.len() as u64;
        self.staged.checksum = blake3::hash(&self.content).to_hex().to_string();
        let mut content = self.shared.lock();
        let (_, group) = content.staged.get_mut(&self.staged.id()).ok_or_else(|| missing("storing an upload"))?;
        group.insert(ONLY.to_owned(), self.content);
        drop(content);
        Ok(self.staged)
    }
}

impl SegmentStore for MemoryObjects {
    fn keep_segment(
        &self,
        id: SegmentId,
        write: &mut dyn FnMut(&mut dyn io::Write) -> io::Result<()>,
    ) -> Result<(), ObjectError> {
        let mut content = Vec::new();
        write(&mut content).map_err(|source| ObjectError::Io { doing: "writing", source })?;
        self.shared.lock().segments.insert(id, content.into());
        Ok(())
    }

    fn map_segment(&self, id: SegmentId) -> Result<Option<Bytes>, ObjectError> {
        Ok(self.shared.lock().segments.get(&id).cloned())
    }

    fn open_segment(&self, id: SegmentId) -> Result<Option<Box<dyn io::Read + Send>>, ObjectError> {
        Ok(self.map_segment(id)?.map(|content| -> Box<dyn io::Read + Send> { Box::new(Cursor::new(content)) }))
    }

    fn remove_segment(&self, id: SegmentId) -> Result<(), ObjectError> {
        self.shared.lock().segments.remove(&id);
        Ok(())
    }

    fn segment_listing(&self) -> Result<Vec<SegmentId>, ObjectError> {
        Ok(self.shared.lock().segments.keys().copied().collect())
    }
}

#[derive(Debug)]
struct MemoryPieces {
    shared: Arc<Shared>,
    upload: UploadId,
}

#[async_trait]
impl PieceWriter for MemoryPieces {
    async fn write(&mut self, chunk: &[u8]) -> Result<(), ObjectError> {
        self.shared.lock().pieces.entry(self.upload).or_default().extend_from_slice(chunk);
        Ok(())
    }

    async fn finish(self: Box<Self>) -> Result<(), ObjectError> {
        Ok(())
    }
}

#[async_trait]
impl ObjectStore for MemoryObjects {
    async fn receive(&self) -> Result<Box<dyn StagedWriter>, ObjectError> {
        let staged = StagedFile::new(self.stage(), self.shared.clone());
        Ok(Box::new(MemoryWriter { shared: self.shared.clone(), staged, content: Vec::new() }))
    }

    fn read_staged(&self, file: &StagedFile) -> Result<Vec<u8>, ObjectError> {
        let content = self.shared.lock();
        let staged = content.staged.get(&file.id()).and_then(|(_, group)| group.get(ONLY));
        staged.cloned().ok_or_else(|| missing("reading an uploaded file"))
    }

    async fn open_staged(&self, file: &StagedFile) -> Result<Box<dyn AssetReader>, ObjectError> {
        Ok(Box::new(Cursor::new(self.read_staged(file)?)))
    }

    async fn held(&self, upload: UploadId) -> Result<u64, ObjectError> {
        Ok(self.shared.lock().pieces.get(&upload).map_or(0, Vec::len) as u64)
    }

    async fn resume(&self, upload: UploadId) -> Result<Box<dyn PieceWriter>, ObjectError> {
        self.shared.lock().pieces.entry(upload).or_default();
        Ok(Box::new(MemoryPieces { shared: self.shared.clone(), upload }))
    }

    fn stage_held(&self, upload: UploadId) -> Result<StagedFile, ObjectError> {
        let mut staged = StagedFile::new(self.stage(), self.shared.clone());
        let mut content = self.shared.lock();
        let pieces = content.pieces.get(&upload).cloned().ok_or_else(|| missing("putting an upload together"))?;
        (staged.bytes, staged.checksum) = (pieces.len() as u64, blake3::hash(&pieces).to_hex().to_string());
        content.staged.entry(staged.id()).and_modify(|(_, group)| drop(group.insert(ONLY.to_owned(), pieces)));
        drop(content);
        Ok(staged)
    }

    fn let_go(&self, upload: UploadId) -> Result<(), ObjectError> {
        self.shared.lock().pieces.remove(&upload);
        Ok(())
    }

    fn held_uploads(&self) -> Result<Vec<UploadId>, ObjectError> {
        Ok(self.shared.lock().pieces.keys().copied().collect())
    }

    fn stage_model(&self) -> Result<StagedModel, ObjectError> {
        Ok(StagedModel::new(self.stage(), self.shared.clone()))
    }

    fn write_asset(&self, model: &StagedModel, asset: &str, content: &[u8]) -> Result<String, ObjectError> {
        let mut all = self.shared.lock();
        let (_, group) = all.staged.get_mut(&model.id()).ok_or_else(|| missing("writing a file of a model"))?;
        group.insert(asset.to_owned(), content.to_vec());
        Ok(blake3::hash(content).to_hex().to_string())
    }

    fn take_asset(&self, model: &StagedModel, asset: &str, file: &StagedFile) -> Result<(), ObjectError> {
        let content = self.read_staged(file)?;
        self.write_asset(model, asset, &content).map(drop)
    }

    fn keep_scan(&self, staged: &StagedFile, set: ScanSetId, file: FileId) -> Result<(), ObjectError> {
        self.publish(staged.id(), StoredFile::Scan(set, file), None)
    }

    fn keep_model(&self, staged: &StagedModel, model: ModelId) -> Result<(), ObjectError> {
        self.publish(staged.id(), StoredFile::Model(model), None)
    }

    fn keep_standard(&self, staged: &StagedFile, standard: StandardId, asset: &str) -> Result<(), ObjectError> {
        self.publish(staged.id(), StoredFile::Standard(standard), Some(asset))
    }

    fn read_scan(&self, set: ScanSetId, scan: &ScanRecord) -> Result<Vec<u8>, ObjectError> {
        let content = self.read(StoredFile::Scan(set, scan.file_id), ONLY).ok_or_else(|| missing("reading a scan"))?;
        checked(content, &scan.checksum, &scan.name)
    }

    fn check_scan(&self, set: ScanSetId, scan: &ScanRecord) -> Result<(), ObjectError> {
        self.read_scan(set, scan).map(drop)
    }

    async fn open_asset(
        &self,
        model: ModelId,
        asset: &AssetRecord,
    ) -> Result<Option<Box<dyn AssetReader>>, ObjectError> {
        let content = self.read_asset(model, asset)?;
        Ok(content.map(|content| -> Box<dyn AssetReader> { Box::new(Cursor::new(content)) }))
    }

    fn read_asset(&self, model: ModelId, asset: &AssetRecord) -> Result<Option<Vec<u8>>, ObjectError> {
        let content = self.read(StoredFile::Model(model), &asset.name);
        content.map(|content| checked(content, &asset.checksum, &asset.name)).transpose()
    }

    fn check_asset(&self, model: ModelId, asset: &AssetRecord) -> Result<bool, ObjectError> {
        Ok(self.read_asset(model, asset)?.is_some())
    }

    fn read_standard(&self, standard: StandardId, asset: &AssetRecord) -> Result<Vec<u8>, ObjectError> {
        let content = self.read(StoredFile::Standard(standard), &asset.name);
        checked(content.ok_or_else(|| missing("reading a standard"))?, &asset.checksum, &asset.name)
    }

    fn remove(&self, file: StoredFile) -> Result<(), ObjectError> {
        let is_in = |stored: &StoredFile| match (file, *stored) {
            (StoredFile::ScanSet(set), StoredFile::Scan(of, _)) => set == of,
            (file, stored) => file == stored,
        };
        self.shared.lock().published.retain(|stored, _| !is_in(stored));
        Ok(())
    }

    fn listing(&self) -> Result<Vec<StoredFile>, ObjectError> {
        Ok(self.shared.lock().published.keys().copied().collect())
    }

    fn set_aside(&self, files: &[StoredFile]) -> Result<String, ObjectError> {
        let mut content = self.shared.lock();
        let files: BTreeSet<StoredFile> = files.iter().copied().collect();
        content.published.retain(|stored, _| !files.contains(stored));
        content.trash.extend(files.into_iter().map(|file| (jiff::Timestamp::now(), file)));
        Ok("the trash".to_owned())
    }

    fn sweep_staging(&self) -> Result<usize, ObjectError> {
        let mut content = self.shared.lock();
        let before = content.staged.len();
        content.staged.retain(|_, (process, _)| process.strong_count() > 0);
        Ok(before - content.staged.len())
    }

    fn free_bytes(&self) -> Option<u64> {
        None
    }

    fn empty_trash(&self, now: jiff::Timestamp) -> Result<usize, ObjectError> {
        let mut content = self.shared.lock();
        let before = content.trash.len();
        let longest = jiff::SignedDuration::from_hours(24 * i64::from(TRASH_DAYS));
        content.trash.retain(|(since, _)| now.duration_since(*since) <= longest);
        Ok(before - content.trash.len())
    }
}

/// Files in memory that several processes may use.
#[derive(Debug, Default)]
pub struct MemoryPlace {
    shared: Arc<Shared>,
}

impl ObjectPlace for MemoryPlace {
    fn new() -> Self {
        MemoryPlace::default()
    }

    fn open(&self) -> Arc<dyn ObjectStore> {
        Arc::new(MemoryObjects { shared: self.shared.clone(), process: Arc::default() })
    }

    fn damage(&self, file: StoredFile, asset: Option<&str>) {
        let mut content = self.shared.lock();
        let group = content.published.get_mut(&file).expect("published");
        group.get_mut(asset.unwrap_or(ONLY)).expect("there")[0] ^= 1;
    }
}

mod conformance {
    use super::MemoryPlace;

    crate::storage::conformance::object_conformance!(MemoryPlace);
}
