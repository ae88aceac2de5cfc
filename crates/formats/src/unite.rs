//! Several scans of a file as one surface.

use super::reading::{Dropped, Reading, ScanReading};
use super::{FormatError, ReadLimits, checked_coordinate};
use visage_geometry::{Cloud, Point3, Surface};

/// The scans of one file as one surface, each moved to where the file says that it is. Grids and places of scanners
/// belong to single scans: those of several are left out.
pub(super) fn unite(scans: Vec<ScanReading>, limits: &ReadLimits) -> Result<Reading, FormatError> {
    let count = scans.len();
    let (points, faces) = scans.iter().map(|scan| &scan.reading.surface).fold((0, 0), |(points, faces), surface| {
        (points + surface.cloud.len() as u64, faces + surface.faces.len() as u64)
    });
    for (what, found, limit) in [("points", points, limits.most_points()), ("faces", faces, limits.max_faces)] {
        if found > limit {
            return Err(FormatError::TooLarge { what, found, limit });
        }
    }
    let mut scans = scans.into_iter().map(placed);
    let Some(first) = scans.next() else {
        let problem = "there are no scans in it";
        return Err(FormatError::malformed("the whole file", problem, "send a file with points"));
    };
    let (_, first) = first?;
    if count == 1 {
        return Ok(first);
    }
    let mut united =
        Reading { surface: Surface::default(), ..Reading { dropped: Dropped::default(), ..first.clone() } };
    let mut had_grid = false;
    for (index, placed) in std::iter::once(Ok((None, first))).chain(scans).enumerate() {
        let (name, reading) = placed?;
        let name = name.unwrap_or_else(|| format!("scan {}", index + 1));
        let Reading { surface, dropped, unit } = reading;
        if unit != united.unit {
            let problem = format!("{name} has another unit than the scans before it");
            return Err(FormatError::malformed("the whole file", problem, "export the scans with one unit"));
        }
        had_grid |= surface.grid.is_some();
        united.dropped.add(dropped, &name);
        append(&mut united, surface);
    }
    if had_grid {
        united.dropped.notes.push(format!("the range grids of {count} scans, which are read as one surface"));
    }
    Ok(united)
}

/// A scan in the frame that the file's scans share.
///
/// # Errors
/// [`FormatError::Malformed`] if its pose takes it beyond what counts as a coordinate.
fn placed(scan: ScanReading) -> Result<(Option<String>, Reading), FormatError> {
    let ScanReading { name, mut reading, world_from_scan } = scan;
    if let Some(motion) = world_from_scan {
        reading.surface = reading.surface.moved(&motion);
        let is_far = |point: &Point3| point.iter().any(|x| checked_coordinate(*x).is_err());
        if reading.surface.cloud.points.iter().any(is_far) {
            let place = name.unwrap_or_else(|| "a scan".to_owned());
            let remedy = "export the scans with coordinates near the origin";
            return Err(FormatError::malformed(place, "its pose takes points too far from the origin", remedy));
        }
    }
    Ok((name, reading))
}

/// Takes the points and triangles of another surface. Points without an attribute that others have are without a sound
/// one.
fn append(united: &mut Reading, surface: Surface) {
    let Surface { cloud, faces, .. } = surface;
    let Reading { surface: Surface { cloud: whole, faces: all, .. }, dropped, .. } = united;
    let (before, added) = (whole.len(), cloud.len());
    let Cloud { points, normals, colors, intensities } = cloud;
    whole.points.extend(points);
    dropped.normals += join(&mut whole.normals, normals, before, added);
    dropped.colors += join(&mut whole.colors, colors, before, added);
    dropped.intensities += join(&mut whole.intensities, intensities, before, added);
    all.extend(faces.into_iter().map(|face| face.map(|vertex| vertex + before as u32)));
}

