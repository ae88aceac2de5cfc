//! Files are held against their checksums before they are given out: a disk that forgets must not answer for us.

use std::collections::HashMap;
use std::fs::{self, File};
use std::io;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::SystemTime;

use super::{LocalFiles, doing};
use crate::storage::ObjectError;
use visage_domain::{AssetRecord, ModelId, ScanRecord, ScanSetId, StandardId};

/// So many files are remembered as sound before all are forgotten.
const REMEMBERED: usize = 4096;

/// Files that were sound when they were last read whole. Parts of a large one need not be paid for with all of it again
/// as long as its size and time say that nobody has written to it.
#[derive(Debug, Default)]
pub(super) struct Sound(Mutex<HashMap<PathBuf, (u64, SystemTime)>>);

impl Sound {
    fn knows(&self, path: &PathBuf, state: (u64, SystemTime)) -> bool {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).get(path) == Some(&state)
    }

    fn remember(&self, path: PathBuf, state: (u64, SystemTime)) {
        let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if known.len() >= REMEMBERED {
            known.clear();
        }
        known.insert(path, state);
    }
}

impl LocalFiles {
    /// A file of a model that is to be opened, off the async threads.
    pub(super) fn opening(&self, model: ModelId, asset: &AssetRecord) -> Opening {
        let path = self.models().join(model.to_string()).join(&asset.name);
        let (sound, checksum) = (Arc::clone(&self.sound), asset.checksum.clone());
        Opening { path, what: format!("{} of model {model}", asset.name), checksum, sound }
    }

    /// The content of a file of a model, if that is what was stored; `None` if it is not there. Blocks.
    pub(super) fn read_verified(&self, model: ModelId, asset: &AssetRecord) -> Result<Option<Vec<u8>>, ObjectError> {
        match fs::read(self.models().join(model.to_string()).join(&asset.name)) {
            Ok(content) => checked(content, &asset.checksum, || format!("{} of model {model}", asset.name)).map(Some),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
            Err(error) => Err(doing("reading a file of a model")(error)),
        }
    }

    /// The content of a scan, if that is what was stored. Blocks.
    pub(super) fn read_verified_scan(&self, set: ScanSetId, scan: &ScanRecord) -> Result<Vec<u8>, ObjectError> {
        let content = fs::read(self.scan(set, scan.file_id)).map_err(doing("reading a scan"))?;
        checked(content, &scan.checksum, || scan_of(set, scan))
    }

    /// Whether a scan is what was stored. Blocks.
    pub(super) fn verify_scan(&self, set: ScanSetId, scan: &ScanRecord) -> Result<(), ObjectError> {
        let mut hasher = blake3::Hasher::new();
        let file = File::open(self.scan(set, scan.file_id)).map_err(doing("reading a scan"))?;
        hasher.update_reader(file).map_err(doing("reading a scan"))?;
        if hasher.finalize().to_hex().as_str() == scan.checksum {
            return Ok(());
        }
        Err(ObjectError::Damaged { what: scan_of(set, scan) })
    }

    /// The file that a standard was made of, if it is what was stored. Blocks.
    pub(super) fn read_verified_standard(
        &self,
        standard: StandardId,
        asset: &AssetRecord,
    ) -> Result<Vec<u8>, ObjectError> {
        let content = fs::read(self.standards().join(standard.to_string()).join(&asset.name));
        let content = content.map_err(doing("reading a standard"))?;
        checked(content, &asset.checksum, || format!("{} of standard {standard}", asset.name))
    }
}

/// A file that is opened if it is what was stored.
#[derive(Debug)]
pub(super) struct Opening {
    path: PathBuf,
    /// Its name for messages.
    what: String,
    checksum: String,
    sound: Arc<Sound>,
}

impl Opening {
    /// Opens it; `None` if it is not there. Blocks as long as reading it takes.
    pub(super) fn open(self) -> Result<Option<File>, ObjectError> {
        let reading = || doing("reading a file of a model");
        let mut file = match File::open(&self.path) {
            Ok(file) => file,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(reading()(error)),
        };
        let found = file.metadata().map_err(reading())?;
        let state = (found.len(), found.modified().unwrap_or(SystemTime::UNIX_EPOCH));
        if !self.sound.knows(&self.path, state) {
            let mut hasher = blake3::Hasher::new();
            hasher.update_reader(&mut file).map_err(reading())?;
            io::Seek::rewind(&mut file).map_err(reading())?;
            if hasher.finalize().to_hex().as_str() != self.checksum {
                return Err(ObjectError::Damaged { what: self.what });
            }
            self.sound.remember(self.path, state);
        }
        Ok(Some(file))
    }
}

/// A scan's name for messages.
fn scan_of(set: ScanSetId, scan: &ScanRecord) -> String {
    format!("scan {} of scan set {set}", scan.name)
}

fn checked(content: Vec<u8>, checksum: &str, what: impl Fn() -> String) -> Result<Vec<u8>, ObjectError> {
    if blake3::hash(&content).to_hex().as_str() == checksum {
        Ok(content)
    } else {
        Err(ObjectError::Damaged { what: what() })
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::files;
    use super::*;
    use crate::storage::ObjectStore;

    fn asset(name: &str, content: &[u8]) -> AssetRecord {
        let checksum = blake3::hash(content).to_hex().to_string();
        AssetRecord { name: name.to_owned(), bytes: content.len() as u64, checksum }
    }

    #[tokio::test]
    async fn a_flipped_byte_is_not_given_out() {
        let (files, _folder) = files();
        let (model, asset) = (ModelId::new(), asset("cloud.ply", b"three points"));
        let staged_model = files.stage_model().expect("staged");
        files.write_asset(&staged_model, &asset.name, b"three points").expect("written");
        files.keep_model(&staged_model, model).expect("kept");
        assert_eq!(files.read_asset(model, &asset).expect("sound").as_deref(), Some(&b"three points"[..]));
        assert!(files.check_asset(model, &asset).expect("sound"));
        assert!(files.check_asset(model, &asset).expect("sound"), "remembered");

        let path = files.models().join(model.to_string()).join(&asset.name);
        fs::write(&path, b"three pointz").expect("flipped");
        // the same moment may have the same time: what was remembered is forgotten here
        files.sound.0.lock().expect("no panic").clear();
        assert!(matches!(files.read_asset(model, &asset), Err(ObjectError::Damaged { .. })));
        let refused = files.check_asset(model, &asset).expect_err("damaged");
        assert!(refused.to_string().contains("cloud.ply"), "{refused}");
        fs::remove_file(path).expect("removed");
        assert!(!files.check_asset(model, &asset).expect("asked"));
    }
}
