//! What is stored is neither lost nor silently wrong: other people's folders, lost and older databases, damaged files,
//! locks of other programs, too little memory.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use crate::common::{FakeEngine, Mode, TestServer, config, expect_json, expect_problem, files, text};
use reqwest::StatusCode;
use reqwest::multipart::{Form, Part};
use serde_json::{Value, json};
use sqlx::{ConnectOptions, SqliteConnection, sqlite::SqliteConnectOptions};
use visage::http::{Server, StartError};
use visage::storage::checkup;
use visage::storage::data_folder::{DataFolder, OpenError};

/// All files below a folder with their content, the database and what goes with it left out.
fn content(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).expect("a folder") {
            let path = entry.expect("an entry").path();
            let name = path.file_name().expect("a name").to_string_lossy().into_owned();
            if path.is_dir() {
                folders.push(path);
            } else if !name.starts_with("visage.") && name != "reserve" {
                let bytes = std::fs::read(&path).expect("read");
                found.push((path, bytes));
            }
        }
    }
    found.sort();
    found
}

async fn refused(folder: &Path) -> StartError {
    let engine = std::sync::Arc::new(FakeEngine::default());
    Server::start_with(config(folder), engine).await.expect_err("the start is refused")
}

/// A connection of another program to a server's database.
async fn other_program(folder: &Path) -> SqliteConnection {
    SqliteConnectOptions::new().filename(folder.join("visage.sqlite")).connect().await.expect("a connection")
}

#[tokio::test]
async fn a_folder_of_something_else_is_refused_and_left_as_it_is() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for path in ["models/weights.bin", "staging/site.html"] {
        let path = folder.path().join(path);
        std::fs::create_dir_all(path.parent().expect("a parent")).expect("created");
        std::fs::write(path, "precious").expect("written");
    }
    let before = content(folder.path());
    let error = refused(folder.path()).await;
    assert!(error.to_string().contains("is no data folder of visage"), "{error}");
    assert_eq!(content(folder.path()), before);
    assert!(!folder.path().join("visage.lock").exists());
}

#[tokio::test]
async fn a_folder_whose_database_is_lost_is_refused_and_left_as_it_is() {
    let server = TestServer::start().await;
    server.model().await;
    let folder = server.folder;
    assert!(server.handle.shutdown().await);
    let before = content(folder.path());
    assert_eq!(before.len(), 7);
    let database = folder.path().join("visage.sqlite");
    let kept = std::fs::read(&database).expect("read");
    for lost in [None, Some(Vec::new())] {
        match lost {
            None => std::fs::remove_file(&database).expect("there"),
            Some(empty) => std::fs::write(&database, empty).expect("written"),
        }
        let error = refused(folder.path()).await;
        assert!(error.to_string().contains("put visage.sqlite back from a backup"), "{error}");
        assert_eq!(content(folder.path()), before);
    }
    std::fs::write(&database, kept).expect("put back");
    let server = TestServer::start_on(folder, |_| {}).await;
    let models = expect_json(server.get("/v1/models").await, StatusCode::OK).await;
    assert_eq!(models["items"].as_array().map(Vec::len), Some(1));
}

#[tokio::test]
async fn an_older_database_is_refused_until_its_operator_sets_the_files_aside() {
    let server = TestServer::start().await;
    let (old, _) = server.model().await;
    let folder = server.folder;
    assert!(server.handle.shutdown().await);
    let database = folder.path().join("visage.sqlite");
    let backup = std::fs::read(&database).expect("read");
    let server = TestServer::start_on(folder, |_| {}).await;
    let (new, _) = server.model().await;
    let folder = server.folder;
    assert!(server.handle.shutdown().await);

    std::fs::write(&database, backup).expect("put back");
    let before = content(folder.path());
    let error = refused(folder.path()).await;
    assert!(matches!(error, StartError::Data(OpenError::UnknownFiles { files: 4, .. })), "{error}");
    assert!(error.to_string().contains("--set-aside"), "{error}");
    assert_eq!(content(folder.path()), before);

    // what `visage doctor --set-aside` does
    let data = DataFolder::open(folder.path(), Duration::ZERO).await.expect("opened");
    let mut findings = checkup::examine(&data.storage).await.expect("examined");
    assert!(!findings.is_sound());
    let trash = checkup::set_aside(&data.storage, &mut findings).await.expect("set aside");
    assert!(findings.is_sound(), "{findings:?}");
    data.storage.database.close().await;
    drop(data);
    assert!(Path::new(&trash).join("models").join(&new).join("cloud.ply").exists());
    let server = TestServer::start_on(folder, |_| {}).await;
    expect_json(server.get(&format!("/v1/models/{old}")).await, StatusCode::OK).await;
    expect_problem(server.get(&format!("/v1/models/{new}")).await, 404, "not_found").await;
}

