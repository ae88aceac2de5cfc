//! Scans that are the same scan again: the same points under another name, in another format, order or frame.
//!
//! A copy fits its original perfectly wherever that lies, so it would bear out anything. Two scans of one object never
//! have the same points: rays don't meet the same places twice, and noise differs.

use rayon::prelude::*;

use crate::pairwise::rigid_fit::RigidFit;
use crate::view::View;
use visage_geometry::neighbours::LocalPoint;
use visage_geometry::progress::{Canceled, Progress};
use visage_geometry::{Motion, Vector3};

/// A view that has the points of another one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Copy {
    /// The other view; never a copy itself.
    pub of: usize,
    /// Maps the copy's scan frame into that of the other.
    pub motion_of_copy: Motion,
}

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Numbers of points of copies differ by less than this share,
        counts: f64 = 0.01,
        /// and radii and principal moments by less than this: formats round.
        lengths: f64 = 1e-3,
        /// Points at which two views are compared.
        samples: usize = 200,
        /// Points are the same within this share of a spacing,
        same: f64 = 0.02,
        /// for at least this share of them.
        share: f64 = 0.98,
        /// Before the frames are fitted to each other points have to lie within this share of a spacing.
        nearly: f64 = 0.5,
        /// Fits of the frames.
        fits: usize = 3,
    }
}

/// For each view of which other it is a copy. Of several alike the one for which `is_preferred` holds is the original,
/// else the first.
pub fn copies(
    views: &[View],
    is_preferred: impl Fn(usize) -> bool,
    progress: &Progress,
) -> Result<Vec<Option<Copy>>, Canceled> {
    let mut order: Vec<usize> = (0..views.len()).collect();
    order.sort_by_key(|view| !is_preferred(*view));
    let may_be = |i: usize, j: usize| {
        let (a, b) = (&views[i], &views[j]);
        let [count_a, count_b] = [a, b].map(|view| view.points().len() as f64);
        (count_a - count_b).abs() <= TUNING.counts * count_a && (a.radius - b.radius).abs() <= TUNING.lengths * a.radius
    };
    let pairs = (0..order.len()).flat_map(|later| (0..later).map(move |earlier| (earlier, later)));
    let suspects: Vec<(usize, usize)> =
        pairs.map(|(earlier, later)| (order[earlier], order[later])).filter(|(i, j)| may_be(*i, *j)).collect();
    let found: Vec<Option<Motion>> = suspects
        .par_iter()
        .map(|&(i, j)| {
            progress.check()?;
            Ok(motion_if_same(&views[i], &views[j]))
        })
        .collect::<Result<_, Canceled>>()?;
    let mut copies: Vec<Option<Copy>> = vec![None; views.len()];
    for ((i, j), motion_of_copy) in suspects.into_iter().zip(found) {
        if let Some(motion_of_copy) = motion_of_copy.filter(|_| copies[i].is_none() && copies[j].is_none()) {
            copies[j] = Some(Copy { of: i, motion_of_copy });
        }
    }
    Ok(copies)
}

/// Pairs of views (all, part) of which the first has all points of the second in the same frame, and more of its own: a
/// merged cloud among its own scans, or an excerpt. They bear each other out wherever they lie.
pub fn holders(views: &[View], progress: &Progress) -> Result<Vec<(usize, usize)>, Canceled> {
    let pairs: Vec<(usize, usize)> = (0..views.len())
        .flat_map(|all| (0..views.len()).map(move |part| (all, part)))
        .filter(|(all, part)| {
            let [count_all, count_part] = [*all, *part].map(|view| views[view].points().len() as f64);
            all != part && count_all > (1.0 + TUNING.counts) * count_part
        })
        .collect();
    let is_held = |&(all, part): &(usize, usize)| {
        progress.check()?;
        let (all, part) = (&views[all], &views[part]);
        let motion = same_frame(all, part);
        let samples = samples_of(part);
        let most_missing = samples.len() - (TUNING.share * samples.len() as f64).ceil() as usize;
        let missing = |sample: &&LocalPoint| nearest(all, &motion, sample, TUNING.same * part.spacing).is_none();
        Ok(samples.iter().filter(missing).take(most_missing + 1).count() <= most_missing)
    };
    let held: Vec<bool> = pairs.par_iter().map(is_held).collect::<Result<_, Canceled>>()?;
    Ok(pairs.into_iter().zip(held).filter(|(_, held)| *held).map(|(pair, _)| pair).collect())
}

