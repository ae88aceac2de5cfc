//! Scans that come piece by piece (tus 1.0): over lost connections and a killed server, with the checks of a PUT.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use reqwest::{Method, RequestBuilder, Response, StatusCode};
use serde_json::{Value, json};
use sha2::Digest;

use crate::binary::{Process, client};
use crate::common::raw::Raw;
use crate::common::{TestServer, expect_json, expect_problem, files, text};

const PIECE: &str = "application/offset+octet-stream";

/// A client of tus for one server.
struct Tus<'a> {
    client: &'a reqwest::Client,
    base: String,
}

impl Tus<'_> {
    fn of(server: &TestServer) -> Tus<'_> {
        Tus { client: &server.client, base: server.url("") }
    }

    fn request(&self, method: Method, path: &str) -> RequestBuilder {
        self.client.request(method, format!("{}{path}", self.base)).header("tus-resumable", "1.0.0")
    }

    fn creation(&self, set: &str, name: &str, bytes: usize) -> RequestBuilder {
        let metadata = format!("filename {}", STANDARD.encode(name));
        self.request(Method::POST, &format!("/v1/scan-sets/{set}/uploads"))
            .header("upload-length", bytes)
            .header("upload-metadata", metadata)
    }

    /// Begins an upload; answers with its address.
    async fn begin(&self, set: &str, name: &str, bytes: usize) -> String {
        let created = self.creation(set, name, bytes).send().await.expect("an answer");
        let location = created.headers()["location"].to_str().expect("text").to_owned();
        let view = expect_json(created, StatusCode::CREATED).await;
        assert_eq!((&view["href"], &view["bytes"], &view["offset"]), (&json!(location), &json!(bytes), &json!(0)));
        location
    }

    fn piece(&self, upload: &str, offset: usize, piece: &[u8]) -> RequestBuilder {
        self.request(Method::PATCH, upload)
            .header("upload-offset", offset)
            .header("content-type", PIECE)
            .body(piece.to_vec())
    }

    async fn send(&self, upload: &str, offset: usize, piece: &[u8]) -> Response {
        self.piece(upload, offset, piece).send().await.expect("an answer")
    }

    /// How much has arrived; `None` if the upload is gone.
    async fn offset(&self, upload: &str) -> Option<usize> {
        let answer = self.request(Method::HEAD, upload).send().await.expect("an answer");
        if answer.status() == StatusCode::NOT_FOUND {
            return None;
        }
        assert_eq!(answer.status(), StatusCode::OK);
        assert_eq!(answer.headers()["cache-control"], "no-store");
        assert_eq!(answer.headers()["tus-resumable"], "1.0.0");
        assert!(answer.headers()["upload-expires"].to_str().expect("text").ends_with(" GMT"));
        Some(number(&answer, "upload-offset"))
    }
}

fn number(answer: &Response, header: &str) -> usize {
    answer.headers()[header].to_str().expect("text").parse().expect("a number")
}

async fn empty_set(server: &TestServer) -> String {
    let set = server.post("/v1/scan-sets", &json!({"name": "pieces"})).await;
    text(&expect_json(set, StatusCode::CREATED).await, "/id")
}

async fn scans(server: &TestServer, set: &str) -> Value {
    expect_json(server.get(&format!("/v1/scan-sets/{set}")).await, StatusCode::OK).await["scans"].clone()
}

#[tokio::test]
async fn pieces_become_a_scan_as_if_it_had_been_put() {
    let server = TestServer::start().await;
    let (tus, set, content) = (Tus::of(&server), empty_set(&server).await, files::ply(200));
    let upload = tus.begin(&set, "front/a b.ply", content.len()).await;
    let first = tus.send(&upload, 0, &content[..700]).await;
    assert_eq!((first.status(), number(&first, "upload-offset")), (StatusCode::NO_CONTENT, 700));
    assert_eq!(tus.offset(&upload).await, Some(700));
    let listed = expect_json(server.get(&format!("/v1/scan-sets/{set}/uploads")).await, StatusCode::OK).await;
    assert_eq!((&listed["items"][0]["offset"], &listed["items"][0]["name"]), (&json!(700), &json!("front/a b.ply")));
    assert_eq!(scans(&server, &set).await, json!([]));

    let last = tus.send(&upload, 700, &content[700..]).await;
    assert_eq!((last.status(), number(&last, "upload-offset")), (StatusCode::NO_CONTENT, content.len()));
    let checksum = blake3::hash(&content).to_hex().to_string();
    assert_eq!(last.headers()["etag"], format!("\"{checksum}\""));
    let by_pieces = scans(&server, &set).await;
    assert_eq!(by_pieces[0]["checksum"], checksum);
    assert_eq!((server.files("uploads"), server.files("staging"), server.files("scan-sets")), (0, 0, 1));
    // whoever lost the answer learns that all is there
    assert_eq!(tus.offset(&upload).await, Some(content.len()));
    assert_eq!(tus.send(&upload, content.len(), b"").await.status(), StatusCode::NO_CONTENT);
    let put = server.put(&format!("/v1/scan-sets/{set}/scans/front%2Fa%20b.ply"), content).await;
    assert_eq!(expect_json(put, StatusCode::OK).await, by_pieces[0]);
}

