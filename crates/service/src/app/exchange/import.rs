//! A stream is read into a data folder: models that are there already are passed over, so a second time changes nothing.

use std::cell::Cell;
use std::collections::BTreeSet;
use std::io::{self, Read};
use std::rc::Rc;

use tokio::runtime::Handle;

use super::Place;
use super::checked::{checked_model, checked_standard, fitting};
use super::layout::{
    FORMAT, HEAD, Head, ModelEntry, SIGNATURE, StandardEntry, TAIL, Tail, VERSION, of_model, of_standard,
};
use super::received::Entries;
use crate::app::engine::Engine;
use crate::app::standards::MOST_STANDARDS;
use crate::storage::inventory::{Storage, StorageError};
use crate::storage::{DatabaseError, ObjectStore, StagedFile};
use visage_domain::{AssetRecord, Examples, ImportedModel, KnownFiles, ModelId, NewModel, NewStandard, StoredFile};
use visage_formats::ReadLimits;
use visage_geometry::progress::Progress;
use visage_shape::faces::Signature;
use visage_shape::faces::standard::by_name;

/// Models that are stored in one step.
const AT_ONCE: usize = 32;

/// Why a file is not taken in, or not to its end.
#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    /// It is something else.
    #[error("this is no export of a gallery (it has to begin with {HEAD})")]
    NoExport,
    /// It was written by a later program, in a way that this one does not know.
    #[error(
        "the file has layout {found} (written by visage {program}), this program reads up to {VERSION}: use a later one"
    )]
    TooNew {
        /// Its layout,
        found: u32,
        /// and who has written it.
        program: String,
    },
    /// It ends too soon.
    #[error("the file ends in the middle: it was cut short")]
    Cut,
    /// Something stands where something else has to.
    #[error("the file holds {found:?} where {expected} has to be")]
    Unexpected {
        /// What is there.
        found: String,
        /// What should be.
        expected: String,
    },
    /// A description that can't be understood.
    #[error("{place}: {reason}")]
    Malformed {
        /// Which one.
        place: String,
        /// Why.
        reason: String,
    },
    /// A description that is too large to be one.
    #[error("{place} has {bytes} bytes, {most} at most make sense")]
    TooLarge {
        /// Which one.
        place: String,
        /// Its size.
        bytes: u64,
        /// What it may have.
        most: u64,
    },
    /// A file is not what was written.
    #[error("{place} is damaged: its size or checksum is not what was written")]
    Damaged {
        /// Which one.
        place: String,
    },
    /// The file of a standard makes none.
    #[error("the standard {name}: {reason}")]
    Standard {
        /// Which one.
        name: String,
        /// Why.
        reason: String,
    },
    /// The stream can't be read.
    #[error("reading the file: {0}")]
    Read(io::Error),
    /// It can't be stored.
    #[error(transparent)]
    Storage(#[from] StorageError),
}

impl From<io::Error> for ImportError {
    fn from(error: io::Error) -> Self {
        if error.kind() == io::ErrorKind::UnexpectedEof { ImportError::Cut } else { ImportError::Read(error) }
    }
}

impl From<DatabaseError> for ImportError {
    fn from(error: DatabaseError) -> Self {
        ImportError::Storage(error.into())
    }
}

/// What came of it.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Imported {
    /// Models that are new.
    pub models: u64,
    /// Of these, those whose signature is made anew after the next start: it is of another version.
    pub to_be_described: u64,
    /// Standards that are new.
    pub standards: u64,
    /// What was there already.
    pub known: u64,
    /// What was not taken, and why.
    pub passed_over: Vec<String>,
}

/// Reads all models and standards. What was stored before an error stays. Blocks, and must not run on an async thread.
///
/// # Errors
/// The file is not sound, or something can't be stored.
pub fn import(
    storage: &Storage,
    runtime: &Handle,
    engine: &dyn Engine,
    limits: &ReadLimits,
    from: impl Read,
) -> Result<Imported, ImportError> {
    let ended = Rc::default();
    let mut archive = tar::Archive::new(Watched { from, ended: Rc::clone(&ended) });
    read(storage, runtime, engine, limits, &mut archive).map_err(|error| match error {
        ImportError::Read(_) if ended.get() => ImportError::Cut,
        error => error,
    })
}

/// A stream that is known to have ended: what tar says of that is no error of a kind of its own.
struct Watched<R> {
    from: R,
    ended: Rc<Cell<bool>>,
}

impl<R: Read> Read for Watched<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let read = self.from.read(buffer)?;
        self.ended.set(read == 0 && !buffer.is_empty());
        Ok(read)
    }
}

