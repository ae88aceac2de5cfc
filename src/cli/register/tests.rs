//! From a file to a registered model in one command.

use std::path::Path;

use clap::Parser;

use super::unpacked::testing::zip;
use super::*;
use crate::formats::e57::{WrittenScan, write_scans};
use crate::formats::{ply, poses};
use crate::geometry::{Motion, Surface};
use crate::synthetic::objects;
use crate::synthetic::scanner::{ScanSet, Scanner};
use crate::synthetic::truth::disturb;

#[derive(Debug, Parser)]
struct Line {
    #[command(flatten)]
    args: RegisterArgs,
}

/// Registers `bytes` as a file of this name; gives the scans with a pose, and the report.
fn register(name: &str, bytes: &[u8], more: &[&str]) -> (Vec<String>, String) {
    let place = tempfile::tempdir().expect("a temporary folder");
    let (file, out) = (place.path().join(name), place.path().join("out"));
    std::fs::write(&file, bytes).expect("written");
    let paths = [Path::new("visage"), &file, Path::new("--out"), &out].map(|path| path.to_str().expect("UTF-8"));
    let line = Line::parse_from([&paths, more].concat());
    run(line.args).expect("registered");
    let read = |asset: Asset| std::fs::read(out.join(&*asset.name())).expect("there");
    let placed = poses::read(&Asset::Poses.name(), &read(Asset::Poses)).expect("sound").poses;
    let is_hidden = |entry: std::io::Result<std::fs::DirEntry>| {
        entry.expect("listed").file_name().to_string_lossy().starts_with('.')
    };
    assert!(!std::fs::read_dir(&out).expect("a folder").any(is_hidden), "what was unpacked is gone");
    let report = String::from_utf8(read(Asset::Report)).expect("UTF-8");
    let page = std::fs::read_to_string(out.join(pictures::PAGE)).expect("a page beside the report");
    assert!(page.contains("<h2>Scans</h2>") && page.trim_end().ends_with("</html>"), "{page}");
    let drawn = std::fs::read_dir(out.join(pictures::FOLDER)).map_or(Vec::new(), |folder| {
        let mut names: Vec<_> = folder.map(|entry| entry.expect("listed").file_name()).collect();
        names.sort();
        names
    });
    // without cloud there is neither surface nor mesh
    let expected: &[&str] =
        if more.contains(&"--pictures") { &["convergence.png", "graph.png", "overlap.png"] } else { &[] };
    assert_eq!(drawn, expected);
    (placed.into_iter().map(|(name, _)| name).collect(), report)
}

/// Scans of a blob side by side, and poses near the true ones.
fn scans() -> (Vec<Surface>, Vec<Motion>) {
    let scanner = Scanner { views: 8, distance: 600.0, resolution: 2.5, noise: 0.15, grazing_angle: 75.0 };
    let ScanSet { mut scans, poses } = scanner.scan_set(&objects::blob(1, 20_000).mesh, 1);
    scans.truncate(3);
    (scans, disturb(&poses[..3], 0.02, 2.0, 1))
}

const QUICK: &[&str] = &["--no-cloud", "--no-signature", "--threads", "2"];

#[test]
fn a_zip_of_scans_is_registered_from_the_poses_in_it() {
    let (scans, near) = scans();
    let names = ["s0.ply", "s1.ply", "s2.ply"];
    let posed: Vec<(String, Option<Motion>)> =
        names.map(str::to_owned).into_iter().zip(near.into_iter().map(Some)).collect();
    let poses = poses::write_json(&posed);
    let files: Vec<Vec<u8>> = scans.iter().map(|scan| ply::write_cloud(&scan.cloud, None)).collect();
    let bytes = zip(&[
        ("set/scans/s0.ply", &files[0]),
        ("set/scans/s1.ply", &files[1]),
        ("set/scans/s2.ply", &files[2]),
        ("set/rough.json", poses.as_bytes()),
        ("set/readme.md", b"three scans"),
        ("__MACOSX/set/scans/._s0.ply", b"no scan"),
    ]);
    let (placed, report) = register("set.zip", &bytes, &[QUICK, &["--pictures"]].concat());
    assert_eq!(placed, ["scans/s0.ply", "scans/s1.ply", "scans/s2.ply"]);
    assert!(report.contains("\"given\"") && !report.contains("\"found\""), "{report}");
}

#[test]
fn the_scans_of_an_e57_file_are_registered_from_its_poses_in_its_unit() {
    let (scans, near) = scans();
    let written = scans.iter().zip(&near).take(2).zip(["front", "a/b"]);
    let written = written.map(|((scan, pose), name)| WrittenScan {
        name,
        cloud: &scan.cloud,
        grid: None,
        world_from_scan: Some(pose),
    });
    let bytes = write_scans(&written.collect::<Vec<_>>());
    let (mut placed, report) = register("room.e57", &bytes, QUICK);
    placed.sort();
    assert_eq!(placed, ["front", "room.e57#1"]);
    assert!(report.contains("\"given\"") && !report.contains("\"found\""), "{report}");
    assert!(report.contains("\"unit\": \"m\""), "{report}");
}

#[test]
fn results_come_in_the_formats_that_are_asked_for_and_scans_where_they_belong() {
    let (scans, near) = scans();
    let named: Vec<(String, Option<Motion>)> =
        near.into_iter().enumerate().map(|(k, pose)| (format!("s{k}.ply"), Some(pose))).collect();
    let files: Vec<Vec<u8>> = scans.iter().map(|scan| ply::write_cloud(&scan.cloud, None)).collect();
    let poses = poses::write_json(&named);
    let bytes =
        zip(&[("s0.ply", &files[0]), ("s1.ply", &files[1]), ("s2.ply", &files[2]), ("rough.json", poses.as_bytes())]);
    let place = tempfile::tempdir().expect("a temporary folder");
    let at = |name: &str| place.path().join(name).to_string_lossy().into_owned();
    std::fs::write(at("set.zip"), bytes).expect("written");
    let line = |placed: &str| {
        let (zip, out, placed) = (at("set.zip"), at("out"), at(placed));
        let more =
            ["--unit", "mm", "--no-mesh", "--no-signature", "--cloud-format", "las,glb", "--poses-format", "aln"];
        let line = ["visage", &zip, "--out", &out, "--placed-scans", &placed];
        Line::parse_from([&line, &more[..]].concat()).args
    };
    run(line("placed.e57")).expect("registered");
    run(line("placed")).expect("registered");
    let read = |name: &str| std::fs::read(at(name)).unwrap_or_else(|error| panic!("{name}: {error}"));
    let surface = |name: &str| formats::read_surface(name, &read(name), &ReadLimits::default()).expect("sound");
    let cloud = surface("out/cloud.ply").cloud;
    assert_eq!(surface("out/cloud.las").cloud.len(), cloud.len());
    let glb = surface("out/cloud.glb").cloud;
    assert!((glb.points[7] * 1000.0 - cloud.points[7]).norm() < 1e-3, "glTF is in metres");
    assert_eq!(poses::read("poses.aln", &read("out/poses.aln")).expect("sound").poses.len(), 3);
    // the file of all scans holds what the single files hold
    let together = formats::read_scans("placed.e57", &read("placed.e57"), &ReadLimits::default()).expect("sound");
    let of_file = surface("placed/s1.ply").cloud.points[11];
    let pose = together[1].world_from_scan.expect("placed");
    let of_all = pose * together[1].reading.surface.cloud.points[11];
    assert!((of_all * 1000.0 - of_file).norm() < 1e-2, "{of_all} {of_file}");
}
