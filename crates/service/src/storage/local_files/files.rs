//! The folder as an object store: what is staged is published by one rename, and read back against its checksum.

use std::fs;
use std::io;

use async_trait::async_trait;

use super::staged::LocalWriter;
use super::{LocalFiles, doing, free_space, gone, private, sync_folder};
use crate::storage::{AssetReader, ObjectError, ObjectStore, PieceWriter, StagedFile, StagedModel, StagedWriter};
use visage_domain::{AssetRecord, FileId, ModelId, ScanRecord, ScanSetId, StandardId, StoredFile, UploadId};

#[async_trait]
impl ObjectStore for LocalFiles {
    async fn receive(&self) -> Result<Box<dyn StagedWriter>, ObjectError> {
        let what = "storing an upload";
        self.check_space_apart(what).await?;
        let staged = StagedFile::new(self.staging.new_id(), self.staging.clone());
        let mut options = tokio::fs::OpenOptions::from(private::options());
        let file = options.write(true).create_new(true).open(self.staging.path(staged.id())).await;
        Ok(Box::new(LocalWriter::new(file.map_err(doing(what))?, staged)))
    }

    fn read_staged(&self, file: &StagedFile) -> Result<Vec<u8>, ObjectError> {
        fs::read(self.staging.path(file.id())).map_err(doing("reading an uploaded file"))
    }

    async fn open_staged(&self, file: &StagedFile) -> Result<Box<dyn AssetReader>, ObjectError> {
        let opened = tokio::fs::File::open(self.staging.path(file.id())).await;
        Ok(Box::new(opened.map_err(doing("opening what was written"))?))
    }

    async fn held(&self, upload: UploadId) -> Result<u64, ObjectError> {
        self.size_held(upload).await
    }

    async fn resume(&self, upload: UploadId) -> Result<Box<dyn PieceWriter>, ObjectError> {
        self.go_on(upload).await
    }

    fn stage_held(&self, upload: UploadId) -> Result<StagedFile, ObjectError> {
        self.stage_pieces(upload)
    }

    fn let_go(&self, upload: UploadId) -> Result<(), ObjectError> {
        self.drop_pieces(upload)
    }

    fn held_uploads(&self) -> Result<Vec<UploadId>, ObjectError> {
        self.list_pieces()
    }

    fn stage_model(&self) -> Result<StagedModel, ObjectError> {
        self.check_space("writing a model")?;
        let staged = StagedModel::new(self.staging.new_id(), self.staging.clone());
        private::create_folder(&self.staging.path(staged.id())).map_err(doing("writing a model"))?;
        Ok(staged)
    }

    fn write_asset(&self, model: &StagedModel, asset: &str, content: &[u8]) -> Result<String, ObjectError> {
        let write = || -> io::Result<()> {
            let mut file = private::create_new(&self.staging.path(model.id()).join(asset))?;
            io::Write::write_all(&mut file, content)?;
            file.sync_all()
        };
        write().map_err(doing("writing a file of a model"))?;
        Ok(blake3::hash(content).to_hex().to_string())
    }

    fn take_asset(&self, model: &StagedModel, asset: &str, file: &StagedFile) -> Result<(), ObjectError> {
        let target = self.staging.path(model.id()).join(asset);
        fs::rename(self.staging.path(file.id()), target).map_err(doing("keeping an uploaded model"))
    }

    fn keep_scan(&self, staged: &StagedFile, set: ScanSetId, file: FileId) -> Result<(), ObjectError> {
        let folder = self.scan_sets().join(set.to_string());
        let keep = || -> io::Result<()> {
            private::create_folder(&folder)?;
            fs::rename(self.staging.path(staged.id()), folder.join(file.to_string()))?;
            sync_folder(&folder)?;
            sync_folder(&self.scan_sets())
        };
        keep().map_err(doing("keeping a scan"))
    }

    fn keep_model(&self, staged: &StagedModel, model: ModelId) -> Result<(), ObjectError> {
        let folder = self.staging.path(staged.id());
        let keep = || -> io::Result<()> {
            sync_folder(&folder)?;
            fs::rename(&folder, self.models().join(model.to_string()))?;
            sync_folder(&self.models())
        };
        keep().map_err(doing("keeping a model"))
    }

    fn keep_standard(&self, staged: &StagedFile, standard: StandardId, asset: &str) -> Result<(), ObjectError> {
        let folder = self.standards().join(standard.to_string());
        let keep = || -> io::Result<()> {
            private::create_folder(&folder)?;
            fs::rename(self.staging.path(staged.id()), folder.join(asset))?;
            sync_folder(&folder)?;
            sync_folder(&self.standards())
        };
        keep().map_err(doing("keeping a standard"))
    }

    fn read_scan(&self, set: ScanSetId, scan: &ScanRecord) -> Result<Vec<u8>, ObjectError> {
        self.read_verified_scan(set, scan)
    }

    fn check_scan(&self, set: ScanSetId, scan: &ScanRecord) -> Result<(), ObjectError> {
        self.verify_scan(set, scan)
    }

    async fn open_asset(
        &self,
        model: ModelId,
        asset: &AssetRecord,
    ) -> Result<Option<Box<dyn AssetReader>>, ObjectError> {
        let opening = self.opening(model, asset);
        let opened = tokio::task::spawn_blocking(move || opening.open()).await;
        let opened = opened.map_err(|error| doing("reading a file of a model")(io::Error::other(error)))??;
        Ok(opened.map(|file| -> Box<dyn AssetReader> { Box::new(tokio::fs::File::from_std(file)) }))
    }

    fn read_asset(&self, model: ModelId, asset: &AssetRecord) -> Result<Option<Vec<u8>>, ObjectError> {
        self.read_verified(model, asset)
    }

    fn check_asset(&self, model: ModelId, asset: &AssetRecord) -> Result<bool, ObjectError> {
        Ok(self.opening(model, asset).open()?.is_some())
    }

    fn read_standard(&self, standard: StandardId, asset: &AssetRecord) -> Result<Vec<u8>, ObjectError> {
        self.read_verified_standard(standard, asset)
    }

    fn remove(&self, file: StoredFile) -> Result<(), ObjectError> {
        let (doing_so, removed) = match file {
            StoredFile::ScanSet(set) => {
                ("removing a scan set", fs::remove_dir_all(self.scan_sets().join(set.to_string())))
            }
            StoredFile::Scan(set, scan) => ("removing a scan", fs::remove_file(self.scan(set, scan))),
            StoredFile::Model(model) => ("removing a model", fs::remove_dir_all(self.models().join(model.to_string()))),
            StoredFile::Standard(id) => {
                ("removing a standard", fs::remove_dir_all(self.standards().join(id.to_string())))
            }
        };
        gone(removed).map_err(doing(doing_so))
    }

    fn listing(&self) -> Result<Vec<StoredFile>, ObjectError> {
        self.list()
    }

    fn set_aside(&self, files: &[StoredFile]) -> Result<String, ObjectError> {
        Ok(self.move_to_trash(files)?.display().to_string())
    }

    fn sweep_staging(&self) -> Result<usize, ObjectError> {
        self.staging.sweep().map_err(doing("emptying the staging folder"))
    }

    fn free_bytes(&self) -> Option<u64> {
        free_space(&self.root).ok()
    }

    fn empty_trash(&self, now: jiff::Timestamp) -> Result<usize, ObjectError> {
        self.drop_old_trash(now)
    }
}
