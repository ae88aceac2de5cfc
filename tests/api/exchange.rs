//! A gallery is written into one file and read into another folder; files that are cut short, changed or hostile are refused.

use std::io::Write;
use std::path::Path;
use std::time::Duration;

use reqwest::StatusCode;
use reqwest::multipart::{Form, Part};
use serde_json::{Value, json};
use tempfile::TempDir;
use visage::app::engine::PipelineEngine;
use visage::app::exchange::{self, ImportError, Imported};
use visage::config::Limits;
use visage::storage::data_folder::DataFolder;

use crate::backup::is_sound;
use crate::common::{TestServer, expect_json, files, text};

const TIPS: [[f64; 3]; 3] = [[80.0, 0.0, 0.0], [10.0, 78.0, 0.0], [-36.0, -12.0, 70.0]];

fn folder() -> TempDir {
    tempfile::tempdir().expect("a temporary folder")
}

/// Opens a folder as the command does, and works on it where that may block.
async fn with<T: Send + 'static>(
    folder: &Path,
    work: impl FnOnce(&DataFolder, &tokio::runtime::Handle) -> T + Send + 'static,
) -> T {
    let data = DataFolder::open(folder, Duration::ZERO).await.expect("a data folder");
    let runtime = tokio::runtime::Handle::current();
    let worked = tokio::task::spawn_blocking(move || {
        let done = work(&data, &runtime);
        runtime.block_on(data.storage.database.close());
        done
    });
    worked.await.expect("no panic")
}

async fn export(folder: &Path) -> Vec<u8> {
    let write = |data: &DataFolder, runtime: &tokio::runtime::Handle| {
        let mut file = Vec::new();
        exchange::export(&data.storage, runtime, &mut file).expect("written");
        file
    };
    with(folder, write).await
}

async fn import(folder: &Path, file: Vec<u8>) -> Result<Imported, ImportError> {
    let read = move |data: &DataFolder, runtime: &tokio::runtime::Handle| {
        let limits = Limits::default().read_limits();
        exchange::import(&data.storage, runtime, &PipelineEngine, &limits, file.as_slice())
    };
    with(folder, read).await
}

async fn upload(server: &TestServer, content: Vec<u8>, label: &'static str) -> String {
    let part = Part::bytes(content).file_name("ball.obj");
    let form = Form::new().part("model", part).text("unit", "mm").text("label", label);
    text(&expect_json(server.post_form("/v1/models", form).await, StatusCode::CREATED).await, "/id")
}

async fn json_of(server: &TestServer, path: &str) -> Value {
    expect_json(server.get(path).await, StatusCode::OK).await
}

/// The answer once no model waits to be judged.
async fn judged(server: &TestServer) -> Value {
    let mut changes = server.handle.changes();
    loop {
        let question = server.post("/v1/queries", &json!({"standard": "knobs"})).await;
        let answer = expect_json(question, StatusCode::OK).await;
        if answer["pending"] == 0 {
            return answer;
        }
        changes.changed().await.expect("the server lives");
    }
}

/// A gallery with an uploaded model of each kind, one of a job, and a standard that has learned; its folder, and what it answers.
async fn filled() -> (TempDir, Vec<Value>) {
    let server = TestServer::start().await;
    let knobbed = |size: f64| files::knobbed_ball(TIPS.map(|tip| tip.map(|x| x * size)));
    let of_class = upload(&server, knobbed(1.05), "knobs").await;
    let other = upload(&server, files::bumpy_sphere(0.0), "other").await;
    server.model().await;
    let landmarks = json!({"a": TIPS[0], "b": TIPS[1], "c": TIPS[2]});
    let form = Form::new()
        .part("model", Part::bytes(knobbed(1.0)).file_name("ball.obj"))
        .text("unit", "mm")
        .text("name", "knobs")
        .text("landmarks", landmarks.to_string())
        .text("positive", json!([of_class]).to_string())
        .text("negative", json!([other]).to_string());
    expect_json(server.post_form("/v1/standards", form).await, StatusCode::CREATED).await;
    let answers = answers(&server).await;
    let TestServer { folder, handle, .. } = server;
    handle.shutdown().await;
    (folder, answers)
}

