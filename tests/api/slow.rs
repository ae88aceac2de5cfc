//! Clients that take their time: each is waited for only so long, and then the connection is closed.

use std::time::Duration;

use crate::common::raw::Raw;
use crate::common::{TestServer, expect_json, expect_problem, files};
use reqwest::StatusCode;
use reqwest::multipart::{Form, Part};
use visage::config::EdgeLimits;

/// What is a moment here takes seconds in service.
const MOMENT: Duration = Duration::from_millis(150);
/// Longer than any test takes.
const LONG: Duration = Duration::from_secs(600);

fn patient() -> EdgeLimits {
    EdgeLimits { connections: 64, head_time: LONG, body_time: LONG, body_rate: 1, body_stall: LONG, answer_stall: LONG }
}

async fn server(edge: EdgeLimits) -> TestServer {
    TestServer::start_with(|config| config.edge = edge).await
}

#[tokio::test]
async fn half_heads_and_idle_connections_are_closed() {
    let server = server(EdgeLimits { head_time: MOMENT, ..patient() }).await;
    for begin in ["", "GET / HTTP/1.1\r\nX: ", "GET /healthz HTTP/1.1\r\nhost: localhost\r\n\r\nGET /hea"] {
        let mut raw = Raw::send_to(&server, begin).await;
        if begin.contains("\r\n\r\n") {
            assert_eq!(raw.answer().await.status, 200);
        }
        assert_eq!(raw.rest().await, "", "{begin:?}");
    }
    // one more byte now and then is no head
    let mut raw = Raw::send_to(&server, "GET / HTTP/1.1\r\nX: ").await;
    while raw.try_send("x").await {
        tokio::time::sleep(MOMENT / 10).await;
    }
}

#[tokio::test]
async fn half_bodies_of_every_kind_are_given_up() {
    // whatever has arrived earns no time
    let server = server(EdgeLimits { body_time: MOMENT, body_rate: u64::MAX, ..patient() }).await;
    let set = server.scan_set(2).await;
    let form = "content-type: multipart/form-data; boundary=b";
    let part = |head: &str| format!("--b\r\ncontent-disposition: form-data; {head}\r\n\r\nsome of it");
    let json = "content-type: application/json";
    let (set_form, probe) = ("POST /v1/scan-sets", "POST /v1/queries");
    let put_scan = format!("PUT /v1/scan-sets/{set}/scans/a.ply");
    let put_poses = format!("PUT /v1/scan-sets/{set}/poses");
    let cases = [
        ("POST /v1/jobs", json, "{".to_owned()),
        (set_form, json, String::new()),
        (probe, json, "{\"standard\"".to_owned()),
        ("PUT /v1/standards/x/examples", json, "{".to_owned()),
        (&put_poses, json, "{".to_owned()),
        (&put_poses, "content-type: text/plain", "a.ply\n1 0 0".to_owned()),
        (&put_scan, "content-type: application/octet-stream", "ply\nformat".to_owned()),
        (set_form, form, String::new()),
        (set_form, form, "before the first part".to_owned()),
        (set_form, form, "--b\r\ncontent-disp".to_owned()),
        (set_form, form, part("name=\"scans\"; filename=\"a.ply\"")),
        (set_form, form, part("name=\"poses\"; filename=\"poses.json\"")),
        ("POST /v1/models", form, part("name=\"model\"; filename=\"a.ply\"")),
        ("POST /v1/standards", form, part("name=\"landmarks\"")),
        (probe, form, part("name=\"probe\"; filename=\"a.ply\"")),
    ];
    for (line, content_type, begin) in cases {
        let head = format!("{line} HTTP/1.1\r\nhost: localhost\r\n{content_type}\r\ncontent-length: 100000\r\n\r\n");
        let mut raw = Raw::send_to(&server, format!("{head}{begin}")).await;
        let answer = raw.answer().await;
        assert_eq!((answer.status, answer.body["code"].as_str()), (408, Some("upload_stalled")), "{line} {begin:?}");
        assert_eq!(raw.rest().await, "", "{line} {begin:?}: the connection is closed");
    }
    assert_eq!(server.files("staging"), 0);
    assert_eq!(server.get("/healthz").await.status(), StatusCode::OK);
}

