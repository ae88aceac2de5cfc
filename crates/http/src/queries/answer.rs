//! Ranked matches and verdicts as the API shows them.

use super::super::cursor;
use super::super::model_views;
use super::super::problem::Problem;
use super::super::state::{AppState, blocking};
use super::super::verdicts::{ExplanationView, ReasonView, VerdictView, places};
use super::placing::{self, PlaceView};
use super::question::{Asked, ClassVerdict, GalleryQuestion, Verdict};
use super::views::{MatchView, QueryAnswer};
use visage_domain::MatchedModel;
use visage_gallery::{Evidence, Match};
use visage_service::app::placing::{Placed, Shows, surest_first};
use visage_service::app::queries::{self, Answer, Grounds, Matches};

/// The answer to what is asked.
pub async fn answer(state: &AppState, asked: Asked) -> Result<QueryAnswer, Problem> {
    match asked {
        Asked::Gallery(asked) => ask_gallery(state, *asked).await,
        Asked::Verdict(asked) => Ok(verdict(&asked)),
        Asked::ClassVerdict(asked) => Ok(class_verdict(&asked)),
    }
}

async fn ask_gallery(state: &AppState, mut asked: GalleryQuestion) -> Result<QueryAnswer, Problem> {
    let answer = queries::ask(&state.context, &asked.question, asked.partial).await?;
    let Answer { mut matches, searched, pending, is_partial, next } = answer;
    let mut laid = None;
    if let (Some(probe), Matches::Found(found)) = (asked.place.take(), &mut matches) {
        let models = found.iter().map(|(_, model)| model.id).collect();
        let shows = asked.question.probe_shows();
        let placed = placing::placed(state, probe, shows, models).await?;
        laid = Some(match shows {
            Shows::Whole => placed,
            Shows::SingleScan => with_surest_first(found, placed),
        });
    }
    let placed = laid.as_ref().map(Vec::len);
    let next_cursor = next.map(|rank| cursor::after(&asked.fingerprint, rank));
    // signatures are read for it
    blocking(move || {
        let matches = match matches {
            Matches::Found(matches) => {
                let places = laid.unwrap_or_default().into_iter().map(|placed| placed.map(PlaceView::from));
                let places = places.chain(std::iter::repeat(None));
                let placed = matches.into_iter().zip(places);
                placed.map(|((found, model), place)| MatchView { place, ..match_view(&asked, &found, model) }).collect()
            }
            Matches::Judged { standard, learned, verdicts } => {
                let threshold = asked.question.threshold;
                let verdicts = verdicts.into_iter().map(|(verdict, model)| {
                    judged_view(VerdictView::of_class(&standard, &learned, &verdict, threshold), model)
                });
                verdicts.collect()
            }
        };
        let partial = is_partial.then_some(true);
        QueryAnswer { matches, searched, pending, partial, placed, next_cursor, verdict: None, explain: None }
    })
    .await
}

/// Brings the matches that a single scan surely lies on to the front, and what was found of each along.
fn with_surest_first(matches: &mut Vec<(Match, MatchedModel)>, placed: Vec<Option<Placed>>) -> Vec<Option<Placed>> {
    let order = surest_first(&placed.iter().map(|placed| placed.map(|placed| placed.same_object)).collect::<Vec<_>>());
    let mut first: Vec<Option<(Match, MatchedModel)>> = matches.drain(..placed.len()).map(Some).collect();
    let reordered: Vec<_> = order.iter().filter_map(|index| first[*index].take()).collect();
    matches.splice(0..0, reordered);
    order.into_iter().map(|index| placed[index]).collect()
}

fn verdict(asked: &Verdict) -> QueryAnswer {
    let Verdict { signature, standard, method, threshold, explain } = asked;
    let evidence = Evidence::new(signature, standard, *method, *threshold);
    let explanation = || ExplanationView::of(signature, standard, evidence.threshold, None);
    verdict_alone(VerdictView::of(standard, &evidence), explain.then(explanation))
}

fn class_verdict(asked: &ClassVerdict) -> QueryAnswer {
    let ClassVerdict { standard, learned, found, threshold } = asked;
    verdict_alone(VerdictView::of_found(standard, learned, Ok(found.as_ref()), *threshold), None)
}

fn verdict_alone(verdict: VerdictView, explain: Option<ExplanationView>) -> QueryAnswer {
    QueryAnswer {
        matches: Vec::new(),
        searched: 0,
        pending: 0,
        partial: None,
        placed: None,
        next_cursor: None,
        verdict: Some(verdict),
        explain,
    }
}

fn match_view(asked: &GalleryQuestion, found: &Match, model: MatchedModel) -> MatchView {
    let question = &asked.question;
    let Grounds { standard, signature, evidence, reason, comparison } =
        Grounds::of(question, found, &model, asked.explain);
    let fit = evidence.as_ref().and_then(|evidence| evidence.verdict.fit);
    let has_triangle = |figure: f64| found.triangle.map(|_| figure).filter(|figure| figure.is_finite());
    let explained = signature.as_ref().filter(|_| asked.explain);
    let explain =
        explained.map(|signature| ExplanationView::of(signature, &standard, question.decisive_threshold(), comparison));
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
        reason: reason.map(|reason| ReasonView::of(reason, evidence.as_ref())),
        explain,
        place: None,
        href: model_views::address(model.id),
    }
}

fn judged_view(verdict: VerdictView, model: MatchedModel) -> MatchView {
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
        place: None,
        href: model_views::address(model.id),
    }
}
