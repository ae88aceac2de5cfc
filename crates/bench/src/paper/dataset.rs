//! One of Stanford's sets: its scans and the poses that come with them.

use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};

use visage::formats::{self, ReadLimits};
use visage::geometry::{Cloud, Motion};
use visage::registration::averaging::paper_objective::{STRIDE, paper_objective};
use visage::registration::view::View;

/// A set that was read. Its scans are in metres.
pub struct Dataset {
    /// `bunny`, `dragon` or `happy`.
    pub name: String,
    /// All points of each scan.
    pub views: Vec<View>,
    /// Every 8th point of each scan: what the objective is measured on.
    pub thinned: Vec<View>,
    /// Whether the paper's methods run on all points.
    pub full: bool,
    /// `pose_world` of each scan, from the .conf.
    pub truth: Vec<Motion>,
}

impl Dataset {
    /// Reads the scans that the folder's one .conf names.
    pub fn read(name: &str, folder: &Path, full: bool) -> anyhow::Result<Dataset> {
        let conf = conf_of(folder)?;
        let file_name = conf.file_name().unwrap_or_default().to_string_lossy();
        let posed = formats::poses::read(&file_name, &read(&conf)?)
            .with_context(|| format!("reading {}", conf.display()))?
            .poses;
        ensure!(posed.len() > 1, "{} names {} scan(s), not several", conf.display(), posed.len());
        let (mut views, mut thinned) = (Vec::new(), Vec::new());
        for (scan, _) in &posed {
            let path = folder.join(scan);
            let surface = formats::read_surface(scan, &read(&path)?, &ReadLimits::default())
                .with_context(|| format!("reading {}", path.display()))?;
            let every_8th = surface.cloud.points.iter().step_by(STRIDE).copied().collect();
            for (cloud, views) in [(&surface.cloud, &mut views), (&Cloud::from_points(every_8th), &mut thinned)] {
                views.push(View::new(cloud).with_context(|| format!("{} can't be used", path.display()))?);
            }
        }
        let truth = posed.into_iter().map(|(_, pose)| pose).collect();
        Ok(Dataset { name: name.to_owned(), views, thinned, full, truth })
    }

    /// The views on which the paper's methods run.
    pub fn views_of_the_paper(&self) -> &[View] {
        if self.full { &self.views } else { &self.thinned }
    }

    /// The paper's objective of scan poses, in mm^2.
    pub fn objective_mm2(&self, poses: &[Motion]) -> f64 {
        const MM2: f64 = 1e6;
        let local: Vec<Motion> = self.thinned.iter().zip(poses).map(|(view, pose)| view.local_pose(pose)).collect();
        MM2 * paper_objective(&self.thinned, &local)
    }
}

/// The folder's one .conf.
pub fn conf_of(folder: &Path) -> anyhow::Result<PathBuf> {
    let entries = std::fs::read_dir(folder).with_context(|| {
        format!(
            "reading {}: put a set's scans and .conf of the Stanford 3D Scanning Repository there",
            folder.display()
        )
    })?;
    let mut confs = Vec::new();
    for entry in entries {
        let path = entry.with_context(|| format!("reading {}", folder.display()))?.path();
        if path.extension().is_some_and(|extension| extension == "conf") {
            confs.push(path);
        }
    }
    ensure!(confs.len() == 1, "{} holds {} .conf files; one is needed", folder.display(), confs.len());
    Ok(confs.remove(0))
}

fn read(path: &Path) -> anyhow::Result<Vec<u8>> {
    std::fs::read(path).with_context(|| format!("reading {}", path.display()))
}
