//! Free space: where a scanner saw a surface, there was nothing between it and the surface. A view that has surface
//! there lies wrong, or the other one does.

use rayon::prelude::*;

use crate::quality::limits;
use crate::view::View;
use visage_geometry::neighbours::LocalPoint;
use visage_geometry::{Motion, Vector3};

/// What one view's scanner saw, as a picture of depths.
struct DepthMap {
    /// Where the scanner stood, in the view's local frame.
    sensor: Vector3,
    forward: Vector3,
    across: Vector3,
    upward: Vector3,
    /// Pixels per unit of the tangent of the angle to `forward`.
    scale: f64,
    /// Pixels from the picture's middle to its border.
    half: i32,
    /// The least depth along `forward` in each pixel; infinite where nothing was seen.
    depths: Vec<f32>,
}

/// Edge of a pixel at the surface, in spacings: wide enough that a surface leaves no holes.
const PIXEL: f64 = 3.0;
/// Pixels a picture has at most along an edge.
const LARGEST: i32 = 512;
/// Nearer to the scanner than the surface it saw by more than this, in spacings, is in free space.
const DEPTH: f64 = 5.0;

impl DepthMap {
    fn new(view: &View, sensor: Vector3, spacing: f64) -> Option<Self> {
        let distance = sensor.norm();
        let forward = (-sensor).try_normalize(f64::MIN_POSITIVE)?;
        let mut least = Vector3::zeros();
        least[forward.iamin()] = 1.0;
        let across = forward.cross(&least).normalize();
        let upward = forward.cross(&across);
        let scale = distance / (PIXEL * spacing);
        let reach = view.points().iter().map(|p| nalgebra::Vector3::from(*p).norm()).fold(0.0f32, f32::max);
        // the scanner must stand outside of what it saw, or there is no picture
        let tangent = f64::from(reach) / (distance - f64::from(reach));
        if !(tangent > 0.0 && tangent < 5.0) {
            return None;
        }
        let half = (tangent * scale).ceil().min(f64::from(LARGEST)) as i32 + 2;
        if half > LARGEST / 2 {
            return None;
        }
        let mut map = DepthMap { sensor, forward, across, upward, scale, half, depths: Vec::new() };
        map.depths = vec![f32::INFINITY; (2 * half * 2 * half) as usize];
        for point in view.points() {
            if let Some((pixel, depth)) = map.project(&nalgebra::Vector3::from(*point).cast()) {
                let nearest = &mut map.depths[pixel];
                *nearest = nearest.min(depth as f32);
            }
        }
        Some(map)
    }

    /// The pixel of a place, at least one away from the border, and its depth.
    fn project(&self, place: &Vector3) -> Option<(usize, f64)> {
        let ray = place - self.sensor;
        let depth = ray.dot(&self.forward);
        if depth <= 0.0 {
            return None;
        }
        let far = f64::from(4 * LARGEST);
        let at = |axis: &Vector3| (ray.dot(axis) / depth * self.scale).floor().clamp(-far, far) as i32 + self.half;
        let (column, row) = (at(&self.across), at(&self.upward));
        let inside = |x: i32| x >= 1 && x < 2 * self.half - 1;
        (inside(column) && inside(row)).then(|| ((row * 2 * self.half + column) as usize, depth))
    }

    /// Whether a place lies in free space; `None` where the scanner saw no unbroken surface.
    fn is_free(&self, place: &Vector3, tolerance: f64) -> Option<bool> {
        let (pixel, depth) = self.project(place)?;
        let mut nearest = f32::INFINITY;
        for row in -1..=1 {
            for column in -1..=1 {
                let neighbour = self.depths[(pixel as i64 + i64::from(row * 2 * self.half + column)) as usize];
                if neighbour == f32::INFINITY {
                    return None;
                }
                nearest = nearest.min(neighbour);
            }
        }
        Some(depth < f64::from(nearest) - tolerance)
    }
}

/// Sample points of a view, at most.
const SAMPLES: usize = 300;

/// A view with surface where another looked through.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Intrusion {
    /// The view that has the surface.
    pub view: usize,
    /// The view that looked through it.
    pub seen_by: usize,
    /// Of the points that fall where the other saw something, the share in front of that.
    pub share: f64,
    /// How many points fell there.
    pub points: usize,
}

impl Intrusion {
    /// Whether it says something: more than noise at edges, and more than a few points.
    pub fn counts(&self) -> bool {
        self.points >= limits::LOOKED_THROUGH_POINTS && self.share > limits::LOOKED_THROUGH
    }
}

/// All pairs of placed views of which the second's scanner is known, with the share of free space.
///
/// `sensors` are positions in the views' local frames.
pub fn intrusions(
    views: &[View],
    sensors: &[Option<Vector3>],
    local_poses: &[Motion],
    placed: &[bool],
    spacing: f64,
) -> Vec<Intrusion> {
    let look = |j: usize| {
        let map = DepthMap::new(&views[j], sensors[j].filter(|_| placed[j])?, spacing)?;
        let others = (0..views.len()).filter(|&i| i != j && placed[i]);
        Some(
            others
                .map(|i| intrusion(&map, (i, j), &views[i], &local_poses[j].inv_mul(&local_poses[i]), spacing))
                .collect(),
        )
    };
    let found: Vec<Option<Vec<Intrusion>>> = (0..views.len()).into_par_iter().map(look).collect();
    found.into_iter().flatten().flatten().collect()
}

fn intrusion(map: &DepthMap, (i, j): (usize, usize), view: &View, j_from_i: &Motion, spacing: f64) -> Intrusion {
    let points: &[LocalPoint] = view.points();
    let (mut seen, mut free) = (0usize, 0usize);
    for point in points.iter().step_by(points.len().div_ceil(SAMPLES).max(1)) {
        let place = j_from_i * nalgebra::Point3::from(*point).cast::<f64>();
        if let Some(is_free) = map.is_free(&place.coords, DEPTH * spacing) {
            seen += 1;
            free += usize::from(is_free);
        }
    }
    Intrusion { view: i, seen_by: j, share: free as f64 / seen.max(1) as f64, points: seen }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_geometry::{Cloud, Point3};

    fn sheet(z: f64) -> View {
        let points = (0..3600).map(|k| Point3::new(f64::from(k % 60) - 29.5, f64::from(k / 60) - 29.5, z));
        View::new(&Cloud::from_points(points.collect())).expect("a sheet can be used")
    }

    #[test]
    fn a_sheet_before_another_intrudes_and_one_behind_it_does_not() {
        let views = [sheet(0.0), sheet(20.0)];
        let poses: Vec<Motion> = views.iter().map(|view| view.local_pose(&Motion::identity())).collect();
        // the first view's scanner stands above both, the second's is not known
        let sensors = [Some(Vector3::new(0.0, 0.0, 300.0)), None];
        let found = intrusions(&views, &sensors, &poses, &[true; 2], 1.0);
        assert_eq!(found.len(), 1);
        assert_eq!((found[0].view, found[0].seen_by, found[0].share), (1, 0, 1.0));
        let below = [Some(Vector3::new(0.0, 0.0, -300.0)), None];
        let found = intrusions(&views, &below, &poses, &[true; 2], 1.0);
        assert!(found[0].points > 100 && found[0].share == 0.0, "{found:?}");
    }
}
