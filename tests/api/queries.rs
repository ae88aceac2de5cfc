//! Queries over a real connection: triangles, verdicts on probes, filters, pages, explanations, the evaluation of the
//! gallery, and what a deletion leaves.

use crate::common::{TestServer, expect_json, expect_problem, files, text};
use reqwest::StatusCode;
use reqwest::multipart::{Form, Part};
use serde_json::{Value, json};
use visage::synthetic::head::{Proportions, head};

fn ball(phase: f64) -> Part {
    Part::bytes(files::bumpy_sphere(phase)).file_name("ball.obj")
}

/// A head made by code.
fn face(seed: u64) -> (Part, visage::synthetic::Specimen) {
    let specimen = head(&Proportions::of(seed));
    (Part::bytes(files::obj(&specimen.mesh)).file_name("head.obj"), specimen)
}

async fn upload(server: &TestServer, file: Part, label: Option<&str>, unit: &str) -> Value {
    let form = Form::new().part("model", file).text("unit", unit.to_owned());
    let form = label.into_iter().fold(form, |form, label| form.text("label", label.to_owned()));
    expect_json(server.post_form("/v1/models", form).await, StatusCode::CREATED).await
}

async fn ask(server: &TestServer, question: &Value) -> Value {
    expect_json(server.post("/v1/queries", question).await, StatusCode::OK).await
}

fn found(answer: &Value) -> Vec<String> {
    answer["matches"].as_array().expect("matches").iter().map(|found| text(found, "/model_id")).collect()
}

async fn ready() -> TestServer {
    let server = TestServer::start().await;
    while server.get("/readyz").await.status() != StatusCode::OK {
        tokio::time::sleep(std::time::Duration::from_millis(10)).await;
    }
    server
}

/// Balls 0 to 4, labelled `ball/0` and so on, in turn millimetres and of unknown unit; their ids.
async fn balls(server: &TestServer) -> Vec<String> {
    let mut ids = Vec::new();
    for (index, unit) in ["mm", "unknown", "mm", "unknown", "mm"].into_iter().enumerate() {
        let model = upload(server, ball(0.4 * index as f64), Some(&format!("ball/{index}")), unit).await;
        ids.push(text(&model, "/id"));
    }
    ids
}

fn near(place: &Value, truth: &visage::geometry::Point3, within: f64) -> bool {
    let place: Vec<f64> = serde_json::from_value(place.clone()).expect("a place");
    (visage::geometry::Point3::new(place[0], place[1], place[2]) - truth).norm() < within
}

#[tokio::test]
async fn a_face_is_answered_with_its_landmarks_and_anything_else_with_a_reason() {
    let server = ready().await;
    let (file, truth) = face(5);
    let head = upload(&server, file, Some("face"), "mm").await;
    let other = upload(&server, ball(0.0), None, "mm").await;
    let answer = ask(&server, &json!({"standard": "face", "explain": true})).await;
    let (first, second) = (&answer["matches"][0], &answer["matches"][1]);
    assert_eq!((&first["model_id"], &first["is_match"], &first["reason"]), (&head["id"], &json!(true), &json!(null)));
    assert!(near(&first["landmarks"]["nose_tip"], &truth.landmarks["nose_tip"], 8.0), "{first}");
    assert!(first["dense_residual_mm"].as_f64().is_some_and(|mm| mm < 2.5) && first["unit"] == "mm");
    assert!(first["coverage"].as_f64().is_some_and(|share| share > 0.8));
    let explain = &first["explain"];
    assert_eq!(explain["scores"]["verified"], first["score"]);
    assert!(explain["candidates"].as_u64() > Some(0) && explain["thresholds"]["score"] == 0.5, "{explain}");
    assert_eq!((&second["model_id"], &second["is_match"]), (&other["id"], &json!(false)));
    assert!(second["landmarks"].is_null() && second["reason"]["code"].is_string(), "{second}");

    // the model itself shows the same, and nothing of a match is left out when asked for matches alone
    let view = expect_json(server.get(&text(&head, "/href")).await, StatusCode::OK).await;
    assert_eq!(view["verdicts"][0]["landmarks"], first["landmarks"]);
    assert_eq!(head["verdicts"], view["verdicts"]);
    let faces = ask(&server, &json!({"standard": "face", "only_matches": true})).await;
    assert_eq!(found(&faces), [text(&head, "/id")]);
    assert!(faces["matches"][0]["explain"].is_null());
    let strict = ask(&server, &json!({"standard": "face", "threshold": 1.0, "limit": 1})).await;
    assert_eq!(strict["matches"][0]["reason"]["code"], "below_threshold");

    // an uploaded probe is judged without being stored
    let (file, _) = face(6);
    let form = Form::new().part("probe", file).text("standard", "face").text("unit", "mm").text("explain", "true");
    let answer = expect_json(server.post_form("/v1/queries", form).await, StatusCode::OK).await;
    assert_eq!((&answer["verdict"]["is_match"], &answer["matches"]), (&json!(true), &json!([])));
    assert!(answer["verdict"]["landmarks"]["chin"].is_array() && answer["explain"]["regions"].is_u64());
    let form = Form::new().part("probe", ball(1.0)).text("standard", "face").text("method", "descriptors");
    let answer = expect_json(server.post_form("/v1/queries", form).await, StatusCode::OK).await;
    assert_eq!((&answer["verdict"]["is_match"], &answer["verdict"]["method"]), (&json!(false), &json!("descriptors")));
    assert!(answer["verdict"]["reason"]["text"].is_string(), "{answer}");
    assert_eq!((server.files("models"), server.files("staging")), (4, 0));
}

