//! Scan sets: their scans and their pose file.

use super::rows::row;
use super::{
    Connection, Pool, Store, damaged, files, models, recycle_bin, replays, sql_limit, stored_id, stored_name,
    timestamp, to_i64, to_u64,
};
use crate::storage::database::ScanSets;
use crate::storage::{DatabaseError, Deleted, Purged};
use async_trait::async_trait;
use visage_domain::{
    FileId, NewScanSet, Page, PageRequest, PoseFile, PutScan, Replay, ScanRecord, ScanSetId, ScanSetRecord, StoredFile,
    sort_naturally,
};

row! {
    struct SetRow {
        id: String,
        name: String,
        unit: String,
        poses_name: Option<String>,
        poses: Option<Vec<u8>>,
        passed_over: Option<String>,
    }
}

row! {
    struct ScanRow {
        name: String,
        file_id: String,
        points: i64,
        bytes: i64,
        checksum: String,
        reading: Option<String>,
    }
}

row! {
    struct BinnedRow {
        scan_set_id: String,
        name: String,
        file_id: String,
        points: i64,
        bytes: i64,
        checksum: String,
        reading: Option<String>,
    }
}

impl SetRow {
    fn record(self, scans: Vec<ScanRow>) -> Result<ScanSetRecord, DatabaseError> {
        let mut scans = scans.into_iter().map(ScanRow::record).collect::<Result<Vec<_>, _>>()?;
        sort_naturally(&mut scans);
        Ok(ScanSetRecord {
            id: stored_id!(ScanSetId, &self.id)?,
            name: self.name,
            unit: stored_name("a unit", &self.unit)?,
            scans,
            poses: self.poses_name.zip(self.poses).map(|(name, content)| PoseFile { name, content }),
            passed_over: match self.passed_over {
                Some(text) => {
                    serde_json::from_str(&text).map_err(|e| damaged("what was passed over", e.to_string()))?
                }
                None => Vec::new(),
            },
        })
    }
}

impl ScanRow {
    fn record(self) -> Result<ScanRecord, DatabaseError> {
        Ok(ScanRecord {
            file_id: stored_id!(FileId, &self.file_id)?,
            name: self.name,
            points: to_u64(self.points),
            bytes: to_u64(self.bytes),
            checksum: self.checksum,
            reading: self.reading,
        })
    }
}

#[async_trait]
impl ScanSets for Store {
    async fn create_scan_set(&self, set: &NewScanSet, replay: Option<&Replay>) -> Result<(), DatabaseError> {
        let mut tx = self.begin().await?;
        insert_set(&mut tx, set).await?;
        if let Some(replay) = replay {
            replays::insert(&mut tx, replay).await?;
        }
        tx.commit().await?;
        Ok(())
    }

    async fn scan_set(&self, id: ScanSetId) -> Result<ScanSetRecord, DatabaseError> {
        // one snapshot for both statements: a scan set never shows half of a change
        let mut tx = self.snapshot().await?;
        let row: Option<SetRow> = sqlx::query_as("SELECT * FROM scan_set WHERE id = $1")
            .bind(id.to_string())
            .fetch_optional(&mut *tx)
            .await?;
        let row = row.ok_or_else(|| not_found(id))?;
        let scans = scan_rows(&mut tx, &row.id).await?;
        row.record(scans)
    }

    async fn scan_sets(&self, page: &PageRequest) -> Result<Page<ScanSetRecord>, DatabaseError> {
        let mut tx = self.snapshot().await?;
        let rows: Vec<SetRow> =
            sqlx::query_as("SELECT * FROM scan_set WHERE $1 IS NULL OR id < $1 ORDER BY id DESC LIMIT $2")
                .bind(page.before.as_deref())
                .bind(sql_limit(page))
                .fetch_all(&mut *tx)
                .await?;
        let mut records = Vec::with_capacity(rows.len());
        for row in rows {
            let scans = scan_rows(&mut tx, &row.id).await?;
            records.push(row.record(scans)?);
        }
        Ok(Page::cut(records, page.limit))
    }

    async fn put_scan(&self, set: ScanSetId, scan: &ScanRecord, limit: usize) -> Result<PutScan, DatabaseError> {
        let mut tx = self.begin().await?;
        check_free(&mut tx, set).await?;
        let old = file_of(&mut tx, set, &scan.name).await?;
        if old.is_none() {
            let count: i64 = sqlx::query_scalar("SELECT count(*) FROM scan WHERE scan_set_id = $1")
                .bind(set.to_string())
                .fetch_one(&mut *tx)
                .await?;
            if to_u64(count) >= limit as u64 {
                return Err(DatabaseError::TooManyScans { limit });
            }
        }
        delete_scan_row(&mut tx, set, &scan.name).await?;
        insert_scan(&mut tx, set, scan).await?;
        if let Some(old) = old {
            files::leave(&mut tx, StoredFile::Scan(set, old)).await?;
        }
        tx.commit().await?;
        Ok(old.map_or(PutScan::Created, PutScan::Replaced))
    }

