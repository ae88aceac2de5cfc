//! Jobs over a real connection: from queued to each of the named ends, waiting, events, repeated requests.

use std::time::{Duration, Instant};

use crate::common::{Mode, TestServer, expect_json, expect_problem, files, scan_form, text};
use reqwest::StatusCode;
use reqwest::multipart::{Form, Part};
use serde_json::{Value, json};

const LONG: Mode = Mode::Slow(Duration::from_secs(60));

/// The scans in the order of a model's report.
fn reported(model: &Value) -> Vec<&str> {
    let views = model["report"]["result"]["views"].as_array().expect("views are reported");
    views.iter().map(|view| view["name"].as_str().expect("a name")).collect()
}

#[tokio::test]
async fn a_job_succeeds_and_leaves_a_model() {
    let server = TestServer::start().await;
    server.engine.set(Mode::Slow(Duration::from_millis(300)));
    let set = server.scan_set(3).await;
    let body = json!({"scan_set_id": set, "label": "face", "options": {"threads": 1, "max_rounds": 5}});
    let response = server.post("/v1/jobs", &body).await;
    assert!(response.headers().contains_key("retry-after"));
    let location = response.headers()["location"].to_str().expect("text").to_owned();
    let queued = expect_json(response, StatusCode::ACCEPTED).await;
    assert_eq!((queued["status"].as_str(), queued["progress"].as_f64()), (Some("queued"), Some(0.0)));
    assert_eq!(queued["options"]["max_rounds"], 5);
    assert_eq!(queued["options"]["min_overlap"], 0.5);
    assert_eq!(queued["links"]["self"], location);

    let job = text(&queued, "/id");
    let running = server.until(&job, "running").await;
    assert_eq!(running["attempts"], 1);
    let ended = server.finished(&job).await;
    assert_eq!((ended["status"].as_str(), ended["progress"].as_f64()), (Some("succeeded"), Some(1.0)), "{ended}");
    assert!(ended["seconds"]["registering"].as_f64().is_some_and(|s| s >= 0.25), "{ended}");
    assert!(ended["seconds"]["loading"].is_number(), "{ended}");
    assert!(ended["finished_at"].is_string());

    let model = expect_json(server.get(&text(&ended, "/links/model")).await, StatusCode::OK).await;
    assert_eq!(model["label"], "face");
    assert_eq!(model["name"], "three");
    assert_eq!(model["quality"], "good");
    assert_eq!(model["points"], 50 + 51 + 52);
    assert_eq!(model["job_id"], job);
    assert_eq!(reported(&model), ["scan0.ply", "scan1.ply", "scan2.ply"]);
    assert_eq!(model["report"]["run"]["threads"], 1);
    assert_eq!(model["report"]["run"]["job_id"], job);
}

#[tokio::test]
async fn views_are_in_the_order_of_the_pose_file() {
    let server = TestServer::start().await;
    let names = ["c.ply", "a.ply", "b.ply"];
    let form =
        names.iter().fold(Form::new(), |form, name| form.part("scans", Part::bytes(files::ply(20)).file_name(*name)));
    let conf: String = ["b.ply", "c.ply", "a.ply"].iter().map(|name| format!("bmesh {name} 0 0 0 0 0 0 1\n")).collect();
    let form = form.part("poses", Part::text(conf).file_name("x.conf")).text("options", "{\"threads\": 2}");
    let job = expect_json(server.post_form("/v1/jobs", form).await, StatusCode::ACCEPTED).await;
    let ended = server.finished(&text(&job, "/id")).await;
    let model = expect_json(server.get(&text(&ended, "/links/model")).await, StatusCode::OK).await;
    assert_eq!(reported(&model), ["b.ply", "c.ply", "a.ply"]);
}

