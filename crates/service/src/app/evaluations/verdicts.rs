//! A standard's scores against the label that its class has.

use std::collections::BTreeMap;

use super::{Labels, VerdictFigures};
use crate::app::live_gallery::{LiveGallery, NotReady};
use visage_gallery::measures::{self, RocPoint};
use visage_gallery::{MatchMethod, ModelId, TopK};

/// Of each class at least so many, or there is nothing to tell apart.
const LEAST_MODELS: usize = 2;
const CONFIDENCE: f64 = 0.95;
const RESAMPLES: usize = 1000;
const SEED: u64 = 1;

/// The scores of the labelled models that are in the index.
pub fn scores(
    gallery: &LiveGallery,
    standard: &str,
    method: MatchMethod,
    labels: &Labels,
) -> Result<BTreeMap<ModelId, f64>, NotReady> {
    let is_labeled = |id: ModelId| labels.contains_key(&id);
    let top_k = TopK { accepts: &is_labeled, ..TopK::best(labels.len()) };
    let ranked = gallery.ask(|index| index.by_standard(standard, method, &top_k).unwrap_or_default())?;
    Ok(ranked.into_iter().map(|found| (found.model_id, found.score)).collect())
}

/// The figures; `None` if either class has too few models.
pub fn evaluate(positive: &str, scores: &BTreeMap<ModelId, f64>, labels: &Labels) -> Option<VerdictFigures> {
    let of_class = |top_k: bool| -> Vec<f64> {
        let models = labels.iter().filter(|(_, label)| (label.as_ref() == positive) == top_k);
        models.filter_map(|(id, _)| scores.get(id).copied()).collect()
    };
    let (positives, negatives) = (of_class(true), of_class(false));
    if positives.len().min(negatives.len()) < LEAST_MODELS {
        return None;
    }
    let (best_threshold, best_accuracy) = measures::best_accuracy(&positives, &negatives)?;
    Some(VerdictFigures {
        label: positive.to_owned(),
        positives: positives.len(),
        negatives: negatives.len(),
        auc: measures::auc(&positives, &negatives)?,
        auc_interval: measures::auc_interval(&positives, &negatives, CONFIDENCE, RESAMPLES, SEED)?,
        equal_error_rate: measures::equal_error_rate(&positives, &negatives)?,
        best_accuracy,
        best_threshold,
        roc: corners(&measures::roc(&positives, &negatives)),
    })
}

/// The curve without the points that lie straight between their neighbours.
fn corners(curve: &[RocPoint]) -> Vec<RocPoint> {
    let place = |point: &RocPoint| (point.false_positive_rate, point.true_positive_rate);
    let mut kept: Vec<RocPoint> = Vec::new();
    let mut last = (0.0, 0.0);
    for (index, point) in curve.iter().enumerate() {
        let (x, y) = place(point);
        let straight = curve.get(index + 1).is_some_and(|next| {
            let (u, v) = place(next);
            ((x - last.0) * (v - last.1) - (u - last.0) * (y - last.1)).abs() < 1e-12
        });
        if !straight {
            last = (x, y);
            kept.push(*point);
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_are_those_of_the_measures() {
        let scores: BTreeMap<ModelId, f64> = (0..20).map(|k| (k, (k * 7 % 20) as f64 / 20.0)).collect();
        let label = |k: ModelId| if k.is_multiple_of(3) { "face" } else { "owl" };
        let labels: Labels = (0..20).map(|k| (k, label(k).into())).collect();
        let figures = evaluate("face", &scores, &labels).expect("two classes");
        assert_eq!((figures.positives, figures.negatives), (7, 13));
        assert!(figures.auc_interval[0] <= figures.auc && figures.auc <= figures.auc_interval[1]);
        let end = figures.roc.last().expect("a curve");
        assert_eq!((end.true_positive_rate, end.false_positive_rate), (1.0, 1.0));
        let (mut area, mut last) = (0.0, (0.0, 0.0));
        for point in &figures.roc {
            let next = (point.false_positive_rate, point.true_positive_rate);
            area += (next.0 - last.0) * 0.5 * (next.1 + last.1);
            last = next;
        }
        assert!((area - figures.auc).abs() < 1e-12, "the corners hold the area");
        let alone: Labels = [(0, "face".into()), (1, "owl".into()), (2, "owl".into())].into();
        assert!(evaluate("face", &scores, &alone).is_none());
    }
}
