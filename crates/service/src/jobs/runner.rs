//! Claims jobs, keeps their leases, and ends them by one of the named ends.
//!
//! Each worker is an async task that owns at most one job; the job itself runs on a thread of its own (`work`).
//! A worker claims nothing after a stop was asked for, and gives its job back instead of failing it.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use tokio::sync::oneshot;
use tokio::task::JoinHandle;
use tokio_util::sync::CancellationToken;
use tracing::Instrument;

use super::evaluation::Evaluation;
use super::memory::{Budget, TooLarge};
use super::resurface::Resurfacing;
use super::watchdog::Watchdog;
use super::work::{Made, Work, WorkError, pooled};
use crate::app::context::ServiceContext;
use crate::app::monitor::{Entry, StopReason};
use crate::config::QueueTiming;
use crate::storage::DatabaseError;
use visage_domain::{Claimant, Finish, JobClaim, JobError, ModelId, StoredFile, WorkerId};
use visage_geometry::progress::Progress;

/// How long a worker waits after the database has failed it, or when the machine is out of something.
const PAUSE_AFTER_ERROR: Duration = Duration::from_secs(1);

/// The running workers.
#[derive(Debug)]
pub struct Runner {
    workers: Vec<JoinHandle<()>>,
}

impl Runner {
    /// Starts `config.concurrent_jobs` workers that run until `stop`; none where jobs are left to others. With `crash`, they also drop what they hold
    /// as if the process had been killed.
    pub fn start(context: &ServiceContext, stop: &CancellationToken, crash: &CancellationToken) -> Runner {
        let worker = |index: usize| {
            let id = context.database.owner().worker(index);
            let work =
                Worker { context: context.clone(), id, stop: stop.clone(), has_complained: AtomicBool::new(false) };
            let crash = crash.clone();
            tokio::spawn(async move {
                tokio::select! {
                    () = work.run() => {}
                    () = crash.cancelled() => {}
                }
            })
        };
        let workers = if context.config.roles.worker { context.config.concurrent_jobs.max(1) } else { 0 };
        Runner { workers: (0..workers).map(worker).collect() }
    }

    /// Waits until all workers have ended.
    pub async fn ended(self) {
        for worker in self.workers {
            if let Err(error) = worker.await {
                tracing::error!("a worker ended badly: {error}");
            }
        }
    }
}

struct Worker {
    context: ServiceContext,
    id: WorkerId,
    stop: CancellationToken,
    /// Whether it has said that the database fails it: a full disk is said once and not with every heartbeat.
    has_complained: AtomicBool,
}

impl Worker {
    async fn run(self) {
        let _hired = self.context.monitor.hire(self.id);
        while !self.stop.is_cancelled() {
            match self.claim().await {
                Ok(Some((claim, entry))) => {
                    self.relieved();
                    // an announcement wakes one worker: pass it on, there may be more than one job
                    self.context.monitor.announce_work();
                    let span = tracing::info_span!("job", job.id = %claim.job.id, attempt = claim.job.attempts);
                    if let Some(traceparent) = self.context.monitor.taken_up(claim.job.id) {
                        self.context.traces.go_on(&span, &traceparent);
                    }
                    entry.tracker.within(span.clone());
                    self.run_job(claim, entry).instrument(span).await;
                }
                Ok(None) => {
                    self.relieved();
                    self.wait(self.timing().poll).await;
                }
                Err(error) => {
                    self.complain("claiming a job", &error);
                    tokio::select! {
                        () = tokio::time::sleep(PAUSE_AFTER_ERROR) => {}
                        () = self.stop.cancelled() => {}
                    }
                }
            }
        }
    }

    fn timing(&self) -> &QueueTiming {
        &self.context.config.queue
    }

    /// Takes a job and says so to the monitor, one worker after the other.
    async fn claim(&self) -> Result<Option<(JobClaim, Entry)>, DatabaseError> {
        let monitor = &self.context.monitor;
        let _turn = monitor.claiming.lock().await;
        let claimant = Claimant {
            worker: self.id,
            living: monitor.living(),
            lease: self.timing().lease,
            max_attempts: self.timing().max_attempts,
            room: self.budget().room(monitor.running_points()),
        };
        let claim = self.context.database.claim_job(&claimant).await?;
        Ok(claim.map(|claim| {
            let entry = monitor.enter(claim.job.id, claim.job.kind, claim.points);
            (claim, entry)
        }))
    }

