//! A point cloud with the attributes that a scan may carry.

use super::{Motion, Point3, Vector3};

/// Points in file order, in the unit of the file, with optional attributes of the same length.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Cloud {
    /// Positions.
    pub points: Vec<Point3>,
    /// Unit normals, outward where known.
    pub normals: Option<Vec<nalgebra::Vector3<f32>>>,
    /// Red, green, blue.
    pub colors: Option<Vec<[u8; 3]>>,
    /// The scanner's return strength, in the scanner's own scale.
    pub intensities: Option<Vec<f32>>,
}

/// An axis-aligned box.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// The smallest coordinate along each axis.
    pub min: Point3,
    /// The largest coordinate along each axis.
    pub max: Point3,
}

impl Bounds {
    /// The smallest box around `points`, or `None` if there are none.
    pub fn of<'a>(points: impl IntoIterator<Item = &'a Point3>) -> Option<Bounds> {
        let mut points = points.into_iter();
        let first = *points.next()?;
        Some(points.fold(Bounds { min: first, max: first }, |bounds, p| bounds.with(p)))
    }

    /// The smallest box around this one and a point.
    #[inline]
    pub fn with(&self, point: &Point3) -> Bounds {
        Bounds { min: self.min.inf(point), max: self.max.sup(point) }
    }

    /// The length of the box's diagonal.
    #[inline]
    pub fn diagonal(&self) -> f64 {
        (self.max - self.min).norm()
    }

    /// The middle of the box.
    #[inline]
    pub fn center(&self) -> Point3 {
        nalgebra::center(&self.min, &self.max)
    }
}

impl Cloud {
    /// A cloud of bare positions.
    #[inline]
    pub fn from_points(points: Vec<Point3>) -> Self {
        Cloud { points, ..Cloud::default() }
    }

    /// The number of points.
    #[inline]
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether there are no points.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// The box around all points, or `None` for an empty cloud.
    #[inline]
    pub fn bounds(&self) -> Option<Bounds> {
        Bounds::of(&self.points)
    }

    /// The mean position (the origin for an empty cloud).
    #[inline]
    pub fn centroid(&self) -> Point3 {
        let sum: Vector3 = self.points.iter().map(|p| p.coords).sum();
        Point3::from(sum / self.points.len().max(1) as f64)
    }

    /// The points for which `kept` holds, in order, with their attributes.
    #[inline]
    pub fn kept(&self, kept: &[bool]) -> Cloud {
        fn of<T: Clone>(values: &[T], kept: &[bool]) -> Vec<T> {
            values.iter().zip(kept).filter(|(_, kept)| **kept).map(|(value, _)| value.clone()).collect()
        }
        Cloud {
            points: of(&self.points, kept),
            normals: self.normals.as_ref().map(|normals| of(normals, kept)),
            colors: self.colors.as_ref().map(|colors| of(colors, kept)),
            intensities: self.intensities.as_ref().map(|intensities| of(intensities, kept)),
        }
    }

    /// The same cloud moved by `motion`: positions and normals turn, other attributes stay.
    #[inline]
    pub fn moved(&self, motion: &Motion) -> Cloud {
        let rotation = motion.rotation.cast::<f32>();
        Cloud {
            points: self.points.iter().map(|p| motion * p).collect(),
            normals: self.normals.as_ref().map(|normals| normals.iter().map(|n| rotation * n).collect()),
            colors: self.colors.clone(),
            intensities: self.intensities.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_and_centroid_of_two_points() {
        let cloud = Cloud::from_points(vec![Point3::new(0.0, 2.0, 0.0), Point3::new(3.0, -2.0, 0.0)]);
        let bounds = cloud.bounds().expect("two points have bounds");
        assert_eq!(bounds.diagonal(), 5.0);
        assert_eq!(bounds.center(), Point3::new(1.5, 0.0, 0.0));
        assert_eq!(cloud.centroid(), bounds.center());
    }

    #[test]
    fn an_empty_cloud_has_no_bounds() {
        assert_eq!(Cloud::default().bounds(), None);
    }

    #[test]
    fn moving_turns_normals_but_does_not_shift_them() {
        let mut cloud = Cloud::from_points(vec![Point3::new(1.0, 0.0, 0.0)]);
        cloud.normals = Some(vec![nalgebra::Vector3::x()]);
        let motion = Motion::new(Vector3::new(0.0, 0.0, 5.0), Vector3::z() * std::f64::consts::FRAC_PI_2);
        let moved = cloud.moved(&motion);
        assert!((moved.points[0] - Point3::new(0.0, 1.0, 5.0)).norm() < 1e-12);
        let normal = moved.normals.expect("normals are kept")[0];
        assert!((normal - nalgebra::Vector3::y()).norm() < 1e-6);
    }
}
