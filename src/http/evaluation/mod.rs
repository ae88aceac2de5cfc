//! `/v1/gallery/evaluation`: how well the gallery's answers agree with its labels.
//!
//! - `verdicts`: a standard's scores against the label that its class has
//! - `rankings`: each labelled model as a probe for its own class
//! - `views`: the figures as they go over the wire; `plot`: the same as a picture

mod plot;
mod rankings;
mod verdicts;
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
use super::queries::MethodView;
use super::responses;
use super::state::{AppState, blocking};
use crate::faces::standard;
use crate::retrieval::ModelId;
use views::Evaluation;

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
    Ok(Json(evaluated(&state, query).await?))
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
    let evaluation = evaluated(&state, query).await?;
    Ok(([(header::CONTENT_TYPE, "image/svg+xml")], plot::svg(&evaluation)))
}

async fn evaluated(state: &AppState, query: EvaluationQuery) -> Result<Evaluation, Problem> {
    tokio::select! {
        evaluation = evaluate(state, query) => evaluation,
        () = state.stop.cancelled() => Err(Problem::shutting_down()),
    }
}

/// The labelled models of the gallery, ascending by id.
type Labels = BTreeMap<ModelId, Box<str>>;

async fn evaluate(state: &AppState, query: EvaluationQuery) -> Result<Evaluation, Problem> {
    state.context.database.settled().await;
    let name = query.standard.unwrap_or_else(|| "face".to_owned());
    let judged = match standard::by_name(&name) {
        Some(_) => None,
        // one that a user has made: as far as models are judged
        None => Some(verdicts::of_class(state, &name, query.method).await?),
    };
    let _turn = state.evaluating.clone().acquire_owned().await.map_err(Problem::internal)?;
    let method = query.method.unwrap_or_default();
    let positive = query.label.unwrap_or_else(|| name.clone());
    let labels = labels(state, query.label_prefix.as_deref().unwrap_or_default())?;
    let gallery = state.context.gallery.clone();
    let work = move || {
        let of_face = verdicts::scores(&gallery, "face", method.into(), &labels)?;
        // of those only that are in the index: others have signatures of another version
        let labels: Labels = labels.into_iter().filter(|(id, _)| of_face.contains_key(id)).collect();
        let scores = judged.unwrap_or(of_face);
        let verdicts = verdicts::evaluate(&name, method, &positive, &scores, &labels);
        Ok::<_, Problem>((labels, verdicts))
    };
    let (labels, verdicts) = blocking(work).await??;
    let rankings = rankings::evaluate(state, &labels).await?;
    if verdicts.is_none() && rankings.is_none() {
        let detail = format!(
            "of {} labelled model(s) neither can two be told from two others by the label, nor do two share one",
            labels.len()
        );
        let hint = "give models labels: at least two of a class, and two of another";
        return Err(Problem::new(Code::TooFewLabels, detail, hint));
    }
    let classes: std::collections::BTreeSet<&str> = labels.values().map(AsRef::as_ref).collect();
    Ok(Evaluation { models: labels.len(), labels: classes.len(), verdicts, rankings })
}

fn labels(state: &AppState, prefix: &str) -> Result<Labels, Problem> {
    let labeled = state.context.gallery.catalogue().labeled(prefix, MOST_MODELS);
    labeled.map(|labeled| labeled.into_iter().collect()).ok_or_else(|| {
        let detail = format!("more than {MOST_MODELS} models have such a label");
        Problem::new(Code::TooManyLabels, detail, "ask for a part of the labels with label_prefix")
    })
}
