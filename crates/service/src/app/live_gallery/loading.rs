//! How the gallery gets into memory: the files that count are mapped, and what they don't tell is made of signatures.

use rayon::prelude::*;

use super::files::{FilingError, SegmentFiles};
use super::index::Index;
use super::{facets_of, off_thread};
use crate::storage::inventory::Storage;
use crate::storage::{Database, DatabaseError, ObjectStore};
use std::sync::Arc;
use visage_domain::{ModelFacets, ModelId, Parts, SegmentId, StoredContent, Unfiled, part_of_number};
use visage_gallery::gallery::FULL_SEGMENT;
use visage_gallery::{Catalogue, Gallery, IndexedModel};
use visage_shape::faces::Signature;

/// Signatures that are read at once.
pub(super) const PAGE: usize = 4096;

/// A gallery that grows by full segments.
#[derive(Debug)]
pub(super) struct Loading {
    files: Arc<SegmentFiles>,
    gallery: Gallery,
    catalogue: Catalogue,
    /// The parts that are made whole.
    parts: Parts,
    /// The parts of which files may tell something.
    present: Parts,
    /// Beside a gallery that is searched meanwhile: the models that are made anew or are gone. Whatever that has of them is older. Files are
    /// its business.
    beside: Option<Vec<ModelId>>,
    waiting: Vec<IndexedModel>,
    damaged: Vec<ModelId>,
    /// Unfiled models that are in no file and have no signature.
    nowhere: Vec<ModelId>,
}

impl Loading {
    /// Maps the files that count. What is lost of them is unfiled from then on, and files that don't count are removed.
    pub async fn mapped(storage: &Storage, files: Arc<SegmentFiles>, parts: Parts) -> Result<Loading, DatabaseError> {
        storage.database.keep_index().await?;
        let records = storage.database.segments().await?;
        let mut loading = Loading { parts, present: Parts::ALL, ..Loading::new(files.clone()) };
        let (mapped, lost) = off_thread(move || {
            let opened: Vec<_> = records.into_par_iter().map(|record| (record.id, files.open(record))).collect();
            let (mut mapped, mut lost) = (Vec::new(), Vec::new());
            for (id, opened) in opened {
                match opened {
                    Ok(segment) => mapped.push(segment),
                    Err(error) => lost.push((id, error)),
                }
            }
            (mapped, lost)
        })
        .await?;
        let used: Vec<SegmentId> = mapped.iter().filter_map(|s| s.file()).map(SegmentId::from_number).collect();
        for segment in mapped {
            loading.catalogue.extend(segment.descriptions().map(|(id, facets, _)| (id, facets)));
            loading.gallery.attach(segment);
        }
        for (id, error) in &lost {
            told(*id, error);
        }
        loading.lose(storage.database.as_ref(), &lost.into_iter().map(|(id, _)| id).collect::<Vec<_>>()).await?;
        let objects = Arc::clone(&storage.objects);
        off_thread(move || remove_others(objects.as_ref(), &used)).await?;
        if parts != Parts::ALL {
            loading.look_through();
        }
        Ok(loading)
    }

    /// Finds out which parts files tell of, and takes out models that several of them tell: such a model is unfiled, so it is made anew when its part
    /// is made whole, but segments may be merged before, and one that becomes of two may not have a model twice.
    fn look_through(&mut self) {
        let mut told: Vec<u128> = self.gallery.segments().flat_map(|segment| segment.ids().to_vec()).collect();
        self.present = told.iter().map(|id| part_of_number(*id)).collect();
        told.par_sort_unstable();
        for double in told.windows(2).filter(|ids| ids[0] == ids[1]) {
            while self.gallery.remove(double[0]) {}
        }
    }

    /// Goes on from a gallery that has lost files.
    pub async fn without(
        storage: &Storage,
        files: Arc<SegmentFiles>,
        index: Index,
        lost: SegmentId,
    ) -> Result<Loading, DatabaseError> {
        let Index { mut gallery, whole, present } = index;
        gallery.detach(lost.number());
        files.lose(lost);
        let loading = Loading { gallery, parts: whole, present, ..Loading::new(files) };
        loading.lose(storage.database.as_ref(), &[lost]).await?;
        let objects = Arc::clone(&storage.objects);
        off_thread(move || objects.remove_segment(lost)).await?.unwrap_or_else(|error| tracing::warn!("{error}"));
        Ok(loading)
    }

    /// Makes parts whole beside a gallery that is searched meanwhile.
    pub fn beside(files: Arc<SegmentFiles>, parts: Parts) -> Loading {
        Loading { parts, present: parts, beside: Some(Vec::new()), ..Loading::new(files) }
    }

    fn new(files: Arc<SegmentFiles>) -> Loading {
        Loading {
            files,
            gallery: Gallery::default(),
            catalogue: Catalogue::default(),
            parts: Parts::NONE,
            present: Parts::NONE,
            beside: None,
            waiting: Vec::new(),
            damaged: Vec::new(),
            nowhere: Vec::new(),
        }
    }

