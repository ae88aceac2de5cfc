//! Requests that are for a state of their resource: `If-Match`, `If-None-Match`, cursors, repeated requests.

use crate::common::{TestServer, expect_json, expect_problem, files, scan_form, text};
use reqwest::{Method, RequestBuilder, Response, StatusCode};
use serde_json::json;

const UNKNOWN: &str = "\"0000\"";

async fn answer(request: RequestBuilder) -> Response {
    request.send().await.expect("an answer")
}

fn etag(response: &Response) -> String {
    response.headers()["etag"].to_str().expect("text").to_owned()
}

/// Every resource that can be looked at tells its state, and is not sent to whom knows it.
#[tokio::test]
async fn nothing_is_deleted_in_another_state_than_its_client_knows() {
    let server = TestServer::start().await;
    let (model, job) = server.model().await;
    let set = server.scan_set(2).await;
    let request = |method: Method, path: &str| server.client.request(method, server.url(path));
    for path in [format!("/v1/models/{model}"), format!("/v1/jobs/{job}"), format!("/v1/scan-sets/{set}")] {
        let tag = etag(&server.get(&path).await);
        let known = answer(request(Method::GET, &path).header("if-none-match", &tag)).await;
        assert_eq!((known.status(), etag(&known)), (StatusCode::NOT_MODIFIED, tag.clone()), "{path}");
        for method in [Method::GET, Method::DELETE] {
            for other in [UNKNOWN, &format!("W/{tag}"), "not a tag"] {
                let refused = answer(request(method.clone(), &path).header("if-match", other)).await;
                expect_problem(refused, 412, "precondition_failed").await;
            }
        }
        assert_eq!(answer(request(Method::GET, &path).header("if-match", &tag)).await.status(), StatusCode::OK);
        let deleted = answer(request(Method::DELETE, &path).header("if-match", format!("{UNKNOWN}, {tag}"))).await;
        assert_eq!(deleted.status(), StatusCode::NO_CONTENT, "{path}");
        let gone = answer(request(Method::DELETE, &path).header("if-match", "*")).await;
        expect_problem(gone, 404, "not_found").await;
    }
}

#[tokio::test]
async fn a_changed_scan_set_has_another_state() {
    let server = TestServer::start().await;
    let set = format!("/v1/scan-sets/{}", server.scan_set(2).await);
    let before = etag(&server.get(&set).await);
    assert_eq!(server.put(&format!("{set}/scans/new.ply"), files::ply(9)).await.status(), StatusCode::CREATED);
    let stale = answer(server.client.delete(server.url(&set)).header("if-match", before)).await;
    expect_problem(stale, 412, "precondition_failed").await;
    let now = etag(&server.get(&set).await);
    let deleted = answer(server.client.delete(server.url(&set)).header("if-match", now)).await;
    assert_eq!(deleted.status(), StatusCode::NO_CONTENT);
}

#[tokio::test]
async fn scans_and_poses_are_replaced_in_the_state_that_is_known_alone() {
    let server = TestServer::start().await;
    let set = format!("/v1/scan-sets/{}", server.scan_set(2).await);
    let scan = server.url(&format!("{set}/scans/new.ply"));
    let put = |header: &'static str, value: &str, points| {
        answer(server.client.put(&scan).header(header, value).body(files::ply(points)))
    };
    expect_problem(put("if-match", "*", 5).await, 412, "precondition_failed").await;
    let first = put("if-none-match", "*", 5).await;
    let first_tag = etag(&first);
    assert_eq!(first.status(), StatusCode::CREATED);
    expect_problem(put("if-none-match", "*", 6).await, 412, "precondition_failed").await;
    let second = put("if-match", &first_tag, 7).await;
    assert_eq!(second.status(), StatusCode::OK);
    expect_problem(put("if-match", &first_tag, 8).await, 412, "precondition_failed").await;
    let stale = answer(server.client.delete(&scan).header("if-match", first_tag)).await;
    expect_problem(stale, 412, "precondition_failed").await;
    assert_eq!(server.files("scan-sets"), 3);
    assert_eq!(answer(server.client.delete(&scan).header("if-match", etag(&second))).await.status(), 204);

    let content = files::poses(&["scan0.ply".to_owned()]);
    for address in ["poses", "pose-file"] {
        let url = server.url(&format!("{set}/{address}"));
        let put = |value: &str, content: &str| {
            answer(server.client.put(&url).header("if-match", value).body(content.to_owned()))
        };
        expect_problem(put(UNKNOWN, &content).await, 412, "precondition_failed").await;
        let stored = put("*", &content).await;
        assert_eq!(stored.status(), StatusCode::OK);
        assert_eq!(put(&etag(&stored), &files::poses(&["scan1.ply".to_owned()])).await.status(), StatusCode::OK);
        expect_problem(put(&etag(&stored), &content).await, 412, "precondition_failed").await;
    }
}

/// Of two that know the same state only one can change it.
#[tokio::test]
async fn a_state_is_used_up_by_one_change() {
    let server = TestServer::start().await;
    let set = format!("/v1/scan-sets/{}", server.scan_set(2).await);
    let url = server.url(&format!("{set}/scans/a.ply"));
    let tag = etag(&answer(server.client.put(&url).body(files::ply(4))).await);
    let changes = (0..8).map(|k| answer(server.client.put(&url).header("if-match", &tag).body(files::ply(10 + k))));
    let answers = futures_util::future::join_all(changes).await;
    let done = answers.iter().filter(|answer| answer.status() == StatusCode::OK).count();
    let refused = answers.iter().filter(|answer| answer.status() == StatusCode::PRECONDITION_FAILED).count();
    assert_eq!((done, refused), (1, 7));
}

