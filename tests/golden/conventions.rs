//! Poses that are meant otherwise than as scan to world.

use std::collections::BTreeMap;

use visage::geometry::{Motion, PoseConvention, Unit};
use visage::pipeline::{self, NamedScan, Options, RegisteredModel, Start};
use visage::progress::Progress;
use visage::synthetic::objects;
use visage::synthetic::scanner::Scanner;
use visage::synthetic::truth::disturb;

const SCANNER: Scanner = Scanner { views: 4, distance: 600.0, resolution: 3.0, noise: 0.15, grazing_angle: 75.0 };
const WORLD_TO_SCAN: &[PoseConvention] = &[PoseConvention::WorldToScan];

#[test]
fn the_surfaces_say_which_way_poses_are_meant() {
    let set = SCANNER.scan_set(&objects::blob(1, 20_000).mesh, 1);
    let rough = disturb(&set.poses, 0.03, 3.0, 7);
    let run = |poses: &[Motion], copy: bool, other_conventions: &'static [PoseConvention]| -> RegisteredModel {
        let mut scans: Vec<NamedScan> =
            (0..4).map(|view| NamedScan { name: format!("{view}.ply"), surface: set.scans[view].clone() }).collect();
        let mut poses: BTreeMap<String, Motion> =
            poses.iter().enumerate().map(|(view, pose)| (format!("{view}.ply"), *pose)).collect();
        if copy {
            // only the copy of a scan has a pose: the scan takes it, in the direction in which it is meant
            scans.push(NamedScan { name: "z.ply".to_owned(), surface: set.scans[1].clone() });
            let pose = poses.remove("1.ply").expect("it has one");
            poses.insert("z.ply".to_owned(), pose);
        }
        let options = Options { cloud: false, signature: false, ..Options::default() };
        let start = Start { poses, other_conventions, ..Start::default() };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().expect("a pool of threads");
        pool.install(|| pipeline::run_from(scans, &start, Unit::Mm, &options, &Progress::silent()))
            .expect("a sound set")
    };
    let inverted: Vec<Motion> = rough.iter().map(Motion::inverse).collect();
    for (poses, copy, read_as) in
        [(&rough, false, "scan_to_world"), (&inverted, false, "world_to_scan"), (&inverted, true, "world_to_scan")]
    {
        let outcome = run(poses, copy, WORLD_TO_SCAN);
        let report = outcome.report.to_json();
        let convention = &report["pose_convention"];
        assert_eq!(convention["read_as"], read_as, "copy: {copy}, {convention}");
        assert!(convention["touching"][read_as].as_f64().is_some_and(|share| share > 0.2), "{convention}");
        assert_eq!(report["verdict"]["quality"], "good");
        // the first view keeps its pose, rightly read
        let (_, Some(first)) = &outcome.poses[0] else { panic!("it is placed") };
        assert!((first.to_homogeneous() - rough[0].to_homogeneous()).norm() < 1e-6);
        let views = report["views"].as_array().expect("views are reported");
        let started = views.iter().filter(|view| view["copy_of"].is_null()).all(|view| view["pose"] == "given");
        assert!(started, "{}", report["views"]);
    }
    assert!(run(&rough, false, &[]).report.pose_convention.is_none(), "nothing is open");
}
