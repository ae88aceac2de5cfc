//! The merged cloud: every point of every placed view in the world frame, with an outward normal.

use visage_geometry::neighbours::LocalPoint;
use visage_geometry::normals::{self, LocalPlane, local_planes};
use visage_geometry::progress::{Canceled, Progress, Stage};
use visage_geometry::{Cloud, Motion};
use visage_registration::sensor::{Facet, Sensor, middle_in_view, outer_side, viewing_axis};
use visage_registration::view::View;

/// The merged cloud of a model, in the world frame.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelCloud {
    /// Positions, outward unit normals, and colour and intensity if a placed scan carries them.
    pub cloud: Cloud,
    /// For each point the index of the view it came from.
    pub views: Vec<u16>,
}

/// A view with what its scan carried beside positions, and its place.
#[derive(Debug, Clone, Copy)]
pub struct PosedView<'a> {
    /// The prepared scan.
    pub view: &'a View,
    /// The scan it was made from.
    pub scan: &'a Cloud,
    /// Local frame to world.
    pub local_pose: Motion,
    /// Whether it belongs to the model.
    pub placed: bool,
    /// Where the scanner stood (local frame), if that is known.
    pub sensor: Option<Sensor>,
}

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// How clearly a side must be the outer one before the normals are called outward.
        clear: f64 = 0.3,
        /// Facets by which a view's axis is told, and the nearest points by which their density is.
        facets: usize = 400,
        around: usize = 16,
    }
}

/// Merges the placed views, in their order. Also says for each view whether its normals are known to be outward.
pub fn merge(posed: &[PosedView], progress: &Progress) -> Result<(ModelCloud, Vec<bool>), Canceled> {
    let local_poses: Vec<Motion> = posed.iter().map(|p| p.local_pose).collect();
    let placed: Vec<bool> = posed.iter().map(|p| p.placed).collect();
    let points = posed.iter().filter(|p| p.placed).map(|p| p.scan.len()).sum();
    let mut merged = ModelCloud { cloud: Cloud::default(), views: Vec::with_capacity(points) };
    merged.cloud.points.reserve_exact(points);
    let mut all_normals = Vec::with_capacity(points);
    let mut outward = Vec::with_capacity(posed.len());
    for (index, view) in posed.iter().enumerate() {
        progress.check()?;
        progress.report(Stage::Merging, index as f64 / posed.len() as f64);
        if !view.placed {
            outward.push(false);
            continue;
        }
        let (normals, known) = outward_normals(view, &middle_in_view(&local_poses, &placed, index));
        outward.push(known);
        let rotation = view.local_pose.rotation.cast::<f32>();
        all_normals.extend(normals.iter().map(|n| rotation * n));
        let scan_pose = view.view.scan_pose(&view.local_pose);
        merged.cloud.points.extend(view.scan.points.iter().map(|p| scan_pose * (p * view.view.scale)));
        merged.views.extend(std::iter::repeat_n(index as u16, view.scan.len()));
    }
    merged.cloud.normals = Some(all_normals);
    merged.cloud.colors = gather(posed, |scan| scan.colors.as_deref());
    merged.cloud.intensities = gather(posed, |scan| scan.intensities.as_deref());
    Ok((merged, outward))
}

/// Normals of a view in its local frame, and whether they are known to point outward.
fn outward_normals(posed: &PosedView, middle: &visage_geometry::Vector3) -> (Vec<nalgebra::Vector3<f32>>, bool) {
    let view = posed.view;
    let planes = local_planes(&view.indexed, view.points(), normals::NEIGHBOURS);
    let (sensor, known) = match posed.sensor {
        Some(sensor) => (sensor, true),
        None => {
            let samples: Vec<_> = view.points().iter().zip(&planes).map(|(p, plane)| (*p, plane.normal)).collect();
            let (sensor, clarity) = outer_side(viewing_axis(&facets(view, &planes)), &samples, middle);
            (sensor, clarity > TUNING.clear)
        }
    };
    let oriented = view.points().iter().zip(&planes).map(|(point, plane)| {
        let normal = nalgebra::Vector3::from(plane.normal);
        if normal.cast::<f64>().dot(&sensor.direction_from(point)) < 0.0 { -normal } else { normal }
    });
    (oriented.collect(), known)
}

