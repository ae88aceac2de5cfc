//! What a database says when it can't do something.

use std::error::Error;

use visage_domain::{DeliveryId, JobId, JobStatus};

/// Why the database did not do what it was asked.
#[derive(Debug, thiserror::Error)]
pub enum DatabaseError {
    /// The database failed: whether what was being written is there is not known.
    #[error("database: {0}")]
    Failed(#[source] Box<dyn Error + Send + Sync>),
    /// The database could not open a file of its own: the process is out of descriptors, and they come free again.
    #[error("database: {0}")]
    Shortage(#[source] Box<dyn Error + Send + Sync>),
    /// The disk is full: nothing was written.
    #[error("the disk is full")]
    Full,
    /// Another program holds the lock of the database: nothing was written.
    #[error("the database is locked by another program")]
    Locked,
    /// All connections to the database stayed in use: nothing was written.
    #[error("no connection to the database came free in time")]
    Busy,
    /// The server of the database can't be reached: whether what was being written is there is not known.
    #[error("the database can't be reached: {0}")]
    Unreachable(#[source] Box<dyn Error + Send + Sync>),
    /// Another server uses the database.
    #[error(
        "the database is in use by another visage server; stop it, or give another --database (several servers may use one if all keep \
         their files in one bucket, by --objects)"
    )]
    Taken,
    /// A server uses the same node's seat.
    #[error(
        "another server runs with a copy of this data folder: give each server a --data folder of its own, a new one"
    )]
    SeatTaken,
    /// The database is of an earlier version, and servers use it.
    #[error("servers of an earlier version use the database: stop them, so that it can be brought to this version")]
    OthersOfBefore,
    /// Rows are to be moved into it, but it has some.
    #[error("the database is not empty: give a new one")]
    NotEmpty,
    /// The database file is broken.
    #[error("the database is damaged: {found}; stop the server and look with `visage doctor --data DIR`")]
    Corrupt {
        /// What the database says.
        found: String,
    },
    /// The file is a database of some other program.
    #[error(
        "the database is that of another program, or not of UTF-8; choose another --data folder, or another --database"
    )]
    Foreign,
    /// A server of another version uses the database.
    #[error(
        "a server of another version of visage uses the database: use the program of that version, or stop it first"
    )]
    OtherVersion,
    /// The database could not be brought to this program's version.
    #[error("migration of the database: {0}")]
    Migration(#[source] Box<dyn Error + Send + Sync>),
    /// A stored value is not what this program writes.
    #[error("the database holds {what} that can't be read: {reason}")]
    Damaged {
        /// The kind of value.
        what: &'static str,
        /// Why it can't be read.
        reason: String,
    },
    /// A text holds a character that no text of the database may hold: nothing was stored or found.
    #[error("a text holds a character that can't be kept, such as U+0000")]
    Unkeepable,
    /// There is no such thing.
    #[error("there is no {kind} {id}")]
    NotFound {
        /// "scan set", "job", "model", "scan".
        kind: &'static str,
        /// What was asked for.
        id: String,
    },
    /// A job that is not finished needs it.
    #[error("{kind} {id} is used by an unfinished job")]
    InUse {
        /// "scan set" or "job".
        kind: &'static str,
        /// Which one.
        id: String,
    },
    /// The queue is full.
    #[error("{limit} jobs are waiting already")]
    QueueFull {
        /// How many may wait.
        limit: usize,
    },
    /// There is one of this name.
    #[error("there is a {kind} named {name:?} already")]
    NameTaken {
        /// "standard".
        kind: &'static str,
        /// The name.
        name: String,
    },
    /// There is no room for another standard.
    #[error("there are {limit} standards already, the most that are kept")]
    TooManyStandards {
        /// How many there may be.
        limit: usize,
    },
    /// There is no room for another key.
    #[error("there are {limit} keys already, the most that are kept")]
    TooManyKeys {
        /// How many there may be.
        limit: usize,
    },
    /// There is no room for another webhook.
    #[error("there are {limit} webhooks already, the most that are kept")]
    TooManyWebhooks {
        /// How many there may be.
        limit: usize,
    },
    /// The message waits to be sent already.
    #[error("delivery {id} waits to be sent already")]
    StillPending {
        /// Which message.
        id: DeliveryId,
    },
    /// The scan set is full.
    #[error("a scan set holds at most {limit} scans")]
    TooManyScans {
        /// How many it may hold.
        limit: usize,
    },
    /// The job has ended in a way that does not allow this.
    #[error("job {id} is {}", status.name())]
    WrongStatus {
        /// Which job.
        id: JobId,
        /// What it is.
        status: JobStatus,
    },
    /// What it was made of is in the recycle bin itself.
    #[error("the {kind} {id} that it was made of is in the recycle bin, too")]
    OriginDeleted {
        /// What it was made of.
        kind: &'static str,
        /// Which one.
        id: String,
    },
    /// Another process has answered a request with the key while this one was worked on: nothing was stored.
    #[error("a request with the idempotency key {key:?} was answered meanwhile")]
    DoneMeanwhile {
        /// The key.
        key: String,
    },
    /// The key was used before, with another body.
    #[error("the idempotency key {key:?} was used before with another body")]
    KeyReused {
        /// The key.
        key: String,
    },
}

impl DatabaseError {
    /// Whether it is for want of something that comes free again.
    pub fn is_shortage(&self) -> bool {
        matches!(self, DatabaseError::Shortage(_))
    }

    /// Whether its server can't be reached, or may not be used at the moment.
    pub fn is_unreachable(&self) -> bool {
        matches!(self, DatabaseError::Unreachable(_) | DatabaseError::Taken | DatabaseError::SeatTaken)
    }

    /// Whether what was to be written may be there all the same: files that belong to it must stay then.
    pub fn leaves_in_doubt(&self) -> bool {
        matches!(
            self,
            DatabaseError::Failed(_)
                | DatabaseError::Unreachable(_)
                | DatabaseError::Shortage(_)
                | DatabaseError::Corrupt { .. }
        )
    }
}
