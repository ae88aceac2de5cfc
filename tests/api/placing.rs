//! Where a probe lies on what is found, whether it is the same object, and which models are there more than once, over a real connection.

use crate::common::{TestServer, expect_json, expect_problem, files, text};
use reqwest::StatusCode;
use reqwest::multipart::{Form, Part};
use serde_json::{Value, json};
use visage::geometry::{Mesh, Motion, Point3, Vector3};
use visage::synthetic::scanner::Scanner;
use visage::synthetic::shapes;

fn thing(name: &str) -> Mesh {
    shapes::catalogue().iter().find(|shape| shape.name == name).expect("it is in the catalogue").mesh_of(1, 8.0)
}

fn changed(mesh: &Mesh, scale: f64, mirror: f64) -> Mesh {
    let motion = Motion::new(Vector3::new(40.0, -30.0, 500.0), Vector3::new(0.8, -1.1, 0.4));
    let place = |p: &Point3| motion * Point3::new(mirror * scale * p.x, scale * p.y, scale * p.z);
    Mesh { vertices: mesh.vertices.iter().map(place).collect(), faces: mesh.faces.clone() }
}

/// Every face cut into three about its middle.
fn remeshed(mesh: &Mesh) -> Mesh {
    let mut cut = Mesh { vertices: mesh.vertices.clone(), faces: Vec::new() };
    for (index, [a, b, c]) in mesh.faces.iter().copied().enumerate() {
        let middle = cut.vertices.len() as u32;
        cut.vertices.push(Point3::from(mesh.corners(index).iter().map(|p| p.coords).sum::<Vector3>() / 3.0));
        cut.faces.extend([[a, b, middle], [b, c, middle], [c, a, middle]]);
    }
    cut
}

fn part(mesh: &Mesh) -> Part {
    Part::bytes(files::obj(mesh)).file_name("thing.obj")
}

async fn ready() -> TestServer {
    let server = TestServer::start().await;
    while server.get("/readyz").await.status() != StatusCode::OK {
        tokio::task::yield_now().await;
    }
    server
}

async fn upload(server: &TestServer, mesh: &Mesh, unit: &str) -> String {
    let form = Form::new().part("model", part(mesh)).text("unit", unit.to_owned());
    text(&expect_json(server.post_form("/v1/models", form).await, StatusCode::CREATED).await, "/id")
}

/// A place of the probe under the matrix of an answer.
fn laid(place: &Value, p: &Point3) -> Point3 {
    let rows: [[f64; 4]; 4] = serde_json::from_value(place["model_from_probe"].clone()).expect("a matrix");
    let [x, y, z, _] = rows.map(|row| row[0] * p.x + row[1] * p.y + row[2] * p.z + row[3]);
    Point3::new(x, y, z)
}

#[tokio::test]
async fn a_probe_is_laid_onto_what_it_is_found_on() {
    let server = ready().await;
    let (bean, animal) = (thing("bean"), thing("animal"));
    let id = upload(&server, &bean, "mm").await;
    let other = upload(&server, &animal, "mm").await;
    let probe = changed(&bean, 1e-3, 1.0);
    let form = Form::new().part("probe", part(&probe)).text("unit", "m").text("place", "true");
    let answer = expect_json(server.post_form("/v1/queries/probe", form).await, StatusCode::OK).await;
    let [first, second] = [0, 1].map(|k| answer["matches"][k].clone());
    assert_eq!((text(&first, "/model_id"), text(&second, "/model_id")), (id.clone(), other), "{answer}");
    let place = &first["place"];
    assert_eq!((&place["scale"], &place["is_mirrored"]), (&json!(1e3), &json!(false)), "{place}");
    let diagonal = bean.bounds().expect("it has vertices").diagonal();
    for (moved, p) in probe.vertices.iter().zip(&bean.vertices).step_by(50) {
        assert!((laid(place, moved) - p).norm() < 0.005 * diagonal, "{place}");
    }
    let deviation = |of: &Value| of["place"]["deviation"].as_f64().expect("a figure");
    assert!(deviation(&first) < 1e-3 && deviation(&second) > 0.01, "{answer}");
    assert!(place["probe_overlap"].as_f64() > Some(0.99) && place["residual"].as_f64() < Some(1.0), "{place}");

    // a stored model asks the same; without asking nothing is laid anywhere
    let twin = upload(&server, &changed(&bean, 1.0, -1.0), "mm").await;
    let asked = json!({"model_id": twin, "limit": 1, "place": true});
    let answer = expect_json(server.post("/v1/queries", &asked).await, StatusCode::OK).await;
    assert_eq!(
        (text(&answer, "/matches/0/model_id"), &answer["matches"][0]["place"]["is_mirrored"]),
        (id, &json!(true))
    );
    let plain = expect_json(server.post("/v1/queries", &json!({"model_id": twin})).await, StatusCode::OK).await;
    assert!(plain["matches"][0].get("place").is_none());
    let refused = server.post("/v1/queries", &json!({"standard": "face", "place": true})).await;
    expect_problem(refused, 422, "invalid_field").await;
}

