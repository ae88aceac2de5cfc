//! Who may: keys, scopes, sessions of browsers, and who needs none.

use futures_util::StreamExt;
use reqwest::header::{COOKIE, SET_COOKIE, WWW_AUTHENTICATE};
use reqwest::{Method, RequestBuilder, Response, StatusCode};
use serde_json::{Value, json};
use visage::config::ServerConfig;
use visage::http::Server;

use crate::common::{TestServer, config, expect_json, expect_problem, scan_form, text};

/// A new key, and a server that needs one from now on.
async fn key(server: &TestServer, scope: &str, by: Option<&str>) -> (String, String) {
    let request = server.client.post(server.url("/v1/keys")).json(&json!({"name": scope, "scope": scope}));
    let response = with(request, by).send().await.expect("an answer");
    assert_eq!(response.headers()["cache-control"], "no-store");
    let key = expect_json(response, StatusCode::CREATED).await;
    (text(&key, "/token"), text(&key, "/id"))
}

fn with(request: RequestBuilder, key: Option<&str>) -> RequestBuilder {
    key.into_iter().fold(request, RequestBuilder::bearer_auth)
}

/// A server with a key of each scope, least first.
async fn closed_server() -> (TestServer, [String; 4]) {
    let server = TestServer::start().await;
    let (admin, _) = key(&server, "admin", None).await;
    let mut keys = Vec::new();
    for scope in ["metrics", "read", "write"] {
        keys.push(key(&server, scope, Some(&admin)).await.0);
    }
    keys.push(admin);
    (server, keys.try_into().expect("four"))
}

/// Every operation of the contract: method, path, and the scope that it needs by the contract.
pub fn operations() -> Vec<(Method, String, Option<String>)> {
    let yaml = visage::http::openapi_yaml().expect("YAML");
    let (mut found, mut path, mut method) = (Vec::new(), String::new(), None);
    for line in yaml.lines().skip_while(|line| *line != "paths:").skip(1).take_while(|line| line.starts_with(' ')) {
        if let Some(name) = line.strip_prefix("  /").and_then(|line| line.strip_suffix(':')) {
            path = format!("/{name}");
        } else if let Some(name) = line.strip_prefix("    ").filter(|name| !name.starts_with(' ')) {
            let name = name.trim_end_matches(':').to_ascii_uppercase();
            method = Some(Method::from_bytes(name.as_bytes()).expect("a method"));
            found.push((method.clone().expect("one"), path.clone(), None));
        } else if line == "      - key:" {
            assert!(method.is_some());
        } else if let Some(scope) = line.strip_prefix("        - ")
            && ["metrics", "read", "write", "admin"].contains(&scope)
            && let Some((_, _, needed)) = found.last_mut()
        {
            *needed = Some(scope.to_owned());
        }
    }
    found
}

fn sample(path: &str) -> String {
    let id = "01890000-0000-7000-8000-000000000000";
    path.replace("{id}", id).replace("{delivery_id}", id).replace("{name}", "a.ply").replace("{file}", "cloud.ply")
}

/// What is said to HEAD has no body.
async fn expect_refusal(response: Response, method: &Method, status: u16, code: &str) {
    if *method == Method::HEAD {
        assert_eq!(response.status().as_u16(), status);
    } else {
        expect_problem(response, status, code).await;
    }
}

#[tokio::test]
async fn every_operation_of_the_contract_is_closed_to_those_who_may_not() {
    let (server, keys) = closed_server().await;
    let scopes = ["metrics", "read", "write", "admin"];
    let (mut closed, mut open) = (0, Vec::new());
    for (method, path, needed) in operations() {
        let url = server.url(&sample(&path));
        let ask = |key| with(server.client.request(method.clone(), &url), key).send();
        let Some(needed) = needed else {
            assert!(![401, 403].contains(&ask(None).await.expect("an answer").status().as_u16()), "{method} {path}");
            open.push(format!("{method} {path}"));
            continue;
        };
        closed += 1;
        let refused = ask(None).await.expect("an answer");
        assert_eq!(refused.headers()[WWW_AUTHENTICATE], "Bearer realm=\"visage\"", "{method} {path}");
        expect_refusal(refused, &method, 401, "unauthorized").await;
        let least = scopes.iter().position(|scope| *scope == needed).expect("a scope");
        for key in &keys[..least] {
            let refused = ask(Some(key)).await.expect("an answer");
            let challenge = refused.headers()[WWW_AUTHENTICATE].to_str().expect("text").to_owned();
            assert!(challenge.contains(&format!("scope=\"{needed}\"")), "{method} {path}: {challenge}");
            expect_refusal(refused, &method, 403, "insufficient_scope").await;
        }
        if method != Method::GET || !path.ends_with("/events") {
            let status = ask(Some(&keys[least])).await.expect("an answer").status().as_u16();
            assert!(![401, 403].contains(&status), "{method} {path}: {status}");
        }
    }
    assert!(closed > 40, "{closed}");
    // a new one has to be put here by hand: it tells nothing of what is kept
    let known = ["GET /healthz", "GET /readyz", "GET /v1/session", "DELETE /v1/session"];
    assert!(open.iter().all(|operation| known.contains(&operation.as_str())), "{open:?}");
}

