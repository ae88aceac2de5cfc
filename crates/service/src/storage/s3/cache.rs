//! Files that were fetched from the bucket, or have just been put there, on the local disk: as many as there is room for, and
//! those that nobody has used for longest leave. Nothing is lost with any of them.

use std::collections::{BTreeMap, HashMap};
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::SystemTime;

/// The cache: files under the places that they have in the bucket.
#[derive(Debug)]
pub(super) struct Cache {
    folder: PathBuf,
    most_bytes: u64,
    held: Mutex<Held>,
}

#[derive(Debug, Default)]
struct Held {
    entries: HashMap<PathBuf, Entry>,
    by_use: BTreeMap<u64, PathBuf>,
    bytes: u64,
    uses: u64,
}

#[derive(Debug)]
struct Entry {
    bytes: u64,
    used: u64,
    /// The time of the file when its content was last held against its checksum.
    sound: Option<SystemTime>,
}

/// A file of the cache.
#[derive(Debug)]
pub(super) struct Cached {
    /// It, at its beginning; it stays readable when it leaves the cache.
    pub(super) file: File,
    /// Whether nobody has written to it since it was held against its checksum.
    pub(super) is_sound: bool,
}

impl Cache {
    /// Takes over what is there. Blocks.
    pub(super) fn open(folder: PathBuf, most_bytes: u64) -> io::Result<Cache> {
        private_folder(&folder)?;
        let mut found = Vec::new();
        gather(&folder, Path::new(""), &mut found)?;
        found.sort();
        let mut held = Held::default();
        for (_, place, bytes) in found {
            held.insert(place, bytes, None);
        }
        let cache = Cache { folder, most_bytes, held: Mutex::new(held) };
        cache.make_room(&mut cache.lock())?;
        Ok(cache)
    }

    fn lock(&self) -> MutexGuard<'_, Held> {
        self.held.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A file, if it is held; it counts as used. Blocks.
    pub(super) fn file(&self, place: &str) -> Option<Cached> {
        let mut held = self.lock();
        let (place, uses) = (Path::new(place), held.uses);
        let entry = held.entries.get_mut(place)?;
        let (before, sound) = (std::mem::replace(&mut entry.used, uses), entry.sound);
        held.by_use.remove(&before);
        held.by_use.insert(uses, place.to_owned());
        held.uses += 1;
        match File::open(self.folder.join(place)) {
            Ok(file) => {
                let is_sound = sound.is_some() && sound == modified(&file);
                Some(Cached { file, is_sound })
            }
            Err(_) => {
                held.forget(place);
                None
            }
        }
    }

    /// Remembers that a file is what was stored.
    pub(super) fn trust(&self, place: &str, file: &File) {
        if let Some(entry) = self.lock().entries.get_mut(Path::new(place)) {
            entry.sound = modified(file);
        }
    }

    /// Takes a file over that is what is stored at its place; one that is larger than the cache drives nothing out. Blocks.
    pub(super) fn take(&self, from: &Path, place: &str) -> io::Result<()> {
        if fs::metadata(from)?.len() > self.most_bytes {
            return fs::remove_file(from);
        }
        let target = self.folder.join(place);
        private_folder(target.parent().unwrap_or(&self.folder))?;
        fs::rename(from, &target)?;
        let file = File::open(&target)?;
        let mut held = self.lock();
        held.forget(Path::new(place));
        held.insert(PathBuf::from(place), file.metadata()?.len(), modified(&file));
        self.make_room(&mut held)
    }

    /// Removes a file, or all below a place; no trouble if there is none. Blocks.
    pub(super) fn forget(&self, place: &str) -> io::Result<()> {
        let mut held = self.lock();
        let place = Path::new(place);
        let there: Vec<PathBuf> = held.entries.keys().filter(|held| held.starts_with(place)).cloned().collect();
        there.iter().try_for_each(|place| self.drop_file(&mut held, place))
    }

    /// Removes files, by the places they have. Blocks.
    pub(super) fn retain(&self, is_needed: impl Fn(&str) -> bool) -> io::Result<()> {
        let mut held = self.lock();
        let is_needed = |place: &Path| place.to_str().is_some_and(&is_needed);
        let there: Vec<PathBuf> = held.entries.keys().filter(|place| !is_needed(place)).cloned().collect();
        there.iter().try_for_each(|place| self.drop_file(&mut held, place))
    }

    fn make_room(&self, held: &mut Held) -> io::Result<()> {
        while held.bytes > self.most_bytes {
            let Some(oldest) = held.by_use.values().next().cloned() else { break };
            self.drop_file(held, &oldest)?;
        }
        Ok(())
    }

