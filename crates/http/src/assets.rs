//! `/v1/models/{id}/{file}`: files of models, an operation a media type, with `ETag` and single ranges.

use axum::body::Body;
use axum::extract::State;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use tokio::io::{AsyncReadExt, AsyncSeekExt};
use tokio_util::io::ReaderStream;

use super::conditions::{ConditionHeaders, Conditions, ETag};
use super::extract::Path;
use super::model_views::media_type;
use super::models::{TAG, parse_id};
use super::problem::{Code, Problem};
use super::responses;
use super::schemas::{FileContent, Poses, SurfaceFile};
use super::state::AppState;
use visage_domain::asset::Asset;
use visage_service::storage::AssetReader;

/// How much is read from disk at a time.
const CHUNK: usize = 256 << 10;

/// Which part of a file is sent, as the contract describes it.
#[derive(utoipa::IntoParams)]
#[into_params(parameter_in = Header)]
#[expect(dead_code, reason = "only describes the headers")]
struct PartHeaders {
    /// One range of bytes.
    #[param(rename = "Range", required = false, example = "bytes=0-1023")]
    range: String,
    /// The ETag for which the range is wanted.
    #[param(rename = "If-Range", required = false)]
    if_range: String,
}

/// The address of a file in the table of routes.
fn address(asset: Asset) -> String {
    format!("/v1/models/{{id}}/{}", asset.name())
}

/// Fetch the poses of a registered model.
#[utoipa::path(
    get, path = address(Asset::Poses), tag = TAG, operation_id = "getModelPoses",
    params(("id" = String, Path, format = "uuid", description = "The model."), ConditionHeaders),
    responses(
        (status = 200, description = "The poses.", body = Poses,
         headers(("ETag" = String, description = "Changes with the content."))),
        responses::Unchanged, responses::NotFound, responses::OtherState, responses::BadRange, responses::Other,
    )
)]
pub async fn get_poses(
    State(state): State<AppState>,
    Path(id): Path<String>,
    conditions: Conditions,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    send(state, &id, &Asset::Poses.name(), &conditions, &headers).await
}

/// Fetch the poses of a registered model in Stanford's format.
///
/// There is none where a scan's name has a blank or a view a scale, which that format can't hold.
#[utoipa::path(
    get, path = address(Asset::PosesConf), tag = TAG, operation_id = "getModelConf",
    params(("id" = String, Path, format = "uuid", description = "The model."), ConditionHeaders),
    responses(
        (status = 200, description = "The pose file.", body = String, content_type = "text/plain",
         headers(("ETag" = String, description = "Changes with the content."))),
        responses::Unchanged, responses::NotFound, responses::OtherState, responses::BadRange, responses::Other,
    )
)]
pub async fn get_conf(
    State(state): State<AppState>,
    Path(id): Path<String>,
    conditions: Conditions,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    send(state, &id, &Asset::PosesConf.name(), &conditions, &headers).await
}

/// Fetch the report on a registration.
#[utoipa::path(
    get, path = address(Asset::Report), tag = TAG, operation_id = "getModelReport",
    params(("id" = String, Path, format = "uuid", description = "The model."), ConditionHeaders),
    responses(
        (status = 200, description = "`result` (the same for the same scans) and `run` (times, memory, host).",
         body = Object, headers(("ETag" = String, description = "Changes with the content."))),
        responses::Unchanged, responses::NotFound, responses::OtherState, responses::BadRange, responses::Other,
    )
)]
pub async fn get_report(
    State(state): State<AppState>,
    Path(id): Path<String>,
    conditions: Conditions,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    send(state, &id, &Asset::Report.name(), &conditions, &headers).await
}

/// Fetch the surface of a model.
///
/// `cloud.ply` and `mesh.ply` of a registered model; of an uploaded one the file itself, as `mesh` or `cloud` with its own ending.
/// `GET /v1/models/{id}` lists what there is.
#[utoipa::path(
    get, path = "/v1/models/{id}/{file}", tag = TAG, operation_id = "getModelFile",
    params(("id" = String, Path, format = "uuid", description = "The model."),
           ("file" = SurfaceFile, Path, description = "The file."), ConditionHeaders, PartHeaders),
    responses(
        (status = 200, description = "The file.", body = inline(FileContent), content_type = "application/octet-stream",
         headers(("ETag" = String, description = "Changes with the content."))),
        (status = 206, description = "The range that was asked for.", body = inline(FileContent),
         content_type = "application/octet-stream",
         headers(("Content-Range" = String, description = "Which bytes of how many."))),
        responses::Unchanged, responses::NotFound, responses::OtherState, responses::BadRange, responses::Other,
    )
)]
pub async fn get_surface(
    State(state): State<AppState>,
    Path((id, file)): Path<(String, String)>,
    conditions: Conditions,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    send(state, &id, &file, &conditions, &headers).await
}

/// Any file of a model, whole or a part of it.
pub(super) async fn send(
    state: AppState,
    id: &str,
    asset: &str,
    conditions: &Conditions,
    headers: &HeaderMap,
) -> Result<Response, Problem> {
    let id = parse_id(id)?;
    let missing = || {
        let detail = format!("model {id} has no file {:?}", asset.chars().take(64).collect::<String>());
        Problem::new(Code::NotFound, detail, format!("GET /v1/models/{id} lists its files"))
    };
    let known = state.context.database.assets(id).await?;
    let record = known.into_iter().find(|record| record.name == asset).ok_or_else(missing)?;
    let delivery = Delivery {
        etag: ETag::of_checksum(&record.checksum),
        media_type: media_type(&record.name),
        name: record.name.clone(),
        by_accept: false,
    };
    if let Some(unchanged) = delivery.unchanged(conditions)? {
        return Ok(unchanged.into_response());
    }
    let file = state.context.objects.open_asset(id, &record).await?.ok_or_else(missing)?;
    delivery.send(record.bytes, file, conditions, headers).await
}

