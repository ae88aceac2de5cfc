//! Which files of the index count, and the models that they don't tell. Triggers of `signature` make models unfiled.

use std::collections::HashSet;
use std::time::Duration;

use async_trait::async_trait;
use sqlx::AssertSqlSafe;

use super::rows::row;
use super::signatures::checked;
use super::{Store, damaged, stored_id, stored_name, to_i64, to_u64};
use crate::storage::DatabaseError;
use crate::storage::database::Segments;
use visage_domain::asset::Origin;
use visage_domain::{ModelFacets, ModelId, Parts, SegmentId, SegmentRecord, Unfiled};

/// A node that was not seen for so long has its index made anew if it comes back.
const GONE: Duration = Duration::from_secs(7 * 24 * 3600);
/// How old a note that a node was seen may be.
const SEEN: Duration = Duration::from_secs(24 * 3600);
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
    pub(in super::super) struct Row {
        id: String,
        label: Option<String>,
        unit: Option<String>,
        uploaded: bool,
        content: Option<Vec<u8>>,
        checksum: Option<String>,
    }
}

impl Row {
    pub(in super::super) fn unfiled(self) -> Result<Unfiled, DatabaseError> {
        let id = stored_id!(ModelId, &self.id)?;
        let (Some(content), Some(unit)) = (self.content, self.unit) else { return Ok(Unfiled { id, signature: None }) };
        let unit = stored_name("a unit", &unit)?;
        let origin = if self.uploaded { Origin::Uploaded } else { Origin::Registered };
        let facets = ModelFacets { label: self.label, unit, origin };
        Ok(Unfiled { id, signature: Some((checked(content, self.checksum.as_deref()), facets)) })
    }
}

/// As SQLite reads a list.
fn json<T: serde::Serialize>(list: impl Iterator<Item = T>) -> Result<String, DatabaseError> {
    serde_json::to_string(&list.collect::<Vec<T>>()).map_err(|error| damaged("ids", error))
}

/// Parts as the ends of the ids of their models.
fn part_names(parts: &Parts) -> Result<String, DatabaseError> {
    json(parts.iter().map(|part| format!("{part:02x}")))
}

#[async_trait]
impl Segments for Store {
    async fn keep_index(&self) -> Result<(), DatabaseError> {
        let seat = self.owner.seat.to_string();
        let seen: Option<i64> = sqlx::query_scalar("SELECT seen_at FROM node WHERE id = $1")
            .bind(&seat)
            .fetch_optional(&self.readers)
            .await?;
        let before = |now_ms: i64, age: Duration| now_ms.saturating_sub(to_i64(age.as_secs()).saturating_mul(1000));
        // nothing is written that need not be: a disk may be full
        if seen.is_some_and(|seen| seen >= before(jiff::Timestamp::now().as_millisecond(), SEEN)) {
            return Ok(());
        }
        let mut tx = self.begin_any().await?;
        let known = sqlx::query("UPDATE node SET seen_at = $1 WHERE id = $2").bind(tx.now_ms()).bind(&seat);
        if known.execute(&mut *tx).await?.rows_affected() == 0 {
            sqlx::query("INSERT INTO node (id, seen_at) VALUES ($1, $2)")
                .bind(&seat)
                .bind(tx.now_ms())
                .execute(&mut *tx)
                .await?;
            sqlx::query("INSERT INTO unfiled (node_id, model_id) SELECT $1, model_id FROM signature")
                .bind(&seat)
                .execute(&mut *tx)
                .await?;
        }
        let oldest = before(tx.now_ms(), GONE);
        let gone = sqlx::query("DELETE FROM node WHERE seen_at < $1").bind(oldest).execute(&mut *tx).await?;
        if gone.rows_affected() > 0 {
            tracing::info!(nodes = gone.rows_affected(), "forgot nodes that were not seen for a week");
        }
        tx.commit().await
    }