#[tokio::test]
async fn the_database_of_another_folder_is_refused() {
    let [a, b] = [TestServer::start().await, TestServer::start().await];
    let (a_folder, b_folder) = (a.folder, b.folder);
    assert!(a.handle.shutdown().await && b.handle.shutdown().await);
    std::fs::copy(b_folder.path().join("visage.sqlite"), a_folder.path().join("visage.sqlite")).expect("copied");
    let error = refused(a_folder.path()).await;
    assert!(matches!(error, StartError::Data(OpenError::OtherFolder { .. })), "{error}");
}

#[tokio::test]
async fn a_broken_database_is_refused_with_what_to_do() {
    let server = TestServer::start().await;
    server.model().await;
    let folder = server.folder;
    assert!(server.handle.shutdown().await);
    let database = folder.path().join("visage.sqlite");
    let mut bytes = std::fs::read(&database).expect("read");
    // all pages but the first, on which the database's schema begins
    bytes[4096..].fill(0x5a);
    std::fs::write(&database, bytes).expect("written");
    let error = refused(folder.path()).await;
    assert!(error.to_string().contains("visage doctor"), "{error}");
}

#[tokio::test]
async fn a_lock_of_another_program_is_a_503_that_passes() {
    let server = TestServer::start().await;
    let mut other = other_program(server.folder.path()).await;
    sqlx::query("BEGIN IMMEDIATE").execute(&mut other).await.expect("locked");
    let answer = server.post("/v1/scan-sets", &json!({"name": "a"})).await;
    assert!(answer.headers().contains_key("retry-after"));
    expect_problem(answer, 503, "database_locked").await;
    expect_problem(server.get("/readyz").await, 503, "not_ready").await;
    sqlx::query("ROLLBACK").execute(&mut other).await.expect("free");
    expect_json(server.post("/v1/scan-sets", &json!({"name": "a"})).await, StatusCode::CREATED).await;
}

#[tokio::test]
async fn a_job_that_ends_while_another_program_holds_the_database_loses_nothing() {
    let server = TestServer::start().await;
    server.engine.set(Mode::Slow(Duration::from_millis(500)));
    let job = server.job().await;
    server.until(&job, "running").await;
    let mut other = other_program(server.folder.path()).await;
    sqlx::query("BEGIN IMMEDIATE").execute(&mut other).await.expect("locked");
    // longer than a write waits for a lock
    tokio::time::sleep(Duration::from_secs(7)).await;
    sqlx::query("ROLLBACK").execute(&mut other).await.expect("free");
    let ended = server.finished(&job).await;
    assert_eq!((ended["status"].as_str(), ended["attempts"].as_u64()), (Some("succeeded"), Some(1)), "{ended}");
}

#[tokio::test]
async fn a_pause_longer_than_the_lease_costs_no_attempt() {
    let server = TestServer::start_with(|config| {
        config.concurrent_jobs = 2;
        config.queue.lease = Duration::from_millis(1);
        // as if the process slept all the time
        config.queue.heartbeat = Duration::from_secs(3600);
        config.queue.poll = Duration::from_millis(20);
    })
    .await;
    server.engine.set(Mode::Slow(Duration::from_millis(600)));
    let job = server.job().await;
    let ended = server.finished(&job).await;
    assert_eq!((ended["status"].as_str(), ended["attempts"].as_u64()), (Some("succeeded"), Some(1)), "{ended}");
}

