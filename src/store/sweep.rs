//! Which files the database knows: everything else on disk was left by a crash and is swept at start.

use std::collections::BTreeSet;

use super::{FileId, ModelId, ScanSetId, StandardId, Store, StoreError, stored_id};

/// All files that rows refer to.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct KnownFiles {
    /// Scan sets.
    pub scan_sets: BTreeSet<ScanSetId>,
    /// Scan files.
    pub scans: BTreeSet<FileId>,
    /// Models.
    pub models: BTreeSet<ModelId>,
    /// Standards.
    pub standards: BTreeSet<StandardId>,
}

impl Store {
    /// What the database refers to, in one snapshot.
    pub async fn known_files(&self) -> Result<KnownFiles, StoreError> {
        let mut tx = self.readers.begin().await?;
        let sets: Vec<String> = sqlx::query_scalar("SELECT id FROM scan_set").fetch_all(&mut *tx).await?;
        let scans: Vec<String> = sqlx::query_scalar("SELECT file_id FROM scan").fetch_all(&mut *tx).await?;
        let models: Vec<String> = sqlx::query_scalar("SELECT id FROM model").fetch_all(&mut *tx).await?;
        let standards: Vec<String> = sqlx::query_scalar("SELECT id FROM standard").fetch_all(&mut *tx).await?;
        Ok(KnownFiles {
            scan_sets: sets.iter().map(|text| stored_id!(ScanSetId, text)).collect::<Result<_, _>>()?,
            scans: scans.iter().map(|text| stored_id!(FileId, text)).collect::<Result<_, _>>()?,
            models: models.iter().map(|text| stored_id!(ModelId, text)).collect::<Result<_, _>>()?,
            standards: standards.iter().map(|text| stored_id!(StandardId, text)).collect::<Result<_, _>>()?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::{NewModel, testing};

    #[tokio::test]
    async fn everything_stored_is_known() {
        let (store, _folder) = testing::store().await;
        let set = testing::scan_set(&store, &["a.ply", "b.ply"]).await;
        let model = NewModel::test(None);
        store.create_model(&model, None).await.expect("stored");
        let known = store.known_files().await.expect("read");
        assert!(known.scan_sets.contains(&set));
        assert_eq!(known.scans.len(), 2);
        assert!(known.models.contains(&model.id));
    }
}