    async fn delete_scan(&self, set: ScanSetId, name: &str) -> Result<FileId, DatabaseError> {
        self.with_reserve(|| self.delete_scan_once(set, name)).await
    }

    async fn put_poses(&self, set: ScanSetId, poses: &PoseFile) -> Result<(), DatabaseError> {
        let mut tx = self.begin().await?;
        check_free(&mut tx, set).await?;
        sqlx::query("UPDATE scan_set SET poses_name = $1, poses = $2 WHERE id = $3")
            .bind(&poses.name)
            .bind(&poses.content)
            .bind(set.to_string())
            .execute(&mut *tx)
            .await?;
        tx.commit().await?;
        Ok(())
    }

    async fn expiry(&self, id: ScanSetId) -> Result<Option<jiff::Timestamp>, DatabaseError> {
        let found: Option<(Option<i64>,)> = sqlx::query_as(
            "SELECT expiry.at FROM scan_set LEFT JOIN expiry ON expiry.scan_set_id = scan_set.id WHERE scan_set.id = $1",
        )
        .bind(id.to_string())
        .fetch_optional(&self.readers)
        .await?;
        let (at,) = found.ok_or_else(|| not_found(id))?;
        at.map(timestamp).transpose()
    }

    async fn set_expiry(&self, id: ScanSetId, at: Option<jiff::Timestamp>) -> Result<(), DatabaseError> {
        let mut tx = self.begin().await?;
        let is_there: bool = sqlx::query_scalar("SELECT EXISTS (SELECT 1 FROM scan_set WHERE id = $1)")
            .bind(id.to_string())
            .fetch_one(&mut *tx)
            .await?;
        if !is_there {
            return Err(not_found(id));
        }
        sqlx::query("DELETE FROM expiry WHERE scan_set_id = $1").bind(id.to_string()).execute(&mut *tx).await?;
        if let Some(at) = at {
            sqlx::query("INSERT INTO expiry (scan_set_id, at) VALUES ($1, $2)")
                .bind(id.to_string())
                .bind(at.as_millisecond())
                .execute(&mut *tx)
                .await?;
        }
        tx.commit().await
    }

    async fn expired_scan_sets(
        &self,
        now: jiff::Timestamp,
        after: Option<ScanSetId>,
        limit: usize,
    ) -> Result<Vec<ScanSetId>, DatabaseError> {
        let ids: Vec<String> = sqlx::query_scalar(
            "SELECT scan_set_id FROM expiry WHERE at <= $1 AND ($2 IS NULL OR scan_set_id > $2)
             ORDER BY scan_set_id LIMIT $3",
        )
        .bind(now.as_millisecond())
        .bind(after.map(|id| id.to_string()))
        .bind(to_i64(limit as u64))
        .fetch_all(&self.readers)
        .await?;
        ids.iter().map(|text| stored_id!(ScanSetId, text)).collect()
    }

    async fn delete_scan_set(&self, id: ScanSetId) -> Result<Deleted, DatabaseError> {
        self.with_reserve(|| self.delete_set_once(id)).await
    }
}

impl Store {
    async fn delete_scan_once(&self, set: ScanSetId, name: &str) -> Result<FileId, DatabaseError> {
        let mut tx = self.begin_any().await?;
        check_free(&mut tx, set).await?;
        let file = file_of(&mut tx, set, name)
            .await?
            .ok_or_else(|| DatabaseError::NotFound { kind: "scan", id: name.to_owned() })?;
        delete_scan_row(&mut tx, set, name).await?;
        files::leave(&mut tx, StoredFile::Scan(set, file)).await?;
        tx.commit().await?;
        Ok(file)
    }

    async fn delete_set_once(&self, id: ScanSetId) -> Result<Deleted, DatabaseError> {
        let mut tx = self.begin_any().await?;
        check_free(&mut tx, id).await?;
        let text = id.to_string();
        let models = models::ids_of_scan_set(&mut tx, &text).await?;
        let jobs: Vec<String> =
            sqlx::query_scalar("SELECT id FROM job WHERE scan_set_id = $1").bind(&text).fetch_all(&mut *tx).await?;
        for resource in jobs.into_iter().chain([text.clone()]) {
            replays::delete_of(&mut tx, &resource).await?;
        }
        // jobs, models, assets and signatures go by foreign keys
        sqlx::query("DELETE FROM scan_set WHERE id = $1").bind(&text).execute(&mut *tx).await?;
        files::leave(&mut tx, StoredFile::ScanSet(id)).await?;
        models::leave(&mut tx, &models).await?;
        let mut purged = Purged::default();
        recycle_bin::purge_made_of(&mut tx, &text, &mut purged).await?;
        Ok(Deleted { models, purged, unseen: tx.commit_unseen(self).await? })
    }
}

