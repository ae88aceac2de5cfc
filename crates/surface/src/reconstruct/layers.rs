//! Whether scans lie on each other where they overlap, or as layers: what the surface is the mean of.
//!
//! In cells that hold points of several scans, the mean of one scan lies off that of another, along the normal, by the noise of
//! both means and by what the scans disagree about. How much the noise makes is known: it is what the halves of one scan
//! differ by in the same cells, so curved surface and slanted normals are in both figures.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::grid::{block_of, place_of};
use super::samples::Frame;
use visage_geometry::{Bounds, Cloud, Point3};

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Edges of the cells, in spacings: the wider ones hold layers that are farther from each other.
        cells: [f64; 2] = [4.0, 8.0],
        /// About so many points are looked at for each edge.
        looked_at: usize = 150_000,
        /// A scan with fewer points in a cell has no say there: each half has two.
        least: usize = 4,
        /// Two scans that share fewer cells say nothing of each other, nor does a scan whose halves were compared in fewer.
        shared: usize = 20,
    }
}
/// From the median of absolute deviations to the standard deviation of a normal distribution.
const NORMAL: f64 = 1.4826;

/// What scans say of the same places.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Layers {
    /// Standard deviation of the points of one scan from the surface that they are of, a length.
    pub noise: f64,
    /// For each scan that overlaps others how far it lies from them, a length without what the noise makes.
    pub scans: Vec<Layer>,
}

/// A scan among the others.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Layer {
    /// The scan.
    pub view: u16,
    /// How far it lies from those that it overlaps: half of the shared places are farther apart than the middle, and the
    /// standard deviation that belongs to it is told.
    pub distance: f64,
}

/// Points of one scan in a cell, by halves.
#[derive(Debug, Clone, Copy, Default)]
struct Part {
    counts: [f64; 2],
    sums: [nalgebra::Vector3<f64>; 2],
}

impl Part {
    fn count(&self) -> f64 {
        self.counts[0] + self.counts[1]
    }

    fn mean(&self) -> nalgebra::Vector3<f64> {
        (self.sums[0] + self.sums[1]) / self.count()
    }
}

/// What one cell says.
#[derive(Default)]
struct Said {
    /// By how much the halves of a scan differ, as if each were one point.
    halves: Vec<f64>,
    /// Two scans, how far apart they are, and the factor of the noise in that.
    pairs: Vec<(u16, u16, f64, f64)>,
}

/// How scans lie on each other; `views` says of which scan each point is. `None` if they share too little to tell.
pub fn layers(cloud: &Cloud, views: &[u16], spacing: f64) -> Option<Layers> {
    let normals = cloud.normals.as_ref()?;
    let bounds = Bounds::of(&cloud.points)?;
    let found = TUNING.cells.iter().filter_map(|cell| {
        let frame = Frame::around(&bounds, cell * spacing);
        of_cells(&frame, &cloud.points, normals, views)
    });
    // a scan may be too far off for the narrow cells, and bend too much for the wide ones
    found.reduce(|narrow, wide| {
        let of = |layers: &Layers| -> BTreeMap<u16, f64> {
            layers.scans.iter().map(|layer| (layer.view, layer.distance)).collect()
        };
        let (mut all, narrow_noise) = (of(&narrow), narrow.noise);
        for (view, distance) in of(&wide) {
            let entry = all.entry(view).or_insert(distance);
            *entry = entry.max(distance);
        }
        let scans = all.into_iter().map(|(view, distance)| Layer { view, distance }).collect();
        Layers { noise: narrow_noise, scans }
    })
}

/// What the cells of one frame say.
fn of_cells(frame: &Frame, points: &[Point3], normals: &[nalgebra::Vector3<f32>], views: &[u16]) -> Option<Layers> {
    let one_of = (points.len() / TUNING.looked_at).max(1) as u64;
    let mut order: Vec<(u64, u32)> = points
        .par_iter()
        .zip(normals)
        .enumerate()
        .filter_map(|(index, (point, normal))| {
            let cell = frame.local(point).map(|x| x as i32);
            let octant = (0..3).fold(0, |bits, axis| bits | u64::from(normal[axis] < 0.0) << axis);
            let key = block_of(&cell) << 12 | (place_of(&cell) as u64) << 3 | octant;
            // a multiplicative hash: whole cells, from all over
            let is_chosen = (key.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 32).is_multiple_of(one_of);
            is_chosen.then_some((key, index as u32))
        })
        .collect();
    order.par_sort_unstable();
    let cells: Vec<&[(u64, u32)]> = order.chunk_by(|a, b| a.0 == b.0).collect();
    let said: Vec<Said> = cells.par_iter().map(|cell| said(cell, points, normals, views)).collect();
    let mut halves: Vec<f64> = said.iter().flat_map(|said| said.halves.iter().copied()).collect();
    if halves.len() < TUNING.shared {
        return None;
    }
    let noise = NORMAL * median(&mut halves);
    let mut of_pairs: BTreeMap<(u16, u16), [Vec<f64>; 2]> = BTreeMap::new();
    for (a, b, apart, factor) in said.iter().flat_map(|said| said.pairs.iter().copied()) {
        let [aparts, factors] = of_pairs.entry((a, b)).or_default();
        aparts.push(apart);
        factors.push(factor);
    }
    let mut of_views: BTreeMap<u16, Vec<f64>> = BTreeMap::new();
    for ((a, b), [mut aparts, mut factors]) in
        of_pairs.into_iter().filter(|(_, [aparts, _])| aparts.len() >= TUNING.shared)
    {
        let (seen, expected) = (NORMAL * median(&mut aparts), noise * median(&mut factors));
        let distance = (seen * seen - expected * expected).max(0.0).sqrt();
        [a, b].into_iter().for_each(|view| of_views.entry(view).or_default().push(distance));
    }
    // of a scan that lies off, most neighbours say so; of its neighbours, one does
    let scans: Vec<Layer> =
        of_views.into_iter().map(|(view, mut of)| Layer { view, distance: lower_median(&mut of) }).collect();
    (!scans.is_empty()).then_some(Layers { noise, scans })
}

