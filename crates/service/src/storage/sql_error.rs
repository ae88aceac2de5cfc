//! What errors of sqlx mean.

use sqlx::sqlite::SqliteError;

use super::{DatabaseError, sqlite};

impl From<sqlx::Error> for DatabaseError {
    fn from(error: sqlx::Error) -> Self {
        if matches!(error, sqlx::Error::PoolTimedOut) {
            return DatabaseError::Busy;
        }
        #[cfg(feature = "postgres")]
        let error = match super::postgres::meaning(error) {
            Ok(meaning) => return meaning,
            Err(error) => error,
        };
        let of_sqlite = error.as_database_error().and_then(|error| error.try_downcast_ref::<SqliteError>());
        let code = of_sqlite.and_then(|error| sqlx::error::DatabaseError::code(error)?.parse().ok());
        sqlite::meaning(code, error)
    }
}