#[tokio::test]
async fn a_triangle_finds_the_models_it_was_taken_from() {
    let server = ready().await;
    balls(&server).await;
    let owner = text(&upload(&server, face(5).0, None, "mm").await, "/id");
    // a face's: the balls share symmetric ones among each other
    let judged = ask(&server, &json!({"standard": "face", "method": "descriptors", "limit": 1})).await;
    assert_eq!(found(&judged), [owner.as_str()]);
    let triangle = judged["matches"][0]["triangle"].clone();
    let answer = ask(&server, &json!({"triangle": triangle})).await;
    assert_eq!(found(&answer).len(), 6);
    assert_eq!((&answer["matches"][0]["model_id"], &answer["matches"][0]["is_match"]), (&json!(owner), &json!(true)));
    assert!(answer["matches"][0]["matching_error_mm"].as_f64().is_some_and(|error| error < 1e-3), "{answer}");
    let errors: Vec<f64> = answer["matches"]
        .as_array()
        .expect("matches")
        .iter()
        .filter_map(|found| found["matching_error_mm"].as_f64())
        .collect();
    assert!(errors.len() == 6 && errors.is_sorted(), "{errors:?}");

    // the same by its sides, in another unit: the same models, errors in millimetres of this triangle
    let corners: Vec<Vec<f64>> = serde_json::from_value(triangle).expect("a triangle");
    let side = |a: usize, b: usize| (0..3).map(|k| (corners[a][k] - corners[b][k]).powi(2)).sum::<f64>().sqrt();
    let sides = [side(0, 1), side(1, 2), side(2, 0)];
    let by = |unit: &str| json!({"triangle": {"sides": sides, "unit": unit}});
    let (mm, cm) = (ask(&server, &by("mm")).await, ask(&server, &by("cm")).await);
    assert_eq!(found(&mm), found(&answer));
    assert_eq!(found(&cm), found(&answer));
    let last = |answer: &Value| answer["matches"][5]["matching_error_mm"].as_f64().expect("an error");
    assert!((last(&cm) / last(&mm) - 10.0).abs() < 1e-9);
    for wrong in [json!([[0, 0, 0], [1, 1, 1], [2, 2, 2]]), json!({"sides": [1, 2, 4]}), json!([[0, 0], [1, 0]])] {
        expect_problem(server.post("/v1/queries", &json!({"triangle": wrong})).await, 422, "invalid_field").await;
    }
}

