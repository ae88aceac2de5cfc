//! What errors of PostgreSQL mean.

use sqlx::postgres::PgDatabaseError;

use crate::storage::DatabaseError;

/// SQLSTATE; the first two characters are a class.
mod code {
    pub const CONNECTION: &str = "08";
    pub const NO_CHARACTER: &str = "22021";
    pub const NO_CHARACTER_IN_JSON: &str = "22P05";
    pub const READ_ONLY: &str = "25006";
    pub const IDLE_TOO_LONG: &str = "25P03";
    pub const CONFLICT: &str = "40001";
    pub const DEADLOCK: &str = "40P01";
    pub const DISK_FULL: &str = "53100";
    pub const NO_MEMORY: &str = "53200";
    pub const NO_CONNECTION_FREE: &str = "53300";
    pub const LOCKED_TOO_LONG: &str = "55P03";
    /// The server is stopped, has crashed, or starts.
    pub const GOING_OR_COMING: &str = "57P";
    pub const CORRUPT: &str = "XX001";
    pub const INDEX_CORRUPT: &str = "XX002";
}

/// What an error means; given back if it is none of PostgreSQL or of the connection to it.
pub(in crate::storage) fn meaning(error: sqlx::Error) -> Result<DatabaseError, sqlx::Error> {
    if matches!(error, sqlx::Error::Io(_) | sqlx::Error::Tls(_) | sqlx::Error::PoolClosed) {
        return Ok(DatabaseError::Unreachable(Box::new(error)));
    }
    let of_server = error.as_database_error().and_then(|error| error.try_downcast_ref::<PgDatabaseError>());
    let Some(code) = of_server.map(|error| error.code().to_owned()) else { return Err(error) };
    Ok(match code.as_str() {
        code::NO_CHARACTER | code::NO_CHARACTER_IN_JSON => DatabaseError::Unkeepable,
        code::DISK_FULL => DatabaseError::Full,
        code::CONFLICT | code::DEADLOCK | code::LOCKED_TOO_LONG => DatabaseError::Locked,
        code::NO_MEMORY | code::NO_CONNECTION_FREE => DatabaseError::Busy,
        code::CORRUPT | code::INDEX_CORRUPT => DatabaseError::Corrupt { found: error.to_string() },
        code::READ_ONLY | code::IDLE_TOO_LONG => DatabaseError::Unreachable(Box::new(error)),
        _ if code.starts_with(code::CONNECTION) || code.starts_with(code::GOING_OR_COMING) => {
            DatabaseError::Unreachable(Box::new(error))
        }
        _ => DatabaseError::Failed(Box::new(error)),
    })
}
