//! Standards over a real connection: made, asked for, learned from examples, kept, deleted; and what becomes of the models
//! that are there already.

use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use crate::common::{Mode, TestServer, expect_json, expect_problem, files, text};
use reqwest::StatusCode;
use reqwest::multipart::{Form, Part};
use serde_json::{Value, json};

/// The tips of a triangle whose sides are all different.
const TIPS: [[f64; 3]; 3] = [[80.0, 0.0, 0.0], [10.0, 78.0, 0.0], [-36.0, -12.0, 70.0]];

/// A class of knobbed balls; other sizes are other instances.
fn knobbed(size: f64) -> Vec<u8> {
    files::knobbed_ball(TIPS.map(|tip| tip.map(|x| x * size)))
}

fn model_form(content: Vec<u8>) -> Form {
    Form::new().part("model", Part::bytes(content).file_name("ball.obj")).text("unit", "mm")
}

async fn upload(server: &TestServer, content: Vec<u8>) -> String {
    upload_as(server, content, "").await
}

async fn upload_as(server: &TestServer, content: Vec<u8>, label: &'static str) -> String {
    let form = if label.is_empty() { model_form(content) } else { model_form(content).text("label", label) };
    text(&expect_json(server.post_form("/v1/models", form).await, StatusCode::CREATED).await, "/id")
}

fn landmarks() -> Value {
    json!({"a": TIPS[0], "b": TIPS[1], "c": TIPS[2]})
}

fn standard_form(name: &str, landmarks: &Value) -> Form {
    model_form(knobbed(1.0)).text("name", name.to_owned()).text("landmarks", landmarks.to_string())
}

async fn make(server: &TestServer, name: &str) -> Value {
    expect_json(server.post_form("/v1/standards", standard_form(name, &landmarks())).await, StatusCode::CREATED).await
}

/// The job that judges the stored models against a new standard.
fn id_of_evaluation(standard: &Value) -> String {
    text(standard, "/evaluation").rsplit('/').next().expect("an id").to_owned()
}

async fn ask(server: &TestServer, name: &str) -> Value {
    expect_json(server.post("/v1/queries", &json!({"standard": name})).await, StatusCode::OK).await
}

