use super::*;
use std::io::{Cursor, Write};

/// An array as NumPy saves it.
fn npy(descr: &str, order: &str, shape: &str, data: &[u8]) -> Vec<u8> {
    let mut header = format!("{{'descr': {descr}, 'fortran_order': {order}, 'shape': {shape}, }}");
    while (header.len() + 11) % 64 > 0 {
        header.push(' ');
    }
    header.push('\n');
    [b"\x93NUMPY\x01\x00", &(header.len() as u16).to_le_bytes()[..], header.as_bytes(), data].concat()
}

fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|x| x.to_le_bytes()).collect()
}

fn read_all(bytes: &[u8]) -> Result<Reading, FormatError> {
    read(bytes, &ReadLimits::default())
}

fn rows(reading: &Reading) -> Vec<[f64; 3]> {
    reading.surface.cloud.points.iter().map(|p| [p.x, p.y, p.z]).collect()
}

const TWO: [[f64; 3]; 2] = [[1.0, 2.0, 3.0], [4.0, 5.0, 6.5]];

#[test]
fn plain_arrays_of_every_order_and_type() {
    let values = [1.0, 2.0, 3.0, 4.0, 5.0, 6.5];
    let columns = [1.0, 4.0, 2.0, 5.0, 3.0, 6.5];
    let big: Vec<u8> = values.iter().flat_map(|x| f64::from(*x).to_be_bytes()).collect();
    for bytes in [
        npy("'<f4'", "False", "(2, 3)", &floats(&values)),
        npy("'<f4'", "True", "(2, 3)", &floats(&columns)),
        npy("'>f8'", "False", "(2, 3)", &big),
    ] {
        let reading = read_all(&bytes).expect("sound");
        assert_eq!((rows(&reading), reading.dropped.is_empty()), (TWO.to_vec(), true));
    }
    let whole = read_all(&npy("'|i1'", "False", "(1, 3)", &[255, 2, 3])).expect("whole numbers");
    assert_eq!(rows(&whole), [[-1.0, 2.0, 3.0]]);
    let image = read_all(&npy("'|u1'", "False", "(2, 1, 3)", &[1, 2, 3, 4, 5, 6])).expect("organised");
    assert_eq!(image.surface.grid, Some(RangeGrid { columns: 1, rows: 2, pixels: vec![0, 1] }));
}

#[test]
fn more_columns_are_taken_where_nothing_else_can_be_meant() {
    let row = |tail: &[f32]| {
        let one = [&[0.5, 1.0, 2.0], tail].concat();
        let bytes = npy("'<f4'", "False", &format!("(2, {})", one.len()), &floats(&one.repeat(2)));
        read_all(&bytes).expect("sound")
    };
    assert_eq!(row(&[200.0, 0.0, 17.0]).surface.cloud.colors, Some(vec![[200, 0, 17]; 2]));
    assert_eq!(row(&[0.6, 0.0, -0.8]).surface.cloud.normals.map(|n| n[0].z), Some(-0.8));
    let doubtful = row(&[0.5]);
    assert_eq!(doubtful.surface.cloud.intensities, None);
    assert!(doubtful.dropped.notes[0].starts_with("1 of 4 columns are not used"));
}

#[test]
fn structured_arrays_name_their_fields() {
    let descr =
        "[('name', '<U1'), ('x', '<f8'), ('y', '<f8'), ('z', '<f8'), ('rgb', '|u1', (3,)), ('intensity', '<f4')]";
    let row: Vec<u8> = [
        &b"a\0\0\0"[..],
        &[1.0f64, 2.0, 3.0].iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<_>>(),
        &[9, 8, 7],
        &0.5f32.to_le_bytes(),
    ]
    .concat();
    let reading = read_all(&npy(descr, "False", "(2,)", &row.repeat(2))).expect("sound");
    assert_eq!(rows(&reading), [[1.0, 2.0, 3.0]; 2]);
    assert_eq!(reading.surface.cloud.colors, Some(vec![[9, 8, 7]; 2]));
    assert_eq!(reading.surface.cloud.intensities, Some(vec![0.5; 2]));
}

fn npz(arrays: &[(&str, Vec<u8>)]) -> Vec<u8> {
    let mut writer = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in arrays {
        writer.start_file(*name, zip::write::SimpleFileOptions::default()).expect("in memory");
        writer.write_all(bytes).expect("in memory");
    }
    writer.finish().expect("in memory").into_inner()
}

