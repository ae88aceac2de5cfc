//! One scan of an E57 file: its fields as points, its indices as a range grid, its pose.

use e57::{PointCloud, RecordDataType, RecordName, RecordValue};
use nalgebra::{Quaternion, UnitQuaternion};

use super::REPAIR;
use super::packets::{Packets, bits};
use crate::budget::Budget;
use crate::colors::Channels;
use crate::points::{COLOR, INTENSITY, Layout, NORMAL, Points, SLOTS, X};
use crate::{FormatError, ScanReading};
use visage_geometry::{Motion, Point3, RangeGrid, Vector3};

/// Points that are read at a time.
const BATCH: usize = 4096;

/// What else a point has: no slots of [`Points`].
const RANGE: usize = SLOTS;
const STATE: usize = SLOTS + 3;
const RANGE_STATE: usize = SLOTS + 4;
const COLOR_STATE: usize = SLOTS + 5;
const INTENSITY_STATE: usize = SLOTS + 6;
const ROW: usize = SLOTS + 7;
const COLUMN: usize = SLOTS + 8;
const FIELDS: usize = SLOTS + 9;

fn slot(name: &RecordName) -> Option<usize> {
    Some(match name {
        RecordName::CartesianX => X,
        RecordName::CartesianY => X + 1,
        RecordName::CartesianZ => X + 2,
        RecordName::CartesianInvalidState => STATE,
        RecordName::SphericalRange => RANGE,
        RecordName::SphericalAzimuth => RANGE + 1,
        RecordName::SphericalElevation => RANGE + 2,
        RecordName::SphericalInvalidState => RANGE_STATE,
        RecordName::Intensity => INTENSITY,
        RecordName::IsIntensityInvalid => INTENSITY_STATE,
        RecordName::ColorRed => COLOR,
        RecordName::ColorGreen => COLOR + 1,
        RecordName::ColorBlue => COLOR + 2,
        RecordName::IsColorInvalid => COLOR_STATE,
        RecordName::RowIndex => ROW,
        RecordName::ColumnIndex => COLUMN,
        RecordName::Unknown { name, .. } => match name.as_str() {
            "normalX" => NORMAL,
            "normalY" => NORMAL + 1,
            "normalZ" => NORMAL + 2,
            _ => return None,
        },
        _ => return None,
    })
}

/// Reads a scan; `None` if no point of it has a place.
pub(super) fn read(
    bytes: &[u8],
    cloud: &PointCloud,
    place: &str,
    unread: &mut u64,
    budget: &mut Budget,
) -> Result<Option<ScanReading>, FormatError> {
    let mut fields = [None; FIELDS];
    for (index, record) in cloud.prototype.iter().enumerate() {
        if let Some(slot) = slot(&record.name) {
            fields[slot] = Some(index);
        }
    }
    let has = |slot: usize| fields[slot].is_some();
    let (is_cartesian, is_spherical) = ((X..X + 3).all(has), (RANGE..RANGE + 3).all(has));
    if !is_cartesian && !is_spherical {
        let problem = "its points have neither x, y, z nor range, azimuth and elevation";
        return Err(FormatError::malformed(place, problem, "export the file with positions"));
    }
    check_count(bytes, cloud, place)?;
    let scales = color_scales(cloud);
    let channels = if scales.iter().any(|(min, full)| full <= min) {
        Channels::Floats
    } else if scales.iter().all(|scale| *scale == (0.0, 65535.0)) {
        Channels::Whole(65535)
    } else {
        Channels::Bytes
    };
    let layout = Layout::of(|slot| slot < NORMAL || has(slot), |_| channels)?;
    let has_grid = has(ROW) && has(COLUMN);
    budget.take(cloud.records, layout.bytes() + if has_grid { size_of::<[u32; 2]>() } else { 0 })?;
    let mut points = Points::new(&layout, cloud.records as usize);
    let mut pixels: Vec<[u32; 2]> = Vec::with_capacity(if has_grid { cloud.records as usize } else { 0 });

    let is_wanted = |index: usize| fields.contains(&Some(index));
    let mut packets = Packets::new(bytes, cloud, place, is_wanted, unread)?;
    let mut columns: Vec<[f64; BATCH]> = vec![[0.0; BATCH]; FIELDS];
    loop {
        let count = packets.available()?.min(BATCH);
        if count == 0 {
            break;
        }
        for (slot, field) in fields.iter().enumerate() {
            if let Some(field) = field {
                packets.take(*field, &mut columns[slot][..count]);
            }
        }
        packets.advance(count);
        for row in 0..count {
            let value = |slot: usize| columns.get(slot).map_or(0.0, |column| column[row]);
            let values = values(value, is_cartesian, is_spherical, &scales);
            if has_grid {
                pixels.push([value(ROW) as u32, value(COLUMN) as u32]);
            }
            let index = points.seen();
            points
                .push(&values)
                .map_err(|problem| FormatError::malformed(format!("{place}, point {index}"), problem, REPAIR))?;
        }
    }
    if points.dropped.no_return >= cloud.records {
        return Ok(None);
    }
    let grid = if has_grid { grid(&pixels, budget) } else { None };
    if has_grid && grid.is_none() {
        points.dropped.notes.push("row and column indices that make no grid".into());
    }
    let world_from_scan = cloud.transform.as_ref().map(|transform| pose(transform, place)).transpose()?;
    // angles are seen from the scanner, and a scan that has a pose and pixels is in the scanner's frame
    let sensor = (is_spherical || (has_grid && world_from_scan.is_some())).then(Point3::origin);
    let reading = points.finish(Vec::new(), grid, sensor)?;
    let name = cloud.name.clone().filter(|name| !name.trim().is_empty());
    Ok(Some(ScanReading { name, reading, world_from_scan }))
}

