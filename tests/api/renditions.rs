//! What is stored of models in the formats that clients ask for, and the units of what they send.

use crate::common::{Mode, TestServer, expect_json, expect_problem, files, text};
use reqwest::header::{ACCEPT, CONTENT_TYPE, ETAG, IF_NONE_MATCH, RANGE, VARY};
use reqwest::multipart::{Form, Part};
use reqwest::{Response, StatusCode};
use serde_json::json;
use visage::formats::archive::{ArchiveLimits, entries};
use visage::formats::{ReadLimits, poses, read_scans, read_surface};
use visage::geometry::Surface;

async fn bytes(response: Response) -> Vec<u8> {
    assert_eq!(response.status(), StatusCode::OK);
    response.bytes().await.expect("a body").to_vec()
}

fn surface(name: &str, bytes: &[u8]) -> Surface {
    read_surface(name, bytes, &ReadLimits::default()).unwrap_or_else(|error| panic!("{name}: {error}"))
}

impl TestServer {
    async fn accepting(&self, path: &str, accept: &str) -> Response {
        self.client.get(self.url(path)).header(ACCEPT, accept).send().await.expect("an answer")
    }
}

#[tokio::test]
async fn a_cloud_comes_in_every_format_that_is_written() {
    let server = TestServer::start().await;
    let (model, _) = server.model().await;
    let stored = surface("cloud.ply", &bytes(server.get(&format!("/v1/models/{model}/cloud.ply")).await).await).cloud;
    for format in visage::formats::written::Written::Cloud.formats() {
        let ending = format.ending();
        let file = bytes(server.get(&format!("/v1/models/{model}/cloud?format={ending}")).await).await;
        let read = surface(&format!("a.{ending}"), &file).cloud;
        assert_eq!(read.len(), stored.len(), "{ending}");
        // the set is in mm
        let factor = format.factor_from(visage::geometry::Unit::Mm);
        assert_eq!(factor == 0.001, ["e57", "glb"].contains(&ending), "{ending}");
        let far = stored.points.iter().zip(&read.points).map(|(a, b)| (a * factor - b.coords).coords.norm());
        assert!(far.fold(0.0, f64::max) < 2e-3 * factor, "{ending}");
    }
    assert_eq!(server.files("staging"), 0, "what was made is gone");
}

#[tokio::test]
async fn accept_chooses_and_representations_have_tags_of_their_own() {
    let server = TestServer::start().await;
    let (model, _) = server.model().await;
    let cloud = format!("/v1/models/{model}/cloud");
    let plain = server.get(&cloud).await;
    assert_eq!([&plain.headers()[CONTENT_TYPE], &plain.headers()[VARY]], ["application/octet-stream", "accept"]);
    let stored = server.get(&format!("{cloud}.ply")).await;
    assert_eq!(plain.headers()[ETAG], stored.headers()[ETAG], "it is the same file");
    let glb = server.accepting(&cloud, "text/html;q=0.9, model/gltf-binary").await;
    let etag = glb.headers()[ETAG].clone();
    assert_eq!([&glb.headers()[CONTENT_TYPE], &glb.headers()[VARY]], ["model/gltf-binary", "accept"]);
    assert_ne!(etag, plain.headers()[ETAG]);
    let whole = bytes(glb).await;
    let known = server.client.get(server.url(&format!("{cloud}?format=glb"))).header(IF_NONE_MATCH, &etag).send();
    assert_eq!(known.await.expect("an answer").status(), StatusCode::NOT_MODIFIED);
    let part = server.client.get(server.url(&format!("{cloud}?format=glb"))).header(RANGE, "bytes=4-11").send().await;
    let part = part.expect("an answer");
    assert_eq!(part.status(), StatusCode::PARTIAL_CONTENT);
    assert_eq!(part.bytes().await.expect("a body"), whole[4..12]);
    let refused = expect_problem(server.accepting(&cloud, "text/html").await, 406, "not_acceptable").await;
    assert!(text(&refused, "/hint").contains("las") && text(&refused, "/hint").contains("model/gltf-binary"));
    let unknown = expect_problem(server.get(&format!("{cloud}?format=doc")).await, 422, "invalid_field").await;
    assert!(text(&unknown, "/hint").contains("ply, pcd"), "{unknown}");
    expect_problem(server.get(&format!("/v1/models/{model}/mesh")).await, 404, "not_found").await;
}

