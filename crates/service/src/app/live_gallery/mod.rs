//! The stored signatures, searchable: mapped from files at start, then kept current.
//!
//! Segments are in files ([`files`]), which are lent as memory; what they don't tell is made of signatures at start (`loading`). Which
//! models that is, the database knows: so a search after a start, be it after a crash, finds what it found before. Until everything is there,
//! queries are refused: every answer is exact.
//!
//! A search takes the gallery as it is and works on that; a change makes the next one and puts it in its place. So
//! nobody waits for anybody but changes for each other.

pub mod files;
mod following;
mod holding;
mod index;
mod loading;

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};

use crate::machine::workers;
use crate::storage::DatabaseError;
use crate::storage::inventory::Storage;
use files::{FilingError, SegmentFiles};
pub use following::Following;
use index::{Acquiring, Change, Index, State};
use loading::{Loading, not_stored, told};
use visage_domain::asset::Origin;
use visage_domain::{ModelFacets, ModelId, Parts, SegmentId, part_of};
use visage_gallery::{Catalogue, Facets, Gallery, IndexedModel, Source};
use visage_shape::faces::Signature;

#[derive(Debug)]
struct Shared {
    /// Held for moments only.
    state: RwLock<State>,
    /// Held by whoever makes the next gallery.
    changing: Mutex<Acquiring>,
    /// What filters ask of the models.
    catalogue: RwLock<Catalogue>,
    /// Whether a thread merges segments.
    merging: AtomicBool,
    /// Whether segments could not be put into files: then they wait for [`LiveGallery::tidy_up`].
    is_stuck: AtomicBool,
    /// Whether nothing is to be left of models that are gone.
    is_to_forget: AtomicBool,
    /// Where segments are kept, once it is loaded.
    files: RwLock<Option<Arc<SegmentFiles>>>,
    /// Held by whoever loads, all of it or what is lost.
    loading: tokio::sync::Mutex<()>,
    /// Up to which version of the database it holds all; held by whoever follows.
    followed: Arc<tokio::sync::Mutex<u64>>,
    /// Rings when what was lost could not be made anew.
    lost: tokio::sync::Notify,
    /// Whether it has had all parts that it is to have.
    is_settled: AtomicBool,
}

/// The index over all stored signatures. Cheap to clone; readers wait for nobody.
#[derive(Debug, Clone)]
pub struct LiveGallery {
    shared: Arc<Shared>,
}

impl Default for LiveGallery {
    fn default() -> Self {
        let state = RwLock::new(State::Loading(Vec::new()));
        LiveGallery {
            shared: Arc::new(Shared {
                state,
                changing: Mutex::default(),
                catalogue: RwLock::default(),
                merging: AtomicBool::new(false),
                is_stuck: AtomicBool::new(false),
                is_to_forget: AtomicBool::new(false),
                files: RwLock::default(),
                loading: tokio::sync::Mutex::default(),
                followed: Arc::default(),
                lost: tokio::sync::Notify::new(),
                is_settled: AtomicBool::new(false),
            }),
        }
    }
}

/// The index is still being loaded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the gallery is still being loaded")]
pub struct NotReady;

impl LiveGallery {
    /// Maps the files that count, makes of signatures what they don't tell, and answers from then on; gives the number of models. Models
    /// added or deleted meanwhile are seen afterwards. Signatures of another version and damaged ones are left out: their models are
    /// kept, but not found until described anew. Nothing is done if it is loaded already.
    pub async fn load(&self, storage: &Storage) -> Result<usize, DatabaseError> {
        self.load_parts(storage, Parts::ALL).await
    }

    /// The same with what files don't tell of some parts alone: only these are whole then.
    pub async fn load_parts(&self, storage: &Storage, parts: Parts) -> Result<usize, DatabaseError> {
        let _loading = self.shared.loading.lock().await;
        if let Some(gallery) = self.gallery() {
            return Ok(gallery.len());
        }
        let files = Arc::new(SegmentFiles::of(storage));
        *self.shared.files.write().unwrap_or_else(PoisonError::into_inner) = Some(files.clone());
        self.follow_from_here(storage.database.as_ref()).await?;
        let loading = Loading::mapped(storage, files, parts).await?;
        self.finish(storage, loading).await
    }

    async fn finish(&self, storage: &Storage, loading: Loading) -> Result<usize, DatabaseError> {
        let loading = loading.filled(storage.database.as_ref()).await?;
        let live = self.clone();
        off_thread(move || live.open(loading)).await
    }

    /// Reads all files of the index and holds them against their checksums. If one is damaged, nothing is answered until what it held is
    /// made anew.
    pub async fn examine(&self, storage: &Storage) -> Result<(), DatabaseError> {
        let Some(files) = self.files() else { return Ok(()) };
        for record in files.listed() {
            let (examiner, id) = (files.clone(), record.id);
            match off_thread(move || examiner.examine(record)).await? {
                Ok(()) | Err(FilingError::Ended) => {}
                // merged meanwhile
                Err(FilingError::Missing) if !files.listed().iter().any(|listed| listed.id == id) => {}
                Err(error) => {
                    told(id, &error);
                    self.do_without(storage, id).await?;
                }
            }
        }
        Ok(())
    }

