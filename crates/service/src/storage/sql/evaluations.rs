//! What is to be looked at again: signatures of another version, and models not yet judged against a standard.
//!
//! What is missing is read off the tables, so an evaluation that is broken off goes on where it stood, and what comes
//! meanwhile (a model, a standard) is seen by it too.

use super::rows::row;
use super::{Connection, Store, damaged, jobs, locked, replays, stored_id, to_i64, to_u64};
use crate::storage::DatabaseError;
use crate::storage::database::Evaluations;
use async_trait::async_trait;
use visage_domain::options::Options;
use visage_domain::{Backlog, JobId, JobRecord, ModelId, Outdated, Replay, StandardId, StoredVerdict};
use visage_shape::faces::Signature;
use visage_shape::standards::Standard;

/// Evaluations that have succeeded are kept for a while.
const EVALUATIONS_KEPT: i64 = 50;

row! {
    struct VerdictRow {
        standard_id: String,
        model_id: String,
        residual_mm: f64,
        found: Option<String>,
        reason: Option<String>,
    }
}

impl VerdictRow {
    fn verdict(self) -> Result<StoredVerdict, DatabaseError> {
        let found = self.found.map(|text| serde_json::from_str(&text)).transpose();
        Ok(StoredVerdict {
            standard_id: stored_id!(StandardId, &self.standard_id)?,
            model_id: stored_id!(ModelId, &self.model_id)?,
            residual_mm: self.residual_mm,
            found: found.map_err(|error| damaged("a verdict", error))?,
            reason: self.reason,
        })
    }
}

#[async_trait]
impl Evaluations for Store {
    async fn backlog(&self) -> Result<Backlog, DatabaseError> {
        let mut db = self.readers.acquire().await?;
        backlog(&mut db).await
    }

    async fn outdated(&self, after: Option<ModelId>, limit: usize) -> Result<Vec<Outdated>, DatabaseError> {
        let rows: Vec<(String, bool, Option<String>)> = sqlx::query_as(
            "SELECT * FROM (
                 SELECT model.id AS id,
                     EXISTS (SELECT 1 FROM signature WHERE model_id = model.id AND version <> $1) AS stale,
                     (SELECT string_agg(standard.id, ',') FROM standard WHERE NOT EXISTS
                         (SELECT 1 FROM verdict WHERE standard_id = standard.id AND model_id = model.id
                                                  AND version = $2)) AS missing
                 FROM model WHERE $3 IS NULL OR model.id > $3)
             AS models WHERE stale OR missing IS NOT NULL ORDER BY id LIMIT $4",
        )
        .bind(i64::from(Signature::VERSION))
        .bind(i64::from(Standard::VERSION))
        .bind(after.map(|id| id.to_string()))
        .bind(to_i64(limit as u64))
        .fetch_all(&self.readers)
        .await?;
        let outdated = |(id, signature, missing): (String, bool, Option<String>)| {
            let ids = missing.iter().flat_map(|ids| ids.split(','));
            let standards = ids.map(|text| stored_id!(StandardId, text)).collect::<Result<_, _>>()?;
            Ok(Outdated { model_id: stored_id!(ModelId, &id)?, signature, standards })
        };
        rows.into_iter().map(outdated).collect()
    }

    async fn keep_verdicts(&self, verdicts: &[StoredVerdict]) -> Result<(), DatabaseError> {
        let mut tx = self.begin().await?;
        for verdict in verdicts {
            let found = verdict.found.as_ref().map(serde_json::to_string).transpose();
            sqlx::query(
                "INSERT INTO verdict (standard_id, model_id, version, residual_mm, found, reason)
                 SELECT standard.id, model.id, $1, $2, $3, $4 FROM standard, model WHERE standard.id = $5 AND model.id = $6
                 ON CONFLICT (standard_id, model_id) DO UPDATE SET version = excluded.version,
                     residual_mm = excluded.residual_mm, found = excluded.found, reason = excluded.reason",
            )
            .bind(i64::from(Standard::VERSION))
            .bind(verdict.residual_mm)
            .bind(found.map_err(|error| damaged("a verdict", error))?)
            .bind(&verdict.reason)
            .bind(verdict.standard_id.to_string())
            .bind(verdict.model_id.to_string())
            .execute(&mut *tx)
            .await?;
        }
        tx.commit().await?;
        Ok(())
    }

    async fn ranking(&self, id: StandardId, limit: usize) -> Result<Vec<StoredVerdict>, DatabaseError> {
        let rows: Vec<VerdictRow> = sqlx::query_as(
            "SELECT standard_id, model_id, residual_mm, found, reason FROM verdict
             WHERE standard_id = $1 AND version = $2 AND reason IS NULL ORDER BY residual_mm, model_id LIMIT $3",
        )
        .bind(id.to_string())
        .bind(i64::from(Standard::VERSION))
        .bind(to_i64(limit as u64))
        .fetch_all(&self.readers)
        .await?;
        rows.into_iter().map(VerdictRow::verdict).collect()
    }

    async fn judged(&self, id: StandardId) -> Result<(u64, u64), DatabaseError> {
        let (judged, models): (i64, i64) = sqlx::query_as(
            "SELECT (SELECT count(*) FROM verdict WHERE standard_id = $1 AND version = $2), (SELECT count(*) FROM model)",
        )
        .bind(id.to_string())
        .bind(i64::from(Standard::VERSION))
        .fetch_one(&self.readers)
        .await?;
        Ok((to_u64(judged), to_u64(models - judged)))
    }

    async fn verdicts_on(&self, id: ModelId) -> Result<Vec<StoredVerdict>, DatabaseError> {
        let rows: Vec<VerdictRow> = sqlx::query_as(
            "SELECT standard_id, model_id, residual_mm, found, reason FROM verdict
             WHERE model_id = $1 AND version = $2 ORDER BY standard_id",
        )
        .bind(id.to_string())
        .bind(i64::from(Standard::VERSION))
        .fetch_all(&self.readers)
        .await?;
        rows.into_iter().map(VerdictRow::verdict).collect()
    }

    async fn example_residuals(&self, id: StandardId) -> Result<(Vec<f64>, Vec<f64>), DatabaseError> {
        let rows: Vec<(bool, f64)> = sqlx::query_as(
            "SELECT is_positive, residual_mm FROM example JOIN verdict USING (standard_id, model_id)
             WHERE standard_id = $1 AND version = $2 AND reason IS NULL ORDER BY model_id",
        )
        .bind(id.to_string())
        .bind(i64::from(Standard::VERSION))
        .fetch_all(&self.readers)
        .await?;
        let of_kind = |kind: bool| rows.iter().filter(|(positive, _)| *positive == kind).map(|(_, r)| *r).collect();
        Ok((of_kind(true), of_kind(false)))
    }

    async fn registration_waits(&self) -> Result<bool, DatabaseError> {
        let waits =
            sqlx::query_scalar("SELECT EXISTS (SELECT 1 FROM job WHERE status = 'queued' AND kind <> 'evaluate')")
                .fetch_one(&self.readers)
                .await?;
        Ok(waits)
    }

    async fn queue_evaluation(&self) -> Result<Option<JobId>, DatabaseError> {
        let mut tx = self.begin().await?;
        let job = queue_if_due(&mut tx).await?;
        tx.commit().await?;
        Ok(job)
    }

    async fn demand_evaluation(
        &self,
        replay: &(dyn for<'r> Fn(&'r JobRecord) -> Option<Replay> + Send + Sync),
    ) -> Result<JobRecord, DatabaseError> {
        let mut tx = self.begin().await?;
        let id = queue(&mut tx).await?;
        let job = jobs::record(&mut tx, id).await?;
        if let Some(replay) = replay(&job) {
            replays::insert(&mut tx, &replay).await?;
        }
        tx.commit().await?;
        Ok(job)
    }
}

