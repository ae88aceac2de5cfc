//! A gallery as one file, for a program of another version: what `visage backup` copies is for the same version alone.
//!
//! - `layout`: what stands in the file, and in which order; docs/EXPORT.md tells others
//! - [`mod@export`]: a data folder is written to a stream
//! - [`mod@import`]: a stream is read into a data folder; `received`: its entries, each held against what the one before has announced;
//!   `checked`: what they say, held against what may be stored
//!
//! Both go through the file once and hold one entry of it in memory at most. Scans are not part of it, nor are keys, webhooks, the audit
//! log and what is in the recycle bin.

mod checked;
pub mod export;
pub mod import;
mod layout;
mod received;

use tokio::runtime::Handle;

use crate::storage::DatabaseError;
use crate::storage::inventory::{Storage, StorageError};

pub use export::{ExportError, Exported, export};
pub use import::{ImportError, Imported, import};

/// Where models come from or go to, from a thread that may block.
struct Place<'a> {
    storage: &'a Storage,
    runtime: &'a Handle,
}

impl Place<'_> {
    /// Waits for the database.
    fn ask<T>(&self, work: impl Future<Output = Result<T, DatabaseError>>) -> Result<T, StorageError> {
        Ok(self.runtime.block_on(work)?)
    }
}