/// The values of a point; NaN for what its states say is not valid.
#[inline]
fn values(
    value: impl Fn(usize) -> f64,
    is_cartesian: bool,
    is_spherical: bool,
    scales: &[(f64, f64); 3],
) -> [f64; SLOTS] {
    let mut values = [0.0; SLOTS];
    let position = if is_cartesian && value(STATE) == 0.0 {
        [value(X), value(X + 1), value(X + 2)]
    } else if is_spherical && value(RANGE_STATE) == 0.0 {
        cartesian(value(RANGE), value(RANGE + 1), value(RANGE + 2))
    } else {
        [f64::NAN; 3]
    };
    values[X..X + 3].copy_from_slice(&position);
    values[NORMAL..NORMAL + 3].copy_from_slice(&[value(NORMAL), value(NORMAL + 1), value(NORMAL + 2)]);
    for (channel, (min, full)) in scales.iter().enumerate() {
        let value = if value(COLOR_STATE) == 0.0 { value(COLOR + channel) } else { f64::NAN };
        values[COLOR + channel] = scaled(value, *min, *full);
    }
    values[INTENSITY] = if value(INTENSITY_STATE) == 0.0 { value(INTENSITY) } else { f64::NAN };
    values
}

/// Whether the points that are declared fit into the file.
fn check_count(bytes: &[u8], cloud: &PointCloud, place: &str) -> Result<(), FormatError> {
    let width: u64 = cloud.prototype.iter().map(|record| bits(&record.data_type) as u64).sum();
    let needed = cloud.records.saturating_mul(width) / 8;
    if needed > bytes.len() as u64 || (width == 0 && cloud.records > 1) {
        let declared = format!("{} points of {place}, {width} bits each", cloud.records);
        return Err(FormatError::Truncated { declared, found: format!("its {} bytes", bytes.len()) });
    }
    Ok(())
}

fn cartesian(range: f64, azimuth: f64, elevation: f64) -> [f64; 3] {
    let level = range * elevation.cos();
    [level * azimuth.cos(), level * azimuth.sin(), range * elevation.sin()]
}

