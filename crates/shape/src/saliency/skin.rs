//! A cloud's skin: how thick noise and misplaced views made its surface, and the surface in the middle of it.
//!
//! Merged scans of depth cameras lie in a layer several millimetres thick. Thinned to cells smaller than that they are
//! samples one above the other, with normals in all directions; what they resolve is the surface that runs through
//! the middle, averaged over a width that grows with the thickness and shrinks with the density.

use nalgebra::{Matrix6, Vector6};
use rayon::prelude::*;

use super::cells::CellGrid;
use super::median;
use super::quadric::tangents;
use super::samples::Samples;
use visage_geometry::normals::least_spread;
use visage_geometry::progress::{Canceled, Progress};
use visage_geometry::{Point3, Vector3};

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Places at which the skin is measured.
        places: usize = 400,
        /// Points that are looked at in all, about.
        looked_at: usize = 200_000,
        /// A place is measured within a radius of so many cells at first, and more until the skin looks thin in it.
        first_radius_in_cells: f64 = 2.0,
        /// The radius grows by this factor,
        growth: f64 = 1.5,
        /// so often at most.
        most_growths: usize = 4,
        /// A skin thinner than this share of the radius is a surface there (a quadric through a ball of points leaves 0.4).
        thin: f64 = 0.15,
        /// With fewer points than this a place says nothing: six of them are taken up by the quadric.
        least_points: usize = 18,
        /// The median of what is normally distributed, in standard deviations.
        median_of_normal: f64 = 0.6745,
        /// Skins thinner than this share of a cell are averaged by the cells, of sparse clouds and of dense ones: these have a
        /// few points of all kinds of error, each of which makes a sample of its own.
        averaged_by_cells: [f64; 2] = [0.25, 0.05],
        /// The surface is averaged over such a radius that what is left of the noise is this share of it: a slope of 3 degrees.
        resolved_slope: f64 = 0.05,
        /// The variance of a quadric's height in the middle of weighted neighbours, in that of their mean if all counted alike.
        variance_of_fit: f64 = 6.0,
        /// The radius is at least this many thicknesses, or the neighbours would not be those of a surface.
        least_radius_in_thicknesses: f64 = 3.0,
        /// With fewer neighbours than this a sample is a speck off the surface.
        least_neighbours: usize = 9,
        /// Where surfaces have this many points a cell, all their cells are taken, and a sample with fewer others than this
        /// within two cells (a plane has some twelve) is a speck, such as depth cameras see between near and far.
        points_a_cell: f64 = 2.0,
        /// Samples with fewer others around are specks.
        least_around: usize = 6,
        /// Around: within so many cells.
        around_in_cells: f64 = 2.0,
    }
}

/// What is known of a cloud's skin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Skin {
    /// Standard deviation of the points across the surface.
    pub thickness: f64,
    /// Points per area.
    pub density: f64,
}

impl Skin {
    /// Measures the skin of a cloud whose finest cells of interest have edge `cell`; `None` where too few places tell.
    pub fn of(points: &[Point3], cell: f64, progress: &Progress) -> Result<Option<Skin>, Canceled> {
        let stride = points.len().div_ceil(TUNING.looked_at).max(1);
        let some: Vec<Point3> = points.iter().step_by(stride).copied().collect();
        let first = TUNING.first_radius_in_cells * cell;
        let grid = CellGrid::new(&some, first);
        let places: Vec<&Point3> = some.iter().step_by(some.len().div_ceil(TUNING.places).max(1)).collect();
        let measured: Vec<Skin> = places
            .par_iter()
            .map(|place| {
                progress.check()?;
                Ok(measured_at(&some, &grid, place, first))
            })
            .collect::<Result<Vec<Option<Skin>>, Canceled>>()?
            .into_iter()
            .flatten()
            .collect();
        if 2 * measured.len() < places.len() {
            return Ok(None);
        }
        let usual = |of: fn(&Skin) -> f64| median(measured.iter().map(of).collect());
        let usual = usual(|skin| skin.thickness).zip(usual(|skin| skin.density));
        Ok(usual.map(|(thickness, density)| Skin { thickness, density: density * stride as f64 }))
    }

    /// Whether a surface takes all cells of that edge which it passes through.
    fn is_dense(&self, cell: f64) -> bool {
        self.density * cell * cell >= TUNING.points_a_cell
    }

    /// The radius over which a surface is to be averaged; `None` where cells of that edge do it.
    pub fn radius(&self, cell: f64) -> Option<f64> {
        if self.thickness <= TUNING.averaged_by_cells[usize::from(self.is_dense(cell))] * cell {
            return None;
        }
        // thickness * sqrt(TUNING.variance_of_fit / (pi radius^2 density)) = TUNING.resolved_slope * radius
        let noise = self.thickness * (TUNING.variance_of_fit / (std::f64::consts::PI * self.density)).sqrt();
        let resolved = (noise / TUNING.resolved_slope).sqrt();
        Some(resolved.max(TUNING.least_radius_in_thicknesses * self.thickness).max(TUNING.first_radius_in_cells * cell))
    }
}

