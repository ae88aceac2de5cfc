//! Where a probe lies on models that are stored.

use super::context::ServiceContext;
use super::model_file::{ModelFile, ModelFileError};
use visage_domain::ModelId;
use visage_geometry::progress::{Canceled, Progress};
use visage_geometry::{Surface, Unit};
use visage_pipeline::placing::{Placeable, Scan, place, place_scan};
pub use visage_pipeline::placing::{Placed, Pose, Sighted};
use visage_shape::faces::DescribeError;

/// From this probability on a probe is rather the same object than not.
const SURE: f64 = 0.5;

/// A probe that is to be laid onto models.
#[derive(Debug, Clone)]
pub enum Probe {
    /// A stored model.
    Stored(ModelId),
    /// A surface that is not stored, and its unit.
    Surface(Box<Surface>, Unit),
}

/// What a probe shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shows {
    /// All of a thing.
    Whole,
    /// What one scan sees of it.
    SingleScan,
}

/// A probe and models, by their files.
#[derive(Debug, Clone)]
pub struct Placing {
    probe: ProbeFile,
    shows: Shows,
    /// `None` for a model that has gone, or has no surface any more.
    models: Vec<Option<ModelFile>>,
}

#[derive(Debug, Clone)]
enum ProbeFile {
    Stored(ModelFile),
    Surface(Box<Surface>, Unit),
}

/// Why nothing was laid anywhere.
#[derive(Debug, thiserror::Error)]
pub enum PlacingError {
    /// A file can't be read.
    #[error(transparent)]
    File(#[from] ModelFileError),
    /// The probe can't be laid onto anything.
    #[error("the probe can't be laid onto models: {0}")]
    Probe(DescribeError),
    /// Nobody waits any more.
    #[error(transparent)]
    Canceled(#[from] Canceled),
}

impl Placing {
    /// Finds the files.
    pub async fn find(
        context: &ServiceContext,
        probe: Probe,
        shows: Shows,
        models: impl IntoIterator<Item = ModelId>,
    ) -> Result<Placing, ModelFileError> {
        let probe = match probe {
            Probe::Stored(id) => ProbeFile::Stored(ModelFile::find(context, id).await?),
            Probe::Surface(surface, unit) => ProbeFile::Surface(surface, unit),
        };
        let mut found = Vec::new();
        for id in models {
            found.push(ModelFile::find_if_there(context, id).await?);
        }
        Ok(Placing { probe, shows, models: found })
    }

    /// The bytes of the largest files that are in memory together.
    pub fn bytes(&self) -> u64 {
        let probe = match &self.probe {
            ProbeFile::Stored(file) => file.asset.bytes,
            ProbeFile::Surface(..) => 0,
        };
        probe + self.models.iter().flatten().map(|file| file.asset.bytes).max().unwrap_or(0)
    }

    /// Lays the probe onto each of the models, one after the other; `None` for one that is gone or has no area. Blocks; runs inside the
    /// caller's rayon pool.
    pub fn run(self, context: &ServiceContext, progress: &Progress) -> Result<Vec<Option<Placed>>, PlacingError> {
        let (surface, unit) = match self.probe {
            ProbeFile::Stored(file) => (Box::new(file.read(context)?), file.unit),
            ProbeFile::Surface(surface, unit) => (surface, unit),
        };
        let probe = match ReadyProbe::new(&surface, self.shows, progress) {
            Ok(probe) => probe,
            Err(DescribeError::Canceled(canceled)) => return Err(canceled.into()),
            Err(error) => return Err(PlacingError::Probe(error)),
        };
        drop(surface);
        let on = |file: ModelFile| -> Result<Option<Placed>, PlacingError> {
            let Some(probe) = &probe else { return Ok(None) };
            let Some(model) = placeable(context, &file, progress)? else { return Ok(None) };
            Ok(probe.placed(&model, known_scale(unit, file.unit), progress)?)
        };
        self.models.into_iter().map(|file| file.map_or(Ok(None), &on)).collect()
    }
}

/// A probe ready to be laid onto models.
enum ReadyProbe {
    Whole(Placeable),
    SingleScan(Scan),
}

impl ReadyProbe {
    fn new(surface: &Surface, shows: Shows, progress: &Progress) -> Result<Option<ReadyProbe>, DescribeError> {
        Ok(match shows {
            Shows::Whole => Placeable::new(surface, progress)?.map(ReadyProbe::Whole),
            Shows::SingleScan => Scan::new(surface, progress)?.map(ReadyProbe::SingleScan),
        })
    }

    fn placed(
        &self,
        model: &Placeable,
        known_scale: Option<f64>,
        progress: &Progress,
    ) -> Result<Option<Placed>, Canceled> {
        match self {
            ReadyProbe::Whole(probe) => place(probe, model, known_scale, progress),
            ReadyProbe::SingleScan(scan) => place_scan(scan, model, known_scale, progress),
        }
    }
}

/// The order of a ranking once a probe was laid onto the first of it, by the probabilities that it is the same object: what rather is than not
/// comes first, the surest before all; the others stay in their order.
pub fn surest_first(same_object: &[Option<f64>]) -> Vec<usize> {
    let sure = |index: &usize| same_object[*index].filter(|same| *same >= SURE);
    let mut order: Vec<usize> = (0..same_object.len()).collect();
    // the sort is stable
    order.sort_by(|a, b| sure(b).unwrap_or(0.0).total_cmp(&sure(a).unwrap_or(0.0)));
    order
}

/// A stored model made ready; `None` if it can't be laid onto anything, or is gone.
pub(super) fn placeable(
    context: &ServiceContext,
    file: &ModelFile,
    progress: &Progress,
) -> Result<Option<Placeable>, PlacingError> {
    let surface = match file.read(context) {
        Ok(surface) => surface,
        Err(ModelFileError::NoSurface(_)) => return Ok(None),
        Err(error) => return Err(error.into()),
    };
    match Placeable::new(&surface, progress) {
        Ok(model) => Ok(model),
        Err(DescribeError::Canceled(canceled)) => Err(canceled.into()),
        Err(DescribeError::Degenerate(_)) => Ok(None),
    }
}

/// Lengths on the model in one of the probe, if both units are known.
pub(super) fn known_scale(probe: Unit, model: Unit) -> Option<f64> {
    Some(probe.in_mm()? / model.in_mm()?)
}

#[cfg(test)]
mod tests {
    use super::surest_first;

    #[test]
    fn what_a_scan_surely_lies_on_comes_first_and_the_rest_stays_in_its_order() {
        let same_object = [Some(0.3), None, Some(0.7), Some(0.49), Some(0.99), Some(0.7)];
        assert_eq!(surest_first(&same_object), [4, 2, 5, 0, 1, 3]);
        assert_eq!(surest_first(&[Some(0.1), Some(0.4)]), [0, 1]);
        assert!(surest_first(&[]).is_empty());
    }
}
