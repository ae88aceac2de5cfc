//! Results in other formats, beside those that are always written.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};
use clap::Args;

use crate::formats::e57::{self, WrittenScan, write_scans};
use crate::formats::written::{Written, placed, scaled};
use crate::formats::{Format, packed, ply, poses};
use crate::geometry::{Cloud, Motion, Unit};
use crate::jobs::artifacts::write_mesh;
use crate::pipeline::{NamedScan, RegisteredModel};

/// What else is to be written.
#[derive(Debug, Args)]
pub struct Others {
    #[arg(long, value_name = "FORMATS", value_delimiter = ',', value_parser = cloud_format,
          help = format!("Also write the cloud in these formats: {}", Written::Cloud.endings().join(", ")))]
    cloud_format: Vec<&'static Format>,
    #[arg(long, value_name = "FORMATS", value_delimiter = ',', value_parser = mesh_format,
          help = format!("Also write the mesh in these formats: {}", Written::Mesh.endings().join(", ")))]
    mesh_format: Vec<&'static Format>,
    #[arg(long, value_name = "FORMATS", value_delimiter = ',', value_parser = pose_format,
          help = format!("Also write the poses in these formats: {}", Written::Poses.endings().join(", ")))]
    poses_format: Vec<&'static Format>,
    /// Also write the scans where they belong: into one file that ends with .e57, or into a folder, a file each
    #[arg(long, value_name = "PATH")]
    placed_scans: Option<PathBuf>,
    #[arg(long, value_name = "FORMAT", requires = "placed_scans", value_parser = cloud_format,
          help = format!("The format of placed scans in a folder: {} [default: ply]", Written::Cloud.endings().join(", ")))]
    placed_format: Option<&'static Format>,
}

fn cloud_format(text: &str) -> Result<&'static Format, String> {
    format_of(Written::Cloud, text)
}

fn mesh_format(text: &str) -> Result<&'static Format, String> {
    format_of(Written::Mesh, text)
}

fn pose_format(text: &str) -> Result<&'static Format, String> {
    format_of(Written::Poses, text)
}

fn format_of(written: Written, text: &str) -> Result<&'static Format, String> {
    written.of_ending(text).ok_or_else(|| format!("it is written as {}", written.endings().join(", ")))
}

impl Others {
    /// Whether the scans have to be kept until the end.
    pub fn wants_scans(&self) -> bool {
        self.placed_scans.is_some()
    }

    /// Refuses what can't be written, before any work. `scans` is where the scans are.
    pub fn check(&self, scans: &Path) -> anyhow::Result<()> {
        let Some(path) = &self.placed_scans else { return Ok(()) };
        let is_same =
            |a: &Path, b: &Path| a.canonicalize().ok().zip(b.canonicalize().ok()).is_some_and(|(a, b)| a == b);
        ensure!(!is_same(path, scans), "--placed-scans {} is where the scans are: give another place", path.display());
        match is_e57(path) {
            true => {
                ensure!(self.placed_format.is_none(), "--placed-format is for a folder, not for {}", path.display())
            }
            false => {
                ensure!(
                    !path.is_file(),
                    "--placed-scans {} is a file: give a folder, or a name that ends with .e57",
                    path.display()
                );
                std::fs::create_dir_all(path).with_context(|| format!("making {}", path.display()))?;
            }
        }
        Ok(())
    }

