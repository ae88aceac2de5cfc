//! Mouth corners and chin. They lie outside of the fitted region, since every expression moves them; the carried
//! places only say where to look on the surface itself.

use super::dense_fit::Placement;
use super::target::Target;
use crate::saliency::quadric::Neighbours;
use visage_geometry::{Point3, Vector3};

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// The crease between the lips is looked for within this of the carried corner, mm on the standard: across, up, out.
        mouth_reach_mm: [f64; 3] = [2.5, 10.0, 15.0],
        /// The radius of the fits that find it, mm,
        crease_radius_mm: f64 = 5.0,
        /// and with so many neighbours at least.
        crease_neighbours: u32 = 10,
        /// The deepest places are averaged.
        deepest: usize = 3,
        /// A crease bends at least this much, one over mm: smoother skin shows no mouth.
        least_bend: f64 = 0.04,
        /// From the crease to the corner, mm: inward, up, out; the medians over the models with exact landmarks.
        corner_offset_mm: [f64; 3] = [0.6, 0.6, -0.4],
        /// The chin is looked for within this of the carried place, mm: to either side, up or down, inward.
        chin_reach_mm: [f64; 3] = [15.0, 20.0, 25.0],
        /// Where it stands out most, half down and half forward, by at most this less, mm.
        chin_cap_mm: f64 = 1.0,
        /// An extreme place this near to the lower end of what was looked at is none, mm: a neck or a chest follows.
        end_mm: f64 = 2.0,
    }
}

/// A sample near a landmark, in the standard's frame.
struct Near {
    sample: usize,
    point: Point3,
}

/// The corner of the mouth beside the carried one: where the surface bends inward most along the height. `None` if
/// it hardly does.
pub fn mouth_corner(target: &Target, placement: &Placement, carried: &Point3) -> Option<Point3> {
    let strip = within(target, placement, carried, TUNING.mouth_reach_mm);
    let mut bends: Vec<(f64, &Near)> = strip
        .iter()
        .filter_map(|near| Some((bend(target, placement, near)?, near)))
        .filter(|(bend, _)| *bend > TUNING.least_bend)
        .collect();
    bends.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.sample.cmp(&b.1.sample)));
    bends.truncate(TUNING.deepest);
    let crease = mean(bends.iter().map(|(_, near)| near.point))?;
    let [inward, up, out] = TUNING.corner_offset_mm;
    Some(Point3::new(carried.x - inward * carried.x.signum(), crease.y + up, crease.z + out))
}

/// How fast the slope along the height grows, one over mm: positive in a crease. `None` with too few neighbours.
fn bend(target: &Target, placement: &Placement, near: &Near) -> Option<f64> {
    let pose = &placement.pose;
    let mut neighbours = Neighbours::new(TUNING.crease_radius_mm);
    let center = target.samples.points[near.sample];
    target.grid.for_each_within(&center, TUNING.crease_radius_mm * pose.scale, |other, distance2| {
        if target.samples.normals[other].dot(&target.samples.normals[near.sample]) > 0.0 {
            let offset = pose.standard_point(&target.samples.points[other]) - near.point;
            neighbours.push(offset.x, offset.y, offset.z, distance2 / (pose.scale * pose.scale));
        }
    });
    let fit = neighbours.fit(TUNING.crease_radius_mm);
    if fit.neighbours < TUNING.crease_neighbours {
        return None;
    }
    let [_, _, along_height, _, slope, _] = fit.coefficients()?;
    Some(2.0 * along_height / TUNING.crease_radius_mm / (1.0 + slope * slope).powf(1.5))
}

/// The chin: what stands out most, half down and half forward. `None` if that is where the surface ends or where it
/// goes on to something else.
pub fn chin(target: &Target, placement: &Placement, carried: &Point3) -> Option<Point3> {
    let region = within(target, placement, carried, TUNING.chin_reach_mm);
    let height = |near: &Near| (near.point.z - near.point.y) * std::f64::consts::FRAC_1_SQRT_2;
    let highest = region.iter().max_by(|a, b| height(a).total_cmp(&height(b)).then(b.sample.cmp(&a.sample)))?;
    if target.is_on_rim(highest.sample) || highest.point.y < carried.y - TUNING.chin_reach_mm[1] + TUNING.end_mm {
        return None;
    }
    let cap = region.iter().filter(|near| height(near) > height(highest) - TUNING.chin_cap_mm);
    mean(cap.map(|near| near.point))
}

