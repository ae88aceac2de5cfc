//! A mixed load whose server is killed again and again: what was answered is there, once, and nothing else is.
#![cfg(unix)]

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::Command;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use crate::binary::{Process, client, coarse_scan, disturbed_poses};
use crate::common::{expect_json, files, text};
use crate::gallery::multiply;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use reqwest::multipart::{Form, Part};
use reqwest::{Client, RequestBuilder, Response, StatusCode};
use serde_json::{Value, json};

/// Clients that work at the same time.
const CLIENTS: usize = 4;
/// So many scan sets or models are kept before old ones are deleted.
const MANY: usize = 12;
/// Everything is compared after so many kills.
const COMPARED_EVERY: usize = 20;

/// A request that is repeated until it is answered.
#[derive(Debug, Clone)]
enum Order {
    ScanSet { number: u64 },
    Job { number: u64, set: String },
    Model { number: u64 },
    Surface { number: u64, model: String },
    DeleteModel(String),
    DeleteSet(String),
    Restore(String),
}

/// What the service has said is there.
#[derive(Debug, Default)]
struct Ledger {
    sets: BTreeSet<String>,
    /// Uploaded models.
    models: BTreeSet<String>,
    /// Jobs with their scan sets, or the models that they give a surface.
    jobs: BTreeMap<String, String>,
    /// Uploaded models in the recycle bin.
    binned: BTreeSet<String>,
    /// Things that a request under way may delete, or put back.
    leaving: BTreeSet<String>,
    /// Requests whose answers were lost.
    in_doubt: Vec<Order>,
    answers: BTreeMap<String, usize>,
}

impl Ledger {
    /// `is_repeated`: an earlier try may have done it, though its answer was lost.
    fn note(&mut self, order: &Order, is_repeated: bool, status: StatusCode, body: &Value) {
        let id = || body["id"].as_str().unwrap_or_else(|| panic!("{order:?}: {body}")).to_owned();
        let name = match order {
            Order::ScanSet { .. } => "scan sets",
            Order::Job { .. } => "jobs",
            Order::Model { .. } => "models",
            Order::Surface { .. } => "surface jobs",
            Order::DeleteModel(_) => "deleted models",
            Order::DeleteSet(_) => "deleted scan sets",
            Order::Restore(_) => "models put back",
        };
        *self.answers.entry(name.to_owned()).or_default() += usize::from(status.is_success());
        match (order, status.as_u16()) {
            (Order::ScanSet { .. }, 201) => {
                self.sets.insert(id());
            }
            (Order::Model { .. }, 201) => {
                self.models.insert(id());
            }
            // its scan set may have been deleted before the answer came
            (Order::Job { set, .. }, 202) if self.sets.contains(set) => {
                self.jobs.insert(id(), set.clone());
            }
            (Order::Job { .. }, 202) => {}
            (Order::Job { set, .. }, 404) if !self.sets.contains(set) || self.leaving.contains(set) => {}
            (Order::Surface { model, .. }, 202) => {
                self.jobs.insert(id(), model.clone());
            }
            (Order::Surface { model, .. }, 404) if !self.models.contains(model) || self.leaving.contains(model) => {}
            // there are jobs enough
            (Order::Job { .. } | Order::Surface { .. }, 429) => {}
            (Order::DeleteModel(_) | Order::DeleteSet(_), 404) if !is_repeated => panic!("{order:?}: it is lost"),
            (Order::Restore(_), 404) if !is_repeated => panic!("{order:?}: it is lost"),
            (Order::DeleteModel(model), 204 | 404) => {
                self.models.remove(model);
                self.binned.insert(model.clone());
                self.leaving.remove(model);
            }
            (Order::Restore(model), 200 | 404) => {
                self.models.insert(model.clone());
                self.binned.remove(model);
                self.leaving.remove(model);
            }
            (Order::DeleteSet(set), 204 | 404) => {
                self.sets.remove(set);
                self.jobs.retain(|_, of| of != set);
                self.leaving.remove(set);
            }
            // a job uses it
            (Order::DeleteSet(set), 409) => {
                self.leaving.remove(set);
            }
            _ => panic!("{order:?} was answered with {status}: {body}"),
        }
    }
}

