//! What a job is for.

use visage_geometry::names::UnknownName;

/// What a job is for.
#[derive(
    Debug,
    Clone,
    Copy,
    Default,
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
#[strum(serialize_all = "snake_case", parse_err_ty = UnknownName, parse_err_fn = no_kind)]
pub enum JobKind {
    /// Makes a model of a scan set.
    #[default]
    Register,
    /// Gives a stored model a surface, as a model of its own.
    Surface,
    /// Brings what is known of the stored models up to date: signatures of another version, and verdicts against
    /// standards.
    Evaluate,
}

impl JobKind {
    /// The name used in tables and in the API.
    pub fn name(self) -> &'static str {
        self.into()
    }
}

fn no_kind(text: &str) -> UnknownName {
    UnknownName::of::<JobKind>("kind of job", text)
}
