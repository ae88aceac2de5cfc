//! What other processes commit comes into the index in memory, in the order of their commits.
//!
//! The database numbers what happens to signatures. Whoever asks something looks at the number first, and takes in what is missing before it
//! searches: so a query finds what was committed before it came, by whichever process, and nothing that was deleted before. Of a database
//! that several processes use, the index follows that way alone, also what its own process commits: two ways could overtake each other.

use std::sync::Arc;

use rayon::prelude::*;

use super::loading::PAGE;
use super::{Change, LiveGallery, State, facets_of, off_thread, revision};
use crate::storage::{Database, DatabaseError};
use visage_domain::{ModelFacets, ModelId, StoredContent, Unfiled};
use visage_gallery::IndexedModel;
use visage_shape::faces::Signature;

/// Whether the index follows the database.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Following {
    /// It holds all that was committed before, unless it is yet to be loaded.
    Followed,
    /// No other process changes the database: this one does to the index what it has committed.
    Alone,
}

/// What a change that others have committed has made of a model.
enum Became {
    Described(Box<(Signature, ModelFacets)>),
    Gone,
    /// Its part is searched by others.
    Outdated,
}

impl LiveGallery {
    /// Takes in what was committed before this call.
    pub async fn follow(&self, database: &dyn Database) -> Result<Following, DatabaseError> {
        if !self.is_ready() {
            // the loading takes in all that there is; an index that is not loaded is asked nothing
            return Ok(match database.gallery_version().await? {
                Some(_) => Following::Followed,
                None => Following::Alone,
            });
        }
        let Some(version) = database.gallery_version().await? else { return Ok(Following::Alone) };
        self.follow_to(database, version).await?;
        Ok(Following::Followed)
    }

    /// Takes in what was committed up to a version of the gallery, unless that is done. False if that can't be: it is not loaded, or the
    /// database has no such version.
    pub async fn follow_to(&self, database: &dyn Database, version: u64) -> Result<bool, DatabaseError> {
        let mut followed = Arc::clone(&self.shared.followed).lock_owned().await;
        while *followed < version && self.is_ready() {
            let Some(changes) = database.gallery_changes(*followed, PAGE).await? else {
                tracing::warn!("the gallery is too far behind the database: it is loaded again");
                self.give_up();
                break;
            };
            if changes.version <= *followed {
                break;
            }
            let live = self.clone();
            // nobody may overtake it, also when whoever wanted it has left
            let taken_in = move || {
                live.take_in(changes.models);
                *followed = changes.version;
                followed
            };
            followed = off_thread(taken_in).await?;
        }
        Ok(*followed >= version && self.is_ready())
    }

    /// Before all of it is loaded: what is committed from now on is looked at again afterwards.
    pub(super) async fn follow_from_here(&self, database: &dyn Database) -> Result<(), DatabaseError> {
        let mut followed = self.shared.followed.lock().await;
        if let Some(version) = database.gallery_version().await? {
            *followed = version;
            // what was taken in until now may be older than what is loaded
            *self.write() = State::Loading(Vec::new());
        }
        Ok(())
    }

    /// Adds a model that was just stored, unless it has been deleted since.
    pub async fn publish(
        &self,
        database: &dyn Database,
        id: ModelId,
        signature: Signature,
    ) -> Result<(), DatabaseError> {
        if self.follow(database).await? == Following::Followed {
            return Ok(());
        }
        let Some(model) = database.matched_models(&[id]).await?.pop() else { return Ok(()) };
        self.put(id, signature, &model.facets);
        // a deletion between the reading and the insertions above has found nothing to remove
        if let Err(DatabaseError::NotFound { .. }) = database.model(id).await {
            self.remove(id);
        }
        Ok(())
    }

    fn put(&self, id: ModelId, signature: Signature, facets: &ModelFacets) {
        let facets = facets_of(facets);
        self.write_catalogue().insert(id.number(), facets.clone());
        let revision = revision(&signature.to_bytes());
        let entry = IndexedModel::new(id.number(), signature).described_by(facets, revision);
        self.change(Change::Put(Box::new(entry)));
    }

    /// Forgets models that were just deleted.
    pub async fn withdraw(&self, database: &dyn Database, models: &[ModelId]) {
        match self.follow(database).await {
            Ok(Following::Followed) => {}
            Ok(Following::Alone) => models.iter().for_each(|model| self.remove(*model)),
            // they are deleted all the same, and queries follow before they answer
            Err(error) => tracing::warn!("the gallery forgets deleted models later: {error}"),
        }
    }

    fn take_in(&self, models: Vec<Unfiled>) {
        let read: Vec<_> = models
            .into_par_iter()
            .map(|Unfiled { id, signature }| {
                if !self.wants(id) {
                    return (id, Became::Outdated);
                }
                let signature = signature.and_then(|(content, facets)| match content {
                    StoredContent::Whole(content) => Some((Signature::from_bytes(&content).ok()?, facets)),
                    StoredContent::Damaged => None,
                });
                // it is gone, or waits to be made anew as after a start
                (id, signature.map_or(Became::Gone, |known| Became::Described(Box::new(known))))
            })
            .collect();
        for (id, became) in read {
            match became {
                Became::Described(known) => self.put(id, known.0, &known.1),
                Became::Gone => self.remove(id),
                Became::Outdated => self.change(Change::Outdate(id)),
            }
        }
    }
}
