//! The bucket as an object store: what arrives is staged in the data folder, and put into the bucket when it is whole.

use std::fs;
use std::sync::Arc;

use async_trait::async_trait;

use super::{BucketFiles, Wanted};
use crate::storage::{
    AssetReader, ObjectError, ObjectStore, PieceWriter, StagedFile, StagedModel, StagedWriter, TRASH_DAYS,
};
use visage_domain::{
    AssetRecord, FileId, KnownFiles, ModelId, ScanRecord, ScanSetId, StandardId, StoredFile, UploadId,
};

const LISTING: &str = "listing what the object store holds";
const TRASH: &str = "trash";

fn of_scan(set: ScanSetId, scan: &ScanRecord) -> Wanted {
    Wanted {
        place: StoredFile::Scan(set, scan.file_id).to_string(),
        checksum: scan.checksum.clone(),
        what: format!("scan {} of scan set {set}", scan.name),
        doing: "reading a scan",
    }
}

fn of_asset(model: ModelId, asset: &AssetRecord) -> Wanted {
    Wanted {
        place: format!("{}/{}", StoredFile::Model(model), asset.name),
        checksum: asset.checksum.clone(),
        what: format!("{} of model {model}", asset.name),
        doing: "reading a file of a model",
    }
}

fn of_standard(standard: StandardId, asset: &AssetRecord) -> Wanted {
    Wanted {
        place: format!("{}/{}", StoredFile::Standard(standard), asset.name),
        checksum: asset.checksum.clone(),
        what: format!("{} of standard {standard}", asset.name),
        doing: "reading a standard",
    }
}

/// What a name below one of the folders stands for; names that are not ours are nobody's to touch.
fn scan_named(name: &str) -> Option<StoredFile> {
    let (set, scan) = name.split_once('/')?;
    Some(StoredFile::Scan(ScanSetId::parse(set)?, FileId::parse(scan)?))
}

/// What a place in the bucket belongs to.
fn of_place(place: &str) -> Option<StoredFile> {
    let (folder, name) = place.split_once('/')?;
    let first = name.split('/').next().unwrap_or_default();
    match folder {
        "scan-sets" => scan_named(name),
        "models" => ModelId::parse(first).map(StoredFile::Model),
        "standards" => StandardId::parse(first).map(StoredFile::Standard),
        _ => None,
    }
}

fn missing(doing: &'static str) -> ObjectError {
    ObjectError::Io { doing, source: std::io::ErrorKind::NotFound.into() }
}

impl BucketFiles {
    fn publish(&self, doing: &'static str, staged: &StagedFile, place: &str) -> Result<(), ObjectError> {
        let file = self.0.local.staged_path(staged.id());
        self.0.put(doing, &file, place)?;
        self.0.take(&file, place);
        Ok(())
    }
}

#[async_trait]
impl ObjectStore for BucketFiles {
    async fn receive(&self) -> Result<Box<dyn StagedWriter>, ObjectError> {
        self.0.local.receive().await
    }

    fn read_staged(&self, file: &StagedFile) -> Result<Vec<u8>, ObjectError> {
        self.0.local.read_staged(file)
    }

    async fn open_staged(&self, file: &StagedFile) -> Result<Box<dyn AssetReader>, ObjectError> {
        self.0.local.open_staged(file).await
    }

    async fn held(&self, upload: UploadId) -> Result<u64, ObjectError> {
        self.0.local.held(upload).await
    }

    async fn resume(&self, upload: UploadId) -> Result<Box<dyn PieceWriter>, ObjectError> {
        self.0.local.resume(upload).await
    }

    fn stage_held(&self, upload: UploadId) -> Result<StagedFile, ObjectError> {
        self.0.local.stage_held(upload)
    }

    fn let_go(&self, upload: UploadId) -> Result<(), ObjectError> {
        self.0.local.let_go(upload)
    }

    fn held_uploads(&self) -> Result<Vec<UploadId>, ObjectError> {
        self.0.local.held_uploads()
    }

    fn stage_model(&self) -> Result<StagedModel, ObjectError> {
        self.0.local.stage_model()
    }

    fn write_asset(&self, model: &StagedModel, asset: &str, content: &[u8]) -> Result<String, ObjectError> {
        self.0.local.write_asset(model, asset, content)
    }

    fn take_asset(&self, model: &StagedModel, asset: &str, file: &StagedFile) -> Result<(), ObjectError> {
        self.0.local.take_asset(model, asset, file)
    }

    fn keep_scan(&self, staged: &StagedFile, set: ScanSetId, file: FileId) -> Result<(), ObjectError> {
        self.publish("keeping a scan", staged, &StoredFile::Scan(set, file).to_string())
    }

    fn keep_model(&self, staged: &StagedModel, model: ModelId) -> Result<(), ObjectError> {
        let doing = "keeping a model";
        let folder = self.0.local.staged_path(staged.id());
        let names = || -> std::io::Result<Vec<String>> {
            let entries = fs::read_dir(&folder)?;
            let mut names = entries
                .map(|entry| entry.map(|entry| entry.file_name().to_string_lossy().into_owned()))
                .collect::<Result<Vec<_>, _>>()?;
            names.sort();
            Ok(names)
        };
        let names = names().map_err(|source| ObjectError::Io { doing, source })?;
        let place = |name: &String| format!("{}/{name}", StoredFile::Model(model));
        names.iter().try_for_each(|name| self.0.put(doing, &folder.join(name), &place(name)))?;
        // only now: if the store was lost in the middle, all of it has to be at hand
        names.iter().for_each(|name| self.0.take(&folder.join(name), &place(name)));
        Ok(())
    }

