//! The contract: what is committed is what is served, and errors are problems everywhere.

use crate::common::{TestServer, expect_json, expect_problem, files, text};
use reqwest::multipart::{Form, Part};
use reqwest::{Method, StatusCode};
use serde_json::json;

#[test]
fn the_committed_contract_is_that_of_the_code() {
    let committed =
        std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/openapi.yaml")).expect("openapi.yaml");
    let served = visage::http::openapi_yaml().expect("YAML");
    assert!(committed == served, "openapi.yaml is out of date: run `cargo run -- openapi > openapi.yaml`");
}

#[tokio::test]
async fn the_served_contract_describes_every_answer() {
    let server = TestServer::start().await;
    let response = server.get("/openapi.yaml").await;
    assert_eq!(response.headers()["content-type"], "application/yaml");
    let yaml = response.text().await.expect("a body");
    assert_eq!(yaml, visage::http::openapi_yaml().expect("YAML"));
    assert!(yaml.starts_with("openapi: 3.1"), "{}", &yaml[..40]);
    // an answer without a description makes the document invalid
    assert!(!yaml.contains("description: ''"));
    assert_eq!(yaml.matches("operationId:").count(), yaml.matches(" responses:\n").count());
}

#[tokio::test]
async fn every_path_of_the_contract_is_served() {
    let server = TestServer::start().await;
    let yaml = visage::http::openapi_yaml().expect("YAML");
    let paths: Vec<&str> =
        yaml.lines().filter_map(|line| line.strip_prefix("  /")).filter_map(|line| line.strip_suffix(':')).collect();
    assert!(paths.len() > 10, "{paths:?}");
    for path in paths {
        // no resource knows this method: a path that is served says so, another one is not found
        let url = server.url(&format!("/{}", path.replace(['{', '}'], "")));
        let response = server.client.request(Method::TRACE, url).send().await.expect("an answer");
        assert!(response.headers().contains_key("allow"), "{path}");
        expect_problem(response, 405, "method_not_allowed").await;
    }
}

#[tokio::test]
async fn errors_are_problems_wherever_they_come_from() {
    let server = TestServer::start().await;
    expect_problem(server.get("/v1/nothing").await, 404, "not_found").await;
    expect_problem(server.get("/v1/scan-sets/%FF").await, 400, "malformed_request").await;
    let post = |content_type: &'static str, body: &'static str| {
        server.client.post(server.url("/v1/jobs")).header("content-type", content_type).body(body).send()
    };
    let broken = post("application/json", "{\"scan_set_id\": ").await.expect("an answer");
    expect_problem(broken, 400, "malformed_request").await;
    let wrong = post("application/json", "{\"scan_set_id\": 7}").await.expect("an answer");
    expect_problem(wrong, 422, "invalid_field").await;
    let xml = post("text/xml", "<job/>").await.expect("an answer");
    expect_problem(xml, 415, "unsupported_media_type").await;
    let key = server.client.post(server.url("/v1/jobs")).header("idempotency-key", "").send().await.expect("an answer");
    expect_problem(key, 400, "malformed_request").await;
}

#[tokio::test]
async fn forms_are_taken_where_clients_are_made_for_them_and_beside_json() {
    let server = TestServer::start().await;
    let files = || {
        let scan = |name: &str, points| Part::bytes(files::ply(points)).file_name(name.to_owned());
        Form::new().part("scans", scan("a.ply", 5)).part("scans", scan("b.ply", 6))
    };
    for path in ["/v1/scan-sets", "/v1/scan-sets/upload"] {
        let set = expect_json(server.post_form(path, files()).await, StatusCode::CREATED).await;
        assert_eq!(set["scans"][1]["name"], "b.ply", "{path}");
    }
    for path in ["/v1/jobs", "/v1/jobs/upload"] {
        expect_json(server.post_form(path, files()).await, StatusCode::ACCEPTED).await;
    }
    for path in ["/v1/queries", "/v1/queries/probe"] {
        let probe = Part::bytes(files::bumpy_sphere(0.0)).file_name("ball.obj");
        // Python writes truth so
        let form = Form::new().part("probe", probe).text("only_matches", "True").text("explain", "False");
        let answer = expect_json(server.post_form(path, form).await, StatusCode::OK).await;
        assert_eq!(answer["matches"], json!([]), "{path}");
    }
    for path in ["/v1/scan-sets/upload", "/v1/jobs/upload", "/v1/queries/probe"] {
        expect_problem(server.post(path, &json!({})).await, 415, "unsupported_media_type").await;
    }
}

