//! Sets that were taken from one place: what stands still is left out, and what moved is registered.

use rayon::prelude::*;

use super::start::{Sensors, Setting};
use super::supports::{Held, Set};
use super::{NamedScan, Options, PipelineError};
use visage_geometry::progress::Progress;
use visage_geometry::{Motion, Vector3};
use visage_registration::global::scan_set::Registered;
use visage_registration::quality::Quality;
use visage_registration::quality::sharpness::is_sharp;
use visage_registration::resolution::resolution;
use visage_registration::sensor::standing_still::{Still, from_one_place};
use visage_registration::sensor::turning::Turning;
use visage_registration::view::View;

/// Scans and how they were registered.
pub(super) struct Taken {
    /// The scans,
    pub scans: Vec<NamedScan>,
    /// their views,
    pub views: Vec<View>,
    /// what is known of their scanners,
    pub sensors: Sensors,
    /// and their registration.
    pub registered: Registered,
}

/// A set as it was registered in the end.
pub(super) struct Settled {
    /// The scans, without what stands still if what moved was followed.
    pub taken: Taken,
    /// The views with their supports, if those were heard.
    pub held: Option<Held>,
    /// For each scan the points that were left out because they stand still.
    pub still: Vec<usize>,
    /// If what stands still holds the scans, and nothing better was found, for each scan the share that moved.
    pub moved: Option<Vec<f64>>,
}

/// Lets supports vote, if there are `whole` views with them, and follows what moved where the scans were taken from one
/// place.
pub(super) fn settle(
    setting: &Setting,
    names: &[String],
    taken: Taken,
    whole: Option<Vec<View>>,
    options: &Options,
    progress: &Progress,
) -> Result<Settled, PipelineError> {
    let Taken { scans, views, sensors, registered } = taken;
    let set = Set { setting, scans: &scans, names, views: &views };
    let (registered, held, before) = match whole {
        Some(whole) => {
            let before = registered.clone();
            let (registered, held) = set.consult(whole, registered, options, progress)?;
            let before = held.is_some().then_some(before);
            (registered, held, before)
        }
        None => (registered, None, None),
    };
    let still = vec![0; scans.len()];
    Ok(match follow_what_moved(&set, &sensors, (&registered, held.as_ref()), before, options, progress)? {
        Stillness::Followed(followed) => {
            Settled { taken: followed.taken, held: None, still: followed.still, moved: None }
        }
        Stillness::Holds(moved) => {
            Settled { taken: Taken { scans, views, sensors, registered }, held, still, moved: Some(moved) }
        }
        Stillness::None => Settled { taken: Taken { scans, views, sensors, registered }, held, still, moved: None },
    })
}

/// What moved before a background, registered by itself.
struct Followed {
    taken: Taken,
    /// For each scan the points that were left out.
    still: Vec<usize>,
}

/// What came of looking for what stands still.
enum Stillness {
    /// Nothing does, as far as can be told.
    None,
    /// A background does, and nothing better was found; for each scan the share that moved.
    Holds(Vec<f64>),
    /// What moved was placed.
    Followed(Box<Followed>),
}

/// A scan moved if this share of it did,
const MOVED: f64 = 0.005;
/// and a set if this share of its placed scans.
const MOVED_SCANS: f64 = 0.5;
/// A view that what moved lays farther off than this, in what the set resolves, was not held by what stands still.
const ELSEWHERE: f64 = 4.0;