fn read<R: Read>(
    storage: &Storage,
    runtime: &Handle,
    engine: &dyn Engine,
    limits: &ReadLimits,
    archive: &mut tar::Archive<R>,
) -> Result<Imported, ImportError> {
    let mut entries = Entries::of(archive)?;
    let head: Head = entries.json(HEAD).map_err(|error| match error {
        ImportError::Storage(_) => error,
        _ => ImportError::NoExport,
    })?;
    if head.format != FORMAT {
        return Err(ImportError::NoExport);
    }
    if head.version > VERSION {
        return Err(ImportError::TooNew { found: head.version, program: head.program });
    }
    let place = Place { storage, runtime };
    let (known, _) = place.ask(storage.database.known_files())?;
    let mut importer = Importer {
        place,
        known,
        seen: BTreeSet::new(),
        waiting: Vec::new(),
        read: Tail::default(),
        done: Imported::default(),
    };
    loop {
        let next = entries.next_place()?;
        if next == TAIL {
            break;
        }
        match next.split('/').collect::<Vec<_>>().as_slice() {
            ["models", id, "model.json"] => importer.model(&mut entries, id)?,
            ["standards", id, "standard.json"] => {
                importer.store()?;
                importer.standard(&mut entries, id, engine, limits)?;
            }
            _ => {
                return Err(ImportError::Unexpected { found: next, expected: "a model, a standard or the end".into() });
            }
        }
    }
    importer.store()?;
    let tail: Tail = entries.json(TAIL)?;
    if tail != importer.read {
        let reason = format!("it counts {tail:?}, and {:?} came", importer.read);
        return Err(ImportError::Malformed { place: TAIL.into(), reason });
    }
    Ok(importer.done)
}

/// A model that has arrived.
struct Arrived {
    model: ImportedModel,
    files: Vec<StagedFile>,
}

struct Importer<'a> {
    place: Place<'a>,
    /// What the folder held before.
    known: KnownFiles,
    /// What has come: nothing may come twice.
    seen: BTreeSet<String>,
    waiting: Vec<Arrived>,
    read: Tail,
    done: Imported,
}

