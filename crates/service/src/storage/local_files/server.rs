//! A data folder whose database is on a server: it says where, so that nobody begins anew beside it.

use std::fs;
use std::io;
use std::path::Path;

use super::doing;
#[cfg(feature = "postgres")]
use super::{FolderError, LocalFiles, private, sync_folder};
use crate::storage::ObjectError;
#[cfg(feature = "postgres")]
use visage_domain::SeatId;

pub(super) const MARKER: &str = "visage.database";
/// Several folders may go with one database: each is a node of its own.
pub(super) const NODE: &str = "visage.node";

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
        self.put_marker(MARKER, place).map_err(doing("saying where the database is"))
    }

    /// Which node the folder is; a new one is made if it is none yet. One that went with a database alone, from before there were
    /// nodes, is what its id says. Blocks.
    pub(in crate::storage) fn seat(&self) -> Result<SeatId, FolderError> {
        let error = doing("reading which node the data folder is");
        match fs::read_to_string(self.root.join(NODE)) {
            Ok(text) => SeatId::parse(text.trim()).ok_or_else(|| FolderError::Foreign {
                folder: self.root.display().to_string(),
                found: format!("a {NODE} that is not visage's"),
            }),
            Err(missing) if missing.kind() == io::ErrorKind::NotFound => {
                let seat = self.folder_id()?.map_or_else(SeatId::new, SeatId::from);
                self.put_marker(NODE, &seat.to_string()).map_err(doing("saying which node the data folder is"))?;
                Ok(seat)
            }
            Err(failed) => Err(error(failed).into()),
        }
    }

    fn put_marker(&self, name: &str, content: &str) -> io::Result<()> {
        let new = self.root.join(format!("{name}.new"));
        let mut file = private::options().write(true).create(true).truncate(true).open(&new)?;
        io::Write::write_all(&mut file, format!("{content}\n").as_bytes())?;
        file.sync_all()?;
        fs::rename(&new, self.root.join(name))?;
        sync_folder(&self.root)
    }

    /// Sets the database in the folder aside, under another name, since all of it is on a server now. Blocks.
    pub(in crate::storage) fn set_database_aside(&self) -> Result<(), ObjectError> {
        let from = self.database();
        let rename = || fs::rename(&from, from.with_extension("sqlite.moved")).and_then(|()| sync_folder(&self.root));
        rename().map_err(doing("setting the database aside"))
    }
}
