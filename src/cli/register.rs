//! `visage register`: the scans of a folder into one model, without a server.

mod depth_folder;
mod folder;
pub(super) mod options;
mod others;
mod out_folder;
mod pictures;
mod pose_files;
mod textures;
mod unfolded;
mod unpacked;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};
use clap::Args;

use self::depth_folder::DepthFolder;
use self::folder::Folder;
use self::options::Given;
use self::others::Others;
use self::pictures::Gallery;
use self::unpacked::Unpacked;
use super::surfaces;
use super::workplace::Workplace;
use crate::domain::asset::Asset;
use crate::domain::options::Options;
use crate::formats::{self, Dropped, ReadLimits, Reading, poses::PoseFile};
use crate::geometry::{PoseConvention, Unit};
use crate::jobs::artifacts::{RunFacts, add_readings, write_assets};
use crate::pipeline::report::{LeftOutReport, ModelReport, ScanReport};
use crate::pipeline::{self, Hints, NamedScan, PipelineError, RegisteredModel, Start, units};
use crate::progress::{Progress, Stage};
use crate::registration::global::report::ComponentReport;
use crate::registration::quality::{Quality, Verdict};

/// What to register and where to write it.
#[derive(Debug, Args)]
pub struct RegisterArgs {
    #[arg(help = format!("The folder with the scans ({}), a zip or tar archive of it, or a file that holds several scans",
                         formats::surface_names()))]
    path: PathBuf,
    /// Initial poses: JSON {"scan name": 4x4 scan-to-world}, what MeshLab, Open3D, COLMAP and trajectories write (see
    /// docs/API.md), or a folder with a file of 4 rows for each scan
    #[arg(long)]
    poses: Option<PathBuf>,
    /// Which files of PATH are scans, such as 'scan_*.ply' [default: those of the pose file, else every scan file]
    #[arg(long, value_name = "GLOB")]
    scans: Option<String>,
    /// Unit of the scans: mm, cm, m, in or unknown [default: what their files declare, else unknown]
    #[arg(long)]
    unit: Option<Unit>,
    #[command(flatten)]
    options: Given<Options>,
    /// The unit of a scan that is in another one than the rest, such as scan_00.ply=m; may be given several times
    #[arg(long, value_name = "SCAN=UNIT", value_parser = unit_of)]
    unit_of: Vec<(String, Unit)>,
    #[command(flatten)]
    others: Others,
    /// Add scans to a finished model: its folder (or its file of poses); the poses in it stay as they are
    #[arg(long, value_name = "MODEL")]
    add_to: Option<PathBuf>,
    /// What you say of the scans where machines can't tell, JSON: picked points, pairs that overlap, regions to use or leave,
    /// units
    #[arg(long, value_name = "FILE")]
    hints: Option<PathBuf>,
    /// Draw all pictures that there are of the model, into the folder pictures below --out
    #[arg(long)]
    pictures: bool,
    #[arg(long, help = format!("The folder to write {} to; made if it isn't there", results()))]
    out: PathBuf,
}

/// The files that are written, for the help.
fn results() -> String {
    let assets = Asset::RESULTS.iter().map(|asset| asset.name());
    assets.chain([pictures::PAGE.into()]).collect::<Vec<_>>().join(", ")
}