fn said(cell: &[(u64, u32)], points: &[Point3], normals: &[nalgebra::Vector3<f32>], views: &[u16]) -> Said {
    let mut parts: BTreeMap<u16, Part> = BTreeMap::new();
    let mut normal = nalgebra::Vector3::zeros();
    let first = cell.first().map(|(_, index)| points[*index as usize]).unwrap_or_default();
    for (_, index) in cell {
        let index = *index as usize;
        let part = parts.entry(views[index]).or_default();
        let half = usize::from(part.counts[0] > part.counts[1]);
        part.counts[half] += 1.0;
        part.sums[half] += points[index] - first;
        normal += normals[index].cast::<f64>();
    }
    let Some(normal) = normal.try_normalize(1e-9) else { return Said::default() };
    let parts: Vec<(u16, Part)> = parts.into_iter().filter(|(_, part)| part.count() >= TUNING.least as f64).collect();
    let mut said = Said::default();
    for (index, (view, part)) in parts.iter().enumerate() {
        let [a, b] = [0, 1].map(|half| part.sums[half] / part.counts[half]);
        let of_one = (1.0 / part.counts[0] + 1.0 / part.counts[1]).sqrt();
        said.halves.push(normal.dot(&(a - b)).abs() / of_one);
        for (other, others) in &parts[..index] {
            let apart = normal.dot(&(part.mean() - others.mean())).abs();
            said.pairs.push((*other, *view, apart, (1.0 / part.count() + 1.0 / others.count()).sqrt()));
        }
    }
    said
}

fn median(values: &mut [f64]) -> f64 {
    let middle = values.len() / 2;
    values.sort_unstable_by(f64::total_cmp);
    values.get(middle).copied().unwrap_or_default()
}

/// Of two values the lower one: one neighbour alone may be the one that is off.
fn lower_median(values: &mut [f64]) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    values.get(values.len().saturating_sub(1) / 2).copied().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_geometry::Vector3;

    /// Four scans of a sphere of radius 40 from around its equator, in points of spacing 1 with a noise of 0.1; the third is
    /// moved.
    fn scans(moved: Vector3) -> (Cloud, Vec<u16>) {
        let mut seed = 7u64;
        let mut uniform = || {
            seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (seed >> 33) as f64 / f64::from(1u32 << 31)
        };
        let (mut points, mut normals, mut views) = (Vec::new(), Vec::new(), Vec::new());
        let around = |view: u16| f64::from(view) * std::f64::consts::FRAC_PI_2;
        for view in 0..4 {
            let (sine, cosine) = around(view).sin_cos();
            for _ in 0..10_000 {
                // evenly over the half that this scanner sees, and a bit more
                let z = 2.0 * uniform() - 1.0;
                let (s, c) = (std::f64::consts::TAU * uniform()).sin_cos();
                let direction = Vector3::new((1.0 - z * z).sqrt() * c, (1.0 - z * z).sqrt() * s, z);
                // a sum of twelve has the variance 1
                let off: f64 = (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
                if direction.dot(&Vector3::new(cosine, sine, 0.0)) > -0.1 {
                    let shift = if view == 2 { moved } else { Vector3::zeros() };
                    points.push(Point3::from((40.0 + 0.1 * off) * direction + shift));
                    normals.push(direction.cast());
                    views.push(view);
                }
            }
        }
        (Cloud { normals: Some(normals), ..Cloud::from_points(points) }, views)
    }

    #[test]
    fn noise_is_told_from_layers_and_the_scan_that_is_off_is_found() {
        let found = |moved: Vector3| {
            let (cloud, views) = scans(moved);
            layers(&cloud, &views, 1.4).expect("they overlap")
        };
        let still = found(Vector3::zeros());
        assert!((0.07..0.16).contains(&still.noise), "{still:?}");
        assert!(still.scans.len() == 4 && still.scans.iter().all(|scan| scan.distance < 0.1), "{still:?}");
        for off in [0.5, 2.0] {
            let layers = found(Vector3::new(0.0, 0.0, off));
            assert!((layers.noise / still.noise - 1.0).abs() < 0.2, "the layers are not its own: {layers:?}");
            let of = |view: usize| layers.scans[view].distance;
            assert!((0.4..1.6).contains(&(of(2) / off)), "{layers:?}");
            assert!([0, 1, 3].into_iter().all(|view| of(view) < 0.1), "its neighbours have others: {layers:?}");
        }
    }

    #[test]
    fn one_scan_alone_has_no_layers() {
        let (cloud, views) = scans(Vector3::zeros());
        assert_eq!(layers(&cloud, &vec![0; views.len()], 1.4), None);
        assert_eq!(layers(&Cloud::default(), &[], 1.0), None);
    }
}
