//! Depth images: what depth cameras and phones write, a 16-bit PNG of distances along the line of sight, and the
//! intrinsics of the camera. Read, they are organised scans in metres, seen from the origin: x right, y down, z
//! forward.

mod intrinsics;
mod layout;
mod picture;

use super::{DeclaredUnit, Dropped, FormatError, ReadLimits, Reading, checked_coordinate};
use visage_geometry::{Cloud, Point3, RangeGrid, Surface};

pub use intrinsics::{Intrinsics, read_intrinsics};
pub use layout::{Frame, IntrinsicsOf, Layout, layout};

/// Values that stand for "nothing was seen": none, and more than can be told.
const NOTHING: [u16; 2] = [0, u16::MAX];

/// The scan of one depth image, in metres: a pixel of value v that sees along (x, y, 1) is the point (x, y, 1) v /
/// `per_metre`.
///
/// `picture`, if there is one, is a PNG of the same view; its colours are those of the points. It may be larger or
/// smaller. One that can't be read costs the colours and not the scan, which is noted.
///
/// # Errors
/// [`FormatError`] if the image is no 16-bit grey PNG, or larger than the limits, or the intrinsics are not those of
/// it.
pub fn read(
    depth: &[u8],
    intrinsics: &Intrinsics,
    per_metre: f64,
    picture: Option<&[u8]>,
    limits: &ReadLimits,
) -> Result<Reading, FormatError> {
    if !(per_metre.is_finite() && per_metre > 0.0) {
        let problem = format!("the depth scale is {per_metre}");
        return Err(FormatError::malformed(
            "the intrinsics",
            problem,
            "give the depth values of a metre, such as 1000",
        ));
    }
    let mut budget = limits.budget();
    let image = picture::depth(depth, limits, &mut budget)?;
    let camera = intrinsics.of_size(image.columns, image.rows)?;
    let seen = image.values.iter().filter(|value| !NOTHING.contains(value)).count();
    budget.take(seen as u64, size_of::<Point3>() + size_of::<[u8; 3]>())?;
    let mut dropped = Dropped::default();
    let colors = picture.and_then(|picture| match picture::colors(picture, limits, &mut budget) {
        Ok(colors) => Some(colors),
        Err(error) => {
            dropped.notes.push(format!("the picture is not read, so that the points have no colours: {error}"));
            None
        }
    });
    let mut cloud = Cloud::from_points(Vec::with_capacity(seen));
    let mut of_points = colors.as_ref().map(|_| Vec::with_capacity(seen));
    let mut pixels = Vec::with_capacity(image.values.len());
    for (pixel, value) in image.values.iter().enumerate() {
        if NOTHING.contains(value) {
            pixels.push(RangeGrid::EMPTY);
            continue;
        }
        let (row, column) = (pixel / image.columns, pixel % image.columns);
        let z = f64::from(*value) / per_metre;
        let x = (column as f64 - camera.cx) / camera.fx * z;
        let y = (row as f64 - camera.cy) / camera.fy * z;
        for coordinate in [x, y, z] {
            checked_coordinate(coordinate).map_err(|problem| {
                FormatError::malformed(
                    format!("pixel {pixel}"),
                    format!("a coordinate {problem}"),
                    "check the intrinsics",
                )
            })?;
        }
        pixels.push(cloud.points.len() as u32);
        cloud.points.push(Point3::new(x, y, z));
        if let (Some(of_points), Some(colors)) = (&mut of_points, &colors) {
            of_points.push(colors.at(row, column, image.rows, image.columns));
        }
    }
    cloud.colors = of_points;
    if cloud.points.is_empty() {
        return Err(FormatError::malformed("the depth image", "no pixel has a depth", "leave the image out"));
    }
    let grid = Some(RangeGrid { columns: image.columns, rows: image.rows, pixels });
    let surface = Surface { cloud, faces: Vec::new(), grid, sensor: Some(Point3::origin()) };
    Ok(Reading { surface, dropped, unit: Some(DeclaredUnit::METRE) })
}

#[cfg(test)]
mod tests {
    use super::picture::tests::{grey16, rgb8};
    use super::*;

    const CAMERA: Intrinsics = Intrinsics { size: Some((4, 3)), fx: 2.0, fy: 4.0, cx: 1.0, cy: 1.0 };

    fn values() -> Vec<u16> {
        let mut values = vec![2000; 12];
        (values[0], values[11], values[5]) = (0, u16::MAX, 1000);
        values
    }

    #[test]
    fn pixels_become_points_before_the_camera() {
        let picture = rgb8(8, 6, |row, column| [row as u8, column as u8, 7]);
        let depth = grey16(4, 3, &values());
        let Reading { surface, dropped, .. } =
            read(&depth, &CAMERA, 1000.0, Some(&picture), &ReadLimits::default()).expect("sound");
        assert_eq!((surface.cloud.len(), dropped), (10, Dropped::default()), "a pixel without a depth is no point");
        // the pixel of the principal point, and the last of the first row
        assert_eq!(surface.cloud.points[4], Point3::new(0.0, 0.0, 1.0));
        assert_eq!(surface.cloud.points[2], Point3::new(2.0, -0.5, 2.0));
        let grid = surface.grid.expect("organised");
        assert_eq!((grid.columns, grid.rows, grid.pixels[0], grid.pixels[3]), (4, 3, RangeGrid::EMPTY, 2));
        assert_eq!(surface.sensor, Some(Point3::origin()));
        assert_eq!(surface.cloud.colors.expect("coloured")[2], [1, 7, 7], "the picture is twice as large");
    }

    #[test]
    fn a_picture_that_can_not_be_read_costs_the_colours() {
        let Reading { surface, dropped, .. } =
            read(&grey16(4, 3, &values()), &CAMERA, 5000.0, Some(b"\xff\xd8 jpeg"), &ReadLimits::default())
                .expect("sound");
        assert!(surface.cloud.colors.is_none() && dropped.notes[0].contains("not read"), "{dropped}");
        assert_eq!(surface.cloud.points[4].z, 0.2);
    }

    #[test]
    fn what_is_no_depth_image_is_refused() {
        let limits = ReadLimits::default();
        let refused = |bytes: &[u8], camera: &Intrinsics, scale: f64, limits: &ReadLimits| {
            read(bytes, camera, scale, None, limits).expect_err("refused").to_string()
        };
        let depth = grey16(4, 3, &values());
        assert!(refused(b"P5", &CAMERA, 1000.0, &limits).contains("it is no PNG"));
        assert!(refused(&rgb8(4, 3, |_, _| [0; 3]), &CAMERA, 1000.0, &limits).contains("16-bit grey"));
        let few = ReadLimits { max_points: 11, ..limits };
        assert!(refused(&depth, &CAMERA, 1000.0, &few).contains("exceeds the limit of 11"));
        assert!(refused(&depth, &CAMERA, 0.0, &limits).contains("the depth scale is 0"));
        assert!(refused(&grey16(4, 3, &[0; 12]), &CAMERA, 1000.0, &limits).contains("no pixel has a depth"));
        let other = Intrinsics { size: Some((3, 4)), ..CAMERA };
        assert!(refused(&depth, &other, 1000.0, &limits).contains("3 x 4"));
        for end in 0..depth.len() {
            // the last chunk says only that it is the last
            assert!(read(&depth[..end], &CAMERA, 1000.0, None, &limits).is_err() || end > depth.len() - 16, "{end}");
        }
        for place in 0..depth.len() {
            let mut changed = depth.clone();
            changed[place] ^= 0x55;
            let _ = read(&changed, &CAMERA, 1000.0, Some(&changed), &limits);
        }
    }
}
