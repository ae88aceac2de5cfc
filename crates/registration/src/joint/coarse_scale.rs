//! Scales to start from: each view tries a range of them and takes the one that brings it nearest to the others.
//!
//! At the given poses a wrong scale moves a scan's points along the rays from its origin, by up to their distance from
//! it: far more than a refinement can bridge where a sensor stood at the origin. So scales are searched one after the
//! other, spreading from the fixed views over those that touch what is already placed, and then once more against all
//! others.

use rayon::prelude::*;

use super::PASSES;
use super::refine::{LEAST_COSINE, Placement};
use super::surfels::Surfels;
use crate::view::View;
use crate::view::common_spacing;
use visage_geometry::Motion;
use visage_geometry::progress::{Canceled, Progress};

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Scales between the inverse of this and this are tried.
        range: f64 = 1.4,
        /// Surfels nearer than this many edges of the first pass are counterparts to some extent.
        reach: f64 = 1.5,
        /// Surfels of a view that are asked, at most.
        samples: usize = 250,
        /// Scales tried, at most: half of `TUNING.range` on either side.
        max_steps: f64 = 120.0,
    }
}

/// What each view's points are to be multiplied by, given the poses of their scans; 1 for those that are `fixed` or
/// whose scale `is_known`, and for those that touch nothing at any scale.
pub fn coarse_scales(
    views: &[View],
    scan_poses: &[Motion],
    is_known: &[bool],
    fixed: &[usize],
    progress: &Progress,
) -> Result<Vec<f64>, Canceled> {
    let edge = PASSES[0].edge(views, common_spacing(views));
    let surfels: Vec<Surfels> = views.par_iter().map(|view| Surfels::new(view, edge)).collect();
    let search = Search { views, surfels: &surfels, scan_poses, reach: TUNING.reach * edge };
    let mut scales = vec![1.0; views.len()];
    let mut placed: Vec<usize> = (0..views.len()).filter(|view| is_known[*view] || fixed.contains(view)).collect();
    let mut tables: Vec<Option<Table>> =
        (0..views.len()).map(|view| (!placed.contains(&view)).then(|| search.table(view))).collect();
    let mut fresh = placed.clone();
    while placed.len() < views.len() {
        progress.check()?;
        tables.par_iter_mut().enumerate().for_each(|(view, table)| {
            if let Some(table) = table {
                fresh.iter().for_each(|&other| search.extend(table, view, other, scales[other]));
            }
        });
        let Some((view, scale)) = nearest(&tables) else { break };
        tables[view] = None;
        scales[view] = scale;
        placed.push(view);
        fresh = vec![view];
    }
    let searched: Vec<usize> =
        (0..views.len()).filter(|v| placed.contains(v) && !fixed.contains(v) && !is_known[*v]).collect();
    for view in searched {
        progress.check()?;
        let mut table = search.table(view);
        let others = placed.iter().filter(|other| **other != view);
        others.for_each(|&other| search.extend(&mut table, view, other, scales[other]));
        scales[view] = table.best().map_or(scales[view], |(_, scale)| scale);
    }
    Ok(scales)
}

/// The view that fits best at some scale, with that scale; `None` if none touches anything.
fn nearest(tables: &[Option<Table>]) -> Option<(usize, f64)> {
    let fits = tables.iter().enumerate().filter_map(|(view, table)| Some((view, table.as_ref()?.best()?)));
    let best = fits.max_by(|(a, (fit_a, _)), (b, (fit_b, _))| fit_a.total_cmp(fit_b).then(b.cmp(a)))?;
    Some((best.0, best.1.1))
}

/// How well one view fits those placed, at each scale tried.
struct Table {
    scales: Vec<f64>,
    /// For each scale and sample of the view: the best fit with any placed view.
    outward: Vec<Vec<f32>>,
    /// For each scale: the fits of the placed views' samples with the view.
    inward: Vec<f64>,
}

