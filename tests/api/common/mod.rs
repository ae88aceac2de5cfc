//! A really started server on a free port and a temporary folder, with algorithms that do what a test tells them.

pub mod database;
pub mod engine;
pub mod files;
pub mod raw;
pub mod receiver;

use std::net::SocketAddr;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use reqwest::multipart::{Form, Part};
use reqwest::{Client, Response, StatusCode};
use serde_json::{Value, json};
use visage::config::ServerConfig;
use visage::http::{Connections, Server, ServerHandle};

pub use engine::{FakeEngine, Mode};

/// A running service.
pub struct TestServer {
    pub client: Client,
    pub engine: Arc<FakeEngine>,
    pub folder: tempfile::TempDir,
    pub handle: ServerHandle,
}

/// The settings of most tests: a free port, one job at a time, quick heartbeats.
pub fn config(folder: &Path) -> ServerConfig {
    let mut config = ServerConfig::new(SocketAddr::from(([127, 0, 0, 1], 0)), folder);
    config.database = database::database_for(folder);
    config.threads = 2;
    config.queue.heartbeat = Duration::from_millis(50);
    config.lock_patience = Duration::from_millis(100);
    config.shutdown_deadline = Duration::from_secs(3);
    config
}

impl TestServer {
    pub async fn start() -> Self {
        Self::start_with(|_| {}).await
    }

    pub async fn start_with(change: impl FnOnce(&mut ServerConfig)) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        Self::start_on(folder, change).await
    }

    /// Starts on a folder that may hold what another server left.
    pub async fn start_on(folder: tempfile::TempDir, change: impl FnOnce(&mut ServerConfig)) -> Self {
        let mut config = config(folder.path());
        change(&mut config);
        let engine = Arc::new(FakeEngine::default());
        let handle = Server::start_with(config, engine.clone()).await.expect("the server starts");
        let client = Client::builder().no_proxy().timeout(Duration::from_secs(30)).build().expect("a client");
        TestServer { client, engine, folder, handle }
    }

    pub fn url(&self, path: &str) -> String {
        format!("{}{path}", self.handle.url())
    }

    pub async fn get(&self, path: &str) -> Response {
        self.client.get(self.url(path)).send().await.expect("an answer")
    }

    pub async fn delete(&self, path: &str) -> StatusCode {
        self.client.delete(self.url(path)).send().await.expect("an answer").status()
    }

    pub async fn post(&self, path: &str, body: &Value) -> Response {
        self.client.post(self.url(path)).json(body).send().await.expect("an answer")
    }

    pub async fn post_form(&self, path: &str, form: Form) -> Response {
        self.client.post(self.url(path)).multipart(form).send().await.expect("an answer")
    }

    pub async fn put(&self, path: &str, body: impl Into<reqwest::Body>) -> Response {
        self.client.put(self.url(path)).body(body).send().await.expect("an answer")
    }

    /// A scan set of `count` small scans with poses; answers with its id.
    pub async fn scan_set(&self, count: usize) -> String {
        let response = self.post_form("/v1/scan-sets", scan_form(count)).await;
        let set = expect_json(response, StatusCode::CREATED).await;
        text(&set, "/id")
    }

    /// A queued job on a new scan set; answers with its id.
    pub async fn job(&self) -> String {
        let set = self.scan_set(3).await;
        let job = self.post("/v1/jobs", &json!({"scan_set_id": set})).await;
        text(&expect_json(job, StatusCode::ACCEPTED).await, "/id")
    }

    /// The job at its end, or after 20 s.
    pub async fn finished(&self, job: &str) -> Value {
        expect_json(self.get(&format!("/v1/jobs/{job}?wait=20")).await, StatusCode::OK).await
    }

    /// Waits until a job has the given status.
    pub async fn until(&self, job: &str, status: &str) -> Value {
        let begin = Instant::now();
        loop {
            let view = expect_json(self.get(&format!("/v1/jobs/{job}")).await, StatusCode::OK).await;
            if view["status"] == status {
                return view;
            }
            assert!(begin.elapsed() < Duration::from_secs(60), "still not {status}: {view}");
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
    }

    /// A model that a job has made: its id and the job's.
    pub async fn model(&self) -> (String, String) {
        let job = self.job().await;
        let view = self.finished(&job).await;
        assert_eq!(view["status"], "succeeded", "{view}");
        (text(&view, "/model_id"), job)
    }

    /// Waits until the connections are so.
    pub async fn until_connections(&self, wanted: impl Fn(&Connections) -> bool) {
        let mut connections = self.handle.connections();
        let waiting = connections.wait_for(wanted);
        tokio::time::timeout(Duration::from_secs(60), waiting).await.expect("in time").expect("the server runs");
    }

    /// Files under a part of the data folder.
    pub fn files(&self, part: &str) -> usize {
        count_files(&self.folder.path().join(part))
    }
}

fn count_files(folder: &Path) -> usize {
    let entries = std::fs::read_dir(folder).expect("a folder");
    entries
        .map(|entry| entry.expect("an entry").path())
        .map(|path| if path.is_dir() { count_files(&path) } else { 1 })
        .sum()
}

/// A form with `count` small scans and their poses.
pub fn scan_form(count: usize) -> Form {
    let names: Vec<String> = (0..count).map(|index| format!("scan{index}.ply")).collect();
    let form = names.iter().enumerate().fold(Form::new(), |form, (index, name)| {
        form.part("scans", Part::bytes(files::ply(50 + index)).file_name(name.clone()))
    });
    form.part("poses", Part::text(files::poses(&names)).file_name("poses.json"))
        .text("name", "three")
        .text("unit", "mm")
}

/// The JSON of an answer that has the expected status.
pub async fn expect_json(response: Response, status: StatusCode) -> Value {
    let found = response.status();
    let body = response.text().await.expect("a body");
    assert_eq!(found, status, "{body}");
    serde_json::from_str(&body).expect("JSON")
}

/// The body of an error, which must be a problem of the given status and code.
pub async fn expect_problem(response: Response, status: u16, code: &str) -> Value {
    let media_type = response.headers()["content-type"].clone();
    assert!(response.headers().contains_key("x-request-id"));
    let body = expect_json(response, StatusCode::from_u16(status).expect("a status")).await;
    assert_eq!(media_type, "application/problem+json");
    assert_eq!(body["code"], code, "{body}");
    assert_eq!(body["status"], status, "{body}");
    for field in ["type", "title", "detail", "hint"] {
        assert!(body[field].as_str().is_some_and(|text| !text.is_empty()), "{field} of {body}");
    }
    body
}

/// A string in a JSON answer.
pub fn text(value: &Value, pointer: &str) -> String {
    value.pointer(pointer).and_then(Value::as_str).unwrap_or_else(|| panic!("{pointer} of {value}")).to_owned()
}
