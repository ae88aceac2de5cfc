//! What the statements of `sql` see of SQLite.

pub(super) use super::SqliteDatabase as Store;
pub(super) use super::words;
pub(super) use super::words::has_words;
pub(super) use super::writing::Writing;
pub(super) use sqlx::sqlite::{SqliteConnection as Connection, SqlitePool as Pool, SqliteRow as DatabaseRow};

/// The size of the whole database.
pub(super) const DATABASE_BYTES: &str = "SELECT page_count * page_size FROM pragma_page_count(), pragma_page_size()";

/// The columns of a table, as SQL lists them.
pub(super) const COLUMNS: &str = "SELECT group_concat('\"' || name || '\"', ', ') FROM pragma_table_info($1)";

/// After a query of rows that a transaction goes on with: nobody else changes them before its end. Here whoever writes is alone.
macro_rules! locked {
    () => {
        ""
    };
}
pub(super) use locked;

/// The same, passing over rows that somebody else has locked.
macro_rules! skip_locked {
    () => {
        ""
    };
}
pub(super) use skip_locked;
