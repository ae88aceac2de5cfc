//! What was deleted is kept for a while, if the operator wants that, and can be put back.

use super::context::ServiceContext;
use crate::config::Retention;
use crate::storage::inventory::StorageError;
use crate::storage::{DatabaseError, Purged};
use visage_domain::{BinDue, BinRecord, Deletable};
use visage_shape::faces::Signature;

/// What a deletion does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Removal {
    /// It is gone.
    ForGood,
    /// It can be put back for a while.
    IntoBin,
}

impl Removal {
    /// What deletions do by these settings; `permanently` if it was said that nothing may be kept.
    pub fn by(retention: &Retention, permanently: bool) -> Removal {
        if permanently || retention.bin == 0 { Removal::ForGood } else { Removal::IntoBin }
    }
}

/// Puts something into the bin: no answer tells of it any more, its files stay.
pub(super) async fn put(context: &ServiceContext, thing: Deletable) -> Result<(), StorageError> {
    let deleted = context.database.put_in_bin(thing).await?;
    context.monitor.announce_change();
    context.gallery.withdraw(context.database.as_ref(), &deleted.models).await;
    drop(deleted);
    // the rows were moved, so the log holds them twice
    context.database.fold_log().await;
    Ok(())
}

/// Puts back what had this id, with all that was deleted with it; the next query finds its models. Must run to its end.
pub async fn restore(context: &ServiceContext, thing: &str) -> Result<BinRecord, StorageError> {
    let database = context.database.as_ref();
    let entry = database.binned(thing).await?;
    let (models, unseen) = database.restore(thing).await?;
    for model in models {
        match database.signature(model).await {
            Ok(content) => {
                // one of another version waits to be made anew, as at a start
                if let Some(Ok(signature)) = content.as_deref().map(Signature::from_bytes) {
                    context.gallery.publish(database, model, signature).await?;
                }
            }
            Err(DatabaseError::Damaged { .. }) => database.give_up_signatures(&[model]).await?,
            Err(error) => return Err(error.into()),
        }
    }
    drop(unseen);
    // what was given up above is to be made anew, too
    database.queue_evaluation().await?;
    context.monitor.announce_work();
    Ok(entry)
}

/// Removes what had this id for good.
pub async fn purge(context: &ServiceContext, thing: &str) -> Result<(), StorageError> {
    let entry = context.database.binned(thing).await?;
    let purged = context.database.purge(&[entry.id]).await?;
    remove(context, purged).await.map(drop)
}

/// Removes for good what is due; answers with the number of entries.
pub(super) async fn purge_due(context: &ServiceContext, due: &BinDue) -> Result<usize, StorageError> {
    let purged = context.database.purge_due(due).await?;
    match purged == Purged::default() {
        true => Ok(0),
        false => remove(context, purged).await,
    }
}

async fn remove(context: &ServiceContext, purged: Purged) -> Result<usize, StorageError> {
    let Purged { entries, files } = purged;
    context.monitor.announce_change();
    context.database.fold_log().await;
    context.storage().remove_all(files).await?;
    Ok(entries)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use jiff::{SignedDuration, Timestamp};

    use super::super::context::testing::{context, file};
    use super::super::models::{Upload, add, delete};
    use super::super::retention::{Dropped, drop_old};
    use super::*;
    use crate::config::ServerConfig;
    use visage_domain::{ModelId, NewModel, PageRequest, StoredFile};
    use visage_gallery::Gallery;
    use visage_shape::faces::signature::example::example;

    async fn with_bin(change: impl FnOnce(&mut Retention)) -> (ServiceContext, impl Sized) {
        let (context, place) = context().await;
        let mut config = ServerConfig::clone(&context.config);
        config.retention.bin = 7;
        change(&mut config.retention);
        (ServiceContext { config: Arc::new(config), ..context }, place)
    }

    async fn added(context: &ServiceContext) -> ModelId {
        let signature = example(0.3, 5);
        let model = NewModel { signature: Some((&signature).into()), ..NewModel::example(None) };
        let (id, file) = (model.id, file(context, b"a mesh").await);
        add(context, Upload { model, file, thumbnail: None, signature }, None).await.expect("added");
        id
    }

    async fn listed(context: &ServiceContext) -> usize {
        let page = PageRequest { before: None, limit: 10 };
        context.database.bin(&page).await.expect("listed").items.len()
    }

    #[tokio::test]
    async fn what_is_in_the_bin_is_found_by_nobody_until_it_is_put_back() {
        let (context, _place) = with_bin(|_| {}).await;
        let id = added(&context).await;
        let before = context.database.model(id).await.expect("there");
        delete(&context, id, Removal::IntoBin).await.expect("deleted");
        assert!(context.database.model(id).await.is_err());
        assert_eq!(context.gallery.ask(Gallery::len), Ok(0));
        assert_eq!(context.objects.listing().expect("listed"), [StoredFile::Model(id)], "its file is kept");
        let restored = restore(&context, &id.to_string()).await.expect("put back");
        assert_eq!((restored.thing, restored.models), (Deletable::Model(id), 1));
        let after = context.database.model(id).await.expect("there");
        assert_eq!((after.name, after.signature), (before.name, before.signature));
        assert_eq!(context.gallery.ask(Gallery::len), Ok(1));
        assert_eq!(listed(&context).await, 0);
        // and once more, for good
        delete(&context, id, Removal::IntoBin).await.expect("deleted");
        purge(&context, &id.to_string()).await.expect("gone");
        assert_eq!(context.objects.listing().expect("listed"), []);
        assert!(restore(&context, &id.to_string()).await.is_err());
    }

    #[tokio::test]
    async fn the_bin_is_emptied_after_its_time_and_makes_nothing_older_than_it_may_be() {
        let (context, _place) = with_bin(|keep| keep.models = Some(3)).await;
        let id = added(&context).await;
        delete(&context, id, Removal::IntoBin).await.expect("deleted");
        let days = |count: i64| Timestamp::now() + SignedDuration::from_hours(24 * count);
        assert_eq!(drop_old(&context, days(2)).await.expect("done"), Dropped::default());
        assert_eq!(drop_old(&context, days(4)).await.expect("done").bin, 1, "a model is kept for three days");
        let (context, _place) = with_bin(|_| {}).await;
        let id = added(&context).await;
        delete(&context, id, Removal::IntoBin).await.expect("deleted");
        assert_eq!(drop_old(&context, days(6)).await.expect("done"), Dropped::default());
        assert_eq!((listed(&context).await, context.objects.listing().expect("listed").len()), (1, 1));
        assert_eq!(drop_old(&context, days(8)).await.expect("done").bin, 1);
        assert_eq!((listed(&context).await, context.objects.listing().expect("listed").len()), (0, 0));
    }

    #[test]
    fn nothing_is_kept_where_there_is_no_bin_or_somebody_says_so() {
        let with = |bin| Retention { bin, ..Retention::default() };
        assert_eq!(Removal::by(&Retention::default(), false), Removal::ForGood);
        assert_eq!(Removal::by(&with(7), false), Removal::IntoBin);
        assert_eq!(Removal::by(&with(7), true), Removal::ForGood);
    }
}