/// The answer once no model waits to be judged.
async fn complete(server: &TestServer, name: &str) -> Value {
    let begin = Instant::now();
    loop {
        let answer = ask(server, name).await;
        if answer["pending"] == 0 {
            return answer;
        }
        assert!(begin.elapsed() < Duration::from_secs(60), "still {answer}");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

fn found(answer: &Value) -> Vec<String> {
    answer["matches"].as_array().expect("matches").iter().map(|found| text(found, "/model_id")).collect()
}

#[tokio::test]
async fn a_class_is_made_asked_for_and_learned() {
    let server = TestServer::start().await;
    let of_class = [upload_as(&server, knobbed(1.05), "knobs").await, upload_as(&server, knobbed(0.96), "knobs").await];
    let straight = files::knobbed_ball([[75.0, 0.0, 0.0], [-75.0, 0.0, 0.0], [0.0, 0.0, 76.0]]);
    let others =
        [upload_as(&server, files::bumpy_sphere(0.0), "other").await, upload_as(&server, straight, "other").await];
    let standard = make(&server, "knobs").await;
    assert_eq!((&standard["built_in"], &standard["threshold"]["rests_on"]), (&json!(false), &json!("default")));
    assert_eq!(standard["triangles"][0]["kinds"], json!(["cap", "cap", "cap"]));
    assert_eq!(standard["pending"], 4);
    let job = server.until(&id_of_evaluation(&standard), "succeeded").await;
    assert_eq!((&job["kind"], &job["progress"]), (&json!("evaluate"), &json!(1.0)));
    assert_eq!((&job["scan_set_id"], &job["model_id"]), (&Value::Null, &Value::Null));

    let answer = ask(&server, "knobs").await;
    assert_eq!((&answer["pending"], &answer["searched"]), (&json!(0), &json!(4)));
    let best: Vec<String> = found(&answer).into_iter().take(2).collect();
    assert!(of_class.iter().all(|id| best.contains(id)), "{answer}");

    let body = json!({"positive": of_class, "negative": others});
    let marked = server.client.put(server.url("/v1/standards/knobs/examples")).json(&body).send().await;
    let marked = expect_json(marked.expect("an answer"), StatusCode::OK).await;
    let threshold = &marked["threshold"];
    assert_eq!((&threshold["rests_on"], &threshold["positives"]), (&json!("examples"), &json!(2)));
    assert_eq!((&threshold["auc"], &threshold["leave_one_out"]), (&json!(1.0), &json!({"right": 4, "of": 4})));
    assert!(threshold["limit_mm"] != standard["threshold"]["limit_mm"], "{threshold}");
    let answer = ask(&server, "knobs").await;
    let matches: Vec<bool> = (0..4).map(|k| answer["matches"][k]["is_match"] == true).collect();
    assert_eq!(matches, [true, true, false, false], "{answer}");

    let view = expect_json(server.get(&format!("/v1/models/{}", of_class[0])).await, StatusCode::OK).await;
    let verdicts = view["verdicts"].as_array().expect("verdicts");
    let names: Vec<&str> = verdicts.iter().filter_map(|verdict| verdict["standard"].as_str()).collect();
    assert_eq!(names, ["face", "knobs"]);
    assert_eq!((&verdicts[0]["is_match"], &verdicts[1]["is_match"]), (&json!(false), &json!(true)));
    let tip = verdicts[1]["landmarks"]["b"].as_array().expect("a position");
    let beside: f64 = tip.iter().zip(TIPS[1]).map(|(x, t)| (x.as_f64().expect("a number") - 1.05 * t).powi(2)).sum();
    assert!(beside.sqrt() < 4.0, "{tip:?}");

    // the same file as a probe gets the verdict of the stored model, and another thing a no with its reason
    let of_probe = judged(&server, knobbed(1.05), "knobs").await;
    assert_eq!(of_probe["verdict"], verdicts[1]);
    assert_eq!((&of_probe["matches"], &of_probe["searched"]), (&json!([]), &json!(0)));
    let of_other = judged(&server, files::bumpy_sphere(0.0), "knobs").await["verdict"].clone();
    assert_eq!((&of_other["is_match"], &of_other["landmarks"]), (&json!(false), &Value::Null));
    assert!(of_other["reason"]["code"].is_string(), "{of_other}");
    assert_eq!(ask(&server, "knobs").await["searched"], 4, "probes are not stored");

    let path = "/v1/gallery/evaluation?standard=knobs";
    let evaluation = expect_json(server.get(path).await, StatusCode::OK).await["verdicts"].clone();
    assert_eq!((&evaluation["positives"], &evaluation["negatives"]), (&json!(2), &json!(2)));
    assert_eq!((&evaluation["label"], &evaluation["auc"]), (&json!("knobs"), &json!(1.0)));
    expect_problem(server.get(&format!("{path}&method=literal")).await, 422, "invalid_field").await;
}

fn probe_form(content: Vec<u8>, standard: &str) -> Form {
    let probe = Part::bytes(content).file_name("probe.obj");
    Form::new().part("probe", probe).text("unit", "mm").text("standard", standard.to_owned())
}

async fn judged(server: &TestServer, content: Vec<u8>, standard: &str) -> Value {
    expect_json(server.post_form("/v1/queries", probe_form(content, standard)).await, StatusCode::OK).await
}

#[tokio::test]
async fn later_models_are_judged_and_deleted_ones_forgotten() {
    let server = TestServer::start().await;
    make(&server, "knobs").await;
    assert_eq!(complete(&server, "knobs").await["matches"], json!([]));
    let model = upload(&server, knobbed(1.1)).await;
    assert_eq!(found(&complete(&server, "knobs").await), [model.as_str()]);
    let info = expect_json(server.get("/v1/info").await, StatusCode::OK).await;
    assert_eq!((&info["load"]["standards"], &info["load"]["missing_verdicts"]), (&json!(1), &json!(0)));
    let body = json!({"positive": [model]});
    let put = || server.client.put(server.url("/v1/standards/knobs/examples")).json(&body).send();
    expect_json(put().await.expect("an answer"), StatusCode::OK).await;
    assert_eq!(server.delete(&format!("/v1/models/{model}")).await, StatusCode::NO_CONTENT);
    assert_eq!(ask(&server, "knobs").await["matches"], json!([]));
    let standard = expect_json(server.get("/v1/standards/knobs").await, StatusCode::OK).await;
    assert_eq!(standard["examples"], json!({"positive": [], "negative": []}));
    expect_problem(put().await.expect("an answer"), 404, "not_found").await;

    assert_eq!(server.files("standards"), 1);
    assert_eq!(server.delete("/v1/standards/knobs").await, StatusCode::NO_CONTENT);
    assert_eq!(server.files("standards"), 0);
    expect_problem(server.get("/v1/standards/knobs").await, 404, "not_found").await;
    expect_problem(server.post("/v1/queries", &json!({"standard": "knobs"})).await, 422, "unknown_standard").await;
}

#[tokio::test]
async fn what_is_wrong_with_a_standard_is_told() {
    let server = TestServer::start().await;
    let post =
        async |name: &str, landmarks: Value| server.post_form("/v1/standards", standard_form(name, &landmarks)).await;
    expect_problem(post("a b", landmarks()).await, 422, "invalid_field").await;
    expect_problem(post("face", landmarks()).await, 409, "duplicate_standard").await;
    expect_problem(post("x", json!({"a": TIPS[0], "b": TIPS[1]})).await, 422, "too_few_landmarks").await;
    expect_problem(post("x", json!({"a": TIPS[0], "b": TIPS[1], "c": "d"})).await, 422, "invalid_field").await;
    let off =
        expect_problem(post("x", json!({"a": TIPS[0], "b": TIPS[1], "c": [0.0, 0.0, 0.0]})).await, 422, "off_surface");
    assert!(off.await["detail"].as_str().is_some_and(|detail| detail.contains("\"c\"")));
    let near = json!({"a": TIPS[0], "b": [80.0, 1.0, 0.0], "c": [80.0, 0.0, 1.0]});
    expect_problem(post("x", near).await, 422, "degenerate_triangle").await;
    let pits = standard_form("x", &landmarks())
        .text("triangle", json!([{"landmark": "a", "kind": "pit"}, "b", "c"]).to_string());
    expect_problem(server.post_form("/v1/standards", pits).await, 422, "no_character").await;
    let strangers = standard_form("x", &landmarks()).text("triangle", json!(["a", "b", "z"]).to_string());
    expect_problem(server.post_form("/v1/standards", strangers).await, 422, "invalid_field").await;
    let nobody = json!(["0192f0c0-0000-7000-8000-000000000000"]).to_string();
    let marked = standard_form("x", &landmarks()).text("positive", nobody);
    expect_problem(server.post_form("/v1/standards", marked).await, 404, "not_found").await;
    assert_eq!(server.files("standards"), 0, "what is refused leaves nothing");
    let none = server.post_form("/v1/standards", Form::new().text("name", "x").text("landmarks", "{}")).await;
    expect_problem(none, 422, "invalid_field").await;

    make(&server, "x").await;
    expect_problem(post("x", landmarks()).await, 409, "duplicate_standard").await;
    let literal = json!({"standard": "x", "method": "literal"});
    expect_problem(server.post("/v1/queries", &literal).await, 422, "invalid_field").await;
    let literal = probe_form(knobbed(1.0), "x").text("method", "literal");
    expect_problem(server.post_form("/v1/queries", literal).await, 422, "invalid_field").await;
    let of_nothing = server.post_form("/v1/queries", probe_form(knobbed(1.0), "y")).await;
    expect_problem(of_nothing, 422, "unknown_standard").await;
    let built_in = server.client.delete(server.url("/v1/standards/face")).send().await.expect("an answer");
    expect_problem(built_in, 409, "built_in").await;
    let face = expect_json(server.get("/v1/standards/face").await, StatusCode::OK).await;
    assert_eq!(face["built_in"], true);
}

#[tokio::test]
async fn it_survives_a_restart_and_is_made_once() {
    let server = TestServer::start().await;
    let post = || {
        let request = server.client.post(server.url("/v1/standards")).header("idempotency-key", "s");
        request.multipart(standard_form("knobs", &landmarks())).send()
    };
    let first = expect_json(post().await.expect("an answer"), StatusCode::CREATED).await;
    let again = expect_json(post().await.expect("an answer"), StatusCode::CREATED).await;
    assert_eq!(first, again);
    let model = upload(&server, knobbed(0.95)).await;
    complete(&server, "knobs").await;
    let folder = server.folder;
    assert!(server.handle.shutdown().await);

    let server = TestServer::start_on(folder, |_| {}).await;
    let list = expect_json(server.get("/v1/standards").await, StatusCode::OK).await;
    let names: Vec<&str> = list["items"].as_array().expect("items").iter().filter_map(|i| i["name"].as_str()).collect();
    assert_eq!(names, ["face", "knobs"]);
    assert_eq!(found(&ask(&server, "knobs").await), [model.as_str()]);
    assert_eq!(server.engine.looks.load(Ordering::Relaxed), 0, "nothing is judged twice");
}

#[tokio::test]
async fn an_evaluation_is_canceled_retried_and_outlives_a_crash() {
    let server = TestServer::start().await;
    let model = upload(&server, knobbed(1.05)).await;
    server.engine.set(Mode::Slow(Duration::from_secs(60)));
    let job = id_of_evaluation(&make(&server, "knobs").await);
    server.until(&job, "running").await;
    let answer = ask(&server, "knobs").await;
    assert_eq!((&answer["matches"], &answer["pending"]), (&json!([]), &json!(1)), "not complete, and says so");
    expect_json(server.post(&format!("/v1/jobs/{job}/cancel"), &json!({})).await, StatusCode::ACCEPTED).await;
    server.until(&job, "canceled").await;
    expect_json(server.post(&format!("/v1/jobs/{job}/retry"), &json!({})).await, StatusCode::ACCEPTED).await;
    server.until(&job, "running").await;
    let folder = server.folder;
    server.handle.abort().await;

    let server = TestServer::start_on(folder, |_| {}).await;
    let ended = server.finished(&job).await;
    assert_eq!((&ended["status"], &ended["attempts"]), (&json!("succeeded"), &json!(2)), "{ended}");
    assert_eq!(found(&complete(&server, "knobs").await), [model.as_str()]);
    let demanded = server.post("/v1/jobs", &json!({"kind": "evaluate"})).await;
    let demanded = text(&expect_json(demanded, StatusCode::ACCEPTED).await, "/id");
    assert_eq!(server.finished(&demanded).await["status"], "succeeded");
    let odd = server.post("/v1/jobs", &json!({"kind": "evaluate", "label": "x"})).await;
    expect_problem(odd, 422, "invalid_field").await;
    expect_problem(server.post("/v1/jobs", &json!({})).await, 422, "invalid_field").await;
}

#[tokio::test]
async fn signatures_of_another_version_are_made_anew() {
    let server = TestServer::start().await;
    let model = upload(&server, files::bumpy_sphere(0.3)).await;
    let folder = server.folder;
    assert!(server.handle.shutdown().await);
    let url = format!("sqlite://{}", folder.path().join("visage.sqlite").display());
    let database = sqlx::SqlitePool::connect(&url).await.expect("the database");
    sqlx::query("UPDATE signature SET version = 0, content = x'00'").execute(&database).await.expect("an old one");
    database.close().await;

    let server = TestServer::start_on(folder, |_| {}).await;
    let begin = Instant::now();
    loop {
        let load = expect_json(server.get("/v1/info").await, StatusCode::OK).await["load"].clone();
        if load["stale_signatures"] == 0 && load["searchable_models"] == 1 {
            break;
        }
        assert!(begin.elapsed() < Duration::from_secs(60), "{load}");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    assert_eq!(found(&ask(&server, "face").await), [model.as_str()]);
}
