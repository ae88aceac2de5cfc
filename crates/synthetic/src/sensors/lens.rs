//! Which way the rays of a sensor go: through a pinhole, over a sphere, or side by side. In the sensor's frame: x to the
//! right, y down, z forward.

use std::f64::consts::{PI, TAU};

use visage_geometry::{Point3, Vector3};

/// How the rays of a picture lie.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Projection {
    /// From one point through a plane; half the picture's width and height at distance 1.
    Pinhole {
        /// Half the width.
        half_width: f64,
        /// Half the height.
        half_height: f64,
    },
    /// From one point all the way round, between two angles above the horizon, radians.
    Sphere {
        /// The lower one.
        low: f64,
        /// The upper one.
        high: f64,
    },
    /// Side by side, forward from the plane z = 0; half its width and height.
    Parallel {
        /// Half the width.
        half_width: f64,
        /// Half the height.
        half_height: f64,
    },
}

/// A projection with its pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lens {
    /// How the rays lie.
    pub projection: Projection,
    /// Pixels in a row.
    pub columns: usize,
    /// Rows.
    pub rows: usize,
}

impl Lens {
    /// With about this many pixels, as dense across as up.
    pub fn of(projection: Projection, pixels: f64) -> Self {
        let (width, height) = match projection {
            Projection::Pinhole { half_width, half_height } | Projection::Parallel { half_width, half_height } => {
                (half_width, half_height)
            }
            Projection::Sphere { low, high } => (TAU, high - low),
        };
        let columns = (pixels * width / height).sqrt().round().max(8.0);
        Lens { projection, columns: columns as usize, rows: (pixels / columns).round().max(8.0) as usize }
    }

    /// Pixels in all.
    pub fn pixels(&self) -> usize {
        self.columns * self.rows
    }

    /// Start and direction of a pixel's ray; `shift` moves it by shares of a pixel.
    pub fn ray(&self, pixel: usize, shift: [f64; 2]) -> (Point3, Vector3) {
        let across = ((pixel % self.columns) as f64 + 0.5 + shift[0]) / self.columns as f64;
        let down = ((pixel / self.columns) as f64 + 0.5 + shift[1]) / self.rows as f64;
        match self.projection {
            Projection::Pinhole { half_width, half_height } => {
                let way = Vector3::new((2.0 * across - 1.0) * half_width, (2.0 * down - 1.0) * half_height, 1.0);
                (Point3::origin(), way.normalize())
            }
            Projection::Sphere { low, high } => {
                let (sine, cosine) = (TAU * across - PI).sin_cos();
                let (up, level) = (high - down * (high - low)).sin_cos();
                (Point3::origin(), Vector3::new(sine * level, -up, cosine * level))
            }
            Projection::Parallel { half_width, half_height } => {
                let (x, y) = ((2.0 * across - 1.0) * half_width, (2.0 * down - 1.0) * half_height);
                (Point3::new(x, y, 0.0), Vector3::z())
            }
        }
    }

    /// Start and direction of the ray that reaches a place, if the picture holds it.
    pub fn toward(&self, place: &Point3) -> Option<(Point3, Vector3)> {
        let way = place.coords;
        match self.projection {
            Projection::Pinhole { half_width, half_height } => {
                let inside = way.z > 0.0 && way.x.abs() < half_width * way.z && way.y.abs() < half_height * way.z;
                inside.then(|| (Point3::origin(), way.normalize()))
            }
            Projection::Sphere { low, high } => {
                let up = (-way.y).atan2(way.x.hypot(way.z));
                (low..high).contains(&up).then(|| (Point3::origin(), way.normalize()))
            }
            Projection::Parallel { half_width, half_height } => {
                let inside = way.z > 0.0 && way.x.abs() < half_width && way.y.abs() < half_height;
                inside.then(|| (Point3::new(way.x, way.y, 0.0), Vector3::z()))
            }
        }
    }

    /// The pixels beside, above and below one.
    pub fn neighbours(&self, pixel: usize) -> impl Iterator<Item = usize> {
        let (column, row) = (pixel % self.columns, pixel / self.columns);
        let (columns, rows) = (self.columns, self.rows);
        let wraps = matches!(self.projection, Projection::Sphere { .. });
        [(1, 0), (-1, 0), (0, 1), (0, -1)].into_iter().filter_map(move |(right, down): (isize, isize)| {
            let row = row.checked_add_signed(down).filter(|row| *row < rows)?;
            let column = if wraps {
                (column + columns).checked_add_signed(right)? % columns
            } else {
                column.checked_add_signed(right).filter(|column| *column < columns)?
            };
            Some(row * columns + column)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ray_reaches_the_places_on_it_and_pixels_have_their_neighbours() {
        let projections = [
            Projection::Pinhole { half_width: 0.5, half_height: 0.4 },
            Projection::Sphere { low: -0.4, high: 1.2 },
            Projection::Parallel { half_width: 3.0, half_height: 2.0 },
        ];
        for projection in projections {
            let lens = Lens::of(projection, 500.0);
            assert!((400..600).contains(&lens.pixels()), "{lens:?}");
            for pixel in 0..lens.pixels() {
                let (start, way) = lens.ray(pixel, [0.0; 2]);
                let (again, toward) = lens.toward(&(start + way * 7.0)).expect("the picture holds it");
                assert!((start - again).norm() < 1e-9 && (way - toward).norm() < 1e-9, "{lens:?} {pixel}");
                let beside: Vec<usize> = lens.neighbours(pixel).collect();
                assert!(beside.iter().all(|other| lens.neighbours(*other).any(|back| back == pixel)));
            }
            let first: Vec<usize> = lens.neighbours(0).collect();
            let wraps = matches!(projection, Projection::Sphere { .. });
            assert_eq!(first.contains(&(lens.columns - 1)), wraps, "only a panorama is round");
        }
    }
}
