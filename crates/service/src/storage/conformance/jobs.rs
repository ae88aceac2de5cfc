//! Jobs as the API sees them, and evaluations.

use std::collections::BTreeSet;

use super::{DatabasePlace, claimant, new_job, scan_set};
use crate::storage::{Database, DatabaseError};
use visage_domain::{
    Backlog, CancelAnswer, Finish, JobId, JobStatus, ModelId, NewModel, Outdated, Replay, ReplayKey, ScanSetId, SeatId,
    StoredSignature,
};
use visage_shape::faces::{Signature, SignatureSummary};

async fn queued(db: &dyn Database, set: ScanSetId) -> JobId {
    let job = new_job(set);
    db.create_job(&job, None, 10, None).await.expect("queued");
    job.id
}

fn replay_key(key: &str, hash: &str) -> ReplayKey {
    ReplayKey { route: "POST /v1/jobs", key: key.to_owned(), body_hash: hash.to_owned() }
}

pub async fn the_queue_has_an_end(place: &impl DatabasePlace) {
    let db = place.open(SeatId::new()).await;
    let db = db.as_ref();
    let set = scan_set(db, &["a.ply"]).await;
    queued(db, set).await;
    let job = new_job(set);
    let refused = db.create_job(&job, None, 1, None).await.expect_err("full");
    assert!(matches!(refused, DatabaseError::QueueFull { limit: 1 }));
    assert!(matches!(db.job(job.id).await, Err(DatabaseError::NotFound { kind: "job", .. })));
}

/// What is checked over several rows is so for all that come at the same moment, too.
pub async fn limits_hold_for_processes_that_ask_at_once(place: &impl DatabasePlace) {
    let processes = [place.open(SeatId::new()).await, place.open(SeatId::new()).await];
    let set = scan_set(processes[0].as_ref(), &["a.ply", "b.ply"]).await;
    let orders = (0..12).map(|number| {
        let db = processes[number % 2].clone();
        tokio::spawn(async move { db.create_job(&new_job(set), None, 3, None).await })
    });
    let mut accepted = 0;
    for order in orders.collect::<Vec<_>>() {
        match order.await.expect("no panic") {
            Ok(()) => accepted += 1,
            Err(DatabaseError::QueueFull { limit: 3 }) => {}
            Err(other) => panic!("{other}"),
        }
    }
    assert_eq!(accepted, 3);
    let demands = (0..12).map(|number| {
        let db = processes[number % 2].clone();
        tokio::spawn(async move { db.demand_evaluation(&|_| None).await.expect("one waits").id })
    });
    let mut waiting = BTreeSet::new();
    for demand in demands.collect::<Vec<_>>() {
        waiting.insert(demand.await.expect("no panic"));
    }
    assert_eq!(waiting.len(), 1);
}

pub async fn a_waiting_job_is_canceled_at_once_and_can_be_retried(place: &impl DatabasePlace) {
    let db = place.open(SeatId::new()).await;
    let db = db.as_ref();
    let set = scan_set(db, &["a.ply"]).await;
    let id = queued(db, set).await;
    assert_eq!(db.cancel_job(id).await.expect("canceled"), CancelAnswer::Canceled);
    assert_eq!(db.job(id).await.expect("there").status, JobStatus::Canceled);
    let twice = db.cancel_job(id).await.expect_err("ended");
    assert!(matches!(twice, DatabaseError::WrongStatus { status: JobStatus::Canceled, .. }));
    db.retry_job(id, 10).await.expect("queued again");
    let job = db.job(id).await.expect("there");
    assert_eq!((job.status, job.cancel_asked, job.finished_at), (JobStatus::Queued, false, None));
}

