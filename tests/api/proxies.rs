//! Behind a proxy: below a path, and with what trusted proxies tell of the client.

use futures_util::StreamExt;
use reqwest::header::{LOCATION, SET_COOKIE};
use reqwest::{RequestBuilder, StatusCode};
use serde_json::{Value, json};
use visage::config::ServerConfig;

use crate::common::{Mode, TestServer, expect_json, expect_problem, scan_form, text};

fn trusting(config: &mut ServerConfig) {
    config.trusted_proxies = vec!["127.0.0.1".parse().expect("a network")];
    config.hosts = vec!["visage.example".parse().expect("a name")];
    config.open = true;
}

fn below(config: &mut ServerConfig) {
    config.base_path = "/visage".parse().expect("a path");
}

async fn sent(request: RequestBuilder) -> reqwest::Response {
    request.send().await.expect("an answer")
}

#[tokio::test]
async fn below_a_path_every_address_has_it() {
    let server = TestServer::start_with(below).await;
    let made = server.post_form("/visage/v1/scan-sets/upload", scan_form(3)).await;
    let location = made.headers()[LOCATION].to_str().expect("text").to_owned();
    let set = expect_json(made, StatusCode::CREATED).await;
    assert_eq!(location, format!("/visage/v1/scan-sets/{}", text(&set, "/id")));
    for link in ["self", "poses", "jobs"] {
        assert!(text(&set, &format!("/links/{link}")).starts_with("/visage/v1/"), "{set}");
    }
    // a repeated request gets the same, and so does one whose proxy has taken the path off
    let ordered = async |path: &str| {
        let body = json!({"scan_set_id": set["id"]});
        let response = sent(server.client.post(server.url(path)).json(&body).header("idempotency-key", "k")).await;
        let location = response.headers()[LOCATION].to_str().expect("text").to_owned();
        (location, expect_json(response, StatusCode::ACCEPTED).await)
    };
    let first = ordered("/visage/v1/jobs").await;
    assert!(first.0.starts_with("/visage/v1/jobs/"), "{first:?}");
    assert_eq!(ordered("/v1/jobs").await, first);
    let job = expect_json(server.get(&format!("{}?wait=20", first.0)).await, StatusCode::OK).await;
    let events = server.get(&text(&job, "/links/events")).await.text().await.expect("events");
    let end = events.lines().filter_map(|line| line.strip_prefix("data: ")).next_back().expect("an event");
    let end: Value = serde_json::from_str(end).expect("JSON");
    assert!(text(&end, "/links/self").starts_with("/visage/v1/jobs/"), "{end}");
    let model = expect_json(server.get(&text(&job, "/links/model")).await, StatusCode::OK).await;
    assert!(text(&model, "/href").starts_with("/visage/v1/models/"), "{model}");
    assert_eq!(server.get(&text(&model, "/assets/0/href")).await.status(), 200);
    for path in ["/visage/healthz", "/healthz", "/visage/", "/visage/openapi.yaml"] {
        assert_eq!(server.get(path).await.status(), 200, "{path}");
    }
    let contract = expect_json(server.get("/visage/openapi.json").await, StatusCode::OK).await;
    assert_eq!(contract["servers"], json!([{"url": "/visage"}]));
    let key = json!({"name": "k", "scope": "admin"});
    let key = expect_json(server.post("/visage/v1/keys", &key).await, StatusCode::CREATED).await;
    let begun = server.client.post(server.url("/visage/v1/session")).bearer_auth(text(&key, "/token"));
    let cookie = sent(begun).await.headers()[SET_COOKIE].to_str().expect("text").to_owned();
    assert!(cookie.contains("; Path=/visage;") && !cookie.contains("Secure"), "{cookie}");
    expect_problem(server.get("/visage/v1/models").await, 401, "unauthorized").await;
}

