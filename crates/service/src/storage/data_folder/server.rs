//! A data folder whose database is on a server: both know of each other.

use std::path::Path;
use std::sync::Arc;

use super::OpenError;
use crate::config::DatabaseUrl;
use crate::storage::Database;
use crate::storage::local_files;

/// What the folder says of where its database is has to be what was said to us.
pub(super) fn check(folder: &Path, database: Option<&DatabaseUrl>) -> Result<(), OpenError> {
    if database.is_some() && !cfg!(feature = "postgres") {
        return Err(OpenError::NoServers);
    }
    let name = folder.display().to_string();
    match (local_files::database_server(folder)?, database) {
        (Some(found), None) => Err(OpenError::DatabaseElsewhere { folder: name, found }),
        (None, Some(url)) if local_files::has_database(folder) => {
            Err(OpenError::DatabaseHere { folder: name, place: url.to_string() })
        }
        _ => Ok(()),
    }
}

#[cfg(not(feature = "postgres"))]
pub(super) use without::{open, open_beside};

/// There are no servers in this build.
#[cfg(not(feature = "postgres"))]
mod without {
    use std::time::Duration;

    use super::*;
    use crate::storage::local_files::LocalFiles;
    use visage_domain::FolderId;

    pub(in super::super) async fn open(
        _: &Arc<LocalFiles>,
        _: &Path,
        _: &DatabaseUrl,
        _: Duration,
        _: bool,
    ) -> Result<(Arc<dyn Database>, FolderId), OpenError> {
        Err(OpenError::NoServers)
    }

    pub(in super::super) async fn open_beside(_: &DatabaseUrl) -> Result<Arc<dyn Database>, OpenError> {
        Err(OpenError::NoServers)
    }
}

#[cfg(feature = "postgres")]
pub(super) use with::{open, open_beside};

#[cfg(feature = "postgres")]
mod with {
    use std::time::Duration;

    use super::*;
    use crate::storage::NoReserve;
    use crate::storage::database::Upkeep;
    use crate::storage::local_files::LocalFiles;
    use crate::storage::postgres::{Claim, PostgresDatabase};
    use visage_domain::FolderId;

    /// Takes the database into use for a folder. A new folder begins with a new database, unless its files are elsewhere
    /// (`files_are_shared`): then all that is in it can be made anew, and others may use the database, too.
    pub(in super::super) async fn open(
        files: &Arc<LocalFiles>,
        folder: &Path,
        url: &DatabaseUrl,
        patience: Duration,
        files_are_shared: bool,
    ) -> Result<(Arc<dyn Database>, FolderId), OpenError> {
        let node = Arc::clone(files);
        let seat = tokio::task::spawn_blocking(move || node.seat()).await??;
        let claim = Claim { seat, is_shared: files_are_shared };
        let database = PostgresDatabase::open_for(url, claim, files.reserve(), patience).await?;
        let (of_files, mut of_database) = (files.folder_id()?, database.folder_id().await?);
        let is_new = of_database.is_none();
        if is_new {
            database.put_folder_id(of_files.unwrap_or_default()).await?;
            // another server may have begun at the same moment: whoever was first counts
            of_database = database.folder_id().await?;
        }
        let id = match (of_files, of_database) {
            (Some(ours), Some(found)) if ours == found => ours,
            (None, Some(found)) if is_new || files_are_shared => found,
            (_, found) => {
                let (folder, place) = (folder.display().to_string(), url.to_string());
                let database = found.unwrap_or_default();
                return Err(OpenError::OtherDatabase { folder, place, database });
            }
        };
        let (files, place) = (Arc::clone(files), url.to_string());
        tokio::task::spawn_blocking(move || files.put_database_server(&place)).await??;
        Ok((Arc::new(database), id))
    }

    /// Opens it while a server may be using it.
    pub(in super::super) async fn open_beside(url: &DatabaseUrl) -> Result<Arc<dyn Database>, OpenError> {
        Ok(Arc::new(PostgresDatabase::open_beside(url, Arc::new(NoReserve)).await?))
    }
}
