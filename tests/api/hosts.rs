//! Whose requests are taken: those that mean this service, and no changes for pages from elsewhere.

use crate::common::raw::{Answer, Raw};
use crate::common::{TestServer, expect_json, expect_problem};
use reqwest::StatusCode;
use serde_json::json;

/// The answer to a request with these headers.
async fn ask(server: &TestServer, line: &str, headers: &[&str]) -> Answer {
    let headers: String = headers.iter().map(|header| format!("{header}\r\n")).collect();
    let body = if line.starts_with("POST") { "content-length: 2\r\n\r\n{}" } else { "\r\n" };
    let mut raw = Raw::send_to(server, format!("{line}\r\n{headers}{body}")).await;
    raw.answer().await
}

fn refused(answer: &Answer, code: &str) -> bool {
    let has_hint = answer.body["hint"].as_str().is_some_and(|hint| hint.contains("--host"));
    answer.status == 403 && answer.body["code"] == code && has_hint
}

#[tokio::test]
async fn a_name_that_was_led_here_gets_nothing() {
    let server = TestServer::start().await;
    for line in
        ["GET /v1/scan-sets HTTP/1.1", "GET /healthz HTTP/1.1", "GET /nothing HTTP/1.1", "DELETE /v1/models/x HTTP/1.1"]
    {
        for host in
            ["evil.example", "evil.example:80", "127.0.0.1.evil.example", "localhost@evil.example", "", "10.1.2.3"]
        {
            let answer = ask(&server, line, &[&format!("Host: {host}")]).await;
            assert!(refused(&answer, "foreign_host"), "{line} {host}: {answer:?}");
        }
    }
    // the form of the address for proxies
    let answer = ask(&server, "GET http://evil.example/v1/scan-sets HTTP/1.1", &["Host: localhost"]).await;
    assert!(refused(&answer, "foreign_host"), "{answer:?}");
    for hosts in [&[][..], &["Host: localhost", "Host: localhost"], &["Host: localhost", "Host: evil.example"]] {
        let answer = ask(&server, "GET /healthz HTTP/1.1", hosts).await;
        assert_eq!((answer.status, answer.body["code"].as_str()), (400, Some("malformed_request")), "{hosts:?}");
    }
}

#[tokio::test]
async fn loopback_names_and_the_address_are_taken() {
    let server = TestServer::start().await;
    let port = server.handle.addr().port();
    for host in ["localhost", &format!("localhost:{port}"), "LOCALHOST:9", "127.0.0.1", "[::1]:80", "a.localhost"] {
        let answer = ask(&server, "GET /healthz HTTP/1.1", &[&format!("Host: {host}")]).await;
        assert_eq!(answer.status, 200, "{host}");
    }
    // probes of load balancers
    assert_eq!(ask(&server, "GET /healthz HTTP/1.0", &[]).await.status, 200);
}

#[tokio::test]
async fn pages_from_elsewhere_can_change_nothing() {
    let server = TestServer::start().await;
    let own = server.url("");
    let foreign: [&[&str]; 6] = [
        &["Origin: http://evil.example"],
        &["Origin: null"],
        &["Sec-Fetch-Site: cross-site"],
        &["Sec-Fetch-Site: same-site"],
        &["Origin: http://evil.example", "Sec-Fetch-Site: cross-site"],
        // another program on this machine
        &["Origin: http://localhost:1"],
    ];
    for headers in foreign {
        for line in
            ["POST /v1/scan-sets HTTP/1.1", "DELETE /v1/models/x HTTP/1.1", "PUT /v1/scan-sets/x/poses HTTP/1.1"]
        {
            let headers = [&["Host: localhost", "content-type: application/json"], headers].concat();
            let answer = ask(&server, line, &headers).await;
            assert!(refused(&answer, "foreign_origin"), "{line} {headers:?}: {answer:?}");
        }
        // what it reads the browser does not show to the page
        let headers = [&["Host: localhost"], headers].concat();
        assert_eq!(ask(&server, "GET /v1/scan-sets HTTP/1.1", &headers).await.status, 200, "{headers:?}");
    }
    let list = expect_json(server.get("/v1/scan-sets").await, StatusCode::OK).await;
    assert_eq!(list["items"], json!([]));
    // programs send neither; pages of the service's own send both
    let url = server.url("/v1/scan-sets");
    for (origin, site) in
        [(None, None), (Some(own.as_str()), Some("same-origin")), (None, Some("none")), (Some(&own), None)]
    {
        let mut request = server.client.post(&url).json(&json!({"name": "own"}));
        request = origin.into_iter().fold(request, |request, origin| request.header("origin", origin));
        request = site.into_iter().fold(request, |request, site| request.header("sec-fetch-site", site));
        assert_eq!(request.send().await.expect("an answer").status(), StatusCode::CREATED, "{origin:?} {site:?}");
    }
}

