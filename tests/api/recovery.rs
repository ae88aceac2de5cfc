//! Crashes, shutdowns, restarts.

use std::time::{Duration, Instant};

use crate::common::{Mode, TestServer, config, expect_json, text};
use reqwest::StatusCode;
use serde_json::json;
use visage::domain::{FileId, ModelId, StoredFile};
use visage::http::{Server, StartError};
use visage::storage::data_folder::OpenError;
use visage::storage::database::{Files, Upkeep};
use visage::storage::sqlite::SqliteDatabase;

const LONG: Mode = Mode::Slow(Duration::from_secs(60));

#[tokio::test]
async fn after_a_crash_the_job_is_run_again_to_the_same_bytes() {
    let undisturbed = TestServer::start().await;
    let (model, _) = undisturbed.model().await;
    let asset = async |server: &TestServer, model: &str, name: &str| {
        server.get(&format!("/v1/models/{model}/{name}")).await.bytes().await.expect("a body")
    };
    let expected = [asset(&undisturbed, &model, "poses.json").await, asset(&undisturbed, &model, "cloud.ply").await];

    let server = TestServer::start().await;
    server.engine.set(LONG);
    let job = server.job().await;
    server.until(&job, "running").await;
    let folder = server.folder;
    server.handle.abort().await;

    let server = TestServer::start_on(folder, |_| {}).await;
    let ended = server.finished(&job).await;
    assert_eq!((ended["status"].as_str(), ended["attempts"].as_u64()), (Some("succeeded"), Some(2)), "{ended}");
    let model = text(&ended, "/model_id");
    assert_eq!([asset(&server, &model, "poses.json").await, asset(&server, &model, "cloud.ply").await], expected);
}

#[tokio::test]
async fn a_job_that_takes_the_server_down_again_and_again_is_failed() {
    let mut server = TestServer::start().await;
    server.engine.set(LONG);
    let job = server.job().await;
    for _ in 0..3 {
        server.until(&job, "running").await;
        let folder = server.folder;
        server.handle.abort().await;
        server = TestServer::start_on(folder, |_| {}).await;
        server.engine.set(LONG);
    }
    let ended = server.finished(&job).await;
    assert_eq!(ended["error"]["code"], "attempts_exhausted", "{ended}");
    assert_eq!(server.engine.runs(), 0);
}

#[tokio::test]
async fn a_shutdown_gives_jobs_back_and_ends_streams() {
    let server = TestServer::start().await;
    server.engine.set(LONG);
    let job = server.job().await;
    server.until(&job, "running").await;
    let stream = server.get(&format!("/v1/jobs/{job}/events")).await;
    let waiting = server.client.get(server.url(&format!("/v1/jobs/{job}?wait=60"))).send();
    let waiting = tokio::spawn(waiting);
    tokio::time::sleep(Duration::from_millis(100)).await;
    let folder = server.folder;
    let begin = Instant::now();
    assert!(server.handle.shutdown().await, "everybody was done before the deadline");
    assert!(begin.elapsed() < Duration::from_secs(2), "{:?}", begin.elapsed());
    stream.text().await.expect("the stream ended properly");
    assert_eq!(waiting.await.expect("no panic").expect("an answer").status(), StatusCode::OK);

    let server = TestServer::start_on(folder, |_| {}).await;
    let ended = server.finished(&job).await;
    assert_eq!((ended["status"].as_str(), ended["attempts"].as_u64()), (Some("succeeded"), Some(1)), "{ended}");
}

#[tokio::test]
async fn a_shutdown_waits_no_longer_than_its_deadline() {
    let server = TestServer::start_with(|config| config.shutdown_deadline = Duration::from_secs(1)).await;
    server.engine.set(Mode::Deaf(Duration::from_secs(4)));
    let job = server.job().await;
    server.until(&job, "running").await;
    // an upload that never ends
    let url = server.url("/v1/scan-sets");
    let endless = reqwest::Body::wrap_stream(futures_util::stream::pending::<Result<Vec<u8>, std::io::Error>>());
    let upload = server.client.post(url).header("content-type", "multipart/form-data; boundary=b").body(endless).send();
    let upload = tokio::spawn(upload);
    tokio::time::sleep(Duration::from_millis(100)).await;
    let folder = server.folder;
    let begin = Instant::now();
    assert!(!server.handle.shutdown().await, "the upload was cut");
    assert!(begin.elapsed() < Duration::from_secs(2), "{:?}", begin.elapsed());
    upload.abort();

    // the deaf thread still holds the folder, as it would until the process has ended
    tokio::time::sleep(Duration::from_secs(4)).await;
    let server = TestServer::start_on(folder, |_| {}).await;
    let ended = server.finished(&job).await;
    assert_eq!((ended["status"].as_str(), ended["attempts"].as_u64()), (Some("succeeded"), Some(1)), "{ended}");
}

