//! The page at `/`: files that were built with the program, with what browsers need to keep them and to distrust
//! everything else.

use axum::Router;
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::get;

use super::conditions::{Conditions, ETag};
use super::problem::Problem;
use super::state::AppState;

include!(concat!(env!("OUT_DIR"), "/page_files.rs"));

/// What a page may do: load what this server has, and nothing else. No script stands in its text.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; \
                      connect-src 'self'; worker-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";
/// What any other answer may do if a browser shows it as a page: be looked at.
const POLICY_OF_OTHERS: &str = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; \
                                form-action 'none'; frame-ancestors 'none'; sandbox allow-downloads";
/// Names with a hash of the content never get another content.
const KEPT_FOREVER: &str = "public, max-age=31536000, immutable";
const ASKED_AGAIN: &str = "no-cache";

/// A file of the page, as it is and packed.
pub struct File {
    path: &'static str,
    plain: &'static [u8],
    gzip: Option<&'static [u8]>,
    brotli: Option<&'static [u8]>,
}

/// One way to send a file.
#[derive(Clone)]
struct Variant {
    encoding: Option<&'static str>,
    bytes: &'static [u8],
    etag: ETag,
}

impl File {
    /// Every way to send it, the smallest first.
    fn variants(&self) -> Vec<Variant> {
        let packed = [("br", self.brotli), ("gzip", self.gzip)];
        let packed = packed.into_iter().filter_map(|(encoding, bytes)| bytes.map(|bytes| (Some(encoding), bytes)));
        let all = packed.chain([(None, self.plain)]);
        all.map(|(encoding, bytes)| Variant { encoding, bytes, etag: ETag::of_bytes(bytes) }).collect()
    }

    fn media_type(&self) -> &'static str {
        match self.path.rsplit_once('.').map(|(_, ending)| ending) {
            Some("js") => "text/javascript; charset=utf-8",
            Some("css") => "text/css; charset=utf-8",
            Some("svg") => "image/svg+xml",
            Some("json") => "application/json",
            Some("txt") => "text/plain; charset=utf-8",
            Some("png") => "image/png",
            _ => "text/html; charset=utf-8",
        }
    }

    fn keeping(&self) -> &'static str {
        if self.path.starts_with("/assets/") { KEPT_FOREVER } else { ASKED_AGAIN }
    }
}

/// Every file of the page at its address.
pub fn routes() -> Router<AppState> {
    FILES.iter().fold(Router::new(), |router, file| {
        let variants = file.variants();
        let send = move |headers: HeaderMap| async move { answer(file, &variants, &headers) };
        router.route(file.path, get(send))
    })
}

