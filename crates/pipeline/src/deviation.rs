//! How far one surface is from another: measured both ways, as figures and in colours.

use visage_formats::ply::{VertexAttributes, write_surface};
pub use visage_formats::{FormatError, read_surface};
use visage_geometry::progress::{Canceled, Progress};
use visage_geometry::{Mesh, Surface};
pub use visage_surface::deviation::DeviationReport;
use visage_surface::deviation::{Reference, colors};

/// What is to be counted.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Question {
    /// What is tolerated.
    pub limit: Option<f64>,
    /// How far a counterpart may be.
    pub reach: Option<f64>,
}

/// What was measured.
#[derive(Debug, Clone, PartialEq)]
pub struct Deviation {
    /// Whether distances have a sign.
    pub has_sides: bool,
    /// From the model to the reference.
    pub forth: DeviationReport,
    /// From the reference to the model.
    pub back: DeviationReport,
    /// The distance of each point of the model, positive outside; NaN out of reach.
    pub distances: Vec<f64>,
}

impl Deviation {
    /// Measures the points of either to the other; `None` if one has no points. Runs inside the caller's rayon pool.
    ///
    /// # Errors
    /// [`Canceled`], while it is at work.
    pub fn measured(
        model: &Surface,
        reference: &Surface,
        question: Question,
        progress: &Progress,
    ) -> Result<Option<Deviation>, Canceled> {
        let reach = question.reach.unwrap_or(f64::INFINITY);
        let Some((to, from)) = Reference::new(reference).zip(Reference::new(model)) else { return Ok(None) };
        let distances = to.distances(&model.cloud.points, reach, progress)?;
        let back = from.distances(&reference.cloud.points, reach, progress)?;
        let report = |distances: &[f64]| DeviationReport::of(distances, question.limit);
        Ok(Some(Deviation { has_sides: to.has_sides(), forth: report(&distances), back: report(&back), distances }))
    }

    /// The model as PLY in the colours of its distances, full at the limit or at what 95 % don't exceed, with the property
    /// `deviation`.
    pub fn coloured(&self, model: Surface, limit: Option<f64>) -> Vec<u8> {
        let colors = colors(&self.distances, limit.unwrap_or(self.forth.absolute.p95));
        let values: Vec<f32> = self.distances.iter().map(|distance| *distance as f32).collect();
        let attributes =
            VertexAttributes { colors: Some(&colors), deviation: Some(&values), ..VertexAttributes::default() };
        write_surface(&Mesh { vertices: model.cloud.points, faces: model.faces }, &attributes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_geometry::{Cloud, Point3};

    #[test]
    fn what_a_model_lacks_is_told_by_the_way_back() {
        let points =
            |side: u32| (0..side * 20).map(|k| Point3::new(f64::from(k % 20), f64::from(k / 20), 0.0)).collect();
        let surface = |side| Surface { cloud: Cloud::from_points(points(side)), ..Surface::default() };
        let question = Question { limit: Some(5.0), reach: None };
        let measure = |a: &Surface, b: &Surface| Deviation::measured(a, b, question, &Progress::silent());
        let found = measure(&surface(10), &surface(20)).expect("not canceled").expect("points");
        assert_eq!((found.forth.absolute.max, found.has_sides), (0.0, false));
        assert!((found.back.absolute.max - 10.0).abs() < 1e-5 && found.back.beyond_limit == Some(0.25), "{found:?}");
        assert_eq!(measure(&surface(10), &Surface::default()), Ok(None));
    }
}