    fn budget(&self) -> Budget {
        Budget(self.context.config.job_memory_bytes)
    }

    /// Says that the database fails, once.
    fn complain(&self, doing: &str, error: &DatabaseError) {
        if !self.has_complained.swap(true, Ordering::Relaxed) {
            tracing::error!("{doing}: {error}; it is tried again");
        }
    }

    fn relieved(&self) {
        if self.has_complained.swap(false, Ordering::Relaxed) {
            tracing::info!("the database takes writes again");
        }
    }

    async fn wait(&self, at_most: Duration) {
        tokio::select! {
            () = self.context.monitor.work_announced() => {}
            () = tokio::time::sleep(at_most) => {}
            () = self.stop.cancelled() => {}
        }
    }

    async fn run_job(&self, claim: JobClaim, entry: Entry) {
        tracing::info!("the job begins");
        let made = match self.start_work(&claim, &entry).await {
            Ok(result) => self.watch(&claim, &entry, result).await,
            Err(error) => Err(error),
        };
        // the last heartbeat: stage, progress and seconds as they are at the end
        self.beat(&claim, &entry).await;
        self.end_surely(&claim, &entry, &made).await;
    }

    /// Writes how the job ended, as soon as that is possible: a full disk or a lock of another program costs no work.
    async fn end_surely(&self, claim: &JobClaim, entry: &Entry, made: &Result<Option<Made>, WorkError>) {
        loop {
            match self.end_job(claim, entry, made).await {
                Ok(()) => {
                    self.relieved();
                    // by what is stored: one that was taken over, or deleted, is not counted here
                    if let Ok(job) = self.context.database.job(claim.job.id).await {
                        self.context.monitor.figures.job_ended(&job);
                    }
                    return;
                }
                Err(error) if self.stop.is_cancelled() => {
                    // the next start runs it again
                    tracing::error!("the end of the job could not be written: {error}");
                    return;
                }
                Err(error) => self.complain("writing the end of the job", &error),
            }
            tokio::select! {
                () = tokio::time::sleep(PAUSE_AFTER_ERROR) => {}
                () = self.stop.cancelled() => {}
            }
        }
    }

    /// Starts the job's thread.
    async fn start_work(&self, claim: &JobClaim, entry: &Entry) -> Result<WorkResult, WorkError> {
        let server_threads = self.context.config.threads.max(1);
        let threads = claim.job.options.threads.unwrap_or(server_threads).clamp(1, server_threads);
        let progress = Progress::new(entry.tracker.clone(), entry.stop.flag());
        if let Some(model) = claim.job.surfaced_model() {
            self.budget().admit(claim.points)?;
            let work = Resurfacing {
                job: claim.job.clone(),
                model,
                database: self.context.database.clone(),
                runtime: tokio::runtime::Handle::current(),
                objects: self.context.objects.clone(),
                limits: self.context.config.limits,
                threads,
                tracker: entry.tracker.clone(),
                progress,
            };
            return spawned(move || pooled(threads, || work.run()).map(Some));
        }
        let Some(set) = claim.job.scan_set_id else {
            let evaluation = self.evaluation(progress);
            return spawned(move || pooled(threads, || evaluation.run()).map(|()| None));
        };
        self.budget().admit(claim.points)?;
        let set = self.context.database.scan_set(set).await?;
        let work = Work {
            job: claim.job.clone(),
            set,
            database: self.context.database.clone(),
            runtime: tokio::runtime::Handle::current(),
            objects: self.context.objects.clone(),
            engine: self.context.engine.clone(),
            limits: self.context.config.limits,
            threads,
            tracker: entry.tracker.clone(),
            progress,
        };
        spawned(move || work.run().map(Some))
    }

