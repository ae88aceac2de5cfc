//! Scan sets over a real connection: uploads, single scans, poses, hostile first contacts, deletion.

use crate::common::{TestServer, expect_json, expect_problem, files, scan_form, text};
use base64::Engine as _;
use reqwest::StatusCode;
use reqwest::multipart::{Form, Part};
use serde_json::json;
use sha2::Digest;

fn one_scan(name: &str, content: impl Into<Vec<u8>>) -> Form {
    Form::new().part("scans", Part::bytes(content.into()).file_name(name.to_owned()))
}

#[tokio::test]
async fn a_scan_set_is_stored_whole_and_goes_whole() {
    let server = TestServer::start().await;
    let response = server.post_form("/v1/scan-sets", scan_form(3)).await;
    let location = response.headers()["location"].to_str().expect("text").to_owned();
    let created = expect_json(response, StatusCode::CREATED).await;
    assert_eq!(location, format!("/v1/scan-sets/{}", text(&created, "/id")));
    assert_eq!(created["unit"], "mm");
    assert_eq!(
        created["scans"][1],
        json!({
            "name": "scan1.ply", "points": 51, "bytes": files::ply(51).len(),
            "checksum": blake3::hash(&files::ply(51)).to_hex().to_string(), "reading": null,
        })
    );
    assert_eq!(created["poses"]["count"], 3);
    assert_eq!(created["poses"]["scans_without_pose"], json!([]));
    assert_eq!(expect_json(server.get(&location).await, StatusCode::OK).await, created);
    assert_eq!((server.files("scan-sets"), server.files("staging")), (3, 0));
    assert_eq!(server.delete(&location).await, StatusCode::NO_CONTENT);
    assert_eq!(server.delete(&location).await, StatusCode::NOT_FOUND);
    assert_eq!(server.files("scan-sets"), 0);
}

#[tokio::test]
async fn a_scan_set_grows_scan_by_scan() {
    let server = TestServer::start().await;
    let set = server.post("/v1/scan-sets", &json!({"name": "slow line", "unit": "m"})).await;
    let set = text(&expect_json(set, StatusCode::CREATED).await, "/links/self");
    let scan = format!("{set}/scans/back%20side.ply");
    let added = expect_json(server.put(&scan, files::ply(7)).await, StatusCode::CREATED).await;
    assert_eq!((added["name"].as_str(), added["points"].as_u64()), (Some("back side.ply"), Some(7)));
    let replaced = expect_json(server.put(&scan, files::ply(8)).await, StatusCode::OK).await;
    assert_eq!(replaced["points"], 8);
    assert_eq!(server.files("scan-sets"), 1);
    let view = expect_json(server.get(&set).await, StatusCode::OK).await;
    assert_eq!(view["scans"].as_array().map(Vec::len), Some(1));
    assert_eq!(server.delete(&scan).await, StatusCode::NO_CONTENT);
    assert_eq!(server.files("scan-sets"), 0);
    expect_problem(server.put("/v1/scan-sets/x/scans/a.ply", "x").await, 404, "not_found").await;
}

#[tokio::test]
async fn a_changed_byte_on_the_way_is_noticed() {
    let server = TestServer::start().await;
    let set = server.scan_set(2).await;
    let url = server.url(&format!("/v1/scan-sets/{set}/scans/new.ply"));
    let put = |digest: String| server.client.put(&url).header("content-digest", digest).body(files::ply(5)).send();
    let digest = |content: &[u8]| {
        format!("sha-256=:{}:", base64::engine::general_purpose::STANDARD.encode(sha2::Sha256::digest(content)))
    };
    let refused = put(digest(b"something else")).await.expect("an answer");
    assert_eq!(expect_problem(refused, 400, "digest_mismatch").await["scan"], "new.ply");
    assert_eq!(server.files("scan-sets"), 2);
    let accepted = put(digest(&files::ply(5))).await.expect("an answer");
    assert_eq!(accepted.status(), StatusCode::CREATED);
}