#[tokio::test]
async fn a_job_that_cannot_fit_into_memory_is_refused_with_the_figure() {
    // 50 + 51 + 52 points
    let server = TestServer::start_with(|config| config.job_memory_bytes = Some(30_000)).await;
    let set = server.scan_set(3).await;
    let problem =
        expect_problem(server.post("/v1/jobs", &json!({"scan_set_id": set})).await, 422, "too_little_memory").await;
    assert!(text(&problem, "/detail").contains("153 points"), "{problem}");

    // one that was accepted where there was more
    let server = TestServer::start().await;
    server.engine.set(Mode::Slow(Duration::from_secs(60)));
    let job = server.job().await;
    server.until(&job, "running").await;
    let folder = server.folder;
    assert!(server.handle.shutdown().await);
    let server = TestServer::start_on(folder, |config| config.job_memory_bytes = Some(30_000)).await;
    let ended = server.finished(&job).await;
    assert_eq!((&ended["error"]["code"], &ended["attempts"]), (&json!("too_little_memory"), &json!(1)), "{ended}");
}

#[tokio::test]
async fn a_job_waits_while_others_take_the_memory() {
    let server = TestServer::start_with(|config| {
        config.concurrent_jobs = 2;
        config.job_memory_bytes = Some(50_000);
        config.queue.poll = Duration::from_millis(10);
    })
    .await;
    server.engine.set(Mode::Slow(Duration::from_secs(600)));
    let (first, second) = (server.job().await, server.job().await);
    server.until(&first, "running").await;
    // the other worker looks for work all the time
    tokio::time::sleep(Duration::from_millis(200)).await;
    let waiting = expect_json(server.get(&format!("/v1/jobs/{second}")).await, StatusCode::OK).await;
    assert_eq!(waiting["status"], "queued", "there is memory for one");
    server.engine.set(Mode::Quick);
    server.post(&format!("/v1/jobs/{first}/cancel"), &json!({})).await;
    let [first, second] = [server.finished(&first).await, server.finished(&second).await];
    assert_eq!((&first["status"], &second["status"]), (&json!("canceled"), &json!("succeeded")));
    let at = |view: &Value, what: &str| text(view, what).parse::<jiff::Timestamp>().expect("a time");
    assert!(at(&first, "/finished_at") <= at(&second, "/started_at"), "{first} {second}");
}

/// Changes one byte in the middle of a file.
fn flip(path: &Path) {
    let mut bytes = std::fs::read(path).expect("read");
    let middle = bytes.len() / 2;
    bytes[middle] ^= 0x10;
    std::fs::write(path, bytes).expect("written");
}

#[tokio::test]
async fn a_damaged_file_is_not_served_and_not_built_on() {
    let server = TestServer::start().await;
    let (model, job) = server.model().await;
    let view = expect_json(server.get(&format!("/v1/jobs/{job}")).await, StatusCode::OK).await;
    let set = text(&view, "/scan_set_id");
    let folder = server.folder.path().join("models").join(&model);
    for asset in ["cloud.ply", "poses.json"] {
        flip(&folder.join(asset));
        let problem = expect_problem(server.get(&format!("/v1/models/{model}/{asset}")).await, 500, "damaged").await;
        assert!(text(&problem, "/detail").contains(asset), "{problem}");
    }
    let scan = files::ply(60);
    server.put(&format!("/v1/scan-sets/{set}/scans/more.ply"), scan).await;
    let order = json!({"scan_set_id": set, "base_model_id": model});
    expect_problem(server.post("/v1/jobs", &order).await, 500, "damaged").await;

    let folder = server.folder;
    assert!(server.handle.shutdown().await);
    let data = DataFolder::open(folder.path(), Duration::ZERO).await.expect("opened");
    let findings = checkup::examine(&data.storage).await.expect("examined");
    assert_eq!((findings.damaged_files.len(), findings.files_read), (2, 8), "{findings:?}");
    data.storage.database.close().await;
    drop(data);
    let doctor = Command::new(env!("CARGO_BIN_EXE_visage")).args(["doctor", "--data"]).arg(folder.path()).output();
    let doctor = doctor.expect("it runs");
    let said = String::from_utf8_lossy(&doctor.stdout);
    assert!(!doctor.status.success());
    assert!(said.contains(&format!("cloud.ply of model {model} is not what was stored")), "{said}");
}

