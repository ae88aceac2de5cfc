//! Jobs as they go over the wire.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::base::link;
use super::hint_views::HintsView;
use super::option_views::OptionsView;
use super::scan_set_views::UnitView;
use super::schemas::{self, ShortText};
use visage_domain::{JobBase, JobError, JobId, JobKind, JobRecord, JobStatus, NewJob, NewSurfaceJob};
use visage_pipeline::{Hints, Options};

/// What is to be done.
#[derive(Debug, Clone, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct NewJobBody {
    /// What it is for; an `evaluate` job takes no other field, a `surface` job `model_id`, `options` and `label`.
    #[serde(default)]
    #[schema(required = false)]
    pub kind: JobKind,
    /// The scans to be registered; required of a `register` job.
    #[schema(format = "uuid")]
    pub scan_set_id: Option<String>,
    /// A finished model of the same scan set that scans are added to: its poses stay, to the last bit, and only scans
    /// without one are registered, onto the others.
    #[schema(format = "uuid")]
    pub base_model_id: Option<String>,
    /// The model that a `surface` job makes a mesh of.
    #[schema(format = "uuid")]
    pub model_id: Option<String>,
    /// Choices; `GET /v1/info` lists them with types, ranges and defaults.
    #[schema(value_type = Option<OptionsView>)]
    pub options: Option<serde_json::Value>,
    /// What a person says of the scans: picked points, pairs that overlap, regions to use or to leave.
    #[schema(value_type = Option<HintsView>)]
    pub hints: Option<serde_json::Value>,
    /// A class label for the model, such as `face`.
    #[schema(value_type = Option<ShortText>)]
    pub label: Option<String>,
}

/// The form by which scans are stored and registered in one call.
#[derive(Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[expect(dead_code, reason = "only describes the form")]
pub struct NewJobForm {
    #[schema(schema_with = schemas::scans_to_register)]
    scans: Vec<Vec<u8>>,
    /// The initial poses: a pose file of any kind. Scans without one are placed by their surface.
    #[schema(required = false, value_type = String, format = Binary)]
    poses: Vec<u8>,
    /// The options as JSON.
    #[schema(required = false, value_type = OptionsView)]
    options: serde_json::Value,
    /// The hints as JSON.
    #[schema(required = false, value_type = HintsView)]
    hints: serde_json::Value,
    /// A class label for the model.
    #[schema(required = false, value_type = ShortText)]
    label: String,
    /// A name for people.
    #[schema(required = false, value_type = ShortText)]
    name: String,
    /// The unit of all scans; not known if not given.
    #[schema(required = false)]
    unit: UnitView,
}

/// A job.
#[derive(Debug, Clone, Serialize, ToSchema)]
#[schema(as = Job)]
pub struct JobView {
    /// Its id.
    #[schema(format = "uuid")]
    pub id: String,
    /// What it is for.
    pub kind: JobKind,
    /// Where it stands.
    pub status: JobStatus,
    /// The step it is in, or was in when it ended; null before it begins.
    #[schema(example = "registering")]
    pub stage: Option<String>,
    /// How much is done, 0 to 1.
    #[schema(minimum = 0, maximum = 1)]
    pub progress: f64,
    /// Seconds spent in each stage so far.
    pub seconds: BTreeMap<String, f64>,
    /// How often it was started: more than once after a crash of the server.
    pub attempts: u32,
    /// Whether a stop was asked for.
    pub cancel_asked: bool,
    /// The scans it works on; null for an evaluation and a `surface` job.
    #[schema(format = "uuid")]
    pub scan_set_id: Option<String>,
    /// The model it adds scans to, or makes a mesh of; null if it makes one anew.
    #[schema(format = "uuid")]
    pub base_model_id: Option<String>,
    /// What it left; null until it has succeeded, or when that model was deleted.
    #[schema(format = "uuid")]
    pub model_id: Option<String>,
    /// Why it failed; null unless it did.
    pub error: Option<JobError>,
    /// The class label for the model.
    pub label: Option<String>,
    /// The options in force.
    #[schema(value_type = OptionsView)]
    pub options: Options,
    /// What a person said of the scans; null if nothing was said.
    #[schema(value_type = Option<HintsView>)]
    pub hints: Option<Hints>,
    /// When it was accepted.
    #[schema(format = DateTime)]
    pub created_at: String,
    /// When it was last started.
    #[schema(format = DateTime)]
    pub started_at: Option<String>,
    /// When it ended.
    #[schema(format = DateTime)]
    pub finished_at: Option<String>,
    /// Where to go from here.
    pub links: JobLinks,
}

/// Addresses of a job.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct JobLinks {
    /// The job itself.
    #[serde(rename = "self")]
    pub self_: String,
    /// Its progress as server-sent events.
    pub events: String,
    /// POST here to stop it.
    pub cancel: String,
    /// POST here to run it again after it failed or was canceled.
    pub retry: String,
    /// Its scans; null for an evaluation.
    pub scan_set: Option<String>,
    /// What it left.
    pub model: Option<String>,
}

/// The address of a job.
pub fn address(id: JobId) -> String {
    link(&format!("/v1/jobs/{id}"))
}

impl JobView {
    /// A stored job.
    pub fn of(job: &JobRecord) -> Self {
        let self_ = address(job.id);
        JobView {
            id: job.id.to_string(),
            kind: job.kind,
            status: job.status,
            stage: job.stage.clone(),
            progress: (job.progress * 1e4).round() / 1e4,
            seconds: job.stage_seconds.clone(),
            attempts: job.attempts,
            cancel_asked: job.cancel_asked,
            scan_set_id: job.scan_set_id.map(|id| id.to_string()),
            base_model_id: job.base.as_ref().map(|base| base.model_id.to_string()),
            model_id: job.model_id.map(|id| id.to_string()),
            error: job.error.clone(),
            label: job.label.clone(),
            options: job.options.clone(),
            hints: (!job.hints.is_empty()).then(|| job.hints.clone()),
            created_at: job.id.created_at().to_string(),
            started_at: job.started_at.map(|time| time.to_string()),
            finished_at: job.finished_at.map(|time| time.to_string()),
            links: JobLinks {
                events: format!("{self_}/events"),
                cancel: format!("{self_}/cancel"),
                retry: format!("{self_}/retry"),
                scan_set: job.scan_set_id.map(super::scan_set_views::address),
                model: job.model_id.map(super::model_views::address),
                self_,
            },
        }
    }

    /// A job that is about to be stored, which gives a model a surface.
    pub fn of_new_surface(job: &NewSurfaceJob) -> Self {
        Self::of(&JobRecord {
            kind: JobKind::Surface,
            scan_set_id: None,
            label: job.label.clone(),
            options: job.options.clone(),
            base: Some(JobBase { model_id: job.model_id, poses: Vec::new() }),
            ..JobRecord::waiting(job.id)
        })
    }

    /// A job that is about to be stored.
    pub fn of_new(job: &NewJob) -> Self {
        Self::of(&JobRecord {
            scan_set_id: Some(job.scan_set_id),
            label: job.label.clone(),
            options: job.options.clone(),
            base: job.base.clone(),
            hints: job.hints.clone(),
            ..JobRecord::waiting(job.id)
        })
    }
}

/// A page of jobs.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct JobList {
    /// Newest first.
    pub items: Vec<JobView>,
    /// What to send as `cursor` for the next page; null on the last one.
    pub next_cursor: Option<String>,
}
