//! Where a registration begins, what of it stays, and which engine runs it.

use std::collections::BTreeMap;

use super::{Method, NamedScan, Options, PipelineError, Scale, bad_option, sensor_of};
use visage_geometry::progress::{Canceled, Progress, Stage};
use visage_geometry::{Motion, PoseConvention, se3};
use visage_registration::global::placement::place;
use visage_registration::global::report::PlacementReport;
use visage_registration::global::scan_set::{Registered, Set};
use visage_registration::hinted::Hinted;
use visage_registration::hints::Hints;
use visage_registration::joint;
use visage_registration::outcome::{MethodOptions, Outcome};
use visage_registration::quality::Surfaces;
use visage_registration::sensor::Sensor;
use visage_registration::sensor::turning::Turning;
use visage_registration::view::View;

/// A pose as a 4x4 row-major matrix `[s R, t]`; the scale s is 1 unless scales were sought.
pub type PoseMatrix = [[f64; 4]; 4];

/// What is known of the scans' poses beforehand.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Start {
    /// Initial `pose_world` by scan name.
    pub poses: BTreeMap<String, Motion>,
    /// Initial scales by scan name; 1, and to be searched for, where none is given.
    pub scales: BTreeMap<String, f64>,
    /// Poses that stay, by scan name: those of the finished model that the other scans are added to. Empty if a model
    /// is made anew.
    pub base: BTreeMap<String, PoseMatrix>,
    /// What a person said of the scans.
    pub hints: Hints,
    /// How else the poses may be meant: the surfaces tell. Nothing if they are certainly scan to world.
    pub other_conventions: &'static [PoseConvention],
    /// Whether the files of the scans tell the poses: then they are in the units of these, and are converted with the scans.
    pub of_scan_files: bool,
}

impl From<&BTreeMap<String, Motion>> for Start {
    fn from(poses: &BTreeMap<String, Motion>) -> Self {
        Start { poses: poses.clone(), ..Start::default() }
    }
}

impl Start {
    /// Checks what the options and the base model ask of scans with these names.
    ///
    /// # Errors
    /// [`PipelineError::Unusable`] with the code `bad_option`, `unknown_reference`, `wrong_base`, `nothing_to_add`,
    /// `scaled_pose` or `invalid_hints`.
    pub fn check(&self, names: &[&str], options: &Options) -> Result<(), PipelineError> {
        self.hints.check(names)?;
        if !self.base.is_empty() {
            let in_base = names.iter().filter(|name| self.base.contains_key(**name)).count();
            check_base(in_base, names.len(), options)?;
        }
        if options.method != Method::Joint && (options.scale != Scale::None || !self.base.is_empty()) {
            let remedy = "joint: the other methods neither find scales nor add to a model";
            return Err(bad_option("method", remedy));
        }
        if let Some(reference) = options.reference.as_deref().filter(|reference| !names.contains(reference)) {
            return Err(PipelineError::Unusable {
                code: "unknown_reference",
                scan: Some(reference.to_owned()),
                message: format!("the reference {reference:?} is none of the scans"),
                hint: "give the name of one of the scans, or leave the option out to take the first".into(),
            });
        }
        let is_posed = |name: &&str| self.poses.contains_key(*name) || self.base.contains_key(*name);
        if options.scale == Scale::PerView && !names.iter().all(is_posed) {
            return Err(poses_for_scales());
        }
        match self.scales.iter().find(|(_, scale)| options.scale == Scale::None && **scale != 1.0) {
            None => Ok(()),
            Some((name, scale)) => Err(PipelineError::Unusable {
                code: "scaled_pose",
                scan: Some(name.clone()),
                message: format!("the initial pose of {name} holds a scale of {scale:.6}"),
                hint: "choose the option scale: per_view, or give rigid poses".into(),
            }),
        }
    }
}

