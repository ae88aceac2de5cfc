//! `/v1/models/{id}/cloud`, `/mesh`, `/poses` and `/scans`: what is stored of a model in the format that a client wants.

use axum::extract::State;
use axum::http::{HeaderMap, HeaderValue, header};
use axum::response::{IntoResponse, Response};
use serde::Deserialize;

use super::assets::{self, Delivery};
use super::conditions::{ConditionHeaders, Conditions, ETag};
use super::extract::{Path, Query};
use super::models::{TAG, parse_id};
use super::negotiation::{Chosen, Offer, choose};
use super::problem::{Code, Problem};
use super::responses;
use super::schemas::{CloudFormat, FileContent, MeshFormat, PosesFormat, ScansFormat};
use super::state::AppState;
use visage_domain::asset::Asset;
use visage_formats::poses::JSON;
use visage_formats::written::Written;
use visage_formats::{Format, e57};
use visage_service::app::renditions::{PlacedScans, PosesAs, PosesSource, RenditionError, ScansAs, SurfaceSource};
use visage_service::storage::StagedFile;

/// Which format is wanted.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub struct CloudQuery {
    /// The format, by its ending; `Accept` may name it instead. PLY if neither does.
    #[param(value_type = CloudFormat, required = false)]
    format: Option<String>,
}

/// The same for a mesh.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub struct MeshQuery {
    /// The format, by its ending; `Accept` may name it instead. PLY if neither does.
    #[param(value_type = MeshFormat, required = false)]
    format: Option<String>,
}

/// The same for poses.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub struct PosesQuery {
    /// The format, by its ending, or `matrices`: a zip archive with a text file of four rows for each scan. JSON if it is
    /// not named.
    #[param(value_type = PosesFormat, required = false)]
    format: Option<String>,
}

/// The same for placed scans.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub struct ScansQuery {
    /// `e57` for one file that holds all scans with their poses; any other for a zip archive of files in this format, moved
    /// to where they belong. E57 if it is not named.
    #[param(value_type = ScansFormat, required = false)]
    format: Option<String>,
}

/// The name that stands for a matrix a scan.
const MATRICES: &str = "matrices";
const ZIP: &[&str] = &["application/zip"];

fn surface_offers(written: Written) -> Vec<Offer<&'static Format>> {
    let offer =
        |format: &'static Format| Offer { ending: format.ending(), media_types: format.media_types(), what: format };
    written.formats().map(offer).collect()
}

fn pose_offers() -> Vec<Offer<PosesAs>> {
    let json = Offer { ending: JSON.ending(), media_types: &["application/json"], what: PosesAs::File(&JSON) };
    let others = Written::Poses.formats().filter(|format| **format != JSON).map(|format| Offer {
        ending: format.ending(),
        media_types: format.media_types(),
        what: PosesAs::File(format),
    });
    let matrices = Offer { ending: MATRICES, media_types: ZIP, what: PosesAs::Matrices };
    std::iter::once(json).chain(others).chain([matrices]).collect()
}

fn scan_offers() -> Vec<Offer<ScansAs>> {
    let one = Offer { ending: e57::FORMAT.ending(), media_types: e57::FORMAT.media_types(), what: ScansAs::E57 };
    let formats = Written::Cloud.formats().filter(|format| **format != e57::FORMAT);
    let zip = formats.enumerate().map(|(place, format)| Offer {
        ending: format.ending(),
        // of the archives the first stands for all
        media_types: if place == 0 { ZIP } else { &[] },
        what: ScansAs::Zip(format),
    });
    std::iter::once(one).chain(zip).collect()
}

/// The names of formats, as the contract lists them.
pub fn names_of_poses() -> Vec<&'static str> {
    pose_offers().iter().map(|offer| offer.ending).collect()
}

/// The same for placed scans.
pub fn names_of_scans() -> Vec<&'static str> {
    scan_offers().iter().map(|offer| offer.ending).collect()
}

/// Fetch the cloud of a model in a format of your choice.
///
/// Converted when it is asked for. In E57 and GLB, which are in metres, lengths are converted if the unit of the model is known.
/// Of a model that was uploaded as a mesh its vertices.
#[utoipa::path(
    get, path = "/v1/models/{id}/cloud", tag = TAG, operation_id = "getModelCloud",
    params(("id" = String, Path, format = "uuid", description = "The model."), CloudQuery, ConditionHeaders),
    responses(
        (status = 200, description = "The file.", body = inline(FileContent), content_type = "application/octet-stream",
         headers(("ETag" = String, description = "Changes with the content, and differs by format."))),
        responses::Unchanged, responses::BadRequest, responses::NotFound, responses::NotAcceptable, responses::OtherState,
        responses::BadRange, responses::Unprocessable, responses::Other,
    )
)]
pub async fn get_cloud(
    State(state): State<AppState>,
    Path(id): Path<String>,
    Query(query): Query<CloudQuery>,
    conditions: Conditions,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    surface(state, &id, Written::Cloud, query.format.as_deref(), &conditions, &headers).await
}

