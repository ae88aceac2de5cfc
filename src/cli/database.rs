//! Where the database is if not in the data folder: what the commands on a data folder have to know alike.

use clap::Args;

use crate::config::DatabaseUrl;

/// A database on a server.
#[derive(Debug, Clone, Args)]
pub(super) struct DatabaseArgs {
    /// Where the database is instead of the data folder, such as postgres://visage@db.example/visage; the password by PGPASSWORD
    /// or a file ~/.pgpass, as with psql
    #[arg(long, env = "VISAGE_DATABASE", value_name = "URL", hide_env_values = true)]
    pub(super) database: Option<DatabaseUrl>,
}