#[tokio::test]
async fn poses_are_held_against_the_scans() {
    let server = TestServer::start().await;
    let set = server.post_form("/v1/scan-sets", one_scan("a.ply", files::ply(9))).await;
    let set = text(&expect_json(set, StatusCode::CREATED).await, "/links/self");
    let conf = "camera 0 0 0 0 0 0 1\nbmesh a.ply 0 0 0 0 0 0 1\nbmesh gone.ply 1 2 3 0 0 0 1\n";
    let poses = expect_json(server.put(&format!("{set}/poses"), conf).await, StatusCode::OK).await;
    assert_eq!(poses["count"], 2);
    assert_eq!(poses["unknown_scans"], json!(["gone.ply"]));
    assert_eq!(server.put(&format!("{set}/scans/b.ply"), files::ply(9)).await.status(), StatusCode::CREATED);
    let view = expect_json(server.get(&set).await, StatusCode::OK).await;
    assert_eq!(view["poses"]["scans_without_pose"], json!(["b.ply"]));
    for broken in ["", "what?", "{\"a.ply\": [[1,2],[3,4]]}", "{\"a.ply\": [[2,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}"]
    {
        expect_problem(server.put(&format!("{set}/poses"), broken).await, 422, "unreadable_poses").await;
    }
}

#[tokio::test]
async fn files_that_are_no_scans_are_named_with_a_remedy() {
    let server = TestServer::start().await;
    let cut = files::ply(50)[..400].to_vec();
    let word = [files::header(3).as_bytes(), b"1 2 3\n4 five 6\n7 8 9\n"].concat();
    let far = [files::header(2).as_bytes(), b"1 2 3\n4 1e20 6\n"].concat();
    let huge = format!("{}1 2 3\n", files::header(1_000_000_000_000)).into_bytes();
    let cases: [(&str, Vec<u8>, &str); 9] = [
        ("text.ply", b"this is a text file, only named .ply\n".to_vec(), "unreadable_scan"),
        ("cut.ply", cut, "unreadable_scan"),
        ("word.ply", word, "unreadable_scan"),
        ("far.ply", far, "unreadable_scan"),
        ("scan.ply.xz", files::ply(9), "unsupported_format"),
        ("huge.ply", huge, "unreadable_scan"),
        ("none.ply", files::ply(0), "unreadable_scan"),
        ("none.obj", b"# nothing\n".to_vec(), "unreadable_scan"),
        ("photo.jpg", b"\xff\xd8\xff".to_vec(), "unsupported_format"),
    ];
    for (name, content, code) in cases {
        let response = server.post_form("/v1/scan-sets", one_scan(name, content)).await;
        assert_eq!(response.status(), 422, "{name}");
        let problem = response.json::<serde_json::Value>().await.expect("JSON");
        assert_eq!(problem["scan"], name, "{problem}");
        assert!(problem["hint"].as_str().is_some_and(|hint| !hint.is_empty()), "{problem}");
        assert_eq!(problem["code"], code, "{problem}");
    }
    assert_eq!((server.files("staging"), server.files("scan-sets")), (0, 0));
    assert_eq!(server.get("/healthz").await.status(), StatusCode::OK);
}

#[tokio::test]
async fn what_is_dropped_of_a_file_is_counted_in_the_answer() {
    let server = TestServer::start().await;
    let nan = [files::header(3).as_bytes(), b"1 2 3\n4 nan 6\n7 8 9\n"].concat();
    let created = server.post_form("/v1/scan-sets", one_scan("a.ply", nan.clone())).await;
    let created = expect_json(created, StatusCode::CREATED).await;
    let dropped = json!({"no_return": 1, "faces": 0, "normals": 0, "colors": 0, "intensities": 0, "notes": []});
    assert_eq!((&created["scans"][0]["points"], &created["scans"][0]["reading"]), (&json!(2), &dropped));
    let set = text(&created, "/links/self");
    assert_eq!(expect_json(server.get(&set).await, StatusCode::OK).await, created);
    let put = server.put(&format!("{set}/scans/b.ply"), nan).await;
    assert_eq!(expect_json(put, StatusCode::CREATED).await["reading"], dropped);
    let again = server.put(&format!("{set}/scans/b.ply"), files::ply(9)).await;
    assert_eq!(expect_json(again, StatusCode::OK).await["reading"], json!(null));
}

