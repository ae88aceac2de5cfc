//! Files are held against their checksums before they are given out: a disk that forgets must not answer for us.

use std::collections::HashMap;
use std::fs::{self, File};
use std::io;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::SystemTime;

use super::{BlobError, Blobs, doing};
use crate::store::{AssetRecord, ModelId, ScanRecord, ScanSetId, StandardId};

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

impl Blobs {
    /// Opens a file of a model that is what was stored; `None` if it is not there.
    pub async fn open_asset(
        self: &Arc<Self>,
        model: ModelId,
        asset: &AssetRecord,
    ) -> Result<Option<tokio::fs::File>, BlobError> {
        let (blobs, asset) = (Arc::clone(self), asset.clone());
        let opened = tokio::task::spawn_blocking(move || blobs.open_sound(model, &asset)).await;
        let opened = opened.map_err(|error| doing("reading a file of a model")(io::Error::other(error)))??;
        Ok(opened.map(tokio::fs::File::from_std))
    }

    /// The same for others than servers. Blocks as long as reading it takes.
    pub fn open_sound(&self, model: ModelId, asset: &AssetRecord) -> Result<Option<File>, BlobError> {
        let path = self.models().join(model.to_string()).join(&asset.name);
        let reading = || doing("reading a file of a model");
        let mut file = match File::open(&path) {
            Ok(file) => file,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(reading()(error)),
        };
        let found = file.metadata().map_err(reading())?;
        let state = (found.len(), found.modified().unwrap_or(SystemTime::UNIX_EPOCH));
        if !self.sound.knows(&path, state) {
            let mut hasher = blake3::Hasher::new();
            hasher.update_reader(&mut file).map_err(reading())?;
            io::Seek::rewind(&mut file).map_err(reading())?;
            if hasher.finalize().to_hex().as_str() != asset.checksum {
                return Err(BlobError::Damaged { what: format!("{} of model {model}", asset.name) });
            }
            self.sound.remember(path, state);
        }
        Ok(Some(file))
    }

    /// The content of a file of a model, if that is what was stored; `None` if it is not there. Blocks.
    pub fn read_asset(&self, model: ModelId, asset: &AssetRecord) -> Result<Option<Vec<u8>>, BlobError> {
        match fs::read(self.models().join(model.to_string()).join(&asset.name)) {
            Ok(content) => checked(content, asset, || format!("{} of model {model}", asset.name)).map(Some),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
            Err(error) => Err(doing("reading a file of a model")(error)),
        }
    }

    /// Whether a scan is what was stored. Blocks.
    pub fn check_scan(&self, set: ScanSetId, scan: &ScanRecord) -> Result<(), BlobError> {
        let mut hasher = blake3::Hasher::new();
        let file = File::open(self.scan(set, scan.file_id)).map_err(doing("reading a scan"))?;
        hasher.update_reader(file).map_err(doing("reading a scan"))?;
        if hasher.finalize().to_hex().as_str() == scan.checksum {
            return Ok(());
        }
        Err(BlobError::Damaged { what: format!("scan {} of scan set {set}", scan.name) })
    }

    /// The file that a standard was made of, if it is what was stored. Blocks.
    pub fn read_standard(&self, standard: StandardId, asset: &AssetRecord) -> Result<Vec<u8>, BlobError> {
        let content = fs::read(self.standards().join(standard.to_string()).join(&asset.name));
        let content = content.map_err(doing("reading a standard"))?;
        checked(content, asset, || format!("{} of standard {standard}", asset.name))
    }
}

fn checked(content: Vec<u8>, asset: &AssetRecord, what: impl Fn() -> String) -> Result<Vec<u8>, BlobError> {
    if blake3::hash(&content).to_hex().as_str() == asset.checksum {
        Ok(content)
    } else {
        Err(BlobError::Damaged { what: what() })
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{blobs, staged};
    use super::*;

    fn asset(name: &str, content: &[u8]) -> AssetRecord {
        let checksum = blake3::hash(content).to_hex().to_string();
        AssetRecord { name: name.to_owned(), bytes: content.len() as u64, checksum }
    }

    #[tokio::test]
    async fn a_flipped_byte_is_not_given_out() {
        let (blobs, _folder) = blobs();
        let (model, asset) = (ModelId::new(), asset("cloud.ply", b"three points"));
        let staged_model = blobs.stage_model().expect("staged");
        staged_model.write(&asset.name, b"three points").expect("written");
        blobs.keep_model(&staged_model, model).expect("kept");
        assert_eq!(blobs.read_asset(model, &asset).expect("sound").as_deref(), Some(&b"three points"[..]));
        assert!(blobs.open_sound(model, &asset).expect("sound").is_some());
        assert!(blobs.open_sound(model, &asset).expect("sound").is_some(), "remembered");

        let path = blobs.models().join(model.to_string()).join(&asset.name);
        fs::write(&path, b"three pointz").expect("flipped");
        // the same moment may have the same time: what was remembered is forgotten here
        blobs.sound.0.lock().expect("no panic").clear();
        assert!(matches!(blobs.read_asset(model, &asset), Err(BlobError::Damaged { .. })));
        let refused = blobs.open_sound(model, &asset).expect_err("damaged");
        assert!(refused.to_string().contains("cloud.ply"), "{refused}");
        fs::remove_file(path).expect("removed");
        assert!(blobs.open_sound(model, &asset).expect("asked").is_none());
    }

    #[tokio::test]
    async fn the_file_of_a_standard_is_checked_too() {
        let (blobs, _folder) = blobs();
        let (standard, asset) = (StandardId::new(), asset("model.ply", b"three points"));
        blobs.keep_standard(&staged(&blobs, b"three points").await, standard, &asset.name).expect("kept");
        assert_eq!(blobs.read_standard(standard, &asset).expect("sound"), b"three points");
        fs::write(blobs.standards().join(standard.to_string()).join(&asset.name), "x").expect("changed");
        assert!(matches!(blobs.read_standard(standard, &asset), Err(BlobError::Damaged { .. })));
    }
}
