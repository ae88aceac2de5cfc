//! The landmarks of a face: carried over by the fitted standard, then moved to where the surface itself shows them.

use super::dense_fit::Placement;
use super::lower_face;
use super::modes::{self, LANDMARKS};
use super::target::Target;
use crate::saliency::Samples;
use visage_geometry::{Point3, Vector3};

/// The landmarks in the order of [`LANDMARKS`], in the model's frame and unit.
pub type Landmarks = [Point3; LANDMARKS.len()];

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// An extremum is one if it lies within this share of the radius that was looked at; else its neighbourhood is looked at
        /// next.
        inner_share: f64 = 0.8,
        /// So many neighbourhoods are looked at, at most.
        most_steps: usize = 4,
        /// Carried landmarks are brought onto the surface if it is this near, mm on the standard.
        on_surface_mm: f64 = 4.0,
        /// The samples around an extremum within this are averaged, mm on the standard.
        smoothing_mm: f64 = 2.5,
    }
}

/// Where a landmark shows on the surface: the point that lies farthest in a direction of the standard's frame, within
/// a radius around the carried place, and where the landmark is from there. Both were measured on the heads whose
/// landmarks are exact.
struct Extremum {
    landmark: &'static str,
    direction: [f64; 3],
    radius_mm: f64,
    offset_mm: [f64; 3],
    /// How much it counts against the carried place, up to `trusted_mm` from there: beyond, the standard doesn't fit and
    /// only the surface counts.
    weight: f64,
    trusted_mm: f64,
    /// A refinement farther than this from where the standard says is none, mm on the standard. Nothing stands out like
    /// the nose for far around it; another pit is near the eye's.
    most_move_mm: f64,
}

/// The nose's apex seen 15 degrees from above, and the pits of the inner eye corners: their deepest points lie inward
/// of the corners and above them.
const EXTREMA: [Extremum; 3] = [
    Extremum {
        landmark: "nose_tip",
        direction: [0.0, 0.26, 0.97],
        radius_mm: 10.0,
        offset_mm: [0.0, 0.0, 0.0],
        weight: 0.7,
        trusted_mm: 5.0,
        most_move_mm: 20.0,
    },
    Extremum {
        landmark: "eye_r_inner",
        direction: [0.0, 0.0, -1.0],
        radius_mm: 8.0,
        offset_mm: [-3.4, -1.5, 0.8],
        weight: 0.5,
        trusted_mm: 5.0,
        most_move_mm: 5.0,
    },
    Extremum {
        landmark: "eye_l_inner",
        direction: [0.0, 0.0, -1.0],
        radius_mm: 8.0,
        offset_mm: [3.4, -1.5, 0.8],
        weight: 0.5,
        trusted_mm: 5.0,
        most_move_mm: 5.0,
    },
];

/// Looks for a landmark on the surface around its carried place.
type Find = fn(&Target, &Placement, &Point3) -> Option<Point3>;

/// The landmarks that expressions move.
const READ_OFF: [(&str, Find); 3] =
    [("mouth_r", lower_face::mouth_corner), ("mouth_l", lower_face::mouth_corner), ("chin", lower_face::chin)];

/// The landmarks of the face that was found at `placement`. A refinement that leaves its neighbourhood is dropped.
pub fn landmarks(target: &Target, placement: &Placement) -> Landmarks {
    let pose = &placement.pose;
    let mut carried = modes::landmarks(&placement.weights);
    for extremum in &EXTREMA {
        let Some(index) = LANDMARKS.iter().position(|name| *name == extremum.landmark) else { continue };
        if let Some(found) = extremum.find(target, placement, &carried[index]) {
            let away = found - carried[index];
            carried[index] += away * if away.norm() > extremum.trusted_mm { 1.0 } else { extremum.weight };
        }
    }
    for (name, find) in READ_OFF {
        let Some(index) = LANDMARKS.iter().position(|landmark| *landmark == name) else { continue };
        carried[index] = find(target, placement, &carried[index]).unwrap_or(carried[index]);
    }
    carried.map(|place| {
        let point = pose.point(&place);
        let near = target.grid.nearest_where(&point, TUNING.on_surface_mm * pose.scale, |_| true);
        near.map_or(point, |(sample, _)| on_plane(target.samples, sample, &point))
    })
}