#[tokio::test]
async fn meshes_and_uploaded_models_are_converted_too() {
    let server = TestServer::start().await;
    server.engine.set(Mode::Meshed);
    let (model, _) = server.model().await;
    let stl = bytes(server.get(&format!("/v1/models/{model}/mesh?format=stl")).await).await;
    assert_eq!(surface("a.stl", &stl).faces.len(), 1);
    let form =
        Form::new().part("model", Part::bytes(files::bumpy_sphere(0.1)).file_name("ball.obj")).text("unit", "mm");
    let uploaded = expect_json(server.post_form("/v1/models", form).await, StatusCode::CREATED).await;
    let model = format!("/v1/models/{}", text(&uploaded, "/id"));
    let xyz = bytes(server.get(&format!("{model}/cloud?format=xyz")).await).await;
    let vertices = surface("a.xyz", &xyz).cloud.len();
    let stored = bytes(server.get(&format!("{model}/mesh?format=obj")).await).await;
    assert_eq!((stored == files::bumpy_sphere(0.1), vertices), (true, surface("a.obj", &stored).cloud.len()));
    expect_problem(server.get(&format!("{model}/poses")).await, 404, "not_found").await;
    expect_problem(server.get(&format!("{model}/scans")).await, 404, "not_found").await;
}

#[tokio::test]
async fn poses_come_in_the_formats_of_other_programs() {
    let server = TestServer::start().await;
    let (model, _) = server.model().await;
    let path = format!("/v1/models/{model}/poses");
    let json = bytes(server.get(&path).await).await;
    assert_eq!(json, bytes(server.get(&format!("{path}.json")).await).await);
    let count = poses::read("poses.json", &json).expect("sound").poses.len();
    for ending in visage::formats::written::Written::Poses.endings() {
        let file = bytes(server.get(&format!("{path}?format={ending}")).await).await;
        let read = poses::read(&format!("p.{ending}"), &file).unwrap_or_else(|error| panic!("{ending}: {error}"));
        assert_eq!(read.poses.len(), count, "{ending}");
    }
    let zip = server.accepting(&path, "application/zip").await;
    assert_eq!(zip.headers()[CONTENT_TYPE], "application/zip");
    let zip = entries("p.zip", &bytes(zip).await, &ArchiveLimits::default()).expect("sound").entries;
    assert_eq!((zip.len(), zip[0].path.as_str()), (count, "scan0.ply.txt"));
}

#[tokio::test]
async fn the_scans_of_a_model_come_where_they_belong() {
    let server = TestServer::start().await;
    let set = server.scan_set(3).await;
    let poses = json!({"scan1.ply": [[0, -1, 0, 4], [1, 0, 0, 5], [0, 0, 1, 6], [0, 0, 0, 1]]});
    let put = server.put(&format!("/v1/scan-sets/{set}/poses"), poses.to_string()).await;
    assert_eq!(put.status(), StatusCode::OK);
    let job = server.post("/v1/jobs", &json!({"scan_set_id": set})).await;
    let job = server.finished(&text(&expect_json(job, StatusCode::ACCEPTED).await, "/id")).await;
    let path = format!("/v1/models/{}/scans", text(&job, "/model_id"));
    let zip = bytes(server.get(&format!("{path}?format=xyz")).await).await;
    let zip = entries("s.zip", &zip, &ArchiveLimits::default()).expect("sound").entries;
    let mut names: Vec<&str> = zip.iter().map(|entry| entry.path.as_str()).collect();
    names.sort_unstable();
    assert_eq!(names, ["scan0.ply.xyz", "scan1.ply.xyz", "scan2.ply.xyz"]);
    let of = |name: &str| {
        let entry = zip.iter().find(|entry| entry.path == name).expect("there");
        surface(name, &entry.bytes).cloud.points[3]
    };
    let scan = surface("a.ply", &files::ply(51)).cloud.points[3];
    let placed = of("scan1.ply.xyz");
    assert!((placed.coords - nalgebra::vector![4.0 - scan.y, 5.0 + scan.x, 6.0 + scan.z]).norm() < 1e-9, "{placed}");
    let e57 = bytes(server.get(&path).await).await;
    let scans = read_scans("s.e57", &e57, &ReadLimits::default()).expect("sound");
    let second = scans.iter().find(|scan| scan.name.as_deref() == Some("scan1.ply")).expect("named");
    let pose = second.world_from_scan.expect("placed");
    let in_metres = pose * second.reading.surface.cloud.points[3];
    assert!((in_metres.coords * 1000.0 - placed.coords).norm() < 1e-6, "{in_metres}");
    // a scan that was replaced is another one
    let put = server.put(&format!("/v1/scan-sets/{set}/scans/scan1.ply"), files::ply(51)).await;
    assert_eq!(put.status(), StatusCode::OK);
    let changed = expect_problem(server.get(&path).await, 409, "scan_changed").await;
    assert_eq!(changed["scan"], "scan1.ply");
}

