//! Vehicle lidars as bare floats: `.bin` of KITTI (x y z and reflectance) and nuScenes (`.pcd.bin`, with the ring behind).
//!
//! Nothing in such a file says what it is, so what does not look like a scan is refused: how many numbers a point has must be
//! beyond doubt.

use super::colors::Channels;
use super::format::{BYTES, Content, Format, Reader, Writers};
use super::points::{INTENSITY, Layout, NORMAL, Points, SLOTS, X};
use super::{DeclaredUnit, FormatError, ReadLimits, Reading};

/// Its line in the table of formats.
pub const FORMAT: Format = Format {
    name: "KITTI",
    endings: &["bin"],
    media_type: BYTES,
    holds: &[Content::Points, Content::Intensities],
    reader: Reader::Surface(read),
    writers: Writers::NONE,
};

/// No lidar on a vehicle sees farther (m).
const FARTHEST: f32 = 1000.0;
/// No such lidar has as many rings.
const RINGS: f32 = 256.0;
/// Reflectances are fractions, or bytes.
const BRIGHTEST: f32 = 255.0;

/// Points of four floats or of five, by what the file looks like.
///
/// # Errors
/// [`FormatError::Malformed`] where it looks like neither, or like both; [`FormatError::TooLarge`] and
/// [`FormatError::TooManyBytes`] beyond the limits.
pub fn read(bytes: &[u8], limits: &ReadLimits) -> Result<Reading, FormatError> {
    let remedy = "send the scan as PLY or PCD";
    let refused = |problem: &str| FormatError::malformed("the whole file", problem, remedy);
    let (floats, rest) = bytes.as_chunks::<4>();
    if bytes.is_empty() || !rest.is_empty() {
        let problem = format!("{} bytes are no floats x y z reflectance", bytes.len());
        return Err(refused(&problem));
    }
    let width = match (is_scan::<4>(floats), is_scan::<5>(floats)) {
        (true, false) => 4,
        (false, true) => 5,
        (true, true) => return Err(refused("its points may have four numbers or five")),
        (false, false) => {
            return Err(refused("the numbers look like no scan of KITTI (x y z reflectance) or nuScenes (and ring)"));
        }
    };
    let (found, limit) = ((floats.len() / width) as u64, limits.most_points());
    if found > limit {
        return Err(FormatError::TooLarge { what: "points", found, limit });
    }
    let layout = Layout::of(|slot| slot < NORMAL || slot == INTENSITY, |_| Channels::Floats)?;
    limits.budget().take(found, layout.bytes())?;
    let mut points = Points::new(&layout, found as usize);
    for (index, point) in floats.chunks_exact(width).enumerate() {
        let mut values = [0.0; SLOTS];
        for (slot, float) in [X, X + 1, X + 2, INTENSITY].into_iter().zip(point) {
            values[slot] = f32::from_le_bytes(*float).into();
        }
        let place = || format!("point {index}");
        points.push(&values).map_err(|problem| FormatError::malformed(place(), problem, remedy))?;
    }
    let mut reading = points.finish(Vec::new(), None, None)?;
    reading.unit = Some(DeclaredUnit::METRE);
    Ok(reading)
}

/// Whether points of so many floats make a scan: all near, none brighter than can be, rings whole and few, and not all alike.
fn is_scan<const N: usize>(floats: &[[u8; 4]]) -> bool {
    let (points, rest) = floats.as_chunks::<N>();
    let mut differs = [false; 3];
    let is_point = |point: &[[u8; 4]; N]| {
        let value = |place: usize| f32::from_le_bytes(point[place]);
        let is_near = (0..3).all(|axis| value(axis).abs() <= FARTHEST || value(axis).is_nan());
        let is_ring = |ring: f32| ring.fract() == 0.0 && (0.0..RINGS).contains(&ring);
        (0..3).for_each(|axis| differs[axis] |= point[axis] != points[0][axis]);
        // numbers that are nearly zero are other numbers read as floats
        let is_number = |x: f32| x == 0.0 || x.is_nan() || x.abs() > 1e-9;
        let is_plain = (0..N).all(|place| is_number(value(place)));
        is_near && is_plain && (0.0..=BRIGHTEST).contains(&value(3)) && (N < 5 || is_ring(value(4)))
    };
    rest.is_empty() && points.iter().all(is_point) && (points.len() < 2 || differs.contains(&true))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scan(width: usize) -> Vec<u8> {
        let point = |k: usize| {
            let turn = k as f32 * 0.1;
            [10.0 * turn.cos(), 10.0 * turn.sin(), -1.5, (k % 7) as f32 * 0.1, (k % 32) as f32]
        };
        (0..100).flat_map(|k| point(k)[..width].to_vec()).flat_map(f32::to_le_bytes).collect()
    }

    fn message(bytes: &[u8]) -> String {
        read(bytes, &ReadLimits::default()).expect_err("refused").to_string()
    }

    #[test]
    fn four_and_five_floats_are_told_apart() {
        for width in [4, 5] {
            let reading = read(&scan(width), &ReadLimits::default()).expect("a scan");
            let cloud = reading.surface.cloud;
            assert_eq!((cloud.len(), cloud.points[0].x, cloud.points[0].z), (100, 10.0, -1.5), "{width}");
            let intensity = cloud.intensities.map(|all| (all[1], all[6], all[8]));
            assert_eq!((intensity, reading.unit), (Some((0.1, 0.6, 0.1)), Some(DeclaredUnit::METRE)), "{width}");
        }
    }

    #[test]
    fn what_may_be_something_else_is_refused() {
        let none = "the whole file: the numbers look like no scan of KITTI (x y z reflectance) or nuScenes (and ring)";
        assert!(
            message(b"").starts_with("the whole file: 0 bytes are no floats x y z reflectance; send the scan as PLY")
        );
        assert!(message(&[0; 31]).starts_with("the whole file: 31 bytes are no floats"));
        assert!(message(&scan(4)[..1596]).starts_with(none), "a number is missing");
        assert!(message(&[0; 400]).starts_with(none), "zeros alone");
        assert!(message(b"This is a text and no scan at all. ..... ").starts_with("the whole file"));
        let integers: Vec<u8> = (0..400u32).flat_map(u32::to_le_bytes).collect();
        assert!(message(&integers).starts_with(none));
        let doubtful: Vec<u8> = (0..20).flat_map(|k| ((k * 3 % 7) as f32).to_le_bytes()).collect();
        assert!(message(&doubtful).starts_with("the whole file: its points may have four numbers or five"));
        let limits = ReadLimits { max_points: 99, ..ReadLimits::default() };
        assert_eq!(read(&scan(4), &limits), Err(FormatError::TooLarge { what: "points", found: 100, limit: 99 }));
    }
}
