//! Scans in the coordinates of a map, hundreds of kilometres from the origin.

use std::collections::BTreeMap;

use visage::formats::{Format, ReadLimits, extension, read_surface};
use visage::geometry::{Motion, Unit};
use visage::pipeline::{self, NamedScan, Options};
use visage::progress::Progress;
use visage::synthetic::objects;
use visage::synthetic::scanner::Scanner;

const SCANNER: Scanner = Scanner { views: 8, distance: 600.0, resolution: 2.5, noise: 0.15, grazing_angle: 75.0 };

/// Zone 33 of UTM, in metres; heights are small.
const PLACE: [f64; 3] = [500_123.0, 4_512_345.0, 187.0];

#[test]
fn two_scans_on_a_map_are_registered_from_files_of_each_kind() {
    let set = SCANNER.scan_set(&objects::blob(1, 20_000).mesh, 1);
    let overlapping = [0, 1];
    let to_map = Motion::translation(PLACE[0], PLACE[1], PLACE[2]);
    for ending in ["las", "e57", "xyz", "ply"] {
        let write = Format::of_ending(ending).and_then(|format| format.writers.cloud).expect("it is written");
        let scans: Vec<NamedScan> = overlapping
            .iter()
            .map(|view| {
                // both stand where they were scanned, but for a few millimetres; metres instead of millimetres
                let pose = set.poses[*view];
                let off = if *view == 0 { Motion::identity() } else { Motion::translation(2.0, -1.0, 1.0) };
                let mut cloud = set.scans[*view].clone().moved(&(off * pose)).cloud;
                cloud.points.iter_mut().for_each(|point| *point = to_map * (*point / 1000.0));
                (cloud.colors, cloud.intensities) = (None, None);
                let name = format!("scan_{view}.{ending}");
                assert_eq!(extension(&name), ending);
                let surface = read_surface(&name, &write(&cloud), &ReadLimits::default()).expect(&name);
                NamedScan { name, surface }
            })
            .collect();
        let start: BTreeMap<String, Motion> =
            scans.iter().map(|scan| (scan.name.clone(), Motion::identity())).collect();
        let options = Options { cloud: false, signature: false, ..Options::default() };
        let outcome = pipeline::run(scans, &start, Unit::M, &options, &Progress::silent()).expect(ending);
        assert_eq!(outcome.report.to_json()["verdict"]["quality"], "good", "{ending}");
        let [Some(first), Some(second)] = [0, 1].map(|view: usize| outcome.poses[view].1) else {
            panic!("{ending}: both have a place")
        };
        // what moves the second scan back by what it was off, seen where it stands on the map
        let moved = first.inverse() * second;
        let point = to_map * set.scans[1].cloud.points[0].map(|_| 0.0);
        let back = (moved * point - point) * 1000.0;
        let wanted = nalgebra::Vector3::new(-2.0, 1.0, -1.0);
        assert!((back - wanted).norm() < 0.5, "{ending}: moved by {back} mm instead of {wanted}");
    }
}