    /// Answers nothing until all of it has been loaded again.
    pub fn give_up(&self) {
        let mut changing = self.changing();
        // whoever acquires parts has to begin anew
        *changing = Acquiring::default();
        if self.is_ready() {
            *self.write() = State::Loading(Vec::new());
            *self.write_catalogue() = Catalogue::default();
        }
        drop(changing);
        self.shared.lost.notify_one();
    }

    /// Waits until a part was lost and could not be made anew: then all of it has to be loaded again.
    pub async fn lost(&self) {
        self.shared.lost.notified().await;
    }

    async fn do_without(&self, storage: &Storage, lost: SegmentId) -> Result<(), DatabaseError> {
        let made = self.made_without(storage, lost).await;
        if made.is_err() {
            self.shared.lost.notify_one();
        }
        made
    }

    async fn made_without(&self, storage: &Storage, lost: SegmentId) -> Result<(), DatabaseError> {
        let _loading = self.shared.loading.lock().await;
        let Some(files) = self.files() else { return Ok(()) };
        let index = {
            let _changing = self.changing();
            let Some(index) = self.index() else { return Ok(()) };
            *self.write() = State::Loading(Vec::new());
            index
        };
        let loading = Loading::without(storage, files, index, lost).await?;
        self.finish(storage, loading).await.map(drop)
    }

    /// Puts into files what could not be put there when it was due, and writes those anew that hold something of models that are gone. To
    /// be called now and then.
    pub fn tidy_up(&self) {
        self.shared.is_stuck.store(false, Ordering::Release);
        self.shared.is_to_forget.store(true, Ordering::Release);
        self.merge_beside();
    }

    fn files(&self) -> Option<Arc<SegmentFiles>> {
        self.shared.files.read().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Brings the loaded gallery up to date and answers queries from then on; gives the number of models.
    fn open(&self, loading: Loading) -> usize {
        let (mut index, catalogue, _) = loading.into_index();
        self.write_catalogue().append(catalogue);
        loop {
            let mut state = self.write();
            let changes = match &mut *state {
                State::Loading(changes) => std::mem::take(changes),
                State::Ready(_) => Vec::new(),
            };
            if changes.is_empty() {
                let models = index.gallery.len();
                *state = State::Ready(index);
                return models;
            }
            // more may come while these are made
            drop(state);
            for change in &changes {
                if !change.puts_into(&index) {
                    self.write_catalogue().remove(change.model().number());
                }
                change.make(&mut index);
            }
        }
    }

    /// Whether queries can be answered.
    pub fn is_ready(&self) -> bool {
        matches!(*self.read(), State::Ready(_))
    }

    /// Adds or replaces a model; seen by the next query.
    pub fn insert(&self, id: ModelId, signature: Signature) {
        self.change(Change::Put(Box::new(IndexedModel::new(id.number(), signature))));
    }

    fn remove(&self, id: ModelId) {
        self.write_catalogue().remove(id.number());
        self.change(Change::Remove(id));
    }

    /// What filters ask of the models.
    pub fn catalogue(&self) -> RwLockReadGuard<'_, Catalogue> {
        self.shared.catalogue.read().unwrap_or_else(PoisonError::into_inner)
    }

