//! A disk that is full for a moment, with the program itself.
#![cfg(target_os = "linux")]

use std::path::Path;
use std::process::Command;
use std::time::Duration;

use crate::binary::{Process, client, finished, start_job_of};
use crate::common::{expect_json, expect_problem, text};
use reqwest::StatusCode;
use serde_json::json;

/// A small disk of its own; gone with the test.
struct Disk(tempfile::TempDir);

impl Disk {
    fn mount(megabytes: u32) -> Disk {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let size = format!("size={megabytes}m");
        let mounted = Command::new("mount").args(["-t", "tmpfs", "-o", &size, "tmpfs"]).arg(folder.path()).status();
        assert!(mounted.expect("mount runs").success(), "mounting needs root");
        Disk(folder)
    }

    fn path(&self) -> &Path {
        self.0.path()
    }

    /// Leaves no space at all; the file that takes it is `ballast`.
    fn fill(&self) {
        let mut ballast = std::fs::File::create(self.path().join("ballast")).expect("created");
        let chunk = vec![0u8; 1 << 12];
        while std::io::Write::write_all(&mut ballast, &chunk).is_ok() {}
    }

    fn empty(&self) {
        std::fs::remove_file(self.path().join("ballast")).expect("there");
    }
}

impl Drop for Disk {
    fn drop(&mut self) {
        // the folder can't be removed while it is mounted
        let _ = Command::new("umount").arg("--lazy").arg(self.path()).status();
    }
}

async fn new_set(process: &Process) -> reqwest::Response {
    let url = format!("{}/v1/scan-sets", process.url);
    client().post(url).json(&json!({"name": "a"})).send().await.expect("an answer")
}

/// Stores what still fits into space that the database has already.
async fn until_refused(process: &Process) {
    for _ in 0..1000 {
        let answer = new_set(process).await;
        if answer.status() != StatusCode::CREATED {
            expect_problem(answer, 507, "storage_full").await;
            return;
        }
    }
    panic!("it is never full");
}

async fn delete(process: &Process, href: &str) -> StatusCode {
    client().delete(format!("{}{href}", process.url)).send().await.expect("an answer").status()
}

#[tokio::test]
#[ignore = "mounts a file system, which only root may"]
async fn a_full_disk_ends_nothing_but_what_takes_space() {
    let disk = Disk::mount(24);
    let process = Process::start(&disk.path().join("data"));
    let [first, second] = [
        expect_json(new_set(&process).await, StatusCode::CREATED).await,
        expect_json(new_set(&process).await, StatusCode::CREATED).await,
    ];
    let ready = || async { client().get(format!("{}/readyz", process.url)).send().await.expect("an answer") };
    for _ in 0..3 {
        disk.fill();
        for _ in 0..3 {
            until_refused(&process).await;
        }
        expect_problem(ready().await, 503, "not_ready").await;
        disk.empty();
        let set = expect_json(new_set(&process).await, StatusCode::CREATED).await;
        assert_eq!(ready().await.status(), StatusCode::OK);
        assert_eq!(delete(&process, &text(&set, "/links/self")).await, StatusCode::NO_CONTENT);
    }
    disk.fill();
    for set in [first, second] {
        let status = delete(&process, &text(&set, "/links/self")).await;
        assert_eq!(status, StatusCode::NO_CONTENT, "the reserve lets deletions through");
    }
    until_refused(&process).await;
    disk.empty();
    expect_json(new_set(&process).await, StatusCode::CREATED).await;
    drop(process);
}

#[tokio::test]
#[ignore = "mounts a file system, which only root may"]
async fn a_job_ends_on_a_full_disk() {
    let disk = Disk::mount(64);
    let process = Process::start(&disk.path().join("data"));
    let job = start_job_of(&process, 100).await;
    // as soon as its scans are there, there is no space for what it makes of them
    while process.get(&format!("/v1/jobs/{job}")).await["status"] == "queued" {
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
    disk.fill();
    let ended = finished(&process, &job).await;
    assert_eq!(
        (ended["status"].as_str(), &ended["error"]["code"]),
        (Some("failed"), &json!("storage_full")),
        "{ended}"
    );
    disk.empty();
    let retry = client().post(format!("{}/v1/jobs/{job}/retry", process.url)).send().await.expect("an answer");
    expect_json(retry, StatusCode::ACCEPTED).await;
    assert_eq!(finished(&process, &job).await["status"], "succeeded");
}
