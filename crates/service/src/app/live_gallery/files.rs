//! The gallery's segments in files, and which of them count: what a crash leaves is a whole index, at every moment.
//!
//! A file is written, read back against its checksums, and mapped; then one transaction makes it count and those that it takes the place of no
//! longer; then its models are no longer unfiled, and the old files are removed (who still searches in them keeps them). What
//! can't be written, on a full disk, stays in memory as it is and is tried again with the next merge.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};

use tokio::runtime::Handle;

use crate::storage::inventory::Storage;
use crate::storage::{Database, DatabaseError, ObjectError, ObjectStore};
use visage_domain::{ModelId, SegmentId, SegmentRecord};
use visage_gallery::segment_handle::check;
use visage_gallery::{Gallery, SegmentError, SegmentHandle};

/// Why a segment is not in a file.
#[derive(Debug, thiserror::Error)]
pub enum FilingError {
    /// The place for files.
    #[error(transparent)]
    Objects(#[from] ObjectError),
    /// The database.
    #[error(transparent)]
    Database(#[from] DatabaseError),
    /// The file is not what was written.
    #[error("the file is not what was written: {0}")]
    Segment(#[from] SegmentError),
    /// The file is not there.
    #[error("the file is missing")]
    Missing,
    /// The service has ended.
    #[error("the service ends")]
    Ended,
}

/// A file that is used.
#[derive(Debug)]
struct Used {
    record: SegmentRecord,
    segment: SegmentHandle,
    /// Whether it counts by the database.
    is_listed: bool,
}

/// Where segments are kept. Holds neither database nor files in use: a service that ends is not waited for.
#[derive(Debug)]
pub struct SegmentFiles {
    database: Weak<dyn Database>,
    objects: Weak<dyn ObjectStore>,
    runtime: Handle,
    /// Held for moments only.
    used: Mutex<BTreeMap<SegmentId, Used>>,
    /// How many steps are still done before the process ends.
    #[cfg(test)]
    pub(super) fuse: std::sync::atomic::AtomicUsize,
}

impl SegmentFiles {
    /// Those of a service. To be called on its runtime.
    pub fn of(storage: &Storage) -> SegmentFiles {
        SegmentFiles {
            database: Arc::downgrade(&storage.database),
            objects: Arc::downgrade(&storage.objects),
            runtime: Handle::current(),
            used: Mutex::default(),
            #[cfg(test)]
            fuse: std::sync::atomic::AtomicUsize::new(usize::MAX),
        }
    }

    /// Whatever is done with files or rows is a step, between which the process may end.
    fn step(&self) -> Result<(), FilingError> {
        #[cfg(test)]
        {
            use std::sync::atomic::Ordering::SeqCst;
            self.fuse.fetch_update(SeqCst, SeqCst, |left| left.checked_sub(1)).map_err(|_| FilingError::Ended)?;
        }
        Ok(())
    }

    fn objects(&self) -> Result<Arc<dyn ObjectStore>, FilingError> {
        self.step()?;
        self.objects.upgrade().ok_or(FilingError::Ended)
    }

    fn database(&self) -> Result<Arc<dyn Database>, FilingError> {
        self.step()?;
        self.database.upgrade().ok_or(FilingError::Ended)
    }

    /// A file that counts, mapped and ready to be searched. Blocks.
    pub fn open(&self, record: SegmentRecord) -> Result<SegmentHandle, FilingError> {
        let segment = self.mapped(record)?;
        self.used().insert(record.id, Used { record, segment: segment.clone(), is_listed: true });
        Ok(segment)
    }

    fn mapped(&self, record: SegmentRecord) -> Result<SegmentHandle, FilingError> {
        let bytes = self.objects()?.map_segment(record.id)?.ok_or(FilingError::Missing)?;
        Ok(SegmentHandle::decode(record.id.number(), record.checksum, &bytes)?)
    }

    /// Writes a segment into a file of its own, which does not count yet. Blocks.
    pub fn write(&self, segment: &SegmentHandle) -> Result<SegmentHandle, FilingError> {
        let (objects, id) = (self.objects()?, SegmentId::new());
        let image = segment.encode();
        let (models, bytes, checksum) = (segment.ids().len() as u64, image.bytes(), image.checksum());
        let record = SegmentRecord { id, models, bytes, checksum };
        let write = || {
            objects.keep_segment(id, &mut |to| image.write_to(to))?;
            self.examine(record)?;
            self.mapped(record)
        };
        let stored = write().inspect_err(|error| {
            // whoever ends leaves it to the next start
            let is_end = matches!(error, FilingError::Ended);
            if let Some(Err(error)) = (!is_end).then(|| objects.remove_segment(id)) {
                tracing::debug!(segment.id = %id, "it is left to the next start: {error}");
            }
        })?;
        self.used().insert(id, Used { record, segment: stored.clone(), is_listed: false });
        Ok(stored)
    }

    /// Reads a whole file and holds it against its checksums. Blocks.
    pub fn examine(&self, record: SegmentRecord) -> Result<(), FilingError> {
        examine(self.objects()?.as_ref(), record)
    }

    /// The first of some files that is not as it was written. Blocks.
    pub fn first_damaged(&self, files: impl Iterator<Item = u128>) -> Option<(SegmentId, FilingError)> {
        let records: Vec<SegmentRecord> = {
            let used = self.used();
            files.filter_map(|file| Some(used.get(&SegmentId::from_number(file))?.record)).collect()
        };
        records.into_iter().find_map(|record| Some((record.id, self.examine(record).err()?)))
    }

    /// The service's database and files, and its runtime; `None` when it has ended.
    pub fn service(&self) -> Option<(Storage, &Handle)> {
        let storage = Storage { database: self.database.upgrade()?, objects: self.objects.upgrade()? };
        Some((storage, &self.runtime))
    }

    /// The files that count, and are used.
    pub fn listed(&self) -> Vec<SegmentRecord> {
        self.used().values().filter(|used| used.is_listed).map(|used| used.record).collect()
    }

    /// Whether a model is in any file that is used, be it gone or not.
    pub fn knows(&self, id: ModelId) -> bool {
        self.used().values().any(|used| used.segment.contains(id.number()))
    }

    /// Forgets a file that is lost.
    pub fn lose(&self, id: SegmentId) {
        self.used().remove(&id);
    }

    /// Makes those files count that a gallery uses, and no others. Nothing, while it owes one. Blocks.
    pub fn publish(&self, gallery: &Gallery) -> Result<(), FilingError> {
        if gallery.to_be_stored().is_some() {
            return Ok(());
        }
        let files: Vec<SegmentId> = gallery.segments().filter_map(|s| s.file()).map(SegmentId::from_number).collect();
        let (new, old): (Vec<SegmentRecord>, Vec<SegmentId>) = {
            let used = self.used();
            let new = files.iter().filter_map(|id| used.get(id)).filter(|file| !file.is_listed).map(|file| file.record);
            let old = used.iter().filter(|(id, file)| file.is_listed && !files.contains(id)).map(|(id, _)| *id);
            (new.collect(), old.collect())
        };
        if !(new.is_empty() && old.is_empty()) {
            self.runtime.block_on(self.database()?.swap_segments(&new, &old))?;
        }
        let gone = self.swapped(&files);
        let (filed, forgotten) = self.settled_by(&new, &gone);
        self.runtime.block_on(self.database()?.file_models(&filed))?;
        self.runtime.block_on(self.database()?.forget_unfiled(&forgotten))?;
        for (id, _) in gone {
            self.objects()?.remove_segment(id)?;
        }
        Ok(())
    }

    /// Takes over what the database knows now; gives the files that are not used any more.
    fn swapped(&self, files: &[SegmentId]) -> Vec<(SegmentId, SegmentHandle)> {
        let mut used = self.used();
        let gone: Vec<SegmentId> = used.keys().filter(|id| !files.contains(id)).copied().collect();
        used.values_mut().for_each(|file| file.is_listed = true);
        gone.into_iter().filter_map(|id| Some((id, used.remove(&id)?.segment))).collect()
    }

    /// The models that new files tell, with the signatures they know, and those that no file tells any more. A model that two files know
    /// stays as it is: one of them is wrong.
    fn settled_by(
        &self,
        new: &[SegmentRecord],
        gone: &[(SegmentId, SegmentHandle)],
    ) -> (Vec<(ModelId, u128)>, Vec<ModelId>) {
        let used = self.used();
        let tell = |id: u128| used.values().filter(|file| file.segment.contains(id)).count();
        let new = new.iter().filter_map(|record| used.get(&record.id));
        let told = new.flat_map(|file| file.segment.descriptions());
        let filed =
            told.filter(|(id, ..)| tell(*id) == 1).map(|(id, _, sum)| (ModelId::from_number(id), sum)).collect();
        let forgotten = gone.iter().flat_map(|(_, segment)| segment.ids()).filter(|id| tell(**id) == 0);
        (filed, forgotten.copied().map(ModelId::from_number).collect())
    }

    fn used(&self) -> MutexGuard<'_, BTreeMap<SegmentId, Used>> {
        self.used.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn examine(objects: &dyn ObjectStore, record: SegmentRecord) -> Result<(), FilingError> {
    let mut file = objects.open_segment(record.id)?.ok_or(FilingError::Missing)?;
    match check(&mut file)? {
        checksum if checksum == record.checksum => Ok(()),
        _ => Err(SegmentError::Damaged("it is another file".to_owned()).into()),
    }
}

/// What is wrong with the files of the index that count, for `visage doctor`: each in a line.
pub async fn damaged_files(storage: &Storage) -> Result<Vec<String>, DatabaseError> {
    let records = storage.database.segments().await?;
    let objects = Arc::clone(&storage.objects);
    super::off_thread(move || {
        let wrong = |record: &SegmentRecord| {
            let error = examine(objects.as_ref(), *record).err()?;
            Some(format!("segments/{} ({} models): {error}", record.id, record.models))
        };
        records.iter().filter_map(wrong).collect()
    })
    .await
}
