//! What is written but not yet in the index in memory: queries wait for it, so that what a client has seen of a job or
//! a model holds for what it asks next.
//!
//! Writers hold a share from just before their commit until the index has followed. Whoever asks afterwards has to get
//! past those shares once. Nobody waits for a lock of the database meanwhile: it is held already when the share is
//! taken.

use std::sync::Arc;

use tokio::sync::{OwnedRwLockReadGuard, RwLock};

use super::Store;

/// Changes of the index that are under way.
#[derive(Debug, Clone, Default)]
pub(super) struct Changes(Arc<RwLock<()>>);

/// A change that the index has not followed yet; dropped when it has.
#[derive(Debug)]
#[must_use = "queries wait until the index has followed"]
pub struct Unseen {
    _share: OwnedRwLockReadGuard<()>,
}

impl Store {
    /// Makes queries that come from now on wait until the answer is dropped.
    pub(super) async fn unseen(&self) -> Unseen {
        Unseen { _share: Arc::clone(&self.changes.0).read_owned().await }
    }

    /// Waits until the index holds everything that was committed before: call it before a query.
    pub async fn settled(&self) {
        drop(self.changes.0.write().await);
    }
}

#[cfg(test)]
mod tests {
    use std::future::poll_fn;
    use std::task::Poll;

    use super::super::{NewModel, testing};

    #[tokio::test]
    async fn a_query_waits_for_what_is_committed_but_not_in_the_index() {
        let (store, _folder) = testing::store().await;
        store.settled().await;
        let unseen = store.create_model(&NewModel::test(None), None).await.expect("stored");
        let mut query = std::pin::pin!(store.settled());
        let waits = poll_fn(|context| Poll::Ready(query.as_mut().poll(context).is_pending())).await;
        assert!(waits, "the index does not know the model yet");
        drop(unseen);
        query.await;
    }
}
