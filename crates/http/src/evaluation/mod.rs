//! `/v1/gallery/evaluation`: how well the gallery's answers agree with its labels. `views` are the figures as they go over the wire.

mod views;

use std::collections::BTreeMap;

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
use super::standards::ranking;
use super::state::AppState;
use views::Evaluation;
use visage_domain::StoredVerdict;
use visage_gallery::ModelId;
use visage_service::app::evaluations::{self, EvaluationError, Labels, Question};
use visage_shape::faces::standard;

const TAG: &str = "queries";
/// With more labelled models than this the gallery is evaluated label by label.
const MOST_MODELS: usize = 20_000;

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
    state.context.database.settled().await;
    let name = query.standard.unwrap_or_else(|| "face".to_owned());
    let judged = match standard::by_name(&name) {
        Some(_) => None,
        // one that a user has made: as far as models are judged
        None => Some(scores_of_class(state, &name, query.method).await?),
    };
    let _turn = state.evaluating.clone().acquire_owned().await.map_err(Problem::internal)?;
    let method = query.method.unwrap_or_default();
    let label = query.label.unwrap_or_else(|| name.clone());
    let labels = labels(state, query.label_prefix.as_deref().unwrap_or_default())?;
    let question = Question { method: method.into(), judged, label };
    let (database, gallery) = (state.context.database.as_ref(), &state.context.gallery);
    let evaluation = evaluations::run(database, gallery, labels, question).await?;
    if evaluation.verdicts.is_none() && evaluation.rankings.is_none() {
        let detail = format!(
            "of {} labelled model(s) neither can two be told from two others by the label, nor do two share one",
            evaluation.models
        );
        let hint = "give models labels: at least two of a class, and two of another";
        return Err(Problem::new(Code::TooFewLabels, detail, hint));
    }
    Ok((Asked { standard: name, method }, evaluation))
}

/// The scores of all models that are judged against a standard that a user has made.
async fn scores_of_class(
    state: &AppState,
    name: &str,
    method: Option<MethodView>,
) -> Result<BTreeMap<ModelId, f64>, Problem> {
    verified_alone(name, method)?;
    let ranking = ranking(state, name, i64::MAX as usize).await?.ok_or_else(|| unknown_standard(name))?;
    let score = |verdict: &StoredVerdict| (verdict.model_id.number(), ranking.learned.score(verdict.residual_mm));
    Ok(ranking.verdicts.iter().map(score).collect())
}

impl From<EvaluationError> for Problem {
    fn from(error: EvaluationError) -> Self {
        match error {
            EvaluationError::NotReady(error) => error.into(),
            EvaluationError::Database(error) => error.into(),
            EvaluationError::Task(error) => Problem::internal(error),
        }
    }
}

fn labels(state: &AppState, prefix: &str) -> Result<Labels, Problem> {
    let labeled = state.context.gallery.catalogue().labeled(prefix, MOST_MODELS);
    labeled.map(|labeled| labeled.into_iter().collect()).ok_or_else(|| {
        let detail = format!("more than {MOST_MODELS} models have such a label");
        Problem::new(Code::TooManyLabels, detail, "ask for a part of the labels with label_prefix")
    })
}
