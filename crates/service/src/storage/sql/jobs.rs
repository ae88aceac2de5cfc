//! Jobs as the API sees them: create, look up, list, cancel, retry, delete.

use super::rows::row;
use super::{
    Connection, Store, damaged, locked, models, outbox, recycle_bin, replays, scan_sets, sql_limit, stored_id,
    stored_name, timestamp, to_u32, to_u64,
};
use crate::storage::database::Jobs;
use crate::storage::{DatabaseError, Deleted, Purged};
use async_trait::async_trait;
use visage_domain::{
    CancelAnswer, Hints, JobBase, JobFilter, JobId, JobRecord, JobStatus, ModelId, NewJob, NewScanSet, NewSurfaceJob,
    Page, PageRequest, Replay,
};

row! {
    /// A row of `job` joined with the id of its model.
    pub(super) struct JobRow {
        id: String,
        kind: String,
        scan_set_id: Option<String>,
        label: Option<String>,
        options: String,
        status: String,
        stage: Option<String>,
        progress: f64,
        stage_seconds: String,
        attempts: i64,
        cancel_asked: bool,
        error: Option<String>,
        base_model_id: Option<String>,
        base_poses: Option<Vec<u8>>,
        hints: Option<String>,
        model_id: Option<String>,
        started_at: Option<i64>,
        finished_at: Option<i64>,
    }
}

impl JobRow {
    pub(super) fn record(self) -> Result<JobRecord, DatabaseError> {
        Ok(JobRecord {
            id: stored_id!(JobId, &self.id)?,
            kind: stored_name("a kind", &self.kind)?,
            scan_set_id: self.scan_set_id.map(|text| stored_id!(ScanSetId, &text)).transpose()?,
            label: self.label,
            options: serde_json::from_str(&self.options).map_err(|error| damaged("options", error))?,
            base: match (self.base_model_id, self.base_poses) {
                (Some(id), Some(poses)) => Some(JobBase { model_id: stored_id!(ModelId, &id)?, poses }),
                _ => None,
            },
            hints: match &self.hints {
                Some(text) => serde_json::from_str(text).map_err(|error| damaged("hints", error))?,
                None => Hints::default(),
            },
            status: stored_name("a status", &self.status)?,
            stage: self.stage,
            progress: self.progress,
            stage_seconds: serde_json::from_str(&self.stage_seconds).map_err(|error| damaged("seconds", error))?,
            attempts: to_u32(self.attempts),
            cancel_asked: self.cancel_asked,
            error: self
                .error
                .map(|text| serde_json::from_str(&text))
                .transpose()
                .map_err(|error| damaged("a job's error", error))?,
            model_id: self.model_id.map(|text| stored_id!(ModelId, &text)).transpose()?,
            started_at: self.started_at.map(timestamp).transpose()?,
            finished_at: self.finished_at.map(timestamp).transpose()?,
        })
    }
}

#[async_trait]
impl Jobs for Store {
    async fn create_job(
        &self,
        job: &NewJob,
        set: Option<&NewScanSet>,
        queue_limit: usize,
        replay: Option<&Replay>,
    ) -> Result<(), DatabaseError> {
        let mut tx = self.begin().await?;
        check_room(&mut tx, queue_limit).await?;
        if let Some(set) = set {
            scan_sets::insert_set(&mut tx, set).await?;
        }
        let options = serde_json::to_string(&job.options).map_err(|error| damaged("options", error))?;
        let hints = (!job.hints.is_empty()).then(|| serde_json::to_string(&job.hints)).transpose();
        let hints = hints.map_err(|error| damaged("hints", error))?;
        // the scan set may have been deleted since it was looked up
        let inserted = sqlx::query(
            "INSERT INTO job (id, kind, scan_set_id, label, options, base_model_id, base_poses, hints, status)
             SELECT $1, 'register', id, $2, $3, $4, $5, $6, 'queued' FROM scan_set WHERE id = $7",
        )
        .bind(job.id.to_string())
        .bind(&job.label)
        .bind(options)
        .bind(job.base.as_ref().map(|base| base.model_id.to_string()))
        .bind(job.base.as_ref().map(|base| &base.poses))
        .bind(hints)
        .bind(job.scan_set_id.to_string())
        .execute(&mut *tx)
        .await?;
        if inserted.rows_affected() == 0 {
            return Err(DatabaseError::NotFound { kind: "scan set", id: job.scan_set_id.to_string() });
        }
        if let Some(replay) = replay {
            replays::insert(&mut tx, replay).await?;
        }
        tx.commit().await?;
        Ok(())
    }

