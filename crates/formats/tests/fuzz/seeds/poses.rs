//! A file of every kind of poses.

use visage_formats::poses;
use visage_geometry::Motion;

use super::{Seed, beside, motion};

const ROWS: &str = "1 0 0 1\n0 1 0 2\n0 0 1 3\n0 0 0 1\n";

/// A line of `.frames`.
const FRAME: &str = "1 0 0 0 0 1 0 0 0 0 1 0 4 5 6 1 2\n";

fn named() -> Vec<(String, Option<Motion>)> {
    (0..3).map(|k| (format!("scan {k}.ply"), Some(motion(f64::from(k))))).collect()
}

pub fn all() -> Vec<Seed> {
    let named = named();
    let frames = r#"{"fl_x": 5, "frames": [{"file_path": "a", "transform_matrix": [[1,0,0,4],[0,1,0,5],[0,0,1,6]]}]}"#;
    let sixteen = "1,0,0,0,0,1,0,0,0,0,1,0,4,5,6,1";
    let graph = format!(
        r#"{{"class_name": "PoseGraph", "nodes": [{{"pose": [{sixteen}]}}, {{"pose": [{sixteen}]}}], "edges": []}}"#
    );
    let trajectory = format!(r#"{{"parameters": [{{"extrinsic": [{sixteen}], "intrinsic": {{"width": 4}}}}]}}"#);
    let list = r#"{"poses": [[[1,0,0,4],[0,1,0,5],[0,0,1,6],[0,0,0,1]], [1,0,0,4,0,1,0,5,0,0,1,6]]}"#;
    vec![
        Seed::plain("poses.json", poses::write_json(&named)),
        Seed::plain("graph.json", graph),
        Seed::plain("trajectory.json", trajectory),
        Seed::plain("frames.json", frames),
        Seed::plain("list.json", list),
        Seed::plain("poses.conf", poses::write_conf(&named)),
        Seed::plain("blocks.txt", format!("a.ply\n{ROWS}# b\nb.ply\n{ROWS}")),
        Seed::plain("poses.aln", poses::write_aln(&named)),
        Seed::plain("poses.mlp", poses::write_mlp(&named)),
        Seed::plain("poses.log", poses::write_log(&named)),
        Seed::plain("table.csv", "name,tx,ty,tz,qx,qy,qz,qw\na,1,2,3,0,0,0,1\nb,4,5,6,0,0,0,1\n"),
        Seed::plain("tum.txt", "1.5 1 2 3 0 0 0 1\n2.5 4 5 6 0 0 0 1\n"),
        Seed::plain("images.txt", "1 1 0 0 0 4 5 6 1 a.png\n1.5 2 -1\n2 1 0 0 0 1 2 3 1 b.png\n\n"),
        Seed::plain("kitti.txt", "1 0 0 4 0 1 0 5 0 0 1 6\n1 0 0 1 0 1 0 2 0 0 1 3\n"),
        Seed::plain("scan000.frames", FRAME.repeat(3)),
        Seed::plain("scan000.pose", "1.5 2 -300\n10 -20 30\n"),
        Seed::plain("bare.txt", ROWS.repeat(2)),
    ]
}

pub fn folder() -> Vec<Seed> {
    let frames = [FRAME.as_bytes(), b"1 2 3\n4 5 6\n", FRAME.as_bytes()];
    vec![
        Seed::plain("folder", beside::joined(&[ROWS.as_bytes(), ROWS.as_bytes(), b"no matrix\n"])),
        Seed::plain("frames", beside::joined(&frames)),
    ]
}
