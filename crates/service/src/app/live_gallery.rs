//! The stored signatures, searchable in memory: loaded in the background at start, then kept current.
//!
//! A search takes the gallery as it is and works on that; a change makes the next one and puts it in its place. So
//! nobody waits for anybody but changes for each other.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};

use rayon::prelude::*;

use crate::storage::{Database, DatabaseError};
use visage_domain::asset::Origin;
use visage_domain::{ModelFacets, ModelId, StoredContent};
use visage_gallery::gallery::FULL_SEGMENT;
use visage_gallery::{Catalogue, Facets, Gallery, IndexedModel, Source};
use visage_shape::faces::Signature;

/// Signatures that are read at once.
const PAGE: usize = 4096;

/// A change that came before the index was ready.
#[derive(Debug)]
enum Change {
    Put(Box<IndexedModel>),
    Remove(ModelId),
}

impl Change {
    fn make(&self, gallery: &mut Gallery) {
        match self {
            Change::Put(entry) => gallery.put(entry),
            Change::Remove(id) => {
                gallery.remove(id.number());
            }
        }
    }
}

#[derive(Debug)]
enum State {
    Loading(Vec<Change>),
    Ready(Gallery),
}

#[derive(Debug)]
struct Shared {
    /// Held for moments only.
    state: RwLock<State>,
    /// Held by whoever makes the next gallery.
    changing: Mutex<()>,
    /// What filters ask of the models.
    catalogue: RwLock<Catalogue>,
    /// Whether a thread merges segments.
    merging: AtomicBool,
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
                changing: Mutex::new(()),
                catalogue: RwLock::default(),
                merging: AtomicBool::new(false),
            }),
        }
    }
}

/// The index is still being loaded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the gallery is still being loaded")]
pub struct NotReady;

impl LiveGallery {
    /// Reads all signatures, page by page, and builds the index. Models added or deleted meanwhile are seen
    /// afterwards. Signatures of another version and damaged ones are left out: their models are kept, but not found
    /// until described anew.
    pub async fn load(&self, database: &dyn Database) -> Result<usize, DatabaseError> {
        let mut loading = Loading::default();
        let mut page = database.signatures_after(None, PAGE).await?;
        while let Some((last, _)) = page.last() {
            let next = database.signatures_after(Some(*last), PAGE);
            let (next, taken) = tokio::join!(next, off_thread(move || loading.taking(page)));
            (page, loading) = (next?, taken?);
            tracing::debug!(models = loading.models(), "the gallery is being loaded");
        }
        database.give_up_signatures(&loading.damaged).await?;
        let facets = database.facets().await?;
        let live = self.clone();
        off_thread(move || live.open(loading.finished(), facets)).await
    }

