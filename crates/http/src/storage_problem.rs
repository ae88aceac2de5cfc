//! What the database, the files and the memory say, as problems.

use super::problem::{Code, Problem};
use visage_service::app::access::AccessError;
use visage_service::app::arrival::ArrivalError;
use visage_service::jobs::memory::TooLarge;
use visage_service::storage::inventory::StorageError;
use visage_service::storage::{DatabaseError, ObjectError};

impl From<DatabaseError> for Problem {
    fn from(error: DatabaseError) -> Self {
        if error.is_shortage() {
            return Problem::shortage(error);
        }
        let detail = error.to_string();
        match error {
            DatabaseError::NotFound { kind, .. } => {
                Problem::new(Code::NotFound, detail, format!("it may have been deleted; list what there is of {kind}s"))
            }
            DatabaseError::InUse { .. } => {
                Problem::new(Code::InUse, detail, "wait for the job's end, or cancel it first").retry_after(5)
            }
            DatabaseError::QueueFull { .. } => {
                Problem::new(Code::QueueFull, detail, "try again when jobs have ended, or cancel some").retry_after(10)
            }
            DatabaseError::NameTaken { .. } => {
                Problem::new(Code::DuplicateStandard, detail, "choose another name, or delete that one first")
            }
            DatabaseError::TooManyStandards { .. } => {
                Problem::new(Code::TooManyStandards, detail, "delete one that is not needed any more")
            }
            DatabaseError::TooManyKeys { .. } => {
                Problem::new(Code::TooManyKeys, detail, "revoke one that is not needed any more")
            }
            DatabaseError::TooManyWebhooks { .. } => {
                Problem::new(Code::TooManyWebhooks, detail, "delete one that is not needed any more")
            }
            DatabaseError::StillPending { .. } => Problem::new(
                Code::WrongStatus,
                detail,
                "only messages that were delivered or are dead are sent once more",
            ),
            DatabaseError::TooManyScans { .. } => {
                Problem::new(Code::TooManyScans, detail, "send fewer scans, or ask the operator to raise the limit")
            }
            DatabaseError::WrongStatus { .. } => Problem::new(
                Code::WrongStatus,
                detail,
                "only queued or running jobs can be canceled, only failed or canceled ones retried",
            ),
            DatabaseError::OriginDeleted { .. } => {
                Problem::new(Code::OriginDeleted, detail, "put that back first: POST /v1/bin/{id}/restore")
            }
            DatabaseError::KeyReused { .. } => {
                Problem::new(Code::KeyReused, detail, "use a new key for a new request; repeat a request unchanged")
            }
            DatabaseError::DoneMeanwhile { .. } => {
                Problem::new(Code::RequestInProgress, detail, "repeat it: the answer is kept").retry_after(1)
            }
            DatabaseError::Unkeepable => Problem::new(Code::InvalidField, detail, "leave that character out"),
            DatabaseError::Full => Problem::storage_full(&detail),
            DatabaseError::Locked => {
                let hint = "repeat the request; if it stays, ask the operator which program holds the database";
                Problem::new(Code::DatabaseLocked, "nothing was stored: another program holds the database", hint)
                    .retry_after(5)
            }
            DatabaseError::Busy => {
                Problem::new(Code::Overloaded, detail, "send the request again in a moment").retry_after(2)
            }
            DatabaseError::Unreachable(_) | DatabaseError::Taken | DatabaseError::SeatTaken => {
                tracing::error!("{detail}");
                let hint = "send the request again in a while; nothing that was accepted is lost";
                let detail = "the database can't be reached at the moment";
                Problem::new(Code::StorageUnreachable, detail, hint).retry_after(10)
            }
            DatabaseError::Failed(_)
            | DatabaseError::Shortage(_)
            | DatabaseError::Migration(_)
            | DatabaseError::OtherVersion
            | DatabaseError::OthersOfBefore
            | DatabaseError::Damaged { .. }
            | DatabaseError::Corrupt { .. }
            | DatabaseError::NotEmpty
            | DatabaseError::Foreign => Problem::internal(detail),
        }
    }
}