#[tokio::test]
async fn scans_without_a_pose_are_taken_and_follow_in_natural_order() {
    let server = TestServer::start().await;
    for (poses, expected) in
        [(None, ["s2.ply", "s9.ply", "s10.ply"]), (Some("s9.ply"), ["s9.ply", "s2.ply", "s10.ply"])]
    {
        let scan = |name: &'static str| Part::bytes(files::ply(20)).file_name(name);
        let mut form = ["s10.ply", "s9.ply", "s2.ply"].into_iter().fold(Form::new(), |f, n| f.part("scans", scan(n)));
        if let Some(posed) = poses {
            form = form.part("poses", Part::text(files::poses(&[posed.to_owned()])));
        }
        let job = expect_json(server.post_form("/v1/jobs", form).await, StatusCode::ACCEPTED).await;
        let ended = server.finished(&text(&job, "/id")).await;
        let model = expect_json(server.get(&text(&ended, "/links/model")).await, StatusCode::OK).await;
        assert_eq!(reported(&model), expected);
    }
}

#[tokio::test]
async fn what_can_not_be_registered_is_refused_at_the_door() {
    let server = TestServer::start().await;
    let empty = expect_json(server.post("/v1/scan-sets", &json!({})).await, StatusCode::CREATED).await;
    let job = |id: &Value| json!({"scan_set_id": id});
    expect_problem(server.post("/v1/jobs", &job(&empty["id"])).await, 422, "too_few_scans").await;
    let one = server.post_form("/v1/scan-sets", scan_form(1)).await;
    let one = expect_json(one, StatusCode::CREATED).await;
    expect_problem(server.post("/v1/jobs", &job(&one["id"])).await, 422, "too_few_scans").await;
    let torn = Form::new().part("scans", Part::bytes(files::ply(9)).file_name("a.ply"));
    expect_problem(server.post_form("/v1/jobs", torn).await, 422, "too_few_scans").await;
    // refused in one call: nothing of it stays
    assert_eq!(server.files("scan-sets"), 1);

    let set = server.scan_set(2).await;
    for options in [json!({"min_overlap": 2}), json!({"speed": "high"}), json!({"threads": -1}), json!([])] {
        let response = server.post("/v1/jobs", &json!({"scan_set_id": set, "options": options})).await;
        expect_problem(response, 422, "invalid_options").await;
    }
    let three = expect_json(server.post_form("/v1/scan-sets", scan_form(3)).await, StatusCode::CREATED).await;
    let pairwise = json!({"scan_set_id": three["id"], "options": {"method": "tricp"}});
    expect_problem(server.post("/v1/jobs", &pairwise).await, 422, "wrong_scan_count").await;
    let unknown = server.post("/v1/jobs", &json!({"scan_set_id": "0192f0c0-0000-7000-8000-000000000000"})).await;
    expect_problem(unknown, 404, "not_found").await;
    expect_problem(server.post("/v1/jobs", &json!({"scans": set})).await, 422, "invalid_field").await;
    expect_problem(server.post("/v1/jobs", &json!([set])).await, 422, "invalid_field").await;
    expect_problem(server.get("/v1/jobs/none").await, 404, "not_found").await;
}

#[tokio::test]
async fn a_running_job_is_canceled_within_a_second() {
    let server = TestServer::start().await;
    server.engine.set(LONG);
    let job = server.job().await;
    server.until(&job, "running").await;
    let begin = Instant::now();
    let asked = server.post(&format!("/v1/jobs/{job}/cancel"), &json!({})).await;
    expect_json(asked, StatusCode::ACCEPTED).await;
    let ended = server.finished(&job).await;
    assert!(begin.elapsed() < Duration::from_secs(1), "{:?}", begin.elapsed());
    assert_eq!((ended["status"].as_str(), &ended["model_id"]), (Some("canceled"), &json!(null)));
    expect_problem(server.post(&format!("/v1/jobs/{job}/cancel"), &json!({})).await, 409, "wrong_status").await;
    assert_eq!((server.files("models"), server.files("staging")), (0, 0));

    server.engine.set(Mode::Quick);
    let again = server.post(&format!("/v1/jobs/{job}/retry"), &json!({})).await;
    expect_json(again, StatusCode::ACCEPTED).await;
    assert_eq!(server.finished(&job).await["status"], "succeeded");
    expect_problem(server.post(&format!("/v1/jobs/{job}/retry"), &json!({})).await, 409, "wrong_status").await;
}

