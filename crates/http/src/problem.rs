//! Every error that leaves the service: `application/problem+json` (RFC 9457) with a stable `code`, the `scan`
//! concerned and a `hint`. Here and in `storage_problem` the layers' errors become HTTP.

use std::time::Duration;

use axum::http::StatusCode;
use axum::http::header::{self, HeaderName, HeaderValue};
use axum::response::{IntoResponse, Response};

use visage_domain::options::OptionError;
use visage_formats::{FormatError, poses, surface_names};
use visage_pipeline::PipelineError;
use visage_service::app::models::BaseError;
use visage_service::jobs::admission::AdmissionError;
use visage_shape::faces::DescribeError;
use visage_shape::standards::StandardError;

macro_rules! codes {
    ($($variant:ident = $name:literal, $status:ident, $title:literal;)*) => {
        /// What can go wrong: a closed set, stable across versions.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        #[expect(missing_docs, reason = "the titles say it")]
        pub enum Code { $($variant,)* }

        impl Code {
            /// Every code.
            pub const ALL: &[Code] = &[$(Code::$variant,)*];

            /// The name that clients see.
            pub fn name(self) -> &'static str {
                match self { $(Code::$variant => $name,)* }
            }

            /// The HTTP status it comes with.
            pub fn status(self) -> StatusCode {
                const CHECKSUM_MISMATCH: u16 = 460;
                // tus has a status of its own
                if self == Code::ChecksumMismatch && let Ok(status) = StatusCode::from_u16(CHECKSUM_MISMATCH) {
                    return status;
                }
                match self { $(Code::$variant => StatusCode::$status,)* }
            }

            /// The kind of problem in a few words; the same for each occurrence.
            pub fn title(self) -> &'static str {
                match self { $(Code::$variant => $title,)* }
            }
        }
    };
}

