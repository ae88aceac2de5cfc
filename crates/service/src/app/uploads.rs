//! Files that come piece by piece: kept until they have become scans, and given up when nobody goes on with them.

use super::context::ServiceContext;
use crate::storage::ObjectStore;
use crate::storage::inventory::StorageError;
use visage_domain::{UploadId, UploadRecord};

/// When a file is given up of which nothing more comes.
pub fn end(context: &ServiceContext, now: jiff::Timestamp) -> jiff::Timestamp {
    now.saturating_add(context.config.limits.upload_life).unwrap_or(now)
}

/// How much of a file its client needs not send again. The last byte counts when the file has become a scan: a client that
/// was not told so sends it once more, and is answered then.
pub async fn acknowledged(context: &ServiceContext, upload: &UploadRecord) -> Result<u64, StorageError> {
    if upload.is_done {
        return Ok(upload.bytes);
    }
    Ok(context.objects.held(upload.id).await?.min(upload.bytes.saturating_sub(1)))
}

/// Notes that a file has become a scan, and lets its pieces go.
pub async fn finish(context: &ServiceContext, id: UploadId) -> Result<(), StorageError> {
    context.database.finish_upload(id).await?;
    let_go(context, vec![id]).await
}

/// Gives a file up.
pub async fn discard(context: &ServiceContext, id: UploadId) -> Result<(), StorageError> {
    context.database.delete_upload(id).await?;
    let_go(context, vec![id]).await
}

/// Gives up what was to be given up by now; answers with the number of files that went.
pub async fn sweep(context: &ServiceContext, now: jiff::Timestamp) -> Result<usize, StorageError> {
    context.database.forget_old_uploads(now).await?;
    let_go_unknown(context).await
}

/// Removes pieces of files that nobody knows any more; answers with the number of files.
pub async fn let_go_unknown(context: &ServiceContext) -> Result<usize, StorageError> {
    // in this order: a file has its row before its first piece
    let mut held = context.storage().blocking(|objects: &dyn ObjectStore| objects.held_uploads()).await?;
    if held.is_empty() {
        return Ok(0);
    }
    let open = context.database.open_uploads().await?;
    held.retain(|id| !open.contains(id));
    let count = held.len();
    let_go(context, held).await?;
    Ok(count)
}

async fn let_go(context: &ServiceContext, ids: Vec<UploadId>) -> Result<(), StorageError> {
    context.storage().blocking(move |objects: &dyn ObjectStore| ids.iter().try_for_each(|id| objects.let_go(*id))).await
}

#[cfg(test)]
mod tests {
    use jiff::{SignedDuration, Timestamp};

    use super::super::context::testing::context;
    use super::super::scan_sets;
    use super::*;
    use crate::storage::DatabaseError;
    use crate::storage::conformance::scan_set;
    use visage_domain::ScanSetId;

    async fn upload(context: &ServiceContext, set: ScanSetId, pieces: &[&[u8]]) -> UploadRecord {
        let (id, expires_at) = (UploadId::new(), end(context, Timestamp::now()));
        let upload = UploadRecord {
            id,
            scan_set_id: set,
            name: "a.ply".into(),
            bytes: 6,
            digest: None,
            expires_at,
            is_done: false,
        };
        context.database.create_upload(&upload, 3).await.expect("stored");
        for piece in pieces {
            let mut writer = context.objects.resume(id).await.expect("goes on");
            writer.write(piece).await.expect("written");
            writer.finish().await.expect("durable");
        }
        upload
    }

    #[tokio::test]
    async fn the_last_byte_counts_when_the_file_is_a_scan() {
        let (context, _place) = context().await;
        let set = scan_set(context.database.as_ref(), &[]).await;
        let begun = upload(&context, set, &[]).await;
        assert_eq!(acknowledged(&context, &begun).await.expect("asked"), 0);
        let whole = upload(&context, set, &[b"abc", b"def"]).await;
        assert_eq!(acknowledged(&context, &whole).await.expect("asked"), 5);
        let listed = context.database.uploads_of(set).await.expect("listed");
        assert_eq!(listed.iter().map(|upload| upload.id).collect::<Vec<_>>(), [begun.id, whole.id]);
        finish(&context, whole.id).await.expect("noted");
        let done = context.database.upload(whole.id).await.expect("there");
        assert_eq!(acknowledged(&context, &done).await.expect("asked"), 6);
        assert_eq!(context.objects.held_uploads().expect("listed"), []);
        assert_eq!(context.database.uploads_of(set).await.expect("listed").len(), 1);
    }

    #[tokio::test]
    async fn what_nobody_goes_on_with_is_given_up_and_what_is_extended_is_not() {
        let (context, _place) = context().await;
        let (db, now) = (context.database.as_ref(), Timestamp::now());
        let set = scan_set(db, &[]).await;
        let [left, kept] = [upload(&context, set, &[b"abc"]).await, upload(&context, set, &[b"abc"]).await];
        assert_eq!(sweep(&context, now).await.expect("swept"), 0);
        let later = now + SignedDuration::from_hours(25);
        db.extend_upload(kept.id, end(&context, later)).await.expect("extended");
        assert_eq!(sweep(&context, later).await.expect("swept"), 1);
        assert!(matches!(db.upload(left.id).await, Err(DatabaseError::NotFound { .. })));
        assert!(matches!(db.extend_upload(left.id, later).await, Err(DatabaseError::NotFound { .. })));
        assert_eq!(context.objects.held_uploads().expect("listed"), [kept.id]);
    }

    #[tokio::test]
    async fn pieces_go_with_their_set() {
        let (context, _place) = context().await;
        let set = scan_set(context.database.as_ref(), &["b.ply"]).await;
        let upload = upload(&context, set, &[b"abc"]).await;
        scan_sets::delete(&context, set, super::super::recycle_bin::Removal::ForGood).await.expect("deleted");
        assert_eq!(context.objects.held_uploads().expect("listed"), []);
        assert!(context.database.upload(upload.id).await.is_err());
    }

    #[tokio::test]
    async fn a_set_has_so_many_open_uploads_and_they_count_as_stored() {
        let (context, _place) = context().await;
        let db = context.database.as_ref();
        let set = scan_set(db, &[]).await;
        let uploads =
            [upload(&context, set, &[]).await, upload(&context, set, &[]).await, upload(&context, set, &[]).await];
        let fourth = UploadRecord { id: UploadId::new(), ..uploads[0].clone() };
        assert!(matches!(db.create_upload(&fourth, 3).await, Err(DatabaseError::TooManyScans { limit: 3 })));
        finish(&context, uploads[0].id).await.expect("noted");
        db.create_upload(&fourth, 3).await.expect("there is room");
        let elsewhere = UploadRecord { id: UploadId::new(), scan_set_id: ScanSetId::new(), ..fourth };
        assert!(matches!(db.create_upload(&elsewhere, 3).await, Err(DatabaseError::NotFound { .. })));
    }
}