/// The samples without specks off the surface; all of them where the surface has too few points to tell.
pub fn without_specks(samples: Samples, skin: &Skin, progress: &Progress) -> Result<Samples, Canceled> {
    if !skin.is_dense(samples.spacing) {
        return Ok(samples);
    }
    let reach = TUNING.around_in_cells * samples.spacing;
    let grid = CellGrid::new(&samples.points, reach);
    let is_kept: Vec<bool> = samples
        .points
        .par_iter()
        .map(|point| {
            progress.check()?;
            let mut around = 0;
            grid.for_each_within(point, reach, |_, _| around += 1);
            // it finds itself
            Ok(around > TUNING.least_around)
        })
        .collect::<Result<_, Canceled>>()?;
    Ok(samples.kept(&is_kept))
}

/// The skin at a place: the smallest ball around it in which the points lie in a layer.
fn measured_at(points: &[Point3], grid: &CellGrid, place: &Point3, first: f64) -> Option<Skin> {
    let mut radius = first;
    for _ in 0..TUNING.most_growths {
        let mut near = Vec::new();
        grid.for_each_within(place, radius, |index, _| near.push(points[index] - place));
        if near.len() >= TUNING.least_points
            && let Some(thickness) = thickness(&near, radius)
            && thickness < TUNING.thin * radius
        {
            let area = std::f64::consts::PI * radius * radius;
            return Some(Skin { thickness, density: near.len() as f64 / area });
        }
        radius *= TUNING.growth;
    }
    None
}

/// How far points lie from a quadric through them: a standard deviation by the median, which specks do not move.
fn thickness(offsets: &[Vector3], radius: f64) -> Option<f64> {
    let mut fit = Fit::default();
    let normal = plane(offsets.iter().map(|offset| (*offset, 1.0)));
    let [x, y] = tangents(&normal);
    let row = |offset: &Vector3| row(offset.dot(&x) / radius, offset.dot(&y) / radius);
    offsets.iter().for_each(|offset| fit.add(&row(offset), offset.dot(&normal), 1.0));
    let coefficients = fit.solved()?;
    let off = offsets.iter().map(|offset| (offset.dot(&normal) - row(offset).dot(&coefficients)).abs());
    let freedom = (offsets.len() as f64 / (offsets.len() as f64 - 6.0)).sqrt();
    Some(median(off.collect())? / TUNING.median_of_normal * freedom)
}

/// The unit normal of weighted points.
fn plane(weighted: impl Iterator<Item = (Vector3, f64)>) -> Vector3 {
    let (mut sum, mut squares, mut total) = (Vector3::zeros(), nalgebra::Matrix3::zeros(), 0.0);
    for (offset, weight) in weighted {
        sum += offset * weight;
        squares += offset * offset.transpose() * weight;
        total += weight;
    }
    let total = f64::max(total, f64::MIN_POSITIVE);
    least_spread(&(squares / total - sum * sum.transpose() / (total * total))).0
}

/// What a quadric's coefficients count at a place.
fn row(x: f64, y: f64) -> Vector6<f64> {
    Vector6::new(x * x, x * y, y * y, x, y, 1.0)
}

/// The normal equations of a weighted quadric.
#[derive(Debug, Default)]
struct Fit {
    matrix: Matrix6<f64>,
    right: Vector6<f64>,
}

impl Fit {
    fn add(&mut self, row: &Vector6<f64>, height: f64, weight: f64) {
        self.matrix.syger(weight, row, row, 1.0);
        self.right.axpy(weight * height, row, 1.0);
    }

    fn solved(mut self) -> Option<Vector6<f64>> {
        // a trace of stiffness: where the neighbours leave a bend open there is none
        let stiff = 1e-6 * self.matrix[(5, 5)];
        (0..5).for_each(|k| self.matrix[(k, k)] += stiff);
        Some(self.matrix.cholesky()?.solve(&self.right))
    }
}

/// The samples moved onto the surface in the middle of the skin, averaged within `radius`, each counting by its area
/// (the number of points in it); one a cell then. Normals are those of the surface, on the side of the samples' own.
pub fn settled(samples: &Samples, radius: f64, progress: &Progress) -> Result<Samples, Canceled> {
    let once = moved(samples, samples, radius, progress)?.coarser(samples.spacing);
    Ok(moved(&once, samples, radius, progress)?.coarser(samples.spacing))
}

/// `samples` moved onto the surface in the middle of `skin`.
fn moved(samples: &Samples, skin: &Samples, radius: f64, progress: &Progress) -> Result<Samples, Canceled> {
    let grid = CellGrid::new(&skin.points, radius);
    let found: Vec<Option<(Point3, Vector3)>> = (0..samples.points.len())
        .into_par_iter()
        .map(|index| {
            progress.check()?;
            Ok(middle(&samples.points[index], &samples.normals[index], skin, &grid, radius))
        })
        .collect::<Result<_, Canceled>>()?;
    let mut moved = Samples { spacing: samples.spacing, ..Samples::default() };
    for (found, area) in found.into_iter().zip(&samples.areas) {
        let Some((point, normal)) = found else { continue };
        moved.points.push(point);
        moved.normals.push(normal);
        moved.areas.push(*area);
    }
    Ok(moved)
}