/// The points of one scan of a thing in a unit that nobody says, as text.
fn single_scan(mesh: &Mesh) -> Part {
    let diagonal = mesh.bounds().expect("it has vertices").diagonal();
    let scanner = Scanner {
        views: 1,
        distance: 2.5 * diagonal,
        resolution: 0.01 * diagonal,
        noise: 0.003 * diagonal,
        ..Scanner::default()
    };
    let points = scanner.scan_set(mesh, 3).scans.remove(0).cloud.points;
    let lines = points.iter().map(|p| format!("{} {} {}\n", 0.01 * p.x, 0.01 * p.y, 0.01 * p.z));
    Part::bytes(lines.collect::<String>().into_bytes()).file_name("scan.xyz")
}

#[tokio::test]
async fn a_single_scan_is_laid_onto_its_first_answers_and_what_it_lies_on_comes_first() {
    let server = ready().await;
    let names =
        ["animal", "bean", "bracket", "mug", "teapot", "propeller", "gem", "leaf", "crank", "vase", "torus", "rope"];
    let known: Vec<_> = shapes::catalogue().into_iter().filter(|shape| names.contains(&shape.name)).collect();
    let things = known.iter().flat_map(|shape| [1, 2].map(|seed| shape.mesh_of(seed, 8.0)));
    let mut models = Vec::new();
    for mesh in things {
        models.push((upload(&server, &mesh, "mm").await, mesh));
    }
    for (id, mesh) in models.iter().step_by(3).take(2) {
        let ask = |place: &str| {
            let form =
                Form::new().part("probe", single_scan(mesh)).text("likeness", "view").text("place", place.to_owned());
            server.post_form("/v1/queries/probe", form.text("limit", "12"))
        };
        let plain = expect_json(ask("false").await, StatusCode::OK).await;
        let answer = expect_json(ask("true").await, StatusCode::OK).await;
        let ids = |of: &Value| -> Vec<String> {
            of["matches"].as_array().expect("matches").iter().map(|found| text(found, "/model_id")).collect()
        };
        assert!(plain.get("placed").is_none() && answer["placed"] == json!(10), "{answer}");
        let [mut before, mut after] = [ids(&plain), ids(&answer)];
        assert_eq!(before[10..], after[10..], "what was not laid stays where it was");
        let same = |index: usize| answer["matches"][index]["place"]["same_object"].as_f64().unwrap_or(0.0);
        assert_eq!((&after[0], same(0) > 0.5, same(1) < 0.5), (id, true, true), "{answer}");
        assert!(answer["matches"][0]["place"]["sighted"]["in_front"].is_f64());
        before.sort();
        after.sort();
        assert_eq!(before, after);
    }
}

/// All pages of the list, each of one model at most: what repeats what, in which way.
async fn duplicates(server: &TestServer) -> Vec<(String, String, String)> {
    let (mut found, mut cursor) = (Vec::new(), String::new());
    loop {
        let page = server.get(&format!("/v1/gallery/duplicates?limit=1{cursor}")).await;
        let page = expect_json(page, StatusCode::OK).await;
        for group in page["groups"].as_array().expect("groups") {
            for duplicate in group["duplicates"].as_array().expect("duplicates") {
                assert_eq!(duplicate["place"].is_null(), duplicate["repetition"] == "same_file", "{duplicate}");
                let model = text(duplicate, "/model_id");
                found.push((model, text(duplicate, "/repetition"), text(group, "/model_id")));
            }
        }
        let Some(next) = page["next_cursor"].as_str() else { return found };
        cursor = format!("&cursor={next}");
    }
}

#[tokio::test]
async fn what_is_there_twice_is_told_with_the_way_in_which_it_is() {
    let server = ready().await;
    let (bean, animal) = (thing("bean"), thing("animal"));
    let first = upload(&server, &bean, "mm").await;
    upload(&server, &animal, "mm").await;
    upload(&server, &thing("bracket"), "mm").await;
    let ways = [
        ("same_file", bean.clone()),
        ("same_surface", changed(&bean, 1.0, 1.0)),
        ("same_surface", remeshed(&bean)),
        ("scaled", changed(&bean, 2.0, 1.0)),
        ("mirrored", changed(&bean, 1.0, -1.0)),
    ];
    let mut expected = Vec::new();
    for (way, mesh) in &ways {
        expected.push((upload(&server, mesh, "mm").await, (*way).to_owned(), first.clone()));
    }
    assert_eq!(duplicates(&server).await, expected);
    // what was repeated goes: the next one stands for all
    assert!(server.delete(&format!("/v1/models/{first}")).await.is_success());
    let left = duplicates(&server).await;
    assert_eq!(left.len(), 4, "{left:?}");
    assert!(left.iter().all(|(_, _, of)| *of == expected[0].0), "{left:?}");
    for wrong in ["limit=0", "limit=101", "cursor=x"] {
        let refused = server.get(&format!("/v1/gallery/duplicates?{wrong}")).await;
        expect_problem(refused, 422, "invalid_field").await;
    }
}
