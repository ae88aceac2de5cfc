//! `/v1/gallery/evaluation`: how well the gallery's answers agree with its labels. `views` are the figures as they go over the wire.

mod views;

use axum::Json;
use axum::extract::State;
use axum::http::header;
use axum::response::IntoResponse;
use serde::Deserialize;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::extract::Query;
use super::problem::{Code, Problem};
use super::queries::{MethodView, unknown_standard, verified_alone};
use super::responses;
use super::state::AppState;
use views::Evaluation;
use visage_service::app::evaluations::{self, EvaluationError, Question};
use visage_shape::faces::standard;

const TAG: &str = "queries";

/// The routes of this resource.
pub fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(evaluation)).routes(routes!(evaluation_plot))
}

/// What to evaluate.
#[derive(Debug, Clone, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
struct EvaluationQuery {
    /// The class whose verdicts are evaluated, `face` or one of your own (`face` if not given).
    #[param(example = "face")]
    standard: Option<String>,
    /// The label of the models that are of that class (the class's name if not given); all other labels are not.
    label: Option<String>,
    /// How models are judged against the standard (`verified` if not given; there are others for the face alone).
    #[param(inline)]
    method: Option<MethodView>,
    /// Only models whose label begins so.
    label_prefix: Option<String>,
}

/// Evaluate the gallery by its labels.
///
/// Verdicts: ROC, its area with a 95 % bootstrap interval, equal error rate. Rankings by probe: nearest neighbour,
/// first and second tier, discounted cumulative gain, mean average precision. Computed anew while the client waits,
/// one evaluation at a time, and given up when it goes away.
#[utoipa::path(
    get, path = "/v1/gallery/evaluation", tag = TAG, operation_id = "evaluateGallery", params(EvaluationQuery),
    responses((status = 200, description = "The figures.", body = Evaluation), responses::BadRequest,
              responses::Unprocessable, responses::NotReady, responses::Other)
)]
async fn evaluation(
    State(state): State<AppState>,
    Query(query): Query<EvaluationQuery>,
) -> Result<Json<Evaluation>, Problem> {
    let (asked, evaluation) = evaluated(&state, query).await?;
    Ok(Json(Evaluation::of(&asked, evaluation)))
}

/// The evaluation as a picture: the ROC curve, and the figures of the rankings as bars.
#[utoipa::path(
    get, path = "/v1/gallery/evaluation.svg", tag = TAG, operation_id = "plotEvaluation", params(EvaluationQuery),
    responses((status = 200, description = "An SVG.", body = String, content_type = "image/svg+xml"),
              responses::BadRequest, responses::Unprocessable, responses::NotReady, responses::Other)
)]
async fn evaluation_plot(
    State(state): State<AppState>,
    Query(query): Query<EvaluationQuery>,
) -> Result<impl IntoResponse, Problem> {
    let (_, evaluation) = evaluated(&state, query).await?;
    Ok(([(header::CONTENT_TYPE, "image/svg+xml")], evaluations::svg(&evaluation)))
}

/// What was asked for, as the answer shows it.
struct Asked {
    standard: String,
    method: MethodView,
}

async fn evaluated(state: &AppState, query: EvaluationQuery) -> Result<(Asked, evaluations::Evaluation), Problem> {
    tokio::select! {
        evaluation = evaluate(state, query) => evaluation,
        () = state.stop.cancelled() => Err(Problem::shutting_down()),
    }
}

async fn evaluate(state: &AppState, query: EvaluationQuery) -> Result<(Asked, evaluations::Evaluation), Problem> {
    let standard = query.standard.unwrap_or_else(|| "face".to_owned());
    if standard::by_name(&standard).is_none() {
        verified_alone(&standard, query.method)?;
    }
    let method = query.method.unwrap_or_default();
    let question = Question {
        method: method.into(),
        label: query.label.unwrap_or_else(|| standard.clone()),
        label_prefix: query.label_prefix.unwrap_or_default(),
        standard: standard.clone(),
    };
    Ok((Asked { standard, method }, evaluations::run(&state.context, question).await?))
}

impl From<EvaluationError> for Problem {
    fn from(error: EvaluationError) -> Self {
        let detail = error.to_string();
        match error {
            EvaluationError::NotReady(error) => error.into(),
            EvaluationError::Elsewhere(error) => error.into(),
            EvaluationError::UnknownStandard(name) => unknown_standard(&name),
            EvaluationError::TooManyLabels => {
                Problem::new(Code::TooManyLabels, detail, "ask for a part of the labels with label_prefix")
            }
            EvaluationError::TooFewLabels { .. } => {
                let hint = "give models labels: at least two of a class, and two of another";
                Problem::new(Code::TooFewLabels, detail, hint)
            }
            EvaluationError::Database(error) => error.into(),
            EvaluationError::Task(error) => Problem::internal(error),
        }
    }
}
