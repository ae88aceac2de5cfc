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

/// A sound file of each kind, with two scans at the same places.
fn samples() -> Vec<(&'static str, String)> {
    let rows = ["0 -1 0 1\n1 0 0 2\n0 0 1 3\n0 0 0 1\n", "1 0 0 4\n0 1 0 5\n0 0 1 6\n0 0 0 1\n"];
    let list = |rows: &str| format!("[{}]", rows.split_whitespace().collect::<Vec<_>>().join(","));
    let [a, b] = rows.map(list);
    let columns = "[0,1,0,0,-1,0,0,0,0,0,1,0,1,2,3,1]";
    let world_to_a = "[0,-1,0,0,1,0,0,0,0,0,1,0,-2,1,-3,1]";
    let (moved, back) = ("[1,0,0,0,0,1,0,0,0,0,1,0,4,5,6,1]", "[1,0,0,0,0,1,0,0,0,0,1,0,-4,-5,-6,1]");
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let named = format!("a.ply\n{}b.ply\n{}", rows[0], rows[1]);
    let mesh = |name: &str, rows: &str| format!("<MLMesh filename=\"{name}\"><MLMatrix44>{rows}</MLMatrix44></MLMesh>");
    let flat = |rows: &str| rows.split_whitespace().take(12).collect::<Vec<_>>().join(" ");
    vec![
        (
            "Open3D pose graph",
            format!("{{\"class_name\":\"PoseGraph\",\"nodes\":[{{\"pose\":{columns}}},{{\"pose\":{moved}}}]}}"),
        ),
        (
            "Open3D camera trajectory",
            format!("{{\"parameters\":[{{\"extrinsic\":{world_to_a}}},{{\"extrinsic\":{back}}}]}}"),
        ),
        (
            "NeRF `transforms.json`",
            format!(
                "{{\"frames\":[{{\"file_path\":\"./a\",\"transform_matrix\":{a}}},{{\"file_path\":\"./b\",\"transform_matrix\":{b}}}]}}"
            ),
        ),
        ("JSON list of matrices", format!("[{a},{b}]")),
        ("JSON by name", format!("{{\"a.ply\":{a},\"b.ply\":{b}}}")),
        (
            "MeshLab project",
            format!(
                "<!DOCTYPE MeshLabDocument><MeshLabProject>{}{}</MeshLabProject>",
                mesh("a.ply", rows[0]),
                mesh("b.ply", rows[1])
            ),
        ),
        ("Stanford `.conf`", format!("bmesh a.ply 1 2 3 0 0 {} {half}\nbmesh b.ply 4 5 6 0 0 0 1\n", -half)),
        ("MeshLab alignment", format!("2\na.ply\n#\n{}b.ply\n#\n{}0\n", rows[0], rows[1])),
        ("Open3D trajectory", format!("0 0 1\n{}1 1 2\n{}", rows[0], rows[1])),
        (
            "COLMAP `images.txt`",
            format!(
                "# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n1 {half} 0 0 {} -2 1 -3 1 a.png\n\n2 1 0 0 0 -4 -5 -6 1 b.png\n1 2 -1\n",
                -half
            ),
        ),
        ("quaternion table", format!("name,tx,ty,tz,qx,qy,qz,qw\na,1,2,3,0,0,{half},{half}\nb,4,5,6,0,0,0,1\n")),
        ("TUM trajectory", format!("0.5 1 2 3 0 0 {half} {half}\n1.5 4 5 6 0 0 0 1\n")),
        ("KITTI poses", format!("{}\n{}\n", flat(rows[0]), flat(rows[1]))),
        ("bare matrices", rows.concat()),
        ("text blocks", named),
    ]
}

#[test]
fn every_kind_is_recognised_and_means_the_same() {
    let samples = samples();
    assert_eq!(
        samples.iter().map(|(kind, _)| *kind).collect::<Vec<_>>(),
        // those of one scan have tests of their own
        KINDS.iter().map(|k| k.name).filter(|name| !name.starts_with("3DTK")).collect::<Vec<_>>()
    );
    let a = Motion::new(Vector3::new(1.0, 2.0, 3.0), Vector3::z() * std::f64::consts::FRAC_PI_2);
    for (kind, text) in samples {
        let file = read("poses", text.as_bytes()).unwrap_or_else(|error| panic!("{kind}: {error}"));
        assert_eq!(file.kind, kind);
        let poses = file.named_as(&["b.ply", "a.ply"]).expect(kind).to_map();
        assert!((poses["a.ply"].to_homogeneous() - a.to_homogeneous()).norm() < 1e-9, "{kind}: {}", poses["a.ply"]);
        assert_eq!(poses["b.ply"].translation.vector, Vector3::new(4.0, 5.0, 6.0), "{kind}");
    }
}

#[test]
fn files_cut_short_or_changed_are_read_soundly_or_refused() {
    let check = |bytes: &[u8]| {
        if let Ok(file) = read_scaled("p", bytes) {
            assert!(file.poses.iter().all(|(_, pose)| pose.to_homogeneous().iter().all(|x| x.is_finite())));
            let _ = file.named_as(&["a.ply", "b.ply"]);
        }
    };
    for (_, text) in samples() {
        let bytes = text.as_bytes();
        (0..bytes.len()).for_each(|end| check(&bytes[..end]));
        for place in 0..bytes.len() {
            for change in [0x01, 0x08, 0x40, 0x80] {
                let mut changed = bytes.to_vec();
                changed[place] ^= change;
                check(&changed);
            }
        }
    }
}

#[test]
fn what_is_of_no_kind_says_what_was_seen() {
    let error = message("1 2 3 4 5\n");
    let seen =
        "\"poses.txt\": line 1: \"1 2 3 4 5\" begins no pose file that is read here: it has 5 number(s); send JSON";
    assert!(error.starts_with(seen), "{error}");
    assert!(message("3\n").contains("it has 1 number(s)"));
    for long in ["1 ".repeat(200_000), "a ".repeat(200_000), "1,".repeat(200_000)] {
        assert!(message(&long).len() < 1000);
    }
}