fn scans(number: u64) -> Form {
    let names: Vec<String> = (0..3).map(|index| format!("part{index}.ply")).collect();
    let form = names.iter().enumerate().fold(Form::new(), |form, (index, name)| {
        let scan = coarse_scan(index, 30 + number as usize % 7);
        form.part("scans", Part::bytes(scan).file_name(name.clone()))
    });
    form.part("poses", Part::text(disturbed_poses(&names)))
}

fn request(client: &Client, url: &str, order: &Order) -> RequestBuilder {
    match order {
        Order::ScanSet { number } => client
            .post(format!("{url}/v1/scan-sets"))
            .header("idempotency-key", format!("set{number}"))
            .multipart(scans(*number)),
        Order::Job { number, set } => {
            let body = json!({"scan_set_id": set, "options": {"signature": false}});
            client.post(format!("{url}/v1/jobs")).header("idempotency-key", format!("job{number}")).json(&body)
        }
        Order::Model { number } => {
            let ball = Part::bytes(files::bumpy_sphere(*number as f64 * 0.1)).file_name("ball.obj");
            let form = Form::new().part("model", ball).text("unit", "mm");
            client.post(format!("{url}/v1/models")).header("idempotency-key", format!("model{number}")).multipart(form)
        }
        Order::Surface { number, model } => {
            let body = json!({"kind": "surface", "model_id": model, "options": {"triangles": 400 + number % 7}});
            client.post(format!("{url}/v1/jobs")).header("idempotency-key", format!("surface{number}")).json(&body)
        }
        Order::DeleteModel(model) => client.delete(format!("{url}/v1/models/{model}")),
        Order::DeleteSet(set) => client.delete(format!("{url}/v1/scan-sets/{set}")),
        Order::Restore(model) => client.post(format!("{url}/v1/bin/{model}/restore")),
    }
}

/// The answer, or nothing if the server is gone.
async fn answered(sent: RequestBuilder) -> Option<(StatusCode, Value)> {
    let response: Response = sent.send().await.ok()?;
    let status = response.status();
    let body = response.text().await.ok()?;
    Some((status, serde_json::from_str(&body).unwrap_or(Value::Null)))
}

/// Work until the server is gone.
async fn work(client: Client, url: String, ledger: Arc<Mutex<Ledger>>, numbers: Arc<AtomicUsize>, seed: u64) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    loop {
        let number = numbers.fetch_add(1, Ordering::Relaxed) as u64;
        let order = next_order(&mut ledger.lock().expect("no panic"), &mut random, number);
        let Some(order) = order else {
            let asked = client.post(format!("{url}/v1/queries")).json(&json!({"standard": "face"}));
            match answered(asked).await {
                Some((status, body)) => assert!([200, 503].contains(&status.as_u16()), "{status}: {body}"),
                None => return,
            }
            continue;
        };
        let answer = answered(request(&client, &url, &order)).await;
        let mut ledger = ledger.lock().expect("no panic");
        match answer {
            Some((status, body)) => ledger.note(&order, false, status, &body),
            None => {
                ledger.in_doubt.push(order);
                return;
            }
        }
    }
}

/// What is asked for next; nothing is a query.
fn next_order(ledger: &mut Ledger, random: &mut ChaCha8Rng, number: u64) -> Option<Order> {
    let of = |all: &BTreeSet<String>, leaving: &BTreeSet<String>, at: usize| {
        all.iter().filter(|id| !leaving.contains(*id)).nth(at).cloned()
    };
    let order = match random.random_range(0..12) {
        0..=2 if ledger.sets.len() < MANY => Some(Order::ScanSet { number }),
        3..=5 => {
            let set = of(&ledger.sets, &ledger.leaving, random.random_range(0..MANY));
            set.map(|set| Order::Job { number, set })
        }
        6..=7 if ledger.models.len() < MANY => Some(Order::Model { number }),
        6..=7 => of(&ledger.models, &ledger.leaving, 0).map(Order::DeleteModel),
        0..=2 => of(&ledger.sets, &ledger.leaving, 0).map(Order::DeleteSet),
        8..=9 => {
            let model = of(&ledger.models, &ledger.leaving, random.random_range(0..MANY));
            model.map(|model| Order::Surface { number, model })
        }
        10 if ledger.models.len() < MANY => {
            of(&ledger.binned, &ledger.leaving, random.random_range(0..MANY)).map(Order::Restore)
        }
        _ => None,
    };
    if let Some(Order::DeleteModel(id) | Order::DeleteSet(id) | Order::Restore(id)) = &order {
        ledger.leaving.insert(id.clone());
    }
    order
}

