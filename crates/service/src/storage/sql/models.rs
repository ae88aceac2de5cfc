//! Models: what they are made of, their files and their signatures.

use super::rows::row;
use super::{
    Connection, Store, Writing, damaged, evaluations, files, has_words, outbox, replays, signatures, sql_limit,
    stored_id, stored_name, to_i64, to_u64, words,
};
use crate::storage::database::Models;
use crate::storage::{DatabaseError, Deleted, Purged, Unseen};
use async_trait::async_trait;
use visage_domain::{
    AssetRecord, Event, ModelFilter, ModelId, ModelRecord, NewModel, Page, PageRequest, Replay, StoredFile,
};

row! {
    struct ModelRow {
        id: String,
        job_id: Option<String>,
        scan_set_id: Option<String>,
        name: String,
        label: Option<String>,
        unit: String,
        points: i64,
        quality: Option<String>,
        reading: Option<String>,
        summary: Option<String>,
    }
}

impl ModelRow {
    fn record(self) -> Result<ModelRecord, DatabaseError> {
        let summary = self.summary.map(|text| serde_json::from_str(&text)).transpose();
        Ok(ModelRecord {
            id: stored_id!(ModelId, &self.id)?,
            job_id: self.job_id.map(|text| stored_id!(JobId, &text)).transpose()?,
            scan_set_id: self.scan_set_id.map(|text| stored_id!(ScanSetId, &text)).transpose()?,
            name: self.name,
            label: self.label,
            unit: stored_name("a unit", &self.unit)?,
            points: to_u64(self.points),
            quality: self.quality,
            reading: self.reading,
            signature: summary.map_err(|error| damaged("a signature's summary", error))?,
        })
    }
}

#[async_trait]
impl Models for Store {
    async fn create_model(&self, model: &NewModel, replay: Option<&Replay>) -> Result<Unseen, DatabaseError> {
        let mut tx = self.begin().await?;
        insert(&mut tx, model).await?;
        if let Some(replay) = replay {
            replays::insert(&mut tx, replay).await?;
        }
        tx.commit_unseen(self).await
    }

    async fn create_models(&self, models: &[NewModel]) -> Result<(), DatabaseError> {
        let mut tx = self.begin().await?;
        for model in models {
            insert(&mut tx, model).await?;
        }
        tx.commit().await
    }

    async fn model(&self, id: ModelId) -> Result<ModelRecord, DatabaseError> {
        let row: Option<ModelRow> = sqlx::query_as(
            "SELECT model.*, signature.summary FROM model
             LEFT JOIN signature ON signature.model_id = model.id WHERE model.id = $1",
        )
        .bind(id.to_string())
        .fetch_optional(&self.readers)
        .await?;
        row.ok_or_else(|| not_found(id))?.record()
    }

    async fn models(&self, filter: &ModelFilter, page: &PageRequest) -> Result<Page<ModelRecord>, DatabaseError> {
        let rows: Vec<ModelRow> = sqlx::query_as(concat!(
            "SELECT model.*, signature.summary FROM model
             LEFT JOIN signature ON signature.model_id = model.id
             WHERE ($1 IS NULL OR model.id < $1)
               AND ($2 IS NULL OR model.label = $2)
               AND ($3 IS NULL OR model.scan_set_id = $3)
               AND ",
            has_words!("$4"),
            " ORDER BY model.id DESC LIMIT $5",
        ))
        .bind(page.before.as_deref())
        .bind(filter.label.as_deref())
        .bind(filter.scan_set_id.map(|id| id.to_string()))
        .bind(words::patterns(&filter.words))
        .bind(sql_limit(page))
        .fetch_all(&self.readers)
        .await?;
        let records = rows.into_iter().map(ModelRow::record).collect::<Result<Vec<_>, _>>()?;
        Ok(Page::cut(records, page.limit))
    }

