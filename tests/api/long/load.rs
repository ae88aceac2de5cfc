//! Many clients beside a running registration: pollers, event streams, uploads, and connections that never say what they want.
//! It lasts for VISAGE_LOAD_JOBS registrations (3 if not given), and until all is uploaded.
#![cfg(unix)]

use std::net::SocketAddr;
use std::path::Path;
use std::process::Stdio;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use bytes::Bytes;
use reqwest::{Client, StatusCode};
use serde_json::{Value, json};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::sync::watch;

use crate::binary::{Process, coarse_scan, disturbed_poses};
use crate::common::{expect_json, text};
use reqwest::multipart::{Form, Part};

const POLLERS: usize = 500;
const STREAMS: usize = 200;
const UPLOADS: usize = 10;
const UPLOAD_BYTES: usize = 50_000_000;
const HALF_OPEN: usize = 2000;
/// Descriptors that stay: the connection that asks, and three more reading connections of the database, of a file and its log each.
const STAY: usize = 1 + 3 * 2;

/// A figure of `/proc/PID/status`, in bytes.
fn status_bytes(process: &Process, name: &str) -> u64 {
    let path = format!("/proc/{}/status", process.child.id());
    let status = std::fs::read_to_string(path).expect("it runs");
    let line = status.lines().find_map(|line| line.strip_prefix(name)).expect("a figure");
    line.trim_start_matches(':').trim().trim_end_matches(" kB").parse::<u64>().expect("a number") * 1024
}

/// From now on the peak counts anew.
fn forget_peak(process: &Process) {
    std::fs::write(format!("/proc/{}/clear_refs", process.child.id()), "5").expect("one's own child");
}

fn descriptors(process: &Process) -> usize {
    std::fs::read_dir(format!("/proc/{}/fd", process.child.id())).expect("it runs").count()
}

fn files_below(folder: &Path) -> usize {
    std::fs::read_dir(folder).map_or(0, Iterator::count)
}

/// Waits until it is so; each look takes as long as an answer of the server.
async fn until(process: &Process, mut is_so: impl FnMut() -> bool) {
    let client = Client::builder().no_proxy().build().expect("a client");
    while !is_so() {
        let answer = client.get(format!("{}/healthz", process.url)).send().await.expect("an answer");
        assert_eq!(answer.status(), StatusCode::OK);
    }
}

/// A scan of 50 MB: places and normals, 24 bytes a point.
fn large_scan() -> Bytes {
    let count = UPLOAD_BYTES / 24;
    let names: String = ["x", "y", "z", "nx", "ny", "nz"].map(|name| format!("property float {name}\n")).concat();
    let head = format!("ply\nformat binary_little_endian 1.0\nelement vertex {count}\n{names}end_header\n");
    let mut scan = head.into_bytes();
    for index in 0..count {
        let t = index as f32 * 1e-3;
        for value in [t.cos() * 50.0, t.sin() * 50.0, t * 1e-2, t.cos(), t.sin(), 0.0] {
            scan.extend_from_slice(&value.to_le_bytes());
        }
    }
    scan.into()
}

/// A set whose registration takes a while.
async fn set(process: &Process, client: &Client) -> String {
    let names: Vec<String> = (0..12).map(|index| format!("part{index}.ply")).collect();
    let form = names.iter().enumerate().fold(Form::new(), |form, (index, name)| {
        form.part("scans", Part::bytes(coarse_scan(index, 220)).file_name(name.clone()))
    });
    let form = form.part("poses", Part::text(disturbed_poses(&names)));
    let sent = client.post(format!("{}/v1/scan-sets/upload", process.url)).multipart(form).send().await;
    text(&expect_json(sent.expect("an answer"), StatusCode::CREATED).await, "/id")
}

async fn order(process: &Process, client: &Client, set: &str) -> String {
    let sent = client.post(format!("{}/v1/jobs", process.url)).json(&json!({"scan_set_id": set})).send().await;
    text(&expect_json(sent.expect("an answer"), StatusCode::ACCEPTED).await, "/id")
}

/// The job at its end.
async fn ended(client: &Client, url: &str, job: &str) -> Value {
    loop {
        let answer = client.get(format!("{url}/v1/jobs/{job}?wait=1")).send().await.expect("an answer");
        let view = expect_json(answer, StatusCode::OK).await;
        if !["queued", "running"].contains(&view["status"].as_str().unwrap_or("")) {
            return view;
        }
    }
}

/// What all clients share.
struct Crowd {
    client: Client,
    url: String,
    addr: SocketAddr,
    /// The job that runs.
    job: watch::Receiver<String>,
    stop: AtomicBool,
    opened: AtomicUsize,
    events: AtomicUsize,
}