    async fn segments(&self) -> Result<Vec<SegmentRecord>, DatabaseError> {
        let rows: Vec<Segment> =
            sqlx::query_as("SELECT id, models, bytes, checksum FROM segment WHERE node_id = $1 ORDER BY id")
                .bind(self.owner.seat.to_string())
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

    async fn unfiled_after(
        &self,
        parts: &Parts,
        after: Option<ModelId>,
        limit: usize,
    ) -> Result<Vec<Unfiled>, DatabaseError> {
        // most indexes are of all parts: then nothing is looked at
        let parts = (*parts != Parts::ALL).then(|| part_names(parts)).transpose()?;
        let rows: Vec<Row> = sqlx::query_as(
            "SELECT unfiled.model_id AS id, label, unit, job_id IS NULL AS uploaded, content, checksum FROM unfiled
             LEFT JOIN model ON model.id = unfiled.model_id
             LEFT JOIN signature ON signature.model_id = unfiled.model_id
             WHERE unfiled.node_id = $3 AND unfiled.model_id > $1
                 AND ($4 IS NULL OR substr(unfiled.model_id, 35, 2) IN (SELECT value FROM json_each($4)))
             ORDER BY unfiled.model_id LIMIT $2",
        )
        .bind(after.map_or(String::new(), |id| id.to_string()))
        .bind(to_i64(limit as u64))
        .bind(self.owner.seat.to_string())
        .bind(parts)
        .fetch_all(&self.readers)
        .await?;
        rows.into_iter().map(Row::unfiled).collect()
    }

    async fn unfile_parts(&self, parts: &Parts) -> Result<(), DatabaseError> {
        // it goes over all signatures, and nobody needs to wait for that: what comes meanwhile is unfiled by itself
        let mut tx = self.begin_rows().await?;
        sqlx::query(
            "INSERT INTO unfiled (node_id, model_id) SELECT $1, model_id FROM signature
             WHERE substr(model_id, 35, 2) IN (SELECT value FROM json_each($2)) ON CONFLICT DO NOTHING",
        )
        .bind(self.owner.seat.to_string())
        .bind(part_names(parts)?)
        .execute(&mut *tx)
        .await?;
        tx.commit().await
    }

    async fn swap_segments(&self, new: &[SegmentRecord], old: &[SegmentId]) -> Result<(), DatabaseError> {
        let mut tx = self.begin_any().await?;
        for segment in new {
            sqlx::query("INSERT INTO segment (id, models, bytes, checksum, node_id) VALUES ($1, $2, $3, $4, $5)")
                .bind(segment.id.to_string())
                .bind(to_i64(segment.models))
                .bind(to_i64(segment.bytes))
                .bind(i64::from(segment.checksum))
                .bind(self.owner.seat.to_string())
                .execute(&mut *tx)
                .await?;
        }
        sqlx::query("DELETE FROM segment WHERE node_id = $2 AND id IN (SELECT value FROM json_each($1))")
            .bind(json(old.iter().map(SegmentId::to_string))?)
            .bind(self.owner.seat.to_string())
            .execute(&mut *tx)
            .await?;
        tx.commit().await
    }

    async fn file_models(&self, models: &[(ModelId, u128)]) -> Result<(), DatabaseError> {
        for chunk in models.chunks(AT_ONCE) {
            let mut tx = self.begin_any().await?;
            // in two steps, of which each has a plan that can't go wrong however little is known of the tables
            let stored: Vec<(String, Option<String>)> = sqlx::query_as(
                "SELECT model_id, substr(checksum, 1, 32) FROM signature WHERE model_id IN (SELECT value FROM json_each($1))",
            )
            .bind(json(chunk.iter().map(|(id, _)| id.to_string()))?)
            .fetch_all(&mut *tx)
            .await?;
            let known: HashSet<(String, String)> =
                chunk.iter().map(|(id, checksum)| (id.to_string(), format!("{checksum:032x}"))).collect();
            let filed = stored.into_iter().filter_map(|(id, checksum)| {
                let row = (id, checksum?);
                known.contains(&row).then_some(row.0)
            });
            sqlx::query("DELETE FROM unfiled WHERE node_id = $2 AND model_id IN (SELECT value FROM json_each($1))")
                .bind(json(filed)?)
                .bind(self.owner.seat.to_string())
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
                "DELETE FROM unfiled WHERE node_id = $2 AND model_id IN (SELECT value FROM json_each($1))
                 AND NOT EXISTS (SELECT 1 FROM signature WHERE signature.model_id = unfiled.model_id)",
            )
            .bind(json(chunk.iter().map(ModelId::to_string))?)
            .bind(self.owner.seat.to_string())
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
            sqlx::query("INSERT INTO unfiled (node_id, model_id) SELECT $2, value FROM json_each($1) WHERE TRUE ON CONFLICT DO NOTHING")
                .bind(json(chunk.iter().map(ModelId::to_string))?)
                .bind(self.owner.seat.to_string())
                .execute(&mut *tx)
                .await?;
        }
        sqlx::query("DELETE FROM segment WHERE node_id = $2 AND id IN (SELECT value FROM json_each($1))")
            .bind(json(lost.iter().map(SegmentId::to_string))?)
            .bind(self.owner.seat.to_string())
            .execute(&mut *tx)
            .await?;
        tx.commit().await
    }
}

/// A copy goes without the files of the index.
impl Store {
    /// Makes no file count, of no node: whoever uses the copy next has everything unfiled.
    pub async fn forget_all_segments(&self) -> Result<(), DatabaseError> {
        let mut tx = self.begin_any().await?;
        for table in ["segment", "unfiled", "node"] {
            sqlx::query(AssertSqlSafe(format!("DELETE FROM {table}"))).execute(&mut *tx).await?;
        }
        tx.commit().await
    }
}
