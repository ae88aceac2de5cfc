//! Jobs are ordered, stopped, tried again and deleted.

use super::context::ServiceContext;
use super::looks::look_at;
use super::models;
use super::recycle_bin::{self, Removal};
use super::scan_sets::{self, ReceivedScans};
use crate::storage::DatabaseError;
use crate::storage::inventory::StorageError;
use visage_domain::{Deletable, JobId, JobRecord, NewJob, NewScanSet, NewSurfaceJob, Replay, StoredFile};

/// Queues a registration, with the answer that the client gets. A scan set that comes with it is stored with it: either
/// both are or neither. Must run to its end.
pub async fn register(
    context: &ServiceContext,
    job: &NewJob,
    upload: Option<(NewScanSet, ReceivedScans)>,
    replay: Option<&Replay>,
) -> Result<(), StorageError> {
    let most = context.config.limits.queued_jobs;
    match upload {
        Some((set, files)) => {
            scan_sets::keep(context, set.id, files).await?;
            let created = context.database.create_job(job, Some(&set), most, replay).await;
            context.storage().or_remove(StoredFile::ScanSet(set.id), created).await?;
        }
        None => context.database.create_job(job, None, most, replay).await?,
    }
    announce(context, job.id);
    Ok(())
}

/// Queues a job that gives a model a surface, with the answer that the client gets.
pub async fn surface(
    context: &ServiceContext,
    job: &NewSurfaceJob,
    replay: Option<&Replay>,
) -> Result<(), DatabaseError> {
    context.database.create_surface_job(job, context.config.limits.queued_jobs, replay).await?;
    announce(context, job.id);
    Ok(())
}

/// Queues an evaluation, or answers with the one that waits.
pub async fn evaluate(
    context: &ServiceContext,
    replay: &(dyn for<'r> Fn(&'r JobRecord) -> Option<Replay> + Send + Sync),
) -> Result<JobRecord, DatabaseError> {
    let job = context.database.demand_evaluation(replay).await?;
    announce(context, job.id);
    Ok(job)
}

/// Tells the workers of a job, and by which request it was ordered.
fn announce(context: &ServiceContext, id: JobId) {
    if let Some(traceparent) = context.traces.traceparent() {
        context.monitor.ordered(id, traceparent);
    }
    context.monitor.announce_work();
}

/// A job as it stands now.
pub async fn look_up(context: &ServiceContext, id: JobId) -> Result<JobRecord, DatabaseError> {
    Ok(look_at(context, id).await?.job().clone())
}

/// Stops a job: at once if it waits, within a second if it runs.
pub async fn cancel(context: &ServiceContext, id: JobId) -> Result<JobRecord, DatabaseError> {
    context.database.cancel_job(id).await?;
    context.monitor.cancel(id);
    look_up(context, id).await
}

/// Queues a failed or canceled job again.
pub async fn retry(context: &ServiceContext, id: JobId) -> Result<JobRecord, DatabaseError> {
    context.database.retry_job(id, context.config.limits.queued_jobs).await?;
    context.monitor.announce_work();
    look_up(context, id).await
}

/// Deletes a finished job with the model it made.
pub async fn delete(context: &ServiceContext, id: JobId, removal: Removal) -> Result<(), StorageError> {
    if removal == Removal::IntoBin {
        return recycle_bin::put(context, Deletable::Job(id)).await;
    }
    let deleted = context.database.delete_job(id).await?;
    context.monitor.announce_change();
    models::forget(context, deleted).await
}