#[tokio::test]
async fn a_waiting_job_is_canceled_at_once() {
    let server = TestServer::start().await;
    server.engine.set(LONG);
    let first = server.job().await;
    server.until(&first, "running").await;
    let second = server.job().await;
    let canceled = server.post(&format!("/v1/jobs/{second}/cancel"), &json!({})).await;
    assert_eq!(expect_json(canceled, StatusCode::ACCEPTED).await["status"], "canceled");
    let waiting = expect_json(server.get("/v1/jobs?status=running").await, StatusCode::OK).await;
    assert_eq!(waiting["items"][0]["id"], first);
    assert_eq!(server.engine.runs(), 1);
}

#[tokio::test]
async fn a_panic_ends_the_job_and_nothing_else() {
    let server = TestServer::start().await;
    server.engine.set(Mode::Panic);
    let job = server.job().await;
    let ended = server.finished(&job).await;
    assert_eq!(ended["status"], "failed");
    assert_eq!(ended["error"]["code"], "internal_panic");
    assert!(text(&ended, "/error/message").contains("told to"), "{ended}");
    server.engine.set(Mode::Quick);
    server.model().await;
}

#[tokio::test]
async fn a_failure_names_the_scan_and_the_remedy() {
    let server = TestServer::start().await;
    server.engine.set(Mode::Refuse);
    let job = server.job().await;
    let ended = server.finished(&job).await;
    let expected = json!({"code": "degenerate_scan", "scan": "scan1.ply", "message": "all points are the same",
                          "hint": "leave it out"});
    assert_eq!((ended["status"].as_str(), &ended["error"]), (Some("failed"), &expected));
}

#[tokio::test]
async fn a_scan_set_in_use_does_not_change() {
    let server = TestServer::start().await;
    server.engine.set(LONG);
    let job = server.job().await;
    let set = text(&server.until(&job, "running").await, "/links/scan_set");
    expect_problem(server.put(&format!("{set}/scans/new.ply"), files::ply(5)).await, 409, "in_use").await;
    let poses = files::poses(&["scan0.ply".to_owned()]);
    expect_problem(server.put(&format!("{set}/poses"), poses).await, 409, "in_use").await;
    assert_eq!(server.delete(&set).await, StatusCode::CONFLICT);
    assert_eq!(server.delete(&format!("/v1/jobs/{job}")).await, StatusCode::CONFLICT);
    assert_eq!(server.files("scan-sets"), 3);
}

#[tokio::test]
async fn the_queue_has_an_end() {
    let server = TestServer::start_with(|config| config.limits.queued_jobs = 1).await;
    server.engine.set(LONG);
    let first = server.job().await;
    server.until(&first, "running").await;
    let waiting = server.job().await;
    let set = server.scan_set(2).await;
    let refused = server.post("/v1/jobs", &json!({"scan_set_id": set})).await;
    assert!(refused.headers().contains_key("retry-after"));
    expect_problem(refused, 429, "queue_full").await;
    let files = server.files("scan-sets");
    expect_problem(server.post_form("/v1/jobs", scan_form(2)).await, 429, "queue_full").await;
    assert_eq!(server.files("scan-sets"), files);
    server.post(&format!("/v1/jobs/{waiting}/cancel"), &json!({})).await;
    assert_eq!(server.post("/v1/jobs", &json!({"scan_set_id": set})).await.status(), StatusCode::ACCEPTED);
}

#[tokio::test]
async fn waiting_takes_no_longer_than_asked_for() {
    let server = TestServer::start().await;
    server.engine.set(LONG);
    let job = server.job().await;
    let begin = Instant::now();
    let view = expect_json(server.get(&format!("/v1/jobs/{job}?wait=1")).await, StatusCode::OK).await;
    assert_eq!(view["status"], "running");
    assert!((0.9..3.0).contains(&begin.elapsed().as_secs_f64()), "{:?}", begin.elapsed());
    expect_problem(server.get(&format!("/v1/jobs/{job}?wait=61")).await, 422, "invalid_field").await;
}

/// The events of a stream that has ended by itself: name and data.
fn parse_events(stream: &str) -> Vec<(String, Value)> {
    let field = |block: &str, name: &str| {
        block.lines().find_map(|line| line.strip_prefix(name)).map(|rest| rest.trim().to_owned())
    };
    stream
        .split("\n\n")
        .filter_map(|block| Some((field(block, "event:")?, serde_json::from_str(&field(block, "data:")?).ok()?)))
        .collect()
}

