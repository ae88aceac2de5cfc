//! Ranked matches with what is stored of their models.

use std::collections::HashMap;

use super::super::model_views;
use super::super::problem::Problem;
use super::super::state::{AppState, blocking};
use super::super::verdicts::{ExplanationView, VerdictView, places};
use super::class;
use super::question::{About, ClassVerdict, Question};
use super::views::{MatchView, QueryAnswer};
use visage_domain::{MatchedModel, ModelId};
use visage_gallery::{Evidence, Match, PROBE_MATCH_SCORE, Reason, compare, triangle_match_score};
use visage_shape::faces::judgement::MATCH_SCORE;
use visage_shape::faces::{MatchMethod, Signature, standard};

/// The answer of the gallery as it is at this moment.
pub async fn answer(state: &AppState, question: Question) -> Result<QueryAnswer, Problem> {
    state.context.database.settled().await;
    if let About::Class { name } = &question.about {
        return class::answer(state, &question, name).await;
    }
    let gallery = state.context.gallery.clone();
    let search = move || {
        let answer = gallery.ask(|index| (question.answer(index, &gallery.catalogue()), index.len()));
        answer.map(|((matches, next_cursor), searched)| (question, matches, next_cursor, searched))
    };
    let (question, matches, next_cursor, searched) = blocking(search).await??;
    let ids: Vec<ModelId> = matches.iter().map(|found| ModelId::from_number(found.model_id)).collect();
    let models = state.context.database.matched_models(&ids).await?;
    blocking(move || QueryAnswer {
        matches: shown(&question, matches, models),
        searched,
        pending: 0,
        next_cursor,
        verdict: None,
        explain: None,
    })
    .await
}

/// The verdict on a probe, if that is what is asked for.
pub fn verdict(question: &Question) -> Option<QueryAnswer> {
    let (verdict, explain) = match &question.about {
        About::Verdict { signature, standard, method } => {
            let evidence = Evidence::new(signature, standard, *method, question.terms.threshold);
            let explain = || ExplanationView::of(signature, standard, evidence.threshold, None);
            (VerdictView::of(standard, &evidence), question.terms.explain.then(explain))
        }
        About::ClassVerdict(looked_for) => {
            let ClassVerdict { standard, learned, found } = &**looked_for;
            (VerdictView::of_found(standard, learned, Ok(found.as_ref()), question.terms.threshold), None)
        }
        _ => return None,
    };
    Some(QueryAnswer {
        matches: Vec::new(),
        searched: 0,
        pending: 0,
        next_cursor: None,
        verdict: Some(verdict),
        explain,
    })
}

/// The matches with their models; one that was deleted since the search is left out.
fn shown(question: &Question, matches: Vec<Match>, models: Vec<MatchedModel>) -> Vec<MatchView> {
    let mut models: HashMap<ModelId, MatchedModel> = models.into_iter().map(|model| (model.id, model)).collect();
    let view = |found: Match| {
        let model = models.remove(&ModelId::from_number(found.model_id))?;
        Some(match_view(question, &found, model))
    };
    matches.into_iter().filter_map(view).collect()
}

fn match_view(question: &Question, found: &Match, model: MatchedModel) -> MatchView {
    let (standard, method) = match &question.about {
        About::Standard { standard, method } | About::Verdict { standard, method, .. } => (*standard, *method),
        About::Probe { .. } | About::Triangle(_) | About::Class { .. } | About::ClassVerdict(_) => {
            (standard::face(), MatchMethod::Verified)
        }
    };
    let is_about_standard = matches!(question.about, About::Standard { .. });
    // what is stored beside the index: landmarks and figures are not kept in memory
    let signature = model.signature.as_deref().and_then(|content| Signature::from_bytes(content).ok());
    let threshold = question.terms.threshold.filter(|_| is_about_standard);
    let evidence = signature.as_ref().map(|signature| Evidence::new(signature, &standard, method, threshold));
    let fit = evidence.as_ref().and_then(|evidence| evidence.verdict.fit);
    let has_triangle = |figure: f64| found.triangle.map(|_| figure).filter(|figure| figure.is_finite());
    let threshold = threshold_of(question);
    let reason = match (&evidence, is_about_standard) {
        _ if found.is_match => None,
        (Some(evidence), true) => evidence.reason(),
        _ => Some(Reason::BelowThreshold { score: found.score, threshold }),
    };
    let explain = signature.as_ref().filter(|_| question.terms.explain).map(|signature| {
        let comparison = match &question.about {
            About::Probe { signature: probe, .. } => Some(compare(probe, signature)),
            _ => None,
        };
        ExplanationView::of(signature, &standard, threshold, comparison)
    });
    MatchView {
        model_id: model.id.to_string(),
        name: model.name,
        label: model.facets.label,
        unit: model.facets.unit.into(),
        score: found.score,
        is_match: found.is_match,
        matching_error_mm: has_triangle(found.matching_error_mm),
        sum_of_distances_mm: has_triangle(found.sum_of_distances_mm),
        dense_residual_mm: fit.map(|fit| fit.residual_mm),
        coverage: fit.map(|fit| fit.observed),
        triangle: found.triangle.map(|corners| corners.map(|corner| corner.to_vec()).to_vec()),
        landmarks: evidence.as_ref().and_then(|evidence| places(&evidence.landmarks)),
        reason: reason.map(Into::into),
        explain,
        href: model_views::address(model.id),
    }
}

/// The threshold that decides a question.
fn threshold_of(question: &Question) -> f64 {
    let own = || match question.about {
        About::Standard { .. } | About::Class { .. } | About::Verdict { .. } | About::ClassVerdict(_) => MATCH_SCORE,
        About::Probe { .. } => PROBE_MATCH_SCORE,
        About::Triangle(_) => triangle_match_score(),
    };
    question.terms.threshold.unwrap_or_else(own)
}
