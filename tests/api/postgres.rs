//! A database on a PostgreSQL server: stopped and started again, used by one service alone, and moved to. Servers of their own, by
//! `.ci/postgres` with the programs in VISAGE_POSTGRES_BIN.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::Arc;

use reqwest::StatusCode;
use reqwest::multipart::{Form, Part};
use serde_json::{Value, json};
use visage::config::{DatabaseUrl, ServerConfig};
use visage::http::Server;

use crate::common::{FakeEngine, Mode, TestServer, config, expect_json, files, text};

/// A server of PostgreSQL that goes with the test.
struct Postgres {
    folder: tempfile::TempDir,
}

impl Postgres {
    fn start() -> Postgres {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let postgres = Postgres { folder };
        postgres.run("start");
        postgres
    }

    fn run(&self, what: &str) {
        assert!(self.runs(what), "{what}");
    }

    fn runs(&self, what: &str) -> bool {
        let bin = std::env::var("VISAGE_POSTGRES_BIN").expect("VISAGE_POSTGRES_BIN is the folder of its programs");
        let script = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(".ci/postgres");
        Command::new(script).args([what, &bin]).arg(self.folder.path()).status().expect("it runs").success()
    }

    fn url(&self) -> DatabaseUrl {
        let address = format!("postgres://visage:geheim@localhost/postgres?host={}", self.folder.path().display());
        address.parse().unwrap_or_else(|never| match never {})
    }

    fn use_it(&self) -> impl FnOnce(&mut ServerConfig) + use<> {
        let url = self.url();
        move |config| config.database = Some(url)
    }
}

impl Drop for Postgres {
    fn drop(&mut self) {
        // a test that fails may have stopped it
        self.runs("stop");
    }
}

fn model_form(phase: f64) -> Form {
    let mesh = Part::bytes(files::bumpy_sphere(phase)).file_name("ball.obj");
    Form::new().part("model", mesh).text("unit", "mm")
}

async fn upload(server: &TestServer, phase: f64) -> String {
    text(&expect_json(server.post_form("/v1/models", model_form(phase)).await, StatusCode::CREATED).await, "/id")
}

