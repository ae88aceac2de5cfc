//! Jobs as the API sees them.

use std::collections::BTreeMap;

use super::options::Options;
use super::{JobId, JobKind, JobStatus, ModelId, ScanSetId};
use visage_registration::hints::Hints;

/// Why a job failed: for programs (`code`) and for people (the rest).
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize, serde::Deserialize, utoipa::ToSchema)]
pub struct JobError {
    /// Stable and machine-readable.
    #[schema(example = "degenerate_scan")]
    pub code: String,
    /// What went wrong.
    pub message: String,
    /// The scan concerned, if it is one.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub scan: Option<String>,
    /// What to do about it.
    pub hint: String,
}

/// The finished model that a job adds scans to, or makes a surface of.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct JobBase {
    /// Which model it is.
    pub model_id: ModelId,
    /// Its `poses.json` as it was when the job was accepted; empty where poses don't matter.
    pub poses: Vec<u8>,
}

/// A job that is to be stored.
#[derive(Debug, Clone)]
pub struct NewJob {
    /// Its id.
    pub id: JobId,
    /// The scans it works on.
    pub scan_set_id: ScanSetId,
    /// A class label for the model it makes.
    pub label: Option<String>,
    /// What the caller chose.
    pub options: Options,
    /// The model it adds scans to; `None` if it makes one anew.
    pub base: Option<JobBase>,
    /// What a person said of the scans.
    pub hints: Hints,
}

/// A job that is to be stored, which gives a model a surface.
#[derive(Debug, Clone)]
pub struct NewSurfaceJob {
    /// Its id.
    pub id: JobId,
    /// The model whose points it takes.
    pub model_id: ModelId,
    /// A class label for the model it makes; that of the other if not given.
    pub label: Option<String>,
    /// What the caller chose.
    pub options: Options,
}

/// A stored job.
#[derive(Debug, Clone)]
pub struct JobRecord {
    /// Its id.
    pub id: JobId,
    /// What it is for.
    pub kind: JobKind,
    /// The scans it works on; `None` for an evaluation.
    pub scan_set_id: Option<ScanSetId>,
    /// A class label for the model it makes.
    pub label: Option<String>,
    /// What the caller chose.
    pub options: Options,
    /// The model it adds scans to; `None` if it makes one anew.
    pub base: Option<JobBase>,
    /// What a person said of the scans.
    pub hints: Hints,
    /// Where it stands.
    pub status: JobStatus,
    /// The step it is in, or was in when it ended.
    pub stage: Option<String>,
    /// How much is done, 0 to 1.
    pub progress: f64,
    /// Seconds spent in each stage.
    pub stage_seconds: BTreeMap<String, f64>,
    /// How often it was started.
    pub attempts: u32,
    /// Whether somebody asked for a stop.
    pub cancel_asked: bool,
    /// Why it failed.
    pub error: Option<JobError>,
    /// What it left.
    pub model_id: Option<ModelId>,
    /// When it was last started.
    pub started_at: Option<jiff::Timestamp>,
    /// When it ended.
    pub finished_at: Option<jiff::Timestamp>,
}

impl JobRecord {
    /// The model that it gives a surface, if that is what it is for.
    pub fn surfaced_model(&self) -> Option<ModelId> {
        self.base.as_ref().filter(|_| self.kind == JobKind::Surface).map(|base| base.model_id)
    }

    /// A registration that waits, of nothing yet.
    pub fn waiting(id: JobId) -> JobRecord {
        JobRecord {
            id,
            kind: JobKind::Register,
            scan_set_id: None,
            label: None,
            options: Options::default(),
            base: None,
            hints: Hints::default(),
            status: JobStatus::Queued,
            stage: None,
            progress: 0.0,
            stage_seconds: BTreeMap::new(),
            attempts: 0,
            cancel_asked: false,
            error: None,
            model_id: None,
            started_at: None,
            finished_at: None,
        }
    }

    /// The same work on a scan set, as it was asked for.
    pub fn again(&self, scan_set_id: ScanSetId) -> NewJob {
        NewJob {
            id: self.id,
            scan_set_id,
            label: self.label.clone(),
            options: self.options.clone(),
            base: self.base.clone(),
            hints: self.hints.clone(),
        }
    }
}

/// Which jobs a list shows.
#[derive(Debug, Clone, Copy, Default)]
pub struct JobFilter {
    /// Only those of this status.
    pub status: Option<JobStatus>,
    /// Only those of this scan set.
    pub scan_set_id: Option<ScanSetId>,
}

/// What asking for a stop did.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CancelAnswer {
    /// It had not begun and is canceled now.
    Canceled,
    /// Its worker has been told.
    Asked,
}
