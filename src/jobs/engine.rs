//! The seam between the service and the algorithms.

use std::collections::BTreeMap;

use crate::faces::{self, DescribeError, Signature};
use crate::geometry::{Motion, Surface, Unit};
use crate::pipeline::{self, NamedScan, Options, Outcome, PipelineError};
use crate::progress::Progress;

/// What the service asks of the algorithms. Calls block, run inside a rayon pool, and may panic: the caller copes.
pub trait Engine: Send + Sync + 'static {
    /// Registers scans from initial poses; see [`pipeline::run`].
    fn register(
        &self,
        scans: Vec<NamedScan>,
        initial_poses: &BTreeMap<String, Motion>,
        unit: Unit,
        options: &Options,
        progress: &Progress,
    ) -> Result<Outcome, PipelineError>;

    /// Computes a signature; see [`faces::describe`].
    fn describe(&self, surface: &Surface, unit: Unit, progress: &Progress) -> Result<Signature, DescribeError>;
}

/// The real thing.
#[derive(Debug, Clone, Copy, Default)]
pub struct PipelineEngine;

impl Engine for PipelineEngine {
    fn register(
        &self,
        scans: Vec<NamedScan>,
        initial_poses: &BTreeMap<String, Motion>,
        unit: Unit,
        options: &Options,
        progress: &Progress,
    ) -> Result<Outcome, PipelineError> {
        pipeline::run(scans, initial_poses, unit, options, progress)
    }

    fn describe(&self, surface: &Surface, unit: Unit, progress: &Progress) -> Result<Signature, DescribeError> {
        faces::describe(surface, unit, progress)
    }
}