/// Whether scans can be added to a base model that has `in_base` of these `count` scans.
fn check_base(in_base: usize, count: usize, options: &Options) -> Result<(), PipelineError> {
    let (code, message, hint) = if options.reference.is_some() {
        let message = "a reference is given together with a base model";
        ("bad_option", message, "leave the reference out: the world is that of the base model")
    } else if in_base == 0 {
        let message = "none of the scans belongs to the base model";
        ("wrong_base", message, "give the scans of the base model too, under their names there")
    } else if in_base == count {
        let message = "every scan has its pose in the base model already: there is nothing to add";
        ("nothing_to_add", message, "add a scan, or register without a base model to begin anew")
    } else {
        return Ok(());
    };
    Err(PipelineError::Unusable { code, scan: None, message: message.into(), hint: hint.into() })
}

/// A start held against the scans and the options.
#[derive(Clone)]
pub(super) struct Setting {
    /// `pose_world` by scan name, of the base model where it has one.
    pub poses: BTreeMap<String, Motion>,
    scales: BTreeMap<String, f64>,
    base: BTreeMap<String, PoseMatrix>,
    /// What a person said of the scans.
    pub hints: Hints,
    /// Whether all scans were cut, so that it says nothing that nothing is there.
    is_cut: bool,
    /// How what moved stood, if the scans were cut to it.
    turning: Option<Turning>,
    other_conventions: &'static [PoseConvention],
    /// Scans that have their pose from a copy: the scan, the copy, and the motion that maps the copy's frame into that
    /// of the scan, in the scale of the copy.
    adopted: Vec<(String, String, Motion)>,
}

impl Setting {
    /// The same of scans of which parts were cut away.
    pub fn cut(&self, turning: Option<Turning>) -> Setting {
        Setting { is_cut: true, turning, ..self.clone() }
    }

    /// Checks the start, and brings the reference to the front: view 0 fixes the world.
    pub fn new(start: &Start, scans: &mut [NamedScan], options: &Options) -> Result<Self, PipelineError> {
        let names: Vec<&str> = scans.iter().map(|scan| scan.name.as_str()).collect();
        start.check(&names, options)?;
        let place = options.reference.as_ref().and_then(|reference| names.iter().position(|name| name == reference));
        if let Some(place) = place {
            scans[..=place].rotate_right(1);
        }
        let Start { poses, scales, base, hints, other_conventions, of_scan_files: _ } = start.clone();
        let adopted = Vec::new();
        let mut setting =
            Setting { poses, scales, base, hints, is_cut: false, turning: None, other_conventions, adopted };
        for (name, matrix) in &start.base {
            let (pose, scale) = se3::from_scaled_rows(matrix).map_err(|error| PipelineError::Unusable {
                code: "wrong_base",
                scan: Some(name.clone()),
                message: format!("the base model's pose of {name} can't be used: {error}"),
                hint: "take the poses of the base model as they were written".into(),
            })?;
            setting.poses.insert(name.clone(), pose);
            setting.scales.insert(name.clone(), scale);
        }
        Ok(setting)
    }

    /// Whether all poses may still be refined together: not where scales were sought, nor poses are fixed.
    pub fn may_be_refined(&self, options: &Options) -> bool {
        options.method == Method::Joint
            && options.scale == Scale::None
            && self.base.is_empty()
            && self.scales.is_empty()
    }

    /// Whether a scan keeps the pose it has in the base model; `None` if there is no base model.
    pub fn is_fixed(&self, name: &str) -> Option<bool> {
        (!self.base.is_empty()).then(|| self.base.contains_key(name))
    }

    /// What was said of the views.
    pub fn hinted(&self, names: &[String], views: &[View]) -> Hinted {
        let mut hinted = Hinted::of(&self.hints, names, views);
        if self.is_cut {
            hinted.cut = (0..views.len()).collect();
        }
        hinted
    }

