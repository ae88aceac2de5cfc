//! Migrations, which the program brings along.

use std::borrow::Cow;

use sqlx::SqlSafeStr;
use sqlx::migrate::{Migration, MigrationType, Migrator};

/// The file names in a folder of migrations and what is in them, in order. sqlx's `migrate!` would list the folder itself, but
/// its macros build SQLite a second time, for the compiler.
macro_rules! files {
    ($folder:literal; $($name:literal),* $(,)?) => {
        [$(($name, include_str!(concat!($folder, $name, ".sql")))),*]
    };
}
pub(super) use files;

/// All of a list; a file's place in it is its number.
pub(super) fn migrator(files: &[(&str, &'static str)]) -> Migrator {
    let migration = |(version, (name, sql)): (i64, &(&str, &'static str))| {
        let description = name.trim_start_matches(|c: char| c.is_ascii_digit() || c == '_').replace('_', " ");
        Migration::new(version, Cow::Owned(description), MigrationType::Simple, sql.into_sql_str(), false)
    };
    Migrator::with_migrations((1..).zip(files).map(migration).collect())
}
