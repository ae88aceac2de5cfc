//! `/v1/gallery/duplicates`: models that are there more than once.

use axum::Json;
use axum::extract::State;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::cursor::{self, Fingerprint};
use super::describe;
use super::extract::Query;
use super::problem::{Code, Problem};
use super::queries::{PlaceView, TAG};
use super::responses;
use super::state::AppState;
use visage_service::app::duplicates::{self, Duplicate, DuplicatesError, Page, Position, Repetition};

/// Models in one answer.
const MOST: usize = 100;
const DEFAULT: usize = 20;

/// The routes of this resource.
pub fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(duplicates))
}

/// Which part of the list.
#[derive(Debug, Clone, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
struct DuplicatesQuery {
    /// At most so many models (1 to 100, 20 if not given).
    #[param(minimum = 1, maximum = 100)]
    limit: Option<usize>,
    /// `next_cursor` of the page before.
    cursor: Option<String>,
}

/// In which way a model repeats another one.
#[derive(Debug, Clone, Copy, Serialize, ToSchema)]
#[schema(as = Repetition)]
#[serde(rename_all = "snake_case")]
enum RepetitionView {
    /// The very file.
    SameFile,
    /// The same surface, moved or meshed otherwise perhaps.
    SameSurface,
    /// The same at another size.
    Scaled,
    /// Its mirror image.
    Mirrored,
}

/// A model that repeats an earlier one.
#[derive(Debug, Clone, Serialize, ToSchema)]
#[schema(as = Duplicate)]
struct DuplicateView {
    /// The model.
    #[schema(format = "uuid")]
    model_id: String,
    /// In which way it repeats the earlier one.
    repetition: RepetitionView,
    /// Where it lies on the earlier one, and how far they agree; null for the very file.
    place: Option<PlaceView>,
}

/// Models that repeat one.
#[derive(Debug, Clone, Serialize, ToSchema)]
struct DuplicateGroup {
    /// The earliest model.
    #[schema(format = "uuid")]
    model_id: String,
    /// Those that repeat it, as far as they are on this page.
    duplicates: Vec<DuplicateView>,
}

/// A page of models that repeat earlier ones.
#[derive(Debug, Clone, Serialize, ToSchema)]
struct Duplicates {
    /// By the model that is repeated, in the order in which the first of its copies came; a group may go on on a later page.
    groups: Vec<DuplicateGroup>,
    /// How many models were looked at for this page.
    searched: usize,
    /// What to send as `cursor` for the next page; null on the last one. A page may be empty and yet not be the last.
    next_cursor: Option<String>,
}

/// List the models that repeat an earlier one: the same file or surface, scaled, or mirrored.
///
/// Each is told once, with the earliest model that it repeats. What is about alike by its shape is laid onto each other and measured on the
/// surfaces, so a page takes seconds; its work is bounded, and the next one goes on where it ended.
#[utoipa::path(
    get, path = "/v1/gallery/duplicates", tag = TAG, operation_id = "listDuplicates", params(DuplicatesQuery),
    responses((status = 200, description = "A page of the list.", body = Duplicates), responses::BadRequest,
              responses::Unprocessable, responses::NotReady, responses::Other)
)]
async fn duplicates(
    State(state): State<AppState>,
    Query(query): Query<DuplicatesQuery>,
) -> Result<Json<Duplicates>, Problem> {
    let limit = query.limit.unwrap_or(DEFAULT);
    if !(1..=MOST).contains(&limit) {
        let detail = format!("limit is {limit}, which is not between 1 and {MOST}");
        return Err(Problem::new(Code::InvalidField, detail, "ask for several pages"));
    }
    let list = cursor::fingerprint(&[b"duplicates"]);
    let from = query.cursor.as_deref().map(|text| position(text, &list)).transpose()?.unwrap_or_default();
    let turn = describe::long_turn(&state).await?;
    let page = duplicates::page(&state.context, from, limit).await?;
    drop(turn);
    Ok(Json(view(page, &list)))
}

fn position(text: &str, list: &Fingerprint) -> Result<Position, Problem> {
    let [model, compared] = cursor::read_items(text, list)?;
    Ok(Position { model, compared })
}

fn view(page: Page, list: &Fingerprint) -> Duplicates {
    let mut groups: Vec<DuplicateGroup> = Vec::new();
    for Duplicate { model, of, repetition, placed } in page.duplicates {
        let (model_id, of) = (model.to_string(), of.to_string());
        let duplicate = DuplicateView { model_id, repetition: repetition.into(), place: placed.map(PlaceView::from) };
        match groups.iter_mut().find(|group| group.model_id == of) {
            Some(group) => group.duplicates.push(duplicate),
            None => groups.push(DuplicateGroup { model_id: of, duplicates: vec![duplicate] }),
        }
    }
    let next_cursor = page.next.map(|next| cursor::after_items(list, [next.model, next.compared]));
    Duplicates { groups, searched: page.searched, next_cursor }
}

impl From<Repetition> for RepetitionView {
    fn from(repetition: Repetition) -> Self {
        match repetition {
            Repetition::SameFile => RepetitionView::SameFile,
            Repetition::SameSurface => RepetitionView::SameSurface,
            Repetition::Scaled => RepetitionView::Scaled,
            Repetition::Mirrored => RepetitionView::Mirrored,
        }
    }
}

impl From<DuplicatesError> for Problem {
    fn from(error: DuplicatesError) -> Self {
        match error {
            DuplicatesError::NotReady(error) => error.into(),
            DuplicatesError::Elsewhere(error) => error.into(),
            DuplicatesError::Placing(error) => error.into(),
            DuplicatesError::File(error) => error.into(),
            DuplicatesError::Task(error) => Problem::internal(error),
        }
    }
}
