//! Adding scans to a finished model over a real connection.

use crate::common::{TestServer, expect_json, expect_problem, files, text};
use reqwest::StatusCode;
use serde_json::{Value, json};

const UNKNOWN: &str = "0192f0c0-0000-7000-8000-000000000000";

/// Stores a further scan in a set, and a pose for it alone.
async fn add_scan(server: &TestServer, set: &str, name: &str) {
    let scan = server.put(&format!("/v1/scan-sets/{set}/scans/{name}"), files::ply(60)).await;
    assert_eq!(scan.status(), StatusCode::CREATED);
    let poses = files::poses(&[name.to_owned()]).replace("[1,0,0,0]", "[1,0,0,7]");
    assert_eq!(server.put(&format!("/v1/scan-sets/{set}/poses"), poses).await.status(), StatusCode::OK);
}

async fn asset(server: &TestServer, model: &str, name: &str) -> String {
    server.get(&format!("/v1/models/{model}/{name}")).await.text().await.expect("a body")
}

#[tokio::test]
async fn a_scan_is_added_to_a_finished_model() {
    let server = TestServer::start().await;
    let (base, set) = registered(&server, 2).await;
    add_scan(&server, &set, "late.ply").await;
    let body = json!({"scan_set_id": set, "base_model_id": base});
    let queued = expect_json(server.post("/v1/jobs", &body).await, StatusCode::ACCEPTED).await;
    assert_eq!(queued["base_model_id"], base);
    // the job has the poses already
    assert_eq!(server.delete(&format!("/v1/models/{base}")).await, StatusCode::NO_CONTENT);
    let ended = server.finished(&text(&queued, "/id")).await;
    assert_eq!((ended["status"].as_str(), &ended["base_model_id"]), (Some("succeeded"), &json!(base)), "{ended}");
    let poses: Value =
        serde_json::from_str(&asset(&server, &text(&ended, "/model_id"), "poses.json").await).expect("JSON");
    assert_eq!(poses.as_object().map(|poses| poses.len()), Some(3));
    assert_eq!((&poses["scan0.ply"][0][3], &poses["late.ply"][0][3]), (&json!(0.0), &json!(7.0)));
}

#[tokio::test]
async fn what_can_not_be_added_is_refused_at_the_door() {
    let server = TestServer::start().await;
    let (base, set) = registered(&server, 2).await;
    let job = |set: &str, base: &str| json!({"scan_set_id": set, "base_model_id": base});
    expect_problem(server.post("/v1/jobs", &job(&set, &base)).await, 422, "nothing_to_add").await;
    expect_problem(server.post("/v1/jobs", &job(&set, UNKNOWN)).await, 404, "not_found").await;
    let other = server.scan_set(2).await;
    expect_problem(server.post("/v1/jobs", &job(&other, &base)).await, 422, "wrong_base").await;

    add_scan(&server, &set, "late.ply").await;
    let mut with_options = job(&set, &base);
    with_options["options"] = json!({"method": "ma-aticp"});
    expect_problem(server.post("/v1/jobs", &with_options).await, 422, "invalid_options").await;
    let reference = json!({"scan_set_id": other, "options": {"reference": "nobody.ply"}});
    let problem = expect_problem(server.post("/v1/jobs", &reference).await, 422, "unknown_reference").await;
    assert_eq!(problem["scan"], "nobody.ply");
}

/// A model of `count` scans, with the set it comes from.
async fn registered(server: &TestServer, count: usize) -> (String, String) {
    let set = server.scan_set(count).await;
    let job = server.post("/v1/jobs", &json!({"scan_set_id": set})).await;
    let job = expect_json(job, StatusCode::ACCEPTED).await;
    let ended = server.finished(&text(&job, "/id")).await;
    (text(&ended, "/model_id"), set)
}
