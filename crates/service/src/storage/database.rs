//! What every database has to offer: a trait for each kind of thing that is kept, and [`Database`] for all of them.
//!
//! Values of `domain` go in and come out, errors are [`DatabaseError`]s. A write is whole or not at all, and there when it
//! has returned. The traits are used as `Arc<dyn Database>`: with a type parameter instead, every handler and with it the
//! table of routes would be generic. So calls return boxed futures (`async-trait`): beside a transaction that is nothing.

mod imports;
mod others;
mod recycle_bin;
mod searchers;
mod upkeep;
mod webhooks;

use std::collections::BTreeMap;
use std::fmt::Debug;
use std::time::Duration;

use async_trait::async_trait;

use super::{DatabaseError, Deleted, Unseen};
use visage_domain::{
    AssetRecord, AuditEntry, AuditFilter, Backlog, CancelAnswer, Claimant, Examples, FileId, Finish, JobClaim,
    JobFilter, JobId, JobRecord, KeyId, KeyRecord, KnownFiles, LooseFile, MatchedModel, ModelFacets, ModelFilter,
    ModelId, ModelRecord, NewJob, NewKey, NewModel, NewScanSet, NewSession, NewStandard, NewSurfaceJob, Outdated, Page,
    PageRequest, Parts, PoseFile, PutScan, Replay, ReplayKey, ScanRecord, ScanSetId, ScanSetRecord, SecretHash,
    SegmentId, SegmentRecord, SessionId, StandardId, StandardRecord, StoredContent, StoredFile, StoredSignature,
    StoredVerdict, Unfiled, UploadId, UploadRecord,
};
use visage_shape::standards::Standard;

pub use self::{
    imports::Imports, others::*, recycle_bin::RecycleBin, searchers::Searchers, upkeep::Upkeep, webhooks::Webhooks,
};

/// A database: everything that the service keeps besides files.
pub trait Database:
    ScanSets
    + Uploads
    + Jobs
    + JobQueue
    + Models
    + Imports
    + Signatures
    + Segments
    + Matches
    + Standards
    + Evaluations
    + Replays
    + Files
    + Keys
    + Audit
    + RecycleBin
    + Webhooks
    + Upkeep
    + Others
    + Searchers
    + Debug
    + Send
    + Sync
    + 'static
{
}

/// Scan sets: the ordered scans of one object and their pose file.
#[async_trait]
pub trait ScanSets {
    /// Stores a scan set, its scans and the answer that the client gets.
    async fn create_scan_set(&self, set: &NewScanSet, replay: Option<&Replay>) -> Result<(), DatabaseError>;

    /// One scan set with its scans.
    async fn scan_set(&self, id: ScanSetId) -> Result<ScanSetRecord, DatabaseError>;

    /// Scan sets, newest first.
    async fn scan_sets(&self, page: &PageRequest) -> Result<Page<ScanSetRecord>, DatabaseError>;

    /// Adds a scan to a set, or replaces the one of the same name. Refused while a job uses the set.
    async fn put_scan(&self, set: ScanSetId, scan: &ScanRecord, limit: usize) -> Result<PutScan, DatabaseError>;

    /// Takes a scan out of a set; answers with the file that is no longer used.
    async fn delete_scan(&self, set: ScanSetId, name: &str) -> Result<FileId, DatabaseError>;

    /// Sets the initial poses of a set. Refused while a job uses the set.
    async fn put_poses(&self, set: ScanSetId, poses: &PoseFile) -> Result<(), DatabaseError>;

    /// When a set is to be deleted, if that was said.
    async fn expiry(&self, id: ScanSetId) -> Result<Option<jiff::Timestamp>, DatabaseError>;

    /// Says when a set is to be deleted; `None` takes it back.
    async fn set_expiry(&self, id: ScanSetId, at: Option<jiff::Timestamp>) -> Result<(), DatabaseError>;

    /// Up to `limit` sets after the given one, in the order of their ids, that were to be deleted by this time.
    async fn expired_scan_sets(
        &self,
        now: jiff::Timestamp,
        after: Option<ScanSetId>,
        limit: usize,
    ) -> Result<Vec<ScanSetId>, DatabaseError>;

