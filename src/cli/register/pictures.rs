//! What people see of a registration: `report.html` beside the report, and `pictures/` if they are asked for.

use std::path::Path;

use anyhow::Context;

use super::write;
use crate::domain::options::Options;
use crate::geometry::{Cloud, Surface, Unit};
use crate::pipeline::RegisteredModel;
use crate::pipeline::surface::SurfaceMesh;
use crate::progress::Progress;
use crate::report::found::Found;
use crate::report::page::{PICTURES, Subject, html, options_in_words, shown};
use crate::report::{Kind, Material, PictureError, Source, Wish, draw};

/// The page, and the folder of the pictures.
pub(super) const PAGE: &str = "report.html";
pub(super) const FOLDER: &str = "pictures";

/// What pictures are made of: files of the model as they are in memory.
pub(super) struct Gallery {
    with_mesh: Option<Material>,
    with_cloud: Option<Material>,
    plain: Material,
}

impl Gallery {
    /// Of what came out, and of the report as it was written. Takes cloud and mesh, which nobody needs any more.
    pub fn new(outcome: &mut RegisteredModel, report: &[u8], unit: Unit) -> anyhow::Result<Gallery> {
        let found = Some(Found::read(report).context("reading the report again")?);
        let plain = Material { signature: outcome.signature.clone(), found, unit, ..Material::default() };
        let with_mesh = outcome.mesh.take().map(|made| {
            let SurfaceMesh { mesh, colors, support } = made.surface;
            let cloud = Cloud { colors, ..Cloud::from_points(mesh.vertices) };
            let surface = Surface { cloud, faces: mesh.faces, ..Surface::default() };
            Material { surface, support, ..plain.clone() }
        });
        let with_cloud = outcome.cloud.take().map(|merged| {
            let surface = Surface { cloud: merged.cloud, ..Surface::default() };
            Material { surface, views: Some(merged.views), ..plain.clone() }
        });
        Ok(Gallery { with_mesh, with_cloud, plain })
    }

    /// What a kind of picture is made of.
    fn material(&self, kind: Kind) -> &Material {
        let of = |source: &Source| match source {
            Source::Preview => None,
            Source::Mesh => self.with_mesh.as_ref(),
            Source::Cloud => self.with_cloud.as_ref(),
        };
        kind.sources().iter().find_map(of).unwrap_or(&self.plain)
    }

    /// Writes the page.
    pub fn write_page(&self, name: String, options: &Options, out: &Path, progress: &Progress) -> anyhow::Result<()> {
        let mut pictures = Vec::new();
        for kind in PICTURES {
            pictures.extend(shown(*kind, self.material(*kind), progress)?);
        }
        let of_cloud = self.with_cloud.as_ref().map(|material| material.surface.cloud.len() as u64);
        let of_views = self.plain.found.iter().flat_map(|found| &found.result.views).map(|view| view.points).sum();
        let subject = Subject {
            name,
            id: None,
            points: of_cloud.unwrap_or(of_views),
            unit: self.plain.unit.name(),
            found: self.plain.found.clone(),
            options: options_in_words(options),
        };
        write(&out.join(PAGE), html(&subject, &pictures)?.as_bytes())
    }

    /// Writes all pictures that there are; the names of those that there are none of.
    pub fn write_pictures(&self, out: &Path, progress: &Progress) -> anyhow::Result<Vec<&'static str>> {
        let folder = out.join(FOLDER);
        std::fs::create_dir_all(&folder).with_context(|| format!("making {}", folder.display()))?;
        let mut without = Vec::new();
        for kind in Kind::ALL {
            match draw(*kind, self.material(*kind), &Wish::of(*kind), progress) {
                Ok(made) => write(&folder.join(format!("{kind}.png")), &made.to_png()?)?,
                Err(PictureError::Lacking { .. } | PictureError::Surface(_)) => without.push(kind.name()),
                Err(PictureError::Canceled(canceled)) => return Err(canceled.into()),
            }
        }
        Ok(without)
    }
}
