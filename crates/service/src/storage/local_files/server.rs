//! A data folder whose database is on a server: it says where, so that nobody begins anew beside it.

use std::fs;
use std::io;
use std::path::Path;

use super::doing;
#[cfg(feature = "postgres")]
use super::{LocalFiles, private, sync_folder};
use crate::storage::ObjectError;

pub(super) const MARKER: &str = "visage.database";

/// Where the database of a folder is, without passwords; `None` if it is in the folder.
pub(in crate::storage) fn database_server(root: &Path) -> Result<Option<String>, ObjectError> {
    match fs::read_to_string(root.join(MARKER)) {
        Ok(text) => Ok(Some(text.trim().to_owned())),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(doing("reading where the database is")(error)),
    }
}

#[cfg(feature = "postgres")]
impl LocalFiles {
    /// Says that the database is on a server from now on. Blocks.
    pub(in crate::storage) fn put_database_server(&self, place: &str) -> Result<(), ObjectError> {
        let write = || -> io::Result<()> {
            let new = self.root.join("visage.database.new");
            let mut file = private::options().write(true).create(true).truncate(true).open(&new)?;
            io::Write::write_all(&mut file, format!("{place}\n").as_bytes())?;
            file.sync_all()?;
            fs::rename(&new, self.root.join(MARKER))?;
            sync_folder(&self.root)
        };
        write().map_err(doing("saying where the database is"))
    }

    /// Sets the database in the folder aside, under another name, since all of it is on a server now. Blocks.
    pub(in crate::storage) fn set_database_aside(&self) -> Result<(), ObjectError> {
        let from = self.database();
        let rename = || fs::rename(&from, from.with_extension("sqlite.moved")).and_then(|()| sync_folder(&self.root));
        rename().map_err(doing("setting the database aside"))
    }
}
