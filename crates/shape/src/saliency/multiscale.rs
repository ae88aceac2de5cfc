//! Weighted curvature `[P11]` and multi-scale saliency `[P12]`, scales combined after Lee, Varshney, Jacobs,
//! "Mesh saliency", 2005.

use rayon::prelude::*;
use wide::f32x4;

use super::CurvedSurface;
use super::cells::CellGrid;
use super::falloff::{falloff, near_falloff_lanes};
use visage_geometry::progress::{Canceled, Progress};

/// The paper's sigmas, in xi.
pub const SIGMAS_IN_XI: [f64; 5] = [2.0, 3.0, 4.0, 5.0, 6.0];

/// sigma_i and 2 sigma_i together, ascending, in xi: each is summed once although some serve two scales.
const FILTERS_IN_XI: [f64; 8] = [2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0];
/// No filter reaches farther.
pub(super) const WIDEST_IN_XI: f64 = FILTERS_IN_XI[7];
/// For each scale, the filters sigma_i and 2 sigma_i.
const SCALES: [[usize; 2]; 5] = [[0, 2], [1, 4], [2, 5], [3, 6], [4, 7]];

/// Weighted curvature `[P11]`: `G(l(v), sigma)`, the mean of l over the points nearer than sigma, weighted by
/// `exp(-|x - v|^2 / (2 sigma^2))`.
///
/// Every point also counts by the area it stands for; with equal areas that is the paper's formula, and with
/// unequal ones the sum no longer depends on where the file has many vertices. 0 where nothing counts.
pub fn weighted_curvature(surface: &CurvedSurface, grid: &CellGrid, vertex: usize, sigma: f64) -> f64 {
    let (mut sum, mut weights) = (0.0, 0.0);
    grid.for_each_within(&surface.points[vertex], sigma, |x, distance2| {
        let weight = surface.areas[x] * falloff(distance2 / (2.0 * sigma * sigma));
        sum += weight * surface.mean_curvatures[x];
        weights += weight;
    });
    if weights > 0.0 { sum / weights } else { 0.0 }
}

/// Saliency of every point in [0, 1] for scale unit `xi` (a length).
///
/// `[P12]` for each sigma: `phi_i(v) = |G(l(v), sigma_i) - G(l(v), 2 sigma_i)|`. Each map is scaled to [0, 1] and
/// weighted by `(1 - m)^2`, m being the mean of its other local maxima: a map with one outstanding place
/// counts for more than one that is busy everywhere. The sum is scaled to [0, 1] again.
pub fn saliency(surface: &CurvedSurface, xi: f64, progress: &Progress) -> Result<Vec<f64>, Canceled> {
    if surface.points.is_empty() || xi <= 0.0 {
        return Ok(vec![0.0; surface.points.len()]);
    }
    let grid = CellGrid::new(&surface.points, 4.0 * xi);
    let filtered = all_filters(surface, &grid, xi, progress)?;
    let mut total = vec![0.0; surface.points.len()];
    for (scale, [narrow, wide]) in SCALES.into_iter().enumerate() {
        let mut map: Vec<f64> = filtered.iter().map(|g| (g[narrow] - g[wide]).abs()).collect();
        scale_to_one(&mut map);
        progress.check()?;
        let maxima = mean_of_other_maxima(surface, &grid, &map, SIGMAS_IN_XI[scale] * xi);
        let weight = (1.0 - maxima).powi(2);
        for (sum, value) in total.iter_mut().zip(&map) {
            *sum += weight * value;
        }
    }
    scale_to_one(&mut total);
    Ok(total)
}

/// [`weighted_curvature`] for all filters in one pass over the neighbours: four at once in f32.
fn all_filters(
    surface: &CurvedSurface,
    grid: &CellGrid,
    xi: f64,
    progress: &Progress,
) -> Result<Vec<[f64; 8]>, Canceled> {
    let widest = FILTERS_IN_XI[7] * xi;
    // lengths in units of the widest filter, areas and curvatures as shares of their greatest: no f32 overflows
    let half = |filter: usize| (0.5 * (FILTERS_IN_XI[7] / FILTERS_IN_XI[filter]).powi(2)) as f32;
    let [narrow, wide] = [0, 4].map(|first| f32x4::new([0, 1, 2, 3].map(|k| half(first + k))));
    let widest_of_narrow = half(3);
    let greatest = |values: &[f64]| values.iter().fold(0.0, |most: f64, v| most.max(v.abs())).max(f64::MIN_POSITIVE);
    let (area_unit, curvature_unit) = (greatest(&surface.areas), greatest(&surface.mean_curvatures));
    let weighed: Vec<[f32; 2]> = surface
        .areas
        .iter()
        .zip(&surface.mean_curvatures)
        .map(|(area, l)| [(area / area_unit) as f32, (area / area_unit * (l / curvature_unit)) as f32])
        .collect();
    let per_widest2 = 1.0 / (widest * widest);
    (0..surface.points.len())
        .into_par_iter()
        .map(|vertex| {
            progress.check()?;
            let mut filters = [Filters::default(); 2];
            grid.for_each_within(&surface.points[vertex], widest, |x, distance2| {
                let [area, curvature] = weighed[x];
                let distance2 = (distance2 * per_widest2) as f32;
                filters[1].add(distance2, wide, area, curvature);
                // the narrower half of the filters does not reach far
                if distance2 * widest_of_narrow < 0.5 {
                    filters[0].add(distance2, narrow, area, curvature);
                }
            });
            let [narrow, wide] = filters.map(|filters| filters.means(curvature_unit));
            Ok(std::array::from_fn(|filter| if filter < 4 { narrow[filter] } else { wide[filter - 4] }))
        })
        .collect()
}