#[tokio::test]
async fn poses_fit_nearly_the_same_names_and_must_fit_some() {
    let server = TestServer::start().await;
    let set = server.post_form("/v1/scan-sets", one_scan("bu\u{308}ste.ply", files::ply(9))).await;
    let set = text(&expect_json(set, StatusCode::CREATED).await, "/links/self");
    let rows = "1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";
    for name in ["b\u{fc}ste.ply", "./b\u{fc}ste.ply", "C:\\scans\\B\u{dc}STE"] {
        let put = server.put(&format!("{set}/poses"), format!("{name}\n{rows}")).await;
        let poses = expect_json(put, StatusCode::OK).await;
        assert_eq!((&poses["unknown_scans"], &poses["scans_without_pose"]), (&json!([]), &json!([])), "{name}");
        let is_told = poses["notes"][0].as_str().is_some_and(|note| note.contains("nearly the same name"));
        assert_eq!(is_told, !name.starts_with('b'), "{poses}");
    }
    let rounded = "a.ply\n0.866 -0.5 0 0\n0.5 0.866 0 0\n0 0 1 0\n0 0 0 1\n".replace("a.ply", "b\u{fc}ste");
    let poses = expect_json(server.put(&format!("{set}/poses"), rounded).await, StatusCode::OK).await;
    assert!(text(&poses, "/notes/0").starts_with("1 pose(s) are rounded"), "{poses}");
    let nothing = server.put(&format!("{set}/poses"), format!("other.ply\n{rows}")).await;
    expect_problem(nothing, 422, "poses_fit_nothing").await;
    let log = server.put(&format!("{set}/poses"), format!("0 0 1\n{rows}1 1 2\n{rows}")).await;
    expect_problem(log, 422, "unreadable_poses").await;
    let form = one_scan("a.ply", files::ply(9)).part("poses", Part::text(files::poses(&["b.ply".to_owned()])));
    expect_problem(server.post_form("/v1/scan-sets", form).await, 422, "poses_fit_nothing").await;
    // without scans the poses come first
    let empty = expect_json(server.post("/v1/scan-sets", &json!({})).await, StatusCode::CREATED).await;
    let put = server.put(&format!("{}/poses", text(&empty, "/links/self")), files::poses(&["a.ply".to_owned()])).await;
    assert_eq!(put.status(), StatusCode::OK);
}

#[tokio::test]
async fn one_bad_scan_refuses_the_whole_form() {
    let server = TestServer::start().await;
    let form = scan_form(3).part("scans", Part::bytes(&b"no"[..]).file_name("bad.ply"));
    let problem = expect_problem(server.post_form("/v1/scan-sets", form).await, 422, "unreadable_scan").await;
    assert_eq!(problem["scan"], "bad.ply");
    assert_eq!((server.files("staging"), server.files("scan-sets")), (0, 0));
    let list = expect_json(server.get("/v1/scan-sets").await, StatusCode::OK).await;
    assert_eq!(list["items"], json!([]));
}

#[tokio::test]
async fn hostile_file_names_are_refused() {
    let server = TestServer::start().await;
    for name in ["../evil.ply", "/etc/passwd", "a\\b.ply", "..", ""] {
        let response = server.post_form("/v1/scan-sets", one_scan(name, files::ply(5))).await;
        expect_problem(response, 422, "invalid_name").await;
    }
    let set = server.scan_set(2).await;
    for name in ["..%2Fevil.ply", "%2e%2e%2fevil.ply", "a%00.ply", "a%0A.ply", &"x".repeat(300)] {
        let response = server.put(&format!("/v1/scan-sets/{set}/scans/{name}"), files::ply(5)).await;
        expect_problem(response, 422, "invalid_name").await;
    }
    let twice = one_scan("a.ply", files::ply(5)).part("scans", Part::bytes(files::ply(6)).file_name("a.ply"));
    expect_problem(server.post_form("/v1/scan-sets", twice).await, 422, "duplicate_scan").await;
    assert!(!server.folder.path().join("evil.ply").exists());
}

#[tokio::test]
async fn a_form_that_breaks_off_leaves_nothing() {
    let server = TestServer::start().await;
    let head = "--b\r\ncontent-disposition: form-data; name=\"scans\"; filename=\"a.ply\"\r\n\r\nply\nformat";
    for (body, boundary) in [(head, "; boundary=b"), (head, ""), ("", "; boundary=b"), ("no form", "; boundary=b")] {
        let content_type = format!("multipart/form-data{boundary}");
        let request = server.client.post(server.url("/v1/scan-sets")).header("content-type", content_type).body(body);
        expect_problem(request.send().await.expect("an answer"), 400, "malformed_request").await;
    }
    assert_eq!(server.files("staging"), 0);
}