    async fn assets(&self, id: ModelId) -> Result<Vec<AssetRecord>, DatabaseError> {
        let rows: Vec<(String, i64, String)> =
            sqlx::query_as("SELECT name, bytes, checksum FROM asset WHERE model_id = $1 ORDER BY name")
                .bind(id.to_string())
                .fetch_all(&self.readers)
                .await?;
        Ok(rows
            .into_iter()
            .map(|(name, bytes, checksum)| AssetRecord { name, bytes: to_u64(bytes), checksum })
            .collect())
    }

    async fn delete_model(&self, id: ModelId) -> Result<Deleted, DatabaseError> {
        let delete = || async {
            let mut tx = self.begin_any().await?;
            replays::delete_of(&mut tx, &id.to_string()).await?;
            let done = sqlx::query("DELETE FROM model WHERE id = $1").bind(id.to_string()).execute(&mut *tx).await?;
            if done.rows_affected() == 0 {
                return Err(not_found(id));
            }
            leave(&mut tx, &[id]).await?;
            Ok(Deleted { models: vec![id], purged: Purged::default(), unseen: tx.commit_unseen(self).await? })
        };
        self.with_reserve(delete).await
    }
}

fn not_found(id: ModelId) -> DatabaseError {
    DatabaseError::NotFound { kind: "model", id: id.to_string() }
}

/// Stores a model with its files' records and its signature; part of a larger transaction.
pub(super) async fn insert(db: &mut Writing, model: &NewModel) -> Result<(), DatabaseError> {
    let id = model.id.to_string();
    sqlx::query(
        "INSERT INTO model (id, job_id, scan_set_id, name, label, unit, points, quality, reading)
         VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9)",
    )
    .bind(&id)
    .bind(model.origin.map(|(job, _)| job.to_string()))
    .bind(model.origin.and_then(|(_, set)| set).map(|set| set.to_string()))
    .bind(&model.name)
    .bind(&model.label)
    .bind(model.unit.name())
    .bind(to_i64(model.points))
    .bind(&model.quality)
    .bind(&model.reading)
    .execute(&mut **db)
    .await?;
    for asset in &model.assets {
        sqlx::query("INSERT INTO asset (model_id, name, bytes, checksum) VALUES ($1, $2, $3, $4)")
            .bind(&id)
            .bind(&asset.name)
            .bind(to_i64(asset.bytes))
            .bind(&asset.checksum)
            .execute(&mut **db)
            .await?;
    }
    if let Some(signature) = &model.signature {
        signatures::insert(db, &id, signature).await?;
    }
    files::settle(db, StoredFile::Model(model.id)).await?;
    outbox::tell(db, &Event::ModelAdded(model.id)).await?;
    let is_to_be_judged: bool =
        sqlx::query_scalar("SELECT EXISTS (SELECT 1 FROM standard)").fetch_one(&mut **db).await?;
    if is_to_be_judged {
        evaluations::queue(db).await?;
    }
    Ok(())
}

/// Models have no rows any more; part of the transaction that deletes those.
pub(super) async fn leave(db: &mut Writing, models: &[ModelId]) -> Result<(), DatabaseError> {
    for model in models {
        files::leave(db, StoredFile::Model(*model)).await?;
        outbox::tell(db, &Event::ModelDeleted(*model)).await?;
    }
    Ok(())
}

/// The models made from a scan set.
pub(super) async fn ids_of_scan_set(db: &mut Connection, set: &str) -> Result<Vec<ModelId>, DatabaseError> {
    let ids: Vec<String> =
        sqlx::query_scalar("SELECT id FROM model WHERE scan_set_id = $1").bind(set).fetch_all(db).await?;
    ids.iter().map(|text| stored_id!(ModelId, text)).collect()
}

/// The model made by a job.
pub(super) async fn id_of_job(db: &mut Connection, job: &str) -> Result<Option<ModelId>, DatabaseError> {
    let id: Option<String> =
        sqlx::query_scalar("SELECT id FROM model WHERE job_id = $1").bind(job).fetch_optional(db).await?;
    id.map(|text| stored_id!(ModelId, &text)).transpose()
}