codes! {
    MalformedRequest = "malformed_request", BAD_REQUEST, "the request can't be read";
    DigestMismatch = "digest_mismatch", BAD_REQUEST, "the body is not what its digest says";
    ChecksumMismatch = "checksum_mismatch", BAD_REQUEST, "the piece is not what its checksum says";
    Unauthorized = "unauthorized", UNAUTHORIZED, "the request needs a valid key";
    InsufficientScope = "insufficient_scope", FORBIDDEN, "the key does not allow this";
    ForeignHost = "foreign_host", FORBIDDEN, "the request is meant for another host";
    ForeignOrigin = "foreign_origin", FORBIDDEN, "the request comes from a page of another origin";
    NotFound = "not_found", NOT_FOUND, "there is no such resource";
    NotAcceptable = "not_acceptable", NOT_ACCEPTABLE, "there is no such representation of it";
    MethodNotAllowed = "method_not_allowed", METHOD_NOT_ALLOWED, "the resource does not know this method";
    UploadStalled = "upload_stalled", REQUEST_TIMEOUT, "the body came too slowly or not to its end";
    InUse = "in_use", CONFLICT, "an unfinished job needs it";
    DuplicateStandard = "duplicate_standard", CONFLICT, "a standard has this name already";
    OriginDeleted = "origin_deleted", CONFLICT, "what it was made of is deleted, too";
    BuiltIn = "built_in", CONFLICT, "what is built in can't be changed";
    ScanChanged = "scan_changed", CONFLICT, "a scan is not the one that the model was made of";
    IndexElsewhere = "index_elsewhere", CONFLICT, "this server leaves the index to others";
    OtherUnit = "other_unit", CONFLICT, "the models are not in one unit";
    WrongStatus = "wrong_status", CONFLICT, "the job's status does not allow this";
    RequestInProgress = "request_in_progress", CONFLICT, "the same request is being worked on";
    OffsetMismatch = "offset_mismatch", CONFLICT, "the piece does not begin where the last one has ended";
    PreconditionFailed = "precondition_failed", PRECONDITION_FAILED, "the resource is not as If-Match or If-None-Match wants it";
    TooLarge = "too_large", PAYLOAD_TOO_LARGE, "the body is larger than is allowed";
    UnsupportedMediaType = "unsupported_media_type", UNSUPPORTED_MEDIA_TYPE, "the body has another type than is read here";
    RangeNotSatisfiable = "range_not_satisfiable", RANGE_NOT_SATISFIABLE, "the file is shorter than the range asked for";
    InvalidField = "invalid_field", UNPROCESSABLE_ENTITY, "a field has a value that is not allowed";
    InvalidOptions = "invalid_options", UNPROCESSABLE_ENTITY, "the options are not allowed";
    InvalidHints = "invalid_hints", UNPROCESSABLE_ENTITY, "the hints can't be used";
    InvalidName = "invalid_name", UNPROCESSABLE_ENTITY, "the file name is not allowed";
    DuplicateScan = "duplicate_scan", UNPROCESSABLE_ENTITY, "two scans have the same name";
    UnsupportedFormat = "unsupported_format", UNPROCESSABLE_ENTITY, "the file has a format that is not read here";
    UnreadableScan = "unreadable_scan", UNPROCESSABLE_ENTITY, "the file can't be read";
    SeveralScans = "several_scans", UNPROCESSABLE_ENTITY, "the file holds several scans";
    TooManyPoints = "too_many_points", UNPROCESSABLE_ENTITY, "the file has more points than are allowed";
    TooManyScans = "too_many_scans", UNPROCESSABLE_ENTITY, "the scan set has more scans than are allowed";
    TooFewScans = "too_few_scans", UNPROCESSABLE_ENTITY, "there is nothing to register with each other";
    WrongScanCount = "wrong_scan_count", UNPROCESSABLE_ENTITY, "the method takes another number of scans";
    ScaledPose = "scaled_pose", UNPROCESSABLE_ENTITY, "an initial pose holds a scale";
    UnknownReference = "unknown_reference", UNPROCESSABLE_ENTITY, "the reference is none of the scans";
    WrongBase = "wrong_base", UNPROCESSABLE_ENTITY, "the scans can't be added to this model";
    NothingToAdd = "nothing_to_add", UNPROCESSABLE_ENTITY, "the model has all scans already";
    UnreadablePoses = "unreadable_poses", UNPROCESSABLE_ENTITY, "the pose file can't be read";
    PosesFitNothing = "poses_fit_nothing", UNPROCESSABLE_ENTITY, "the pose file names none of the scans";
    KeyReused = "idempotency_key_reused", UNPROCESSABLE_ENTITY, "the idempotency key belongs to another request";
    UnknownStandard = "unknown_standard", UNPROCESSABLE_ENTITY, "there is no such standard";
    TooManyStandards = "too_many_standards", UNPROCESSABLE_ENTITY, "there are as many standards as are allowed";
    TooFewLandmarks = "too_few_landmarks", UNPROCESSABLE_ENTITY, "a class needs at least three landmarks";
    OffSurface = "off_surface", UNPROCESSABLE_ENTITY, "a landmark is not on the surface";
    NoCharacter = "no_character", UNPROCESSABLE_ENTITY, "too few landmarks are caps or pits";
    DegenerateTriangle = "degenerate_triangle", UNPROCESSABLE_ENTITY, "the landmarks span no triangle";
    TooSmallRegion = "too_small_region", UNPROCESSABLE_ENTITY, "there is too little surface around the landmarks";
    NoSignature = "no_signature", UNPROCESSABLE_ENTITY, "the model has no signature of this version";
    TooFewLabels = "too_few_labels", UNPROCESSABLE_ENTITY, "too few models have labels";
    TooManyLabels = "too_many_labels", UNPROCESSABLE_ENTITY, "too many models have labels";
    Undescribable = "undescribable_model", UNPROCESSABLE_ENTITY, "the model can't be described";
    TooLittleMemory = "too_little_memory", UNPROCESSABLE_ENTITY, "the job needs more memory than there is";
    TooManyWebhooks = "too_many_webhooks", UNPROCESSABLE_ENTITY, "there are as many webhooks as are allowed";
    ForbiddenAddress = "forbidden_address", UNPROCESSABLE_ENTITY, "this address may not be asked";
    TooManyKeys = "too_many_keys", UNPROCESSABLE_ENTITY, "there are as many keys as are allowed";
    QueueFull = "queue_full", TOO_MANY_REQUESTS, "too many jobs are waiting";
    RateLimited = "rate_limited", TOO_MANY_REQUESTS, "the key has asked for too much in too short a time";
    QuotaExceeded = "quota_exceeded", TOO_MANY_REQUESTS, "the key has as much as it may have";
    Internal = "internal", INTERNAL_SERVER_ERROR, "the server failed";
    Damaged = "damaged", INTERNAL_SERVER_ERROR, "what is stored is damaged";
    FetchFailed = "fetch_failed", BAD_GATEWAY, "the file could not be fetched";
    DatabaseLocked = "database_locked", SERVICE_UNAVAILABLE, "another program holds the database";
    StorageUnreachable = "storage_unreachable", SERVICE_UNAVAILABLE, "what keeps files or records can't be reached";
    NotReady = "not_ready", SERVICE_UNAVAILABLE, "the server is not ready yet";
    NotSearched = "not_searched", SERVICE_UNAVAILABLE, "a part of the gallery can't be searched at the moment";
    Overloaded = "overloaded", SERVICE_UNAVAILABLE, "the server has no room for the request at the moment";
    ShuttingDown = "shutting_down", SERVICE_UNAVAILABLE, "the server is shutting down";
    StorageFull = "storage_full", INSUFFICIENT_STORAGE, "the server's disk is full";
}