impl Crowd {
    fn goes_on(&self) -> bool {
        !self.stop.load(Ordering::Relaxed)
    }

    /// Asks with `wait`; answers with the milliseconds beyond what it said that it would wait.
    async fn poll(self: Arc<Self>) -> Vec<f64> {
        let mut late = Vec::new();
        while self.goes_on() {
            let job = self.job.borrow().clone();
            let begin = Instant::now();
            let answer = self.client.get(format!("{}/v1/jobs/{job}?wait=1", self.url)).send().await.expect("an answer");
            let status = answer.status();
            let view: Value = answer.json().await.expect("JSON");
            let took = begin.elapsed().as_secs_f64() * 1000.0;
            assert_eq!(status, 200, "{view}");
            // an end comes when it comes
            if ["queued", "running"].contains(&view["status"].as_str().unwrap_or("")) {
                late.push((took - 1000.0).max(0.0));
            }
        }
        late
    }

    async fn listen(self: Arc<Self>) {
        use futures_util::StreamExt;
        while self.goes_on() {
            let job = self.job.borrow().clone();
            let answer = self.client.get(format!("{}/v1/jobs/{job}/events", self.url)).send().await.expect("an answer");
            assert_eq!(answer.status(), 200);
            let mut events = answer.bytes_stream();
            while let Some(chunk) = events.next().await {
                chunk.expect("an event");
                self.events.fetch_add(1, Ordering::Relaxed);
                if !self.goes_on() {
                    break;
                }
            }
        }
    }

    /// Opens a connection, never ends the head of its request, and does so again when it is closed.
    async fn say_nothing(self: Arc<Self>) {
        while self.goes_on() {
            let Ok(mut stream) = TcpStream::connect(self.addr).await else { continue };
            self.opened.fetch_add(1, Ordering::Relaxed);
            if stream.write_all(b"GET /v1/models HTTP/1.1\r\nHost: 127").await.is_err() {
                continue;
            }
            let mut chunk = [0; 512];
            while self.goes_on() {
                match tokio::time::timeout(Duration::from_millis(500), stream.read(&mut chunk)).await {
                    Ok(Ok(1..)) | Err(_) => {}
                    Ok(_) => break,
                }
            }
        }
    }

    async fn upload(self: Arc<Self>, index: usize, scan: Bytes) -> f64 {
        let made = self.client.post(format!("{}/v1/scan-sets", self.url)).json(&json!({"name": "large"})).send().await;
        let set = text(&expect_json(made.expect("an answer"), StatusCode::CREATED).await, "/id");
        let begin = Instant::now();
        let put = self.client.put(format!("{}/v1/scan-sets/{set}/scans/large{index}.ply", self.url)).body(scan);
        let stored = expect_json(put.send().await.expect("an answer"), StatusCode::CREATED).await;
        assert!(stored["points"].as_u64().is_some_and(|points| points > 2_000_000), "{stored}");
        let took = begin.elapsed().as_secs_f64();
        let gone = self.client.delete(format!("{}/v1/scan-sets/{set}", self.url)).send().await.expect("an answer");
        assert_eq!(gone.status(), 204);
        took
    }
}

fn quantile(sorted: &[f64], share: f64) -> f64 {
    sorted.get(((sorted.len() as f64 * share) as usize).min(sorted.len().saturating_sub(1))).copied().unwrap_or(0.0)
}