/// The motion between the local frames of two views whose scans have one frame.
fn same_frame(a: &View, b: &View) -> Motion {
    Motion::from_parts((b.center - a.center).into(), nalgebra::UnitQuaternion::identity())
}

/// The motion that maps the scan frame of `b` into that of `a`, if both have the same points.
fn motion_if_same(a: &View, b: &View) -> Option<Motion> {
    let (moments_a, moments_b) = (Moments::of(a), Moments::of(b));
    let differ = (moments_a.values - moments_b.values).abs().max();
    if differ > TUNING.lengths * moments_a.values.max() {
        return None;
    }
    // nothing but the name was changed, or the format: the frame is the same
    let same_frame = same_frame(a, b);
    let turned =
        [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)].map(|(x, y)| moments_b.turned_onto(&moments_a, x, y));
    let a_from_b = std::iter::once(same_frame).chain(turned).find_map(|start| fitted(a, b, start))?;
    let local = |view: &View| nalgebra::Translation3::from(view.center);
    Some(local(a) * a_from_b * local(b).inverse())
}

/// The motion between the local frames, fitted to the points that are the same, if nearly all are.
fn fitted(a: &View, b: &View, start: Motion) -> Option<Motion> {
    let mut a_from_b = start;
    let samples = samples_of(b);
    for _ in 0..TUNING.fits {
        let mut fit = RigidFit::default();
        let mut near = 0;
        for sample in &samples {
            if let Some(nearest) = nearest(a, &a_from_b, sample, TUNING.nearly * a.spacing) {
                fit.add(sample, &nearest);
                near += 1;
            }
        }
        if (near as f64) < TUNING.share * samples.len() as f64 {
            return None;
        }
        a_from_b = fit.solve()?;
    }
    let b_from_a = a_from_b.inverse();
    let same_share = |from: &[LocalPoint], to: &View, motion: &Motion| {
        let same = from.iter().filter(|sample| nearest(to, motion, sample, TUNING.same * a.spacing).is_some()).count();
        same as f64 / from.len() as f64
    };
    let is_same =
        same_share(&samples, a, &a_from_b) >= TUNING.share && same_share(&samples_of(a), b, &b_from_a) >= TUNING.share;
    is_same.then_some(a_from_b)
}

fn samples_of(view: &View) -> Vec<LocalPoint> {
    let points = view.points();
    points.iter().step_by(points.len().div_ceil(TUNING.samples).max(1)).copied().collect()
}

/// The point of `view` nearest to a moved sample, within `reach`.
fn nearest(view: &View, motion: &Motion, sample: &LocalPoint, reach: f64) -> Option<LocalPoint> {
    let moved = motion * nalgebra::Point3::from(*sample).cast::<f64>();
    let found = view.indexed.tree.nearest(&moved.coords.cast::<f32>().into(), (reach * reach) as f32)?;
    Some(view.points()[found.index as usize])
}

/// How a view's points spread about their mean.
struct Moments {
    /// Descending.
    values: Vector3,
    mean: Vector3,
    axes: nalgebra::Matrix3<f64>,
}

impl Moments {
    fn of(view: &View) -> Self {
        let points = || view.points().iter().map(|p| nalgebra::Vector3::from(*p).cast::<f64>());
        let count = view.points().len() as f64;
        let mean: Vector3 = points().sum::<Vector3>() / count;
        let scatter: nalgebra::Matrix3<f64> = points().map(|p| (p - mean) * (p - mean).transpose()).sum();
        let eigen = (scatter / count).symmetric_eigen();
        let mut order = [0, 1, 2];
        order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
        let axis = |k: usize| eigen.eigenvectors.column(order[k]).into_owned();
        let axes = nalgebra::Matrix3::from_columns(&[axis(0), axis(1), axis(2)]);
        Moments { values: Vector3::from(order.map(|k| eigen.eigenvalues[k])), mean, axes }
    }