#[tokio::test]
async fn what_there_is_not_is_closed_too() {
    let (server, _) = closed_server().await;
    for path in ["/v1", "/v1/", "/v1/nothing", "/v1/models/x/y/z", "//v1/models", "/v1/keys/"] {
        let status = server.get(path).await.status().as_u16();
        assert!([401, 404].contains(&status), "{path}: {status}");
    }
    assert_eq!(server.client.patch(server.url("/v1/models")).send().await.expect("an answer").status(), 401);
    assert_eq!(server.client.head(server.url("/v1/models")).send().await.expect("an answer").status(), 401);
    // the contract is no secret
    assert_eq!(server.get("/openapi.yaml").await.status(), 200);
}

#[tokio::test]
async fn a_wrong_key_is_refused_even_where_none_is_needed() {
    let server = TestServer::start().await;
    assert_eq!(server.get("/v1/models").await.status(), 200);
    let well_formed = format!("visage_{}", "A".repeat(64));
    for wrong in ["x", &well_formed] {
        let answer = with(server.client.get(server.url("/v1/models")), Some(wrong)).send().await.expect("an answer");
        assert!(answer.headers()[WWW_AUTHENTICATE].to_str().expect("text").contains("invalid_token"));
        expect_problem(answer, 401, "unauthorized").await;
        let alive = with(server.client.get(server.url("/healthz")), Some(wrong)).send().await.expect("an answer");
        assert_eq!(alive.status(), 200);
    }
}

#[tokio::test]
async fn a_key_ends_when_it_is_revoked_and_stays_in_the_list() {
    let server = TestServer::start().await;
    let (admin, admin_id) = key(&server, "admin", None).await;
    let (read, id) = key(&server, "read", Some(&admin)).await;
    let get = async |path: &str, key: &str| {
        with(server.client.get(server.url(path)), Some(key)).send().await.expect("an answer")
    };
    assert_eq!(get("/v1/models", &read).await.status(), 200);
    let revoke = server.client.delete(server.url(&format!("/v1/keys/{id}"))).bearer_auth(&admin).send().await;
    assert_eq!(revoke.expect("an answer").status(), 204);
    expect_problem(get("/v1/models", &read).await, 401, "unauthorized").await;
    let list = expect_json(get("/v1/keys", &admin).await, StatusCode::OK).await;
    assert_eq!((&list["items"][0]["id"], &list["items"][1]["id"]), (&json!(id), &json!(admin_id)));
    assert!(list["items"][0]["revoked_at"].is_string() && list["items"][1]["revoked_at"].is_null());
    assert!(!list.to_string().contains("visage_"), "tokens are told once");
    // the last one revoked: nobody gets in, rather than everybody
    let revoke = server.client.delete(server.url(&format!("/v1/keys/{admin_id}"))).bearer_auth(&admin).send().await;
    assert_eq!(revoke.expect("an answer").status(), 204);
    expect_problem(server.get("/v1/models").await, 401, "unauthorized").await;
}

#[tokio::test]
async fn what_a_new_key_is_asked_to_be_is_checked() {
    let server = TestServer::start().await;
    for body in [
        json!({"name": "", "scope": "read"}),
        json!({"name": "a\nb", "scope": "read"}),
        json!({"name": "a", "scope": "root"}),
        json!({"name": "a", "scope": "read", "expires_at": "tomorrow"}),
        json!({"name": "a", "scope": "read", "expires_at": "2001-01-01T00:00:00Z"}),
        json!({"name": "a", "scope": "read", "secret": "x"}),
    ] {
        expect_problem(server.post("/v1/keys", &body).await, 422, "invalid_field").await;
    }
    assert_eq!(server.get("/v1/models").await.status(), 200, "none was made");
}

/// The cookie of an answer, as a browser would send it, after a look at what the browser was told of it.
fn cookie(response: &Response) -> String {
    let cookie = response.headers()[SET_COOKIE].to_str().expect("text").to_owned();
    for part in ["HttpOnly", "SameSite=Strict", "Path=/"] {
        assert!(cookie.contains(part), "{cookie}");
    }
    cookie.split(';').next().expect("a pair").to_owned()
}

