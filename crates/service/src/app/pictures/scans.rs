//! Scans as they were uploaded, before anything runs.

use super::{PicturesError, STORED, check_memory};
use crate::app::context::ServiceContext;
use visage_domain::{ScanRecord, ScanSetId};
use visage_formats::read_surface;
use visage_geometry::progress::Progress;
use visage_picture::camera::Side;
use visage_picture::image::Image;
use visage_picture::size::Size;
use visage_report::scans::{on_sheet, picture, sheet, size_on_sheet};

/// A picture of a scan.
#[derive(Debug, Clone)]
pub struct ScanPicture {
    set: ScanSetId,
    scan: ScanRecord,
}

impl ScanPicture {
    /// Finds the scan.
    ///
    /// # Errors
    /// There is no such set or scan, or it is too large for this machine.
    pub async fn find(context: &ServiceContext, set: ScanSetId, name: &str) -> Result<ScanPicture, PicturesError> {
        let scans = context.database.scan_set(set).await?.scans;
        let missing = || PicturesError::NoScan(name.chars().take(64).collect());
        let scan = scans.into_iter().find(|scan| scan.name == name).ok_or_else(missing)?;
        check_memory(context, scan.points)?;
        Ok(ScanPicture { set, scan })
    }

    /// Stands for all that goes into it.
    pub fn tag(&self) -> &str {
        &self.scan.checksum
    }

    /// The bytes of its file.
    pub fn bytes(&self) -> u64 {
        self.scan.bytes
    }

    /// Reads and draws. Blocks; runs inside the caller's rayon pool.
    pub fn made(
        &self,
        context: &ServiceContext,
        side: Side,
        size: Size,
        progress: &Progress,
    ) -> Result<Image, PicturesError> {
        let bytes = context.objects.read_scan(self.set, &self.scan)?;
        let unreadable = |error| PicturesError::Unreadable { name: self.scan.name.clone(), error };
        let surface = read_surface(&self.scan.name, &bytes, &STORED).map_err(unreadable)?;
        drop(bytes);
        Ok(picture(&surface, side, size, progress)?)
    }
}

/// A picture of some scans of a set.
#[derive(Debug, Clone)]
pub struct SetPicture {
    scans: Vec<ScanPicture>,
}

impl SetPicture {
    /// Finds the scans.
    ///
    /// # Errors
    /// There is no such set, it has no scans, or one is too large for this machine.
    pub async fn find(context: &ServiceContext, set: ScanSetId) -> Result<SetPicture, PicturesError> {
        let all = context.database.scan_set(set).await?.scans;
        let scans: Vec<ScanPicture> =
            on_sheet(all.len()).into_iter().map(|index| ScanPicture { set, scan: all[index].clone() }).collect();
        if scans.is_empty() {
            return Err(PicturesError::NoScans);
        }
        scans.iter().try_for_each(|scan| check_memory(context, scan.scan.points))?;
        Ok(SetPicture { scans })
    }

    /// Stands for all that goes into it.
    pub fn tag(&self) -> String {
        let mut hash = blake3::Hasher::new();
        self.scans.iter().for_each(|scan| {
            hash.update(scan.scan.checksum.as_bytes());
        });
        hash.finalize().to_hex().to_string()
    }

    /// The bytes of the largest file.
    pub fn bytes(&self) -> u64 {
        self.scans.iter().map(ScanPicture::bytes).max().unwrap_or(0)
    }

    /// Reads and draws them, one after the other. Blocks; runs inside the caller's rayon pool.
    pub fn made(&self, context: &ServiceContext, size: Size, progress: &Progress) -> Result<Image, PicturesError> {
        let of_each = size_on_sheet(self.scans.len(), size);
        let pictures: Result<Vec<Image>, PicturesError> =
            self.scans.iter().map(|scan| scan.made(context, Side::Default, of_each, progress)).collect();
        Ok(sheet(&pictures?, size))
    }
}
