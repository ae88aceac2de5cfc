//! What no row knows is set aside, never just deleted: it goes to `trash/{day and time as an id}/...` and stays there
//! for [`TRASH_DAYS`] days.

use std::fs;
use std::io;
use std::path::PathBuf;

use super::{BlobError, Blobs, doing, gone, listing, private, sync_folder};
use crate::store::{FileId, ScanSetId, StoredFile};

/// How long what was set aside is kept.
pub const TRASH_DAYS: u32 = 30;

impl Blobs {
    /// Everything in the folder that has an id of ours. Blocks.
    pub fn listing(&self) -> Result<Vec<StoredFile>, BlobError> {
        listing::of(&self.root).map_err(doing("reading the data folder"))
    }

    /// Moves things to the trash, under the place they had; answers with the folder in which they are now. Blocks.
    pub fn set_aside(&self, files: &[StoredFile]) -> Result<PathBuf, BlobError> {
        let batch = self.trash().join(FileId::new().to_string());
        let set_aside = || -> io::Result<()> {
            for file in files {
                let place = file.to_string();
                let target = batch.join(&place);
                private::create_folder(target.parent().unwrap_or(&batch))?;
                gone(fs::rename(self.root.join(&place), &target))?;
                sync_folder(target.parent().unwrap_or(&batch))?;
            }
            sync_folder(&self.trash())?;
            self.drop_empty_sets()
        };
        set_aside().map_err(doing("setting files aside")).map(|()| batch)
    }

    /// Removes what belonged to a row that was deleted; no trouble if it is gone. Blocks.
    pub fn remove(&self, file: StoredFile) -> Result<(), BlobError> {
        match file {
            StoredFile::ScanSet(set) => self.remove_scan_set(set),
            StoredFile::Scan(set, scan) => self.remove_scan(set, scan),
            StoredFile::Model(model) => self.remove_model(model),
            StoredFile::Standard(standard) => self.remove_standard(standard),
        }
    }

    /// Removes uploads and models in the making of a server that has ended: they were never anybody's. Only before the
    /// service begins. Answers with the number of them. Blocks.
    pub fn empty_staging(&self) -> Result<usize, BlobError> {
        let empty = || -> io::Result<usize> {
            let left = listing::ids(&self.staging(), FileId::parse)?;
            for id in &left {
                let path = self.staging().join(id.to_string());
                if path.is_dir() { fs::remove_dir_all(path)? } else { fs::remove_file(path)? }
            }
            Ok(left.len())
        };
        empty().map_err(doing("emptying the staging folder"))
    }

    /// Deletes for good what was set aside more than [`TRASH_DAYS`] days ago; answers with the number of batches.
    /// Blocks.
    pub fn empty_trash(&self, now: jiff::Timestamp) -> Result<usize, BlobError> {
        let empty = || -> io::Result<usize> {
            let mut removed = 0;
            for batch in listing::ids(&self.trash(), FileId::parse)? {
                let age = now.duration_since(batch.created_at());
                if age > jiff::SignedDuration::from_hours(24 * i64::from(TRASH_DAYS)) {
                    fs::remove_dir_all(self.trash().join(batch.to_string()))?;
                    removed += 1;
                }
            }
            Ok(removed)
        };
        empty().map_err(doing("emptying the trash"))
    }

    /// Folders of scan sets in which nothing is left.
    fn drop_empty_sets(&self) -> io::Result<()> {
        for set in listing::ids(&self.scan_sets(), ScanSetId::parse)? {
            let folder = self.scan_sets().join(set.to_string());
            if listing::is_empty(&folder) {
                gone(fs::remove_dir(folder))?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{blobs, entries, staged};
    use super::*;
    use crate::store::{ModelId, StandardId};

    #[tokio::test]
    async fn what_is_set_aside_keeps_its_place_and_goes_after_a_while() {
        let (blobs, _folder) = blobs();
        let (set, scans) = (ScanSetId::new(), [FileId::new(), FileId::new()]);
        for scan in scans {
            blobs.keep_scan(&staged(&blobs, b"x").await, set, scan).expect("kept");
        }
        let model = ModelId::new();
        let folder = blobs.stage_model().expect("staged");
        folder.write("report.json", b"{}").expect("written");
        blobs.keep_model(&folder, model).expect("kept");
        let standard = StandardId::new();
        blobs.keep_standard(&staged(&blobs, b"x").await, standard, "model.ply").expect("kept");
        fs::write(blobs.models().join("weights.bin"), "precious").expect("somebody else's");

        let mut listed = blobs.listing().expect("listed");
        listed.sort();
        let mut all = vec![StoredFile::Model(model), StoredFile::Standard(standard)];
        all.extend(scans.map(|scan| StoredFile::Scan(set, scan)));
        all.sort();
        assert_eq!(listed, all);

        let trash = blobs.set_aside(&all).expect("set aside");
        assert_eq!(blobs.listing().expect("listed"), []);
        assert_eq!((entries(&blobs.models()), entries(&blobs.scan_sets())), (1, 0), "weights.bin stays");
        assert!(trash.join("models").join(model.to_string()).join("report.json").exists());
        assert!(trash.join("scan-sets").join(set.to_string()).join(scans[1].to_string()).exists());

        let now = jiff::Timestamp::now();
        assert_eq!(blobs.empty_trash(now).expect("looked"), 0);
        let later = now + jiff::SignedDuration::from_hours(24 * i64::from(TRASH_DAYS) + 1);
        assert_eq!(blobs.empty_trash(later).expect("emptied"), 1);
        assert!(!trash.exists());
    }

    #[tokio::test]
    async fn uploads_of_a_server_that_ended_go_and_nothing_else() {
        let (blobs, _folder) = blobs();
        std::mem::forget(staged(&blobs, b"half").await);
        std::mem::forget(blobs.stage_model().expect("staged"));
        fs::write(blobs.staging().join("site.html"), "x").expect("somebody else's");
        assert_eq!(blobs.empty_staging().expect("emptied"), 2);
        assert_eq!(entries(&blobs.staging()), 1);
    }
}