    fn write_catalogue(&self) -> RwLockWriteGuard<'_, Catalogue> {
        self.shared.catalogue.write().unwrap_or_else(PoisonError::into_inner)
    }

    /// Asks the index as it is now. Takes as long as the search: call it off the async threads.
    pub fn ask<T>(&self, question: impl FnOnce(&Gallery) -> T) -> Result<T, NotReady> {
        let gallery = self.gallery().ok_or(NotReady)?;
        Ok(question(&gallery))
    }

    fn gallery(&self) -> Option<Gallery> {
        self.index().map(|index| index.gallery)
    }

    fn index(&self) -> Option<Index> {
        match &*self.read() {
            State::Loading(_) => None,
            State::Ready(index) => Some(index.clone()),
        }
    }

    fn change(&self, change: Change) {
        let mut changing = self.changing();
        if changing.parts.hold(part_of(change.model())) {
            return changing.keep(change);
        }
        let Some(mut index) = self.index() else {
            let mut state = self.write();
            match &mut *state {
                State::Loading(changes) => changes.push(change),
                // loaded between the two looks
                State::Ready(index) => change.make(index),
            }
            return;
        };
        change.make(&mut index);
        let is_due = index.gallery.due().is_some() || (!self.is_stuck() && index.gallery.to_be_stored().is_some());
        self.replace(index);
        drop(changing);
        if is_due {
            self.merge_beside();
        }
    }

    /// Merges segments on a thread of its own until nothing is due, unless one does already.
    fn merge_beside(&self) {
        if self.shared.merging.swap(true, Ordering::AcqRel) {
            return;
        }
        let live = self.clone();
        let spawned = std::thread::Builder::new().name("gallery-merge".to_owned()).spawn(move || {
            let merging = Merging(&live.shared.merging);
            // one thread: what is asked and registered meanwhile has the others
            if let Ok(pool) = workers("gallery-merge", 1) {
                pool.install(|| live.merge());
            }
            drop(merging);
        });
        if let Err(error) = spawned {
            self.shared.merging.store(false, Ordering::Release);
            tracing::warn!("the gallery can't be tidied up: {error}");
        }
    }

    fn merge(&self) {
        let files = self.files();
        self.store(files.as_deref());
        let forgets = self.shared.is_to_forget.swap(false, Ordering::AcqRel);
        let next = |gallery: Gallery| {
            gallery.due().or_else(|| gallery.due_to_forget().filter(|_| forgets && !self.is_stuck()))
        };
        while let Some(merge) = self.gallery().and_then(next) {
            // what is merged gets checksums of its own: damage must not get into it
            if let Some(files) = &files
                && let Some((id, error)) = files.first_damaged(merge.files())
            {
                told(id, &error);
                return self.do_without_beside(files, id);
            }
            let mut merged = merge.run();
            if let Some(files) = files.as_ref().filter(|_| !self.is_stuck()) {
                match files.write(&merged.segment()) {
                    Ok(stored) => merged = merged.stored_as(stored),
                    Err(error) => self.stop_storing(&error),
                }
            }
            self.update(|gallery| gallery.adopt(merged));
            self.store(files.as_deref());
        }
    }

    /// From a thread of its own.
    fn do_without_beside(&self, files: &SegmentFiles, lost: SegmentId) {
        let Some((storage, runtime)) = files.service() else { return };
        if let Err(error) = runtime.block_on(self.do_without(&storage, lost)) {
            tracing::error!("a part of the gallery can't be made anew: {error}");
        }
    }

    /// Puts segments that have grown up into files, and has the files count that are used.
    fn store(&self, files: Option<&SegmentFiles>) {
        let Some(files) = files.filter(|_| !self.is_stuck()) else { return };
        let store = || -> Result<(), FilingError> {
            while let Some(memory) = self.gallery().and_then(|gallery| gallery.to_be_stored()) {
                let stored = files.write(&memory)?;
                self.update(|gallery| gallery.settle(&memory, stored));
            }
            self.gallery().map_or(Ok(()), |gallery| files.publish(&gallery))
        };
        if let Err(error) = store() {
            self.stop_storing(&error);
        }
    }

    fn stop_storing(&self, error: &FilingError) {
        not_stored(error);
        self.shared.is_stuck.store(true, Ordering::Release);
    }

    fn is_stuck(&self) -> bool {
        self.shared.is_stuck.load(Ordering::Acquire)
    }

    /// Puts the gallery with a change in the place of the one before, if it is loaded.
    fn update(&self, change: impl FnOnce(&mut Gallery) -> bool) {
        let _changing = self.changing();
        if let Some(mut index) = self.index()
            && change(&mut index.gallery)
        {
            self.replace(index);
        }
    }

    /// The gallery before is dropped after the lock is.
    fn replace(&self, index: Index) {
        let before = std::mem::replace(&mut *self.write(), State::Ready(index));
        drop(before);
    }

    fn read(&self) -> RwLockReadGuard<'_, State> {
        self.shared.state.read().unwrap_or_else(PoisonError::into_inner)
    }

    fn write(&self) -> RwLockWriteGuard<'_, State> {
        self.shared.state.write().unwrap_or_else(PoisonError::into_inner)
    }

    fn changing(&self) -> MutexGuard<'_, Acquiring> {
        self.shared.changing.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Says that nobody merges any more, also when merging panicked.
struct Merging<'a>(&'a AtomicBool);

impl Drop for Merging<'_> {
    fn drop(&mut self) {
        self.0.store(false, Ordering::Release);
    }
}

async fn off_thread<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Result<T, DatabaseError> {
    tokio::task::spawn_blocking(work)
        .await
        .map_err(|error| DatabaseError::Damaged { what: "a signature", reason: error.to_string() })
}

/// What the catalogue keeps of a model.
fn facets_of(facets: &ModelFacets) -> Facets {
    let source = match facets.origin {
        Origin::Registered => Source::Registered,
        Origin::Uploaded => Source::Uploaded,
    };
    Facets { label: facets.label.as_deref().map(Box::from), unit: facets.unit, source }
}

/// The first half of the checksum that is stored with a signature: what tells it from others of the model.
fn revision(content: &[u8]) -> u128 {
    let first = blake3::hash(content).as_bytes().first_chunk().copied().unwrap_or_default();
    u128::from_be_bytes(first)
}

#[cfg(test)]
mod holding_tests;
#[cfg(test)]
mod tests;
