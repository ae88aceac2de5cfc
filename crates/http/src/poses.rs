//! `/v1/scan-sets/{id}/poses` and `/pose-file`: the initial poses of a scan set.

use axum::Json;
use axum::extract::{Request, State};
use axum::response::{IntoResponse, Response};

use super::body::read_body;
use super::conditions::{ConditionHeaders, Conditions, ETag};
use super::extract::{Path, is_json, media_type};
use super::problem::{Code, Problem};
use super::responses;
use super::scan_set_views::PosesView;
use super::scan_sets::{TAG, fit_poses, parse_id};
use super::schemas::{FileContent, Poses};
use super::state::AppState;
use visage_domain::asset::Asset;
use visage_domain::{PoseFile, ScanSetRecord};
use visage_formats::poses::remedy;

/// Set the initial poses of a scan set.
///
/// Matrices may also be flat lists of 16 numbers, and all of it may stand in `{"poses": {...}}`. Any other pose file as
/// for `PUT /v1/scan-sets/{id}/pose-file` is taken here too.
#[utoipa::path(
    put, path = "/v1/scan-sets/{id}/poses", tag = TAG, operation_id = "putPoses",
    params(("id" = String, Path, format = "uuid", description = "The scan set."), ConditionHeaders),
    request_body(content = Poses, description = "The poses.", example = json!({
        "bun000.ply": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]],
        "bun045.ply": [[0.83, 0, 0.56, -0.05], [0, 1, 0, 0], [-0.56, 0, 0.83, -0.01], [0, 0, 0, 1]],
    })),
    responses(
        (status = 200, description = "The poses are stored.", body = PosesView,
         headers(("ETag" = String, description = "Changes with the content."))),
        responses::BadRequest, responses::NotFound, responses::Stalled, responses::Conflict, responses::OtherState,
        responses::TooLarge, responses::Unprocessable, responses::Other,
    )
)]
pub(super) async fn put_poses(
    State(state): State<AppState>,
    Path(id): Path<String>,
    conditions: Conditions,
    request: Request,
) -> Result<Response, Problem> {
    store_poses(state, &id, &conditions, request).await
}

/// Set the initial poses of a scan set by a pose file of any format.
///
/// JSON `{"scan name": 4x4}` or `{"poses": {...}}`, text blocks of a name and 4 rows, a Stanford `.conf`, MeshLab's `.aln` and
/// `.mlp`, Open3D's `.log`, pose graphs and trajectories, TUM, KITTI, COLMAP's `images.txt`, `transforms.json` or a table with a
/// header. It is recognised by the content, whatever the `Content-Type`. A pose maps its scan into the world frame; matrices are
/// row-major. Poses without names are those of the scans in natural order, if there are as many: send the scans first.
#[utoipa::path(
    put, path = "/v1/scan-sets/{id}/pose-file", tag = TAG, operation_id = "putPoseFile",
    params(("id" = String, Path, format = "uuid", description = "The scan set."), ConditionHeaders),
    request_body(content = inline(FileContent), content_type = "application/octet-stream",
                 description = "The pose file."),
    responses(
        (status = 200, description = "The poses are stored.", body = PosesView,
         headers(("ETag" = String, description = "Changes with the content."))),
        responses::BadRequest, responses::NotFound, responses::Stalled, responses::Conflict, responses::OtherState,
        responses::TooLarge, responses::Unprocessable, responses::Other,
    )
)]
pub(super) async fn put_pose_file(
    State(state): State<AppState>,
    Path(id): Path<String>,
    conditions: Conditions,
    request: Request,
) -> Result<Response, Problem> {
    store_poses(state, &id, &conditions, request).await
}

async fn store_poses(
    state: AppState,
    id: &str,
    conditions: &Conditions,
    request: Request,
) -> Result<Response, Problem> {
    let id = parse_id(id)?;
    // before all of it is sent in vain
    conditions.check(poses_tag(&state.context.database.scan_set(id).await?).as_ref())?;
    let is_json = is_json(&media_type(request.headers()));
    let content = read_body(&state, request, state.limits().pose_file_bytes).await?.to_vec();
    if content.is_empty() {
        return Err(Problem::new(Code::UnreadablePoses, "the pose file is empty", remedy()));
    }
    let poses = PoseFile { name: if is_json { Asset::Poses.name().into() } else { "poses".to_owned() }, content };
    let _turn = conditions.turn(&state).await?;
    let set = state.context.database.scan_set(id).await?;
    conditions.check(poses_tag(&set).as_ref())?;
    let names: Vec<&str> = set.scans.iter().map(|scan| scan.name.as_str()).collect();
    let fit = fit_poses(&names, &poses)?;
    state.context.database.put_poses(id, &poses).await?;
    let etag = ETag::of_bytes(&poses.content).header()?;
    Ok(([etag], Json(PosesView::of(&poses.name, &fit))).into_response())
}

/// The tag of a set's pose file, if it has one.
fn poses_tag(set: &ScanSetRecord) -> Option<ETag> {
    set.poses.as_ref().map(|poses| ETag::of_bytes(&poses.content))
}
