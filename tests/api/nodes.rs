//! Several servers on one database and one bucket, each a process with a data folder of its own. `.ci/nodes` has PostgreSQL and an S3 server.

use std::path::Path;
use std::process::{Command, Output, Stdio};

use reqwest::multipart::{Form, Part};
use reqwest::{Response, StatusCode};
use serde_json::{Value, json};
use visage::config::DatabaseUrl;
use visage::domain::FileId;

use crate::binary::{Process, client, finished, results, start_job};
use crate::common::database::made_for;
use crate::common::{expect_json, files, text};

/// Any free port of this machine's own.
const FREE: &str = "127.0.0.1:0";

/// A database and a part of the bucket that nobody else uses.
pub struct Place {
    folder: tempfile::TempDir,
    database: DatabaseUrl,
    objects: String,
}

impl Place {
    pub fn new() -> Place {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let (database, objects) = (made_for(folder.path()), format!("s3://visage/nodes/{}", FileId::new()));
        Place { folder, database, objects }
    }

    /// What a node of this name is told.
    fn arguments<'a>(&'a self, endpoint: &'a str) -> [&'a str; 6] {
        let database = self.database.secret();
        ["--database", database, "--objects", &self.objects, "--objects-endpoint", endpoint]
    }

    fn start(&self, name: &str, more: &[&str]) -> Process {
        let endpoint = endpoint();
        let mut arguments = self.arguments(&endpoint).to_vec();
        arguments.extend(more);
        Process::start_with(&self.folder.path().join(name), &arguments, Stdio::null())
    }

    pub async fn ready(&self, name: &str, more: &[&str]) -> Process {
        let process = self.start(name, more);
        until_ready(&process).await;
        process
    }

    /// Where a node of this name has its data.
    pub fn folder(&self, name: &str) -> std::path::PathBuf {
        self.folder.path().join(name)
    }

    pub fn objects(&self) -> &str {
        &self.objects
    }

    pub fn database(&self) -> &DatabaseUrl {
        &self.database
    }

    /// A start that is refused.
    pub fn refused(&self, folder: &Path, arguments: &[&str], addr: &str) -> String {
        let Output { status, stderr, .. } = Command::new(env!("CARGO_BIN_EXE_visage"))
            .args(["serve", "--addr", addr, "--open", "--database", self.database.secret(), "--data"])
            .arg(folder)
            .args(arguments)
            .output()
            .expect("it runs");
        assert!(!status.success());
        String::from_utf8_lossy(&stderr).into_owned()
    }
}

pub fn endpoint() -> String {
    std::env::var("VISAGE_S3").expect("VISAGE_S3 is the address of an S3 server with a bucket visage")
}

/// Asks until the service is ready: of a process nobody is told.
async fn until_ready(process: &Process) {
    while get(process, "/readyz").await.status() != StatusCode::OK {
        tokio::task::yield_now().await;
    }
}

pub async fn get(process: &Process, path: &str) -> Response {
    client().get(format!("{}{path}", process.url)).send().await.expect("an answer")
}

async fn get_ok(process: &Process, path: &str) -> Value {
    expect_json(get(process, path).await, StatusCode::OK).await
}

pub async fn upload(process: &Process, phase: f64) -> String {
    let mesh = Part::bytes(files::bumpy_sphere(phase)).file_name("ball.obj");
    let form = Form::new().part("model", mesh).text("unit", "mm");
    let sent = client().post(format!("{}/v1/models", process.url)).multipart(form).send().await.expect("an answer");
    text(&expect_json(sent, StatusCode::CREATED).await, "/id")
}

pub async fn delete(process: &Process, model: &str) {
    let sent = client().delete(format!("{}/v1/models/{model}", process.url)).send().await.expect("an answer");
    assert_eq!(sent.status(), StatusCode::NO_CONTENT);
}

/// What a query by a model answers, without what it took.
async fn found(process: &Process, model: &str) -> Value {
    let question = json!({"model_id": model, "limit": 100});
    let sent = client().post(format!("{}/v1/queries", process.url)).json(&question).send().await.expect("an answer");
    let mut answer = expect_json(sent, StatusCode::OK).await;
    if let Some(answer) = answer.as_object_mut() {
        answer.retain(|name, _| !name.contains("seconds") && !name.contains("time"));
    }
    answer
}

#[tokio::test]
#[ignore = "takes PostgreSQL and an S3 server: .ci/nodes has them"]
async fn a_model_is_found_at_every_node_once_it_is_stored_and_at_none_once_it_is_deleted() {
    let place = Place::new();
    // they begin at the same moment, on a database that is yet to be made
    let nodes = [place.start("a", &[]), place.start("b", &[]), place.start("c", &[])];
    for node in &nodes {
        until_ready(node).await;
    }
    let kept = upload(&nodes[0], 0.3).await;
    for round in 0..24 {
        let [here, there, elsewhere] = [0, 1, 2].map(|step| &nodes[(round + step) % 3]);
        let model = upload(here, 0.4 + 0.01 * round as f64).await;
        let answer = found(there, &kept).await;
        assert!(answer.to_string().contains(&model), "stored at one node: {answer}");
        assert_eq!(found(elsewhere, &kept).await, answer, "all answer the same");
        // while another one asks all the time
        let (asking, ()) = tokio::join!(found(there, &kept), delete(elsewhere, &model));
        drop(asking);
        for node in [here, there] {
            let answer = found(node, &kept).await;
            assert!(!answer.to_string().contains(&model), "deleted at one node: {answer}");
            assert_eq!(get(node, &format!("/v1/models/{model}")).await.status(), StatusCode::NOT_FOUND);
        }
    }
    // a node that was not there meanwhile
    let [a, b, c] = nodes;
    b.signal("-KILL");
    drop(b);
    let (first, second) = (upload(&a, 0.9).await, upload(&c, 1.1).await);
    delete(&a, &kept).await;
    let b = place.ready("b", &[]).await;
    let answer = found(&b, &first).await;
    assert!(answer.to_string().contains(&second) && !answer.to_string().contains(&kept), "{answer}");
    assert_eq!(found(&a, &first).await, answer);
}

