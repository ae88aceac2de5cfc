//! Models and queries over a real connection: files with ETag and ranges, the gallery, deletion of all that is derived.

use crate::common::{Mode, TestServer, expect_json, expect_problem, files, text};
use reqwest::StatusCode;
use reqwest::multipart::{Form, Part};
use serde_json::{Value, json};

fn model_form(phase: f64, label: &str) -> Form {
    let mesh = Part::bytes(files::bumpy_sphere(phase)).file_name("ball.obj");
    Form::new().part("model", mesh).text("label", label.to_owned()).text("unit", "mm")
}

async fn upload(server: &TestServer, phase: f64, label: &str) -> Value {
    expect_json(server.post_form("/v1/models", model_form(phase, label)).await, StatusCode::CREATED).await
}

async fn ask(server: &TestServer, question: &Value) -> Value {
    expect_json(server.post("/v1/queries", question).await, StatusCode::OK).await
}

fn found(answer: &Value) -> Vec<String> {
    answer["matches"].as_array().expect("matches").iter().map(|found| text(found, "/model_id")).collect()
}

/// The gallery is loaded in the background.
async fn ready(server: &TestServer) {
    while server.get("/readyz").await.status() != StatusCode::OK {
        tokio::time::sleep(std::time::Duration::from_millis(10)).await;
    }
}

#[tokio::test]
async fn a_registered_model_has_its_files() {
    let server = TestServer::start().await;
    let (model, _) = server.model().await;
    let view = expect_json(server.get(&format!("/v1/models/{model}")).await, StatusCode::OK).await;
    let names: Vec<String> =
        view["assets"].as_array().expect("assets").iter().map(|asset| text(asset, "/name")).collect();
    assert_eq!(names, ["cloud.ply", "poses.conf", "poses.json", "report.json"]);
    for asset in view["assets"].as_array().expect("assets") {
        let response = server.get(&text(asset, "/href")).await;
        assert_eq!(response.headers()["content-type"], text(asset, "/media_type").as_str());
        let content = response.bytes().await.expect("a body");
        assert_eq!(content.len() as u64, asset["bytes"].as_u64().expect("a size"));
        assert_eq!(blake3::hash(&content).to_hex().as_str(), text(asset, "/checksum"));
    }
    let poses = expect_json(server.get(&format!("/v1/models/{model}/poses.json")).await, StatusCode::OK).await;
    assert_eq!(poses["scan2.ply"][0], json!([1.0, 0.0, 0.0, 0.0]));
    let conf = server.get(&format!("/v1/models/{model}/poses.conf")).await.text().await.expect("a body");
    assert_eq!(conf.lines().count(), 3);
    for missing in ["mesh.glb", "..%2Fposes.json", "%2e%2e"] {
        expect_problem(server.get(&format!("/v1/models/{model}/{missing}")).await, 404, "not_found").await;
    }
}

#[tokio::test]
async fn a_mesh_of_a_registered_model_is_served_beside_its_cloud() {
    let server = TestServer::start().await;
    server.engine.set(Mode::Meshed);
    let (model, _) = server.model().await;
    let view = expect_json(server.get(&format!("/v1/models/{model}")).await, StatusCode::OK).await;
    let assets = view["assets"].as_array().expect("assets");
    let mesh = assets.iter().find(|asset| asset["name"] == "mesh.ply").expect("a mesh is listed");
    let response = server.get(&format!("/v1/models/{model}/mesh.ply")).await;
    assert_eq!(response.headers()["content-type"], text(mesh, "/media_type").as_str());
    let content = response.bytes().await.expect("a body");
    assert_eq!(blake3::hash(&content).to_hex().as_str(), text(mesh, "/checksum"));
    assert!(content.windows(22).any(|line| line == b"property float support"));
    let read = visage::formats::read_surface("mesh.ply", &content, &visage::formats::ReadLimits::default());
    assert_eq!(read.expect("own files are read").faces, [[0, 1, 2]]);
    // what says how many points a model has is its cloud
    let cloud = server.get(&format!("/v1/models/{model}/cloud.ply")).await.bytes().await.expect("a body");
    let cloud = visage::formats::read_surface("cloud.ply", &cloud, &visage::formats::ReadLimits::default());
    assert_eq!(view["points"], cloud.expect("own files are read").cloud.len());
}

