use super::*;
use ::e57::{E57Writer, Record, RecordDataType, RecordName, RecordValue};
use visage_geometry::{Cloud, Motion, Point3, RangeGrid, Vector3};

fn all(bytes: &[u8]) -> Result<Vec<ScanReading>, FormatError> {
    read(bytes, &ReadLimits::default())
}

fn message(bytes: &[u8]) -> String {
    all(bytes).expect_err("refused").to_string()
}

/// A file of one scan with these fields and rows.
fn file(fields: Vec<(RecordName, RecordDataType)>, rows: Vec<Vec<RecordValue>>) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    let mut writer = E57Writer::new(&mut bytes, "file").expect("to memory");
    let prototype = fields.into_iter().map(|(name, data_type)| Record { name, data_type }).collect();
    let mut cloud = writer.add_pointcloud("scan", prototype).expect("a sound prototype");
    rows.into_iter().for_each(|row| cloud.add_point(row).expect("a sound row"));
    cloud.finalize().expect("to memory");
    writer.finalize().expect("to memory");
    drop(writer);
    bytes.into_inner()
}

/// The same file with other words of the same length in its description, and right checksums.
fn replaced(bytes: &[u8], from: &str, to: &str) -> Vec<u8> {
    assert_eq!(from.len(), to.len());
    let mut content: Vec<u8> = bytes.chunks(1024).flat_map(|page| page[..1020].to_vec()).collect();
    let at = memchr::memmem::find(&content, from.as_bytes()).expect("it is there");
    content[at..at + to.len()].copy_from_slice(to.as_bytes());
    paged(&content)
}

/// Content as pages with right checksums.
fn paged(content: &[u8]) -> Vec<u8> {
    let pages = content.chunks(1020).map(|page| {
        let mut page = page.to_vec();
        page.resize(1020, 0);
        let sum = crc32c::crc32c(&page).to_be_bytes();
        [page, sum.to_vec()].concat()
    });
    pages.flatten().collect()
}

const DOUBLE: RecordDataType = RecordDataType::Double { min: None, max: None };

fn xyz(kind: &RecordDataType) -> Vec<(RecordName, RecordDataType)> {
    [RecordName::CartesianX, RecordName::CartesianY, RecordName::CartesianZ].map(|name| (name, kind.clone())).into()
}

fn some_cloud(count: usize) -> Cloud {
    let place = |k: f64| Point3::new(500_000.0 + 0.001 * k, 4_500_000.0 - 0.37 * k, 0.1 * k);
    Cloud {
        normals: Some(vec![nalgebra::Vector3::y(); count]),
        colors: Some((0..count).map(|k| [k as u8, 7, 255]).collect()),
        intensities: Some((0..count).map(|k| k as f32 / 8.0).collect()),
        ..Cloud::from_points((0..count).map(|k| place(k as f64)).collect())
    }
}

#[test]
fn scans_come_back_with_their_poses_and_grids() {
    let (first, second) = (some_cloud(6000), some_cloud(4));
    let motion = Motion::new(Vector3::new(500_000.0, 4_500_000.0, 7.0), Vector3::new(0.1, -0.2, 3.0));
    let grid = RangeGrid { columns: 3, rows: 2, pixels: vec![0, RangeGrid::EMPTY, 1, 2, RangeGrid::EMPTY, 3] };
    let written = [
        WrittenScan { name: "hall ]]> <a>", cloud: &first, grid: None, world_from_scan: None },
        WrittenScan { name: "", cloud: &second, grid: Some(&grid), world_from_scan: Some(&motion) },
    ];
    let bytes = write_scans(&written);
    assert_eq!(bytes, write_scans(&written), "the same scans give the same bytes");
    let scans = all(&bytes).expect("sound");
    assert_eq!(scans.len(), 2);
    assert_eq!(scans[0].reading.surface.cloud, first, "coordinates are exact");
    assert_eq!((scans[0].name.as_deref(), scans[0].world_from_scan), (Some("hall ]] > <a>"), None));
    assert_eq!(scans[1].reading.surface.cloud, second);
    assert_eq!((&scans[1].name, &scans[1].reading.surface.grid), (&None, &Some(grid)));
    assert_eq!(scans[1].reading.surface.sensor, Some(Point3::origin()));
    let read = scans[1].world_from_scan.expect("a pose");
    assert!((read.to_homogeneous() - motion.to_homogeneous()).norm() < 1e-12);
    assert!(scans.iter().all(|scan| scan.reading.unit == Some(DeclaredUnit::METRE) && scan.reading.dropped.is_empty()));
    let united = crate::read("a.e57", &bytes, &ReadLimits::default()).expect("sound").surface.cloud;
    assert_eq!(united.points[6001], motion * second.points[1]);
}