/// The body of every error.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize, serde::Deserialize, utoipa::ToSchema)]
#[schema(as = Problem)]
pub struct ProblemBody {
    /// A URN made of the code.
    #[serde(rename = "type")]
    #[schema(example = "urn:visage:problem:too_few_scans")]
    pub kind: String,
    /// The kind of problem in a few words; the same for each occurrence.
    #[schema(example = "there is nothing to register with each other")]
    pub title: String,
    /// The HTTP status.
    #[schema(example = 422, minimum = 400, maximum = 599)]
    pub status: u16,
    /// Stable and machine-readable.
    #[schema(example = "too_few_scans")]
    pub code: String,
    /// What went wrong this time.
    #[schema(example = "the scan set holds 1 scan(s); registration needs at least 2")]
    pub detail: String,
    /// The scan concerned, if it is one.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    #[schema(example = "bun045.ply")]
    pub scan: Option<String>,
    /// What to do about it.
    #[schema(example = "upload at least two scans that overlap")]
    pub hint: String,
}

/// An error on its way to the client. Small, since every handler's result has room for one.
#[derive(Debug)]
pub struct Problem(Box<Details>);

#[derive(Debug)]
struct Details {
    code: Code,
    detail: String,
    scan: Option<String>,
    hint: String,
    retry_after: Option<Duration>,
    header: Option<(HeaderName, HeaderValue)>,
}

impl Problem {
    /// An error of the given kind, with what went wrong and what to do about it.
    pub fn new(code: Code, detail: impl Into<String>, hint: impl Into<String>) -> Self {
        Problem(Box::new(Details {
            code,
            detail: detail.into(),
            scan: None,
            hint: hint.into(),
            retry_after: None,
            header: None,
        }))
    }

    /// Names the scan concerned.
    pub fn scan(mut self, name: impl Into<String>) -> Self {
        self.0.scan = Some(name.into());
        self
    }

    /// Says otherwise what went wrong.
    pub fn detail(mut self, detail: String) -> Self {
        self.0.detail = detail;
        self
    }

    /// Says when to try again.
    pub fn retry_after(mut self, seconds: u64) -> Self {
        self.0.retry_after = Some(Duration::from_secs(seconds));
        self
    }

    /// Adds a header to the answer.
    pub fn header(mut self, name: HeaderName, value: HeaderValue) -> Self {
        self.0.header = Some((name, value));
        self
    }

    /// What went wrong this time.
    pub fn said(&self) -> &str {
        &self.0.detail
    }

    /// The kind of error.
    pub fn code(&self) -> Code {
        self.0.code
    }

    /// A failure of ours. The client learns that it is one; the log learns what it was.
    pub fn internal(error: impl std::fmt::Display) -> Self {
        tracing::error!("internal error: {error}");
        Problem::new(
            Code::Internal,
            "an internal error; the server's log says more, under the request id of this answer",
            "try again later; if it stays, report it with the request id (header x-request-id)",
        )
    }

