//! Requests to the REST API, and what the service says when it refuses.

use anyhow::{Context, anyhow, bail};
use reqwest::multipart::Form;
use reqwest::{Method, RequestBuilder, Response, StatusCode, Url};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

/// Talks to one service.
pub struct Client {
    http: reqwest::Client,
    base: Url,
    key: Option<String>,
}

/// The part of a stored resource that everything else needs.
#[derive(Debug, Deserialize)]
pub struct Created {
    /// Its id.
    pub id: String,
}

/// What the service says when it refuses (RFC 9457).
#[derive(Debug, Deserialize)]
struct Problem {
    detail: Option<String>,
    hint: Option<String>,
}

/// A refusal.
#[derive(Debug, thiserror::Error)]
#[error("the service answered {status}: {reason}")]
pub struct Refusal {
    /// Its status.
    pub status: StatusCode,
    /// What the service says of it.
    reason: String,
}

impl Client {
    /// A client of the service at `base`, such as `http://127.0.0.1:8080`, known there by `key`.
    pub fn new(base: &str, key: Option<&str>) -> anyhow::Result<Self> {
        let mut base = Url::parse(base).with_context(|| format!("{base:?} is no address: write http://HOST:PORT"))?;
        if !matches!(base.scheme(), "http" | "https") {
            bail!("{base} is no address of a service: write http://HOST:PORT");
        }
        if !base.path().ends_with('/') {
            base.set_path(&format!("{}/", base.path()));
        }
        // a proxy of the environment has no business with a service on this machine
        let is_here = matches!(base.host_str(), Some("localhost" | "127.0.0.1" | "[::1]"));
        let builder = reqwest::Client::builder();
        let builder = if is_here { builder.no_proxy() } else { builder };
        let http = builder.build().context("making an HTTP client")?;
        Ok(Client { http, base, key: key.map(str::to_owned) })
    }

    /// The address of a resource, part by part: `["v1", "models", id]`.
    pub fn url(&self, path: &[&str]) -> Url {
        let mut url = self.base.clone();
        // an address with a host always has parts
        if let Ok(mut segments) = url.path_segments_mut() {
            segments.pop_if_empty().extend(path);
        }
        url
    }

    /// A request that may be given more before it is sent.
    pub fn request(&self, method: Method, url: Url) -> RequestBuilder {
        let request = self.http.request(method, url);
        match &self.key {
            Some(key) => request.bearer_auth(key),
            None => request,
        }
    }

    /// What stands at an address.
    pub async fn get<T: DeserializeOwned>(&self, url: Url) -> anyhow::Result<T> {
        self.answer(self.request(Method::GET, url)).await
    }

    /// A file that stands at an address.
    pub async fn bytes(&self, url: Url) -> anyhow::Result<Vec<u8>> {
        let response = self.send(self.request(Method::GET, url.clone())).await?;
        Ok(response.bytes().await.with_context(|| format!("fetching {url}"))?.to_vec())
    }

    /// Posts JSON.
    pub async fn post<T: DeserializeOwned>(&self, url: Url, body: &impl Serialize) -> anyhow::Result<T> {
        self.answer(self.request(Method::POST, url).json(body)).await
    }

    /// Posts a form.
    pub async fn post_form<T: DeserializeOwned>(&self, url: Url, form: Form) -> anyhow::Result<T> {
        self.answer(self.request(Method::POST, url).multipart(form)).await
    }

    /// Deletes what stands at an address.
    pub async fn delete(&self, url: Url) -> anyhow::Result<()> {
        self.send(self.request(Method::DELETE, url)).await.map(|_| ())
    }

    /// Sends a request whose answer is JSON.
    pub async fn answer<T: DeserializeOwned>(&self, request: RequestBuilder) -> anyhow::Result<T> {
        self.send(request).await?.json().await.context("reading the service's answer")
    }

    /// Sends a request; a refusal becomes a [`Refusal`] with what the service says about it.
    pub async fn send(&self, request: RequestBuilder) -> anyhow::Result<Response> {
        let response = request.send().await.map_err(|error| match error.is_connect() {
            true => anyhow!(error).context(format!(
                "no service answers at {}: start one with `visage serve`, or name another with --server",
                self.base
            )),
            false => anyhow!(error).context("calling the service"),
        })?;
        let status = response.status();
        if status.is_success() {
            return Ok(response);
        }
        let text = response.text().await.unwrap_or_default();
        let reason = match serde_json::from_str::<Problem>(&text) {
            Ok(problem) => [problem.detail, problem.hint].into_iter().flatten().collect::<Vec<_>>().join("; "),
            Err(_) => text.chars().take(400).collect(),
        };
        Err(Refusal { status, reason }.into())
    }
}

/// Whether the same request may succeed when it is sent again: nothing answered, or somebody who had no time.
pub fn is_passing(error: &anyhow::Error) -> bool {
    if let Some(refusal) = error.downcast_ref::<Refusal>() {
        let status = refusal.status;
        return matches!(
            status,
            StatusCode::REQUEST_TIMEOUT
                | StatusCode::TOO_MANY_REQUESTS
                | StatusCode::BAD_GATEWAY
                | StatusCode::SERVICE_UNAVAILABLE
                | StatusCode::GATEWAY_TIMEOUT
        );
    }
    error.chain().any(|cause| {
        let failed = cause.downcast_ref::<reqwest::Error>();
        failed.is_some_and(|error| error.is_connect() || error.is_request() || error.is_body() || error.is_timeout())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_made_part_by_part() {
        let url = |base: &str, path: &[&str]| Client::new(base, None).expect("a client").url(path).to_string();
        assert_eq!(url("http://a:1", &["v1", "models"]), "http://a:1/v1/models");
        assert_eq!(url("http://a:1/scans/", &["v1"]), "http://a:1/scans/v1");
        assert_eq!(url("http://a:1/scans", &["x", "front/a b.ply"]), "http://a:1/scans/x/front%2Fa%20b.ply");
    }

    #[test]
    fn what_is_no_address_is_refused_with_how_to_write_it() {
        for text in ["127.0.0.1:8080", "localhost:80", "file:///tmp", ""] {
            let error = Client::new(text, None).err().expect("refused");
            assert!(format!("{error:#}").contains("write http://HOST:PORT"), "{error:#}");
        }
    }

    #[test]
    fn a_refusal_for_want_of_time_passes_others_stay() {
        let refusal = |status| anyhow::Error::from(Refusal { status, reason: String::new() });
        assert!(is_passing(&refusal(StatusCode::SERVICE_UNAVAILABLE)));
        assert!(!is_passing(&refusal(StatusCode::UNPROCESSABLE_ENTITY)));
    }
}
