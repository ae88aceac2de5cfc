//! Files of the index, each written once and used as memory from then on.

use std::fs::{self, File};
use std::io::{self, BufWriter, Read, Write};
use std::path::PathBuf;

use bytes::Bytes;

use super::{LocalFiles, doing, gone, listing, private, sync_folder};
use crate::storage::{ObjectError, SegmentStore, StagedFile};
use visage_domain::SegmentId;

/// Bytes that are written at once.
const CHUNK: usize = 1 << 20;

impl LocalFiles {
    fn segment(&self, id: SegmentId) -> PathBuf {
        self.segment_folder().join(id.to_string())
    }

    fn opened_segment(&self, id: SegmentId) -> Result<Option<File>, ObjectError> {
        match File::open(self.segment(id)) {
            Ok(file) => Ok(Some(file)),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
            Err(error) => Err(doing("opening a file of the index")(error)),
        }
    }
}

impl SegmentStore for LocalFiles {
    fn keep_segment(
        &self,
        id: SegmentId,
        write: &mut dyn FnMut(&mut dyn Write) -> io::Result<()>,
    ) -> Result<(), ObjectError> {
        self.check_space("writing a file of the index")?;
        let staged = StagedFile::new(self.staging.new_id(), self.staging.clone());
        let path = self.staging.path(staged.id());
        let mut keep = || -> io::Result<()> {
            let mut file = BufWriter::with_capacity(CHUNK, private::create_new(&path)?);
            write(&mut file)?;
            file.into_inner().map_err(io::IntoInnerError::into_error)?.sync_all()?;
            fs::rename(&path, self.segment(id))?;
            sync_folder(&self.segment_folder())
        };
        keep().map_err(doing("writing a file of the index"))
    }

    fn map_segment(&self, id: SegmentId) -> Result<Option<Bytes>, ObjectError> {
        // nobody writes to it: it has its name since it was whole, in a folder that only this user may enter
        let mapped = self.opened_segment(id)?.map(|file| visage_mapping::map(&file));
        mapped.transpose().map_err(doing("mapping a file of the index"))
    }

    fn open_segment(&self, id: SegmentId) -> Result<Option<Box<dyn Read + Send>>, ObjectError> {
        Ok(self.opened_segment(id)?.map(|file| -> Box<dyn Read + Send> { Box::new(file) }))
    }

    fn remove_segment(&self, id: SegmentId) -> Result<(), ObjectError> {
        gone(fs::remove_file(self.segment(id))).map_err(doing("removing a file of the index"))
    }

    fn segment_listing(&self) -> Result<Vec<SegmentId>, ObjectError> {
        listing::ids(&self.segment_folder(), SegmentId::parse).map_err(doing("reading the files of the index"))
    }
}
