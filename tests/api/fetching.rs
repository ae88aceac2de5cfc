//! Scans that the service fetches itself: from where, and what becomes of answers that are none.

use std::net::SocketAddr;

use reqwest::StatusCode;
use serde_json::json;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpListener;
use tokio::sync::mpsc;
use tokio::task::JoinHandle;

use crate::common::files::ply;
use crate::common::{TestServer, expect_json, expect_problem, text};

/// Answers every request with the same bytes, and says what it was asked; gone when this is dropped.
struct Source {
    addr: SocketAddr,
    asked: mpsc::UnboundedReceiver<String>,
    serving: JoinHandle<()>,
}

impl Drop for Source {
    fn drop(&mut self) {
        self.serving.abort();
    }
}

impl Source {
    /// `stays` if the connection is held open after the answer.
    async fn start(answer: Vec<u8>, stays: bool) -> Source {
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
        let addr = listener.local_addr().expect("an address");
        let (tell, asked) = mpsc::unbounded_channel();
        let serving = tokio::spawn(async move {
            let mut open = Vec::new();
            while let Ok((mut stream, _)) = listener.accept().await {
                let mut head = Vec::new();
                while !head.ends_with(b"\r\n\r\n") {
                    match stream.read_u8().await {
                        Ok(byte) => head.push(byte),
                        Err(_) => break,
                    }
                }
                let _ = tell.send(String::from_utf8_lossy(&head).into_owned());
                let _ = stream.write_all(&answer).await;
                if stays {
                    open.push(stream);
                }
            }
        });
        Source { addr, asked, serving }
    }

    /// A file with further headers.
    async fn of(file: &[u8], headers: &str) -> Source {
        let head = format!("HTTP/1.1 200 OK\r\ncontent-length: {}\r\n{headers}\r\n", file.len());
        Source::start([head.as_bytes(), file].concat(), false).await
    }

    async fn server(&self) -> TestServer {
        let source = format!("http://{}/scans/", self.addr).parse().expect("a place");
        TestServer::start_with(|config| {
            config.fetch_from = vec![source];
            config.edge.body_stall = std::time::Duration::from_millis(300);
            config.limits.file_bytes = 100_000;
        })
        .await
    }
}

async fn empty_set(server: &TestServer) -> String {
    text(&expect_json(server.post("/v1/scan-sets", &json!({"name": "a test"})).await, StatusCode::CREATED).await, "/id")
}

async fn fetched(server: &TestServer, set: &str, name: &str, url: &str) -> reqwest::Response {
    let client = reqwest::Client::new();
    let place = server.url(&format!("/v1/scan-sets/{set}/scans/{name}/source"));
    client.put(place).json(&json!({"url": url})).send().await.expect("an answer")
}

#[tokio::test]
async fn a_scan_is_fetched_and_is_then_as_one_that_was_sent() {
    let file = ply(40);
    let mut source = Source::of(&file, "content-type: application/octet-stream\r\n").await;
    let server = source.server().await;
    let set = empty_set(&server).await;
    let url = format!("http://{}/scans/a.ply?signature=x%2Fy", source.addr);
    let made = fetched(&server, &set, "first.ply", &url).await;
    let etag = made.headers()["etag"].clone();
    let scan = expect_json(made, StatusCode::CREATED).await;
    assert_eq!((text(&scan, "/name"), scan["points"].as_u64()), ("first.ply".to_owned(), Some(40)));
    let asked = source.asked.recv().await.expect("a request").to_ascii_lowercase();
    assert!(asked.starts_with("get /scans/a.ply?signature=x%2fy http/1.1\r\n"), "{asked}");
    assert!(asked.contains("accept-encoding: identity\r\n") && !asked.contains("authorization"), "{asked}");
    // once more it replaces itself; sent by hand it is the same
    assert_eq!(fetched(&server, &set, "first.ply", &url).await.status(), StatusCode::OK);
    let sent = server.put(&format!("/v1/scan-sets/{set}/scans/second.ply"), file).await;
    assert_eq!(sent.headers()["etag"], etag);
    let info = expect_json(server.get("/v1/info").await, StatusCode::OK).await;
    assert_eq!(info["limits"]["fetch_from"], json!([format!("http://{}/scans/", source.addr)]));
}

