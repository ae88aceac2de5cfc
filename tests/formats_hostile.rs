//! Files from outside that are broken, cut short or made to harm: never a panic, always a message that names the
//! place and the remedy.

use proptest::prelude::*;
use visage::formats::{FormatError, ReadLimits, obj, ply, poses, read_surface, stl};
use visage::geometry::{Cloud, Mesh, Motion, Point3, RangeGrid, Vector3};

const XYZ: &str = "property float x\nproperty float y\nproperty float z\n";

fn read(bytes: &[u8]) -> Result<visage::geometry::Surface, FormatError> {
    read_surface("scan.ply", bytes, &ReadLimits::default())
}

fn message(bytes: &[u8]) -> String {
    read(bytes).expect_err("a hostile file").to_string()
}

#[test]
fn a_text_file_named_ply_is_refused() {
    assert_eq!(
        message(b"Dear scanner,\nplease find my points below.\n"),
        "byte 0: a PLY file begins with the line `ply`, this one begins with \"Dear scanner,\\nplease fin...\"; \
         send a PLY file, ASCII or binary"
    );
    assert!(message(b"").ends_with("this one is empty; send a PLY file, ASCII or binary"));
}

#[test]
fn a_file_that_declares_10_to_the_12_vertices_is_refused_without_allocating() {
    for format in ["ascii", "binary_little_endian", "binary_big_endian"] {
        let file = format!("ply\nformat {format} 1.0\nelement vertex 1000000000000\n{XYZ}end_header\n0 0 0\n");
        assert_eq!(
            message(file.as_bytes()),
            "the file is cut short: it declares 1000000000000 rows of \"vertex\" but ends within the 6 bytes after \
             its header; export or upload it again"
        );
    }
    let file = format!("ply\nformat ascii 1.0\nelement vertex 18446744073709551615\n{XYZ}end_header\n0 0 0\n");
    assert!(message(file.as_bytes()).starts_with("the file is cut short"));
    let huge = "ply\nformat ascii 1.0\nelement vertex 99999999999999999999999\nend_header\n";
    assert!(message(huge.as_bytes()).starts_with("header line 3: an element needs a count"));
}

#[test]
fn an_stl_that_declares_4_thousand_million_facets_is_refused_without_allocating() {
    let mut file = vec![0; 80];
    file.extend(u32::MAX.to_le_bytes());
    file.extend([0; 50]);
    let error = read_surface("a.stl", &file, &ReadLimits::default()).expect_err("one facet").to_string();
    assert!(
        error.starts_with("the file is cut short: it declares 4294967295 facets but ends within the 50 bytes"),
        "{error}"
    );
}

#[test]
fn an_stl_of_one_long_line_takes_no_time() {
    let text = "solid facet ".repeat(1_000_000);
    let error = read_surface("a.stl", text.as_bytes(), &ReadLimits::default()).expect_err("nothing in it").to_string();
    assert!(error.contains("there are no facets"), "{error}");
}

#[test]
fn every_truncation_of_a_binary_stl_is_an_error() {
    let vertices = vec![Point3::origin(), Point3::new(1.0, 0.0, 0.0), Point3::new(0.0, 1.0, 0.0)];
    let whole = stl::write_mesh(&Mesh { vertices, faces: vec![[0, 1, 2]; 5] });
    for length in 0..whole.len() {
        assert!(read_surface("a.stl", &whole[..length], &ReadLimits::default()).is_err(), "{length}");
    }
}

#[test]
fn huge_lists_are_not_believed() {
    let head = format!("ply\nformat binary_little_endian 1.0\nelement vertex 1\n{XYZ}element face 1\n");
    let mut file = format!("{head}property list uint uint vertex_indices\nend_header\n").into_bytes();
    file.extend([0; 12]);
    file.extend(u32::MAX.to_le_bytes());
    file.extend([0; 8]);
    assert!(message(&file).starts_with("the file is cut short: it declares 1 rows of \"face\" but ends within face 0"));
    let mut negative = format!("{head}property list int uint vertex_indices\nend_header\n").into_bytes();
    negative.extend([0; 12]);
    negative.extend((-1i32).to_le_bytes());
    assert!(
        message(&negative).contains("face 0 (byte ") && message(&negative).contains("a list can't have -1 entries")
    );
}

