//! Parts of requests, with rejections as problem+json.

use axum::extract::{FromRequestParts, Request};
use axum::http::request::Parts;
use axum::http::{HeaderMap, header};
use serde::de::DeserializeOwned;

use super::body::read_body;
use super::cursor::{self, Fingerprint};
use super::problem::{Code, Problem};
use super::state::AppState;
use visage_domain::PageRequest;

/// Path parameters.
pub struct Path<T>(pub T);

impl<T: DeserializeOwned + Send, S: Send + Sync> FromRequestParts<S> for Path<T> {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, Problem> {
        match axum::extract::Path::from_request_parts(parts, state).await {
            Ok(axum::extract::Path(value)) => Ok(Path(value)),
            Err(rejection) => Err(Problem::new(
                Code::MalformedRequest,
                rejection.body_text(),
                "write the path in percent-encoded UTF-8",
            )),
        }
    }
}

/// The query of the URI.
pub struct Query<T>(pub T);

impl<T: DeserializeOwned, S: Send + Sync> FromRequestParts<S> for Query<T> {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, _state: &S) -> Result<Self, Problem> {
        match axum::extract::Query::try_from_uri(&parts.uri) {
            Ok(axum::extract::Query(value)) => Ok(Query(value)),
            Err(rejection) => {
                let hint = "see /openapi.yaml for the parameters of this call";
                Err(Problem::new(Code::MalformedRequest, rejection.body_text(), hint))
            }
        }
    }
}

/// The `Idempotency-Key` of a request.
pub struct IdempotencyKey(pub Option<String>);

/// The same as the contract describes it.
#[derive(utoipa::IntoParams)]
#[into_params(parameter_in = Header)]
#[expect(dead_code, reason = "only describes the header")]
pub struct IdempotencyHeader {
    /// Makes a repeated request harmless: 1 to 255 visible ASCII characters, such as a UUID.
    #[param(
        rename = "Idempotency-Key",
        required = false,
        min_length = 1,
        max_length = 255,
        pattern = "^[!-~]([ -~]*[!-~])?$"
    )]
    idempotency_key: String,
}

/// The longest key that is kept.
pub const LONGEST_KEY: usize = 255;

impl<S: Send + Sync> FromRequestParts<S> for IdempotencyKey {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, _state: &S) -> Result<Self, Problem> {
        let Some(value) = parts.headers.get("idempotency-key") else { return Ok(IdempotencyKey(None)) };
        match value.to_str() {
            // a tab passes as a part of a header's text
            Ok(key) if (1..=LONGEST_KEY).contains(&key.len()) && !key.contains('\t') => {
                Ok(IdempotencyKey(Some(key.to_owned())))
            }
            _ => Err(Problem::new(
                Code::MalformedRequest,
                format!("the idempotency key must be 1 to {LONGEST_KEY} visible ASCII characters"),
                "use a UUID",
            )),
        }
    }
}

/// Which part of a list is wanted.
#[derive(Debug, Clone, Default, serde::Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub struct PageQuery {
    /// At most so many items (1 to 100, 20 if not given).
    #[param(minimum = 1, maximum = 100, default = 20)]
    pub limit: Option<usize>,
    /// `next_cursor` of the page before.
    pub cursor: Option<String>,
}

impl PageQuery {
    const DEFAULT: usize = 20;
    const MOST: usize = 100;

    /// The page of this list as the database wants it.
    pub fn request(&self, list: &Fingerprint) -> Result<PageRequest, Problem> {
        let limit = self.limit.unwrap_or(Self::DEFAULT);
        if !(1..=Self::MOST).contains(&limit) {
            let detail = format!("limit is {limit}, which is not between 1 and {}", Self::MOST);
            return Err(Problem::new(Code::InvalidField, detail, "ask for several pages"));
        }
        let last = self.cursor.as_deref().map(|text| cursor::read_item(text, list)).transpose()?;
        Ok(PageRequest { before: last.map(|id| uuid::Uuid::from_u128(id).to_string()), limit })
    }
}

/// What the `Content-Type` says without its parameters, in lower case.
pub fn media_type(headers: &HeaderMap) -> String {
    let value = headers.get(header::CONTENT_TYPE).and_then(|value| value.to_str().ok()).unwrap_or_default();
    value.split(';').next().unwrap_or_default().trim().to_ascii_lowercase()
}

/// Whether a media type is JSON.
pub fn is_json(media_type: &str) -> bool {
    media_type == "application/json" || media_type.ends_with("+json")
}

