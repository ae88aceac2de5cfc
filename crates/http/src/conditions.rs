//! `If-Match` and `If-None-Match` (RFC 9110, section 13): a request is for a state of the resource that its client knows.

use axum::extract::FromRequestParts;
use axum::http::request::Parts;
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use bytes::Bytes;
use serde::Serialize;
use tokio::sync::{OwnedRwLockReadGuard, OwnedRwLockWriteGuard};

use super::problem::{Code, Problem};
use super::state::AppState;
use visage_service::storage::database::{Alone, Exclusive};

/// A strong validator: equal for equal bytes alone.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ETag(String);

impl ETag {
    /// Of content whose checksum is known.
    pub fn of_checksum(checksum: &str) -> ETag {
        ETag(format!("\"{checksum}\""))
    }

    /// Of content.
    pub fn of_bytes(bytes: &[u8]) -> ETag {
        ETag::of_checksum(&blake3::hash(bytes).to_hex())
    }

    /// Of what is shown as JSON.
    pub fn of_view(view: &impl Serialize) -> Result<ETag, Problem> {
        Ok(ETag::of_bytes(&serde_json::to_vec(view).map_err(Problem::internal)?))
    }

    /// As a header of an answer.
    pub fn header(&self) -> Result<(HeaderName, HeaderValue), Problem> {
        Ok((header::ETAG, HeaderValue::try_from(&self.0).map_err(Problem::internal)?))
    }

    /// Whether an `If-Range` gives this one.
    pub fn is_given_by(&self, value: &HeaderValue) -> bool {
        value.as_bytes() == self.0.as_bytes()
    }

    /// Whether this tag of a request is this one. A weak one says that its content may differ in bytes.
    fn is(&self, tag: &str, weak_counts: bool) -> bool {
        tag == self.0 || (weak_counts && tag.strip_prefix("W/") == Some(&self.0))
    }
}

/// What a request asks of the state of its resource.
#[derive(Debug, Clone, Default)]
pub struct Conditions {
    if_match: Option<Vec<String>>,
    if_none_match: Option<Vec<String>>,
}

/// The same as the contract describes them.
#[derive(utoipa::IntoParams)]
#[into_params(parameter_in = Header)]
#[expect(dead_code, reason = "only describes the headers")]
pub struct ConditionHeaders {
    /// The request is for this ETag (or one of several, or `*` for whatever is there), and refused (412) for any other.
    #[param(rename = "If-Match", required = false)]
    if_match: String,
    /// The ETag that is known already (or several, or `*`): such a content is not sent again (304) and not changed (412).
    #[param(rename = "If-None-Match", required = false)]
    if_none_match: String,
}

impl<S: Send + Sync> FromRequestParts<S> for Conditions {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, _state: &S) -> Result<Self, Problem> {
        Ok(Conditions::of(&parts.headers))
    }
}

/// Keeps a condition true until the change that it is for is made: conditional changes are made alone.
pub struct Turn {
    _shared: Option<OwnedRwLockReadGuard<()>>,
    _alone: Option<OwnedRwLockWriteGuard<()>>,
    /// The same among the processes that use the database.
    _among_processes: Exclusive,
}

impl Turn {
    /// Waits until a change may be made, alone if it depends on the state of what it changes.
    pub async fn take(state: &AppState, alone: bool) -> Result<Turn, Problem> {
        let changes = state.changes.clone();
        let (shared, own) = match alone {
            true => (None, Some(changes.write_owned().await)),
            false => (Some(changes.read_owned().await), None),
        };
        let among_processes = state.context.database.wait_for(Alone::ConditionalChange, !alone).await?;
        Ok(Turn { _shared: shared, _alone: own, _among_processes: among_processes })
    }
}

impl Conditions {
    /// Of these headers.
    pub fn of(headers: &HeaderMap) -> Conditions {
        Conditions { if_match: tags(headers, header::IF_MATCH), if_none_match: tags(headers, header::IF_NONE_MATCH) }
    }

    /// Whether anything is asked.
    pub fn any(&self) -> bool {
        self.if_match.is_some() || self.if_none_match.is_some()
    }

    /// Waits until the change may be made. To be held until it is.
    pub async fn turn(&self, state: &AppState) -> Result<Turn, Problem> {
        Turn::take(state, self.any()).await
    }

    /// Refuses the request if what is there (`None`: nothing) is not what it asks for.
    pub fn check(&self, current: Option<&ETag>) -> Result<(), Problem> {
        self.check_match(current)?;
        match &self.if_none_match {
            Some(tags) if is_among(tags, current, true) => Err(failed("If-None-Match names what is there")),
            _ => Ok(()),
        }
    }