/// Facets of a view with these planes, spread over it.
fn facets(view: &View, planes: &[LocalPlane]) -> Vec<Facet> {
    let mut found = Vec::new();
    let step = planes.len().div_ceil(TUNING.facets).max(1);
    let facet = |(point, plane): (&LocalPoint, &LocalPlane)| {
        view.indexed.tree.k_nearest_unordered(point, TUNING.around, f32::INFINITY, &mut found);
        Facet::within(plane.normal, found.iter().map(|n| n.distance2).fold(0.0, f32::max))
    };
    view.points().iter().zip(planes).step_by(step).map(facet).collect()
}

/// An attribute of all placed scans one after the other, `None` if all of them lack it; points of a scan that lacks it have
/// nothing (black, 0).
fn gather<T: Copy + Default>(posed: &[PosedView], attribute: impl Fn(&Cloud) -> Option<&[T]>) -> Option<Vec<T>> {
    let placed = || posed.iter().filter(|view| view.placed);
    if placed().all(|view| attribute(view.scan).is_none_or(<[T]>::is_empty)) {
        return None;
    }
    let mut all = Vec::with_capacity(placed().map(|view| view.scan.len()).sum());
    for view in placed() {
        match attribute(view.scan) {
            Some(values) => all.extend_from_slice(values),
            None => all.resize(all.len() + view.scan.len(), T::default()),
        }
    }
    Some(all)
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_geometry::{Point3, Vector3};

    /// Both halves of a sphere about the origin, each a scan in a frame of its own.
    fn half(up: f64) -> Cloud {
        let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
        let points = (0..4000).map(|k| {
            let z = 1.0 - (k as f64 + 0.5) / 4000.0;
            let (sine, cosine) = (golden * k as f64).sin_cos();
            let radius = (1.0 - z * z).sqrt();
            Point3::new(radius * cosine, radius * sine, z * up) * 10.0
        });
        Cloud::from_points(points.collect())
    }

    #[test]
    fn normals_of_both_halves_point_outward_and_views_are_told_apart() {
        let shift = Motion::new(Vector3::new(100.0, 0.0, 0.0), Vector3::x());
        let mut scans = [half(1.0), half(-1.0).moved(&shift.inverse())];
        scans[1].colors = Some(vec![[7, 8, 9]; 4000]);
        let views: Vec<View> = scans.iter().map(|scan| View::new(scan).expect("half a sphere can be used")).collect();
        let poses = [Motion::identity(), shift];
        let posed: Vec<PosedView> = (0..2)
            .map(|i| PosedView {
                view: &views[i],
                scan: &scans[i],
                local_pose: views[i].local_pose(&poses[i]),
                placed: true,
                sensor: None,
            })
            .collect();
        let (merged, outward) = merge(&posed, &Progress::silent()).expect("not canceled");
        assert_eq!(outward, [true, true]);
        assert_eq!((merged.cloud.len(), merged.views[0], merged.views[7999]), (8000, 0, 1));
        let colors = merged.cloud.colors.as_ref().expect("one scan has colours");
        assert_eq!((colors.len(), colors[0], colors[7999]), (8000, [0; 3], [7, 8, 9]));
        assert_eq!(merged.cloud.intensities, None);
        let normals = merged.cloud.normals.expect("normals are made");
        let wrong = merged
            .cloud
            .points
            .iter()
            .zip(&normals)
            .filter(|(p, n)| p.coords.normalize().dot(&n.cast::<f64>()) < 0.8)
            .count();
        assert!(wrong < 80, "{wrong} of 8000 normals don't point outward");
        assert!((merged.cloud.points[6000].coords.norm() - 10.0).abs() < 1e-4);
    }
}
