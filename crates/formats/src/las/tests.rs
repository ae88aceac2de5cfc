use std::io::Cursor;

use super::*;
use crate::DeclaredUnit;
use ::laz::{LasZipCompressor, LazVlr, LazVlrBuilder};
use visage_geometry::{Cloud, Point3};

fn all(bytes: &[u8]) -> Result<Reading, FormatError> {
    read(bytes, &ReadLimits::default())
}

fn message(bytes: &[u8]) -> String {
    all(bytes).expect_err("refused").to_string()
}

fn some_cloud(count: usize) -> Cloud {
    let place = |k: f64| Point3::new(500_000.123 + 0.001 * k, 4_500_000.456 - 0.37 * k, (0.1 * k).sin());
    let milli = |p: Point3| Point3::from(p.coords.map(|x| (x * 1000.0).round() / 1000.0));
    Cloud {
        colors: Some((0..count).map(|k| [k as u8, 7, 255]).collect()),
        intensities: Some((0..count).map(|k| (k % 60_000) as f32).collect()),
        ..Cloud::from_points((0..count).map(|k| milli(place(k as f64))).collect())
    }
}

/// Records of a point format with so many further bytes; the values are those of their index.
fn records(format: u8, more: usize, count: usize) -> (usize, Vec<u8>) {
    let known = [20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67][usize::from(format)];
    let color = [99, 99, 20, 28, 99, 28, 99, 30, 30, 99, 30][usize::from(format)];
    let mut bytes = Vec::new();
    for k in 0..count {
        let mut record = vec![0; known + more];
        for axis in 0..3 {
            record[4 * axis..4 * axis + 4].copy_from_slice(&(k as i32 * (1000 + axis as i32) - 77).to_le_bytes());
        }
        record[12..14].copy_from_slice(&(k as u16 * 3).to_le_bytes());
        record[14] = if format < 6 { 0b0000_1001 } else { 0b0001_0001 };
        if color < 99 {
            record[color..color + 6].copy_from_slice(&[0, k as u8, 0, 9, 0, 255]);
        }
        record[known..].fill(k as u8);
        bytes.extend(record);
    }
    (known + more, bytes)
}

/// A file of records, with a further record before them.
fn file(format: u8, record: usize, count: usize, body: &[u8], further: &[u8], is_packed: bool) -> Vec<u8> {
    let mut bytes = vec![0; 375];
    bytes[..4].copy_from_slice(b"LASF");
    bytes[24..26].copy_from_slice(&[1, 4]);
    bytes[94..96].copy_from_slice(&375u16.to_le_bytes());
    bytes[96..100].copy_from_slice(&((375 + further.len()) as u32).to_le_bytes());
    bytes[100..104].copy_from_slice(&u32::from(!further.is_empty()).to_le_bytes());
    bytes[104] = format | if is_packed { 0x80 } else { 0 };
    bytes[105..107].copy_from_slice(&(record as u16).to_le_bytes());
    for axis in 0..3 {
        bytes[131 + 8 * axis..][..8].copy_from_slice(&0.001f64.to_le_bytes());
        bytes[155 + 8 * axis..][..8].copy_from_slice(&4_500_000.0f64.to_le_bytes());
    }
    bytes[247..255].copy_from_slice(&(count as u64).to_le_bytes());
    [&bytes, further, body].concat()
}

fn further(user: &str, id: u16, data: &[u8]) -> Vec<u8> {
    let mut head = vec![0; 54];
    head[2..2 + user.len()].copy_from_slice(user.as_bytes());
    head[18..20].copy_from_slice(&id.to_le_bytes());
    head[20..22].copy_from_slice(&(data.len() as u16).to_le_bytes());
    [&head, data].concat()
}

/// The same records compressed.
fn packed(format: u8, more: usize, count: usize, chunk: u32) -> Vec<u8> {
    let (record, body) = records(format, more, count);
    let builder = LazVlrBuilder::default().with_point_format(format, more as u16).expect("a known format");
    let vlr: LazVlr = builder.with_fixed_chunk_size(chunk).build();
    let mut data = Vec::new();
    vlr.write_to(&mut data).expect("to memory");
    let further = further("laszip encoded", 22204, &data);
    // the table's place counts from the begin of the file
    let head = file(format, record, count, &[], &further, true);
    let mut whole = Cursor::new(head.clone());
    whole.set_position(head.len() as u64);
    let mut compressor = LasZipCompressor::new(&mut whole, vlr).expect("known items");
    compressor.compress_many(&body).expect("to memory");
    compressor.done().expect("to memory");
    drop(compressor);
    whole.into_inner()
}

#[test]
fn what_is_written_comes_back_to_the_millimetre_and_better() {
    let cloud = some_cloud(100);
    let bytes = write_cloud(&cloud);
    let reading = all(&bytes).expect("sound");
    assert_eq!(reading.surface.cloud.colors, cloud.colors);
    assert_eq!(reading.surface.cloud.intensities, cloud.intensities);
    for (read, written) in reading.surface.cloud.points.iter().zip(&cloud.points) {
        assert!((read - written).amax() < 1e-6, "{read} is not {written}");
    }
    assert!(reading.dropped.is_empty() && reading.unit.is_none());
    for size in [1e-6, 0.001, 1.0, 1e3, 3e5, 1e9] {
        let points = vec![Point3::new(0.3, 0.0, 0.0), Point3::new(0.3 + size, size, size / 3.0)];
        let read = all(&write_cloud(&Cloud::from_points(points.clone()))).expect("sound").surface.cloud;
        let error = read.points.iter().zip(&points).map(|(a, b)| (a - b).amax()).fold(0.0, f64::max);
        assert!(error <= (size * 1e-7).max(1e-7), "{size}: {error}");
        assert_eq!((read.colors, read.intensities), (None, None));
    }
    let mut cloud = some_cloud(3);
    cloud.intensities = Some(vec![0.25, 0.5, 1.0]);
    let read = all(&write_cloud(&cloud)).expect("sound").surface.cloud.intensities;
    assert_eq!(read, Some(vec![16384.0, 32768.0, 65535.0]));
}