async fn backlog(db: &mut Connection) -> Result<Backlog, DatabaseError> {
    let (stale, models, standards, judged): (i64, i64, i64, i64) = sqlx::query_as(
        "SELECT (SELECT count(*) FROM signature WHERE version < $1 OR version > $1),
                (SELECT count(*) FROM model), (SELECT count(*) FROM standard),
                (SELECT count(*) FROM verdict WHERE version = $2)",
    )
    .bind(i64::from(Signature::VERSION))
    .bind(i64::from(Standard::VERSION))
    .fetch_one(db)
    .await?;
    Ok(Backlog {
        stale_signatures: to_u64(stale),
        missing_verdicts: to_u64(models * standards - judged),
        standards: to_u64(standards),
    })
}

/// Queues an evaluation if there is anything to be done; part of the transaction that gives it something to do.
pub(super) async fn queue_if_due(db: &mut Connection) -> Result<Option<JobId>, DatabaseError> {
    let Backlog { stale_signatures, missing_verdicts, .. } = backlog(db).await?;
    if stale_signatures + missing_verdicts == 0 { Ok(None) } else { queue(db).await.map(Some) }
}

/// One that runs already may have looked for the last time: only one that waits is sure to see everything.
pub(super) async fn queue(db: &mut Connection) -> Result<JobId, DatabaseError> {
    let waiting: Option<String> = sqlx::query_scalar(concat!(
        "SELECT id FROM job WHERE kind = 'evaluate' AND status = 'queued' LIMIT 1",
        locked!()
    ))
    .fetch_optional(&mut *db)
    .await?;
    if let Some(waiting) = waiting {
        return stored_id!(JobId, &waiting);
    }
    forget_old(db).await?;
    let id = JobId::new();
    let options = serde_json::to_string(&Options::default()).map_err(|error| damaged("options", error))?;
    sqlx::query("INSERT INTO job (id, kind, options, status) VALUES ($1, 'evaluate', $2, 'queued')")
        .bind(id.to_string())
        .bind(options)
        .execute(db)
        .await?;
    Ok(id)
}

/// There is one after each upload of a model where there are standards: only the last ones are of interest.
async fn forget_old(db: &mut Connection) -> Result<(), DatabaseError> {
    let old: Vec<String> = sqlx::query_scalar(
        "SELECT id FROM job WHERE kind = 'evaluate' AND status = 'succeeded' AND id NOT IN
             (SELECT id FROM job WHERE kind = 'evaluate' AND status = 'succeeded' ORDER BY id DESC LIMIT $1)",
    )
    .bind(EVALUATIONS_KEPT)
    .fetch_all(&mut *db)
    .await?;
    for id in old {
        replays::delete_of(db, &id).await?;
        sqlx::query("DELETE FROM job WHERE id = $1").bind(id).execute(&mut *db).await?;
    }
    Ok(())
}
