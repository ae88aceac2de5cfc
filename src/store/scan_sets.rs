//! Scan sets: their scans and their pose file.

use sqlx::{FromRow, SqliteConnection};

use super::{
    Deleted, FileId, Page, PageRequest, Replay, ScanSetId, Store, StoreError, StoredFile, damaged, models, replays,
    stored_id, sweep, to_i64, to_u64,
};
use crate::geometry::Unit;

/// One scan as the store knows it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ScanRecord {
    /// The user's file name; unique in its set.
    pub name: String,
    /// The file on disk.
    pub file_id: FileId,
    /// Points in the file.
    pub points: u64,
    /// Size of the file.
    pub bytes: u64,
    /// BLAKE3 of the file, hexadecimal.
    pub checksum: String,
    /// What of the file was not taken (JSON); `None` if all of it was.
    pub reading: Option<String>,
}

/// A pose file as it was sent.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PoseFile {
    /// Its name: only for messages and for telling the format.
    pub name: String,
    /// Its bytes.
    pub content: Vec<u8>,
}

/// A scan set that is to be stored.
#[derive(Debug, Clone)]
pub struct NewScanSet {
    /// Its id.
    pub id: ScanSetId,
    /// A name for people.
    pub name: String,
    /// The unit of all its scans.
    pub unit: Unit,
    /// Its scans.
    pub scans: Vec<ScanRecord>,
    /// Its initial poses.
    pub poses: Option<PoseFile>,
}

/// A stored scan set.
#[derive(Debug, Clone)]
pub struct ScanSetRecord {
    /// Its id.
    pub id: ScanSetId,
    /// A name for people.
    pub name: String,
    /// The unit of all its scans.
    pub unit: Unit,
    /// Its scans, in natural order of their names (`scan2` before `scan10`).
    pub scans: Vec<ScanRecord>,
    /// Its initial poses.
    pub poses: Option<PoseFile>,
}

/// What storing one scan did.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PutScan {
    /// There was none of that name.
    Created,
    /// There was one: its file is no longer used.
    Replaced(FileId),
}

#[derive(FromRow)]
struct SetRow {
    id: String,
    name: String,
    unit: String,
    poses_name: Option<String>,
    poses: Option<Vec<u8>>,
}

#[derive(FromRow)]
struct ScanRow {
    name: String,
    file_id: String,
    points: i64,
    bytes: i64,
    checksum: String,
    reading: Option<String>,
}

impl SetRow {
    fn record(self, scans: Vec<ScanRow>) -> Result<ScanSetRecord, StoreError> {
        let mut scans = scans.into_iter().map(ScanRow::record).collect::<Result<Vec<_>, _>>()?;
        sort_naturally(&mut scans);
        Ok(ScanSetRecord {
            id: stored_id!(ScanSetId, &self.id)?,
            name: self.name,
            unit: self.unit.parse().map_err(|reason: String| damaged("a unit", reason))?,
            scans,
            poses: self.poses_name.zip(self.poses).map(|(name, content)| PoseFile { name, content }),
        })
    }
}