/// Headers for what is not of the page: content that came from outside is never taken for something that it does not say
/// it is, and has no rights where the page has some.
pub fn distrust() -> [(HeaderName, HeaderValue); 3] {
    [
        (header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff")),
        (header::REFERRER_POLICY, HeaderValue::from_static("no-referrer")),
        (header::CONTENT_SECURITY_POLICY, HeaderValue::from_static(POLICY_OF_OTHERS)),
    ]
}

fn answer(file: &File, variants: &[Variant], headers: &HeaderMap) -> Result<Response, Problem> {
    let Some(variant) = variants.iter().find(|variant| variant.encoding.is_none_or(|name| takes(headers, name))) else {
        return Err(Problem::internal("a file of the page has no plain form"));
    };
    let common = [
        variant.etag.header()?,
        (header::CACHE_CONTROL, HeaderValue::from_static(file.keeping())),
        (header::VARY, HeaderValue::from_static("accept-encoding")),
        (header::CONTENT_SECURITY_POLICY, HeaderValue::from_static(POLICY)),
        (HeaderName::from_static("cross-origin-opener-policy"), HeaderValue::from_static("same-origin")),
    ];
    if Conditions::of(headers).knows(&variant.etag) {
        return Ok((StatusCode::NOT_MODIFIED, common).into_response());
    }
    let mut response = (common, variant.bytes).into_response();
    response.headers_mut().insert(header::CONTENT_TYPE, HeaderValue::from_static(file.media_type()));
    if let Some(encoding) = variant.encoding {
        response.headers_mut().insert(header::CONTENT_ENCODING, HeaderValue::from_static(encoding));
    }
    Ok(response)
}

/// Whether `Accept-Encoding` names this encoding (RFC 9110, section 12.5.3): a weight of zero refuses it.
fn takes(headers: &HeaderMap, encoding: &str) -> bool {
    let lines = headers.get_all(header::ACCEPT_ENCODING).iter().filter_map(|value| value.to_str().ok());
    let mut weights = lines.flat_map(|line| line.split(',')).filter_map(|item| {
        let mut parts = item.split(';').map(str::trim);
        let is_meant = parts.next().is_some_and(|name| name.eq_ignore_ascii_case(encoding));
        let weight = parts.find_map(|part| part.strip_prefix("q=").or_else(|| part.strip_prefix("Q=")));
        is_meant.then(|| weight.map_or(1.0, |weight| weight.parse().unwrap_or(0.0)))
    });
    weights.next().is_some_and(|weight: f64| weight > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    static FILE: File = File { path: "/assets/a-1.js", plain: b"plain", gzip: Some(b"gz"), brotli: Some(b"b") };

    fn asked(file: &'static File, given: &[(HeaderName, &str)]) -> Response {
        let headers = given.iter().map(|(name, value)| (name.clone(), HeaderValue::from_str(value).expect("a header")));
        answer(file, &file.variants(), &headers.collect()).expect("an answer")
    }

    fn encoding(accepted: &str) -> Option<String> {
        let response = asked(&FILE, &[(header::ACCEPT_ENCODING, accepted)]);
        response.headers().get(header::CONTENT_ENCODING).map(|value| value.to_str().expect("text").to_owned())
    }

    #[test]
    fn the_smallest_form_that_is_accepted_is_sent() {
        assert_eq!(encoding("gzip, deflate, br, zstd").as_deref(), Some("br"));
        assert_eq!(encoding("gzip;q=0.5").as_deref(), Some("gzip"));
        assert_eq!(encoding("br;q=0, gzip;q=0, deflate"), None);
        assert_eq!(encoding(""), None);
        assert!(asked(&FILE, &[]).headers().get(header::CONTENT_ENCODING).is_none());
    }

    #[test]
    fn what_is_known_is_not_sent_again() {
        let first = asked(&FILE, &[(header::ACCEPT_ENCODING, "br")]);
        assert_eq!(first.headers()[header::CACHE_CONTROL], KEPT_FOREVER);
        let etag = first.headers()[header::ETAG].to_str().expect("text").to_owned();
        let again = |accepted| asked(&FILE, &[(header::ACCEPT_ENCODING, accepted), (header::IF_NONE_MATCH, &etag)]);
        assert_eq!(again("br").status(), StatusCode::NOT_MODIFIED);
        assert_eq!(again("gzip").status(), StatusCode::OK, "other bytes have another tag");
    }

    #[test]
    fn every_file_has_a_type_a_policy_and_no_script_in_its_text() {
        assert!(FILES.iter().any(|file| file.path == "/"));
        for file in FILES {
            let response = asked(file, &[]);
            assert_eq!(response.headers()[header::CONTENT_SECURITY_POLICY], POLICY);
            let is_page = response.headers()[header::CONTENT_TYPE] == "text/html; charset=utf-8";
            assert!(!file.path.starts_with("/v1") && !file.path.ends_with('z'), "{}", file.path);
            if is_page {
                let text = std::str::from_utf8(file.plain).expect("text");
                assert!(
                    !text.contains("<script>") && !text.contains("style=") && !text.contains("<style"),
                    "{}",
                    file.path
                );
                assert_eq!(response.headers()[header::CACHE_CONTROL], ASKED_AGAIN);
            }
        }
        assert!(!IS_BUILT || FILES.iter().any(|file| file.path == "/docs"));
    }
}
