//! Models: what they are made of, their files and their signatures.

use sqlx::{FromRow, SqliteConnection};

use super::{
    Deleted, JobId, ModelId, Page, PageRequest, Replay, ScanSetId, Store, StoreError, StoredFile, StoredSignature,
    Unseen, damaged, evaluations, replays, signatures, stored_id, sweep, to_i64, to_u64,
};
use crate::domain::asset::Origin;
use crate::faces::SignatureSummary;
use crate::geometry::Unit;

/// One file of a model.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AssetRecord {
    /// Its name in the API and on disk; one of ours, never a user's.
    pub name: String,
    /// Its size.
    pub bytes: u64,
    /// BLAKE3 of its content, hexadecimal.
    pub checksum: String,
}

/// A model that is to be stored.
#[derive(Debug, Clone)]
pub struct NewModel {
    /// Its id.
    pub id: ModelId,
    /// The job and the scan set it comes from; `None` for an uploaded one.
    pub origin: Option<(JobId, ScanSetId)>,
    /// A name for people.
    pub name: String,
    /// Its class, if it has one.
    pub label: Option<String>,
    /// The unit of its coordinates.
    pub unit: Unit,
    /// Its points.
    pub points: u64,
    /// The verdict on its registration.
    pub quality: Option<String>,
    /// Its files.
    pub assets: Vec<AssetRecord>,
    /// What of an uploaded file was not taken (JSON); `None` if all of it was.
    pub reading: Option<String>,
    /// Its signature.
    pub signature: Option<StoredSignature>,
}

/// A stored model.
#[derive(Debug, Clone)]
pub struct ModelRecord {
    /// Its id.
    pub id: ModelId,
    /// The job it comes from; `None` for an uploaded one.
    pub job_id: Option<JobId>,
    /// The scan set it comes from; `None` for an uploaded one.
    pub scan_set_id: Option<ScanSetId>,
    /// A name for people.
    pub name: String,
    /// Its class, if it has one.
    pub label: Option<String>,
    /// The unit of its coordinates.
    pub unit: Unit,
    /// Its points.
    pub points: u64,
    /// The verdict on its registration.
    pub quality: Option<String>,
    /// What of an uploaded file was not taken (JSON); `None` if all of it was.
    pub reading: Option<String>,
    /// What the API shows of its signature.
    pub signature: Option<SignatureSummary>,
}

impl ModelRecord {
    /// Where it comes from.
    pub fn origin(&self) -> Origin {
        if self.job_id.is_some() { Origin::Registered } else { Origin::Uploaded }
    }
}

/// Which models a list shows.
#[derive(Debug, Clone, Default)]
pub struct ModelFilter {
    /// Only those of this class.
    pub label: Option<String>,
    /// Only those made from this scan set.
    pub scan_set_id: Option<ScanSetId>,
}

#[derive(FromRow)]
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

impl ModelRow {
    fn record(self) -> Result<ModelRecord, StoreError> {
        let summary = self.summary.map(|text| serde_json::from_str(&text)).transpose();
        Ok(ModelRecord {
            id: stored_id!(ModelId, &self.id)?,
            job_id: self.job_id.map(|text| stored_id!(JobId, &text)).transpose()?,
            scan_set_id: self.scan_set_id.map(|text| stored_id!(ScanSetId, &text)).transpose()?,
            name: self.name,
            label: self.label,
            unit: self.unit.parse().map_err(|reason: String| damaged("a unit", reason))?,
            points: to_u64(self.points),
            quality: self.quality,
            reading: self.reading,
            signature: summary.map_err(|error| damaged("a signature's summary", error))?,
        })
    }
}

impl Store {
    /// Stores an uploaded model and the answer that the client gets. The index has to follow before the answer is
    /// dropped.
    pub async fn create_model(&self, model: &NewModel, replay: Option<&Replay>) -> Result<Unseen, StoreError> {
        let mut tx = self.begin().await?;
        insert(&mut tx, model).await?;
        if let Some(replay) = replay {
            replays::insert(&mut tx, replay).await?;
        }
        tx.commit_unseen(self).await
    }

    /// Stores many uploaded models at once.
    pub async fn create_models(&self, models: &[NewModel]) -> Result<(), StoreError> {
        let mut tx = self.begin().await?;
        for model in models {
            insert(&mut tx, model).await?;
        }
        tx.commit().await
    }

    /// One model.
    pub async fn model(&self, id: ModelId) -> Result<ModelRecord, StoreError> {
        let row: Option<ModelRow> = sqlx::query_as(
            "SELECT model.*, signature.summary FROM model
             LEFT JOIN signature ON signature.model_id = model.id WHERE model.id = ?",
        )
        .bind(id.to_string())
        .fetch_optional(&self.readers)
        .await?;
        row.ok_or_else(|| not_found(id))?.record()
    }

    /// Models, newest first.
    pub async fn models(&self, filter: &ModelFilter, page: &PageRequest) -> Result<Page<ModelRecord>, StoreError> {
        let rows: Vec<ModelRow> = sqlx::query_as(
            "SELECT model.*, signature.summary FROM model
             LEFT JOIN signature ON signature.model_id = model.id
             WHERE (?1 IS NULL OR model.id < ?1)
               AND (?2 IS NULL OR model.label = ?2)
               AND (?3 IS NULL OR model.scan_set_id = ?3)
             ORDER BY model.id DESC LIMIT ?4",
        )
        .bind(page.before.as_deref())
        .bind(filter.label.as_deref())
        .bind(filter.scan_set_id.map(|id| id.to_string()))
        .bind(page.sql_limit())
        .fetch_all(&self.readers)
        .await?;
        let records = rows.into_iter().map(ModelRow::record).collect::<Result<Vec<_>, _>>()?;
        Ok(Page::cut(records, page.limit))
    }