/// A file on its way to a client.
pub(super) struct Delivery {
    /// What it is called.
    pub name: String,
    /// Its tag.
    pub etag: ETag,
    /// The media type that it is sent as.
    pub media_type: &'static str,
    /// Whether `Accept` has a say in what is sent.
    pub by_accept: bool,
}

impl Delivery {
    fn headers(&self) -> Result<HeaderMap, Problem> {
        let mut answer = HeaderMap::from_iter([self.etag.header()?]);
        answer.insert(header::ACCEPT_RANGES, HeaderValue::from_static("bytes"));
        // the content under an address never changes, but deleting must be seen: always ask again
        answer.insert(header::CACHE_CONTROL, HeaderValue::from_static("private, no-cache"));
        if self.by_accept {
            answer.insert(header::VARY, HeaderValue::from_static("accept"));
        }
        Ok(answer)
    }

    /// The answer to a client that knows the content; an error for one that wants another.
    pub fn unchanged(&self, conditions: &Conditions) -> Result<Option<(StatusCode, HeaderMap)>, Problem> {
        conditions.check_match(Some(&self.etag))?;
        conditions.knows(&self.etag).then(|| Ok((StatusCode::NOT_MODIFIED, self.headers()?))).transpose()
    }

    /// Sends it, whole or a part of it.
    pub async fn send(
        self,
        bytes: u64,
        mut file: Box<dyn AssetReader>,
        conditions: &Conditions,
        headers: &HeaderMap,
    ) -> Result<Response, Problem> {
        if let Some(unchanged) = self.unchanged(conditions)? {
            return Ok(unchanged.into_response());
        }
        let mut answer = self.headers()?;
        answer.insert(header::CONTENT_TYPE, HeaderValue::from_static(self.media_type));
        // an upload of somebody else's must never be run as a page
        answer.insert(header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
        let wanted = headers
            .get(header::RANGE)
            .filter(|_| headers.get(header::IF_RANGE).is_none_or(|known| self.etag.is_given_by(known)))
            .and_then(|range| range.to_str().ok());
        let (status, first, length) = match wanted.map_or(Wanted::All, |range| parse_range(range, bytes)) {
            Wanted::All => (StatusCode::OK, 0, bytes),
            Wanted::Part { first, last } => {
                answer.insert(header::CONTENT_RANGE, content_range(&format!("{first}-{last}"), bytes)?);
                (StatusCode::PARTIAL_CONTENT, first, last - first + 1)
            }
            Wanted::Nothing => {
                let detail = format!("{} has {bytes} bytes", self.name);
                let problem = Problem::new(Code::RangeNotSatisfiable, detail, "ask for a range within the file");
                return Err(problem.header(header::CONTENT_RANGE, content_range("*", bytes)?));
            }
        };
        answer.insert(header::CONTENT_LENGTH, length.into());
        file.seek(std::io::SeekFrom::Start(first)).await.map_err(Problem::internal)?;
        let body = Body::from_stream(ReaderStream::with_capacity(file.take(length), CHUNK));
        Ok((status, answer, body).into_response())
    }
}

fn content_range(range: &str, bytes: u64) -> Result<HeaderValue, Problem> {
    HeaderValue::try_from(format!("bytes {range}/{bytes}")).map_err(Problem::internal)
}

/// What a `Range` header asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Wanted {
    All,
    Part { first: u64, last: u64 },
    Nothing,
}

/// Reads a `Range` header. What is not one range of bytes is ignored, as RFC 9110 allows: the whole file is sent.
fn parse_range(range: &str, bytes: u64) -> Wanted {
    let Some((first, last)) = range.strip_prefix("bytes=").and_then(|range| range.trim().split_once('-')) else {
        return Wanted::All;
    };
    let end = bytes.saturating_sub(1);
    let part = match (first.parse::<u64>(), last.parse::<u64>()) {
        (Ok(first), Ok(last)) if first <= last => (first, last.min(end)),
        (Ok(first), Err(_)) if last.is_empty() => (first, end),
        (Err(_), Ok(suffix)) if first.is_empty() => {
            if suffix == 0 {
                return Wanted::Nothing;
            }
            (bytes.saturating_sub(suffix), end)
        }
        _ => return Wanted::All,
    };
    if part.0 >= bytes { Wanted::Nothing } else { Wanted::Part { first: part.0, last: part.1 } }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_of_rfc_9110() {
        assert_eq!(parse_range("bytes=0-4", 10), Wanted::Part { first: 0, last: 4 });
        assert_eq!(parse_range("bytes=4-", 10), Wanted::Part { first: 4, last: 9 });
        assert_eq!(parse_range("bytes=-3", 10), Wanted::Part { first: 7, last: 9 });
        assert_eq!(parse_range("bytes=-30", 10), Wanted::Part { first: 0, last: 9 });
        assert_eq!(parse_range("bytes=5-100", 10), Wanted::Part { first: 5, last: 9 });
        assert_eq!(parse_range("bytes=10-", 10), Wanted::Nothing);
        assert_eq!(parse_range("bytes=-0", 10), Wanted::Nothing);
        assert_eq!(parse_range("bytes=0-", 0), Wanted::Nothing);
    }

    #[test]
    fn what_is_no_single_range_is_ignored() {
        for range in ["bytes=5-3", "bytes=0-1,4-5", "lines=0-1", "bytes=a-b", "bytes=-", "bytes", "bytes=--5"] {
            assert_eq!(parse_range(range, 10), Wanted::All, "{range}");
        }
    }
}
