//! The recycle bin: what is in it is in no answer, comes back as it was, and goes for good when it is due or somebody says so.

use std::collections::BTreeMap;

use reqwest::multipart::{Form, Part};
use reqwest::{Method, StatusCode};
use serde_json::{Value, json};
use visage::storage::data_folder::backup;

use crate::access::operations;
use crate::backup::is_sound;
use crate::common::{Mode, TestServer, expect_json, expect_problem, files, text};

async fn server_with_bin() -> TestServer {
    let server = TestServer::start_with(|config| config.retention.bin = 7).await;
    while server.get("/readyz").await.status() != StatusCode::OK {
        tokio::task::yield_now().await;
    }
    server
}

fn ball() -> Part {
    Part::bytes(files::bumpy_sphere(0.3)).file_name("ball.obj")
}

async fn uploaded(server: &TestServer) -> String {
    let form = Form::new().part("model", ball()).text("unit", "mm").text("label", "ball");
    text(&expect_json(server.post_form("/v1/models", form).await, StatusCode::CREATED).await, "/id")
}

async fn put_back(server: &TestServer, id: &str) -> reqwest::Response {
    server.client.post(server.url(&format!("/v1/bin/{id}/restore"))).send().await.expect("an answer")
}

/// What of a service may change though nothing was deleted, or tells of deletions.
const TELLS_OF_MORE: [&str; 4] = ["/v1/bin", "/v1/audit", "/v1/info", "/metrics"];

/// A set with its job and model, and two models of one file.
struct World {
    set: String,
    job: String,
    made: String,
    twins: [String; 2],
}

impl World {
    async fn new(server: &TestServer) -> World {
        server.engine.set(Mode::Described);
        let (made, job) = server.model().await;
        let set =
            text(&expect_json(server.get(&format!("/v1/jobs/{job}")).await, StatusCode::OK).await, "/scan_set_id");
        World { set, job, made, twins: [uploaded(server).await, uploaded(server).await] }
    }

    /// What is deleted: the second twin, and the set with all that was made of it.
    fn deleted(&self) -> [&str; 4] {
        [&self.set, &self.job, &self.made, &self.twins[1]]
    }

    /// Addresses of every operation of the contract that reads, for each thing that it may be asked of.
    fn reads(&self) -> Vec<String> {
        let mut reads = Vec::new();
        for (method, path, _) in operations() {
            let ids: &[&str] = match path.split('/').nth(2) {
                Some("models") => &[&self.made, &self.twins[0], &self.twins[1]],
                Some("jobs") => &[&self.job],
                Some("scan-sets") => &[&self.set],
                _ => &["01890000-0000-7000-8000-000000000000"],
            };
            if method != Method::GET {
                continue;
            }
            let path = path.replace("{name}", "scan0.ply").replace("{file}", "cloud.ply");
            let kind = if path.ends_with("/svg") { "overlap" } else { "thumbnail" };
            let path = path.replace("{kind}", kind);
            let ids = if path.contains("{id}") { ids } else { &ids[..1] };
            for id in ids {
                let query = match path.rsplit('/').next() {
                    Some("deviation" | "deviation.ply") => format!("?reference={}", self.twins[0]),
                    Some("evaluation" | "evaluation.svg") => "?label=ball".to_owned(),
                    _ => String::new(),
                };
                reads.push(format!("{}{query}", path.replace("{id}", id)));
            }
        }
        reads.push(format!("/v1/models?scan_set_id={}", self.set));
        reads.push(format!("/v1/jobs?scan_set_id={}", self.set));
        reads.push("/v1/models?label=ball&text=ball".to_owned());
        reads
    }