    async fn create_surface_job(
        &self,
        job: &NewSurfaceJob,
        queue_limit: usize,
        replay: Option<&Replay>,
    ) -> Result<(), DatabaseError> {
        let mut tx = self.begin().await?;
        check_room(&mut tx, queue_limit).await?;
        let options = serde_json::to_string(&job.options).map_err(|error| damaged("options", error))?;
        // the model may have been deleted since it was looked up
        let inserted = sqlx::query(
            "INSERT INTO job (id, kind, label, options, base_model_id, base_poses, status)
             SELECT $1, 'surface', $2, $3, id, $4, 'queued' FROM model WHERE id = $5",
        )
        .bind(job.id.to_string())
        .bind(&job.label)
        .bind(options)
        .bind(Vec::<u8>::new())
        .bind(job.model_id.to_string())
        .execute(&mut *tx)
        .await?;
        if inserted.rows_affected() == 0 {
            return Err(DatabaseError::NotFound { kind: "model", id: job.model_id.to_string() });
        }
        if let Some(replay) = replay {
            replays::insert(&mut tx, replay).await?;
        }
        tx.commit().await?;
        Ok(())
    }

    async fn job(&self, id: JobId) -> Result<JobRecord, DatabaseError> {
        let mut db = self.readers.acquire().await?;
        record(&mut db, id).await
    }

    async fn jobs(&self, filter: &JobFilter, page: &PageRequest) -> Result<Page<JobRecord>, DatabaseError> {
        let rows: Vec<JobRow> = sqlx::query_as(
            "SELECT job.*, model.id AS model_id FROM job LEFT JOIN model ON model.job_id = job.id
             WHERE ($1 IS NULL OR job.id < $1)
               AND ($2 IS NULL OR job.status = $2)
               AND ($3 IS NULL OR job.scan_set_id = $3)
             ORDER BY job.id DESC LIMIT $4",
        )
        .bind(page.before.as_deref())
        .bind(filter.status.map(JobStatus::name))
        .bind(filter.scan_set_id.map(|id| id.to_string()))
        .bind(sql_limit(page))
        .fetch_all(&self.readers)
        .await?;
        let records = rows.into_iter().map(JobRow::record).collect::<Result<Vec<_>, _>>()?;
        Ok(Page::cut(records, page.limit))
    }

    async fn queue_length(&self) -> Result<(u64, u64), DatabaseError> {
        let (queued, running): (i64, i64) = sqlx::query_as(
            "SELECT count(*) FILTER (WHERE status = 'queued'), count(*) FILTER (WHERE status = 'running')
             FROM job WHERE status IN ('queued', 'running')",
        )
        .fetch_one(&self.readers)
        .await?;
        Ok((to_u64(queued), to_u64(running)))
    }

    async fn cancel_job(&self, id: JobId) -> Result<CancelAnswer, DatabaseError> {
        self.with_reserve(|| self.cancel_once(id)).await
    }

    async fn retry_job(&self, id: JobId, queue_limit: usize) -> Result<(), DatabaseError> {
        let mut tx = self.begin().await?;
        match status_of(&mut tx, id).await? {
            JobStatus::Failed | JobStatus::Canceled => {}
            status => return Err(DatabaseError::WrongStatus { id, status }),
        }
        check_room(&mut tx, queue_limit).await?;
        sqlx::query(
            "UPDATE job SET status = 'queued', stage = NULL, progress = 0, stage_seconds = '{}', attempts = 0,
                            cancel_asked = FALSE, error = NULL, started_at = NULL, finished_at = NULL
             WHERE id = $1",
        )
        .bind(id.to_string())
        .execute(&mut *tx)
        .await?;
        tx.commit().await?;
        Ok(())
    }

