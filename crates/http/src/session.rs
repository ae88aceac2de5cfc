//! `/v1/session`: a browser shows a key once, and is known by a cookie from then on that no script can read.

use axum::Json;
use axum::extract::State;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::{Extension, http};
use serde::Serialize;
use utoipa::ToSchema;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::access::{self, Caller, SESSION_COOKIE};
use super::base;
use super::forwarded::Client;
use super::problem::{Code, Problem};
use super::responses;
use super::state::{AppState, uninterrupted};
use visage_domain::Scope;
use visage_service::app::access::{Shown, sign_in, sign_out};

const TAG: &str = "access";

/// The routes of this resource.
pub fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(who, begin, end))
}

/// Who one is to the service.
#[derive(Debug, Clone, Serialize, ToSchema)]
#[schema(as = Session)]
struct SessionView {
    /// What one may do; null for nothing but what is for everybody.
    scope: Option<Scope>,
    /// The name of the key that was shown; null without one.
    key: Option<String>,
    /// When the session or the key ends (UTC, RFC 3339); null if neither does.
    expires_at: Option<String>,
}

/// Who one is to the service: whether a key has to be shown, and what one may do.
#[utoipa::path(
    get, path = "/v1/session", tag = TAG, operation_id = "getSession",
    responses((status = 200, description = "Who one is.", body = SessionView), responses::Other)
)]
async fn who(Extension(caller): Extension<Caller>) -> Json<SessionView> {
    let expires_at = caller.key.as_ref().and_then(|key| key.expires_at).map(|end| end.to_string());
    Json(SessionView { scope: caller.scope, key: caller.key.map(|key| key.name), expires_at })
}

/// Sign in: a browser shows a key (`Authorization: Bearer`) and gets a cookie in its place, for twelve hours at most.
#[utoipa::path(
    post, path = "/v1/session", tag = TAG, operation_id = "signIn",
    responses((status = 201, description = "The session has begun.", body = SessionView,
               headers(("Set-Cookie" = String, description = "The session; not for scripts."))),
              responses::Other)
)]
async fn begin(
    State(state): State<AppState>,
    Extension(caller): Extension<Caller>,
    client: Option<Extension<Client>>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let by_key = matches!(access::shown(&headers), Ok(Some(Shown::Key(_))));
    let Some(key) = caller.key.filter(|_| by_key) else {
        let hint = "send it as `Authorization: Bearer KEY`; where no key is needed there is nothing to sign in to";
        return Err(Problem::new(Code::Unauthorized, "signing in takes a key", hint)
            .header(header::WWW_AUTHENTICATE, HeaderValue::from_static("Bearer realm=\"visage\"")));
    };
    let now = jiff::Timestamp::now();
    let (database, name, scope) = (state.context.database.clone(), key.name.clone(), key.scope);
    let (token, end) = uninterrupted(async move { Ok(sign_in(database.as_ref(), &key, now).await?) }).await?;
    let seconds = end.duration_since(now).as_secs().max(0);
    let view = SessionView { scope: Some(scope), key: Some(name), expires_at: Some(end.to_string()) };
    let cookie = cookie(&headers, client.as_deref(), &token.to_string(), seconds)?;
    Ok((StatusCode::CREATED, [(header::SET_COOKIE, cookie), no_store()], Json(view)).into_response())
}

/// Sign out: the session is over, here and in the browser.
#[utoipa::path(
    delete, path = "/v1/session", tag = TAG, operation_id = "signOut",
    responses((status = 204, description = "There is no session any more."), responses::Other)
)]
async fn end(
    State(state): State<AppState>,
    client: Option<Extension<Client>>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    if let Some(token) = access::session_of(&headers) {
        let database = state.context.database.clone();
        uninterrupted(async move { Ok(sign_out(database.as_ref(), token).await?) }).await?;
        // streams that it has begun end
        state.context.monitor.announce_change();
    }
    Ok((StatusCode::NO_CONTENT, [(header::SET_COOKIE, cookie(&headers, client.as_deref(), "", 0)?)]).into_response())
}

/// Scripts can't read it, pages from elsewhere can't use it, and over TLS it is never sent in the clear.
fn cookie(headers: &HeaderMap, client: Option<&Client>, value: &str, seconds: i64) -> Result<HeaderValue, Problem> {
    // the browser knows how it reached the page, whatever proxies are between; whoever lies harms only the own session
    let origin = headers.get(header::ORIGIN).map(HeaderValue::as_bytes);
    let is_secure = origin.is_some_and(|origin| origin.starts_with(b"https://"));
    let secure = if is_secure || client.is_some_and(|client| client.is_secure) { "; Secure" } else { "" };
    let path = base::cookie_path();
    let text = format!("{SESSION_COOKIE}={value}; HttpOnly; SameSite=Strict; Path={path}; Max-Age={seconds}{secure}");
    HeaderValue::try_from(text).map_err(Problem::internal)
}

fn no_store() -> (http::HeaderName, HeaderValue) {
    (header::CACHE_CONTROL, HeaderValue::from_static("no-store"))
}