    /// The process is out of descriptors or memory for the moment.
    pub(super) fn shortage(error: impl std::fmt::Display) -> Self {
        tracing::error!("out of descriptors or memory: {error}");
        let detail = "the server has no descriptors or memory left for the request";
        Problem::new(Code::Overloaded, detail, "send it again in a moment").retry_after(2)
    }

    /// What a reader says about the file `name`.
    pub fn unreadable(name: &str, error: &FormatError) -> Self {
        let code = match error {
            FormatError::UnknownExtension { .. } | FormatError::Packed { .. } => Code::UnsupportedFormat,
            FormatError::TooLarge { .. } => Code::TooManyPoints,
            FormatError::TooManyBytes { .. } => Code::TooLarge,
            _ => Code::UnreadableScan,
        };
        let hint = match error {
            FormatError::UnknownExtension { .. } => format!("export the scan as {}", surface_names()),
            FormatError::Packed { .. } => format!("unpack the file and send what is in it: {}", surface_names()),
            FormatError::Malformed { remedy, .. } => remedy.clone(),
            FormatError::Truncated { .. } => "export or upload the file again".to_owned(),
            FormatError::TooLarge { .. } | FormatError::TooManyBytes { .. } => {
                "thin the scan, or ask the operator to raise the limit".to_owned()
            }
        };
        Problem::new(code, format!("{name}: {error}"), hint).scan(name)
    }

    /// A file of several scans where one is wanted.
    pub fn several_scans(name: &str, count: usize) -> Self {
        let hint = "send it as `scans` of the form POST /v1/scan-sets/upload, which makes each a scan of a set with the pose \
                    that the file gives it; or export them one by one";
        Problem::new(
            Code::SeveralScans,
            format!("{name}: the file holds {count} scans, and this is the place of one"),
            hint,
        )
        .scan(name)
    }

    /// What the reader says about a pose file; its message names the file.
    pub fn unreadable_poses(error: &FormatError) -> Self {
        let hint = match error {
            FormatError::Malformed { remedy, .. } => remedy.clone(),
            _ => poses::remedy(),
        };
        Problem::new(Code::UnreadablePoses, error.to_string(), hint)
    }
}

impl IntoResponse for Problem {
    fn into_response(self) -> Response {
        let Details { code, detail, scan, hint, retry_after, header } = *self.0;
        let status = code.status();
        let body = ProblemBody {
            kind: format!("urn:visage:problem:{}", code.name()),
            title: code.title().to_owned(),
            status: status.as_u16(),
            code: code.name().to_owned(),
            detail,
            scan,
            hint,
        };
        let mut response = (status, axum::Json(body)).into_response();
        let headers = response.headers_mut();
        headers.insert(header::CONTENT_TYPE, HeaderValue::from_static("application/problem+json"));
        if let Some(wait) = retry_after {
            headers.insert(header::RETRY_AFTER, HeaderValue::from(wait.as_secs()));
        }
        if let Some((name, value)) = header {
            headers.insert(name, value);
        }
        response
    }
}

impl From<AdmissionError> for Problem {
    fn from(error: AdmissionError) -> Self {
        let detail = error.to_string();
        match error {
            AdmissionError::TooFewScans { .. } => {
                Problem::new(Code::TooFewScans, detail, "upload at least two scans that overlap")
            }
            AdmissionError::WrongScanCount { .. } => {
                Problem::new(Code::WrongScanCount, detail, "choose two scans, or a method for several such as joint")
            }
            AdmissionError::Unreadable(error) => Problem::unreadable_poses(&error),
            AdmissionError::FitsNothing { .. } => Problem::new(
                Code::PosesFitNothing,
                detail,
                "name the poses after the scans' files, or send the scans first",
            ),
            AdmissionError::Unfit(error) => error.into(),
            AdmissionError::TooLarge(error) => error.into(),
        }
    }
}

impl From<BaseError> for Problem {
    fn from(error: BaseError) -> Self {
        let detail = error.to_string();
        match error {
            BaseError::OtherScanSet(_) => Problem::new(
                Code::WrongBase,
                detail,
                "name a model that was made from this scan set, or register without a base model",
            ),
            BaseError::NoPoses(_) => {
                Problem::new(Code::WrongBase, detail, "name a model that was registered from scans")
            }
            BaseError::Storage(error) => error.into(),
        }
    }
}