#[test]
fn elements_without_properties_take_no_time() {
    let file = format!(
        "ply\nformat ascii 1.0\nelement nothing 18446744073709551615\nelement vertex 1\n{XYZ}end_header\n1 2 3\n"
    );
    assert_eq!(read(file.as_bytes()).expect("sound, if odd").cloud.points, [Point3::new(1.0, 2.0, 3.0)]);
}

#[test]
fn points_too_far_away_are_named_with_their_value() {
    let text = format!("ply\nformat ascii 1.0\nelement vertex 2\n{XYZ}end_header\n0 0 0\n1e20 0 0\n");
    assert_eq!(
        message(text.as_bytes()),
        "vertex 1 (line 9): x is 1e20, which is too large to be a coordinate (they reach to 1e12); repair the file or \
         export it again"
    );
    let mut binary = format!("ply\nformat binary_big_endian 1.0\nelement vertex 1\n{XYZ}end_header\n").into_bytes();
    for x in [0.0, f32::MAX, 0.0] {
        binary.extend(x.to_be_bytes());
    }
    assert!(message(&binary).starts_with("vertex 0 (byte 124): y is 3.4028234"), "{}", message(&binary));
    let pcd = "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 1\nHEIGHT 1\nDATA ascii\n0 -1e19 0\n";
    let obj = "v 0 0 1e19\n";
    let stl = "solid\nfacet normal 0 0 0\nouter loop\nvertex 0 0 1e19\nvertex 0 1 0\nvertex 1 0 0\nendloop\nendfacet\nendsolid\n";
    for (name, text) in [("a.pcd", pcd), ("a.obj", obj), ("a.stl", stl)] {
        let error = read_surface(name, text.as_bytes(), &ReadLimits::default()).expect_err(name).to_string();
        assert!(error.contains("1e19, which is too large to be a coordinate"), "{error}");
    }
}

#[test]
fn every_truncation_is_an_error() {
    let cloud = Cloud::from_points((0..20).map(|i| Point3::new(f64::from(i), 0.5, -1.0)).collect());
    let binary = ply::write_cloud(&cloud, None);
    for length in 0..binary.len() {
        let error = read(&binary[..length]).expect_err("cut short");
        let at_the_start = length < 4;
        assert!(at_the_start || matches!(error, FormatError::Truncated { .. }), "{length}: {error}");
    }
    let mut text = format!("ply\nformat ascii 1.0\nelement vertex 20\n{XYZ}end_header\n").into_bytes();
    let header = text.len();
    cloud.points.iter().for_each(|p| text.extend(format!("{} {} {}\n", p.x, p.y, p.z).bytes()));
    let last_row = text.len() - "19 0.5 -1\n".len();
    for length in header..=last_row {
        assert!(read(&text[..length]).is_err(), "{length} bytes hold no 20 rows");
    }
}

#[test]
fn names_are_judged_by_their_extension_only() {
    let error = read_surface("../../etc/passwd", b"", &ReadLimits::default()).expect_err("no such format");
    assert!(matches!(error, FormatError::UnknownExtension { .. }), "{error}");
}

/// A PLY header from odd parts, so that the body readers are reached more often than by random bytes.
fn odd_ply() -> impl Strategy<Value = Vec<u8>> {
    let format = prop::sample::select(vec!["ascii", "binary_little_endian", "binary_big_endian", "none"]);
    let line = prop::sample::select(vec![
        "element vertex 2",
        "element vertex 0",
        "element face 1",
        "element range_grid 2",
        "element other 3",
        "property float x",
        "property double y",
        "property char z",
        "property float nx",
        "property ushort red",
        "property float64 intensity",
        "property list uchar int vertex_indices",
        "property list char double vertex_index",
        "property list int ushort flags",
        "obj_info num_cols 1",
        "obj_info num_rows 2",
        "bye",
    ]);
    let body = prop_oneof![
        prop::collection::vec(any::<u8>(), 0..80),
        "([0-9]{1,3}|-1|nan|1e9|x| |\n){0,60}".prop_map(String::into_bytes),
    ];
    (format, prop::collection::vec(line, 0..12), body).prop_map(|(format, lines, body)| {
        let vertices = format!("element vertex 1\n{XYZ}");
        let mut file = format!("ply\nformat {format} 1.0\n{vertices}{}\nend_header\n", lines.join("\n")).into_bytes();
        file.extend(body);
        file
    })
}

