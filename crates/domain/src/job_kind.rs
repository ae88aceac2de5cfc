//! What a job is for.

/// What a job is for.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "snake_case")]
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
        match self {
            JobKind::Register => "register",
            JobKind::Surface => "surface",
            JobKind::Evaluate => "evaluate",
        }
    }
}

impl std::str::FromStr for JobKind {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        [JobKind::Register, JobKind::Surface, JobKind::Evaluate]
            .into_iter()
            .find(|kind| kind.name() == text)
            .ok_or_else(|| format!("{text:?} is no kind of a job"))
    }
}
