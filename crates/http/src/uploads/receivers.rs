//! One request at a time adds to a file. A new one takes over from an older one: that is often one whose client is gone, which
//! nobody has told the server.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio::sync::OwnedMutexGuard;
use tokio_util::sync::CancellationToken;

use visage_domain::UploadId;

/// Who receives the pieces of which file.
#[derive(Debug, Default)]
pub struct Receivers(Mutex<HashMap<UploadId, Line>>);

/// Those who want to receive pieces of one file.
#[derive(Debug, Default)]
struct Line {
    turn: Arc<tokio::sync::Mutex<()>>,
    newest: CancellationToken,
    count: usize,
}

/// A turn at a file, until it is dropped.
#[derive(Debug)]
pub struct Receiver {
    all: Arc<Receivers>,
    id: UploadId,
    turn: Option<OwnedMutexGuard<()>>,
    /// Set when somebody else wants to go on.
    pub taken_over: CancellationToken,
}

impl Receivers {
    fn lock(&self) -> MutexGuard<'_, HashMap<UploadId, Line>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Tells whoever receives pieces of a file to stop, and waits until that has ended.
    pub async fn take_over(self: &Arc<Self>, id: UploadId) -> Receiver {
        let taken_over = CancellationToken::new();
        let turn = {
            let mut lines = self.lock();
            let line = lines.entry(id).or_default();
            line.count += 1;
            std::mem::replace(&mut line.newest, taken_over.clone()).cancel();
            line.turn.clone()
        };
        // counted from here on, also when it is given up while it waits
        let mut receiver = Receiver { all: self.clone(), id, turn: None, taken_over };
        receiver.turn = Some(turn.lock_owned().await);
        receiver
    }
}

impl Drop for Receiver {
    fn drop(&mut self) {
        // the next one must not find the line gone and begin another
        self.turn = None;
        let mut lines = self.all.lock();
        if let Some(line) = lines.get_mut(&self.id) {
            line.count -= 1;
            if line.count == 0 {
                lines.remove(&self.id);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_newer_one_takes_over_and_nothing_is_left_behind() {
        let (receivers, id) = (Arc::new(Receivers::default()), UploadId::new());
        let first = receivers.take_over(id).await;
        let other = receivers.take_over(UploadId::new()).await;
        assert!(!first.taken_over.is_cancelled() && !other.taken_over.is_cancelled());
        let second = tokio::spawn({
            let receivers = receivers.clone();
            async move { receivers.take_over(id).await }
        });
        first.taken_over.cancelled().await;
        assert!(!second.is_finished(), "it waits until the first one has ended");
        drop(first);
        let second = second.await.expect("no panic");
        assert!(!second.taken_over.is_cancelled());
        drop((second, other));
        assert!(receivers.lock().is_empty());
    }

    #[tokio::test]
    async fn one_that_waits_in_vain_is_forgotten() {
        let (receivers, id) = (Arc::new(Receivers::default()), UploadId::new());
        let first = receivers.take_over(id).await;
        {
            let mut waiting = Box::pin(receivers.take_over(id));
            assert!(futures_util::poll!(&mut waiting).is_pending());
        }
        drop(first);
        assert!(receivers.lock().is_empty());
    }
}
