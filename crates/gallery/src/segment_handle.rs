//! The gallery's segments as bytes, so that a start needs no signature: encoded once, and used as they lie in a file from then on.
//!
//! What is in a segment follows from signatures alone, so a file that is gone, damaged or of another version costs time and nothing
//! else. Which models of a segment are still there is not in its file, which never changes.

use std::io;
use std::sync::Arc;

use bytes::Bytes;

use super::columns::{self, Columns, SegmentError, SegmentImage, Stored};
use super::live_segment::{Home, LiveSegment};
use super::segment::Segment;
use super::{Facets, Gallery, ModelId};
use visage_shape::faces::Signature;

/// Counts up whenever a segment made of the same signatures would hold something else: another column, another bound, another verdict.
/// A test notices changed verdicts.
const RULES: u32 = 1;
/// What a file must have been written by to be used.
const VERSIONS: [u32; 2] = [RULES, Signature::VERSION];

/// One of a gallery's segments. Cheap to clone.
#[derive(Debug, Clone)]
pub struct SegmentHandle {
    segment: Arc<Segment>,
    home: Home,
}

impl SegmentHandle {
    pub(super) fn of(live: &LiveSegment) -> SegmentHandle {
        SegmentHandle { segment: Arc::clone(&live.segment), home: live.home }
    }

    pub(super) fn into_live(self) -> LiveSegment {
        LiveSegment::at(self.segment, self.home)
    }

    /// The segment in a file of this name that was written with this checksum of its head, which is used where it lies. Its head and
    /// whatever points to something are checked; whether all else is as it was written, [`check`] tells.
    pub fn decode(file: u128, checksum: u32, bytes: &Bytes) -> Result<SegmentHandle, SegmentError> {
        let columns = Columns::of(bytes, VERSIONS)?;
        if columns.checksum != checksum {
            return Err(columns::damaged("it is another file"));
        }
        let segment = Segment::read("", &columns)?;
        if segment.ids.len() as u64 != columns.models || !segment.is_sound() {
            return Err(columns::damaged("its columns contradict each other"));
        }
        Ok(SegmentHandle { segment: Arc::new(segment), home: Home::File(file) })
    }

    /// As it is to be written.
    pub fn encode(&self) -> SegmentImage<'_> {
        SegmentImage::of(&*self.segment, self.segment.ids.len(), VERSIONS)
    }

    /// The name of its file, if it is used from one.
    pub fn file(&self) -> Option<u128> {
        match self.home {
            Home::File(file) => Some(file),
            Home::Memory | Home::Owed => None,
        }
    }

    /// Its models by id; some of them may be gone from the gallery.
    pub fn ids(&self) -> &[ModelId] {
        &self.segment.ids
    }

    /// Whether a model is in it, be it gone or not.
    pub fn contains(&self, id: ModelId) -> bool {
        self.segment.place(id).is_some()
    }

    /// Its models with what [`IndexedModel::described_by`](super::IndexedModel::described_by) said of them.
    pub fn descriptions(&self) -> impl Iterator<Item = (ModelId, Facets, u128)> + '_ {
        let segment = &self.segment;
        let described =
            |place: usize| (segment.ids[place], segment.facets.facets(place as u32), segment.revisions[place]);
        (0..segment.ids.len()).map(described)
    }
}

/// Reads a segment's file from its beginning and holds all of it against its checksums; answers with that of its head.
pub fn check(file: &mut impl io::Read) -> Result<u32, SegmentError> {
    columns::check(file, VERSIONS)
}

impl Gallery {
    /// Its segments.
    pub fn segments(&self) -> impl Iterator<Item = SegmentHandle> + '_ {
        self.segments.iter().map(SegmentHandle::of)
    }

    /// Adds a segment; none of its models may be in the gallery.
    pub fn attach(&mut self, segment: SegmentHandle) {
        // not at the end: the last is the one that additions go to
        self.segments.insert(0, segment.into_live());
    }

    /// A segment that is large enough for a file and in none yet.
    pub fn to_be_stored(&self) -> Option<SegmentHandle> {
        let last = self.segments.len().checked_sub(1);
        let is_due = |(k, live): &(usize, &LiveSegment)| match live.home {
            Home::File(_) => false,
            Home::Owed => true,
            Home::Memory => Some(*k) != last || !live.is_young(),
        };
        self.segments.iter().enumerate().find(is_due).map(|(_, live)| SegmentHandle::of(live))
    }

    /// Puts a segment as it is in its file in the place of the same in memory; false if that is not there any more.
    pub fn settle(&mut self, memory: &SegmentHandle, stored: SegmentHandle) -> bool {
        let found = self.segments.iter_mut().find(|live| Arc::ptr_eq(&live.segment, &memory.segment));
        let Some(live) = found.filter(|_| *memory.segment.ids == *stored.segment.ids) else { return false };
        *live = live.moved(stored.segment, stored.home);
        true
    }

    /// Takes out the segment of a file with all of its models.
    pub fn detach(&mut self, file: u128) -> bool {
        let before = self.segments.len();
        self.segments.retain(|live| live.home != Home::File(file));
        self.segments.len() < before
    }
}

#[cfg(test)]
mod fuzz;
#[cfg(test)]
mod tests;
