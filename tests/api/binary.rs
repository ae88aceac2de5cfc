//! The real binary: what it prints, how it stops, and that it survives being killed.
#![cfg(unix)]

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::common::database::database_for;
use crate::common::{expect_json, files, text};
use reqwest::multipart::{Form, Part};
use reqwest::{Client, StatusCode};
use serde_json::{Value, json};
use visage::domain::asset::Asset;

/// What tells a command on a folder that its database is on a server, if it is.
pub fn on_server(folder: &Path) -> Option<(&'static str, String)> {
    database_for(folder).map(|url| ("VISAGE_DATABASE", url.secret().to_owned()))
}

/// A running `visage serve`, killed when dropped.
pub struct Process {
    pub child: Child,
    pub url: String,
}

impl Process {
    pub fn start(folder: &Path) -> Process {
        Process::start_with(folder, &[], Stdio::null())
    }

    /// Starts with further arguments; the log goes to `log`.
    pub fn start_with(folder: &Path, arguments: &[&str], log: Stdio) -> Process {
        Process::start_in(folder, arguments, &[], log)
    }

    /// The same with variables of the environment.
    pub fn start_in(folder: &Path, arguments: &[&str], environment: &[(&str, String)], log: Stdio) -> Process {
        let mut child = Command::new(env!("CARGO_BIN_EXE_visage"))
            .args(["serve", "--addr", "127.0.0.1:0", "--log-format", "json", "--data"])
            .arg(folder)
            .args(arguments)
            .envs(on_server(folder))
            .envs(environment.iter().map(|(name, value)| (name, value)))
            .stdout(Stdio::piped())
            .stderr(log)
            .spawn()
            .expect("the binary starts");
        let mut line = String::new();
        BufReader::new(child.stdout.take().expect("piped")).read_line(&mut line).expect("a line");
        let url = line.trim().strip_prefix("listening on ").unwrap_or_else(|| panic!("{line:?}")).to_owned();
        Process { child, url }
    }

    pub fn signal(&self, signal: &str) {
        let status = Command::new("kill").args([signal, &self.child.id().to_string()]).status().expect("kill runs");
        assert!(status.success());
    }

    pub async fn get(&self, path: &str) -> Value {
        let response = client().get(format!("{}{path}", self.url)).send().await.expect("an answer");
        expect_json(response, StatusCode::OK).await
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // already gone in most tests
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

pub fn client() -> Client {
    Client::builder().no_proxy().timeout(Duration::from_secs(120)).build().expect("a client")
}

#[tokio::test]
async fn it_serves_is_well_and_stops_when_told_to() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for signal in ["-TERM", "-INT"] {
        let mut process = Process::start(folder.path());
        assert_eq!(process.get("/healthz").await["status"], "ok");
        let addr = process.url.strip_prefix("http://").expect("a URL").to_owned();
        let check = || Command::new(env!("CARGO_BIN_EXE_visage")).args(["healthcheck", "--addr", &addr]).output();
        assert!(check().expect("it runs").status.success());
        let begin = Instant::now();
        process.signal(signal);
        assert!(process.child.wait().expect("it ends").success());
        assert!(begin.elapsed() < Duration::from_secs(5), "{:?}", begin.elapsed());
        assert!(!check().expect("it runs").status.success());
    }
}

#[tokio::test]
async fn a_second_server_on_the_same_folder_is_refused() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let first = Process::start(folder.path());
    let second = Command::new(env!("CARGO_BIN_EXE_visage"))
        .args(["serve", "--addr", "127.0.0.1:0", "--data"])
        .arg(folder.path())
        .envs(on_server(folder.path()))
        .output()
        .expect("it runs");
    assert!(!second.status.success());
    assert!(String::from_utf8_lossy(&second.stderr).contains("in use by another visage server"));
    assert_eq!(first.get("/healthz").await["status"], "ok");
}

#[test]
fn a_reader_that_has_seen_enough_ends_the_command_quietly() {
    let mut command = Command::new(env!("CARGO_BIN_EXE_visage"));
    let mut child = command.arg("openapi").stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("it runs");
    drop(child.stdout.take());
    let output = child.wait_with_output().expect("it ends");
    assert_eq!(String::from_utf8_lossy(&output.stderr), "");
}

#[test]
fn it_prints_its_contract() {
    let output = Command::new(env!("CARGO_BIN_EXE_visage")).arg("openapi").output().expect("it runs");
    assert!(output.status.success());
    assert_eq!(String::from_utf8(output.stdout).expect("text"), visage::http::openapi_yaml().expect("YAML"));
}

/// A folder with three scans, and their names.
pub fn folder_of_scans(folder: &Path) -> Vec<String> {
    let names: Vec<String> = (0..3).map(|index| format!("s{index}.ply")).collect();
    for (index, name) in names.iter().enumerate() {
        std::fs::write(folder.join(name), coarse_scan(index, 40)).expect("written");
    }
    names
}