#[tokio::test]
async fn filters_choose_models_and_pages_go_on_where_the_last_one_ended() {
    let server = ready().await;
    let ids = balls(&server).await;
    let view = expect_json(server.get(&format!("/v1/models/{}", ids[1])).await, StatusCode::OK).await;
    let chosen = |filter: Value| {
        let (server, ids) = (&server, &ids);
        async move {
            let answer = ask(server, &json!({"standard": "face", "filter": filter})).await;
            let mut places: Vec<usize> =
                found(&answer).iter().filter_map(|id| ids.iter().position(|known| known == id)).collect();
            places.sort();
            places
        }
    };
    assert_eq!(chosen(json!({"labels": ["ball/3", "ball/1", "owl"]})).await, [1, 3]);
    assert_eq!(chosen(json!({"label_prefix": "ball/"})).await, [0, 1, 2, 3, 4]);
    assert_eq!(chosen(json!({"units": ["mm"], "label_prefix": "ball"})).await, [0, 2, 4]);
    assert_eq!(chosen(json!({"created_after": view["created_at"]})).await, [2, 3, 4]);
    assert_eq!(chosen(json!({"created_before": view["created_at"]})).await, [0]);
    assert_eq!(chosen(json!({"source": "registered"})).await, [0; 0]);
    assert_eq!(chosen(json!({"text": "BALL /3"})).await, [3]);
    assert_eq!(chosen(json!({"text": "ball", "units": ["mm"]})).await, [0, 2, 4]);
    assert_eq!(chosen(json!({"text": "owl"})).await, [0; 0]);
    for wrong in
        [json!({"labels": []}), json!({"text": " "}), json!({"colour": "red"}), json!({"created_after": "yesterday"})]
    {
        let question = json!({"standard": "face", "filter": wrong});
        expect_problem(server.post("/v1/queries", &question).await, 422, "invalid_field").await;
    }

    let question = json!({"model_id": ids[0], "limit": 2, "filter": {"label_prefix": "ball"}});
    let whole = found(&ask(&server, &json!({"model_id": ids[0], "filter": {"label_prefix": "ball"}})).await);
    let first = ask(&server, &question).await;
    let mut next = question.clone();
    next["cursor"] = first["next_cursor"].clone();
    // one that was shown goes, another comes: nobody is shown twice or left out
    assert_eq!(server.delete(&format!("/v1/models/{}", found(&first)[0])).await, StatusCode::NO_CONTENT);
    let second = ask(&server, &next).await;
    assert_eq!([found(&first), found(&second)].concat(), whole);
    assert!(second["next_cursor"].is_null(), "{second}");
    next["filter"] = json!({"label_prefix": "bal"});
    let problem = expect_problem(server.post("/v1/queries", &next).await, 422, "invalid_field").await;
    assert!(text(&problem, "/detail").contains("another question"));
}

#[tokio::test]
async fn the_gallery_is_evaluated_by_its_labels() {
    let server = ready().await;
    let path = "/v1/gallery/evaluation";
    expect_problem(server.get(path).await, 422, "too_few_labels").await;
    expect_problem(server.get("/v1/gallery/evaluation?standard=teapot").await, 422, "unknown_standard").await;
    for seed in [5, 6] {
        upload(&server, face(seed).0, Some("face"), "mm").await;
    }
    let alone = expect_json(server.get(path).await, StatusCode::OK).await;
    assert!(alone["verdicts"].is_null() && alone["rankings"]["probes"] == 2, "{alone}");
    for phase in [0.0, 0.02, 0.04] {
        upload(&server, ball(phase), Some("ball"), "mm").await;
    }
    upload(&server, ball(2.0), None, "mm").await;
    let evaluation = expect_json(server.get(path).await, StatusCode::OK).await;
    assert_eq!((&evaluation["models"], &evaluation["labels"]), (&json!(5), &json!(2)));
    let verdicts = &evaluation["verdicts"];
    assert_eq!((&verdicts["positives"], &verdicts["negatives"]), (&json!(2), &json!(3)));
    assert_eq!((&verdicts["auc"], &verdicts["equal_error_rate"]), (&json!(1.0), &json!(0.0)));
    assert_eq!(verdicts["auc_interval"], json!([1.0, 1.0]));
    let rankings = &evaluation["rankings"];
    assert_eq!((&rankings["probes"], &rankings["nearest_neighbour"]), (&json!(5), &json!(1.0)));
    assert_eq!(rankings["classes"][0]["label"], "ball");
    let balls = expect_json(server.get(&format!("{path}?label_prefix=ball")).await, StatusCode::OK).await;
    assert_eq!((&balls["models"], &balls["verdicts"]), (&json!(3), &json!(null)));

    let plot = server.get("/v1/gallery/evaluation.svg").await;
    assert_eq!((plot.status(), plot.headers()["content-type"].to_str().ok()), (StatusCode::OK, Some("image/svg+xml")));
    let plot = plot.text().await.expect("a body");
    assert!(plot.starts_with("<svg") && plot.contains("AUC 1.000"), "{plot}");
}

