//! *Sharpness*, the chief sign of right poses: of the points that have another view's surface somewhere near (within
//! [`NEAR`] spacings), the share that has it at touching distance ([`TOUCHING`] spacings). Surfaces that are the same lie on
//! each other; surfaces brought together wrongly cross, and most points near the crossing don't touch.

use rayon::prelude::*;

use super::limits;
use crate::outcome::Outcome;
use crate::view::View;
use visage_geometry::neighbours::LocalPoint;
use visage_geometry::normals;

/// "Near" in spacings.
pub const NEAR: f64 = 8.0;
/// "Touching" in spacings.
pub const TOUCHING: f64 = 2.0;

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Sample points of a view at which sharpness is measured, at most: a share to about 3 %.
        max_samples: usize = 400,
        /// A point that lies farther than this beside the nearest point of another view, in spacings, lies beyond its rim.
        beside: f64 = 2.0,
    }
}

/// Sharpness of each view against all placed views that overlap it, together. `spacing` is what the views resolve.
///
/// A point touches if another view has a point there or goes through there as a plane; beyond a rim it has no counterpart.
pub fn sharpness(views: &[View], result: &Outcome, spacing: f64) -> Vec<Option<f64>> {
    (0..views.len())
        .into_par_iter()
        .map(|i| {
            if !result.placed[i] {
                return None;
            }
            let mut others: Vec<usize> = (0..views.len()).filter(|&j| j != i && result.placed[j]).collect();
            others.retain(|&j| result.overlaps.directed(i, j) > 0.0);
            // the view that is most likely to have the nearest point is asked first, mostly the only one
            others.sort_by(|&a, &b| result.overlaps.directed(i, b).total_cmp(&result.overlaps.directed(i, a)));
            let others: Vec<(&View, nalgebra::Isometry3<f32>)> = others
                .iter()
                .map(|&j| (&views[j], result.local_poses[j].inv_mul(&result.local_poses[i]).cast()))
                .collect();
            let (mut near, mut touching) = (0usize, 0usize);
            let points = views[i].points();
            for sample in points.iter().step_by(points.len().div_ceil(TUNING.max_samples)) {
                match encounter(&others, sample, spacing) {
                    Encounter::Touches => (near, touching) = (near + 1, touching + 1),
                    Encounter::Misses => near += 1,
                    Encounter::Alone => {}
                }
            }
            (near > 0).then(|| touching as f64 / near as f64)
        })
        .collect()
}

/// Whether a view of this sharpness lies on the others.
pub fn is_sharp(sharpness: Option<f64>) -> bool {
    sharpness.is_some_and(|sharpness| sharpness >= limits::SHARP)
}

/// What a point of a view meets.
enum Encounter {
    Touches,
    Misses,
    Alone,
}

fn encounter(others: &[(&View, nalgebra::Isometry3<f32>)], sample: &LocalPoint, spacing: f64) -> Encounter {
    let touching = (TOUCHING * spacing) as f32;
    let mut nearest2 = (NEAR * spacing).powi(2) as f32;
    let mut nearest: Option<(&View, LocalPoint, u32)> = None;
    for (view, motion) in others {
        let moved: LocalPoint = (motion * nalgebra::Point3::from(*sample)).coords.into();
        if let Some(found) = view.indexed.tree.nearest(&moved, nearest2) {
            (nearest2, nearest) = (found.distance2, Some((*view, moved, found.index)));
        }
        // one that touches is enough
        if nearest2 < touching * touching {
            return Encounter::Touches;
        }
    }
    let Some((view, moved, index)) = nearest else { return Encounter::Alone };
    let place = view.points()[index as usize];
    let mut found = Vec::new();
    view.indexed.tree.k_nearest(&place, normals::NEIGHBOURS, f32::INFINITY, &mut found);
    let normal = nalgebra::Vector3::from(normals::plane_through(view.points(), &found).normal);
    let offset = nalgebra::Vector3::from(moved) - nalgebra::Vector3::from(place);
    let height = normal.dot(&offset).abs();
    if offset.norm_squared() - height * height > ((TUNING.beside * spacing) as f32).powi(2) {
        Encounter::Alone
    } else if height < touching {
        Encounter::Touches
    } else {
        Encounter::Misses
    }
}
