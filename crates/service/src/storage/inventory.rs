//! The files held against the database, and what is done about those of processes that are gone.
//!
//! Files without a row mean one of two things. Those that the database expected, or whose row it has deleted, were left
//! by a crash, or are under way in another process. Any other one says that the database is not the one that goes with
//! these files (an older copy, a new one).

use std::collections::BTreeSet;
use std::sync::Arc;

use tokio::task::JoinError;

use super::{Database, DatabaseError, ObjectError, ObjectStore};
use visage_domain::{KnownFiles, LooseFile, StoredFile};

/// Why files and database could not be held against each other.
#[derive(Debug, thiserror::Error)]
pub enum StorageError {
    /// The files.
    #[error(transparent)]
    Objects(#[from] ObjectError),
    /// The database.
    #[error(transparent)]
    Database(#[from] DatabaseError),
    /// A task ended badly.
    #[error("looking at the files: {0}")]
    Task(#[from] JoinError),
}

/// A database and the files that go with it. Cheap to clone.
#[derive(Debug, Clone)]
pub struct Storage {
    /// The database.
    pub database: Arc<dyn Database>,
    /// The files.
    pub objects: Arc<dyn ObjectStore>,
}

/// What is among the files, held against the database.
#[derive(Debug, Default)]
pub struct Inventory {
    /// Files without a row that nothing explains.
    pub unknown: Vec<StoredFile>,
    /// Files that were being stored when their process ended.
    pub arriving: Vec<StoredFile>,
    /// Files whose rows were deleted.
    pub deleted: Vec<StoredFile>,
    /// What has a row but no file.
    pub missing: Vec<StoredFile>,
    /// Entries of the database about files that are left: they are forgotten with them.
    left: Vec<StoredFile>,
}

/// What processes that are gone have left.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PickedUp {
    /// Jobs that wait again.
    pub jobs: u64,
    /// Files that were set aside or removed.
    pub files: usize,
}

impl Storage {
    /// Holds the files against the database. Other processes may store and delete meanwhile: what they have just done
    /// is neither unknown nor missing.
    pub async fn inventory(&self, now: jiff::Timestamp) -> Result<Inventory, StorageError> {
        let files = self.listing().await?;
        let (known, loose) = self.database.known_files().await?;
        let mut found = self.compare(&files, &known, &loose, now);
        if !found.unknown.is_empty() || !found.missing.is_empty() {
            let later = self.listing().await?;
            found.unknown.retain(|file| later.contains(file));
            found.missing.retain(|file| !later.contains(file));
        }
        Ok(found)
    }

    fn compare(
        &self,
        files: &BTreeSet<StoredFile>,
        known: &KnownFiles,
        loose: &[LooseFile],
        now: jiff::Timestamp,
    ) -> Inventory {
        let me = self.database.owner();
        let mut found = Inventory::default();
        for file in files.iter().copied().filter(|file| !known.knows(*file)) {
            match loose.iter().find(|entry| covers(entry.file, file)) {
                None => found.unknown.push(file),
                Some(entry) if entry.is_deleted => found.deleted.push(file),
                Some(entry) if entry.is_left(me, now) => found.arriving.push(file),
                // it is on its way, in a process that lives as far as anybody knows
                Some(_) => {}
            }
        }
        found.missing = known.needed().filter(|file| !files.contains(file)).collect();
        found.left = loose.iter().filter(|entry| entry.is_left(me, now)).map(|entry| entry.file).collect();
        found
    }

    /// Takes over what processes have left that are gone: their jobs wait again, their files are set aside or removed.
    /// `found` must hold nothing unknown.
    pub async fn pick_up(&self, found: Inventory, max_attempts: u32) -> Result<PickedUp, StorageError> {
        if !found.missing.is_empty() {
            tracing::error!(files = found.missing.len(), "files are missing: `visage doctor` names them");
        }
        let Inventory { arriving, deleted, left, .. } = found;
        let jobs = self.database.reclaim_jobs(max_attempts).await?;
        let mut files = arriving.len() + deleted.len();
        if !arriving.is_empty() {
            let trash = self.set_aside(arriving).await?;
            tracing::warn!(trash, "files without a row are set aside");
        }
        let sweep = move |objects: &dyn ObjectStore| -> Result<usize, ObjectError> {
            deleted.into_iter().try_for_each(|file| objects.remove(file))?;
            objects.empty_trash(jiff::Timestamp::now())?;
            objects.sweep_staging()
        };
        files += self.blocking(sweep).await?;
        self.database.forget_loose(&left).await?;
        Ok(PickedUp { jobs, files })
    }

    /// Removes, while a server runs, what was deleted but could not be removed then, and what was never stored after
    /// all.
    pub async fn tidy_up(&self, now: jiff::Timestamp) -> Result<(), StorageError> {
        let me = self.database.owner();
        let (known, loose) = self.database.known_files().await?;
        let due = loose.into_iter().filter(|entry| entry.is_left(me, now)).map(|entry| entry.file);
        let due: Vec<StoredFile> = due.filter(|file| !known.knows(*file)).collect();
        let gone = due.clone();
        let remove = move |objects: &dyn ObjectStore| -> Result<(), ObjectError> {
            gone.into_iter().try_for_each(|file| objects.remove(file))?;
            objects.empty_trash(now).map(drop)
        };
        self.blocking(remove).await?;
        Ok(self.database.forget_loose(&due).await?)
    }

    /// Removes copies that this process has of files that are deleted: another one may have done that.
    pub async fn forget_copies(&self) -> Result<(), StorageError> {
        let (known, _) = self.database.known_files().await?;
        self.blocking(move |objects: &dyn ObjectStore| objects.keep_copies_of(&known)).await
    }

    /// Moves files to the trash; answers with where they are now.
    pub async fn set_aside(&self, files: Vec<StoredFile>) -> Result<String, StorageError> {
        self.blocking(move |objects: &dyn ObjectStore| objects.set_aside(&files)).await
    }

    /// Removes what belonged to a row that is gone, or never came.
    pub async fn remove(&self, file: StoredFile) -> Result<(), StorageError> {
        self.remove_all(vec![file]).await
    }

    /// The same for several. What can't be reached now is removed later: the database knows of it.
    pub async fn remove_all(&self, files: Vec<StoredFile>) -> Result<(), StorageError> {
        let remove = |objects: &dyn ObjectStore| files.into_iter().try_for_each(|file| objects.remove(file));
        match self.blocking(remove).await {
            Err(StorageError::Objects(error)) if error.is_unreachable() => {
                tracing::warn!("files of what was deleted are removed later: {error}");
                Ok(())
            }
            removed => removed,
        }
    }

    /// What the database has answered about the row of a file that has its place already. If the row was refused, the
    /// file is removed; whether a failed commit took place is not known: then the file stays, and is removed later if
    /// it has no row.
    pub async fn or_remove<T>(&self, file: StoredFile, answer: Result<T, DatabaseError>) -> Result<T, StorageError> {
        match answer {
            Err(refused) if !refused.leaves_in_doubt() => {
                self.remove(file).await?;
                Err(refused.into())
            }
            answer => Ok(answer?),
        }
    }

    async fn listing(&self) -> Result<BTreeSet<StoredFile>, StorageError> {
        let files = self.blocking(|objects: &dyn ObjectStore| objects.listing()).await?;
        Ok(files.into_iter().collect())
    }

    /// Works on the files, off the async threads.
    pub async fn blocking<T: Send + 'static>(
        &self,
        work: impl FnOnce(&dyn ObjectStore) -> Result<T, ObjectError> + Send + 'static,
    ) -> Result<T, StorageError> {
        let (objects, span) = (Arc::clone(&self.objects), tracing::Span::current());
        Ok(tokio::task::spawn_blocking(move || span.in_scope(|| work(objects.as_ref()))).await??)
    }
}

/// Whether an entry about `entry` is one about `file` too.
fn covers(entry: StoredFile, file: StoredFile) -> bool {
    entry == file || matches!((entry, file), (StoredFile::ScanSet(whole), StoredFile::Scan(set, _)) if whole == set)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::storage::conformance::memory::MemoryPlace;
    use crate::storage::conformance::{DatabasePlace, ObjectPlace};
    use crate::storage::sqlite::testing::SqlitePlace;
    use visage_domain::{ModelId, NewModel, SeatId};

    fn stored(objects: &dyn ObjectStore) -> ModelId {
        let (staged, id) = (objects.stage_model().expect("staged"), ModelId::new());
        objects.write_asset(&staged, "report.json", b"{}").expect("written");
        objects.keep_model(&staged, id).expect("kept");
        id
    }

    #[tokio::test]
    async fn a_start_leaves_alone_what_another_process_is_storing_until_that_takes_too_long() {
        let (place, objects) = (SqlitePlace::new().await, MemoryPlace::new().open());
        let [a, b] = [place.open(SeatId::new()).await, place.open(SeatId::new()).await];
        let [a, b] = [a, b].map(|database| Storage { database, objects: objects.clone() });
        let id = stored(objects.as_ref());
        a.database.expect_files(&[StoredFile::Model(id)]).await.expect("stored");

        let now = jiff::Timestamp::now();
        let found = b.inventory(now).await.expect("held against the database");
        assert!(found.unknown.is_empty() && found.arriving.is_empty(), "{found:?}");
        assert_eq!(b.pick_up(found, 3).await.expect("a start"), PickedUp { jobs: 0, files: 0 });
        b.tidy_up(now).await.expect("tidied up");
        assert_eq!(objects.listing().expect("listed"), [StoredFile::Model(id)]);
        let model = NewModel { id, ..NewModel::example(None) };
        drop(a.database.create_model(&model, None).await.expect("it has its row"));
        assert!(b.inventory(now).await.expect("held against the database").missing.is_empty());

        let late = stored(objects.as_ref());
        a.database.expect_files(&[StoredFile::Model(late)]).await.expect("stored");
        let later = now + jiff::SignedDuration::from_hours(2);
        let found = b.inventory(later).await.expect("held against the database");
        assert_eq!(found.arriving, [StoredFile::Model(late)]);
        assert_eq!(b.pick_up(found, 3).await.expect("a start"), PickedUp { jobs: 0, files: 1 });
        assert_eq!(objects.listing().expect("listed"), [StoredFile::Model(id)]);
    }

    #[tokio::test]
    async fn a_start_takes_what_its_seat_was_storing_and_no_row_knows() {
        let (place, objects, seat) = (SqlitePlace::new().await, MemoryPlace::new().open(), SeatId::new());
        let gone = Storage { database: place.open(seat).await, objects: objects.clone() };
        let left = stored(objects.as_ref());
        gone.database.expect_files(&[StoredFile::Model(left)]).await.expect("stored");
        let next = Storage { database: place.open(seat).await, objects: objects.clone() };
        let now = jiff::Timestamp::now();
        let found = next.inventory(now).await.expect("held against the database");
        assert_eq!(found.arriving, [StoredFile::Model(left)]);
        assert_eq!(next.pick_up(found, 3).await.expect("a start"), PickedUp { jobs: 0, files: 1 });
        assert_eq!(objects.listing().expect("listed"), []);
        let (_, loose) = next.database.known_files().await.expect("read");
        assert_eq!(loose, [], "it is forgotten");
    }

    #[tokio::test]
    async fn a_file_that_nobody_expected_is_unknown_and_one_that_is_gone_is_missing() {
        let (place, objects) = (SqlitePlace::new().await, MemoryPlace::new().open());
        let storage = Storage { database: place.open(SeatId::new()).await, objects };
        let unknown = stored(storage.objects.as_ref());
        let model = NewModel::example(None);
        drop(storage.database.create_model(&model, None).await.expect("stored"));
        let found = storage.inventory(jiff::Timestamp::now()).await.expect("held against the database");
        assert_eq!(found.unknown, [StoredFile::Model(unknown)]);
        assert_eq!(found.missing, [StoredFile::Model(model.id)]);
    }
}