#[tokio::test]
async fn files_are_given_in_the_state_that_is_wanted() {
    let server = TestServer::start().await;
    let (model, _) = server.model().await;
    for file in ["poses.json", "poses.conf", "report.json", "cloud.ply"] {
        let path = format!("/v1/models/{model}/{file}");
        let tag = etag(&server.get(&path).await);
        let get =
            |header: &'static str, value: &str| answer(server.client.get(server.url(&path)).header(header, value));
        assert_eq!(get("if-match", &tag).await.status(), StatusCode::OK, "{file}");
        expect_problem(get("if-match", UNKNOWN).await, 412, "precondition_failed").await;
        assert_eq!(get("if-none-match", &tag).await.status(), StatusCode::NOT_MODIFIED, "{file}");
        let ranged = server.client.get(server.url(&path)).header("if-match", UNKNOWN).header("range", "bytes=0-3");
        expect_problem(answer(ranged).await, 412, "precondition_failed").await;
    }
}

#[tokio::test]
async fn jobs_are_stopped_and_run_again_in_the_state_that_is_known_alone() {
    let server = TestServer::start().await;
    let (_, job) = server.model().await;
    for action in ["cancel", "retry"] {
        let url = server.url(&format!("/v1/jobs/{job}/{action}"));
        expect_problem(answer(server.client.post(&url).header("if-match", UNKNOWN)).await, 412, "precondition_failed")
            .await;
        let tag = etag(&server.get(&format!("/v1/jobs/{job}")).await);
        expect_problem(answer(server.client.post(&url).header("if-match", tag)).await, 409, "wrong_status").await;
    }
}

#[tokio::test]
async fn cursors_lead_back_to_their_own_list_alone() {
    let server = TestServer::start().await;
    let sets = [server.scan_set(2).await, server.scan_set(2).await, server.scan_set(2).await];
    for set in &sets {
        for _ in 0..2 {
            let job = server.post("/v1/jobs", &json!({"scan_set_id": set})).await;
            server.finished(&text(&expect_json(job, StatusCode::ACCEPTED).await, "/id")).await;
        }
    }
    let filtered = format!("/v1/jobs?limit=1&scan_set_id={}", sets[0]);
    let lists = ["/v1/scan-sets?limit=1", "/v1/jobs?limit=1", "/v1/models?limit=1", &filtered];
    let mut cursors = Vec::new();
    for list in lists {
        let page = expect_json(server.get(list).await, StatusCode::OK).await;
        cursors.push((list, text(&page, "/next_cursor")));
    }
    // ids stand in addresses: anybody can make such a cursor
    let forged = [
        "x",
        "",
        "zzzzzzzz",
        &sets[1],
        "018f0000-0000-7000-8000-000000000000",
        "~",
        "AAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA",
    ];
    for list in lists {
        for (of, cursor) in &cursors {
            let page = server.get(&format!("{list}&cursor={cursor}")).await;
            if *of == list {
                assert_eq!(
                    expect_json(page, StatusCode::OK).await["items"].as_array().map(Vec::len),
                    Some(1),
                    "{list}"
                );
            } else {
                expect_problem(page, 422, "invalid_field").await;
            }
        }
        for cursor in forged {
            expect_problem(server.get(&format!("{list}&cursor={cursor}")).await, 422, "invalid_field").await;
        }
    }
}

#[tokio::test]
async fn a_repeated_evaluation_is_the_same_one() {
    let server = TestServer::start().await;
    let url = server.url("/v1/jobs");
    let evaluate =
        |key: &'static str, body| answer(server.client.post(&url).header("idempotency-key", key).json(&body));
    let first = expect_json(evaluate("a", json!({"kind": "evaluate"})).await, StatusCode::ACCEPTED).await;
    // one that has ended is not the answer to a new request
    let job = text(&first, "/id");
    assert_eq!(server.finished(&job).await["status"], "succeeded");
    let again = evaluate("a", json!({"kind": "evaluate"})).await;
    assert_eq!(again.headers()["idempotent-replayed"], "true");
    assert_eq!(expect_json(again, StatusCode::ACCEPTED).await, first);
    let other = expect_json(evaluate("b", json!({"kind": "evaluate"})).await, StatusCode::ACCEPTED).await;
    assert!(other["id"] != first["id"], "{other}");
    let reused = evaluate("a", json!({"kind": "evaluate", "label": null})).await;
    expect_problem(reused, 422, "idempotency_key_reused").await;
    server.finished(&text(&other, "/id")).await;
    assert_eq!(server.delete(&format!("/v1/jobs/{job}")).await, StatusCode::NO_CONTENT);
    let forgotten = expect_json(evaluate("a", json!({"kind": "evaluate"})).await, StatusCode::ACCEPTED).await;
    assert!(forgotten["id"] != first["id"], "{forgotten}");
}

#[tokio::test]
async fn the_first_form_of_a_key_is_still_the_answer() {
    let server = TestServer::start().await;
    let post = || {
        let request = server.client.post(server.url("/v1/scan-sets")).header("idempotency-key", "k");
        answer(request.multipart(scan_form(2)))
    };
    let first = expect_json(post().await, StatusCode::CREATED).await;
    assert_eq!(expect_json(post().await, StatusCode::CREATED).await, first);
}