async fn all(process: &Process, what: &str) -> Vec<Value> {
    let (mut items, mut cursor) = (Vec::new(), String::new());
    loop {
        let page = process.get(&format!("/v1/{what}?limit=100{cursor}")).await;
        items.extend(page["items"].as_array().expect("items").iter().cloned());
        match page["next_cursor"].as_str() {
            Some(next) => cursor = format!("&cursor={next}"),
            None => return items,
        }
    }
}

fn ids(items: &[Value]) -> BTreeSet<String> {
    let ids: BTreeSet<String> = items.iter().map(|item| item["id"].as_str().expect("an id").to_owned()).collect();
    assert_eq!(ids.len(), items.len(), "an id is listed twice");
    ids
}

/// Holds what is there against what was answered.
async fn compare(process: &Process, ledger: &Mutex<Ledger>) {
    let (sets, jobs, mut models) =
        (all(process, "scan-sets").await, all(process, "jobs").await, all(process, "models").await);
    models.retain(|model| model["name"] != "copy");
    let wanted = {
        let ledger = ledger.lock().expect("no panic");
        let jobs = ledger.jobs.keys().cloned().collect::<BTreeSet<_>>();
        (ledger.sets.clone(), jobs, ledger.models.clone(), ledger.binned.clone())
    };
    let binned: BTreeSet<String> = ids(&all(process, "bin").await);
    assert!(wanted.3.is_subset(&binned), "models in the recycle bin");
    assert_eq!(ids(&sets), wanted.0, "scan sets");
    assert_eq!(ids(&jobs), wanted.1, "jobs");
    let (made, uploaded): (Vec<Value>, Vec<Value>) = models.into_iter().partition(|model| model["job_id"].is_string());
    assert_eq!(ids(&uploaded), wanted.2, "models");
    // one model a job that has succeeded; jobs go on meanwhile
    let of_jobs: Vec<&str> = made.iter().map(|model| model["job_id"].as_str().expect("an id")).collect();
    assert_eq!(of_jobs.iter().collect::<BTreeSet<_>>().len(), of_jobs.len(), "a job made two models");
    for job in jobs {
        match job["status"].as_str() {
            Some("succeeded") => assert!(of_jobs.contains(&job["id"].as_str().expect("an id")), "{job} has no model"),
            Some("failed") if job["kind"] == "surface" && job["error"]["code"] == "model_gone" => {}
            Some("failed") => assert_eq!(job["error"]["code"], "attempts_exhausted", "{job}"),
            _ => {}
        }
    }
}

/// Repeats the requests whose answers were lost.
async fn settle(process: &Process, client: &Client, ledger: &Mutex<Ledger>) {
    let in_doubt = std::mem::take(&mut ledger.lock().expect("no panic").in_doubt);
    for order in in_doubt {
        let (status, body) = answered(request(client, &process.url, &order)).await.expect("nobody kills it now");
        ledger.lock().expect("no panic").note(&order, true, status, &body);
    }
}

