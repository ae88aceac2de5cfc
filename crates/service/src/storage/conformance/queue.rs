//! Jobs as the workers see them: leases, ends, and processes that come and go.

use std::collections::BTreeMap;
use std::time::Duration;

use super::{DatabasePlace, claimant, new_job, scan_set, worker};
use crate::storage::{Database, DatabaseError};
use visage_domain::{CancelAnswer, Claimant, Finish, JobClaim, JobId, JobStatus, NewModel, Room, SeatId};

const LEASE: Duration = Duration::from_secs(30);
const EXPIRED: Duration = Duration::ZERO;
const NONE: BTreeMap<String, f64> = BTreeMap::new();

async fn queued(db: &dyn Database) -> JobId {
    let job = new_job(scan_set(db, &["a.ply", "b.ply"]).await);
    db.create_job(&job, None, 10, None).await.expect("queued");
    job.id
}

async fn claim(db: &dyn Database, worker: &str, lease: Duration) -> Option<JobClaim> {
    db.claim_job(&Claimant { lease, ..claimant(worker) }).await.expect("claimed")
}

/// The first worker of a process that is alone in it, as it looks for a job.
fn claimant_of(db: &dyn Database, number: usize, lease: Duration) -> Claimant {
    let worker = db.owner().worker(number);
    Claimant { worker, living: vec![worker], lease, ..claimant("any") }
}

/// A job whose lease is about to end.
async fn taken_over(db: &dyn Database, worker: &str) -> JobClaim {
    until_over(EXPIRED).await;
    claim(db, worker, LEASE).await.expect("taken over")
}

/// Leases are kept in milliseconds: one that ends now is over when the next one has begun.
async fn until_over(lease: Duration) {
    tokio::time::sleep(lease + Duration::from_millis(2)).await;
}

pub async fn jobs_are_claimed_once_and_in_order(place: &impl DatabasePlace) {
    let db = place.open(SeatId::new()).await;
    let db = db.as_ref();
    let (first, second) = (queued(db).await, queued(db).await);
    let a = claim(db, "a", LEASE).await.expect("one waits");
    let b = claim(db, "b", LEASE).await.expect("one waits");
    assert_eq!((a.job.id, b.job.id), (first, second));
    assert_eq!(a.job.attempts, 1);
    assert!(claim(db, "c", LEASE).await.is_none());
}

pub async fn a_worker_that_lost_its_lease_writes_nothing(place: &impl DatabasePlace) {
    let db = place.open(SeatId::new()).await;
    let db = db.as_ref();
    let id = queued(db).await;
    let lost = claim(db, "slow", EXPIRED).await.expect("one waits");
    let taken = taken_over(db, "quick").await;
    assert_eq!(taken.job.attempts, 2);
    assert_eq!(db.heartbeat(&lost, LEASE, None, 0.5, &NONE).await.expect("asked"), None);
    assert!(db.finish_job(&lost, &Finish::Canceled).await.expect("asked").is_none());
    assert!(!db.give_back_job(&lost).await.expect("asked"));
    assert_eq!(db.heartbeat(&taken, LEASE, Some("loading"), 0.5, &NONE).await.expect("asked"), Some(false));
    let job = db.job(id).await.expect("there");
    assert_eq!((job.status, job.stage.as_deref(), job.progress), (JobStatus::Running, Some("loading"), 0.5));
}

pub async fn giving_back_costs_no_attempt(place: &impl DatabasePlace) {
    let db = place.open(SeatId::new()).await;
    let db = db.as_ref();
    let id = queued(db).await;
    for _ in 0..5 {
        let taken = claim(db, "w", LEASE).await.expect("waits");
        assert!(db.give_back_job(&taken).await.expect("given back"));
    }
    let job = db.job(id).await.expect("there");
    assert_eq!((job.status, job.attempts), (JobStatus::Queued, 0));
}

