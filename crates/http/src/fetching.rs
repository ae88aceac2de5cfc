//! `/v1/scan-sets/{id}/scans/{name}/source`: a scan that the service itself fetches, from where the operator allows.

use axum::extract::{Request, State};
use axum::http::{StatusCode, header};
use axum::response::Response;
use serde::Deserialize;
use utoipa::ToSchema;

use super::body;
use super::conditions::{ConditionHeaders, Conditions};
use super::extract::{Path, read_json};
use super::names;
use super::outgoing::{Dialer, Download, download};
use super::problem::{Code, Problem};
use super::responses;
use super::scan_set_views::ScanView;
use super::scan_sets::{TAG, parse_id};
use super::scans;
use super::schemas::ScanName;
use super::state::AppState;
use visage_service::config::Address;

/// Where scans are fetched.
pub const PLACE: &str = "/v1/scan-sets/{id}/scans/{name}/source";

/// Where a scan is.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SourceBody {
    /// Its address: https, or what else the operator allows. One that is signed for a while, as object stores give them out, is fine.
    #[schema(example = "https://data.example/scans/bun045.ply", max_length = 2000)]
    url: String,
}

/// Fetch one scan from an address, and add it or replace the one of the same name.
///
/// The server asks for the file itself, if its operator allows that address (`fetch_from` of `GET /v1/info`), follows no redirect, and
/// answers when the scan is kept. The limits of uploads hold. Retryable, as if the scan was put.
#[utoipa::path(
    put, path = "/v1/scan-sets/{id}/scans/{name}/source", tag = TAG, operation_id = "fetchScan",
    params(("id" = String, Path, format = "uuid", description = "The scan set."),
           ("name" = ScanName, Path, description = "The scan's file name, or its path with slashes as %2F; its ending tells the format."),
           ConditionHeaders),
    request_body(content = SourceBody),
    responses(
        (status = 200, description = "It replaces the scan of the same name.", body = ScanView,
         headers(("ETag" = String, description = "Changes with the content."))),
        (status = 201, description = "It is added.", body = ScanView,
         headers(("ETag" = String, description = "Changes with the content."))),
        responses::BadRequest, responses::NotFound, responses::Stalled, responses::Conflict, responses::OtherState,
        responses::TooLarge, responses::WrongType, responses::Unprocessable, responses::NotFetched, responses::Other,
    )
)]
pub(super) async fn fetch(
    State(state): State<AppState>,
    Path((id, name)): Path<(String, String)>,
    conditions: Conditions,
    request: Request,
) -> Result<Response, Problem> {
    let id = parse_id(&id)?;
    let name = names::scan_name(&name)?;
    let (SourceBody { url }, _) = read_json::<SourceBody>(&state, request).await?;
    let (dialer, address) = allowed(&state, &url)?;
    scans::check_place(&state, id, &name, &conditions).await?;
    let edge = state.context.config.edge;
    let found = download(dialer, &address, edge.body_stall).await;
    let found = found.map_err(|error| not_fetched(&address, &name, &error.to_string()))?;
    let file = file_of(found, &state, &address, &name)?;
    let staged = scans::receive(&state, &name, file).await.map_err(|problem| match problem.code() {
        // what is said of bodies is meant for who sends them
        Code::UploadStalled | Code::MalformedRequest => not_fetched(&address, &name, problem.said()),
        _ => problem,
    })?;
    scans::store(state, id, name, staged, conditions).await
}

/// The address that is meant, if the operator allows it.
fn allowed<'s>(state: &'s AppState, url: &str) -> Result<(&'s Dialer, Address), Problem> {
    let address: Address = url.parse().map_err(|error: visage_service::config::NoAddress| {
        Problem::new(
            Code::InvalidField,
            format!("url: {error}"),
            "send an address such as https://data.example/scans/bun045.ply",
        )
    })?;
    let sources = &state.context.config.fetch_from;
    let is_allowed = sources.iter().any(|source| source.holds(&address));
    state.dialer.as_ref().filter(|_| is_allowed).map(|dialer| (dialer, address)).ok_or_else(|| {
        let listed = sources.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
        let hint = match listed.is_empty() {
            true => {
                "send the scan itself, or ask the operator to allow addresses to fetch from (--fetch-from)".to_owned()
            }
            false => {
                format!("name a file below one of these: {listed}; or ask the operator to allow more (--fetch-from)")
            }
        };
        Problem::new(Code::ForbiddenAddress, "nothing is fetched from this address", hint)
    })
}

/// An answer as if its file was sent to us, no slower than files have to be sent.
fn file_of(found: Download, state: &AppState, address: &Address, name: &str) -> Result<Request, Problem> {
    let Download { status, headers, body } = found;
    let refused = |why: &str| Err(not_fetched(address, name, why));
    match status {
        StatusCode::OK => {}
        moved if moved.is_redirection() => {
            return refused(&format!("it answered {moved}, and redirects are not followed"));
        }
        other => return refused(&format!("it answered {other}")),
    }
    if headers.get(header::CONTENT_ENCODING).is_some_and(|coding| coding != "identity") {
        return refused("it sends the file packed (Content-Encoding), though it was asked not to");
    }
    let length = headers.get(header::CONTENT_LENGTH).and_then(|length| length.to_str().ok()?.parse().ok());
    if length.is_some_and(|length: u64| length > state.limits().file_bytes) {
        return Err(Problem::file_too_large(name, state.limits().file_bytes));
    }
    let mut request = Request::new(body::at_least_so_fast(body, state.context.config.edge));
    *request.headers_mut() = headers;
    Ok(request)
}

fn not_fetched(address: &Address, name: &str, why: &str) -> Problem {
    // what follows the path may be what opens it
    let shown = format!("{}://{}{}", if address.is_secure { "https" } else { "http" }, address.host, path_of(address));
    let hint = "see that the address is right and that the service may read it; or send the scan itself";
    Problem::new(Code::FetchFailed, format!("{shown} could not be fetched: {why}"), hint).scan(name)
}

fn path_of(address: &Address) -> &str {
    address.target.split('?').next().unwrap_or_default()
}
