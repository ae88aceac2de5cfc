//! `/v1/models`: what registration left, and finished models that were uploaded to the gallery.

use axum::Json;
use axum::extract::{Request, State};
use axum::http::StatusCode;
use axum::response::Response;
use serde::Deserialize;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::bin::DeletionQuery;
use super::conditions::{ConditionHeaders, Conditions};
use super::extract::{FORM, IdempotencyHeader, IdempotencyKey, PageQuery, Path, Query, media_type, wrong_media_type};
use super::idempotency::{Attempt, Created};
use super::model_views::{ModelList, ModelSummary, ModelView, NewModelForm, address};
use super::problem::{Code, Problem};
use super::scan_sets::parse_id as parse_scan_set_id;
use super::schemas::ShortText;
use super::state::{AppState, deleted, uninterrupted};
use super::upload::{self, Form, FormRules};
use super::verdicts::{self, VerdictView};
use super::{assets, cursor, describe, deviation, names, pictures, reading_view, renditions, responses, saliency};
use visage_domain::asset::Asset;
use visage_domain::{AssetRecord, ModelFilter, ModelId, ModelRecord, NewModel};
use visage_formats::Reading;
use visage_geometry::Surface;
use visage_service::app::models::{self, Upload};
use visage_service::app::pictures::thumbnail;
use visage_service::storage::DatabaseError;

pub(super) const TAG: &str = "models";
const RULES: FormRules = FormRules {
    files: &["model"],
    most_files: 1,
    file_name: names::surface_file_name,
    texts: &["label", "name", "unit"],
};
/// What `GET /v1/models/{id}` shows of a report; a larger one has to be fetched as a file.
const LARGEST_REPORT: u64 = 16 << 20;

/// The routes of this resource.
pub fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new()
        .routes(routes!(create, list))
        .routes(routes!(get_one, delete))
        .routes(routes!(assets::get_poses))
        .routes(routes!(assets::get_conf))
        .routes(routes!(assets::get_report))
        .routes(routes!(assets::get_surface))
        .routes(routes!(renditions::get_cloud))
        .routes(routes!(renditions::get_mesh))
        .routes(routes!(renditions::get_poses))
        .routes(routes!(renditions::get_scans))
        .routes(routes!(deviation::figures))
        .routes(routes!(deviation::map))
        .routes(routes!(saliency::map))
        .routes(routes!(pictures::get_picture))
        .routes(routes!(pictures::get_plot))
        .routes(routes!(pictures::get_page))
}

pub(super) fn parse_id(text: &str) -> Result<ModelId, Problem> {
    ModelId::parse(text)
        .ok_or_else(|| DatabaseError::NotFound { kind: "model", id: text.chars().take(64).collect() }.into())
}

/// Put a finished model into the gallery.
///
/// The file is kept as it is; its signature is computed before the answer, so the next query finds the model.
#[utoipa::path(
    post, path = "/v1/models", tag = TAG, operation_id = "createModel",
    params(IdempotencyHeader),
    request_body(content = NewModelForm, content_type = "multipart/form-data"),
    responses(
        (status = 201, description = "The model is stored and can be found.", body = ModelView,
         headers(("Location" = String, description = "The address of the model."))),
        responses::BadRequest, responses::Stalled, responses::Conflict, responses::TooLarge, responses::WrongType,
        responses::Unprocessable, responses::NotReady, responses::Other,
    )
)]
async fn create(
    State(state): State<AppState>,
    IdempotencyKey(key): IdempotencyKey,
    request: Request,
) -> Result<Created, Problem> {
    let mut attempt = Attempt::begin(&state, "POST /v1/models", key.as_deref())?;
    let found = media_type(request.headers());
    if found != FORM {
        return Err(wrong_media_type(&found, "multipart/form-data with a part `model`"));
    }
    let form = upload::read_form(&state, request, &RULES).await?;
    if let Some(answer) = attempt.known(&state, || form.hash()).await? {
        return Ok(answer);
    }
    let upload = described(&state, form).await?;
    let verdicts = vec![VerdictView::of_face(&upload.signature)];
    let view = ModelView { verdicts, ..ModelView::of(&record(&upload.model), &upload.model.assets, None) };
    let created = Created::new(StatusCode::CREATED, address(upload.model.id), &view)?;
    let replay = attempt.replay(&created, upload.model.id.to_string());
    uninterrupted(async move {
        let _attempt = attempt;
        Ok(models::add(&state.context, upload, replay.as_ref()).await?)
    })
    .await?;
    Ok(created)
}