#[test]
fn spherical_coordinates_and_invalid_states_are_understood() {
    let state = RecordDataType::Integer { min: 0, max: 2 };
    let fields = vec![
        (RecordName::SphericalRange, DOUBLE),
        (RecordName::SphericalAzimuth, DOUBLE),
        (RecordName::SphericalElevation, DOUBLE),
        (RecordName::SphericalInvalidState, state),
    ];
    let row = |range: f64, azimuth: f64, elevation: f64, state: i64| {
        let mut row: Vec<RecordValue> = [range, azimuth, elevation].map(RecordValue::Double).into();
        row.push(RecordValue::Integer(state));
        row
    };
    let half = std::f64::consts::FRAC_PI_2;
    let rows = vec![row(2.0, half, 0.0, 0), row(1.0, 0.0, 0.0, 1), row(3.0, 0.0, half, 0), row(1.0, 0.0, 0.0, 2)];
    let scan = all(&file(fields, rows)).expect("sound").remove(0).reading;
    let expected = [Point3::new(0.0, 2.0, 0.0), Point3::new(0.0, 0.0, 3.0)];
    for (point, expected) in scan.surface.cloud.points.iter().zip(expected) {
        assert!((point - expected).norm() < 1e-12, "{point}");
    }
    assert_eq!((scan.surface.cloud.len(), scan.dropped.no_return), (2, 2));
    assert_eq!(scan.surface.sensor, Some(Point3::origin()), "angles are seen from the scanner");
}

#[test]
fn whole_numbers_of_any_width_are_exact() {
    for (min, max) in [(-5, 2000), (0, 1), (i64::MIN / 65536, i64::MAX / 65536), (-1_000_000_007, 12), (3, 3)] {
        let scale = 0.001;
        let scaled = RecordDataType::ScaledInteger { min, max, scale, offset: 2.0 };
        let mut fields = xyz(&DOUBLE);
        fields[1].1 = scaled;
        fields.push((RecordName::RowIndex, RecordDataType::Integer { min: 0, max: 6 }));
        let number = |k: i64| min + (k * 7919).rem_euclid((max - min).max(1));
        let rows = (0..5000).map(|k| {
            let x = RecordValue::Double(k as f64);
            vec![x.clone(), RecordValue::ScaledInteger(number(k)), x, RecordValue::Integer(k % 7)]
        });
        let points = all(&file(fields, rows.collect())).expect("sound").remove(0).reading.surface.cloud.points;
        assert_eq!(points.len(), 5000);
        for (k, point) in points.iter().enumerate() {
            assert_eq!((point.x, point.y), (k as f64, number(k as i64) as f64 * scale + 2.0), "{min} to {max}");
        }
    }
}

#[test]
fn colours_are_scaled_by_their_limits_and_may_be_invalid() {
    let colors = |kind: RecordDataType, value: fn(i64) -> RecordValue, numbers: [i64; 3]| {
        let mut fields = xyz(&DOUBLE);
        let names = [RecordName::ColorRed, RecordName::ColorGreen, RecordName::ColorBlue];
        fields.extend(names.map(|name| (name, kind.clone())));
        fields.push((RecordName::IsColorInvalid, RecordDataType::Integer { min: 0, max: 1 }));
        let row = |k: i64, invalid: i64| {
            let mut row = vec![RecordValue::Double(k as f64); 3];
            row.extend(numbers.map(value));
            row.push(RecordValue::Integer(invalid));
            row
        };
        let reading = all(&file(fields, vec![row(0, 0), row(1, 1)])).expect("sound").remove(0).reading;
        assert_eq!(reading.dropped.colors, 1);
        reading.surface.cloud.colors.expect("colours")[0]
    };
    let whole = |max| RecordDataType::Integer { min: 0, max };
    assert_eq!(colors(whole(255), RecordValue::Integer, [1, 2, 255]), [1, 2, 255]);
    assert_eq!(colors(whole(65535), RecordValue::Integer, [257, 0, 65535]), [1, 0, 255]);
    assert_eq!(colors(whole(65535), RecordValue::Integer, [1, 0, 255]), [1, 0, 255], "bytes in wider numbers");
    assert_eq!(colors(whole(1023), RecordValue::Integer, [1023, 0, 512]), [255, 0, 128]);
    let unit = RecordDataType::Single { min: Some(0.0), max: Some(1.0) };
    assert_eq!(colors(unit, |k| RecordValue::Single(k as f32), [1, 0, 1]), [255, 0, 255]);
}

#[test]
fn indices_that_share_pixels_make_no_grid() {
    let mut fields = xyz(&DOUBLE);
    let index = RecordDataType::Integer { min: 0, max: 4_000_000_000 };
    fields.extend([RecordName::RowIndex, RecordName::ColumnIndex].map(|name| (name, index.clone())));
    let row = |k: i64, row: i64, column: i64| {
        let mut values = vec![RecordValue::Double(k as f64); 3];
        values.extend([row, column].map(RecordValue::Integer));
        values
    };
    for far in [1, 3_999_999_999] {
        let rows = (0..8).map(|k| row(k, far * (k % 2), far * (k % 2))).collect();
        let reading = all(&file(fields.clone(), rows)).expect("sound").remove(0).reading;
        assert_eq!(reading.surface.grid, None);
        assert_eq!(reading.dropped.notes, ["row and column indices that make no grid"]);
    }
    let rows = (0..6).map(|k| row(k, 5 + k / 3, 9 - k % 3)).collect();
    let grid = all(&file(fields, rows)).expect("sound").remove(0).reading.surface.grid.expect("a grid");
    assert_eq!((grid.rows, grid.columns, grid.pixels), (2, 3, vec![2, 1, 0, 5, 4, 3]), "counted from any number");
}

