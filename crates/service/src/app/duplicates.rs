//! Models that are there more than once: each with the earliest one that it repeats, as the surfaces themselves say.
//!
//! What may repeat an earlier model is what the gallery knows to be about as alike as copies are; one after the other is laid onto it until
//! one fits. So what is told of a model depends on those before it alone, and the list can be read page by page without anything kept.

use std::sync::Arc;

use super::context::ServiceContext;
use super::live_gallery::NotReady;
use super::model_file::{ModelFile, ModelFileError};
use super::placing::{Placed, PlacingError, known_scale, placeable};
use super::search::Elsewhere;
use visage_domain::ModelId;
use visage_gallery::Gallery;
use visage_geometry::progress::Progress;
use visage_pipeline::placing::{Placeable, place};

/// Copies are this alike by their descriptors: of 120 code-made things, each with half the triangles, three were farther, cubes and plates.
const ALIKE: f64 = 0.1;
/// The greatest deviation of two models of one surface, as a share of their size: copies of code-made things, moved and scaled, have 0.0001 at
/// most, other heads than one's own 0.002 at least.
const SAME_SURFACE: f64 = 1e-3;
/// Factors nearer to 1 than this are no other size.
const SAME_SIZE: f64 = 0.005;
/// Models that are looked up for one page, and pairs that are laid onto each other for it.
const LOOKED_UP: usize = 500;
const COMPARED: usize = 8;

/// In which way a model repeats another one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Repetition {
    /// The very file.
    SameFile,
    /// The same surface, moved or meshed otherwise perhaps.
    SameSurface,
    /// The same at another size.
    Scaled,
    /// Its mirror image.
    Mirrored,
}

/// A model and the earliest one that it repeats.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Duplicate {
    /// The model.
    pub model: ModelId,
    /// The earlier one.
    pub of: ModelId,
    /// In which way.
    pub repetition: Repetition,
    /// Where the model lies on the earlier one; `None` for the very file, which lies where it is.
    pub placed: Option<Placed>,
}

/// How far the list has been read: the model last looked up, and the earlier one that it was last compared with.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Position {
    /// Models before it are done.
    pub model: u128,
    /// It has been compared with those up to this one; 0: with none.
    pub compared: u128,
}

/// A page of the list.
#[derive(Debug, Clone)]
pub struct Page {
    /// In the order of the models' ids.
    pub duplicates: Vec<Duplicate>,
    /// How many models were looked up.
    pub searched: usize,
    /// Where it goes on; `None` at the end.
    pub next: Option<Position>,
}

/// Why there is no page.
#[derive(Debug, thiserror::Error)]
pub enum DuplicatesError {
    /// The index is still being loaded.
    #[error(transparent)]
    NotReady(#[from] NotReady),
    /// The index is not here.
    #[error(transparent)]
    Elsewhere(#[from] Elsewhere),
    /// Surfaces can't be compared.
    #[error(transparent)]
    Placing(#[from] PlacingError),
    /// A file can't be looked up.
    #[error(transparent)]
    File(#[from] ModelFileError),
    /// A task ended badly.
    #[error("comparing models: {0}")]
    Task(#[from] tokio::task::JoinError),
}

/// Up to `limit` models that repeat an earlier one, from a position on. A page may hold fewer and yet not be the last: its work is bounded.
pub async fn page(context: &ServiceContext, from: Position, limit: usize) -> Result<Page, DuplicatesError> {
    context.has_index()?;
    let (mut page, mut at, mut compared) = (Page { duplicates: Vec::new(), searched: 0, next: None }, from, 0);
    while page.duplicates.len() < limit && page.searched < LOOKED_UP {
        let Some((model, earlier)) = candidates(context, at).await? else { return Ok(page) };
        page.searched += 1;
        let mut comparing = Comparing { context, model: None, prepared: None };
        let mut found = None;
        for other in earlier {
            if compared == COMPARED {
                page.next = Some(at);
                return Ok(page);
            }
            at = Position { model, compared: other };
            found = comparing.compared(model, other, &mut compared).await?;
            if found.is_some() {
                break;
            }
        }
        page.duplicates.extend(found);
        at = Position { model: model + 1, compared: 0 };
    }
    page.next = Some(at);
    Ok(page)
}

/// The first model from a position on, and what it has to be compared with.
async fn candidates(context: &ServiceContext, at: Position) -> Result<Option<(u128, Vec<u128>)>, DuplicatesError> {
    let gallery = context.gallery.clone();
    let look = move || {
        gallery.ask(|index: &Gallery| {
            let model = index.model_after(at.model.checked_sub(1))?;
            let mut earlier = index.alike_before(model, ALIKE);
            if model == at.model {
                earlier.retain(|other| *other > at.compared || at.compared == 0);
            }
            Some((model, earlier))
        })
    };
    Ok(tokio::task::spawn_blocking(look).await??)
}

/// A model that is compared with one after the other.
struct Comparing<'a> {
    context: &'a ServiceContext,
    model: Option<ModelFile>,
    prepared: Option<Arc<Placeable>>,
}

impl Comparing<'_> {
    /// Whether the model repeats another one; adds to the number of pairs that were laid onto each other.
    async fn compared(
        &mut self,
        model: u128,
        other: u128,
        compared: &mut usize,
    ) -> Result<Option<Duplicate>, DuplicatesError> {
        let [model, of] = [model, other].map(ModelId::from_number);
        let (Some(file), Some(other)) = (self.file(model).await?, ModelFile::find_if_there(self.context, of).await?)
        else {
            return Ok(None);
        };
        if file.asset.checksum == other.asset.checksum && file.unit == other.unit {
            return Ok(Some(Duplicate { model, of, repetition: Repetition::SameFile, placed: None }));
        }
        *compared += 1;
        let Some(probe) = self.prepared(&file).await? else { return Ok(None) };
        let context = self.context.clone();
        let known = known_scale(file.unit, other.unit);
        let compare = move || -> Result<Option<Placed>, PlacingError> {
            let progress = Progress::silent();
            let Some(ground) = placeable(&context, &other, &progress)? else { return Ok(None) };
            Ok(place(&probe, &ground, known, &progress)?)
        };
        let found = tokio::task::spawn_blocking(compare).await??;
        Ok(found.and_then(|placed| {
            let repetition = repetition(&placed, known.unwrap_or(1.0))?;
            Some(Duplicate { model, of, repetition, placed: Some(placed) })
        }))
    }

    async fn file(&mut self, model: ModelId) -> Result<Option<ModelFile>, DuplicatesError> {
        if self.model.is_none() {
            self.model = ModelFile::find_if_there(self.context, model).await?;
        }
        Ok(self.model.clone())
    }

    async fn prepared(&mut self, file: &ModelFile) -> Result<Option<Arc<Placeable>>, DuplicatesError> {
        if self.prepared.is_none() {
            let (context, file) = (self.context.clone(), file.clone());
            let prepare = move || placeable(&context, &file, &Progress::silent());
            self.prepared = tokio::task::spawn_blocking(prepare).await??.map(Arc::new);
        }
        Ok(self.prepared.clone())
    }
}

/// In which way one model lies on another; `None` if it is another surface.
fn repetition(placed: &Placed, same_size: f64) -> Option<Repetition> {
    if placed.verified.deviation_of_both() > SAME_SURFACE {
        return None;
    }
    Some(match placed.pose {
        pose if pose.mirrored => Repetition::Mirrored,
        pose if (pose.scale / same_size - 1.0).abs() > SAME_SIZE => Repetition::Scaled,
        _ => Repetition::SameSurface,
    })
}
