//! How well the gallery's answers agree with its labels.
//!
//! - `verdicts`: a standard's scores against the label that its class has
//! - `rankings`: each labelled model as a probe for its own class
//! - `plot`: the figures as a picture

mod plot;
mod rankings;
mod verdicts;

use std::collections::BTreeMap;

use super::context::ServiceContext;
use super::live_gallery::NotReady;
use super::search::Elsewhere;
use super::standards;
use crate::storage::DatabaseError;
use visage_domain::StoredVerdict;
use visage_gallery::measures::{RankingMeasures, RocPoint};
use visage_gallery::{MatchMethod, ModelId};
use visage_shape::faces::standard::by_name;

/// With more labelled models than this the gallery is evaluated label by label.
const MOST_MODELS: usize = 20_000;

pub use plot::svg;

/// The labelled models of the gallery, ascending by id.
pub type Labels = BTreeMap<ModelId, Box<str>>;

/// What is to be evaluated.
#[derive(Debug, Clone)]
pub struct Question {
    /// The class whose verdicts are evaluated: a built-in one, or one that a user has made.
    pub standard: String,
    /// How models are judged against a built-in one.
    pub method: MatchMethod,
    /// The label that counts as of the class.
    pub label: String,
    /// Only models whose label begins so.
    pub label_prefix: String,
}

/// All figures.
#[derive(Debug, Clone)]
pub struct Evaluation {
    /// Models with a label and a signature.
    pub models: usize,
    /// Different labels.
    pub labels: usize,
    /// `None` unless there are two models of the class and two others.
    pub verdicts: Option<VerdictFigures>,
    /// `None` unless two models share a label.
    pub rankings: Option<Rankings>,
}

/// How well a standard's scores tell its class from everything else.
#[derive(Debug, Clone)]
pub struct VerdictFigures {
    /// The label that counts as of the class.
    pub label: String,
    /// Models with that label.
    pub positives: usize,
    /// Models with another.
    pub negatives: usize,
    /// The area under the ROC curve.
    pub auc: f64,
    /// Its 95 % bootstrap interval.
    pub auc_interval: [f64; 2],
    /// Where as many positives are missed as negatives are taken for positives.
    pub equal_error_rate: f64,
    /// The most models that one threshold puts into their class.
    pub best_accuracy: f64,
    /// That threshold.
    pub best_threshold: f64,
    /// The corners of the curve, from the strictest threshold to the laxest.
    pub roc: Vec<RocPoint>,
}

/// Each labelled model asked about: how well does its ranking bring its own class to the front?
#[derive(Debug, Clone)]
pub struct Rankings {
    /// Models asked about.
    pub probes: usize,
    /// The means over all of them.
    pub mean: RankingMeasures,
    /// By label.
    pub classes: Vec<ClassRankings>,
}

/// The rankings of one class.
#[derive(Debug, Clone)]
pub struct ClassRankings {
    /// The label.
    pub label: Box<str>,
    /// Its models that were asked about.
    pub probes: usize,
    /// The means over them.
    pub mean: RankingMeasures,
}

/// Why there is no evaluation.
#[derive(Debug, thiserror::Error)]
pub enum EvaluationError {
    /// The index is still being loaded.
    #[error(transparent)]
    NotReady(#[from] NotReady),
    /// The index is not here.
    #[error(transparent)]
    Elsewhere(#[from] Elsewhere),
    /// There is no standard of this name.
    #[error("there is no standard {0:?}")]
    UnknownStandard(String),
    /// They can't be held in memory at once.
    #[error("more than {MOST_MODELS} models have such a label")]
    TooManyLabels,
    /// There is nothing to compare.
    #[error("of {models} labelled model(s) neither can two be told from two others by the label, nor do two share one")]
    TooFewLabels {
        /// The labelled models.
        models: usize,
    },
    /// The database.
    #[error(transparent)]
    Database(#[from] DatabaseError),
    /// A task ended badly.
    #[error("evaluating: {0}")]
    Task(#[from] tokio::task::JoinError),
}

/// Evaluates the gallery as it is at this moment; may take minutes, and others can use it meanwhile.
pub async fn run(context: &ServiceContext, question: Question) -> Result<Evaluation, EvaluationError> {
    context.has_index()?;
    context.settled().await?;
    let judged = match by_name(&question.standard) {
        Some(_) => None,
        None => Some(stored_scores(context, &question.standard).await?),
    };
    let _turn = context.evaluating.acquire().await;
    let labels = labels(context, &question.label_prefix)?;
    let live = context.gallery.clone();
    let work = move || {
        let of_face = verdicts::scores(&live, "face", question.method, &labels)?;
        // of those only that are in the index: others have signatures of another version
        let labels: Labels = labels.into_iter().filter(|(id, _)| of_face.contains_key(id)).collect();
        let scores = judged.unwrap_or(of_face);
        let verdicts = verdicts::evaluate(&question.label, &scores, &labels);
        Ok::<_, NotReady>((labels, verdicts))
    };
    let (labels, verdicts) = off_thread(work).await??;
    let rankings = rankings::evaluate(context.database.as_ref(), &context.gallery, &labels).await?;
    if verdicts.is_none() && rankings.is_none() {
        return Err(EvaluationError::TooFewLabels { models: labels.len() });
    }
    let classes: std::collections::BTreeSet<&str> = labels.values().map(AsRef::as_ref).collect();
    Ok(Evaluation { models: labels.len(), labels: classes.len(), verdicts, rankings })
}

/// The scores of all models that are judged against a standard that a user has made.
async fn stored_scores(context: &ServiceContext, name: &str) -> Result<BTreeMap<ModelId, f64>, EvaluationError> {
    let ranking = standards::ranking(context, name, i64::MAX as usize).await?;
    let ranking = ranking.ok_or_else(|| EvaluationError::UnknownStandard(name.to_owned()))?;
    let score = |verdict: &StoredVerdict| (verdict.model_id.number(), ranking.learned.score(verdict.residual_mm));
    Ok(ranking.verdicts.iter().map(score).collect())
}

fn labels(context: &ServiceContext, prefix: &str) -> Result<Labels, EvaluationError> {
    let labeled = context.gallery.catalogue().labeled(prefix, MOST_MODELS).ok_or(EvaluationError::TooManyLabels)?;
    Ok(labeled.into_iter().collect())
}

/// Searches beside the async threads; what it says is of the request that asked.
async fn off_thread<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Result<T, tokio::task::JoinError> {
    let span = tracing::Span::current();
    tokio::task::spawn_blocking(move || span.in_scope(work)).await
}
