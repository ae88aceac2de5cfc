use super::*;
use visage_geometry::Point3;

const SQUARE: &str =
    "OFF\n# a square and a line\n4 3 0\n0 0 0\n1 0 0 # a corner\n1 1 0\n\n0 1 0.5\n4 0 1 2 3 255 0 0\n3 0 1 2\n2 0 1\n";

fn read_text(text: &str) -> Result<Reading, FormatError> {
    read(text.as_bytes(), &ReadLimits::default())
}

#[test]
fn normals_stand_before_or_behind_colours() {
    let row = |row: &str, letters: &str| format!("{letters}OFF\n2 0 0\n0 0 0 {row}\n1 1 1 {row}\n");
    // MeshLab's, Geomview's, and letters that say otherwise than the values
    for (letters, values) in [
        ("NC", "250 36 0 255 0 0.6 0.8"),
        ("NC", "250 36 0 0 0.6 0.8"),
        ("CN", "0 0.6 0.8 250 36 0 255"),
        ("CN", "0 0.6 0.8 250 36 0"),
        ("NC", "0 0.6 0.8 250 36 0 255"),
        ("STNC", "250 36 0 255 0 0.6 0.8 0.5 0.5"),
    ] {
        let cloud = read(row(values, letters).as_bytes(), &ReadLimits::default()).expect(values).surface.cloud;
        assert_eq!(cloud.colors, Some(vec![[250, 36, 0]; 2]), "{letters} {values}");
        assert_eq!(cloud.normals.map(|normals| normals[1].z), Some(0.8), "{letters} {values}");
    }
}

#[test]
fn polygons_become_fans_wherever_the_counts_stand() {
    let square = read_text(SQUARE).expect("sound");
    assert_eq!(square.surface.cloud.len(), 4);
    assert_eq!(square.surface.faces, [[0, 1, 2], [0, 2, 3], [0, 1, 2]]);
    assert!(square.dropped.is_empty(), "{}", square.dropped);
    for head in ["OFF 4 3 0\n", "OFF4 3 0\n", "OFF 4 3\n", "#\nOFF\n\n4 3 0 # counts\n"] {
        let text = SQUARE.replace("OFF\n# a square and a line\n4 3 0\n", head);
        assert_eq!(read_text(&text).as_ref(), Ok(&square), "{head}");
        assert_eq!(read_text(&text.replace('\n', "\r\n")).as_ref(), Ok(&square), "{head}");
    }
}

#[test]
fn letters_say_what_vertices_have() {
    let one = |head: &str, row: &str| read_text(&format!("{head}\n1 0 0\n{row}\n")).expect(head).surface.cloud;
    assert_eq!(one("COFF", "0 0 0 255 0 9 255").colors, Some(vec![[255, 0, 9]]));
    assert_eq!(one("COFF", "0 0 0 1 0 9").colors, Some(vec![[1, 0, 9]]));
    assert_eq!(one("COFF", "0 0 0 1.0 0.5 0.0 1.0").colors, Some(vec![[255, 128, 0]]));
    assert_eq!(one("NOFF", "0 0 0 0 2 0").normals, Some(vec![nalgebra::Vector3::y()]));
    for head in ["STCNOFF", "NCSTOFF"] {
        let all = one(head, "0 0 0 0 2 0 7 8 9 255 0.5 0.5");
        assert_eq!((all.normals, all.colors), (Some(vec![nalgebra::Vector3::y()]), Some(vec![[7, 8, 9]])));
    }
    let more = read_text("OFF\n1 0 0\n0 0 0 1 2 3\n").expect("more values");
    assert_eq!(more.dropped.notes, ["more values of the vertices than OFF has are not used"]);
}

#[test]
fn what_is_wrong_is_named_by_line() {
    let cases = [
        ("", "line 0: an OFF file begins with OFF, COFF, NOFF or the like; this one is empty; send"),
        ("solid\n", "line 1: an OFF file begins with OFF, COFF, NOFF or the like; this one begins with \"solid\""),
        ("CCOFF\n1 0 0\n", "line 1: an OFF file begins with OFF"),
        ("OFF BINARY\n", "line 1: binary OFF files are not read; export it as text"),
        ("4OFF\n1 0 0\n0 0 0 1\n", "line 1: 4OFF has points of another dimension than 3"),
        ("OFF\none\n", "line 2: the numbers of vertices and faces are expected, but here is \"one\""),
        ("OFF\n0 0 0\n", "the whole file: there are no vertices"),
        ("OFF\n2 0 0\n0 0 0\n", "the file is cut short: it declares 2 vertices and 0 faces"),
        ("OFF\n9999999999999 0 0\n0 0 0\n", "the file is cut short: it declares 9999999999999 vertices"),
        ("NOFF\n1 0 0\n0 0 0\n", "line 3: a vertex of NOFF has 6 numbers, not 3"),
        ("OFF\n1 0 0\n0 zero 0\n", "line 3: \"zero\" is no number"),
        ("OFF\n1 0 0\n0 1e20 0\n", "line 3: y is 1e20, which is too large"),
        ("OFF\n1 1 0\n0 0 0\n3 0 0\n", "line 4: a face of 3 corners has 2"),
        ("OFF\n1 1 0\n0 0 0\n3 0 0 x\n", "line 4: \"x\" is no index of a vertex"),
    ];
    for (text, start) in cases {
        let error = read_text(text).expect_err(text).to_string();
        assert!(error.starts_with(start), "{error}");
    }
    let limits = ReadLimits { max_faces: 1, ..ReadLimits::default() };
    let many = "OFF\n4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n";
    assert_eq!(read(many.as_bytes(), &limits), Err(FormatError::TooLarge { what: "faces", found: 2, limit: 1 }));
}

#[test]
fn what_is_not_sound_costs_itself() {
    let text = SQUARE.replace("3 0 1 2\n", "3 0 1 -9\n3 0 1 4\n").replace("4 3 0", "4 4 0");
    let reading = read_text(&text).expect("faces without vertices");
    assert_eq!((reading.surface.faces.len(), reading.dropped.faces), (2, 2));
    let reading = read_text(&SQUARE.replace("0 1 0.5", "0 nan 0")).expect("a vertex");
    assert_eq!((reading.surface.cloud.len(), reading.surface.faces.len(), reading.dropped.no_return), (3, 2, 1));
    let more = read_text(&(SQUARE.to_owned() + "1 2 3\n")).expect("more lines").dropped.notes;
    assert_eq!(more, ["what follows the last face is not read (line 12)"]);
}

#[test]
fn what_is_written_comes_back() {
    let cloud = Cloud {
        points: vec![Point3::new(1.0 / 3.0, 4.5e6 + 0.001, -1e-9), Point3::origin()],
        normals: Some(vec![nalgebra::Vector3::x(), nalgebra::Vector3::new(0.6, 0.0, 0.8)]),
        colors: Some(vec![[1, 0, 1], [0, 1, 0]]),
        intensities: None,
    };
    let bytes = write_cloud(&cloud);
    assert!(bytes.starts_with(b"CNOFF\n2 0 0\n"));
    assert_eq!(read(&bytes, &ReadLimits::default()).expect("own files").surface.cloud, cloud);
}