    /// The same for what is shown as JSON.
    pub fn check_view(&self, view: &impl Serialize) -> Result<(), Problem> {
        if self.any() { self.check(Some(&ETag::of_view(view)?)) } else { Ok(()) }
    }

    /// `If-Match` alone: a request that reads is answered with 304 by the other.
    pub fn check_match(&self, current: Option<&ETag>) -> Result<(), Problem> {
        match &self.if_match {
            Some(tags) if !is_among(tags, current, false) => Err(failed("If-Match does not name what is there")),
            _ => Ok(()),
        }
    }

    /// Whether a client that reads knows the content already.
    pub fn knows(&self, current: &ETag) -> bool {
        self.if_none_match.as_ref().is_some_and(|tags| is_among(tags, Some(current), true))
    }

    /// The answer to a request that reads what is shown as JSON.
    pub fn answer(&self, view: &impl Serialize) -> Result<Response, Problem> {
        self.answer_with(serde_json::to_vec(view).map_err(Problem::internal)?.into())
    }

    /// The same of JSON that is written already.
    pub fn answer_with(&self, body: Bytes) -> Result<Response, Problem> {
        let etag = ETag::of_bytes(&body);
        self.check_match(Some(&etag))?;
        // what is known may be asked for again at any time, but not shown unasked: a deletion has to be seen
        let headers = [etag.header()?, (header::CACHE_CONTROL, HeaderValue::from_static("private, no-cache"))];
        if self.knows(&etag) {
            return Ok((StatusCode::NOT_MODIFIED, headers).into_response());
        }
        let json = [(header::CONTENT_TYPE, HeaderValue::from_static("application/json"))];
        Ok((headers, json, body).into_response())
    }
}

fn failed(detail: &str) -> Problem {
    let hint = "look at the resource again, and decide by its new ETag";
    Problem::new(Code::PreconditionFailed, detail, hint)
}

/// The tags of a header, however many lines it has; one that can't be read is one that nothing has.
fn tags(headers: &HeaderMap, name: HeaderName) -> Option<Vec<String>> {
    let mut given = headers.get_all(name).iter().peekable();
    given.peek()?;
    let tags = given.flat_map(|value| value.to_str().unwrap_or_default().split(','));
    Some(tags.map(|tag| tag.trim().to_owned()).collect())
}

fn is_among(tags: &[String], current: Option<&ETag>, weak_counts: bool) -> bool {
    current.is_some_and(|current| tags.iter().any(|tag| tag == "*" || current.is(tag, weak_counts)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn conditions(lines: &[(HeaderName, &'static str)]) -> Conditions {
        let lines = lines.iter().map(|(name, value)| (name.clone(), HeaderValue::from_static(value)));
        let mut headers = HeaderMap::new();
        for (name, value) in lines {
            headers.append(name, value);
        }
        Conditions::of(&headers)
    }

    #[test]
    fn a_change_is_made_to_what_its_client_knows_alone() {
        let current = ETag::of_checksum("ab");
        let passes = |value| conditions(&[(header::IF_MATCH, value)]).check(Some(&current)).is_ok();
        assert!(passes("\"ab\"") && passes("*") && passes("\"x\", \"ab\""));
        assert!(!passes("\"x\"") && !passes("W/\"ab\"") && !passes("ab") && !passes(""));
        assert!(conditions(&[(header::IF_MATCH, "\"x\""), (header::IF_MATCH, "\"ab\"")]).check(Some(&current)).is_ok());
        assert!(conditions(&[(header::IF_MATCH, "*")]).check(None).is_err(), "nothing is there");
        assert!(conditions(&[]).check(None).is_ok());
    }

    #[test]
    fn what_is_there_is_not_replaced_when_nothing_should_be_there() {
        let current = ETag::of_checksum("ab");
        let passes = |value, current| conditions(&[(header::IF_NONE_MATCH, value)]).check(current).is_ok();
        assert!(passes("*", None) && passes("\"x\"", Some(&current)));
        assert!(!passes("*", Some(&current)) && !passes("W/\"ab\"", Some(&current)));
    }

    #[test]
    fn known_content_is_not_sent_again() {
        let view = serde_json::json!({"a": 1});
        let etag = ETag::of_view(&view).expect("JSON");
        let known = Conditions { if_none_match: Some(vec![etag.0.clone()]), ..Conditions::default() };
        let answer = known.answer(&view).expect("an answer");
        assert_eq!(answer.status(), StatusCode::NOT_MODIFIED);
        assert_eq!(answer.headers()[header::ETAG], etag.0.as_str());
        assert_eq!(Conditions::default().answer(&view).expect("an answer").status(), StatusCode::OK);
        let other = Conditions { if_match: Some(vec!["\"x\"".to_owned()]), ..Conditions::default() };
        assert_eq!(other.answer(&view).expect_err("another").code(), Code::PreconditionFailed);
    }
}