impl From<ObjectError> for Problem {
    fn from(error: ObjectError) -> Self {
        if error.is_storage_full() {
            return Problem::storage_full(&error.to_string());
        }
        if error.is_unreachable() {
            tracing::error!("{error}");
            let hint = "send the request again in a while; nothing that was accepted is lost";
            let detail = "the object store that keeps files can't be used at the moment";
            return Problem::new(Code::StorageUnreachable, detail, hint).retry_after(10);
        }
        if let ObjectError::Damaged { .. } = error {
            tracing::error!("{error}; `visage doctor` tells what else is");
            let hint = "ask the operator to put the file back from a backup, or delete what it belongs to";
            return Problem::new(Code::Damaged, error.to_string(), hint);
        }
        if error.is_shortage() { Problem::shortage(error) } else { Problem::internal(error) }
    }
}

impl From<StorageError> for Problem {
    fn from(error: StorageError) -> Self {
        match error {
            StorageError::Objects(error) => error.into(),
            StorageError::Database(error) => error.into(),
            StorageError::Task(error) => Problem::internal(error),
        }
    }
}

impl From<AccessError> for Problem {
    fn from(error: AccessError) -> Self {
        match error {
            AccessError::Database(error) => error.into(),
            AccessError::Randomness(error) => Problem::internal(error),
        }
    }
}

impl From<ArrivalError> for Problem {
    fn from(error: ArrivalError) -> Self {
        match error {
            ArrivalError::Unreadable { ref file, error: ref found, .. } => {
                Problem::unreadable(file, found).detail(error.to_string())
            }
            ArrivalError::TooManyScans { .. } => {
                let hint = "send fewer, in sets of their own; GET /v1/info states the limits";
                Problem::new(Code::TooManyScans, error.to_string(), hint)
            }
            ArrivalError::Duplicate { first, second } => Problem::duplicate(&first, &second),
            ArrivalError::Objects(error) => error.into(),
            ArrivalError::Ended(error) => Problem::internal(error),
            ArrivalError::Closed(error) => Problem::internal(error),
        }
    }
}

impl From<TooLarge> for Problem {
    fn from(error: TooLarge) -> Self {
        Problem::new(Code::TooLittleMemory, error.to_string(), TooLarge::HINT)
    }
}

impl Problem {
    /// Two scans of one set have names that are the same, or that some system takes for one.
    pub fn duplicate(first: &str, second: &str) -> Self {
        let detail = match first == second {
            true => format!("two files are named {second}"),
            false => format!("the names {first} and {second} differ only in upper case or in how accents are written"),
        };
        Problem::new(Code::DuplicateScan, detail, "give each scan a name of its own").scan(second)
    }

    /// A file is larger than files may be.
    pub fn file_too_large(name: &str, most: u64) -> Self {
        let hint = "thin the scan, send it as binary PLY, or ask the operator to raise the limit";
        Problem::new(Code::TooLarge, format!("{name} is larger than {most} bytes"), hint).scan(name)
    }

    /// There is no space; the log learns why.
    pub fn storage_full(error: &str) -> Self {
        tracing::error!("the disk is full: {error}");
        let hint = "delete what is not needed, or ask the operator for space; then repeat the request";
        Problem::new(Code::StorageFull, "nothing more can be stored", hint)
    }

    /// Why nothing can be stored at the moment, for `/readyz`.
    pub fn not_writable(error: DatabaseError) -> Self {
        let detail = match &error {
            DatabaseError::Full => "nothing can be stored: the disk is full",
            DatabaseError::Locked => "nothing can be stored: another program holds the database",
            _ => return error.into(),
        };
        Problem::new(Code::NotReady, detail, "try again when the operator has seen to it").retry_after(5)
    }
}
