//! The models of a class that a user has made. They are judged by a job and ranked by what it stored.

use std::collections::HashMap;

use super::super::cursor;
use super::super::model_views;
use super::super::problem::Problem;
use super::super::standards::{self, Ranking};
use super::super::state::AppState;
use super::super::verdicts::VerdictView;
use super::question::{Question, unknown_standard};
use super::views::{MatchView, QueryAnswer};
use visage_domain::{MatchedModel, ModelId, StoredVerdict};
use visage_gallery::Rank;
use visage_shape::faces::judgement::MATCH_SCORE;

/// The models judged so far, best first.
pub async fn answer(state: &AppState, question: &Question, name: &str) -> Result<QueryAnswer, Problem> {
    let terms = &question.terms;
    // behind a filter, or on a later page, the wanted models may stand anywhere in the ranking
    let is_first = terms.filter.is_empty() && question.after.is_none();
    let rows = if is_first { terms.limit + 1 } else { i64::MAX as usize };
    let ranking = standards::ranking(state, name, rows).await?.ok_or_else(|| unknown_standard(name))?;
    let mut wanted = wanted(state, question, &ranking);
    let more = wanted.len() > terms.limit;
    wanted.truncate(terms.limit);
    let next_cursor =
        wanted.last().filter(|_| more).map(|last| cursor::after(&question.fingerprint, rank(&ranking, last)));
    let ids: Vec<ModelId> = wanted.iter().map(|verdict| verdict.model_id).collect();
    let models = state.context.database.matched_models(&ids).await?;
    let mut models: HashMap<ModelId, MatchedModel> = models.into_iter().map(|model| (model.id, model)).collect();
    let view = |verdict: &&StoredVerdict| {
        let model = models.remove(&verdict.model_id)?;
        let verdict = VerdictView::of_class(&ranking.standard, &ranking.learned, verdict, terms.threshold);
        Some(match_view(verdict, model))
    };
    Ok(QueryAnswer {
        matches: wanted.iter().filter_map(view).collect(),
        searched: usize::try_from(ranking.judged).unwrap_or(usize::MAX),
        pending: ranking.pending,
        next_cursor,
        verdict: None,
        explain: None,
    })
}

/// The verdicts that are asked for, and one more if there is one.
fn wanted<'a>(state: &AppState, question: &Question, ranking: &'a Ranking) -> Vec<&'a StoredVerdict> {
    let catalogue = state.context.gallery.catalogue();
    let accepts = |id| catalogue.takes(&question.terms.filter, id);
    let wanted = question.top_k(&accepts);
    let threshold = question.terms.threshold.unwrap_or(MATCH_SCORE);
    let takes = |verdict: &&StoredVerdict| {
        let Rank { score, model_id } = rank(ranking, verdict);
        wanted.takes(score, model_id, threshold)
    };
    ranking.verdicts.iter().filter(takes).take(wanted.limit).collect()
}

fn rank(ranking: &Ranking, verdict: &StoredVerdict) -> Rank {
    Rank { score: ranking.learned.score(verdict.residual_mm), model_id: verdict.model_id.number() }
}

fn match_view(verdict: VerdictView, model: MatchedModel) -> MatchView {
    MatchView {
        model_id: model.id.to_string(),
        name: model.name,
        label: model.facets.label,
        unit: model.facets.unit.into(),
        score: verdict.score,
        is_match: verdict.is_match,
        matching_error_mm: verdict.matching_error_mm,
        sum_of_distances_mm: verdict.sum_of_distances_mm,
        dense_residual_mm: verdict.dense_residual_mm,
        coverage: verdict.coverage,
        triangle: verdict.triangle,
        landmarks: verdict.landmarks,
        reason: verdict.reason,
        explain: None,
        href: model_views::address(model.id),
    }
}