#[test]
fn what_is_wrong_is_named() {
    let cloud = some_cloud(30);
    let bytes = write_cloud(&cloud);
    let count = "recordCount=\"30\"";
    let renamed = replaced(&bytes, "<cartesianX", "<cartesianW");
    let cases = [
        (b"PK\x03\x04".to_vec(), "byte 0: an E57 file begins with ASTM-E57, this one with \"PK"),
        (
            replaced(&bytes, count, "recordCount=\"80\""),
            "it declares 50 more points of scan 1 but ends within its packets",
        ),
        (replaced(&renamed, "</cartesianX", "</cartesianW"), "scan 1: its points have neither x, y, z nor range"),
        (replaced(&bytes, "</data3D>", "</data3E>"), "the description: "),
        (replaced(&bytes, count, "recordCount=\"00\""), "the whole file: none of its 1 scans has points"),
    ];
    for (bytes, expected) in cases {
        let error = message(&bytes);
        assert!(error.contains(expected), "{error}");
    }
    let mut changed = bytes.clone();
    changed[700] ^= 1;
    assert!(message(&changed).contains("page 0: its checksum is wrong"), "{}", message(&changed));
    let many = write_cloud(&some_cloud(3000));
    let error = message(&replaced(&many, "recordCount=\"3000\"", "recordCount=\"9e99\""));
    assert!(error.contains("the description: "), "{error}");
    let declared = replaced(&many, "fileOffset=\"48\" recordCount=\"3000\"", "fileOffset=\"48\" recordCount=\"9999\"");
    assert!(matches!(all(&declared), Err(FormatError::Truncated { .. })));
}

#[test]
fn limits_hold_over_all_scans() {
    let cloud = some_cloud(10);
    let scan = WrittenScan { name: "a", cloud: &cloud, grid: None, world_from_scan: None };
    let bytes = write_scans(&[scan, scan]);
    let limited =
        |max_points| read(&bytes, &ReadLimits { max_points, ..ReadLimits::default() }).map(|scans| scans.len());
    assert_eq!(limited(20), Ok(2));
    assert_eq!(limited(19), Err(FormatError::TooLarge { what: "points", found: 20, limit: 19 }));
    // one section of points for many scans
    let one = write_cloud(&some_cloud(20_000));
    let content: Vec<u8> = one.chunks(1024).flat_map(|page| page[..1020].to_vec()).collect();
    let text = memchr::memmem::find(&content, b"<?xml").expect("a description");
    let xml = String::from_utf8_lossy(&content[text..]).trim_end_matches('\0').to_owned();
    let (start, end) = (xml.find("<vectorChild").expect("a scan"), xml.find("</data3D>").expect("its end"));
    let xml = [&xml[..start], &xml[start..end].repeat(9), &xml[end..]].concat();
    let mut again = [&content[..text], xml.as_bytes()].concat();
    again[32..40].copy_from_slice(&(xml.len() as u64).to_le_bytes());
    let length = again.len().div_ceil(1020) * 1024;
    again[16..24].copy_from_slice(&(length as u64).to_le_bytes());
    assert!(message(&paged(&again)).contains("its packets are those of another scan"));
}

#[test]
fn a_file_cut_anywhere_is_an_error() {
    let whole = write_cloud(&some_cloud(40));
    assert!(all(&whole).is_ok());
    for length in 0..whole.len() {
        assert!(all(&whole[..length]).is_err(), "{length}");
    }
}

#[test]
fn changed_content_with_right_checksums_never_panics() {
    let scan = some_cloud(50);
    let grid = RangeGrid { columns: 10, rows: 5, pixels: (0..50).collect() };
    let motion = Motion::translation(1.0, 2.0, 3.0);
    let bytes =
        write_scans(&[WrittenScan { name: "a", cloud: &scan, grid: Some(&grid), world_from_scan: Some(&motion) }]);
    let content: Vec<u8> = bytes.chunks(1024).flat_map(|page| page[..1020].to_vec()).collect();
    let limits = ReadLimits { max_points: 1000, max_faces: 1000, max_bytes: 1 << 20 };
    let mut state = 7u64;
    let mut next = |below: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % below
    };
    let mut read_well = 0;
    for _ in 0..4000 {
        let mut changed = content.clone();
        for _ in 0..1 + next(3) {
            let place = next(changed.len());
            changed[place] = if next(2) == 0 { next(256) as u8 } else { b"0123456789-.e<>\"="[next(17)] };
        }
        read_well += usize::from(read(&paged(&changed), &limits).is_ok());
    }
    assert!(read_well > 100, "{read_well}: the changes are too rough to reach anything");
}
