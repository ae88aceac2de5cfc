//! Some of the gallery's models in their final form: packed, indexed, never changed.

use rayon::prelude::*;

use super::by_view::ViewRows;
use super::column::Column;
use super::columns::stored;
use super::dense_rows::DenseRows;
use super::face_order::FaceOrder;
use super::facet_rows::FacetRows;
use super::indexed_model::{self, IndexedModel, METHODS, Standing};
use super::outline::Outlines;
use super::shape_rows::ShapeRows;
use super::triangle_index::TriangleIndex;
use super::{MatchMethod, ModelId};

/// A list of models, ascending by id. A model is known here by its place in it.
#[derive(Debug, Default)]
pub(super) struct Segment {
    pub ids: Column<ModelId>,
    /// For each model a number that tells the signature that it was made of from others of the model.
    pub revisions: Column<u128>,
    pub facets: FacetRows,
    pub outlines: Outlines,
    pub triangles: TriangleIndex,
    pub standings: Column<[Standing; 3]>,
    /// How surely each is a face, apart from the other figures for searches that go over all.
    pub face_scores: Column<f64>,
    /// For each method all places, best score first, ties by id.
    pub rankings: [Column<u32>; 3],
    pub shapes: ShapeRows,
    pub views: ViewRows,
    pub dense: DenseRows,
    pub faces: FaceOrder,
}

stored!(Segment {
    ids,
    revisions,
    facets,
    outlines,
    triangles,
    standings,
    face_scores,
    rankings,
    shapes,
    views,
    dense,
    faces,
});

/// Some models of another segment, by their places.
pub(super) struct Kept<'a> {
    pub segment: &'a Segment,
    pub places: Vec<u32>,
}

/// Where a model that goes into a segment is now.
enum Source<'a> {
    Kept(&'a Segment, u32),
    Fresh(&'a IndexedModel),
}

impl Segment {
    /// A segment of what is kept of others and of fresh models. No id may come twice. Runs inside the caller's rayon pool.
    pub fn build(kept: &[Kept], fresh: &[IndexedModel]) -> Segment {
        let old =
            kept.iter().flat_map(|k| k.places.iter().map(|&p| (k.segment.ids[p as usize], Source::Kept(k.segment, p))));
        let new = fresh.iter().map(|entry| (entry.id, Source::Fresh(entry)));
        let mut sources: Vec<(ModelId, Source)> = old.chain(new).collect();
        sources.sort_by_key(|(id, _)| *id);
        let mut segment = Segment::default();
        for (id, source) in sources {
            segment.push(id, source);
        }
        segment.finish()
    }

    fn push(&mut self, id: ModelId, source: Source) {
        self.ids.push(id);
        match source {
            Source::Kept(other, place) => {
                self.revisions.push(other.revisions[place as usize]);
                self.facets.push_from(&other.facets, place);
                self.outlines.push_from(&other.outlines, place);
                self.standings.push(other.standings[place as usize]);
                self.shapes.push_from(&other.shapes, place);
                self.views.push_from(&other.views, place);
                self.dense.push_from(&other.dense, place);
            }
            Source::Fresh(entry) => {
                self.revisions.push(entry.revision);
                self.facets.push(&entry.facets);
                self.outlines.push(&entry.signature);
                self.standings.push(entry.standings);
                self.shapes.push(entry.signature.shape());
                self.views.push(entry.signature.views());
                self.dense.push(entry.signature.dense());
            }
        }
    }

    /// Indexes what was pushed.
    fn finish(mut self) -> Segment {
        self.ids.shrink();
        self.revisions.shrink();
        self.facets.shrink();
        self.outlines.shrink();
        self.standings.shrink();
        self.shapes.finish();
        self.views.shrink();
        self.dense.shrink();
        let verified = indexed_model::slot(MatchMethod::Verified);
        self.face_scores = self.standings.iter().map(|standings| standings[verified].score).collect();
        self.rankings = [0, 1, 2].map(|slot| self.ranked(slot).into());
        self.faces = FaceOrder::of(&self.dense, &self.rankings[verified]);
        let shapes: Vec<Vec<_>> = (0..self.outlines.len() as u32)
            .into_par_iter()
            .map(|place| self.outlines.outline(place).triangles().map(|(number, t)| (place, number, t.shape)).collect())
            .collect();
        self.triangles = TriangleIndex::build(shapes.into_iter().flatten());
        self
    }

    fn ranked(&self, slot: usize) -> Vec<u32> {
        debug_assert!(slot < METHODS.len());
        let mut places: Vec<u32> = (0..self.ids.len() as u32).collect();
        let score = |place: u32| self.standings[place as usize][slot].score;
        places.sort_by(|&a, &b| score(b).total_cmp(&score(a)).then(a.cmp(&b)));
        places
    }

    /// Where a model is.
    pub fn place(&self, id: ModelId) -> Option<u32> {
        self.ids.binary_search(&id).ok().map(|place| place as u32)
    }

    /// Whether all of its columns are about the same models, and point to what is there: nothing that is read of it then can be
    /// out of place.
    pub fn is_sound(&self) -> bool {
        let models = self.ids.len();
        let are_places = |places: &[u32]| places.len() == models && places.iter().all(|p| (*p as usize) < models);
        let counts = [self.revisions.len(), self.outlines.len(), self.standings.len(), self.face_scores.len()];
        self.ids.is_sorted_by(|a, b| a < b)
            && counts == [models; 4]
            && self.facets.are_of(models)
            && self.outlines.is_sound()
            && self.triangles.is_sound()
            && self.rankings.iter().all(|ranking| are_places(ranking))
            && self.shapes.are_of(models)
            && self.views.are_of(models)
            && self.dense.are_of(models)
            && self.faces.is_of(models)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_shape::faces::signature::example::example;

    #[test]
    fn models_moved_to_another_segment_are_as_if_built_there() {
        let entry = |k: u128| IndexedModel::new(k, example(0.37 * k as f64, 3 + (k % 7) as usize));
        let (first, second): (Vec<IndexedModel>, Vec<IndexedModel>) =
            ((0..40).map(entry).collect(), (40..60).map(entry).collect());
        let built = |entries: &[IndexedModel]| Segment::build(&[], entries);
        let (first, second) = (built(&first), built(&second));
        let kept =
            [Kept { segment: &second, places: vec![1, 3, 17] }, Kept { segment: &first, places: (5..30).collect() }];
        let moved = Segment::build(&kept, &[entry(100), entry(2)]);
        let ids: Vec<u128> = [2].into_iter().chain(5..30).chain([41, 43, 57, 100]).collect();
        assert_eq!(*moved.ids, ids);
        assert!(moved.is_sound());
        let anew = built(&ids.iter().map(|&id| entry(id)).collect::<Vec<_>>());
        assert_eq!(moved.rankings, anew.rankings);
        assert_eq!(moved.triangles.len(), anew.triangles.len());
        for place in 0..ids.len() as u32 {
            assert_eq!(moved.place(ids[place as usize]), Some(place));
            assert!(moved.outlines.outline(place).triangles().eq(anew.outlines.outline(place).triangles()));
            assert_eq!(moved.dense.signature(place), anew.dense.signature(place));
            assert_eq!(moved.shapes.shape(place), anew.shapes.shape(place));
        }
        assert_eq!(moved.place(42), None);
    }
}
