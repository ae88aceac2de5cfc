//! An index of some parts of the gallery, where others search the rest: parts are made whole beside searches, and given up.
//!
//! Models of several parts share segments and files, as they come. What makes a part whole is what makes the index whole at a start: the
//! database knows which models no file tells (`unfiled`). A part that is not whole is not answered for, and of what happens to its models
//! only that is done which keeps the database's word true: older copies are taken out. What is given up is unfiled first, while no
//! file is written: so it stays that way, whatever becomes of the files that tell it.

use std::sync::atomic::Ordering;

use super::index::{Acquiring, Index, State};
use super::loading::Loading;
use super::{LiveGallery, Merging, NotReady, off_thread};
use crate::storage::DatabaseError;
use crate::storage::inventory::Storage;
use visage_domain::{ModelId, Parts, part_of, part_of_number};
use visage_gallery::Gallery;

impl LiveGallery {
    /// The parts that it answers for; none while it is not loaded.
    pub fn whole_parts(&self) -> Parts {
        self.with_index(|index| index.whole).unwrap_or_default()
    }

    /// The parts of which it may have any models.
    pub fn present_parts(&self) -> Parts {
        self.with_index(|index| index.present).unwrap_or_default()
    }

    fn with_index<T>(&self, look: impl FnOnce(&Index) -> T) -> Option<T> {
        match &*self.read() {
            State::Loading(_) => None,
            State::Ready(index) => Some(look(index)),
        }
    }

    /// Whether it has had all parts that it is to have.
    pub fn is_settled(&self) -> bool {
        self.is_ready() && self.shared.is_settled.load(Ordering::Acquire)
    }

    /// Says that it has all parts that it is to have.
    pub fn settle(&self) {
        self.shared.is_settled.store(true, Ordering::Release);
    }

    /// Asks the index as it is now about some parts: about those of them that it has whole, which the question is told. Takes as long as the
    /// search: call it off the async threads.
    pub fn ask_parts<T>(&self, parts: &Parts, question: impl FnOnce(&Gallery, Parts) -> T) -> Result<T, NotReady> {
        let Index { gallery, whole, present } = self.index().ok_or(NotReady)?;
        let answered = whole.common(parts);
        if present.without(&answered).is_empty() {
            return Ok(question(&gallery, answered));
        }
        Ok(question(&gallery.only(|id| answered.hold(part_of_number(id))), answered))
    }

    /// Whether a change of this model may have to be made.
    pub(super) fn wants(&self, id: ModelId) -> bool {
        let part = part_of(id);
        let is_acquired = self.changing().parts.hold(part);
        is_acquired || self.with_index(|index| index.whole.hold(part)).unwrap_or(true)
    }

    /// Makes parts whole, while those that are go on answering. False if that has to be begun anew, since the index is being loaded.
    pub async fn acquire(&self, storage: &Storage, parts: Parts) -> Result<bool, DatabaseError> {
        let _loading = self.shared.loading.lock().await;
        let Some(files) = self.files() else { return Ok(false) };
        let parts = {
            let mut changing = self.changing();
            let Some(whole) = self.with_index(|index| index.whole) else { return Ok(false) };
            let parts = parts.without(&whole);
            // what comes from now on is not in what is read, or is there twice; it is made afterwards
            *changing = Acquiring { parts, changes: Vec::new() };
            parts
        };
        let live = self.clone();
        let done = match Loading::beside(files, parts).filled(storage.database.as_ref()).await {
            Ok(loading) => off_thread(move || live.take_over(loading)).await,
            Err(error) => Err(error),
        };
        if done.is_err() {
            // whatever was to be done to their models is unfiled
            *self.changing() = Acquiring::default();
        }
        self.merge_beside();
        done
    }

    fn take_over(&self, loading: Loading) -> bool {
        let (new, catalogue, older) = loading.into_index();
        let mut changing = self.changing();
        let Acquiring { parts, changes } = std::mem::take(&mut *changing);
        let Some(mut index) = self.index().filter(|_| parts == new.whole) else { return false };
        for id in older {
            while index.gallery.remove(id.number()) {}
        }
        index.gallery.absorb(new.gallery);
        index.whole = index.whole.and(&new.whole);
        index.present = index.present.and(&new.present);
        let mut known = self.write_catalogue();
        known.append(catalogue);
        for change in changes {
            if !change.puts_into(&index) {
                known.remove(change.model().number());
            }
            change.make(&mut index);
        }
        drop(known);
        self.replace(index);
        true
    }

    /// Gives parts up. False if segments are being merged: it is for later then.
    pub async fn release(&self, storage: &Storage, parts: Parts) -> Result<bool, DatabaseError> {
        let _loading = self.shared.loading.lock().await;
        if self.shared.merging.swap(true, Ordering::AcqRel) {
            return Ok(false);
        }
        let merging = Merging(&self.shared.merging);
        storage.database.unfile_parts(&parts).await?;
        let live = self.clone();
        let released = off_thread(move || live.forget_parts(&parts)).await?;
        drop(merging);
        self.merge_beside();
        Ok(released)
    }

    fn forget_parts(&self, parts: &Parts) -> bool {
        let _changing = self.changing();
        let Some(mut index) = self.index() else { return false };
        index.gallery = index.gallery.only(|id| !parts.hold(part_of_number(id)));
        index.whole = index.whole.without(parts);
        index.present = index.present.without(parts);
        self.write_catalogue().retain(|id| !parts.hold(part_of_number(id)));
        self.replace(index);
        true
    }
}