fn not_found(id: ScanSetId) -> DatabaseError {
    DatabaseError::NotFound { kind: "scan set", id: id.to_string() }
}

/// Stores a scan set and its scans; part of a larger transaction.
pub(super) async fn insert_set(db: &mut Connection, set: &NewScanSet) -> Result<(), DatabaseError> {
    let passed_over = match set.passed_over.as_slice() {
        [] => None,
        files => serde_json::to_string(files).ok(),
    };
    sqlx::query(
        "INSERT INTO scan_set (id, name, unit, poses_name, poses, passed_over) VALUES ($1, $2, $3, $4, $5, $6)",
    )
    .bind(set.id.to_string())
    .bind(&set.name)
    .bind(set.unit.name())
    .bind(set.poses.as_ref().map(|poses| &poses.name))
    .bind(set.poses.as_ref().map(|poses| &poses.content))
    .bind(passed_over)
    .execute(&mut *db)
    .await?;
    for scan in &set.scans {
        insert_scan(db, set.id, scan).await?;
    }
    Ok(())
}

async fn insert_scan(db: &mut Connection, set: ScanSetId, scan: &ScanRecord) -> Result<(), DatabaseError> {
    let columns = "INSERT INTO scan (scan_set_id, name, file_id, points, bytes, checksum, reading)
                   VALUES ($1, $2, $3, $4, $5, $6, $7)";
    sqlx::query(columns)
        .bind(set.to_string())
        .bind(&scan.name)
        .bind(scan.file_id.to_string())
        .bind(to_i64(scan.points))
        .bind(to_i64(scan.bytes))
        .bind(&scan.checksum)
        .bind(&scan.reading)
        .execute(&mut *db)
        .await?;
    files::settle(db, StoredFile::Scan(set, scan.file_id)).await
}

async fn delete_scan_row(db: &mut Connection, set: ScanSetId, name: &str) -> Result<(), DatabaseError> {
    sqlx::query("DELETE FROM scan WHERE scan_set_id = $1 AND name = $2")
        .bind(set.to_string())
        .bind(name)
        .execute(db)
        .await?;
    Ok(())
}

async fn scan_rows(db: &mut Connection, set: &str) -> Result<Vec<ScanRow>, DatabaseError> {
    let rows =
        sqlx::query_as("SELECT name, file_id, points, bytes, checksum, reading FROM scan WHERE scan_set_id = $1")
            .bind(set)
            .fetch_all(db)
            .await?;
    Ok(rows)
}

/// The scans in the recycle bin.
pub(super) async fn binned_scans(readers: &Pool) -> Result<Vec<(ScanSetId, ScanRecord)>, DatabaseError> {
    let rows: Vec<BinnedRow> = sqlx::query_as("SELECT * FROM binned_scan").fetch_all(readers).await?;
    let scan = |row: BinnedRow| {
        let BinnedRow { scan_set_id, name, file_id, points, bytes, checksum, reading } = row;
        Ok((
            stored_id!(ScanSetId, &scan_set_id)?,
            ScanRow { name, file_id, points, bytes, checksum, reading }.record()?,
        ))
    };
    rows.into_iter().map(scan).collect()
}

async fn file_of(db: &mut Connection, set: ScanSetId, name: &str) -> Result<Option<FileId>, DatabaseError> {
    let file: Option<String> = sqlx::query_scalar("SELECT file_id FROM scan WHERE scan_set_id = $1 AND name = $2")
        .bind(set.to_string())
        .bind(name)
        .fetch_optional(db)
        .await?;
    file.map(|text| stored_id!(FileId, &text)).transpose()
}

/// The set is there and no unfinished job uses it: a job must see the same scans however often it is run.
pub(super) async fn check_free(db: &mut Connection, id: ScanSetId) -> Result<(), DatabaseError> {
    let in_use: Option<bool> = sqlx::query_scalar(
        "SELECT EXISTS (SELECT 1 FROM job WHERE scan_set_id = scan_set.id AND status IN ('queued', 'running'))
         FROM scan_set WHERE id = $1",
    )
    .bind(id.to_string())
    .fetch_optional(db)
    .await?;
    match in_use {
        None => Err(not_found(id)),
        Some(true) => Err(DatabaseError::InUse { kind: "scan set", id: id.to_string() }),
        Some(false) => Ok(()),
    }
}
