//! What is stored, as people see it.

use crate::common::{Mode, TestServer, expect_json, expect_problem, files, text};
use reqwest::header::{CACHE_CONTROL, CONTENT_SECURITY_POLICY, CONTENT_TYPE, ETAG, IF_NONE_MATCH};
use reqwest::multipart::{Form, Part};
use reqwest::{Response, StatusCode};
use serde_json::json;
use std::time::Duration;

async fn upload(server: &TestServer, file: Vec<u8>, unit: &str) -> String {
    let form = Form::new().part("model", Part::bytes(file).file_name("ball.obj")).text("unit", unit.to_owned());
    text(&expect_json(server.post_form("/v1/models", form).await, StatusCode::CREATED).await, "/id")
}

/// The size and the pixels of a PNG.
async fn picture(response: Response) -> ([u32; 2], Vec<u8>) {
    assert_eq!(response.status(), StatusCode::OK, "{}", response.url());
    assert_eq!(response.headers()[CONTENT_TYPE], "image/png");
    let bytes = response.bytes().await.expect("a body");
    let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().expect("a PNG");
    let mut pixels = vec![0; reader.output_buffer_size().expect("small")];
    let frame = reader.next_frame(&mut pixels).expect("whole");
    ([frame.width, frame.height], pixels)
}

fn is_empty(pixels: &[u8]) -> bool {
    pixels.chunks(3).all(|pixel| pixel == &pixels[..3])
}

#[tokio::test]
async fn a_model_has_pictures_of_the_size_and_from_the_side_that_are_wished() {
    let server = TestServer::start().await;
    let model = upload(&server, files::bumpy_sphere(0.3), "mm").await;
    let path = |what: &str| format!("/v1/models/{model}/pictures/{what}");
    let (size, pixels) = picture(server.get(&path("thumbnail")).await).await;
    assert!(size == [256, 192] && !is_empty(&pixels));
    // it was drawn when the model was stored, as it would be drawn now
    let view = expect_json(server.get(&format!("/v1/models/{model}")).await, StatusCode::OK).await;
    assert_eq!(view["assets"][1]["name"], "thumbnail.png");
    let (kept, drawn) = picture(server.get(&text(&view, "/assets/1/href")).await).await;
    assert!(kept == size && drawn == pixels);
    let upright = picture(server.get(&path("shaded?size=256x192&view=front")).await).await;
    let asked = picture(server.get(&path("thumbnail?view=front")).await).await;
    assert!(upright.0 == asked.0 && asked.1 != pixels, "another side is drawn");
    let (size, front) = picture(server.get(&path("shaded?size=120x80&view=front")).await).await;
    assert_eq!(size, [120, 80]);
    let (_, left) = picture(server.get(&path("shaded?size=120x80&view=left")).await).await;
    assert!(front != left && !is_empty(&front));
    for kind in ["saliency", "regions", "section", "section&plane=z:10"] {
        let kind = kind.replacen('&', "?", 1);
        let separator = if kind.contains('?') { '&' } else { '?' };
        let (_, pixels) = picture(server.get(&path(&format!("{kind}{separator}size=160x120"))).await).await;
        assert!(!is_empty(&pixels), "{kind}");
    }
    let other = upload(&server, files::bumpy_sphere(1.3), "mm").await;
    let (_, pixels) = picture(server.get(&path(&format!("deviation?other={other}&size=160x120"))).await).await;
    assert!(
        pixels.chunks(3).any(|p| p[0] > p[2].saturating_add(60))
            && pixels.chunks(3).any(|p| p[2] > p[0].saturating_add(60))
    );
}

