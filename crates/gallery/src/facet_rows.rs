//! What filters ask of a list of models, packed.

use super::catalogue::{Facets, Source};
use super::column::Column;
use super::columns::stored;
use visage_geometry::Unit;

/// Units by the number that is kept; only ever added to.
const UNITS: [Unit; 5] = [Unit::Unknown, Unit::Mm, Unit::Cm, Unit::M, Unit::In];
/// The same of ways into the gallery.
const SOURCES: [Source; 2] = [Source::Uploaded, Source::Registered];
/// The bit that tells a model with a label from one without, which an empty label is not.
const LABELED: u8 = 0x80;

/// The facets of a list of models.
#[derive(Debug, Default)]
pub(super) struct FacetRows {
    /// Number of the unit, number of the source and [`LABELED`].
    kinds: Column<[u8; 2]>,
    /// Where each model's label ends.
    ends: Column<u32>,
    labels: Column<u8>,
}

stored!(FacetRows { kinds, ends, labels });

impl FacetRows {
    /// Adds a model's.
    pub fn push(&mut self, facets: &Facets) {
        let number = |place: Option<usize>| place.unwrap_or(0) as u8;
        let source = number(SOURCES.iter().position(|source| *source == facets.source));
        let labeled = if facets.label.is_some() { LABELED } else { 0 };
        self.kinds.push([number(UNITS.iter().position(|unit| *unit == facets.unit)), source | labeled]);
        self.labels.extend(facets.label.iter().flat_map(|label| label.bytes()));
        self.ends.push(self.labels.len() as u32);
    }

    /// Adds one from another list.
    pub fn push_from(&mut self, others: &FacetRows, place: u32) {
        self.push(&others.facets(place));
    }

    /// Gives back what was reserved but not used.
    pub fn shrink(&mut self) {
        self.kinds.shrink();
        self.ends.shrink();
        self.labels.shrink();
    }

    /// A model's.
    pub fn facets(&self, place: u32) -> Facets {
        let place = place as usize;
        let ([unit, kind], end) = (self.kinds[place], self.ends[place]);
        let start = place.checked_sub(1).map_or(0, |before| self.ends[before]);
        let label = String::from_utf8_lossy(&self.labels[start as usize..end as usize]);
        Facets {
            label: (kind & LABELED != 0).then(|| label.into()),
            unit: UNITS.get(usize::from(unit)).copied().unwrap_or_default(),
            source: SOURCES.get(usize::from(kind & !LABELED)).copied().unwrap_or_default(),
        }
    }

    /// Whether there is one for each of so many models.
    pub fn are_of(&self, models: usize) -> bool {
        let last = self.ends.last().map_or(0, |end| *end as usize);
        (self.kinds.len(), self.ends.len()) == (models, models) && self.ends.is_sorted() && last == self.labels.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn facets_come_back_also_from_another_list() {
        let facets = |label: Option<&str>, unit, source| Facets { label: label.map(Box::from), unit, source };
        let all = [
            facets(Some("face/ann"), Unit::Mm, Source::Uploaded),
            facets(None, Unit::Unknown, Source::Registered),
            facets(Some(""), Unit::In, Source::Registered),
            facets(Some("Büste"), Unit::M, Source::Uploaded),
            facets(None, Unit::Cm, Source::Uploaded),
        ];
        let (mut rows, mut others) = (FacetRows::default(), FacetRows::default());
        all.iter().for_each(|facets| rows.push(facets));
        [3, 0, 2].into_iter().for_each(|place| others.push_from(&rows, place));
        assert!(rows.are_of(5) && others.are_of(3));
        assert!((0..5).all(|place| rows.facets(place) == all[place as usize]));
        assert_eq!([0, 1, 2].map(|place| others.facets(place)), [3, 0, 2].map(|place: usize| all[place].clone()));
    }
}