    /// All answers of the service by what was asked: its reads, queries by everything that can be asked, and a probe.
    async fn answers(&self, server: &TestServer) -> BTreeMap<String, (u16, String)> {
        let mut answers = BTreeMap::new();
        for path in self.reads() {
            let response = server.get(&path).await;
            let status = response.status().as_u16();
            let body = response.bytes().await.expect("a body");
            answers.insert(path, (status, String::from_utf8_lossy(&body).into_owned()));
        }
        let mut questions = vec![json!({"standard": "face", "limit": 100})];
        questions.push(json!({"triangle": {"sides": [31.0, 52.5, 52.5], "unit": "mm"}, "limit": 100}));
        for model in [&self.made, &self.twins[0], &self.twins[1]] {
            questions.push(json!({"model_id": model, "limit": 100}));
            questions.push(json!({"model_id": model, "limit": 100, "likeness": "shape"}));
        }
        for question in questions {
            let response = server.post("/v1/queries", &question).await;
            let status = response.status().as_u16();
            answers.insert(question.to_string(), (status, response.text().await.expect("a body")));
        }
        let probe = server.post_form("/v1/queries/probe", Form::new().part("probe", ball())).await;
        answers.insert("a probe".to_owned(), (probe.status().as_u16(), probe.text().await.expect("a body")));
        answers.retain(|asked, _| !TELLS_OF_MORE.iter().any(|path| asked.starts_with(path)));
        answers
    }
}

/// Over every operation of the contract, so that a new one is asked, too.
#[tokio::test]
async fn what_is_in_the_bin_is_in_no_answer_and_comes_back_as_it_was() {
    let server = server_with_bin().await;
    let world = World::new(&server).await;
    let before = world.answers(&server).await;
    let mentions = |answers: &BTreeMap<String, (u16, String)>| {
        let tells = |body: &str| world.deleted().iter().any(|id| body.contains(id));
        answers.values().filter(|(status, body)| *status < 300 && tells(body)).count()
    };
    assert!(mentions(&before) > 12, "{} answers tell of what will be deleted", mentions(&before));
    assert!(before["/v1/gallery/duplicates"].1.contains(&world.twins[1]), "{}", before["/v1/gallery/duplicates"].1);

    for path in [format!("/v1/models/{}", world.twins[1]), format!("/v1/scan-sets/{}", world.set)] {
        assert_eq!(server.delete(&path).await, StatusCode::NO_CONTENT);
    }
    for (asked, (status, body)) in world.answers(&server).await {
        if world.deleted().iter().any(|id| asked.contains(id)) {
            let is_empty_list = status == 200 && asked.contains("scan_set_id=") && body.contains("\"items\":[]");
            assert!(status == 404 || is_empty_list, "{asked}: {status} {body}");
        } else {
            assert!(!world.deleted().iter().any(|id| body.contains(id)), "{asked}: {body}");
        }
    }
    let binned = expect_json(server.get("/v1/bin").await, StatusCode::OK).await;
    let listed: Vec<(&str, &str, u64)> = binned["items"]
        .as_array()
        .expect("items")
        .iter()
        .map(|entry| {
            let text = |field: &str| entry[field].as_str().expect("text");
            (text("kind"), text("id"), entry["models"].as_u64().expect("a number"))
        })
        .collect();
    assert_eq!(listed, [("scan_set", world.set.as_str(), 1), ("model", world.twins[1].as_str(), 1)]);

    for id in [&world.set, &world.twins[1]] {
        let entry = expect_json(put_back(&server, id).await, StatusCode::OK).await;
        assert_eq!(server.get(&text(&entry, "/href")).await.status(), StatusCode::OK);
        expect_problem(put_back(&server, id).await, 404, "not_found").await;
    }
    let after = world.answers(&server).await;
    for (asked, answer) in &before {
        assert_eq!(&after[asked], answer, "{asked}");
    }
}

