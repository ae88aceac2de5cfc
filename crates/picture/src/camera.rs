//! From which side things are seen, and where that puts them on the picture.

use crate::size::Size;
use visage_geometry::names::UnknownName;
use visage_geometry::{Point3, Vector3};

/// From where a model is seen. Its axes: x to the right, y up, z to who looks at its front.
#[derive(
    Debug,
    Clone,
    Copy,
    Default,
    PartialEq,
    Eq,
    strum::VariantArray,
    strum::IntoStaticStr,
    strum::EnumString,
    strum::Display,
)]
#[strum(serialize_all = "lowercase", parse_err_ty = UnknownName, parse_err_fn = no_side)]
pub enum Side {
    /// From before it, a little from the left and from above, in perspective.
    #[default]
    Default,
    /// Against z.
    Front,
    /// Along z.
    Back,
    /// Along x.
    Left,
    /// Against x.
    Right,
    /// Against y; the front is below.
    Top,
    /// Along y; the front is above.
    Bottom,
}

impl Side {
    /// All of them.
    pub const ALL: &[Side] = <Side as strum::VariantArray>::VARIANTS;

    /// As it is named in the API.
    pub fn name(self) -> &'static str {
        self.into()
    }

    /// To who looks, and what is up there.
    fn directions(self) -> (Vector3, Vector3) {
        match self {
            // 30 degrees to the side, 20 up
            Side::Default => (Vector3::new(-0.4698, 0.3420, 0.8138), Vector3::y()),
            Side::Front => (Vector3::z(), Vector3::y()),
            Side::Back => (-Vector3::z(), Vector3::y()),
            Side::Left => (-Vector3::x(), Vector3::y()),
            Side::Right => (Vector3::x(), Vector3::y()),
            Side::Top => (Vector3::y(), -Vector3::z()),
            Side::Bottom => (-Vector3::y(), Vector3::z()),
        }
    }
}

fn no_side(text: &str) -> UnknownName {
    UnknownName::of::<Side>("side", text)
}

/// Half the field of view in perspective, as a tangent: 15 degrees flatten no face and still show depth.
const HALF_FIELD: f64 = 0.268;
/// Share of the picture that is left free on each side.
const FREE: f64 = 0.06;
/// Points outside of the middle 99 of 100 don't count for the fit if that makes the rest larger by more than this.
const STRAY: f64 = 1.5;

/// An axis for each direction of the picture: right, up, and to who looks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Axes {
    /// To the right.
    pub right: Vector3,
    /// Up.
    pub up: Vector3,
    /// To who looks.
    pub toward: Vector3,
}

impl Axes {
    /// Seen from one of the sides.
    pub fn of_side(side: Side) -> Axes {
        let (toward, up) = side.directions();
        Axes::looking(toward, up)
    }

    /// Seen from a direction; what is up need not be at a right angle to it.
    pub fn looking(toward: Vector3, up: Vector3) -> Axes {
        let toward = toward.try_normalize(f64::MIN_POSITIVE).unwrap_or_else(Vector3::z);
        // looked at along what is up, anything else may be up
        let ups = [up, -Vector3::z(), Vector3::y()];
        let right = ups.iter().find_map(|up| up.cross(&toward).try_normalize(1e-6)).unwrap_or_else(Vector3::x);
        Axes { right, up: toward.cross(&right), toward }
    }

    /// The same for things whose frame is that of a camera: y down, z away from who looks.
    pub fn of_camera_frame(self) -> Axes {
        let turned = |v: Vector3| Vector3::new(v.x, -v.y, -v.z);
        Axes { right: turned(self.right), up: turned(self.up), toward: turned(self.toward) }
    }

    fn of(&self, offset: &Vector3) -> [f64; 3] {
        [self.right.dot(offset), self.up.dot(offset), self.toward.dot(offset)]
    }
}

/// How depth becomes smaller.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Projection {
    /// Not at all: pixels for a length.
    Orthographic { scale: f64 },
    /// With the distance to the centre: pixels for a length at distance 1.
    Perspective { focus: f64, distance: f64 },
}

/// Where things are on the picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    axes: Axes,
    center: Point3,
    /// Half the size of the picture.
    middle: [f64; 2],
    projection: Projection,
    /// Nearness counts from here: nothing is farther.
    farthest: f64,
}

