//! Many who wait for one job look at it together: each change would otherwise be as many reads as there are clients.

use std::collections::HashMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::storage::{Database, DatabaseError};
use visage_domain::{JobId, JobRecord};

/// The last look at a job, and how many had asked when it began.
type Last = (u64, Option<Arc<JobRecord>>);

#[derive(Debug, Default)]
struct Place {
    asked: AtomicU64,
    /// Held while somebody looks.
    last: tokio::sync::Mutex<Last>,
}

/// Looks at jobs that are under way.
#[derive(Debug, Default)]
pub(super) struct Looks(Mutex<HashMap<JobId, Arc<Place>>>);

impl Looks {
    /// A job as it was stored at some moment after this call: whoever asks while another one looks shares the look that follows, never
    /// the one that has begun before.
    pub(super) async fn job(&self, database: &dyn Database, id: JobId) -> Result<Arc<JobRecord>, DatabaseError> {
        let visit = Visit { looks: self, id, place: self.lock().entry(id).or_default().clone() };
        let place = &visit.place;
        let turn = place.asked.fetch_add(1, Ordering::SeqCst) + 1;
        let mut last = place.last.lock().await;
        if let (begun, Some(job)) = &*last
            && *begun >= turn
        {
            return Ok(job.clone());
        }
        let begun = place.asked.load(Ordering::SeqCst);
        let job = Arc::new(database.job(id).await?);
        *last = (begun, Some(job.clone()));
        Ok(job)
    }

    fn lock(&self) -> MutexGuard<'_, HashMap<JobId, Arc<Place>>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Somebody who looks, or waits to; the last one to leave takes the place away.
struct Visit<'a> {
    looks: &'a Looks,
    id: JobId,
    place: Arc<Place>,
}

impl Drop for Visit<'_> {
    fn drop(&mut self) {
        let mut places = self.looks.lock();
        // the map's and this one: nobody can take another one meanwhile
        if Arc::strong_count(&self.place) <= 2 {
            places.remove(&self.id);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::future::Future;
    use std::pin::pin;
    use std::task::{Context, Waker};

    use super::super::context::testing::context;
    use super::*;
    use crate::storage::conformance::{new_job, scan_set};
    use visage_domain::JobStatus;

    #[tokio::test]
    async fn a_look_that_began_before_is_not_shared_and_one_that_follows_is() {
        let (context, _place) = context().await;
        let database = context.database.as_ref();
        let job = new_job(scan_set(database, &["a.ply", "b.ply"]).await);
        database.create_job(&job, None, 10, None).await.expect("queued");
        let looks = Looks::default();
        // somebody looks
        let place = looks.lock().entry(job.id).or_default().clone();
        let looking = place.last.lock().await;
        let (mut first, mut second) = (pin!(looks.job(database, job.id)), pin!(looks.job(database, job.id)));
        let mut nobody = Context::from_waker(Waker::noop());
        assert!(first.as_mut().poll(&mut nobody).is_pending() && second.as_mut().poll(&mut nobody).is_pending());
        database.cancel_job(job.id).await.expect("canceled");
        drop(looking);
        let (first, second) = (first.await.expect("there"), second.await.expect("there"));
        assert_eq!(first.status, JobStatus::Canceled, "it was looked at after it was asked for");
        assert!(Arc::ptr_eq(&first, &second), "one look for both");
        assert!(
            !Arc::ptr_eq(&first, &looks.job(database, job.id).await.expect("there")),
            "and another one for who asks later"
        );
        drop(place);
        assert!(looks.job(database, JobId::new()).await.is_err());
        looks.job(database, job.id).await.expect("there");
        assert!(looks.lock().is_empty());
    }
}
