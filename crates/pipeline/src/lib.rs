//! Scans to model to signature, stage by stage: the whole path, free of files, clocks and HTTP. [`run_from`] is the order of stages.
//!
//! - before registration: `preparation` (scans as the registration wants them), `copies` of one scan, `cleaning`, `static_background` (scans that
//!   were all taken from one place), `start` (what is known of poses), [`units`] (of the set, and who
//!   seems to be in another), `convention` (how they are meant), `hints`
//! - after it: `supports` (what was cleaned away votes), [`surface`] (mesh, coarser mesh, preview), `deface`, [`report`]

mod cleaning;
mod convention;
mod copies;
pub mod deface;
pub mod deviation;
mod hints;
pub mod orient;
pub mod placing;
mod preparation;
pub mod report;
mod start;
mod static_background;
mod supports;
pub mod surface;
mod surface_report;
pub mod units;

use std::collections::BTreeMap;

use visage_domain::options::{Declared, OptionError};
pub use visage_domain::options::{Fill, Method, Options, Scale};
use visage_geometry::progress::{Canceled, Progress, Stage};
use visage_geometry::{Motion, Surface, Unit, Vector3};
use visage_registration::conclusion::{Circumstances, Conclusion};
use visage_registration::global::scan_set::Registered;
pub use visage_registration::hints::Hints;
use visage_registration::outcome::Outcome;
use visage_registration::quality::Finding;
use visage_registration::quality::colour::Brightness;
use visage_registration::report::{Finished, RegistrationReport};
use visage_registration::sensor::Sensor;
use visage_registration::view::View;
use visage_shape::faces::{self, DescribeError, Signature};
pub use visage_surface::merge::ModelCloud;
use visage_surface::merge::PosedView;
pub use visage_surface::reconstruct::SurfaceReport;

use self::report::{ModelReport, ScanReport};
use self::start::Setting;
pub use self::start::{PoseMatrix, Start};
use self::static_background::{Settled, Taken};
pub use self::surface::MadeSurface;
use self::surface::Merged;

/// One scan with the name by which poses and reports speak of it.
#[derive(Debug, Clone)]
pub struct NamedScan {
    /// The file name.
    pub name: String,
    /// Its points, in the sensor's frame.
    pub surface: Surface,
}

/// What a run leaves behind.
#[derive(Debug)]
pub struct RegisteredModel {
    /// Scan name and `pose_world`, in view order; `None` = unplaced.
    pub poses: Vec<(String, Option<Motion>)>,
    /// The same as matrices, which hold the scales too: what is written.
    pub matrices: Vec<(String, Option<PoseMatrix>)>,
    /// The `result` part of the report.
    pub report: ModelReport,
    /// The merged cloud, if it was asked for.
    pub cloud: Option<ModelCloud>,
    /// The surface of that cloud, if it was asked for and there is one.
    pub mesh: Option<MadeSurface>,
    /// The signature, if it was asked for.
    pub signature: Option<Signature>,
}

/// Why a run ended without a model. Messages name the scan and the remedy.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PipelineError {
    /// The caller asked for a stop.
    #[error(transparent)]
    Canceled(#[from] Canceled),
    /// The input can't be registered.
    #[error("{message}")]
    Unusable {
        /// A stable machine-readable code, such as `too_few_scans`, `degenerate_scan`.
        code: &'static str,
        /// The scan concerned, if it is one.
        scan: Option<String>,
        /// What is wrong.
        message: String,
        /// What to do about it.
        hint: String,
    },
}

/// The least scans of a set.
pub const MIN_SCANS: usize = 2;

/// Registers the scans and describes the model; see [`run_from`].
///
/// `initial_poses` maps scan names to `pose_world`.
pub fn run(
    scans: Vec<NamedScan>,
    initial_poses: &BTreeMap<String, Motion>,
    unit: Unit,
    options: &Options,
    progress: &Progress,
) -> Result<RegisteredModel, PipelineError> {
    run_from(scans, &initial_poses.into(), unit, options, progress)
}

