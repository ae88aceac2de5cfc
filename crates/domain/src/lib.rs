//! What the service keeps and what its users may choose, as plain values: no files, no database, no requests.
//!
//! - [`asset`]: the files of models and standards, by name, media type and role
//! - [`options`]: what the caller of a job may choose, a line each
//! - `ids`: what everything is called by; `owner`: who holds leases and files in the making
//! - `scan_set`, `job`, `model`, `signature`, `standard`, `evaluation`, `replay`: records, as they are stored and given back
//! - `job_kind`, `job_status`, `queue`: what jobs are for, where they stand, and how workers take and end them
//! - `segment`: files of the index, and what they don't tell; `parts`: into which the gallery is divided among servers, and who has which;
//!   `searcher`: servers that search some of them
//! - `import`: models that come from another data folder
//! - `key`, `audit`: who may ask, and for what; who did what; `webhook`: addresses that get messages, and of which events
//! - `upload`: files that come piece by piece; `recycle_bin`: what was deleted and can still be put back
//! - `stored_file`: what is kept as files; `census`: how much; `page`: lists, page by page

#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used))]

pub mod asset;
mod audit;
mod census;
mod evaluation;
mod ids;
mod import;
mod job;
mod job_kind;
mod job_status;
mod key;
mod model;
pub mod options;
mod owner;
mod page;
mod parts;
mod queue;
mod recycle_bin;
mod replay;
mod scan_set;
mod searcher;
mod segment;
mod signature;
mod standard;
mod stored_file;
mod upload;
mod webhook;

pub use audit::{AuditEntry, AuditFilter};
pub use census::Census;
pub use evaluation::{Backlog, Outdated, StoredVerdict};
pub use ids::{
    AuditId, BinId, DeliveryId, FileId, FolderId, JobId, KeyId, ModelId, ProcessId, ScanSetId, SeatId, SegmentId,
    SessionId, StandardId, UploadId, WebhookId,
};
pub use import::ImportedModel;
pub use job::{CancelAnswer, JobBase, JobError, JobFilter, JobRecord, NewJob, NewSurfaceJob};
pub use job_kind::JobKind;
pub use job_status::JobStatus;
pub use key::{KeyRecord, NewKey, NewSession, Scope, SecretHash};
pub use model::{AssetRecord, MatchedModel, ModelFacets, ModelFilter, ModelRecord, NewModel};
pub use owner::{Owner, WorkerId};
pub use page::{Page, PageRequest};
pub use parts::{COPIES, NoParts, PARTS, Part, Parts, part_of, part_of_number, placed, placed_on, weight};
pub use queue::{Claimant, Finish, JobClaim, Room};
pub use recycle_bin::{BinDue, BinRecord, Deletable};
pub use replay::{Replay, ReplayKey};
pub use scan_set::{NewScanSet, PassedOver, PoseFile, PutScan, ScanRecord, ScanSetRecord, sort_naturally};
pub use searcher::{NodeSecret, Searcher};
pub use segment::{SegmentRecord, Unfiled};
pub use signature::{StoredContent, StoredSignature};
pub use standard::{Examples, NewStandard, StandardRecord};
pub use stored_file::{KnownFiles, LooseFile, StoredFile};
pub use upload::UploadRecord;
/// What a person said of the scans of a job.
pub use visage_registration::hints::Hints;
pub use webhook::{
    Attempt, DeliveryClaim, DeliveryRecord, DeliveryStatus, Event, EventKind, NewWebhook, WebhookRecord, WebhookSecret,
};
