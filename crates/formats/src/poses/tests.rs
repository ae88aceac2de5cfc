use super::*;
use visage_geometry::Vector3;

fn message(text: &str) -> String {
    read("poses.txt", text.as_bytes()).expect_err(text).to_string()
}

#[test]
fn the_three_kinds_are_told_apart() {
    let kinds = [
        "camera 0 0 0 0 0 0 1\nbmesh a.ply 1 2 3 0 0 0 1\n",
        "# by hand\na.ply\n1 0 0 1\n0 1 0 2\n0 0 1 3\n0 0 0 1\n",
        "\u{feff}\n{\"a.ply\": [[1,0,0,1],[0,1,0,2],[0,0,1,3],[0,0,0,1]]}",
    ];
    for text in kinds {
        let poses = read("poses", text.as_bytes()).expect(text);
        assert_eq!(poses.to_map()["a.ply"], Motion::translation(1.0, 2.0, 3.0));
    }
}

#[test]
fn a_file_without_poses_or_with_a_name_twice_is_refused() {
    assert!(message("").starts_with("\"poses.txt\": the whole file: there is no pose in it; send JSON"));
    assert!(message("{}").contains("there is no pose in it"));
    assert!(message("# nothing\n").contains("there is no pose in it"));
    let twice = message("bmesh a.ply 0 0 0 0 0 0 1\nbmesh a.ply 0 0 0 0 0 0 1\n");
    assert!(twice.starts_with("\"poses.txt\": the pose of \"a.ply\": the scan is named twice"), "{twice}");
    assert!(read("x", b"\xff\xfe").expect_err("no text").to_string().contains("it is no text"));
}

#[test]
fn matrices_that_are_no_motion_name_the_scan() {
    let scaled = message("{\"a.ply\": null, \"b.ply\": [2,0,0,0, 0,2,0,0, 0,0,2,0, 0,0,0,1]}");
    assert!(scaled.starts_with("\"poses.txt\": the pose of \"b.ply\": the 3x3 block is no rotation"), "{scaled}");
    let far = message("a.ply\n1 0 0 1e300\n0 1 0 0\n0 0 1 0\n0 0 0 1\n");
    assert!(far.contains("the pose of \"a.ply\": the translation is 1e300"), "{far}");
    let not_finite = message("a.ply\n1 0 0 nan\n0 1 0 0\n0 0 1 0\n0 0 0 1\n");
    assert!(not_finite.contains("the pose of \"a.ply\": the matrix has a number that is not finite"), "{not_finite}");
    let last = message("a.ply\n1 0 0 0\n0 1 0 0\n0 0 1 0\n1 0 0 1\n");
    assert!(last.contains("the last row must be 0 0 0 1"), "{last}");
}

#[test]
fn scales_are_read_where_they_are_asked_for_and_matrices_are_kept_to_the_last_bit() {
    let turned = Motion::new(Vector3::new(0.1, -1e-9, 1e6), Vector3::new(0.3, 2.0, -0.7));
    let matrices =
        vec![("a".to_owned(), Some(se3::to_scaled_rows(&turned, 1.1))), ("b".to_owned(), Some(se3::to_rows(&turned)))];
    let text = write_matrices(&matrices);
    let file = read_scaled("poses.json", text.as_bytes()).expect("scaled poses");
    assert_eq!(file.scales.keys().collect::<Vec<_>>(), ["a"]);
    assert!((file.scales["a"] - 1.1).abs() < 1e-12);
    assert!((file.to_map()["a"].to_homogeneous() - turned.to_homogeneous()).norm() < 1e-9);
    assert_eq!(file.matrices["b"], se3::to_rows(&turned));
    let again: Vec<_> = file.matrices.into_iter().map(|(name, rows)| (name, Some(rows))).collect();
    assert_eq!(write_matrices(&again), text);
    assert!(message(&text).contains("the pose of \"a\": the 3x3 block is no rotation: it holds a scale of 1.1"));
}

#[test]
fn what_is_written_is_read_back() {
    let poses: Vec<(String, Option<Motion>)> = vec![
        ("scan 1.ply".into(), Some(Motion::new(Vector3::new(0.1, -1e-9, 1e6), Vector3::new(0.3, 2.0, -0.7)))),
        ("lost \"one\".ply".into(), None),
        ("scan_0.ply".into(), Some(Motion::identity())),
    ];
    let json = read("poses.json", write_json(&poses).as_bytes()).expect("own JSON");
    assert_eq!(json.unplaced, ["lost \"one\".ply"]);
    let conf = read("poses.conf", write_conf(&poses).as_bytes()).expect("own .conf");
    for file in [json, conf] {
        assert_eq!(file.poses.len(), 2);
        assert_eq!((file.poses[0].0.as_str(), file.poses[1].0.as_str()), ("scan 1.ply", "scan_0.ply"));
        let error = file.poses[0].1.to_homogeneous() - poses[0].1.expect("posed").to_homogeneous();
        assert!(error.norm() < 1e-14, "{error}");
    }
}