/// A place on the picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placed {
    /// Pixels from the left, pixels from the top.
    pub at: [f64; 2],
    /// Larger is nearer; always positive. It changes evenly over the picture of a plane.
    pub nearness: f64,
}

impl Camera {
    /// All points as large as may be, seen from these axes.
    pub fn fit(points: &[Point3], axes: Axes, size: Size, perspective: bool) -> Camera {
        let middle = [f64::from(size.width()) / 2.0, f64::from(size.height()) / 2.0];
        let reference = points.first().copied().unwrap_or_else(Point3::origin);
        let bounds = Extent::of(points, &axes, &reference);
        let [x, y, z] = bounds.middle();
        let center = reference + axes.right * x + axes.up * y + axes.toward * z;
        let half = bounds.half();
        let room = middle.map(|side| side * (1.0 - 2.0 * FREE));
        // of a single point anything is a scale
        let least = 1e-9 * center.coords.amax().max(1e-9);
        let scale = (room[0] / half[0].max(least)).min(room[1] / half[1].max(least));
        let farthest = 1.5 * (half[2] + bounds.beyond).max(half[0]).max(half[1]).max(least);
        let mut camera = Camera { axes, center, middle, projection: Projection::Orthographic { scale }, farthest };
        if perspective {
            // from there even the nearest corner of the box is within the field of view
            let focus = room[1].min(room[0]) / HALF_FIELD;
            let wide = [half[0] * focus / room[0], half[1] * focus / room[1]];
            let distance = half[2] + wide[0].max(wide[1]).max(least);
            let near = bounds.nearest(points, &axes, &reference, &center, [focus / room[0], focus / room[1]]);
            let distance = near.map_or(distance, |near| near.min(distance)).max(half[2] * 1.05 + least);
            camera.projection = Projection::Perspective { focus, distance };
        }
        camera
    }

    /// The same with the picture moved to the right and down by so many pixels.
    pub fn moved(self, [right, down]: [f64; 2]) -> Camera {
        Camera { middle: [self.middle[0] + right, self.middle[1] + down], ..self }
    }

    /// A part of the picture that this camera takes, as a picture of its own: its centre, and how much larger.
    pub fn magnified(&self, at: [f64; 2], factor: f64, size: Size) -> Camera {
        let Projection::Orthographic { scale } = self.projection else { return *self };
        let offset = [(at[0] - self.middle[0]) / scale, (self.middle[1] - at[1]) / scale];
        let center = self.center + self.axes.right * offset[0] + self.axes.up * offset[1];
        let middle = [f64::from(size.width()) / 2.0, f64::from(size.height()) / 2.0];
        Camera { center, middle, projection: Projection::Orthographic { scale: scale * factor }, ..*self }
    }

    /// Pixels for a length; `None` in perspective.
    pub fn scale(&self) -> Option<f64> {
        match self.projection {
            Projection::Orthographic { scale } => Some(scale),
            Projection::Perspective { .. } => None,
        }
    }

    /// Its axes.
    pub fn axes(&self) -> &Axes {
        &self.axes
    }

    /// A point in the axes of the picture, counted from the centre.
    pub(crate) fn view(&self, point: &Point3) -> [f32; 3] {
        self.axes.of(&(point - self.center)).map(|x| x as f32)
    }

    /// A direction in the axes of the picture.
    pub(crate) fn turned(&self, direction: &nalgebra::Vector3<f32>) -> [f32; 3] {
        self.axes.of(&direction.cast()).map(|x| x as f32)
    }

    /// Where a place in the axes of the picture is on it.
    #[inline]
    pub(crate) fn placed(&self, [x, y, z]: [f32; 3]) -> Placed {
        let [x, y, z] = [x, y, z].map(f64::from);
        let (pixels, nearness) = match self.projection {
            Projection::Orthographic { scale } => (scale, (z + self.farthest).max(1e-6 * self.farthest)),
            Projection::Perspective { focus, distance } => {
                // what would be behind the eye is squeezed before it
                let depth = (distance - z).max(1e-3 * distance);
                (focus / depth, 1.0 / depth)
            }
        };
        Placed { at: [self.middle[0] + x * pixels, self.middle[1] - y * pixels], nearness }
    }

    /// Where a point is on the picture.
    pub fn place(&self, point: &Point3) -> Placed {
        self.placed(self.view(point))
    }

