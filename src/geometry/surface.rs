//! What one file describes: points on a surface, perhaps with triangles and what the scanner knew.

use super::{Cloud, Mesh, Point3};

/// A scan or a model as it came from a file, in the file's frame and unit.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Surface {
    /// The vertices with their attributes.
    pub cloud: Cloud,
    /// Triangles over `cloud.points`; empty for a bare cloud.
    pub faces: Vec<[u32; 3]>,
    /// The pixels of an organised scan, if the file has them.
    pub grid: Option<RangeGrid>,
    /// Where the scanner stood, in the scan's frame, if the file says so.
    pub sensor: Option<Point3>,
}

/// An organised scan: for each pixel, row by row, the index of its point or [`RangeGrid::EMPTY`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RangeGrid {
    /// Pixels in a row.
    pub columns: usize,
    /// Rows.
    pub rows: usize,
    /// `rows * columns` indices into the points.
    pub pixels: Vec<u32>,
}

impl RangeGrid {
    /// Marks a pixel where nothing was seen.
    pub const EMPTY: u32 = u32::MAX;
}

impl Surface {
    /// The triangles as a mesh of its own, or `None` for a bare cloud.
    pub fn mesh(&self) -> Option<Mesh> {
        (!self.faces.is_empty()).then(|| Mesh { vertices: self.cloud.points.clone(), faces: self.faces.clone() })
    }
}

/// The unit of a file's coordinates.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Unit {
    /// Millimetres.
    Mm,
    /// Centimetres.
    Cm,
    /// Metres.
    M,
    /// Inches.
    In,
    /// Not known: lengths are given in the file's own unit and in spacings.
    #[default]
    Unknown,
}

impl Unit {
    /// Millimetres in one such unit, or `None` if the unit is unknown.
    pub fn in_mm(self) -> Option<f64> {
        match self {
            Unit::Mm => Some(1.0),
            Unit::Cm => Some(10.0),
            Unit::M => Some(1000.0),
            Unit::In => Some(25.4),
            Unit::Unknown => None,
        }
    }

    /// The name used in options, reports and messages.
    pub fn name(self) -> &'static str {
        match self {
            Unit::Mm => "mm",
            Unit::Cm => "cm",
            Unit::M => "m",
            Unit::In => "in",
            Unit::Unknown => "unknown",
        }
    }
}

impl std::str::FromStr for Unit {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        [Unit::Mm, Unit::Cm, Unit::M, Unit::In, Unit::Unknown]
            .into_iter()
            .find(|unit| unit.name() == text)
            .ok_or_else(|| format!("{text:?} is no unit that is known here; use mm, cm, m, in or unknown"))
    }
}
