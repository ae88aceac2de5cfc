//! Scales with the poses: for scanners that disagree in unit (the paper's "optimal scaling", left there as future work).
//!
//! A view's points are multiplied by its scale, about the origin of its scan, before its pose moves them: a Sim(3) a
//! view. The first view's scale is 1. Scales start from [`coarse_scales`] and are refined together with the poses, by one
//! more unknown a view in the same equations.

use rayon::prelude::*;

use super::coarse_scale::coarse_scales;
use super::surfels::Surfels;
use super::{PASSES, Pass, Run, TUNING};
use crate::least_squares::normal_equations::SCALED;
use crate::outcome::{MethodOptions, Outcome};
use crate::view::{View, common_spacing};
use visage_geometry::Motion;
use visage_geometry::progress::{Canceled, Progress, Stage};

/// Once more after the last pass: the surfels of a view that has been scaled are not those that its scale was refined
/// with, and scales settle more slowly than poses.
const FINISH: Pass = Pass { settled: 0.01, query_stride: 1, first_distance: PASSES[1].last_distance, ..PASSES[1] };

/// Registers `views` from the poses of their scans (`pose_world`), and scales all but the `fixed` ones. Answers with the
/// views as scaled ([`View::scale`] tells by how much) and their registration.
///
/// `views` carry the scales to start from; `is_known` says which of those are more than a guess.
pub fn joint_scaled(
    mut views: Vec<View>,
    scan_poses: &[Motion],
    is_known: &[bool],
    fixed: &[usize],
    options: &MethodOptions,
    progress: &Progress,
) -> Result<(Vec<View>, Outcome), Canceled> {
    progress.report(Stage::Registering, 0.0);
    let growth = coarse_scales(&views, scan_poses, is_known, fixed, progress)?;
    views = scaled(views, &growth);
    let initial: Vec<Motion> = views.iter().zip(scan_poses).map(|(view, pose)| view.local_pose(pose)).collect();
    let mut state = Outcome::at(&initial);
    let passes = [&PASSES[0], &PASSES[1], &FINISH, &FINISH];
    for (index, pass) in passes.into_iter().enumerate() {
        progress.report(Stage::Registering, (index + 1) as f64 / (passes.len() + 1) as f64);
        let run = Run { options, fixed, spacing: common_spacing(&views), max_steps: TUNING.max_steps, progress };
        let edge = pass.edge(&views, run.spacing);
        let surfels = surfels(&views, edge);
        let growth = run.pass::<SCALED>(&surfels, index, pass, edge, &mut state)?;
        views = scaled(views, &growth);
        if index + 1 == passes.len() {
            let run = Run { spacing: common_spacing(&views), ..run };
            run.measure_pairs(&views, &self::surfels(&views, edge), &mut state)?;
        }
    }
    Ok((views, state))
}

fn surfels(views: &[View], edge: f64) -> Vec<Surfels> {
    views.par_iter().map(|view| Surfels::new(view, edge)).collect()
}

fn scaled(views: Vec<View>, growth: &[f64]) -> Vec<View> {
    views.into_par_iter().zip(growth).map(|(view, factor)| view.scaled(*factor)).collect()
}