#[tokio::test]
async fn a_picture_that_is_known_is_not_sent_again() {
    let server = TestServer::start().await;
    let model = upload(&server, files::bumpy_sphere(0.3), "mm").await;
    let path = format!("/v1/models/{model}/pictures/thumbnail?size=64x64");
    let first = server.get(&path).await;
    let etag = first.headers()[ETAG].clone();
    assert_eq!(first.headers()[CACHE_CONTROL], "private, no-cache");
    let first = first.bytes().await.expect("a body");
    let again = server.client.get(server.url(&path)).header(IF_NONE_MATCH, &etag).send().await.expect("an answer");
    assert_eq!((again.status(), &again.headers()[ETAG]), (StatusCode::NOT_MODIFIED, &etag));
    assert_eq!(server.get(&path).await.bytes().await.expect("a body"), first, "the same bytes");
    let larger = server.get(&path.replace("64x64", "65x64")).await;
    assert_ne!(larger.headers()[ETAG], etag);
    // what is gone is gone, however well it is remembered
    assert_eq!(server.delete(&format!("/v1/models/{model}")).await, StatusCode::NO_CONTENT);
    expect_problem(server.get(&path).await, 404, "not_found").await;
}

#[tokio::test]
async fn what_is_wished_wrongly_or_lacking_is_said_with_a_remedy() {
    let server = TestServer::start().await;
    let model = upload(&server, files::bumpy_sphere(0.3), "mm").await;
    let metres = upload(&server, files::bumpy_sphere(0.3), "m").await;
    let get = |what: String| {
        let (server, model) = (&server, &model);
        async move { server.get(&format!("/v1/models/{model}/pictures/{what}")).await }
    };
    for wrong in [
        "size=15x80",
        "size=80x4097",
        "size=80",
        "size=-8x80",
        "size=99999999999x9",
        "view=sideways",
        "view=",
        "plane=w",
        "plane=x:nan",
    ] {
        let problem = expect_problem(get(format!("section?{wrong}")).await, 422, "invalid_field").await;
        assert!(problem["hint"].as_str().is_some_and(|hint| hint.starts_with("give ")), "{problem}");
    }
    for kind in ["portrait", "..%2F..%2Fetc", "thumbnail%00", "%3Cscript%3E"] {
        let problem = expect_problem(get(kind.to_owned()).await, 404, "not_found").await;
        assert!(problem["hint"].as_str().is_some_and(|hint| hint.contains("thumbnail, shaded")), "{problem}");
    }
    for kind in ["views", "support", "overlap", "graph", "convergence", "landmarks", "overlap/svg", "shaded/svg"] {
        expect_problem(get(kind.to_owned()).await, 404, "not_found").await;
    }
    expect_problem(get("deviation".to_owned()).await, 422, "invalid_field").await;
    expect_problem(get(format!("deviation?other={metres}")).await, 409, "other_unit").await;
    expect_problem(get("deviation?other=nobody".to_owned()).await, 404, "not_found").await;
    let nobody = "0199c6a0-6d5b-7a35-9d2c-6f3b8d1e4a70";
    expect_problem(server.get(&format!("/v1/models/{nobody}/pictures/thumbnail")).await, 404, "not_found").await;
    expect_problem(server.get("/v1/models/x/report.html").await, 404, "not_found").await;
}

#[tokio::test]
async fn a_registered_model_shows_its_scans_and_has_plots_in_two_forms() {
    let server = TestServer::start().await;
    server.engine.set(Mode::Meshed);
    let (model, _) = server.model().await;
    for kind in ["thumbnail", "shaded", "views", "section", "support", "overlap", "graph"] {
        let (size, pixels) =
            picture(server.get(&format!("/v1/models/{model}/pictures/{kind}?size=200x150")).await).await;
        assert!(size == [200, 150] && !is_empty(&pixels), "{kind}");
    }
    let plot = server.get(&format!("/v1/models/{model}/pictures/graph/svg")).await;
    assert_eq!(plot.headers()[CONTENT_TYPE], "image/svg+xml");
    let svg = plot.text().await.expect("a text");
    assert!(svg.starts_with("<svg") && svg.contains("scan1.ply"), "{svg}");
}