impl Importer<'_> {
    fn model<R: Read>(&mut self, entries: &mut Entries<'_, R>, id: &str) -> Result<(), ImportError> {
        let place = of_model(id, "model.json");
        let entry: ModelEntry = entries.json(&place)?;
        let wrong = |reason: String| ImportError::Malformed { place: place.clone(), reason };
        let mut model = checked_model(&entry, id, &wrong)?;
        self.come(id, &wrong)?;
        self.read.models += 1;
        let is_known = self.known.models.contains(&model.model.id);
        let lost_set = self.binned_set(&model)?;
        let mut files = Vec::new();
        for file in &entry.files {
            let at = of_model(id, &file.name);
            match is_known || lost_set {
                true => entries.pass_over(&at, file)?,
                false => files.push(entries.staged(&self.place, &at, file)?),
            }
        }
        if let Some(signature) = &entry.signature {
            let content = entries.content(&of_model(id, SIGNATURE), &signature.file)?;
            model.model.signature = Some(fitting(signature, content));
        }
        if is_known {
            return self.known_model(&model.model);
        }
        if lost_set {
            self.pass_over(format!("model {id}: the scan set that it was made from is in the recycle bin"));
            return Ok(());
        }
        self.waiting.push(Arrived { model, files });
        if self.waiting.len() >= AT_ONCE { self.store() } else { Ok(()) }
    }

    /// Nothing that is there is changed.
    fn known_model(&mut self, model: &NewModel) -> Result<(), ImportError> {
        match self.place.ask(self.place.storage.database.assets(model.id))? {
            assets if assets.is_empty() => self.pass_over(format!("model {}: it is in the recycle bin", model.id)),
            assets if same_files(&assets, &model.assets) => self.done.known += 1,
            _ => self.pass_over(format!("model {}: another one has this id", model.id)),
        }
        Ok(())
    }

    /// Whether what it was made from was deleted here and can still be put back.
    fn binned_set(&self, model: &ImportedModel) -> Result<bool, ImportError> {
        let Some(set) = model.scan_set.as_ref().filter(|set| self.known.scan_sets.contains(&set.id)) else {
            return Ok(false);
        };
        match self.place.ask(self.place.storage.database.scan_set(set.id)) {
            Err(StorageError::Database(DatabaseError::NotFound { .. })) => Ok(true),
            found => Ok(found.map(|_| false)?),
        }
    }

    fn come(&mut self, id: &str, wrong: &dyn Fn(String) -> ImportError) -> Result<(), ImportError> {
        if self.seen.insert(id.to_owned()) { Ok(()) } else { Err(wrong("it comes twice".into())) }
    }

    fn pass_over(&mut self, what: String) {
        self.done.passed_over.push(what);
    }

    /// Stores what has arrived: files first, as for any model, so that a crash leaves no row without them.
    fn store(&mut self) -> Result<(), ImportError> {
        if self.waiting.is_empty() {
            return Ok(());
        }
        let storage = self.place.storage;
        let arrived = std::mem::take(&mut self.waiting);
        let stored: Vec<StoredFile> = arrived.iter().map(|each| StoredFile::Model(each.model.model.id)).collect();
        self.place.ask(storage.database.expect_files(&stored))?;
        let mut models = Vec::new();
        for Arrived { model, files } in arrived {
            keep(storage.objects.as_ref(), &model.model, &files)?;
            models.push(model);
        }
        let answer = self.place.runtime.block_on(storage.database.import_models(&models));
        if let Err(refused) = answer {
            if !refused.leaves_in_doubt() {
                self.place.runtime.block_on(storage.remove_all(stored))?;
            }
            return Err(refused.into());
        }
        self.done.models += models.len() as u64;
        let stale =
            |each: &&ImportedModel| each.model.signature.as_ref().is_some_and(|s| s.version != Signature::VERSION);
        self.done.to_be_described += models.iter().filter(stale).count() as u64;
        Ok(())
    }

    fn standard<R: Read>(
        &mut self,
        entries: &mut Entries<'_, R>,
        id: &str,
        engine: &dyn Engine,
        limits: &ReadLimits,
    ) -> Result<(), ImportError> {
        let place = of_standard(id, "standard.json");
        let entry: StandardEntry = entries.json(&place)?;
        let wrong = |reason: String| ImportError::Malformed { place: place.clone(), reason };
        let (parsed, unit) = checked_standard(&entry, id, &wrong)?;
        self.come(id, &wrong)?;
        self.read.standards += 1;
        let at = of_standard(id, &entry.file.name);
        let database = &self.place.storage.database;
        let there = self.place.ask(database.standards())?;
        if let Some(one) = there.iter().find(|one| one.id == parsed || one.name == entry.name) {
            entries.pass_over(&at, &entry.file)?;
            match one.id == parsed && one.asset == AssetRecord::from(&entry.file) {
                true => self.done.known += 1,
                false => self.pass_over(format!("standard {}: another one has its name or id", entry.name)),
            }
            return Ok(());
        }
        if by_name(&entry.name).is_some() {
            entries.pass_over(&at, &entry.file)?;
            self.pass_over(format!("standard {}: one of this name is built in", entry.name));
            return Ok(());
        }
        let file = entries.staged(&self.place, &at, &entry.file)?;
        let refused = |reason: String| ImportError::Standard { name: entry.name.clone(), reason };
        let bytes = self.place.storage.objects.read_staged(&file).map_err(StorageError::from)?;
        let reading =
            visage_formats::read(&entry.file.name, &bytes, limits).map_err(|error| refused(error.to_string()))?;
        let definition = engine
            .annotate(&reading.surface, unit, &entry.annotation, &Progress::silent())
            .map_err(|error| refused(error.to_string()))?;
        let standard = NewStandard {
            id: parsed,
            name: entry.name.clone(),
            asset: AssetRecord::from(&entry.file),
            unit,
            annotation: entry.annotation.clone(),
            definition,
            examples: Examples { positive: self.there(&entry.positive)?, negative: self.there(&entry.negative)? },
        };
        self.store_standard(&standard, &file)
    }

    fn store_standard(&mut self, standard: &NewStandard, file: &StagedFile) -> Result<(), ImportError> {
        let (storage, stored) = (self.place.storage, StoredFile::Standard(standard.id));
        self.place.ask(storage.database.expect_files(&[stored]))?;
        storage.objects.keep_standard(file, standard.id, &standard.asset.name).map_err(StorageError::from)?;
        let created =
            self.place.runtime.block_on(storage.database.create_standard(standard, MOST_STANDARDS, &|_| None));
        match self.place.runtime.block_on(storage.or_remove(stored, created)) {
            Err(StorageError::Database(full @ DatabaseError::TooManyStandards { .. })) => {
                self.pass_over(format!("standard {}: {full}", standard.name));
            }
            stored => {
                stored?;
                self.done.standards += 1;
            }
        }
        Ok(())
    }

    /// Those of the models that are there.
    fn there(&self, ids: &[String]) -> Result<Vec<ModelId>, ImportError> {
        let ids: Vec<ModelId> = ids.iter().filter_map(|id| ModelId::parse(id)).collect();
        let there = self.place.ask(self.place.storage.database.matched_models(&ids))?;
        Ok(there.into_iter().map(|model| model.id).collect())
    }
}

fn keep(objects: &dyn ObjectStore, model: &NewModel, files: &[StagedFile]) -> Result<(), StorageError> {
    let staged = objects.stage_model()?;
    for (asset, file) in model.assets.iter().zip(files) {
        objects.take_asset(&staged, &asset.name, file)?;
    }
    Ok(objects.keep_model(&staged, model.id)?)
}

fn same_files(there: &[AssetRecord], come: &[AssetRecord]) -> bool {
    there.len() == come.len() && there.iter().all(|file| come.contains(file))
}
