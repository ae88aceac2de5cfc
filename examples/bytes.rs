//! The bytes that registration makes of many sets, as hashes: what a change that shall change nothing must leave alone.
//!
//! `cargo run --release --example bytes -- [FOLDER...] > HASHES` registers 60 sets made by code, and the scans of each
//! folder from themselves and from each pose file in it, and prints a line for each: the set, and the hashes of
//! `poses.json`, `cloud.ply`, the signature and `report.result`. Compare the lines of two versions with `diff`.

use std::path::Path;

use visage::formats::{self, ReadLimits, ply::write_cloud, poses};
use visage::geometry::{Surface, Unit};
use visage::pipeline::{self, NamedScan, Options, Start};
use visage::progress::Progress;
use visage::synthetic::head::{Proportions, head, head_with_bumps};
use visage::synthetic::objects::jug;
use visage::synthetic::scanner::Scanner;
use visage::synthetic::scenery::SceneKind;
use visage::synthetic::sensors::{SensorKind, sensor_set};
use visage::synthetic::shapes::{ScanOptions, catalogue, scan_set};
use visage::synthetic::truth::disturb;

/// Everything random follows from this.
const SEED: u64 = 77;
/// Shapes of the catalogue that are scanned: every third or so.
const SHAPES: usize = 9;

fn main() -> anyhow::Result<()> {
    println!("# set\tposes.json\tcloud.ply\tsignature\treport.result");
    for (sensor, scene) in
        SensorKind::ALL.iter().flat_map(|sensor| SceneKind::ALL.iter().map(move |scene| (sensor, scene)))
    {
        let scans = sensor_set(*sensor, *scene, SEED).scans;
        print_hashes(&format!("{}, {}", sensor.name(), scene.name()), named(scans), &Start::default());
    }
    let shapes = catalogue();
    for shape in shapes.iter().step_by(shapes.len().div_ceil(SHAPES)) {
        let set = scan_set(shape, 7, &ScanOptions::default(), SEED);
        print_hashes(shape.name, named(set.scans), &Start::default());
    }
    for (name, specimen) in [("head", head(&Proportions::of(SEED))), ("bumps", head_with_bumps()), ("jug", jug())] {
        let set = Scanner::default().scan_set(&specimen.mesh, SEED);
        let begin = disturb(&set.poses, 0.07, 6.0, SEED);
        let scans = named(set.scans);
        let poses = scans.iter().map(|scan| scan.name.clone()).zip(begin).collect();
        print_hashes(name, scans, &Start { poses, ..Start::default() });
    }
    for folder in std::env::args().skip(1) {
        of_folder(Path::new(&folder))?;
    }
    Ok(())
}

fn named(scans: Vec<Surface>) -> Vec<NamedScan> {
    scans.into_iter().enumerate().map(|(k, surface)| NamedScan { name: format!("scan{k}.ply"), surface }).collect()
}

/// The scans of a folder from themselves, and from each of its pose files.
fn of_folder(folder: &Path) -> anyhow::Result<()> {
    let files = std::fs::read_dir(folder)?.map(|entry| Ok(entry?.file_name().to_string_lossy().into_owned()));
    let mut files = files.collect::<anyhow::Result<Vec<String>>>()?;
    files.sort_by(|a, b| natord::compare(a, b));
    let scan_names: Vec<&String> = files.iter().filter(|name| formats::check_name(name).is_ok()).collect();
    let scans = |wanted: &dyn Fn(&str) -> bool| -> anyhow::Result<Vec<NamedScan>> {
        let named = |name: &&String| -> anyhow::Result<NamedScan> {
            let surface = formats::read_surface(name, &std::fs::read(folder.join(name))?, &ReadLimits::default())?;
            Ok(NamedScan { name: (*name).clone(), surface })
        };
        scan_names.iter().filter(|name| wanted(name)).map(named).collect()
    };
    let of_set = |name: &str| !name.starts_with("gt_model");
    print_hashes(&folder.display().to_string(), scans(&of_set)?, &Start::default());
    for file in &files {
        let Ok(start) = poses::read(file, &std::fs::read(folder.join(file))?) else { continue };
        let start = start.to_map();
        let scans = scans(&|name| start.contains_key(name))?;
        if scans.len() > 1 {
            print_hashes(&format!("{}, {file}", folder.display()), scans, &Start { poses: start, ..Start::default() });
        }
    }
    Ok(())
}

fn print_hashes(set: &str, scans: Vec<NamedScan>, start: &Start) {
    let hash = |bytes: &[u8]| blake3::hash(bytes).to_hex()[..12].to_owned();
    let none = || "-".to_owned();
    // a mesh follows from the cloud, and would be told of in the report
    let options = Options { mesh: false, ..Options::default() };
    match pipeline::run_from(scans, start, Unit::Unknown, &options, &Progress::silent()) {
        Ok(outcome) => println!(
            "{set}\t{}\t{}\t{}\t{}",
            hash(poses::write_matrices(&outcome.matrices).as_bytes()),
            outcome.cloud.map_or_else(none, |model| hash(&write_cloud(&model.cloud, Some(&model.views)))),
            outcome.signature.map_or_else(none, |signature| hash(&signature.to_bytes())),
            hash(outcome.report.to_json().to_string().as_bytes()),
        ),
        Err(error) => println!("{set}\trefused: {error}"),
    }
}