#[tokio::test]
async fn a_client_that_stalls_is_given_up() {
    let server = TestServer::start_with(|config| {
        config.edge.body_stall = std::time::Duration::from_millis(200);
    })
    .await;
    let set = server.scan_set(2).await;
    let first = futures_util::stream::iter([Ok::<_, std::io::Error>(files::ply(5))]);
    let endless = futures_util::StreamExt::chain(first, futures_util::stream::pending());
    let response = server.put(&format!("/v1/scan-sets/{set}/scans/a.ply"), reqwest::Body::wrap_stream(endless)).await;
    expect_problem(response, 408, "upload_stalled").await;
    assert_eq!(server.files("staging"), 0);
}

#[tokio::test]
async fn limits_are_enforced() {
    let server = TestServer::start_with(|config| {
        config.limits.scans_per_set = 3;
        config.limits.file_bytes = 5_000;
        config.limits.upload_bytes = 40_000;
        config.limits.points_per_scan = 100;
        config.limits.text_bytes = 500;
    })
    .await;
    expect_problem(server.post_form("/v1/scan-sets", scan_form(4)).await, 422, "too_many_scans").await;
    let large = server.post_form("/v1/scan-sets", one_scan("large.ply", vec![b' '; 6_000])).await;
    assert_eq!(expect_problem(large, 413, "too_large").await["scan"], "large.ply");
    let many = server.post_form("/v1/scan-sets", one_scan("many.ply", files::ply(101))).await;
    expect_problem(many, 422, "too_many_points").await;
    let long = server.post("/v1/scan-sets", &json!({"name": "x".repeat(600)})).await;
    expect_problem(long, 413, "too_large").await;
    let set = server.scan_set(3).await;
    let fourth = server.put(&format!("/v1/scan-sets/{set}/scans/d.ply"), files::ply(5)).await;
    expect_problem(fourth, 422, "too_many_scans").await;
    let large = server.put(&format!("/v1/scan-sets/{set}/scans/scan0.ply"), vec![b' '; 6_000]).await;
    expect_problem(large, 413, "too_large").await;
    let form =
        (0..10).fold(Form::new(), |form, _| form.part("scans", Part::bytes(vec![b' '; 4_900]).file_name("a.ply")));
    let refused = server.post_form("/v1/scan-sets", form).await;
    assert!([413, 422].contains(&refused.status().as_u16()));
    assert_eq!((server.files("staging"), server.files("scan-sets")), (0, 3));
}

#[tokio::test]
async fn lists_are_paged() {
    let server = TestServer::start().await;
    for _ in 0..3 {
        server.scan_set(2).await;
    }
    let first = expect_json(server.get("/v1/scan-sets?limit=2").await, StatusCode::OK).await;
    assert_eq!(first["items"].as_array().map(Vec::len), Some(2));
    let next = format!("/v1/scan-sets?limit=2&cursor={}", text(&first, "/next_cursor"));
    let rest = expect_json(server.get(&next).await, StatusCode::OK).await;
    assert_eq!(rest["items"].as_array().map(Vec::len), Some(1));
    assert_eq!(rest["next_cursor"], json!(null));
    expect_problem(server.get("/v1/scan-sets?limit=0").await, 422, "invalid_field").await;
    expect_problem(server.get("/v1/scan-sets?limit=many").await, 400, "malformed_request").await;
}

#[tokio::test]
async fn a_set_may_be_told_when_to_go() {
    let server = TestServer::start().await;
    let set = server.scan_set(2).await;
    let path = format!("/v1/scan-sets/{set}/expiry");
    let put = |body: serde_json::Value| server.client.put(server.url(&path)).json(&body).send();
    assert!(expect_json(server.get(&path).await, StatusCode::OK).await["expires_at"].is_null());
    let said = put(json!({"expires_at": "2100-01-01T00:00:00Z"})).await.expect("an answer");
    assert_eq!(expect_json(said, StatusCode::OK).await["expires_at"], "2100-01-01T00:00:00Z");
    assert_eq!(expect_json(server.get(&path).await, StatusCode::OK).await["expires_at"], "2100-01-01T00:00:00Z");
    for wrong in
        [json!({"expires_at": "2001-01-01T00:00:00Z"}), json!({"expires_at": "soon"}), json!({"at": null}), json!({})]
    {
        expect_problem(put(wrong).await.expect("an answer"), 422, "invalid_field").await;
    }
    let taken_back = put(json!({"expires_at": null})).await.expect("an answer");
    assert!(expect_json(taken_back, StatusCode::OK).await["expires_at"].is_null());
    server.delete(&format!("/v1/scan-sets/{set}")).await;
    expect_problem(put(json!({"expires_at": null})).await.expect("an answer"), 404, "not_found").await;
}