    async fn lose(&self, database: &dyn Database, lost: &[SegmentId]) -> Result<(), DatabaseError> {
        if lost.is_empty() {
            return Ok(());
        }
        let filed = self.gallery.segments().filter(|segment| segment.file().is_some());
        let mut told: Vec<ModelId> = filed.flat_map(|s| s.ids().to_vec()).map(ModelId::from_number).collect();
        told.sort_unstable();
        database.lose_segments(lost, &told).await
    }

    /// Makes of signatures what no file tells, page by page.
    pub async fn filled(mut self, database: &dyn Database) -> Result<Loading, DatabaseError> {
        let parts = self.parts;
        let mut page = database.unfiled_after(&parts, None, PAGE).await?;
        while let Some(last) = page.last().map(|model| model.id) {
            let loading = self;
            let next = database.unfiled_after(&parts, Some(last), PAGE);
            let (next, taken) = tokio::join!(next, off_thread(move || loading.taking(page)));
            (page, self) = (next?, taken?);
            tracing::debug!(models = self.models(), "the gallery is being loaded");
        }
        database.give_up_signatures(&self.damaged).await?;
        database.forget_unfiled(&self.nowhere).await?;
        off_thread(move || self.finished()).await
    }

    /// What is searched from now on, what filters ask of it, and the models of which a gallery beside has something older.
    pub fn into_index(self) -> (Index, Catalogue, Vec<ModelId>) {
        let older = self.beside.unwrap_or_default();
        (Index { gallery: self.gallery, whole: self.parts, present: self.present }, self.catalogue, older)
    }

    fn models(&self) -> usize {
        self.gallery.len() + self.waiting.len()
    }

    fn taking(mut self, page: Vec<Unfiled>) -> Loading {
        let mut fresh = Vec::new();
        for Unfiled { id, signature } in page {
            let is_filed = self.forget(id);
            match signature {
                Some((content, facets)) => fresh.push((id, content, facets)),
                None if !is_filed => self.nowhere.push(id),
                None => {}
            }
        }
        let damaged = fresh.iter().filter(|(_, content, _)| *content == StoredContent::Damaged).map(|(id, ..)| *id);
        self.damaged.extend(damaged);
        self.catalogue.extend(fresh.iter().map(|(id, _, facets)| (id.number(), facets_of(facets))));
        let entries: Vec<Option<IndexedModel>> =
            fresh.into_par_iter().map(|(id, content, facets)| entry(id, &content, &facets)).collect();
        self.waiting.extend(entries.into_iter().flatten());
        if self.waiting.len() >= FULL_SEGMENT {
            self.append();
            tracing::info!(models = self.models(), "the gallery is being loaded");
        }
        self
    }

    /// Takes a model out of all segments; whether a file knows it.
    fn forget(&mut self, id: ModelId) -> bool {
        while self.gallery.remove(id.number()) {}
        self.catalogue.remove(id.number());
        self.beside.iter_mut().for_each(|older| older.push(id));
        self.files.knows(id)
    }

    fn append(&mut self) {
        self.gallery.append(&std::mem::take(&mut self.waiting));
        if self.beside.is_none()
            && let Err(error) = self.store()
        {
            not_stored(&error);
        }
    }

    /// Puts what has grown up into files.
    fn store(&mut self) -> Result<(), FilingError> {
        while let Some(memory) = self.gallery.to_be_stored() {
            let stored = self.files.write(&memory)?;
            self.gallery.settle(&memory, stored);
        }
        self.files.publish(&self.gallery)
    }

    fn finished(mut self) -> Loading {
        self.append();
        self
    }
}

/// Says that a file of the index is lost.
pub(super) fn told(id: SegmentId, error: &FilingError) {
    if matches!(error, FilingError::Segment(visage_gallery::SegmentError::OtherVersion)) {
        tracing::info!(segment.id = %id, "a file of the index is of another version: it is made anew from signatures");
    } else {
        tracing::error!(segment.id = %id, "a file of the index is lost: {error}; it is made anew from signatures");
    }
}

/// Says that a segment stays in memory.
pub(super) fn not_stored(error: &FilingError) {
    if !matches!(error, FilingError::Ended) {
        tracing::warn!("the index is not written to files for now, so a start takes longer: {error}");
    }
}

/// A crash may have left files that never counted, or no longer; and lost ones are of no use.
fn remove_others(objects: &dyn ObjectStore, used: &[SegmentId]) {
    let left = objects.segment_listing().map(|there| there.into_iter().filter(|id| !used.contains(id)));
    let removed = left.and_then(|mut left| left.try_for_each(|id| objects.remove_segment(id)));
    if let Err(error) = removed {
        tracing::warn!("files of the index that don't count are left: {error}");
    }
}

fn entry(id: ModelId, content: &StoredContent, facets: &ModelFacets) -> Option<IndexedModel> {
    let StoredContent::Whole(content) = content else {
        tracing::error!(model.id = %id, "the stored signature is damaged: it is to be made anew");
        return None;
    };
    match Signature::from_bytes(content) {
        Ok(signature) => {
            Some(IndexedModel::new(id.number(), signature).described_by(facets_of(facets), super::revision(content)))
        }
        Err(error) => {
            tracing::warn!(model.id = %id, "the signature is left out of the gallery: {error}");
            None
        }
    }
}
