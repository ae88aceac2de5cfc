//! Jobs as the workers see them: claim, heartbeat, finish, give back.
//!
//! A running job belongs to the worker named in its row until its lease runs out. Every write of a worker is
//! guarded by that name, so a worker whose job was taken over can neither finish it twice nor overwrite it.

use std::collections::BTreeMap;
use std::time::Duration;

use super::jobs::JobRow;
use super::{Store, Writing, damaged, models, outbox, skip_locked, to_i64, to_u64};
use crate::storage::database::JobQueue;
use crate::storage::{DatabaseError, Unseen};
use async_trait::async_trait;
use visage_domain::{Claimant, Event, Finish, JobClaim, JobError, JobStatus, Room, WorkerId};

#[async_trait]
impl JobQueue for Store {
    async fn claim_job(&self, claimant: &Claimant) -> Result<Option<JobClaim>, DatabaseError> {
        let Claimant { worker, living, lease, max_attempts, room } = claimant;
        let living: Vec<String> = living.iter().map(WorkerId::to_string).collect();
        let living = serde_json::to_string(&living).map_err(|error| damaged("names of workers", error))?;
        let unlimited = Room { free_points: u64::MAX, all_points: u64::MAX };
        let room = room.unwrap_or(unlimited);
        if !self.has_reserve().await {
            return Err(DatabaseError::Full);
        }
        let mut tx = self.begin_rows().await?;
        fail_exhausted(&mut tx, *max_attempts, &living).await?;
        let row: Option<JobRow> = sqlx::query_as(concat!(
            "UPDATE job SET status = 'running', worker = $1, leased_until = $2, attempts = attempts + 1,
                            started_at = $3, stage = NULL, progress = 0, stage_seconds = '{}', seat = $7
             WHERE id = (SELECT id FROM job
                         WHERE status = 'queued'
                            OR (status = 'running' AND leased_until < $3
                                AND worker NOT IN (SELECT value FROM json_each($4)))
                         ORDER BY kind = 'evaluate', id LIMIT 1",
            skip_locked!(),
            ")
               AND (SELECT coalesce(sum(points), 0) <= $5 OR sum(points) > $6
                    FROM (SELECT points FROM scan WHERE scan.scan_set_id = job.scan_set_id
                          UNION ALL SELECT points FROM model WHERE job.kind = 'surface' AND model.id = job.base_model_id)
                         AS its)
             RETURNING *, NULL AS model_id",
        ))
        .bind(worker.to_string())
        .bind(lease_end(tx.now_ms(), *lease))
        .bind(tx.now_ms())
        .bind(&living)
        .bind(to_i64(room.free_points))
        .bind(to_i64(room.all_points))
        .bind(self.owner.seat.to_string())
        .fetch_optional(&mut *tx)
        .await?;
        let Some(job) = row.map(JobRow::record).transpose()? else {
            tx.commit().await?;
            return Ok(None);
        };
        let points: i64 = sqlx::query_scalar(
            "SELECT CAST(coalesce(sum(points), 0) AS BIGINT)
             FROM (SELECT points FROM scan WHERE scan_set_id = $1 UNION ALL SELECT points FROM model WHERE id = $2) AS its",
        )
        .bind(job.scan_set_id.map(|id| id.to_string()))
        .bind(job.surfaced_model().map(|id| id.to_string()))
        .fetch_one(&mut *tx)
        .await?;
        tx.commit().await?;
        Ok(Some(JobClaim { job, worker: *worker, points: to_u64(points) }))
    }

    async fn heartbeat(
        &self,
        claim: &JobClaim,
        lease: Duration,
        stage: Option<&str>,
        progress: f64,
        stage_seconds: &BTreeMap<String, f64>,
    ) -> Result<Option<bool>, DatabaseError> {
        let seconds = serde_json::to_string(stage_seconds).map_err(|error| damaged("seconds", error))?;
        let cancel_asked = sqlx::query_scalar(
            "UPDATE job SET leased_until = $1, stage = $2, progress = $3, stage_seconds = $4
             WHERE id = $5 AND worker = $6 AND status = 'running' RETURNING cancel_asked",
        )
        .bind(lease_end(self.now_ms().await?, lease))
        .bind(stage)
        .bind(progress.clamp(0.0, 1.0))
        .bind(seconds)
        .bind(claim.job.id.to_string())
        .bind(claim.worker.to_string())
        .fetch_optional(&self.writer)
        .await?;
        Ok(cancel_asked)
    }

    async fn finish_job(&self, claim: &JobClaim, finish: &Finish) -> Result<Option<Unseen>, DatabaseError> {
        self.with_reserve(|| self.finish_once(claim, finish)).await
    }

    async fn give_back_job(&self, claim: &JobClaim) -> Result<bool, DatabaseError> {
        self.with_reserve(|| self.give_back_once(claim)).await
    }

    async fn reclaim_jobs(&self, max_attempts: u32) -> Result<u64, DatabaseError> {
        self.with_reserve(|| self.reclaim_once(max_attempts)).await
    }
}

impl Store {
    async fn finish_once(&self, claim: &JobClaim, finish: &Finish) -> Result<Option<Unseen>, DatabaseError> {
        let (status, error, model) = match finish {
            Finish::Succeeded(model) => (JobStatus::Succeeded, None, model.as_ref()),
            Finish::Failed(error) => (JobStatus::Failed, Some(error), None),
            Finish::Canceled => (JobStatus::Canceled, None, None),
        };
        let error = error.map(serde_json::to_string).transpose().map_err(|error| damaged("a job's error", error))?;
        let mut tx = self.begin_any().await?;
        let done = sqlx::query(
            "UPDATE job SET status = $1, error = $2, worker = NULL, leased_until = NULL, finished_at = $3,
                            progress = CASE WHEN $1 = 'succeeded' THEN 1 ELSE progress END
             WHERE id = $4 AND worker = $5 AND status = 'running' AND NOT ($1 = 'succeeded' AND cancel_asked)",
        )
        .bind(status.name())
        .bind(error)
        .bind(tx.now_ms())
        .bind(claim.job.id.to_string())
        .bind(claim.worker.to_string())
        .execute(&mut *tx)
        .await?;
        if done.rows_affected() == 0 {
            return Ok(None);
        }
        if let Some(model) = model {
            models::insert(&mut tx, model).await?;
        }
        let (id, kind, model) = (claim.job.id, claim.job.kind, model.map(|model| model.id));
        outbox::tell(&mut tx, &Event::JobEnded { id, kind, status, model }).await?;
        tx.commit_unseen(self).await.map(Some)
    }