    /// Deletes a scan set with everything derived from it; answers with the models that went with it.
    async fn delete_scan_set(&self, id: ScanSetId) -> Result<Deleted, DatabaseError>;
}

/// Files that come piece by piece, each to become a scan.
#[async_trait]
pub trait Uploads {
    /// Stores one that nothing has arrived of yet; a set has at most so many that are not done.
    async fn create_upload(&self, upload: &UploadRecord, limit: usize) -> Result<(), DatabaseError>;

    /// One upload.
    async fn upload(&self, id: UploadId) -> Result<UploadRecord, DatabaseError>;

    /// The uploads for a set that are not done, oldest first.
    async fn uploads_of(&self, set: ScanSetId) -> Result<Vec<UploadRecord>, DatabaseError>;

    /// Says that one is given up later.
    async fn extend_upload(&self, id: UploadId, until: jiff::Timestamp) -> Result<(), DatabaseError>;

    /// Says that one has become a scan.
    async fn finish_upload(&self, id: UploadId) -> Result<(), DatabaseError>;

    /// Forgets one; no trouble if there is none.
    async fn delete_upload(&self, id: UploadId) -> Result<(), DatabaseError>;

    /// Forgets those that were to be given up by now.
    async fn forget_old_uploads(&self, now: jiff::Timestamp) -> Result<(), DatabaseError>;

    /// Those that are not done.
    async fn open_uploads(&self) -> Result<Vec<UploadId>, DatabaseError>;
}

/// Jobs as the API sees them: create, look up, list, cancel, retry, delete.
#[async_trait]
pub trait Jobs {
    /// Accepts a job; with `set`, its scan set is stored in the same transaction.
    async fn create_job(
        &self,
        job: &NewJob,
        set: Option<&NewScanSet>,
        queue_limit: usize,
        replay: Option<&Replay>,
    ) -> Result<(), DatabaseError>;

    /// Accepts a job that gives a model a surface.
    async fn create_surface_job(
        &self,
        job: &NewSurfaceJob,
        queue_limit: usize,
        replay: Option<&Replay>,
    ) -> Result<(), DatabaseError>;

    /// One job.
    async fn job(&self, id: JobId) -> Result<JobRecord, DatabaseError>;

    /// Jobs, newest first.
    async fn jobs(&self, filter: &JobFilter, page: &PageRequest) -> Result<Page<JobRecord>, DatabaseError>;

    /// Jobs that wait, and jobs that run.
    async fn queue_length(&self) -> Result<(u64, u64), DatabaseError>;

    /// Stops a job that waits, or asks the worker of a running one to stop.
    async fn cancel_job(&self, id: JobId) -> Result<CancelAnswer, DatabaseError>;

    /// Queues a failed or canceled job again, with all its attempts.
    async fn retry_job(&self, id: JobId, queue_limit: usize) -> Result<(), DatabaseError>;

    /// Deletes a finished job with the model it made.
    async fn delete_job(&self, id: JobId) -> Result<Deleted, DatabaseError>;
}

/// Jobs as the workers see them. A running job belongs to the worker that claimed it until its lease runs out; every
/// write of a worker is guarded by its id, so a worker whose job was taken over can neither finish it twice nor
/// overwrite it.
#[async_trait]
pub trait JobQueue {
    /// Takes the oldest job that waits or whose worker is gone, registrations before evaluations. One that does not fit
    /// beside those that run is waited for: smaller ones must not overtake it for ever. A job that was started
    /// `max_attempts` times without an end takes its worker down with it: it is failed instead.
    async fn claim_job(&self, claimant: &Claimant) -> Result<Option<JobClaim>, DatabaseError>;

    /// Extends the lease and writes the progress; answers whether a stop was asked for, or `None` if the job is
    /// no longer this worker's.
    async fn heartbeat(
        &self,
        claim: &JobClaim,
        lease: Duration,
        stage: Option<&str>,
        progress: f64,
        stage_seconds: &BTreeMap<String, f64>,
    ) -> Result<Option<bool>, DatabaseError>;