/// The surface at the foot of a point; `None` where too little lies around it.
fn middle(point: &Point3, normal: &Vector3, skin: &Samples, grid: &CellGrid, radius: f64) -> Option<(Point3, Vector3)> {
    let mut near: Vec<(Vector3, f64)> = Vec::with_capacity(96);
    grid.for_each_within(point, radius, |index, distance2| {
        if skin.normals[index].dot(normal) >= 0.0 {
            let weight = skin.areas[index] * (1.0 - distance2 / (radius * radius)).powi(2);
            near.push((skin.points[index] - point, weight));
        }
    });
    if near.len() < TUNING.least_neighbours {
        return None;
    }
    let mut up = plane(near.iter().copied());
    if up.dot(normal) < 0.0 {
        up = -up;
    }
    let [x, y] = tangents(&up);
    let mut fit = Fit::default();
    for (offset, weight) in &near {
        fit.add(&row(offset.dot(&x) / radius, offset.dot(&y) / radius), offset.dot(&up), *weight);
    }
    let coefficients = fit.solved()?;
    let (height, slope_x, slope_y) = (coefficients[5], coefficients[3] / radius, coefficients[4] / radius);
    if height.abs() > radius {
        return None;
    }
    let normal = (up - x * slope_x - y * slope_y).try_normalize(f64::MIN_POSITIVE)?;
    Some((point + up * height, normal))
}

#[cfg(test)]
mod tests {
    use rand::distr::Distribution;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    use super::*;

    /// A square of 400, bent to a radius of 1000, with noise of this height across it.
    fn sheet(points: usize, noise: f64) -> Vec<Point3> {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let point = |_| {
            let (x, y) = (rng.random_range(-200.0..200.0), rng.random_range(-200.0..200.0));
            let error: f64 = StandardNormal.sample(&mut rng);
            Point3::new(x, y, height(x, y) + noise * error)
        };
        (0..points).map(point).collect()
    }

    fn height(x: f64, y: f64) -> f64 {
        -(x * x + y * y) / 2000.0
    }

    fn skin(points: &[Point3], cell: f64) -> Skin {
        Skin::of(points, cell, &Progress::silent()).expect("not canceled").expect("it can be told")
    }

    #[test]
    fn thickness_and_density_are_told_from_the_points() {
        for noise in [0.3, 2.0, 4.0] {
            let skin = skin(&sheet(80_000, noise), 5.0);
            assert!((skin.thickness / noise - 1.0).abs() < 0.15, "{noise}: {skin:?}");
            assert!((0.35..0.6).contains(&skin.density), "{skin:?}");
        }
    }

    #[test]
    fn a_thick_skin_settles_on_the_surface_in_its_middle() {
        let points = sheet(80_000, 3.0);
        let up = vec![Vector3::z(); points.len()];
        let samples = Samples::counted(&points, &up, 4.0);
        let radius = skin(&points, 4.0).radius(4.0).expect("it is thick");
        let settled = settled(&samples, radius, &Progress::silent()).expect("not canceled");
        assert!(
            settled.points.len() * 2 < samples.points.len(),
            "{} of {}",
            settled.points.len(),
            samples.points.len()
        );
        let inside = settled.points.iter().zip(&settled.normals).filter(|(p, _)| p.x.abs().max(p.y.abs()) < 180.0);
        let off: Vec<(f64, f64)> =
            inside.map(|(point, normal)| ((point.z - height(point.x, point.y)).powi(2), normal.z)).collect();
        let rms = (off.iter().map(|(square, _)| square).sum::<f64>() / off.len() as f64).sqrt();
        let upright = off.iter().filter(|(_, z)| *z > 0.9).count();
        assert!(rms < 0.35 * 3.0 && upright * 20 > off.len() * 19, "{rms} {upright} of {}", off.len());
    }

    #[test]
    fn sparse_and_thin_clouds_stay_as_they_are() {
        assert_eq!(skin(&sheet(8_000, 0.2), 4.0).radius(4.0), None);
        assert_eq!(skin(&sheet(80_000, 0.1), 4.0).radius(4.0), None);
    }

    #[test]
    fn specks_are_left_out_where_surfaces_are_dense() {
        let mut points = sheet(80_000, 0.1);
        points.extend((0..50).map(|k| Point3::new(f64::from(k) * 7.0 - 170.0, 0.0, 40.0)));
        let up = vec![Vector3::z(); points.len()];
        let count = |points: &[Point3]| {
            let samples = Samples::counted(points, &up, 5.0);
            without_specks(samples, &skin(points, 5.0), &Progress::silent()).expect("not canceled")
        };
        let kept = count(&points);
        assert!(kept.points.iter().all(|p| p.z < 20.0) && kept.points.len() > 5_500, "{}", kept.points.len());
    }
}