#[test]
fn register_writes_the_files_that_the_service_keeps() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let names = folder_of_scans(folder.path());
    let poses = folder.path().join("given.json");
    std::fs::write(&poses, disturbed_poses(&names)).expect("written");
    let out = folder.path().join("out");
    let register = |more: &[&str]| {
        Command::new(env!("CARGO_BIN_EXE_visage"))
            .args(["register", "--no-signature", "--poses"])
            .args([poses.as_path(), folder.path(), Path::new("--out"), out.as_path()])
            .args(more)
            .output()
            .expect("it starts")
    };
    let refused = register(&["--min-overlap", "0.01"]);
    let complaint = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(!refused.status.success() && complaint.contains("not between 0.05 and 0.95"), "{complaint}");
    let bare = register(&["--no-mesh"]);
    assert!(bare.status.success(), "{}", String::from_utf8_lossy(&bare.stderr));
    assert!(out.join(&*Asset::Cloud.name()).is_file() && !out.join(&*Asset::Mesh.name()).exists());
    assert!(!String::from_utf8_lossy(&bare.stdout).contains("surface:"));
    let done = register(&["--fill", "none"]);
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let said = String::from_utf8_lossy(&done.stdout).into_owned();
    assert!(said.lines().any(|line| line.starts_with("surface: ") && line.contains(" 0 closed")), "{said}");
    for asset in Asset::RESULTS {
        // a copy of 100 000 triangles is made of larger meshes only
        let is_made = *asset != Asset::Medium;
        assert_eq!(out.join(&*asset.name()).is_file(), is_made, "{asset:?}");
    }
    let conf = std::fs::read(out.join(&*Asset::PosesConf.name())).expect("written");
    assert_eq!(visage::formats::poses::read("it", &conf).expect("sound").poses.len(), 3);
}

/// A part of a bumpy sphere as a scan; with 220 rows so dense that registering a few takes a while.
pub fn coarse_scan(index: usize, rows: usize) -> Vec<u8> {
    let mut points = Vec::new();
    for row in 0..rows {
        for column in 0..rows {
            let polar = 0.6 + 1.8 * row as f64 / rows as f64;
            let azimuth = index as f64 * 0.5 + 2.4 * column as f64 / rows as f64;
            let radius = 80.0 + 5.0 * (5.0 * polar).sin() * (3.0 * azimuth).cos() + 2.0 * (7.0 * azimuth + polar).sin();
            let (x, y) = (radius * polar.sin() * azimuth.cos(), radius * polar.sin() * azimuth.sin());
            points.push(format!("{x:.5} {y:.5} {:.5}\n", radius * polar.cos()));
        }
    }
    format!("{}{}", files::header(points.len()), points.concat()).into_bytes()
}

pub fn disturbed_poses(names: &[String]) -> String {
    let pose = |index: usize| {
        let angle = 0.01 * index as f64;
        json!([[angle.cos(), -angle.sin(), 0, 0.5], [angle.sin(), angle.cos(), 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    };
    let map: serde_json::Map<String, Value> =
        names.iter().enumerate().map(|(index, name)| (name.clone(), pose(index))).collect();
    Value::Object(map).to_string()
}

pub async fn start_job(process: &Process) -> String {
    start_job_of(process, 220).await
}

/// A job on six scans of so many rows.
pub async fn start_job_of(process: &Process, rows: usize) -> String {
    let names: Vec<String> = (0..6).map(|index| format!("part{index}.ply")).collect();
    let form = names.iter().enumerate().fold(Form::new(), |form, (index, name)| {
        form.part("scans", Part::bytes(coarse_scan(index, rows)).file_name(name.clone()))
    });
    let form = form.part("poses", Part::text(disturbed_poses(&names)));
    let response = client().post(format!("{}/v1/jobs", process.url)).multipart(form).send().await.expect("an answer");
    text(&expect_json(response, StatusCode::ACCEPTED).await, "/id")
}

pub async fn finished(process: &Process, job: &str) -> Value {
    loop {
        let view = process.get(&format!("/v1/jobs/{job}?wait=60")).await;
        if !["queued", "running"].contains(&view["status"].as_str().unwrap_or_default()) {
            return view;
        }
    }
}

pub async fn results(process: &Process, ended: &Value) -> (Value, bytes::Bytes, Value) {
    assert_eq!(ended["status"], "succeeded", "{ended}");
    let model = text(ended, "/links/model");
    let cloud = client().get(format!("{}{model}/cloud.ply", process.url)).send().await.expect("an answer");
    let report = process.get(&format!("{model}/report.json")).await;
    let cloud = cloud.bytes().await.expect("a body");
    (process.get(&format!("{model}/poses.json")).await, cloud, report["result"].clone())
}

#[tokio::test]
async fn killed_in_a_job_it_finishes_with_the_same_bytes_after_a_restart() {
    let (quiet, rough) = (tempfile::tempdir().expect("a folder"), tempfile::tempdir().expect("a folder"));
    let undisturbed = Process::start(quiet.path());
    let job = start_job(&undisturbed).await;
    let expected = results(&undisturbed, &finished(&undisturbed, &job).await).await;

    let process = Process::start(rough.path());
    let job = start_job(&process).await;
    let begin = Instant::now();
    loop {
        let view = process.get(&format!("/v1/jobs/{job}")).await;
        if view["stage"] == "registering" {
            break;
        }
        assert!(begin.elapsed() < Duration::from_secs(60), "never registering: {view}");
    }
    process.signal("-KILL");
    // at once: the killed process may still hold its lock
    let restarted = Process::start(rough.path());
    let ended = finished(&restarted, &job).await;
    assert_eq!(ended["attempts"], 2);
    assert_eq!(results(&restarted, &ended).await, expected);
}

#[tokio::test]
async fn keys_are_made_and_revoked_beside_a_running_server() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let key = |arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_visage"));
        let output = command
            .arg("key")
            .args(arguments)
            .arg("--data")
            .arg(folder.path())
            .envs(on_server(folder.path()))
            .output()
            .expect("it runs");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).expect("text").trim().to_owned()
    };
    let process = Process::start(folder.path());
    let models = format!("{}/v1/models", process.url);
    assert_eq!(client().get(&models).send().await.expect("an answer").status(), 200);
    let token = key(&["create", "--name", "a person", "--scope", "write", "--expires-in", "30"]);
    assert_eq!(client().get(&models).send().await.expect("an answer").status(), 401);
    assert_eq!(client().get(&models).bearer_auth(&token).send().await.expect("an answer").status(), 200);
    let list = key(&["list"]);
    assert!(list.contains("write") && list.contains("a person") && list.contains("until") && !list.contains(&token));
    key(&["revoke", list.split(' ').next().expect("an id")]);
    assert_eq!(client().get(&models).bearer_auth(&token).send().await.expect("an answer").status(), 401);
    drop(process);
    // without a server
    assert!(key(&["list"]).contains("revoked"));
    assert!(key(&["create", "--name", "another"]).starts_with("visage_"));
}

