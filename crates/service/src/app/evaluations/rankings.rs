//! Each labelled model as a probe: does its ranking bring its own class to the front?

use std::collections::BTreeMap;

use super::{ClassRankings, EvaluationError, Labels, Rankings, off_thread};
use crate::app::live_gallery::{LiveGallery, NotReady};
use crate::storage::Database;
use visage_gallery::measures::RankingMeasures;
use visage_gallery::{ModelId, TopK};
use visage_shape::faces::Signature;

/// No more models than this are asked about, spread evenly over all.
const MOST_PROBES: usize = 500;
/// Labels with figures of their own.
const MOST_CLASSES: usize = 100;

/// The figures; `None` if no two models share a label. Others can use the gallery between two probes, and when the
/// request is dropped no further one is asked about.
pub async fn evaluate(
    database: &dyn Database,
    gallery: &LiveGallery,
    labels: &Labels,
) -> Result<Option<Rankings>, EvaluationError> {
    let labels = std::sync::Arc::new(labels.clone());
    let mut by_class: BTreeMap<Box<str>, Vec<RankingMeasures>> = BTreeMap::new();
    for probe in probes(&labels) {
        let id = visage_domain::ModelId::from_number(probe);
        let content = database.signature(id).await?;
        // a model that was deleted in the meantime
        let Some(signature) = content.and_then(|content| Signature::from_bytes(&content).ok()) else { continue };
        let (gallery, everyone) = (gallery.clone(), labels.clone());
        let measures = off_thread(move || measures(&gallery, probe, &signature, &everyone)).await??;
        if let (Some(measures), Some(label)) = (measures, labels.get(&probe)) {
            by_class.entry(label.clone()).or_default().push(measures);
        }
    }
    let all: Vec<RankingMeasures> = by_class.values().flatten().copied().collect();
    let Some(mean) = RankingMeasures::mean(&all) else { return Ok(None) };
    let class = |(label, measures): (Box<str>, Vec<RankingMeasures>)| {
        Some(ClassRankings { label, probes: measures.len(), mean: RankingMeasures::mean(&measures)? })
    };
    let classes = by_class.into_iter().filter_map(class).take(MOST_CLASSES).collect();
    Ok(Some(Rankings { probes: all.len(), mean, classes }))
}

/// The models that share their label with another, or an even choice of them.
fn probes(labels: &Labels) -> Vec<ModelId> {
    let mut members: BTreeMap<&str, usize> = BTreeMap::new();
    for label in labels.values() {
        *members.entry(label).or_default() += 1;
    }
    let shared = labels.iter().filter(|(_, label)| members.get(label.as_ref()).is_some_and(|count| *count > 1));
    let shared: Vec<ModelId> = shared.map(|(id, _)| *id).collect();
    let count = shared.len().min(MOST_PROBES);
    (0..count).map(|index| shared[index * shared.len() / count]).collect()
}

/// Measures the ranking of all other labelled models; those that have nothing in common with the probe come last,
/// by id.
fn measures(
    gallery: &LiveGallery,
    probe: ModelId,
    signature: &Signature,
    labels: &Labels,
) -> Result<Option<RankingMeasures>, NotReady> {
    let is_labeled = |id: ModelId| labels.contains_key(&id);
    let top_k = TopK { accepts: &is_labeled, ..TopK::best(labels.len()) };
    let found = gallery.ask(|index| index.by_probe(signature, Some(probe), &top_k))?;
    let mut ranking: Vec<ModelId> = found.iter().map(|found| found.model_id).collect();
    let ranked: std::collections::BTreeSet<ModelId> = ranking.iter().copied().chain([probe]).collect();
    ranking.extend(labels.keys().filter(|id| !ranked.contains(id)));
    let own = labels.get(&probe);
    let is_member: Vec<bool> = ranking.iter().map(|id| labels.get(id) == own).collect();
    Ok(RankingMeasures::of(&is_member))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_models_with_company_are_asked_about() {
        let labels: Labels = [(1, "a"), (2, "b"), (3, "a"), (4, "c")].map(|(id, label)| (id, label.into())).into();
        assert_eq!(probes(&labels), [1, 3]);
        let many: Labels = (0..1200).map(|id| (id, "a".into())).collect();
        let chosen = probes(&many);
        assert_eq!((chosen.len(), chosen[0], chosen[1], chosen[499]), (500, 0, 2, 1197));
    }
}