#[tokio::test]
async fn a_body_nobody_asked_for_keeps_no_connection() {
    let server = server(patient()).await;
    let head = "POST /v1/nothing HTTP/1.1\r\nhost: localhost\r\ncontent-length: 100000\r\n\r\nsome";
    let begin = Raw::send_to(&server, head).await;
    let answer = begin.rest().await;
    assert!(answer.starts_with("HTTP/1.1 404"), "{answer}");
}

#[tokio::test]
async fn a_body_that_trickles_is_given_up_and_one_that_pauses_is_not() {
    // 64 kB a second at least
    let server = server(EdgeLimits { body_time: MOMENT * 4, body_rate: 1 << 16, ..patient() }).await;
    let set = server.scan_set(2).await;
    let head = format!("PUT /v1/scan-sets/{set}/scans/a.ply HTTP/1.1\r\nhost: localhost\r\ncontent-length: ");
    let mut trickle = Raw::send_to(&server, format!("{head}100000\r\n\r\n")).await;
    while trickle.try_send(" ").await {
        tokio::time::sleep(MOMENT / 10).await;
    }
    // what was quick before may pause for as long as that would have taken: 4 MB earn a minute
    let points = b"1.000 2.000 3.000\n4.000 5.000 6.000\n".repeat(120_000);
    let scan = [files::header(240_000).as_bytes(), &points].concat();
    let (first, rest) = scan.split_at(scan.len() - 100);
    let mut pause = Raw::send_to(&server, format!("{head}{}\r\n\r\n", scan.len())).await;
    pause.send(first).await;
    tokio::time::sleep(MOMENT * 8).await;
    pause.send(rest).await;
    assert_eq!(pause.answer().await.status, 201);
}

#[tokio::test]
async fn an_answer_that_nobody_takes_is_given_up() {
    let server = server(EdgeLimits { answer_stall: MOMENT, ..patient() }).await;
    // far more than the system keeps for a connection
    let many: Vec<String> = (0..400_000).map(|k| format!("{}.5 {}.25 1\n", k % 1000, k / 1000)).collect();
    let scan = [files::header(many.len()).into_bytes(), many.concat().into_bytes()].concat();
    let form = ["a.ply", "b.ply", "c.ply"]
        .iter()
        .fold(Form::new(), |form, name| form.part("scans", Part::bytes(scan.clone()).file_name(*name)));
    let names = ["a.ply", "b.ply", "c.ply"].map(str::to_owned);
    let form = form.part("poses", Part::text(files::poses(&names)).file_name("poses.json"));
    let job = expect_json(server.post_form("/v1/jobs", form).await, StatusCode::ACCEPTED).await;
    let job = server.finished(job["id"].as_str().expect("an id")).await;
    let address = format!("/v1/models/{}/cloud.ply", job["model_id"].as_str().expect("a model"));
    let line = format!("GET {address} HTTP/1.1\r\nhost: localhost\r\n\r\n");
    let before = *server.handle.connections().borrow();
    let requests = (0..4).map(|_| Raw::send_to(&server, line.clone()));
    let asleep = futures_util::future::join_all(requests).await;
    server.until_connections(|now| now.accepted == before.accepted + 4 && now.open <= before.open).await;
    drop(asleep);
}

