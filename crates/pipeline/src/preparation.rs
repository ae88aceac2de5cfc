//! Scans made ready before anything is looked for: without points that are none, with views, seen from where they were
//! seen.

use super::report::{CleaningReport, LeftOutReport};
use rayon::prelude::*;

use super::{NamedScan, Options, PipelineError};
use visage_geometry::coincidence::{Coincidence, copy_distance, without_copies};
use visage_geometry::progress::{Progress, Stage};
use visage_geometry::viewpoint::{self, Facets};
use visage_geometry::{Cloud, Point3};
use visage_registration::cleaning::LeftOut;
use visage_registration::sensor::Sensor;
use visage_registration::view::{UnusableScan, View};

/// What was found out about a scan on the way.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Prepared {
    /// Points that hints left out.
    pub regions: usize,
    /// Points of what stands still in a set whose object moved.
    pub still: usize,
    /// Points where nothing was seen.
    pub no_return: usize,
    /// Points that repeat another one.
    pub repeated: usize,
    /// What coordinates are rounded to, if that is no less than a good part of the spacing.
    pub rounded_to: Option<f64>,
    /// Whether the place of its scanner, as the file has it, is the pose of the scan.
    pub sensor_is_pose: bool,
}

/// Coordinates beyond this have squares that single precision has no numbers for.
const LARGEST_COORDINATE: f64 = 1e15;
/// Coordinates rounded to more than this share of the spacing are no surface any more.
const ROUGH: f64 = 0.25;

/// Makes scans ready; says what of them was found out.
pub(super) fn prepare(
    scans: &mut [NamedScan],
    options: &Options,
    progress: &Progress,
) -> Result<(Vec<View>, Vec<Prepared>), PipelineError> {
    progress.report(Stage::Preparing, 0.0);
    for scan in scans.iter_mut() {
        if let Some(sensor) = options.sensor {
            scan.surface.sensor = Some(sensor.into());
        }
    }
    let ready: Vec<Result<(View, Prepared), PipelineError>> = scans
        .par_iter_mut()
        .map(|scan| {
            progress.check()?;
            without_repetitions(scan)
        })
        .collect();
    // of several errors the first scan's, whichever thread met its own first
    let ready = ready.into_iter().collect::<Result<Vec<_>, _>>()?;
    let (mut views, mut prepared): (Vec<View>, Vec<Prepared>) = ready.into_iter().unzip();
    if options.sensor.is_none() {
        settle_sensors(scans, &mut views, &mut prepared);
        settle_origins(scans, &mut views);
    }
    Ok((views, prepared))
}

/// Leaves out of a scan what repeats, and measures the rest.
fn without_repetitions(scan: &mut NamedScan) -> Result<(View, Prepared), PipelineError> {
    if let Some(p) = scan.surface.cloud.points.iter().find(|p| !p.iter().all(|x| x.abs() <= LARGEST_COORDINATE)) {
        return Err(PipelineError::Unusable {
            code: "degenerate_scan",
            scan: Some(scan.name.clone()),
            message: format!("{} has a point at ({:e}, {:e}, {:e})", scan.name, p.x, p.y, p.z),
            hint: format!("leave out what lies beyond {LARGEST_COORDINATE:e}"),
        });
    }
    let found = Coincidence::of(&scan.surface);
    let mut prepared = Prepared { no_return: found.no_return, repeated: found.repeated, ..Prepared::default() };
    scan.surface = found.applied(std::mem::take(&mut scan.surface));
    let mut view = View::of(&scan.surface).map_err(|problem| unusable(scan, &prepared, problem))?;
    if let Some(distance) = copy_distance(&view.indexed) {
        let kept = without_copies(&view.indexed, distance);
        let surface = scan.surface.kept(&kept);
        // copies that are no rule leave nothing to measure
        if let Ok(thinned) = View::of(&surface) {
            prepared.repeated += kept.iter().filter(|kept| !**kept).count();
            (scan.surface, view) = (surface, thinned);
        }
    }
    let step = float_step(&scan.surface.cloud);
    prepared.rounded_to = step.filter(|step| *step > ROUGH * view.spacing);
    Ok((view, prepared))
}

