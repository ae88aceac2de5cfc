//! Ranked matches with what is stored of their models.

use std::collections::HashMap;

use super::super::model_views;
use super::super::problem::Problem;
use super::super::state::AppState;
use super::views::MatchView;
use crate::retrieval::Match;
use crate::store::ModelId;

/// Puts names to the matches; a model that was deleted since the search is left out.
pub async fn named(state: &AppState, matches: Vec<Match>) -> Result<Vec<MatchView>, Problem> {
    let ids: Vec<ModelId> = matches.iter().map(|found| ModelId::from_number(found.model_id)).collect();
    let names = state.shop.store.model_names(&ids).await?;
    let mut names: HashMap<_, _> = names.into_iter().map(|(id, name, label)| (id, (name, label))).collect();
    let view = |found: Match| {
        let id = ModelId::from_number(found.model_id);
        let (name, label) = names.remove(&id)?;
        let has_triangle = found.triangle.is_some();
        Some(MatchView {
            model_id: id.to_string(),
            name,
            label,
            score: found.score,
            is_match: found.is_match,
            matching_error_mm: has_triangle.then_some(found.matching_error_mm).filter(|error| error.is_finite()),
            sum_of_distances_mm: has_triangle.then_some(found.sum_of_distances_mm).filter(|sum| sum.is_finite()),
            triangle: found.triangle.map(|corners| corners.map(|corner| corner.to_vec()).to_vec()),
            href: model_views::address(id),
        })
    };
    Ok(matches.into_iter().filter_map(view).collect())
}
