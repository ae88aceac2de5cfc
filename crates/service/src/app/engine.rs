//! The seam between the service and the algorithms.

use visage_geometry::progress::Progress;
use visage_geometry::{Surface, Unit};
use visage_pipeline::{NamedScan, Options, PipelineError, RegisteredModel, Start};
use visage_shape::faces::{self, DescribeError, Signature};
use visage_shape::standards::{Annotation, Found, Standard, StandardError};

/// What the service asks of the algorithms. Calls block, run inside a rayon pool, and may panic: the caller copes.
pub trait Engine: Send + Sync + 'static {
    /// Registers scans from where they start; see [`visage_pipeline::run_from`].
    fn register(
        &self,
        scans: Vec<NamedScan>,
        start: &Start,
        unit: Unit,
        options: &Options,
        progress: &Progress,
    ) -> Result<RegisteredModel, PipelineError>;

    /// Computes a signature; see [`faces::describe`].
    fn describe(&self, surface: &Surface, unit: Unit, progress: &Progress) -> Result<Signature, DescribeError>;

    /// Makes a standard of an annotated surface; see [`Standard::annotated`].
    fn annotate(
        &self,
        surface: &Surface,
        unit: Unit,
        annotation: &Annotation,
        progress: &Progress,
    ) -> Result<Standard, StandardError> {
        Standard::annotated(surface, unit, annotation, progress)
    }

    /// Looks for standards on a surface; see [`Standard::find_each`].
    fn find(
        &self,
        standards: &[&Standard],
        surface: &Surface,
        unit: Unit,
        progress: &Progress,
    ) -> Result<Vec<Option<Found>>, DescribeError> {
        Standard::find_each(standards, surface, unit, progress)
    }
}

/// The real thing.
#[derive(Debug, Clone, Copy, Default)]
pub struct PipelineEngine;

impl Engine for PipelineEngine {
    fn register(
        &self,
        scans: Vec<NamedScan>,
        start: &Start,
        unit: Unit,
        options: &Options,
        progress: &Progress,
    ) -> Result<RegisteredModel, PipelineError> {
        visage_pipeline::run_from(scans, start, unit, options, progress)
    }

    fn describe(&self, surface: &Surface, unit: Unit, progress: &Progress) -> Result<Signature, DescribeError> {
        faces::describe(surface, unit, progress)
    }
}
