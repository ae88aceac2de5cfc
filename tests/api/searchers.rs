//! Servers that search a part of the gallery each, and one that asks them, as processes. `.ci/nodes` has PostgreSQL and an S3 server.

use reqwest::header::RETRY_AFTER;
use reqwest::multipart::{Form, Part};
use reqwest::{Response, StatusCode};
use serde_json::{Value, json};
use sqlx::postgres::PgConnectOptions;
use sqlx::{ConnectOptions, Connection};

use crate::binary::{Process, client};
use crate::common::{expect_json, files};
use crate::nodes::{Place, delete, get, upload};

const SEARCH: &[&str] = &["--roles", "search"];

async fn ask(process: &Process, question: &Value) -> Response {
    client().post(format!("{}/v1/queries", process.url)).json(question).send().await.expect("an answer")
}

/// An answer, byte by byte.
async fn bytes(answer: Response) -> String {
    let (status, text) = (answer.status(), answer.text().await.expect("a body"));
    assert_eq!(status, StatusCode::OK, "{text}");
    text
}

/// Every kind of question that several servers answer, about some models.
fn questions(models: &[String]) -> Vec<Value> {
    let mut asked = vec![
        json!({"standard": "face", "limit": 100}),
        json!({"standard": "face", "method": "literal", "only_matches": true, "threshold": 0.1}),
        json!({"model_id": models[1], "likeness": "view"}),
        json!({"model_id": models[2], "likeness": "salient_regions", "limit": 3}),
        json!({"model_id": models[3], "filter": {"text": "ball", "units": ["mm"]}, "explain": true}),
        json!({"model_id": models[3], "filter": {"created_before": "2020-01-01T00:00:00Z"}}),
        json!({"triangle": {"sides": [31.0, 52.5, 52.5], "unit": "mm"}, "limit": 7}),
    ];
    asked.extend(models.iter().take(4).map(|model| json!({"model_id": model, "limit": 1000})));
    asked
}

/// The answers to all of them, the pages of one, and that to a probe.
async fn answers(process: &Process, models: &[String]) -> Vec<String> {
    let mut all = Vec::new();
    for question in questions(models) {
        all.push(bytes(ask(process, &question).await).await);
    }
    let mut question = json!({"model_id": models[0], "limit": 4});
    loop {
        let page = bytes(ask(process, &question).await).await;
        let next = serde_json::from_str::<Value>(&page).expect("JSON")["next_cursor"].take();
        all.push(page);
        if next.is_null() {
            break;
        }
        question["cursor"] = next;
    }
    let probe = Part::bytes(files::bumpy_sphere(0.77)).file_name("ball.obj");
    let form = Form::new().part("probe", probe).text("unit", "mm").text("limit", "50");
    let sent = client().post(format!("{}/v1/queries/probe", process.url)).multipart(form).send().await;
    all.push(bytes(sent.expect("an answer")).await);
    all
}

/// How many parts a server has.
async fn parts(process: &Process) -> usize {
    let text = get(process, "/metrics").await.text().await.expect("a body");
    let line = text.lines().find_map(|line| line.strip_prefix("visage_gallery_parts ")).expect("a figure");
    line.parse::<f64>().expect("a number") as usize
}

async fn problem(answer: Response, status: StatusCode) -> Value {
    let has_time = answer.headers().contains_key(RETRY_AFTER);
    let problem = expect_json(answer, status).await;
    assert!(problem["hint"].as_str().is_some_and(|hint| !hint.is_empty()), "{problem}");
    assert_eq!(has_time, status == StatusCode::SERVICE_UNAVAILABLE, "{problem}");
    problem
}

