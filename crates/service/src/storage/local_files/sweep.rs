//! What no row knows is set aside, never just deleted: it goes to `trash/{day and time as an id}/...` and stays there
//! for [`TRASH_DAYS`] days.

use std::fs;
use std::io;
use std::path::PathBuf;

use super::{LocalFiles, doing, gone, listing, private, sync_folder};
use crate::storage::{ObjectError, TRASH_DAYS};
use visage_domain::{FileId, ScanSetId, StoredFile};

impl LocalFiles {
    /// Everything in the folder that has an id of ours. Blocks.
    pub(super) fn list(&self) -> Result<Vec<StoredFile>, ObjectError> {
        listing::of(&self.root).map_err(doing("reading the data folder"))
    }

    /// Moves things to the trash, under the place they had; answers with the folder in which they are now. Blocks.
    pub(super) fn move_to_trash(&self, files: &[StoredFile]) -> Result<PathBuf, ObjectError> {
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

    /// Deletes for good what was set aside more than [`TRASH_DAYS`] days ago; answers with the number of batches.
    /// Blocks.
    pub(super) fn drop_old_trash(&self, now: jiff::Timestamp) -> Result<usize, ObjectError> {
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
    use super::super::testing::{entries, files, staged};
    use super::*;
    use crate::storage::ObjectStore;
    use visage_domain::{ModelId, StandardId};

    #[tokio::test]
    async fn what_is_set_aside_keeps_its_place_and_goes_after_a_while() {
        let (files, _folder) = files();
        let (set, scans) = (ScanSetId::new(), [FileId::new(), FileId::new()]);
        for scan in scans {
            files.keep_scan(&staged(&files, b"x").await, set, scan).expect("kept");
        }
        let model = ModelId::new();
        let folder = files.stage_model().expect("staged");
        files.write_asset(&folder, "report.json", b"{}").expect("written");
        files.keep_model(&folder, model).expect("kept");
        let standard = StandardId::new();
        files.keep_standard(&staged(&files, b"x").await, standard, "model.ply").expect("kept");
        fs::write(files.models().join("weights.bin"), "precious").expect("somebody else's");

        let mut listed = files.listing().expect("listed");
        listed.sort();
        let mut all = vec![StoredFile::Model(model), StoredFile::Standard(standard)];
        all.extend(scans.map(|scan| StoredFile::Scan(set, scan)));
        all.sort();
        assert_eq!(listed, all);

        let trash = PathBuf::from(files.set_aside(&all).expect("set aside"));
        assert_eq!(files.listing().expect("listed"), []);
        assert_eq!((entries(&files.models()), entries(&files.scan_sets())), (1, 0), "weights.bin stays");
        assert!(trash.join("models").join(model.to_string()).join("report.json").exists());
        assert!(trash.join("scan-sets").join(set.to_string()).join(scans[1].to_string()).exists());

        let now = jiff::Timestamp::now();
        assert_eq!(files.empty_trash(now).expect("looked"), 0);
        let later = now + jiff::SignedDuration::from_hours(24 * i64::from(TRASH_DAYS) + 1);
        assert_eq!(files.empty_trash(later).expect("emptied"), 1);
        assert!(!trash.exists());
    }

    #[tokio::test]
    async fn uploads_of_a_process_that_ended_go_and_nothing_else() {
        let (ended, folder) = files();
        std::mem::forget(staged(&ended, b"half").await);
        std::mem::forget(ended.stage_model().expect("staged"));
        fs::write(ended.database(), "a database").expect("written");
        drop(ended);
        let files = LocalFiles::open(folder.path(), std::time::Duration::ZERO).expect("free again");
        fs::write(files.staging_folder().join("site.html"), "x").expect("somebody else's");
        let own = staged(&files, b"mine").await;
        assert_eq!(files.sweep_staging().expect("swept"), 2);
        assert_eq!(entries(&files.staging_folder()), 2);
        assert_eq!(files.read_staged(&own).expect("it is on its way"), b"mine");
    }
}
