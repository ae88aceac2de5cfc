//! Whether colours bear a registration out. A bottle fits itself at any turn; what is printed on it does not.
//!
//! Light and exposure change from scan to scan, and so do means and shades: what is compared is how much brighter or
//! darker a point is than what surrounds it. That is partly noise, which shows in points side by side; how well colours of
//! two scans can agree at best follows from it.

use rayon::prelude::*;

use crate::outcome::Outcome;
use crate::view::View;
use crate::view_graph::all_pairs;
use visage_geometry::neighbours::LocalPoint;

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Points of a view that are held against another.
        samples: usize = 500,
        /// Fewer counterparts say nothing.
        least: usize = 150,
        /// A counterpart lies within so many units.
        beside: f64 = 1.5,
        /// A point is compared with what lies within so many units around it.
        surroundings: f64 = 8.0,
        /// Below this share of what varies that is no noise, a view has no texture to speak of.
        textured: f64 = 0.3,
    }
}

/// How bright the points of a view are, in its order.
pub type Brightness = Vec<f32>;

/// For each view how well its texture agrees with the neighbour that it agrees with best, in what noise lets it: about 1
/// where views lie right, about 0 where they don't; `None` where there is no texture, or too little of it overlaps.
/// `unit` is what the views resolve, a length.
pub fn agreement(views: &[View], brightness: &[Option<Brightness>], result: &Outcome, unit: f64) -> Vec<Option<f64>> {
    let textures: Vec<Option<Texture>> = views
        .par_iter()
        .zip(brightness)
        .map(|(view, brightness)| Texture::new(view, brightness.as_deref()?, unit))
        .collect();
    let n = views.len();
    let pairs: Vec<(usize, usize)> = all_pairs(n)
        .filter(|&(i, j)| result.placed[i] && result.placed[j])
        .filter(|&(i, j)| result.overlaps.directed(i, j) > 0.0)
        .collect();
    let found: Vec<Option<f64>> = pairs
        .par_iter()
        .map(|&(i, j)| {
            let motion = result.local_poses[j].inv_mul(&result.local_poses[i]).cast::<f32>();
            correlation(textures[i].as_ref()?, textures[j].as_ref()?, &motion, unit)
        })
        .collect();
    let mut best: Vec<Option<f64>> = vec![None; n];
    for ((i, j), agreement) in pairs.into_iter().zip(found) {
        let Some(agreement) = agreement else { continue };
        for view in [i, j] {
            best[view] = Some(best[view].map_or(agreement, |known| known.max(agreement)));
        }
    }
    best
}

/// A view whose points differ in brightness by more than noise.
struct Texture<'a> {
    view: &'a View,
    brightness: &'a [f32],
    radius2: f32,
    /// The share of what varies that is no noise.
    reliability: f64,
}

impl<'a> Texture<'a> {
    fn new(view: &'a View, brightness: &'a [f32], unit: f64) -> Option<Self> {
        let radius2 = (TUNING.surroundings * unit).powi(2) as f32;
        let mut texture = Texture { view, brightness, radius2, reliability: 1.0 };
        let (mut squares, mut noise, mut count) = (0.0, 0.0, 0.0);
        let mut near = Vec::new();
        for index in sampled(view) {
            let own = texture.relief(&view.points()[index], index);
            view.indexed.tree.k_nearest(&view.points()[index], 2, f32::INFINITY, &mut near);
            let Some(beside) = near.iter().find(|n| n.index as usize != index) else { continue };
            let step = f64::from(brightness[index] - brightness[beside.index as usize]);
            (squares, noise, count) = (squares + own * own, noise + 0.5 * step * step, count + 1.0);
        }
        texture.reliability = 1.0 - noise / f64::max(squares, f64::MIN_POSITIVE);
        (count > 0.0 && texture.reliability >= TUNING.textured).then_some(texture)
    }