    fn keep_standard(&self, staged: &StagedFile, standard: StandardId, asset: &str) -> Result<(), ObjectError> {
        self.publish("keeping a standard", staged, &format!("{}/{asset}", StoredFile::Standard(standard)))
    }

    fn read_scan(&self, set: ScanSetId, scan: &ScanRecord) -> Result<Vec<u8>, ObjectError> {
        self.0.content(&of_scan(set, scan))?.ok_or_else(|| missing("reading a scan"))
    }

    fn check_scan(&self, set: ScanSetId, scan: &ScanRecord) -> Result<(), ObjectError> {
        match self.0.checked(&of_scan(set, scan))? {
            true => Ok(()),
            false => Err(missing("reading a scan")),
        }
    }

    async fn open_asset(
        &self,
        model: ModelId,
        asset: &AssetRecord,
    ) -> Result<Option<Box<dyn AssetReader>>, ObjectError> {
        let (parts, wanted) = (Arc::clone(&self.0), of_asset(model, asset));
        let ended =
            |error| ObjectError::Io { doing: "reading a file of a model", source: std::io::Error::other(error) };
        let opened = tokio::task::spawn_blocking(move || parts.opened(&wanted)).await.map_err(ended)??;
        Ok(opened.map(|file| -> Box<dyn AssetReader> { Box::new(tokio::fs::File::from_std(file)) }))
    }

    fn read_asset(&self, model: ModelId, asset: &AssetRecord) -> Result<Option<Vec<u8>>, ObjectError> {
        self.0.content(&of_asset(model, asset))
    }

    fn check_asset(&self, model: ModelId, asset: &AssetRecord) -> Result<bool, ObjectError> {
        self.0.checked(&of_asset(model, asset))
    }

    fn read_standard(&self, standard: StandardId, asset: &AssetRecord) -> Result<Vec<u8>, ObjectError> {
        let wanted = of_standard(standard, asset);
        // read once a version of the program: the doctor, who reads it too, wants to know how it is where it is kept
        let _ = self.0.cache.forget(&wanted.place);
        self.0.content(&wanted)?.ok_or_else(|| missing("reading a standard"))
    }

    fn remove(&self, file: StoredFile) -> Result<(), ObjectError> {
        let place = file.to_string();
        let doing = match file {
            StoredFile::ScanSet(_) => "removing a scan set",
            StoredFile::Scan(..) => "removing a scan",
            StoredFile::Model(_) => "removing a model",
            StoredFile::Standard(_) => "removing a standard",
        };
        // first what is here: that can be done always
        self.0.cache.forget(&place).map_err(|source| ObjectError::Io { doing, source })?;
        match file {
            StoredFile::Scan(..) => self.0.bucket.remove(doing, &place),
            _ => self.0.bucket.remove_below(doing, &place),
        }
    }

    fn listing(&self) -> Result<Vec<StoredFile>, ObjectError> {
        let bucket = &self.0.bucket;
        let mut files = Vec::new();
        let models = bucket.groups(LISTING, "models")?;
        files.extend(models.iter().filter_map(|name| ModelId::parse(name)).map(StoredFile::Model));
        let standards = bucket.groups(LISTING, "standards")?;
        files.extend(standards.iter().filter_map(|name| StandardId::parse(name)).map(StoredFile::Standard));
        files.extend(bucket.names(LISTING, "scan-sets")?.iter().filter_map(|name| scan_named(name)));
        Ok(files)
    }

    fn set_aside(&self, files: &[StoredFile]) -> Result<String, ObjectError> {
        let doing = "setting files aside";
        let batch = format!("{TRASH}/{}", FileId::new());
        for file in files {
            let place = file.to_string();
            self.0.cache.forget(&place).map_err(|source| ObjectError::Io { doing, source })?;
            if let StoredFile::Scan(..) = file {
                self.0.bucket.rename(doing, &place, &format!("{batch}/{place}"))?;
                continue;
            }
            for name in self.0.bucket.names(doing, &place)? {
                self.0.bucket.rename(doing, &format!("{place}/{name}"), &format!("{batch}/{place}/{name}"))?;
            }
        }
        Ok(format!("{}/{batch}", self.0.bucket.name()))
    }

    fn sweep_staging(&self) -> Result<usize, ObjectError> {
        self.0.local.sweep_staging()
    }

    fn keep_copies_of(&self, known: &KnownFiles) -> Result<(), ObjectError> {
        let kept = self.0.cache.retain(|place| of_place(place).is_some_and(|file| known.knows(file)));
        kept.map_err(|source| ObjectError::Io { doing: "removing copies of what was deleted", source })
    }

    fn free_bytes(&self) -> Option<u64> {
        self.0.local.free_bytes()
    }

    fn empty_trash(&self, now: jiff::Timestamp) -> Result<usize, ObjectError> {
        let doing = "emptying the trash";
        let longest = jiff::SignedDuration::from_hours(24 * i64::from(TRASH_DAYS));
        let batches = self.0.bucket.groups(doing, TRASH)?;
        let is_old = |batch: &FileId| now.duration_since(batch.created_at()) > longest;
        let old: Vec<FileId> = batches.iter().filter_map(|name| FileId::parse(name)).filter(is_old).collect();
        for batch in &old {
            self.0.bucket.remove_below(doing, &format!("{TRASH}/{batch}"))?;
        }
        Ok(old.len())
    }
}
