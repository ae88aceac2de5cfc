//! Which scan sets may become a job: refusing at the door is kinder than failing later.

use std::collections::{BTreeMap, BTreeSet};

use super::memory::{Budget, TooLarge};
use visage_domain::asset::Asset;
use visage_domain::{NewJob, PoseFile, ScanRecord};
use visage_formats::{FormatError, poses};
use visage_geometry::{Motion, PoseConvention};
use visage_pipeline::{Hints, MIN_SCANS, Method, Options, PipelineError, Start};

/// Why a scan set can't be registered.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum AdmissionError {
    /// One scan or none.
    #[error("the scan set holds {count} scan(s); registration needs at least {MIN_SCANS}")]
    TooFewScans {
        /// How many there are.
        count: usize,
    },
    /// A method for a fixed number of scans was given another.
    #[error("the scan set holds {count} scans; method {method} takes exactly {exact}")]
    WrongScanCount {
        /// How many there are.
        count: usize,
        /// The method.
        method: Method,
        /// How many it takes.
        exact: usize,
    },
    /// The pose file can't be read.
    #[error(transparent)]
    Unreadable(#[from] FormatError),
    /// The pose file names none of the scans, so all of it would be ignored.
    #[error("the pose file {file:?} names none of the scans: it names {named:?}, the scans are {scan:?} and others")]
    FitsNothing {
        /// The pose file.
        file: String,
        /// A name in it.
        named: String,
        /// A scan.
        scan: String,
    },
    /// The options or the base model don't fit the scans.
    #[error(transparent)]
    Unfit(#[from] PipelineError),
    /// It takes more memory than jobs may have.
    #[error(transparent)]
    TooLarge(#[from] TooLarge),
}

/// How a pose file and the scans of a set fit together.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseFit {
    /// The poses of the scans that are there, in the order of the file: the order of the views.
    pub poses: Vec<(String, Motion)>,
    /// Names in the pose file for which there is no scan (yet).
    pub unknown_scans: Vec<String>,
    /// Scans that the pose file does not name.
    pub scans_without_pose: Vec<String>,
    /// Scales that the poses hold.
    pub scales: BTreeMap<String, f64>,
    /// How else the poses may be meant.
    pub other_conventions: &'static [PoseConvention],
    /// Whether the files of the scans tell the poses.
    pub of_scan_files: bool,
    /// What was done to make the file fit, in words.
    pub notes: Vec<String>,
}

/// What of a scan set is registered, and from where.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// The scans in the order of the views.
    pub names: Vec<String>,
    /// Where they start.
    pub start: Start,
    /// What was done to make the pose file fit, in words.
    pub notes: Vec<String>,
}

/// Reads a pose file and holds it against the scans; names need not be the same to the letter where there is no doubt.
pub fn fit_poses(scans: &[&str], file: &PoseFile) -> Result<PoseFit, FormatError> {
    let read = poses::read_scaled(&file.name, &file.content)?.named_as(scans)?;
    let notes = read.notes();
    let names: BTreeSet<&str> = scans.iter().copied().collect();
    let (poses, unknown): (Vec<_>, Vec<_>) =
        read.poses.into_iter().partition(|(name, _)| names.contains(name.as_str()));
    let posed: BTreeSet<&str> = poses.iter().map(|(name, _)| name.as_str()).collect();
    let without = scans.iter().filter(|name| !posed.contains(**name)).map(|name| (*name).to_owned()).collect();
    Ok(PoseFit {
        unknown_scans: unknown.into_iter().map(|(name, _)| name).collect(),
        scans_without_pose: without,
        scales: read.scales,
        other_conventions: read.other_conventions,
        of_scan_files: read.of_scan_files,
        notes,
        poses,
    })
}

/// Refuses a pose file that has poses, but for none of the scans. `scans` are all of the set: what is added to a model may
/// come without poses.
pub fn check_fit(scans: &[&str], file: &PoseFile, fit: &PoseFit) -> Result<(), AdmissionError> {
    match (fit.unknown_scans.first(), scans.first()) {
        (Some(named), Some(scan)) if fit.poses.is_empty() => {
            Err(AdmissionError::FitsNothing { file: file.name.clone(), named: named.clone(), scan: (*scan).to_owned() })
        }
        _ => Ok(()),
    }
}

/// Whether a method takes so many scans.
fn admit_count(count: usize, method: Method) -> Result<(), AdmissionError> {
    match method.exact_scans() {
        Some(exact) if exact != count => Err(AdmissionError::WrongScanCount { count, method, exact }),
        _ => Ok(()),
    }
}

/// Whether a registration of these scans may be queued: it can be planned, and fits into memory when nothing else runs.
pub fn admit_job(
    scans: &[ScanRecord],
    poses: Option<&PoseFile>,
    job: &NewJob,
    budget: Budget,
) -> Result<(), AdmissionError> {
    let names: Vec<&str> = scans.iter().map(|scan| scan.name.as_str()).collect();
    plan(&names, poses, job.base.as_ref().map(|base| base.poses.as_slice()), &job.options, &job.hints)?;
    budget.admit(scans.iter().map(|scan| scan.points).sum())?;
    Ok(())
}