    fn evaluation(&self, progress: Progress) -> Evaluation {
        Evaluation {
            database: self.context.database.clone(),
            objects: self.context.objects.clone(),
            gallery: self.context.gallery.clone(),
            engine: self.context.engine.clone(),
            limits: self.context.config.limits,
            progress,
            runtime: tokio::runtime::Handle::current(),
        }
    }

    /// Keeps the lease and listens for stops until the job's thread has ended.
    async fn watch(&self, claim: &JobClaim, entry: &Entry, mut result: WorkResult) -> Result<Option<Made>, WorkError> {
        let mut watchdog = Watchdog::new(self.timing());
        let mut heartbeat = tokio::time::interval(self.timing().heartbeat);
        heartbeat.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
        let is_deaf = loop {
            tokio::select! {
                ended = &mut result => {
                    return ended.unwrap_or_else(|_| Err(WorkError::Failed(defect("the job's thread vanished"))));
                }
                _ = heartbeat.tick() => {
                    self.beat(claim, entry).await;
                    if watchdog.gives_up(entry) {
                        break true;
                    }
                }
                () = self.stop.cancelled() => break false,
            }
        };
        if is_deaf {
            self.leave_behind(claim, result);
            return Err(WorkError::Stopped);
        }
        // a thread that does not listen is left behind: it can write nothing any more
        entry.stop.raise(StopReason::Shutdown);
        match tokio::time::timeout(self.context.config.shutdown_deadline / 2, result).await {
            Ok(Ok(ended)) => ended,
            Ok(Err(_)) | Err(_) => Err(WorkError::Stopped),
        }
    }

    /// Lets the thread of a job go on that does not listen: what it makes is thrown away, and its memory counts until it ends.
    fn leave_behind(&self, claim: &JobClaim, result: WorkResult) {
        tracing::error!("the job does not stop: its thread is left behind");
        let left = self.context.monitor.leave_behind(claim.points);
        let context = self.context.clone();
        let ended = async move {
            if let Ok(Ok(Some(made))) = result.await
                && let Err(error) = discard(&context, made.model.id).await
            {
                tracing::warn!("files of a model that nobody wants: {error}");
            }
            drop(left);
            tracing::info!("the thread that was left behind has ended");
        };
        tokio::spawn(ended.in_current_span());
    }

    /// One heartbeat: extends the lease, writes the progress, reads the cancel flag.
    async fn beat(&self, claim: &JobClaim, entry: &Entry) {
        let now = entry.tracker.snapshot();
        let stage = now.stage.map(visage_geometry::progress::Stage::name);
        let beat = self.context.database.heartbeat(claim, self.timing().lease, stage, now.progress, &now.stage_seconds);
        match beat.await {
            Ok(Some(true)) => entry.stop.raise(StopReason::Canceled),
            Ok(Some(false)) => self.relieved(),
            Ok(None) => entry.stop.raise(StopReason::LeaseLost),
            // the lease outlives many missed heartbeats
            Err(error) => self.complain("writing the progress", &error),
        }
    }