/// An uploaded model as it will be stored.
fn record(model: &NewModel) -> ModelRecord {
    ModelRecord {
        id: model.id,
        job_id: None,
        scan_set_id: None,
        name: model.name.clone(),
        label: model.label.clone(),
        unit: model.unit,
        points: model.points,
        quality: None,
        reading: model.reading.clone(),
        signature: model.signature.as_ref().map(|signature| signature.summary.clone()),
    }
}

async fn described(state: &AppState, mut form: Form) -> Result<Upload, Problem> {
    let unit = form.text("unit")?.map(names::unit).transpose()?.unwrap_or_default();
    let label = form.text("label")?.map(|label| names::text("label", label)).transpose()?;
    let name = form.text("name")?.map(|name| names::text("name", name)).transpose()?;
    let file = form.files.pop().ok_or_else(|| {
        Problem::new(
            Code::InvalidField,
            "the form has no part `model`",
            "send the mesh or cloud as a file named `model`",
        )
    })?;
    let file = upload::unpacked(state, file).await?;
    let turn = describe::turn(state, &file).await?;
    let (file, Reading { surface, dropped, .. }) = upload::read(state, file).await?;
    let asset = AssetRecord {
        name: asset_name(&file.name, &surface)?,
        bytes: file.staged.bytes,
        checksum: file.staged.checksum.clone(),
    };
    let points = surface.cloud.len() as u64;
    let (signature, thumbnail) = describe::computed(state, turn, move |engine, progress| {
        let signature = engine.describe(&surface, unit, progress).map_err(Problem::from)?;
        let thumbnail = thumbnail(surface, &signature, unit, progress)?;
        Ok((signature, thumbnail))
    })
    .await
    .map_err(|problem| problem.scan(&file.name))?;
    let drawn = thumbnail.as_deref().map(|content| AssetRecord {
        name: Asset::Thumbnail.name().into_owned(),
        bytes: content.len() as u64,
        checksum: blake3::hash(content).to_hex().to_string(),
    });
    let model = NewModel {
        id: ModelId::new(),
        origin: None,
        name: name.unwrap_or_else(|| file.name.clone()),
        label,
        unit,
        points,
        quality: None,
        assets: [asset].into_iter().chain(drawn).collect(),
        reading: reading_view::stored(&dropped),
        signature: Some((&signature).into()),
    };
    Ok(Upload { model, file: file.staged, thumbnail, signature })
}

/// An uploaded file is kept under the name that a file of that kind has for every model.
fn asset_name(file: &str, surface: &Surface) -> Result<String, Problem> {
    let format = names::surface_format(file)?;
    Ok(Asset::uploaded(format, !surface.faces.is_empty()).name().into_owned())
}

/// Which models to list.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
struct ListQuery {
    /// Only those of this class.
    label: Option<String>,
    /// Only those made from this scan set.
    #[param(format = "uuid")]
    scan_set_id: Option<String>,
    /// Only those that have each of these words, or parts of words, in their name or label, in large letters or small.
    #[param(value_type = ShortText, required = false)]
    text: Option<String>,
    /// At most so many items (1 to 100, 20 if not given).
    #[param(minimum = 1, maximum = 100, default = 20)]
    limit: Option<usize>,
    /// `next_cursor` of the page before.
    cursor: Option<String>,
}

