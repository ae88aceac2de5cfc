//! Files in a bucket of a real S3 server, which `.ci/s3` starts.

use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use reqwest::StatusCode;
use serde_json::json;
use visage::config::{BucketSettings, ServerConfig};
use visage::domain::{FileId, ModelId, StoredFile};
use visage::http::{Server, StartError};
use visage::storage::data_folder::backup;
use visage::storage::data_folder::{DataFolder, OpenError, Places};
use visage::storage::inventory::StorageError;

use crate::common::{TestServer, config, expect_json, expect_problem, files, scan_form, text};

/// A part of the bucket that nobody else uses.
fn bucket(endpoint: &str) -> BucketSettings {
    let url = format!("s3://visage/api/{}", FileId::new()).parse().expect("a bucket");
    BucketSettings { url, endpoint: Some(endpoint.to_owned()), region: None, cache_bytes: 1 << 30 }
}

fn shared() -> BucketSettings {
    bucket(&std::env::var("VISAGE_S3").expect("VISAGE_S3 is the address of an S3 server with a bucket visage"))
}

fn keeps_in(objects: &BucketSettings) -> impl FnOnce(&mut ServerConfig) + use<> {
    let objects = objects.clone();
    move |config| config.objects = Some(objects)
}

/// What is in the bucket. No server may be using the folder.
async fn stored(folder: &Path, objects: &BucketSettings) -> Vec<StoredFile> {
    let places = Places { objects: Some(objects), database: None };
    let data = DataFolder::open_with(folder, Duration::from_secs(5), places).await.expect("opened");
    let files = data.storage.blocking(|objects| objects.listing()).await.expect("listed");
    data.storage.database.close().await;
    files
}

async fn bytes(server: &TestServer, path: &str) -> Vec<u8> {
    let answer = server.get(path).await;
    assert_eq!(answer.status(), StatusCode::OK, "{path}");
    answer.bytes().await.expect("a body").to_vec()
}

fn forget_cache(folder: &Path) {
    std::fs::remove_dir_all(folder.join("cache")).expect("there is a cache");
}

async fn uploaded(server: &TestServer) -> String {
    let form = reqwest::multipart::Form::new()
        .part("model", reqwest::multipart::Part::bytes(files::bumpy_sphere(0.0)).file_name("ball.obj"))
        .text("unit", "mm");
    text(&expect_json(server.post_form("/v1/models", form).await, StatusCode::CREATED).await, "/id")
}

#[tokio::test(flavor = "multi_thread")]
#[ignore = "needs an S3 server: .ci/s3"]
async fn everything_is_kept_in_the_bucket_and_found_there_by_the_next_server() {
    let objects = shared();
    let server = TestServer::start_with(keeps_in(&objects)).await;
    let (model, job) = server.model().await;
    let uploaded = uploaded(&server).await;
    let [cloud, poses] = [format!("/v1/models/{model}/cloud.ply"), format!("/v1/models/{model}/poses.json")];
    let expected = [bytes(&server, &cloud).await, bytes(&server, &poses).await];
    assert_eq!((server.files("models"), server.files("scan-sets"), server.files("staging")), (0, 0, 0));
    let set = text(&expect_json(server.get(&format!("/v1/jobs/{job}")).await, StatusCode::OK).await, "/scan_set_id");
    let folder = server.folder;
    server.handle.shutdown().await;
    let files = stored(folder.path(), &objects).await;
    assert_eq!(files.len(), 5, "three scans and two models: {files:?}");

    // nothing of the cache is needed
    forget_cache(folder.path());
    let server = TestServer::start_on(folder, keeps_in(&objects)).await;
    assert_eq!([bytes(&server, &cloud).await, bytes(&server, &poses).await], expected);
    let again = server.post("/v1/jobs", &json!({"scan_set_id": set})).await;
    let again = text(&expect_json(again, StatusCode::ACCEPTED).await, "/id");
    let ended = server.finished(&again).await;
    assert_eq!(ended["status"], "succeeded", "{ended}");
    let other = text(&ended, "/model_id");
    assert_eq!(bytes(&server, &format!("/v1/models/{other}/cloud.ply")).await, expected[0]);

    // a backup is a data folder that has all files itself
    let copy = tempfile::tempdir().expect("a temporary folder");
    let report =
        backup::back_up_with(server.folder.path(), copy.path(), false, Some(&objects)).await.expect("backed up");
    assert!(report.is_whole() && report.new > 5, "{report:?}");
    let refused = backup::back_up(server.folder.path(), copy.path(), false).await.expect_err("where are the files?");
    assert!(refused.to_string().contains(&format!("give --objects {}", objects.url)), "{refused}");
    let restored = TestServer::start_on(copy, |_| {}).await;
    assert_eq!(bytes(&restored, &cloud).await, expected[0]);
    restored.handle.shutdown().await;

    for gone in [&model, &other, &uploaded] {
        assert_eq!(server.delete(&format!("/v1/models/{gone}")).await, StatusCode::NO_CONTENT);
        assert_eq!(server.get(&format!("/v1/models/{gone}/cloud.ply")).await.status(), StatusCode::NOT_FOUND);
    }
    let folder = server.folder;
    server.handle.shutdown().await;
    let left = stored(folder.path(), &objects).await;
    assert!(left.len() == 3 && left.iter().all(|file| matches!(file, StoredFile::Scan(..))), "{left:?}");
}