#[tokio::test]
async fn a_deleted_face_leaves_nothing_behind() {
    let server = ready().await;
    let (file, _) = face(7);
    let form = || Form::new().text("name", "somebody in particular").text("unit", "mm").text("label", "face");
    let request = server.client.post(server.url("/v1/models")).header("idempotency-key", "once");
    let request = request.multipart(form().part("model", file));
    let model = expect_json(request.send().await.expect("an answer"), StatusCode::CREATED).await;
    let holds = || {
        let files = std::fs::read_dir(server.folder.path()).expect("a folder").map(|e| e.expect("an entry").path());
        let bytes: Vec<u8> =
            files.filter(|file| file.is_file()).flat_map(|f| std::fs::read(f).expect("a file")).collect();
        [&b"somebody in particular"[..], b"VSIG"].map(|what| bytes.windows(what.len()).any(|w| w == what))
    };
    assert_eq!(holds(), [true, true]);
    assert_eq!(server.delete(&text(&model, "/href")).await, StatusCode::NO_CONTENT);
    assert_eq!(holds(), [false, false], "neither name nor signature is in the database or its log");
    assert_eq!((server.files("models"), server.files("staging")), (0, 0));
    assert_eq!(ask(&server, &json!({"standard": "face"})).await["searched"], 0);
    // the key's answer went too: the same request stores anew
    let request = server.client.post(server.url("/v1/models")).header("idempotency-key", "once");
    let again = request.multipart(form().part("model", face(7).0)).send().await.expect("an answer");
    assert!(!again.headers().contains_key("idempotent-replayed"));
    assert_ne!(expect_json(again, StatusCode::CREATED).await["id"], model["id"]);
}

/// A plank of eight vertices, or with vertices of their own for every triangle, half of them wound the other way and turned about z.
fn plank(is_other_mesh: bool) -> Part {
    let corner = |k: usize| [(k & 1) as f64, 2.0 * (k >> 1 & 1) as f64, 5.0 * (k >> 2) as f64];
    let quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];
    let triangles: Vec<[usize; 3]> = quads.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    let mut obj = String::new();
    if !is_other_mesh {
        (0..8).map(corner).for_each(|[x, y, z]| obj += &format!("v {x} {y} {z}\n"));
        triangles.iter().for_each(|[a, b, c]| obj += &format!("f {} {} {}\n", a + 1, b + 1, c + 1));
        return Part::bytes(obj.into_bytes()).file_name("plank.obj");
    }
    for (number, [a, b, c]) in triangles.into_iter().enumerate() {
        let turned = |[x, y, z]: [f64; 3]| format!("v {} {} {}\n", 0.6 * x - 0.8 * y + 7.0, 0.8 * x + 0.6 * y, z);
        [a, b, c].map(corner).map(turned).iter().for_each(|line| obj += line);
        let first = 3 * number + 1;
        let [second, third] = if number % 2 == 0 { [first + 1, first + 2] } else { [first + 2, first + 1] };
        obj += &format!("f {first} {second} {third}\n");
    }
    Part::bytes(obj.into_bytes()).file_name("other.obj")
}

#[tokio::test]
async fn a_thing_is_found_by_its_shape_however_it_is_meshed() {
    let server = ready().await;
    balls(&server).await;
    let own = text(&upload(&server, plank(false), Some("plank"), "unknown").await, "/id");
    let form = Form::new().part("probe", plank(true));
    let answer = expect_json(server.post_form("/v1/queries", form).await, StatusCode::OK).await;
    let (first, second) = (&answer["matches"][0], &answer["matches"][1]);
    assert_eq!((&first["model_id"], &first["is_match"]), (&json!(own), &json!(true)), "{answer}");
    assert!(first["score"].as_f64() > Some(0.9) && second["score"].as_f64() < Some(0.5), "{answer}");

    // the paper's way is there, too; a plank has no salient region
    let paper = ask(&server, &json!({"model_id": own, "likeness": "salient_regions"})).await;
    assert!(paper["matches"].as_array().expect("matches").iter().all(|found| found["is_match"] == false), "{paper}");
    // seen from a side a plank is like no ball
    let form = Form::new().part("probe", plank(true)).text("likeness", "view");
    let seen = expect_json(server.post_form("/v1/queries/probe", form).await, StatusCode::OK).await;
    assert_eq!(seen["matches"][0]["model_id"], json!(own), "{seen}");
    let wrong = json!({"model_id": own, "likeness": "colour"});
    assert_eq!(server.post("/v1/queries", &wrong).await.status(), StatusCode::UNPROCESSABLE_ENTITY);
    let standard = json!({"standard": "face", "likeness": "shape"});
    let problem = expect_problem(server.post("/v1/queries", &standard).await, 422, "invalid_field").await;
    assert!(text(&problem, "/detail").contains("likeness"), "{problem}");
    let form = Form::new().part("probe", plank(true)).text("likeness", "colour");
    expect_problem(server.post_form("/v1/queries", form).await, 422, "invalid_field").await;
}
