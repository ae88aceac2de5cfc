//! OBJ files whose colours are in files beside them.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::formats::{self, FormatError, ReadLimits, Reading, obj, obj_textures, packed};

/// Reads a scan, `name` from `folder`; an OBJ file with its materials and pictures.
pub fn read(folder: &Path, name: &str, bytes: &[u8], limits: &ReadLimits) -> Result<Reading, FormatError> {
    if formats::check_name(name)? != &obj::FORMAT {
        return formats::read(name, bytes, limits);
    }
    let (_, bytes) = packed::unpacked(name, bytes, limits)?;
    let parent = folder.join(name).parent().map(Path::to_owned).unwrap_or_default();
    // only what is listed is read, wherever the paths in the file lead
    let mut files = BTreeMap::new();
    list(&parent, "", obj_textures::DEPTH, &mut files);
    let resolve = |path: &str| {
        let file = files.get(path)?;
        let is_sound = file.metadata().is_ok_and(|data| data.is_file() && data.len() <= limits.max_bytes);
        is_sound.then(|| std::fs::read(file).ok()).flatten().map(Cow::Owned)
    };
    obj_textures::read(&bytes, limits, &resolve)
}

/// Lists the files that may be needed by their paths from the OBJ file. A folder that can't be listed has none.
fn list(path: &Path, prefix: &str, depth: usize, files: &mut BTreeMap<String, PathBuf>) {
    for entry in std::fs::read_dir(path).into_iter().flatten().flatten() {
        let name = format!("{prefix}{}", entry.file_name().to_string_lossy());
        let Ok(kind) = entry.file_type() else { continue };
        if kind.is_dir() && depth > 0 {
            list(&entry.path(), &format!("{name}/"), depth - 1, files);
        } else if obj_textures::ENDINGS.contains(&formats::extension(&name).as_str()) {
            files.insert(name, entry.path());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const OBJ: &[u8] = b"mtllib parts/a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl red\nf 1 2 3\n";
    const MATERIALS: &[u8] = b"newmtl red\nKd 1 0 0\n";

    #[test]
    fn materials_are_found_beside_the_file_and_nowhere_else() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        std::fs::create_dir_all(folder.path().join("set/parts")).expect("made");
        std::fs::write(folder.path().join("set/parts/a.mtl"), MATERIALS).expect("written");
        let colors = |name: &str, text: &[u8]| {
            let reading = read(folder.path(), name, text, &ReadLimits::default()).expect("sound");
            (reading.surface.cloud.colors, reading.dropped.notes.len())
        };
        assert_eq!(colors("set/a.obj", OBJ), (Some(vec![[255, 0, 0]; 3]), 0));
        assert_eq!(colors("a.obj", OBJ), (None, 1));
        let outside = String::from_utf8_lossy(OBJ).replace("parts/a.mtl", "../set/parts/a.mtl");
        assert_eq!(colors("set/a.obj", outside.as_bytes()), (None, 1));
    }
}