/// The smallest and largest value of each channel, by the limits that are declared, else by the type. The same twice
/// where nothing is declared: then the values tell.
fn color_scales(cloud: &PointCloud) -> [(f64, f64); 3] {
    let limits = cloud.color_limits.as_ref();
    let of = |name: RecordName, min: Option<&RecordValue>, max: Option<&RecordValue>| {
        let kind = cloud.prototype.iter().find(|record| record.name == name).map(|record| &record.data_type);
        let number = |value: &RecordValue| match (value, kind) {
            (RecordValue::ScaledInteger(_), Some(kind)) => value.to_f64(kind).unwrap_or(0.0),
            (RecordValue::Integer(value) | RecordValue::ScaledInteger(value), _) => *value as f64,
            (RecordValue::Single(value), _) => f64::from(*value),
            (RecordValue::Double(value), _) => *value,
        };
        let of_type = match kind {
            Some(RecordDataType::Integer { min, max }) => (*min as f64, *max as f64),
            _ => (0.0, 0.0),
        };
        let (min, max) = min.map(number).zip(max.map(number)).filter(|(min, max)| min < max).unwrap_or(of_type);
        // no camera has more
        if min.is_finite() && max.is_finite() && max < f64::from(u32::MAX) { (min, max) } else { (0.0, 0.0) }
    };
    [
        of(
            RecordName::ColorRed,
            limits.and_then(|limits| limits.red_min.as_ref()),
            limits.and_then(|limits| limits.red_max.as_ref()),
        ),
        of(
            RecordName::ColorGreen,
            limits.and_then(|limits| limits.green_min.as_ref()),
            limits.and_then(|limits| limits.green_max.as_ref()),
        ),
        of(
            RecordName::ColorBlue,
            limits.and_then(|limits| limits.blue_min.as_ref()),
            limits.and_then(|limits| limits.blue_max.as_ref()),
        ),
    ]
}

/// A channel as a byte. Where the range is that of bytes, or of two, or is not known, the value stands as it is.
fn scaled(value: f64, min: f64, full: f64) -> f64 {
    if full <= min || (min == 0.0 && (full == 255.0 || full == 65535.0)) {
        value
    } else {
        (value - min) / (full - min) * 255.0
    }
}

/// The pose of a scan.
fn pose(transform: &e57::Transform, place: &str) -> Result<Motion, FormatError> {
    let e57::Transform { rotation: q, translation: t } = transform;
    let (quaternion, translation) = (Quaternion::new(q.w, q.x, q.y, q.z), Vector3::new(t.x, t.y, t.z));
    let is_finite = quaternion.coords.iter().chain(translation.iter()).all(|x| x.is_finite());
    let wrong = |problem: &str| FormatError::malformed(place, problem, REPAIR);
    if !is_finite || translation.amax() > visage_geometry::MAX_COORDINATE {
        return Err(wrong("its pose is not finite"));
    }
    let rotation = UnitQuaternion::try_new(quaternion, 1e-3).ok_or_else(|| wrong("its pose has no rotation"))?;
    Ok(Motion::from_parts(translation.into(), rotation))
}

/// The grid of the points' rows and columns; `None` if there is no room for it, or if many share a pixel.
fn grid(pixels: &[[u32; 2]], budget: &mut Budget) -> Option<RangeGrid> {
    let ends = |axis: usize| {
        let values = pixels.iter().map(|pixel| pixel[axis]);
        Some((values.clone().min()?, values.max()?))
    };
    let ((first_row, last_row), (first_column, last_column)) = (ends(0)?, ends(1)?);
    let rows = (last_row - first_row) as usize + 1;
    let columns = (last_column - first_column) as usize + 1;
    let size = rows.checked_mul(columns).filter(|size| *size < u32::MAX as usize)?;
    budget.take(size as u64, size_of::<u32>()).ok()?;
    let mut grid = RangeGrid { columns, rows, pixels: vec![RangeGrid::EMPTY; size] };
    let mut shared = 0;
    for (index, [row, column]) in pixels.iter().enumerate() {
        let pixel = &mut grid.pixels[(row - first_row) as usize * columns + (column - first_column) as usize];
        if *pixel == RangeGrid::EMPTY {
            *pixel = index as u32;
        } else {
            // a second return of the same pulse
            shared += 1;
        }
    }
    (shared <= pixels.len() / 2 && rows.min(columns) > 1).then_some(grid)
}
