//! Scans as they were uploaded.

use super::draw::{scene, upright};
use visage_geometry::progress::{Canceled, Progress};
use visage_geometry::{Cloud, Surface, Vector3};
use visage_picture::camera::{Axes, Camera, Side};
use visage_picture::image::Image;
use visage_picture::raster::{Paint, render};
use visage_picture::size::Size;

/// Points that are drawn of a scan: more than there are pixels say nothing more.
const MOST_POINTS: usize = 300_000;
/// Scans on a sheet.
pub const ON_A_SHEET: usize = 4;

/// One scan, from where the scanner stood if that is known. Runs inside the caller's rayon pool.
///
/// # Errors
/// [`Canceled`], while it is at work.
pub fn picture(scan: &Surface, side: Side, size: Size, progress: &Progress) -> Result<Image, Canceled> {
    let thinned;
    let is_cloud = scan.faces.is_empty();
    let scan = if is_cloud && scan.cloud.len() > MOST_POINTS {
        thinned = Surface { cloud: some_of(&scan.cloud), ..Surface::default() };
        &thinned
    } else {
        scan
    };
    let points = &scan.cloud.points;
    let toward = scan.sensor.filter(|_| side == Side::Default).map(|sensor| sensor - scan.cloud.centroid());
    let axes = match toward {
        Some(toward) => Axes::looking(toward, up_of_sensor(&-toward)),
        None => upright(Axes::of_side(side), points),
    };
    let camera = Camera::fit(points, axes, size, side == Side::Default);
    Ok(render(&scene(scan, scan.cloud.colors.as_deref(), Paint::Material), &camera, size, progress)?.image)
}

/// What is up for a sensor that looks into a direction of its own frame: cameras look along z with y down, or against it with y up;
/// what stands on a tripod has z up.
fn up_of_sensor(forward: &Vector3) -> Vector3 {
    let is_camera = forward.z.abs() > forward.x.abs().max(forward.y.abs());
    if !is_camera { Vector3::z() } else { Vector3::y() * -forward.z.signum() }
}

/// Every so-many-th point.
fn some_of(cloud: &Cloud) -> Cloud {
    let step = cloud.len().div_ceil(MOST_POINTS).max(1);
    cloud.kept(&(0..cloud.len()).map(|index| index % step == 0).collect::<Vec<_>>())
}

/// Which of so many scans are on a sheet.
pub fn on_sheet(count: usize) -> Vec<usize> {
    let shown = count.min(ON_A_SHEET);
    (0..shown).map(|place| place * count / shown).collect()
}

/// The size of each of so many pictures on a sheet.
pub fn size_on_sheet(count: usize, size: Size) -> Size {
    let [columns, rows] = cells(count);
    Size::clamped(size.width() / columns, size.height() / rows)
}

/// Several pictures on one, row by row.
pub fn sheet(pictures: &[Image], size: Size) -> Image {
    let mut sheet = Image::new(size, visage_picture::color::GROUND);
    let [columns, rows] = cells(pictures.len());
    for (index, picture) in pictures.iter().enumerate() {
        let (column, row) = (index as u32 % columns, index as u32 / columns);
        sheet.put(i64::from(column * size.width() / columns), i64::from(row * size.height() / rows), picture);
    }
    sheet
}

fn cells(count: usize) -> [u32; 2] {
    match count {
        0 | 1 => [1, 1],
        2 => [2, 1],
        _ => [2, 2],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_geometry::Point3;

    #[test]
    fn a_sheet_shows_scans_from_all_over_the_set() {
        assert!(on_sheet(0).is_empty());
        assert_eq!(on_sheet(3), [0, 1, 2]);
        assert_eq!(on_sheet(10), [0, 2, 5, 7]);
        let size = Size::clamped(100, 80);
        assert_eq!(size_on_sheet(4, size), Size::clamped(50, 40));
        let red = Image::new(size_on_sheet(3, size), [200, 0, 0]);
        let sheet = sheet(&[red.clone(), red.clone(), red], size);
        assert_eq!([sheet.at(10, 10), sheet.at(60, 10), sheet.at(10, 60)], [Some([200, 0, 0]); 3]);
        assert_eq!(sheet.at(60, 60), Some(visage_picture::color::GROUND));
    }

    #[test]
    fn what_a_camera_saw_is_not_upside_down() {
        // a plate before a camera whose y goes down, with a bar at its upper edge
        let place = |k: usize| {
            let (x, y) = ((k % 60) as f64 - 30.0, (k / 60) as f64 - 30.0);
            Point3::new(x, y, 200.0)
        };
        let points: Vec<Point3> = (0..3600).map(place).collect();
        let colors = points.iter().map(|p| if p.y < -20.0 { [200, 0, 0] } else { [0, 0, 200] }).collect();
        let cloud = Cloud { points, colors: Some(colors), ..Cloud::default() };
        let of = |cloud: &Cloud, sensor| Surface { cloud: cloud.clone(), sensor, ..Surface::default() };
        let size = Size::clamped(64, 64);
        let opengl =
            Cloud { points: cloud.points.iter().map(|p| Point3::new(p.x, -p.y, -p.z)).collect(), ..cloud.clone() };
        for scan in [
            of(&cloud, Some(Point3::origin())),
            of(&cloud, None),
            of(&opengl, Some(Point3::origin())),
            of(&opengl, None),
        ] {
            let image = picture(&scan, Side::Default, size, &Progress::silent()).expect("not canceled");
            let reds = |rows: std::ops::Range<i64>| {
                let places = rows.flat_map(|y| (0..64).map(move |x| (x, y)));
                places.filter(|(x, y)| image.at(*x, *y).is_some_and(|[r, _, b]| r > 60 && b < 60)).count()
            };
            assert!(reds(0..32) > 100 && reds(32..64) == 0, "{} {}", reds(0..32), reds(32..64));
        }
    }

    #[test]
    fn a_scan_is_seen_from_where_its_scanner_stood() {
        let points = (0..2500).map(|k| Point3::new(0.0, f64::from(k % 50), f64::from(k / 50))).collect();
        let plate = |sensor| Surface { cloud: Cloud::from_points(points), sensor, ..Surface::default() };
        let size = Size::clamped(64, 64);
        let drawn = picture(&plate(Some(Point3::new(100.0, 25.0, 25.0))), Side::Default, size, &Progress::silent());
        let covered =
            drawn.expect("not canceled").pixels().iter().filter(|p| **p != visage_picture::color::GROUND).count();
        assert!(covered > 2000, "the whole plate: {covered}");
    }
}
