//! What every answer tells browsers, and from which other pages they may ask.

use axum::http::{HeaderName, HeaderValue, Method, header};
use axum::middleware::Next;
use axum::{extract::Request, response::Response};
use std::time::Duration;
use tower_http::cors::{AllowHeaders, AllowOrigin, CorsLayer, ExposeHeaders};

use visage_service::config::Origin;

/// Said unless an answer says otherwise itself, besides what `page` says of what is not the page: nothing may be framed,
/// other pages load nothing of it, and caches of others keep nothing.
const SAID: [(HeaderName, &str); 3] = [
    (header::X_FRAME_OPTIONS, "DENY"),
    (HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
    (header::CACHE_CONTROL, "private, no-cache"),
];

/// What clients of tus send.
const SENT_BY_TUS: [&str; 5] =
    ["tus-resumable", "upload-length", "upload-offset", "upload-metadata", "upload-checksum"];
/// What they read.
const SAID_TO_TUS: [&str; 8] = [
    "tus-resumable",
    "tus-version",
    "tus-extension",
    "tus-max-size",
    "upload-length",
    "upload-offset",
    "upload-metadata",
    "upload-expires",
];

/// Says it.
pub async fn said(request: Request, next: Next) -> Response {
    let mut response = next.run(request).await;
    let headers = response.headers_mut();
    for (name, value) in SAID {
        headers.entry(name).or_insert(HeaderValue::from_static(value));
    }
    response
}

/// Lets pages of these origins ask and read, with a key; the cookie of a session is not for them.
pub fn cors(origins: &[Origin]) -> CorsLayer {
    let origins = origins.iter().filter_map(|origin| HeaderValue::try_from(origin.as_str()).ok());
    CorsLayer::new()
        .allow_origin(AllowOrigin::list(origins))
        .allow_methods([Method::GET, Method::HEAD, Method::POST, Method::PUT, Method::PATCH, Method::DELETE])
        .allow_headers(AllowHeaders::list(SENT_BY_TUS.map(HeaderName::from_static).into_iter().chain([
            header::AUTHORIZATION,
            header::CONTENT_TYPE,
            header::ACCEPT,
            header::RANGE,
            header::IF_MATCH,
            header::IF_NONE_MATCH,
            HeaderName::from_static("idempotency-key"),
            HeaderName::from_static("content-digest"),
        ])))
        .expose_headers(ExposeHeaders::list(SAID_TO_TUS.map(HeaderName::from_static).into_iter().chain([
            header::ETAG,
            header::LOCATION,
            header::RETRY_AFTER,
            header::CONTENT_DISPOSITION,
            header::CONTENT_RANGE,
            header::WWW_AUTHENTICATE,
            HeaderName::from_static("x-request-id"),
            HeaderName::from_static("idempotent-replayed"),
        ])))
        .max_age(Duration::from_secs(600))
}
