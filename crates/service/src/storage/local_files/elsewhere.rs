//! A data folder whose files are kept elsewhere: it says where, and has a part in it.

use std::fs;
use std::io;
use std::path::Path;

use super::doing;
use crate::storage::ObjectError;

const MARKER: &str = "visage.objects";

/// Where the files of a folder are; `None` if they are in it.
pub(in crate::storage) fn elsewhere(root: &Path) -> Result<Option<String>, ObjectError> {
    match fs::read_to_string(root.join(MARKER)) {
        Ok(text) => Ok(Some(text.trim().to_owned())),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(doing("reading where files are kept")(error)),
    }
}

#[cfg(feature = "s3")]
pub(in crate::storage) use beside::{create_private_file, create_private_folder};

/// What a place elsewhere needs of the folder.
#[cfg(feature = "s3")]
mod beside {
    use std::fs::{self, File};
    use std::io::{self, Write};
    use std::path::{Path, PathBuf};

    use super::super::{LocalFiles, doing, private, sync_folder};
    use super::MARKER;
    use crate::storage::{ObjectError, StagedFile};
    use visage_domain::FileId;

    /// Creates a folder, and those above it, for their owner alone.
    pub(in crate::storage) fn create_private_folder(folder: &Path) -> io::Result<()> {
        private::create_folder(folder)
    }

    /// Creates a file for its owner alone that must not be there yet.
    pub(in crate::storage) fn create_private_file(path: &Path) -> io::Result<File> {
        private::create_new(path)
    }

    impl LocalFiles {
        /// Says that files are kept elsewhere from now on. Blocks.
        pub(in crate::storage) fn put_elsewhere(&self, place: &str) -> Result<(), ObjectError> {
            let write = || -> io::Result<()> {
                let new = self.root.join("visage.objects.new");
                let mut file = private::options().write(true).create(true).truncate(true).open(&new)?;
                file.write_all(format!("{place}\n").as_bytes())?;
                file.sync_all()?;
                fs::rename(&new, self.root.join(MARKER))?;
                sync_folder(&self.root)
            };
            write().map_err(doing("saying where files are kept"))
        }

        /// Where files are kept that were fetched.
        pub(in crate::storage) fn cache_folder(&self) -> PathBuf {
            self.root.join("cache")
        }

        /// Where something that is staged is.
        pub(in crate::storage) fn staged_path(&self, id: FileId) -> PathBuf {
            self.staging.path(id)
        }

        /// Something to be staged that does not come from a client.
        pub(in crate::storage) fn stage_apart(&self) -> StagedFile {
            StagedFile::new(self.staging.new_id(), self.staging.clone())
        }
    }
}
