//! Files of a data folder are copied into another one, each held against its checksum on the way.

use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

use super::{LocalFiles, doing, gone, listing, private, sync_folder};
use crate::storage::ObjectError;
use visage_domain::{FileId, FolderId, KnownFiles, StoredFile};

const CHUNK: usize = 1 << 20;

/// A file that has to be in a copy: by the row that knows it.
#[derive(Debug, Clone)]
pub struct Wanted {
    /// Whose it is.
    pub of: StoredFile,
    /// Its name, if that has several.
    pub asset: Option<String>,
    /// Its size.
    pub bytes: u64,
    /// BLAKE3 of its content, hexadecimal.
    pub checksum: String,
}

impl Wanted {
    /// Its place below a data folder.
    pub fn place(&self) -> PathBuf {
        let mut place = PathBuf::from(self.of.to_string());
        place.extend(&self.asset);
        place
    }
}

/// Where files are copied from.
pub trait Source: Send + Sync {
    /// The content of a file, from its beginning; `None` if it is not there. `scratch` is a folder for what has to lie somewhere
    /// meanwhile. Blocks.
    fn open(&self, file: &Wanted, scratch: &Path) -> io::Result<Option<File>>;
}

/// A data folder that has its files itself.
impl Source for PathBuf {
    fn open(&self, file: &Wanted, _: &Path) -> io::Result<Option<File>> {
        match File::open(self.join(file.place())) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
            opened => opened.map(Some),
        }
    }
}

/// What became of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Copied {
    /// It was copied, and is what its row says.
    New,
    /// The copy has it already.
    Known,
    /// It is not there.
    Missing,
    /// It is not what its row says; it was not copied.
    Damaged,
}

/// Copies one file. What the copy has under its name is taken for it if it has its size, or, with `reread`, its
/// content: names are ids that are never used twice. Blocks.
pub fn copy(from: &dyn Source, to: &Path, file: &Wanted, reread: bool) -> Result<Copied, ObjectError> {
    let copy = || -> io::Result<Copied> {
        let target = to.join(file.place());
        let there = fs::metadata(&target).is_ok_and(|found| found.is_file() && found.len() == file.bytes);
        if there && (!reread || checksum(&target)? == file.checksum) {
            return Ok(Copied::Known);
        }
        private::create_folder(&to.join("staging"))?;
        let Some(mut source) = from.open(file, &to.join("staging"))? else { return Ok(Copied::Missing) };
        let staged = to.join("staging").join(FileId::new().to_string());
        let copied = copy_hashed(&mut source, &staged);
        let sound = copied.as_ref().is_ok_and(|found| *found == file.checksum);
        if !sound {
            gone(fs::remove_file(&staged))?;
            return copied.map(|_| Copied::Damaged);
        }
        let folder = target.parent().unwrap_or(to);
        private::create_folder(folder)?;
        fs::rename(&staged, &target)?;
        sync_folder(folder)?;
        Ok(Copied::New)
    };
    copy().map_err(doing("copying a file"))
}

/// Writes a copy that is durable; answers with the checksum of what was read.
fn copy_hashed(source: &mut File, target: &Path) -> io::Result<String> {
    let mut target = private::create_new(target)?;
    let mut hasher = blake3::Hasher::new();
    let mut chunk = vec![0; CHUNK];
    loop {
        let count = source.read(&mut chunk)?;
        if count == 0 {
            break;
        }
        hasher.update(&chunk[..count]);
        target.write_all(&chunk[..count])?;
    }
    target.sync_all()?;
    Ok(hasher.finalize().to_hex().to_string())
}

fn checksum(file: &Path) -> io::Result<String> {
    let (mut file, mut hasher, mut chunk) = (File::open(file)?, blake3::Hasher::new(), vec![0; CHUNK]);
    loop {
        match file.read(&mut chunk)? {
            0 => return Ok(hasher.finalize().to_hex().to_string()),
            count => drop(hasher.update(&chunk[..count])),
        }
    }
}

/// Removes what no row of a copy knows: what was deleted since the last time, or a copy that was broken off has left.
/// Blocks.
pub fn prune(copy: &Path, known: &KnownFiles) -> Result<usize, ObjectError> {
    let prune = || -> io::Result<usize> {
        let mut removed = 0;
        for file in listing::of(copy)?.into_iter().filter(|file| !known.knows(*file)) {
            let path = copy.join(file.to_string());
            match file {
                StoredFile::Scan(..) => gone(fs::remove_file(path))?,
                _ => gone(fs::remove_dir_all(path))?,
            }
            removed += 1;
        }
        for staged in listing::ids(&copy.join("staging"), FileId::parse)? {
            gone(fs::remove_file(copy.join("staging").join(staged.to_string())))?;
        }
        Ok(removed)
    };
    prune().map_err(doing("removing what was deleted from a copy"))
}

/// Where a database is written before it gets its place; nothing is there. Blocks.
pub fn new_database(root: &Path) -> Result<PathBuf, ObjectError> {
    let path = root.join("visage.sqlite.new");
    let clear = || -> io::Result<()> {
        for ending in ["", "-wal", "-shm", "-journal"] {
            gone(fs::remove_file(root.join(format!("visage.sqlite.new{ending}"))))?;
        }
        Ok(())
    };
    clear().map_err(doing("making place for a copy of the database")).map(|()| path)
}

/// Copies a database file that nobody has open; refused if a log beside it says that somebody has, or had. Blocks.
pub fn copy_database(from: &Path, to: &Path) -> Result<(), ObjectError> {
    let copy = || -> io::Result<()> {
        let log = from.with_extension("sqlite-wal");
        if fs::metadata(log).is_ok_and(|log| log.len() > 0) {
            return Err(io::Error::other("it was not closed: run `visage doctor` on its folder first"));
        }
        copy_hashed(&mut File::open(from)?, to).map(drop)
    };
    copy().map_err(doing("copying the database"))
}

/// Puts a finished database in its place, and says whose folder it is. From then on the copy is a data folder. Blocks.
pub fn publish(root: &Path, new: &Path, id: FolderId) -> Result<(), ObjectError> {
    let publish = || -> io::Result<()> {
        private::restrict(new)?;
        File::open(new)?.sync_all()?;
        // a log belongs to the database that goes
        for ending in ["-wal", "-shm"] {
            gone(fs::remove_file(root.join(format!("visage.sqlite{ending}"))))?;
        }
        fs::rename(new, super::database_of(root))?;
        sync_folder(root)
    };
    publish().map_err(doing("putting the database in its place"))?;
    LocalFiles::write_folder_id(root, id)
}