    /// Ends a job, and stores its model in the same transaction; the index has to follow before the answer is dropped.
    /// `None` if the job is no longer this worker's, or if it would succeed after a stop was asked for: then nothing is
    /// written.
    async fn finish_job(&self, claim: &JobClaim, finish: &Finish) -> Result<Option<Unseen>, DatabaseError>;

    /// Puts a job back into the queue at a shutdown: it costs no attempt.
    async fn give_back_job(&self, claim: &JobClaim) -> Result<bool, DatabaseError>;

    /// At the start of a server: takes back the jobs of processes that are gone. They are those of the process that had
    /// this handle's seat before, and those whose lease is over; what others run is theirs. They wait again (or are
    /// canceled, or are failed when they took down their process too often); answers with the number of them.
    async fn reclaim_jobs(&self, max_attempts: u32) -> Result<u64, DatabaseError>;
}

/// Models and the records of their files.
#[async_trait]
pub trait Models {
    /// Stores an uploaded model and the answer that the client gets. The index has to follow before the answer is
    /// dropped.
    async fn create_model(&self, model: &NewModel, replay: Option<&Replay>) -> Result<Unseen, DatabaseError>;

    /// Stores many uploaded models at once.
    async fn create_models(&self, models: &[NewModel]) -> Result<(), DatabaseError>;

    /// One model.
    async fn model(&self, id: ModelId) -> Result<ModelRecord, DatabaseError>;

    /// Models, newest first.
    async fn models(&self, filter: &ModelFilter, page: &PageRequest) -> Result<Page<ModelRecord>, DatabaseError>;

    /// The files of a model, by name.
    async fn assets(&self, id: ModelId) -> Result<Vec<AssetRecord>, DatabaseError>;

    /// Deletes a model with its files' records and its signature.
    async fn delete_model(&self, id: ModelId) -> Result<Deleted, DatabaseError>;
}

/// What is stored of models for retrieval.
#[async_trait]
pub trait Signatures {
    /// The signature of a model, if it has one.
    async fn signature(&self, id: ModelId) -> Result<Option<Vec<u8>>, DatabaseError>;

    /// The signatures of up to `limit` models, in the order of their ids, those after the given one.
    async fn signatures_after(
        &self,
        after: Option<ModelId>,
        limit: usize,
    ) -> Result<Vec<(ModelId, StoredContent)>, DatabaseError>;

    /// Puts a signature in the place of one of another version; `None` if the model is gone.
    async fn renew_signature(&self, id: ModelId, signature: &StoredSignature) -> Result<Option<Unseen>, DatabaseError>;

    /// Says that signatures are damaged: an evaluation makes them anew, from the models' files.
    async fn give_up_signatures(&self, ids: &[ModelId]) -> Result<(), DatabaseError>;
}

/// Which files of the index count for this handle's seat, a node, and of which models they don't tell what the signatures do. Both together are the whole index: a model
/// is what the files say of it, unless it is unfiled; then it is what its signature says, or gone if it has none. Whoever stores, changes or
/// deletes a signature makes its model unfiled in the same transaction.
#[async_trait]
pub trait Segments {
    /// Says that this handle's seat is a node with files of the index of its own: what they don't tell is kept for it from now on. For a
    /// node that is new everything is unfiled. To be called before all else here, and again within a week.
    async fn keep_index(&self) -> Result<(), DatabaseError>;

    /// The files that count.
    async fn segments(&self) -> Result<Vec<SegmentRecord>, DatabaseError>;

    /// Up to `limit` unfiled models of some parts, in the order of their ids, those after the given one.
    async fn unfiled_after(
        &self,
        parts: &Parts,
        after: Option<ModelId>,
        limit: usize,
    ) -> Result<Vec<Unfiled>, DatabaseError>;

    /// Makes all models of some parts unfiled, whatever files tell of them: the index is about to forget them.
    async fn unfile_parts(&self, parts: &Parts) -> Result<(), DatabaseError>;