async fn signed_in(server: &TestServer, key: &str) -> String {
    let response = server.client.post(server.url("/v1/session")).bearer_auth(key).send().await.expect("an answer");
    assert_eq!(response.status(), 201);
    cookie(&response)
}

#[tokio::test]
async fn a_browser_signs_in_and_reads_events_pictures_and_files_without_the_key() {
    let server = TestServer::start().await;
    let (model, job) = server.model().await;
    let (admin, _) = key(&server, "admin", None).await;
    let (write, _) = key(&server, "write", Some(&admin)).await;
    let cookie = signed_in(&server, &write).await;
    assert!(!cookie.contains(&write), "the key is not kept by the browser");
    let get = |path: String| server.client.get(server.url(&path)).header(COOKIE, &cookie).send();
    let who = expect_json(get("/v1/session".to_owned()).await.expect("an answer"), StatusCode::OK).await;
    assert_eq!((who["scope"].as_str(), who["key"].as_str()), (Some("write"), Some("write")));
    for path in [
        format!("/v1/models/{model}"),
        format!("/v1/models/{model}/poses.json"),
        format!("/v1/models/{model}/cloud?format=ply"),
        format!("/v1/jobs/{job}"),
    ] {
        assert_eq!(get(path.clone()).await.expect("an answer").status(), 200, "{path}");
    }
    let events = get(format!("/v1/jobs/{job}/events")).await.expect("an answer");
    assert_eq!(
        (events.status().as_u16(), &events.headers()["content-type"]),
        (200, &"text/event-stream".parse().expect("a value"))
    );
    let first = events.bytes_stream().next().await.expect("an event").expect("bytes");
    assert!(first.starts_with(b"event: end"), "{first:?}");
    let form = server.client.post(server.url("/v1/scan-sets/upload")).multipart(scan_form(2)).header(COOKIE, &cookie);
    assert_eq!(form.send().await.expect("an answer").status(), 201);
    // what the key may not, the session may not
    expect_problem(get("/v1/keys".to_owned()).await.expect("an answer"), 403, "insufficient_scope").await;
}