#[tokio::test(flavor = "multi_thread")]
#[ignore = "needs an S3 server: .ci/s3"]
async fn a_folder_and_a_bucket_that_do_not_go_together_are_refused() {
    let objects = shared();
    let server = TestServer::start_with(keeps_in(&objects)).await;
    let folder = server.folder;
    server.handle.shutdown().await;
    let refused = Server::start(config(folder.path())).await.expect_err("its files are elsewhere");
    assert!(refused.to_string().contains(&format!("give --objects {}", objects.url)), "{refused}");

    let start = async |folder: &Path, objects: &BucketSettings| {
        let mut config = config(folder);
        config.objects = Some(objects.clone());
        Server::start(config).await.expect_err("refused")
    };
    let other = tempfile::tempdir().expect("a temporary folder");
    let refused = start(other.path(), &objects).await;
    assert!(matches!(refused, StartError::Data(OpenError::BucketTaken { .. })), "{refused}");

    let local = TestServer::start().await;
    local.scan_set(2).await;
    let folder = local.folder;
    local.handle.shutdown().await;
    let refused = start(folder.path(), &shared()).await;
    assert!(matches!(refused, StartError::Data(OpenError::FilesHere { files: 2, .. })), "{refused}");
    TestServer::start_on(folder, |_| {}).await;
}

/// An S3 server that can be killed.
struct S3 {
    folder: tempfile::TempDir,
    port: u16,
    process: Child,
}

impl Drop for S3 {
    fn drop(&mut self) {
        self.kill();
    }
}

impl S3 {
    async fn start() -> S3 {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let are_free = |first: u16| (first..first + 8).all(|port| TcpListener::bind(("127.0.0.1", port)).is_ok());
        let port = (30_000..40_000).step_by(8).find(|first| are_free(*first)).expect("ports in a row");
        let process = S3::spawn(folder.path(), port);
        let s3 = S3 { folder, port, process };
        s3.ready().await;
        let made = reqwest::Client::new().post(format!("http://127.0.0.1:{}/buckets/visage/", port + 5)).send().await;
        assert!(made.expect("an answer").status().is_success(), "the bucket is made");
        s3.until(|client| client.put(s3.probe()).body("is it there?"), StatusCode::CREATED).await;
        s3
    }

    /// An object that says, by the file server behind, whether objects can be read and written.
    fn probe(&self) -> String {
        format!("http://127.0.0.1:{}/buckets/visage/probe", self.port + 5)
    }

    fn spawn(folder: &Path, port: u16) -> Child {
        let weed = std::env::var("VISAGE_WEED").expect("VISAGE_WEED is the program of SeaweedFS");
        let script = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(".ci/s3");
        let mut command = Command::new(script);
        command.args(["serve", &weed]).arg(folder).arg(port.to_string());
        command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("started")
    }

