//! Surfaces of stored models over a real connection: made anew with other options, and measured to each other.

use crate::common::{TestServer, expect_json, expect_problem, files, text};
use reqwest::StatusCode;
use reqwest::multipart::{Form, Part};
use serde_json::{Value, json};
use visage::formats::{ReadLimits, read_surface};
use visage::geometry::Surface;

async fn upload(server: &TestServer, content: Vec<u8>, unit: &'static str) -> String {
    let model = Part::bytes(content).file_name("ball.obj");
    let form = Form::new().part("model", model).text("unit", unit).text("label", "ball");
    text(&expect_json(server.post_form("/v1/models", form).await, StatusCode::CREATED).await, "/id")
}

async fn file(server: &TestServer, path: &str) -> Surface {
    let response = server.get(path).await;
    assert_eq!(response.status(), StatusCode::OK, "{path}");
    let bytes = response.bytes().await.expect("a body");
    let name = path.split('?').next().and_then(|path| path.rsplit('/').next()).expect("a name").to_owned();
    read_surface(&name, &bytes, &ReadLimits::default()).expect("own files are read")
}

/// The model that a job of kind surface leaves.
async fn surfaced(server: &TestServer, model: &str, options: Value) -> Value {
    let order = json!({"kind": "surface", "model_id": model, "options": options});
    let job = expect_json(server.post("/v1/jobs", &order).await, StatusCode::ACCEPTED).await;
    assert_eq!(
        (&job["kind"], &job["base_model_id"], &job["scan_set_id"]),
        (&json!("surface"), &json!(model), &json!(null))
    );
    let ended = server.finished(&text(&job, "/id")).await;
    assert_eq!(ended["status"], "succeeded", "{ended}");
    assert_ne!(ended["model_id"], model, "it is a model of its own");
    expect_json(server.get(&format!("/v1/models/{}", text(&ended, "/model_id"))).await, StatusCode::OK).await
}

#[tokio::test]
async fn an_uploaded_model_gets_a_surface_and_again_with_other_options() {
    let server = TestServer::start().await;
    let model = upload(&server, files::bumpy_sphere(0.3), "mm").await;
    let made = surfaced(&server, &model, json!({})).await;
    let names: Vec<String> = made["assets"].as_array().expect("assets").iter().map(|a| text(a, "/name")).collect();
    assert_eq!(names, ["cloud.ply", "mesh.ply", "preview.glb", "report.json"]);
    assert_eq!((&made["signature"], &made["label"], &made["unit"]), (&json!(null), &json!("ball"), &json!("mm")));
    let result = &made["report"]["result"];
    assert_eq!((&result["of_model"], &result["normals"]), (&json!(model), &json!("estimated")), "{result}");
    let whole = file(&server, &format!("/v1/models/{}/mesh.ply", text(&made, "/id"))).await;
    assert_eq!(result["surface"]["triangles"], whole.faces.len());
    assert!(whole.mesh().expect("triangles").signed_volume_6() > 0.0);

    // of what it made it takes the cloud, with its normals
    let again = surfaced(&server, &text(&made, "/id"), json!({"triangles": 300, "preview": false})).await;
    let coarse = file(&server, &format!("/v1/models/{}/mesh.ply", text(&again, "/id"))).await;
    assert!(coarse.faces.len() <= 300 && coarse.faces.len() < whole.faces.len());
    let result = &again["report"]["result"];
    assert_eq!(
        (&result["normals"], &result["surface"]["simplified"]["triangles"]),
        (&json!("file"), &json!(coarse.faces.len()))
    );
    // a face is looked for where it is to be cut out
    let cut = surfaced(&server, &model, json!({"deface": true})).await;
    assert_eq!(cut["report"]["result"]["face_cut"], false);
    // copies are no answers
    let answer = expect_json(server.post("/v1/queries", &json!({"model_id": model})).await, StatusCode::OK).await;
    assert_eq!(answer["searched"], 1, "{answer}");
}