/// Looks whether the placed views were taken from one place, and if so follows what moved. `before` is the registration
/// without supports, where these have changed it.
fn follow_what_moved(
    set: &Set,
    sensors: &Sensors,
    (registered, held): (&Registered, Option<&Held>),
    before: Option<Registered>,
    options: &Options,
    progress: &Progress,
) -> Result<Stillness, PipelineError> {
    let (all, at) = held.map_or((set.views, &registered.result), |held| (held.whole.as_slice(), &held.result));
    let shifts: Vec<Vector3> = set.views.iter().zip(all).map(|(view, all)| view.center - all.center).collect();
    let sensors_of_all: Sensors =
        sensors.iter().zip(&shifts).map(|(sensor, shift)| sensor.map(|sensor| sensor.moved(shift))).collect();
    let unit = resolution(all, at);
    let Some(still) = from_one_place(all, &sensors_of_all, at, unit) else { return Ok(Stillness::None) };
    let moved = still.moved(set.views, all, &shifts);
    let share = |moved: &Vec<bool>| moved.iter().filter(|moved| **moved).count() as f64 / moved.len().max(1) as f64;
    let shares: Vec<f64> = moved.iter().map(share).collect();
    let placed: Vec<usize> = (0..set.views.len()).filter(|view| registered.result.placed[*view]).collect();
    let count = placed.iter().filter(|view| shares[**view] >= MOVED).count();
    let has_moved = count as f64 >= MOVED_SCANS * placed.len() as f64 && still.is_compact(set.views, &shifts, &moved);
    if !has_moved {
        let nothing = vec![0.0; shares.len()];
        return Ok(if still.is_known { Stillness::Holds(nothing) } else { Stillness::None });
    }
    if !set.setting.may_be_refined(options) || options.keep_all {
        return Ok(Stillness::Holds(shares));
    }
    let without_support = before.map(|registered| Followed {
        taken: Taken { scans: set.scans.to_vec(), views: set.views.to_vec(), sensors: sensors.clone(), registered },
        still: vec![0; set.views.len()],
    });
    let cut = cut_and_register(set, &registered.result.placed, moved, (&still, all), options, progress)?;
    let is_elsewhere = |followed: &Followed| {
        let Taken { views, registered: Registered { result, .. }, .. } = &followed.taken;
        let shifts =
            views.iter().zip(set.views).map(|(view, all)| nalgebra::Translation3::from(all.center - view.center));
        let poses: Vec<Motion> = result.local_poses.iter().zip(shifts).map(|(pose, shift)| pose * shift).collect();
        is_elsewhere(&poses, &result.placed, registered, set.views, unit)
    };
    let quality = |followed: &Followed| followed.taken.registered.quality(set.names);
    let rank = |followed: &Followed| (quality(followed), std::cmp::Reverse(count_placed(followed)));
    let best = [without_support, cut]
        .into_iter()
        .flatten()
        .filter(|followed| 2 * count_placed(followed) > set.views.len() && is_elsewhere(followed))
        .filter(|followed| quality(followed) != Quality::Failed && lies_sharply(followed))
        .min_by_key(rank);
    Ok(best.map_or(Stillness::Holds(shares), |followed| Stillness::Followed(Box::new(followed))))
}

/// Whether what moved lies on itself: of two answers that are not sure the one that crosses itself is none.
fn lies_sharply(followed: &Followed) -> bool {
    let Registered { result, surfaces, .. } = &followed.taken.registered;
    result.placed.iter().zip(&surfaces.sharpness).all(|(placed, sharpness)| !placed || is_sharp(*sharpness))
}

fn count_placed(followed: &Followed) -> usize {
    followed.taken.registered.result.placed.iter().filter(|placed| **placed).count()
}

/// Whether most views lie elsewhere than `still` has them, against the first that both place.
fn is_elsewhere(poses: &[Motion], placed: &[bool], still: &Registered, views: &[View], unit: f64) -> bool {
    let both: Vec<usize> = (0..views.len()).filter(|view| placed[*view] && still.result.placed[*view]).collect();
    let Some((&first, rest)) = both.split_first() else { return false };
    let differs = |view: &&usize| {
        let apart = poses[first]
            .inv_mul(&poses[**view])
            .inv_mul(&still.result.local_poses[first].inv_mul(&still.result.local_poses[**view]));
        apart.translation.vector.norm() + apart.rotation.angle() * views[**view].radius > ELSEWHERE * unit
    };
    2 * rest.iter().filter(differs).count() > rest.len()
}

/// Registers what moved of each scan; scans without a place keep all they have. `None` if too little of one is left.
fn cut_and_register(
    set: &Set,
    placed: &[bool],
    moved: Vec<Vec<bool>>,
    (background, wholes): (&Still, &[View]),
    options: &Options,
    progress: &Progress,
) -> Result<Option<Followed>, PipelineError> {
    let cut = |((scan, moved), placed): ((&NamedScan, &Vec<bool>), &bool)| {
        if !placed {
            return Some((scan.clone(), View::of(&scan.surface).ok()?, 0));
        }
        let surface = scan.surface.kept(moved);
        let view = View::of(&surface).ok()?;
        let still = moved.iter().filter(|moved| !**moved).count();
        Some((NamedScan { name: scan.name.clone(), surface }, view, still))
    };
    let rest: Option<Vec<(NamedScan, View, usize)>> =
        set.scans.par_iter().zip(&moved).zip(placed).with_max_len(1).map(cut).collect();
    let Some(rest) = rest else { return Ok(None) };
    let (mut scans, mut views, mut still) = (Vec::new(), Vec::new(), Vec::new());
    for (scan, view, count) in rest {
        scans.push(scan);
        views.push(view);
        still.push(count);
    }
    for ((view, scan), whole) in views.iter_mut().zip(&scans).zip(set.views) {
        // where the scanner stood shows in all that it saw
        let sensor = whole.sensor.map(|sensor| sensor.moved(&(whole.center - view.center)));
        view.sensor = super::sensor_of(scan, view, options).or(sensor);
    }
    let turning = Turning::of(background, &views, wholes);
    let (views, sensors, registered) =
        set.setting.cut(turning).register(&scans, views, set.names, options, progress)?;
    Ok(Some(Followed { taken: Taken { scans, views, sensors, registered }, still }))
}
