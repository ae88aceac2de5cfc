//! The report on a model as a page.

use super::models::Stored;
use super::{PicturesError, check_memory};
use crate::app::context::ServiceContext;
use visage_domain::ModelId;
use visage_geometry::progress::Progress;
use visage_report::page::{PICTURES, Shown, Subject, html, options_in_words, shown};

/// What the page of a model is made of.
#[derive(Debug, Clone)]
pub struct ModelPage {
    material: Stored,
    options: Vec<(String, String)>,
    /// Stands for all that goes into it.
    pub tag: String,
}

impl ModelPage {
    /// Finds it.
    ///
    /// # Errors
    /// There is no such model, or it is too large for this machine.
    pub async fn find(context: &ServiceContext, id: ModelId) -> Result<ModelPage, PicturesError> {
        let material = Stored::find(context, id).await?;
        let options = match material.model.job_id {
            // jobs are removed when they are old; their models stay
            Some(job) => context.database.job(job).await.map(|job| options_in_words(&job.options)).unwrap_or_default(),
            None => Vec::new(),
        };
        check_memory(context, material.model.points)?;
        let name = material.model.name.clone();
        let checksums = material.assets.iter().map(|asset| asset.checksum.as_str()).collect::<String>();
        let options_text = format!("{options:?}");
        let tag = material.tag(&[name.as_bytes(), checksums.as_bytes(), options_text.as_bytes()]);
        Ok(ModelPage { material, options, tag })
    }

    /// The bytes of the files that have to be read.
    pub fn bytes(&self) -> u64 {
        self.material.assets.iter().map(|asset| asset.bytes).sum()
    }

    /// Reads, draws and writes. Blocks; runs inside the caller's rayon pool.
    pub fn made(&self, context: &ServiceContext, progress: &Progress) -> Result<String, PicturesError> {
        let mut pictures: Vec<Shown> = Vec::new();
        let mut stored = self.material.clone();
        let mut material = stored.read(context)?;
        let mut sources: &[visage_report::Source] = &[];
        for kind in PICTURES {
            progress.check()?;
            // several pictures are made of one file, which is read once
            if !kind.is_plot() && kind.sources() != sources {
                sources = kind.sources();
                stored.want(sources);
                material = stored.read(context)?;
            }
            pictures.extend(shown(*kind, &material, progress)?);
        }
        let model = &self.material.model;
        let subject = Subject {
            name: model.name.clone(),
            id: Some(model.id.to_string()),
            points: model.points,
            unit: model.unit.name(),
            found: material.found,
            options: self.options.clone(),
        };
        html(&subject, &pictures).map_err(|error| PicturesError::Broken(error.to_string()))
    }
}