#[tokio::test]
async fn events_end_by_themselves_with_the_job() {
    let server = TestServer::start().await;
    server.engine.set(Mode::Slow(Duration::from_secs(1)));
    let job = server.job().await;
    let response = server.get(&format!("/v1/jobs/{job}/events")).await;
    assert_eq!(response.headers()["content-type"], "text/event-stream");
    let events = parse_events(&response.text().await.expect("the stream ends"));
    let (last, progress) = events.split_last().expect("events");
    assert_eq!((last.0.as_str(), last.1["status"].as_str()), ("end", Some("succeeded")));
    assert!((3..=12).contains(&progress.len()), "{} events in a second", progress.len());
    assert!(progress.iter().all(|(name, _)| name == "progress"));
    let done: Vec<f64> = events.iter().filter_map(|(_, job)| job["progress"].as_f64()).collect();
    assert!(done.is_sorted(), "{done:?}");
    // of a job that has ended: one event
    let late = server.get(&format!("/v1/jobs/{job}/events")).await.text().await.expect("the stream ends");
    assert_eq!(parse_events(&late).len(), 1);
    expect_problem(server.get("/v1/jobs/none/events").await, 404, "not_found").await;
}

#[tokio::test]
async fn a_repeated_request_is_answered_once() {
    let server = TestServer::start().await;
    let post_set = |form: Form| {
        server.client.post(server.url("/v1/scan-sets")).header("idempotency-key", "k1").multipart(form).send()
    };
    let first = post_set(scan_form(3)).await.expect("an answer").text().await.expect("a body");
    // another boundary, the same content
    let again = post_set(scan_form(3)).await.expect("an answer");
    assert_eq!(again.headers()["idempotent-replayed"], "true");
    assert_eq!(again.status(), StatusCode::CREATED);
    assert_eq!(again.text().await.expect("a body"), first);
    assert_eq!(server.files("scan-sets"), 3);
    expect_problem(post_set(scan_form(2)).await.expect("an answer"), 422, "idempotency_key_reused").await;
    assert_eq!(server.files("staging"), 0);

    let set: Value = serde_json::from_str(&first).expect("JSON");
    let post_job = |label: &str| {
        let body = json!({"scan_set_id": set["id"], "label": label});
        server.client.post(server.url("/v1/jobs")).header("idempotency-key", "k1").json(&body).send()
    };
    let job = expect_json(post_job("face").await.expect("an answer"), StatusCode::ACCEPTED).await;
    let same = expect_json(post_job("face").await.expect("an answer"), StatusCode::ACCEPTED).await;
    assert_eq!(job, same);
    expect_problem(post_job("nose").await.expect("an answer"), 422, "idempotency_key_reused").await;
    assert_eq!(server.finished(&text(&job, "/id")).await["status"], "succeeded");
    assert_eq!(server.engine.runs(), 1);
}

#[tokio::test]
async fn of_two_requests_at_once_one_is_carried_out() {
    let server = TestServer::start().await;
    let post =
        || server.client.post(server.url("/v1/scan-sets")).header("idempotency-key", "k").multipart(scan_form(3));
    let answers = futures_util::future::join_all((0..5).map(|_| post().send())).await;
    for answer in answers {
        let status = answer.expect("an answer").status();
        assert!([StatusCode::CREATED, StatusCode::CONFLICT].contains(&status), "{status}");
    }
    let list = expect_json(server.get("/v1/scan-sets").await, StatusCode::OK).await;
    assert_eq!(list["items"].as_array().map(Vec::len), Some(1));
}

#[tokio::test]
async fn jobs_run_side_by_side_when_allowed() {
    let server = TestServer::start_with(|config| config.concurrent_jobs = 2).await;
    server.engine.set(LONG);
    let jobs = [server.job().await, server.job().await];
    for job in &jobs {
        server.until(job, "running").await;
        server.post(&format!("/v1/jobs/{job}/cancel"), &json!({})).await;
    }
    for job in &jobs {
        assert_eq!(server.finished(job).await["status"], "canceled");
    }
}