/// The samples that look forward within a box around a place.
fn within(target: &Target, placement: &Placement, center: &Point3, reach_mm: [f64; 3]) -> Vec<Near> {
    let pose = &placement.pose;
    let reach = Vector3::from(reach_mm);
    let forward = pose.motion.rotation * Vector3::z() * target.sign;
    let mut found = Vec::new();
    let radius = reach.norm() * pose.scale * pose.stretch.max();
    target.grid.for_each_within(&pose.point(center), radius, |sample, _| {
        let point = pose.standard_point(&target.samples.points[sample]);
        let inside = (point - center).abs() <= reach;
        if inside && target.samples.normals[sample].dot(&forward) > 0.1 {
            found.push(Near { sample, point });
        }
    });
    found
}

fn mean(points: impl Iterator<Item = Point3>) -> Option<Point3> {
    let (sum, count) = points.fold((Vector3::zeros(), 0.0), |(sum, count), p| (sum + p.coords, count + 1.0));
    (count > 0.0).then(|| Point3::from(sum / count))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::faces::modes::Weights;
    use crate::faces::similarity::Similarity;
    use crate::saliency::{CellGrid, Samples};
    use visage_geometry::Motion;

    /// A lower face: a crease along y = `mouth`, and a chin that rounds off below `chin`.
    fn lower_face(mouth: f64, chin: f64, pose: &Similarity) -> Samples {
        let height = |x: f64, y: f64| {
            let crease = 4.0 * (-((y - mouth) / 4.0).powi(2)).exp();
            let below = (chin + 8.0 - y).max(0.0);
            110.0 - x * x / 120.0 - crease - below * below / 20.0
        };
        let places = (0..67 * 60).map(|k| (f64::from(k % 67) * 1.5 - 49.5, f64::from(k / 67) * 1.5 - 100.0));
        let mut samples = Samples { spacing: 1.5 * pose.scale, ..Samples::default() };
        for (x, y) in places {
            let slope = |dx: f64, dy: f64| (height(x + dx, y + dy) - height(x - dx, y - dy)) / 0.02;
            samples.points.push(pose.point(&Point3::new(x, y, height(x, y))));
            samples.normals.push(pose.normal(&Vector3::new(-slope(0.01, 0.0), -slope(0.0, 0.01), 1.0).normalize()));
            samples.areas.push(1.0);
        }
        samples
    }

    fn placed() -> Placement {
        let motion = Motion::new(Vector3::new(5.0, 1.0, -2.0), Vector3::new(0.5, -2.0, 0.3));
        let pose = Similarity { scale: 0.02, stretch: Vector3::repeat(1.0), motion };
        Placement { pose, weights: Weights::zeros() }
    }

    #[test]
    fn the_crease_gives_the_corner_its_height_and_the_chin_is_where_it_turns_down() {
        let placement = placed();
        let samples = lower_face(-41.0, -80.0, &placement.pose);
        let grid = CellGrid::new(&samples.points, 2.0 * samples.spacing);
        let target = Target { samples: &samples, grid: &grid, sign: 1.0 };
        let corner = mouth_corner(&target, &placement, &Point3::new(25.0, -36.0, 101.0)).expect("a crease");
        assert!((corner.y - (-41.0 + TUNING.corner_offset_mm[1])).abs() < 1.0 && corner.x < 25.0, "{corner}");
        // the slope is 1 at 10 mm below where the rounding begins
        let found = chin(&target, &placement, &Point3::new(0.0, -76.0, 104.0)).expect("a chin");
        assert!((found.y - -82.0).abs() < 2.0 && found.x.abs() < 1.0, "{found}");
    }

    #[test]
    fn smooth_skin_has_no_mouth_and_a_surface_that_ends_no_chin() {
        let placement = placed();
        let samples = lower_face(-300.0, -130.0, &placement.pose);
        let grid = CellGrid::new(&samples.points, 2.0 * samples.spacing);
        let target = Target { samples: &samples, grid: &grid, sign: 1.0 };
        assert_eq!(mouth_corner(&target, &placement, &Point3::new(25.0, -36.0, 105.0)), None);
        assert_eq!(chin(&target, &placement, &Point3::new(0.0, -85.0, 108.0)), None);
    }
}