#[tokio::test]
async fn from_where_the_operator_has_not_said_nothing_is_asked() {
    let mut source = Source::of(&ply(40), "").await;
    let server = source.server().await;
    let set = empty_set(&server).await;
    for url in [
        format!("http://{}/private/a.ply", source.addr),
        format!("http://{}/scans/../private/a.ply", source.addr),
        format!("http://{}/scans/%2e%2e/private/a.ply", source.addr),
        format!("https://{}/scans/a.ply", source.addr),
        format!("http://localhost:{}/scans/a.ply", source.addr.port()),
        "http://169.254.169.254/latest/meta-data".to_owned(),
    ] {
        let refused = expect_problem(fetched(&server, &set, "a.ply", &url).await, 422, "forbidden_address").await;
        assert!(text(&refused, "/hint").contains("--fetch-from"), "{refused}");
    }
    for url in ["file:///etc/passwd", "a.ply", "http://user:pass@127.0.0.1/scans/a.ply"] {
        expect_problem(fetched(&server, &set, "a.ply", url).await, 422, "invalid_field").await;
    }
    assert!(source.asked.try_recv().is_err(), "it was asked");
    // as it comes the service fetches nothing
    let server = TestServer::start().await;
    let set = empty_set(&server).await;
    let url = format!("http://{}/scans/a.ply", source.addr);
    expect_problem(fetched(&server, &set, "a.ply", &url).await, 422, "forbidden_address").await;
    assert!(source.asked.try_recv().is_err(), "it was asked");
}

#[tokio::test]
async fn what_is_no_file_is_refused_with_what_was_answered() {
    let file = String::from_utf8_lossy(&ply(40)).into_owned();
    let whole = format!("content-length: {}\r\n", file.len());
    let long = "HTTP/1.1 200 OK\r\ncontent-length: 100001\r\n\r\n".to_owned();
    let endless = format!("HTTP/1.1 200 OK\r\n\r\n{}", "x".repeat(200_000));
    let digest = "content-digest: sha-256=:47DEQpj8HBSa+/TImW+5JCeuQeRkm5NMpJWZG3hSuFU=:\r\n";
    for (answer, stays, status, code, part) in [
        ("HTTP/1.1 404 Not Found\r\ncontent-length: 0\r\n\r\n".to_owned(), false, 502, "fetch_failed", "404"),
        (
            "HTTP/1.1 302 Found\r\nlocation: /b.ply\r\ncontent-length: 0\r\n\r\n".to_owned(),
            false,
            502,
            "fetch_failed",
            "redirects",
        ),
        (
            format!("HTTP/1.1 200 OK\r\ncontent-encoding: gzip\r\n{whole}\r\n{file}"),
            false,
            502,
            "fetch_failed",
            "packed",
        ),
        (format!("HTTP/1.1 200 OK\r\ncontent-length: 9999\r\n\r\n{file}"), false, 502, "fetch_failed", "to its end"),
        (format!("HTTP/1.1 200 OK\r\ncontent-length: 9999\r\n\r\n{file}"), true, 502, "fetch_failed", "arrived"),
        ("SSH-2.0-x\r\n".to_owned(), false, 502, "fetch_failed", "no answer"),
        (String::new(), true, 502, "fetch_failed", "in time"),
        (long, true, 413, "too_large", "100000"),
        (endless, true, 413, "too_large", "100000"),
        (format!("HTTP/1.1 200 OK\r\n{digest}{whole}\r\n{file}"), false, 400, "digest_mismatch", "a.ply"),
        ("HTTP/1.1 200 OK\r\ncontent-length: 5\r\n\r\nhello".to_owned(), false, 422, "unreadable_scan", "a.ply"),
    ] {
        let source = Source::start(answer.clone().into_bytes(), stays).await;
        let server = source.server().await;
        let set = empty_set(&server).await;
        let url = format!("http://{}/scans/a.ply?secret", source.addr);
        let refused = expect_problem(fetched(&server, &set, "a.ply", &url).await, status, code).await;
        let detail = text(&refused, "/detail");
        assert!(detail.contains(part) && !detail.contains("secret"), "{answer:.60}: {detail}");
        // nothing of it is kept
        let kept = expect_json(server.get(&format!("/v1/scan-sets/{set}")).await, StatusCode::OK).await;
        assert_eq!(kept["scans"], json!([]));
        assert_eq!(server.files("staging"), 0);
    }
}

/// What a key may upload at a time counts for what is fetched, too.
#[tokio::test]
async fn what_is_fetched_counts_as_an_upload() {
    let mut source = Source::start(b"HTTP/1.1 200 OK\r\ncontent-length: 9999\r\n\r\n".to_vec(), true).await;
    let place = format!("http://{}/", source.addr).parse().expect("a place");
    let server = TestServer::start_with(|config| {
        config.fetch_from = vec![place];
        config.quotas.uploads = Some(1);
    })
    .await;
    let set = empty_set(&server).await;
    let url = format!("http://{}/a.ply", source.addr);
    let held = fetched(&server, &set, "a.ply", &url);
    tokio::pin!(held);
    tokio::select! {
        answer = &mut held => panic!("{answer:?}"),
        asked = source.asked.recv() => assert!(asked.is_some()),
    }
    // the first one waits for its file
    expect_problem(fetched(&server, &set, "b.ply", &url).await, 429, "rate_limited").await;
}
