//! `/v1/models/{id}/deviation`: how far a model is from another of the same frame, as figures and as a coloured surface.

use axum::Json;
use axum::extract::State;
use axum::http::header;
use axum::response::IntoResponse;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::describe;
use super::extract::{Path, Query};
use super::models::{TAG, parse_id};
use super::problem::{Code, Problem};
use super::responses;
use super::schemas::FileContent;
use super::state::AppState;
use visage_service::app::deviation::{DeviationError, DeviationReport, Measured, Pair, Question};
use visage_service::app::model_file::ModelFileError;

/// What is measured to what.
#[derive(Debug, Clone, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub struct DeviationQuery {
    /// The model that it is measured to, in the same frame and unit.
    #[param(format = "uuid")]
    reference: String,
    /// What is tolerated, in the unit of the model: the share beyond it is counted, and colours are full there.
    #[param(exclusive_minimum = 0.0, maximum = 1e6, example = 0.5)]
    limit: Option<f64>,
    /// Places that have nothing of the other model within this have no counterpart, and are left out of the figures.
    #[param(exclusive_minimum = 0.0, maximum = 1e6, example = 20.0)]
    reach: Option<f64>,
}

/// How far two models are from each other, lengths in the unit of the model.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct Deviation {
    /// The unit of all lengths: mm, cm, m, in or unknown.
    #[schema(example = "mm")]
    pub unit: &'static str,
    /// The file of the model that was measured.
    pub file: String,
    /// The file of the reference.
    pub reference_file: String,
    /// Whether the reference has an outer side: without one distances have no sign.
    pub has_sides: bool,
    /// From the model's vertices to the reference.
    pub model_to_reference: DeviationFigures,
    /// From the reference's vertices to the model: what the model lacks.
    pub reference_to_model: DeviationFigures,
}

/// Distances in figures. Outside of what they are measured to is positive.
#[derive(Debug, Clone, Copy, Serialize, ToSchema)]
pub struct DeviationFigures {
    /// Vertices that have something of the other model within reach.
    pub points: usize,
    /// Vertices that have nothing of it within reach.
    pub out_of_reach: usize,
    /// The mean with signs.
    pub mean_signed: f64,
    /// The least with its sign.
    pub lowest: f64,
    /// The largest with its sign.
    pub highest: f64,
    /// The mean without signs.
    pub mean: f64,
    /// The root mean square.
    pub rms: f64,
    /// What 95 of 100 don't exceed, without signs.
    pub p95: f64,
    /// What 99 of 100 don't exceed, without signs.
    pub p99: f64,
    /// The share of the vertices beyond the limit; null without one.
    pub beyond_limit: Option<f64>,
}

impl From<DeviationReport> for DeviationFigures {
    fn from(of: DeviationReport) -> Self {
        DeviationFigures {
            points: of.points,
            out_of_reach: of.out_of_reach,
            mean_signed: of.mean_signed,
            lowest: of.lowest,
            highest: of.highest,
            mean: of.absolute.mean,
            rms: of.absolute.rms,
            p95: of.absolute.p95,
            p99: of.absolute.p99,
            beyond_limit: of.beyond_limit,
        }
    }
}

/// Measure how far a model is from another.
///
/// Both have to be in one frame and unit: nothing is aligned. Of a model with triangles these are measured, else its points;
/// to a cloud it is as far as to the planes about its points. Computed anew while the client waits, and given up when it goes away.
#[utoipa::path(
    get, path = "/v1/models/{id}/deviation", tag = TAG, operation_id = "measureDeviation",
    params(("id" = String, Path, format = "uuid", description = "The model."), DeviationQuery),
    responses((status = 200, description = "The figures.", body = Deviation), responses::BadRequest, responses::NotFound,
              responses::Conflict, responses::Unprocessable, responses::NotReady, responses::Other)
)]
pub async fn figures(
    State(state): State<AppState>,
    Path(id): Path<String>,
    Query(query): Query<DeviationQuery>,
) -> Result<Json<Deviation>, Problem> {
    let (pair, question) = asked(&state, &id, &query).await?;
    let unit = pair.unit();
    let Measured { names: [file, reference_file], deviation, .. } = measured(&state, pair, question).await?;
    let (model_to_reference, reference_to_model) = (deviation.forth.into(), deviation.back.into());
    let has_sides = deviation.has_sides;
    let unit = unit.name();
    Ok(Json(Deviation { unit, file, reference_file, has_sides, model_to_reference, reference_to_model }))
}

/// The model in the colours of its distances: red outside of the reference, blue inside, grey out of reach.
///
/// A PLY whose vertices have the property `deviation`, with the triangles of the model if it has some.
#[utoipa::path(
    get, path = "/v1/models/{id}/deviation.ply", tag = TAG, operation_id = "paintDeviation",
    params(("id" = String, Path, format = "uuid", description = "The model."), DeviationQuery),
    responses((status = 200, description = "The file.", body = inline(FileContent), content_type = "application/octet-stream"),
              responses::BadRequest, responses::NotFound, responses::Conflict, responses::Unprocessable, responses::NotReady,
              responses::Other)
)]
pub async fn map(
    State(state): State<AppState>,
    Path(id): Path<String>,
    Query(query): Query<DeviationQuery>,
) -> Result<impl IntoResponse, Problem> {
    let (pair, question) = asked(&state, &id, &query).await?;
    let measured = measured(&state, pair, question).await?;
    let headers = [(header::CONTENT_TYPE, "application/octet-stream"), (header::X_CONTENT_TYPE_OPTIONS, "nosniff")];
    Ok((headers, measured.coloured(question.limit)))
}

/// Checks what is asked for, and finds the files.
async fn asked(state: &AppState, id: &str, query: &DeviationQuery) -> Result<(Pair, Question), Problem> {
    let (model, reference) = (parse_id(id)?, parse_id(&query.reference)?);
    for (name, length) in [("limit", query.limit), ("reach", query.reach)] {
        let is_sound = length.is_none_or(|length| length > 0.0 && length <= 1e6);
        if !is_sound {
            let detail = format!("{name} is no length that can be used");
            return Err(Problem::new(Code::InvalidField, detail, "give a number above 0 and no larger than 1000000"));
        }
    }
    let pair = Pair::find(&state.context, model, reference).await?;
    Ok((pair, Question { limit: query.limit, reach: query.reach }))
}

async fn measured(state: &AppState, pair: Pair, question: Question) -> Result<Measured, Problem> {
    let turn = describe::turn_of(state, pair.bytes()).await?;
    let context = state.context.clone();
    describe::computed(state, turn, move |_, progress| Ok(pair.measured(&context, question, progress)?)).await
}

impl From<DeviationError> for Problem {
    fn from(error: DeviationError) -> Self {
        let detail = error.to_string();
        match error {
            DeviationError::OtherUnit(..) => {
                Problem::new(Code::OtherUnit, detail, "name a reference in the unit of the model")
            }
            DeviationError::Canceled(_) => Problem::internal(detail),
            DeviationError::File(error) => error.into(),
        }
    }
}

impl From<ModelFileError> for Problem {
    fn from(error: ModelFileError) -> Self {
        let detail = error.to_string();
        match error {
            ModelFileError::NoSurface(_) => {
                Problem::new(Code::NotFound, detail, "GET /v1/models/{id} lists the files of a model")
            }
            ModelFileError::Unreadable(_) => Problem::internal(detail),
            ModelFileError::Database(error) => error.into(),
            ModelFileError::Objects(error) => error.into(),
        }
    }
}