/// The media type of forms with files.
pub const FORM: &str = "multipart/form-data";

/// Neither JSON nor a form.
pub fn wrong_media_type(found: &str, wanted: &str) -> Problem {
    let detail =
        if found.is_empty() { "there is no Content-Type".to_owned() } else { format!("{found} is not read here") };
    Problem::new(Code::UnsupportedMediaType, detail, format!("send {wanted}"))
}

/// A JSON body.
pub async fn read_json<T: DeserializeOwned>(state: &AppState, request: Request) -> Result<(T, bytes::Bytes), Problem> {
    let found = media_type(request.headers());
    if !is_json(&found) {
        return Err(wrong_media_type(&found, "application/json"));
    }
    let body = read_body(state, request, state.limits().text_bytes).await?;
    // serde would also take an array of the values in their order
    if body.trim_ascii_start().starts_with(b"[") {
        return Err(Problem::new(Code::InvalidField, "the body is a JSON array", "send a JSON object"));
    }
    Ok((parse_json("the body", &body)?, body))
}

/// JSON that came as a body or as a part of a form.
pub fn parse_json<T: DeserializeOwned>(what: &str, bytes: &[u8]) -> Result<T, Problem> {
    let parsed = serde_json::from_slice(bytes);
    // the first error tells the place; it stands unless 20.0 is all that is wrong with a 20
    let parsed = parsed.or_else(|error| {
        let mut value = if error.is_data() { serde_json::from_slice(bytes)? } else { return Err(error) };
        whole_numbers(&mut value);
        serde_json::from_value(value).map_err(|_| error)
    });
    parsed.map_err(|error| {
        if error.is_data() {
            let detail = format!("{what} has a field that is not allowed: {error}");
            Problem::new(Code::InvalidField, detail, "see /openapi.yaml for the fields of this call")
        } else {
            let detail = format!("{what} is no JSON: {error}");
            Problem::new(Code::MalformedRequest, detail, "send well-formed JSON in UTF-8")
        }
    })
}

/// Makes integers of numbers such as 20.0: to JSON Schema, and so to the contract, they are integers, to serde they aren't.
pub fn whole_numbers(value: &mut serde_json::Value) {
    /// Beyond this not every integer has a floating point number of its own.
    const EXACT: f64 = 9_007_199_254_740_992.0;
    match value {
        serde_json::Value::Number(number) => {
            if let Some(float) = number.as_f64().filter(|x| number.is_f64() && x.fract() == 0.0 && x.abs() <= EXACT) {
                *value = (float as i64).into();
            }
        }
        serde_json::Value::Array(items) => items.iter_mut().for_each(whole_numbers),
        serde_json::Value::Object(fields) => fields.values_mut().for_each(whole_numbers),
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, serde::Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Sample {
        #[expect(dead_code, reason = "only parsed")]
        a: u8,
    }

    #[test]
    fn broken_json_and_wrong_fields_are_told_apart() {
        let broken = parse_json::<Sample>("the body", b"{\"a\": ").expect_err("cut short");
        assert_eq!(broken.code(), Code::MalformedRequest);
        let wrong = parse_json::<Sample>("the body", b"{\"a\": \"x\"}").expect_err("no number");
        assert_eq!(wrong.code(), Code::InvalidField);
        let unknown = parse_json::<Sample>("the body", b"{\"a\": 1, \"b\": 2}").expect_err("unknown field");
        assert_eq!(unknown.code(), Code::InvalidField);
    }

    #[test]
    fn a_whole_number_is_an_integer_however_it_is_written() {
        for whole in ["7", "7.0", "70e-1"] {
            assert_eq!(parse_json::<u8>("the body", whole.as_bytes()).expect(whole), 7);
        }
        for other in ["7.5", "-7.0", "1e300", "\"7\""] {
            assert_eq!(parse_json::<u8>("the body", other.as_bytes()).expect_err(other).code(), Code::InvalidField);
        }
        let mut value = serde_json::json!({"a": [1.0, 0.5], "b": 1e17});
        whole_numbers(&mut value);
        assert_eq!(value, serde_json::json!({"a": [1, 0.5], "b": 1e17}));
    }

    #[test]
    fn pages_have_bounds() {
        let page = |limit| PageQuery { limit, cursor: None }.request(&cursor::fingerprint(&[]));
        assert_eq!(page(None).expect("default").limit, 20);
        assert!(page(Some(0)).is_err());
        assert!(page(Some(101)).is_err());
    }
}
