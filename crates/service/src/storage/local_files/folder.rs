//! Whose folder it is: nothing is touched before that is known.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use super::{LocalFiles, doing, listing, private, server};
use crate::storage::ObjectError;
use visage_domain::FolderId;

/// How often a lock that is held is tried again.
const LOCK_POLL: Duration = Duration::from_millis(20);
const MARKER: &str = "visage.folder";
const DATABASE: &str = "visage.sqlite";
const LOCK: &str = "visage.lock";

/// Why a folder can't be taken into use.
#[derive(Debug, thiserror::Error)]
pub enum FolderError {
    /// The file system said no.
    #[error(transparent)]
    Files(#[from] ObjectError),
    /// Another process uses the folder.
    #[error("{folder} is in use by another visage server; stop it, or choose another --data folder")]
    Locked {
        /// The data folder.
        folder: String,
    },
    /// The folder is somebody else's.
    #[error("{folder} is no data folder of visage: it holds {found}; choose an empty or new folder for --data")]
    Foreign {
        /// The folder.
        folder: String,
        /// What is in it.
        found: String,
    },
    /// There are files but no database that knows them.
    #[error(
        "the database of {folder} is {database}, but there are {files} scans, models and standards in the folder: put \
         visage.sqlite back from a backup (and remove visage.sqlite-wal and -shm, if there are any), or choose another \
         --data folder to begin anew"
    )]
    DatabaseLost {
        /// The data folder.
        folder: String,
        /// "missing" or "empty".
        database: &'static str,
        /// How many things would be lost.
        files: usize,
    },
}

impl LocalFiles {
    /// The same for a folder whose database is on a server. Blocks.
    pub fn open_without_database(root: &Path, patience: Duration) -> Result<LocalFiles, FolderError> {
        Self::take(root, patience)
    }

    /// Takes the folder into use: creates it when absent (readable by its owner alone) and locks it. A folder with
    /// other things in it is refused, and so is one whose database is gone. A process that has just been killed holds
    /// its lock until the system has taken it apart: `patience` is how long that may take. Blocks.
    pub fn open(root: &Path, patience: Duration) -> Result<LocalFiles, FolderError> {
        let files = Self::take(root, patience)?;
        files.prepare_database()?;
        Ok(files)
    }

    fn take(root: &Path, patience: Duration) -> Result<LocalFiles, FolderError> {
        refuse_foreign(root)?;
        private::create_folder(root).map_err(doing("creating the data folder"))?;
        let lock = lock(root, patience)?;
        // it may have been somebody else's until now
        refuse_foreign(root)?;
        let files = LocalFiles::at(root, lock);
        for name in listing::FOLDERS {
            let folder = root.join(name);
            private::create_folder(&folder).map_err(doing("creating the data folder"))?;
            private::restrict(&folder).map_err(doing("restricting the data folder"))?;
        }
        files.restrict()?;
        Ok(files)
    }

    /// The database inherits the rights of a file that is there already.
    fn prepare_database(&self) -> Result<(), ObjectError> {
        let database = self.database();
        match private::create_new(&database) {
            Err(error) if error.kind() != io::ErrorKind::AlreadyExists => Err(doing("creating the database")(error)),
            _ => Ok(()),
        }
    }

    fn restrict(&self) -> Result<(), ObjectError> {
        for name in [DATABASE, "visage.sqlite-wal", "visage.sqlite-shm", LOCK, MARKER] {
            let path = self.root.join(name);
            if path.exists() {
                private::restrict(&path).map_err(doing("restricting the database"))?;
            }
        }
        Ok(())
    }

    /// The id that the folder holds; `None` for a new one, or one from before folders had ids.
    pub fn folder_id(&self) -> Result<Option<FolderId>, FolderError> {
        folder_id(&self.root)
    }

    /// Says whose folder it is; only once. Blocks.
    pub fn put_folder_id(&self, id: FolderId) -> Result<(), ObjectError> {
        Self::write_folder_id(&self.root, id)
    }

    /// The same for a folder that is being made. Blocks.
    pub(super) fn write_folder_id(root: &Path, id: FolderId) -> Result<(), ObjectError> {
        let write = || -> io::Result<()> {
            let new = root.join("visage.folder.new");
            let mut file = private::options().write(true).create(true).truncate(true).open(&new)?;
            io::Write::write_all(&mut file, format!("{id}\n").as_bytes())?;
            file.sync_all()?;
            fs::rename(&new, root.join(MARKER))?;
            super::sync_folder(root)
        };
        write().map_err(doing("saying whose data folder it is"))
    }
}

/// A folder that nobody else uses as long as this lives.
#[derive(Debug)]
pub struct FolderLock {
    root: PathBuf,
    _lock: File,
}

impl FolderLock {
    /// Creates the folder when absent, and takes its lock. One with other things in it is refused. Blocks.
    pub fn take(root: &Path, patience: Duration) -> Result<FolderLock, FolderError> {
        let holds_copy = ["visage.sqlite.new", MARKER].iter().any(|name| root.join(name).exists());
        if !holds_copy {
            refuse_foreign(root)?;
        }
        private::create_folder(root).map_err(doing("creating the data folder"))?;
        private::restrict(root).map_err(doing("restricting the data folder"))?;
        Ok(FolderLock { root: root.to_owned(), _lock: lock(root, patience)? })
    }

    /// The id that the folder holds, if it has one.
    pub fn folder_id(&self) -> Result<Option<FolderId>, FolderError> {
        folder_id(&self.root)
    }
}