#[tokio::test]
async fn a_folder_belongs_to_one_server() {
    let server = TestServer::start().await;
    let refused = Server::start(config(server.folder.path())).await.expect_err("in use");
    assert!(matches!(refused, StartError::Data(OpenError::Folder(_))));
    assert!(refused.to_string().contains("in use by another visage server"), "{refused}");
}

#[tokio::test]
async fn what_a_crash_left_on_disk_is_swept() {
    let server = TestServer::start().await;
    server.model().await;
    let folder = server.folder;
    server.handle.abort().await;
    let [lost, of_others] = [ModelId::new(), ModelId::new()];
    for model in [lost, of_others] {
        let half = folder.path().join("models").join(model.to_string());
        std::fs::create_dir(&half).expect("created");
        std::fs::write(half.join("cloud.ply"), "half").expect("written");
    }
    let others = SqliteDatabase::open(&folder.path().join("visage.sqlite")).await.expect("opened");
    let folder_id = others.folder_id().await.expect("read").expect("the folder has one");
    let crashed = others.clone().on_seat(folder_id.into());
    crashed.expect_files(&[StoredFile::Model(lost)]).await.expect("it was said to come");
    others.expect_files(&[StoredFile::Model(of_others)]).await.expect("it was said to come");
    others.close().await;
    let upload = FileId::new().to_string();
    std::fs::write(folder.path().join("staging").join(upload), "half").expect("written");
    let server = TestServer::start_on(folder, |_| {}).await;
    assert_eq!((server.files("models"), server.files("staging"), server.files("scan-sets")), (5, 0, 3));
    assert_eq!(server.files("trash"), 1, "it is set aside");
    let is_there = |model: ModelId| server.folder.path().join("models").join(model.to_string()).exists();
    assert_eq!([lost, of_others].map(is_there), [false, true], "another process may still be storing it");
    let models = expect_json(server.get("/v1/models").await, StatusCode::OK).await;
    assert_eq!(models["items"].as_array().map(Vec::len), Some(1));
}

#[tokio::test]
async fn a_job_that_does_not_stop_is_left_behind_and_its_worker_goes_on() {
    let server = TestServer::start_with(|config| config.queue.deaf = Duration::ZERO).await;
    server.engine.set(Mode::Stuck);
    let job = server.job().await;
    // running are jobs that load their scans, too, and these stop
    server.engine.until_runs(1).await;
    server.post(&format!("/v1/jobs/{job}/cancel"), &json!({})).await;
    assert_eq!(server.finished(&job).await["status"], "canceled");

    server.engine.set(Mode::Quick);
    let next = server.job().await;
    assert_eq!(server.finished(&next).await["status"], "succeeded");
    let mut changes = server.handle.changes();
    assert!(left_behind(&server, 1).await);
    server.engine.release();
    while !left_behind(&server, 0).await {
        changes.changed().await.expect("the server runs");
    }
}

#[tokio::test]
async fn a_job_without_a_sign_of_life_fails() {
    let server = TestServer::start_with(|config| {
        config.queue.stall = config.queue.heartbeat;
        config.queue.deaf = Duration::ZERO;
    })
    .await;
    server.engine.set(Mode::Stuck);
    let job = server.job().await;
    let ended = server.finished(&job).await;
    assert_eq!((&ended["status"], &ended["error"]["code"]), (&json!("failed"), &json!("stuck")), "{ended}");
    server.engine.release();
}

async fn left_behind(server: &TestServer, count: usize) -> bool {
    let text = server.get("/metrics").await.text().await.expect("a body");
    text.lines().any(|line| {
        line == format!("visage_jobs_left_behind {count}") || line == format!("visage_jobs_left_behind {count}.0")
    })
}