    /// Writes them; answers with what the user should know. `scans` are those that were registered.
    pub fn write(
        &self,
        outcome: &RegisteredModel,
        scans: Vec<NamedScan>,
        unit: Unit,
        out: &Path,
    ) -> anyhow::Result<Vec<String>> {
        let mut notes = Vec::new();
        for format in &self.cloud_format {
            match (&outcome.cloud, format.writers.cloud) {
                (Some(merged), Some(write)) => {
                    let cloud = in_unit_of(format, merged.cloud.clone(), unit);
                    save(&out.join(format!("cloud.{}", format.ending())), &write(&cloud))?;
                }
                _ => notes.push(format!("there is no cloud to write as {}", format.name)),
            }
        }
        for format in &self.mesh_format {
            match outcome.mesh.as_ref().and_then(|made| write_mesh(&made.surface, unit, format)) {
                Some(content) => save(&out.join(format!("mesh.{}", format.ending())), &content)?,
                None => notes.push(format!("there is no mesh to write as {}", format.name)),
            }
        }
        for format in &self.poses_format {
            let scaled =
                outcome.report.registration.views.iter().any(|view| view.scale.is_some_and(|scale| scale != 1.0));
            let has_blank = |(name, _): &(String, Option<Motion>)| name.chars().any(char::is_whitespace);
            let is_conf = **format == poses::CONF;
            match format.writers.poses {
                _ if scaled => {
                    notes.push(format!("poses with scales are not written as {}: see poses.json", format.name))
                }
                _ if is_conf && outcome.poses.iter().any(has_blank) => {
                    notes.push(format!("names with blanks are not written as {}", format.name));
                }
                Some(write) => save(&out.join(format!("poses.{}", format.ending())), write(&outcome.poses).as_bytes())?,
                None => {}
            }
        }
        if let Some(path) = &self.placed_scans {
            self.write_placed(path, outcome, scans, unit)?;
        }
        Ok(notes)
    }

    fn write_placed(
        &self,
        path: &Path,
        outcome: &RegisteredModel,
        scans: Vec<NamedScan>,
        unit: Unit,
    ) -> anyhow::Result<()> {
        let of_scan = |scan: NamedScan| {
            let (_, pose) = outcome.poses.iter().find(|(name, _)| *name == scan.name)?;
            let views = &outcome.report.registration.views;
            let scale = views.iter().find(|view| view.view.name == scan.name).and_then(|view| view.scale);
            Some((scan.name, scan.surface, (*pose)?, scale.unwrap_or(1.0)))
        };
        let scans = scans.into_iter().filter_map(of_scan);
        if is_e57(path) {
            let factor = e57::FORMAT.factor_from(unit);
            let scans: Vec<_> = scans
                .map(|(name, surface, mut pose, scale)| {
                    pose.translation.vector *= factor;
                    (name, scaled(surface, scale * factor), pose)
                })
                .collect();
            let written = scans.iter().map(|(name, surface, pose)| WrittenScan {
                name,
                cloud: &surface.cloud,
                grid: surface.grid.as_ref(),
                world_from_scan: Some(pose),
            });
            return save(path, &write_scans(&written.collect::<Vec<_>>()));
        }
        let format = self.placed_format.unwrap_or(&ply::FORMAT);
        let Some(write) = format.writers.cloud else { bail!("clouds are not written as {}", format.name) };
        for (name, surface, pose, scale) in scans {
            let file = path.join(file_name(&name, format));
            if let Some(folder) = file.parent() {
                std::fs::create_dir_all(folder).with_context(|| format!("making {}", folder.display()))?;
            }
            save(&file, &write(&in_unit_of(format, placed(surface, scale, &pose).cloud, unit)))?;
        }
        Ok(())
    }
}

fn is_e57(path: &Path) -> bool {
    crate::formats::extension(&path.to_string_lossy()) == e57::FORMAT.ending()
}

fn in_unit_of(format: &Format, mut cloud: Cloud, unit: Unit) -> Cloud {
    let factor = format.factor_from(unit);
    cloud.points.iter_mut().for_each(|point| *point *= factor);
    cloud
}

/// The name of a placed scan: that of the scan, with the ending of the format behind it unless it ends so.
fn file_name(scan: &str, format: &Format) -> String {
    let plain = packed::inner_name(scan).unwrap_or(scan);
    let ending = format!(".{}", format.ending());
    if plain.to_ascii_lowercase().ends_with(&ending) { plain.to_owned() } else { format!("{plain}{ending}") }
}

fn save(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    std::fs::write(path, bytes).with_context(|| format!("writing {}", path.display()))
}
