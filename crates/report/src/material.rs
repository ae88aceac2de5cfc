//! What pictures are made of, what may be wished, and what comes out.

use std::fmt;
use std::str::FromStr;

use super::found::Found;
use super::kind::Kind;
use visage_geometry::progress::Canceled;
use visage_geometry::{Surface, Unit};
use visage_picture::camera::Side;
use visage_picture::drawing::Drawing;
use visage_picture::image::Image;
use visage_picture::size::Size;
use visage_shape::faces::Signature;

/// What is known of a model, as far as a picture needs it.
#[derive(Debug, Clone, Default)]
pub struct Material {
    /// Its surface: the file that the kind of picture prefers.
    pub surface: Surface,
    /// For each point of the surface the scan that it is of.
    pub views: Option<Vec<u16>>,
    /// For each point of the surface how much was measured there.
    pub support: Option<Vec<f32>>,
    /// What it is compared with.
    pub other: Option<Surface>,
    /// Regions, triangles and the face, if it was described.
    pub signature: Option<Signature>,
    /// What its report says, if it has one.
    pub found: Option<Found>,
    /// The unit of lengths.
    pub unit: Unit,
}

/// What is wished of a picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wish {
    /// How large.
    pub size: Size,
    /// From which side.
    pub side: Side,
    /// The plane of a section; the middle of the shortest axis if none is named.
    pub plane: Option<Plane>,
}

impl Wish {
    /// What is usual for a kind.
    pub fn of(kind: Kind) -> Wish {
        Wish { size: kind.size(), side: Side::Default, plane: None }
    }
}

/// An axis of the model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Axis {
    /// x
    X,
    /// y
    Y,
    /// z
    Z,
}

impl Axis {
    /// Its name.
    pub fn name(self) -> &'static str {
        ["x", "y", "z"][self as usize]
    }
}

/// A plane at a right angle to an axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane {
    /// The axis.
    pub axis: Axis,
    /// Where on it, in the unit of the model; the middle if it is not said.
    pub offset: Option<f64>,
}

/// Why a text is no plane.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("give an axis, and where on it if that is not the middle: x, y, z, or such as z:12.5")]
pub struct PlaneError;

impl FromStr for Plane {
    type Err = PlaneError;

    fn from_str(text: &str) -> Result<Plane, PlaneError> {
        let (axis, offset) = text.split_once(':').map_or((text, None), |(axis, offset)| (axis, Some(offset)));
        let axis = [Axis::X, Axis::Y, Axis::Z].into_iter().find(|known| known.name() == axis).ok_or(PlaneError)?;
        let number = |text: &str| text.parse::<f64>().ok().filter(|x| x.abs() <= visage_geometry::MAX_COORDINATE);
        let offset = offset.map(|text| number(text).ok_or(PlaneError)).transpose()?;
        Ok(Plane { axis, offset })
    }
}

impl fmt::Display for Plane {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.axis.name())?;
        self.offset.map_or(Ok(()), |offset| write!(f, ":{offset}"))
    }
}

/// Why there is no such picture.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum PictureError {
    /// The model lacks what it would show.
    #[error("there is no picture of {kind}: {lacks}")]
    Lacking {
        /// The kind of picture.
        kind: &'static str,
        /// What is lacking.
        lacks: &'static str,
        /// What to do about it.
        remedy: &'static str,
    },
    /// The caller asked for a stop.
    #[error(transparent)]
    Canceled(#[from] Canceled),
    /// The surface can't be reckoned with.
    #[error("{0}")]
    Surface(String),
}

/// A picture or a plot.
#[derive(Debug, Clone, PartialEq)]
pub enum Made {
    /// Pixels.
    Image(Image),
    /// Shapes, which become pixels or SVG.
    Plot(Drawing),
}

/// A picture could not be written.
#[derive(Debug, thiserror::Error)]
#[error("the picture can't be written: {0}")]
pub struct WriteError(String);

impl Made {
    /// As a PNG file.
    ///
    /// # Errors
    /// What the encoder says; it has nothing to say of what is in memory.
    pub fn to_png(&self) -> Result<Vec<u8>, WriteError> {
        let written = match self {
            Made::Image(image) => image.to_png(),
            Made::Plot(drawing) => drawing.to_image().to_png(),
        };
        written.map_err(|error| WriteError(error.to_string()))
    }

    /// As SVG; `None` for what is pixels.
    pub fn to_svg(&self) -> Option<String> {
        match self {
            Made::Image(_) => None,
            Made::Plot(drawing) => Some(drawing.to_svg()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planes_have_an_axis_and_perhaps_a_place() {
        assert_eq!("x".parse(), Ok(Plane { axis: Axis::X, offset: None }));
        assert_eq!("z:-1.5e1".parse(), Ok(Plane { axis: Axis::Z, offset: Some(-15.0) }));
        assert_eq!("z:-15".parse::<Plane>().map(|plane| plane.to_string()), Ok("z:-15".to_owned()));
        for wrong in ["", "w", "x:", "x:nan", "x:inf", "x:1e300", "x:1:2", "X"] {
            assert_eq!(wrong.parse::<Plane>(), Err(PlaneError), "{wrong}");
        }
    }
}