impl ScanRow {
    fn record(self) -> Result<ScanRecord, StoreError> {
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

impl Store {
    /// Stores a scan set, its scans and the answer that the client gets.
    pub async fn create_scan_set(&self, set: &NewScanSet, replay: Option<&Replay>) -> Result<(), StoreError> {
        let mut tx = self.begin().await?;
        insert_set(&mut tx, set).await?;
        if let Some(replay) = replay {
            replays::insert(&mut tx, replay).await?;
        }
        tx.commit().await?;
        Ok(())
    }

    /// One scan set with its scans.
    pub async fn scan_set(&self, id: ScanSetId) -> Result<ScanSetRecord, StoreError> {
        // one snapshot for both statements: a scan set never shows half of a change
        let mut tx = self.readers.begin().await?;
        let row: Option<SetRow> =
            sqlx::query_as("SELECT * FROM scan_set WHERE id = ?").bind(id.to_string()).fetch_optional(&mut *tx).await?;
        let row = row.ok_or_else(|| not_found(id))?;
        let scans = scan_rows(&mut tx, &row.id).await?;
        row.record(scans)
    }

    /// Scan sets, newest first.
    pub async fn scan_sets(&self, page: &PageRequest) -> Result<Page<ScanSetRecord>, StoreError> {
        let mut tx = self.readers.begin().await?;
        let rows: Vec<SetRow> =
            sqlx::query_as("SELECT * FROM scan_set WHERE ?1 IS NULL OR id < ?1 ORDER BY id DESC LIMIT ?2")
                .bind(page.before.as_deref())
                .bind(page.sql_limit())
                .fetch_all(&mut *tx)
                .await?;
        let mut records = Vec::with_capacity(rows.len());
        for row in rows {
            let scans = scan_rows(&mut tx, &row.id).await?;
            records.push(row.record(scans)?);
        }
        Ok(Page::cut(records, page.limit))
    }

    /// Adds a scan to a set, or replaces the one of the same name. Refused while a job uses the set.
    pub async fn put_scan(&self, set: ScanSetId, scan: &ScanRecord, limit: usize) -> Result<PutScan, StoreError> {
        let mut tx = self.begin().await?;
        check_free(&mut tx, set).await?;
        let old = file_of(&mut tx, set, &scan.name).await?;
        if old.is_none() {
            let count: i64 = sqlx::query_scalar("SELECT count(*) FROM scan WHERE scan_set_id = ?")
                .bind(set.to_string())
                .fetch_one(&mut *tx)
                .await?;
            if to_u64(count) >= limit as u64 {
                return Err(StoreError::TooManyScans { limit });
            }
        }
        delete_scan_row(&mut tx, set, &scan.name).await?;
        insert_scan(&mut tx, set, scan).await?;
        if let Some(old) = old {
            sweep::leave(&mut tx, StoredFile::Scan(set, old)).await?;
        }
        tx.commit().await?;
        Ok(old.map_or(PutScan::Created, PutScan::Replaced))
    }

    /// Takes a scan out of a set; answers with the file that is no longer used.
    pub async fn delete_scan(&self, set: ScanSetId, name: &str) -> Result<FileId, StoreError> {
        self.with_reserve(|| self.delete_scan_once(set, name)).await
    }

    async fn delete_scan_once(&self, set: ScanSetId, name: &str) -> Result<FileId, StoreError> {
        let mut tx = self.begin_any().await?;
        check_free(&mut tx, set).await?;
        let file = file_of(&mut tx, set, name)
            .await?
            .ok_or_else(|| StoreError::NotFound { kind: "scan", id: name.to_owned() })?;
        delete_scan_row(&mut tx, set, name).await?;
        sweep::leave(&mut tx, StoredFile::Scan(set, file)).await?;
        tx.commit().await?;
        Ok(file)
    }

    /// Sets the initial poses of a set. Refused while a job uses the set.
    pub async fn put_poses(&self, set: ScanSetId, poses: &PoseFile) -> Result<(), StoreError> {
        let mut tx = self.begin().await?;
        check_free(&mut tx, set).await?;
        sqlx::query("UPDATE scan_set SET poses_name = ?, poses = ? WHERE id = ?")
            .bind(&poses.name)
            .bind(&poses.content)
            .bind(set.to_string())
            .execute(&mut *tx)
            .await?;
        tx.commit().await?;
        Ok(())
    }

    /// Deletes a scan set with everything derived from it; answers with the models that went with it.
    pub async fn delete_scan_set(&self, id: ScanSetId) -> Result<Deleted, StoreError> {
        self.with_reserve(|| self.delete_set_once(id)).await
    }

    async fn delete_set_once(&self, id: ScanSetId) -> Result<Deleted, StoreError> {
        let mut tx = self.begin_any().await?;
        check_free(&mut tx, id).await?;
        let text = id.to_string();
        let models = models::ids_of_scan_set(&mut tx, &text).await?;
        let jobs: Vec<String> =
            sqlx::query_scalar("SELECT id FROM job WHERE scan_set_id = ?").bind(&text).fetch_all(&mut *tx).await?;
        for resource in jobs.into_iter().chain([text.clone()]) {
            replays::delete_of(&mut tx, &resource).await?;
        }
        // jobs, models, assets and signatures go by foreign keys
        sqlx::query("DELETE FROM scan_set WHERE id = ?").bind(&text).execute(&mut *tx).await?;
        sweep::leave(&mut tx, StoredFile::ScanSet(id)).await?;
        for model in &models {
            sweep::leave(&mut tx, StoredFile::Model(*model)).await?;
        }
        Ok(Deleted { models, unseen: tx.commit_unseen(self).await? })
    }
}

/// Natural order of the names, ties by bytes: `scan2` before `scan10`.
pub fn sort_naturally(scans: &mut [ScanRecord]) {
    scans.sort_by(|a, b| natord::compare(&a.name, &b.name).then_with(|| a.name.cmp(&b.name)));
}

fn not_found(id: ScanSetId) -> StoreError {
    StoreError::NotFound { kind: "scan set", id: id.to_string() }
}

/// Stores a scan set and its scans; part of a larger transaction.
pub(super) async fn insert_set(db: &mut SqliteConnection, set: &NewScanSet) -> Result<(), StoreError> {
    sqlx::query("INSERT INTO scan_set (id, name, unit, poses_name, poses) VALUES (?, ?, ?, ?, ?)")
        .bind(set.id.to_string())
        .bind(&set.name)
        .bind(set.unit.name())
        .bind(set.poses.as_ref().map(|poses| &poses.name))
        .bind(set.poses.as_ref().map(|poses| &poses.content))
        .execute(&mut *db)
        .await?;
    for scan in &set.scans {
        insert_scan(db, set.id, scan).await?;
    }
    Ok(())
}

async fn insert_scan(db: &mut SqliteConnection, set: ScanSetId, scan: &ScanRecord) -> Result<(), StoreError> {
    let columns = "INSERT INTO scan (scan_set_id, name, file_id, points, bytes, checksum, reading)
                   VALUES (?, ?, ?, ?, ?, ?, ?)";
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
    sweep::settle(db, StoredFile::Scan(set, scan.file_id)).await
}

async fn delete_scan_row(db: &mut SqliteConnection, set: ScanSetId, name: &str) -> Result<(), StoreError> {
    sqlx::query("DELETE FROM scan WHERE scan_set_id = ? AND name = ?")
        .bind(set.to_string())
        .bind(name)
        .execute(db)
        .await?;
    Ok(())
}

async fn scan_rows(db: &mut SqliteConnection, set: &str) -> Result<Vec<ScanRow>, StoreError> {
    let rows = sqlx::query_as("SELECT name, file_id, points, bytes, checksum, reading FROM scan WHERE scan_set_id = ?")
        .bind(set)
        .fetch_all(db)
        .await?;
    Ok(rows)
}

async fn file_of(db: &mut SqliteConnection, set: ScanSetId, name: &str) -> Result<Option<FileId>, StoreError> {
    let file: Option<String> = sqlx::query_scalar("SELECT file_id FROM scan WHERE scan_set_id = ? AND name = ?")
        .bind(set.to_string())
        .bind(name)
        .fetch_optional(db)
        .await?;
    file.map(|text| stored_id!(FileId, &text)).transpose()
}

/// The set is there and no unfinished job uses it: a job must see the same scans however often it is run.
async fn check_free(db: &mut SqliteConnection, id: ScanSetId) -> Result<(), StoreError> {
    let in_use: Option<bool> = sqlx::query_scalar(
        "SELECT EXISTS (SELECT 1 FROM job WHERE scan_set_id = scan_set.id AND status IN ('queued', 'running'))
         FROM scan_set WHERE id = ?",
    )
    .bind(id.to_string())
    .fetch_optional(db)
    .await?;
    match in_use {
        None => Err(not_found(id)),
        Some(true) => Err(StoreError::InUse { kind: "scan set", id: id.to_string() }),
        Some(false) => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing;
    use super::*;

    fn scan(name: &str) -> ScanRecord {
        let (file_id, checksum) = (FileId::new(), "ab".to_owned());
        ScanRecord { name: name.to_owned(), file_id, points: 3, bytes: 9, checksum, reading: Some("{}".to_owned()) }
    }

    #[tokio::test]
    async fn scans_come_back_in_natural_order() {
        let (store, _folder) = testing::store().await;
        let id = testing::scan_set(&store, &["scan10.ply", "scan2.ply", "scan1.ply"]).await;
        let set = store.scan_set(id).await.expect("stored");
        let names: Vec<&str> = set.scans.iter().map(|scan| scan.name.as_str()).collect();
        assert_eq!(names, ["scan1.ply", "scan2.ply", "scan10.ply"]);
    }

    #[tokio::test]
    async fn a_scan_is_replaced_and_the_limit_holds() {
        let (store, _folder) = testing::store().await;
        let id = testing::scan_set(&store, &["a.ply"]).await;
        let first = scan("b.ply");
        assert_eq!(store.put_scan(id, &first, 2).await.expect("put"), PutScan::Created);
        assert_eq!(store.scan_set(id).await.expect("stored").scans[1].reading.as_deref(), Some("{}"));
        let again = scan("b.ply");
        assert_eq!(store.put_scan(id, &again, 2).await.expect("put"), PutScan::Replaced(first.file_id));
        let refused = store.put_scan(id, &scan("c.ply"), 2).await.expect_err("full");
        assert!(matches!(refused, StoreError::TooManyScans { limit: 2 }));
        assert_eq!(store.delete_scan(id, "b.ply").await.expect("there"), again.file_id);
        assert!(matches!(store.delete_scan(id, "b.ply").await, Err(StoreError::NotFound { kind: "scan", .. })));
    }

    #[tokio::test]
    async fn lists_are_paged_newest_first() {
        let (store, _folder) = testing::store().await;
        let mut ids = Vec::new();
        for _ in 0..3 {
            ids.push(testing::scan_set(&store, &[]).await);
        }
        let first = store.scan_sets(&PageRequest { before: None, limit: 2 }).await.expect("listed");
        assert_eq!(first.items.iter().map(|set| set.id).collect::<Vec<_>>(), [ids[2], ids[1]]);
        assert!(first.more);
        let rest = PageRequest { before: Some(ids[1].to_string()), limit: 2 };
        let rest = store.scan_sets(&rest).await.expect("listed");
        assert_eq!(rest.items.len(), 1);
        assert!(!rest.more);
    }
}
