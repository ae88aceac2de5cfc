//! Webhooks: who is told what, how it is signed, and what becomes of what nobody takes.

use std::time::Duration;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use reqwest::StatusCode;
use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use visage::config::ServerConfig;

use crate::common::receiver::{Message, Receiver};
use crate::common::{TestServer, expect_json, expect_problem, text};

const ALL: [&str; 5] = ["job.succeeded", "job.failed", "job.canceled", "model.added", "model.deleted"];

/// This machine may be told, and what fails is sent again soon, so many times.
fn quick(times: usize) -> impl FnOnce(&mut ServerConfig) {
    move |config| {
        config.webhooks.networks = vec!["127.0.0.0/8".parse().expect("a network")];
        config.webhooks.pauses = vec![Duration::from_millis(10); times];
    }
}

async fn hook(server: &TestServer, url: &str, events: &[&str]) -> Value {
    let made = server.post("/v1/webhooks", &json!({"name": "a test", "url": url, "events": events})).await;
    assert_eq!(made.headers()["cache-control"], "no-store");
    expect_json(made, StatusCode::CREATED).await
}

async fn deliveries(server: &TestServer, hook: &str, status: &str) -> Vec<Value> {
    let list = server.get(&format!("/v1/webhooks/{hook}/deliveries?status={status}")).await;
    expect_json(list, StatusCode::OK).await["items"].as_array().expect("a list").clone()
}

/// Waits until so many messages stand there.
async fn until(server: &TestServer, hook: &str, status: &str, count: usize) -> Vec<Value> {
    until_so(server, hook, status, |found| found.len() == count).await
}

/// Waits until the messages of a status are so: looks again whenever one has changed.
async fn until_so(server: &TestServer, hook: &str, status: &str, is_so: impl Fn(&[Value]) -> bool) -> Vec<Value> {
    let mut changes = server.handle.changes();
    loop {
        // what changes after the look rings again
        changes.mark_unchanged();
        let found = deliveries(server, hook, status).await;
        if is_so(&found) {
            return found;
        }
        changes.changed().await.expect("the server runs");
    }
}

/// HMAC-SHA-256 (RFC 2104), written out: what the receiver computes does not come from what the service uses.
fn signature(secret: &str, message: &Message) -> String {
    let mut key = STANDARD.decode(secret.strip_prefix("whsec_").expect("the prefix")).expect("base64");
    key.resize(64, 0);
    let padded = |with: u8| key.iter().map(|byte| byte ^ with).collect::<Vec<u8>>();
    let (id, time) = (message.header("webhook-id"), message.header("webhook-timestamp"));
    let content = format!("{id}.{time}.{}", message.body);
    let inner = Sha256::digest([padded(0x36), content.into_bytes()].concat());
    format!("v1,{}", STANDARD.encode(Sha256::digest([padded(0x5c), inner.to_vec()].concat())))
}

#[tokio::test]
async fn jobs_and_models_are_told_with_a_signature_and_without_names() {
    let server = TestServer::start_with(quick(0)).await;
    let mut receiver = Receiver::start(&[]).await;
    let made = hook(&server, &receiver.url(), &ALL).await;
    let (model, job) = server.model().await;
    let [added, ended] = [receiver.message().await, receiver.message().await];
    assert_eq!([added.kind(), ended.kind()], ["model.added", "job.succeeded"]);
    for message in [&added, &ended] {
        assert_eq!(message.header("webhook-signature"), signature(&text(&made, "/secret"), message));
        assert_eq!(message.header("content-type"), "application/json");
    }
    let data: Value = serde_json::from_str(&ended.body).expect("JSON");
    assert_eq!(data["data"], json!({"job_id": job, "kind": "register", "model_id": model}));
    assert_eq!(server.delete(&format!("/v1/jobs/{job}")).await, StatusCode::NO_CONTENT);
    assert_eq!(receiver.message().await.kind(), "model.deleted");
    let id = text(&made, "/id");
    until(&server, &id, "delivered", 3).await;
    let shown = expect_json(server.get(&format!("/v1/webhooks/{id}")).await, StatusCode::OK).await;
    assert!(shown["secret"].is_null() && shown["pending"] == 0 && shown["dead"] == 0, "{shown}");
    let metrics = server.get("/metrics").await.text().await.expect("text");
    assert!(metrics.contains("visage_webhook_attempts_total{end=\"delivered\"} 3"), "{metrics}");
}

