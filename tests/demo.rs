//! The demo as a user runs it: everything in one process, through the real REST API.

use std::process::Command;

#[test]
fn the_demo_comes_out_right_and_leaves_its_results() {
    let out = tempfile::tempdir().expect("a temporary folder");
    let demo = Command::new(env!("CARGO_BIN_EXE_visage")).args(["demo", "--out"]).arg(out.path()).output();
    let demo = demo.expect("the binary runs");
    let (said, complained) = (String::from_utf8_lossy(&demo.stdout), String::from_utf8_lossy(&demo.stderr));
    assert!(demo.status.success(), "{said}\n{complained}");
    assert!(said.contains("All poses and all answers are right."), "{said}");
    for name in ["head", "decoy", "jug"] {
        for asset in ["cloud.ply", "poses.json", "report.json"] {
            let file = out.path().join(format!("{name}_{asset}"));
            assert!(std::fs::metadata(&file).is_ok_and(|file| file.len() > 100), "{}", file.display());
        }
        // what was uploaded: eight scans and their poses
        assert_eq!(std::fs::read_dir(out.path().join(name)).expect("a folder of scans").count(), 9);
        assert!(out.path().join(name).join("rough.json").is_file());
    }
}
