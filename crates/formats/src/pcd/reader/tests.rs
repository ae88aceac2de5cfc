use super::*;
use visage_geometry::Surface;

/// A file of 2 x 2 pixels, one of which saw nothing, in one of the three encodings.
fn organised(data: &str, body: &[u8]) -> Vec<u8> {
    let mut file = format!(
        "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z rgb label normal_x normal_y normal_z intensity\n\
         SIZE 4 8 4 4 2 4 4 4 4\nTYPE F F F U I F F F F\nCOUNT 1 1 1 1 2 1 1 1 1\nWIDTH 2\nHEIGHT 2\n\
         VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 4\nDATA {data}\n"
    )
    .into_bytes();
    file.extend_from_slice(body);
    file
}

/// The fields of each point, as bytes.
fn rows() -> Vec<Vec<Vec<u8>>> {
    let point = |x: f32, red: u8| -> Vec<Vec<u8>> {
        vec![
            x.to_le_bytes().to_vec(),
            2.5f64.to_le_bytes().to_vec(),
            (-3.0f32).to_le_bytes().to_vec(),
            vec![7, 8, red, 0],
            vec![1, 2, 3, 4],
            0f32.to_le_bytes().to_vec(),
            0f32.to_le_bytes().to_vec(),
            4f32.to_le_bytes().to_vec(),
            0.5f32.to_le_bytes().to_vec(),
        ]
    };
    vec![point(1.0, 10), point(f32::NAN, 0), point(3.0, 30), point(4.0, 40)]
}

fn binary() -> Vec<u8> {
    organised("binary", &rows().concat().concat())
}

/// Literal runs alone are sound LZF.
fn packed(bytes: &[u8]) -> Vec<u8> {
    bytes.chunks(32).flat_map(|run| [&[run.len() as u8 - 1], run].concat()).collect()
}

fn compressed() -> Vec<u8> {
    let fields = (0..9).flat_map(|field| rows().into_iter().flat_map(move |row| row[field].clone()));
    let plain: Vec<u8> = fields.collect();
    let packed = packed(&plain);
    let sizes = [(packed.len() as u32).to_le_bytes(), (plain.len() as u32).to_le_bytes()].concat();
    organised("binary_compressed", &[sizes, packed].concat())
}

fn ascii() -> Vec<u8> {
    let line = |x: &str, red: u32| format!("{x} 2.5 -3 {} 1 2 0 0 4 0.5\n", (red << 16) + (8 << 8) + 7);
    let body = [line("1", 10), line("nan", 0), line("3", 30), line("4", 40)].concat();
    organised("ascii", body.as_bytes())
}

fn read_all(bytes: &[u8]) -> Result<Surface, FormatError> {
    read(bytes, &ReadLimits::default()).map(|reading| reading.surface)
}

#[test]
fn the_three_encodings_hold_the_same() {
    for file in [ascii(), binary(), compressed()] {
        let surface = read_all(&file).expect("sound");
        let xs: Vec<f64> = surface.cloud.points.iter().map(|p| p.x).collect();
        assert_eq!(xs, [1.0, 3.0, 4.0]);
        assert_eq!(surface.cloud.points[1], Point3::new(3.0, 2.5, -3.0));
        assert_eq!(surface.cloud.colors.expect("rgb")[2], [40, 8, 7]);
        assert_eq!(surface.cloud.normals.expect("normals")[0], nalgebra::Vector3::z());
        assert_eq!(surface.cloud.intensities.expect("intensity"), [0.5; 3]);
        let pixels = vec![0, RangeGrid::EMPTY, 1, 2];
        assert_eq!(surface.grid, Some(RangeGrid { columns: 2, rows: 2, pixels }));
        assert_eq!(surface.sensor, Some(Point3::origin()), "an organised scan is seen from its viewpoint");
    }
}

#[test]
fn a_cloud_of_one_row_has_no_grid_and_no_sensor_at_the_origin() {
    let text = |viewpoint: &str| {
        format!(
            "VERSION .5\nCOLUMNS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F F\nWIDTH 1\nHEIGHT 1\nVIEWPOINT {viewpoint} 1 0 0 0\n\
             DATA ascii\n1 2 3 4.2108e+06\n"
        )
    };
    let cloud = read_all(text("0 0 0").as_bytes()).expect("sound");
    assert_eq!((cloud.grid, cloud.sensor), (None, None));
    let bits = 4.2108e6f32.to_bits().to_be_bytes();
    assert_eq!(cloud.cloud.colors, Some(vec![[bits[1], bits[2], bits[3]]]));
    assert_eq!(read_all(text("1 0 2").as_bytes()).expect("sound").sensor, Some(Point3::new(1.0, 0.0, 2.0)));
}

#[test]
fn cut_files_are_refused_wherever_they_end() {
    for file in [ascii(), binary(), compressed()] {
        for end in 0..file.len() - 1 {
            // the last digits of a text may be missing unseen
            let is_shorter_number = file == ascii() && end > file.len() - 4;
            assert!(read_all(&file[..end]).is_err() || is_shorter_number, "cut at {end} of {}", file.len());
        }
    }
}

#[test]
fn what_is_declared_is_held_against_the_bytes_before_anything_is_made() {
    let huge = |data: &str| {
        let text = format!("FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 4000000\nHEIGHT 4\nDATA {data}\n");
        read_all(&[text.as_bytes(), &[0; 64]].concat()).expect_err("64 bytes only")
    };
    for data in ["ascii", "binary"] {
        assert!(matches!(huge(data), FormatError::Truncated { .. }), "{data}");
    }
    assert!(huge("binary_compressed").to_string().contains("don't make 16000000 points"));
    let limits = ReadLimits { max_points: 3, ..ReadLimits::default() };
    assert_eq!(read(&binary(), &limits), Err(FormatError::TooLarge { what: "points", found: 4, limit: 3 }));
}

#[test]
fn bad_values_are_named_by_point() {
    let message = |text: String| read_all(text.as_bytes()).expect_err("bad").to_string();
    let file = |body: &str| format!("FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 2\nHEIGHT 1\nDATA ascii\n{body}");
    assert!(message(file("1 2 3\n1 1e20 2\n")).starts_with("point 1 (line 8): y is 1e20, which is too large"));
    assert!(message(file("1 2 3\n1 2 x\n")).starts_with("point 1 (line 8): \"x\" is no number"));
    assert!(message(file("1 2 3\n1 22\n")).starts_with("point 1 (line 8): the line has fewer numbers"));
    assert!(
        message(file("nan 2 3\nnan 1 2\n"))
            .starts_with("the whole file: there are no points: no coordinates are finite")
    );
    assert!(message(file("").replace("x y z", "x y w")).contains("the points have no x, y and z"));
}

#[test]
fn whole_numbers_of_every_size_are_read() {
    assert_eq!(number(&[0xff], NumberType::Signed), -1.0);
    assert_eq!(number(&[0xff], NumberType::Unsigned), 255.0);
    assert_eq!(number(&[0xfe, 0xff], NumberType::Signed), -2.0);
    assert_eq!(number(&(-5i64).to_le_bytes(), NumberType::Signed), -5.0);
    assert_eq!(number(&7u32.to_le_bytes(), NumberType::Unsigned), 7.0);
    assert!(number(&[1, 2], NumberType::Float).is_nan());
}