/// Registers and writes the results.
pub fn run(args: RegisterArgs) -> anyhow::Result<()> {
    let options = &args.options.0;
    let place = Workplace::new(options.threads)?;
    let Workplace { threads, pool, tracker, progress, .. } = &place;

    out_folder::make_out(&args.out, &args.path)?;
    args.others.check(&args.path)?;
    let archive = is_archive(&args.path);
    let archive = archive.then(|| Unpacked::new(&args.path, &args.out, &ReadLimits::default())).transpose()?;
    let mut folder = match &archive {
        Some(unpacked) => Folder::of_archive(&args.path, unpacked)?,
        None if args.path.is_file() => Folder::of_file(&args.path)?,
        None => Folder::list(&args.path)?,
    };
    pool.install(|| folder.unfold(args.scans.as_deref()))?;
    let given = args.poses.as_deref().map(read_poses).transpose()?;
    let poses = given.map(|file| folder.fit(args.scans.as_deref(), file)).transpose()?;
    let base = args.add_to.as_deref().map(read_base).transpose()?;
    let base = base.map(|file| folder.fit(None, file)).transpose()?;
    let names = folder.choose(args.scans.as_deref(), poses.as_ref(), base.as_ref())?;
    let mut notes: Vec<String> = archive.iter().flat_map(Unpacked::notes).collect();
    notes.extend(folder.unfolded().notes());
    notes.extend(folder.depth().map(DepthFolder::note));
    let is_told = poses.is_some() || base.is_some();
    let (found, doubt) = if archive.is_some() && !is_told { pose_files::find(&folder, &names) } else { (None, None) };
    notes.extend(doubt);
    let (found, poses) = match found {
        Some((name, file)) => {
            notes.push(format!("the scans start from the poses in {name}"));
            (Some(name), Some(file))
        }
        None => (None, poses),
    };
    let pose_notes = poses.as_ref().map(PoseFile::notes).unwrap_or_default();
    notes.extend(pose_notes.iter().cloned());
    if args.scans.is_none() && args.poses.is_none() {
        notes.extend(folder.passed_over(found.as_deref()));
    }
    let mut of_files = BTreeMap::new();
    if poses.is_none() && base.is_none() {
        of_files = folder.unfolded().poses(&names);
        if !of_files.is_empty() {
            notes.push(format!("{} scans start from the poses that their files give", of_files.len()));
        }
        let tiles = formats::shared_frame(names.iter().map(String::as_str));
        if !tiles.is_empty() {
            notes
                .push(format!("{} scans start where they are, since files of their format share a frame", tiles.len()));
        }
        of_files.extend(tiles);
    }
    check_depth_unit(&folder, args.unit)?;
    notes.iter().for_each(|note| eprintln!("note: {note}"));
    let mut hints = args.hints.as_deref().map(read_hints).transpose()?.unwrap_or_default();
    hints.units.extend(args.unit_of);
    let read = pool.install(|| read_scans(&folder, &names, progress))?;
    let declared: Vec<_> = names.iter().map(String::as_str).zip(read.iter().map(|reading| reading.unit)).collect();
    // depth images are in metres whatever is said of them
    let given = args.unit.filter(|_| folder.depth().is_none());
    let mut settled = units::settle(given, &declared, &hints.units).map_err(with_hint)?;
    settled.notes.iter().for_each(|note| eprintln!("note: {note}"));
    let mut dropped: BTreeMap<String, Dropped> = BTreeMap::new();
    let mut scans: Vec<NamedScan> = Vec::with_capacity(read.len());
    for (name, reading) in names.iter().zip(read) {
        dropped.insert(name.clone(), reading.dropped);
        scans.push(NamedScan { name: name.clone(), surface: reading.surface });
    }
    let mut start = Start {
        other_conventions: poses.as_ref().map(|file| file.other_conventions).unwrap_or_default(),
        of_scan_files: poses.as_ref().is_none_or(|file| file.of_scan_files),
        poses: poses.as_ref().map_or(of_files, PoseFile::to_map),
        scales: poses.map(|file| file.scales).unwrap_or_default(),
        base: base.map(|file| file.matrices).unwrap_or_default(),
        hints,
    };
    settled.apply(&mut scans, &mut start);
    let kept = args.others.wants_scans().then(|| scans.clone());
    let mut outcome =
        pool.install(|| pipeline::run_from(scans, &start, settled.unit, options, progress)).map_err(with_hint)?;
    add_readings(&mut outcome.report, &dropped, &pose_notes);
    let more = args.others.write(&outcome, kept.unwrap_or_default(), settled.unit, &args.out)?;
    settled.undo(&names, &mut outcome);

    progress.report(Stage::Storing, 0.0);
    let facts = || {
        progress.report(Stage::Storing, 1.0);
        RunFacts::here(None, *threads, tracker.snapshot())
    };
    let mut report = Vec::new();
    write_assets(&outcome, facts, |asset, content| {
        if asset == Asset::Report {
            report = content.to_vec();
        }
        write(&args.out.join(&*asset.name()), content)
    })?;
    let gallery = Gallery::new(&mut outcome, &report, settled.unit)?;
    let name = args.path.canonicalize().unwrap_or_else(|_| args.path.clone());
    let name = name.file_name().unwrap_or_default().to_string_lossy().into_owned();
    pool.install(|| gallery.write_page(name, options, &args.out, progress))?;
    if args.pictures {
        let without = pool.install(|| gallery.write_pictures(&args.out, progress))?;
        if !without.is_empty() {
            eprintln!("note: there is no picture of {}: the model lacks what it would show", without.join(", "));
        }
    }
    place.done();
    more.iter().for_each(|note| eprintln!("note: {note}"));
    summarise(&outcome, &args.out)
}

