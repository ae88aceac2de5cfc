//! What every backend has to keep, as tests that take any of them.
//!
//! A backend implements [`DatabasePlace`] or [`ObjectPlace`] for its tests and calls [`database_conformance`] or
//! [`object_conformance`]: each check becomes a test of its own, on a place of its own.

pub mod files;
pub mod jobs;
pub mod memory;
pub mod objects;
pub mod queue;
pub mod records;
pub mod segment_files;
pub mod segments;

use std::sync::{Arc, LazyLock};
use std::time::Duration;

use async_trait::async_trait;

use super::{Database, ObjectStore};
use visage_domain::options::Options;
use visage_domain::{
    Claimant, FileId, JobId, NewJob, NewScanSet, ProcessId, ScanRecord, ScanSetId, SeatId, StoredFile, WorkerId,
};

/// A database that is made for a test, empty, and goes with it.
#[async_trait]
pub trait DatabasePlace: Sized + Send + Sync {
    /// A new one.
    async fn new() -> Self;
    /// A process begins to use it from a seat, beside all others that do.
    async fn open(&self, seat: SeatId) -> Arc<dyn Database>;
    /// The same, but nothing large can be stored any more.
    async fn open_full(&self) -> Arc<dyn Database>;
}

/// A place for files that is made for a test, empty, and goes with it.
pub trait ObjectPlace: Sized + Send + Sync {
    /// A new one.
    fn new() -> Self;
    /// A process begins to use it; the one before has ended (nobody holds what this has given).
    fn open(&self) -> Arc<dyn ObjectStore>;
    /// Changes a byte behind the store's back; `asset` is the name of the file, if it is one of several.
    fn damage(&self, file: StoredFile, asset: Option<&str>);
}

/// Runs a kind of database through all checks.
macro_rules! database_conformance {
    ($place:ty $(, #[$attribute:meta])?) => {
        $crate::storage::conformance::checks! { $(#[$attribute])? <$place as $crate::storage::conformance::DatabasePlace>::new().await;
            queue {
                jobs_are_claimed_once_and_in_order,
                a_worker_that_lost_its_lease_writes_nothing,
                giving_back_costs_no_attempt,
                a_job_that_takes_the_server_down_thrice_is_failed,
                a_stop_that_was_asked_for_beats_success,
                a_canceled_job_of_a_dead_server_is_not_run_again,
                success_stores_the_model_with_the_job,
                a_pause_longer_than_the_lease_costs_no_attempt,
                every_job_has_one_worker,
                a_process_leaves_what_another_one_runs_until_the_lease_is_over,
                a_process_takes_back_at_once_what_was_run_from_its_seat,
                a_job_waits_until_there_is_room_for_it_and_is_not_overtaken,
            }
            jobs {
                the_queue_has_an_end,
                limits_hold_for_processes_that_ask_at_once,
                a_waiting_job_is_canceled_at_once_and_can_be_retried,
                a_scan_set_in_use_is_left_alone,
                a_replay_is_kept_with_what_it_created,
                at_most_one_evaluation_waits_and_registrations_go_first,
                old_signatures_are_a_backlog_until_they_are_made_anew,
            }
            records {
                scans_come_back_in_natural_order,
                a_scan_is_replaced_and_the_limit_holds,
                lists_are_paged_newest_first,
                a_model_goes_with_all_its_parts,
                models_are_given_as_far_as_they_are_there,
                models_are_found_by_words_of_their_names_and_labels,
                a_query_waits_for_what_is_committed_but_not_in_the_index,
                a_full_database_says_so_and_is_as_it_was,
            }
            segments {
                a_model_is_unfiled_until_a_file_tells_its_very_signature,
                what_was_in_lost_files_is_unfiled,
                parts_are_asked_for_apart_and_can_be_given_up,
                each_node_has_an_index_of_its_own,
            }
            files {
                everything_stored_is_known,
                a_file_is_loose_before_it_has_a_row_and_after,
                a_file_on_its_way_has_an_owner,
            }
        }
    };
}
pub(crate) use database_conformance;

/// Runs a kind of object store through all checks.
macro_rules! object_conformance {
    ($place:ty) => {
        $crate::storage::conformance::checks! { <$place as $crate::storage::conformance::ObjectPlace>::new();
            segment_files {
                a_file_of_the_index_is_there_when_it_is_whole_and_lent_also_after_it_is_removed,
            }
            objects {
                a_scan_arrives_whole_and_goes_with_its_set,
                what_is_given_up_leaves_nothing,
                a_model_is_kept_with_all_its_files_and_goes_with_them,
                files_are_sent_whole_or_from_some_place_on,
                a_flipped_byte_is_not_given_out,
                what_is_set_aside_is_kept_for_a_while,
                what_a_process_was_making_goes_when_it_has_ended,
            }
        }
    };
}
pub(crate) use object_conformance;

/// A test for each check, on what an expression makes for it.
macro_rules! checks {
    (#[$attribute:meta] $place:expr; $($module:ident { $($check:ident,)* })*) => {
        $(mod $module {
            use super::*;
            $(
                #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
                #[$attribute]
                async fn $check() {
                    $crate::storage::conformance::$module::$check(&$place).await;
                }
            )*
        })*
    };
    ($place:expr; $($module:ident { $($check:ident,)* })*) => {
        $(mod $module {
            use super::*;
            $(
                #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
                async fn $check() {
                    $crate::storage::conformance::$module::$check(&$place).await;
                }
            )*
        })*
    };
}
pub(crate) use checks;

/// A scan set with the given scan names, each of 10 points.
pub async fn scan_set(db: &dyn Database, names: &[&str]) -> ScanSetId {
    let scan = |name: &&str| ScanRecord {
        name: (*name).to_owned(),
        file_id: FileId::new(),
        points: 10,
        bytes: 100,
        checksum: "00".to_owned(),
        reading: None,
    };
    let (scans, unit) = (names.iter().map(scan).collect(), visage_geometry::Unit::Mm);
    let passed_over = Vec::new();
    let set = NewScanSet { id: ScanSetId::new(), name: "set".to_owned(), unit, scans, poses: None, passed_over };
    db.create_scan_set(&set, None).await.expect("stored");
    set.id
}

/// A job on a scan set.
pub fn new_job(scan_set_id: ScanSetId) -> NewJob {
    let (options, hints) = (Options::default(), Default::default());
    NewJob { id: JobId::new(), scan_set_id, label: None, options, base: None, hints }
}

/// A worker of a process that is none of those that use the database now.
pub fn worker(name: &str) -> WorkerId {
    static PROCESS: LazyLock<ProcessId> = LazyLock::new(ProcessId::new);
    WorkerId { process: *PROCESS, number: name.bytes().map(usize::from).sum() }
}

/// A worker that is the only one, with a lease of 30 s, as much memory as it likes, and three attempts.
pub fn claimant(name: &str) -> Claimant {
    let worker = worker(name);
    Claimant { worker, living: vec![worker], lease: Duration::from_secs(30), max_attempts: 3, room: None }
}