/// Registers the scans from where they start and describes the model. Runs inside the caller's rayon pool.
///
/// Scans without a pose are placed by their surface. `unit` is that of the scans.
pub fn run_from(
    mut scans: Vec<NamedScan>,
    start: &Start,
    unit: Unit,
    options: &Options,
    progress: &Progress,
) -> Result<RegisteredModel, PipelineError> {
    let mut setting = Setting::new(start, &mut scans, options)?;
    check_input(&scans, options)?;
    let left_by_regions = hints::apply(&mut scans, &setting.hints)?;
    let (mut views, mut prepared) = preparation::prepare(&mut scans, options, progress)?;
    prepared.iter_mut().zip(left_by_regions).for_each(|(prepared, count)| prepared.regions = count);
    let copied = copies::take_out(&mut scans, &mut views, &mut prepared, &mut setting, progress)?;
    let names: Vec<String> = scans.iter().map(|scan| scan.name.clone()).collect();
    let holders = visage_registration::cleaning::copies::holders(&views, progress)?;
    let whole = (!options.keep_all).then(|| views.clone());
    let left_out =
        (!options.keep_all).then(|| cleaning::clean_scans(&mut scans, &mut views, options, progress)).transpose()?;
    for (scan, view) in scans.iter().zip(&mut views) {
        view.sensor = sensor_of(scan, view, options);
    }
    let convention = convention::settle(&mut setting, &views, &names, progress)?;
    let (views, sensors, registered) = setting.register(&scans, views, &names, options, progress)?;
    let has_support = left_out.iter().flatten().any(|left_out| left_out.support > 0);
    let whole = whole.filter(|_| has_support && setting.may_be_refined(options));
    let taken = Taken { scans, views, sensors, registered };
    let settled = static_background::settle(&setting, &names, taken, whole, options, progress)?;
    let Settled { taken: Taken { scans, views, sensors, mut registered }, held, still, moved } = settled;
    prepared.iter_mut().zip(still).for_each(|(prepared, count)| prepared.still = count);
    let brightness = brightness_of(&scans);
    if held.is_none() && moved.is_none() && setting.may_be_refined(options) {
        registered.follow_colours(&views, &brightness, progress)?;
    }
    let mut findings: Vec<Finding> = prepared
        .iter()
        .zip(&names)
        .filter_map(|(prepared, name)| prepared.doubt(name, unit.name()))
        .map(Finding::doubt)
        .collect();
    findings.extend(units::suspects(&views, &names, &registered.result.placed, unit));
    findings.extend(holders.into_iter().map(|(all, part)| merged_cloud(&names[all], &names[part])));
    let said = setting.hinted(&names, &views);
    let relative = |i: usize, j: usize| registered.placement.relative(&registered.result, &views, i, j);
    let said = hints::report(&said, relative, &names, &mut findings);
    let positions: Vec<Option<Vector3>> = sensors.iter().map(|sensor| sensor.and_then(|s| s.position())).collect();
    let Conclusion { covariances, verdict } = registered.conclude(
        &views,
        &names,
        &Circumstances {
            positions: &positions,
            brightness: &brightness,
            held: held.as_ref().map(|held| (held.whole.as_slice(), &held.result)),
            moved: moved.as_deref(),
            findings: &findings,
        },
    );
    let Registered { result, placement, .. } = registered;
    let finished =
        Finished { names: &names, views: &views, result: &result, placement: &placement, poses: &covariances };
    let registration = RegistrationReport::new(options.method, unit.name(), &finished, verdict);

    let spacing = surface::spacing(&views, &result.placed);
    let merged = merge_views(&scans, &views, &sensors, &result, spacing, options, progress)?;
    let poses: Vec<(String, Option<Motion>)> = names
        .iter()
        .zip(views.iter().zip(result.local_poses.iter().zip(&result.placed)))
        .map(|(name, (view, (pose, placed)))| (name.clone(), placed.then(|| view.scan_pose(pose))))
        .collect();
    let matrices = poses
        .iter()
        .zip(&views)
        .map(|((name, pose), view)| (name.clone(), pose.map(|pose| setting.matrix(name, &pose, view.scale))))
        .collect();
    let has_scales = options.scale != Scale::None;
    let registration = registration.with_rows(|(index, view)| ScanReport {
        normals_outward: merged.as_ref().map(|merged| merged.outward[index]),
        left_out: prepared[index].left_out(left_out.as_ref().map(|left_out| &left_out[index])),
        copy_of: None,
        viewpoint_is_pose: prepared[index].sensor_is_pose,
        scale: Some(views[index].scale).filter(|scale| has_scales || *scale != 1.0),
        fixed: setting.is_fixed(&names[index]),
        reading: None,
        view,
    });
    // what comes takes much memory, and needs the cloud alone
    drop((scans, views, result));
    let described = Described::of(merged, &names, spacing, unit, options, progress)?;
    let report = ModelReport {
        registration,
        surface: described.mesh.as_ref().map(|mesh| mesh.report.clone()),
        face_cut: described.face_cut,
        hints: said,
        pose_convention: convention,
        pose_notes: Vec::new(),
        unit_notes: Vec::new(),
    };
    let Described { cloud, mesh, signature, .. } = described;
    let mut outcome = RegisteredModel { poses, matrices, report, cloud, mesh, signature };
    copies::put_back(&copied, &setting, &mut outcome);
    Ok(outcome)
}

/// What is made of the merged cloud.
#[derive(Default)]
struct Described {
    cloud: Option<ModelCloud>,
    mesh: Option<MadeSurface>,
    signature: Option<Signature>,
    face_cut: Option<bool>,
}

