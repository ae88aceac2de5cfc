//! Files of the index: what every place that keeps files has to offer for them.
//!
//! They are made of signatures, so none of them is missed for long: no row of the inventory is about them, no backup holds them, and what
//! is there without counting is removed.

use std::io;

use bytes::Bytes;

use super::ObjectError;
use visage_domain::SegmentId;

/// A place that keeps files of the index. All of its calls block.
pub trait SegmentStore {
    /// Writes a file: it is there when it is whole and durable, or not at all.
    fn keep_segment(
        &self,
        id: SegmentId,
        write: &mut dyn FnMut(&mut dyn io::Write) -> io::Result<()>,
    ) -> Result<(), ObjectError>;

    /// The content of a file as memory that is lent, also after the file is removed; `None` if it is not there.
    fn map_segment(&self, id: SegmentId) -> Result<Option<Bytes>, ObjectError>;

    /// Opens a file, to be read once from its beginning; `None` if it is not there.
    fn open_segment(&self, id: SegmentId) -> Result<Option<Box<dyn io::Read + Send>>, ObjectError>;

    /// Removes a file; no trouble if it is gone.
    fn remove_segment(&self, id: SegmentId) -> Result<(), ObjectError>;

    /// The files that are there.
    fn segment_listing(&self) -> Result<Vec<SegmentId>, ObjectError>;
}