impl From<PipelineError> for Problem {
    fn from(error: PipelineError) -> Self {
        let detail = error.to_string();
        match error {
            PipelineError::Canceled(_) => Problem::shutting_down(),
            PipelineError::Unusable { code, scan, hint, .. } => {
                let named = Code::ALL.iter().copied().find(|known| known.name() == code);
                let problem = Problem::new(named.unwrap_or(Code::InvalidOptions), detail, hint);
                match scan {
                    Some(scan) => problem.scan(scan),
                    None => problem,
                }
            }
        }
    }
}

impl From<OptionError> for Problem {
    fn from(error: OptionError) -> Self {
        Problem::new(Code::InvalidOptions, error.to_string(), "GET /v1/info lists all options with types and ranges")
    }
}

impl From<DescribeError> for Problem {
    fn from(error: DescribeError) -> Self {
        match error {
            DescribeError::Canceled(_) => Problem::shutting_down(),
            DescribeError::Degenerate(reason) => {
                Problem::new(Code::Undescribable, reason, "send a mesh or cloud with more of the surface")
            }
        }
    }
}

impl From<StandardError> for Problem {
    fn from(error: StandardError) -> Self {
        let detail = error.to_string();
        let (code, hint) = match error {
            StandardError::Canceled(_) => return Problem::shutting_down(),
            StandardError::Degenerate(_) => (Code::Undescribable, "send a mesh or cloud with more of the surface"),
            StandardError::TooFewLandmarks(_) => {
                (Code::TooFewLandmarks, "name at least three caps or pits of the surface")
            }
            StandardError::UnknownCorner(_) => (Code::InvalidField, "name three different ones of the landmarks"),
            StandardError::OffSurface { .. } => {
                (Code::OffSurface, "give positions in the coordinates and the unit of the file")
            }
            StandardError::NoCharacter { .. } => (
                Code::NoCharacter,
                "choose places that stand out or are hollow in every direction: tips, corners, dents",
            ),
            StandardError::TooClose { .. } | StandardError::InLine => {
                (Code::DegenerateTriangle, "choose landmarks farther apart and not in a line, or send a smaller part")
            }
            StandardError::TooSmallRegion { .. } => {
                (Code::TooSmallRegion, "send more of the surface around the landmarks, or choose them farther apart")
            }
        };
        Problem::new(code, detail, hint)
    }
}

impl Problem {
    /// The server takes on nothing new.
    pub fn shutting_down() -> Self {
        Problem::new(Code::ShuttingDown, "the server is shutting down", "try again in a moment").retry_after(5)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_service::storage::DatabaseError;

    #[test]
    fn codes_are_unique_and_are_errors() {
        let mut names: Vec<&str> = Code::ALL.iter().map(|code| code.name()).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), Code::ALL.len());
        assert!(Code::ALL.iter().all(|code| code.status().as_u16() >= 400));
    }

    #[tokio::test]
    async fn an_error_is_problem_json() {
        let problem = Problem::from(DatabaseError::QueueFull { limit: 3 }).scan("a.ply");
        let response = problem.into_response();
        assert_eq!(response.status(), StatusCode::TOO_MANY_REQUESTS);
        assert_eq!(response.headers()[header::CONTENT_TYPE], "application/problem+json");
        assert_eq!(response.headers()[header::RETRY_AFTER], "10");
        let body = axum::body::to_bytes(response.into_body(), 10_000).await.expect("a body");
        let body: ProblemBody = serde_json::from_slice(&body).expect("JSON");
        assert_eq!((body.code.as_str(), body.status), ("queue_full", 429));
        assert_eq!(body.scan.as_deref(), Some("a.ply"));
        assert!(!body.hint.is_empty());
    }

    #[tokio::test]
    async fn a_failure_of_ours_tells_no_secrets() {
        let problem = Problem::from(DatabaseError::Damaged { what: "a unit", reason: "secret".to_owned() });
        let body = axum::body::to_bytes(problem.into_response().into_body(), 10_000).await.expect("a body");
        assert!(!String::from_utf8_lossy(&body).contains("secret"));
    }
}
