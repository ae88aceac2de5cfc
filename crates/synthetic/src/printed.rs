//! Surfaces that turn or slide in themselves, with something printed on them: a bottle and a wall, as a camera with changing
//! exposure would scan them.

use rand::SeedableRng;
use rand::distr::Distribution;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use super::scanner::{ScanSet, Scanner};
use super::texture::rough;
use visage_geometry::{Mesh, Motion, Point3, Vector3};

/// What a print is on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Printed {
    /// A body of revolution about the y axis, 200 mm high: it turns.
    Bottle,
    /// A flat sheet of 400 by 300 mm: it slides and turns.
    Wall,
}

/// How bright a place is, 0 to 1: blots of 20 mm with finer ones on them.
fn print(place: &Point3, seed: u64) -> f64 {
    const BLOT_MM: f64 = 20.0;
    (0.5 + 0.4 * rough(&(place / BLOT_MM), 3, seed)).clamp(0.0, 1.0)
}

/// Five scans of it, coloured, with their true poses; each scan has an exposure of its own, and noise of 0.3 mm in depth and of
/// 1 % in brightness.
pub fn printed_set(what: Printed, seed: u64) -> ScanSet {
    const EXPOSURES: [f64; 5] = [1.0, 0.7, 0.85, 0.6, 0.95];
    const NOISE: f64 = 0.01;
    let scanner = Scanner { noise: 0.3, resolution: 1.6, distance: 500.0, ..Scanner::default() };
    let poses = (0..EXPOSURES.len()).map(|view| pose(what, view as f64 - 2.0, scanner.distance)).collect();
    let mut set = scanner.scan_from(&mesh(what), poses, seed);
    for (view, (scan, pose)) in set.scans.iter_mut().zip(&set.poses).enumerate() {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(100 + view as u64);
        let colour = |point: &Point3| {
            let error: f64 = StandardNormal.sample(&mut rng);
            [(255.0 * (EXPOSURES[view] * print(&(pose * point), seed) + NOISE * error)).clamp(0.0, 255.0) as u8; 3]
        };
        scan.cloud.colors = Some(scan.cloud.points.iter().map(colour).collect());
    }
    set
}

/// The scanner of a view, `step` steps from the middle one: round the bottle, along the wall.
fn pose(what: Printed, step: f64, distance: f64) -> Motion {
    let (sensor, target) = match what {
        Printed::Bottle => {
            let (sine, cosine) = (0.5 * step).sin_cos();
            (Point3::new(distance * sine, 20.0 * step, distance * cosine), Point3::origin())
        }
        Printed::Wall => {
            let target = Point3::new(35.0 * step, 12.0 * step, 0.0);
            (target + Vector3::new(40.0 * step, -25.0 * step, distance), target)
        }
    };
    Motion::face_towards(&sensor, &target, &-Vector3::y())
}

fn mesh(what: Printed) -> Mesh {
    match what {
        Printed::Bottle => {
            let outline = |height: f64| 35.0 - 20.0 * (1.0 / (1.0 + (-(height - 50.0) / 8.0).exp()));
            grid([240, 80], true, |u, v| {
                let (turn, height) = (std::f64::consts::TAU * u, 200.0 * v - 100.0);
                let radius = outline(height);
                Point3::new(radius * turn.sin(), height, radius * turn.cos())
            })
        }
        Printed::Wall => grid([2, 2], false, |u, v| Point3::new(400.0 * u - 200.0, 300.0 * v - 150.0, 0.0)),
    }
}

/// A mesh over the unit square, wound outward where u runs to the right of one who looks at it and v upward.
fn grid([columns, rows]: [u32; 2], is_closed: bool, place: impl Fn(f64, f64) -> Point3) -> Mesh {
    let mut mesh = Mesh { vertices: Vec::new(), faces: Vec::new() };
    let width = if is_closed { columns } else { columns + 1 };
    for row in 0..=rows {
        for column in 0..width {
            mesh.vertices.push(place(f64::from(column) / f64::from(columns), f64::from(row) / f64::from(rows)));
            if row < rows && (is_closed || column < columns) {
                let next = (column + 1) % width;
                let [a, b] = [row * width + column, row * width + next];
                mesh.faces.extend([[a, b, b + width], [a, b + width, a + width]]);
            }
        }
    }
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scans_lie_on_the_surface_and_are_as_bright_as_the_print_but_for_exposure() {
        for what in [Printed::Bottle, Printed::Wall] {
            let set = printed_set(what, 3);
            assert_eq!(set.scans.len(), 5);
            for (scan, pose) in set.scans.iter().zip(&set.poses) {
                assert!(scan.cloud.len() > 2000, "{what:?}: {} points", scan.cloud.len());
                let colours = scan.cloud.colors.as_ref().expect("coloured");
                let pairs: Vec<(f64, f64)> = scan
                    .cloud
                    .points
                    .iter()
                    .zip(colours)
                    .map(|(point, colour)| (print(&(pose * point), 3), f64::from(colour[0])))
                    .collect();
                let count = pairs.len() as f64;
                let (x, y) = pairs.iter().fold((0.0, 0.0), |(x, y), p| (x + p.0 / count, y + p.1 / count));
                let sums = pairs.iter().fold([0.0; 3], |[xx, xy, yy], p| {
                    [xx + (p.0 - x) * (p.0 - x), xy + (p.0 - x) * (p.1 - y), yy + (p.1 - y) * (p.1 - y)]
                });
                assert!(sums[1] / (sums[0] * sums[2]).sqrt() > 0.95, "{what:?}");
            }
        }
    }
}