/// What `--unit-of` says.
fn unit_of(text: &str) -> anyhow::Result<(String, Unit)> {
    let (scan, unit) = text.rsplit_once('=').context("give the name of a scan, =, and its unit: scan_00.ply=m")?;
    Ok((scan.to_owned(), unit.parse()?))
}

/// Whether a path is that of an archive to be unfolded.
fn is_archive(path: &Path) -> bool {
    path.is_file() && formats::archive::is_archive(&path.file_name().unwrap_or_default().to_string_lossy())
}

/// Depth images are read in metres.
fn check_depth_unit(folder: &Folder, given: Option<Unit>) -> anyhow::Result<()> {
    let other = given.filter(|unit| folder.depth().is_some() && !matches!(unit, Unit::M | Unit::Unknown));
    match other {
        Some(unit) => bail!("depth images are read in metres, not in {}: leave --unit out", unit.name()),
        None => Ok(()),
    }
}

fn read_poses(path: &Path) -> anyhow::Result<PoseFile> {
    if path.is_dir() {
        return pose_files::read_matrices(path);
    }
    let bytes = std::fs::read(path).with_context(|| format!("reading {}", path.display()))?;
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    formats::poses::read_scaled(&name, &bytes).with_context(|| format!("reading {}", path.display()))
}

/// Reads hints.
fn read_hints(path: &Path) -> anyhow::Result<Hints> {
    let bytes = std::fs::read(path).with_context(|| format!("reading {}", path.display()))?;
    let remedy =
        r#"give {"points": [...], "overlaps": [...], "regions": [...], "units": {...}} as docs/API.md describes it"#;
    serde_json::from_slice(&bytes).with_context(|| format!("{} holds no hints; {remedy}", path.display()))
}

/// The poses of a finished model, from its folder or from the file itself.
fn read_base(model: &Path) -> anyhow::Result<PoseFile> {
    let path = if model.is_dir() { model.join(&*Asset::Poses.name()) } else { model.to_owned() };
    let file = read_poses(&path)?;
    let has_matrices = file.matrices.len() == file.poses.len() && !file.poses.is_empty();
    ensure!(has_matrices, "{} is not the {} of a finished model", path.display(), Asset::Poses.name());
    Ok(file)
}

fn read_scans(folder: &Folder, names: &[String], progress: &Progress) -> anyhow::Result<Vec<Reading>> {
    use rayon::prelude::*;
    progress.report(Stage::Loading, 0.0);
    let of_scans: Vec<anyhow::Result<Reading>> = names
        .par_iter()
        .map(|name| {
            let reading = folder.read(name)?;
            let Reading { surface, dropped, .. } = &reading;
            if !dropped.is_empty() {
                eprintln!("note: {name}: {dropped}");
            }
            if !surface.faces.is_empty() && surface.grid.is_none() {
                eprintln!("note: {name} is a mesh; its vertices are taken as a scan");
            }
            Ok(reading)
        })
        .collect();
    // of several errors the first scan's, whichever thread met its own first
    of_scans.into_iter().collect()
}

fn with_hint(error: PipelineError) -> anyhow::Error {
    match error {
        PipelineError::Unusable { message, hint, .. } => anyhow::anyhow!("{message}; {hint}"),
        canceled @ PipelineError::Canceled(_) => canceled.into(),
    }
}

fn write(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    std::fs::write(path, bytes).with_context(|| format!("writing {}", path.display()))
}

/// The verdict on standard output; an error if the registration failed, since scripts look at the exit status.
fn summarise(outcome: &RegisteredModel, out: &Path) -> anyhow::Result<()> {
    let Verdict { quality, reasons, .. } = &outcome.report.registration.verdict;
    let placed = outcome.poses.iter().filter(|(_, pose)| pose.is_some()).count();
    println!(
        "quality {}: {placed} of {} scans placed, results in {}",
        quality.name(),
        outcome.poses.len(),
        out.display()
    );
    for reason in reasons {
        println!("  {reason}");
    }
    let groups = groups_in_words(&outcome.report);
    for line in groups.into_iter().chain(surface_in_words(&outcome.report)).chain(left_out_in_words(&outcome.report)) {
        println!("{line}");
    }
    for note in notes(&outcome.report) {
        eprintln!("note: {note}");
    }
    if *quality == Quality::Failed {
        bail!("the registration failed; the files are written, but don't use them unseen");
    }
    Ok(())
}