    /// The files of a model, by name.
    pub async fn assets(&self, id: ModelId) -> Result<Vec<AssetRecord>, StoreError> {
        let rows: Vec<(String, i64, String)> =
            sqlx::query_as("SELECT name, bytes, checksum FROM asset WHERE model_id = ? ORDER BY name")
                .bind(id.to_string())
                .fetch_all(&self.readers)
                .await?;
        Ok(rows
            .into_iter()
            .map(|(name, bytes, checksum)| AssetRecord { name, bytes: to_u64(bytes), checksum })
            .collect())
    }

    /// Deletes a model with its files' records and its signature.
    pub async fn delete_model(&self, id: ModelId) -> Result<Deleted, StoreError> {
        let delete = || async {
            let mut tx = self.begin_any().await?;
            replays::delete_of(&mut tx, &id.to_string()).await?;
            let done = sqlx::query("DELETE FROM model WHERE id = ?").bind(id.to_string()).execute(&mut *tx).await?;
            if done.rows_affected() == 0 {
                return Err(not_found(id));
            }
            sweep::leave(&mut tx, StoredFile::Model(id)).await?;
            Ok(Deleted { models: vec![id], unseen: tx.commit_unseen(self).await? })
        };
        self.with_reserve(delete).await
    }
}

fn not_found(id: ModelId) -> StoreError {
    StoreError::NotFound { kind: "model", id: id.to_string() }
}

/// Stores a model with its files' records and its signature; part of a larger transaction.
pub(super) async fn insert(db: &mut SqliteConnection, model: &NewModel) -> Result<(), StoreError> {
    let id = model.id.to_string();
    sqlx::query(
        "INSERT INTO model (id, job_id, scan_set_id, name, label, unit, points, quality, reading)
         VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)",
    )
    .bind(&id)
    .bind(model.origin.map(|(job, _)| job.to_string()))
    .bind(model.origin.map(|(_, set)| set.to_string()))
    .bind(&model.name)
    .bind(&model.label)
    .bind(model.unit.name())
    .bind(to_i64(model.points))
    .bind(&model.quality)
    .bind(&model.reading)
    .execute(&mut *db)
    .await?;
    for asset in &model.assets {
        sqlx::query("INSERT INTO asset (model_id, name, bytes, checksum) VALUES (?, ?, ?, ?)")
            .bind(&id)
            .bind(&asset.name)
            .bind(to_i64(asset.bytes))
            .bind(&asset.checksum)
            .execute(&mut *db)
            .await?;
    }
    if let Some(signature) = &model.signature {
        signatures::insert(db, &id, signature).await?;
    }
    sweep::settle(db, StoredFile::Model(model.id)).await?;
    let is_to_be_judged: bool =
        sqlx::query_scalar("SELECT EXISTS (SELECT 1 FROM standard)").fetch_one(&mut *db).await?;
    if is_to_be_judged {
        evaluations::queue(db).await?;
    }
    Ok(())
}

/// The models made from a scan set.
pub(super) async fn ids_of_scan_set(db: &mut SqliteConnection, set: &str) -> Result<Vec<ModelId>, StoreError> {
    let ids: Vec<String> =
        sqlx::query_scalar("SELECT id FROM model WHERE scan_set_id = ?").bind(set).fetch_all(db).await?;
    ids.iter().map(|text| stored_id!(ModelId, text)).collect()
}

/// The model made by a job.
pub(super) async fn id_of_job(db: &mut SqliteConnection, job: &str) -> Result<Option<ModelId>, StoreError> {
    let id: Option<String> =
        sqlx::query_scalar("SELECT id FROM model WHERE job_id = ?").bind(job).fetch_optional(db).await?;
    id.map(|text| stored_id!(ModelId, &text)).transpose()
}

#[cfg(test)]
impl NewModel {
    /// A small model, of the given job or uploaded.
    pub(crate) fn test(origin: Option<(JobId, ScanSetId)>) -> NewModel {
        NewModel {
            id: ModelId::new(),
            origin,
            name: origin.map_or("uploaded", |_| "registered").to_owned(),
            label: Some("face".to_owned()),
            unit: Unit::Mm,
            points: 7,
            quality: None,
            assets: vec![AssetRecord { name: "report.json".to_owned(), bytes: 2, checksum: "00".to_owned() }],
            reading: None,
            signature: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{StoredContent, testing};
    use super::*;

    #[tokio::test]
    async fn a_model_goes_with_all_its_parts() {
        let (store, _folder) = testing::store().await;
        let summary = SignatureSummary { version: 1, regions: 2, triangles: 3, left_out: Default::default() };
        let signature = StoredSignature { version: 1, summary: summary.clone(), content: vec![1, 2, 3] };
        let model = NewModel { signature: Some(signature), ..NewModel::test(None) };
        drop(store.create_model(&model, None).await.expect("stored"));
        assert_eq!(store.model(model.id).await.expect("there").signature, Some(summary));
        assert_eq!(store.assets(model.id).await.expect("read"), model.assets);
        let whole = StoredContent::Whole(vec![1, 2, 3]);
        assert_eq!(store.signatures_after(None, 5).await.expect("read"), [(model.id, whole)]);
        assert!(store.signatures_after(Some(model.id), 5).await.expect("read").is_empty());
        drop(store.delete_model(model.id).await.expect("deleted"));
        assert!(store.assets(model.id).await.expect("read").is_empty());
        assert!(store.signatures_after(None, 5).await.expect("read").is_empty());
        assert!(matches!(store.delete_model(model.id).await, Err(StoreError::NotFound { kind: "model", .. })));
    }
}