/// Whether a folder was taken into use before.
pub(in crate::storage) fn is_in_use(root: &Path) -> bool {
    root.join(MARKER).exists()
}

fn folder_id(root: &Path) -> Result<Option<FolderId>, FolderError> {
    match fs::read_to_string(root.join(MARKER)) {
        Ok(text) => match FolderId::parse(text.trim()) {
            Some(id) => Ok(Some(id)),
            None => Err(FolderError::Foreign {
                folder: root.display().to_string(),
                found: format!("a {MARKER} that is not visage's"),
            }),
        },
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(doing("reading whose data folder it is")(error).into()),
    }
}

/// A folder that is neither empty nor a data folder, or one whose database has been lost, is left as it is.
fn refuse_foreign(root: &Path) -> Result<(), FolderError> {
    let folder = root.display().to_string();
    let database = fs::metadata(root.join(DATABASE)).map(|found| found.len()).ok();
    if database.is_some_and(|bytes| bytes > 0) || root.join(server::MARKER).exists() {
        return Ok(());
    }
    let entries = match fs::read_dir(root) {
        Ok(entries) => entries,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
        Err(error) => return Err(doing("reading the data folder")(error).into()),
    };
    if root.join(MARKER).exists() {
        let files = listing::of(root).map_err(doing("reading the data folder"))?.len();
        if files == 0 {
            // a first start that was broken off
            return Ok(());
        }
        let database = if database.is_some() { "empty" } else { "missing" };
        return Err(FolderError::DatabaseLost { folder, database, files });
    }
    for entry in entries {
        let name = entry.map_err(doing("reading the data folder"))?.file_name();
        let name = name.to_string_lossy().into_owned();
        let is_ours = [LOCK, DATABASE, server::NODE, "lost+found", "reserve"].contains(&name.as_str())
            || listing::FOLDERS.contains(&name.as_str()) && listing::is_empty(&root.join(&name));
        if !is_ours {
            return Err(FolderError::Foreign { folder, found: name });
        }
    }
    Ok(())
}

fn lock(root: &Path, patience: Duration) -> Result<File, FolderError> {
    let lock = private::options()
        .create(true)
        .truncate(false)
        .write(true)
        .open(root.join(LOCK))
        .map_err(doing("opening the lock of the data folder"))?;
    let begin = Instant::now();
    loop {
        match lock.try_lock() {
            Ok(()) => return Ok(lock),
            Err(fs::TryLockError::WouldBlock) if begin.elapsed() < patience => std::thread::sleep(LOCK_POLL),
            Err(fs::TryLockError::WouldBlock) => {
                return Err(FolderError::Locked { folder: root.display().to_string() });
            }
            Err(fs::TryLockError::Error(error)) => return Err(doing("locking the data folder")(error).into()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::storage::ObjectStore;

    fn open(folder: &Path) -> Result<LocalFiles, FolderError> {
        LocalFiles::open(folder, Duration::ZERO)
    }

    fn names(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).expect("a folder");
        let mut names: Vec<String> =
            entries.map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }

    #[test]
    fn a_folder_of_something_else_is_left_as_it_is() {
        for path in ["models/weights.bin", "staging/site.html", "notes.txt", "visage.folder.bak"] {
            let folder = tempfile::tempdir().expect("a temporary folder");
            let file = folder.path().join(path);
            fs::create_dir_all(file.parent().expect("a parent")).expect("created");
            fs::write(&file, "precious").expect("written");
            let before = names(folder.path());
            let refused = open(folder.path()).expect_err("not ours");
            assert!(matches!(refused, FolderError::Foreign { .. }), "{refused}");
            assert!(refused.to_string().contains("choose an empty or new folder"), "{refused}");
            assert_eq!(names(folder.path()), before);
        }
    }

    #[test]
    fn an_empty_folder_and_a_fresh_disk_are_taken() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        fs::create_dir(folder.path().join("lost+found")).expect("created");
        drop(open(folder.path()).expect("a fresh disk"));
        drop(open(folder.path()).expect("a first start that was broken off"));
    }

    #[test]
    fn a_lost_database_is_no_reason_to_begin_anew() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let files = open(folder.path()).expect("new");
        files.put_folder_id(FolderId::new()).expect("written");
        drop(files);
        drop(open(folder.path()).expect("nothing is lost"));
        let model = folder.path().join("models").join(visage_domain::ModelId::new().to_string());
        fs::create_dir(&model).expect("created");
        for database in ["empty", "missing"] {
            let refused = open(folder.path()).expect_err("its database is lost");
            assert!(refused.to_string().contains(database), "{refused}");
            assert!(model.exists());
            let _ = fs::remove_file(folder.path().join(DATABASE));
        }
    }

    #[cfg(unix)]
    #[test]
    fn nobody_else_may_read_what_is_stored() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().expect("a temporary folder");
        fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o755)).expect("made by hand");
        fs::write(folder.path().join(DATABASE), "").expect("written");
        let files = open(folder.path()).expect("new");
        files.put_folder_id(FolderId::new()).expect("written");
        let staged = files.stage_model().expect("staged");
        files.write_asset(&staged, "report.json", b"{}").expect("written");
        let mut all = vec![folder.path().to_owned()];
        while let Some(path) = all.pop() {
            for entry in fs::read_dir(path).expect("a folder") {
                let entry = entry.expect("an entry");
                let mode = entry.metadata().expect("there").permissions().mode();
                assert_eq!(mode & 0o077, 0, "{} has {mode:o}", entry.path().display());
                if entry.path().is_dir() {
                    all.push(entry.path());
                }
            }
        }
    }
}
