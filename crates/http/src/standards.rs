//! `/v1/standards`: the classes that can be asked for.

use axum::Json;
use axum::extract::{Request, State};
use axum::http::StatusCode;
use axum::response::Response;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::conditions::{ConditionHeaders, Conditions};
use super::extract::{
    FORM, IdempotencyHeader, IdempotencyKey, Path, media_type, parse_json, read_json, wrong_media_type,
};
use super::idempotency::{Attempt, Created};
use super::problem::{Code, Problem};
use super::standard_views::{
    AnyStandard, BuiltInView, CornerPart, ExamplesView, LandmarksPart, NewStandardForm, StandardList, StandardView,
    address, annotation,
};
use super::state::{AppState, deleted, uninterrupted};
use super::upload::{self, Form, FormRules, UploadedFile};
use super::{describe, names, responses};
use visage_domain::asset::Asset;
use visage_domain::{AssetRecord, Examples, NewStandard, StandardId, StandardRecord};
use visage_service::app::standards::{self, Standing};
use visage_service::storage::DatabaseError;
use visage_shape::faces::standard::by_name;
use visage_shape::standards::limit;

const TAG: &str = "standards";
const RULES: FormRules = FormRules {
    files: &["model"],
    most_files: 1,
    file_name: names::surface_file_name,
    texts: &["name", "unit", "landmarks", "triangle", "positive", "negative"],
};
/// The longest name.
const LONGEST_NAME: usize = 64;

/// The routes of this resource.
pub fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(create, list)).routes(routes!(get_one, delete)).routes(routes!(mark))
}

/// Make a standard of a model with named landmarks.
///
/// The landmarks that are caps or pits of the surface make the triangles by which the class is found, the surface around
/// them is what is fitted there. The stored models are judged against it by a job; until it has ended, queries answer with
/// those that are judged.
#[utoipa::path(
    post, path = "/v1/standards", tag = TAG, operation_id = "createStandard",
    params(IdempotencyHeader),
    request_body(content = NewStandardForm, content_type = "multipart/form-data"),
    responses(
        (status = 201, description = "The standard is stored.", body = StandardView,
         headers(("Location" = String, description = "The address of the standard."))),
        responses::BadRequest, responses::NotFound, responses::Stalled, responses::Conflict, responses::TooLarge,
        responses::WrongType, responses::Unprocessable, responses::NotReady, responses::Other,
    )
)]
async fn create(
    State(state): State<AppState>,
    IdempotencyKey(key): IdempotencyKey,
    request: Request,
) -> Result<Created, Problem> {
    let mut attempt = Attempt::begin(&state, "POST /v1/standards", key.as_deref())?;
    let found = media_type(request.headers());
    if found != FORM {
        return Err(wrong_media_type(&found, "multipart/form-data with parts `model`, `name` and `landmarks`"));
    }
    let form = upload::read_form(&state, request, &RULES).await?;
    if let Some(answer) = attempt.known(&state, || form.hash()).await? {
        return Ok(answer);
    }
    let (standard, file) = annotated(&state, form).await?;
    let (_, pending) = state.context.database.judged(standard.id).await?;
    uninterrupted(async move {
        let answer = |job| -> Result<Created, Problem> {
            let learned = limit::learn(&[], &[]);
            let standing = Standing { examples: standard.examples.clone(), learned, judged: (0, pending) };
            let view = StandardView::of(&record(&standard), &standing, job);
            Created::new(StatusCode::CREATED, address(standard.id), &view)
        };
        let replay = |job| answer(job).ok().and_then(|created| attempt.replay(&created, standard.id.to_string()));
        answer(standards::add(&state.context, &standard, file.staged, &replay).await?)
    })
    .await
}

fn record(standard: &NewStandard) -> StandardRecord {
    StandardRecord {
        id: standard.id,
        name: standard.name.clone(),
        asset: standard.asset.clone(),
        unit: standard.unit,
        annotation: standard.annotation.clone(),
        definition: standard.definition.clone(),
    }
}