pub async fn a_scan_set_in_use_is_left_alone(place: &impl DatabasePlace) {
    let db = place.open(SeatId::new()).await;
    let db = db.as_ref();
    let set = scan_set(db, &["a.ply"]).await;
    let id = queued(db, set).await;
    assert!(matches!(db.delete_scan_set(set).await, Err(DatabaseError::InUse { kind: "scan set", .. })));
    assert!(matches!(db.delete_job(id).await, Err(DatabaseError::InUse { kind: "job", .. })));
    db.cancel_job(id).await.expect("canceled");
    drop(db.delete_scan_set(set).await.expect("free now"));
    assert!(matches!(db.job(id).await, Err(DatabaseError::NotFound { .. })));
}

pub async fn a_replay_is_kept_with_what_it_created(place: &impl DatabasePlace) {
    let db = place.open(SeatId::new()).await;
    let db = db.as_ref();
    let set = scan_set(db, &["a.ply"]).await;
    let job = new_job(set);
    let key = replay_key("k", "hash");
    let replay = Replay {
        key: key.clone(),
        status: 202,
        location: "/v1/jobs/x".to_owned(),
        body: "{}".to_owned(),
        resource_id: job.id.to_string(),
    };
    db.create_job(&job, None, 10, Some(&replay)).await.expect("queued");
    assert_eq!(db.replay(&key).await.expect("read"), Some(replay));
    let other = db.replay(&replay_key("k", "other")).await.expect_err("another body");
    assert!(matches!(other, DatabaseError::KeyReused { .. }));
    db.cancel_job(job.id).await.expect("canceled");
    drop(db.delete_job(job.id).await.expect("deleted"));
    assert_eq!(db.replay(&key).await.expect("read"), None);
}

pub async fn at_most_one_evaluation_waits_and_registrations_go_first(place: &impl DatabasePlace) {
    let db = place.open(SeatId::new()).await;
    let db = db.as_ref();
    assert_eq!(db.queue_evaluation().await.expect("asked"), None, "nothing is to be done");
    let demand = async || db.demand_evaluation(&|_| None).await.expect("queued").id;
    let waiting = demand().await;
    assert_eq!(demand().await, waiting);
    let set = scan_set(db, &["a.ply", "b.ply"]).await;
    let job = new_job(set);
    db.create_job(&job, None, 10, None).await.expect("queued");
    assert!(db.registration_waits().await.expect("asked"));
    let first = db.claim_job(&claimant("w")).await.expect("claimed").expect("one waits");
    assert_eq!(first.job.id, job.id);
    assert!(!db.registration_waits().await.expect("asked"));
    let second = db.claim_job(&claimant("w")).await.expect("claimed").expect("one waits");
    assert_eq!((second.job.id, second.job.scan_set_id), (waiting, None));
    assert!(demand().await != waiting, "the running one may have looked already");
    assert!(db.finish_job(&second, &Finish::Succeeded(None)).await.expect("ended").is_some());
}

pub async fn old_signatures_are_a_backlog_until_they_are_made_anew(place: &impl DatabasePlace) {
    let db = place.open(SeatId::new()).await;
    let db = db.as_ref();
    let summary = SignatureSummary { version: 1, regions: 2, triangles: 3, left_out: Default::default() };
    let old = StoredSignature { version: 1, summary: summary.clone(), content: vec![1] };
    let model = NewModel { signature: Some(old), ..NewModel::example(None) };
    drop(db.create_model(&model, None).await.expect("stored"));
    assert_eq!(db.backlog().await.expect("read").stale_signatures, 1);
    let outdated = Outdated { model_id: model.id, signature: true, standards: Vec::new() };
    assert_eq!(db.outdated(None, 10).await.expect("read"), [outdated]);
    assert!(db.outdated(Some(model.id), 10).await.expect("read").is_empty());
    let new = StoredSignature { version: Signature::VERSION, summary, content: vec![2] };
    assert!(db.renew_signature(model.id, &new).await.expect("renewed").is_some());
    assert_eq!(db.backlog().await.expect("read"), Backlog::default());
    assert!(db.renew_signature(ModelId::new(), &new).await.expect("asked").is_none(), "it is gone");
}
