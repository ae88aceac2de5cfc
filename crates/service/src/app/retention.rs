//! What is old is deleted, where the operator has said so: faces are not kept longer than they are needed. What goes for its age
//! goes for good: the recycle bin must not make it older.

use jiff::{SignedDuration, Timestamp};

use super::context::ServiceContext;
use super::recycle_bin::{self, Removal};
use super::{models, scan_sets};
use crate::storage::DatabaseError;
use crate::storage::inventory::StorageError;
use visage_domain::{AuditId, BinDue, BinId, ModelId, PageRequest, ScanSetId};

/// Rows that are asked for at a time.
const PAGE: usize = 100;

/// What was deleted because it was old.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Dropped {
    /// Scan sets, with their jobs and models.
    pub scan_sets: usize,
    /// Models.
    pub models: usize,
    /// Entries of the audit log.
    pub audit: u64,
    /// Entries of the recycle bin.
    pub bin: usize,
}

/// Deletes what is older at `now` than it may be, and what was to be deleted by then. A set that an unfinished job
/// needs is left for the next time.
pub async fn drop_old(context: &ServiceContext, now: Timestamp) -> Result<Dropped, StorageError> {
    let keep = context.config.retention;
    // ids hold the time at which they were made
    let oldest = |days: u32| now.saturating_sub(SignedDuration::from_hours(24 * i64::from(days))).unwrap_or(now);
    let mut dropped = Dropped::default();
    if let Some(days) = keep.scan_sets {
        let mut page = from(ScanSetId::earliest_at(oldest(days)).to_string());
        loop {
            let sets = context.database.scan_sets(&page).await?;
            page.before = sets.next_cursor(|set| set.id.to_string());
            for set in sets.items {
                dropped.scan_sets += done(scan_sets::delete(context, set.id, Removal::ForGood).await)?;
            }
            if page.before.is_none() {
                break;
            }
        }
    }
    let mut after = None;
    loop {
        let sets = context.database.expired_scan_sets(now, after, PAGE).await?;
        for set in &sets {
            dropped.scan_sets += done(scan_sets::delete(context, *set, Removal::ForGood).await)?;
        }
        after = sets.last().copied();
        if after.is_none() {
            break;
        }
    }
    if let Some(days) = keep.models {
        let mut page = from(ModelId::earliest_at(oldest(days)).to_string());
        loop {
            let found = context.database.models(&Default::default(), &page).await?;
            page.before = found.next_cursor(|model| model.id.to_string());
            for model in found.items {
                dropped.models += done(models::delete(context, model.id, Removal::ForGood).await)?;
            }
            if page.before.is_none() {
                break;
            }
        }
    }
    if let Some(days) = keep.audit {
        dropped.audit = context.database.forget_audit_before(AuditId::earliest_at(oldest(days)).created_at()).await?;
    }
    let due = BinDue {
        before: BinId::earliest_at(oldest(keep.bin)),
        models_before: keep.models.map(|days| ModelId::earliest_at(oldest(days))),
        scan_sets_before: keep.scan_sets.map(|days| ScanSetId::earliest_at(oldest(days))),
        now,
    };
    dropped.bin = recycle_bin::purge_due(context, &due).await?;
    Ok(dropped)
}

fn from(before: String) -> PageRequest {
    PageRequest { before: Some(before), limit: PAGE }
}

