//! One model made ready for a segment: what costs time is done here, once.

use bytemuck::{Pod, Zeroable};

use super::{Facets, Match, MatchMethod, ModelId};
use visage_geometry::Point3;
use visage_shape::faces::{self, Signature, Verdict, standard};

/// The methods, in the order in which verdicts are kept.
pub(super) const METHODS: [MatchMethod; 3] = [MatchMethod::Descriptors, MatchMethod::Verified, MatchMethod::Literal];

/// Where verdicts by this method are kept.
pub(super) fn slot(method: MatchMethod) -> usize {
    match method {
        MatchMethod::Descriptors => 0,
        MatchMethod::Verified => 1,
        MatchMethod::Literal => 2,
    }
}

/// What is kept of a verdict: all that an answer shows.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Standing {
    pub score: f64,
    matching_error_mm: f64,
    sum_of_distances_mm: f64,
    /// NaN if there is none.
    triangle: [[f64; 3]; 3],
}

impl Standing {
    fn of(verdict: &Verdict) -> Standing {
        let triangle = verdict.triangle.map_or([[f64::NAN; 3]; 3], |corners| corners.map(|p: Point3| p.into()));
        Standing {
            score: verdict.score,
            matching_error_mm: verdict.matching_error_mm,
            sum_of_distances_mm: verdict.sum_of_distances_mm,
            triangle,
        }
    }

    /// The answer that this stands for.
    pub fn answer(&self, model_id: ModelId, threshold: f64) -> Match {
        Match {
            model_id,
            score: self.score,
            matching_error_mm: self.matching_error_mm,
            sum_of_distances_mm: self.sum_of_distances_mm,
            is_match: self.score >= threshold,
            triangle: Some(self.triangle).filter(|corners| !corners[0][0].is_nan()),
        }
    }
}

/// A signature with its verdicts.
#[derive(Debug, Clone)]
pub struct IndexedModel {
    pub(super) id: ModelId,
    pub(super) signature: Signature,
    pub(super) standings: [Standing; 3],
    pub(super) facets: Facets,
    pub(super) revision: u128,
}

impl IndexedModel {
    /// Judges a signature against the built-in standard by every method.
    pub fn new(id: ModelId, signature: Signature) -> IndexedModel {
        let face = standard::face();
        let standings = METHODS.map(|method| Standing::of(&faces::judge(&signature, &face, method)));
        IndexedModel { id, signature, standings, facets: Facets::default(), revision: 0 }
    }

    /// The same with what filters ask, and with a number that tells this signature from others of the model.
    #[must_use]
    pub fn described_by(self, facets: Facets, revision: u128) -> IndexedModel {
        IndexedModel { facets, revision, ..self }
    }

    /// The model.
    pub fn id(&self) -> ModelId {
        self.id
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_shape::faces::signature::example::example;

    #[test]
    fn a_standing_answers_as_its_verdict() {
        for regions in [2, 6] {
            let signature = example(0.4, regions);
            let entry = IndexedModel::new(7, signature.clone());
            for method in METHODS {
                let verdict = faces::judge(&signature, &standard::face(), method);
                assert_eq!(entry.standings[slot(method)].answer(7, 0.5), Match::of(7, &verdict, 0.5));
            }
        }
    }
}