#[tokio::test]
async fn what_arrived_before_the_connection_was_lost_is_kept() {
    let server = TestServer::start().await;
    let (tus, set, content) = (Tus::of(&server), empty_set(&server).await, files::ply(200));
    let upload = tus.begin(&set, "a.ply", content.len()).await;
    let head = format!(
        "PATCH {upload} HTTP/1.1\r\nhost: localhost\r\ntus-resumable: 1.0.0\r\nupload-offset: 0\r\n\
         content-type: {PIECE}\r\ncontent-length: {}\r\n\r\n",
        content.len()
    );
    let half = [head.as_bytes(), &content[..500]].concat();
    let lost = Raw::send_to(&server, &half).await;
    while tus.offset(&upload).await != Some(500) {
        tokio::task::yield_now().await;
    }
    // a newer request takes over from one whose client is silent, and goes on behind what that has brought
    let next = tus.send(&upload, 500, &content[500..900]).await;
    assert_eq!((next.status(), number(&next, "upload-offset")), (StatusCode::NO_CONTENT, 900));
    drop(lost);
    let stale = tus.send(&upload, 500, &content[500..]).await;
    expect_problem(stale, 409, "offset_mismatch").await;
    assert_eq!(tus.send(&upload, 900, &content[900..]).await.status(), StatusCode::NO_CONTENT);
    assert_eq!(scans(&server, &set).await[0]["checksum"], blake3::hash(&content).to_hex().to_string());
}

#[tokio::test]
async fn a_killed_server_has_kept_every_byte_it_acknowledged() {
    let (folder, client) = (tempfile::tempdir().expect("a temporary folder"), client());
    let content = files::ply(20_000);
    let mut process = Process::start(folder.path());
    let made = client.post(format!("{}/v1/scan-sets", process.url)).json(&json!({"name": "a"})).send().await;
    let set = text(&expect_json(made.expect("an answer"), StatusCode::CREATED).await, "/id");
    let tus = |process: &Process| Tus { client: &client, base: process.url.clone() };
    let upload = tus(&process).begin(&set, "a.ply", content.len()).await;
    let mut offset = 0;
    for _ in 0..3 {
        let next = offset + content.len() / 5;
        let sent = tus(&process).send(&upload, offset, &content[offset..next]).await;
        assert_eq!(sent.status(), StatusCode::NO_CONTENT);
        offset = number(&sent, "upload-offset");
        process.signal("-KILL");
        process.child.wait().expect("it is dead");
        process = Process::start(folder.path());
        assert_eq!(tus(&process).offset(&upload).await, Some(offset));
    }
    let sent = tus(&process).send(&upload, offset, &content[offset..]).await;
    assert_eq!(sent.status(), StatusCode::NO_CONTENT);
    let stored = process.get(&format!("/v1/scan-sets/{set}")).await;
    assert_eq!(stored["scans"][0]["checksum"], blake3::hash(&content).to_hex().to_string());
    // killed between the scan and the note that it is one, a server is asked for the last byte once more
    process.signal("-KILL");
    process.child.wait().expect("it is dead");
    process = Process::start(folder.path());
    assert_eq!(tus(&process).offset(&upload).await, Some(content.len()));
}

