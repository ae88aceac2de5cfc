//! Surface normals of point clouds: the direction of least spread among each point's neighbours.

use rayon::prelude::*;

use super::neighbours::{IndexedPoints, LocalPoint, Neighbour};

/// A plane fitted to the neighbours of a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LocalPlane {
    /// Unit normal, its sign arbitrary.
    pub normal: [f32; 3],
    /// Root mean square distance of the neighbours from the plane, in the points' unit.
    pub rms: f32,
}

/// Points that a plane is fitted to: enough to average noise, few enough to stay on one side of an edge.
pub const NEIGHBOURS: usize = 12;

/// A plane at each of `queries`, fitted to its `k` nearest points of `indexed` (itself included).
/// With fewer than three neighbours, or all in one place, the normal is zero.
#[inline]
pub fn local_planes(indexed: &IndexedPoints, queries: &[LocalPoint], k: usize) -> Vec<LocalPlane> {
    queries
        .par_iter()
        .with_min_len(256)
        .map_init(Vec::new, |found, query| {
            indexed.tree.k_nearest(query, k, f32::INFINITY, found);
            plane_through(&indexed.points, found)
        })
        .collect()
}

/// The plane through `neighbours`, which are some of `points`; its normal is zero if they are fewer than three or all in
/// one place.
pub fn plane_through(points: &[LocalPoint], neighbours: &[Neighbour]) -> LocalPlane {
    let flat = LocalPlane { normal: [0.0; 3], rms: 0.0 };
    if neighbours.len() < 3 {
        return flat;
    }
    let at = |n: &Neighbour| nalgebra::Vector3::from(points[n.index as usize]).cast::<f64>();
    let count = neighbours.len() as f64;
    let mean = neighbours.iter().map(at).sum::<nalgebra::Vector3<f64>>() / count;
    let mut scatter = nalgebra::Matrix3::zeros();
    for neighbour in neighbours {
        let d = at(neighbour) - mean;
        scatter += d * d.transpose();
    }
    let (normal, spread) = least_spread(&(scatter / count));
    if !(spread.is_finite() && normal.norm_squared() > 0.5) {
        return flat;
    }
    LocalPlane { normal: normal.cast::<f32>().into(), rms: spread.max(0.0).sqrt() as f32 }
}

/// The surface about a place, as its points tell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Patch {
    /// How many points there are.
    pub count: usize,
    /// Their mean, from the place; zero without points.
    pub mean: nalgebra::Vector3<f32>,
    /// Unit normal, its sign arbitrary; `None` with fewer than three points.
    pub normal: Option<nalgebra::Vector3<f64>>,
}

/// The patch of the points of `indexed` within `reach` of `center`, all in one unit.
#[inline]
pub fn patch_within(indexed: &IndexedPoints, center: &LocalPoint, reach: f32) -> Patch {
    let center = nalgebra::Vector3::from(*center);
    let (mut count, mut sum, mut squares) = (0usize, nalgebra::Vector3::zeros(), nalgebra::Matrix3::zeros());
    indexed.tree.for_each_within(&center.into(), reach * reach, |neighbour| {
        let d = nalgebra::Vector3::from(indexed.points[neighbour.index as usize]) - center;
        count += 1;
        sum += d;
        squares += d * d.transpose();
    });
    let mean: nalgebra::Vector3<f32> = sum / count.max(1) as f32;
    let spread = || least_spread(&(squares / count as f32 - mean * mean.transpose()).cast::<f64>()).0;
    Patch { count, mean, normal: (count >= 3).then(spread) }
}

/// The unit direction of least spread of a symmetric 3x3 scatter matrix, and the spread along it.
///
/// The least eigenvalue in closed form (Smith, "Eigenvalues of a symmetric 3x3 matrix", CACM 1961), its eigenvector as
/// what is square to two rows of the rest: a tenth of what iterations take. Where two spreads are nearly alike in that
/// (points along a line, in one place, equally far all around) they are iterated.
pub fn least_spread(scatter: &nalgebra::Matrix3<f64>) -> (nalgebra::Vector3<f64>, f64) {
    let mean = scatter.trace() / 3.0;
    let rest = scatter - nalgebra::Matrix3::from_diagonal_element(mean);
    let size = (rest.norm_squared() / 6.0).sqrt();
    let angle = (rest.determinant() / (2.0 * size.powi(3))).clamp(-1.0, 1.0).acos() / 3.0;
    let least = 2.0 * size * (angle + std::f64::consts::TAU / 3.0).cos();
    let [x, y, z] = [0, 1, 2].map(|k| rest.column(k) - nalgebra::Vector3::ith(k, least));
    let mut square = x.cross(&y);
    for other in [x.cross(&z), y.cross(&z)] {
        if other.norm_squared() > square.norm_squared() {
            square = other;
        }
    }
    let length = square.norm();
    if length > DISTINCT * size * size {
        let direction = square / length;
        return (direction, direction.dot(&(scatter * direction)));
    }
    let eigen = scatter.symmetric_eigen();
    let least = eigen.eigenvalues.imin();
    (eigen.eigenvectors.column(least).into_owned(), eigen.eigenvalues[least])
}

/// How far apart eigenvalues are, in their deviation, if the closed form is to tell their directions.
const DISTINCT: f64 = 1e-3;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tilted_plane_has_its_own_normal() {
        let normal = nalgebra::Vector3::new(1.0f32, 2.0, 3.0).normalize();
        let (u, v) = (
            normal.cross(&nalgebra::Vector3::x()).normalize(),
            normal.cross(&nalgebra::Vector3::x()).cross(&normal).normalize(),
        );
        let points: Vec<LocalPoint> = (0..400).map(|i| (u * (i % 20) as f32 + v * (i / 20) as f32).into()).collect();
        for plane in local_planes(&IndexedPoints::new(points.clone()), &points, NEIGHBOURS) {
            assert!(nalgebra::Vector3::from(plane.normal).dot(&normal).abs() > 1.0 - 1e-5);
            assert!(plane.rms < 1e-4);
        }
    }

    #[test]
    fn the_closed_form_agrees_with_iterations() {
        let turn = nalgebra::Rotation3::from_euler_angles(0.3, -1.1, 2.0);
        for spreads in [[3.0, 2.0, 1.0], [1.0, 1.0, 1e-6], [2.0, 1.0, 0.0], [1e-9, 5e-10, 1e-12], [1.0, 1e-3, 1e-7]] {
            let diagonal = nalgebra::Matrix3::from_diagonal(&nalgebra::Vector3::from(spreads));
            let (direction, spread) = least_spread(&(turn * diagonal * turn.inverse()));
            assert!(direction.dot(&(turn * nalgebra::Vector3::z())).abs() > 1.0 - 1e-9, "{spreads:?}");
            assert!((spread - spreads[2]).abs() < 1e-12 * spreads[0], "{spreads:?}: {spread}");
        }
        for spreads in [[1.0, 0.0, 0.0], [1.0, 1.0, 1.0], [0.0; 3]] {
            let (direction, spread) = least_spread(&nalgebra::Matrix3::from_diagonal(&spreads.into()));
            assert!((direction.norm() - 1.0).abs() < 1e-9 && (spread - spreads[2]).abs() < 1e-12, "{spreads:?}");
        }
    }

    #[test]
    fn two_points_have_no_normal() {
        let points = vec![[0.0; 3], [1.0, 0.0, 0.0]];
        assert_eq!(local_planes(&IndexedPoints::new(points.clone()), &points, NEIGHBOURS)[0].normal, [0.0; 3]);
    }
}