    /// Lets hints and the pose of a copy serve its original, the pose if that has none; `motion_of_copy` maps the copy's
    /// frame into that of the original.
    pub fn adopt_pose(&mut self, original: &str, copy: &str, motion_of_copy: &Motion) {
        self.hints.adopt(original, copy, motion_of_copy);
        let Some(pose) = self.poses.get(copy).copied().filter(|_| !self.poses.contains_key(original)) else { return };
        let scale = self.scales.get(copy).copied();
        let mut motion = *motion_of_copy;
        motion.translation.vector *= scale.unwrap_or(1.0);
        self.poses.insert(original.to_owned(), pose * motion.inverse());
        self.scales.extend(scale.map(|scale| (original.to_owned(), scale)));
        self.adopted.push((original.to_owned(), copy.to_owned(), motion));
    }

    /// How else the poses may be meant. Poses with scales are written by visage, or by who knows it.
    pub fn other_conventions(&self) -> &'static [PoseConvention] {
        if self.scales.values().any(|scale| *scale != 1.0) { &[] } else { self.other_conventions }
    }

    /// The pose of a scan, and whether its meaning is certain, since it is that of the base model.
    pub fn pose(&self, name: &str) -> Option<(Motion, bool)> {
        Some((*self.poses.get(name)?, self.base.contains_key(name)))
    }

    /// Takes the poses for what a convention says.
    pub fn read_as(&mut self, convention: PoseConvention) {
        let given = self.poses.iter_mut().filter(|(name, _)| !self.base.contains_key(*name));
        given.for_each(|(_, pose)| *pose = convention.world_from_scan(pose));
        for (scan, copy, motion) in &self.adopted {
            if let Some(pose) = self.poses.get(copy).copied() {
                self.poses.insert(scan.clone(), pose * motion.inverse());
            }
        }
    }

    /// The matrix of a scan's pose: of a fixed one as the base model has it, to the last bit.
    pub fn matrix(&self, name: &str, pose_world: &Motion, scale: f64) -> PoseMatrix {
        self.base.get(name).copied().unwrap_or_else(|| se3::to_scaled_rows(pose_world, scale))
    }

    /// Registers the views of the scans; answers with the views as scaled and what is known of their sensors.
    pub fn register(
        &self,
        scans: &[NamedScan],
        views: Vec<View>,
        names: &[String],
        options: &Options,
        progress: &Progress,
    ) -> Result<(Vec<View>, Sensors, Registered), PipelineError> {
        let scale = |name: &String| self.scales.get(name).copied().unwrap_or(1.0);
        let views: Vec<View> = views.into_iter().zip(names).map(|(view, name)| view.scaled(scale(name))).collect();
        let sensors = |views: &[View]| -> Sensors {
            scans.iter().zip(views).map(|(scan, view)| sensor_of(scan, view, options)).collect()
        };
        let task = Task { setting: self, names, options, progress };
        if options.scale == Scale::PerView {
            let (views, registered) = task.scaled(views)?;
            let found = sensors(&views);
            return Ok((views, found, registered));
        }
        let found = sensors(&views);
        let registered =
            if self.base.is_empty() { task.anew(&views, &found)? } else { task.onto_base(&views, &found)? };
        Ok((views, found, registered))
    }
}

/// For each view where its scanner stood, if that is known.
pub(super) type Sensors = Vec<Option<Sensor>>;

/// One registration.
struct Task<'a> {
    setting: &'a Setting,
    names: &'a [String],
    options: &'a Options,
    progress: &'a Progress,
}