/// List models, newest first.
#[utoipa::path(
    get, path = "/v1/models", tag = TAG, operation_id = "listModels", params(ListQuery),
    responses((status = 200, description = "A page of models.", body = ModelList), responses::BadRequest,
              responses::NotFound, responses::Unprocessable, responses::Other)
)]
async fn list(State(state): State<AppState>, Query(query): Query<ListQuery>) -> Result<Json<ModelList>, Problem> {
    let scan_set_id = query.scan_set_id.as_deref().map(parse_scan_set_id).transpose()?;
    let words = query.text.map(|text| names::words("text", &text)).transpose()?.unwrap_or_default();
    let filter = ModelFilter { label: query.label, scan_set_id, words };
    let list = cursor::fingerprint(&[b"models", format!("{filter:?}").as_bytes()]);
    let page = PageQuery { limit: query.limit, cursor: query.cursor }.request(&list)?;
    let page = state.context.database.models(&filter, &page).await?;
    let next_cursor = page.next_cursor(|model| cursor::after_item(&list, model.id.number()));
    Ok(Json(ModelList { items: page.items.iter().map(ModelSummary::of).collect(), next_cursor }))
}

/// Look at one model, with its report, its files and what its signature holds.
#[utoipa::path(
    get, path = "/v1/models/{id}", tag = TAG, operation_id = "getModel",
    params(("id" = String, Path, format = "uuid", description = "The model."), ConditionHeaders),
    responses((status = 200, description = "The model.", body = ModelView,
               headers(("ETag" = String, description = "Changes with the content."))),
              responses::Unchanged, responses::NotFound, responses::OtherState, responses::Other)
)]
async fn get_one(
    State(state): State<AppState>,
    Path(id): Path<String>,
    conditions: Conditions,
) -> Result<Response, Problem> {
    conditions.answer(&view(&state, parse_id(&id)?).await?)
}

async fn view(state: &AppState, id: ModelId) -> Result<ModelView, Problem> {
    let model = state.context.database.model(id).await?;
    let assets = state.context.database.assets(id).await?;
    let report = read_report(state, id, &assets).await?;
    let verdicts = verdicts::on_model(state, &model).await?;
    Ok(ModelView { verdicts, ..ModelView::of(&model, &assets, report) })
}

async fn read_report(
    state: &AppState,
    id: ModelId,
    assets: &[AssetRecord],
) -> Result<Option<serde_json::Value>, Problem> {
    let Some(asset) = assets.iter().find(|asset| asset.name == Asset::Report.name() && asset.bytes <= LARGEST_REPORT)
    else {
        return Ok(None);
    };
    let content = models::read_asset(&state.context, id, asset).await?;
    content.map(|content| serde_json::from_slice(&content).map_err(Problem::internal)).transpose()
}

/// Delete a model with its files and its signature. The job and the scans it came from stay.
///
/// Where there is a recycle bin it can be put back for a while, unless it is deleted `permanently`.
#[utoipa::path(
    delete, path = "/v1/models/{id}", tag = TAG, operation_id = "deleteModel",
    params(("id" = String, Path, format = "uuid", description = "The model."), ConditionHeaders, DeletionQuery),
    responses((status = 204, description = "It is gone."), responses::NotFound, responses::OtherState,
              responses::Other)
)]
async fn delete(
    State(state): State<AppState>,
    Path(id): Path<String>,
    Query(query): Query<DeletionQuery>,
    conditions: Conditions,
) -> Result<StatusCode, Problem> {
    let id = parse_id(&id)?;
    let removal = query.removal(&state);
    deleted(async move {
        let _turn = conditions.turn(&state).await?;
        if conditions.any() {
            conditions.check_view(&view(&state, id).await?)?;
        }
        Ok(models::delete(&state.context, id, removal).await?)
    })
    .await
}
