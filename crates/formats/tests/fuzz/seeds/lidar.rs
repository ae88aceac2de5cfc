//! E57, LAS and LAZ.

use std::io::Cursor;

use e57::{E57Writer, Record, RecordDataType, RecordName, RecordValue};
use laz::{LasZipCompressor, LazVlrBuilder};
use visage_formats::e57::{WrittenScan, write_cloud, write_scans};
use visage_formats::las;
use visage_geometry::RangeGrid;

use super::{Seed, cloud, motion};

/// Bytes of a page, with and without its checksum, and where the head says where the description is.
const PAGE: usize = 1024;
const CONTENT: usize = PAGE - 4;

/// The content of a file's pages.
fn unpaged(file: &[u8]) -> Vec<u8> {
    file.chunks(PAGE).flat_map(|page| page[..page.len().min(CONTENT)].to_vec()).collect()
}

/// Content as pages with right checksums, and a head that tells its length and where its description is.
fn paged(content: &[u8]) -> Vec<u8> {
    let mut content = content.to_vec();
    let description = memchr::memmem::find(&content, b"<?xml");
    let length = content.len();
    content.resize(length.next_multiple_of(CONTENT), 0);
    if let (Some(at), true) = (description, length >= 48) {
        let size = (content.len() / CONTENT * PAGE) as u64;
        content[16..24].copy_from_slice(&size.to_le_bytes());
        content[24..32].copy_from_slice(&((at / CONTENT * PAGE + at % CONTENT) as u64).to_le_bytes());
        let end = memchr::memmem::rfind(&content, b"</e57Root>").map_or(length, |end| end + 10).max(at);
        content[32..40].copy_from_slice(&((end - at) as u64).to_le_bytes());
    }
    let page = |page: &[u8]| [page, &crc32c::crc32c(page).to_be_bytes()].concat();
    content.chunks(CONTENT).flat_map(page).collect()
}

/// Angles, ranges, states, pixels, bits that end within bytes.
fn spherical() -> Vec<u8> {
    let fields = [
        (RecordName::SphericalRange, RecordDataType::Single { min: None, max: None }),
        (
            RecordName::SphericalAzimuth,
            RecordDataType::ScaledInteger { min: -4000, max: 4000, scale: 0.001, offset: 0.0 },
        ),
        (
            RecordName::SphericalElevation,
            RecordDataType::ScaledInteger { min: -2000, max: 2000, scale: 0.001, offset: 0.0 },
        ),
        (RecordName::SphericalInvalidState, RecordDataType::Integer { min: 0, max: 2 }),
        (RecordName::RowIndex, RecordDataType::Integer { min: 0, max: 9 }),
        (RecordName::ColumnIndex, RecordDataType::Integer { min: 0, max: 9 }),
        (RecordName::Intensity, RecordDataType::Integer { min: 0, max: 2047 }),
        (RecordName::ColorRed, RecordDataType::Integer { min: 0, max: 255 }),
        (RecordName::ColorGreen, RecordDataType::Integer { min: 0, max: 255 }),
        (RecordName::ColorBlue, RecordDataType::Integer { min: 0, max: 255 }),
    ];
    let mut bytes = Cursor::new(Vec::new());
    let mut writer = E57Writer::new(&mut bytes, "file").expect("to memory");
    let prototype = fields.into_iter().map(|(name, data_type)| Record { name, data_type }).collect();
    let mut scan = writer.add_pointcloud("scan", prototype).expect("a sound prototype");
    for k in 0..40 {
        let (scaled, whole) = (RecordValue::ScaledInteger, RecordValue::Integer);
        let row = vec![
            RecordValue::Single(2.0 + k as f32),
            scaled(100 * k),
            scaled(50 * (k % 7)),
            whole(2 * i64::from(k == 3)),
            whole(k / 10),
            whole(k % 10),
            whole(50 * k),
            whole(k),
            whole(2),
            whole(255),
        ];
        scan.add_point(row).expect("a sound row");
    }
    scan.finalize().expect("to memory");
    writer.finalize().expect("to memory");
    drop(writer);
    bytes.into_inner()
}