/// A line for each group of scans beside the placed one.
fn groups_in_words(report: &ModelReport) -> Vec<String> {
    let words = |(index, group): (usize, &ComponentReport)| {
        format!(
            "group {index} ({} by itself): {}; not placed, their poses among each other are in {}",
            group.quality.name(),
            group.views.join(", "),
            Asset::Report.name()
        )
    };
    report.registration.groups.iter().enumerate().skip(1).map(words).collect()
}

/// What became of the surface, if there is one.
fn surface_in_words(report: &ModelReport) -> Vec<String> {
    let Some(surface) = &report.surface else { return Vec::new() };
    let left_out = report.registration.views.iter().filter(|scan| is_not_in_surface(scan)).count();
    let without = match left_out {
        0 => String::new(),
        count => format!("; without {count} scans of which it is not known which side is outside (--sensor tells it)"),
    };
    surfaces::in_words(surface, report.registration.unit.parse().unwrap_or_default(), &without)
}

/// Whether a scan has a place, but is not part of the surface.
fn is_not_in_surface(scan: &ScanReport) -> bool {
    scan.view.placed && scan.copy_of.is_none() && scan.normals_outward == Some(false)
}

/// What was left out of the scans, if anything was.
fn left_out_in_words(report: &ModelReport) -> Vec<String> {
    let left_out = || report.registration.views.iter().filter(|scan| scan.copy_of.is_none()).map(|scan| scan.left_out);
    let sum = |count: fn(&LeftOutReport) -> usize| left_out().map(|left_out| count(&left_out)).sum::<usize>();
    let support = sum(|left_out| left_out.cleaning.map_or(0, |cleaning| cleaning.support));
    let strays = sum(|left_out| left_out.cleaning.map_or(0, |cleaning| cleaning.strays));
    let (no_return, repeated) = (sum(|left_out| left_out.no_return), sum(|left_out| left_out.repeated));
    let cleaned = (support + strays > 0).then(|| {
        format!(
            "left out: {support} points of turntable, floor or walls, {strays} stray points (--keep-all keeps them)"
        )
    });
    let none = (no_return + repeated > 0)
        .then(|| format!("left out: {no_return} points where nothing was seen, {repeated} that repeat others"));
    cleaned.into_iter().chain(none).collect()
}

/// What the user may not know of the scans.
fn notes(report: &ModelReport) -> Vec<String> {
    let scans = || report.registration.views.iter();
    let copies = scans().filter_map(|scan| Some((&scan.view.name, scan.copy_of.as_ref()?)));
    let mut notes: Vec<String> = copies
        .map(|(name, of)| {
            format!("{name} has the points of {of}: a copy bears out nothing, it takes the pose of the other")
        })
        .collect();
    let posed: Vec<&str> = scans().filter(|scan| scan.viewpoint_is_pose).map(|scan| scan.view.name.as_str()).collect();
    if !posed.is_empty() {
        notes.push(format!(
            "the VIEWPOINT of {} is the pose of the scan, not the scanner's place in it: the scanner is taken to be at the \
             origin (--sensor tells another place)",
            posed.join(", ")
        ));
    }
    notes.extend(convention_in_words(report));
    if report.face_cut == Some(false) {
        notes.push("no face was found to cut out: nothing is hidden in cloud and mesh".to_owned());
    }
    notes
}

/// As what the poses were read, if not as they stand.
fn convention_in_words(report: &ModelReport) -> Option<String> {
    let convention = report.pose_convention.as_ref()?;
    let others = [PoseConvention::WorldToScan, PoseConvention::OpenGlCamera];
    let read_as = others.into_iter().find(|other| convention.read_as == other.name())?;
    let percent = |of: PoseConvention| 100.0 * convention.touching.get(of.name()).copied().unwrap_or_default();
    Some(format!(
        "the poses are read as {}: so {:.0} % of the points lie by other scans, as they stand {:.0} %",
        read_as.words(),
        percent(read_as),
        percent(PoseConvention::ScanToWorld)
    ))
}

#[cfg(test)]
mod tests;
