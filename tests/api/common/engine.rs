//! Algorithms that do what a test tells them.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Condvar, Mutex, OnceLock};
use std::time::{Duration, Instant};

use tokio::sync::watch;
use visage::app::engine::{Engine, PipelineEngine};
use visage::faces::{DescribeError, Signature};
use visage::geometry::{Cloud, Mesh, Motion, Point3, Surface, Unit, se3};
use visage::pipeline::report::ModelReport;
use visage::pipeline::{MadeSurface, ModelCloud, NamedScan, Options, PipelineError, RegisteredModel, Start};
use visage::progress::{Progress, Stage};
use visage::standards::{Found, Standard};
use visage::surface::SurfaceMesh;

/// What the next registration does.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Mode {
    /// Hands the initial poses back.
    #[default]
    Quick,
    /// The same after a while, and stops when asked to.
    Slow(Duration),
    /// The same after a while, and does not listen.
    Deaf(Duration),
    /// The same when it is released, without a sign of life before, and does not listen.
    Stuck,
    /// Panics.
    Panic,
    /// Refuses the second scan.
    Refuse,
    /// Hands the initial poses back, and a signature of a ball.
    Described,
    /// Hands the initial poses back, and a mesh of one triangle.
    Meshed,
}

/// Deterministic, and no registration at all. Signatures are real.
#[derive(Debug, Default)]
pub struct FakeEngine {
    mode: Mutex<Mode>,
    is_released: Mutex<bool>,
    release: Condvar,
    /// Registrations that were begun.
    runs: watch::Sender<usize>,
    /// Models that were looked at for classes.
    pub looks: AtomicUsize,
    /// Models whose description was begun.
    pub described: AtomicUsize,
    /// Descriptions that were stopped because nobody wants them any more.
    pub given_up: AtomicUsize,
    ball: OnceLock<Signature>,
}

impl FakeEngine {
    pub fn set(&self, mode: Mode) {
        *self.mode.lock().expect("never poisoned") = mode;
    }

    /// Registrations that were begun.
    pub fn runs(&self) -> usize {
        *self.runs.borrow()
    }

    /// Waits until so many were begun.
    pub async fn until_runs(&self, count: usize) {
        let mut runs = self.runs.subscribe();
        let waiting = runs.wait_for(|runs| *runs >= count);
        tokio::time::timeout(Duration::from_secs(60), waiting).await.expect("in time").expect("the engine is there");
    }

    /// Lets those that are stuck go on.
    pub fn release(&self) {
        *self.is_released.lock().expect("never poisoned") = true;
        self.release.notify_all();
    }

    fn signature_of_a_ball(&self) -> Signature {
        let describe = || {
            let limits = visage::config::Limits::default().read_limits();
            let ball = visage::formats::read_surface("ball.obj", &super::files::bumpy_sphere(0.0), &limits);
            PipelineEngine.describe(&ball.expect("a mesh"), Unit::Mm, &Progress::silent()).expect("a signature")
        };
        self.ball.get_or_init(describe).clone()
    }
}

impl Engine for FakeEngine {
    fn register(
        &self,
        scans: Vec<NamedScan>,
        start: &Start,
        _unit: Unit,
        _options: &Options,
        progress: &Progress,
    ) -> Result<RegisteredModel, PipelineError> {
        let mode = *self.mode.lock().expect("never poisoned");
        self.runs.send_modify(|runs| *runs += 1);
        match mode {
            Mode::Quick | Mode::Described | Mode::Meshed => progress.report(Stage::Registering, 1.0),
            Mode::Slow(time) => wait(time, progress, true)?,
            Mode::Deaf(time) => wait(time, progress, false)?,
            Mode::Stuck => {
                let stuck = self.is_released.lock().expect("never poisoned");
                drop(self.release.wait_while(stuck, |is_released| !*is_released).expect("never poisoned"));
            }
            Mode::Panic => panic!("told to"),
            Mode::Refuse => {
                return Err(PipelineError::Unusable {
                    code: "degenerate_scan",
                    scan: Some(scans[1].name.clone()),
                    message: "all points are the same".to_owned(),
                    hint: "leave it out".to_owned(),
                });
            }
        }
        let mut poses = start.poses.clone();
        for (name, matrix) in &start.base {
            poses.insert(name.clone(), se3::from_rows(matrix).expect("rigid"));
        }
        let signature = if mode == Mode::Described { Some(self.signature_of_a_ball()) } else { None };
        let mesh = (mode == Mode::Meshed).then(triangle);
        Ok(RegisteredModel { signature, mesh, ..outcome(&scans, &poses) })
    }

    fn describe(&self, surface: &Surface, unit: Unit, progress: &Progress) -> Result<Signature, DescribeError> {
        self.described.fetch_add(1, Ordering::Relaxed);
        let mode = *self.mode.lock().expect("never poisoned");
        if let Mode::Slow(time) = mode {
            let begin = Instant::now();
            while begin.elapsed() < time {
                progress.check().inspect_err(|_| {
                    self.given_up.fetch_add(1, Ordering::Relaxed);
                })?;
                std::thread::sleep(Duration::from_millis(5));
            }
        }
        PipelineEngine.describe(surface, unit, progress)
    }

    fn find(
        &self,
        standards: &[&Standard],
        surface: &Surface,
        unit: Unit,
        progress: &Progress,
    ) -> Result<Vec<Option<Found>>, DescribeError> {
        self.looks.fetch_add(1, Ordering::Relaxed);
        let mode = *self.mode.lock().expect("never poisoned");
        if let Mode::Slow(time) = mode {
            let begin = Instant::now();
            while begin.elapsed() < time {
                progress.check()?;
                std::thread::sleep(Duration::from_millis(5));
            }
        }
        PipelineEngine.find(standards, surface, unit, progress)
    }
}

fn wait(time: Duration, progress: &Progress, listens: bool) -> Result<(), PipelineError> {
    let begin = Instant::now();
    while begin.elapsed() < time {
        if listens {
            progress.check()?;
        }
        progress.report(Stage::Registering, begin.elapsed().as_secs_f64() / time.as_secs_f64());
        std::thread::sleep(Duration::from_millis(5));
    }
    Ok(())
}

/// A surface of one triangle, of which one corner was seen by nobody.
fn triangle() -> MadeSurface {
    let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let surface = SurfaceMesh {
        mesh: Mesh { vertices: corners.map(Point3::from).to_vec(), faces: vec![[0, 1, 2]] },
        support: Some(vec![3.0, 2.0, 0.0]),
        colors: None,
    };
    MadeSurface { surface, ..MadeSurface::default() }
}

fn outcome(scans: &[NamedScan], poses: &BTreeMap<String, Motion>) -> RegisteredModel {
    let pose = |scan: &NamedScan| poses.get(&scan.name).copied().unwrap_or_default();
    let mut merged = ModelCloud { cloud: Cloud::default(), views: Vec::new() };
    for (index, scan) in scans.iter().enumerate() {
        let moved = scan.surface.cloud.moved(&pose(scan));
        merged.views.extend(std::iter::repeat_n(index as u16, moved.len()));
        merged.cloud.points.extend(moved.points);
    }
    let names: Vec<&str> = scans.iter().map(|scan| scan.name.as_str()).collect();
    RegisteredModel {
        matrices: scans.iter().map(|scan| (scan.name.clone(), Some(se3::to_rows(&pose(scan))))).collect(),
        poses: scans.iter().map(|scan| (scan.name.clone(), Some(pose(scan)))).collect(),
        report: ModelReport::example(&names),
        cloud: Some(merged),
        mesh: None,
        signature: None,
    }
}