#[tokio::test]
async fn what_a_trusted_proxy_tells_counts_and_what_others_tell_does_not() {
    for is_trusted in [true, false] {
        let server = TestServer::start_with(|config| {
            trusting(config);
            if !is_trusted {
                config.trusted_proxies.clear();
            }
        })
        .await;
        let forwarded = |request: RequestBuilder, host: &str| {
            let value = format!("for=7.7.7.7;proto=https;host=evil.example, for=1.2.3.4;proto=https;host={host}");
            request.header("forwarded", value)
        };
        let made = server.client.post(server.url("/v1/scan-sets")).json(&json!({}));
        let made = sent(forwarded(made, "visage.example").header("origin", "https://visage.example")).await;
        let set = text(&expect_json(made, StatusCode::CREATED).await, "/id");
        let log = expect_json(server.get(&format!("/v1/audit?target={set}")).await, StatusCode::OK).await;
        let client = if is_trusted { "1.2.3.4" } else { "127.0.0.1" };
        assert_eq!(log["items"][0]["client"], client, "{log}");
        // the name that the client has called has to be ours, as without a proxy
        let asked = sent(forwarded(server.client.get(server.url("/v1/models")), "evil.example")).await;
        match is_trusted {
            true => drop(expect_problem(asked, 403, "foreign_host").await),
            false => assert_eq!(asked.status(), 200),
        }
        let key =
            expect_json(server.post("/v1/keys", &json!({"name": "k", "scope": "read"})).await, StatusCode::CREATED);
        let begun = server.client.post(server.url("/v1/session")).bearer_auth(text(&key.await, "/token"));
        let begun = sent(forwarded(begun, "visage.example")).await;
        let cookie = begun.headers()[SET_COOKIE].to_str().expect("text").to_owned();
        assert_eq!(cookie.ends_with("; Secure"), is_trusted, "{cookie}");
    }
}

#[tokio::test]
async fn each_client_behind_a_trusted_proxy_has_its_own_rate() {
    let server = TestServer::start_with(|config| {
        trusting(config);
        config.quotas.requests_per_minute = Some(2);
    })
    .await;
    let ask = async |client: &str| {
        sent(server.client.get(server.url("/v1/models")).header("x-forwarded-for", format!("9.9.9.9, {client}"))).await
    };
    for client in ["1.1.1.1", "2.2.2.2"] {
        for _ in 0..2 {
            assert_eq!(ask(client).await.status(), 200);
        }
        expect_problem(ask(client).await, 429, "rate_limited").await;
    }
}

#[tokio::test]
async fn a_stream_of_events_ends_when_its_key_is_revoked_or_its_session_ends() {
    let server = TestServer::start().await;
    let admin = json!({"name": "admin", "scope": "admin"});
    let admin = text(&expect_json(server.post("/v1/keys", &admin).await, StatusCode::CREATED).await, "/token");
    let with = |request: RequestBuilder| request.bearer_auth(&admin);
    let reader =
        sent(with(server.client.post(server.url("/v1/keys"))).json(&json!({"name": "r", "scope": "read"}))).await;
    let reader = expect_json(reader, StatusCode::CREATED).await;
    let (token, id) = (text(&reader, "/token"), text(&reader, "/id"));
    let session = sent(server.client.post(server.url("/v1/session")).bearer_auth(&admin)).await;
    let cookie = session.headers()[SET_COOKIE].to_str().expect("text").split(';').next().expect("a pair").to_owned();

    server.engine.set(Mode::Slow(std::time::Duration::from_secs(600)));
    let job = sent(with(server.client.post(server.url("/v1/jobs/upload"))).multipart(scan_form(2))).await;
    let job = text(&expect_json(job, StatusCode::ACCEPTED).await, "/id");
    let events = server.url(&format!("/v1/jobs/{job}/events"));
    let by_key = sent(server.client.get(&events).bearer_auth(&token)).await;
    let by_session = sent(server.client.get(&events).header("cookie", &cookie)).await;
    let by_admin = sent(with(server.client.get(&events))).await;
    assert_eq!([&by_key, &by_session, &by_admin].map(|answer| answer.status().as_u16()), [200; 3]);

    let ended = async |answer: reqwest::Response| {
        let rest = answer.text().await.expect("events until it ends");
        assert!(rest.contains("event: progress") && !rest.contains("event: end"), "{rest}");
    };
    assert_eq!(sent(with(server.client.delete(server.url(&format!("/v1/keys/{id}"))))).await.status(), 204);
    ended(by_key).await;
    let out = server.client.delete(server.url("/v1/session")).header("cookie", &cookie);
    assert_eq!(sent(out).await.status(), 204);
    ended(by_session).await;
    // whose key is valid goes on
    assert!(by_admin.bytes_stream().next().await.is_some());
}