/// What a gallery answers, whatever was made of it by which run.
async fn answers(server: &TestServer) -> Vec<Value> {
    let mut all = vec![judged(server).await];
    let models = json_of(server, "/v1/models").await;
    for model in models["items"].as_array().expect("models") {
        let id = text(model, "/id");
        let whole = json_of(server, &format!("/v1/models/{id}")).await;
        if let Some(job) = whole["job_id"].as_str() {
            all.push(json_of(server, &format!("/v1/jobs/{job}")).await);
        }
        for file in whole["assets"].as_array().expect("files") {
            let content = server.get(&text(file, "/href")).await.bytes().await.expect("a body");
            all.push(json!(blake3::hash(&content).to_hex().as_str()));
        }
        all.push(whole);
        if model["signature"].is_object() {
            let alike = server.post("/v1/queries", &json!({"model_id": id, "limit": 10})).await;
            all.push(expect_json(alike, StatusCode::OK).await);
        }
    }
    let standards = json_of(server, "/v1/standards").await;
    all.extend([models, standards["items"][1]["examples"].clone(), standards["items"][1]["threshold"].clone()]);
    all
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_imported_gallery_answers_as_the_exported_one_and_a_second_import_changes_nothing() {
    let (source, expected) = filled().await;
    let file = export(source.path()).await;
    assert_eq!(export(source.path()).await, file, "the same gallery is the same file");
    let target = folder();
    let done = import(target.path(), file.clone()).await.expect("read");
    let all = Imported { models: 3, standards: 1, ..Imported::default() };
    assert_eq!(done, all);
    assert!(is_sound(target.path()).await);
    let again = import(target.path(), file).await.expect("read");
    assert_eq!(again, Imported { known: 4, ..Imported::default() });
    let server = TestServer::start_on(target, |_| {}).await;
    for (answer, expected) in answers(&server).await.iter().zip(&expected) {
        assert_eq!(answer, expected);
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_was_cut_short_or_changed_is_refused_and_goes_on_where_it_ended() {
    let (source, _) = filled().await;
    let file = export(source.path()).await;
    let target = folder();
    for end in [0, 100, 512, 2000, file.len() / 2, file.len() - 2000] {
        let refused = import(target.path(), file[..end].to_vec()).await.expect_err("it is not whole");
        assert!(matches!(refused, ImportError::Cut | ImportError::NoExport), "{end}: {refused}");
        assert!(is_sound(target.path()).await, "cut at {end}");
    }
    // a byte of each entry's content
    let mut entries = tar::Archive::new(file.as_slice());
    let places: Vec<(u64, u64)> = entries
        .entries()
        .expect("a tar")
        .map(|entry| entry.map(|entry| (entry.raw_file_position(), entry.size())).expect("an entry"))
        .collect();
    let mut refusals = 0;
    for (begin, size) in &places {
        let mut changed = file.clone();
        changed[(begin + size / 2) as usize] ^= 0x20;
        let target = folder();
        match import(target.path(), changed).await {
            // a letter of a name, or a number, is another name or number
            Ok(done) => assert_eq!(done.models, 3),
            Err(refused) => {
                refusals += 1;
                assert!(
                    matches!(
                        refused,
                        ImportError::Damaged { .. }
                            | ImportError::Malformed { .. }
                            | ImportError::NoExport
                            | ImportError::Unexpected { .. }
                    ),
                    "{refused}"
                );
            }
        }
        assert!(is_sound(target.path()).await);
    }
    assert!(refusals * 2 > places.len(), "{refusals} of {}", places.len());
    let done = import(target.path(), file).await.expect("read");
    assert_eq!(done.models + done.known, 4 - done.standards, "{done:?}");
}

/// An archive of these entries.
fn archive(entries: &[(&str, &[u8])]) -> Vec<u8> {
    let mut archive = tar::Builder::new(Vec::new());
    for (place, content) in entries {
        let mut header = tar::Header::new_ustar();
        // as it is: what climbs out is what is tried here
        header.as_mut_bytes()[..place.len()].copy_from_slice(place.as_bytes());
        header.set_size(content.len() as u64);
        header.set_mode(0o600);
        header.set_cksum();
        archive.append(&header, *content).expect("written");
    }
    archive.into_inner().expect("written")
}

fn head(version: u32) -> Vec<u8> {
    json!({"format": "visage-gallery", "version": version, "program": "9.9.9"}).to_string().into_bytes()
}

/// A model with a file of this name.
fn described(id: &str, name: &str, content: &[u8]) -> Value {
    json!({
        "id": id, "name": "ball", "label": null, "unit": "mm", "points": 3, "quality": null, "reading": null,
        "files": [{"name": name, "bytes": content.len(), "blake3": blake3::hash(content).to_hex().as_str()}],
        "signature": null, "job": null, "scan_set": null,
    })
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn nothing_in_a_hostile_file_chooses_where_it_is_written_or_how_much_is_kept() {
    let id = visage::domain::ModelId::new().to_string();
    let place = format!("models/{id}/model.json");
    let head = head(1);
    let tail = |models: u64| json!({"models": models, "standards": 0}).to_string().into_bytes();
    let named = |name: &str| described(&id, name, b"v 0 0 0").to_string().into_bytes();
    let surroundings = folder();
    let target = surroundings.path().join("data");
    let refused = async |entries: &[(&str, &[u8])]| {
        let error = import(&target, archive(entries)).await.expect_err("refused");
        assert!(is_sound(&target).await);
        let outside: Vec<_> = std::fs::read_dir(surroundings.path()).expect("a folder").collect();
        assert_eq!(outside.len(), 1, "nothing is written beside the data folder: {error}");
        error
    };
    for climbing in ["../evil.ply", "/etc/evil.ply", "mesh.ply/../../../../evil", "evil.sh", ""] {
        let (model, at) = (named(climbing), format!("models/{id}/{climbing}"));
        let entries: [(&str, &[u8]); 4] =
            [("gallery.json", &head), (&place, &model), (&at, b"v 0 0 0"), ("end.json", &tail(1))];
        assert!(matches!(refused(&entries).await, ImportError::Malformed { .. }), "{climbing}");
    }
    // the description is sound, what follows is somewhere else
    let model = named("mesh.obj");
    for elsewhere in ["../../evil", "models/mesh.obj", "gallery.json"] {
        let entries: [(&str, &[u8]); 3] = [("gallery.json", &head), (&place, &model), (elsewhere, b"v 0 0 0")];
        assert!(matches!(refused(&entries).await, ImportError::Unexpected { .. }), "{elsewhere}");
    }
    let at = format!("models/{id}/mesh.obj");
    let twice: [(&str, &[u8]); 5] =
        [("gallery.json", &head), (&place, &model), (&at, b"v 0 0 0"), (&place, &model), (&at, b"v 0 0 0")];
    assert!(matches!(refused(&twice).await, ImportError::Malformed { .. }));
    let large = vec![b' '; 17 << 20];
    assert!(matches!(refused(&[("gallery.json", &head), (&place, &large)]).await, ImportError::TooLarge { .. }));
    let miscounted: [(&str, &[u8]); 2] = [("gallery.json", &head), ("end.json", &tail(7))];
    assert!(matches!(refused(&miscounted).await, ImportError::Malformed { .. }));
    let later = self::head(2);
    assert!(matches!(refused(&[("gallery.json", &later)]).await, ImportError::TooNew { found: 2, .. }));
    assert!(matches!(refused(&[("readme.txt", b"hello")]).await, ImportError::NoExport));
    // a link in place of a file
    let mut link = tar::Builder::new(Vec::new());
    let mut header = tar::Header::new_ustar();
    header.set_entry_type(tar::EntryType::Symlink);
    header.set_size(0);
    link.append_link(&mut header, "gallery.json", "/etc/passwd").expect("written");
    let link = link.into_inner().expect("written");
    assert!(import(&target, link).await.is_err());
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_signature_of_another_version_is_made_anew_and_what_later_programs_add_is_passed_over() {
    let mesh = files::bumpy_sphere(0.3);
    let id = visage::domain::ModelId::new().to_string();
    let mut model = described(&id, "mesh.obj", &mesh);
    let signature = b"of a later operator";
    model["signature"] = json!({
        "version": 9999, "summary": {"version": 9999, "regions": 1, "triangles": 1},
        "file": {"name": "signature", "bytes": signature.len(), "blake3": blake3::hash(signature).to_hex().as_str()},
    });
    model["colour"] = json!("blue");
    let (model, head) = (model.to_string().into_bytes(), head(1));
    let tail = br#"{"models": 1, "standards": 0, "words": 12}"#;
    let [place, at, of_signature] = ["model.json", "mesh.obj", "signature"].map(|name| format!("models/{id}/{name}"));
    let entries: [(&str, &[u8]); 5] =
        [("gallery.json", &head), (&place, &model), (&at, &mesh), (&of_signature, signature), ("end.json", tail)];
    let target = folder();
    let done = import(target.path(), archive(&entries)).await.expect("read");
    assert_eq!(done, Imported { models: 1, to_be_described: 1, ..Imported::default() });
    let server = TestServer::start_on(target, |_| {}).await;
    let mut changes = server.handle.changes();
    while json_of(&server, &format!("/v1/models/{id}")).await["signature"]["version"] == 9999 {
        changes.changed().await.expect("the server lives");
    }
    let made = json_of(&server, &format!("/v1/models/{id}")).await;
    assert_eq!(made["signature"]["version"], visage::faces::Signature::VERSION);
    let alike = server.post("/v1/queries", &json!({"model_id": id})).await;
    expect_json(alike, StatusCode::OK).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
#[cfg(unix)]
async fn the_commands_write_a_file_that_is_private_and_read_it_from_a_stream() {
    use std::os::unix::fs::PermissionsExt;
    use std::process::{Command, Stdio};

    let (source, _) = filled().await;
    let place = folder();
    let (file, target) = (place.path().join("gallery.tar"), place.path().join("data"));
    let program = || Command::new(env!("CARGO_BIN_EXE_visage"));
    let mut export = program();
    export.arg("export").arg(&file).arg("--data").arg(source.path());
    let output = export.output().expect("it runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(std::fs::metadata(&file).expect("there").permissions().mode() & 0o777, 0o600);
    assert!(!export.output().expect("it runs").status.success(), "it writes over nothing");
    let mut import = program();
    import.args(["import", "-", "--data"]).arg(&target).stdin(Stdio::piped()).stdout(Stdio::piped());
    let mut child = import.spawn().expect("it runs");
    let mut stdin = child.stdin.take().expect("piped");
    stdin.write_all(&std::fs::read(&file).expect("there")).expect("sent");
    drop(stdin);
    let output = child.wait_with_output().expect("it ends");
    assert!(output.status.success());
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(said.contains("3 models and 1 standards are new, 0 were there already"), "{said}");
}
