//! The readers on real files. `VISAGE_DATA` names the folder with `stanford/`, `init/` and `faces/`.

use std::path::{Path, PathBuf};

use visage::formats::{ReadLimits, poses, read_surface};
use visage::geometry::{RangeGrid, Surface};

use crate::{data, read};

fn surface(path: &Path) -> Surface {
    let bytes = std::fs::read(path).expect("the file is there");
    let name = path.to_string_lossy();
    read_surface(&name, &bytes, &ReadLimits::default()).unwrap_or_else(|error| panic!("{name}: {error}"))
}

fn plys_below(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).expect("the folder is there").map(|e| e.expect("an entry").path());
    let mut found = Vec::new();
    for path in entries {
        match path.extension() {
            _ if path.is_dir() => found.extend(plys_below(&path)),
            Some(extension) if extension == "ply" => found.push(path),
            _ => {}
        }
    }
    found.sort();
    found
}

#[test]
#[ignore = "needs VISAGE_DATA"]
fn every_stanford_scan_has_a_grid_that_names_each_point_once() {
    let scans = plys_below(&data("stanford"));
    assert_eq!(scans.len(), 40);
    for path in scans {
        let surface = surface(&path);
        let grid = surface.grid.unwrap_or_else(|| panic!("{} has a grid", path.display()));
        let mut seen: Vec<u32> = grid.pixels.iter().copied().filter(|p| *p != RangeGrid::EMPTY).collect();
        seen.sort_unstable();
        seen.dedup();
        assert!(seen.len() as f64 > 0.95 * surface.cloud.len() as f64, "{}", path.display());
    }
    let bunny = surface(&data("stanford/bunny/bun000.ply"));
    assert_eq!(bunny.cloud.len(), 40256);
    assert_eq!(bunny.cloud.points[0].coords.as_slice(), [-0.06325, 0.0359793, 0.0420873]);
    assert_eq!(bunny.grid.map(|grid| (grid.columns, grid.rows)), Some((512, 400)));
}

#[test]
#[ignore = "needs VISAGE_DATA"]
fn every_model_is_a_mesh() {
    let models = plys_below(&data("faces/models"));
    assert!(models.len() > 80);
    for path in models {
        assert!(surface(&path).mesh().is_some(), "{} has faces", path.display());
    }
}

#[test]
#[ignore = "needs VISAGE_DATA"]
fn the_conf_files_agree_with_the_poses_of_the_other_readers() {
    for (set, conf) in [("bunny", "bun"), ("dragon", "dragonStandRight"), ("happy", "happyStandRight")] {
        let read = |path: PathBuf| {
            let bytes = std::fs::read(&path).expect("the file is there");
            poses::read(&path.to_string_lossy(), &bytes).unwrap_or_else(|error| panic!("{error}"))
        };
        let from_conf = read(data(&format!("stanford/{set}/{conf}.conf"))).to_map();
        let from_json = read(data(&format!("init/{set}_gt.json"))).to_map();
        assert_eq!(from_conf.len(), if set == "bunny" { 10 } else { 15 });
        for (name, pose) in &from_json {
            let error = pose.to_homogeneous() - from_conf[name].to_homogeneous();
            assert!(error.amax() < 1e-5, "{name}: {error}");
        }
    }
}

#[test]
#[ignore = "needs VISAGE_DATA"]
fn the_text_blocks_of_the_head_sets_are_read() {
    for set in ["head_a", "head_b", "nonface_owl", "real_maxplanck"] {
        for file in ["poses_gt.txt", "poses_init.txt"] {
            let path = data(&format!("faces/scansets/{set}/{file}"));
            let poses = poses::read(file, &read(path)).expect("text blocks");
            let names: Vec<&str> = poses.poses.iter().map(|(name, _)| name.as_str()).collect();
            let expected: Vec<String> = (0..8).map(|i| format!("scan_{i:02}.ply")).collect();
            assert_eq!(names, expected);
        }
    }
}