#[test]
fn nobody_is_let_in_from_elsewhere_by_accident() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let output = Command::new(env!("CARGO_BIN_EXE_visage"))
        .args(["serve", "--addr", "0.0.0.0:0", "--data"])
        .arg(folder.path())
        .output()
        .expect("it runs");
    assert!(!output.status.success());
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(said.contains("visage key create") && said.contains("--open"), "{said}");
}

#[tokio::test]
async fn killed_in_a_surface_job_it_loses_nothing_and_makes_the_same_bytes() {
    let folder = tempfile::tempdir().expect("a folder");
    let process = Process::start(folder.path());
    let cloud = Part::bytes(coarse_scan(0, 300)).file_name("cloud.ply");
    let form = Form::new().part("model", cloud).text("unit", "mm");
    let sent = client().post(format!("{}/v1/models", process.url)).multipart(form).send().await.expect("an answer");
    let model = text(&expect_json(sent, StatusCode::CREATED).await, "/id");
    let order = json!({"kind": "surface", "model_id": model, "options": {"fill": "all", "triangles": 9000}});
    let post = async |process: &Process| {
        let sent = client().post(format!("{}/v1/jobs", process.url)).json(&order).send().await.expect("an answer");
        text(&expect_json(sent, StatusCode::ACCEPTED).await, "/id")
    };
    let job = post(&process).await;
    loop {
        let view = process.get(&format!("/v1/jobs/{job}")).await;
        if view["stage"] == "surfacing" {
            break;
        }
        assert!(["queued", "running"].map(Value::from).contains(&view["status"]), "never surfacing: {view}");
    }
    process.signal("-KILL");
    let restarted = Process::start(folder.path());
    let ended = finished(&restarted, &job).await;
    assert_eq!((&ended["status"], &ended["attempts"]), (&json!("succeeded"), &json!(2)), "{ended}");
    // one that nobody disturbs
    let again = finished(&restarted, &post(&restarted).await).await;
    let made = async |ended: &Value| {
        let model = text(ended, "/links/model");
        let mut files = Vec::new();
        for asset in ["cloud.ply", "mesh.ply", "preview.glb"] {
            let sent = client().get(format!("{}{model}/{asset}", restarted.url)).send().await.expect("an answer");
            assert_eq!(sent.status(), StatusCode::OK, "{asset}");
            files.push(sent.bytes().await.expect("a body"));
        }
        (files, restarted.get(&format!("{model}/report.json")).await["result"].clone())
    };
    assert_eq!(made(&ended).await, made(&again).await);
    let models = restarted.get("/v1/models").await;
    assert_eq!(models["items"].as_array().map(Vec::len), Some(3), "the model, and what each job has made");
    restarted.signal("-TERM");
    drop(restarted);
    let doctor = Command::new(env!("CARGO_BIN_EXE_visage"))
        .args(["doctor", "--data"])
        .arg(folder.path())
        .envs(on_server(folder.path()))
        .output();
    let doctor = doctor.expect("it runs");
    assert!(doctor.status.success(), "{}", String::from_utf8_lossy(&doctor.stdout));
}
