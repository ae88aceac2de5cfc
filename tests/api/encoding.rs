//! Bodies that come packed by gzip: unpacked while they arrive, within the bounds of what is unpacked.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use reqwest::{Response, StatusCode};
use serde_json::json;
use sha2::Digest;

use crate::common::{TestServer, expect_json, expect_problem, files, text};

fn gzip(content: &[u8]) -> Vec<u8> {
    use std::io::Write;
    let mut packer = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    packer.write_all(content).expect("in memory");
    packer.finish().expect("in memory")
}

async fn put(server: &TestServer, path: &str, coding: &str, body: Vec<u8>) -> Response {
    server.client.put(server.url(path)).header("content-encoding", coding).body(body).send().await.expect("an answer")
}

#[tokio::test]
async fn packed_bodies_of_every_kind_are_taken() {
    let server = TestServer::start().await;
    let created = server.client.post(server.url("/v1/scan-sets")).header("content-encoding", "gzip");
    let created = created.header("content-type", "application/json").body(gzip(br#"{"name": "packed"}"#)).send().await;
    let set = text(&expect_json(created.expect("an answer"), StatusCode::CREATED).await, "/links/self");
    let (path, content) = (format!("{set}/scans/a.ply"), files::ply(500));
    let plain = expect_json(server.put(&path, content.clone()).await, StatusCode::CREATED).await;
    for (coding, body) in [
        ("gzip", gzip(&content)),
        ("x-gzip", gzip(&content)),
        ("GZip", [gzip(&content[..999]), gzip(&content[999..])].concat()),
        ("identity", content.clone()),
    ] {
        assert_eq!(expect_json(put(&server, &path, coding, body).await, StatusCode::OK).await, plain, "{coding}");
    }
    let form = b"--x\r\ncontent-disposition: form-data; name=\"scans\"; filename=\"b.ply\"\r\n\r\n";
    let form = gzip(&[&form[..], &content, b"\r\n--x--\r\n"].concat());
    let sent = server.client.post(server.url("/v1/scan-sets/upload")).header("content-encoding", "gzip");
    let sent = sent.header("content-type", "multipart/form-data; boundary=x").body(form).send().await;
    let set = expect_json(sent.expect("an answer"), StatusCode::CREATED).await;
    assert_eq!(set["scans"][0]["checksum"], plain["checksum"]);
}

#[tokio::test]
async fn a_digest_is_that_of_what_is_sent() {
    let server = TestServer::start().await;
    let (set, content) = (server.scan_set(2).await, files::ply(50));
    let url = server.url(&format!("/v1/scan-sets/{set}/scans/a.ply"));
    let put = |digested: &[u8]| {
        let digest = format!("sha-256=:{}:", STANDARD.encode(sha2::Sha256::digest(digested)));
        let request = server.client.put(&url).header("content-encoding", "gzip").header("content-digest", digest);
        request.body(gzip(&content)).send()
    };
    expect_problem(put(&content).await.expect("an answer"), 400, "digest_mismatch").await;
    assert_eq!(put(&gzip(&content)).await.expect("an answer").status(), StatusCode::CREATED);
}

#[tokio::test]
async fn nothing_is_unpacked_beyond_the_bounds_and_what_is_broken_or_packed_otherwise_is_refused() {
    let server = TestServer::start_with(|config| {
        config.limits.file_bytes = 100_000;
        config.limits.upload_bytes = 200_000;
    })
    .await;
    let set = server.scan_set(2).await;
    let path = format!("/v1/scan-sets/{set}/scans/a.ply");
    // a thousand times as much as is sent
    let bomb = gzip(&vec![b'0'; 50_000_000]);
    assert!(bomb.len() < 100_000);
    expect_problem(put(&server, &path, "gzip", bomb.clone()).await, 413, "too_large").await;
    let json = server.client.post(server.url("/v1/scan-sets")).header("content-encoding", "gzip");
    let json = json.header("content-type", "application/json").body(bomb.clone()).send().await;
    expect_problem(json.expect("an answer"), 413, "too_large").await;
    let form = server.client.post(server.url("/v1/scan-sets/upload")).header("content-encoding", "gzip");
    let form = form.header("content-type", "multipart/form-data; boundary=x").body(bomb).send().await;
    expect_problem(form.expect("an answer"), 413, "too_large").await;
    assert_eq!(server.files("staging"), 0);

    let content = files::ply(50);
    let packed = gzip(&content);
    let broken = [&packed[..packed.len() / 2], &packed[..packed.len() - 1], b"no gzip", &content];
    for body in broken {
        expect_problem(put(&server, &path, "gzip", body.to_vec()).await, 400, "malformed_request").await;
    }
    let trailing = [&packed[..], b"and more"].concat();
    expect_problem(put(&server, &path, "gzip", trailing).await, 400, "malformed_request").await;
    let mut flipped = packed.clone();
    flipped[packed.len() - 6] ^= 1;
    expect_problem(put(&server, &path, "gzip", flipped).await, 400, "malformed_request").await;
    for coding in ["br", "deflate", "zstd", "compress", "gzip, gzip", "gzip, br", "br, gzip", "snappy"] {
        let refused = put(&server, &path, coding, content.clone()).await;
        assert_eq!(refused.headers()["accept-encoding"], "gzip, identity");
        expect_problem(refused, 415, "unsupported_media_type").await;
    }
    assert_eq!(server.files("scan-sets"), 2);
    assert_eq!(json!(server.files("staging")), json!(0));
}