/// Appends the values of an attribute; gives the number of points that were first found to be without.
fn join<T: Clone + Default>(all: &mut Option<Vec<T>>, values: Option<Vec<T>>, before: usize, added: usize) -> u64 {
    match (all.as_mut(), values) {
        (None, None) => 0,
        (Some(all), Some(values)) => {
            all.extend(values);
            0
        }
        (Some(all), None) => {
            all.resize(before + added, T::default());
            added as u64
        }
        (None, Some(values)) => {
            *all = Some([vec![T::default(); before], values].concat());
            before as u64
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::DeclaredUnit;
    use visage_geometry::{Motion, Point3, RangeGrid};

    fn scan(x: f64, color: Option<[u8; 3]>) -> ScanReading {
        let mut cloud = Cloud::from_points(vec![Point3::new(x, 0.0, 0.0), Point3::new(x, 1.0, 0.0)]);
        cloud.colors = color.map(|color| vec![color; 2]);
        let surface = Surface { cloud, faces: vec![[0, 1, 0]], grid: None, sensor: Some(Point3::origin()) };
        let reading = Reading { surface, dropped: Dropped::default(), unit: Some(DeclaredUnit::METRE) };
        ScanReading { name: None, reading, world_from_scan: Some(Motion::translation(0.0, 0.0, x)) }
    }

    #[test]
    fn scans_are_united_in_the_frame_that_they_share() {
        let limits = ReadLimits::default();
        let mut second = scan(2.0, Some([9; 3]));
        second.name = Some("door".into());
        second.reading.dropped.notes.push("a word".into());
        second.reading.surface.grid = Some(RangeGrid { columns: 1, rows: 2, pixels: vec![0, 1] });
        let united = unite(vec![scan(1.0, None), second, scan(3.0, None)], &limits).expect("three");
        let surface = united.surface;
        assert_eq!(surface.cloud.points[2..4], [Point3::new(2.0, 0.0, 2.0), Point3::new(2.0, 1.0, 2.0)]);
        assert_eq!(surface.cloud.colors, Some(vec![[0; 3], [0; 3], [9; 3], [9; 3], [0; 3], [0; 3]]));
        assert_eq!(surface.faces, [[0, 1, 0], [2, 3, 2], [4, 5, 4]]);
        assert_eq!((surface.grid, surface.sensor, united.unit), (None, None, Some(DeclaredUnit::METRE)));
        assert_eq!(united.dropped.colors, 4);
        let note = "the range grids of 3 scans, which are read as one surface";
        assert_eq!(united.dropped.notes, ["door: a word", note]);
    }

    #[test]
    fn one_scan_stays_what_it_is_but_for_its_place() {
        let one = unite(vec![scan(1.0, None)], &ReadLimits::default()).expect("one").surface;
        assert_eq!((one.cloud.points[0], one.sensor), (Point3::new(1.0, 0.0, 1.0), Some(Point3::new(0.0, 0.0, 1.0))));
    }

    #[test]
    fn a_pose_that_takes_points_beyond_all_coordinates_is_refused() {
        let mut far = scan(1.0, None);
        far.world_from_scan = Some(Motion::translation(visage_geometry::MAX_COORDINATE, 0.0, 0.0));
        let error = unite(vec![scan(1.0, None), far], &ReadLimits::default()).expect_err("too far").to_string();
        assert!(error.contains("too far from the origin"), "{error}");
    }

    #[test]
    fn no_scans_too_many_points_and_two_units_are_refused() {
        let limits = ReadLimits { max_points: 3, ..ReadLimits::default() };
        assert!(unite(Vec::new(), &limits).is_err());
        let two = vec![scan(1.0, None), scan(2.0, None)];
        assert_eq!(unite(two, &limits), Err(FormatError::TooLarge { what: "points", found: 4, limit: 3 }));
        let mut other = scan(2.0, None);
        other.reading.unit = None;
        let error = unite(vec![scan(1.0, None), other], &ReadLimits::default()).expect_err("units").to_string();
        assert!(error.contains("scan 2 has another unit than the scans before it"), "{error}");
    }
}