#[tokio::test]
async fn what_is_dropped_of_an_uploaded_model_is_counted() {
    let server = TestServer::start().await;
    let ball = [files::bumpy_sphere(0.3), b"f 1 2 99999\nv nan 0 0\n".to_vec()].concat();
    let form = Form::new().part("model", Part::bytes(ball).file_name("ball.obj"));
    let created = expect_json(server.post_form("/v1/models", form).await, StatusCode::CREATED).await;
    assert_eq!((&created["reading"]["faces"], &created["reading"]["no_return"]), (&json!(1), &json!(1)), "{created}");
    let view = expect_json(server.get(&format!("/v1/models/{}", text(&created, "/id"))).await, StatusCode::OK).await;
    assert_eq!(view["reading"], created["reading"]);
    assert_eq!(upload(&server, 0.1, "ball").await["reading"], json!(null));
}

#[tokio::test]
async fn files_are_fetched_in_part_and_only_when_new() {
    let server = TestServer::start().await;
    let (model, _) = server.model().await;
    let url = server.url(&format!("/v1/models/{model}/cloud.ply"));
    let whole = server.client.get(&url).send().await.expect("an answer");
    let etag = whole.headers()["etag"].clone();
    let whole = whole.bytes().await.expect("a body");

    let known = server.client.get(&url).header("if-none-match", &etag).send().await.expect("an answer");
    assert_eq!(known.status(), StatusCode::NOT_MODIFIED);
    assert_eq!(known.headers()["etag"], etag);
    assert!(known.bytes().await.expect("no body").is_empty());

    let part = |range: &str| server.client.get(&url).header("range", range.to_owned());
    let answer = part("bytes=3-9").send().await.expect("an answer");
    assert_eq!(answer.status(), StatusCode::PARTIAL_CONTENT);
    assert_eq!(answer.headers()["content-range"], format!("bytes 3-9/{}", whole.len()).as_str());
    assert_eq!(answer.headers()["content-length"], "7");
    assert_eq!(answer.bytes().await.expect("a body"), whole[3..=9]);
    let tail = part("bytes=-4").send().await.expect("an answer").bytes().await.expect("a body");
    assert_eq!(tail, whole[whole.len() - 4..]);
    let beyond = part("bytes=99999999-").send().await.expect("an answer");
    assert_eq!(beyond.headers()["content-range"], format!("bytes */{}", whole.len()).as_str());
    expect_problem(beyond, 416, "range_not_satisfiable").await;
    let changed = part("bytes=3-9").header("if-range", "\"other\"").send().await.expect("an answer");
    assert_eq!(changed.status(), StatusCode::OK);

    let head = server.client.head(&url).send().await.expect("an answer");
    assert_eq!(head.headers()["content-length"], whole.len().to_string().as_str());
}

/// A model in every format that is written, and in some more, kept and sent as the table of formats says.
#[tokio::test]
async fn an_uploaded_model_comes_back_as_it_was_sent() {
    let server = TestServer::start().await;
    let limits = visage::formats::ReadLimits::default();
    let obj = files::bumpy_sphere(0.0);
    let surface = visage::formats::read_surface("ball.obj", &obj, &limits).expect("sound");
    let rows: String = surface.cloud.points.iter().map(|p| format!("{} {} {}\n", p.x, p.y, p.z)).collect();
    let count = surface.cloud.len();
    let pcd = format!("FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH {count}\nHEIGHT 1\nDATA ascii\n{rows}");
    let mesh = surface.mesh().expect("faces");
    let sent = [
        ("mesh.obj", obj),
        ("mesh.ply", visage::formats::ply::write_mesh(&mesh)),
        ("mesh.stl", visage::formats::stl::write_mesh(&mesh)),
        ("mesh.glb", visage::formats::gltf::write_mesh(&mesh)),
        ("mesh.3mf", visage::formats::threemf::write_mesh(&(&mesh).into())),
        ("cloud.e57", visage::formats::e57::write_cloud(&surface.cloud)),
        ("cloud.las", visage::formats::las::write_cloud(&surface.cloud)),
        // the head says whether it is compressed
        ("cloud.laz", visage::formats::las::write_cloud(&surface.cloud)),
        ("cloud.pcd", pcd.into_bytes()),
        ("mesh.off", visage::formats::off::write_mesh(&mesh)),
        ("cloud.xyz", rows.clone().into_bytes()),
        ("cloud.pts", format!("{count}\n{rows}").into_bytes()),
    ];
    for format in visage::formats::Format::surfaces().filter(|format| format.writers.any()) {
        let is_sent = sent.iter().any(|(name, _)| visage::formats::extension(name) == format.ending());
        assert!(is_sent, "{} wants a row", format.name);
    }
    for (name, content) in sent {
        let format = visage::formats::check_name(name).expect("read here");
        let form =
            Form::new().part("model", Part::bytes(content.clone()).file_name(format!("ball.{}", format.ending())));
        let model = expect_json(server.post_form("/v1/models", form).await, StatusCode::CREATED).await;
        assert_eq!(model["assets"][0]["name"], name);
        assert_eq!(model["assets"][0]["media_type"], format.media_type);
        let answer = server.get(&text(&model, "/assets/0/href")).await;
        assert_eq!(answer.headers()["content-type"], format.media_type);
        assert_eq!(answer.bytes().await.expect("a body"), content);
    }
}

