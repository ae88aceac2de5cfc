//! What the statements of `sql` see of PostgreSQL.

pub(super) use super::PostgresDatabase as Store;
pub(super) use super::words;
pub(super) use super::words::has_words;
pub(super) use super::writing::Writing;
pub(super) use sqlx::postgres::{PgConnection as Connection, PgPool as Pool, PgRow as DatabaseRow};

/// The size of the whole database.
pub(super) const DATABASE_BYTES: &str = "SELECT pg_database_size(current_database())";

/// The columns of a table, as SQL lists them.
pub(super) const COLUMNS: &str = "SELECT string_agg(quote_ident(column_name), ', ') FROM information_schema.columns
    WHERE table_schema = current_schema() AND table_name = $1";

/// After a query of rows that a transaction goes on with: nobody else changes them before its end, and they are as they are then.
macro_rules! locked {
    () => {
        " FOR UPDATE"
    };
}
pub(super) use locked;

/// The same, passing over rows that somebody else has locked.
macro_rules! skip_locked {
    () => {
        " FOR UPDATE SKIP LOCKED"
    };
}
pub(super) use skip_locked;
