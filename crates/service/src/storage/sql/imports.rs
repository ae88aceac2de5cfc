//! Models that come from another data folder, with the jobs that made them.

use super::{Connection, Store, damaged, models, scan_sets};
use crate::storage::DatabaseError;
use crate::storage::database::Imports;
use async_trait::async_trait;
use visage_domain::{ImportedModel, JobRecord};

#[async_trait]
impl Imports for Store {
    async fn import_models(&self, models: &[ImportedModel]) -> Result<(), DatabaseError> {
        let mut tx = self.begin().await?;
        for ImportedModel { model, job, scan_set } in models {
            if let Some(set) = scan_set {
                let is_there: bool = sqlx::query_scalar("SELECT EXISTS (SELECT 1 FROM scan_set WHERE id = $1)")
                    .bind(set.id.to_string())
                    .fetch_one(&mut *tx)
                    .await?;
                if !is_there {
                    scan_sets::insert_set(&mut tx, set).await?;
                }
            }
            if let Some(job) = job {
                insert_ended(&mut tx, job).await?;
            }
            models::insert(&mut tx, model).await?;
        }
        tx.commit().await
    }
}

/// A job that has succeeded; one of its id that is there stays as it is.
async fn insert_ended(db: &mut Connection, job: &JobRecord) -> Result<(), DatabaseError> {
    let options = serde_json::to_string(&job.options).map_err(|error| damaged("options", error))?;
    let hints = (!job.hints.is_empty()).then(|| serde_json::to_string(&job.hints)).transpose();
    let seconds = serde_json::to_string(&job.stage_seconds).map_err(|error| damaged("seconds", error))?;
    sqlx::query(
        "INSERT INTO job (id, kind, scan_set_id, label, options, status, stage, progress, stage_seconds, attempts, started_at,
                          finished_at, base_model_id, base_poses, hints)
         VALUES ($1, $2, $3, $4, $5, 'succeeded', $6, 1, $7, $8, $9, $10, $11, $12, $13) ON CONFLICT DO NOTHING",
    )
    .bind(job.id.to_string())
    .bind(job.kind.name())
    .bind(job.scan_set_id.map(|id| id.to_string()))
    .bind(&job.label)
    .bind(options)
    .bind(&job.stage)
    .bind(seconds)
    .bind(i64::from(job.attempts))
    .bind(job.started_at.map(jiff::Timestamp::as_millisecond))
    .bind(job.finished_at.map(jiff::Timestamp::as_millisecond))
    .bind(job.base.as_ref().map(|base| base.model_id.to_string()))
    .bind(job.base.as_ref().map(|base| &base.poses))
    .bind(hints.map_err(|error| damaged("hints", error))?)
    .execute(db)
    .await?;
    Ok(())
}