    /// The motion that lays the axes on those of the other one, the first two in these directions.
    fn turned_onto(&self, other: &Moments, x: f64, y: f64) -> Motion {
        let handed = |axes: &nalgebra::Matrix3<f64>| axes.determinant().signum();
        let signs = Vector3::new(x, y, x * y * handed(&self.axes) * handed(&other.axes));
        let rotation = other.axes * nalgebra::Matrix3::from_diagonal(&signs) * self.axes.transpose();
        let rotation = visage_geometry::se3::nearest_rotation(&rotation);
        Motion::from_parts((other.mean - rotation * self.mean).into(), rotation)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_geometry::{Cloud, Point3};

    /// A bent sheet, its points a little off their grid; another `seed` is another scan of it.
    fn sheet(seed: u32) -> Vec<Point3> {
        let off = |k: u32| f64::from((k + seed).wrapping_mul(2_654_435_761) >> 8) / f64::from(1 << 24) - 0.5;
        let place = |k: u32| (f64::from(k % 50) + 0.3 * off(2 * k), 0.7 * f64::from(k / 50) + 0.3 * off(2 * k + 1));
        (0..2000)
            .map(place)
            .map(|(x, y)| Point3::new(x, y, 0.02 * x * x - 0.01 * x * y + 4.0 * (0.2 * y).sin()))
            .collect()
    }

    fn view(points: Vec<Point3>) -> View {
        View::new(&Cloud::from_points(points)).expect("a sound scan")
    }

    fn found(views: &[View]) -> Vec<Option<Copy>> {
        copies(views, |_| false, &Progress::silent()).expect("not canceled")
    }

    /// What may be done to a scan without making it another one.
    fn again(points: &[Point3], motion: &Motion, order: usize, decimals: i32) -> Vec<Point3> {
        let unit = 10f64.powi(decimals);
        let count = points.len();
        (0..count).map(|k| motion * points[k * order % count]).map(|p| p.map(|x| (x * unit).round() / unit)).collect()
    }

    #[test]
    fn a_copy_is_found_in_any_frame_order_and_rounding() {
        let points = sheet(1);
        let turned = Motion::new(Vector3::new(300.0, -20.0, 5.0), Vector3::new(0.4, -2.0, 1.1));
        for motion in [Motion::identity(), Motion::translation(1.0, 2.0, 3.0), turned] {
            for (order, decimals) in [(1, 12), (1, 3), (1999, 5), (777, 3)] {
                let views = [view(points.clone()), view(sheet(2)), view(again(&points, &motion, order, decimals))];
                let copies = found(&views);
                let copy = copies[2].unwrap_or_else(|| panic!("{motion} {order} {decimals}"));
                assert_eq!((copies[0], copies[1], copy.of), (None, None, 0));
                let off = points.iter().map(|p| (copy.motion_of_copy * (motion * p) - p).norm()).fold(0.0, f64::max);
                assert!(off < 2e-3, "{off}");
            }
        }
    }

    #[test]
    fn another_scan_of_the_same_surface_is_no_copy() {
        let turned = Motion::new(Vector3::zeros(), Vector3::new(0.4, -2.0, 1.1));
        let views = [view(sheet(1)), view(sheet(2)), view(again(&sheet(3), &turned, 1, 12))];
        assert_eq!(found(&views), [None; 3]);
    }

    #[test]
    fn a_merged_cloud_holds_its_scans() {
        let other: Vec<Point3> = sheet(2).iter().map(|p| p + Vector3::new(25.0, 0.0, 0.0)).collect();
        let merged = [sheet(1), other.clone()].concat();
        let views = [view(sheet(1)), view(merged), view(other), view(sheet(3))];
        assert_eq!(holders(&views, &Progress::silent()).expect("not canceled"), [(1, 0), (1, 2)]);
    }

    #[test]
    fn of_several_alike_one_is_the_original() {
        let views = [view(sheet(1)), view(sheet(1)), view(sheet(1))];
        let of = |copies: Vec<Option<Copy>>| copies.iter().map(|copy| copy.map(|copy| copy.of)).collect::<Vec<_>>();
        assert_eq!(of(found(&views)), [None, Some(0), Some(0)]);
        let preferred = copies(&views, |view| view == 1, &Progress::silent()).expect("not canceled");
        assert_eq!(of(preferred), [Some(1), None, Some(1)]);
    }
}