/// A PCD of two by two points whose header lines and data may be wrong.
fn odd_pcd() -> impl Strategy<Value = Vec<u8>> {
    let fields = "FIELDS( x| y| z| rgb| intensity| normal_x){3,5}";
    let size = "SIZE( 1| 2| 4| 8){3,4}";
    let kind = "TYPE( F| F| F| U| I){3,4}";
    let count = "(COUNT( 1| 1| 1| 2| 4096){3,4})?";
    let extent = "WIDTH [0-9]{1,2}\nHEIGHT [0-9]{1,20}\n(POINTS [0-9]{1,2}\n)?";
    let data = prop::sample::select(vec!["ascii", "binary", "binary_compressed"]);
    let body = prop_oneof![
        prop::collection::vec(any::<u8>(), 0..200),
        "([0-9]{1,2}|nan|inf|x| |\n){0,80}".prop_map(String::into_bytes)
    ];
    (fields, size, kind, count, extent, data, body).prop_map(|(fields, size, kind, count, extent, data, body)| {
        let sound = "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\n".to_owned();
        let head = if body.len() % 2 == 0 { sound } else { format!("{fields}\n{size}\n{kind}\n{count}\n") };
        [format!("{head}{extent}DATA {data}\n").as_bytes(), &body].concat()
    })
}

fn any_cloud() -> impl Strategy<Value = Cloud> {
    let coordinate = prop_oneof![-1.0..1.0f64, -1e7..1e7f64];
    let point = prop::array::uniform3(coordinate).prop_map(Point3::from);
    let rest = (prop::array::uniform3(any::<u8>()), -1e6..1e6f32);
    (prop::collection::vec((point, rest), 1..50), any::<[bool; 2]>()).prop_map(|(rows, [colors, intensities])| Cloud {
        points: rows.iter().map(|row| row.0).collect(),
        normals: None,
        colors: colors.then(|| rows.iter().map(|row| row.1.0).collect()),
        intensities: intensities.then(|| rows.iter().map(|row| row.1.1).collect()),
    })
}