#[tokio::test]
async fn a_report_is_a_page_that_needs_nothing_else() {
    let server = TestServer::start().await;
    server.engine.set(Mode::Meshed);
    let form = Form::new()
        .part("scans", Part::bytes(files::ply(50)).file_name("<b>.ply"))
        .part("scans", Part::bytes(files::ply(60)).file_name("b.ply"));
    let poses = files::poses(&["<b>.ply".to_owned(), "b.ply".to_owned()]);
    let form = form.part("poses", Part::text(poses).file_name("poses.json"));
    let set = text(&expect_json(server.post_form("/v1/scan-sets", form).await, StatusCode::CREATED).await, "/id");
    let job = text(
        &expect_json(server.post("/v1/jobs", &json!({"scan_set_id": set})).await, StatusCode::ACCEPTED).await,
        "/id",
    );
    let model = text(&server.finished(&job).await, "/model_id");
    let path = format!("/v1/models/{model}/report.html");
    let page = server.get(&path).await;
    assert_eq!(page.status(), StatusCode::OK);
    assert_eq!(page.headers()[CONTENT_TYPE], "text/html; charset=utf-8");
    assert!(page.headers()[CONTENT_SECURITY_POLICY].to_str().expect("text").starts_with("default-src 'none'"));
    let etag = page.headers()[ETAG].clone();
    let html = page.text().await.expect("a text");
    assert!(html.contains("The scans fit together") && html.contains("data:image/png;base64,"));
    assert!(html.contains("&#60;b&#62;.ply") && !html.contains("<b>.ply") && !html.contains("<script"));
    assert!(html.contains("min_overlap"), "the options of the job");
    let again = server.client.get(server.url(&path)).header(IF_NONE_MATCH, etag).send().await.expect("an answer");
    assert_eq!(again.status(), StatusCode::NOT_MODIFIED);
}

#[tokio::test]
async fn scans_are_seen_before_anything_runs() {
    let server = TestServer::start().await;
    let set = server.scan_set(3).await;
    let (size, pixels) = picture(server.get(&format!("/v1/scan-sets/{set}/pictures/thumbnail?size=90x90")).await).await;
    assert!(size == [90, 90] && !is_empty(&pixels));
    let scan = format!("/v1/scan-sets/{set}/scans/scan1.ply/picture");
    let (size, pixels) = picture(server.get(&scan).await).await;
    assert!(size == [256, 192] && !is_empty(&pixels));
    let etag = server.get(&scan).await.headers()[ETAG].clone();
    let known = server.client.get(server.url(&scan)).header(IF_NONE_MATCH, &etag).send().await.expect("an answer");
    assert_eq!(known.status(), StatusCode::NOT_MODIFIED);
    // another scan of the same name is another picture
    let put = server.put(&format!("/v1/scan-sets/{set}/scans/scan1.ply"), files::ply(90)).await;
    assert_eq!(put.status(), StatusCode::OK);
    assert_ne!(server.get(&scan).await.headers()[ETAG], etag);
    expect_problem(server.get(&format!("/v1/scan-sets/{set}/scans/none.ply/picture")).await, 404, "not_found").await;
    expect_problem(server.get(&format!("{scan}?size=1x1")).await, 422, "invalid_field").await;
    let empty = expect_json(server.post("/v1/scan-sets", &json!({"name": "empty"})).await, StatusCode::CREATED).await;
    let path = format!("/v1/scan-sets/{}/pictures/thumbnail", text(&empty, "/id"));
    expect_problem(server.get(&path).await, 404, "not_found").await;
}

#[tokio::test]
async fn pictures_do_not_wait_for_models_that_are_described() {
    let server = TestServer::start_with(|config| config.limits.concurrent_describing = 1).await;
    let model = upload(&server, files::bumpy_sphere(0.3), "mm").await;
    server.engine.set(Mode::Slow(Duration::from_secs(600)));
    let probe = Form::new().part("probe", Part::bytes(files::bumpy_sphere(0.9)).file_name("ball.obj"));
    let asking = server.post_form("/v1/queries/probe", probe);
    let path = format!("/v1/models/{model}/pictures/thumbnail?size=64x64");
    let drawing = server.get(&path);
    tokio::select! {
        _ = asking => panic!("the probe takes long"),
        drawn = drawing => assert_eq!(drawn.status(), StatusCode::OK),
    }
}