#[tokio::test]
async fn a_piece_that_is_not_what_its_checksum_says_leaves_nothing() {
    let server = TestServer::start().await;
    let (tus, set, content) = (Tus::of(&server), empty_set(&server).await, files::ply(100));
    let upload = tus.begin(&set, "a.ply", content.len()).await;
    let send = |offset: usize, piece: &[u8], of: &[u8]| {
        let checksum = format!("sha256 {}", STANDARD.encode(sha2::Sha256::digest(of)));
        tus.piece(&upload, offset, piece).header("upload-checksum", checksum).send()
    };
    let refused = send(0, &content[..400], b"something else").await.expect("an answer");
    expect_problem(refused, 460, "checksum_mismatch").await;
    assert_eq!((tus.offset(&upload).await, server.files("staging")), (Some(0), 0));
    let taken = send(0, &content[..400], &content[..400]).await.expect("an answer");
    assert_eq!(number(&taken, "upload-offset"), 400);
    let last = send(400, &content[400..], &content[400..]).await.expect("an answer");
    assert_eq!(last.status(), StatusCode::NO_CONTENT);
    assert_eq!(scans(&server, &set).await[0]["points"], 100);
}

#[tokio::test]
async fn a_file_at_fault_is_refused_as_by_put_and_its_upload_is_gone() {
    let server = TestServer::start().await;
    let (tus, set) = (Tus::of(&server), empty_set(&server).await);
    let broken = b"ply\nformat ascii 1.0\nthis is no scan";
    let upload = tus.begin(&set, "a.ply", broken.len()).await;
    let refused = expect_problem(tus.send(&upload, 0, broken).await, 422, "unreadable_scan").await;
    let put = server.put(&format!("/v1/scan-sets/{set}/scans/a.ply"), broken.to_vec()).await;
    assert_eq!(expect_problem(put, 422, "unreadable_scan").await, refused);
    assert_eq!((tus.offset(&upload).await, server.files("uploads"), server.files("staging")), (None, 0, 0));

    let content = files::ply(60);
    let digest = format!("sha-256=:{}:", STANDARD.encode(sha2::Sha256::digest(b"another file")));
    let metadata = format!("filename {},digest {}", STANDARD.encode("b.ply"), STANDARD.encode(digest));
    let created = tus.creation(&set, "b.ply", content.len());
    let created = tus
        .client
        .post(created.build().expect("a request").url().clone())
        .header("upload-length", content.len())
        .header("upload-metadata", metadata);
    let upload = text(&expect_json(created.send().await.expect("an answer"), StatusCode::CREATED).await, "/href");
    expect_problem(tus.send(&upload, 0, &content).await, 400, "digest_mismatch").await;
    assert_eq!((tus.offset(&upload).await, server.files("uploads")), (None, 0));
}

#[tokio::test]
async fn a_set_in_use_keeps_the_upload_until_it_is_free() {
    let server = TestServer::start().await;
    server.engine.set(crate::common::Mode::Slow(std::time::Duration::from_secs(60)));
    let (tus, set, content) = (Tus::of(&server), server.scan_set(3).await, files::ply(60));
    let upload = tus.begin(&set, "new.ply", content.len()).await;
    let job = server.post("/v1/jobs", &json!({"scan_set_id": set})).await;
    let job = text(&expect_json(job, StatusCode::ACCEPTED).await, "/id");
    expect_problem(tus.send(&upload, 0, &content).await, 409, "in_use").await;
    let all_but_one = content.len() - 1;
    assert_eq!(tus.offset(&upload).await, Some(all_but_one), "the last byte is asked for once more");
    expect_json(server.post(&format!("/v1/jobs/{job}/cancel"), &json!(null)).await, StatusCode::ACCEPTED).await;
    server.until(&job, "canceled").await;
    // another last byte changes nothing of what is there
    assert_eq!(tus.send(&upload, all_but_one, b"!").await.status(), StatusCode::NO_CONTENT);
    let stored = scans(&server, &set).await;
    assert_eq!(stored[0]["checksum"], blake3::hash(&content).to_hex().to_string(), "{stored}");
}