    /// Brings the loaded gallery up to date and answers queries from then on; gives the number of models.
    fn open(&self, mut gallery: Gallery, facets: Vec<(ModelId, ModelFacets)>) -> usize {
        {
            let mut catalogue = self.write_catalogue();
            for (id, facets) in facets {
                catalogue.insert(id.number(), facets_of(&facets));
            }
        }
        loop {
            let mut state = self.write();
            let changes = match &mut *state {
                State::Loading(changes) => std::mem::take(changes),
                State::Ready(_) => Vec::new(),
            };
            if changes.is_empty() {
                let models = gallery.len();
                *state = State::Ready(gallery);
                return models;
            }
            // more may come while these are made
            drop(state);
            for change in &changes {
                if let Change::Remove(id) = change {
                    self.write_catalogue().remove(id.number());
                }
                change.make(&mut gallery);
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

    /// Adds a model that was just stored, unless it has been deleted since.
    pub async fn publish(
        &self,
        database: &dyn Database,
        id: ModelId,
        signature: Signature,
    ) -> Result<(), DatabaseError> {
        let Some(model) = database.matched_models(&[id]).await?.pop() else { return Ok(()) };
        self.write_catalogue().insert(id.number(), facets_of(&model.facets));
        self.insert(id, signature);
        // a deletion between the reading and the insertions above has found nothing to remove
        if let Err(DatabaseError::NotFound { .. }) = database.model(id).await {
            self.remove(id);
        }
        Ok(())
    }

    /// Forgets a model.
    pub fn remove(&self, id: ModelId) {
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
        match &*self.read() {
            State::Loading(_) => None,
            State::Ready(gallery) => Some(gallery.clone()),
        }
    }

    fn change(&self, change: Change) {
        let changing = self.changing();
        let Some(mut gallery) = self.gallery() else {
            let mut state = self.write();
            match &mut *state {
                State::Loading(changes) => changes.push(change),
                // loaded between the two looks
                State::Ready(gallery) => change.make(gallery),
            }
            return;
        };
        change.make(&mut gallery);
        let is_due = gallery.due().is_some();
        self.replace(gallery);
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
            if let Ok(pool) = rayon::ThreadPoolBuilder::new().num_threads(1).build() {
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
        while let Some(merge) = self.gallery().and_then(|gallery| gallery.due()) {
            let merged = merge.run();
            let _changing = self.changing();
            if let Some(mut gallery) = self.gallery() {
                gallery.adopt(merged);
                self.replace(gallery);
            }
        }
    }

    /// The gallery before is dropped after the lock is.
    fn replace(&self, gallery: Gallery) {
        let before = std::mem::replace(&mut *self.write(), State::Ready(gallery));
        drop(before);
    }

    fn read(&self) -> RwLockReadGuard<'_, State> {
        self.shared.state.read().unwrap_or_else(PoisonError::into_inner)
    }

    fn write(&self) -> RwLockWriteGuard<'_, State> {
        self.shared.state.write().unwrap_or_else(PoisonError::into_inner)
    }

    fn changing(&self) -> MutexGuard<'_, ()> {
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

/// A gallery that grows by full segments.
#[derive(Debug, Default)]
struct Loading {
    gallery: Gallery,
    waiting: Vec<IndexedModel>,
    damaged: Vec<ModelId>,
}

impl Loading {
    fn models(&self) -> usize {
        self.gallery.len() + self.waiting.len()
    }

    fn taking(mut self, page: Vec<(ModelId, StoredContent)>) -> Loading {
        let damaged = page.iter().filter(|(_, content)| *content == StoredContent::Damaged).map(|(id, _)| *id);
        self.damaged.extend(damaged);
        let entries: Vec<Option<IndexedModel>> =
            page.into_par_iter().map(|(id, content)| entry(id, &content)).collect();
        self.waiting.extend(entries.into_iter().flatten());
        if self.waiting.len() >= FULL_SEGMENT {
            self.append();
            tracing::info!(models = self.models(), "the gallery is being loaded");
        }
        self
    }

    fn append(&mut self) {
        self.gallery.append(&self.waiting);
        self.waiting = Vec::new();
    }

    fn finished(mut self) -> Gallery {
        self.append();
        self.gallery
    }
}

fn entry(id: ModelId, content: &StoredContent) -> Option<IndexedModel> {
    let StoredContent::Whole(content) = content else {
        tracing::error!(model.id = %id, "the stored signature is damaged: it is to be made anew");
        return None;
    };
    match Signature::from_bytes(content) {
        Ok(signature) => Some(IndexedModel::new(id.number(), signature)),
        Err(error) => {
            tracing::warn!(model.id = %id, "the signature is left out of the gallery: {error}");
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::storage::database::Models;
    use crate::storage::sqlite::testing;
    use visage_domain::{NewModel, StoredSignature};
    use visage_gallery::TopK;
    use visage_shape::faces::signature::example::example;

    #[tokio::test]
    async fn it_is_ready_only_when_loaded() {
        let (store, _folder) = testing::store().await;
        let gallery = LiveGallery::default();
        assert_eq!(gallery.ask(Gallery::len), Err(NotReady));
        // deleting a model nobody knows is no trouble, before or after
        gallery.remove(ModelId::new());
        assert_eq!(gallery.load(&store).await.expect("loaded"), 0);
        assert!(gallery.is_ready());
        gallery.remove(ModelId::new());
        assert_eq!(gallery.ask(Gallery::len), Ok(0));
    }

    /// Models whose signature is stored.
    fn models(count: usize) -> Vec<NewModel> {
        let signature = example(0.3, 5);
        let stored = StoredSignature::from(&signature);
        (0..count).map(|_| NewModel { signature: Some(stored.clone()), ..NewModel::example(None) }).collect()
    }

    #[tokio::test]
    async fn all_pages_are_loaded_and_changes_meanwhile_are_not_lost() {
        let (store, _folder) = testing::store().await;
        let models = models(PAGE + 10);
        store.create_models(&models).await.expect("stored");
        let gallery = LiveGallery::default();
        let (late, gone) = (ModelId::new(), models[17].id);
        gallery.insert(late, example(0.9, 6));
        gallery.remove(gone);
        assert_eq!(gallery.load(&store).await.expect("loaded"), models.len());
        let best = gallery.ask(|g| g.by_probe(&example(0.9, 6), None, &TopK::best(1))).expect("ready");
        assert_eq!(best[0].model_id, late.number());
        let all = gallery.ask(|g| g.by_probe(&example(0.3, 5), None, &TopK::best(5000))).expect("ready");
        assert!(all.iter().all(|found| found.model_id != gone.number()));
    }

    #[tokio::test]
    async fn additions_are_seen_at_once_while_segments_are_merged() {
        let (store, _folder) = testing::store().await;
        let gallery = LiveGallery::default();
        gallery.load(&store).await.expect("loaded");
        for count in 1..600 {
            gallery.insert(ModelId::new(), example(0.01 * count as f64, 3));
            assert_eq!(gallery.ask(Gallery::len), Ok(count));
        }
    }
}