/// The standard that a form asks for, with its file.
async fn annotated(state: &AppState, mut form: Form) -> Result<(NewStandard, UploadedFile), Problem> {
    let missing = |part: &str, hint: &str| {
        Problem::new(Code::InvalidField, format!("the form has no part `{part}`"), hint.to_owned())
    };
    let name = form.text("name")?.ok_or_else(|| missing("name", "give the class a name"))?;
    let name = checked_name(name)?;
    let unit = form.text("unit")?.map(names::unit).transpose()?.unwrap_or_default();
    let landmarks: LandmarksPart = json_part(&form, "landmarks")?
        .ok_or_else(|| missing("landmarks", "send JSON {\"name\": [x, y, z], ...} with at least three landmarks"))?;
    let annotation = annotation(landmarks, json_part::<[CornerPart; 3]>(&form, "triangle")?)?;
    let [positive, negative] = [json_part(&form, "positive")?, json_part(&form, "negative")?];
    let marked = ExamplesView { positive: positive.unwrap_or_default(), negative: negative.unwrap_or_default() };
    let examples = marked.examples()?;
    if by_name(&name).is_some() {
        return Err(DatabaseError::NameTaken { kind: "standard", name }.into());
    }
    // before the work: the name may still be taken meanwhile
    if standards::named(&state.context, &name).await?.is_some() {
        return Err(DatabaseError::NameTaken { kind: "standard", name }.into());
    }
    let file = form.files.pop().ok_or_else(|| missing("model", "send a mesh or cloud as a file named `model`"))?;
    let file = upload::unpacked(state, file).await?;
    let turn = describe::turn(state, &file).await?;
    let (file, surface) = upload::read_surface(state, file).await?;
    let format = names::surface_format(&file.name)?;
    let given = annotation.clone();
    let definition = describe::computed(state, turn, move |engine, progress| {
        engine.annotate(&surface, unit, &given, progress).map_err(Problem::from)
    })
    .await
    .map_err(|problem| problem.scan(&file.name))?;
    let asset = AssetRecord {
        name: Asset::Annotated(format).name().into_owned(),
        bytes: file.staged.bytes,
        checksum: file.staged.checksum.clone(),
    };
    Ok((NewStandard { id: StandardId::new(), name, asset, unit, annotation, definition, examples }, file))
}

fn json_part<T: serde::de::DeserializeOwned>(form: &Form, part: &str) -> Result<Option<T>, Problem> {
    form.text(part)?.map(|text| parse_json(&format!("the part {part}"), text.as_bytes())).transpose()
}

/// A name that can stand in an address and is no id.
fn checked_name(name: &str) -> Result<String, Problem> {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    let fits = (1..=LONGEST_NAME).contains(&name.len()) && name.chars().all(is_plain);
    if fits && StandardId::parse(name).is_none() {
        return Ok(name.to_owned());
    }
    let detail = format!("the name of a standard has 1 to {LONGEST_NAME} letters, digits, - or _, and is no id");
    Err(Problem::new(Code::InvalidField, detail, "choose a name such as teapot"))
}

/// List the classes that can be asked for.
#[utoipa::path(
    get, path = "/v1/standards", tag = TAG, operation_id = "listStandards",
    responses((status = 200, description = "All standards.", body = StandardList), responses::Other)
)]
async fn list(State(state): State<AppState>) -> Result<Json<StandardList>, Problem> {
    let mut items = built_in()?;
    for standard in state.context.database.standards().await? {
        items.push(AnyStandard::Uploaded(Box::new(view(&state, &standard).await?)));
    }
    Ok(Json(StandardList { items }))
}

fn built_in() -> Result<Vec<AnyStandard>, Problem> {
    let view = |value| serde_json::from_value::<Box<BuiltInView>>(value).map(AnyStandard::BuiltIn);
    visage_gallery::standards().into_iter().map(|value| view(value).map_err(Problem::internal)).collect()
}

async fn view(state: &AppState, standard: &StandardRecord) -> Result<StandardView, Problem> {
    Ok(StandardView::of(standard, &standards::standing(&state.context, standard.id).await?, None))
}

