//! Which files belong to the database, and which may be on disk though no row knows them.

use std::collections::BTreeSet;

use sqlx::{FromRow, SqliteConnection};

use super::{FileId, ModelId, ScanSetId, StandardId, Store, StoreError, now_ms, stored_id};

/// Something in the data folder that has a row, or is about to have one, or had one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum StoredFile {
    /// All files of a scan set.
    ScanSet(ScanSetId),
    /// One scan of a set.
    Scan(ScanSetId, FileId),
    /// All files of a model.
    Model(ModelId),
    /// All files of a standard.
    Standard(StandardId),
}

impl std::fmt::Display for StoredFile {
    /// The place below the data folder.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            StoredFile::ScanSet(set) => write!(f, "scan-sets/{set}"),
            StoredFile::Scan(set, scan) => write!(f, "scan-sets/{set}/{scan}"),
            StoredFile::Model(model) => write!(f, "models/{model}"),
            StoredFile::Standard(standard) => write!(f, "standards/{standard}"),
        }
    }
}

impl StoredFile {
    fn kind(self) -> &'static str {
        match self {
            StoredFile::ScanSet(_) => "scan_set",
            StoredFile::Scan(..) => "scan",
            StoredFile::Model(_) => "model",
            StoredFile::Standard(_) => "standard",
        }
    }

    fn id(self) -> String {
        match self {
            StoredFile::ScanSet(id) => id.to_string(),
            StoredFile::Scan(_, id) => id.to_string(),
            StoredFile::Model(id) => id.to_string(),
            StoredFile::Standard(id) => id.to_string(),
        }
    }

    fn scan_set(self) -> Option<String> {
        match self {
            StoredFile::Scan(set, _) => Some(set.to_string()),
            _ => None,
        }
    }
}

/// A file that no row needs to know.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LooseFile {
    /// Which one.
    pub file: StoredFile,
    /// Whether its row was deleted; otherwise it was being stored.
    pub is_deleted: bool,
    /// Since when.
    pub since: jiff::Timestamp,
}

/// All files that rows refer to.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct KnownFiles {
    /// Scan sets, also those without a scan.
    pub scan_sets: BTreeSet<ScanSetId>,
    /// Scan files.
    pub scans: BTreeSet<(ScanSetId, FileId)>,
    /// Models.
    pub models: BTreeSet<ModelId>,
    /// Standards.
    pub standards: BTreeSet<StandardId>,
}

impl KnownFiles {
    /// Whether a row refers to it.
    pub fn knows(&self, file: StoredFile) -> bool {
        match file {
            StoredFile::ScanSet(id) => self.scan_sets.contains(&id),
            StoredFile::Scan(set, id) => self.scans.contains(&(set, id)),
            StoredFile::Model(id) => self.models.contains(&id),
            StoredFile::Standard(id) => self.standards.contains(&id),
        }
    }

    /// Everything that has to be on disk.
    pub fn needed(&self) -> impl Iterator<Item = StoredFile> {
        let scans = self.scans.iter().map(|(set, id)| StoredFile::Scan(*set, *id));
        let models = self.models.iter().map(|id| StoredFile::Model(*id));
        scans.chain(models).chain(self.standards.iter().map(|id| StoredFile::Standard(*id)))
    }
}

#[derive(FromRow)]
struct LooseRow {
    kind: String,
    id: String,
    scan_set_id: Option<String>,
    is_deleted: bool,
    since: i64,
}

impl LooseRow {
    fn file(self) -> Result<LooseFile, StoreError> {
        let file = match (self.kind.as_str(), &self.scan_set_id) {
            ("scan_set", _) => StoredFile::ScanSet(stored_id!(ScanSetId, &self.id)?),
            ("scan", Some(set)) => StoredFile::Scan(stored_id!(ScanSetId, set)?, stored_id!(FileId, &self.id)?),
            ("model", _) => StoredFile::Model(stored_id!(ModelId, &self.id)?),
            ("standard", _) => StoredFile::Standard(stored_id!(StandardId, &self.id)?),
            _ => return Err(super::damaged("a kind of file", self.kind)),
        };
        Ok(LooseFile { file, is_deleted: self.is_deleted, since: super::timestamp(self.since)? })
    }
}

