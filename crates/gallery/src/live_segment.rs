//! A segment of the gallery and what has become of its models.

use std::sync::Arc;

use super::ModelId;
use super::gallery::YOUNG_SEGMENT;
use super::segment::{Kept, Segment};
use super::triangle_query::{TriangleQuery, score};

/// Where a segment is kept besides memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Home {
    /// Nowhere: all of its models came after the files.
    Memory,
    /// Nowhere yet, but some of its models were in a file that it takes the place of.
    Owed,
    /// In the file of this name.
    File(u128),
}

/// A segment and which of its models are still there.
#[derive(Debug, Clone)]
pub(super) struct LiveSegment {
    pub segment: Arc<Segment>,
    pub home: Home,
    alive: Arc<Vec<u64>>,
    pub models: usize,
}

impl LiveSegment {
    pub fn new(segment: Segment) -> LiveSegment {
        LiveSegment::at(Arc::new(segment), Home::Memory)
    }

    pub fn at(segment: Arc<Segment>, home: Home) -> LiveSegment {
        let models = segment.ids.len();
        LiveSegment { segment, home, alive: Arc::new(vec![u64::MAX; models.div_ceil(64)]), models }
    }

    /// The same models in another place.
    pub fn moved(&self, segment: Arc<Segment>, home: Home) -> LiveSegment {
        LiveSegment { segment, home, ..self.clone() }
    }

    /// Whether the next addition may take its place.
    pub fn is_young(&self) -> bool {
        self.models < YOUNG_SEGMENT && self.home == Home::Memory
    }

    pub fn is_alive(&self, place: u32) -> bool {
        self.alive[place as usize / 64] >> (place % 64) & 1 == 1
    }

    /// Marks a model as gone; true if it was there.
    pub fn forget(&mut self, id: ModelId) -> bool {
        let Some(place) = self.segment.place(id).filter(|place| self.is_alive(*place)) else { return false };
        Arc::make_mut(&mut self.alive)[place as usize / 64] &= !(1 << (place % 64));
        self.models -= 1;
        true
    }

    /// The same without the models that `keeps` does not want.
    pub fn only(&self, keeps: &impl Fn(ModelId) -> bool) -> LiveSegment {
        let mut alive = vec![0; self.alive.len()];
        let mut models = 0;
        for place in self.places().filter(|place| keeps(self.segment.ids[*place as usize])) {
            alive[place as usize / 64] |= 1 << (place % 64);
            models += 1;
        }
        LiveSegment { alive: Arc::new(alive), models, ..self.clone() }
    }

    /// The places whose models are there, ascending.
    pub fn places(&self) -> impl Iterator<Item = u32> + '_ {
        (0..self.segment.ids.len() as u32).filter(|place| self.is_alive(*place))
    }

    /// What goes into another segment.
    pub fn kept(&self) -> Kept<'_> {
        Kept { segment: &self.segment, places: self.places().collect() }
    }

    /// A model's id and the score of one of its triangles; `None` if the model is gone.
    pub fn score(&self, query: &TriangleQuery, place: u32, number: u16) -> Option<(ModelId, f64)> {
        let id = *self.segment.ids.get(place as usize)?;
        let triangle = self.is_alive(place).then(|| self.segment.outlines.outline(place).triangle(number))??;
        Some((id, score(query.chord(&triangle.shape))))
    }
}