    fn drop_file(&self, held: &mut Held, place: &Path) -> io::Result<()> {
        held.forget(place);
        let path = self.folder.join(place);
        match fs::remove_file(&path) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
            _ => {}
        }
        // the folder of its group, if nothing else is in it
        if let Some(group) = path.parent().filter(|group| *group != self.folder) {
            let _ = fs::remove_dir(group);
        }
        Ok(())
    }

    /// Bytes that are held.
    #[cfg(test)]
    pub(super) fn bytes(&self) -> u64 {
        self.lock().bytes
    }
}

impl Held {
    fn insert(&mut self, place: PathBuf, bytes: u64, sound: Option<SystemTime>) {
        self.by_use.insert(self.uses, place.clone());
        self.entries.insert(place, Entry { bytes, used: self.uses, sound });
        self.bytes += bytes;
        self.uses += 1;
    }

    fn forget(&mut self, place: &Path) {
        if let Some(entry) = self.entries.remove(place) {
            self.by_use.remove(&entry.used);
            self.bytes -= entry.bytes;
        }
    }
}

fn modified(file: &File) -> Option<SystemTime> {
    file.metadata().and_then(|found| found.modified()).ok()
}

/// Scans of people are nobody else's business here either.
fn private_folder(folder: &Path) -> io::Result<()> {
    crate::storage::local_files::create_private_folder(folder)
}

fn gather(root: &Path, place: &Path, found: &mut Vec<(SystemTime, PathBuf, u64)>) -> io::Result<()> {
    for entry in fs::read_dir(root.join(place))? {
        let entry = entry?;
        let (place, about) = (place.join(entry.file_name()), entry.metadata()?);
        if about.is_dir() {
            gather(root, &place, found)?;
        } else {
            found.push((about.modified()?, place, about.len()));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::io::Read;

    use super::*;

    struct Place {
        folder: tempfile::TempDir,
        cache: Cache,
    }

    impl Place {
        fn new(most_bytes: u64) -> Place {
            let folder = tempfile::tempdir().expect("a temporary folder");
            let cache = Cache::open(folder.path().join("cache"), most_bytes).expect("opened");
            Place { folder, cache }
        }

        fn take(&self, place: &str, content: &str) {
            let from = self.folder.path().join("new");
            fs::write(&from, content).expect("written");
            self.cache.take(&from, place).expect("taken");
        }

        fn held(&self, place: &str) -> Option<String> {
            let mut content = String::new();
            self.cache.file(place)?.file.read_to_string(&mut content).expect("read");
            Some(content)
        }
    }

    #[test]
    fn what_nobody_has_used_for_longest_leaves() {
        let place = Place::new(10);
        place.take("models/a/cloud", "aaaa");
        place.take("models/b/cloud", "bbbb");
        assert_eq!(place.held("models/a/cloud").as_deref(), Some("aaaa"));
        place.take("models/c/cloud", "cccc");
        let held = ["a", "b", "c"].map(|model| place.held(&format!("models/{model}/cloud")).is_some());
        assert_eq!((held, place.cache.bytes()), ([true, false, true], 8));
        assert!(!place.folder.path().join("cache/models/b").exists(), "nothing is left of it");
        place.take("models/d/cloud", "larger than the cache");
        assert_eq!((place.held("models/d/cloud"), place.cache.bytes()), (None, 8));
    }

    #[test]
    fn what_is_held_outlives_the_process_but_is_looked_at_again() {
        let place = Place::new(100);
        place.take("models/a/cloud", "aaaa");
        assert!(place.cache.file("models/a/cloud").expect("held").is_sound);
        let next = Cache::open(place.folder.path().join("cache"), 100).expect("opened");
        let cached = next.file("models/a/cloud").expect("held");
        assert!(!cached.is_sound, "who knows what has happened to it");
        next.trust("models/a/cloud", &cached.file);
        assert!(next.file("models/a/cloud").expect("held").is_sound);
        assert_eq!(Cache::open(place.folder.path().join("cache"), 3).expect("opened").bytes(), 0, "less room now");
    }

    #[test]
    fn what_belongs_together_goes_together() {
        let place = Place::new(100);
        for name in ["models/a/cloud", "models/a/mesh", "models/ab/mesh"] {
            place.take(name, "aaaa");
        }
        place.cache.forget("models/a").expect("removed");
        place.cache.forget("models/a").expect("no trouble");
        assert_eq!(place.held("models/a/mesh"), None);
        assert_eq!((place.held("models/ab/mesh").is_some(), place.cache.bytes()), (true, 4));
        place.take("models/b/cloud", "bbbb");
        place.cache.retain(|place| place.starts_with("models/b/")).expect("removed");
        assert_eq!((place.held("models/b/cloud").is_some(), place.cache.bytes()), (true, 4));
    }
}
