//! The database of a data folder, moved to a server. Files stay where they are.

use std::path::Path;

use super::OpenError;
use crate::config::DatabaseUrl;

/// Moves the database of a folder that no server uses; answers with the numbers of rows by table, or with none if an earlier attempt
/// had moved them all. From then on the folder goes with the database on the server, and the one in it is set aside.
#[cfg(feature = "postgres")]
pub async fn migrate(folder: &Path, to: &DatabaseUrl) -> Result<Vec<(&'static str, u64)>, OpenError> {
    use super::{DataFolder, Places};
    use crate::storage::database::Upkeep;
    use crate::storage::postgres::{Claim, PostgresDatabase};
    use crate::storage::sqlite::SqliteDatabase;
    use crate::storage::{NoReserve, local_files};
    use std::sync::Arc;
    use std::time::Duration;

    if !local_files::has_database(folder) {
        return Err(OpenError::NothingToMove { folder: folder.display().to_string() });
    }
    // whoever has it holds the folder's lock, and the database is one of this version, with its id
    let (data, files) = DataFolder::open_here(folder, Duration::ZERO, Places::default()).await?;
    data.storage.database.close().await;
    let from = SqliteDatabase::open_with(&files.database(), Arc::new(NoReserve)).await?;
    let claim = Claim { seat: data.id.into(), is_shared: false };
    let target = PostgresDatabase::open_for(to, claim, Arc::new(NoReserve), Duration::ZERO).await?;
    let moved = target.move_in(&from).await;
    from.close().await;
    target.close().await;
    let moved = moved?;
    let place = to.to_string();
    let mark = move || files.put_database_server(&place).and_then(|()| files.set_database_aside());
    tokio::task::spawn_blocking(mark).await??;
    drop(data);
    Ok(moved.unwrap_or_default())
}

/// There are no servers in this build.
#[cfg(not(feature = "postgres"))]
#[allow(clippy::unused_async, reason = "as with them")]
pub async fn migrate(_: &Path, _: &DatabaseUrl) -> Result<Vec<(&'static str, u64)>, OpenError> {
    Err(OpenError::NoServers)
}
