//! Waiting for the end of a job.

use std::time::Duration;

use anyhow::bail;
use indicatif::{ProgressBar, ProgressStyle};
use serde::Deserialize;

use super::http::{Client, is_passing};

/// So often in a row a job may be asked for in vain, a second apart, before its service counts as gone.
const PATIENCE: usize = 30;

/// Where a job stands.
#[derive(Debug, Clone, Deserialize)]
pub struct Job {
    /// Its id.
    pub id: String,
    /// `register`, `surface` or `evaluate`.
    pub kind: String,
    /// `queued`, `running`, `succeeded`, `failed` or `canceled`.
    pub status: String,
    /// The step it is in.
    pub stage: Option<String>,
    /// 0 to 1.
    pub progress: f64,
    /// What it left.
    pub model_id: Option<String>,
    /// When it was accepted.
    pub created_at: String,
    error: Option<JobError>,
}

/// Why a job failed.
#[derive(Debug, Clone, Deserialize)]
struct JobError {
    message: String,
    hint: Option<String>,
}

impl Job {
    /// Whether it has come to an end.
    pub fn is_finished(&self) -> bool {
        !matches!(self.status.as_str(), "queued" | "running")
    }

    /// Why it failed, with the remedy; empty if it did not.
    pub fn reason(&self) -> String {
        let error = self.error.iter().flat_map(|error| [Some(&error.message), error.hint.as_ref()]);
        error.flatten().map(String::as_str).collect::<Vec<_>>().join("; ")
    }

    /// The id of the model it left, if it makes one; an error if it did not succeed.
    pub fn model(&self) -> anyhow::Result<Option<&str>> {
        if self.status != "succeeded" {
            bail!("job {} {}: {}", self.id, self.status, self.reason());
        }
        Ok(self.model_id.as_deref())
    }
}

/// Waits for the end of a job, its progress in a bar (on a terminal). A service that is gone for a while is waited for.
pub async fn until_finished(client: &Client, id: &str, name: &str) -> anyhow::Result<Job> {
    let style = ProgressStyle::with_template("{prefix} [{bar:30}] {percent:>3} % {msg} {elapsed}")?;
    let bar = ProgressBar::new(1000).with_style(style.progress_chars("=> ")).with_prefix(name.to_owned());
    bar.enable_steady_tick(Duration::from_millis(200));
    let mut in_vain = 0;
    loop {
        // answers at the job's end, or after a second
        let mut url = client.url(&["v1", "jobs", id]);
        url.query_pairs_mut().append_pair("wait", "1");
        match client.get::<Job>(url).await {
            Ok(job) => {
                in_vain = 0;
                bar.set_position((job.progress * 1000.0) as u64);
                bar.set_message(job.stage.clone().unwrap_or_else(|| job.status.clone()));
                if job.is_finished() {
                    bar.finish_and_clear();
                    return Ok(job);
                }
            }
            Err(error) if is_passing(&error) && in_vain < PATIENCE => {
                in_vain += 1;
                bar.set_message("the service does not answer, asking again");
                tokio::time::sleep(Duration::from_secs(1)).await;
            }
            Err(error) => {
                bar.finish_and_clear();
                return Err(error);
            }
        }
    }
}
