//! Large scans, sent piece by piece (tus 1.0): what the service has already is not sent again, neither after a lost connection
//! nor by the next run of the command.

use std::io::BufRead;
use std::path::Path;
use std::time::Duration;

use anyhow::{Context, ensure};
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use indicatif::ProgressBar;
use reqwest::header::{CONTENT_LENGTH, CONTENT_TYPE};
use reqwest::{Method, StatusCode, Url};
use serde::Deserialize;
use sha2::Digest;

use super::http::{Client, Refusal, is_passing};
use super::upload::{ATTEMPTS, stream};

/// Smaller scans are sent whole: that is one request instead of four.
pub(super) const LARGE: u64 = 4 << 20;

/// An upload as the service knows it.
#[derive(Debug, Deserialize)]
struct Upload {
    id: String,
    name: String,
    bytes: u64,
    digest: Option<String>,
}

#[derive(Debug, Deserialize)]
struct Uploads {
    items: Vec<Upload>,
}

/// Sends a scan for a set, from where the last attempt has ended. As long as something arrives it goes on.
pub(super) async fn send(client: &Client, set: &str, name: &str, path: &Path, bar: &ProgressBar) -> anyhow::Result<()> {
    let bytes = std::fs::metadata(path).with_context(|| format!("reading {}", path.display()))?.len();
    let digest = digest(path)?;
    let (mut upload, mut reached, mut failed) = (None, 0, 0);
    loop {
        let sent = send_rest(client, set, (name, bytes, &digest), path, &mut upload, bar).await;
        let error = match sent {
            Ok(offset) if offset == bytes => return Ok(()),
            Ok(offset) => {
                ensure!(offset > reached, "the service takes nothing more of {name}");
                (reached, failed) = (offset, 0);
                continue;
            }
            Err(error) => error,
        };
        let status = error.downcast_ref::<Refusal>().map(|refusal| refusal.status);
        // whoever took over may be an earlier attempt of our own
        let may_pass = is_passing(&error) || status == Some(StatusCode::CONFLICT);
        match status {
            // given up meanwhile: begun anew
            Some(StatusCode::NOT_FOUND) if upload.take().is_some() => {}
            _ if may_pass && failed + 1 < ATTEMPTS => bar.set_message(format!("goes on ({error:#})")),
            _ => return Err(error),
        }
        failed += 1;
        tokio::time::sleep(Duration::from_secs(1 << (failed - 1))).await;
        if let Some(url) = &upload {
            let offset = offset(client, url).await.unwrap_or(reached);
            if offset > reached {
                (reached, failed) = (offset, 0);
            }
        }
    }
}

/// Sends what is left; answers with how much has arrived in all.
async fn send_rest(
    client: &Client,
    set: &str,
    (name, bytes, digest): (&str, u64, &str),
    path: &Path,
    upload: &mut Option<Url>,
    bar: &ProgressBar,
) -> anyhow::Result<u64> {
    let url = match upload {
        Some(url) => url.clone(),
        None => {
            let id = match known(client, set, (name, bytes, digest)).await? {
                Some(id) => id,
                None => begin(client, set, (name, bytes, digest)).await?,
            };
            upload.insert(client.url(&["v1", "uploads", &id])).clone()
        }
    };
    let from = offset(client, &url).await?;
    if from == bytes {
        return Ok(from);
    }
    let body = stream(path, from, bar).await?;
    let request = client
        .request(Method::PATCH, url)
        .header("tus-resumable", "1.0.0")
        .header("upload-offset", from)
        .header(CONTENT_TYPE, "application/offset+octet-stream")
        .header(CONTENT_LENGTH, bytes - from)
        .body(body);
    offset_in(&client.send(request).await?)
}

/// An upload of this very file that was broken off.
async fn known(client: &Client, set: &str, (name, bytes, digest): (&str, u64, &str)) -> anyhow::Result<Option<String>> {
    let uploads: Uploads = client.get(client.url(&["v1", "scan-sets", set, "uploads"])).await?;
    let mut items = uploads.items.into_iter();
    let found = items.find(|it| it.name == name && it.bytes == bytes && it.digest.as_deref() == Some(digest));
    Ok(found.map(|upload| upload.id))
}

async fn begin(client: &Client, set: &str, (name, bytes, digest): (&str, u64, &str)) -> anyhow::Result<String> {
    let metadata = format!("filename {},digest {}", STANDARD.encode(name), STANDARD.encode(digest));
    let request = client
        .request(Method::POST, client.url(&["v1", "scan-sets", set, "uploads"]))
        .header("tus-resumable", "1.0.0")
        .header("upload-length", bytes)
        .header("upload-metadata", metadata);
    let upload: Upload = client.answer(request).await?;
    Ok(upload.id)
}

async fn offset(client: &Client, url: &Url) -> anyhow::Result<u64> {
    let request = client.request(Method::HEAD, url.clone()).header("tus-resumable", "1.0.0");
    offset_in(&client.send(request).await?)
}

fn offset_in(answer: &reqwest::Response) -> anyhow::Result<u64> {
    let offset = answer.headers().get("upload-offset").and_then(|value| value.to_str().ok()?.parse().ok());
    offset.context("the service does not say how much has arrived: is there a proxy that drops Upload-Offset?")
}

/// As `Content-Digest` has it.
fn digest(path: &Path) -> anyhow::Result<String> {
    let reading = || format!("reading {}", path.display());
    let mut file = std::io::BufReader::new(std::fs::File::open(path).with_context(reading)?);
    let mut hasher = sha2::Sha256::new();
    loop {
        let part = file.fill_buf().with_context(reading)?;
        if part.is_empty() {
            break;
        }
        hasher.update(part);
        let read = part.len();
        file.consume(read);
    }
    Ok(format!("sha-256=:{}:", STANDARD.encode(hasher.finalize())))
}