    async fn delete_job(&self, id: JobId) -> Result<Deleted, DatabaseError> {
        self.with_reserve(|| self.delete_job_once(id)).await
    }
}

impl Store {
    async fn cancel_once(&self, id: JobId) -> Result<CancelAnswer, DatabaseError> {
        let mut tx = self.begin_any().await?;
        let answer = match status_of(&mut tx, id).await? {
            JobStatus::Queued => {
                let cancel = "UPDATE job SET status = 'canceled', cancel_asked = TRUE, finished_at = $1 WHERE id = $2
                              RETURNING id, kind";
                let canceled =
                    sqlx::query_as(cancel).bind(tx.now_ms()).bind(id.to_string()).fetch_all(&mut *tx).await?;
                outbox::tell_ends(&mut tx, &canceled, JobStatus::Canceled).await?;
                CancelAnswer::Canceled
            }
            JobStatus::Running => {
                sqlx::query("UPDATE job SET cancel_asked = TRUE WHERE id = $1")
                    .bind(id.to_string())
                    .execute(&mut *tx)
                    .await?;
                CancelAnswer::Asked
            }
            status => return Err(DatabaseError::WrongStatus { id, status }),
        };
        tx.commit().await?;
        Ok(answer)
    }

    async fn delete_job_once(&self, id: JobId) -> Result<Deleted, DatabaseError> {
        let mut tx = self.begin_any().await?;
        check_finished(&mut tx, id).await?;
        let text = id.to_string();
        let model = models::id_of_job(&mut tx, &text).await?;
        replays::delete_of(&mut tx, &text).await?;
        // model, assets and signature go by foreign keys
        sqlx::query("DELETE FROM job WHERE id = $1").bind(&text).execute(&mut *tx).await?;
        let models: Vec<ModelId> = model.into_iter().collect();
        models::leave(&mut tx, &models).await?;
        let mut purged = Purged::default();
        recycle_bin::purge_made_of(&mut tx, &text, &mut purged).await?;
        Ok(Deleted { models, purged, unseen: tx.commit_unseen(self).await? })
    }
}

/// One job; part of a larger transaction, or alone.
pub(super) async fn record(db: &mut Connection, id: JobId) -> Result<JobRecord, DatabaseError> {
    let row: Option<JobRow> = sqlx::query_as(
        "SELECT job.*, model.id AS model_id FROM job LEFT JOIN model ON model.job_id = job.id WHERE job.id = $1",
    )
    .bind(id.to_string())
    .fetch_optional(db)
    .await?;
    row.ok_or_else(|| not_found(id))?.record()
}

fn not_found(id: JobId) -> DatabaseError {
    DatabaseError::NotFound { kind: "job", id: id.to_string() }
}

async fn status_of(db: &mut Connection, id: JobId) -> Result<JobStatus, DatabaseError> {
    let status: Option<String> = sqlx::query_scalar(concat!("SELECT status FROM job WHERE id = $1", locked!()))
        .bind(id.to_string())
        .fetch_optional(db)
        .await?;
    stored_name("a status", &status.ok_or_else(|| not_found(id))?)
}

/// The job is there, and will not change any more unless it is tried again.
pub(super) async fn check_finished(db: &mut Connection, id: JobId) -> Result<(), DatabaseError> {
    match status_of(db, id).await?.is_finished() {
        true => Ok(()),
        false => Err(DatabaseError::InUse { kind: "job", id: id.to_string() }),
    }
}

/// There is room for one more waiting job.
async fn check_room(db: &mut Connection, limit: usize) -> Result<(), DatabaseError> {
    let queued: i64 = sqlx::query_scalar("SELECT count(*) FROM job WHERE status = 'queued'").fetch_one(db).await?;
    if to_u64(queued) >= limit as u64 {
        return Err(DatabaseError::QueueFull { limit });
    }
    Ok(())
}