/// What somebody else has deleted, or a job needs, is no reason to leave all the rest.
fn done(deleted: Result<(), StorageError>) -> Result<usize, StorageError> {
    match deleted {
        Ok(()) => Ok(1),
        Err(StorageError::Database(DatabaseError::NotFound { .. } | DatabaseError::InUse { .. })) => Ok(0),
        Err(error) => Err(error),
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::super::context::testing::context;
    use super::*;
    use crate::config::{Retention, ServerConfig};
    use visage_domain::{AuditEntry, AuditFilter, NewModel};

    fn days(count: i64) -> SignedDuration {
        SignedDuration::from_hours(24 * count)
    }

    async fn model_of(context: &ServiceContext, time: Timestamp) -> ModelId {
        // nothing is random in it: one for each millisecond
        let id = ModelId::earliest_at(time);
        let model = NewModel { id, ..NewModel::example(None) };
        drop(context.database.create_model(&model, None).await.expect("stored"));
        id
    }

    async fn with(retention: Retention) -> (ServiceContext, impl Sized) {
        let (context, place) = context().await;
        let config = ServerConfig { retention, ..context.config.as_ref().clone() };
        (ServiceContext { config: Arc::new(config), ..context }, place)
    }

    #[tokio::test]
    async fn models_and_entries_go_on_the_day_they_are_too_old_and_not_before() {
        let keep = Retention { models: Some(30), audit: Some(10), ..Retention::default() };
        let (context, _place) = with(keep).await;
        let now = Timestamp::now();
        let made = now - days(29);
        let (kept, old) = (model_of(&context, made).await, model_of(&context, now - days(31)).await);
        for time in [now, now - days(11)] {
            let entry = AuditEntry {
                id: AuditId::earliest_at(time),
                key: None,
                client: None,
                request: "r".into(),
                method: "DELETE".into(),
                route: "/v1/models/{id}".into(),
                target: Some(old.to_string()),
                status: 204,
            };
            context.database.record(&entry).await.expect("written");
        }
        assert_eq!(drop_old(&context, now).await.expect("done"), Dropped { models: 1, audit: 1, ..Dropped::default() });
        context.database.model(kept).await.expect("there");
        assert!(context.database.model(old).await.is_err());
        let page = PageRequest { before: None, limit: 10 };
        assert_eq!(context.database.audit(&AuditFilter::default(), &page).await.expect("listed").items.len(), 1);
        assert_eq!(drop_old(&context, now).await.expect("done"), Dropped::default());
        assert_eq!(drop_old(&context, made + days(31)).await.expect("done").models, 1);
    }

    #[tokio::test]
    async fn everything_is_kept_where_nothing_was_said() {
        let (context, _place) = with(Retention { audit: None, ..Retention::default() }).await;
        let now = Timestamp::now();
        let old = model_of(&context, now - days(5000)).await;
        assert_eq!(drop_old(&context, now).await.expect("done"), Dropped::default());
        context.database.model(old).await.expect("there");
    }

    #[tokio::test]
    async fn a_set_goes_when_its_time_has_come_and_others_stay() {
        use crate::storage::conformance::scan_set;
        let (context, _place) = with(Retention { audit: None, ..Retention::default() }).await;
        let db = context.database.as_ref();
        let now = Timestamp::now();
        let [kept, due, later, taken_back] = [(); 4].map(|()| scan_set(db, &["a.ply"]));
        let [kept, due, later, taken_back] = [kept.await, due.await, later.await, taken_back.await];
        for (set, time) in [(due, now), (later, now + days(2)), (taken_back, now)] {
            db.set_expiry(set, Some(time)).await.expect("said");
        }
        db.set_expiry(taken_back, None).await.expect("said");
        assert_eq!(db.expiry(due).await.expect("asked").map(Timestamp::as_millisecond), Some(now.as_millisecond()));
        assert_eq!((db.expiry(kept).await.expect("asked"), db.expiry(taken_back).await.expect("asked")), (None, None));
        assert_eq!(drop_old(&context, now - days(1)).await.expect("done"), Dropped::default());
        assert_eq!(drop_old(&context, now + days(1)).await.expect("done").scan_sets, 1);
        assert!(db.scan_set(due).await.is_err());
        for set in [kept, later, taken_back] {
            db.scan_set(set).await.expect("there");
        }
        assert!(matches!(db.set_expiry(due, None).await, Err(DatabaseError::NotFound { .. })));
    }

    #[tokio::test]
    async fn old_scan_sets_go_with_all_that_was_made_of_them_unless_a_job_needs_them() {
        use crate::storage::conformance::scan_set;
        use visage_domain::{JobId, NewJob};
        let (context, _place) = with(Retention { scan_sets: Some(1), ..Retention::default() }).await;
        let db = context.database.as_ref();
        let (used, free) = (scan_set(db, &["a.ply"]).await, scan_set(db, &["a.ply"]).await);
        let job = NewJob {
            id: JobId::new(),
            scan_set_id: used,
            label: None,
            options: Default::default(),
            base: None,
            hints: Default::default(),
        };
        db.create_job(&job, None, 10, None).await.expect("queued");
        let now = Timestamp::now();
        assert_eq!(drop_old(&context, now).await.expect("done").scan_sets, 0);
        assert_eq!(drop_old(&context, now + days(2)).await.expect("done").scan_sets, 1);
        db.scan_set(used).await.expect("a job needs it");
        assert!(db.scan_set(free).await.is_err());
    }
}
