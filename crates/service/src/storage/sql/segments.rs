//! Which files of the index count, and the models that they don't tell. Triggers of `signature` make models unfiled.

use async_trait::async_trait;

use super::rows::row;
use super::signatures::checked;
use super::{Store, damaged, stored_id, to_i64, to_u64};
use crate::storage::DatabaseError;
use crate::storage::database::Segments;
use visage_domain::asset::Origin;
use visage_domain::{ModelFacets, ModelId, SegmentId, SegmentRecord, Unfiled};

/// Models in one statement.
const AT_ONCE: usize = 4096;

row! {
    struct Segment {
        id: String,
        models: i64,
        bytes: i64,
        checksum: i64,
    }
}

row! {
    struct Row {
        id: String,
        label: Option<String>,
        unit: Option<String>,
        uploaded: bool,
        content: Option<Vec<u8>>,
        checksum: Option<String>,
    }
}

impl Row {
    fn unfiled(self) -> Result<Unfiled, DatabaseError> {
        let id = stored_id!(ModelId, &self.id)?;
        let (Some(content), Some(unit)) = (self.content, self.unit) else { return Ok(Unfiled { id, signature: None }) };
        let unit = unit.parse().map_err(|reason: String| damaged("a unit", reason))?;
        let origin = if self.uploaded { Origin::Uploaded } else { Origin::Registered };
        let facets = ModelFacets { label: self.label, unit, origin };
        Ok(Unfiled { id, signature: Some((checked(content, self.checksum.as_deref()), facets)) })
    }
}

/// As SQLite reads a list.
fn json<T: serde::Serialize>(list: impl Iterator<Item = T>) -> Result<String, DatabaseError> {
    serde_json::to_string(&list.collect::<Vec<T>>()).map_err(|error| damaged("ids", error))
}

#[async_trait]
impl Segments for Store {
    async fn segments(&self) -> Result<Vec<SegmentRecord>, DatabaseError> {
        let rows: Vec<Segment> = sqlx::query_as("SELECT id, models, bytes, checksum FROM segment ORDER BY id")
            .fetch_all(&self.readers)
            .await?;
        let record = |row: Segment| {
            Ok(SegmentRecord {
                id: stored_id!(SegmentId, &row.id)?,
                models: to_u64(row.models),
                bytes: to_u64(row.bytes),
                checksum: u32::try_from(row.checksum).map_err(|error| damaged("a checksum", error))?,
            })
        };
        rows.into_iter().map(record).collect()
    }

    async fn unfiled_after(&self, after: Option<ModelId>, limit: usize) -> Result<Vec<Unfiled>, DatabaseError> {
        let rows: Vec<Row> = sqlx::query_as(
            "SELECT unfiled.model_id AS id, label, unit, job_id IS NULL AS uploaded, content, checksum FROM unfiled
             LEFT JOIN model ON model.id = unfiled.model_id
             LEFT JOIN signature ON signature.model_id = unfiled.model_id
             WHERE unfiled.model_id > $1 ORDER BY unfiled.model_id LIMIT $2",
        )
        .bind(after.map_or(String::new(), |id| id.to_string()))
        .bind(to_i64(limit as u64))
        .fetch_all(&self.readers)
        .await?;
        rows.into_iter().map(Row::unfiled).collect()
    }

    async fn swap_segments(&self, new: &[SegmentRecord], old: &[SegmentId]) -> Result<(), DatabaseError> {
        let mut tx = self.begin_any().await?;
        for segment in new {
            sqlx::query("INSERT INTO segment (id, models, bytes, checksum) VALUES ($1, $2, $3, $4)")
                .bind(segment.id.to_string())
                .bind(to_i64(segment.models))
                .bind(to_i64(segment.bytes))
                .bind(i64::from(segment.checksum))
                .execute(&mut *tx)
                .await?;
        }
        sqlx::query("DELETE FROM segment WHERE id IN (SELECT value FROM json_each($1))")
            .bind(json(old.iter().map(SegmentId::to_string))?)
            .execute(&mut *tx)
            .await?;
        tx.commit().await
    }

    async fn file_models(&self, models: &[(ModelId, u128)]) -> Result<(), DatabaseError> {
        for chunk in models.chunks(AT_ONCE) {
            let known = json(chunk.iter().map(|(id, checksum)| format!("{id}{checksum:032x}")))?;
            let mut tx = self.begin_any().await?;
            sqlx::query(
                "DELETE FROM unfiled WHERE model_id IN (
                     SELECT signature.model_id FROM json_each($1) AS known
                     JOIN signature ON signature.model_id = substr(known.value, 1, 36)
                     WHERE substr(signature.checksum, 1, 32) = substr(known.value, 37))",
            )
            .bind(known)
            .execute(&mut *tx)
            .await?;
            tx.commit().await?;
        }
        Ok(())
    }

    async fn forget_unfiled(&self, models: &[ModelId]) -> Result<(), DatabaseError> {
        for chunk in models.chunks(AT_ONCE) {
            let mut tx = self.begin_any().await?;
            sqlx::query(
                "DELETE FROM unfiled WHERE model_id IN (SELECT value FROM json_each($1))
                 AND NOT EXISTS (SELECT 1 FROM signature WHERE signature.model_id = unfiled.model_id)",
            )
            .bind(json(chunk.iter().map(ModelId::to_string))?)
            .execute(&mut *tx)
            .await?;
            tx.commit().await?;
        }
        Ok(())
    }

    async fn lose_segments(&self, lost: &[SegmentId], told: &[ModelId]) -> Result<(), DatabaseError> {
        let mut tx = self.begin_any().await?;
        let signed: Vec<String> =
            sqlx::query_scalar("SELECT model_id FROM signature ORDER BY model_id").fetch_all(&mut *tx).await?;
        let signed: Vec<ModelId> = signed.iter().map(|id| stored_id!(ModelId, id)).collect::<Result<_, _>>()?;
        let missing: Vec<ModelId> = signed.into_iter().filter(|id| told.binary_search(id).is_err()).collect();
        for chunk in missing.chunks(AT_ONCE) {
            sqlx::query("INSERT INTO unfiled SELECT value FROM json_each($1) WHERE TRUE ON CONFLICT DO NOTHING")
                .bind(json(chunk.iter().map(ModelId::to_string))?)
                .execute(&mut *tx)
                .await?;
        }
        sqlx::query("DELETE FROM segment WHERE id IN (SELECT value FROM json_each($1))")
            .bind(json(lost.iter().map(SegmentId::to_string))?)
            .execute(&mut *tx)
            .await?;
        tx.commit().await
    }
}

/// A copy goes without the files of the index.
impl Store {
    /// Makes all models unfiled, and no file count.
    pub async fn forget_all_segments(&self) -> Result<(), DatabaseError> {
        let lost: Vec<SegmentId> = self.segments().await?.into_iter().map(|segment| segment.id).collect();
        self.lose_segments(&lost, &[]).await
    }
}
