//! The page at `/`: what a browser gets, and what it may do with it.

use crate::common::{TestServer, expect_json, expect_problem};
use reqwest::{Method, StatusCode};
use serde_json::Value;

#[tokio::test]
async fn the_page_is_served_with_a_policy_and_asked_for_again_only_when_it_changed() {
    let server = TestServer::start().await;
    let page = server.get("/").await;
    assert_eq!(page.status(), StatusCode::OK);
    let headers = page.headers().clone();
    assert_eq!(headers["content-type"], "text/html; charset=utf-8");
    assert_eq!(headers["cache-control"], "no-cache");
    assert_eq!(headers["x-content-type-options"], "nosniff");
    let policy = headers["content-security-policy"].to_str().expect("text");
    assert!(policy.starts_with("default-src 'none'; script-src 'self'; style-src 'self';"), "{policy}");
    assert!(!policy.contains("unsafe"), "{policy}");
    let again = server.client.get(server.url("/")).header("if-none-match", &headers["etag"]).send().await;
    assert_eq!(again.expect("an answer").status(), StatusCode::NOT_MODIFIED);

    // every file that the page names is there, and one with a hash in its name is kept for good
    let text = page.text().await.expect("a body");
    for file in text.split('"').filter(|word| word.starts_with("/assets/")) {
        let answer = server.get(file).await;
        assert_eq!(answer.status(), StatusCode::OK, "{file}");
        assert!(answer.headers()["cache-control"].to_str().expect("text").ends_with("immutable"), "{file}");
    }
    let write = server.client.request(Method::POST, server.url("/")).send().await.expect("an answer");
    expect_problem(write, 405, "method_not_allowed").await;
}

#[tokio::test]
async fn what_is_not_of_the_page_has_no_rights_in_a_browser() {
    let server = TestServer::start().await;
    for path in ["/v1/info", "/v1/nothing", "/openapi.yaml", "/healthz"] {
        let answer = server.get(path).await;
        let policy = answer.headers()["content-security-policy"].to_str().expect("text");
        assert!(policy.starts_with("default-src 'none'") && policy.contains("sandbox"), "{path}: {policy}");
        assert!(!policy.contains("script-src"), "{path}: {policy}");
        assert_eq!(answer.headers()["x-content-type-options"], "nosniff", "{path}");
    }
}

#[tokio::test]
async fn the_contract_is_served_as_json_too() {
    let server = TestServer::start().await;
    let contract = expect_json(server.get("/openapi.json").await, StatusCode::OK).await;
    let operations = |value: &Value| value.to_string().matches("\"operationId\"").count();
    let yaml = visage::http::openapi_yaml().expect("YAML");
    assert_eq!(operations(&contract), yaml.matches("operationId:").count());
}
