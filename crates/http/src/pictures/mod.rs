//! `/v1/models/{id}/pictures/{kind}` and `/report.html`, pictures of scan sets and scans: what is stored as people see it.
//!
//! Pictures are drawn when they are asked for, a few at a time, on a pool of their own: nothing async waits for them, and who goes away
//! stops them. The last ones are kept in memory, since pages show the same again and again.

mod cache;
mod wishes;

pub use cache::Drawn;

use axum::extract::State;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use bytes::Bytes;
use visage_geometry::names::UnknownName;

use self::wishes::{PictureQuery, PlotQuery, ScanPictureQuery, size_of, wish_of};
use super::conditions::{ConditionHeaders, Conditions, ETag};
use super::describe;
use super::extract::{Path, Query};
use super::models::{TAG, parse_id};
use super::names;
use super::problem::{Code, Problem};
use super::responses;
use super::scan_sets::{TAG as SET_TAG, parse_id as parse_set_id};
use super::schemas::{FileContent, PictureKind, PlotKind, ScanName};
use super::state::AppState;
use visage_geometry::progress::Progress;
use visage_report::PictureError;
use visage_service::app::pictures::{Kind, ModelPage, ModelPicture, PicturesError, ScanPicture, SetPicture};

const PNG: &str = "image/png";
const SVG: &str = "image/svg+xml";
const HTML: &str = "text/html; charset=utf-8";

/// Fetch a picture of a model.
///
/// Drawn when it is asked for; the same request gives the same bytes. A model without what the picture would show is said (404) with what
/// to do about it.
#[utoipa::path(
    get, path = "/v1/models/{id}/pictures/{kind}", tag = TAG, operation_id = "getModelPicture",
    params(("id" = String, Path, format = "uuid", description = "The model."),
           ("kind" = PictureKind, Path, description = "What is shown."), PictureQuery, ConditionHeaders),
    responses(
        (status = 200, description = "A PNG.", body = inline(FileContent), content_type = "image/png",
         headers(("ETag" = String, description = "Changes with what is shown, and differs by what is wished."))),
        responses::Unchanged, responses::BadRequest, responses::NotFound, responses::Conflict, responses::OtherState,
        responses::Unprocessable, responses::NotReady, responses::Other,
    )
)]
pub async fn get_picture(
    State(state): State<AppState>,
    Path((id, kind)): Path<(String, String)>,
    Query(query): Query<PictureQuery>,
    conditions: Conditions,
) -> Result<Response, Problem> {
    let kind = kind_of(&kind)?;
    let wish = wish_of(kind, &query)?;
    let other = query.other.as_deref().map(parse_id).transpose()?;
    let source = ModelPicture::find(&state.context, parse_id(&id)?, kind, other).await?;
    let what = format!("{}-{}-{}-{:?}", source.tag, wish.size, wish.side, wish.plane);
    let (context, bytes) = (state.context.clone(), source.bytes(&wish));
    let draw = move |progress: &Progress| source.png(&context, &wish, progress);
    answer(&state, &conditions, &what, PNG, bytes, draw).await
}

/// Fetch a plot of a model as SVG.
#[utoipa::path(
    get, path = "/v1/models/{id}/pictures/{kind}/svg", tag = TAG, operation_id = "getModelPlot",
    params(("id" = String, Path, format = "uuid", description = "The model."),
           ("kind" = PlotKind, Path, description = "What is shown."), PlotQuery, ConditionHeaders),
    responses(
        (status = 200, description = "An SVG.", body = String, content_type = "image/svg+xml",
         headers(("ETag" = String, description = "Changes with what is shown, and differs by what is wished."))),
        responses::Unchanged, responses::BadRequest, responses::NotFound, responses::OtherState, responses::Unprocessable,
        responses::NotReady, responses::Other,
    )
)]
pub async fn get_plot(
    State(state): State<AppState>,
    Path((id, kind)): Path<(String, String)>,
    Query(query): Query<PlotQuery>,
    conditions: Conditions,
) -> Result<Response, Problem> {
    let kind = kind_of(&kind)?;
    let wish =
        visage_report::Wish { size: size_of(query.size.as_deref(), kind.size())?, ..visage_report::Wish::of(kind) };
    if !kind.is_plot() {
        return Err(PicturesError::NoPlot(kind.name()).into());
    }
    let source = ModelPicture::find(&state.context, parse_id(&id)?, kind, None).await?;
    let what = format!("{}-{}-svg", source.tag, wish.size);
    let (context, bytes) = (state.context.clone(), source.bytes(&wish));
    let draw = move |progress: &Progress| {
        let svg = source.made(&context, &wish, progress)?.to_svg();
        svg.map(String::into_bytes).ok_or(PicturesError::NoPlot(kind.name()))
    };
    answer(&state, &conditions, &what, SVG, bytes, draw).await
}

