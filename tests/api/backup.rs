//! A data folder is copied while its server works, and put back.

use std::path::Path;
use std::time::Duration;

use reqwest::StatusCode;
use serde_json::json;
use visage::storage::checkup;
use visage::storage::data_folder::DataFolder;
use visage::storage::data_folder::backup::{self, BackupError};

use crate::common::{TestServer, expect_json, scan_form, text};

/// The only file below a folder whose path has this in it.
fn file_with(folder: &Path, part: &str) -> std::path::PathBuf {
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.to_string_lossy().contains(part) {
                return path;
            }
        }
    }
    panic!("no {part}");
}

fn damage(file: &Path) {
    let mut content = std::fs::read(file).expect("there");
    content[0] ^= 1;
    std::fs::write(file, content).expect("changed");
}

pub async fn is_sound(folder: &Path) -> bool {
    let data = DataFolder::open(folder, Duration::ZERO).await.expect("a data folder");
    let findings = checkup::examine(&data.storage).await.expect("read");
    data.storage.database.close().await;
    assert!(findings.is_sound(), "{findings:?}");
    true
}

#[tokio::test]
async fn a_backup_of_a_running_server_is_put_back_whole() {
    let server = TestServer::start().await;
    let (model, _) = server.model().await;
    let place = tempfile::tempdir().expect("a temporary folder");
    let (copy, restored) = (place.path().join("backup"), tempfile::tempdir().expect("a temporary folder"));
    let report = backup::back_up(server.folder.path(), &copy, false).await.expect("copied");
    assert!(report.is_whole() && report.new > 3 && report.known == 0, "{report:?}");
    let poses = server.get(&format!("/v1/models/{model}/poses.json")).await.bytes().await.expect("a body");
    // it goes on beside, and what comes later is not in the backup
    let later = server.scan_set(2).await;
    let put_back = backup::restore(&copy, restored.path()).await.expect("put back");
    assert!(put_back.is_whole() && put_back.new == report.new, "{put_back:?}");
    assert!(is_sound(restored.path()).await && is_sound(&copy).await);
    let again = TestServer::start_on(restored, |_| {}).await;
    let served = again.get(&format!("/v1/models/{model}/poses.json")).await.bytes().await.expect("a body");
    assert_eq!(served, poses);
    assert_eq!(again.get(&format!("/v1/scan-sets/{later}")).await.status(), 404);
    assert_eq!(server.get(&format!("/v1/scan-sets/{later}")).await.status(), 200);
}

#[tokio::test]
async fn a_later_backup_copies_what_is_new_and_forgets_what_was_deleted() {
    let server = TestServer::start().await;
    let (first, kept) = (server.scan_set(2).await, server.scan_set(3).await);
    let copy = tempfile::tempdir().expect("a temporary folder");
    let back_up = async |reread| backup::back_up(server.folder.path(), copy.path(), reread).await.expect("copied");
    assert_eq!(back_up(false).await.new, 5);
    let nothing = back_up(false).await;
    assert_eq!((nothing.new, nothing.known, nothing.removed), (0, 5, 0));
    assert_eq!(server.delete(&format!("/v1/scan-sets/{first}")).await, StatusCode::NO_CONTENT);
    server.scan_set(1).await;
    let next = back_up(false).await;
    assert_eq!((next.new, next.known, next.removed), (1, 3, 2));
    let gone = copy.path().join("scan-sets").join(&first);
    assert!(
        !gone.exists() || std::fs::read_dir(gone).expect("a folder").next().is_none(),
        "faces are gone from backups too"
    );
    // a backup that has rotted is found and mended when it is asked for
    damage(&file_with(copy.path(), &kept));
    assert_eq!(back_up(false).await.new, 0);
    assert_eq!(back_up(true).await.new, 1);
    assert!(is_sound(copy.path()).await);
}