#[tokio::test]
#[ignore = "takes PostgreSQL and an S3 server: .ci/nodes has them"]
async fn what_several_servers_find_is_what_one_finds_whoever_of_them_is_killed() {
    let place = Place::new();
    let api = place.ready("api", &["--roles", "api,worker"]).await;
    // nobody searches yet; what is stored meanwhile is found later
    let mut models = vec![upload(&api, 0.3).await];
    let question = json!({"standard": "face"});
    let refused = problem(ask(&api, &question).await, StatusCode::SERVICE_UNAVAILABLE).await;
    assert_eq!(refused["code"], "not_searched");

    let mut first = place.ready("first", SEARCH).await;
    models.push(upload(&api, 0.35).await);
    let [second, third] = [place.ready("second", SEARCH).await, place.ready("third", SEARCH).await];
    for step in 0..18 {
        models.push(upload(&api, 0.4 + 0.05 * f64::from(step)).await);
        let found = bytes(ask(&api, &json!({"model_id": models[0], "limit": 100})).await).await;
        assert!(models[1..].iter().all(|model| found.contains(model)), "stored before: {found}");
    }
    // each has its two thirds, and no more
    while parts(&first).await + parts(&second).await + parts(&third).await != 512 {
        tokio::task::yield_now().await;
    }
    assert!(parts(&first).await < 256 && parts(&second).await < 256 && parts(&third).await < 256);
    assert_eq!(parts(&api).await, 0);
    for step in 0..6 {
        let gone = models.remove(5 + step);
        let question = json!({"model_id": models[0], "limit": 100});
        // while somebody asks all the time
        let (asking, ()) = tokio::join!(ask(&api, &question), delete(&api, &gone));
        drop(asking);
        let found = bytes(ask(&api, &question).await).await;
        assert!(!found.contains(&gone), "deleted before: {found}");
    }
    let expected = answers(&api, &models).await;
    assert!(!expected.iter().any(|answer| answer.contains("\"partial\"")));

    first.signal("-KILL");
    first.child.wait().expect("it ends");
    assert_eq!(answers(&api, &models).await, expected, "the others have what it had");

    // it comes back at another address
    let first = place.ready("first", SEARCH).await;
    second.signal("-KILL");
    drop(second);
    assert_eq!(answers(&api, &models).await, expected);

    third.signal("-KILL");
    drop(third);
    let question = json!({"model_id": models[0], "limit": 100});
    let refused = problem(ask(&api, &question).await, StatusCode::SERVICE_UNAVAILABLE).await;
    assert_eq!(refused["code"], "not_searched");
    let agreed = json!({"model_id": models[0], "limit": 100, "partial": true});
    let answer = expect_json(ask(&api, &agreed).await, StatusCode::OK).await;
    assert_eq!(answer["partial"], true);
    let all: Value = serde_json::from_str(&expected[7]).expect("JSON");
    let all = all["matches"].as_array().expect("matches");
    let some = answer["matches"].as_array().expect("matches");
    assert!(some.len() < all.len() && some.iter().all(|found| all.contains(found)), "{answer}");

    drop(first);
    problem(ask(&api, &question).await, StatusCode::SERVICE_UNAVAILABLE).await;
    let answer = expect_json(ask(&api, &agreed).await, StatusCode::OK).await;
    assert_eq!((&answer["partial"], &answer["matches"], &answer["searched"]), (&json!(true), &json!([]), &json!(0)));

    // one that has everything answers the same, alone and to the other
    let whole = place.ready("whole", &["--roles", "api,search"]).await;
    assert_eq!(answers(&whole, &models).await, expected);
    while ask(&api, &question).await.status() != StatusCode::OK {
        tokio::task::yield_now().await;
    }
    assert_eq!(answers(&api, &models).await, expected);
    assert_eq!(bytes(ask(&api, &agreed).await).await, bytes(ask(&whole, &question).await).await, "it is not partial");
}

#[tokio::test]
#[ignore = "takes PostgreSQL and an S3 server: .ci/nodes has them"]
async fn a_server_that_is_stopped_in_its_tracks_is_passed_over() {
    let place = Place::new();
    let api = place.ready("api", &["--roles", "api"]).await;
    let [first, second] = [place.ready("first", SEARCH).await, place.ready("second", SEARCH).await];
    let models = [upload(&api, 0.3).await, upload(&api, 0.5).await];
    let question = json!({"model_id": models[0]});
    let expected = bytes(ask(&api, &question).await).await;
    assert!(expected.contains(&models[1]));
    // its system still takes connections for it
    first.signal("-STOP");
    assert_eq!(bytes(ask(&api, &question).await).await, expected);
    drop(second);
    problem(ask(&api, &question).await, StatusCode::SERVICE_UNAVAILABLE).await;
    first.signal("-CONT");
    while ask(&api, &question).await.status() != StatusCode::OK {
        tokio::task::yield_now().await;
    }
    assert_eq!(bytes(ask(&api, &question).await).await, expected);
}

#[tokio::test]
#[ignore = "takes PostgreSQL and an S3 server: .ci/nodes has them"]
async fn what_takes_the_whole_index_is_refused_where_there_is_none() {
    let place = Place::new();
    let api = place.ready("api", &["--roles", "api"]).await;
    let searcher = place.ready("searcher", SEARCH).await;
    for path in ["/v1/gallery/duplicates", "/v1/gallery/evaluation", "/v1/gallery/evaluation.svg"] {
        let refused = problem(get(&api, path).await, StatusCode::CONFLICT).await;
        assert_eq!(refused["code"], "index_elsewhere", "{path}");
    }
    assert!(get(&api, "/v1/info").await.json::<Value>().await.expect("JSON")["load"]["searchable_models"].is_null());
    for path in ["/v1/models", "/", "/openapi.yaml"] {
        assert_eq!(get(&searcher, path).await.status(), StatusCode::NOT_FOUND, "{path}");
    }
    let everywhere = place.refused(
        &place.folder("everywhere"),
        &["--roles", "search", "--objects", place.objects(), "--objects-endpoint", &crate::nodes::endpoint()],
        "0.0.0.0:0",
    );
    assert!(everywhere.contains("--node-address"), "{everywhere}");
}