#[tokio::test]
async fn a_repeated_form_is_known_at_either_address() {
    let server = TestServer::start().await;
    let send = |path: &str| {
        let form = Form::new().part("scans", Part::bytes(files::ply(5)).file_name("a.ply"));
        server.client.post(server.url(path)).header("idempotency-key", "k").multipart(form).send()
    };
    let first = send("/v1/scan-sets").await.expect("an answer");
    let first = expect_json(first, StatusCode::CREATED).await;
    let again = send("/v1/scan-sets/upload").await.expect("an answer");
    assert_eq!(again.headers()["idempotent-replayed"], "true");
    assert_eq!(expect_json(again, StatusCode::CREATED).await["id"], first["id"]);
}

#[tokio::test]
async fn poses_are_put_as_json_or_as_a_file_whatever_its_type() {
    let server = TestServer::start().await;
    let form = Form::new().part("scans", Part::bytes(files::ply(5)).file_name("a.ply"));
    let set = expect_json(server.post_form("/v1/scan-sets/upload", form).await, StatusCode::CREATED).await;
    let conf = "camera 0 0 0 0 0 0 1\nbmesh a.ply 0 0 0 0 0 0 1\n";
    let matrices = files::poses(&["a.ply".to_owned()]);
    for (address, media_type, body) in [
        ("poses", "application/json", matrices.as_str()),
        ("poses", "text/plain", conf),
        ("pose-file", "application/octet-stream", conf),
        ("pose-file", "application/octet-stream", matrices.as_str()),
    ] {
        let url = server.url(&format!("{}/{address}", text(&set, "/links/self")));
        let put = server.client.put(url).header("content-type", media_type).body(body.to_owned()).send().await;
        let poses = expect_json(put.expect("an answer"), StatusCode::OK).await;
        assert_eq!((&poses["count"], &poses["scans_without_pose"]), (&json!(1), &json!([])), "{address} {media_type}");
    }
}

#[tokio::test]
async fn the_service_tells_how_it_is_and_what_it_offers() {
    let server = TestServer::start().await;
    assert_eq!(expect_json(server.get("/healthz").await, StatusCode::OK).await["status"], "ok");
    let info = expect_json(server.get("/v1/info").await, StatusCode::OK).await;
    assert_eq!(info["versions"]["visage"], env!("CARGO_PKG_VERSION"));
    assert_eq!(info["limits"]["threads_per_job"], 2);
    let options = info["job_options"].as_array().expect("options");
    let min_overlap = options.iter().find(|option| option["name"] == "min_overlap").expect("an option");
    assert_eq!((min_overlap["type"].as_str(), min_overlap["default"].as_f64()), (Some("number"), Some(0.5)));
    assert!(
        min_overlap["minimum"].is_number() && min_overlap["maximum"].is_number() && min_overlap["help"].is_string()
    );
    assert_eq!(info["file_formats"], serde_json::json!(visage::formats::surface_endings()));
}

#[tokio::test]
async fn request_ids_are_ours() {
    let server = TestServer::start().await;
    let request = server.client.get(server.url("/healthz")).header("x-request-id", "theirs").send();
    let response = request.await.expect("an answer");
    assert_ne!(response.headers()["x-request-id"], "theirs");
}