fn unusable(scan: &NamedScan, prepared: &Prepared, problem: UnusableScan) -> PipelineError {
    let left_out = prepared.no_return + prepared.repeated;
    let mut message = format!("{} can't be registered: {problem}", scan.name);
    if left_out > 0 {
        message += &format!(
            " (without {} where nothing was seen and {} that repeat others)",
            prepared.no_return, prepared.repeated
        );
    }
    let rounded = float_step(&scan.surface.cloud).filter(|_| left_out > 0);
    let hint = match rounded {
        Some(step) if prepared.repeated > 0 => format!(
            "its coordinates are so large that single precision rounds them to {step}: subtract an offset before the \
             export, or leave the scan out"
        ),
        _ => "export the scan again or leave it out".into(),
    };
    PipelineError::Unusable { code: "degenerate_scan", scan: Some(scan.name.clone()), message, hint }
}

/// The step of single precision at the largest coordinates, if all of a cloud's are single-precision numbers.
fn float_step(cloud: &Cloud) -> Option<f64> {
    let is_single = |x: f64| f64::from(x as f32) == x;
    if !cloud.points.iter().all(|p| p.iter().all(|x| is_single(*x))) {
        return None;
    }
    let largest = cloud.points.iter().flat_map(|p| p.iter()).fold(0.0f64, |most, x| most.max(x.abs()));
    (largest > 0.0).then(|| largest.log2().floor().exp2() * f64::from(f32::EPSILON))
}

/// Takes the places of scanners that are poses for what they are: those scans were seen from their origins.
fn settle_sensors(scans: &mut [NamedScan], views: &mut [View], prepared: &mut [Prepared]) {
    let told: Vec<usize> = (0..scans.len()).filter(|k| scans[*k].surface.sensor.is_some()).collect();
    if told.iter().all(|k| scans[*k].surface.sensor == Some(Point3::origin())) {
        return;
    }
    let facets: Vec<Facets> = told.iter().map(|k| Facets::of(&views[*k].indexed, &views[*k].center)).collect();
    let places = told.iter().zip(&facets).filter_map(|(k, facets)| Some((facets, scans[*k].surface.sensor?)));
    if !viewpoint::are_poses(places) {
        return;
    }
    for k in told {
        prepared[k].sensor_is_pose = true;
        scans[k].surface.sensor = Some(Point3::origin());
        views[k].sensor = Some(Sensor::At(-views[k].center));
    }
}

/// If so many of the scans without a told place of the scanner were plainly taken from their origins, all were.
const MOST: f64 = 0.75;

/// Takes scans for taken from their origins where most scans of the set plainly were: one program wrote them all, and a
/// scan of much clutter does not show it by itself.
fn settle_origins(scans: &mut [NamedScan], views: &mut [View]) {
    let untold: Vec<usize> = (0..scans.len()).filter(|k| scans[*k].surface.sensor.is_none()).collect();
    let plain = untold.iter().filter(|k| views[**k].sensor.is_some()).count();
    if plain == untold.len() || (plain as f64) < MOST * untold.len() as f64 {
        return;
    }
    for k in untold {
        scans[k].surface.sensor = Some(Point3::origin());
        views[k].sensor = Some(Sensor::At(-views[k].center));
    }
}

impl Prepared {
    /// What is left out of the scan, with what `cleaning` found if it was asked for: a row of the report.
    pub(super) fn left_out(&self, cleaning: Option<&LeftOut>) -> LeftOutReport {
        LeftOutReport {
            no_return: self.no_return,
            repeated: self.repeated,
            regions: self.regions,
            still: self.still,
            cleaning: cleaning.map(|cleaning| CleaningReport { support: cleaning.support, strays: cleaning.strays }),
        }
    }

    /// Why a verdict can't be good, if coordinates are rounded.
    pub(super) fn doubt(&self, name: &str, unit: &str) -> Option<String> {
        let step = self.rounded_to?;
        let unit = if unit == "unknown" { String::new() } else { format!(" {unit}") };
        Some(format!(
            "the coordinates of {name} are so large that single precision rounds them to a grid of {step:.2}{unit}: subtract \
             an offset before the export"
        ))
    }
}
