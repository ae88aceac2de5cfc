//! What a pose may mean: programs differ in its direction and in the axes of a camera.

use super::{Motion, Vector3};

/// How a pose that stands in a file is to be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, strum::IntoStaticStr)]
#[strum(serialize_all = "snake_case")]
pub enum PoseConvention {
    /// It maps the scan into the world: what poses mean here.
    ScanToWorld,
    /// It maps the world into the scan, as the extrinsics of cameras do.
    WorldToScan,
    /// It maps a camera that looks along -z with y up (OpenGL) into the world, but the scan has x right, y down and z
    /// forward (OpenCV), as depth images have it.
    #[strum(serialize = "opengl_camera")]
    OpenGlCamera,
}

impl PoseConvention {
    /// The pose that maps the scan into the world.
    pub fn world_from_scan(self, pose: &Motion) -> Motion {
        match self {
            PoseConvention::ScanToWorld => *pose,
            PoseConvention::WorldToScan => pose.inverse(),
            PoseConvention::OpenGlCamera => pose * half_turn(),
        }
    }

    /// The name used in reports.
    pub fn name(self) -> &'static str {
        self.into()
    }

    /// In words, for messages: "the poses are read as ...".
    pub fn words(self) -> &'static str {
        match self {
            PoseConvention::ScanToWorld => "scan to world, as they stand there",
            PoseConvention::WorldToScan => "world to scan, and inverted",
            PoseConvention::OpenGlCamera => "those of cameras with y up and z back, and turned to y down and z forward",
        }
    }
}

/// Half a turn about x: from y down, z forward to y up, z back.
fn half_turn() -> Motion {
    Motion::rotation(Vector3::x() * std::f64::consts::PI)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Point3;

    #[test]
    fn every_convention_says_where_a_point_of_the_scan_is() {
        let pose = Motion::new(Vector3::new(1.0, 2.0, 3.0), Vector3::z() * std::f64::consts::FRAC_PI_2);
        let place = |convention: PoseConvention, p: [f64; 3]| convention.world_from_scan(&pose) * Point3::from(p);
        let is_near = |a: Point3, b: [f64; 3]| (a - Point3::from(b)).norm() < 1e-12;
        assert!(is_near(place(PoseConvention::ScanToWorld, [1.0, 0.0, 0.0]), [1.0, 3.0, 3.0]));
        assert!(is_near(place(PoseConvention::WorldToScan, [1.0, 3.0, 3.0]), [1.0, 0.0, 0.0]));
        // what is in front of the scanner is behind the origin of an OpenGL camera
        assert!(is_near(place(PoseConvention::OpenGlCamera, [0.0, 0.0, 5.0]), [1.0, 2.0, -2.0]));
        assert!(is_near(place(PoseConvention::OpenGlCamera, [0.0, 1.0, 0.0]), [2.0, 2.0, 3.0]));
    }
}