    /// From now on files count, and others no longer: at once.
    async fn swap_segments(&self, new: &[SegmentRecord], old: &[SegmentId]) -> Result<(), DatabaseError>;

    /// Says that the files tell these models, given with the first half of the checksum of the signature that they know. Those
    /// with another signature by now stay unfiled.
    async fn file_models(&self, models: &[(ModelId, u128)]) -> Result<(), DatabaseError>;

    /// Says that no file tells anything of these models. Those that have a signature stay unfiled.
    async fn forget_unfiled(&self, models: &[ModelId]) -> Result<(), DatabaseError>;

    /// Files no longer count because they are damaged or gone: all models with a signature are unfiled but those that the other files
    /// tell, given in the order of their ids.
    async fn lose_segments(&self, lost: &[SegmentId], told: &[ModelId]) -> Result<(), DatabaseError>;
}

/// What queries need of models besides the index.
#[async_trait]
pub trait Matches {
    /// Those of the given models that are (still) there, ordered by id.
    async fn matched_models(&self, ids: &[ModelId]) -> Result<Vec<MatchedModel>, DatabaseError>;

    /// The models that have each of these words in their name or label, in large letters or small.
    async fn models_with_words(&self, words: &[String]) -> Result<Vec<ModelId>, DatabaseError>;

    /// The facets of all models that have a signature.
    async fn facets(&self) -> Result<Vec<(ModelId, ModelFacets)>, DatabaseError>;
}

/// Standards made by users, and the examples marked for them.
#[async_trait]
pub trait Standards {
    /// Stores a standard with its examples, and queues the evaluation of the stored models against it; answers with the
    /// job if there is anything to be done. `replay` makes the answer that is kept from that job.
    async fn create_standard(
        &self,
        standard: &NewStandard,
        limit: usize,
        replay: &(dyn Fn(Option<JobId>) -> Option<Replay> + Send + Sync),
    ) -> Result<Option<JobId>, DatabaseError>;

    /// All standards, in the order in which they were made.
    async fn standards(&self) -> Result<Vec<StandardRecord>, DatabaseError>;

    /// The standard with this name or id.
    async fn standard(&self, name_or_id: &str) -> Result<StandardRecord, DatabaseError>;

    /// Puts a standard that was made anew in the place of one of another version.
    async fn renew_standard(&self, id: StandardId, standard: &Standard) -> Result<(), DatabaseError>;

    /// The examples of a standard.
    async fn examples(&self, id: StandardId) -> Result<Examples, DatabaseError>;

    /// Puts examples in the place of those that were marked before.
    async fn mark_examples(&self, id: StandardId, examples: &Examples) -> Result<(), DatabaseError>;

    /// Deletes a standard with its examples and the verdicts against it.
    async fn delete_standard(&self, id: StandardId) -> Result<(), DatabaseError>;
}

/// What is to be looked at again, and verdicts. What is missing follows from what is stored, so an evaluation that is
/// broken off goes on where it stood, and sees what comes meanwhile.
#[async_trait]
pub trait Evaluations {
    /// How much there is to be done.
    async fn backlog(&self) -> Result<Backlog, DatabaseError>;

    /// Models with something to be done, after the given one in the order of ids, at most `limit`.
    async fn outdated(&self, after: Option<ModelId>, limit: usize) -> Result<Vec<Outdated>, DatabaseError>;

    /// Keeps verdicts; those on models or against standards that are gone are dropped.
    async fn keep_verdicts(&self, verdicts: &[StoredVerdict]) -> Result<(), DatabaseError>;

    /// The verdicts against a standard, least residual first, ties by id; at most `limit`.
    async fn ranking(&self, id: StandardId, limit: usize) -> Result<Vec<StoredVerdict>, DatabaseError>;

    /// How many models have a verdict against a standard, and how many have none yet.
    async fn judged(&self, id: StandardId) -> Result<(u64, u64), DatabaseError>;

    /// The verdicts on a model, by standard.
    async fn verdicts_on(&self, id: ModelId) -> Result<Vec<StoredVerdict>, DatabaseError>;