/// Fetch the report on a model as a page.
///
/// It needs no script and no other file, and prints well: the verdict in words with what to do about it, pictures, tables, what the
/// figures don't show.
#[utoipa::path(
    get, path = "/v1/models/{id}/report.html", tag = TAG, operation_id = "getModelReportPage",
    params(("id" = String, Path, format = "uuid", description = "The model."), ConditionHeaders),
    responses(
        (status = 200, description = "The page.", body = String, content_type = "text/html",
         headers(("ETag" = String, description = "Changes with what is shown."))),
        responses::Unchanged, responses::NotFound, responses::OtherState, responses::Unprocessable, responses::NotReady,
        responses::Other,
    )
)]
pub async fn get_page(
    State(state): State<AppState>,
    Path(id): Path<String>,
    conditions: Conditions,
) -> Result<Response, Problem> {
    let source = ModelPage::find(&state.context, parse_id(&id)?).await?;
    let what = format!("{}-page", source.tag);
    let (context, bytes) = (state.context.clone(), source.bytes());
    let draw = move |progress: &Progress| Ok(source.made(&context, progress)?.into_bytes());
    let mut page = answer(&state, &conditions, &what, HTML, bytes, draw).await?;
    // it holds names that users gave: whatever they are, nothing in it runs or loads
    let policy = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; sandbox";
    page.headers_mut().insert(header::CONTENT_SECURITY_POLICY, HeaderValue::from_static(policy));
    Ok(page)
}

/// Fetch a picture of some scans of a set, before anything runs.
///
/// Each from where its scanner stood, if its file says so; up to four, from all over the set.
#[utoipa::path(
    get, path = "/v1/scan-sets/{id}/pictures/thumbnail", tag = SET_TAG, operation_id = "getSetPicture",
    params(("id" = String, Path, format = "uuid", description = "The scan set."), PlotQuery, ConditionHeaders),
    responses(
        (status = 200, description = "A PNG.", body = inline(FileContent), content_type = "image/png",
         headers(("ETag" = String, description = "Changes with what is shown, and differs by what is wished."))),
        responses::Unchanged, responses::BadRequest, responses::NotFound, responses::OtherState, responses::Unprocessable,
        responses::NotReady, responses::Other,
    )
)]
pub async fn get_of_set(
    State(state): State<AppState>,
    Path(id): Path<String>,
    Query(query): Query<PlotQuery>,
    conditions: Conditions,
) -> Result<Response, Problem> {
    let size = size_of(query.size.as_deref(), Kind::Thumbnail.size())?;
    let source = SetPicture::find(&state.context, parse_set_id(&id)?).await?;
    let what = format!("{}-{size}-set", source.tag());
    let (context, bytes) = (state.context.clone(), source.bytes());
    let draw = move |progress: &Progress| {
        let image = source.made(&context, size, progress)?;
        image.to_png().map_err(|error| PicturesError::Broken(error.to_string()))
    };
    answer(&state, &conditions, &what, PNG, bytes, draw).await
}

/// Fetch a picture of a scan, before anything runs.
///
/// From where its scanner stood, if its file says so and no side is named.
#[utoipa::path(
    get, path = "/v1/scan-sets/{id}/scans/{name}/picture", tag = SET_TAG, operation_id = "getScanPicture",
    params(("id" = String, Path, format = "uuid", description = "The scan set."),
           ("name" = ScanName, Path, description = "The scan."), ScanPictureQuery, ConditionHeaders),
    responses(
        (status = 200, description = "A PNG.", body = inline(FileContent), content_type = "image/png",
         headers(("ETag" = String, description = "Changes with what is shown, and differs by what is wished."))),
        responses::Unchanged, responses::BadRequest, responses::NotFound, responses::OtherState, responses::Unprocessable,
        responses::NotReady, responses::Other,
    )
)]
pub async fn get_of_scan(
    State(state): State<AppState>,
    Path((id, name)): Path<(String, String)>,
    Query(query): Query<ScanPictureQuery>,
    conditions: Conditions,
) -> Result<Response, Problem> {
    let set = parse_set_id(&id)?;
    // of a name that no scan can have there is none
    let name = names::scan_name(&name).unwrap_or(name);
    let (size, side) = query.wish()?;
    let source = ScanPicture::find(&state.context, set, &name).await?;
    let what = format!("{}-{size}-{side}-scan-{name}", source.tag());
    let (context, bytes) = (state.context.clone(), source.bytes());
    let draw = move |progress: &Progress| {
        let image = source.made(&context, side, size, progress)?;
        image.to_png().map_err(|error| PicturesError::Broken(error.to_string()))
    };
    answer(&state, &conditions, &what, PNG, bytes, draw).await
}