#[tokio::test]
async fn a_proxy_passes_on_a_name_that_is_allowed() {
    let server = TestServer::start_with(|config| {
        config.hosts = ["visage.example", "faces.example:8443"].map(|name| name.parse().expect("a host")).into();
        config.open = true;
    })
    .await;
    for host in ["visage.example", "Visage.Example:443", "faces.example:8443"] {
        assert_eq!(ask(&server, "GET /v1/models HTTP/1.1", &[&format!("Host: {host}")]).await.status, 200, "{host}");
    }
    assert!(refused(&ask(&server, "GET /v1/models HTTP/1.1", &["Host: faces.example"]).await, "foreign_host"));
    // a proxy that passes the name on, and one that puts its own in the place
    for (host, origin) in [
        ("visage.example", "https://visage.example"),
        ("127.0.0.1:8080", "https://visage.example"),
        ("127.0.0.1:8080", "https://faces.example:8443"),
    ] {
        let headers = [&format!("Host: {host}"), &format!("Origin: {origin}"), "content-type: application/json"];
        assert_eq!(ask(&server, "POST /v1/scan-sets HTTP/1.1", &headers).await.status, 201, "{host} {origin}");
    }
    let headers = ["Host: visage.example", "Origin: https://other.visage.example", "content-type: application/json"];
    assert!(refused(&ask(&server, "POST /v1/scan-sets HTTP/1.1", &headers).await, "foreign_origin"));
}

#[tokio::test]
async fn a_refused_upload_still_gets_its_answer() {
    let server = TestServer::start().await;
    let set = server.scan_set(2).await;
    let request =
        server.client.put(server.url(&format!("/v1/scan-sets/{set}/scans/a.ply"))).header("host", "evil.example");
    let response = request.body(vec![b' '; 8 << 20]).send().await.expect("an answer, not a broken connection");
    expect_problem(response, 403, "foreign_host").await;
}

#[tokio::test]
async fn other_pages_ask_if_they_are_listed_and_never_with_a_session() {
    let server = TestServer::start_with(|config| {
        config.cors_origins = vec!["https://app.example".parse().expect("an origin")];
    })
    .await;
    let key = server.post("/v1/keys", &json!({"name": "app", "scope": "admin"})).await;
    let key: serde_json::Value = key.json().await.expect("JSON");
    let ask = |method: reqwest::Method, origin: &str| {
        let request = server.client.request(method, server.url("/v1/scan-sets")).header("origin", origin);
        request
            .header("access-control-request-method", "POST")
            .header("access-control-request-headers", "authorization")
    };
    // the preflight brings no key
    let preflight = ask(reqwest::Method::OPTIONS, "https://app.example").send().await.expect("an answer");
    assert_eq!(preflight.status(), 200);
    let headers = preflight.headers();
    assert_eq!(headers["access-control-allow-origin"], "https://app.example");
    assert!(headers["access-control-allow-headers"].to_str().expect("text").contains("authorization"));
    assert!(!headers.contains_key("access-control-allow-credentials"), "a session is not for other pages");
    for stranger in ["https://evil.example", "https://app.example.evil.example", "http://app.example", "null"] {
        let preflight = ask(reqwest::Method::OPTIONS, stranger).send().await.expect("an answer");
        assert!(!preflight.headers().contains_key("access-control-allow-origin"), "{stranger}");
    }
    let token = key["token"].as_str().expect("text");
    let post = |origin: &str| ask(reqwest::Method::POST, origin).bearer_auth(token).json(&json!({"name": "a"})).send();
    let made = post("https://app.example").await.expect("an answer");
    assert_eq!(made.headers()["access-control-allow-origin"], "https://app.example");
    assert!(made.headers()["access-control-expose-headers"].to_str().expect("text").contains("location"));
    assert_eq!(made.status(), 201);
    expect_problem(post("https://evil.example").await.expect("an answer"), 403, "foreign_origin").await;
    // a refusal can be read by the page, too
    let refused = ask(reqwest::Method::POST, "https://app.example").json(&json!({"name": "a"})).send().await;
    let refused = refused.expect("an answer");
    assert_eq!(refused.headers()["access-control-allow-origin"], "https://app.example");
    expect_problem(refused, 401, "unauthorized").await;
}

#[tokio::test]
async fn every_answer_tells_browsers_what_not_to_do_with_it() {
    let server = TestServer::start().await;
    for path in ["/v1/models", "/healthz", "/v1/nothing", "/nothing", "/openapi.yaml", "/metrics"] {
        let answer = server.get(path).await;
        for (name, part) in [
            ("content-security-policy", "default-src 'none'"),
            ("x-content-type-options", "nosniff"),
            ("x-frame-options", "DENY"),
            ("referrer-policy", "no-referrer"),
            ("cross-origin-resource-policy", "same-origin"),
            ("cache-control", "private"),
        ] {
            let value = answer.headers().get(name).and_then(|value| value.to_str().ok()).unwrap_or_default();
            assert!(value.contains(part), "{path} {name}: {value}");
        }
        assert!(
            !answer.headers().contains_key("server") && !answer.headers().contains_key("access-control-allow-origin")
        );
    }
}