#[tokio::test]
#[ignore = "takes PostgreSQL and an S3 server: .ci/nodes has them"]
async fn a_job_is_run_by_another_node_and_once_more_when_that_is_killed_with_the_same_bytes() {
    let alone = tempfile::tempdir().expect("a temporary folder");
    let undisturbed = Process::start_with(alone.path(), &[], Stdio::null());
    let expected = results(&undisturbed, &finished(&undisturbed, &start_job(&undisturbed).await).await).await;
    drop(undisturbed);

    let place = Place::new();
    let (a, c) =
        (place.ready("a", &["--roles", "api,search"]).await, place.ready("c", &["--roles", "api,search"]).await);
    let worker = place.ready("worker", &["--roles", "worker"]).await;
    let uploaded = upload(&a, 0.3).await;
    let job = start_job(&a).await;
    let ended = finished(&c, &job).await;
    assert_eq!(ended["attempts"], 1);
    assert_eq!(results(&c, &ended).await, expected);
    assert_eq!(results(&a, &ended).await, expected);
    let model = text(&ended, "/model_id");
    let answer = found(&a, &uploaded).await;
    assert!(answer.to_string().contains(&model), "the nodes that answer have learned of it: {answer}");
    assert_eq!(found(&c, &uploaded).await, answer);

    // a worker tells how it is, and nothing else
    assert_eq!(get(&worker, "/healthz").await.status(), StatusCode::OK);
    assert!(get(&worker, "/metrics").await.text().await.expect("a body").contains("role=\"worker\""));
    assert_eq!(get(&worker, "/v1/models").await.status(), StatusCode::NOT_FOUND);

    // one that was killed too late has made its model: then it is tried with another
    let (mut jobs, mut worker) = (1, worker);
    let ended = loop {
        let job = start_job(&c).await;
        jobs += 1;
        while get_ok(&a, &format!("/v1/jobs/{job}")).await["status"] == "queued" {
            tokio::task::yield_now().await;
        }
        worker.signal("-KILL");
        worker = place.ready(&format!("worker {jobs}"), &["--roles", "worker"]).await;
        let ended = finished(&a, &job).await;
        if ended["attempts"] == 2 {
            break ended;
        }
    };
    assert_eq!(results(&a, &ended).await, expected);
    let models = get_ok(&c, "/v1/models").await;
    assert_eq!(models["items"].as_array().map(Vec::len), Some(1 + jobs), "each job has made one: {models}");
}

#[tokio::test]
#[ignore = "takes PostgreSQL and an S3 server: .ci/nodes has them"]
async fn a_stop_that_is_asked_for_at_one_node_reaches_who_waits_at_another() {
    let place = Place::new();
    let (a, b) = (place.ready("a", &["--roles", "api"]).await, place.ready("b", &["--roles", "api"]).await);
    // nobody runs it
    let job = start_job(&a).await;
    let (ended, canceled) = tokio::join!(finished(&b, &job), async {
        let sent = client().post(format!("{}/v1/jobs/{job}/cancel", a.url)).send().await.expect("an answer");
        sent.status()
    });
    assert_eq!((ended["status"].as_str(), canceled), (Some("canceled"), StatusCode::ACCEPTED));
}

#[tokio::test]
#[ignore = "takes PostgreSQL and an S3 server: .ci/nodes has them"]
async fn what_does_not_go_together_is_refused() {
    let place = Place::new();
    let a = place.ready("a", &[]).await;
    let new = place.folder.path().join("new");
    let refused = place.refused(&new, &[], FREE);
    assert!(refused.contains("in use by another visage server") && refused.contains("--objects"), "{refused}");

    // as a machine that was cloned
    let (of_a, clone) = (place.folder.path().join("a"), place.folder.path().join("clone"));
    std::fs::create_dir(&clone).expect("made");
    for name in ["visage.folder", "visage.node", "visage.database", "visage.objects"] {
        std::fs::copy(of_a.join(name), clone.join(name)).expect("copied");
    }
    let endpoint = endpoint();
    let refused = place.refused(&clone, &["--objects", &place.objects, "--objects-endpoint", &endpoint], FREE);
    assert!(refused.contains("a copy of this data folder"), "{refused}");

    // what is done beside servers is done
    let key = Command::new(env!("CARGO_BIN_EXE_visage"))
        .args(["key", "list", "--database", place.database.secret(), "--data"])
        .arg(&of_a)
        .output()
        .expect("it runs");
    assert!(key.status.success(), "{}", String::from_utf8_lossy(&key.stderr));
    let refused = place.refused(&new, &["--roles", "api,searcher"], FREE);
    assert!(refused.contains("searcher") && refused.contains("api") && refused.contains("worker"), "{refused}");
    let alone = Command::new(env!("CARGO_BIN_EXE_visage"))
        .args(["serve", "--addr", "127.0.0.1:0", "--roles", "api", "--data"])
        .arg(&new)
        .output()
        .expect("it runs");
    let refused = String::from_utf8_lossy(&alone.stderr).into_owned();
    assert!(!alone.status.success() && refused.contains("--database and --objects"), "{refused}");
    assert_eq!(a.get("/healthz").await["status"], "ok");
}