    /// How much brighter a point is than its surroundings.
    fn relief(&self, place: &LocalPoint, index: usize) -> f64 {
        let (mut sum, mut count) = (0.0, 0.0);
        self.view.indexed.tree.for_each_within(place, self.radius2, |n| {
            sum += f64::from(self.brightness[n.index as usize]);
            count += 1.0;
        });
        f64::from(self.brightness[index]) - sum / f64::max(count, 1.0)
    }
}

/// Indices of points spread evenly over a view.
fn sampled(view: &View) -> impl Iterator<Item = usize> {
    let count = view.points().len();
    (0..count).step_by(count.div_ceil(TUNING.samples).max(1))
}

/// The correlation of two textures where they overlap, in the largest that noise allows; `motion` maps the first view into
/// the second.
fn correlation(a: &Texture, b: &Texture, motion: &nalgebra::Isometry3<f32>, unit: f64) -> Option<f64> {
    let reach2 = (TUNING.beside * unit).powi(2) as f32;
    let reliefs: Vec<(f64, f64)> = sampled(a.view)
        .filter_map(|index| {
            let place = a.view.points()[index];
            let moved = (motion * nalgebra::Point3::from(place)).coords.into();
            let target = b.view.indexed.tree.nearest(&moved, reach2)?.index as usize;
            Some((a.relief(&place, index), b.relief(&b.view.points()[target], target)))
        })
        .collect();
    if reliefs.len() < TUNING.least {
        return None;
    }
    let count = reliefs.len() as f64;
    let (mean_a, mean_b) = reliefs.iter().fold((0.0, 0.0), |(x, y), (a, b)| (x + a / count, y + b / count));
    let (mut aa, mut ab, mut bb) = (0.0, 0.0, 0.0);
    for (x, y) in reliefs.iter().map(|(a, b)| (a - mean_a, b - mean_b)) {
        (aa, ab, bb) = (aa + x * x, ab + x * y, bb + y * y);
    }
    let spread = (aa * bb).sqrt();
    (spread > 0.0).then(|| ab / spread / (a.reliability * b.reliability).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::overlap::OverlapMatrix;
    use visage_geometry::{Cloud, Motion, Point3};

    /// A sheet of 60 by 60 points with blotches; the shift is that of its texture.
    fn sheet(shift: f64, contrast: f32) -> (View, Option<Brightness>) {
        let places = (0..3600).map(|k| (f64::from(k % 60), f64::from(k / 60)));
        let bright = |(x, y): (f64, f64)| contrast * ((0.5 * (x + shift)).sin() * (0.4 * y).cos()) as f32;
        let brightness = places.clone().map(bright).collect();
        let points = places.map(|(x, y)| Point3::new(x, y, 0.0)).collect();
        (View::new(&Cloud::from_points(points)).expect("a sheet can be used"), Some(brightness))
    }

    fn agreed(sheets: [(View, Option<Brightness>); 2]) -> Vec<Option<f64>> {
        let (views, brightness): (Vec<View>, Vec<Option<Brightness>>) = sheets.into_iter().unzip();
        let poses: Vec<Motion> = views.iter().map(|view| view.local_pose(&Motion::identity())).collect();
        let overlaps = OverlapMatrix::from_rows(vec![vec![1.0; 2]; 2]);
        let result = Outcome { overlaps, ..Outcome::at(&poses) };
        agreement(&views, &brightness, &result, 1.0)
    }

    #[test]
    fn texture_tells_where_a_sheet_lies_on_a_sheet() {
        for agreement in agreed([sheet(0.0, 50.0), sheet(0.0, 20.0)]) {
            assert!(agreement.is_some_and(|agreement| agreement > 0.9), "{agreement:?}");
        }
        for agreement in agreed([sheet(0.0, 50.0), sheet(3.1, 50.0)]) {
            assert!(agreement.is_some_and(|agreement| agreement < 0.4), "{agreement:?}");
        }
    }

    #[test]
    fn what_has_no_texture_says_nothing() {
        assert_eq!(agreed([sheet(0.0, 0.0), sheet(0.0, 50.0)]), [None, None]);
    }
}
