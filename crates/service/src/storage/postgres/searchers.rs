//! Who searches which part of the gallery, and what they show each other.

use std::time::Duration;

use async_trait::async_trait;

use super::PostgresDatabase;
use super::sql::to_u64;
use crate::storage::DatabaseError;
use crate::storage::database::Searchers;
use visage_domain::{NodeSecret, Parts, Searcher, SeatId};

#[async_trait]
impl Searchers for PostgresDatabase {
    async fn tell_searcher(&self, address: &str, parts: &Parts) -> Result<(), DatabaseError> {
        let mut tx = self.begin_rows().await?;
        sqlx::query(
            "INSERT INTO gallery_searcher (node_id, address, parts, seen_at) VALUES ($1, $2, $3, $4)
             ON CONFLICT (node_id) DO UPDATE SET address = excluded.address, parts = excluded.parts, seen_at = excluded.seen_at",
        )
        .bind(self.owner.seat.to_string())
        .bind(address)
        .bind(parts.to_string())
        .bind(tx.now_ms())
        .execute(&mut *tx)
        .await?;
        tx.commit().await
    }

    async fn searchers(&self, within: Duration) -> Result<Vec<Searcher>, DatabaseError> {
        let within = i64::try_from(within.as_millis()).unwrap_or(i64::MAX);
        let rows: Vec<(String, String, String, i64)> = sqlx::query_as(
            "SELECT node_id, address, parts, silent FROM
                 (SELECT node_id, address, parts,
                         CAST(extract(epoch FROM clock_timestamp()) * 1000 AS BIGINT) - seen_at AS silent FROM gallery_searcher) AS told
             WHERE silent <= $1 ORDER BY node_id",
        )
        .bind(within)
        .fetch_all(&self.readers)
        .await?;
        let damaged = |what: &'static str, reason: String| DatabaseError::Damaged { what, reason };
        let searcher = |(node, address, parts, silent): (String, String, String, i64)| {
            let node = SeatId::parse(&node).ok_or_else(|| damaged("an id", node.clone()))?;
            let parts = parts.parse().map_err(|error: visage_domain::NoParts| damaged("parts", error.to_string()))?;
            Ok(Searcher { node, address, parts, silent_ms: to_u64(silent) })
        };
        rows.into_iter().map(searcher).collect()
    }

    async fn node_secret(&self) -> Result<Option<NodeSecret>, DatabaseError> {
        let secret: Option<String> =
            sqlx::query_scalar("SELECT secret FROM gallery_secret").fetch_optional(&self.readers).await?;
        Ok(secret.map(NodeSecret))
    }
}