pub async fn a_job_that_takes_the_server_down_thrice_is_failed(place: &impl DatabasePlace) {
    let db = place.open(SeatId::new()).await;
    let db = db.as_ref();
    let id = queued(db).await;
    for _ in 0..3 {
        claim(db, "w", LEASE).await.expect("waits");
        assert_eq!(db.reclaim_jobs(3).await.expect("reclaimed"), 1);
    }
    assert!(claim(db, "w", LEASE).await.is_none());
    let job = db.job(id).await.expect("there");
    assert_eq!(job.status, JobStatus::Failed);
    assert_eq!(job.error.expect("a reason").code, "attempts_exhausted");
}

pub async fn a_stop_that_was_asked_for_beats_success(place: &impl DatabasePlace) {
    let db = place.open(SeatId::new()).await;
    let db = db.as_ref();
    let id = queued(db).await;
    let taken = claim(db, "w", LEASE).await.expect("waits");
    assert_eq!(db.cancel_job(id).await.expect("asked"), CancelAnswer::Asked);
    assert_eq!(db.heartbeat(&taken, LEASE, None, 0.1, &NONE).await.expect("asked"), Some(true));
    let model = NewModel::example(Some((id, taken.job.scan_set_id.expect("a registration"))));
    let succeeded = Finish::Succeeded(Some(Box::new(model)));
    assert!(db.finish_job(&taken, &succeeded).await.expect("asked").is_none());
    assert!(db.finish_job(&taken, &Finish::Canceled).await.expect("asked").is_some());
    assert_eq!(db.job(id).await.expect("there").status, JobStatus::Canceled);
}

pub async fn a_canceled_job_of_a_dead_server_is_not_run_again(place: &impl DatabasePlace) {
    let db = place.open(SeatId::new()).await;
    let db = db.as_ref();
    let id = queued(db).await;
    claim(db, "w", LEASE).await.expect("waits");
    db.cancel_job(id).await.expect("asked");
    db.reclaim_jobs(3).await.expect("reclaimed");
    assert_eq!(db.job(id).await.expect("there").status, JobStatus::Canceled);
}

pub async fn success_stores_the_model_with_the_job(place: &impl DatabasePlace) {
    let db = place.open(SeatId::new()).await;
    let db = db.as_ref();
    let id = queued(db).await;
    let taken = claim(db, "w", LEASE).await.expect("waits");
    let model = NewModel::example(Some((id, taken.job.scan_set_id.expect("a registration"))));
    let succeeded = Finish::Succeeded(Some(Box::new(model.clone())));
    assert!(db.finish_job(&taken, &succeeded).await.expect("stored").is_some());
    let job = db.job(id).await.expect("there");
    assert_eq!((job.status, job.progress, job.model_id), (JobStatus::Succeeded, 1.0, Some(model.id)));
    assert_eq!(db.delete_job(id).await.expect("deleted").models, [model.id]);
    assert!(matches!(db.model(model.id).await, Err(DatabaseError::NotFound { kind: "model", .. })));
}

pub async fn a_pause_longer_than_the_lease_costs_no_attempt(place: &impl DatabasePlace) {
    let db = place.open(SeatId::new()).await;
    let db = db.as_ref();
    let id = queued(db).await;
    let paused = claim(db, "a", EXPIRED).await.expect("one waits");
    until_over(EXPIRED).await;
    let both = vec![worker("a"), worker("b")];
    let other = Claimant { living: both, max_attempts: 1, ..claimant("b") };
    assert!(db.claim_job(&other).await.expect("asked").is_none(), "its worker lives");
    let job = db.job(id).await.expect("there");
    assert_eq!((job.status, job.attempts), (JobStatus::Running, 1));
    assert_eq!(db.heartbeat(&paused, LEASE, None, 0.5, &NONE).await.expect("asked"), Some(false));
    assert!(db.finish_job(&paused, &Finish::Canceled).await.expect("asked").is_some());
}

/// Two processes and many workers at once.
pub async fn every_job_has_one_worker(place: &impl DatabasePlace) {
    let processes = [place.open(SeatId::new()).await, place.open(SeatId::new()).await];
    let mut jobs = Vec::new();
    for _ in 0..4 {
        jobs.push(queued(processes[0].as_ref()).await);
    }
    let claims = (0..8).map(|number| {
        let db = processes[number % 2].clone();
        tokio::spawn(async move { db.claim_job(&claimant_of(db.as_ref(), number, LEASE)).await.expect("asked") })
    });
    let mut claimed = Vec::new();
    for claim in claims.collect::<Vec<_>>() {
        claimed.extend(claim.await.expect("no panic").map(|claim| claim.job.id));
    }
    claimed.sort();
    assert_eq!(claimed, jobs);
}