#[tokio::test]
#[ignore = "takes PostgreSQL and an S3 server: .ci/nodes has them"]
async fn nobody_but_servers_of_the_database_is_answered_and_nonsense_ends_nothing() {
    let place = Place::new();
    let api = place.ready("api", &["--roles", "api"]).await;
    let searcher = place.ready("searcher", SEARCH).await;
    let options: PgConnectOptions = place.database().secret().parse().expect("an address");
    let mut database = options.connect().await.expect("a database");
    let secret: String =
        sqlx::query_scalar("SELECT secret FROM gallery_secret").fetch_one(&mut database).await.expect("one");
    let node: String =
        sqlx::query_scalar("SELECT node_id FROM gallery_searcher").fetch_one(&mut database).await.expect("one");
    database.close().await.expect("closed");
    assert!(secret.len() >= 64);

    let send = |process: &Process, shown: Option<&str>, body: Vec<u8>| {
        let request = client().post(format!("{}/internal/search", process.url)).body(body);
        shown.iter().fold(request, |request, shown| request.bearer_auth(shown)).send()
    };
    let question = |change: &dyn Fn(&mut Value)| {
        let mut question = json!({
            "rules": 1, "node": node, "version": 0, "parts": "f".repeat(64), "limit": 5, "threshold": null, "only_matches": false,
            "about": {"built_in": {"standard": "face", "method": "verified"}}, "words": [], "after": null,
            "filter": {"labels": [], "label_prefix": null, "created_after_ms": null, "created_before_ms": null, "units": [], "source": null},
        });
        change(&mut question);
        question.to_string().into_bytes()
    };
    let sound = question(&|_| ());
    assert_eq!(send(&searcher, Some(&secret), sound.clone()).await.expect("an answer").status(), StatusCode::OK);
    for shown in [None, Some(""), Some("x"), Some(&secret[1..]), Some(&format!("{secret}0"))] {
        let refused = send(&searcher, shown, sound.clone()).await.expect("an answer");
        let refused = expect_json(refused, StatusCode::UNAUTHORIZED).await;
        assert!(!refused.to_string().contains(&secret), "{refused}");
    }
    // a server that does not search has no such place, and takes the secret for a key that it does not know
    assert_eq!(send(&api, None, sound.clone()).await.expect("an answer").status(), StatusCode::NOT_FOUND);
    let refused = send(&api, Some(&secret), sound.clone()).await.expect("an answer");
    assert_eq!(refused.status(), StatusCode::UNAUTHORIZED);
    for (body, status) in [
        (Vec::new(), StatusCode::BAD_REQUEST),
        (b"\xff\xfe".to_vec(), StatusCode::BAD_REQUEST),
        (vec![b'['; 1 << 20], StatusCode::BAD_REQUEST),
        (vec![b' '; 3 << 20], StatusCode::PAYLOAD_TOO_LARGE),
        (question(&|q| q["rules"] = json!(2)), StatusCode::BAD_REQUEST),
        (question(&|q| q["limit"] = json!(u64::MAX)), StatusCode::BAD_REQUEST),
        (question(&|q| q["parts"] = json!("x")), StatusCode::BAD_REQUEST),
        (
            question(&|q| q["about"] = json!({"probe": {"signature": "AAAA", "stored": null, "likeness": "shape"}})),
            StatusCode::BAD_REQUEST,
        ),
        (question(&|q| q["node"] = json!("0199c6a0-6d5b-7a35-9d2c-6f3b8d1e4a71")), StatusCode::FORBIDDEN),
        // no database of ours has come so far
        (question(&|q| q["version"] = json!(u64::MAX)), StatusCode::SERVICE_UNAVAILABLE),
        (question(&|q| q["version"] = json!(1_000_000)), StatusCode::SERVICE_UNAVAILABLE),
    ] {
        let shown = String::from_utf8_lossy(&body[..body.len().min(100)]).into_owned();
        let answer = send(&searcher, Some(&secret), body).await.expect("an answer");
        let problem = expect_json(answer, status).await;
        assert!(problem["code"].is_string() && !problem.to_string().contains(&secret), "{shown}: {problem}");
    }
    let answer = expect_json(get(&searcher, "/healthz").await, StatusCode::OK).await;
    assert_eq!(answer["roles"], json!(["search"]));
    bytes(ask(&api, &json!({"standard": "face"})).await).await;
}