    /// Writes how the job ended.
    async fn end_job(
        &self,
        claim: &JobClaim,
        entry: &Entry,
        made: &Result<Option<Made>, WorkError>,
    ) -> Result<(), DatabaseError> {
        match made {
            Ok(Some(made)) => self.succeed(claim, made).await,
            Ok(None) => {
                if self.context.database.finish_job(claim, &Finish::Succeeded(None)).await?.is_none() {
                    drop(self.context.database.finish_job(claim, &Finish::Canceled).await?);
                }
                Ok(())
            }
            Err(WorkError::Failed(error)) => {
                self.context.database.finish_job(claim, &Finish::Failed(error.clone())).await.map(drop)?;
                tracing::warn!(code = error.code, scan = error.scan, "the job failed: {}", error.message);
                Ok(())
            }
            Err(WorkError::GivesWay) => {
                tracing::info!("the job gives way to registrations");
                self.context.database.give_back_job(claim).await.map(drop)
            }
            Err(WorkError::Later(reason)) => {
                tracing::warn!("the job waits: {reason}");
                // others need what is left, and this job gets no further before they have ended
                tokio::select! {
                    () = tokio::time::sleep(PAUSE_AFTER_ERROR) => {}
                    () = self.stop.cancelled() => {}
                }
                self.context.database.give_back_job(claim).await.map(drop)
            }
            Err(WorkError::Stopped) => match entry.stop.reason() {
                Some(StopReason::Canceled) => {
                    tracing::info!("the job was canceled");
                    self.context.database.finish_job(claim, &Finish::Canceled).await.map(drop)
                }
                Some(StopReason::LeaseLost) => {
                    tracing::warn!("the job was taken over by another worker");
                    Ok(())
                }
                Some(StopReason::Shutdown) => {
                    tracing::info!("the job is given back");
                    self.context.database.give_back_job(claim).await.map(drop)
                }
                Some(StopReason::Stuck) => {
                    let stage = entry.tracker.snapshot().stage.map_or("its beginning", |stage| stage.name());
                    let error = JobError {
                        code: "stuck".to_owned(),
                        message: format!(
                            "the job showed no sign of life for {} s in {stage}",
                            self.timing().stall.as_secs()
                        ),
                        scan: None,
                        hint: "this is a defect of visage: please report it with the job's id; other jobs go on"
                            .to_owned(),
                    };
                    self.context.database.finish_job(claim, &Finish::Failed(error)).await.map(drop)?;
                    tracing::error!("the job is stuck");
                    Ok(())
                }
                None => {
                    let error = defect("the job stopped though nobody asked for it");
                    self.context.database.finish_job(claim, &Finish::Failed(error)).await.map(drop)
                }
            },
        }
    }

    async fn succeed(&self, claim: &JobClaim, made: &Made) -> Result<(), DatabaseError> {
        let id = made.model.id;
        let finish = Finish::Succeeded(Some(Box::new(made.model.clone())));
        let unseen = self.context.database.finish_job(claim, &finish).await?;
        // an earlier try may have been written though its answer was lost
        if unseen.is_some() || self.context.database.model(id).await.is_ok() {
            if let Some(signature) = &made.signature {
                self.context.gallery.publish(self.context.database.as_ref(), id, signature.clone()).await?;
            }
            drop(unseen);
            tracing::info!(model.id = %id, "the job succeeded");
            return Ok(());
        }
        // canceled or taken over at the last moment: nobody knows these files
        discard(&self.context, id).await?;
        self.context.database.finish_job(claim, &Finish::Canceled).await.map(drop)
    }
}

/// Takes away the files of a model that nobody wants.
async fn discard(context: &ServiceContext, id: ModelId) -> Result<(), DatabaseError> {
    let objects = context.objects.clone();
    match tokio::task::spawn_blocking(move || objects.remove(StoredFile::Model(id))).await {
        Ok(Ok(())) => context.database.forget_loose(&[StoredFile::Model(id)]).await?,
        Ok(Err(error)) => tracing::warn!("files of a model that nobody wants: {error}"),
        Err(error) => tracing::warn!("files of a model that nobody wants: {error}"),
    }
    Ok(())
}

fn defect(message: &str) -> JobError {
    JobError {
        code: "internal_panic".to_owned(),
        message: message.to_owned(),
        scan: None,
        hint: "this is a defect of visage: please report it with the job's id".to_owned(),
    }
}

type WorkResult = oneshot::Receiver<Result<Option<Made>, WorkError>>;

/// Starts work on a thread of its own: the runtime does not wait for it when the shutdown deadline has passed.
fn spawned(work: impl FnOnce() -> Result<Option<Made>, WorkError> + Send + 'static) -> Result<WorkResult, WorkError> {
    let (send, receive) = oneshot::channel();
    let span = tracing::Span::current();
    std::thread::Builder::new()
        .name("job".to_owned())
        .spawn(move || {
            let _span = span.entered();
            // nobody listens any more when the worker has gone
            let _ = send.send(work());
        })
        .map_err(|error| WorkError::Later(format!("starting the job's thread: {error}")))?;
    Ok(receive)
}

impl From<TooLarge> for WorkError {
    fn from(error: TooLarge) -> Self {
        super::work::failed("too_little_memory", error.to_string(), None, TooLarge::HINT)
    }
}
