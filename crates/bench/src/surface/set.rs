//! Scans with poses, registered, and their merged cloud.

use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};

use crate::child;
use crate::paper::conf_of;
use visage::formats::{self, ReadLimits, ply, poses};
use visage::geometry::{Cloud, Mesh, Motion};
use visage::registration::pairwise::rigid_fit::RigidFit;
use visage::registration::sensor::Sensor;
use visage::registration::view::{View, median_spacing};
use visage::surface::merge::PosedView;
use visage::surface::reconstruct::Reconstruction;
use visage::surface::reconstruct::free_space::FreeSpace;

/// A registered set.
pub struct PlacedSet {
    pub name: String,
    /// Every point of every scan, with outward normals.
    pub cloud: Cloud,
    /// For each point the scan that it is of.
    pub views: Vec<u16>,
    /// That of a single scan, a length.
    pub spacing: f64,
    pub free_space: FreeSpace,
    /// The true surface in the cloud's frame, where it is known.
    pub truth: Option<Mesh>,
    out: PathBuf,
}

impl PlacedSet {
    /// Registers the set of a name below `data` from the poses that come with it; results go to `out`.
    pub fn register(data: &Path, name: &str, out: &Path) -> anyhow::Result<PlacedSet> {
        let simulated = data.join("faces/scansets").join(name);
        let is_simulated = simulated.is_dir();
        let folder = if is_simulated { simulated } else { data.join("stanford").join(name) };
        let start = if is_simulated { folder.join("poses_init.txt") } else { conf_of(&folder)? };
        child::register(&folder, &start, out, &["--no-mesh", "--no-signature"])?;
        let bytes = read(&out.join("cloud.ply"))?;
        let views = ply::views(&bytes).context("the cloud doesn't say which scans its points are of")?;
        let cloud = formats::read_surface("cloud.ply", &bytes, &ReadLimits::default())?.cloud;
        let mut placed = Vec::new();
        for (scan, pose) in poses::read("poses.json", &read(&out.join("poses.json"))?)?.to_map() {
            let surface = formats::read_surface(&scan, &read(&folder.join(&scan))?, &ReadLimits::default())?;
            let view = View::of(&surface).with_context(|| format!("{scan} can't be registered"))?;
            placed.push((scan, surface, view, pose));
        }
        let posed: Vec<PosedView> = placed
            .iter()
            .map(|(_, surface, view, pose)| PosedView {
                view,
                scan: &surface.cloud,
                local_pose: view.local_pose(pose),
                placed: true,
                sensor: surface.sensor.map(|place| Sensor::At(place.coords - view.center)).or(view.sensor),
            })
            .collect();
        let spacing = median_spacing(placed.iter().map(|(_, _, view, _)| view));
        let free_space = FreeSpace::of(&posed, spacing);
        let estimated: Vec<(&str, &Cloud, Motion)> =
            placed.iter().map(|(scan, surface, _, pose)| (scan.as_str(), &surface.cloud, *pose)).collect();
        let truth = is_simulated.then(|| truth(&folder, &estimated)).transpose()?;
        Ok(PlacedSet { name: name.to_owned(), cloud, views, spacing, free_space, truth, out: out.to_owned() })
    }

    /// For each point whether it is the last of so many of its scan.
    pub fn each(&self, of: usize) -> Vec<bool> {
        let scans = self.views.iter().max().map_or(0, |last| usize::from(*last) + 1);
        let mut counts = vec![0usize; scans];
        let mut is_last = |view: &u16| {
            let count = &mut counts[usize::from(*view)];
            *count += 1;
            count.is_multiple_of(of)
        };
        self.views.iter().map(&mut is_last).collect()
    }

    /// Writes a surface beside the cloud.
    pub fn keep(&self, found: &Reconstruction, fill: &str) -> anyhow::Result<()> {
        let attributes = ply::VertexAttributes { support: Some(&found.support), ..Default::default() };
        let path = self.out.join(format!("mesh_{fill}.ply"));
        std::fs::write(&path, ply::write_surface(&found.mesh, &attributes))
            .with_context(|| format!("writing {}", path.display()))
    }
}

fn read(path: &Path) -> anyhow::Result<Vec<u8>> {
    std::fs::read(path).with_context(|| format!("reading {}", path.display()))
}

/// The true surface where the points of all scans at the poses that were found lie best on those at their true poses.
fn truth(folder: &Path, estimated: &[(&str, &Cloud, Motion)]) -> anyhow::Result<Mesh> {
    let exact = poses::read("poses_gt.txt", &read(&folder.join("poses_gt.txt"))?)?.to_map();
    let mut fit = RigidFit::default();
    for (scan, cloud, pose) in estimated {
        let exact = exact.get(*scan).with_context(|| format!("{scan} has no true pose"))?;
        for point in cloud.points.iter().step_by(10) {
            let local = |motion: &Motion| (motion * point).coords.cast::<f32>().into();
            fit.add(&local(exact), &local(pose));
        }
    }
    let world_from_truth = fit.solve().context("too few points")?;
    let surface = formats::read_surface("gt_model.ply", &read(&folder.join("gt_model.ply"))?, &ReadLimits::default())?;
    let mut mesh = surface.mesh().context("gt_model.ply has no triangles")?;
    ensure!(!mesh.vertices.is_empty(), "gt_model.ply is empty");
    mesh.vertices.iter_mut().for_each(|vertex| *vertex = world_from_truth * *vertex);
    Ok(mesh)
}