fn any_motion() -> impl Strategy<Value = Motion> {
    (prop::array::uniform3(-1e4..1e4f64), prop::array::uniform3(-3.0..3.0f64))
        .prop_map(|(t, w)| Motion::new(Vector3::from(t), Vector3::from(w)))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 512, ..ProptestConfig::default() })]

    #[test]
    fn any_bytes_are_read_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        let limits = ReadLimits::default();
        let _ = obj::read(&bytes, &limits);
        let _ = stl::read(&bytes, &limits);
        let _ = stl::read(&[b"solid ", bytes.as_slice()].concat(), &limits);
        let _ = poses::read("poses", &bytes);
        let _ = ply::read(&bytes, &limits);
        let _ = ply::read(&[b"ply\n", bytes.as_slice()].concat(), &limits);
    }

    #[test]
    fn odd_plys_are_read_soundly_or_refused(file in odd_ply()) {
        if let Ok(surface) = read(&file) {
            let count = surface.cloud.len();
            prop_assert!(count > 0);
            prop_assert!(surface.cloud.points.iter().all(|p| p.iter().all(|x| x.is_finite())));
            prop_assert!(surface.faces.iter().flatten().all(|vertex| (*vertex as usize) < count));
            if let Some(grid) = surface.grid {
                prop_assert_eq!(grid.columns * grid.rows, grid.pixels.len());
                prop_assert!(grid.pixels.iter().all(|p| *p == RangeGrid::EMPTY || (*p as usize) < count));
            }
        }
    }

    #[test]
    fn odd_pcds_are_read_soundly_or_refused(file in odd_pcd()) {
        if let Ok(surface) = read_surface("scan.pcd", &file, &ReadLimits::default()) {
            prop_assert!(surface.cloud.points.iter().all(|p| p.coords.iter().all(|x| x.is_finite())));
            if let Some(grid) = surface.grid {
                prop_assert_eq!(grid.pixels.len(), grid.columns * grid.rows);
                prop_assert!(grid.pixels.iter().all(|p| *p == RangeGrid::EMPTY || (*p as usize) < surface.cloud.len()));
            }
        }
    }

    #[test]
    fn odd_objs_are_read_soundly_or_refused(text in "((v|vn|f|o|#|usemtl)( (-?[0-9]{1,2}|1//1|2/2/2|nan|1e400|\\pL)){0,7}\n){0,12}") {
        if let Ok(surface) = read_surface("model.obj", text.as_bytes(), &ReadLimits::default()) {
            let count = surface.cloud.len();
            prop_assert!(surface.faces.iter().flatten().all(|vertex| (*vertex as usize) < count));
            prop_assert!(surface.cloud.points.iter().all(|p| p.iter().all(|x| x.is_finite())));
        }
    }

    #[test]
    fn odd_stls_are_read_soundly_or_refused(
        text in "solid( (solid|facet|normal|outer|loop|vertex 0 [0-9] 1|vertex|endloop|endfacet|endsolid|nan|1e400|\\pL)|\n){0,40}",
        head in prop::collection::vec(any::<u8>(), 80),
        count in 0..4u32,
        body in prop::collection::vec(any::<u8>(), 0..200),
    ) {
        let binary = [head.as_slice(), &count.to_le_bytes(), &body].concat();
        for file in [text.as_bytes(), &binary] {
            if let Ok(surface) = read_surface("model.stl", file, &ReadLimits::default()) {
                let vertices = surface.cloud.len();
                prop_assert!(vertices > 0 && !surface.faces.is_empty());
                prop_assert!(surface.faces.iter().flatten().all(|vertex| (*vertex as usize) < vertices));
                prop_assert!(surface.cloud.points.iter().all(|p| p.iter().all(|x| x.is_finite())));
            }
        }
    }

    #[test]
    fn odd_pose_files_are_read_or_refused(text in "(bmesh|a|\\{|\\}|\\[|\\]|\"a\":|null|,|[01] |-1e3 |\n|#){0,60}") {
        if let Ok(file) = poses::read("poses", text.as_bytes()) {
            prop_assert!(!file.poses.is_empty() || !file.unplaced.is_empty());
        }
    }

    #[test]
    fn clouds_come_back(cloud in any_cloud()) {
        let back = read(&ply::write_cloud(&cloud, None)).expect("own files are read").cloud;
        let tolerance = 1e-7 * cloud.bounds().expect("points").diagonal();
        for (before, after) in cloud.points.iter().zip(&back.points) {
            prop_assert!((before - after).amax() <= tolerance);
        }
        prop_assert_eq!(back.colors, cloud.colors);
        prop_assert_eq!(back.intensities, cloud.intensities);
    }

    #[test]
    fn meshes_come_back(cloud in any_cloud(), faces in prop::collection::vec(prop::array::uniform3(any::<prop::sample::Index>()), 1..20)) {
        let faces = faces.iter().map(|face| face.map(|i| i.index(cloud.len()) as u32)).collect();
        let mesh = Mesh { vertices: cloud.points, faces };
        let back = read(&ply::write_mesh(&mesh)).expect("own files are read").mesh().expect("faces");
        prop_assert_eq!(&back.faces, &mesh.faces);
        // STL names corners by their place, as `f32`
        let back = stl::read(&stl::write_mesh(&mesh), &ReadLimits::default()).expect("own files are read").surface;
        prop_assert_eq!(back.faces.len(), mesh.faces.len());
        for (face, expected) in back.faces.iter().zip(&mesh.faces) {
            for (vertex, expected) in face.iter().zip(expected) {
                let rounded = mesh.vertices[*expected as usize].map(|x| f64::from(x as f32));
                prop_assert_eq!(back.cloud.points[*vertex as usize], rounded);
            }
        }
    }

    #[test]
    fn poses_come_back_in_every_format(motions in prop::collection::vec(any_motion(), 1..6)) {
        let named: Vec<_> = motions.iter().enumerate().map(|(i, m)| (format!("scan {i}.ply"), Some(*m))).collect();
        for text in [poses::write_json(&named), poses::write_conf(&named)] {
            let back = poses::read("poses", text.as_bytes()).expect("own files are read");
            prop_assert_eq!(back.poses.len(), motions.len());
            for ((name, pose), (expected_name, expected)) in back.poses.iter().zip(&named) {
                prop_assert_eq!(name, expected_name);
                let error = pose.to_homogeneous() - expected.expect("placed").to_homogeneous();
                prop_assert!(error.amax() < 1e-11);
            }
        }
        prop_assert_eq!(poses::write_json(&named), poses::write_json(&named));
    }
}