impl Task<'_> {
    fn method_options(&self) -> MethodOptions {
        MethodOptions {
            min_overlap: self.options.min_overlap,
            range_accuracy: self.options.range_accuracy,
            max_rounds: self.options.max_rounds,
        }
    }

    fn refine(&self, views: &[View], initial: &[Motion]) -> Result<Outcome, Canceled> {
        self.options.method.register(views, initial, &self.method_options(), self.progress)
    }

    /// Known poses, local frame to world.
    fn given(&self, views: &[View]) -> Vec<Option<Motion>> {
        let pose = |name: &String, view: &View| Some(view.local_pose(self.setting.poses.get(name)?));
        self.names.iter().zip(views).map(|(name, view)| pose(name, view)).collect()
    }

    /// The views whose poses stay: those of the base model, else the first.
    fn fixed(&self) -> Vec<usize> {
        match self.setting.base.is_empty() {
            true => vec![0],
            false => (0..self.names.len()).filter(|view| self.setting.base.contains_key(&self.names[*view])).collect(),
        }
    }

    fn anew(&self, views: &[View], sensors: &[Option<Sensor>]) -> Result<Registered, PipelineError> {
        let hinted = self.setting.hinted(self.names, views);
        let set = Set {
            names: self.names,
            views,
            given: &self.given(views),
            sensors,
            hinted: &hinted,
            turning: self.setting.turning.as_ref(),
        };
        Ok(set.register(&|views, initial| self.refine(views, initial), self.progress)?)
    }

    fn scaled(&self, views: Vec<View>) -> Result<(Vec<View>, Registered), PipelineError> {
        let poses: Option<Vec<Motion>> = self.names.iter().map(|name| self.setting.poses.get(name).copied()).collect();
        // checked with the start: every scan has one
        let poses = poses.ok_or_else(poses_for_scales)?;
        let is_known: Vec<bool> = self.names.iter().map(|name| self.setting.scales.contains_key(name)).collect();
        let (fixed, options) = (self.fixed(), self.method_options());
        let (views, result) = joint::joint_scaled(views, &poses, &is_known, &fixed, &options, self.progress)?;
        let registered = self.judged(&views, PlacementReport::of_given(&result), result);
        Ok((views, registered))
    }

    /// Adds to the base model. Where poses are missing, all scans are placed by their surface to begin with.
    fn onto_base(&self, views: &[View], sensors: &[Option<Sensor>]) -> Result<Registered, PipelineError> {
        let given = self.given(views);
        let mut placement = None;
        if given.contains(&None) {
            let refine = |views: &[View], initial: &[Motion]| self.refine(views, initial);
            let hinted = self.setting.hinted(self.names, views);
            let set = Set {
                names: self.names,
                views,
                given: &given,
                sensors,
                hinted: &hinted,
                turning: self.setting.turning.as_ref(),
            };
            placement = Some(place(&set, &refine, self.progress)?);
        }
        let mut initial = Vec::with_capacity(views.len());
        for (view, pose) in given.iter().enumerate() {
            let found = placement.as_ref().filter(|placement| placement.result.placed[view]);
            let pose = pose.or(found.map(|placement| placement.result.local_poses[view]));
            initial.push(pose.ok_or_else(|| fits_nowhere(&self.names[view]))?);
        }
        let result = joint::joint_onto(views, &initial, &self.fixed(), &self.method_options(), self.progress)?;
        let report = placement.as_ref().map_or_else(|| PlacementReport::of_given(&result), PlacementReport::of);
        Ok(self.judged(views, report, result))
    }

    fn judged(&self, views: &[View], placement: PlacementReport, result: Outcome) -> Registered {
        self.progress.report(Stage::Judging, 0.0);
        let surfaces = Surfaces::measure(views, &result);
        Registered { result, surfaces, placement }
    }
}

fn poses_for_scales() -> PipelineError {
    PipelineError::Unusable {
        code: "bad_option",
        scan: None,
        message: "scale: per_view needs an initial pose of every scan".into(),
        hint: "give the poses, or bring the scans into one unit first".into(),
    }
}

fn fits_nowhere(name: &str) -> PipelineError {
    PipelineError::Unusable {
        code: "not_placed",
        scan: Some(name.to_owned()),
        message: format!("{name} has no initial pose, and its surface fits nowhere on the base model"),
        hint: "give its pose, or add a scan that overlaps the model more".into(),
    }
}