    fn endpoint(&self) -> String {
        format!("http://127.0.0.1:{}", self.port)
    }

    /// It refuses, for want of a key: so it is there.
    async fn ready(&self) {
        self.until(|client| client.get(format!("{}/visage", self.endpoint())), StatusCode::FORBIDDEN).await;
    }

    /// Asks until the answer is this one, however long that takes: the process says nowhere that it has begun.
    async fn until(&self, ask: impl Fn(&reqwest::Client) -> reqwest::RequestBuilder, wanted: StatusCode) {
        let client = reqwest::Client::new();
        while !ask(&client).send().await.is_ok_and(|answer| answer.status() == wanted) {
            tokio::task::yield_now().await;
        }
    }

    /// kill -9.
    fn kill(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }

    async fn start_again(&mut self) {
        self.process = S3::spawn(self.folder.path(), self.port);
        self.ready().await;
        // it refuses before it knows where its objects are
        self.until(|client| client.get(self.probe()), StatusCode::OK).await;
    }
}

#[tokio::test(flavor = "multi_thread")]
#[ignore = "needs an S3 server: .ci/s3"]
async fn a_store_that_is_killed_costs_time_and_loses_nothing() {
    let mut s3 = S3::start().await;
    let objects = bucket(&s3.endpoint());
    let server = TestServer::start_with(keeps_in(&objects)).await;
    let (model, _) = server.model().await;
    let unwanted = uploaded(&server).await;
    let set = server.scan_set(3).await;
    let path = format!("/v1/models/{model}/cloud.ply");
    let expected = bytes(&server, &path).await;

    s3.kill();
    assert_eq!(bytes(&server, &path).await, expected, "it is in the cache");
    let refused = server.post_form("/v1/scan-sets", scan_form(3)).await;
    assert_eq!(refused.headers()["retry-after"], "10");
    expect_problem(refused, 503, "storage_unreachable").await;
    // what is deleted is deleted, wherever its files are
    assert_eq!(server.delete(&format!("/v1/models/{unwanted}")).await, StatusCode::NO_CONTENT);
    let runs = server.engine.runs();
    let job = server.post("/v1/jobs", &json!({"scan_set_id": set})).await;
    let job = text(&expect_json(job, StatusCode::ACCEPTED).await, "/id");
    server.engine.until_runs(runs + 1).await;

    s3.start_again().await;
    let ended = server.finished(&job).await;
    assert_eq!((ended["status"].as_str(), ended["attempts"].as_u64()), (Some("succeeded"), Some(1)), "{ended}");
    assert_eq!(server.engine.runs(), runs + 1, "nothing was computed twice");
    let made = format!("/v1/models/{}/cloud.ply", text(&ended, "/model_id"));
    assert_eq!(bytes(&server, &made).await, expected);
    server.scan_set(2).await;

    // both are gone: the start says why there is none
    s3.kill();
    let folder = server.folder;
    server.handle.abort().await;
    let mut settings = config(folder.path());
    settings.objects = Some(objects.clone());
    let refused = Server::start(settings).await.expect_err("the files are not there");
    assert!(
        matches!(&refused, StartError::Data(OpenError::Storage(StorageError::Objects(error))) if error.is_unreachable())
    );
    assert!(refused.to_string().contains("can't be reached"), "{refused}");

    s3.start_again().await;
    forget_cache(folder.path());
    let server = TestServer::start_on(folder, keeps_in(&objects)).await;
    assert_eq!([bytes(&server, &path).await, bytes(&server, &made).await], [expected.clone(), expected]);
    let folder = server.folder;
    server.handle.shutdown().await;
    let files = stored(folder.path(), &objects).await;
    let unwanted = StoredFile::Model(ModelId::parse(&unwanted).expect("an id"));
    assert!(!files.contains(&unwanted), "what was deleted meanwhile is removed");
    assert_eq!(files.len(), 3 + 1 + 3 + 1 + 2, "{files:?}");
}