/// Milliseconds that polls took in the server beyond what they waited, from its log.
fn in_server(log: &Path) -> Vec<f64> {
    let log = std::fs::read_to_string(log).expect("a log");
    let mut late = Vec::new();
    for line in log.lines() {
        let Ok(line) = serde_json::from_str::<Value>(line) else { continue };
        let line = line.to_string();
        assert!(!line.contains("panic"), "{line}");
        let is_poll = line.contains("/v1/jobs/") && !line.contains("/events") && line.contains("\"GET\"");
        let Some((_, rest)) = line.split_once("\"ms\":").filter(|_| is_poll) else { continue };
        let digits: String = rest.chars().take_while(char::is_ascii_digit).collect();
        let ms: f64 = digits.parse().expect("a number");
        // those that ended with the job waited for less
        if ms >= 1000.0 {
            late.push(ms - 1000.0);
        }
    }
    late
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
#[ignore = "takes minutes and 6 000 descriptors: the load lasts for VISAGE_LOAD_JOBS registrations (3 if not given)"]
async fn many_clients_beside_a_registration_are_answered_and_leave_nothing() {
    let wanted: usize = std::env::var("VISAGE_LOAD_JOBS").map_or(3, |text| text.parse().expect("a number"));
    let folder = tempfile::tempdir().expect("a temporary folder");
    let log = folder.path().with_extension("log");
    let file = std::fs::File::create(&log).expect("a log");
    let arguments = ["--max-connections", "3000", "--threads", "1", "--log", "warn,visage=info"];
    let process = Process::start_with(folder.path(), &arguments, Stdio::from(file));
    // the server closes what has been idle for ten seconds: a request must not come just then
    let client = Client::builder().no_proxy().pool_idle_timeout(Duration::from_secs(5)).build().expect("a client");
    let set = set(&process, &client).await;
    // alone first
    let idle = status_bytes(&process, "VmRSS");
    forget_peak(&process);
    let begin = Instant::now();
    let alone = order(&process, &client, &set).await;
    let view = ended(&client, &process.url, &alone).await;
    assert_eq!(view["status"], "succeeded", "{view}");
    let (alone_seconds, alone_peak) = (begin.elapsed().as_secs_f64(), status_bytes(&process, "VmHWM"));
    let before = descriptors(&process);
    forget_peak(&process);

    let (announce, job) = watch::channel(order(&process, &client, &set).await);
    let crowd = Arc::new(Crowd {
        client: client.clone(),
        url: process.url.clone(),
        addr: process.url.strip_prefix("http://").and_then(|addr| addr.parse().ok()).expect("an address"),
        job,
        stop: AtomicBool::new(false),
        opened: AtomicUsize::new(0),
        events: AtomicUsize::new(0),
    });
    let pollers: Vec<_> = (0..POLLERS).map(|_| tokio::spawn(crowd.clone().poll())).collect();
    let streams: Vec<_> = (0..STREAMS).map(|_| tokio::spawn(crowd.clone().listen())).collect();
    let silent: Vec<_> = (0..HALF_OPEN).map(|_| tokio::spawn(crowd.clone().say_nothing())).collect();
    let scan = large_scan();
    let uploads: Vec<_> = (0..UPLOADS).map(|index| tokio::spawn(crowd.clone().upload(index, scan.clone()))).collect();
    // a registration runs all the time
    let (mut jobs, mut most_open) = (0, 0);
    while jobs < wanted || uploads.iter().any(|upload| !upload.is_finished()) {
        let running = crowd.job.borrow().clone();
        let look = client.get(format!("{}/v1/jobs/{running}?wait=1", process.url)).send().await.expect("an answer");
        let view = expect_json(look, StatusCode::OK).await;
        most_open = most_open.max(descriptors(&process));
        if view["status"] == "succeeded" {
            jobs += 1;
            announce.send_replace(order(&process, &client, &set).await);
        }
        assert!(["queued", "running", "succeeded"].contains(&view["status"].as_str().unwrap_or("")), "{view}");
    }
    crowd.stop.store(true, Ordering::Relaxed);
    let running = crowd.job.borrow().clone();
    let (mut late, mut longest) = (Vec::new(), 0.0_f64);
    for poller in pollers {
        late.extend(poller.await.expect("every answer is as it should be"));
    }
    for upload in uploads {
        longest = longest.max(upload.await.expect("every answer is as it should be"));
    }
    // a stream that is in the middle of a job ends with it
    assert_eq!(ended(&client, &process.url, &running).await["status"], "succeeded");
    for task in streams.into_iter().chain(silent) {
        task.await.expect("every answer is as it should be");
    }
    let peak = status_bytes(&process, "VmHWM");
    let (opened, events) = (crowd.opened.load(Ordering::Relaxed), crowd.events.load(Ordering::Relaxed));
    drop((crowd, client));
    until(&process, || descriptors(&process) <= before + STAY).await;
    until(&process, || files_below(&folder.path().join("staging")) == 0).await;
    let after = status_bytes(&process, "VmRSS");
    process.signal("-TERM");
    drop(process);
    late.sort_by(f64::total_cmp);
    let mut inside = in_server(&log);
    inside.sort_by(f64::total_cmp);
    std::fs::remove_file(&log).expect("removed");
    assert!(opened >= HALF_OPEN && events >= STREAMS && late.len() > POLLERS && !inside.is_empty());
    let mb = |bytes: u64| bytes / 1_000_000;
    println!("{jobs} registrations beside it; one alone took {alone_seconds:.1} s");
    for (place, late) in [("client", &late), ("server", &inside)] {
        let [p50, p99, most] = [0.5, 0.99, 1.0].map(|share| quantile(late, share));
        println!("{} polls, ms late at the {place}: {p50:.0} (median), {p99:.0} (p99), {most:.0} (most)", late.len());
    }
    println!("{opened} half-open connections, {events} events, uploads took up to {longest:.1} s");
    println!("{most_open} descriptors at most, {before} before");
    println!(
        "memory: {} MB idle, {} MB at most for a registration alone, {} MB with the load, {} MB afterwards",
        mb(idle),
        mb(alone_peak),
        mb(peak),
        mb(after)
    );
}
