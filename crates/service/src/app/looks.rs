//! Many who wait for one job look at it together: each change would otherwise be as many reads, and as many answers written, as there are
//! clients.

use std::sync::{Arc, OnceLock};

use bytes::Bytes;

use super::context::ServiceContext;
use super::shared_reads::SharedReads;
use crate::storage::DatabaseError;
use visage_domain::{JobId, JobRecord};

/// Looks at jobs that are under way.
pub(super) type Looks = SharedReads<JobId, Look>;

/// A job as it was at some moment, for all who looked at it then.
#[derive(Debug)]
pub struct Look {
    job: JobRecord,
    shown: OnceLock<Bytes>,
}

impl Look {
    /// The job.
    pub fn job(&self) -> &JobRecord {
        &self.job
    }

    /// The job as it is shown to clients: written by the first who needs it.
    ///
    /// # Errors
    /// What `show` says.
    pub fn shown<E>(&self, show: impl FnOnce(&JobRecord) -> Result<Vec<u8>, E>) -> Result<Bytes, E> {
        if let Some(shown) = self.shown.get() {
            return Ok(shown.clone());
        }
        let shown = Bytes::from(show(&self.job)?);
        Ok(self.shown.get_or_init(|| shown).clone())
    }
}

/// A job as it was stored, with how far it had come, at some moment after this call.
pub async fn look_at(context: &ServiceContext, id: JobId) -> Result<Arc<Look>, DatabaseError> {
    let read = || {
        let (database, monitor) = (context.database.clone(), context.monitor.clone());
        async move {
            let mut job = database.job(id).await?;
            monitor.refresh(&mut job);
            Ok(Look { job, shown: OnceLock::new() })
        }
    };
    context.looks.get(id, read).await
}

#[cfg(test)]
mod tests {
    use super::super::context::testing::context;
    use super::*;
    use crate::storage::conformance::{new_job, scan_set};
    use visage_domain::JobStatus;

    #[tokio::test]
    async fn those_who_look_together_share_what_is_shown() {
        let (context, _place) = context().await;
        let database = context.database.as_ref();
        let job = new_job(scan_set(database, &["a.ply", "b.ply"]).await);
        database.create_job(&job, None, 10, None).await.expect("queued");
        let (first, second) = tokio::join!(look_at(&context, job.id), look_at(&context, job.id));
        let (first, second) = (first.expect("there"), second.expect("there"));
        assert!(Arc::ptr_eq(&first, &second));
        let written = first.shown(|job| Ok::<_, ()>(job.status.name().into())).expect("written");
        assert_eq!(second.shown(|_| Err(())), Ok(written), "it is written once");
        database.cancel_job(job.id).await.expect("canceled");
        let later = look_at(&context, job.id).await.expect("there");
        assert_eq!(later.job().status, JobStatus::Canceled);
        assert!(look_at(&context, JobId::new()).await.is_err());
    }
}
