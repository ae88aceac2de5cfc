//! Files that come piece by piece, by the protocol tus 1.0 (tus.io) with its extensions creation, expiration, checksum and
//! termination: a lost connection costs only what was under way, and so does a server that was killed. When all of a file has
//! arrived it becomes a scan, as if it had been put.
//!
//! - `resource`: they are begun, listed, looked at, given up; `pieces`: what arrives of them
//! - `tus`: the headers of the protocol; `receivers`: one request at a time adds to a file

mod pieces;
mod receivers;
mod resource;
mod tus;

use axum::middleware::from_fn;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::problem::Problem;
use super::state::AppState;
use visage_domain::{UploadId, UploadRecord};
use visage_service::storage::DatabaseError;

pub use receivers::Receivers;

/// Where the uploads of a set are.
pub const OF_SET: &str = "/v1/scan-sets/{id}/uploads";
/// Where one is.
pub const ONE: &str = "/v1/uploads/{id}";

/// The routes of this resource.
pub fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new()
        .routes(routes!(resource::create, resource::list, resource::capabilities))
        .routes(routes!(resource::look, resource::give_up, pieces::add))
        .layer(from_fn(tus::spoken))
}

fn parse_id(text: &str) -> Result<UploadId, Problem> {
    UploadId::parse(text).ok_or_else(|| not_found(&text.chars().take(64).collect::<String>()))
}

/// The upload of this id, if it is still waited for.
async fn record(state: &AppState, id: UploadId) -> Result<UploadRecord, Problem> {
    let upload = state.context.database.upload(id).await?;
    if upload.expires_at <= jiff::Timestamp::now() {
        return Err(not_found(&id.to_string()));
    }
    Ok(upload)
}

fn not_found(id: &str) -> Problem {
    DatabaseError::NotFound { kind: "upload", id: id.to_owned() }.into()
}
