//! Whether a single scan would have looked like this if it were of the model: what of the model the scanner would have seen, held against
//! what it saw.
//!
//! Where the scanner stood is known for few scans. Else its direction is read off the surfaces that it saw. A sheet looks the same from behind,
//! so both sides are tried, and the one that speaks less against the model counts.

use visage_geometry::neighbours::LocalPoint;
use visage_geometry::{Point3, Vector3};
use visage_registration::sensor::depth_image::{DepthImage, Seen};
use visage_registration::sensor::{Facet, Sensor, viewing_axis};
use visage_shape::descriptor::SampledShape;

use super::pose::Pose;

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// The edge of a cell of the images, in mean distances of the scan from its centroid: some samples each.
        cell: f64 = 0.06,
        /// Surfaces that differ less than this along the sight are one, in the same unit: two cells at a slant of 45 degrees.
        thick: f32 = 0.12,
        /// Scanners see nothing of surface that is nearly along their sight: the least cosine.
        grazing: f64 = 0.25,
    }
}

/// A scan as its scanner saw it, from either side if it is not known from which.
pub(super) struct Sight {
    images: Vec<(Sensor, DepthImage)>,
    center: Point3,
    unit: f64,
}

/// What the scanner would have seen of a model, as shares.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sighted {
    /// Stands where the scanner looked through.
    pub in_front: f64,
    /// Stands where it saw nothing.
    pub missed: f64,
    /// Is behind what it saw.
    pub behind: f64,
}

impl Sighted {
    /// All that speaks against the model.
    pub fn against(&self) -> f64 {
        self.in_front + self.missed + self.behind
    }
}

impl Sight {
    /// That of a scan; `scanner`: where it stood, if that is known.
    pub fn of(scan: &SampledShape, scanner: Option<Point3>) -> Sight {
        let (center, unit) = (scan.whole[0].center, scan.whole[0].size);
        let points: Vec<LocalPoint> = scan.points.iter().map(|p| local(p, &center, unit)).collect();
        let sensors = match scanner {
            Some(place) => vec![Sensor::At((place - center) / unit)],
            None => {
                // samples are spread evenly
                let facet = |n: &Vector3| Facet { normal: n.cast::<f32>(), density: 1.0 };
                let toward = Sensor::Toward(viewing_axis(&scan.normals.iter().map(facet).collect::<Vec<_>>()));
                vec![toward, toward.reversed()]
            }
        };
        let image = |sensor: Sensor| (sensor, DepthImage::new(&points, &sensor, TUNING.cell));
        Sight { images: sensors.into_iter().map(image).collect(), center, unit }
    }

    /// What it would have seen of a model under the scan's pose.
    pub fn of_model(&self, model: &SampledShape, pose: &Pose) -> Sighted {
        let points: Vec<LocalPoint> =
            model.points.iter().map(|p| local(&pose.probe_point(p), &self.center, self.unit)).collect();
        let normals: Vec<Vector3> = model.normals.iter().map(|n| pose.probe_direction(n)).collect();
        let from = |(sensor, image): &(Sensor, DepthImage)| sighted(&points, &normals, sensor, image);
        let all = self.images.iter().map(from);
        let nothing = Sighted { in_front: 0.0, missed: 1.0, behind: 0.0 };
        all.min_by(|a, b| a.against().total_cmp(&b.against())).unwrap_or(nothing)
    }
}

fn local(p: &Point3, center: &Point3, unit: f64) -> LocalPoint {
    ((p - center) / unit).cast::<f32>().into()
}

fn sighted(points: &[LocalPoint], normals: &[Vector3], sensor: &Sensor, image: &DepthImage) -> Sighted {
    let own = DepthImage::new(points, sensor, TUNING.cell);
    let [mut in_front, mut missed, mut behind, mut all] = [0.0; 4];
    for (point, normal) in points.iter().zip(normals) {
        let toward = sensor.direction_from(point);
        if normal.dot(&toward).abs() < TUNING.grazing * toward.norm() {
            continue;
        }
        let place = (*point).into();
        match own.look(&place) {
            Seen::Surface { height } if height > -TUNING.thick => {}
            _ => continue,
        }
        match image.look(&place) {
            Seen::Surface { height } if height > TUNING.thick => in_front += 1.0,
            Seen::Surface { height } if height < -TUNING.thick => behind += 1.0,
            Seen::Nothing => missed += 1.0,
            Seen::Surface { .. } => {}
            Seen::Rim | Seen::Unknown => continue,
        }
        all += 1.0;
    }
    let share = |count: f64| if all > 0.0 { count / all } else { 0.0 };
    let missed = if all > 0.0 { share(missed) } else { 1.0 };
    Sighted { in_front: share(in_front), missed, behind: share(behind) }
}