impl Extremum {
    /// The landmark by the extremum, in the standard's frame; `None` if it isn't a proper one.
    fn find(&self, target: &Target, placement: &Placement, carried: &Point3) -> Option<Point3> {
        let pose = &placement.pose;
        let expected = carried - Vector3::from(self.offset_mm);
        let extreme = self.climbed(target, placement, pose.point(&expected))?;
        let (mut sum, mut count) = (Vector3::zeros(), 0.0);
        let around = target.samples.points[extreme];
        target.grid.for_each_within(&around, TUNING.smoothing_mm * pose.scale, |sample, _| {
            sum += target.samples.points[sample] - around;
            count += 1.0;
        });
        let found = pose.standard_point(&(around + sum / f64::max(count, 1.0))) + Vector3::from(self.offset_mm);
        ((found - carried).norm() <= self.most_move_mm).then_some(found)
    }

    /// The sample that lies farthest in the direction, looked for around `center` and then around what was found, until
    /// that stays.
    fn climbed(&self, target: &Target, placement: &Placement, mut center: Point3) -> Option<usize> {
        let pose = &placement.pose;
        let direction = (pose.motion.rotation * Vector3::from(self.direction)).normalize();
        let radius = self.radius_mm * pose.scale;
        let mut extreme = None;
        for _ in 0..TUNING.most_steps {
            let mut best: Option<(f64, usize)> = None;
            target.grid.for_each_within(&center, radius, |sample, _| {
                let height = direction.dot(&(target.samples.points[sample] - center));
                if best.is_none_or(|(most, _)| height > most) {
                    best = Some((height, sample));
                }
            });
            let (_, sample) = best?;
            let point = target.samples.points[sample];
            extreme = Some(sample);
            if (point - center).norm() < TUNING.inner_share * radius || self.most_move_mm <= self.radius_mm {
                break;
            }
            center = point;
        }
        extreme
    }
}

/// The point brought onto the tangent plane of a sample.
fn on_plane(samples: &Samples, sample: usize, point: &Point3) -> Point3 {
    let normal = samples.normals[sample];
    point - normal * normal.dot(&(point - samples.points[sample]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::faces::modes::Weights;
    use crate::faces::similarity::Similarity;
    use crate::saliency::CellGrid;
    use visage_geometry::Motion;

    /// A vault with a nose whose middle is at height `tip`.
    fn nosed(tip: f64, pose: &Similarity) -> Samples {
        let mut samples = Samples { spacing: 1.5 * pose.scale, ..Samples::default() };
        for k in 0..61 * 81 {
            let (x, y) = (f64::from(k % 61) * 1.5 - 45.0, f64::from(k / 61) * 1.5 - 60.0);
            let nose = 22.0 * (-(x / 9.0).powi(2) - ((y - tip) / 20.0).powi(2)).exp();
            samples.points.push(pose.point(&Point3::new(x, y, 110.0 - x * x / 120.0 + nose)));
            samples.normals.push(pose.normal(&Vector3::z()));
            samples.areas.push(1.0);
        }
        samples
    }

    #[test]
    fn the_nose_is_climbed_to_from_where_the_standard_expects_it() {
        let motion = Motion::new(Vector3::new(5.0, 1.0, -2.0), Vector3::new(0.5, -2.0, 0.3));
        let pose = Similarity { scale: 0.02, stretch: Vector3::repeat(1.0), motion };
        let placement = Placement { pose, weights: Weights::zeros() };
        let index = LANDMARKS.iter().position(|name| *name == "nose_tip").expect("a landmark");
        let carried = modes::landmarks(&placement.weights)[index];
        for (off, is_reached) in [(13.0, true), (40.0, false)] {
            let samples = nosed(carried.y + off, &pose);
            let grid = CellGrid::new(&samples.points, 2.0 * samples.spacing);
            let target = Target { samples: &samples, grid: &grid, sign: 1.0 };
            let found = pose.standard_point(&landmarks(&target, &placement)[index]);
            // seen 15 degrees from above the apex lies 2.4 mm higher
            let beside = (found.y - carried.y - off - 2.4).abs();
            assert_eq!(beside < 2.0 && found.x.abs() < 1.0, is_reached, "{off}: {found} for {carried}");
        }
    }
}
