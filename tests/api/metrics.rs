//! What Prometheus reads.

use reqwest::Method;

use crate::common::{TestServer, expect_problem};

async fn metrics(server: &TestServer) -> String {
    let answer = server.get("/metrics").await;
    assert_eq!(answer.headers()["content-type"], "application/openmetrics-text; version=1.0.0; charset=utf-8");
    answer.text().await.expect("a body")
}

/// The value of the line that begins so.
fn value(text: &str, line: &str) -> f64 {
    let found = text.lines().find_map(|found| found.strip_prefix(line)?.strip_prefix(' '));
    found.unwrap_or_else(|| panic!("no {line} in\n{text}")).parse().expect("a number")
}

#[tokio::test]
async fn requests_jobs_stages_and_what_is_kept_are_counted() {
    let server = TestServer::start().await;
    server.model().await;
    server.get("/v1/models/nothing").await;
    // a run is counted after its end can be seen, but before its worker takes another job: this one has ended then
    let next = server.post("/v1/jobs", &serde_json::json!({"kind": "evaluate"})).await;
    let next: serde_json::Value = next.json().await.expect("JSON");
    assert_eq!(server.finished(next["id"].as_str().expect("an id")).await["status"], "succeeded");
    let text = metrics(&server).await;
    assert_eq!(value(&text, "visage_job_runs_total{kind=\"register\",end=\"succeeded\"}"), 1.0);
    assert_eq!(value(&text, "visage_stage_runs_total{stage=\"registering\"}"), 1.0);
    assert_eq!(value(&text, "visage_jobs{kind=\"register\",status=\"succeeded\"}"), 1.0);
    assert_eq!(
        (value(&text, "visage_scan_sets"), value(&text, "visage_scans"), value(&text, "visage_models")),
        (1.0, 3.0, 1.0)
    );
    assert_eq!(
        value(&text, "visage_http_requests_total{method=\"GET\",route=\"/v1/models/{id}\",status=\"404\"}"),
        1.0
    );
    assert!(value(&text, "visage_http_request_seconds_count{method=\"POST\",route=\"/v1/jobs\"}") >= 1.0);
    for name in
        ["memory_bytes", "memory_peak_bytes", "disk_free_bytes", "database_bytes", "file_bytes", "cpu_seconds_total"]
    {
        assert!(value(&text, &format!("visage_{name}")) > 0.0, "{name}");
    }
    assert_eq!(value(&text, "visage_gallery_ready"), 1.0);
    assert!(text.contains("visage_model_verdicts{verdict=\"") && text.ends_with("# EOF\n"), "{text}");
}

#[tokio::test]
async fn clients_can_not_make_new_series() {
    let server = TestServer::start().await;
    for index in 0..20 {
        server.get(&format!("/v1/nothing/{index}")).await;
        let method = Method::from_bytes(format!("M{index}").as_bytes()).expect("a method");
        server.client.request(method, server.url("/v1/models")).send().await.expect("an answer");
    }
    let text = metrics(&server).await;
    assert_eq!(value(&text, "visage_http_requests_total{method=\"GET\",route=\"none\",status=\"404\"}"), 20.0);
    assert_eq!(value(&text, "visage_http_requests_total{method=\"other\",route=\"/v1/models\",status=\"405\"}"), 20.0);
    assert!(!text.contains("nothing") && !text.contains("\"M1"), "{text}");
}

#[tokio::test]
async fn a_key_for_metrics_reads_nothing_else() {
    let server = TestServer::start().await;
    let key = server.post("/v1/keys", &serde_json::json!({"name": "prometheus", "scope": "metrics"})).await;
    let key: serde_json::Value = key.json().await.expect("JSON");
    let get = |path: &str| server.client.get(server.url(path)).bearer_auth(key["token"].as_str().expect("text")).send();
    assert_eq!(get("/metrics").await.expect("an answer").status(), 200);
    expect_problem(get("/v1/models").await.expect("an answer"), 403, "insufficient_scope").await;
    expect_problem(server.get("/metrics").await, 401, "unauthorized").await;
}

/// The board shows what there is.
#[tokio::test]
async fn the_board_asks_for_series_that_are_told() {
    let server = TestServer::start().await;
    server.model().await;
    let board = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/deploy/grafana.json")).expect("a board");
    let _: serde_json::Value = serde_json::from_str(&board).expect("JSON");
    let text = metrics(&server).await;
    let names: std::collections::BTreeSet<&str> = board
        .split(|c: char| !c.is_ascii_alphanumeric() && c != '_')
        .filter(|word| word.starts_with("visage_"))
        .collect();
    assert!(names.len() > 12, "{names:?}");
    let told = |name: &str| {
        let family = name.strip_suffix("_total").or_else(|| name.strip_suffix("_bucket")).unwrap_or(name);
        text.contains(&format!("# TYPE {family} "))
    };
    let unknown: Vec<&&str> = names.iter().filter(|name| !told(name)).collect();
    assert!(unknown.is_empty(), "{unknown:?}");
}