/// Fetch the mesh of a model in a format of your choice.
///
/// Converted when it is asked for, as the cloud is.
#[utoipa::path(
    get, path = "/v1/models/{id}/mesh", tag = TAG, operation_id = "getModelMesh",
    params(("id" = String, Path, format = "uuid", description = "The model."), MeshQuery, ConditionHeaders),
    responses(
        (status = 200, description = "The file.", body = inline(FileContent), content_type = "application/octet-stream",
         headers(("ETag" = String, description = "Changes with the content, and differs by format."))),
        responses::Unchanged, responses::BadRequest, responses::NotFound, responses::NotAcceptable, responses::OtherState,
        responses::BadRange, responses::Unprocessable, responses::Other,
    )
)]
pub async fn get_mesh(
    State(state): State<AppState>,
    Path(id): Path<String>,
    Query(query): Query<MeshQuery>,
    conditions: Conditions,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    surface(state, &id, Written::Mesh, query.format.as_deref(), &conditions, &headers).await
}

/// Fetch the poses of a registered model in a format of your choice.
///
/// 406 where the format can't hold them: names with blanks in Stanford's, scales in all but JSON.
#[utoipa::path(
    get, path = "/v1/models/{id}/poses", tag = TAG, operation_id = "getModelPosesAs",
    params(("id" = String, Path, format = "uuid", description = "The model."), PosesQuery, ConditionHeaders),
    responses(
        (status = 200, description = "The file.", body = inline(FileContent), content_type = "application/octet-stream",
         headers(("ETag" = String, description = "Changes with the content, and differs by format."))),
        responses::Unchanged, responses::BadRequest, responses::NotFound, responses::NotAcceptable, responses::OtherState,
        responses::BadRange, responses::Unprocessable, responses::Other,
    )
)]
pub async fn get_poses(
    State(state): State<AppState>,
    Path(id): Path<String>,
    Query(query): Query<PosesQuery>,
    conditions: Conditions,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let source = PosesSource::find(&state.context, parse_id(&id)?).await?;
    let (wanted, media_type) = choose(&pose_offers(), query.format.as_deref(), &headers)?;
    let ending = match wanted {
        PosesAs::File(format) if *format == JSON => {
            return stored(&state, &id, &Asset::Poses.name(), media_type, &conditions, &headers).await;
        }
        PosesAs::File(format) => format.ending(),
        PosesAs::Matrices => MATRICES,
    };
    let name = if wanted == PosesAs::Matrices { "poses.zip".to_owned() } else { format!("poses.{ending}") };
    let made = Made { name, etag: tag(&source.asset.checksum, ending), media_type };
    if let Some(answer) = made.known(&conditions)? {
        return Ok(answer);
    }
    let file = source.write(&state.context, &state.conversions, wanted).await?;
    made.send(&state, file, &conditions, &headers).await
}

/// Fetch the scans that a model was made of, where they belong.
///
/// One E57 file in metres, or a zip archive of files. Scans without a place are left out. A scan that was replaced or deleted since
/// is said (409).
#[utoipa::path(
    get, path = "/v1/models/{id}/scans", tag = TAG, operation_id = "getModelScans",
    params(("id" = String, Path, format = "uuid", description = "The model."), ScansQuery, ConditionHeaders),
    responses(
        (status = 200, description = "The file.", body = inline(FileContent), content_type = "application/octet-stream",
         headers(("ETag" = String, description = "Changes with the content, and differs by format."))),
        responses::Unchanged, responses::BadRequest, responses::NotFound, responses::NotAcceptable, responses::Conflict,
        responses::OtherState, responses::BadRange, responses::Unprocessable, responses::Other,
    )
)]
pub async fn get_scans(
    State(state): State<AppState>,
    Path(id): Path<String>,
    Query(query): Query<ScansQuery>,
    conditions: Conditions,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let source = PlacedScans::find(&state.context, parse_id(&id)?).await?;
    let (wanted, media_type) = choose(&scan_offers(), query.format.as_deref(), &headers)?;
    let (ending, name) = match wanted {
        ScansAs::E57 => (e57::FORMAT.ending(), "scans.e57"),
        ScansAs::Zip(format) => (format.ending(), "scans.zip"),
    };
    let made = Made { name: name.to_owned(), etag: tag(&source.tag, ending), media_type };
    if let Some(answer) = made.known(&conditions)? {
        return Ok(answer);
    }
    let file = source.write(&state.context, &state.conversions, wanted).await?;
    made.send(&state, file, &conditions, &headers).await
}