#[tokio::test]
async fn pages_from_elsewhere_can_change_nothing_in_the_name_of_who_is_signed_in() {
    let server = TestServer::start().await;
    let (admin, _) = key(&server, "admin", None).await;
    let cookie = signed_in(&server, &admin).await;
    let post = |headers: &[(&'static str, &str)]| {
        let request =
            server.client.post(server.url("/v1/scan-sets")).json(&json!({"name": "a"})).header(COOKIE, &cookie);
        headers.iter().fold(request, |request, (name, value)| request.header(*name, *value)).send()
    };
    for headers in [
        &[("sec-fetch-site", "cross-site")][..],
        &[("sec-fetch-site", "same-site")],
        &[("origin", "https://evil.example")],
        &[("origin", "null")],
        // another program of this machine: the same site, another origin
        &[("origin", "http://localhost:1"), ("sec-fetch-site", "same-site")],
    ] {
        expect_problem(post(headers).await.expect("an answer"), 403, "foreign_origin").await;
        let out = headers
            .iter()
            .fold(server.client.delete(server.url("/v1/session")).header(COOKIE, &cookie), |request, (name, value)| {
                request.header(*name, *value)
            });
        expect_problem(out.send().await.expect("an answer"), 403, "foreign_origin").await;
    }
    let own = server.url("");
    let response = post(&[("origin", own.as_str()), ("sec-fetch-site", "same-origin")]).await.expect("an answer");
    assert_eq!(response.status(), 201);
}

#[tokio::test]
async fn signing_out_and_revoking_the_key_end_a_session() {
    let server = TestServer::start().await;
    let (admin, _) = key(&server, "admin", None).await;
    let (read, read_id) = key(&server, "read", Some(&admin)).await;
    let status = async |cookie: &str| {
        server.client.get(server.url("/v1/models")).header(COOKIE, cookie).send().await.expect("an answer").status()
    };
    let first = signed_in(&server, &read).await;
    assert_eq!(status(&first).await, 200);
    let out = server.client.delete(server.url("/v1/session")).header(COOKIE, &first).send().await.expect("an answer");
    assert_eq!(out.status(), 204);
    assert!(out.headers()[SET_COOKIE].to_str().expect("text").contains("Max-Age=0"));
    assert_eq!(status(&first).await, 401);
    let second = signed_in(&server, &read).await;
    let revoke = server.client.delete(server.url(&format!("/v1/keys/{read_id}"))).bearer_auth(&admin).send().await;
    assert_eq!(revoke.expect("an answer").status(), 204);
    assert_eq!(status(&second).await, 401);
}

#[tokio::test]
async fn signing_in_takes_a_key_and_over_tls_the_cookie_stays_there() {
    let server = TestServer::start_with(|config| {
        config.hosts = vec!["visage.example".parse().expect("a host")];
        config.open = true;
    })
    .await;
    let sign_in = || server.client.post(server.url("/v1/session"));
    expect_problem(sign_in().send().await.expect("an answer"), 401, "unauthorized").await;
    let (admin, _) = key(&server, "admin", None).await;
    let cookie = signed_in(&server, &admin).await;
    // a session begins with a key, not with another session
    expect_problem(sign_in().header(COOKIE, &cookie).send().await.expect("an answer"), 401, "unauthorized").await;
    let secure = async |origin: &str| {
        let response = sign_in().bearer_auth(&admin).header("origin", origin).send().await.expect("an answer");
        response.headers()[SET_COOKIE].to_str().expect("text").contains("; Secure")
    };
    assert!(secure("https://visage.example").await);
    assert!(!secure("http://visage.example").await);
}

#[tokio::test]
async fn a_service_that_others_reach_does_not_start_without_keys_unless_it_is_open() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let exposed = |change: fn(&mut ServerConfig)| {
        let mut config = config(folder.path());
        change(&mut config);
        Server::start(config)
    };
    let ways: [fn(&mut ServerConfig); 3] = [
        |config| config.addr = "0.0.0.0:0".parse().expect("an address"),
        |config| config.addr = "[::]:0".parse().expect("an address"),
        |config| config.hosts = vec!["visage.example".parse().expect("a host")],
    ];
    for way in ways {
        let refused = exposed(way).await.expect_err("nobody has a key").to_string();
        assert!(refused.contains("visage key create") && refused.contains("--open"), "{refused}");
    }
    let open = exposed(|config| {
        config.hosts = vec!["visage.example".parse().expect("a host")];
        config.open = true;
    });
    let open = open.await.expect("it is said to be open");
    let client = reqwest::Client::builder().no_proxy().build().expect("a client");
    let url = format!("{}/v1/keys", open.url());
    let key = client.post(&url).json(&json!({"name": "a", "scope": "admin"})).send().await.expect("an answer");
    let key: Value = expect_json(key, StatusCode::CREATED).await;
    assert_eq!(client.get(&url).send().await.expect("an answer").status(), 200, "open stays open");
    open.shutdown().await;
    let closed = exposed(|config| config.hosts = vec!["visage.example".parse().expect("a host")]).await;
    let closed = closed.expect("there is a key");
    let url = format!("{}/v1/keys", closed.url());
    assert_eq!(client.get(&url).send().await.expect("an answer").status(), 401);
    let request = client.get(&url).bearer_auth(text(&key, "/token"));
    assert_eq!(request.send().await.expect("an answer").status(), 200);
    closed.shutdown().await;
}

async fn audit(server: &TestServer, key: &str, query: &str) -> Vec<Value> {
    let request = server.client.get(server.url(&format!("/v1/audit{query}"))).bearer_auth(key);
    let list = expect_json(request.send().await.expect("an answer"), StatusCode::OK).await;
    list["items"].as_array().expect("a list").clone()
}

#[tokio::test]
async fn the_audit_log_tells_who_did_what_to_what() {
    let server = TestServer::start().await;
    let (admin, _) = key(&server, "admin", None).await;
    let (write, write_id) = key(&server, "write", Some(&admin)).await;
    let (read, read_id) = key(&server, "read", Some(&admin)).await;
    let made = server.client.post(server.url("/v1/scan-sets")).bearer_auth(&write).json(&json!({"name": "a"})).send();
    let made = made.await.expect("an answer");
    let request = made.headers()["x-request-id"].to_str().expect("text").to_owned();
    let set = text(&expect_json(made, StatusCode::CREATED).await, "/id");
    let delete = |key: &str| server.client.delete(server.url(&format!("/v1/scan-sets/{set}"))).bearer_auth(key).send();
    expect_problem(delete(&read).await.expect("an answer"), 403, "insufficient_scope").await;
    assert_eq!(delete(&write).await.expect("an answer").status(), 204);
    let of_set = audit(&server, &admin, &format!("?target={set}")).await;
    let told = |entry: &Value| {
        let field = |name: &str| entry[name].as_str().unwrap_or_default().to_owned();
        (field("key_id"), field("method"), field("route"), entry["status"].as_u64().expect("a status"))
    };
    let route = "/v1/scan-sets/{id}".to_owned();
    assert_eq!(
        of_set.iter().map(told).collect::<Vec<_>>(),
        [
            (write_id.clone(), "DELETE".into(), route.clone(), 204),
            (read_id, "DELETE".into(), route, 403),
            (write_id.clone(), "POST".into(), "/v1/scan-sets".into(), 201),
        ]
    );
    assert_eq!(of_set[2]["request"], json!(request));
    assert_eq!(audit(&server, &admin, &format!("?key_id={write_id}")).await.len(), 2);
    // strangers can't fill it, and looking is no deed
    let before = audit(&server, &admin, "").await.len();
    assert_eq!(server.delete(&format!("/v1/scan-sets/{set}")).await, StatusCode::UNAUTHORIZED);
    assert_eq!(audit(&server, &admin, "").await.len(), before);
    let all = audit(&server, &admin, "").await;
    assert!(all.iter().all(|entry| !entry.to_string().contains("visage_")), "no secrets: {all:?}");
}