#[tokio::test]
async fn what_makes_no_surface_fails_with_the_remedy_and_bad_orders_are_refused() {
    let server = TestServer::start().await;
    let model = upload(&server, files::bumpy_sphere(0.3), "mm").await;
    let post = |body: Value| {
        let server = &server;
        async move { server.post("/v1/jobs", &body).await }
    };
    expect_problem(post(json!({"kind": "surface"})).await, 422, "invalid_field").await;
    let set = server.scan_set(2).await;
    let both = json!({"kind": "surface", "model_id": model, "scan_set_id": set});
    expect_problem(post(both).await, 422, "invalid_field").await;
    expect_problem(post(json!({"scan_set_id": set, "model_id": model})).await, 422, "invalid_field").await;
    let unknown = json!({"kind": "surface", "model_id": "0199c6a0-6d5b-7a35-9d2c-6f3b8d1e4a70"});
    expect_problem(post(unknown).await, 404, "not_found").await;
    let wrong = json!({"kind": "surface", "model_id": model, "options": {"triangles": 1}});
    expect_problem(post(wrong).await, 422, "invalid_options").await;
}

#[tokio::test]
async fn the_deviation_of_a_model_is_told_in_figures_and_colours() {
    let server = TestServer::start().await;
    let model = upload(&server, files::bumpy_sphere(0.3), "mm").await;
    let same = upload(&server, files::bumpy_sphere(0.3), "mm").await;
    let other = upload(&server, files::bumpy_sphere(1.3), "mm").await;
    let metres = upload(&server, files::bumpy_sphere(0.3), "m").await;
    let path = |reference: &str, more: &str| format!("/v1/models/{model}/deviation?reference={reference}{more}");
    let none = expect_json(server.get(&path(&same, "")).await, StatusCode::OK).await;
    assert_eq!(none["model_to_reference"]["rms"].as_f64().map(|rms| rms < 1e-6), Some(true), "{none}");
    assert_eq!((&none["unit"], &none["file"], &none["has_sides"]), (&json!("mm"), &json!("mesh.obj"), &json!(true)));
    let some = expect_json(server.get(&path(&other, "&limit=0.5&reach=1000")).await, StatusCode::OK).await;
    let figures = &some["model_to_reference"];
    assert!(figures["rms"].as_f64() > Some(0.1) && figures["beyond_limit"].as_f64() > Some(0.0), "{some}");
    let map = file(&server, &format!("/v1/models/{model}/deviation.ply?reference={other}&limit=0.5")).await;
    assert!(map.cloud.colors.is_some_and(|colors| colors.contains(&[255, 0, 0]) && colors.contains(&[0, 0, 255])));
    assert!(!map.faces.is_empty());
    expect_problem(server.get(&path(&metres, "")).await, 409, "other_unit").await;
    expect_problem(server.get(&path(&same, "&limit=-1")).await, 422, "invalid_field").await;
    expect_problem(server.get(&path("nobody", "")).await, 404, "not_found").await;
    expect_problem(server.get(&format!("/v1/models/{model}/deviation")).await, 400, "malformed_request").await;
}

#[tokio::test]
async fn what_stands_out_comes_as_a_surface_with_a_figure_a_vertex() {
    let server = TestServer::start().await;
    let model = upload(&server, files::bumpy_sphere(0.3), "mm").await;
    let path = format!("/v1/models/{model}/saliency.ply");
    let first = server.get(&path).await;
    assert_eq!(first.status(), StatusCode::OK);
    assert_eq!(first.headers()["content-type"], "application/octet-stream");
    let etag = first.headers()["etag"].clone();
    let bytes = first.bytes().await.expect("a body");
    assert!(bytes.windows(24).any(|line| line == b"property float saliency\n"));
    let own = file(&server, &format!("/v1/models/{model}/mesh.obj")).await;
    let read = read_surface("saliency.ply", &bytes, &ReadLimits::default()).expect("own files are read");
    assert_eq!((read.cloud.len(), &read.faces), (own.cloud.len(), &own.faces));
    let colors = read.cloud.colors.expect("coloured");
    assert!(colors.iter().any(|color| color != &colors[0]), "some places stand out");
    let known = server.client.get(server.url(&path)).header("if-none-match", &etag).send().await.expect("an answer");
    assert_eq!(known.status(), StatusCode::NOT_MODIFIED);
    assert_eq!(server.delete(&format!("/v1/models/{model}")).await, StatusCode::NO_CONTENT);
    expect_problem(server.get(&path).await, 404, "not_found").await;
    expect_problem(server.get("/v1/models/x/saliency.ply").await, 404, "not_found").await;
}
