//! The audit log: rows that are only ever added, until they are old.

use jiff::Timestamp;

use super::rows::row;
use super::{Store, damaged, sql_limit, stored_id, to_u64};
use crate::storage::DatabaseError;
use crate::storage::database::Audit;
use async_trait::async_trait;
use visage_domain::{AuditEntry, AuditFilter, AuditId, KeyId, Page, PageRequest};

row! {
    struct Row {
        id: String,
        key_id: Option<String>,
        client: Option<String>,
        request: String,
        method: String,
        route: String,
        target: Option<String>,
        status: i64,
    }
}

impl Row {
    fn entry(self) -> Result<AuditEntry, DatabaseError> {
        Ok(AuditEntry {
            id: stored_id!(AuditId, &self.id)?,
            key: self.key_id.map(|text| stored_id!(KeyId, &text)).transpose()?,
            client: self.client,
            request: self.request,
            method: self.method,
            route: self.route,
            target: self.target,
            status: u16::try_from(self.status).map_err(|error| damaged("a status", error))?,
        })
    }
}

#[async_trait]
impl Audit for Store {
    async fn record(&self, entry: &AuditEntry) -> Result<(), DatabaseError> {
        let insert = || async {
            let mut tx = self.begin_rows().await?;
            sqlx::query(
                "INSERT INTO audit (id, key_id, client, request, method, route, target, status)
                 VALUES ($1, $2, $3, $4, $5, $6, $7, $8)",
            )
            .bind(entry.id.to_string())
            .bind(entry.key.map(|key| key.to_string()))
            .bind(&entry.client)
            .bind(&entry.request)
            .bind(&entry.method)
            .bind(&entry.route)
            .bind(&entry.target)
            .bind(i64::from(entry.status))
            .execute(&mut *tx)
            .await?;
            if let Some(made) = entry.made() {
                sqlx::query(
                    "INSERT INTO made_by (id, key_id) VALUES ($1, $2)
                             ON CONFLICT (id) DO UPDATE SET key_id = excluded.key_id",
                )
                .bind(made)
                .bind(entry.key.map(|key| key.to_string()))
                .execute(&mut *tx)
                .await?;
            }
            tx.commit().await
        };
        self.with_reserve(insert).await
    }

    async fn jobs_waiting_of(&self, key: Option<KeyId>) -> Result<u64, DatabaseError> {
        let count: i64 = sqlx::query_scalar(
            "SELECT count(*) FROM job JOIN made_by ON made_by.id = job.id
             WHERE made_by.key_id IS NOT DISTINCT FROM $1 AND job.status IN ('queued', 'running')",
        )
        .bind(key.map(|key| key.to_string()))
        .fetch_one(&self.readers)
        .await?;
        Ok(to_u64(count))
    }

    async fn bytes_stored_of(&self, key: Option<KeyId>) -> Result<u64, DatabaseError> {
        // what is in the recycle bin counts until it is gone for good;
        // what a job has made counts for who ordered it, and the scans that came with a job for their set; what comes piece by
        // piece counts as a whole from its beginning
        let bytes: i64 = sqlx::query_scalar(
            "WITH mine AS (SELECT id FROM made_by WHERE key_id IS NOT DISTINCT FROM $1),
                  sets AS (SELECT id FROM mine UNION SELECT scan_set_id FROM job WHERE id IN (SELECT id FROM mine)
                           UNION SELECT scan_set_id FROM binned_job WHERE id IN (SELECT id FROM mine)),
                  models AS (SELECT id FROM model WHERE id IN (SELECT id FROM mine) OR job_id IN (SELECT id FROM mine)
                             UNION SELECT id FROM binned_model WHERE id IN (SELECT id FROM mine) OR job_id IN (SELECT id FROM mine))
             SELECT CAST((SELECT coalesce(sum(bytes), 0) FROM scan WHERE scan_set_id IN (SELECT id FROM sets))
                  + (SELECT coalesce(sum(bytes), 0) FROM asset WHERE model_id IN (SELECT id FROM models))
                  + (SELECT coalesce(sum(bytes), 0) FROM binned_scan WHERE scan_set_id IN (SELECT id FROM sets))
                  + (SELECT coalesce(sum(bytes), 0) FROM binned_asset WHERE model_id IN (SELECT id FROM models))
                  + (SELECT coalesce(sum(bytes), 0) FROM standard WHERE id IN (SELECT id FROM mine))
                  + (SELECT coalesce(sum(bytes), 0) FROM upload WHERE scan_set_id IN (SELECT id FROM sets) AND NOT is_done) AS BIGINT)",
        )
        .bind(key.map(|key| key.to_string()))
        .fetch_one(&self.readers)
        .await?;
        Ok(to_u64(bytes))
    }

    async fn audit(&self, filter: &AuditFilter, page: &PageRequest) -> Result<Page<AuditEntry>, DatabaseError> {
        let rows: Vec<Row> = sqlx::query_as(
            "SELECT * FROM audit
             WHERE ($1 IS NULL OR id < $1) AND ($2 IS NULL OR target = $2) AND ($3 IS NULL OR key_id = $3)
             ORDER BY id DESC LIMIT $4",
        )
        .bind(page.before.as_deref())
        .bind(filter.target.as_deref())
        .bind(filter.key.map(|key| key.to_string()))
        .bind(sql_limit(page))
        .fetch_all(&self.readers)
        .await?;
        let entries = rows.into_iter().map(Row::entry).collect::<Result<Vec<_>, _>>()?;
        Ok(Page::cut(entries, page.limit))
    }

    async fn forget_audit_before(&self, time: Timestamp) -> Result<u64, DatabaseError> {
        // ids begin with their time
        let oldest = AuditId::earliest_at(time);
        let mut tx = self.begin_any().await?;
        let done = sqlx::query("DELETE FROM audit WHERE id < $1").bind(oldest.to_string()).execute(&mut *tx).await?;
        // of what is gone nobody needs to know who made it
        sqlx::query(
            "DELETE FROM made_by WHERE id NOT IN (SELECT id FROM scan_set) AND id NOT IN (SELECT id FROM job)
             AND id NOT IN (SELECT id FROM model) AND id NOT IN (SELECT id FROM standard)
             AND id NOT IN (SELECT id FROM binned_scan_set) AND id NOT IN (SELECT id FROM binned_job)
             AND id NOT IN (SELECT id FROM binned_model)",
        )
        .execute(&mut *tx)
        .await?;
        tx.commit().await?;
        Ok(done.rows_affected())
    }
}
