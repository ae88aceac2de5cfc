//! Scan sets come with their files, change, and go with all that was made of them. What changes files and rows must run
//! to its end: between a file and its row nobody else knows of it.

use super::context::ServiceContext;
use super::recycle_bin::{self, Removal};
use super::{models, uploads};
use crate::storage::inventory::StorageError;
use crate::storage::{ObjectStore, StagedFile};
use visage_domain::{Deletable, FileId, NewScanSet, PutScan, Replay, ScanRecord, ScanSetId, StoredFile};

/// Files of scans that have arrived, each with the id that its row names.
pub type ReceivedScans = Vec<(FileId, StagedFile)>;

/// Stores a scan set with its scans, and with the answer that the client gets.
pub async fn add(
    context: &ServiceContext,
    set: &NewScanSet,
    files: ReceivedScans,
    replay: Option<&Replay>,
) -> Result<(), StorageError> {
    keep(context, set.id, files).await?;
    let created = context.database.create_scan_set(set, replay).await;
    context.storage().or_remove(StoredFile::ScanSet(set.id), created).await
}

/// Moves received scans to where they belong.
pub(super) async fn keep(context: &ServiceContext, set: ScanSetId, files: ReceivedScans) -> Result<(), StorageError> {
    let expected: Vec<StoredFile> = files.iter().map(|(file, _)| StoredFile::Scan(set, *file)).collect();
    if expected.is_empty() {
        return Ok(());
    }
    context.database.expect_files(&expected).await?;
    let keep =
        move |objects: &dyn ObjectStore| files.iter().try_for_each(|(id, file)| objects.keep_scan(file, set, *id));
    context.storage().blocking(keep).await
}

/// Adds a scan to a set, or replaces the one of the same name.
pub async fn put_scan(
    context: &ServiceContext,
    set: ScanSetId,
    scan: &ScanRecord,
    file: StagedFile,
) -> Result<PutScan, StorageError> {
    let (storage, most) = (context.storage(), context.config.limits.scans_per_set);
    keep(context, set, vec![(scan.file_id, file)]).await?;
    let put = storage.database.put_scan(set, scan, most).await;
    let put = storage.or_remove(StoredFile::Scan(set, scan.file_id), put).await?;
    if let PutScan::Replaced(old) = put {
        storage.remove(StoredFile::Scan(set, old)).await?;
    }
    Ok(put)
}

/// Takes a scan out of a set.
pub async fn delete_scan(context: &ServiceContext, set: ScanSetId, name: &str) -> Result<(), StorageError> {
    let file = context.database.delete_scan(set, name).await?;
    context.storage().remove(StoredFile::Scan(set, file)).await
}

/// Deletes a scan set with everything derived from it.
pub async fn delete(context: &ServiceContext, id: ScanSetId, removal: Removal) -> Result<(), StorageError> {
    if removal == Removal::IntoBin {
        recycle_bin::put(context, Deletable::ScanSet(id)).await?;
        // what has arrived of a file is not kept: it is no scan yet
        return uploads::let_go_unknown(context).await.map(drop);
    }
    let deleted = context.database.delete_scan_set(id).await?;
    context.monitor.announce_change();
    // whichever fails, the other is done
    let of_models = models::forget(context, deleted).await;
    context.storage().remove(StoredFile::ScanSet(id)).await?;
    uploads::let_go_unknown(context).await?;
    of_models
}

#[cfg(test)]
mod tests {
    use super::super::context::testing::{context, file};
    use super::*;
    use visage_geometry::Unit;

    fn scan(name: &str, file: &StagedFile) -> ScanRecord {
        ScanRecord {
            name: name.to_owned(),
            file_id: FileId::new(),
            points: 3,
            bytes: file.bytes,
            checksum: file.checksum.clone(),
            reading: None,
        }
    }

    fn set(scans: Vec<ScanRecord>) -> NewScanSet {
        NewScanSet {
            id: ScanSetId::new(),
            name: "set".to_owned(),
            unit: Unit::Mm,
            scans,
            poses: None,
            passed_over: Vec::new(),
        }
    }

    #[tokio::test]
    async fn a_set_and_its_files_come_change_and_go_together() {
        let (context, _place) = context().await;
        let first = file(&context, b"first").await;
        let record = scan("a.ply", &first);
        let set = set(vec![record.clone()]);
        add(&context, &set, vec![(record.file_id, first)], None).await.expect("stored");
        let files = || context.objects.listing().expect("listed");
        assert_eq!(files(), [StoredFile::Scan(set.id, record.file_id)]);

        let second = file(&context, b"second").await;
        let replacing = scan("a.ply", &second);
        let put = put_scan(&context, set.id, &replacing, second).await.expect("replaced");
        assert_eq!(put, PutScan::Replaced(record.file_id));
        assert_eq!(files(), [StoredFile::Scan(set.id, replacing.file_id)], "the one before is gone");

        delete_scan(&context, set.id, "a.ply").await.expect("taken out");
        assert_eq!(files(), []);
        delete(&context, set.id, Removal::ForGood).await.expect("deleted");
        assert!(context.database.scan_set(set.id).await.is_err());
    }

    #[tokio::test]
    async fn files_of_a_row_that_is_refused_are_removed() {
        let (context, _place) = context().await;
        let arrived = file(&context, b"a scan").await;
        let record = scan("a.ply", &arrived);
        let refused = put_scan(&context, ScanSetId::new(), &record, arrived).await;
        assert!(refused.is_err(), "there is no such set");
        assert_eq!(context.objects.listing().expect("listed"), []);
    }
}