#[tokio::test]
async fn a_canceled_job_is_told_and_other_kinds_are_not() {
    let server = TestServer::start_with(|config| {
        quick(0)(config);
        config.concurrent_jobs = 1;
    })
    .await;
    let mut receiver = Receiver::start(&[]).await;
    hook(&server, &receiver.url(), &["job.canceled", "job.failed"]).await;
    server.engine.set(crate::common::Mode::Refuse);
    let failing = server.job().await;
    assert_eq!(receiver.message().await.kind(), "job.failed");
    server.engine.set(crate::common::Mode::Slow(Duration::from_secs(600)));
    let (running, waiting) = (server.job().await, server.job().await);
    server.until(&running, "running").await;
    for job in [&waiting, &running] {
        server.post(&format!("/v1/jobs/{job}/cancel"), &json!({})).await;
        let message = receiver.message().await;
        assert!(message.kind() == "job.canceled" && message.body.contains(job.as_str()), "{message:?}");
    }
    assert_eq!(server.delete(&format!("/v1/jobs/{failing}")).await, StatusCode::NO_CONTENT);
}

#[tokio::test]
async fn what_nobody_takes_is_dead_until_it_is_replayed() {
    let server = TestServer::start_with(quick(2)).await;
    let mut receiver = Receiver::start(&[500, 302, 429]).await;
    let id = text(&hook(&server, &receiver.url(), &["model.deleted"]).await, "/id");
    let ping =
        expect_json(server.post(&format!("/v1/webhooks/{id}/ping"), &json!({})).await, StatusCode::ACCEPTED).await;
    let dead = until(&server, &id, "dead", 1).await;
    assert_eq!((&dead[0]["id"], &dead[0]["attempts"], &dead[0]["answer"]), (&ping["id"], &json!(3), &json!(429)));
    let sent: Vec<Message> = [receiver.message().await, receiver.message().await, receiver.message().await].into();
    assert!(sent.iter().all(|message| message.header("webhook-id") == text(&ping, "/id")));
    let again = server.post(&format!("/v1/webhooks/{id}/replay"), &json!({})).await;
    assert_eq!(expect_json(again, StatusCode::ACCEPTED).await["replayed"], 1);
    assert_eq!(receiver.message().await.header("webhook-id"), text(&ping, "/id"));
    until(&server, &id, "delivered", 1).await;
    let path = format!("/v1/webhooks/{id}/deliveries/{}/replay", text(&ping, "/id"));
    expect_json(server.post(&path, &json!({})).await, StatusCode::ACCEPTED).await;
    receiver.message().await;
    let other = format!("/v1/webhooks/{id}/deliveries/{id}/replay");
    expect_problem(server.post(&other, &json!({})).await, 404, "not_found").await;
}

#[tokio::test]
async fn a_receiver_that_was_down_gets_what_it_missed() {
    let server = TestServer::start_with(quick(10_000)).await;
    let receiver = Receiver::start(&[]).await;
    let (addr, url) = (receiver.addr, receiver.url());
    drop(receiver);
    let id = text(&hook(&server, &url, &["model.added"]).await, "/id");
    let (model, _) = server.model().await;
    until_so(&server, &id, "pending", |found| found.first().is_some_and(|one| one["attempts"] != 0)).await;
    let mut receiver = Receiver::start_at(addr, &[]).await;
    assert!(receiver.message().await.body.contains(&model));
    until(&server, &id, "delivered", 1).await;
}

