//! Writes E57: placed scans, each with its pose, or one cloud.

use std::io::Cursor;

use e57::{E57Writer, Extension, PointCloudWriter, Record, RecordDataType, RecordName, RecordValue};

use visage_geometry::{Cloud, Motion, RangeGrid};

/// A scan as it is written.
#[derive(Debug, Clone, Copy)]
pub struct WrittenScan<'a> {
    /// What it is called.
    pub name: &'a str,
    /// Its points, in its own frame and in metres.
    pub cloud: &'a Cloud,
    /// Its pixels.
    pub grid: Option<&'a RangeGrid>,
    /// Where it is; `None` for one without a place.
    pub world_from_scan: Option<&'a Motion>,
}

const NORMALS: [&str; 3] = ["normalX", "normalY", "normalZ"];
const NORMALS_URL: &str = "http://www.libe57.org/E57_NOR_surface_normals.txt";

/// Writes a cloud with all its attributes. E57 is in metres: coordinates stand as they are. The same cloud always gives
/// the same bytes.
pub fn write_cloud(cloud: &Cloud) -> Vec<u8> {
    write_scans(&[WrittenScan { name: "", cloud, grid: None, world_from_scan: None }])
}

/// Writes scans with their poses; coordinates are `f64`. The same scans always give the same bytes.
pub fn write_scans(scans: &[WrittenScan]) -> Vec<u8> {
    // writing to memory can't fail
    try_write(scans).unwrap_or_default()
}

fn try_write(scans: &[WrittenScan]) -> e57::Result<Vec<u8>> {
    let mut bytes = Cursor::new(Vec::new());
    let mut writer = E57Writer::new(&mut bytes, &guid(scans, 0))?;
    if scans.iter().any(|scan| scan.cloud.normals.is_some()) {
        writer.register_extension(Extension::new("nor", NORMALS_URL))?;
    }
    for (index, scan) in scans.iter().enumerate() {
        let mut cloud = writer.add_pointcloud(&guid(scans, index + 1), prototype(scan))?;
        // the name stands in a section of text that this would end
        let name = scan.name.replace("]]>", "]] >");
        let is_plain = |c: &char| !c.is_control();
        cloud.set_name(Some(name.chars().filter(is_plain).collect()));
        cloud.set_transform(scan.world_from_scan.map(transform));
        write_points(scan, &mut cloud)?;
        cloud.finalize()?;
    }
    writer.finalize()?;
    drop(writer);
    Ok(bytes.into_inner())
}

/// A name that differs where the points do, as the standard wants it, and is the same for the same scans.
fn guid(scans: &[WrittenScan], index: usize) -> String {
    let mut state = [0xcbf2_9ce4_8422_2325u64, 0x9ae1_6a3b_2f90_404f ^ index as u64];
    let mut mix = |bits: u64| {
        for half in &mut state {
            *half = (*half ^ bits).wrapping_mul(0x0000_0100_0000_01b3).rotate_left(23);
        }
    };
    for scan in scans {
        scan.name.bytes().for_each(|byte| mix(u64::from(byte)));
        mix(scan.cloud.len() as u64);
        scan.cloud.points.iter().flat_map(|p| [p.x, p.y, p.z]).for_each(|x| mix(x.to_bits()));
    }
    let [a, b] = state;
    let (a1, a2, a3, b1, b2) = (a >> 32, a >> 16 & 0xffff, a & 0xfff, b >> 48 & 0x3fff | 0x8000, b & 0xffff_ffff_ffff);
    format!("{{{a1:08x}-{a2:04x}-4{a3:03x}-{b1:04x}-{b2:012x}}}")
}

fn transform(motion: &Motion) -> e57::Transform {
    let q = motion.rotation.quaternion();
    // the standard wants a scalar part that is not negative
    let sign = if q.w < 0.0 { -1.0 } else { 1.0 };
    let t = motion.translation.vector;
    e57::Transform {
        rotation: e57::Quaternion { w: sign * q.w, x: sign * q.i, y: sign * q.j, z: sign * q.k },
        translation: e57::Translation { x: t.x, y: t.y, z: t.z },
    }
}

fn prototype(scan: &WrittenScan) -> Vec<Record> {
    let field = |name, data_type| Record { name, data_type };
    let double = RecordDataType::Double { min: None, max: None };
    let single = RecordDataType::Single { min: None, max: None };
    let mut fields: Vec<Record> = [RecordName::CartesianX, RecordName::CartesianY, RecordName::CartesianZ]
        .map(|name| field(name, double.clone()))
        .into();
    if scan.cloud.normals.is_some() {
        let name = |name: &str| RecordName::Unknown { namespace: "nor".into(), name: name.into() };
        fields.extend(NORMALS.map(|axis| field(name(axis), single.clone())));
    }
    if scan.cloud.colors.is_some() {
        let names = [RecordName::ColorRed, RecordName::ColorGreen, RecordName::ColorBlue];
        fields.extend(names.map(|name| field(name, RecordDataType::Integer { min: 0, max: 255 })));
    }
    if let Some(intensities) = &scan.cloud.intensities {
        let min = intensities.iter().copied().fold(f32::INFINITY, f32::min);
        let max = intensities.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        fields.push(field(RecordName::Intensity, RecordDataType::Single { min: Some(min), max: Some(max) }));
    }
    if let Some(grid) = scan.grid {
        let index = |size: usize| RecordDataType::Integer { min: 0, max: size.saturating_sub(1) as i64 };
        fields.push(field(RecordName::RowIndex, index(grid.rows)));
        fields.push(field(RecordName::ColumnIndex, index(grid.columns)));
    }
    fields
}

fn write_points(scan: &WrittenScan, writer: &mut PointCloudWriter<&mut Cursor<Vec<u8>>>) -> e57::Result<()> {
    let WrittenScan { cloud, grid, .. } = scan;
    let mut pixels = vec![[0; 2]; if grid.is_some() { cloud.len() } else { 0 }];
    if let Some(grid) = grid {
        for (place, point) in grid.pixels.iter().enumerate() {
            if let Some(pixel) = pixels.get_mut(*point as usize) {
                *pixel = [place / grid.columns.max(1), place % grid.columns.max(1)];
            }
        }
    }
    for (index, point) in cloud.points.iter().enumerate() {
        let mut values: Vec<RecordValue> = [point.x, point.y, point.z].map(RecordValue::Double).into();
        if let Some(normals) = &cloud.normals {
            values.extend(normals[index].iter().map(|x| RecordValue::Single(*x)));
        }
        if let Some(colors) = &cloud.colors {
            values.extend(colors[index].map(|channel| RecordValue::Integer(i64::from(channel))));
        }
        if let Some(intensities) = &cloud.intensities {
            values.push(RecordValue::Single(intensities[index]));
        }
        if let Some(pixel) = pixels.get(index) {
            values.extend(pixel.map(|axis| RecordValue::Integer(axis as i64)));
        }
        writer.add_point(values)?;
    }
    Ok(())
}