    /// The residuals of a standard's examples: of its class, and of others. Those without a verdict are left out.
    async fn example_residuals(&self, id: StandardId) -> Result<(Vec<f64>, Vec<f64>), DatabaseError>;

    /// Whether a registration waits, for which an evaluation should give way.
    async fn registration_waits(&self) -> Result<bool, DatabaseError>;

    /// Queues an evaluation if there is anything to be done and none waits already.
    async fn queue_evaluation(&self) -> Result<Option<JobId>, DatabaseError>;

    /// Queues an evaluation unless one waits already; answers with the one that waits. `replay` makes the answer that
    /// is kept from that job.
    async fn demand_evaluation(
        &self,
        replay: &(dyn for<'r> Fn(&'r JobRecord) -> Option<Replay> + Send + Sync),
    ) -> Result<JobRecord, DatabaseError>;
}

/// Answers kept for repeated POSTs, stored with what they created.
#[async_trait]
pub trait Replays {
    /// The answer given to this request before, if it was. Another body under the same key is an error.
    async fn replay(&self, key: &ReplayKey) -> Result<Option<Replay>, DatabaseError>;

    /// Forgets answers that are older than a day.
    async fn forget_old_replays(&self) -> Result<u64, DatabaseError>;
}

/// Which files belong to the database, and which may be there though no row knows them.
#[async_trait]
pub trait Files {
    /// The files that rows refer to, and those that no row needs to know, in one snapshot.
    async fn known_files(&self) -> Result<(KnownFiles, Vec<LooseFile>), DatabaseError>;

    /// Says that files are about to be put in their places, by this handle's owner. The row that knows one takes this
    /// back.
    async fn expect_files(&self, files: &[StoredFile]) -> Result<(), DatabaseError>;

    /// Says that a file is gone, or has a row after all.
    async fn forget_loose(&self, files: &[StoredFile]) -> Result<(), DatabaseError>;
}

/// Keys, and sessions of browsers that have shown one.
#[async_trait]
pub trait Keys {
    /// Stores a key; there may be so many that are not revoked.
    async fn create_key(&self, key: &NewKey, limit: usize) -> Result<(), DatabaseError>;

    /// Keys, newest first; revoked ones too.
    async fn keys(&self, page: &PageRequest) -> Result<Page<KeyRecord>, DatabaseError>;

    /// One key with the hash of its secret.
    async fn key(&self, id: KeyId) -> Result<Option<(KeyRecord, SecretHash)>, DatabaseError>;

    /// Whether there was ever a key.
    async fn has_keys(&self) -> Result<bool, DatabaseError>;

    /// Revokes a key and ends its sessions; no trouble if it was revoked before.
    async fn revoke_key(&self, id: KeyId) -> Result<(), DatabaseError>;

    /// Stores a session.
    async fn create_session(&self, session: &NewSession) -> Result<(), DatabaseError>;

    /// One session.
    async fn session(&self, id: SessionId) -> Result<Option<NewSession>, DatabaseError>;

    /// Ends a session; no trouble if there is none.
    async fn delete_session(&self, id: SessionId) -> Result<(), DatabaseError>;

    /// Forgets sessions that are over.
    async fn forget_old_sessions(&self) -> Result<u64, DatabaseError>;
}

/// The audit log.
#[async_trait]
pub trait Audit {
    /// Adds an entry, on a full disk too; what was made counts for its key from then on.
    async fn record(&self, entry: &AuditEntry) -> Result<(), DatabaseError>;

    /// Entries, newest first.
    async fn audit(&self, filter: &AuditFilter, page: &PageRequest) -> Result<Page<AuditEntry>, DatabaseError>;

    /// Jobs of a key that wait or run; of those who needed none, for `None`.
    async fn jobs_waiting_of(&self, key: Option<KeyId>) -> Result<u64, DatabaseError>;

    /// Bytes of the files that a key has sent or had made and that are kept.
    async fn bytes_stored_of(&self, key: Option<KeyId>) -> Result<u64, DatabaseError>;

    /// Forgets entries from before this time.
    async fn forget_audit_before(&self, time: jiff::Timestamp) -> Result<u64, DatabaseError>;
}
