//! A surface ready to be sampled, all of it or around a place.

use crate::saliency::{Patches, Samples, Side};
use visage_geometry::{Bounds, Mesh, Point3};

/// A surface ready to be sampled at any spacing, with consistent unit normals.
#[derive(Debug, Clone, Copy)]
pub struct SampledSurface<'a> {
    /// What is sampled.
    pub form: Form<'a>,
    /// The box around it.
    pub bounds: Bounds,
    /// Which side the normals point to.
    pub side: Side,
}

/// What a surface is made of.
#[derive(Debug, Clone, Copy)]
pub enum Form<'a> {
    /// A mesh with faces.
    Mesh(&'a Mesh),
    /// A cloud with a patch of surface at every point.
    Cloud(&'a Patches),
}

impl SampledSurface<'_> {
    /// The points it was made of.
    pub(crate) fn points(&self) -> Box<dyn Iterator<Item = Point3> + '_> {
        match self.form {
            Form::Mesh(mesh) => Box::new(mesh.vertices.iter().copied()),
            Form::Cloud(patches) => Box::new(patches.centers()),
        }
    }

    pub(crate) fn sampled(&self, spacing: f64) -> Samples {
        match self.form {
            Form::Mesh(mesh) => Samples::from_mesh(mesh, spacing),
            Form::Cloud(patches) => patches.sampled(spacing, |_| true),
        }
    }

    /// Samples of the part within `reach` of `center`.
    pub(crate) fn sampled_around(&self, center: &Point3, reach: f64, spacing: f64) -> Samples {
        let near = |p: &Point3| (p - center).norm_squared() < reach * reach;
        match self.form {
            Form::Mesh(mesh) => Samples::from_part(mesh, spacing, near),
            Form::Cloud(patches) => patches.sampled(spacing, near),
        }
    }

    /// The area of a mesh, about that of a cloud.
    pub(crate) fn area(&self) -> f64 {
        match self.form {
            Form::Mesh(mesh) => (0..mesh.faces.len()).map(|f| 0.5 * mesh.area_normal(f).norm()).sum(),
            Form::Cloud(patches) => patches.area(),
        }
    }
}
