//! The real binary under pressure: its log, thousands of connections that say nothing, no descriptors left.
#![cfg(target_os = "linux")]

use std::fs::File;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::binary::Process;
use crate::common::{expect_json, expect_problem, scan_form, text};
use reqwest::{Client, StatusCode};
use serde_json::{Value, json};
use tokio::io::AsyncReadExt;
use tokio::net::TcpStream;

const PATIENCE: Duration = Duration::from_secs(60);

/// A server whose log can be read.
fn start(folder: &Path, arguments: &[&str]) -> Process {
    let log = File::create(folder.join("log")).expect("a file");
    Process::start_with(&folder.join("data"), arguments, Stdio::from(log))
}

/// The first line of the log that holds all of these words, as soon as there is one.
async fn logged(folder: &Path, words: &[&str]) -> Value {
    let begin = Instant::now();
    loop {
        let log = std::fs::read_to_string(folder.join("log")).expect("a log");
        if let Some(line) = log.lines().find(|line| words.iter().all(|word| line.contains(word))) {
            return serde_json::from_str(line).expect("JSON");
        }
        assert!(begin.elapsed() < PATIENCE, "{words:?} is not in the log: {log}");
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
}

#[tokio::test]
async fn the_log_has_a_line_for_each_request_but_no_more_than_is_promised() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let server = start(folder.path(), &["--host", "visage.example", "--open"]);
    let response = reqwest::get(format!("{}/v1/models/nothing?label=secret", server.url)).await.expect("an answer");
    let id = response.headers()["x-request-id"].to_str().expect("text").to_owned();
    let line = logged(folder.path(), &[&id, "answered"]).await;
    assert_eq!((line["level"].as_str(), line["status"].as_u64()), (Some("INFO"), Some(404)), "{line}");
    assert!(line["ms"].is_u64(), "{line}");
    let span = &line["span"];
    assert_eq!((span["method"].as_str(), span["path"].as_str()), (Some("GET"), Some("/v1/models/nothing")), "{line}");
    // signs of life are asked for all the time
    reqwest::get(format!("{}/healthz", server.url)).await.expect("an answer");
    let refused = Client::new().get(format!("{}/healthz", server.url)).header("host", "evil.example").send().await;
    expect_problem(refused.expect("an answer"), 403, "foreign_host").await;
    logged(folder.path(), &["/healthz", "403"]).await;
    let log = std::fs::read_to_string(folder.path().join("log")).expect("a log");
    assert!(!log.contains("secret") && !log.contains("\"status\":200"), "{log}");
}

#[tokio::test]
async fn fifteen_hundred_half_heads_are_gone_in_time() {
    use nix::sys::resource::{Resource, getrlimit, setrlimit};
    let (_, most) = getrlimit(Resource::RLIMIT_NOFILE).expect("a limit");
    setrlimit(Resource::RLIMIT_NOFILE, most.min(8192), most).expect("as many descriptors as are allowed");
    let folder = tempfile::tempdir().expect("a temporary folder");
    let server = start(folder.path(), &["--head-seconds", "1", "--max-connections", "200"]);
    let addr = server.url.strip_prefix("http://").expect("a URL").to_owned();
    let half = || async {
        let mut stream = TcpStream::connect(&addr).await.expect("a connection");
        tokio::io::AsyncWriteExt::write_all(&mut stream, b"GET / HTTP/1.1\r\nX: ").await.expect("sent");
        // ends when the server closes it
        let mut rest = Vec::new();
        let _ = stream.read_to_end(&mut rest).await;
    };
    let all = futures_util::future::join_all((0..1500).map(|_| half()));
    let descriptors = std::fs::read_dir(format!("/proc/{}/fd", server.child.id())).expect("a process").count();
    assert!(descriptors < 300, "{descriptors}");
    tokio::time::timeout(PATIENCE * 2, all).await.expect("all of them are closed");
    let health = reqwest::get(format!("{}/healthz", server.url)).await.expect("an answer");
    assert_eq!(health.status(), StatusCode::OK);
}

/// Sets how many descriptors the server may have from now on; those that it has stay.
fn limit_descriptors(server: &Process, soft: u64) {
    let pid = server.child.id().to_string();
    let limited = Command::new("prlimit").args(["--pid", &pid, &format!("--nofile={soft}:")]).status();
    assert!(limited.expect("prlimit is part of util-linux").success());
}

#[tokio::test]
async fn without_descriptors_jobs_wait_and_requests_are_told_to() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let server = start(folder.path(), &["--max-connections", "4"]);
    // one connection, opened before
    let client = Client::builder().no_proxy().pool_max_idle_per_host(1).timeout(PATIENCE).build().expect("a client");
    let url = |path: &str| format!("{}{path}", server.url);
    let set = client.post(url("/v1/scan-sets")).multipart(scan_form(3)).send().await.expect("an answer");
    let set = text(&expect_json(set, StatusCode::CREATED).await, "/id");
    let post =
        |options: Value| client.post(url("/v1/jobs")).json(&json!({"scan_set_id": set, "options": options})).send();
    // a first one opens whatever the server opens once
    let first = expect_json(post(json!({"signature": false})).await.expect("an answer"), StatusCode::ACCEPTED).await;
    let ended = client.get(url(&format!("/v1/jobs/{}?wait=60", text(&first, "/id")))).send().await.expect("an answer");
    expect_json(ended, StatusCode::OK).await;
    limit_descriptors(&server, 4);
    let put = client.put(url(&format!("/v1/scan-sets/{set}/scans/d.ply"))).body("ply").send().await.expect("an answer");
    let busy = put.status();
    if busy == StatusCode::SERVICE_UNAVAILABLE {
        assert!(put.headers().contains_key("retry-after"));
        expect_problem(put, 503, "overloaded").await;
    } else {
        panic!("{busy}: {}", put.text().await.expect("a body"));
    }
    let job = expect_json(post(json!({"signature": false})).await.expect("an answer"), StatusCode::ACCEPTED).await;
    logged(folder.path(), &["the job waits"]).await;
    // a new connection is not accepted now, but when there are descriptors again
    let other = tokio::spawn(reqwest::get(url("/healthz")));
    logged(folder.path(), &["connections can't be accepted"]).await;
    limit_descriptors(&server, 256);
    assert_eq!(other.await.expect("not aborted").expect("an answer").status(), StatusCode::OK);
    let ended = client.get(url(&format!("/v1/jobs/{}?wait=60", text(&job, "/id")))).send().await.expect("an answer");
    let ended = expect_json(ended, StatusCode::OK).await;
    let first = client.get(url(&format!("/v1/jobs/{}", text(&first, "/id")))).send().await.expect("an answer");
    let first = expect_json(first, StatusCode::OK).await;
    assert_eq!((&ended["status"], &ended["attempts"]), (&first["status"], &json!(1)), "{ended}");
}
