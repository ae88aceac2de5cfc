//! The points of a file as they are read, by one rule for all formats: a point of which a coordinate is not finite is
//! no return; an attribute that is not sound costs the point this attribute, and the file only if no point has it.

use super::colors::{Channels, Colors};
use super::number::{NoCoordinate, checked_coordinate};
use super::{Dropped, FormatError, Reading};
use visage_geometry::{Cloud, Point3, RangeGrid, Surface};

/// Places of a point's values, by what they are.
pub(super) const X: usize = 0;
pub(super) const NORMAL: usize = 3;
pub(super) const COLOR: usize = 6;
pub(super) const INTENSITY: usize = 9;
/// A colour packed into four bytes, blue first; NaN for none.
pub(super) const PACKED: usize = 10;
pub(super) const SLOTS: usize = 11;

/// The values of one point.
pub(super) type Values = [f64; SLOTS];

/// The slot of a value by its name, in any spelling that programs are known to use.
pub(super) fn slot_of(name: &str) -> Option<usize> {
    Some(match name.to_ascii_lowercase().as_str() {
        "x" => X,
        "y" => X + 1,
        "z" => X + 2,
        "nx" | "normal_x" => NORMAL,
        "ny" | "normal_y" => NORMAL + 1,
        "nz" | "normal_z" => NORMAL + 2,
        "red" | "diffuse_red" | "r" => COLOR,
        "green" | "diffuse_green" | "g" => COLOR + 1,
        "blue" | "diffuse_blue" | "b" => COLOR + 2,
        "intensity" | "scalar_intensity" | "reflectance" | "scalar_reflectance" | "reflectivity" => INTENSITY,
        "rgb" | "rgba" => PACKED,
        _ => return None,
    })
}

/// Which attributes a file's points have.
#[derive(Debug, Clone, Copy)]
pub(super) struct Layout {
    normals: bool,
    /// How the channels of the colours are stored; none for packed colours.
    channels: Option<Channels>,
    packed: bool,
    intensities: bool,
}

impl Layout {
    /// By the slots that a file fills; `channels` says how it stores those of a colour.
    pub(super) fn of(has: impl Fn(usize) -> bool, channels: impl Fn(usize) -> Channels) -> Result<Self, FormatError> {
        let all = |first: usize| (first..first + 3).all(&has);
        if !all(X) {
            let problem = "the points have no x, y and z";
            return Err(FormatError::malformed("header", problem, "export the file with positions"));
        }
        let widest = |a: Channels, b: Channels| match (a, b) {
            (Channels::Bytes, other) | (other, Channels::Bytes) => other,
            (Channels::SignedBytes, Channels::SignedBytes) => a,
            (Channels::Whole(a), Channels::Whole(b)) => Channels::Whole(a.max(b)),
            _ => Channels::Floats,
        };
        let channels = all(COLOR).then(|| (COLOR..COLOR + 3).map(channels).fold(Channels::Bytes, widest));
        let packed = channels.is_none() && has(PACKED);
        Ok(Layout { normals: all(NORMAL), channels, packed, intensities: has(INTENSITY) })
    }

    /// What a point takes while it is read (bytes).
    pub(super) fn bytes(&self) -> usize {
        let color = match self.channels {
            Some(Channels::Bytes | Channels::SignedBytes) => 3,
            Some(_) => 12,
            None => 3 * usize::from(self.packed),
        };
        size_of::<Point3>() + 12 * usize::from(self.normals) + color + 4 * usize::from(self.intensities)
    }
}

/// The points read so far.
pub(super) struct Points {
    positions: Vec<Point3>,
    normals: Option<Vec<nalgebra::Vector3<f32>>>,
    colors: Option<Colors>,
    is_packed: bool,
    intensities: Option<Vec<f32>>,
    /// For each point of the file its index among those kept; made when the first is left out.
    places: Option<Vec<u32>>,
    pub(super) dropped: Dropped,
}

/// Stands for a point that is left out, or was never there.
pub(super) const NONE: u32 = RangeGrid::EMPTY;

impl Points {
    /// With room for `count` points, for which there must be bytes.
    pub(super) fn new(layout: &Layout, count: usize) -> Self {
        let channels = layout.channels.or(layout.packed.then_some(Channels::Bytes));
        Points {
            positions: Vec::with_capacity(count),
            normals: layout.normals.then(|| Vec::with_capacity(count)),
            colors: channels.map(|channels| Colors::new(channels, count)),
            is_packed: layout.packed,
            intensities: layout.intensities.then(|| Vec::with_capacity(count)),
            places: None,
            dropped: Dropped::default(),
        }
    }