fn kind_of(text: &str) -> Result<Kind, Problem> {
    text.parse().map_err(|error: UnknownName| {
        let named: String = text.chars().take(64).collect();
        Problem::new(
            Code::NotFound,
            format!("there is no picture {named:?} of models"),
            format!("use {}", error.names()),
        )
    })
}

/// A picture, unless the client has it: drawn, or as it was drawn a moment ago.
pub(crate) async fn answer(
    state: &AppState,
    conditions: &Conditions,
    what: &str,
    media_type: &'static str,
    bytes: u64,
    draw: impl FnOnce(&Progress) -> Result<Vec<u8>, PicturesError> + Send + 'static,
) -> Result<Response, Problem> {
    // the same program always draws the same
    let etag = ETag::of_bytes(format!("{what}-{}", env!("CARGO_PKG_VERSION")).as_bytes());
    conditions.check_match(Some(&etag))?;
    let mut headers = HeaderMap::from_iter([etag.header()?]);
    // the content under an address never changes, but deleting must be seen: always ask again
    headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("private, no-cache"));
    if conditions.knows(&etag) {
        return Ok((StatusCode::NOT_MODIFIED, headers).into_response());
    }
    headers.insert(header::CONTENT_TYPE, HeaderValue::from_static(media_type));
    headers.insert(header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
    let drawn = match state.drawn.get(&etag) {
        Some(drawn) => drawn,
        None => {
            let turn = describe::turn_in(state, &state.drawing, bytes).await?;
            // who waited for its turn may find it drawn by another
            match state.drawn.get(&etag) {
                Some(drawn) => drawn,
                None => {
                    let drawn = describe::computed(state, turn, move |_, progress| Ok(draw(progress)?)).await?;
                    let drawn = Bytes::from(drawn);
                    state.drawn.put(etag, drawn.clone());
                    drawn
                }
            }
        }
    };
    Ok((headers, drawn).into_response())
}

impl From<PicturesError> for Problem {
    fn from(error: PicturesError) -> Self {
        let detail = error.to_string();
        let field = |hint: &str| Problem::new(Code::InvalidField, error.to_string(), hint);
        match error {
            PicturesError::Picture(PictureError::Lacking { remedy, .. }) => {
                Problem::new(Code::NotFound, detail, remedy)
            }
            PicturesError::Picture(PictureError::Canceled(_)) | PicturesError::Canceled(_) => Problem::internal(detail),
            PicturesError::Picture(PictureError::Surface(_)) => field("ask for another kind of picture of this model"),
            PicturesError::NoOther => field("name it: other=ID"),
            PicturesError::OtherUnit(..) => {
                Problem::new(Code::OtherUnit, detail, "name another model in the unit of this one")
            }
            PicturesError::NoPlot(_) => {
                Problem::new(Code::NotFound, detail, "leave /svg out of the address to have it as PNG")
            }
            PicturesError::TooLarge { .. } => {
                let hint =
                    "fetch the file and look at it elsewhere, or ask the operator for more memory (--job-memory-mb)";
                Problem::new(Code::TooLittleMemory, detail, hint)
            }
            PicturesError::NoScan(_) | PicturesError::NoScans => {
                Problem::new(Code::NotFound, detail, "GET /v1/scan-sets/{id} lists the scans of a set")
            }
            PicturesError::Unreadable { name, error } => Problem::unreadable(&name, &error),
            PicturesError::Broken(_) => Problem::internal(detail),
            PicturesError::Database(error) => error.into(),
            PicturesError::Objects(error) => error.into(),
        }
    }
}