    /// The depth that a nearness stands for, in the axes of the picture, and pixels for a length there.
    #[inline]
    pub(crate) fn depth_of(&self, nearness: f32) -> (f32, f32) {
        match self.projection {
            Projection::Orthographic { scale } => (nearness - self.farthest as f32, scale as f32),
            Projection::Perspective { focus, distance } => (distance as f32 - 1.0 / nearness, focus as f32 * nearness),
        }
    }
}

/// All points, or so many of them: taken all over the list, since points come in rows and triangles.
fn some(points: &[Point3], most: usize) -> impl Iterator<Item = &Point3> {
    const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;
    let count = points.len();
    let index = move |k: usize| match count <= most {
        true => k,
        false => ((u128::from((k as u64).wrapping_mul(GOLDEN)) * count as u128) >> 64) as usize,
    };
    (0..count.min(most)).filter_map(move |k| points.get(index(k)))
}

/// A box in the axes of a picture.
struct Extent {
    min: [f64; 3],
    max: [f64; 3],
    /// How far points that don't count for the fit are beyond the box in depth.
    beyond: f64,
}

impl Extent {
    fn of(points: &[Point3], axes: &Axes, reference: &Point3) -> Extent {
        let mut whole = Extent { min: [f64::INFINITY; 3], max: [f64::NEG_INFINITY; 3], beyond: 0.0 };
        for point in points {
            let place = axes.of(&(point - reference));
            whole.min = std::array::from_fn(|axis| whole.min[axis].min(place[axis]));
            whole.max = std::array::from_fn(|axis| whole.max[axis].max(place[axis]));
        }
        if points.is_empty() {
            return Extent { min: [-1.0; 3], max: [1.0; 3], beyond: 0.0 };
        }
        // a few strays must not make everything else small
        let some: Vec<[f64; 3]> = some(points, 5000).map(|point| axes.of(&(point - reference))).collect();
        let (mut min, mut max) = (whole.min, whole.max);
        let mut is_smaller = false;
        for axis in 0..3 {
            let mut values: Vec<f64> = some.iter().map(|place| place[axis]).collect();
            values.sort_unstable_by(f64::total_cmp);
            let cut = values.len() / 200;
            let (low, high) = (values[cut], values[values.len() - 1 - cut]);
            let pad = 0.05 * (high - low);
            (min[axis], max[axis]) = ((low - pad).max(whole.min[axis]), (high + pad).min(whole.max[axis]));
            is_smaller |= axis < 2 && (max[axis] - min[axis]) * STRAY < whole.max[axis] - whole.min[axis];
        }
        if !is_smaller {
            return whole;
        }
        let beyond = (min[2] - whole.min[2]).max(whole.max[2] - max[2]).max(0.0);
        Extent { min, max, beyond }
    }

    fn middle(&self) -> [f64; 3] {
        std::array::from_fn(|axis| (self.min[axis] + self.max[axis]) / 2.0)
    }

    fn half(&self) -> [f64; 3] {
        std::array::from_fn(|axis| (self.max[axis] - self.min[axis]) / 2.0)
    }

