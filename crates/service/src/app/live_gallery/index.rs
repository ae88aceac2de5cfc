//! What is searched, and what becomes of it.

use visage_domain::{ModelId, Parts, part_of};
use visage_gallery::{Gallery, IndexedModel};

/// What becomes of a model.
#[derive(Debug)]
pub(super) enum Change {
    Put(Box<IndexedModel>),
    Remove(ModelId),
    /// Something, but its part is not whole: whatever there is of it is older.
    Outdate(ModelId),
}

impl Change {
    pub fn model(&self) -> ModelId {
        match self {
            Change::Put(entry) => ModelId::from_number(entry.id()),
            Change::Remove(id) | Change::Outdate(id) => *id,
        }
    }

    /// Whether the model is to be there afterwards.
    pub fn puts_into(&self, index: &Index) -> bool {
        matches!(self, Change::Put(_)) && index.whole.hold(part_of(self.model()))
    }

    /// Of a part that is not whole nothing is kept current: what there may be of the model is older.
    pub fn make(&self, index: &mut Index) {
        match self {
            Change::Put(entry) if self.puts_into(index) => index.gallery.put(entry),
            _ => {
                index.gallery.remove(self.model().number());
            }
        }
    }
}

/// What is searched.
#[derive(Debug, Clone)]
pub(super) struct Index {
    pub gallery: Gallery,
    /// The parts of which it has every model, as it is now: all of them, unless others search the rest.
    pub whole: Parts,
    /// The parts of which it may have any models.
    pub present: Parts,
}

#[derive(Debug)]
pub(super) enum State {
    Loading(Vec<Change>),
    Ready(Index),
}

/// Parts that are being made whole, and what happens to their models meanwhile.
#[derive(Debug, Default)]
pub(super) struct Acquiring {
    pub parts: Parts,
    pub changes: Vec<Change>,
}

impl Acquiring {
    /// Keeps a change of one of these models until they are there. What was only outdated by it has been read anew since.
    pub fn keep(&mut self, change: Change) {
        if !matches!(change, Change::Outdate(_)) {
            self.changes.push(change);
        }
    }
}
