//! Hints of a person over a real connection: kept with the job, shown, refused at the door.

use crate::common::{Mode, TestServer, expect_json, expect_problem, text};
use reqwest::StatusCode;
use serde_json::{Value, json};

#[tokio::test]
async fn hints_stay_with_the_job_through_a_retry() {
    let server = TestServer::start().await;
    let set = server.scan_set(2).await;
    let pair = |x: f64, y: f64| json!([[x, y, 0.0], [x, y, 1.0]]);
    let hints = json!({
        "points": [{"a": "scan0.ply", "b": "scan1.ply", "pairs": [pair(0.0, 0.0), pair(1.0, 0.0), pair(0.0, 2.0)]}],
        "overlaps": [["scan0.ply", "scan1.ply"]],
        "regions": [{"scan": "scan1.ply", "leave": {"sphere": {"center": [0.0, 0.0, 0.0], "radius": 1.0}}}],
    });
    server.engine.set(Mode::Refuse);
    let body = json!({"scan_set_id": set, "hints": hints});
    let queued = expect_json(server.post("/v1/jobs", &body).await, StatusCode::ACCEPTED).await;
    assert_eq!(queued["hints"], hints);
    let job = text(&queued, "/id");
    assert_eq!(server.finished(&job).await["status"], "failed");
    server.engine.set(Mode::Quick);
    let again =
        expect_json(server.post(&format!("/v1/jobs/{job}/retry"), &json!({})).await, StatusCode::ACCEPTED).await;
    assert_eq!(again["hints"], hints);
    let ended = server.finished(&job).await;
    assert_eq!((&ended["status"], &ended["hints"]), (&json!("succeeded"), &hints));
    let without = expect_json(server.post("/v1/jobs", &json!({"scan_set_id": set})).await, StatusCode::ACCEPTED).await;
    assert_eq!(without["hints"], Value::Null);
}

#[tokio::test]
async fn hints_that_can_not_be_used_are_refused_at_the_door() {
    let server = TestServer::start().await;
    let set = server.scan_set(2).await;
    let unknown = json!({"overlaps": [["scan0.ply", "nobody.ply"]]});
    let few = json!({"points": [{"a": "scan0.ply", "b": "scan1.ply", "pairs": [[[0, 0, 0], [0, 0, 0]]]}]});
    for (hints, scan) in [(unknown, Some("nobody.ply")), (few, Some("scan1.ply")), (json!([]), None)] {
        let body = json!({"scan_set_id": set, "hints": hints});
        let problem = expect_problem(server.post("/v1/jobs", &body).await, 422, "invalid_hints").await;
        assert_eq!(problem["scan"].as_str(), scan, "{problem}");
    }
}