/// Whether scans of these names with this pose file can be registered. Scans without a pose are placed by their surface.
fn admit(scans: &[&str], file: Option<&PoseFile>) -> Result<PoseFit, AdmissionError> {
    if scans.len() < MIN_SCANS {
        return Err(AdmissionError::TooFewScans { count: scans.len() });
    }
    let fit = fit_all(scans, file)?;
    if let Some(file) = file {
        check_fit(scans, file, &fit)?;
    }
    Ok(fit)
}

/// Holds the scans against a pose file that may be missing; those without a pose in natural order.
fn fit_all(scans: &[&str], file: Option<&PoseFile>) -> Result<PoseFit, FormatError> {
    let mut fit = match file {
        Some(file) => fit_poses(scans, file)?,
        None => PoseFit {
            poses: Vec::new(),
            unknown_scans: Vec::new(),
            scans_without_pose: scans.iter().map(|name| (*name).to_owned()).collect(),
            scales: BTreeMap::new(),
            other_conventions: &[],
            of_scan_files: false,
            notes: Vec::new(),
        },
    };
    fit.scans_without_pose.sort_by(|a, b| natord::compare(a, b));
    Ok(fit)
}

impl PoseFit {
    /// The scans in the order of the views: as the pose file names them, then the others in natural order.
    pub fn view_order(&self) -> impl Iterator<Item = &str> {
        self.poses.iter().map(|(name, _)| name.as_str()).chain(self.scans_without_pose.iter().map(String::as_str))
    }
}

/// Plans the registration of scans of these names; with `base`, the `poses.json` of the model that they are added to.
///
/// Views are in the order of the base model, then of the pose file, then in natural order of their names.
pub fn plan(
    scans: &[&str],
    file: Option<&PoseFile>,
    base: Option<&[u8]>,
    options: &Options,
    hints: &Hints,
) -> Result<Plan, AdmissionError> {
    let mut plan = match base {
        None => {
            let fit = admit(scans, file)?;
            let names = fit.view_order().map(str::to_owned).collect();
            Plan {
                names,
                notes: fit.notes,
                start: Start {
                    poses: fit.poses.into_iter().collect(),
                    scales: fit.scales,
                    other_conventions: fit.other_conventions,
                    of_scan_files: fit.of_scan_files,
                    ..Start::default()
                },
            }
        }
        Some(base) => plan_addition(scans, file, &poses::read_scaled(&Asset::Poses.name(), base)?)?,
    };
    plan.start.hints = hints.clone();
    let names: Vec<&str> = plan.names.iter().map(String::as_str).collect();
    admit_count(names.len(), options.method)?;
    plan.start.check(&names, options)?;
    Ok(plan)
}

fn plan_addition(scans: &[&str], file: Option<&PoseFile>, base: &poses::PoseFile) -> Result<Plan, AdmissionError> {
    let fixed = base.poses.iter().map(|(name, _)| name.as_str()).filter(|name| scans.contains(name));
    let mut names: Vec<String> = fixed.map(str::to_owned).collect();
    let added: Vec<&str> = scans.iter().copied().filter(|scan| !names.iter().any(|name| name == scan)).collect();
    let mut start = Start { base: base.matrices.clone(), ..Start::default() };
    // held against all scans, so that the pose of one that is there already is not taken for one of nearly its name
    let mut fit = fit_all(scans, file)?;
    if let Some(file) = file {
        check_fit(scans, file, &fit)?;
    }
    let is_added = |name: &String| added.contains(&name.as_str());
    fit.poses.retain(|(name, _)| is_added(name));
    fit.scans_without_pose.retain(is_added);
    names.extend(fit.view_order().map(str::to_owned));
    start.scales = fit.scales.iter().filter(|(name, _)| is_added(name)).map(|(name, s)| (name.clone(), *s)).collect();
    start.poses = fit.poses.into_iter().collect();
    start.other_conventions = fit.other_conventions;
    start.of_scan_files = fit.of_scan_files;
    Ok(Plan { names, start, notes: fit.notes })
}

#[cfg(test)]
mod tests {
    use super::*;

    const IDENTITY: &str = "[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]";

    fn poses(names: &[&str]) -> PoseFile {
        let entries: Vec<String> = names.iter().map(|name| format!("\"{name}\": {IDENTITY}")).collect();
        PoseFile { name: "poses.json".to_owned(), content: format!("{{{}}}", entries.join(",")).into_bytes() }
    }