impl Table {
    /// The fit of a sample at the best scale, and that scale; `None` if nothing is touched at any.
    ///
    /// Both directions count: a view that shrinks onto another fits it, but the other no longer fits the view.
    fn best(&self) -> Option<(f64, f64)> {
        let fit =
            |(outward, inward): (&Vec<f32>, &f64)| outward.iter().map(|fit| f64::from(*fit)).sum::<f64>() + inward;
        let fits = self.outward.iter().zip(&self.inward).map(fit).zip(&self.scales);
        let (fit, scale) = fits.max_by(|a, b| a.0.total_cmp(&b.0))?;
        (fit > 0.0).then_some((fit, *scale))
    }
}

struct Search<'a> {
    views: &'a [View],
    surfels: &'a [Surfels],
    scan_poses: &'a [Motion],
    reach: f64,
}

impl Search<'_> {
    /// A table in which no scale fits yet: scales so close that from one to the next nothing moves by more than half
    /// of the reach.
    fn table(&self, view: usize) -> Table {
        let lever = self.views[view].center.norm() + self.surfels[view].radius;
        let steps = (2.0 * TUNING.range.ln() * lever / self.reach).ceil().clamp(4.0, TUNING.max_steps);
        let scales: Vec<f64> = (0..=2 * steps as usize).map(|k| TUNING.range.powf(k as f64 / steps - 1.0)).collect();
        let samples = samples(&self.surfels[view]).count();
        Table { outward: vec![vec![0.0; samples]; scales.len()], inward: vec![0.0; scales.len()], scales }
    }

    /// Adds what a placed view says.
    fn extend(&self, table: &mut Table, view: usize, other: usize, other_scale: f64) {
        let fixed = (self.local_pose(other, other_scale), other_scale);
        let rows = table.outward.par_iter_mut().zip(&mut table.inward).zip(&table.scales);
        rows.for_each(|((outward, inward), &scale)| {
            let moved = (self.local_pose(view, scale), scale);
            let reaches = scale * self.surfels[view].radius + other_scale * self.surfels[other].radius + self.reach;
            if (moved.0.translation.vector - fixed.0.translation.vector).norm() > reaches {
                return;
            }
            let there = Placement::between((&fixed.0, fixed.1), (&moved.0, moved.1));
            let back = Placement::between((&moved.0, moved.1), (&fixed.0, fixed.1));
            let fits = self.fits(view, other, &there, self.reach / other_scale);
            outward.iter_mut().zip(fits).for_each(|(best, fit)| *best = best.max(fit));
            *inward += self.fits(other, view, &back, self.reach / scale).map(f64::from).sum::<f64>();
        });
    }

    fn local_pose(&self, view: usize, scale: f64) -> Motion {
        self.scan_poses[view] * nalgebra::Translation3::from(self.views[view].center * scale)
    }

    /// For each sample of view `a` how well it fits view `b`: 1 where it lies on b, 0 from `reach` on (in b's unit).
    fn fits(&self, a: usize, b: usize, placement: &Placement, reach: f64) -> impl Iterator<Item = f32> {
        let (a, b) = (&self.surfels[a], &self.surfels[b]);
        let rotation = placement.motion.rotation.to_rotation_matrix().cast::<f32>();
        let shift = placement.motion.translation.vector.cast::<f32>();
        let (ratio, reach2) = (placement.ratio as f32, (reach * reach) as f32);
        samples(a).map(move |index| {
            let moved = rotation * (nalgebra::Vector3::from(a.indexed.points[index]) * ratio) + shift;
            let Some(nearest) = b.indexed.tree.nearest(&moved.into(), reach2) else { return 0.0 };
            let target = nearest.index as usize;
            let cosine =
                (rotation * nalgebra::Vector3::from(a.normals[index])).dot(&nalgebra::Vector3::from(b.normals[target]));
            let is_counterpart = b.is_inner[target] && a.likeness(index, b, target, cosine) > LEAST_COSINE;
            if is_counterpart { 1.0 - nearest.distance2 / reach2 } else { 0.0 }
        })
    }
}

/// Indices of inner surfels spread evenly over a view.
fn samples(surfels: &Surfels) -> impl Iterator<Item = usize> {
    let step = surfels.inner.len().div_ceil(TUNING.samples).max(1);
    surfels.inner.iter().step_by(step).map(|index| *index as usize)
}