#[test]
fn several_arrays_make_one_surface() {
    let points = npy("'<f4'", "False", "(3, 3)", &floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]));
    let colors = npy("'<f4'", "False", "(3, 3)", &floats(&[0.5; 9]));
    let normals = npy("'<f4'", "False", "(3, 3)", &floats(&[0.0, 0.0, 1.0].repeat(3)));
    let faces = npy("'<i4'", "False", "(2, 3)", &[0, 1, 2, 0, 1, 9].map(i32::to_le_bytes).concat());
    let arrays = [
        ("points.npy", points.clone()),
        ("colors.npy", colors.clone()),
        ("Normals.npy", normals),
        ("faces.npy", faces),
    ];
    let reading = read_npz(&npz(&arrays), &ReadLimits::default()).expect("sound");
    assert_eq!(reading.surface.cloud.colors, Some(vec![[128; 3]; 3]));
    assert_eq!(reading.surface.cloud.normals, Some(vec![nalgebra::Vector3::z(); 3]));
    assert_eq!((reading.surface.faces.clone(), reading.dropped.faces), (vec![[0, 1, 2]], 1));
    let intensities = npy("'<f4'", "False", "(3,)", &floats(&[0.5, 1.0, 2.0]));
    let with = read_npz(&npz(&[("xyz.npy", points.clone()), ("intensity.npy", intensities)]), &ReadLimits::default());
    assert_eq!(with.expect("sound").surface.cloud.intensities, Some(vec![0.5, 1.0, 2.0]));
    let number = npy("'<f4'", "False", "()", &floats(&[0.5]));
    assert!(read_npz(&npz(&[("xyz.npy", points.clone()), ("rgb.npy", number)]), &ReadLimits::default()).is_err());
    let one = read_npz(&npz(&[("arr_0.npy", points.clone())]), &ReadLimits::default()).expect("the only one");
    assert_eq!(one.surface.cloud.len(), 3);
    let refused =
        |arrays: &[(&str, Vec<u8>)]| read_npz(&npz(arrays), &ReadLimits::default()).expect_err("refused").to_string();
    let error = refused(&[("a.npy", points.clone()), ("b.npy", points.clone())]);
    assert!(error.starts_with("the list of arrays: none of its arrays is named points: \"a.npy, b.npy\""), "{error}");
    let short = npy("'<f4'", "False", "(2, 3)", &floats(&[0.5; 6]));
    let error = refused(&[("points.npy", points), ("colors.npy", short)]);
    assert!(error.starts_with("the list of arrays: colors is [2, 3], the points are [3, 3]"), "{error}");
}

#[test]
fn what_is_wrong_is_said_and_nothing_panics() {
    let cases = [
        (b"PK".to_vec(), "byte 0: an array of NumPy begins with"),
        (npy("'<f4'", "False", "(3,)", &floats(&[0.0; 3])), "header: its shape is [3], not points x 3"),
        (npy("'<f4'", "False", "(3, 2)", &floats(&[0.0; 6])), "header: its shape is [3, 2], not points x 3"),
        (npy("'<f4'", "False", "(9, 3)", &floats(&[0.0; 6])), "the file is cut short: it declares an array of [9, 3]"),
        (npy("'<f4'", "False", "(99999999999, 99999999999)", &[]), "the file is cut short"),
        (npy("'|O'", "False", "(1, 3)", &[0; 24]), "header: its type can't be read: "),
        (npy("[('a', '<f4')]", "False", "(1,)", &[0; 4]), "header: the points have no x, y and z"),
        (npy("'<f4'", "False", "(0, 3)", &[]), "the whole file: there are no points"),
    ];
    for (bytes, start) in cases {
        let error = read_all(&bytes).expect_err(start).to_string();
        assert!(error.starts_with(start), "{error}");
    }
    let whole = npy("'<f4'", "False", "(2, 3)", &floats(&[0.5; 6]));
    for place in 0..whole.len() {
        assert!(read_all(&whole[..place]).is_err(), "{place}");
        for change in [1, 0x10, 0x80] {
            let mut changed = whole.clone();
            changed[place] ^= change;
            let _ = read_all(&changed);
        }
    }
}