#[test]
fn every_point_format_is_read_packed_or_not() {
    for format in 0..=10 {
        for more in [0, 3] {
            let (record, body) = records(format, more, 700);
            let plain = all(&file(format, record, 700, &body, &[], false)).expect("sound");
            let cloud = &plain.surface.cloud;
            assert_eq!(cloud.points[2], Point3::new(4_500_001.923, 4_500_001.925, 4_500_001.927), "format {format}");
            let has_color = [2, 3, 5, 7, 8, 10].contains(&format);
            assert_eq!(cloud.colors.as_ref().map(|colors| colors[5]), has_color.then_some([5, 9, 255]));
            assert_eq!(cloud.intensities.as_ref().map(|values| values[5]), Some(15.0));
            for chunk in [50_000, 100] {
                let read = all(&packed(format, more, 700, chunk));
                assert_eq!(read.as_ref(), Ok(&plain), "format {format}, {more} more bytes, chunks of {chunk}");
            }
        }
    }
}

#[test]
fn units_are_said_and_degrees_refused() {
    let text = further("LASF_Projection", 2112, b"PROJCS[\"x\",UNIT[\"US survey foot\",0.3048006096012192]]\0");
    let (record, body) = records(0, 0, 3);
    let unit = all(&file(0, record, 3, &body, &text, false)).expect("sound").unit;
    assert_eq!(unit, Some(DeclaredUnit { metres: 0.3048006096012192 }));
    let text = further("LASF_Projection", 2112, b"GEOGCS[\"WGS 84\",UNIT[\"degree\",0.0174532925199433]]\0");
    assert!(message(&file(0, record, 3, &body, &text, false)).contains("coordinates are longitudes and latitudes"));
}

#[test]
fn withheld_points_are_left_out() {
    let (record, mut body) = records(0, 0, 3);
    body[record + 15] |= 0x80;
    let reading = all(&file(0, record, 3, &body, &[], false)).expect("sound");
    assert_eq!((reading.surface.cloud.len(), reading.surface.cloud.intensities), (2, Some(vec![0.0, 6.0])));
    assert_eq!(reading.dropped.notes, ["1 points that the file withholds"]);
}

#[test]
fn what_is_wrong_is_named() {
    let (record, body) = records(2, 0, 5);
    let whole = file(2, record, 5, &body, &[], false);
    let changed = |at: usize, to: &[u8]| {
        let mut bytes = whole.clone();
        bytes[at..at + to.len()].copy_from_slice(to);
        bytes
    };
    let cases = [
        (b"LASX".to_vec(), "byte 0: a LAS file begins with LASF, this one with \"LASX\""),
        (changed(104, &[11]), "byte 104: there is no point format 11"),
        (changed(105, &[25]), "byte 105: a record of point format 2 has 26 bytes, not 25"),
        (changed(131, &[0; 8]), "is no scale"),
        (changed(155, &f64::NAN.to_le_bytes()), "is no offset"),
        (changed(247, &[6]), "it declares 6 points of 26 bytes but ends within the 130 bytes after its header"),
        (changed(104, &[0x82]), "there is no record that says how it is compressed"),
    ];
    for (bytes, expected) in cases {
        assert!(message(&bytes).contains(expected), "{}", message(&bytes));
    }
}

#[test]
fn limits_hold_for_what_is_packed() {
    let bytes = packed(2, 0, 700, 100);
    let limited = |max_points, max_bytes| read(&bytes, &ReadLimits { max_points, max_bytes, ..ReadLimits::default() });
    assert_eq!(limited(699, 1 << 20), Err(FormatError::TooLarge { what: "points", found: 700, limit: 699 }));
    assert!(matches!(limited(700, 18_199), Err(FormatError::TooManyBytes { found: 18_200, .. })));
    assert!(limited(700, 18_200).is_ok());
    let mut many = bytes.clone();
    let table =
        u64::from_le_bytes(many[96..100].iter().chain(&[0; 4]).copied().collect::<Vec<u8>>().try_into().expect("8"));
    let start = table as usize;
    let place = u64::from_le_bytes(many[start..start + 8].try_into().expect("8")) as usize;
    many[place + 4..place + 8].copy_from_slice(&u32::MAX.to_le_bytes());
    assert!(message(&many).contains("4294967295 chunks for 700 points"), "{}", message(&many));
}

#[test]
fn a_file_cut_anywhere_is_an_error_and_changed_bytes_never_panic() {
    let limits = ReadLimits { max_points: 2000, max_faces: 0, max_bytes: 1 << 20 };
    let (record, body) = records(3, 0, 20);
    let plain = file(3, record, 20, &body, &[], false);
    for whole in [plain, packed(3, 0, 40, 10), packed(7, 2, 40, 10)] {
        assert!(read(&whole, &limits).is_ok());
        for length in 0..whole.len() {
            assert!(read(&whole[..length], &limits).is_err(), "{length}");
        }
        let mut state = 7u64;
        let mut next = |below: usize| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as usize % below
        };
        for _ in 0..400 {
            let mut changed = whole.clone();
            let from = if next(2) == 0 { 90 } else { 375 };
            for _ in 0..1 + next(2) {
                let place = from + next(changed.len() - from);
                changed[place] = [next(256) as u8, 0, 255][next(3)];
            }
            let _ = read(&changed, &limits);
        }
    }
}
