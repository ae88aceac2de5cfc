//! What the demo asks of the service.

use anyhow::Context;
use reqwest::multipart::{Form, Part};
use serde::Deserialize;

use super::super::client::http::{Client, Created};
use super::super::client::watch::Job;
use crate::domain::asset::Asset;
use crate::formats::poses::{self, PoseFile};

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

/// Uploads scans and their initial poses; gives the id of the scan set.
pub async fn create_scan_set(
    client: &Client,
    name: &str,
    scans: &[(String, Vec<u8>)],
    poses_json: &str,
) -> anyhow::Result<String> {
    let mut form = Form::new().text("name", name.to_owned()).text("unit", "mm");
    for (file, bytes) in scans {
        form = form.part("scans", Part::bytes(bytes.clone()).file_name(file.clone()));
    }
    form = form.part("poses", Part::text(poses_json.to_owned()).file_name(Asset::Poses.name()));
    let created: Created = client.post_form(client.url(&["v1", "scan-sets"]), form).await?;
    Ok(created.id)
}

/// Queues the registration of a scan set. The virtual scanner is the origin of each scan's frame.
pub async fn create_job(client: &Client, scan_set_id: &str, label: &str) -> anyhow::Result<Job> {
    let options = serde_json::json!({"sensor": [0.0, 0.0, 0.0]});
    let body = serde_json::json!({"scan_set_id": scan_set_id, "label": label, "options": options});
    client.post(client.url(&["v1", "jobs"]), &body).await
}

/// One file of a model.
pub async fn asset(client: &Client, model_id: &str, asset: Asset) -> anyhow::Result<Vec<u8>> {
    client.bytes(client.url(&["v1", "models", model_id, &asset.name()])).await
}

/// The poses that were found.
pub async fn poses(client: &Client, model_id: &str) -> anyhow::Result<PoseFile> {
    let bytes = asset(client, model_id, Asset::Poses).await?;
    poses::read(&Asset::Poses.name(), &bytes).context("reading the poses")
}

/// How all stored models compare with a standard.
pub async fn query_standard(client: &Client, standard: &str) -> anyhow::Result<Vec<Match>> {
    let body = serde_json::json!({"standard": standard});
    let answer: Answer = client.post(client.url(&["v1", "queries"]), &body).await?;
    Ok(answer.matches)
}