impl Described {
    /// Makes mesh and signature of the cloud, and cuts the face out, as far as is wanted; `spacing` is that of a single scan.
    fn of(
        merged: Option<Merged>,
        names: &[String],
        spacing: f64,
        unit: Unit,
        options: &Options,
        progress: &Progress,
    ) -> Result<Described, PipelineError> {
        let Some(merged) = merged else { return Ok(Described::default()) };
        let mut mesh = match options.cloud && options.mesh {
            true => surface::surface(&merged, names, spacing, options, progress)?,
            false => None,
        };
        let mut cloud = merged.model;
        let signature = match options.signature || options.deface {
            true => describe(&cloud, unit, progress)?,
            false => None,
        };
        let face_cut = options.deface.then(|| deface::deface(signature.as_ref(), &mut cloud, mesh.as_mut()));
        let signature = signature.filter(|_| options.signature);
        Ok(Described { cloud: options.cloud.then_some(cloud), mesh, signature, face_cut })
    }
}

/// A scan that holds the points of another one.
fn merged_cloud(all: &str, part: &str) -> Finding {
    Finding::doubt(format!(
        "{all} holds the points of {part}: a merged cloud is no scan of its own, leave one of them out"
    ))
}

fn check_input(scans: &[NamedScan], options: &Options) -> Result<(), PipelineError> {
    if scans.len() < MIN_SCANS {
        return Err(PipelineError::Unusable {
            code: "too_few_scans",
            scan: None,
            message: format!("{} scan(s) given, at least {MIN_SCANS} are needed", scans.len()),
            hint: "add the other scans of the object".into(),
        });
    }
    if scans.len() > usize::from(u16::MAX) {
        return Err(PipelineError::Unusable {
            code: "too_many_scans",
            scan: None,
            message: format!("{} scans given, at most {} are possible", scans.len(), u16::MAX),
            hint: "split the set".into(),
        });
    }
    if let Some(exact) = options.method.exact_scans().filter(|exact| *exact != scans.len()) {
        return Err(PipelineError::Unusable {
            code: "wrong_scan_count",
            scan: None,
            message: format!("{} scans given, method {} takes exactly {exact}", scans.len(), options.method),
            hint: "choose two scans, or a method for several such as joint".into(),
        });
    }
    Ok(options.check()?)
}

impl From<OptionError> for PipelineError {
    fn from(error: OptionError) -> Self {
        let hint = match &error {
            OptionError::OutOfRange { minimum, maximum, .. } => format!("give a value from {minimum} to {maximum}"),
            OptionError::Malformed(_) => "give options that are known, with values of their types".to_owned(),
        };
        PipelineError::Unusable { code: "bad_option", scan: None, message: error.to_string(), hint }
    }
}

fn bad_option(name: &str, remedy: &str) -> PipelineError {
    PipelineError::Unusable {
        code: "bad_option",
        scan: None,
        message: format!("option {name} is out of range"),
        hint: format!("give {remedy}"),
    }
}

/// The merged cloud; `None` if nobody needs it. `spacing` is that of a single scan.
fn merge_views(
    scans: &[NamedScan],
    views: &[View],
    sensors: &[Option<Sensor>],
    result: &Outcome,
    spacing: f64,
    options: &Options,
    progress: &Progress,
) -> Result<Option<Merged>, PipelineError> {
    if !(options.cloud || options.signature || options.deface) {
        return Ok(None);
    }
    let posed: Vec<PosedView> = scans
        .iter()
        .zip(views)
        .enumerate()
        .map(|(index, (scan, view))| PosedView {
            view,
            scan: &scan.surface.cloud,
            local_pose: result.local_poses[index],
            placed: result.placed[index],
            sensor: sensors[index],
        })
        .collect();
    Ok(Some(Merged::of(&posed, spacing, options, progress)?))
}

/// Where the scanner stood, in the view's local frame: from the options, else from the file, else read off the scan.
fn sensor_of(scan: &NamedScan, view: &View, options: &Options) -> Option<Sensor> {
    let told = options.sensor.map(Vector3::from).or(scan.surface.sensor.map(|p| p.coords));
    told.map(|position| Sensor::At(position * view.scale - view.center)).or(view.sensor)
}

/// How bright the points of each scan are, where it has colours.
fn brightness_of(scans: &[NamedScan]) -> Vec<Option<Brightness>> {
    let brightness =
        |[red, green, blue]: &[u8; 3]| 0.3 * f32::from(*red) + 0.59 * f32::from(*green) + 0.11 * f32::from(*blue);
    let of_scan = |scan: &NamedScan| Some(scan.surface.cloud.colors.as_ref()?.iter().map(brightness).collect());
    scans.iter().map(of_scan).collect()
}

/// The signature, or `None` if the surface is too poor to have one.
fn describe(model: &ModelCloud, unit: Unit, progress: &Progress) -> Result<Option<Signature>, PipelineError> {
    progress.report(Stage::Describing, 0.0);
    let surface = Surface { cloud: model.cloud.clone(), ..Surface::default() };
    match faces::describe(&surface, unit, progress) {
        Ok(signature) => Ok(Some(signature)),
        Err(DescribeError::Canceled(canceled)) => Err(canceled.into()),
        Err(DescribeError::Degenerate(_)) => Ok(None),
    }
}
