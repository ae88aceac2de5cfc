//! From scans without poses to faces with landmarks, over a real connection with the real algorithms. Needs the data
//! folder in VISAGE_DATA; run in release: `cargo test --release --test real queries -- --ignored --nocapture`.

use std::path::{Path, PathBuf};
use std::time::Duration;

use reqwest::multipart::{Form, Part};
use reqwest::{Client, Response};
use serde_json::{Value, json};
use visage::config::ServerConfig;
use visage::formats::poses;
use visage::geometry::{Motion, Point3};
use visage::http::{Server, ServerHandle};

use crate::{data, read};

/// Landmarks must be this near to the true ones, mm, on average over a face.
const MOST_ERROR_MM: f64 = 4.0;

fn scan_sets() -> PathBuf {
    data("faces/scansets")
}

async fn json_of(response: Response) -> Value {
    let status = response.status();
    let body = response.text().await.expect("a body");
    assert!(status.is_success(), "{status}: {body}");
    serde_json::from_str(&body).expect("JSON")
}

/// The scans of a set, without their poses.
fn form(folder: &Path) -> Form {
    let scans = (0..8).map(|index| format!("scan_{index:02}.ply"));
    scans.fold(Form::new().text("unit", "mm"), |form, name| {
        form.part("scans", Part::bytes(read(folder.join(&name))).file_name(name))
    })
}

struct Service {
    client: Client,
    handle: ServerHandle,
}

impl Service {
    async fn get(&self, path: &str) -> Value {
        json_of(self.client.get(format!("{}{path}", self.handle.url())).send().await.expect("an answer")).await
    }

    /// Uploads a set and registers it; answers with its model.
    async fn registered(&self, name: &str) -> String {
        let base = self.handle.url();
        let sets = self.client.post(format!("{base}/v1/scan-sets")).multipart(form(&scan_sets().join(name)));
        let set = json_of(sets.send().await.expect("an answer")).await;
        let job = json!({"scan_set_id": set["id"], "label": name, "options": {"threads": 2}});
        let job =
            json_of(self.client.post(format!("{base}/v1/jobs")).json(&job).send().await.expect("an answer")).await;
        let path = format!("/v1/jobs/{}", job["id"].as_str().expect("an id"));
        loop {
            let job = self.get(&format!("{path}?wait=30")).await;
            match job["status"].as_str() {
                Some("succeeded") => return job["model_id"].as_str().expect("a model").to_owned(),
                Some("queued" | "running") => {}
                _ => panic!("{name}: {job}"),
            }
        }
    }

    /// The motion from the registered world into the true one: by the first scan, which both have a pose for.
    async fn motion_to_truth(&self, name: &str, model: &str) -> Motion {
        let found = self.get(&format!("/v1/models/{model}/poses.json")).await;
        let found = poses::read("poses.json", found.to_string().as_bytes()).expect("sound poses");
        let truth = poses::read("poses.txt", &read(scan_sets().join(name).join("poses_gt.txt"))).expect("sound poses");
        let (first, true_pose) = &truth.poses[0];
        let pose = found.poses.iter().find(|(name, _)| name == first).expect("the first scan has a place").1;
        true_pose * pose.inverse()
    }
}

fn point(value: &Value) -> Point3 {
    let [x, y, z]: [f64; 3] = serde_json::from_value(value.clone()).expect("a place");
    Point3::new(x, y, z)
}

#[tokio::test]
#[ignore = "needs VISAGE_DATA"]
async fn heads_come_out_of_their_scans_as_faces_with_landmarks_and_the_owl_does_not() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut config = ServerConfig::new(([127, 0, 0, 1], 0).into(), folder.path());
    config.threads = 2;
    let handle = Server::start(config).await.expect("the server starts");
    let client = Client::builder().no_proxy().timeout(Duration::from_secs(60)).build().expect("a client");
    let service = Service { client, handle };
    let names = ["head_a", "head_b", "real_maxplanck", "nonface_owl"];
    let mut models = Vec::new();
    for name in names {
        models.push(service.registered(name).await);
    }
    let question = json!({"standard": "face", "explain": true});
    let url = format!("{}/v1/queries", service.handle.url());
    let answer = json_of(service.client.post(url).json(&question).send().await.expect("an answer")).await;
    for (name, model) in names.into_iter().zip(&models) {
        let matches = answer["matches"].as_array().expect("matches");
        let found = matches.iter().find(|found| found["model_id"] == model.as_str()).expect("every model is ranked");
        println!(
            "{name}: score {:.3}, residual {} mm",
            found["score"].as_f64().unwrap_or(0.0),
            found["dense_residual_mm"]
        );
        assert_eq!(found["is_match"], json!(name != "nonface_owl"), "{found}");
        if name == "nonface_owl" {
            assert!(found["landmarks"].is_null() && found["reason"]["code"].is_string(), "{found}");
            continue;
        }
        let motion_to_truth = service.motion_to_truth(name, model).await;
        let info: Value = serde_json::from_slice(&read(scan_sets().join(name).join("info.json"))).expect("JSON");
        let truth = info["landmarks_world"].as_object().expect("landmarks");
        let places = found["landmarks"].as_object().expect("landmarks");
        let errors: Vec<(&str, f64)> = truth
            .iter()
            .filter_map(|(landmark, place)| {
                let found = motion_to_truth * point(places.get(landmark)?);
                Some((landmark.as_str(), (found - point(place)).norm()))
            })
            .collect();
        let mean = errors.iter().map(|(_, error)| error).sum::<f64>() / errors.len() as f64;
        println!("  landmarks: mean {mean:.2} mm of {} ({errors:.1?})", errors.len());
        assert!(errors.len() >= 3 && mean <= MOST_ERROR_MM, "{name}");
    }
    assert!(service.handle.shutdown().await);
}
