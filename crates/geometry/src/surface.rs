//! What one file describes: points on a surface, perhaps with triangles and what the scanner knew.

use super::names::UnknownName;
use super::{Cloud, Mesh, Motion, Point3};

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
    #[inline]
    pub fn mesh(&self) -> Option<Mesh> {
        (!self.faces.is_empty()).then(|| Mesh { vertices: self.cloud.points.clone(), faces: self.faces.clone() })
    }

    /// The same surface moved by `motion`.
    #[inline]
    pub fn moved(&self, motion: &Motion) -> Surface {
        Surface {
            cloud: self.cloud.moved(motion),
            faces: self.faces.clone(),
            grid: self.grid.clone(),
            sensor: self.sensor.map(|place| motion * place),
        }
    }

    /// The surface of the points for which `kept` holds, in order; triangles that lose a corner go, pixels become empty.
    pub fn kept(&self, kept: &[bool]) -> Surface {
        let mut next = 0;
        let places: Vec<Option<u32>> = kept
            .iter()
            .map(|kept| {
                next += u32::from(*kept);
                kept.then(|| next - 1)
            })
            .collect();
        let place = |index: u32| places.get(index as usize).copied().flatten();
        let face = |[a, b, c]: &[u32; 3]| Some([place(*a)?, place(*b)?, place(*c)?]);
        Surface {
            cloud: self.cloud.kept(kept),
            faces: self.faces.iter().filter_map(face).collect(),
            grid: self.grid.as_ref().map(|grid| RangeGrid {
                pixels: grid.pixels.iter().map(|index| place(*index).unwrap_or(RangeGrid::EMPTY)).collect(),
                ..grid.clone()
            }),
            sensor: self.sensor,
        }
    }
}

/// The unit of a file's coordinates.
#[derive(
    Debug,
    Clone,
    Copy,
    Default,
    PartialEq,
    Eq,
    serde::Serialize,
    serde::Deserialize,
    strum::VariantArray,
    strum::IntoStaticStr,
    strum::EnumString,
)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "lowercase", parse_err_ty = UnknownName, parse_err_fn = no_unit)]
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
    #[inline]
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
    #[inline]
    pub fn name(self) -> &'static str {
        self.into()
    }
}

fn no_unit(text: &str) -> UnknownName {
    UnknownName::of::<Unit>("unit", text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn leaving_points_out_keeps_faces_and_pixels_right() {
        let points = (0..4).map(|x| Point3::new(f64::from(x), 0.0, 0.0)).collect();
        let mut cloud = Cloud::from_points(points);
        cloud.colors = Some((0..4).map(|c| [c; 3]).collect());
        let pixels = vec![0, RangeGrid::EMPTY, 1, 2, 3, RangeGrid::EMPTY];
        let grid = Some(RangeGrid { columns: 3, rows: 2, pixels });
        let surface = Surface { cloud, faces: vec![[0, 1, 2], [0, 2, 3]], grid, sensor: None };
        let kept = surface.kept(&[true, false, true, true]);
        assert_eq!(kept.cloud.points.iter().map(|p| p.x).collect::<Vec<_>>(), [0.0, 2.0, 3.0]);
        assert_eq!(kept.cloud.colors, Some(vec![[0; 3], [2; 3], [3; 3]]));
        assert_eq!(kept.faces, [[0, 1, 2]]);
        let empty = RangeGrid::EMPTY;
        assert_eq!(kept.grid.expect("the grid stays").pixels, [0, empty, empty, 1, 2, empty]);
    }
}