    /// The least distance from which all points are within the field of view.
    fn nearest(
        &self,
        points: &[Point3],
        axes: &Axes,
        reference: &Point3,
        center: &Point3,
        slopes: [f64; 2],
    ) -> Option<f64> {
        let is_inside = |place: &[f64; 3]| (0..3).all(|axis| (self.min[axis]..=self.max[axis]).contains(&place[axis]));
        let needed = |point: &Point3| {
            let [x, y, z] = axes.of(&(point - center));
            z + (x.abs() * slopes[0]).max(y.abs() * slopes[1])
        };
        let inside = some(points, 100_000).filter(|point| is_inside(&axes.of(&(*point - reference))));
        inside.map(needed).reduce(f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cube() -> Vec<Point3> {
        (0..8).map(|k| Point3::new(f64::from(k & 1), f64::from(k >> 1 & 1), f64::from(k >> 2)) * 2.0).collect()
    }

    #[test]
    fn everything_is_on_the_picture_and_it_is_filled() {
        let size = Size::clamped(400, 300);
        for &side in Side::ALL {
            for perspective in [false, true] {
                let camera = Camera::fit(&cube(), Axes::of_side(side), size, perspective);
                let places: Vec<Placed> = cube().iter().map(|point| camera.place(point)).collect();
                let most = |axis: usize| places.iter().map(|p| p.at[axis]).fold(0.0, f64::max);
                let least = |axis: usize| places.iter().map(|p| p.at[axis]).fold(f64::INFINITY, f64::min);
                assert!(least(0) > 0.0 && least(1) > 0.0 && most(0) < 400.0 && most(1) < 300.0, "{side} {places:?}");
                assert!(most(1) - least(1) > 200.0, "{side} {perspective}: {} to {}", least(1), most(1));
                assert!(places.iter().all(|place| place.nearness > 0.0));
            }
        }
    }

    #[test]
    fn sides_show_what_they_are_named_after() {
        let size = Size::clamped(100, 100);
        let place = |side, point| Camera::fit(&cube(), Axes::of_side(side), size, false).place(&point);
        let (low, high) = (Point3::origin(), Point3::new(2.0, 2.0, 2.0));
        let front = place(Side::Front, high);
        assert!(front.at[0] > 50.0 && front.at[1] < 50.0 && front.nearness > place(Side::Front, low).nearness);
        assert!(place(Side::Back, high).at[0] < 50.0);
        assert!(place(Side::Right, high).nearness > place(Side::Right, low).nearness);
        // who looks from the right has the front on the left
        assert!(place(Side::Right, Point3::new(0.0, 0.0, 2.0)).at[0] < 50.0);
        assert!(place(Side::Top, Point3::new(0.0, 0.0, 2.0)).at[1] > 50.0);
        assert_eq!("left".parse(), Ok(Side::Left));
        assert!("sideways".parse::<Side>().is_err_and(|error| error.names().contains("default, front")));
    }

    #[test]
    fn a_stray_does_not_make_the_rest_small() {
        let mut points: Vec<Point3> =
            (0..1000).map(|k| Point3::new(f64::from(k % 10), f64::from(k / 10 % 10), f64::from(k / 100))).collect();
        points.push(Point3::new(1e6, 0.0, 0.0));
        let camera = Camera::fit(&points, Axes::of_side(Side::Front), Size::clamped(100, 100), false);
        assert!(camera.scale().is_some_and(|scale| scale > 5.0));
        assert!(points.iter().all(|point| camera.place(point).nearness > 0.0));
    }

    #[test]
    fn no_points_or_one_still_have_a_camera() {
        for points in [vec![], vec![Point3::origin()], vec![Point3::new(1e9, 1e9, 1e9)]] {
            for perspective in [false, true] {
                let camera = Camera::fit(&points, Axes::of_side(Side::Default), Size::clamped(64, 64), perspective);
                let placed = camera.place(&points.first().copied().unwrap_or_default());
                assert!(placed.at.iter().all(|x| x.is_finite()) && placed.nearness > 0.0, "{points:?} {placed:?}");
            }
        }
    }

    #[test]
    fn what_is_long_in_depth_or_endless_has_a_camera() {
        let long = vec![Point3::new(0.0, 0.0, -1e6), Point3::new(1e-3, 1e-3, 1e6), Point3::origin()];
        let endless = vec![Point3::new(f64::NEG_INFINITY, 0.0, 0.0), Point3::new(f64::INFINITY, f64::NAN, 3.0)];
        for points in [long, endless] {
            for &side in Side::ALL {
                let camera = Camera::fit(&points, Axes::of_side(side), Size::clamped(64, 48), true);
                assert!(
                    points.iter().all(|point| camera.place(point).nearness > 0.0 || !point.x.is_finite()),
                    "{side}"
                );
            }
        }
    }

    #[test]
    fn a_part_is_magnified_about_its_middle() {
        let size = Size::clamped(100, 100);
        let camera = Camera::fit(&cube(), Axes::of_side(Side::Front), size, false);
        let point = Point3::new(2.0, 2.0, 0.0);
        let at = camera.place(&point).at;
        let magnified = camera.magnified(at, 4.0, size);
        let again = magnified.place(&point).at;
        assert!((again[0] - 50.0).abs() < 1e-3 && (again[1] - 50.0).abs() < 1e-3, "{again:?}");
        assert_eq!(magnified.scale(), camera.scale().map(|scale| 4.0 * scale));
    }
}