/// Asks until the service is ready: of a server that comes back nobody is told.
async fn ready(server: &TestServer) {
    while server.get("/readyz").await.status() != StatusCode::OK {
        tokio::task::yield_now().await;
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
#[ignore = "takes PostgreSQL: .ci/postgres has it"]
async fn a_server_that_is_stopped_and_started_again_costs_answers_but_nothing_that_was_accepted() {
    let postgres = Postgres::start();
    let server = TestServer::start_with(postgres.use_it()).await;
    let before = upload(&server, 0.3).await;
    server.engine.set(Mode::Stuck);
    let job = server.job().await;
    server.until(&job, "running").await;

    postgres.run("stop");
    let question = json!({"model_id": before, "limit": 10});
    let refused = [
        server.get("/v1/models").await,
        server.get(&format!("/v1/jobs/{job}")).await,
        server.post("/v1/queries", &question).await,
        server.post_form("/v1/models", model_form(0.5)).await,
        server.get("/readyz").await,
    ];
    for refused in refused {
        assert_eq!(refused.status(), StatusCode::SERVICE_UNAVAILABLE);
        let problem = expect_json(refused, StatusCode::SERVICE_UNAVAILABLE).await;
        let code = problem["code"].as_str().unwrap_or_default();
        assert!(["storage_unreachable", "overloaded"].contains(&code), "{problem}");
        assert!(!problem.to_string().contains("geheim"), "{problem}");
    }

    postgres.run("start");
    ready(&server).await;
    server.engine.release();
    let ended = server.finished(&job).await;
    assert_eq!((ended["status"].as_str(), ended["attempts"].as_u64()), (Some("succeeded"), Some(1)), "{ended}");
    let after = upload(&server, 0.5).await;
    ready(&server).await;
    let answer = expect_json(server.post("/v1/queries", &question).await, StatusCode::OK).await;
    assert!(answer.to_string().contains(&after), "{answer}");
    // the registered model has a signature of its own
    assert_eq!(server.get(&format!("/v1/models/{}", text(&ended, "/model_id"))).await.status(), 200);
}

/// As a disk that two machines have mounted.
fn copy_of(folder: &Path) -> tempfile::TempDir {
    let copy = tempfile::tempdir().expect("a temporary folder");
    for name in ["visage.folder", "visage.database"] {
        std::fs::copy(folder.join(name), copy.path().join(name)).expect("copied");
    }
    copy
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
#[ignore = "takes PostgreSQL: .ci/postgres has it"]
async fn a_database_is_used_by_one_service_and_with_its_own_folder() {
    let postgres = Postgres::start();
    let server = TestServer::start_with(postgres.use_it()).await;
    let start = async |folder: &Path, url: Option<DatabaseUrl>| {
        let config = ServerConfig { database: url, ..config(folder) };
        Server::start_with(config, Arc::new(FakeEngine::default())).await.map(drop).expect_err("refused").to_string()
    };
    let copy = copy_of(server.folder.path());
    let refused = start(copy.path(), Some(postgres.url())).await;
    assert!(refused.contains("in use by another visage server"), "{refused}");
    let TestServer { folder, handle, .. } = server;
    assert!(handle.shutdown().await);
    let refused = start(folder.path(), None).await;
    assert!(refused.contains("give --database") && !refused.contains("geheim"), "{refused}");
    let other = tempfile::tempdir().expect("a temporary folder");
    let refused = start(other.path(), Some(postgres.url())).await;
    assert!(refused.contains("belongs to the data folder") && !refused.contains("geheim"), "{refused}");
    drop(TestServer::start_on(folder, postgres.use_it()).await);
}

fn visage(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_visage")).args(arguments).output().expect("it runs")
}

/// What a service answers of all that it has.
async fn answers(server: &TestServer, model: &str) -> Vec<Value> {
    ready(server).await;
    let mut answers = Vec::new();
    for path in
        ["/v1/scan-sets", "/v1/jobs", "/v1/models", "/v1/standards", "/v1/bin", "/v1/webhooks", "/v1/models?q=ball"]
    {
        answers.push(expect_json(server.get(path).await, StatusCode::OK).await);
    }
    let question = json!({"model_id": model, "limit": 10});
    let mut found = expect_json(server.post("/v1/queries", &question).await, StatusCode::OK).await;
    if let Some(found) = found.as_object_mut() {
        found.retain(|name, _| !name.contains("seconds") && !name.contains("time"));
    }
    answers.push(found);
    answers
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
#[ignore = "takes PostgreSQL: .ci/postgres has it"]
async fn what_is_moved_from_sqlite_answers_the_same() {
    let (postgres, bin_days) = (Postgres::start(), |config: &mut ServerConfig| config.retention.bin = 1);
    let server = TestServer::start_with(|config| {
        config.database = None;
        bin_days(config);
    })
    .await;
    let (first, second) = (upload(&server, 0.3).await, upload(&server, 0.9).await);
    let (registered, _) = server.model().await;
    upload(&server, 0.5).await;
    assert_eq!(server.delete(&format!("/v1/models/{second}")).await, StatusCode::NO_CONTENT);
    let before = answers(&server, &first).await;
    let poses = server.get(&format!("/v1/models/{registered}/poses.json")).await.bytes().await.expect("a body");
    let TestServer { folder, handle, .. } = server;
    let (from, to) = (format!("sqlite:{}", folder.path().display()), postgres.url());
    let in_use = visage(&["migrate", "--from", &from, "--to", to.secret()]);
    assert!(!in_use.status.success(), "a server uses the folder");
    assert!(handle.shutdown().await);

    let moved = visage(&["migrate", "--from", &from, "--to", to.secret()]);
    let said = format!("{}{}", String::from_utf8_lossy(&moved.stdout), String::from_utf8_lossy(&moved.stderr));
    assert!(moved.status.success() && said.contains("3  model") && !said.contains("geheim"), "{said}");
    assert!(
        !visage(&["migrate", "--from", &from, "--to", to.secret()]).status.success(),
        "there is nothing left to move"
    );
    let config = config(folder.path());
    let refused = Server::start_with(ServerConfig { database: None, ..config }, Arc::new(FakeEngine::default())).await;
    assert!(refused.is_err(), "it would begin anew");

    let server = TestServer::start_on(folder, |config| {
        config.database = Some(to);
        bin_days(config);
    })
    .await;
    assert_eq!(answers(&server, &first).await, before);
    let path = format!("/v1/models/{registered}/poses.json");
    assert_eq!(server.get(&path).await.bytes().await.expect("a body"), poses);
    let restored = server.post(&format!("/v1/bin/{second}/restore"), &json!({})).await;
    assert!(restored.status().is_success(), "{}", restored.status());
    let folder = server.folder.path().display().to_string();
    let backup = visage(&["backup", "--data", &folder, "/nowhere"]);
    assert!(String::from_utf8_lossy(&backup.stderr).contains("pg_dump"));
    assert!(server.handle.shutdown().await);
    let doctor = visage(&["doctor", "--data", &folder, "--database", postgres.url().secret()]);
    assert!(doctor.status.success(), "{}", String::from_utf8_lossy(&doctor.stdout));
}
