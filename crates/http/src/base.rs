//! Served below a path (`--base-path /visage`): what comes in loses it, and addresses that go out get it.
//!
//! Handlers know paths from the root, as the contract writes them. A request may come with the base path or without it,
//! since some proxies take it off. Addresses in answers are made by [`link`], which knows the base path of the request that
//! is being answered; work that goes on by itself takes it along ([`carried`]).

use axum::Router;
use axum::extract::{Request, State};
use axum::http::uri::PathAndQuery;
use axum::http::{HeaderValue, StatusCode, Uri, header};
use axum::middleware::{Next, from_fn_with_state};
use axum::response::{IntoResponse, Response};

use visage_service::config::BasePath;

tokio::task_local! {
    static BASE: BasePath;
}

/// An address in an answer: a path from the root, as clients have to ask for it.
pub fn link(path: &str) -> String {
    BASE.try_with(|base| format!("{}{path}", base.as_str())).unwrap_or_else(|_| path.to_owned())
}

/// Work that answers the request at hand, wherever it runs.
pub fn carried<F: Future>(work: F) -> impl Future<Output = F::Output> {
    within(current(), work)
}

/// The base path of the request at hand.
pub fn current() -> BasePath {
    BASE.try_with(BasePath::clone).unwrap_or_default()
}

/// Work that answers a request with this base path.
pub fn within<F: Future>(base: BasePath, work: F) -> impl Future<Output = F::Output> {
    BASE.scope(base, work)
}

/// Where a cookie is sent to.
pub fn cookie_path() -> String {
    BASE.try_with(BasePath::to_string).unwrap_or_else(|_| "/".to_owned())
}

/// The same service below a path.
pub fn below(base: BasePath, inner: Router) -> Router {
    if base.as_str().is_empty() {
        return inner;
    }
    // a layer of the router itself would come after its routes were looked at
    Router::new().fallback_service(inner).layer(from_fn_with_state(base, stripped))
}

async fn stripped(State(base): State<BasePath>, mut request: Request, next: Next) -> Response {
    let path = request.uri().path();
    if path == base.as_str() {
        // what the page loads stands beside it, so its address has to end with a slash
        let Ok(location) = HeaderValue::try_from(format!("{}/", base.as_str())) else {
            return StatusCode::NOT_FOUND.into_response();
        };
        return (StatusCode::PERMANENT_REDIRECT, [(header::LOCATION, location)]).into_response();
    }
    if let Some(inner) = base.strip(path).and_then(|path| without_base(request.uri(), path)) {
        *request.uri_mut() = inner;
    }
    BASE.scope(base, next.run(request)).await
}

fn without_base(uri: &Uri, path: &str) -> Option<Uri> {
    let text = uri.query().map_or_else(|| path.to_owned(), |query| format!("{path}?{query}"));
    let mut parts = uri.clone().into_parts();
    parts.path_and_query = Some(PathAndQuery::try_from(text).ok()?);
    Uri::from_parts(parts).ok()
}

#[cfg(test)]
mod tests {
    use axum::body::{Body, to_bytes};
    use axum::routing::get;
    use tower::ServiceExt;

    use super::*;

    async fn asked(uri: &str) -> (StatusCode, String, String) {
        let told = |request: Request| async move {
            let inside = carried(async { link("/v1/x") });
            format!("{} {}", request.uri(), tokio::spawn(inside).await.expect("it ends"))
        };
        let inner = Router::new().route("/v1/{id}", get(told)).route("/", get(told));
        let service = below("/visage".parse().expect("a path"), inner);
        let answer =
            service.oneshot(Request::get(uri).body(Body::empty()).expect("a request")).await.expect("an answer");
        let location = answer.headers().get(header::LOCATION).map(|value| value.to_str().expect("text").to_owned());
        let status = answer.status();
        let body = to_bytes(answer.into_body(), 1000).await.expect("a body");
        (status, String::from_utf8_lossy(&body).into_owned(), location.unwrap_or_default())
    }

    #[tokio::test]
    async fn a_request_comes_with_the_base_path_or_without_it_and_links_have_it() {
        for (uri, seen) in [
            ("/visage/v1/a?x=/visage/b", "/v1/a?x=/visage/b"),
            ("/v1/a", "/v1/a"),
            ("/visage/", "/"),
            ("http://h/visage/v1/a", "http://h/v1/a"),
        ] {
            assert_eq!(asked(uri).await, (StatusCode::OK, format!("{seen} /visage/v1/x"), String::new()), "{uri}");
        }
        assert_eq!(asked("/visages/v1/a").await.0, StatusCode::NOT_FOUND);
        let (status, _, location) = asked("/visage").await;
        assert_eq!((status, location.as_str()), (StatusCode::PERMANENT_REDIRECT, "/visage/"));
    }

    #[tokio::test]
    async fn at_the_root_links_are_as_they_are() {
        assert_eq!((link("/v1/x"), cookie_path()), ("/v1/x".to_owned(), "/".to_owned()));
    }
}