#[tokio::test]
async fn others_wait_while_all_connections_are_taken() {
    let server = server(EdgeLimits { connections: 3, head_time: MOMENT * 4, ..patient() }).await;
    let half = "GET / HTTP/1.1\r\nX: ";
    let held = futures_util::future::join_all((0..3).map(|_| Raw::send_to(&server, half))).await;
    server.until_connections(|now| now.accepted == 3).await;
    // the next ones are answered when the first have been closed, though nobody closes them here
    let get = "GET /healthz HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\n\r\n";
    let next = futures_util::future::join_all((0..9).map(|_| Raw::send_to(&server, get))).await;
    for answer in futures_util::future::join_all(next.into_iter().map(Raw::rest)).await {
        assert!(answer.starts_with("HTTP/1.1 200"), "{answer}");
    }
    drop(held);
}

#[tokio::test]
async fn limits_on_connections_are_stated() {
    let server =
        server(EdgeLimits { connections: 7, head_time: Duration::from_secs(11), ..EdgeLimits::default() }).await;
    let info = expect_json(server.get("/v1/info").await, StatusCode::OK).await;
    let limits = &info["limits"];
    assert_eq!((limits["connections"].as_u64(), limits["head_seconds"].as_u64()), (Some(7), Some(11)), "{limits}");
    for limit in ["body_seconds", "body_bytes_per_second", "upload_stall_seconds", "answer_stall_seconds"] {
        assert!(limits[limit].as_u64().is_some_and(|limit| limit > 0), "{limit}: {limits}");
    }
}

/// What precedes the first part, and the head of a part, are looked through in memory.
#[tokio::test]
async fn forms_with_endless_heads_are_refused_at_once() {
    let server = server(patient()).await;
    let head = "POST /v1/models HTTP/1.1\r\nhost: localhost\r\ncontent-type: multipart/form-data; boundary=b\r\n\
                content-length: 900000000\r\n\r\n";
    let begins = [
        String::new(),
        "--b\r\nx: ".to_owned(),
        "--b\r\ncontent-disposition: form-data; name=\"".to_owned(),
        "--b\r\ncontent-disposition: form-data; name=\"label\"\r\n\r\nx\r\n--b\r\nx: ".to_owned(),
    ];
    for begin in begins {
        let mut raw = Raw::send_to(&server, format!("{head}{begin}")).await;
        let mut sent = 0;
        // it may read on for a while, so that the client gets to its answer, but it does not keep what it reads
        while sent < 100 << 20 && raw.try_send([b'x'; 1 << 16]).await {
            sent += 1 << 16;
        }
        assert!(sent < 100 << 20, "{begin:?}: it has read {sent} bytes");
    }
    for begin in ["x".repeat(20_000), format!("--b\r\nx: {}", "x".repeat(20_000))] {
        let request = server.client.post(server.url("/v1/models")).body(begin);
        let request = request.header("content-type", "multipart/form-data; boundary=b");
        expect_problem(request.send().await.expect("an answer"), 413, "too_large").await;
    }
}

#[tokio::test]
async fn what_is_kept_of_all_bodies_together_is_bounded() {
    let server = TestServer::start_with(|config| {
        config.edge = patient();
        config.limits.buffered_bytes = 64 << 10;
    })
    .await;
    let set = server.scan_set(2).await;
    let head = format!("PUT /v1/scan-sets/{set}/poses HTTP/1.1\r\nhost: localhost\r\ncontent-length: 60000\r\n\r\n");
    let half = " ".repeat(40_000);
    let mut first = Raw::send_to(&server, format!("{head}{half}")).await;
    // which of the two comes first is not known, but one of them finds no room
    let mut second = Raw::send_to(&server, format!("{head}{half}")).await;
    let refused = tokio::select! {
        answer = first.answer() => answer,
        answer = second.answer() => answer,
    };
    assert_eq!((refused.status, refused.body["code"].as_str()), (503, Some("overloaded")));
    drop((first, second));
    // room again as soon as the server sees that they have left
    let small = format!("/v1/scan-sets/{set}/poses");
    while server.put(&small, " ".repeat(60_000)).await.status() == StatusCode::SERVICE_UNAVAILABLE {}
}