#[cfg(unix)]
#[tokio::test]
async fn nobody_but_the_owner_may_read_what_is_stored() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().expect("a temporary folder");
    std::fs::set_permissions(folder.path(), std::fs::Permissions::from_mode(0o755)).expect("made by hand");
    let server = TestServer::start_on(folder, |_| {}).await;
    server.model().await;
    let mut folders = vec![server.folder.path().to_owned()];
    let mut seen = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).expect("a folder") {
            let entry = entry.expect("an entry");
            let mode = entry.metadata().expect("there").permissions().mode();
            assert_eq!(mode & 0o077, 0, "{} has {mode:o}", entry.path().display());
            seen.push(entry.file_name().to_string_lossy().into_owned());
            if entry.path().is_dir() {
                folders.push(entry.path());
            }
        }
    }
    for name in ["visage.sqlite", "visage.sqlite-wal", "visage.folder", "cloud.ply"] {
        assert!(seen.iter().any(|seen| seen == name), "{name} is not among {seen:?}");
    }
}

#[tokio::test]
async fn a_damaged_signature_is_made_anew() {
    let server = TestServer::start().await;
    let mesh = Part::bytes(files::bumpy_sphere(0.0)).file_name("ball.obj");
    let model = server.post_form("/v1/models", Form::new().part("model", mesh)).await;
    let model = text(&expect_json(model, StatusCode::CREATED).await, "/id");
    let folder = server.folder;
    assert!(server.handle.shutdown().await);
    let mut other = other_program(folder.path()).await;
    let signature = async |other: &mut SqliteConnection| {
        let content: Vec<u8> =
            sqlx::query_scalar("SELECT content FROM signature").fetch_one(other).await.expect("there");
        content
    };
    let sound = signature(&mut other).await;
    let mut damaged = sound.clone();
    damaged[sound.len() / 2] ^= 1;
    sqlx::query("UPDATE signature SET content = ?").bind(damaged).execute(&mut other).await.expect("changed");
    sqlx::Connection::close(other).await.expect("closed");

    let server = TestServer::start_on(folder, |_| {}).await;
    let begin = Instant::now();
    loop {
        let answer = server.post("/v1/queries", &json!({"standard": "face"})).await;
        if answer.status() == StatusCode::OK {
            let answer: Value = answer.json().await.expect("JSON");
            if answer["matches"][0]["model_id"] == json!(model) {
                break;
            }
        }
        assert!(begin.elapsed() < Duration::from_secs(60), "it is not found again");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    let mut other = other_program(server.folder.path()).await;
    assert_eq!(signature(&mut other).await, sound);
}

#[tokio::test]
async fn a_model_is_found_as_soon_as_its_job_has_succeeded() {
    let server = TestServer::start_with(|config| config.concurrent_jobs = 2).await;
    while server.get("/readyz").await.status() != StatusCode::OK {
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    server.engine.set(Mode::Described);
    for number in 1..=12 {
        let job = server.job().await;
        let job = server.until(&job, "succeeded").await;
        let question = json!({"standard": "face", "limit": 100});
        let answer = expect_json(server.post("/v1/queries", &question).await, StatusCode::OK).await;
        let found = answer["matches"].as_array().expect("matches");
        assert!(found.iter().any(|found| found["model_id"] == job["model_id"]), "{job} is not in {answer}");
        assert_eq!((found.len(), answer["searched"].as_u64()), (number, Some(number as u64)));
    }
}