#[tokio::test]
async fn what_is_damaged_or_missing_is_named_and_all_else_is_copied() {
    let server = TestServer::start().await;
    let (bad, good) = (server.scan_set(1).await, server.scan_set(2).await);
    let copy = tempfile::tempdir().expect("a temporary folder");
    damage(&file_with(server.folder.path(), &bad));
    let report = backup::back_up(server.folder.path(), copy.path(), false).await.expect("copied");
    assert_eq!((report.new, report.damaged.len()), (2, 1));
    assert!(report.damaged[0].contains(&bad) && !report.is_whole(), "{report:?}");
    std::fs::remove_file(file_with(server.folder.path(), &good)).expect("removed");
    let restored = tempfile::tempdir().expect("a temporary folder");
    let put_back = backup::restore(copy.path(), restored.path()).await.expect("put back");
    assert!(put_back.missing.len() == 1 && put_back.missing[0].contains(&bad), "{put_back:?}");
    let next = tempfile::tempdir().expect("a temporary folder");
    let report = backup::back_up(server.folder.path(), next.path(), false).await.expect("copied");
    assert!(report.missing.len() == 1 && report.missing[0].contains(&good), "{report:?}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 4)]
async fn a_backup_amid_changes_is_of_one_moment() {
    let server = std::sync::Arc::new(TestServer::start().await);
    for _ in 0..5 {
        server.scan_set(2).await;
    }
    let stop = std::sync::Arc::new(std::sync::atomic::AtomicBool::new(false));
    let changing = tokio::spawn({
        let (server, stop) = (server.clone(), stop.clone());
        async move {
            let mut changes = 0;
            while !stop.load(std::sync::atomic::Ordering::Relaxed) {
                let set = server.post_form("/v1/scan-sets/upload", scan_form(2)).await;
                let set = text(&expect_json(set, StatusCode::CREATED).await, "/id");
                server.delete(&format!("/v1/scan-sets/{set}")).await;
                changes += 1;
            }
            changes
        }
    });
    for _ in 0..5 {
        let copy = tempfile::tempdir().expect("a temporary folder");
        let report = backup::back_up(server.folder.path(), copy.path(), false).await.expect("copied");
        assert!(report.is_whole(), "{report:?}");
        assert!(is_sound(copy.path()).await);
    }
    stop.store(true, std::sync::atomic::Ordering::Relaxed);
    assert!(changing.await.expect("no panic") > 0);
}

#[tokio::test]
async fn nothing_is_written_over_by_a_backup_or_by_putting_it_back() {
    let [one, two] = [TestServer::start().await, TestServer::start().await];
    let (data, other) = (one.folder.path(), two.folder.path());
    let place = tempfile::tempdir().expect("a temporary folder");
    let copy = place.path().join("copy");
    for within in [data.to_owned(), data.join("backup")] {
        assert!(matches!(backup::back_up(data, &within, false).await, Err(BackupError::Within(_))));
    }
    assert!(backup::back_up(data, other, false).await.is_err(), "a server uses it");
    backup::back_up(data, &copy, false).await.expect("copied");
    assert!(matches!(backup::back_up(other, &copy, false).await, Err(BackupError::OtherFolder { .. })));
    std::fs::write(place.path().join("notes.txt"), "precious").expect("written");
    assert!(backup::back_up(data, place.path(), false).await.is_err(), "it is somebody else's");
    assert!(matches!(backup::restore(&copy, other).await, Err(BackupError::NotEmpty(_))));
    let foreign = tempfile::tempdir().expect("a temporary folder");
    std::fs::write(foreign.path().join("notes.txt"), "precious").expect("written");
    assert!(backup::back_up(data, foreign.path(), false).await.is_err());
    assert_eq!(std::fs::read_dir(foreign.path()).expect("a folder").count(), 1);
    let nothing = tempfile::tempdir().expect("a temporary folder");
    assert!(matches!(backup::restore(foreign.path(), nothing.path()).await, Err(BackupError::NoDatabase(_))));
}

#[tokio::test]
async fn keys_come_along_and_sessions_do_not() {
    let server = TestServer::start().await;
    let key = server.post("/v1/keys", &json!({"name": "admin", "scope": "admin"})).await;
    let key = text(&expect_json(key, StatusCode::CREATED).await, "/token");
    let session = server.client.post(server.url("/v1/session")).bearer_auth(&key).send().await.expect("an answer");
    let cookie = session.headers()["set-cookie"].to_str().expect("text").split(';').next().expect("a pair").to_owned();
    let place = tempfile::tempdir().expect("a temporary folder");
    let (copy, restored) = (place.path().join("backup"), tempfile::tempdir().expect("a temporary folder"));
    backup::back_up(server.folder.path(), &copy, false).await.expect("copied");
    backup::restore(&copy, restored.path()).await.expect("put back");
    let again = TestServer::start_on(restored, |_| {}).await;
    let get = |url: String| server.client.get(url);
    let url = again.url("/v1/models");
    assert_eq!(get(url.clone()).send().await.expect("an answer").status(), 401);
    assert_eq!(get(url.clone()).bearer_auth(&key).send().await.expect("an answer").status(), 200);
    assert_eq!(get(url).header("cookie", &cookie).send().await.expect("an answer").status(), 401);
    let still = get(server.url("/v1/models")).header("cookie", &cookie).send().await.expect("an answer");
    assert_eq!(still.status(), 200);
}
