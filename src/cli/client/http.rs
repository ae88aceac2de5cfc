//! As much of a client of the REST API as the demo needs.

use anyhow::{Context, anyhow, bail};
use reqwest::multipart::{Form, Part};
use reqwest::{RequestBuilder, Response};
use serde::Deserialize;
use serde::de::DeserializeOwned;

use crate::domain::asset::Asset;
use crate::formats::poses::{self, PoseFile};

/// Talks to one server.
pub struct Client {
    http: reqwest::Client,
    base: String,
}

/// The part of a stored resource that everything else needs.
#[derive(Debug, Deserialize)]
struct Created {
    id: String,
}

/// Where a job stands.
#[derive(Debug, Clone, Deserialize)]
pub struct Job {
    /// Its id.
    pub id: String,
    /// `queued`, `running`, `succeeded`, `failed` or `canceled`.
    pub status: String,
    /// The step it is in.
    pub stage: Option<String>,
    /// 0 to 1.
    pub progress: f64,
    model_id: Option<String>,
    error: Option<serde_json::Value>,
}

impl Job {
    /// Whether it has come to an end.
    pub fn is_finished(&self) -> bool {
        !matches!(self.status.as_str(), "queued" | "running")
    }

    /// The id of the model it left; an error that names the object if there is none.
    pub fn model(&self, object: &str) -> anyhow::Result<String> {
        match (&self.model_id, self.status.as_str()) {
            (Some(model), "succeeded") => Ok(model.clone()),
            (_, status) => {
                let reason = self.error.as_ref().map(ToString::to_string).unwrap_or_default();
                bail!("the job of the {object} {status} {reason}")
            }
        }
    }
}

/// One answer to a query.
#[derive(Debug, Clone, Deserialize)]
pub struct Match {
    /// The model.
    pub model_id: String,
    /// In [0, 1], high is good.
    pub score: f64,
    /// Whether it passes the standard's threshold.
    pub is_match: bool,
    /// Right eye, left eye and nose in the model's frame.
    pub triangle: Option<[[f64; 3]; 3]>,
}

#[derive(Debug, Deserialize)]
struct Answer {
    matches: Vec<Match>,
}

/// What the service says when it refuses (RFC 9457).
#[derive(Debug, Deserialize)]
struct Problem {
    detail: Option<String>,
    hint: Option<String>,
}

impl Client {
    /// A client of the server at `base`, such as `http://127.0.0.1:8080`.
    pub fn new(base: &str) -> anyhow::Result<Self> {
        // the server is ours and near: a proxy of the environment is none of its business
        let http = reqwest::Client::builder().no_proxy().build().context("making an HTTP client")?;
        Ok(Client { http, base: base.to_owned() })
    }

    /// The full address of a path.
    pub fn url(&self, path: &str) -> String {
        format!("{}{path}", self.base)
    }

    /// The full address of a model's file.
    pub fn asset_url(&self, model_id: &str, asset: &str) -> String {
        self.url(&format!("/v1/models/{model_id}/{asset}"))
    }

    /// Uploads scans and their initial poses; gives the id of the scan set.
    pub async fn create_scan_set(
        &self,
        name: &str,
        scans: &[(String, Vec<u8>)],
        poses_json: &str,
    ) -> anyhow::Result<String> {
        let mut form = Form::new().text("name", name.to_owned()).text("unit", "mm");
        for (file, bytes) in scans {
            form = form.part("scans", Part::bytes(bytes.clone()).file_name(file.clone()));
        }
        form = form.part("poses", Part::text(poses_json.to_owned()).file_name(Asset::Poses.name()));
        let created: Created = json(self.http.post(self.url("/v1/scan-sets")).multipart(form)).await?;
        Ok(created.id)
    }

    /// Queues the registration of a scan set. The virtual scanner is the origin of each scan's frame.
    pub async fn create_job(&self, scan_set_id: &str, label: &str) -> anyhow::Result<Job> {
        let options = serde_json::json!({"sensor": [0.0, 0.0, 0.0]});
        let body = serde_json::json!({"scan_set_id": scan_set_id, "label": label, "options": options});
        json(self.http.post(self.url("/v1/jobs")).json(&body)).await
    }

    /// Looks at a job.
    pub async fn job(&self, id: &str) -> anyhow::Result<Job> {
        json(self.http.get(self.url(&format!("/v1/jobs/{id}")))).await
    }

    /// One file of a model.
    pub async fn asset(&self, model_id: &str, asset: &str) -> anyhow::Result<Vec<u8>> {
        let response = send(self.http.get(self.asset_url(model_id, asset))).await?;
        Ok(response.bytes().await.with_context(|| format!("fetching {asset}"))?.to_vec())
    }

    /// The poses that were found.
    pub async fn poses(&self, model_id: &str) -> anyhow::Result<PoseFile> {
        let name = Asset::Poses.name();
        Ok(poses::read(&name, &self.asset(model_id, &name).await?)?)
    }

    /// How all stored models compare with a standard.
    pub async fn query_standard(&self, standard: &str) -> anyhow::Result<Vec<Match>> {
        let body = serde_json::json!({"standard": standard});
        let answer: Answer = json(self.http.post(self.url("/v1/queries")).json(&body)).await?;
        Ok(answer.matches)
    }
}

async fn json<T: DeserializeOwned>(request: RequestBuilder) -> anyhow::Result<T> {
    send(request).await?.json().await.context("reading the service's answer")
}

/// Sends a request; a refusal becomes an error with what the service says about it.
async fn send(request: RequestBuilder) -> anyhow::Result<Response> {
    let response = request.send().await.context("calling the service")?;
    let status = response.status();
    if status.is_success() {
        return Ok(response);
    }
    let text = response.text().await.unwrap_or_default();
    let reason = match serde_json::from_str::<Problem>(&text) {
        Ok(problem) => [problem.detail, problem.hint].into_iter().flatten().collect::<Vec<_>>().join("; "),
        Err(_) => text,
    };
    Err(anyhow!("the service answered {status}: {reason}"))
}