    #[test]
    fn one_scan_is_too_few_whatever_the_poses() {
        assert_eq!(admit(&[], None), Err(AdmissionError::TooFewScans { count: 0 }));
        assert_eq!(admit(&["a.ply"], Some(&poses(&["a.ply"]))), Err(AdmissionError::TooFewScans { count: 1 }));
    }

    #[test]
    fn scans_without_a_pose_come_last_in_natural_order() {
        let order = |file: Option<&PoseFile>| -> Vec<String> {
            let fit = admit(&["s10.ply", "a.ply", "s9.ply"], file).expect("no pose is needed");
            fit.view_order().map(str::to_owned).collect()
        };
        assert_eq!(order(None), ["a.ply", "s9.ply", "s10.ply"]);
        assert_eq!(order(Some(&poses(&["s10.ply"]))), ["s10.ply", "a.ply", "s9.ply"]);
    }

    #[test]
    fn names_without_a_scan_are_ignored_but_told() {
        let fit = admit(&["a.ply", "b.ply"], Some(&poses(&["b.ply", "c.ply", "a.ply"]))).expect("all have one");
        assert_eq!(fit.unknown_scans, ["c.ply"]);
        let views: Vec<&str> = fit.poses.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(views, ["b.ply", "a.ply"], "the order of the file is the order of the views");
    }

    #[test]
    fn names_fit_in_a_plainer_form_and_a_file_that_fits_nothing_is_refused() {
        let fit = admit(&["a.ply", "b.ply"], Some(&poses(&["C:/scans/b.ply", "A"]))).expect("both are meant");
        assert_eq!(fit.view_order().collect::<Vec<_>>(), ["b.ply", "a.ply"]);
        assert!(fit.unknown_scans.is_empty() && fit.notes[0].starts_with("2 pose(s) are taken"), "{:?}", fit.notes);
        let refused = admit(&["a.ply", "b.ply"], Some(&poses(&["0.ply"]))).expect_err("fits nothing");
        assert!(matches!(refused, AdmissionError::FitsNothing { ref named, .. } if named == "0.ply"), "{refused}");
        let base = poses(&["a.ply"]).content;
        let refused =
            plan(&["a.ply", "b.ply"], Some(&poses(&["0.ply"])), Some(&base), &Options::default(), &Hints::default());
        assert!(matches!(refused, Err(AdmissionError::FitsNothing { .. })));
    }

    #[test]
    fn what_is_added_comes_after_the_base() {
        let base = poses(&["b.ply", "a.ply", "gone.ply"]).content;
        let planned = |scans: &[&str], file: Option<&PoseFile>| {
            plan(scans, file, Some(&base), &Options::default(), &Hints::default())
        };
        let plan = planned(&["a.ply", "b.ply", "c.ply"], Some(&poses(&["c.ply"]))).expect("c.ply has a pose");
        assert_eq!(plan.names, ["b.ply", "a.ply", "c.ply"]);
        assert_eq!(plan.start.poses.keys().collect::<Vec<_>>(), ["c.ply"]);
        let bare = planned(&["d.ply", "a.ply", "b.ply", "c.ply"], Some(&poses(&["a.ply"]))).expect("no pose is needed");
        assert_eq!(bare.names, ["b.ply", "a.ply", "c.ply", "d.ply"]);
        assert!(bare.start.poses.is_empty(), "the base model's pose counts");
        let code = |refused: Result<Plan, AdmissionError>| match refused {
            Err(AdmissionError::Unfit(PipelineError::Unusable { code, .. })) => code,
            other => panic!("{other:?}"),
        };
        assert_eq!(code(planned(&["a.ply", "b.ply"], None)), "nothing_to_add");
        assert_eq!(code(planned(&["x.ply", "y.ply"], Some(&poses(&["x.ply", "y.ply"])))), "wrong_base");
    }

    #[test]
    fn references_and_scales_are_checked_at_the_door() {
        let scans = ["a.ply", "b.ply"];
        let refused =
            |file: &PoseFile, options: &Options| match plan(&scans, Some(file), None, options, &Hints::default()) {
                Err(AdmissionError::Unfit(PipelineError::Unusable { code, .. })) => code,
                other => panic!("{other:?}"),
            };
        let elsewhere = Options { reference: Some("c.ply".to_owned()), ..Options::default() };
        assert_eq!(refused(&poses(&scans), &elsewhere), "unknown_reference");
        let mut scaled = poses(&scans);
        scaled.content = String::from_utf8_lossy(&scaled.content)
            .replace("[[1,0,0,0],[0,1,0,0],[0,0,1,0]", "[[2,0,0,0],[0,2,0,0],[0,0,2,0]")
            .into_bytes();
        assert_eq!(refused(&scaled, &Options::default()), "scaled_pose");
        let options = Options { scale: visage_pipeline::Scale::PerView, ..Options::default() };
        let plan = plan(&scans, Some(&scaled), None, &options, &Hints::default()).expect("scales are allowed");
        assert_eq!(plan.start.scales["a.ply"], 2.0);
    }
}
