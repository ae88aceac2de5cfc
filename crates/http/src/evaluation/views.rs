//! The figures of an evaluation as they go over the wire.

use serde::Serialize;
use utoipa::ToSchema;

use super::super::queries::MethodView;
use super::Asked;
use visage_gallery::measures::{RankingMeasures, RocPoint};
use visage_service::app::evaluations::{self, ClassRankings, Rankings, VerdictFigures};

/// How well the gallery's answers agree with its labels.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct Evaluation {
    /// Models with a label and a signature.
    pub models: usize,
    /// Different labels.
    pub labels: usize,
    /// The verdicts of a standard; null unless there are two models of its class and two others.
    pub verdicts: Option<VerdictEvaluation>,
    /// Rankings by probe; null unless two models share a label.
    pub rankings: Option<RankingEvaluation>,
}

/// A point of the ROC curve.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
#[schema(as = RocPoint)]
pub struct RocPointView {
    /// Scores from this on count as positive.
    pub threshold: f64,
    /// Share of the positives found.
    pub true_positive_rate: f64,
    /// Share of the negatives taken for positives.
    pub false_positive_rate: f64,
}

/// How well a standard's scores tell its class from everything else.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct VerdictEvaluation {
    /// The class.
    pub standard: String,
    /// How models were judged.
    pub method: MethodView,
    /// The label that counts as of the class.
    pub label: String,
    /// Models with that label.
    pub positives: usize,
    /// Models with another.
    pub negatives: usize,
    /// The area under the ROC curve: the chance that a positive scores higher than a negative, ties counting half.
    pub auc: f64,
    /// The 95 % bootstrap interval of the area: 1000 samples drawn from each class by itself, seeded.
    pub auc_interval: Vec<f64>,
    /// Where as many positives are missed as negatives are taken for positives.
    pub equal_error_rate: f64,
    /// The most models that one threshold puts into their class.
    pub best_accuracy: f64,
    /// That threshold.
    pub best_threshold: f64,
    /// The curve from the strictest threshold to the laxest; points on a straight line between others are left out.
    pub roc: Vec<RocPointView>,
}

/// The means over probes; each in [0, 1], high is good.
#[derive(Debug, Clone, Copy, Serialize, ToSchema)]
pub struct RankingFigures {
    /// Share of the probes whose first match is of their class.
    pub nearest_neighbour: f64,
    /// Of the class's C other models, the share among the first C matches.
    pub first_tier: f64,
    /// The same among the first 2 C.
    pub second_tier: f64,
    /// Discounted cumulative gain relative to the best ranking.
    pub discounted_cumulative_gain: f64,
    /// Mean average precision.
    pub mean_average_precision: f64,
}

impl From<RankingMeasures> for RankingFigures {
    fn from(measures: RankingMeasures) -> Self {
        RankingFigures {
            nearest_neighbour: measures.nearest_neighbour,
            first_tier: measures.first_tier,
            second_tier: measures.second_tier,
            discounted_cumulative_gain: measures.discounted_cumulative_gain,
            mean_average_precision: measures.average_precision,
        }
    }
}

/// The figures of one class.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct ClassFigures {
    /// The label.
    pub label: String,
    /// Its models that were asked about.
    pub probes: usize,
    /// The means over them.
    #[serde(flatten)]
    pub figures: RankingFigures,
}

/// Each labelled model asked about: how well does its ranking bring its own class to the front?
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct RankingEvaluation {
    /// Models asked about: all that share their label, or an even choice of 500.
    pub probes: usize,
    /// The means over all of them.
    #[serde(flatten)]
    pub figures: RankingFigures,
    /// By label; at most 100 of them.
    pub classes: Vec<ClassFigures>,
}

impl Evaluation {
    /// The figures, beside what was asked for.
    pub(super) fn of(asked: &Asked, evaluation: evaluations::Evaluation) -> Self {
        let evaluations::Evaluation { models, labels, verdicts, rankings } = evaluation;
        let verdicts = verdicts.map(|figures| VerdictEvaluation::of(asked, figures));
        Evaluation { models, labels, verdicts, rankings: rankings.map(Into::into) }
    }
}

impl VerdictEvaluation {
    fn of(asked: &Asked, figures: VerdictFigures) -> Self {
        VerdictEvaluation {
            standard: asked.standard.clone(),
            method: asked.method,
            label: figures.label,
            positives: figures.positives,
            negatives: figures.negatives,
            auc: figures.auc,
            auc_interval: figures.auc_interval.to_vec(),
            equal_error_rate: figures.equal_error_rate,
            best_accuracy: figures.best_accuracy,
            best_threshold: figures.best_threshold,
            roc: figures.roc.into_iter().map(Into::into).collect(),
        }
    }
}

impl From<RocPoint> for RocPointView {
    fn from(point: RocPoint) -> Self {
        RocPointView {
            threshold: point.threshold,
            true_positive_rate: point.true_positive_rate,
            false_positive_rate: point.false_positive_rate,
        }
    }
}

impl From<Rankings> for RankingEvaluation {
    fn from(rankings: Rankings) -> Self {
        let class = |class: ClassRankings| ClassFigures {
            label: class.label.into_string(),
            probes: class.probes,
            figures: class.mean.into(),
        };
        let classes = rankings.classes.into_iter().map(class).collect();
        RankingEvaluation { probes: rankings.probes, figures: rankings.mean.into(), classes }
    }
}
