//! OBJ files whose colours are in other files of their archive: materials and pictures.

use std::borrow::Cow;
use std::cell::{Cell, RefCell};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Mutex, PoisonError};

use super::Desk;
use crate::storage::{ObjectError, StagedFile};
use visage_formats::{FormatError, Reading, check_name, extension, obj, obj_textures, packed, write_mesh_of};
use visage_geometry::Unit;

/// Files of an archive that OBJ files may need, by their paths.
#[derive(Debug, Default)]
pub(super) struct Beside {
    files: BTreeMap<String, StagedFile>,
    used: Mutex<BTreeSet<String>>,
}

/// Whether a file may have its colours in others.
pub(super) fn may_be_textured(name: &str) -> bool {
    check_name(name).is_ok_and(|format| format == &obj::FORMAT)
}

/// An OBJ file that was read with what stands beside it.
pub(super) struct Textured {
    pub reading: Reading,
    /// The file with the colours of its vertices in it, if they are in others.
    pub colored: Option<Vec<u8>>,
}

impl Beside {
    /// Takes the files that may be needed out of those of an archive.
    pub fn take_from(files: &mut BTreeMap<String, StagedFile>) -> Self {
        let is_needed = |name: &str| obj_textures::ENDINGS.contains(&extension(name).as_str());
        let (beside, others) = std::mem::take(files).into_iter().partition(|(name, _)| is_needed(name));
        *files = others;
        Beside { files: beside, used: Mutex::default() }
    }

    /// Reads an OBJ file: `name` is its path in the archive. Blocks.
    ///
    /// # Errors
    /// Those of the reader; the outer ones are those of the storage.
    pub fn read(&self, desk: &Desk, name: &str, bytes: &[u8]) -> Result<Result<Textured, FormatError>, ObjectError> {
        let folder = name.rfind('/').map_or("", |end| &name[..=end]);
        let (is_found, failed) = (Cell::new(false), RefCell::new(None));
        let resolve = |path: &str| {
            // the paths of an archive hold no `..`: nothing above the file's folder is found
            let file = format!("{folder}{path}");
            let staged = self.files.get(&file).filter(|_| path.split('/').count() <= obj_textures::DEPTH + 1)?;
            match desk.objects.read_staged(staged) {
                Ok(bytes) => {
                    is_found.set(true);
                    self.used.lock().unwrap_or_else(PoisonError::into_inner).insert(file);
                    Some(Cow::Owned(bytes))
                }
                Err(error) => {
                    failed.borrow_mut().get_or_insert(error);
                    None
                }
            }
        };
        let limits = desk.limits.read_limits();
        let read = || {
            let (_, bytes) = packed::unpacked(name, bytes, &limits)?;
            let reading = obj_textures::read(&bytes, &limits, &resolve)?;
            // a file that has colours of its own asks for no other
            let is_colored = is_found.get() && reading.surface.cloud.colors.is_some();
            let colored = if is_colored { written(name, &reading) } else { None };
            Ok(Textured { reading, colored })
        };
        let read = read();
        match failed.into_inner() {
            Some(error) => Err(error),
            None => Ok(read),
        }
    }

    /// The files that no OBJ file has needed.
    pub fn unused(&self) -> Vec<String> {
        let used = self.used.lock().unwrap_or_else(PoisonError::into_inner);
        self.files.keys().filter(|name| !used.contains(*name)).cloned().collect()
    }
}

/// The file with its colours.
fn written(name: &str, reading: &Reading) -> Option<Vec<u8>> {
    let bytes = write_mesh_of(&reading.surface, Unit::Unknown, obj::FORMAT.writers.mesh?)?;
    Some(if packed::inner_name(name).is_some() { packed::pack(&bytes) } else { bytes })
}