#[tokio::test]
async fn the_gallery_finds_what_it_holds_and_forgets_what_is_deleted() {
    let server = TestServer::start().await;
    ready(&server).await;
    let (a, b) = (upload(&server, 0.0, "ball").await, upload(&server, 1.0, "other").await);
    assert_eq!(a["assets"][0]["name"], "mesh.obj");
    assert_eq!(a["name"], "ball.obj");
    assert!(a["signature"]["version"].is_number(), "{a}");
    let (a, b) = (text(&a, "/id"), text(&b, "/id"));

    let faces = ask(&server, &json!({"standard": "face"})).await;
    assert_eq!(faces["searched"], 2);
    let mut everyone = found(&faces);
    everyone.sort();
    assert_eq!(everyone, [a.clone(), b.clone()]);
    let scores: Vec<f64> =
        faces["matches"].as_array().expect("matches").iter().filter_map(|found| found["score"].as_f64()).collect();
    assert!(scores.iter().rev().is_sorted(), "{scores:?}");
    assert_eq!(found(&ask(&server, &json!({"standard": "face", "limit": 1})).await).len(), 1);
    assert_eq!(ask(&server, &json!({"standard": "face", "method": "literal"})).await["searched"], 2);

    assert_eq!(found(&ask(&server, &json!({"model_id": a})).await), std::slice::from_ref(&b));
    let probe =
        Form::new().part("probe", Part::bytes(files::bumpy_sphere(0.0)).file_name("probe.obj")).text("limit", "1");
    let alike = expect_json(server.post_form("/v1/queries", probe).await, StatusCode::OK).await;
    assert_eq!(found(&alike), std::slice::from_ref(&a));
    assert_eq!(server.files("staging"), 0);

    let labeled = expect_json(server.get("/v1/models?label=ball").await, StatusCode::OK).await;
    assert_eq!(labeled["items"].as_array().map(Vec::len), Some(1));
    assert_eq!(server.delete(&format!("/v1/models/{a}")).await, StatusCode::NO_CONTENT);
    assert_eq!(server.delete(&format!("/v1/models/{a}")).await, StatusCode::NOT_FOUND);
    assert_eq!(found(&ask(&server, &json!({"standard": "face"})).await), [b]);
    assert_eq!(server.files("models"), 2, "its file and its thumbnail");
}

#[tokio::test]
async fn the_gallery_survives_a_restart() {
    let server = TestServer::start().await;
    let kept = text(&upload(&server, 0.0, "ball").await, "/id");
    let folder = server.folder;
    assert!(server.handle.shutdown().await);
    let server = TestServer::start_on(folder, |_| {}).await;
    ready(&server).await;
    assert_eq!(found(&ask(&server, &json!({"standard": "face"})).await), [kept]);
}

#[tokio::test]
async fn deleting_takes_everything_derived() {
    let server = TestServer::start().await;
    let (model, job) = server.model().await;
    assert_eq!(server.delete(&format!("/v1/jobs/{job}")).await, StatusCode::NO_CONTENT);
    expect_problem(server.get(&format!("/v1/models/{model}")).await, 404, "not_found").await;
    assert_eq!((server.files("models"), server.files("scan-sets")), (0, 3));

    let (model, job) = server.model().await;
    let view = expect_json(server.get(&format!("/v1/jobs/{job}")).await, StatusCode::OK).await;
    assert_eq!(server.delete(&text(&view, "/links/scan_set")).await, StatusCode::NO_CONTENT);
    expect_problem(server.get(&format!("/v1/models/{model}")).await, 404, "not_found").await;
    expect_problem(server.get(&format!("/v1/jobs/{job}")).await, 404, "not_found").await;
    assert_eq!((server.files("models"), server.files("scan-sets")), (0, 3));

    let (model, job) = server.model().await;
    assert_eq!(server.delete(&format!("/v1/models/{model}")).await, StatusCode::NO_CONTENT);
    let view = expect_json(server.get(&format!("/v1/jobs/{job}")).await, StatusCode::OK).await;
    assert_eq!((view["status"].as_str(), &view["model_id"]), (Some("succeeded"), &json!(null)));
}

