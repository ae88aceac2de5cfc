//! Which files belong to the database, and which may be on disk though no row knows them.

use super::rows::row;
use super::{Connection, Store, Writing, stored_id};
use crate::storage::DatabaseError;
use crate::storage::database::Files;
use async_trait::async_trait;
use visage_domain::{KnownFiles, LooseFile, Owner, StoredFile};

fn kind_of(file: StoredFile) -> &'static str {
    match file {
        StoredFile::ScanSet(_) => "scan_set",
        StoredFile::Scan(..) => "scan",
        StoredFile::Model(_) => "model",
        StoredFile::Standard(_) => "standard",
    }
}

fn id_of(file: StoredFile) -> String {
    match file {
        StoredFile::ScanSet(id) => id.to_string(),
        StoredFile::Scan(_, id) => id.to_string(),
        StoredFile::Model(id) => id.to_string(),
        StoredFile::Standard(id) => id.to_string(),
    }
}

fn scan_set_of(file: StoredFile) -> Option<String> {
    match file {
        StoredFile::Scan(set, _) => Some(set.to_string()),
        _ => None,
    }
}

row! {
    struct LooseRow {
        kind: String,
        id: String,
        scan_set_id: Option<String>,
        is_deleted: bool,
        since: i64,
        seat: Option<String>,
        process: Option<String>,
    }
}

impl LooseRow {
    fn file(self) -> Result<LooseFile, DatabaseError> {
        let file = match (self.kind.as_str(), &self.scan_set_id) {
            ("scan_set", _) => StoredFile::ScanSet(stored_id!(ScanSetId, &self.id)?),
            ("scan", Some(set)) => StoredFile::Scan(stored_id!(ScanSetId, set)?, stored_id!(FileId, &self.id)?),
            ("model", _) => StoredFile::Model(stored_id!(ModelId, &self.id)?),
            ("standard", _) => StoredFile::Standard(stored_id!(StandardId, &self.id)?),
            _ => return Err(super::damaged("a kind of file", self.kind)),
        };
        let owner = match (&self.seat, &self.process) {
            (Some(seat), Some(process)) => {
                Some(Owner { seat: stored_id!(SeatId, seat)?, process: stored_id!(ProcessId, process)? })
            }
            _ => None,
        };
        Ok(LooseFile { file, is_deleted: self.is_deleted, since: super::timestamp(self.since)?, owner })
    }
}

#[async_trait]
impl Files for Store {
    async fn known_files(&self) -> Result<(KnownFiles, Vec<LooseFile>), DatabaseError> {
        let mut tx = self.snapshot().await?;
        // what is in the recycle bin needs its files, too
        let sets: Vec<String> = sqlx::query_scalar("SELECT id FROM scan_set UNION ALL SELECT id FROM binned_scan_set")
            .fetch_all(&mut *tx)
            .await?;
        let scans: Vec<(String, String)> = sqlx::query_as(
            "SELECT scan_set_id, file_id FROM scan UNION ALL SELECT scan_set_id, file_id FROM binned_scan",
        )
        .fetch_all(&mut *tx)
        .await?;
        let models: Vec<String> = sqlx::query_scalar("SELECT id FROM model UNION ALL SELECT id FROM binned_model")
            .fetch_all(&mut *tx)
            .await?;
        let standards: Vec<String> = sqlx::query_scalar("SELECT id FROM standard").fetch_all(&mut *tx).await?;
        let scan = |(set, file): &(String, String)| Ok((stored_id!(ScanSetId, set)?, stored_id!(FileId, file)?));
        let loose: Vec<LooseRow> = sqlx::query_as("SELECT * FROM loose_file").fetch_all(&mut *tx).await?;
        let known = KnownFiles {
            scan_sets: sets.iter().map(|text| stored_id!(ScanSetId, text)).collect::<Result<_, _>>()?,
            scans: scans.iter().map(scan).collect::<Result<_, DatabaseError>>()?,
            models: models.iter().map(|text| stored_id!(ModelId, text)).collect::<Result<_, _>>()?,
            standards: standards.iter().map(|text| stored_id!(StandardId, text)).collect::<Result<_, _>>()?,
        };
        let loose = loose.into_iter().map(LooseRow::file).collect::<Result<_, _>>()?;
        Ok((known, loose))
    }

    async fn expect_files(&self, files: &[StoredFile]) -> Result<(), DatabaseError> {
        let mut tx = self.begin().await?;
        for file in files {
            insert_loose(&mut tx, *file, Some(self.owner)).await?;
        }
        tx.commit().await
    }

    async fn forget_loose(&self, files: &[StoredFile]) -> Result<(), DatabaseError> {
        if files.is_empty() {
            return Ok(());
        }
        let mut tx = self.begin_any().await?;
        for file in files {
            settle(&mut tx, *file).await?;
        }
        tx.commit().await
    }
}

/// A file has its row now; part of the transaction that stores that.
pub(super) async fn settle(db: &mut Connection, file: StoredFile) -> Result<(), DatabaseError> {
    sqlx::query("DELETE FROM loose_file WHERE kind = $1 AND id = $2")
        .bind(kind_of(file))
        .bind(id_of(file))
        .execute(db)
        .await?;
    Ok(())
}

/// A file has no row any more; part of the transaction that deletes that.
pub(super) async fn leave(db: &mut Writing, file: StoredFile) -> Result<(), DatabaseError> {
    insert_loose(db, file, None).await
}

/// With an owner, who puts the file in its place; without, its row was deleted.
async fn insert_loose(db: &mut Writing, file: StoredFile, owner: Option<Owner>) -> Result<(), DatabaseError> {
    let columns = "INSERT INTO loose_file (kind, id, scan_set_id, is_deleted, since, seat, process)
                   VALUES ($1, $2, $3, $4, $5, $6, $7)
                   ON CONFLICT (kind, id) DO UPDATE SET scan_set_id = excluded.scan_set_id, since = excluded.since,
                       is_deleted = excluded.is_deleted, seat = excluded.seat, process = excluded.process";
    sqlx::query(columns)
        .bind(kind_of(file))
        .bind(id_of(file))
        .bind(scan_set_of(file))
        .bind(owner.is_none())
        .bind(db.now_ms())
        .bind(owner.map(|owner| owner.seat.to_string()))
        .bind(owner.map(|owner| owner.process.to_string()))
        .execute(&mut **db)
        .await?;
    Ok(())
}