#[tokio::test]
async fn what_was_being_sent_at_a_crash_is_sent_after_it() {
    let server = TestServer::start_with(quick(0)).await;
    // the first is never answered
    let mut receiver = Receiver::start(&[0]).await;
    let id = text(&hook(&server, &receiver.url(), &["model.added"]).await, "/id");
    server.model().await;
    let first = receiver.message().await;
    let TestServer { folder, handle, .. } = server;
    handle.abort().await;
    let server = TestServer::start_on(folder, quick(0)).await;
    let second = receiver.message().await;
    assert_eq!((first.header("webhook-id"), &first.body), (second.header("webhook-id"), &second.body));
    until(&server, &id, "delivered", 1).await;
}

#[tokio::test]
async fn a_webhook_goes_with_the_key_that_made_it() {
    let server = TestServer::start_with(quick(0)).await;
    let mut keys = Vec::new();
    for name in ["first", "second"] {
        let by = keys.first().map(|key| text(key, "/token"));
        let request = server.client.post(server.url("/v1/keys")).json(&json!({"name": name, "scope": "admin"}));
        let request = by.iter().fold(request, |request, key| request.bearer_auth(key));
        keys.push(expect_json(request.send().await.expect("an answer"), StatusCode::CREATED).await);
    }
    let [first, second] = [text(&keys[0], "/token"), text(&keys[1], "/token")];
    let body = json!({"name": "n", "url": "http://127.0.0.1:9/", "events": ["job.failed"]});
    let made = server.client.post(server.url("/v1/webhooks")).json(&body).bearer_auth(&second).send().await;
    let made = expect_json(made.expect("an answer"), StatusCode::CREATED).await;
    assert_eq!(made["key_id"], keys[1]["id"]);
    let count = async || {
        let list = server.client.get(server.url("/v1/webhooks")).bearer_auth(&first).send().await;
        expect_json(list.expect("an answer"), StatusCode::OK).await["items"].as_array().expect("a list").len()
    };
    assert_eq!(count().await, 1);
    let revoked = server.client.delete(server.url(&format!("/v1/keys/{}", text(&keys[1], "/id"))));
    assert_eq!(revoked.bearer_auth(&first).send().await.expect("an answer").status(), StatusCode::NO_CONTENT);
    assert_eq!(count().await, 0);
}

#[tokio::test]
async fn nobody_is_told_where_the_operator_has_not_allowed_it() {
    let server = TestServer::start().await;
    let make = async |url: &str, events: Value| {
        server.post("/v1/webhooks", &json!({"name": "n", "url": url, "events": events})).await
    };
    for url in [
        "http://127.0.0.1:1/",
        "https://127.0.0.1/",
        "https://[::1]/",
        "https://[::ffff:10.0.0.1]/",
        "https://169.254.169.254/latest/meta-data",
        "http://a.example/",
    ] {
        expect_problem(make(url, json!(["job.failed"])).await, 422, "forbidden_address").await;
    }
    for url in ["", "ftp://a.example/", "https://user@a.example/", "https://a.example/#x", "https://2130706433/"] {
        expect_problem(make(url, json!(["job.failed"])).await, 422, "invalid_field").await;
    }
    for events in [json!([]), json!(["job.begun"]), json!("job.failed"), Value::Null] {
        expect_problem(make("https://a.example/", events).await, 422, "invalid_field").await;
    }
}

#[tokio::test]
async fn there_are_not_more_webhooks_than_are_served() {
    let server = TestServer::start_with(quick(0)).await;
    let body = json!({"name": "n", "url": "http://127.0.0.1:9/", "events": ["job.failed"]});
    for _ in 0..32 {
        expect_json(server.post("/v1/webhooks", &body).await, StatusCode::CREATED).await;
    }
    expect_problem(server.post("/v1/webhooks", &body).await, 422, "too_many_webhooks").await;
    let list = expect_json(server.get("/v1/webhooks?limit=1").await, StatusCode::OK).await;
    let path = text(&list, "/items/0/href");
    assert_eq!(server.delete(&path).await, StatusCode::NO_CONTENT);
    assert_eq!(server.delete(&path).await, StatusCode::NOT_FOUND);
    expect_json(server.post("/v1/webhooks", &body).await, StatusCode::CREATED).await;
}