/// Look at one standard, by name or id.
#[utoipa::path(
    get, path = "/v1/standards/{name}", tag = TAG, operation_id = "getStandard",
    params(("name" = String, Path, description = "The standard's name or id."), ConditionHeaders),
    responses((status = 200, description = "The standard.", body = AnyStandard,
               headers(("ETag" = String, description = "Changes with the content."))),
              responses::Unchanged, responses::NotFound, responses::OtherState, responses::Other)
)]
async fn get_one(
    State(state): State<AppState>,
    Path(name): Path<String>,
    conditions: Conditions,
) -> Result<Response, Problem> {
    for standard in built_in()? {
        if matches!(&standard, AnyStandard::BuiltIn(view) if view.name == name) {
            return conditions.answer(&standard);
        }
    }
    let standard = state.context.database.standard(&name).await?;
    conditions.answer(&AnyStandard::Uploaded(Box::new(view(&state, &standard).await?)))
}

/// Delete a standard with its file, its examples and the verdicts against it.
#[utoipa::path(
    delete, path = "/v1/standards/{name}", tag = TAG, operation_id = "deleteStandard",
    params(("name" = String, Path, description = "The standard's name or id."), ConditionHeaders),
    responses((status = 204, description = "It is gone."), responses::NotFound, responses::Conflict,
              responses::OtherState, responses::Other)
)]
async fn delete(
    State(state): State<AppState>,
    Path(name): Path<String>,
    conditions: Conditions,
) -> Result<StatusCode, Problem> {
    let standard = uploaded(&state, &name).await?;
    deleted(async move {
        let _turn = conditions.turn(&state).await?;
        check(&state, &standard, &conditions).await?;
        Ok(standards::delete(&state.context, standard.id).await?)
    })
    .await
}

/// Refuses a change of a standard that is not as the request wants it.
async fn check(state: &AppState, standard: &StandardRecord, conditions: &Conditions) -> Result<(), Problem> {
    if conditions.any() { conditions.check_view(&view(state, standard).await?) } else { Ok(()) }
}

/// A standard that users may change.
async fn uploaded(state: &AppState, name: &str) -> Result<StandardRecord, Problem> {
    if by_name(name).is_some() {
        let detail = format!("the standard {name} is built in");
        return Err(Problem::new(Code::BuiltIn, detail, "make a standard of your own with POST /v1/standards"));
    }
    Ok(state.context.database.standard(name).await?)
}

/// Mark stored models as of the class or as other things, in place of those that were marked before.
///
/// The threshold is learned from them: the middle, in the logarithm, between the worst positive and the best negative
/// example; the answer says how many it rests on and how well they part.
#[utoipa::path(
    put, path = "/v1/standards/{name}/examples", tag = TAG, operation_id = "markExamples",
    params(("name" = String, Path, description = "The standard's name or id."), ConditionHeaders),
    request_body = ExamplesView,
    responses((status = 200, description = "The standard.", body = StandardView), responses::BadRequest,
              responses::NotFound, responses::Stalled, responses::Conflict, responses::OtherState, responses::TooLarge,
              responses::WrongType, responses::Unprocessable, responses::Other)
)]
async fn mark(
    State(state): State<AppState>,
    Path(name): Path<String>,
    conditions: Conditions,
    request: Request,
) -> Result<Json<StandardView>, Problem> {
    let (body, _) = read_json::<ExamplesView>(&state, request).await?;
    let examples: Examples = body.examples()?;
    let standard = uploaded(&state, &name).await?;
    let _turn = conditions.turn(&state).await?;
    check(&state, &standard, &conditions).await?;
    state.context.database.mark_examples(standard.id, &examples).await?;
    Ok(Json(view(&state, &standard).await?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_can_stand_in_an_address_and_are_no_ids() {
        for good in ["teapot", "Face-2", "a_b"] {
            assert_eq!(checked_name(good).expect("plain"), good);
        }
        for bad in ["", "a b", "a/b", "über", &"x".repeat(65), &StandardId::new().to_string()] {
            assert!(checked_name(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn the_built_in_standard_has_the_shape_of_its_contract() {
        let listed = built_in().expect("one is built in");
        assert!(matches!(&listed[0], AnyStandard::BuiltIn(view) if view.name == "face" && view.built_in));
    }
}