#[tokio::test]
async fn what_is_hostile_is_refused_with_what_to_do() {
    let server = TestServer::start_with(|config| {
        config.limits.file_bytes = 5_000;
        config.limits.scans_per_set = 4;
    })
    .await;
    let (tus, set) = (Tus::of(&server), server.scan_set(2).await);
    let create = async |name: &str, bytes: usize| tus.creation(&set, name, bytes).send().await.expect("an answer");
    expect_problem(create("a.ply", 5_001).await, 413, "too_large").await;
    expect_problem(create("a.ply", usize::MAX).await, 413, "too_large").await;
    expect_problem(create("a.ply", 0).await, 422, "unreadable_scan").await;
    expect_problem(create("../a.ply", 10).await, 422, "invalid_name").await;
    expect_problem(create("a.exe", 10).await, 422, "unsupported_format").await;
    expect_problem(create("SCAN0.ply", 10).await, 422, "duplicate_scan").await;
    let nameless = tus.request(Method::POST, &format!("/v1/scan-sets/{set}/uploads")).header("upload-length", 3);
    expect_problem(nameless.send().await.expect("an answer"), 422, "invalid_name").await;
    let unmatched = tus.creation(&set, "scan0.ply", 10).header("if-none-match", "*").send().await;
    expect_problem(unmatched.expect("an answer"), 412, "precondition_failed").await;
    expect_problem(tus.creation("x", "a.ply", 10).send().await.expect("an answer"), 404, "not_found").await;
    let version = tus.client.head(server.url("/v1/uploads/x")).header("tus-resumable", "0.2.2").send().await;
    let version = version.expect("an answer");
    assert_eq!((version.status().as_u16(), &version.headers()["tus-version"]), (412, &"1.0.0".parse().expect("text")));

    let upload = tus.begin(&set, "a.ply", 10).await;
    expect_problem(tus.send(&upload, 0, &[b'x'; 11]).await, 413, "too_large").await;
    assert_eq!(tus.offset(&upload).await, Some(0));
    expect_problem(tus.send(&upload, 5, b"x").await, 409, "offset_mismatch").await;
    let plain = tus.request(Method::PATCH, &upload).header("upload-offset", 0).body("x").send().await;
    expect_problem(plain.expect("an answer"), 415, "unsupported_media_type").await;
    let nowhere = tus.request(Method::PATCH, &upload).header("content-type", PIECE).body("x").send().await;
    expect_problem(nowhere.expect("an answer"), 400, "malformed_request").await;
    for _ in 0..3 {
        tus.begin(&set, "b.ply", 10).await;
    }
    expect_problem(create("c.ply", 10).await, 422, "too_many_scans").await;
    assert_eq!(server.delete(&upload).await, StatusCode::NO_CONTENT);
    assert_eq!(server.delete(&upload).await, StatusCode::NOT_FOUND);
    assert_eq!(tus.offset(&upload).await, None);
    let offered = tus.request(Method::OPTIONS, &format!("/v1/scan-sets/{set}/uploads")).send().await;
    let offered = offered.expect("an answer");
    assert_eq!((offered.status().as_u16(), number(&offered, "tus-max-size")), (204, 5_000));
    assert_eq!(offered.headers()["tus-extension"], "creation,expiration,checksum,termination");
    // what is begun and not sent takes no place
    assert_eq!(server.files("uploads"), 0);
}

#[tokio::test]
async fn uploads_count_for_quotas_and_go_with_their_set_or_in_time() {
    let server = TestServer::start_with(|config| {
        config.quotas.stored_bytes = Some(20_000);
        config.limits.upload_life = std::time::Duration::from_secs(3600);
    })
    .await;
    let (tus, set) = (Tus::of(&server), empty_set(&server).await);
    let upload = tus.begin(&set, "a.ply", 15_000).await;
    let beyond = tus.creation(&set, "b.ply", 6_000).send().await.expect("an answer");
    expect_problem(beyond, 429, "quota_exceeded").await;
    // its pieces are counted already
    assert_eq!(tus.send(&upload, 0, &[b'x'; 14_000]).await.status(), StatusCode::NO_CONTENT);
    assert_eq!(server.files("uploads"), 1);
    assert_eq!(server.delete(&format!("/v1/scan-sets/{set}")).await, StatusCode::NO_CONTENT);
    assert_eq!((tus.offset(&upload).await, server.files("uploads")), (None, 0));

    let server = TestServer::start_with(|config| config.limits.upload_life = std::time::Duration::ZERO).await;
    let (tus, set) = (Tus::of(&server), empty_set(&server).await);
    let upload = tus.begin(&set, "a.ply", 100).await;
    assert_eq!(tus.offset(&upload).await, None, "nobody waits for it any more");
    expect_problem(tus.send(&upload, 0, b"x").await, 404, "not_found").await;
    let listed = expect_json(server.get(&format!("/v1/scan-sets/{set}/uploads")).await, StatusCode::OK).await;
    assert_eq!(listed["items"], json!([]));
}