impl Store {
    /// What the database refers to, in one snapshot.
    pub async fn known_files(&self) -> Result<KnownFiles, StoreError> {
        let mut tx = self.readers.begin().await?;
        let sets: Vec<String> = sqlx::query_scalar("SELECT id FROM scan_set").fetch_all(&mut *tx).await?;
        let scans: Vec<(String, String)> =
            sqlx::query_as("SELECT scan_set_id, file_id FROM scan").fetch_all(&mut *tx).await?;
        let models: Vec<String> = sqlx::query_scalar("SELECT id FROM model").fetch_all(&mut *tx).await?;
        let standards: Vec<String> = sqlx::query_scalar("SELECT id FROM standard").fetch_all(&mut *tx).await?;
        let scan = |(set, file): &(String, String)| Ok((stored_id!(ScanSetId, set)?, stored_id!(FileId, file)?));
        Ok(KnownFiles {
            scan_sets: sets.iter().map(|text| stored_id!(ScanSetId, text)).collect::<Result<_, _>>()?,
            scans: scans.iter().map(scan).collect::<Result<_, StoreError>>()?,
            models: models.iter().map(|text| stored_id!(ModelId, text)).collect::<Result<_, _>>()?,
            standards: standards.iter().map(|text| stored_id!(StandardId, text)).collect::<Result<_, _>>()?,
        })
    }

    /// Says that a file is about to be put in its place. The row that knows it takes this back.
    pub async fn expect_files(&self, files: &[StoredFile]) -> Result<(), StoreError> {
        let mut tx = self.begin().await?;
        for file in files {
            insert_loose(&mut tx, *file, false).await?;
        }
        tx.commit().await
    }

    /// Files that no row needs to know.
    pub async fn loose_files(&self) -> Result<Vec<LooseFile>, StoreError> {
        let rows: Vec<LooseRow> = sqlx::query_as("SELECT * FROM loose_file").fetch_all(&self.readers).await?;
        rows.into_iter().map(LooseRow::file).collect()
    }

    /// Says that a file is gone, or has a row after all.
    pub async fn forget_loose(&self, files: &[StoredFile]) -> Result<(), StoreError> {
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
pub(super) async fn settle(db: &mut SqliteConnection, file: StoredFile) -> Result<(), StoreError> {
    sqlx::query("DELETE FROM loose_file WHERE kind = ? AND id = ?")
        .bind(file.kind())
        .bind(file.id())
        .execute(db)
        .await?;
    Ok(())
}

/// A file has no row any more; part of the transaction that deletes that.
pub(super) async fn leave(db: &mut SqliteConnection, file: StoredFile) -> Result<(), StoreError> {
    insert_loose(db, file, true).await
}

async fn insert_loose(db: &mut SqliteConnection, file: StoredFile, is_deleted: bool) -> Result<(), StoreError> {
    sqlx::query("INSERT OR REPLACE INTO loose_file (kind, id, scan_set_id, is_deleted, since) VALUES (?, ?, ?, ?, ?)")
        .bind(file.kind())
        .bind(file.id())
        .bind(file.scan_set())
        .bind(is_deleted)
        .bind(now_ms())
        .execute(db)
        .await?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::{NewModel, testing};
    use super::*;

    #[tokio::test]
    async fn everything_stored_is_known() {
        let (store, _folder) = testing::store().await;
        let set = testing::scan_set(&store, &["a.ply", "b.ply"]).await;
        let model = NewModel::test(None);
        drop(store.create_model(&model, None).await.expect("stored"));
        let known = store.known_files().await.expect("read");
        assert!(known.knows(StoredFile::ScanSet(set)));
        assert_eq!(known.scans.len(), 2);
        assert!(known.knows(StoredFile::Model(model.id)));
        assert_eq!(known.needed().count(), 3);
    }

    #[tokio::test]
    async fn a_file_is_loose_before_it_has_a_row_and_after() {
        let (store, _folder) = testing::store().await;
        let model = NewModel::test(None);
        let file = StoredFile::Model(model.id);
        let loose = async || {
            let loose = store.loose_files().await.expect("read");
            loose.into_iter().map(|loose| (loose.file, loose.is_deleted)).collect::<Vec<_>>()
        };
        store.expect_files(&[file]).await.expect("stored");
        assert_eq!(loose().await, [(file, false)]);
        drop(store.create_model(&model, None).await.expect("stored"));
        assert_eq!(loose().await, []);
        drop(store.delete_model(model.id).await.expect("deleted"));
        assert_eq!(loose().await, [(file, true)]);
        store.forget_loose(&[file]).await.expect("forgotten");
        assert_eq!(loose().await, []);
    }
}
