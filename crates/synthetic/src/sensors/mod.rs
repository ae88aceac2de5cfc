//! Six kinds of sensor with the faults that they have in life, and sets of scans of every kind of scene by each of them.
//!
//! - [`laser`]: triangulation by a laser line: clean, but blind where laser or camera don't reach, and to dark and grazing parts
//! - [`depth_camera`]: structured light: steps of disparity, noise that grows with depth, flying pixels, cropped frames
//! - [`phone`]: a phone's lidar: few pixels, smoothed depth with rounded edges, a far limit
//! - [`vehicle`]: rings all the way round, drawn while the vehicle rolls on
//! - [`panorama`]: a scanner on a tripod: the full sphere but for the tripod, mixed pixels at edges
//! - [`carried`]: merged while carried: in the hand, a fragment of many trembling frames; aloft, a strip in float32 coordinates
//! - [`walk`](mod@walk): a depth camera carried through a building, frame by frame
//! - [`lens`], [`stage`]: rays, and what they meet; [`tour`]: where sensors stand; [`set`]: whole sets
//!
//! Lengths are in the unit that the sensor's files have: millimetres for the laser, metres for the others. Scenes are scaled
//! so that a sensor sees them from its usual distance, whatever their size in life.

mod carried;
mod depth_camera;
mod laser;
mod lens;
mod panorama;
mod phone;
mod set;
mod stage;
mod tour;
mod vehicle;
mod walk;

pub use set::{SensorSet, sensor_set};
pub use walk::walk;

use super::scenery::Layout;
use lens::Projection;

/// What scans.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, strum::VariantArray, strum::IntoStaticStr, strum::EnumString,
)]
#[strum(serialize_all = "snake_case")]
pub enum SensorKind {
    /// Triangulation by a laser line.
    Laser,
    /// Structured-light depth camera.
    DepthCamera,
    /// A phone's lidar.
    Phone,
    /// Rotating lidar on a vehicle.
    Vehicle,
    /// Terrestrial scanner on a tripod.
    Panorama,
    /// Carried over the scene, in the hand or aloft, and merged.
    Carried,
}

impl SensorKind {
    /// Every kind.
    pub const ALL: &[SensorKind] = <SensorKind as strum::VariantArray>::VARIANTS;

    /// The name in rows and tables.
    pub fn name(self) -> &'static str {
        self.into()
    }

    /// Whether confidence may be fitted on it; the other half is kept for showing how well that went.
    pub fn is_for_fitting(self) -> bool {
        matches!(self, SensorKind::Laser | SensorKind::DepthCamera | SensorKind::Vehicle)
    }

    /// From how far it looks, in the unit of its files.
    fn reach(self, layout: Layout) -> f64 {
        match self {
            SensorKind::Laser => 500.0,
            SensorKind::DepthCamera => 1.6,
            SensorKind::Phone => 1.2,
            SensorKind::Vehicle => 12.0,
            SensorKind::Panorama => 4.0,
            SensorKind::Carried if self.is_aloft(layout) => 300.0,
            SensorKind::Carried => 1.2,
        }
    }

    /// Streets and land are flown over; the rest is walked around.
    fn is_aloft(self, layout: Layout) -> bool {
        self == SensorKind::Carried && matches!(layout, Layout::Along | Layout::Above)
    }

    /// Whether it sees all the way round, and so stands in or beside the scene.
    fn is_round(self) -> bool {
        matches!(self, SensorKind::Vehicle | SensorKind::Panorama)
    }

    /// Which way its rays go.
    fn projection(self, layout: Layout) -> Projection {
        let pinhole = |half_width, half_height| Projection::Pinhole { half_width, half_height };
        match self {
            SensorKind::Laser => pinhole(0.36, 0.36),
            SensorKind::DepthCamera => pinhole(0.55, 0.42),
            SensorKind::Phone => pinhole(0.43, 0.57),
            SensorKind::Vehicle => Projection::Sphere { low: vehicle::LOW, high: vehicle::HIGH },
            SensorKind::Panorama => Projection::Sphere { low: panorama::LOW, high: panorama::HIGH },
            SensorKind::Carried if layout == Layout::Above => {
                Projection::Parallel { half_width: 0.38 * self.reach(layout), half_height: 0.8 * self.reach(layout) }
            }
            SensorKind::Carried if layout == Layout::Along => {
                Projection::Parallel { half_width: 1.3 * self.reach(layout), half_height: 1.5 * self.reach(layout) }
            }
            SensorKind::Carried => pinhole(0.5, 0.4),
        }
    }

    /// How large a scene's extent is made.
    fn extent(self, layout: Layout) -> f64 {
        let share = match (layout, self.is_round()) {
            (Layout::Around, false) => 0.33,
            (Layout::Around, true) => 0.5,
            (Layout::Inside | Layout::Along, _) => 0.9,
            (Layout::Above, false) => 1.0,
            (Layout::Above, true) => 3.0,
        };
        share * self.reach(layout)
    }

    /// About how many points a scan has.
    fn points(self) -> f64 {
        match self {
            SensorKind::Laser | SensorKind::Phone => 9_000.0,
            SensorKind::DepthCamera => 20_000.0,
            SensorKind::Vehicle | SensorKind::Panorama => 13_000.0,
            SensorKind::Carried => 10_000.0,
        }
    }

    /// Standard deviation of most points along their rays, at this range; flying and mixed pixels lie anywhere.
    pub fn accuracy(self, range: f64) -> f64 {
        match self {
            SensorKind::Laser => laser::NOISE,
            SensorKind::DepthCamera => depth_camera::deviation(range),
            SensorKind::Phone => phone::deviation(range),
            SensorKind::Vehicle => vehicle::NOISE,
            SensorKind::Panorama => panorama::NOISE,
            SensorKind::Carried => carried::deviation(range),
        }
    }
}
