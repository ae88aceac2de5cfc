//! The scans of a model where they belong.

use std::collections::BTreeMap;
use std::io::{self, Write};
use std::sync::Arc;

use tokio::runtime::Handle;
use tokio::sync::Semaphore;

use super::poses::{PosesSource, parse};
use super::{Desk, RenditionError, STORED, ScansAs, content, model_of, stage};
use crate::app::context::ServiceContext;
use crate::storage::{ObjectError, ObjectStore, StagedFile, StagedWriter};
use visage_domain::{ModelId, ScanRecord, ScanSetId};
use visage_formats::archive::ZipWriter;
use visage_formats::e57::{self, WrittenScan, write_scans};
use visage_formats::written::{placed, scaled};
use visage_formats::{Format, packed, read_surface};
use visage_geometry::{Motion, Surface, Unit};

/// The scans that a model was made of, those that have a place.
#[derive(Debug)]
pub struct PlacedScans {
    set: ScanSetId,
    scans: Vec<Placed>,
    unit: Unit,
    /// Stands for all that goes into the files.
    pub tag: String,
}

/// A scan and where it belongs.
#[derive(Debug, Clone)]
struct Placed {
    scan: ScanRecord,
    motion: Motion,
    scale: f64,
}

impl PlacedScans {
    /// Finds them.
    ///
    /// # Errors
    /// [`RenditionError::Changed`] if one is gone, or was replaced since the model was made.
    pub async fn find(context: &ServiceContext, id: ModelId) -> Result<Self, RenditionError> {
        let (model, _) = model_of(context, id).await?;
        let source = PosesSource::find(context, id).await?;
        let hint = "only models that were registered from scans have some";
        let missing = RenditionError::Missing { model: id, what: "scans", hint };
        let set = model.scan_set_id.ok_or(missing)?;
        let asset = source.asset.clone();
        let bytes = Desk::new(context, &Arc::new(Semaphore::new(1)))
            .work(0, move |objects| content(objects, id, &asset))
            .await?;
        let file = parse(&bytes, &source.asset.name)?;
        let stored = context.database.scan_set(set).await?;
        let by_name: BTreeMap<&str, &ScanRecord> = stored.scans.iter().map(|scan| (scan.name.as_str(), scan)).collect();
        let mut hash = blake3::Hasher::new();
        hash.update(source.asset.checksum.as_bytes());
        let mut scans = Vec::new();
        for (name, motion) in &file.poses {
            // ids tell when a file came
            let is_older = |scan: &&&ScanRecord| scan.file_id.created_at() <= id.created_at();
            let scan = by_name.get(name.as_str()).filter(is_older);
            let scan = scan.ok_or_else(|| RenditionError::Changed { scan: name.clone() })?;
            hash.update(scan.checksum.as_bytes());
            let scale = file.scales.get(name).copied().unwrap_or(1.0);
            scans.push(Placed { scan: (*scan).clone(), motion: *motion, scale });
        }
        Ok(PlacedScans { set, scans, unit: model.unit, tag: hash.finalize().to_hex().to_string() })
    }

    /// Writes them; each scan of an archive is in memory by itself, an E57 file as a whole.
    pub async fn write(
        &self,
        context: &ServiceContext,
        permits: &Arc<Semaphore>,
        wanted: ScansAs,
    ) -> Result<StagedFile, RenditionError> {
        let (set, scans, unit) = (self.set, self.scans.clone(), self.unit);
        let points = scans.iter().map(|placed| placed.scan.points);
        let points = if wanted == ScansAs::E57 { points.sum() } else { points.max().unwrap_or(0) };
        let desk = Desk::new(context, permits);
        match wanted {
            ScansAs::E57 => {
                let work = move |objects: &dyn ObjectStore| stage(objects, &one_file(objects, set, &scans, unit)?);
                desk.work(points, work).await
            }
            ScansAs::Zip(format) => {
                let writer = context.objects.receive().await?;
                let work = move |objects: &dyn ObjectStore| pack(objects, writer, set, &scans, unit, format);
                desk.work(points, work).await
            }
        }
    }
}

/// The scan as it was sent.
fn read(objects: &dyn ObjectStore, set: ScanSetId, scan: &ScanRecord) -> Result<Surface, RenditionError> {
    let bytes = objects.read_scan(set, scan).map_err(|error| match error {
        ObjectError::Damaged { .. } => RenditionError::Changed { scan: scan.name.clone() },
        error => error.into(),
    })?;
    read_surface(&scan.name, &bytes, &STORED)
        .map_err(|error| RenditionError::Unreadable { name: scan.name.clone(), error })
}

fn one_file(
    objects: &dyn ObjectStore,
    set: ScanSetId,
    scans: &[Placed],
    unit: Unit,
) -> Result<Vec<u8>, RenditionError> {
    let factor = e57::FORMAT.factor_from(unit);
    let mut read_scans: Vec<(&str, Surface, Motion)> = Vec::with_capacity(scans.len());
    for Placed { scan, motion, scale } in scans {
        let mut motion = *motion;
        motion.translation.vector *= factor;
        read_scans.push((&scan.name, scaled(read(objects, set, scan)?, scale * factor), motion));
    }
    let written = read_scans.iter().map(|(name, surface, motion)| WrittenScan {
        name,
        cloud: &surface.cloud,
        grid: surface.grid.as_ref(),
        world_from_scan: Some(motion),
    });
    Ok(write_scans(&written.collect::<Vec<_>>()))
}

fn pack(
    objects: &dyn ObjectStore,
    writer: Box<dyn StagedWriter>,
    set: ScanSetId,
    scans: &[Placed],
    unit: Unit,
    format: &Format,
) -> Result<StagedFile, RenditionError> {
    let Some(write) = format.writers.cloud else {
        return Err(RenditionError::Unfit { format: format.name, why: "clouds are not written in it".to_owned() });
    };
    let factor = format.factor_from(unit);
    let mut zip = ZipWriter::new(Staged(writer));
    for Placed { scan, motion, scale } in scans {
        let surface = scaled(placed(read(objects, set, scan)?, *scale, motion), factor);
        zip.add(&name_in(&scan.name, format), &write(&surface.cloud))?;
    }
    let Staged(writer) = zip.finish()?;
    Ok(Handle::current().block_on(writer.finish())?)
}

/// The name of a placed scan: that of the scan, with the ending of what is written behind it unless it ends so.
fn name_in(scan: &str, format: &Format) -> String {
    let plain = packed::inner_name(scan).unwrap_or(scan);
    let ending = format!(".{}", format.ending());
    if plain.to_ascii_lowercase().ends_with(&ending) { plain.to_owned() } else { format!("{plain}{ending}") }
}

/// A staged file as what a program writes to. Blocks.
struct Staged(Box<dyn StagedWriter>);

impl Write for Staged {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        Handle::current().block_on(self.0.write(bytes)).map_err(io::Error::other)?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn placed_scans_are_named_as_the_scans() {
        let ply = &visage_formats::ply::FORMAT;
        assert_eq!(name_in("x/a.PLY", ply), "x/a.PLY");
        assert_eq!(name_in("a.ply.gz", ply), "a.ply");
        assert_eq!(name_in("a.obj", ply), "a.obj.ply");
    }
}