#[tokio::test]
async fn questions_that_make_no_sense_are_refused() {
    let server = TestServer::start().await;
    ready(&server).await;
    let refused = [
        (json!({}), 422, "invalid_field"),
        (json!({"standard": "face", "model_id": "x"}), 422, "invalid_field"),
        (json!({"standard": "nose"}), 422, "unknown_standard"),
        (json!({"standard": "face", "limit": 0}), 422, "invalid_field"),
        (json!({"standard": "face", "threshold": 1.5}), 422, "invalid_field"),
        (json!({"standard": "face", "speed": 1}), 422, "invalid_field"),
        (json!({"model_id": "x"}), 404, "not_found"),
    ];
    for (question, status, code) in refused {
        expect_problem(server.post("/v1/queries", &question).await, status, code).await;
    }
    let (unsigned, _) = server.model().await;
    expect_problem(server.post("/v1/queries", &json!({"model_id": unsigned})).await, 422, "no_signature").await;
    let nothing = Form::new().text("limit", "3");
    expect_problem(server.post_form("/v1/queries", nothing).await, 422, "invalid_field").await;
    let text_file = Form::new().part("probe", Part::bytes(&b"text"[..]).file_name("probe.ply"));
    expect_problem(server.post_form("/v1/queries", text_file).await, 422, "unreadable_scan").await;
    let point = Form::new().part("model", Part::bytes(files::ply(1)).file_name("point.ply"));
    expect_problem(server.post_form("/v1/models", point).await, 422, "undescribable_model").await;
    assert_eq!((server.files("models"), server.files("staging")), (4, 0));
}

#[tokio::test]
async fn a_repeated_upload_of_a_model_is_stored_once() {
    let server = TestServer::start().await;
    let post = || {
        let request = server.client.post(server.url("/v1/models")).header("idempotency-key", "m");
        request.multipart(model_form(0.0, "ball")).send()
    };
    let first = expect_json(post().await.expect("an answer"), StatusCode::CREATED).await;
    let again = expect_json(post().await.expect("an answer"), StatusCode::CREATED).await;
    assert_eq!(first, again);
    assert_eq!(server.files("models"), 2, "its file and its thumbnail");
}

#[tokio::test]
async fn the_standards_are_listed() {
    let server = TestServer::start().await;
    let list = expect_json(server.get("/v1/standards").await, StatusCode::OK).await;
    assert!(list["items"].as_array().is_some_and(|items| items.iter().any(|item| item["name"] == "face")), "{list}");
}

#[tokio::test]
async fn models_are_listed_by_words_of_their_names_and_labels() {
    let server = TestServer::start().await;
    for (name, label) in [("Krug 100%", "Gefäß"), ("Kopf", "face"), ("krug_2", "gefäß")] {
        let form = model_form(0.3, label).text("name", name);
        expect_json(server.post_form("/v1/models", form).await, StatusCode::CREATED).await;
    }
    let list = async |query: &[(&str, &str)]| {
        let url = reqwest::Url::parse_with_params(&server.url("/v1/models"), query).expect("an address");
        let answer = server.client.get(url).send().await.expect("an answer");
        let list = expect_json(answer, StatusCode::OK).await;
        let names: Vec<String> =
            list["items"].as_array().expect("items").iter().map(|item| text(item, "/name")).collect();
        (names, list["next_cursor"].as_str().map(str::to_owned))
    };
    assert_eq!(list(&[("text", "KRUG  gefÄß")]).await.0, ["krug_2", "Krug 100%"]);
    assert_eq!(list(&[("text", "0%")]).await.0, ["Krug 100%"]);
    assert_eq!(list(&[("text", "krug"), ("label", "Gefäß")]).await.0, ["Krug 100%"]);
    assert!(list(&[("text", "' OR 1=1 --")]).await.0.is_empty());
    let (first, cursor) = list(&[("text", "krug"), ("limit", "1")]).await;
    let cursor = cursor.expect("there is another");
    let (second, end) = list(&[("text", "krug"), ("limit", "1"), ("cursor", &cursor)]).await;
    assert_eq!((first, second, end), (vec!["krug_2".to_owned()], vec!["Krug 100%".to_owned()], None));
    // a cursor goes on with its own list alone
    expect_problem(server.get(&format!("/v1/models?text=kopf&cursor={cursor}")).await, 422, "invalid_field").await;
    for wrong in ["", "%20", "a%00b", &"x".repeat(201)] {
        expect_problem(server.get(&format!("/v1/models?text={wrong}")).await, 422, "invalid_field").await;
    }
    // many words cost no more than a look at each model
    let many = (0..100).map(|k| char::from(b'a' + k % 26).to_string()).collect::<Vec<_>>().join("+");
    assert_eq!(server.get(&format!("/v1/models?text={many}")).await.status(), StatusCode::OK);
}
