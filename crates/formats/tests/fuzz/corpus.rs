//! Files that went wrong once, by reader: every run reads them first. `corpus/README.md` says of each why it is there.

use std::path::PathBuf;

fn folder() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/fuzz/corpus")
}

/// The files of a reader, by name.
pub fn of(reader: &str) -> Vec<(String, Vec<u8>)> {
    let Ok(files) = std::fs::read_dir(folder().join(reader)) else { return Vec::new() };
    let mut files: Vec<(String, Vec<u8>)> = files
        .map(|file| file.expect("the folder is there"))
        .map(|file| (file.file_name().to_string_lossy().into_owned(), std::fs::read(file.path()).expect("a file")))
        .collect();
    files.sort();
    files
}

/// Every file belongs to a reader and has its line.
pub fn check_list() {
    let list = std::fs::read_to_string(folder().join("README.md")).expect("the list of the corpus");
    for reader in std::fs::read_dir(folder()).expect("the corpus is there").map(|entry| entry.expect("an entry")) {
        let name = reader.file_name().to_string_lossy().into_owned();
        if name == "README.md" {
            continue;
        }
        assert!(super::READERS.iter().any(|target| target.name == name), "corpus/{name} belongs to no reader");
        for (file, _) in of(&name) {
            assert!(
                list.contains(&format!("`{name}/{file}`")),
                "corpus/README.md does not say why {name}/{file} is kept"
            );
        }
    }
}
