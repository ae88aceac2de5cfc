//! Models that are described while their clients wait: nobody blocks all others, and who leaves is worked for no longer.

use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use crate::common::raw::Raw;
use crate::common::{Mode, TestServer, files};
use reqwest::multipart::{Form, Part};
use reqwest::{Response, StatusCode};

const LONG: Duration = Duration::from_secs(600);

/// A model that is described in no time, or can't be, with so many bytes that say nothing.
fn model(padding: usize) -> Form {
    let small = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
    let content = format!("# {}\n{small}", "x".repeat(padding));
    Form::new().part("model", Part::bytes(content.into_bytes()).file_name("model.obj"))
}

/// The model was looked at.
async fn looked_at(server: &TestServer, model: Form) {
    let status = server.post_form("/v1/models", model).await.status();
    assert!([StatusCode::CREATED, StatusCode::UNPROCESSABLE_ENTITY].contains(&status), "{status}");
}

/// Waits until something holds.
async fn until(what: &str, holds: impl Fn() -> bool) {
    let begin = Instant::now();
    while !holds() {
        assert!(begin.elapsed() < Duration::from_secs(60), "still not: {what}");
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
}

#[tokio::test]
async fn large_models_block_no_small_ones() {
    let server = TestServer::start_with(|config| config.limits.concurrent_describing = 2).await;
    server.engine.set(Mode::Slow(LONG));
    let post = |form| {
        let request = server.client.post(server.url("/v1/models")).timeout(LONG).multipart(form);
        tokio::spawn(async move { request.send().await.map(|response: Response| response.status()) })
    };
    let large: Vec<_> = (0..3).map(|_| post(model(9 << 20))).collect();
    until("a large one is being described", || server.engine.described.load(Ordering::Relaxed) == 1).await;
    server.engine.set(Mode::Quick);
    for _ in 0..2 {
        looked_at(&server, model(0)).await;
    }
    assert_eq!(server.engine.described.load(Ordering::Relaxed), 3, "the other large ones wait");
    // the clients leave: the one is stopped, the others are never begun or stopped too
    large.iter().for_each(|posting| posting.abort());
    until("the work is given up", || server.engine.given_up.load(Ordering::Relaxed) >= 1).await;
    looked_at(&server, model(9 << 20)).await;
}

#[tokio::test]
async fn who_leaves_is_worked_for_no_longer() {
    let server = TestServer::start().await;
    server.engine.set(Mode::Slow(LONG));
    for (line, part) in [("POST /v1/models", "model"), ("POST /v1/queries", "probe")] {
        let given_up = server.engine.given_up.load(Ordering::Relaxed);
        let described = server.engine.described.load(Ordering::Relaxed);
        let head = format!("--b\r\ncontent-disposition: form-data; name=\"{part}\"; filename=\"a.obj\"\r\n\r\n");
        let body = [head.as_bytes(), &files::bumpy_sphere(0.0), b"\r\n--b--\r\n"].concat();
        let head = format!("{line} HTTP/1.1\r\nhost: localhost\r\ncontent-type: multipart/form-data; boundary=b\r\n");
        let mut raw = Raw::send_to(&server, format!("{head}content-length: {}\r\n\r\n", body.len())).await;
        raw.send(body).await;
        until("it is being described", || server.engine.described.load(Ordering::Relaxed) > described).await;
        drop(raw);
        until("the work is given up", || server.engine.given_up.load(Ordering::Relaxed) > given_up).await;
    }
    assert_eq!((server.files("staging"), server.files("models")), (0, 0));
}