pub async fn a_process_leaves_what_another_one_runs_until_the_lease_is_over(place: &impl DatabasePlace) {
    let [a, b] = [place.open(SeatId::new()).await, place.open(SeatId::new()).await];
    let id = queued(a.as_ref()).await;
    let running = a.claim_job(&claimant_of(a.as_ref(), 0, LEASE)).await.expect("asked").expect("one waits");
    let of_b = claimant_of(b.as_ref(), 0, LEASE);
    assert_eq!(b.reclaim_jobs(3).await.expect("a start"), 0);
    assert!(b.claim_job(&of_b).await.expect("asked").is_none());
    assert_eq!(a.heartbeat(&running, LEASE, None, 0.5, &NONE).await.expect("asked"), Some(false));

    assert_eq!(a.heartbeat(&running, EXPIRED, None, 0.5, &NONE).await.expect("asked"), Some(false));
    until_over(EXPIRED).await;
    assert_eq!(b.reclaim_jobs(3).await.expect("a start"), 1);
    assert_eq!(b.job(id).await.expect("there").status, JobStatus::Queued);
    let taken = b.claim_job(&of_b).await.expect("asked").expect("it waits again");
    assert_eq!((taken.job.id, taken.job.attempts), (id, 2));
    assert_eq!(a.heartbeat(&running, LEASE, None, 0.9, &NONE).await.expect("asked"), None);
    assert!(a.finish_job(&running, &Finish::Succeeded(None)).await.expect("asked").is_none());
    assert_eq!(a.reclaim_jobs(3).await.expect("a start"), 0);
}

pub async fn a_process_takes_back_at_once_what_was_run_from_its_seat(place: &impl DatabasePlace) {
    let seat = SeatId::new();
    let [gone, other] = [place.open(seat).await, place.open(SeatId::new()).await];
    let (first, second) = (queued(gone.as_ref()).await, queued(gone.as_ref()).await);
    gone.claim_job(&claimant_of(gone.as_ref(), 0, LEASE)).await.expect("asked").expect("one waits");
    let running = other.claim_job(&claimant_of(other.as_ref(), 0, LEASE)).await.expect("asked").expect("one waits");
    assert_eq!(running.job.id, second);

    let next = place.open(seat).await;
    assert_eq!(next.reclaim_jobs(3).await.expect("a start"), 1);
    assert_eq!(next.job(first).await.expect("there").status, JobStatus::Queued);
    assert_eq!(other.heartbeat(&running, LEASE, None, 0.5, &NONE).await.expect("asked"), Some(false));
    next.claim_job(&claimant_of(next.as_ref(), 0, LEASE)).await.expect("asked").expect("it waits again");
    assert_eq!(next.reclaim_jobs(3).await.expect("asked"), 0, "what a process runs itself is not left");
}

pub async fn a_job_waits_until_there_is_room_for_it_and_is_not_overtaken(place: &impl DatabasePlace) {
    let db = place.open(SeatId::new()).await;
    let db = db.as_ref();
    let large = queued(db).await;
    let small_set = scan_set(db, &["a.ply"]).await;
    let small = new_job(small_set);
    db.create_job(&small, None, 10, None).await.expect("queued");
    let claim = async |free_points: u64, all_points: u64| {
        let claimant = Claimant { room: Some(Room { free_points, all_points }), ..claimant("w") };
        db.claim_job(&claimant).await.expect("asked").map(|claim| claim.job.id)
    };
    assert_eq!(claim(19, 20).await, None, "20 points are needed");
    assert_eq!(claim(20, 20).await, Some(large));
    assert_eq!(claim(0, 5).await, Some(small.id), "it can never fit: it is to be refused");
    db.demand_evaluation(&|_| None).await.expect("queued");
    assert!(claim(0, 20).await.is_some(), "an evaluation has no scans");
}