/// The sums of four filters.
#[derive(Default, Clone, Copy)]
struct Filters {
    sums: f32x4,
    weights: f32x4,
}

impl Filters {
    /// `halves` are `1 / (2 sigma^2)`.
    #[inline(always)]
    fn add(&mut self, distance2: f32, halves: f32x4, area: f32, curvature: f32) {
        let x = f32x4::splat(distance2) * halves;
        let falloff = x.simd_lt(f32x4::HALF) & near_falloff_lanes(x);
        self.sums += falloff * f32x4::splat(curvature);
        self.weights += falloff * f32x4::splat(area);
    }

    fn means(&self, unit: f64) -> [f64; 4] {
        let [sums, weights] = [self.sums, self.weights].map(|lanes| lanes.to_array().map(f64::from));
        std::array::from_fn(|k| if weights[k] > 0.0 { unit * sums[k] / weights[k] } else { 0.0 })
    }
}

/// Scales to a range of 0 to 1; a map that is the same everywhere (to rounding) has nothing salient: all 0.
fn scale_to_one(map: &mut [f64]) {
    let (low, high) = map.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &v| (low.min(v), high.max(v)));
    let range = high - low;
    for value in map {
        *value = if range > 1e-12 * high.abs() { (*value - low) / range } else { 0.0 };
    }
}

/// The mean of the local maxima (no greater value nearer than `radius`) without the greatest of all.
fn mean_of_other_maxima(surface: &CurvedSurface, grid: &CellGrid, map: &[f64], radius: f64) -> f64 {
    let is_maximum: Vec<bool> = (0..map.len())
        .into_par_iter()
        .map(|vertex| {
            let higher = |x: usize| map[x] > map[vertex];
            let counts = map[vertex] > 0.0 && surface.areas[vertex] > 0.0;
            counts && !grid.any_within(&surface.points[vertex], radius, higher)
        })
        .collect();
    let maxima: Vec<f64> = map.iter().zip(&is_maximum).filter(|(v, is)| **is && **v < 1.0).map(|(v, _)| *v).collect();
    if maxima.is_empty() { 0.0 } else { maxima.iter().sum::<f64>() / maxima.len() as f64 }
}

#[cfg(test)]
mod tests {
    use super::super::curvature::tests::sphere;
    use super::*;
    use visage_geometry::{Mesh, Point3};

    fn saliency(surface: &CurvedSurface, xi: f64) -> Vec<f64> {
        super::saliency(surface, xi, &Progress::silent()).expect("not canceled")
    }

    /// A sphere with one bump at +z.
    fn bumpy() -> Mesh {
        let mut mesh = sphere(1.0, 5);
        for vertex in &mut mesh.vertices {
            let angle2 = 2.0 * (1.0 - vertex.z);
            *vertex = Point3::from(vertex.coords * (1.0 + 0.08 * (-angle2 / (2.0 * 0.06 * 0.06)).exp()));
        }
        mesh
    }

    #[test]
    fn one_pass_gives_what_the_formula_gives() {
        let surface = CurvedSurface::from_mesh(&bumpy(), 1.0);
        let xi = surface.xi();
        let grid = CellGrid::new(&surface.points, 4.0 * xi);
        let filtered = all_filters(&surface, &grid, xi, &Progress::silent()).expect("not canceled");
        for vertex in (0..surface.points.len()).step_by(97) {
            for (filter, sigma) in FILTERS_IN_XI.iter().enumerate() {
                let expected = weighted_curvature(&surface, &grid, vertex, sigma * xi);
                assert!((filtered[vertex][filter] - expected).abs() < 1e-5 * (1.0 + expected.abs()));
            }
        }
    }

    #[test]
    fn the_filters_are_the_papers_sigmas_and_their_doubles() {
        for (sigma, [narrow, wide]) in SIGMAS_IN_XI.into_iter().zip(SCALES) {
            assert_eq!(FILTERS_IN_XI[narrow], sigma);
            assert_eq!(FILTERS_IN_XI[wide], 2.0 * sigma);
        }
    }

    #[test]
    fn the_bump_is_the_salient_place() {
        let surface = CurvedSurface::from_mesh(&bumpy(), 1.0);
        let map = saliency(&surface, 3.0 * surface.xi());
        let peak = (0..map.len()).fold(0, |best, v| if map[v] > map[best] { v } else { best });
        assert_eq!(map[peak], 1.0);
        assert!(surface.points[peak].z > 0.95, "{}", surface.points[peak]);
        let far: Vec<f64> = (0..map.len()).filter(|&v| surface.points[v].z < 0.0).map(|v| map[v]).collect();
        assert!(far.iter().sum::<f64>() / (far.len() as f64) < 0.1);
    }

    #[test]
    fn saliency_does_not_depend_on_scale_or_winding() {
        let mesh = bumpy();
        let grown = Mesh { vertices: mesh.vertices.iter().map(|p| p * 1000.0).collect(), faces: mesh.faces.clone() };
        let (one, other) = (CurvedSurface::from_mesh(&mesh, 1.0), CurvedSurface::from_mesh(&grown, -1.0));
        let maps = [saliency(&one, one.xi()), saliency(&other, other.xi())];
        assert!(maps[0].iter().zip(&maps[1]).all(|(a, b)| (a - b).abs() < 1e-6));
    }

    #[test]
    fn nothing_to_see_on_nothing() {
        assert!(saliency(&CurvedSurface::default(), 1.0).is_empty());
    }
}
