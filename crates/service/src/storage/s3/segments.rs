//! Files of the index stay in the data folder, beside the database whose signatures they are made of: they are mapped, and what is
//! lost of them is made anew.

use std::io;

use bytes::Bytes;

use super::BucketFiles;
use crate::storage::{ObjectError, SegmentStore};
use visage_domain::SegmentId;

impl SegmentStore for BucketFiles {
    fn keep_segment(
        &self,
        id: SegmentId,
        write: &mut dyn FnMut(&mut dyn io::Write) -> io::Result<()>,
    ) -> Result<(), ObjectError> {
        self.0.local.keep_segment(id, write)
    }

    fn map_segment(&self, id: SegmentId) -> Result<Option<Bytes>, ObjectError> {
        self.0.local.map_segment(id)
    }

    fn open_segment(&self, id: SegmentId) -> Result<Option<Box<dyn io::Read + Send>>, ObjectError> {
        self.0.local.open_segment(id)
    }

    fn remove_segment(&self, id: SegmentId) -> Result<(), ObjectError> {
        self.0.local.remove_segment(id)
    }

    fn segment_listing(&self) -> Result<Vec<SegmentId>, ObjectError> {
        self.0.local.segment_listing()
    }
}
