//! Which files are the models that somebody means.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};

use crate::domain::asset::Asset;
use crate::formats::{self, Format};
use crate::geometry::Unit;

/// A gallery of more would take long to describe, and nobody looks through it.
const MOST: usize = 100;
/// A report is read for its unit; a larger file is none.
const LARGEST_REPORT: u64 = 64 << 20;

/// A model that is to be shown.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Found {
    /// Its file.
    pub file: PathBuf,
    /// How it is called in the gallery.
    pub name: String,
    /// The unit of its coordinates.
    pub unit: Unit,
}

/// The models of these files and folders, in their order.
pub(super) fn models(paths: &[PathBuf], unit: Option<Unit>) -> anyhow::Result<Vec<Found>> {
    let mut found = Vec::new();
    for path in paths {
        if path.is_dir() {
            found.extend(of_folder(path, unit)?);
        } else {
            let file_name = file_name(path);
            ensure!(path.exists(), "there is no {}", path.display());
            formats::check_name(&file_name).with_context(|| path.display().to_string())?;
            found.push(Found { file: path.clone(), name: file_name, unit: unit.unwrap_or_default() });
        }
    }
    let count = found.len();
    ensure!(count <= MOST, "these are {count} models, at most {MOST} are shown: name those that you want to see");
    Ok(found)
}

fn of_folder(folder: &Path, unit: Option<Unit>) -> anyhow::Result<Vec<Found>> {
    let entries = std::fs::read_dir(folder).with_context(|| format!("reading {}", folder.display()))?;
    let mut files = Vec::new();
    for entry in entries {
        let path = entry.with_context(|| format!("reading {}", folder.display()))?.path();
        let is_surface = Format::of_ending(&formats::extension(&file_name(&path))).is_some_and(Format::is_surface);
        if is_surface && path.is_file() && !file_name(&path).starts_with('.') {
            files.push(path);
        }
    }
    files.sort_by(|a, b| natord::compare(&file_name(a), &file_name(b)));
    if let Some(result) = of_result(folder, &files, unit) {
        return Ok(result);
    }
    if files.is_empty() {
        bail!(
            "{} holds neither meshes nor clouds: give what `visage register SCANS --out FOLDER` left, or a file",
            folder.display()
        );
    }
    let unit = unit.unwrap_or_default();
    Ok(files.into_iter().map(|file| Found { name: file_name(&file), file, unit }).collect())
}

/// The mesh and the cloud that a registration left in a folder, if it is such a one.
fn of_result(folder: &Path, files: &[PathBuf], unit: Option<Unit>) -> Option<Vec<Found>> {
    let report = folder.join(&*Asset::Report.name());
    if !report.is_file() {
        return None;
    }
    let unit = unit.or_else(|| unit_of(&report)).unwrap_or_default();
    let shown = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
    let model = |what: &str| {
        let file = files.iter().find(|file| file.file_stem().is_some_and(|stem| stem == what))?;
        Some(Found { file: file.clone(), name: format!("{} ({what})", file_name(&shown)), unit })
    };
    let found: Vec<Found> = ["mesh", "cloud"].into_iter().filter_map(model).collect();
    (!found.is_empty()).then_some(found)
}

/// The unit that a report names; what is no report names none.
fn unit_of(report: &Path) -> Option<Unit> {
    let is_small = std::fs::metadata(report).is_ok_and(|metadata| metadata.len() <= LARGEST_REPORT);
    let content = is_small.then(|| std::fs::read(report).ok()).flatten()?;
    let report: serde_json::Value = serde_json::from_slice(&content).ok()?;
    report["result"]["unit"].as_str()?.parse().ok()
}

fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder(files: &[(&str, &str)]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().expect("a folder");
        for (name, content) in files {
            std::fs::write(folder.path().join(name), content).expect("written");
        }
        folder
    }

    fn names(folder: &tempfile::TempDir) -> Vec<String> {
        let found = models(&[folder.path().to_owned()], None).expect("models");
        found.into_iter().map(|found| file_name(&found.file)).collect()
    }

    #[test]
    fn of_a_result_the_mesh_and_the_cloud_are_shown_in_their_unit() {
        let files = ["cloud.ply", "medium.glb", "mesh.stl", "poses.json", "preview.glb"].map(|name| (name, ""));
        let result = folder(&[&files[..], &[("report.json", "{\"result\": {\"unit\": \"cm\"}}")]].concat());
        let found = models(&[result.path().to_owned()], None).expect("models");
        assert_eq!(found.iter().map(|found| found.unit).collect::<Vec<_>>(), [Unit::Cm, Unit::Cm]);
        assert_eq!(names(&result), ["mesh.stl", "cloud.ply"]);
        assert!(found[0].name.ends_with(" (mesh)") && found[1].name.ends_with(" (cloud)"), "{found:?}");
        let said = models(&[result.path().to_owned()], Some(Unit::M)).expect("models");
        assert_eq!(said[0].unit, Unit::M);
        std::fs::write(result.path().join("report.json"), "[1").expect("written");
        assert_eq!(models(&[result.path().to_owned()], None).expect("models")[0].unit, Unit::Unknown);
    }

    #[test]
    fn of_any_other_folder_every_surface_is_shown_in_natural_order() {
        let some = folder(&[("s10.ply", ""), ("s9.obj", ""), ("notes.txt", ""), ("a.jpg", ""), (".hidden.ply", "")]);
        let shown = names(&some);
        assert!(shown.contains(&"s9.obj".to_owned()) && !shown.iter().any(|name| name.contains("hidden")), "{shown:?}");
        let place = |wanted: &str| shown.iter().position(|name| name == wanted);
        assert!(place("s9.obj") < place("s10.ply"), "{shown:?}");
    }

    #[test]
    fn what_is_no_model_is_refused_with_what_to_give() {
        let refused = |path: &Path| format!("{:#}", models(&[path.to_owned()], None).expect_err("refused"));
        let empty = folder(&[("a.jpg", "")]);
        assert!(refused(empty.path()).contains("visage register SCANS --out FOLDER"));
        assert!(refused(&empty.path().join("none.ply")).starts_with("there is no "));
        assert!(refused(&empty.path().join("a.jpg")).contains("a.jpg"));
        let many: Vec<String> = (0..=MOST).map(|k| format!("{k}.ply")).collect();
        let many = folder(&many.iter().map(|name| (name.as_str(), "")).collect::<Vec<_>>());
        assert!(refused(many.path()).contains("at most 100 are shown"));
    }
}