#[tokio::test]
async fn a_key_that_asks_too_often_waits_and_others_do_not() {
    let server = TestServer::start_with(|config| config.quotas.requests_per_minute = Some(5)).await;
    let (admin, _) = key(&server, "admin", None).await;
    let (read, _) = key(&server, "read", Some(&admin)).await;
    let get = |key: &str| server.client.get(server.url("/v1/models")).bearer_auth(key).send();
    let mut refused = None;
    for _ in 0..20 {
        let answer = get(&read).await.expect("an answer");
        if answer.status() == StatusCode::TOO_MANY_REQUESTS {
            refused = Some(answer);
            break;
        }
    }
    let refused = refused.expect("five a minute");
    let wait: u64 = refused.headers()["retry-after"].to_str().expect("text").parse().expect("seconds");
    assert!((1..=12).contains(&wait), "{wait}");
    expect_problem(refused, 429, "rate_limited").await;
    assert_eq!(get(&admin).await.expect("an answer").status(), 200);
    assert_eq!(server.get("/healthz").await.status(), 200, "probes need no key and have no bound");
}

#[tokio::test]
async fn a_key_has_no_more_jobs_and_bytes_than_it_may() {
    use crate::common::Mode;
    let server = TestServer::start_with(|config| {
        config.quotas.queued_jobs = Some(1);
        config.quotas.stored_bytes = Some(20_000);
    })
    .await;
    server.engine.set(Mode::Slow(std::time::Duration::from_secs(60)));
    let (admin, _) = key(&server, "admin", None).await;
    let (first, _) = key(&server, "write", Some(&admin)).await;
    let (second, _) = key(&server, "write", Some(&admin)).await;
    let order =
        |key: &str| server.client.post(server.url("/v1/jobs/upload")).bearer_auth(key).multipart(scan_form(2)).send();
    let job = text(&expect_json(order(&first).await.expect("an answer"), StatusCode::ACCEPTED).await, "/id");
    let refused = order(&first).await.expect("an answer");
    assert!(refused.headers().contains_key("retry-after"));
    expect_problem(refused, 429, "quota_exceeded").await;
    expect_json(order(&second).await.expect("an answer"), StatusCode::ACCEPTED).await;
    let cancel = server.client.post(server.url(&format!("/v1/jobs/{job}/cancel"))).bearer_auth(&first).send().await;
    assert_eq!(cancel.expect("an answer").status(), 202);
    let job = format!("/v1/jobs/{job}?wait=20");
    server.client.get(server.url(&job)).bearer_auth(&first).send().await.expect("it has ended");
    let upload =
        || server.client.post(server.url("/v1/scan-sets/upload")).bearer_auth(&first).multipart(scan_form(2)).send();
    let mut sets = Vec::new();
    let refused = loop {
        let answer = upload().await.expect("an answer");
        if answer.status() != StatusCode::CREATED {
            break answer;
        }
        sets.push(text(&expect_json(answer, StatusCode::CREATED).await, "/id"));
        assert!(sets.len() < 20, "20 kB are full some time");
    };
    expect_problem(refused, 429, "quota_exceeded").await;
    let delete =
        server.client.delete(server.url(&format!("/v1/scan-sets/{}", sets[0]))).bearer_auth(&first).send().await;
    assert_eq!(delete.expect("an answer").status(), 204);
    assert_eq!(upload().await.expect("an answer").status(), 201, "there is room again");
    let noted = audit(&server, &admin, "?limit=100").await;
    assert!(noted.iter().all(|entry| entry["status"] != 429), "a quota does not fill the log: {noted:?}");
}