#[tokio::test]
async fn what_is_too_large_to_be_converted_is_said() {
    let server = TestServer::start_with(|config| config.job_memory_bytes = Some(40_000)).await;
    let form = Form::new().part("model", Part::bytes(files::bumpy_sphere(0.1)).file_name("ball.obj"));
    let uploaded = expect_json(server.post_form("/v1/models", form).await, StatusCode::CREATED).await;
    let path = format!("/v1/models/{}", text(&uploaded, "/id"));
    let refused = expect_problem(server.get(&format!("{path}/cloud?format=las")).await, 422, "too_little_memory").await;
    assert!(text(&refused, "/hint").contains("as it is stored"));
    let stored = server.get(&format!("{path}/mesh?format=obj")).await;
    assert_eq!(stored.status(), StatusCode::OK, "as it is stored");
}

#[tokio::test]
async fn scans_of_another_unit_are_converted_when_it_is_said_and_their_poses_hold_the_scale() {
    let server = TestServer::start().await;
    let set = server.scan_set(3).await;
    let job = json!({"scan_set_id": set, "hints": {"units": {"scan1.ply": "m"}}});
    let job = expect_json(server.post("/v1/jobs", &job).await, StatusCode::ACCEPTED).await;
    let job = server.finished(&text(&job, "/id")).await;
    let model = format!("/v1/models/{}", text(&job, "/model_id"));
    let poses = expect_json(server.get(&format!("{model}/poses.json")).await, StatusCode::OK).await;
    assert_eq!((&poses["scan1.ply"][0][0], &poses["scan0.ply"][0][0]), (&json!(1000.0), &json!(1.0)));
    let report = expect_json(server.get(&format!("{model}/report.json")).await, StatusCode::OK).await;
    let note = "scan1.ply is in m, as was said: its lengths are converted to mm";
    assert_eq!(report["result"]["unit_notes"], json!([note]));
    // the cloud is in the unit of the set, and a placed scan with it
    let cloud = surface("cloud.ply", &bytes(server.get(&format!("{model}/cloud.ply")).await).await).cloud;
    let largest = cloud.points.iter().map(|point| point.x.abs()).fold(0.0, f64::max);
    assert!((5_000.0..20_000.0).contains(&largest), "{largest}");
    let zip = bytes(server.get(&format!("{model}/scans?format=ply")).await).await;
    let zip = entries("s.zip", &zip, &ArchiveLimits::default()).expect("sound").entries;
    let scaled = zip.iter().find(|entry| entry.path == "scan1.ply").expect("there");
    let reach = surface("a.ply", &scaled.bytes).cloud.points.iter().map(|point| point.x.abs()).fold(0.0, f64::max);
    assert!((reach - largest).abs() < 1.0, "{reach}");
    let refused = server.get(&format!("{model}/poses?format=aln")).await;
    assert!(text(&expect_problem(refused, 406, "not_acceptable").await, "/detail").contains("holds a scale"));
    let unknown = json!({"scan_set_id": set, "hints": {"units": {"other.ply": "m"}}});
    expect_problem(server.post("/v1/jobs", &unknown).await, 422, "invalid_hints").await;
}

#[tokio::test]
async fn a_unit_that_files_declare_is_that_of_the_model() {
    let server = TestServer::start().await;
    let cloud = |name: &str| surface(name, &files::ply(30)).cloud;
    let glb = visage::formats::gltf::write_cloud(&cloud("a.ply"));
    let form = |unit: &'static str| {
        let part = |name: &str| Part::bytes(glb.clone()).file_name(name.to_owned());
        Form::new().part("scans", part("a.glb")).part("scans", part("b.glb")).text("unit", unit)
    };
    for (given, expected) in [("unknown", "m"), ("mm", "mm")] {
        let job = expect_json(server.post_form("/v1/jobs/upload", form(given)).await, StatusCode::ACCEPTED).await;
        let job = server.finished(&text(&job, "/id")).await;
        let model = server.get(&format!("/v1/models/{}", text(&job, "/model_id"))).await;
        assert_eq!(expect_json(model, StatusCode::OK).await["unit"], expected);
    }
}

#[tokio::test]
async fn a_head_in_metres_sent_as_millimetres_is_told_its_size() {
    let server = TestServer::start().await;
    let form = Form::new()
        .part("probe", Part::bytes(files::bumpy_sphere(0.2)).file_name("ball.obj"))
        .text("standard", "face")
        .text("unit", "m");
    let answer = expect_json(server.post_form("/v1/queries/probe", form).await, StatusCode::OK).await;
    let reason = text(&answer, "/verdict/reason/text");
    assert!(reason.contains("m in the unit given") && reason.contains("is the unit right?"), "{reason}");
}