pub fn e57() -> Vec<Seed> {
    let cloud = cloud();
    let grid = RangeGrid { columns: 5, rows: 4, pixels: (0..20).collect() };
    let (first, second) = (motion(0.0), motion(1.0));
    let scan = |name, world_from_scan| WrittenScan { name, cloud: &cloud, grid: Some(&grid), world_from_scan };
    let two = write_scans(&[scan("a", Some(&first)), scan("b", Some(&second))]);
    let content = |name: &str, file: &[u8]| Seed { name: name.into(), bytes: unpaged(file), wrap: paged };
    vec![
        content("cloud.e57", &write_cloud(&cloud)),
        content("two.e57", &two),
        content("angles.e57", &spherical()),
        Seed::plain("raw.e57", write_cloud(&cloud)),
    ]
}

/// Records of a point format, and the length of one.
fn records(format: u8, more: usize, count: usize) -> (usize, Vec<u8>) {
    let known = [20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67][usize::from(format)];
    let mut bytes = Vec::new();
    for k in 0..count {
        let mut record = vec![k as u8; known + more];
        for axis in 0..3 {
            record[4 * axis..4 * axis + 4].copy_from_slice(&(k as i32 * (1000 + axis as i32) - 77).to_le_bytes());
        }
        record[14] = if format < 6 { 0b0000_1001 } else { 0b0001_0001 };
        record[15] = 0;
        bytes.extend(record);
    }
    (known + more, bytes)
}

/// The head of a file, and a further record if there is one.
fn head(format: u8, record: usize, count: usize, further: &[u8], is_packed: bool) -> Vec<u8> {
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
    [&bytes, further].concat()
}

/// A further record.
fn further(user: &str, id: u16, data: &[u8]) -> Vec<u8> {
    let mut head = vec![0; 54];
    head[2..2 + user.len()].copy_from_slice(user.as_bytes());
    head[18..20].copy_from_slice(&id.to_le_bytes());
    head[20..22].copy_from_slice(&(data.len() as u16).to_le_bytes());
    [&head, data].concat()
}

/// A compressed file.
fn packed(format: u8, more: usize, count: usize, chunk: u32) -> Vec<u8> {
    let (record, body) = records(format, more, count);
    let builder = LazVlrBuilder::default().with_point_format(format, more as u16).expect("a known format");
    let vlr = builder.with_fixed_chunk_size(chunk).build();
    let mut data = Vec::new();
    vlr.write_to(&mut data).expect("to memory");
    let head = head(format, record, count, &further("laszip encoded", 22204, &data), true);
    let mut whole = Cursor::new(head.clone());
    whole.set_position(head.len() as u64);
    let mut compressor = LasZipCompressor::new(&mut whole, vlr).expect("known items");
    compressor.compress_many(&body).expect("to memory");
    compressor.done().expect("to memory");
    drop(compressor);
    whole.into_inner()
}

pub fn las() -> Vec<Seed> {
    let text =
        b"PROJCS[\"x\",GEOGCS[\"y\",UNIT[\"degree\",0.0174532925199433]],UNIT[\"US survey foot\",0.3048006096012192]]";
    let keys: Vec<u8> =
        [1u16, 1, 0, 2, 1024, 0, 1, 1, 3076, 0, 1, 9002].iter().flat_map(|key| key.to_le_bytes()).collect();
    let plain = |format: u8, more: usize, further: &[u8]| {
        let (record, body) = records(format, more, 30);
        [head(format, record, 30, further, false), body].concat()
    };
    vec![
        Seed::plain("cloud.las", las::write_cloud(&cloud())),
        Seed::plain("text.las", plain(7, 3, &further("LASF_Projection", 2112, text))),
        Seed::plain("keys.las", plain(3, 0, &further("LASF_Projection", 34735, &keys))),
    ]
}

pub fn laz() -> Vec<Seed> {
    let one = |format: u8, more: usize| Seed::plain(&format!("{format}.laz"), packed(format, more, 60, 25));
    vec![
        one(0, 0),
        one(1, 2),
        one(3, 0),
        one(6, 0),
        one(7, 3),
        one(8, 0),
        Seed::plain("chunk.laz", packed(2, 0, 40, 50_000)),
    ]
}