fn doctor(folder: &Path) {
    let output = Command::new(env!("CARGO_BIN_EXE_visage")).args(["doctor", "--data"]).arg(folder).output();
    let output = output.expect("it runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stdout));
    println!("{}", String::from_utf8_lossy(&output.stdout).trim());
}

/// Starts the server; answers with how long it took until it could be asked, and until it had its gallery, too.
async fn started(folder: &Path) -> (Process, Duration, Duration) {
    let begin = Instant::now();
    let process = Process::start_with(folder, &["--bin-days", "1"], std::process::Stdio::null());
    let listens = begin.elapsed();
    let client = client();
    // each look takes as long as an answer
    while client.get(format!("{}/readyz", process.url)).send().await.expect("an answer").status() != StatusCode::OK {}
    (process, listens, begin.elapsed())
}

fn count(variable: &str, otherwise: usize) -> usize {
    std::env::var(variable).map_or(otherwise, |text| text.parse().expect("a number"))
}

/// Kills a server on this folder so many times, each time at a random moment of a mixed load.
async fn kill(folder: &Path, kills: usize) {
    let (ledger, numbers) = (Arc::new(Mutex::new(Ledger::default())), Arc::new(AtomicUsize::new(0)));
    let (client, mut random) = (client(), ChaCha8Rng::seed_from_u64(19));
    let (mut starts, mut ready) = (Vec::new(), Vec::new());
    for kill in 0..kills {
        let (process, listens, is_ready) = started(folder).await;
        starts.push(listens);
        ready.push(is_ready);
        settle(&process, &client, &ledger).await;
        if kill % COMPARED_EVERY == 0 {
            compare(&process, &ledger).await;
        }
        let clients: Vec<_> = (0..CLIENTS)
            .map(|index| {
                let seed = (kill * CLIENTS + index) as u64;
                tokio::spawn(work(client.clone(), process.url.clone(), ledger.clone(), numbers.clone(), seed))
            })
            .collect();
        tokio::time::sleep(Duration::from_millis(random.random_range(20..1500))).await;
        process.signal("-KILL");
        for client in clients {
            client.await.expect("every answer is as it should be");
        }
    }
    let (process, ..) = started(folder).await;
    settle(&process, &client, &ledger).await;
    let is_open = |job: &&Value| ["queued", "running"].contains(&job["status"].as_str().unwrap_or(""));
    while let Some(id) = all(&process, "jobs").await.iter().find(is_open).map(|job| text(job, "/id")) {
        // answered when the job ends
        let end = client.get(format!("{}/v1/jobs/{id}?wait=20", process.url)).send().await;
        expect_json(end.expect("an answer"), StatusCode::OK).await;
    }
    compare(&process, &ledger).await;
    process.signal("-TERM");
    drop(process);
    doctor(folder);
    starts.sort();
    ready.sort();
    let answers = &ledger.lock().expect("no panic").answers;
    println!(
        "{kills} kills; answered {answers:?}; listening after {:?} (median), {:?} (longest), ready after {:?}, {:?}",
        starts[kills / 2],
        starts[kills - 1],
        ready[kills / 2],
        ready[kills - 1]
    );
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
#[ignore = "takes minutes: VISAGE_KILLS says how often it is killed (300 if not given)"]
async fn killed_in_a_mixed_load_it_loses_and_doubles_nothing() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    kill(folder.path(), count("VISAGE_KILLS", 300)).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
#[ignore = "takes minutes: VISAGE_LARGE_KILLS says how often it is killed (20 if not given), VISAGE_LARGE_MODELS with how many models (20000)"]
async fn killed_beside_a_large_gallery_it_loses_and_doubles_nothing() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (process, ..) = started(folder.path()).await;
    let (status, first) =
        answered(request(&client(), &process.url, &Order::Model { number: 0 })).await.expect("an answer");
    assert_eq!(status, StatusCode::CREATED, "{first}");
    process.signal("-TERM");
    drop(process);
    multiply(folder.path(), count("VISAGE_LARGE_MODELS", 20_000) as i64).await;
    let first = first["id"].as_str().expect("an id").to_owned();
    copy_files(folder.path(), &first);
    // the index is made of the signatures once; the first one is not in the ledger
    let (process, _, is_ready) = started(folder.path()).await;
    assert_eq!(process.get("/v1/info").await["load"]["searchable_models"], count("VISAGE_LARGE_MODELS", 20_000) + 1);
    answered(client().delete(format!("{}/v1/models/{first}?permanently=true", process.url))).await.expect("an answer");
    println!("ready for the first time after {is_ready:?}");
    drop(process);
    kill(folder.path(), count("VISAGE_LARGE_KILLS", 20)).await;
}

/// Each copy gets a folder, as a model of which nothing but the signature is kept.
fn copy_files(folder: &Path, first: &str) {
    for number in 1..=count("VISAGE_LARGE_MODELS", 20_000) {
        let copy = folder.join("models").join(format!("00000000-0000-7000-8000-{number:012x}"));
        std::fs::create_dir(copy).expect("made");
    }
    assert!(folder.join("models").join(first).is_dir());
}