#[tokio::test]
async fn a_deletion_for_good_keeps_nothing_and_takes_along_what_was_made_of_it() {
    let server = server_with_bin().await;
    let (model, job) = server.model().await;
    let job_view = expect_json(server.get(&format!("/v1/jobs/{job}")).await, StatusCode::OK).await;
    let set = text(&job_view, "/scan_set_id");
    assert_eq!(server.delete(&format!("/v1/models/{model}")).await, StatusCode::NO_CONTENT);
    assert_eq!(server.delete(&format!("/v1/jobs/{job}")).await, StatusCode::NO_CONTENT);
    // a model needs the job that it was made by
    let refused = expect_problem(put_back(&server, &model).await, 409, "origin_deleted").await;
    assert!(text(&refused, "/detail").contains(&job), "{refused}");
    expect_json(put_back(&server, &job).await, StatusCode::OK).await;
    expect_json(put_back(&server, &model).await, StatusCode::OK).await;
    let again = expect_json(server.get(&format!("/v1/jobs/{job}")).await, StatusCode::OK).await;
    assert_eq!(again, job_view);

    assert_eq!(server.delete(&format!("/v1/models/{model}")).await, StatusCode::NO_CONTENT);
    assert!(server.files("models") > 0 && server.files("scan-sets") > 0);
    assert_eq!(server.delete(&format!("/v1/scan-sets/{set}?permanently=true")).await, StatusCode::NO_CONTENT);
    expect_problem(put_back(&server, &model).await, 404, "not_found").await;
    assert_eq!((server.files("models"), server.files("scan-sets")), (0, 0));
    let refused = server.client.delete(server.url(&format!("/v1/scan-sets/{set}?permanently=perhaps"))).send().await;
    expect_problem(refused.expect("an answer"), 400, "malformed_request").await;

    let model = uploaded(&server).await;
    assert_eq!(server.delete(&format!("/v1/models/{model}")).await, StatusCode::NO_CONTENT);
    assert_eq!(server.delete(&format!("/v1/bin/{model}")).await, StatusCode::NO_CONTENT);
    assert_eq!(server.delete(&format!("/v1/bin/{model}")).await, StatusCode::NOT_FOUND);
    assert_eq!(server.files("models"), 0);
}

#[tokio::test]
async fn without_a_bin_deleted_is_gone() {
    let server = TestServer::start().await;
    let (model, job) = server.model().await;
    assert_eq!(server.delete(&format!("/v1/models/{model}")).await, StatusCode::NO_CONTENT);
    assert_eq!(server.delete(&format!("/v1/jobs/{job}")).await, StatusCode::NO_CONTENT);
    let binned = expect_json(server.get("/v1/bin").await, StatusCode::OK).await;
    assert_eq!((&binned["items"], server.files("models")), (&json!([]), 0));
}

#[tokio::test]
async fn what_is_in_the_bin_counts_for_its_quota_is_backed_up_and_survives_a_start() {
    let server = TestServer::start_with(|config| {
        config.retention.bin = 7;
        config.quotas.stored_bytes = Some(9_000);
    })
    .await;
    let (model, job) = server.model().await;
    let set: Value = expect_json(server.get(&format!("/v1/jobs/{job}")).await, StatusCode::OK).await;
    let set = text(&set, "/scan_set_id");
    let poses = server.get(&format!("/v1/models/{model}/poses.json")).await.bytes().await.expect("a body");
    let mut sets = 0;
    let refused = loop {
        let answer = server.post_form("/v1/scan-sets/upload", crate::common::scan_form(2)).await;
        if answer.status() != StatusCode::CREATED {
            break answer;
        }
        sets += 1;
        assert!(sets < 20, "9 kB are full some time");
    };
    expect_problem(refused, 429, "quota_exceeded").await;
    assert_eq!(server.delete(&format!("/v1/scan-sets/{set}")).await, StatusCode::NO_CONTENT);
    let refused = server.post_form("/v1/scan-sets/upload", crate::common::scan_form(2)).await;
    expect_problem(refused, 429, "quota_exceeded").await;

    let place = tempfile::tempdir().expect("a temporary folder");
    let (copy, restored) = (place.path().join("backup"), tempfile::tempdir().expect("a temporary folder"));
    assert!(backup::back_up(server.folder.path(), &copy, false).await.expect("copied").is_whole());
    assert!(backup::restore(&copy, restored.path()).await.expect("put back").is_whole());
    assert!(is_sound(restored.path()).await);
    // the backup forgets what is gone for good
    assert_eq!(server.delete(&format!("/v1/bin/{set}")).await, StatusCode::NO_CONTENT);
    let answer = server.post_form("/v1/scan-sets/upload", crate::common::scan_form(2)).await;
    assert_eq!(answer.status(), StatusCode::CREATED, "there is room again");
    assert!(backup::back_up(server.folder.path(), &copy, false).await.expect("copied").removed > 0);

    let again = TestServer::start_on(restored, |config| config.retention.bin = 7).await;
    expect_json(put_back(&again, &set).await, StatusCode::OK).await;
    let served = again.get(&format!("/v1/models/{model}/poses.json")).await.bytes().await.expect("a body");
    assert_eq!(served, poses);
}
