//! What is kept, as SQL that every database here speaks: a file implements a trait of
//! [`database`](crate::storage::database), under the same name.
//!
//! The folder is a module of `sqlite` and of `postgres`, compiled for each with its own types: what stands here once would with
//! type parameters need a dozen bounds a function, and with sqlx's driver for any database a copy of each value. So it sees of
//! its database only what that lists in its `dialect`: types of sqlx, a few words of SQL, and the calls of `Store` and `Writing`
//! about connections, transactions and clocks.
//!
//! Rules that make one text do for both: parameters are `$1`, counts are i64, truths are `TRUE` and `FALSE`, sums are cast
//! back to BIGINT, a list is one parameter (a JSON array, read by `json_each`), rows are put over others by `ON CONFLICT`, a
//! table in `FROM` that is a query has a name.

mod audit;
mod census;
mod evaluations;
mod files;
mod folder;
mod imports;
mod jobs;
mod keys;
mod matches;
mod models;
mod outbox;
mod queue;
pub(super) mod recycle_bin;
mod replays;
mod rows;
mod scan_sets;
pub(super) mod segments;
pub(super) mod signatures;
mod standards;
mod uploads;
mod webhooks;

use std::str::FromStr;

use super::dialect::{
    COLUMNS, Connection, DATABASE_BYTES, DatabaseRow, Pool, Store, Writing, has_words, locked, skip_locked, words,
};
use crate::storage::DatabaseError;
use visage_domain::PageRequest;

/// A stored time: milliseconds since 1970, as the tables keep times.
fn timestamp(ms: i64) -> Result<jiff::Timestamp, DatabaseError> {
    jiff::Timestamp::from_millisecond(ms).map_err(|error| damaged("a time", error))
}

/// Turns what the standard library or serde says of a stored value into our error.
pub(super) fn damaged(what: &'static str, reason: impl ToString) -> DatabaseError {
    DatabaseError::Damaged { what, reason: reason.to_string() }
}

/// What is stored by its name.
fn stored_name<T: FromStr<Err: ToString>>(what: &'static str, name: &str) -> Result<T, DatabaseError> {
    name.parse().map_err(|error: T::Err| damaged(what, error))
}

/// SQL counts in i64; nothing stored here comes near its end.
pub(super) fn to_i64(count: u64) -> i64 {
    i64::try_from(count).unwrap_or(i64::MAX)
}

/// A stored count.
pub(super) fn to_u64(count: i64) -> u64 {
    u64::try_from(count).unwrap_or(0)
}

/// A stored small count.
fn to_u32(count: i64) -> u32 {
    u32::try_from(to_u64(count)).unwrap_or(u32::MAX)
}

/// A stored id.
macro_rules! stored_id {
    ($kind:ident, $text:expr) => {
        visage_domain::$kind::parse($text)
            .ok_or_else(|| $crate::storage::DatabaseError::Damaged { what: "an id", reason: $text.to_string() })
    };
}
pub(super) use stored_id;

/// One row more than is shown tells whether there is a next page.
fn sql_limit(page: &PageRequest) -> i64 {
    to_i64(page.limit as u64 + 1)
}
