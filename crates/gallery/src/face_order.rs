//! The models of a segment that have dense signatures, surest faces first, with all that rules out distances without
//! reading the signatures.

use std::ops::Range;

use super::column::Column;
use super::columns::stored;
use super::dense_rows::{DenseProbe, DenseRows};
use super::partial_distance::{PartialDistances, PartialProbe};
use super::pca_code::{GistProbe, PcaCodes};
use super::trimmed_lower_bound::Reach;
use visage_shape::faces::dense_signature::DenseSignature;

/// A model is known here by its number, counted from the surest face.
#[derive(Debug, Default)]
pub(super) struct FaceOrder {
    /// Where each is.
    pub places: Column<u32>,
    /// Where the models without a dense signature are, surest face first.
    pub others: Column<u32>,
    pca_codes: PcaCodes,
    partial_distance: PartialDistances,
}

stored!(FaceOrder { places, others, pca_codes, partial_distance });

/// A probe held against them.
pub(super) struct FaceProbe<'a> {
    pca_codes: Option<GistProbe<'a>>,
    partial_distance: Option<PartialProbe<'a>>,
}

/// A distance to be ruled out, as each bound needs it.
pub(super) struct Bound {
    limits: Vec<u32>,
    partial_distance: Reach,
    pub rows: Reach,
}

impl FaceOrder {
    /// Of all models of a segment, given in the order of how surely they are faces. Runs inside the caller's rayon pool.
    pub fn of(rows: &DenseRows, ranking: &[u32]) -> FaceOrder {
        let (others, places): (Vec<u32>, Vec<u32>) = ranking.iter().partition(|place| rows.is_missing(**place));
        FaceOrder {
            pca_codes: PcaCodes::of(rows, &places),
            partial_distance: PartialDistances::of(rows, &places),
            places: places.into(),
            others: others.into(),
        }
    }

    /// Whether it is one of so many models.
    pub fn is_of(&self, models: usize) -> bool {
        let signatures = self.places.len();
        signatures + self.others.len() == models
            && self.places.iter().chain(&*self.others).all(|place| (*place as usize) < models)
            && self.pca_codes.are_of(signatures)
            && self.partial_distance.are_of(signatures)
    }

    /// A probe held against all of them.
    pub fn against(&self, probe: &DenseSignature) -> FaceProbe<'_> {
        FaceProbe { pca_codes: self.pca_codes.against(probe), partial_distance: self.partial_distance.against(probe) }
    }
}

impl FaceProbe<'_> {
    /// What must be exceeded to be farther than `reach_mm`.
    pub fn bound(&self, reach_mm: f64) -> Bound {
        Bound {
            limits: self.pca_codes.as_ref().map_or(Vec::new(), |pca_codes| pca_codes.limits(reach_mm)),
            partial_distance: PartialProbe::reach(reach_mm),
            rows: DenseProbe::reach(reach_mm),
        }
    }

    /// The numbers of the `count` nearest of the first ones by their PCA codes, in no order; none if there are no PCA codes.
    pub fn nearest(&self, count: usize, first: usize) -> Vec<usize> {
        self.pca_codes.as_ref().map_or(Vec::new(), |pca_codes| pca_codes.nearest(count, first))
    }

    /// The numbers in a range that are not ruled out by PCA code or partial distance, ascending.
    pub fn near(&self, range: Range<usize>, bound: &Bound, near: &mut Vec<usize>) {
        near.clear();
        match &self.pca_codes {
            Some(pca_codes) => pca_codes.within(range, &bound.limits, near),
            None => near.extend(range),
        }
        if let Some(partial_distance) = &self.partial_distance {
            partial_distance.fetch(near);
            near.retain(|number| !partial_distance.is_beyond(*number, &bound.partial_distance));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_near_is_farther_with_gaps_and_without() {
        let face = |k: u32, holed: bool| {
            let height = |point: usize| 20.0 * (0.1 * f64::from(k) * (1.0 + point as f64 / 50.0)).sin();
            let holed = |point: usize| holed && (40..60).contains(&point);
            DenseSignature::from_bytes(std::array::from_fn(|point| match holed(point) {
                true => visage_shape::faces::dense_signature::UNSEEN.cast_unsigned(),
                false => (height(point).round() as i8).cast_unsigned(),
            }))
        };
        let mut rows = DenseRows::default();
        (0..200).for_each(|k| rows.push((k % 10 != 0).then(|| face(k, k % 3 == 0)).as_ref()));
        let ranking: Vec<u32> = (0..200).map(|k| k * 77 % 200).collect();
        let list = FaceOrder::of(&rows, &ranking);
        assert_eq!((list.places.len(), list.others.len()), (180, 20));
        assert_eq!((&list.places[..2], &list.others[..2]), (&[77, 154][..], &[0, 170][..]));
        for holed in [false, true] {
            let probe = face(55, holed);
            let (faces, dense) = (list.against(&probe), DenseProbe::new(&probe));
            assert_eq!(faces.nearest(5, 180).len(), if holed { 0 } else { 5 });
            for reach_mm in [0.0, 0.5, 1.5] {
                let mut near = vec![3];
                faces.near(20..180, &faces.bound(reach_mm), &mut near);
                let is_within = |number: &usize| dense.distance_mm(&rows, list.places[*number]) <= Some(reach_mm);
                let within: Vec<usize> = (20..180).filter(is_within).collect();
                assert!(near.is_sorted() && within.iter().all(|number| near.contains(number)));
                assert!(holed || reach_mm > 1.0 || near.len() < 100, "{} are left at {reach_mm} mm", near.len());
            }
        }
    }
}