    async fn give_back_once(&self, claim: &JobClaim) -> Result<bool, DatabaseError> {
        let mut tx = self.begin_any().await?;
        let given_back: Vec<(String, String, String)> = sqlx::query_as(
            "UPDATE job SET status = CASE WHEN cancel_asked THEN 'canceled' ELSE 'queued' END,
                            finished_at = CASE WHEN cancel_asked THEN $1 END,
                            worker = NULL, leased_until = NULL, attempts = CASE WHEN attempts > 0 THEN attempts - 1 ELSE 0 END,
                            stage = NULL, progress = 0, stage_seconds = '{}'
             WHERE id = $2 AND worker = $3 AND status = 'running' RETURNING id, kind, status",
        )
        .bind(tx.now_ms())
        .bind(claim.job.id.to_string())
        .bind(claim.worker.to_string())
        .fetch_all(&mut *tx)
        .await?;
        let is_given_back = !given_back.is_empty();
        let canceled = given_back.into_iter().filter(|(_, _, status)| status == JobStatus::Canceled.name());
        let canceled: Vec<_> = canceled.map(|(id, kind, _)| (id, kind)).collect();
        outbox::tell_ends(&mut tx, &canceled, JobStatus::Canceled).await?;
        tx.commit().await?;
        Ok(is_given_back)
    }

    async fn reclaim_once(&self, max_attempts: u32) -> Result<u64, DatabaseError> {
        let mut tx = self.begin_any().await?;
        // of all that runs, what was run from this seat by another process: that one is gone, and its lease with it
        let left = "UPDATE job SET leased_until = 0
                    WHERE status = 'running'
                      AND (leased_until < $1 OR (seat = $2 AND substr(worker, 1, length($3)) <> $3))";
        let running = sqlx::query(left)
            .bind(tx.now_ms())
            .bind(self.owner.seat.to_string())
            .bind(self.owner.process.to_string())
            .execute(&mut *tx)
            .await?;
        let canceled = sqlx::query_as(
            "UPDATE job SET status = 'canceled', worker = NULL, leased_until = NULL, finished_at = $1
             WHERE status = 'running' AND leased_until = 0 AND cancel_asked RETURNING id, kind",
        )
        .bind(tx.now_ms())
        .fetch_all(&mut *tx)
        .await?;
        outbox::tell_ends(&mut tx, &canceled, JobStatus::Canceled).await?;
        fail_exhausted(&mut tx, max_attempts, "[]").await?;
        sqlx::query(
            "UPDATE job SET status = 'queued', worker = NULL, leased_until = NULL, stage = NULL, progress = 0,
                            stage_seconds = '{}'
             WHERE status = 'running' AND leased_until = 0",
        )
        .execute(&mut *tx)
        .await?;
        outbox::take_back(&mut tx, self.owner.seat).await?;
        tx.commit().await?;
        Ok(running.rows_affected())
    }
}

fn lease_end(now_ms: i64, lease: Duration) -> i64 {
    now_ms.saturating_add(i64::try_from(lease.as_millis()).unwrap_or(i64::MAX))
}

/// Fails the jobs whose worker vanished for the last time that is allowed; `living` is a JSON list of those that have
/// not.
async fn fail_exhausted(db: &mut Writing, max_attempts: u32, living: &str) -> Result<(), DatabaseError> {
    let error = JobError {
        code: "attempts_exhausted".to_owned(),
        message: format!("the job was started {max_attempts} times and the server ended each time before the job did"),
        scan: None,
        hint: "the scans may need more memory than the server has: use fewer or thinner scans, or retry the job on a \
               larger machine"
            .to_owned(),
    };
    let error = serde_json::to_string(&error).map_err(|error| damaged("a job's error", error))?;
    let failed = sqlx::query_as(
        "UPDATE job SET status = 'failed', error = $1, worker = NULL, leased_until = NULL, finished_at = $2
         WHERE status = 'running' AND leased_until < $2 AND attempts >= $3
           AND worker NOT IN (SELECT value FROM json_each($4))
         RETURNING id, kind",
    )
    .bind(error)
    .bind(db.now_ms())
    .bind(i64::from(max_attempts))
    .bind(living)
    .fetch_all(&mut **db)
    .await?;
    outbox::tell_ends(db, &failed, JobStatus::Failed).await
}
