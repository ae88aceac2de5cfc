//! The stored signatures, searchable in memory: loaded in the background at start, then kept current.

use std::sync::{Arc, PoisonError, RwLock, RwLockReadGuard};

use super::{ModelId, Store, StoreError};
use crate::faces::Signature;
use crate::retrieval::{Catalogue, Gallery};

/// A change that came before the index was ready.
#[derive(Debug)]
enum Change {
    Insert(ModelId, Box<Signature>),
    Remove(ModelId),
}

#[derive(Debug)]
enum State {
    Loading(Vec<Change>),
    Ready(Box<Gallery>),
}

/// The index over all stored signatures. Cheap to clone; readers don't wait for each other.
#[derive(Debug, Clone)]
pub struct LiveGallery {
    state: Arc<RwLock<State>>,
    /// What filters ask of the models. Taken after `state` where both are.
    catalogue: Arc<RwLock<Catalogue>>,
}

impl Default for LiveGallery {
    fn default() -> Self {
        LiveGallery { state: Arc::new(RwLock::new(State::Loading(Vec::new()))), catalogue: Arc::default() }
    }
}

/// The index is still being loaded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the gallery is still being loaded")]
pub struct NotReady;

impl LiveGallery {
    /// Reads all signatures and builds the index. Models added or deleted meanwhile are seen afterwards.
    /// Signatures of another version are left out: their models are kept, but not found until described anew.
    pub async fn load(&self, store: &Store) -> Result<usize, StoreError> {
        let stored = store.signatures().await?;
        let gallery = tokio::task::spawn_blocking(move || build(stored)).await;
        let mut gallery = gallery.map_err(|error| super::damaged("a signature", error))?;
        let facets = store.facets().await?;
        let mut state = self.state.write().unwrap_or_else(PoisonError::into_inner);
        if let State::Loading(changes) = &mut *state {
            let mut catalogue = self.catalogue.write().unwrap_or_else(PoisonError::into_inner);
            for (id, facets) in facets {
                catalogue.insert(id.number(), facets);
            }
            for change in changes.drain(..) {
                match change {
                    Change::Insert(id, signature) => gallery.insert(id.number(), *signature),
                    Change::Remove(id) => {
                        catalogue.remove(id.number());
                        gallery.remove(id.number());
                    }
                }
            }
        }
        let models = gallery.len();
        *state = State::Ready(Box::new(gallery));
        Ok(models)
    }

    /// Whether queries can be answered.
    pub fn is_ready(&self) -> bool {
        matches!(*self.state.read().unwrap_or_else(PoisonError::into_inner), State::Ready(_))
    }

    /// Adds or replaces a model; seen by the next query.
    pub fn insert(&self, id: ModelId, signature: Signature) {
        match &mut *self.state.write().unwrap_or_else(PoisonError::into_inner) {
            State::Loading(changes) => changes.push(Change::Insert(id, Box::new(signature))),
            State::Ready(gallery) => gallery.insert(id.number(), signature),
        }
    }

    /// Adds a model that was just stored, unless it has been deleted since.
    pub async fn publish(&self, store: &Store, id: ModelId, signature: Signature) -> Result<(), StoreError> {
        let Some(model) = store.matched_models(&[id]).await?.pop() else { return Ok(()) };
        self.catalogue.write().unwrap_or_else(PoisonError::into_inner).insert(id.number(), model.facets);
        self.insert(id, signature);
        // a deletion between the reading and the insertions above has found nothing to remove
        if let Err(StoreError::NotFound { .. }) = store.model(id).await {
            self.remove(id);
        }
        Ok(())
    }

    /// Forgets a model.
    pub fn remove(&self, id: ModelId) {
        self.catalogue.write().unwrap_or_else(PoisonError::into_inner).remove(id.number());
        match &mut *self.state.write().unwrap_or_else(PoisonError::into_inner) {
            State::Loading(changes) => changes.push(Change::Remove(id)),
            State::Ready(gallery) => {
                gallery.remove(id.number());
            }
        }
    }

    /// What filters ask of the models.
    pub fn catalogue(&self) -> RwLockReadGuard<'_, Catalogue> {
        self.catalogue.read().unwrap_or_else(PoisonError::into_inner)
    }

    /// Asks the index. Takes as long as the search: call it off the async threads.
    pub fn ask<T>(&self, question: impl FnOnce(&Gallery) -> T) -> Result<T, NotReady> {
        match &*self.state.read().unwrap_or_else(PoisonError::into_inner) {
            State::Loading(_) => Err(NotReady),
            State::Ready(gallery) => Ok(question(gallery)),
        }
    }
}

fn build(stored: Vec<(ModelId, Vec<u8>)>) -> Gallery {
    let mut entries = Vec::with_capacity(stored.len());
    for (id, content) in stored {
        match Signature::from_bytes(&content) {
            Ok(signature) => entries.push((id.number(), signature)),
            Err(error) => tracing::warn!(model.id = %id, "the signature is left out of the gallery: {error}"),
        }
    }
    Gallery::build(entries)
}

#[cfg(test)]
mod tests {
    use super::super::testing;
    use super::*;

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
}