    /// Points without attributes, whose coordinates have been checked.
    pub(super) fn of(positions: Vec<Point3>) -> Self {
        let dropped = Dropped::default();
        Points { positions, normals: None, colors: None, is_packed: false, intensities: None, places: None, dropped }
    }

    /// Takes the next point of the file. Finite coordinates that are too large are an error: they are no "no return",
    /// and no measurement either.
    #[inline]
    pub(super) fn push(&mut self, values: &Values) -> Result<(), String> {
        let is_coordinate = |value: &f64| checked_coordinate(*value).is_ok();
        if !values[X..X + 3].iter().all(is_coordinate) {
            return self.leave_out(values);
        }
        if let Some(places) = &mut self.places {
            places.push(self.positions.len() as u32);
        }
        self.positions.push(Point3::new(values[X], values[X + 1], values[X + 2]));
        if let Some(normals) = &mut self.normals {
            let normal = nalgebra::Vector3::new(values[NORMAL], values[NORMAL + 1], values[NORMAL + 2]);
            let is_sound = normal.iter().all(|x| x.is_finite());
            self.dropped.normals += u64::from(!is_sound);
            let unit = normal.try_normalize(f64::MIN_POSITIVE).filter(|_| is_sound);
            normals.push(unit.unwrap_or_default().cast());
        }
        if let Some(colors) = &mut self.colors {
            if self.is_packed {
                colors.push_packed(values[PACKED]);
            } else {
                colors.push([values[COLOR], values[COLOR + 1], values[COLOR + 2]]);
            }
        }
        if let Some(intensities) = &mut self.intensities {
            let intensity = values[INTENSITY] as f32;
            let is_sound = intensity.is_finite();
            self.dropped.intensities += u64::from(!is_sound);
            intensities.push(if is_sound { intensity } else { 0.0 });
        }
        Ok(())
    }

    /// Passes over a point without a return.
    #[cold]
    fn leave_out(&mut self, values: &Values) -> Result<(), String> {
        let checked = ["x", "y", "z"].into_iter().zip(&values[X..X + 3]);
        for (axis, value) in checked {
            if let Err(problem @ NoCoordinate::TooLarge(_)) = checked_coordinate(*value) {
                return Err(format!("{axis} {problem}"));
            }
        }
        let kept = self.positions.len() as u32;
        self.places.get_or_insert_with(|| (0..kept).collect()).push(NONE);
        self.dropped.no_return += 1;
        Ok(())
    }

    /// Points of the file so far, those without a return included.
    #[inline]
    pub(super) fn seen(&self) -> usize {
        self.places.as_ref().map_or(self.positions.len(), Vec::len)
    }

    /// The surface of these points. `faces` and `grid` name points of the file; what names one that is left out goes.
    pub(super) fn finish(
        mut self,
        mut faces: Vec<[u32; 3]>,
        mut grid: Option<RangeGrid>,
        sensor: Option<Point3>,
    ) -> Result<Reading, FormatError> {
        if self.positions.is_empty() {
            let problem = "there are no points: no coordinates are finite";
            return Err(FormatError::malformed("the whole file", problem, "send a file with points"));
        }
        if let Some(places) = &self.places {
            let place = |vertex: u32| places.get(vertex as usize).copied().unwrap_or(NONE);
            let before = faces.len();
            faces.iter_mut().for_each(|face| *face = face.map(place));
            faces.retain(|face| !face.contains(&NONE));
            self.dropped.faces += (before - faces.len()) as u64;
            for pixel in grid.iter_mut().flat_map(|grid| &mut grid.pixels) {
                *pixel = place(*pixel);
            }
        }
        let points = self.positions.len() as u64;
        self.dropped.colors += self.colors.as_ref().map_or(0, |colors| colors.unsound);
        let cloud = Cloud {
            points: self.positions,
            normals: self.normals.filter(|_| self.dropped.normals < points),
            colors: self.colors.and_then(Colors::finish),
            intensities: self.intensities.filter(|_| self.dropped.intensities < points),
        };
        Ok(Reading { surface: Surface { cloud, faces, grid, sensor }, dropped: self.dropped, unit: None })
    }
}

/// A packed colour from the bits of its four bytes. Stored as a float it may be NaN on purpose, for no colour: that has
/// the bits of `f32::NAN`. All other bits that happen to be a NaN are a colour whose opacity is 255.
pub(super) fn packed_color(bits: u32, is_float: bool) -> f64 {
    if is_float && bits == f32::NAN.to_bits() { f64::NAN } else { f64::from(bits) }
}

/// A packed colour from a number in text: the bits of a float, or a whole number.
pub(super) fn packed_color_of(value: f64, is_float: bool) -> f64 {
    match is_float {
        _ if value.is_nan() => f64::NAN,
        true => f64::from((value as f32).to_bits()),
        false => f64::from(value as i64 as u32),
    }
}
