//! Writes LAS 1.2.

use visage_geometry::{Bounds, Cloud, Point3};

/// Bytes of the head.
const HEAD: u16 = 227;
/// Steps from the middle of a cloud to its end: ten million at least, a hundred million at most.
const STEPS: f64 = 1e7;

/// Writes a cloud with its colours and intensities. Coordinates are whole numbers with a step of a power of ten, at
/// most a ten-thousandth unless the cloud is too large for that. Intensities are whole numbers up to 65535: others are
/// scaled to that range. The same cloud always gives the same bytes.
pub fn write_cloud(cloud: &Cloud) -> Vec<u8> {
    let bounds = cloud.bounds().unwrap_or(Bounds { min: Point3::origin(), max: Point3::origin() });
    let offset = bounds.center().coords.map(f64::round);
    let length = (bounds.max.coords - offset).amax().max((bounds.min.coords - offset).amax());
    let digits = (-(length.max(f64::MIN_POSITIVE) / STEPS).log10().floor()) as i32;
    // what fits into 32 bits with a step of a ten-thousandth has no coarser one
    let digits = if length < 2e5 { digits.clamp(4, 12) } else { digits };
    let (parts, step) = (10f64.powi(digits), 10f64.powi(-digits));
    let count = u32::try_from(cloud.len()).unwrap_or(u32::MAX);
    let (format, record): (u8, u16) = if cloud.colors.is_some() { (2, 26) } else { (0, 20) };

    let mut bytes = Vec::with_capacity(usize::from(HEAD) + usize::from(record) * cloud.len());
    bytes.extend(b"LASF");
    // no source, no times, no project
    bytes.extend([0; 20]);
    bytes.extend([1, 2]);
    bytes.extend(padded::<32>(b"visage"));
    bytes.extend(padded::<32>(b"visage"));
    // no date
    bytes.extend([0; 4]);
    bytes.extend(HEAD.to_le_bytes());
    bytes.extend(u32::from(HEAD).to_le_bytes());
    bytes.extend(0u32.to_le_bytes());
    bytes.push(format);
    bytes.extend(record.to_le_bytes());
    bytes.extend(count.to_le_bytes());
    // all points are first returns
    [count, 0, 0, 0, 0].iter().for_each(|count| bytes.extend(count.to_le_bytes()));
    [step; 3].iter().chain(offset.iter()).for_each(|x| bytes.extend(x.to_le_bytes()));
    for axis in 0..3 {
        bytes.extend(bounds.max[axis].to_le_bytes());
        bytes.extend(bounds.min[axis].to_le_bytes());
    }
    let intensity = intensity_scale(cloud);
    for (index, point) in cloud.points.iter().enumerate() {
        for axis in 0..3 {
            // `as` from a float saturates
            bytes.extend((((point[axis] - offset[axis]) * parts).round() as i32).to_le_bytes());
        }
        let value = cloud.intensities.as_ref().map_or(0.0, |intensities| f64::from(intensities[index]));
        bytes.extend(((value * intensity).round() as u16).to_le_bytes());
        // the first of one return
        bytes.extend([0b0000_1001, 0, 0, 0, 0, 0]);
        if let Some(colors) = &cloud.colors {
            colors[index].iter().for_each(|channel| bytes.extend((u16::from(*channel) * 257).to_le_bytes()));
        }
    }
    bytes
}

/// What intensities are multiplied by.
fn intensity_scale(cloud: &Cloud) -> f64 {
    let intensities = cloud.intensities.as_deref().unwrap_or_default();
    let most = intensities.iter().copied().fold(0.0, f32::max);
    let is_whole = intensities.iter().all(|value| value.fract() == 0.0 && (0.0..=65535.0).contains(value));
    if is_whole || most <= 0.0 { 1.0 } else { 65535.0 / f64::from(most) }
}

fn padded<const N: usize>(text: &[u8]) -> [u8; N] {
    let mut bytes = [0; N];
    bytes.iter_mut().zip(text).for_each(|(byte, letter)| *byte = *letter);
    bytes
}