async fn surface(
    state: AppState,
    id: &str,
    written: Written,
    format: Option<&str>,
    conditions: &Conditions,
    headers: &HeaderMap,
) -> Result<Response, Problem> {
    let source = SurfaceSource::find(&state.context, parse_id(id)?, written).await?;
    let (format, media_type): Chosen<&Format> = choose(&surface_offers(written), format, headers)?;
    if source.is_in(format) {
        return stored(&state, id, &source.asset.name, media_type, conditions, headers).await;
    }
    let what = if written == Written::Mesh { "mesh" } else { "cloud" };
    let name = format!("{what}.{}", format.ending());
    let made = Made { etag: tag(&source.asset.checksum, &name), name, media_type };
    if let Some(answer) = made.known(conditions)? {
        return Ok(answer);
    }
    let file = source.write(&state.context, &state.conversions, format).await?;
    made.send(&state, file, conditions, headers).await
}

/// The tag of what is made of a file: the same program always makes the same bytes.
fn tag(checksum: &str, what: &str) -> ETag {
    ETag::of_checksum(&format!("{checksum}-{what}-{}", env!("CARGO_PKG_VERSION")))
}

/// A file that is stored as it is wanted.
async fn stored(
    state: &AppState,
    id: &str,
    name: &str,
    media_type: Option<&'static str>,
    conditions: &Conditions,
    headers: &HeaderMap,
) -> Result<Response, Problem> {
    let mut answer = assets::send(state.clone(), id, name, conditions, headers).await?;
    let kind = HeaderValue::from_static(media_type.unwrap_or("application/octet-stream"));
    if answer.headers().contains_key(header::CONTENT_TYPE) {
        answer.headers_mut().insert(header::CONTENT_TYPE, kind);
    }
    answer.headers_mut().insert(header::VARY, HeaderValue::from_static("accept"));
    Ok(answer)
}

/// A file that is made.
struct Made {
    name: String,
    etag: ETag,
    media_type: Option<&'static str>,
}

impl Made {
    fn delivery(&self) -> Delivery {
        let media_type = self.media_type.unwrap_or("application/octet-stream");
        Delivery { name: self.name.clone(), etag: self.etag.clone(), media_type, by_accept: true }
    }

    /// The answer if the client knows the file, or does not want it: nothing is made then.
    fn known(&self, conditions: &Conditions) -> Result<Option<Response>, Problem> {
        let delivery = self.delivery();
        Ok(delivery.unchanged(conditions)?.map(IntoResponse::into_response))
    }

    async fn send(
        self,
        state: &AppState,
        file: StagedFile,
        conditions: &Conditions,
        headers: &HeaderMap,
    ) -> Result<Response, Problem> {
        let reader = state.context.objects.open_staged(&file).await?;
        self.delivery().send(file.bytes, reader, conditions, headers).await
    }
}

impl From<RenditionError> for Problem {
    fn from(error: RenditionError) -> Self {
        let detail = error.to_string();
        match error {
            RenditionError::Missing { hint, .. } => Problem::new(Code::NotFound, detail, hint),
            RenditionError::Changed { scan } => {
                let hint = "register the set again to have its scans where they belong";
                Problem::new(Code::ScanChanged, detail, hint).scan(scan)
            }
            RenditionError::Unfit { .. } => {
                Problem::new(Code::NotAcceptable, detail, "ask for another format; /openapi.yaml lists them")
            }
            RenditionError::TooLarge { .. } => {
                let hint = "fetch the file as it is stored, or ask the operator for more memory (--job-memory-mb)";
                Problem::new(Code::TooLittleMemory, detail, hint)
            }
            RenditionError::Unreadable { name, error } => Problem::unreadable(&name, &error),
            RenditionError::Database(error) => error.into(),
            RenditionError::Objects(error) => error.into(),
            RenditionError::Packing(error) => Problem::internal(error),
            RenditionError::Ended(error) => Problem::internal(error),
            RenditionError::Closed(error) => Problem::internal(error),
        }
    }
}
