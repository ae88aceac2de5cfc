//! Where a job stands.

use visage_geometry::names::UnknownName;

/// Where a job stands.
#[derive(
    Debug,
    Clone,
    Copy,
    PartialEq,
    Eq,
    Hash,
    serde::Serialize,
    serde::Deserialize,
    utoipa::ToSchema,
    strum::VariantArray,
    strum::IntoStaticStr,
    strum::EnumString,
)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case", parse_err_ty = UnknownName, parse_err_fn = no_status)]
pub enum JobStatus {
    /// Waits for a worker.
    Queued,
    /// Is being worked on.
    Running,
    /// Has left a model.
    Succeeded,
    /// Has ended with an error.
    Failed,
    /// Was stopped on request.
    Canceled,
}

impl JobStatus {
    /// The name used in tables, in the API and in logs.
    pub fn name(self) -> &'static str {
        self.into()
    }

    /// Whether nothing more will happen by itself.
    pub fn is_finished(self) -> bool {
        matches!(self, JobStatus::Succeeded | JobStatus::Failed | JobStatus::Canceled)
    }
}

fn no_status(text: &str) -> UnknownName {
    UnknownName::of::<JobStatus>("status of a job", text)
}
