//! The commands that talk to a running service, against the real binary.
#![cfg(unix)]

use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

use crate::binary::{Process, folder_of_scans};

/// Runs a command against a service.
fn ask(url: &str, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_visage")).args(arguments).env("VISAGE_SERVER", url).output().expect("it runs")
}

fn told(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

fn complaint(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// What a command that has to succeed prints as JSON.
fn json(url: &str, arguments: &[&str]) -> Value {
    let output = ask(url, &[arguments, &["--json"]].concat());
    assert!(output.status.success(), "{arguments:?}: {}", complaint(&output));
    serde_json::from_str(&told(&output)).unwrap_or_else(|error| panic!("{arguments:?}: {error}: {}", told(&output)))
}

fn path(folder: &Path) -> &str {
    folder.to_str().expect("UTF-8")
}

#[test]
fn a_folder_goes_to_the_service_and_comes_back_as_a_model() {
    let (data, scans) = (tempfile::tempdir().expect("a folder"), tempfile::tempdir().expect("a folder"));
    let service = Process::start(data.path());
    let url = service.url.as_str();
    let names = folder_of_scans(scans.path());

    let arguments = ["upload", path(scans.path()), "--unit", "mm", "--label", "ball", "--no-signature", "--wait"];
    let job = json(url, &arguments);
    assert_eq!((&job["status"], &job["label"]), (&"succeeded".into(), &"ball".into()), "{job}");
    assert_eq!(job["options"]["signature"], false);
    let (id, model) = (job["id"].as_str().expect("an id"), job["model_id"].as_str().expect("a model"));

    let listed = told(&ask(url, &["jobs"]));
    assert!(listed.contains(id) && listed.contains("succeeded"), "{listed}");
    let models = told(&ask(url, &["models", "list"]));
    assert!(models.contains(model) && models.contains("ball"), "{models}");
    let found = |arguments: &[&str]| json(url, &[&["models"], arguments].concat())["items"].as_array().map(Vec::len);
    assert_eq!(found(&["--text", "BALL"]), Some(1));
    assert_eq!(found(&["list", "--text", "ball", "--label", "ball"]), Some(1));
    assert_eq!(found(&["--text", "jug"]), Some(0));
    let report = told(&ask(url, &["report", model]));
    assert!(report.contains("quality: ") && report.contains(&names[2]), "{report}");
    let nobody = json(url, &["query", "--standard", "face", "--text", "nobody has this name"]);
    assert_eq!(nobody["matches"], serde_json::json!([]), "{nobody}");
    let answer = json(url, &["query", "--standard", "face"]);
    assert_eq!(answer["matches"].as_array().map(Vec::len), Some(0), "it has no signature");

    for (file, begins) in [("cloud.xyz", ""), ("mesh.stl", ""), ("poses.json", "{"), ("model.ply", "ply")] {
        let out = scans.path().join(file);
        let done = ask(url, &["models", "download", model, path(&out)]);
        assert!(done.status.success(), "{file}: {}", complaint(&done));
        let content = std::fs::read(&out).expect("written");
        assert!(!content.is_empty() && content.starts_with(begins.as_bytes()), "{file}");
    }
    let refused = ask(url, &["models", "download", model, "model.doc"]);
    assert!(complaint(&refused).contains("are not written: choose"), "{}", complaint(&refused));

    assert!(ask(url, &["models", "delete", model]).status.success());
    let gone = ask(url, &["report", model]);
    assert!(!gone.status.success() && complaint(&gone).contains("404"), "{}", complaint(&gone));
}

#[test]
fn what_was_deleted_is_listed_put_back_and_removed_for_good() {
    let data = tempfile::tempdir().expect("a folder");
    let service = Process::start_with(data.path(), &["--bin-days", "7"], std::process::Stdio::null());
    let url = service.url.as_str();
    let file = data.path().with_extension("obj");
    std::fs::write(&file, crate::common::files::bumpy_sphere(0.3)).expect("written");
    let model = json(url, &["models", "add", path(&file), "--name", "a ball"]);
    std::fs::remove_file(&file).expect("removed");
    let id = model["id"].as_str().expect("an id");
    let done = |arguments: &[&str]| {
        let output = ask(url, arguments);
        assert!(output.status.success(), "{arguments:?}: {}", complaint(&output));
        told(&output)
    };
    done(&["models", "delete", id]);
    let listed = done(&["bin"]);
    assert!(listed.contains(id) && listed.contains("a ball"), "{listed}");
    assert_eq!(json(url, &["bin", "restore", id])["id"], id);
    assert!(!done(&["bin", "list"]).contains(id));
    done(&["models", "delete", id]);
    done(&["bin", "empty"]);
    let gone = ask(url, &["bin", "restore", id]);
    assert!(!gone.status.success() && complaint(&gone).contains("404"), "{}", complaint(&gone));
}

#[test]
fn what_was_sent_is_not_sent_again_and_archives_are_taken_apart() {
    let (data, scans) = (tempfile::tempdir().expect("a folder"), tempfile::tempdir().expect("a folder"));
    let service = Process::start(data.path());
    let url = service.url.as_str();
    let names = folder_of_scans(scans.path());
    let file = |index: usize| scans.path().join(&names[index]);

    let set = json(url, &["upload", path(&file(0)), path(&file(1)), "--no-register"]);
    let id = set["id"].as_str().expect("an id");
    assert_eq!(set["scans"].as_array().map(Vec::len), Some(2));
    let before = set["scans"][0]["checksum"].clone();
    let more = json(url, &["upload", path(scans.path()), "--into", id, "--no-register"]);
    assert_eq!(more["scans"].as_array().map(Vec::len), Some(3));
    assert_eq!(more["scans"][0]["checksum"], before);

    // a file that holds poses of all, in an archive with the scans: the service finds it
    let identity = "[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]";
    let poses: Vec<String> = names.iter().map(|name| format!("{name:?}: {identity}")).collect();
    std::fs::write(scans.path().join("poses.json"), format!("{{{}}}", poses.join(","))).expect("written");
    std::fs::write(scans.path().join("notes.mtl"), "newmtl a\n").expect("written");
    let packed = json(url, &["upload", path(scans.path()), "--no-register", "--name", "packed"]);
    assert_eq!((&packed["name"], packed["scans"].as_array().map(Vec::len)), (&"packed".into(), Some(3)), "{packed}");
    assert_eq!(packed["poses"]["count"], 3, "{packed}");
}

#[test]
fn a_service_that_is_not_there_or_refuses_is_told_with_the_remedy() {
    let nobody = ask("http://127.0.0.1:1", &["models"]);
    assert!(!nobody.status.success());
    assert!(
        complaint(&nobody).contains("no service answers at http://127.0.0.1:1/: start one"),
        "{}",
        complaint(&nobody)
    );

    let data = tempfile::tempdir().expect("a folder");
    let service = Process::start(data.path());
    let scan = data.path().join("empty.ply");
    std::fs::write(&scan, "ply\n").expect("written");
    let refused = ask(&service.url, &["upload", path(&scan)]);
    let text = complaint(&refused);
    assert!(!refused.status.success() && text.contains("sending empty.ply") && text.contains("422"), "{text}");
}

/// A scan of more than the 4 MiB from which scans are sent piece by piece.
fn large_scan() -> Vec<u8> {
    let count: u16 = 60_000;
    let properties: String = (0..20).map(|index| format!("property float p{index}\n")).collect();
    let head = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {count}\nproperty float x\nproperty float y\n\
         property float z\n{properties}end_header\n"
    );
    let point =
        |index: u16| (0..23_u16).flat_map(move |column| f32::from(index.wrapping_mul(column + 1)).to_le_bytes());
    head.into_bytes().into_iter().chain((0..count).flat_map(point)).collect()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_large_scan_that_was_broken_off_is_gone_on_with_by_the_next_run() {
    use base64::Engine as _;
    use base64::engine::general_purpose::STANDARD;
    use sha2::Digest;
    let (data, scans) = (tempfile::tempdir().expect("a folder"), tempfile::tempdir().expect("a folder"));
    let service = Process::start(data.path());
    let (content, client) = (large_scan(), crate::binary::client());
    assert!(content.len() > 5_000_000);
    std::fs::write(scans.path().join("large.ply"), &content).expect("written");
    let set = client.post(format!("{}/v1/scan-sets", service.url)).json(&serde_json::json!({"name": "a"})).send().await;
    let set: Value = set.expect("an answer").json().await.expect("JSON");
    let set = set["id"].as_str().expect("an id").to_owned();
    let digest = format!("sha-256=:{}:", STANDARD.encode(sha2::Sha256::digest(&content)));
    let metadata = format!("filename {},digest {}", STANDARD.encode("large.ply"), STANDARD.encode(digest));
    let begun = client.post(format!("{}/v1/scan-sets/{set}/uploads", service.url));
    let begun = begun.header("upload-length", content.len()).header("upload-metadata", metadata).send().await;
    let begun: Value = begun.expect("an answer").json().await.expect("JSON");
    let upload = format!("{}{}", service.url, begun["href"].as_str().expect("an address"));
    let sent =
        client.patch(&upload).header("upload-offset", 0).header("content-type", "application/offset+octet-stream");
    assert_eq!(sent.body(content[..3_000_000].to_vec()).send().await.expect("an answer").status(), 204);

    let arguments = ["upload", path(scans.path()), "--into", &set, "--no-register"];
    let url = service.url.clone();
    let stored = tokio::task::block_in_place(|| json(&url, &arguments));
    assert_eq!(stored["scans"][0]["checksum"], blake3::hash(&content).to_hex().to_string());
    let offset = client.head(&upload).send().await.expect("an answer").headers()["upload-offset"].clone();
    assert_eq!(offset, content.len().to_string(), "it is this upload that was gone on with");
    // and it is not sent once more
    let again = tokio::task::block_in_place(|| ask(&url, &arguments));
    assert!(again.status.success(), "{}", complaint(&again));
}

#[test]
fn a_result_and_a_file_are_opened_in_the_page_until_they_are_done_with() {
    use std::io::{BufRead, BufReader};
    let result = tempfile::tempdir().expect("a folder");
    let ball = crate::common::files::bumpy_sphere(0.3);
    for name in ["mesh.obj", "cloud.obj"] {
        std::fs::write(result.path().join(name), &ball).expect("written");
    }
    std::fs::write(result.path().join("report.json"), "{\"result\": {\"unit\": \"cm\"}}").expect("written");
    let temporary = tempfile::tempdir().expect("a folder");
    let mut child = Command::new(env!("CARGO_BIN_EXE_visage"))
        .args(["open", path(result.path())])
        .env("TMPDIR", temporary.path())
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::null())
        .spawn()
        .expect("it runs");
    let mut line = String::new();
    BufReader::new(child.stdout.take().expect("piped")).read_line(&mut line).expect("a line");
    let (url, place) = line.trim().split_once("/#/").expect("an address of the page");
    assert!(url.starts_with("http://127.0.0.1:") && place.starts_with("compare?a="), "{line}");
    let models = json(url, &["models"]);
    let shown: Vec<(&str, &str)> = models["items"]
        .as_array()
        .expect("items")
        .iter()
        .map(|model| (model["name"].as_str().expect("a name"), model["unit"].as_str().expect("a unit")))
        .collect();
    assert!(shown.iter().all(|(_, unit)| *unit == "cm") && shown[0].0.ends_with(" (cloud)"), "{shown:?}");
    assert!(std::fs::read_dir(temporary.path()).expect("a folder").next().is_some());
    let stopped = Command::new("kill").args(["-INT", &child.id().to_string()]).status().expect("kill runs");
    assert!(stopped.success() && child.wait().expect("it ends").success());
    assert_eq!(std::fs::read_dir(temporary.path()).expect("a folder").count(), 0, "nothing stays");

    for (given, said) in
        [("nowhere.ply", "there is no nowhere.ply"), (path(temporary.path()), "neither meshes nor clouds")]
    {
        let refused = Command::new(env!("CARGO_BIN_EXE_visage")).args(["open", given]).output().expect("it runs");
        assert!(!refused.status.success() && complaint(&refused).contains(said), "{}", complaint(&refused));
    }
    let broken = result.path().join("broken.ply");
    std::fs::write(&broken, "ply\n").expect("written");
    let refused = Command::new(env!("CARGO_BIN_EXE_visage")).args(["open", path(&broken)]).output().expect("it runs");
    let text = complaint(&refused);
    assert!(!refused.status.success() && text.contains("opening") && text.contains("422"), "{text}");
}
