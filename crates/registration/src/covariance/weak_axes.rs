//! Motions that hardly anything holds: a view of a sphere turns, one of a plane slides, one of a cylinder does both.

use nalgebra::{Matrix6, Vector6};

use crate::covariance::PoseCovariance;
use visage_geometry::se3::Twist;
use visage_geometry::{Point3, Vector3};

/// What kind of motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum AxisKind {
    /// Turning about a line.
    Rotation,
    /// Sliding along a direction.
    Translation,
    /// Turning about a line and sliding along it at once.
    Screw,
}

/// A motion along which a view's pose is hardly known.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct WeakAxis {
    /// What kind of motion.
    pub kind: AxisKind,
    /// Unit vector in the world: of the axis, or of the slide.
    pub direction: [f64; 3],
    /// A point of the axis in the world, in the scans' unit; a slide has none.
    pub point: Option<[f64; 3]>,
    /// Root mean square displacement of the view's surface by one standard deviation, in spacings: a lower bound if
    /// `held` is small.
    pub std_spacings: f64,
    /// Which share of what seems to hold the view along it is relief, and not noise of the normals; 1 = all.
    pub held: f64,
    /// Why it is named, in words.
    pub why: String,
}

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// A motion is weak if less than this share of what holds it is real...
        least_real: f64 = 0.5,
        /// ... or if its standard deviation moves the view's surface by more than this, in spacings.
        largest_std: f64 = 0.5,
        /// Of a motion's displacement, less than this share by turning makes it a slide, less by sliding a turn.
        pure: f64 = 0.25,
    }
}

/// The weak axes of a view, slides first.
pub fn weak_axes(pose: &PoseCovariance, spacing: f64) -> Vec<WeakAxis> {
    let Some(metric) = Metric::new(&pose.extent) else { return Vec::new() };
    let spread = (metric.root * pose.covariance * metric.root).symmetric_eigen();
    let loose = (0..6)
        .filter(|&k| spread.eigenvalues[k] > (TUNING.largest_std * spacing).powi(2))
        .map(|k| spread.eigenvectors.column(k).into_owned());
    let unreal =
        pose.evidence.iter().filter(|(share, _)| *share < TUNING.least_real).map(|(_, twist)| metric.root * twist);
    let basis = orthonormal(loose.chain(unreal));
    let describe = |unit: Vector6<f64>| {
        let variance = unit.dot(&(metric.root * pose.covariance * metric.root * unit));
        let held = real_share(pose, &metric, &unit);
        describe(&(metric.inverse * unit), pose, variance.max(0.0).sqrt() / spacing, held)
    };
    slides_first(basis, &metric).into_iter().map(describe).collect()
}

/// Twists measured by how far they move the view's surface: `root twist` is as long as that.
struct Metric {
    root: Matrix6<f64>,
    inverse: Matrix6<f64>,
}

impl Metric {
    fn new(extent: &Matrix6<f64>) -> Option<Self> {
        let eigen = extent.symmetric_eigen();
        let of = |f: fn(f64) -> f64| {
            eigen.eigenvectors * Matrix6::from_diagonal(&eigen.eigenvalues.map(f)) * eigen.eigenvectors.transpose()
        };
        (eigen.eigenvalues.min() > 0.0).then(|| Metric { root: of(f64::sqrt), inverse: of(|x| 1.0 / x.sqrt()) })
    }

    /// The part of a unit motion's displacement that is turning about the centroid, 0 to 1.
    fn turning(&self, unit: &Vector6<f64>) -> Vector6<f64> {
        let mut twist = self.inverse * unit;
        twist.fixed_rows_mut::<3>(0).fill(0.0);
        self.root * twist
    }
}

fn orthonormal(vectors: impl Iterator<Item = Vector6<f64>>) -> Vec<Vector6<f64>> {
    let mut basis: Vec<Vector6<f64>> = Vec::new();
    for vector in vectors {
        let Some(unit) = vector.try_normalize(f64::MIN_POSITIVE) else { continue };
        let rest = basis.iter().fold(unit, |rest, b| rest - b * b.dot(&rest));
        // what lies almost in the span of the others is the same weakness seen twice
        if rest.norm() > 0.5 {
            basis.push(rest.normalize());
        }
    }
    basis
}

/// Another basis of the same motions, in which what can be a slide is one, by singular values of the turning part.
fn slides_first(basis: Vec<Vector6<f64>>, metric: &Metric) -> Vec<Vector6<f64>> {
    if basis.len() < 2 {
        return basis;
    }
    let span = nalgebra::Matrix6xX::from_columns(&basis);
    let turning: Vec<Vector6<f64>> = basis.iter().map(|unit| metric.turning(unit)).collect();
    let turning = nalgebra::Matrix6xX::from_columns(&turning);
    let eigen = (turning.transpose() * &turning).symmetric_eigen();
    let mut order: Vec<usize> = (0..basis.len()).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
    order.into_iter().map(|k| &span * eigen.eigenvectors.column(k)).collect()
}

/// The real share of the information along a motion: information adds up over the independent twists.
fn real_share(pose: &PoseCovariance, metric: &Metric, unit: &Vector6<f64>) -> f64 {
    let columns: Vec<Vector6<f64>> = pose.evidence.iter().map(|(_, twist)| metric.root * twist).collect();
    let Some(parts) = Matrix6::from_columns(&columns).lu().solve(unit) else { return 0.0 };
    let (mut real, mut all) = (0.0, 0.0);
    for (part, (share, _)) in parts.iter().zip(&pose.evidence) {
        real += part * part * share.clamp(0.0, 1.0);
        all += part * part;
    }
    if all > 0.0 { real / all } else { 0.0 }
}

fn describe(twist: &Twist, pose: &PoseCovariance, std_spacings: f64, held: f64) -> WeakAxis {
    let shift = twist.fixed_rows::<3>(0).into_owned();
    let turn = twist.fixed_rows::<3>(3).into_owned();
    let moved = |t: Vector3, w: Vector3| {
        let twist = Twist::new(t.x, t.y, t.z, w.x, w.y, w.z);
        twist.dot(&(pose.extent * twist)).max(0.0).sqrt()
    };
    let all = moved(shift, turn).max(f64::MIN_POSITIVE);
    let why = if held < TUNING.least_real {
        "what seems to hold it is mostly noise"
    } else {
        "the surface that overlaps has too little relief along it"
    };
    let axis = |kind, direction: Vector3, point: Option<Point3>| WeakAxis {
        kind,
        direction: canonical(direction).into(),
        point: point.map(|p| p.coords.into()),
        std_spacings,
        held,
        why: why.into(),
    };
    if moved(Vector3::zeros(), turn) < TUNING.pure * all {
        return axis(AxisKind::Translation, shift, None);
    }
    let along = turn * (turn.dot(&shift) / turn.norm_squared());
    let point = pose.center + turn.cross(&shift) / turn.norm_squared();
    let kind = if along.norm() < TUNING.pure * all { AxisKind::Rotation } else { AxisKind::Screw };
    axis(kind, turn, Some(point))
}

/// The unit vector along a line whose sign says nothing: its largest component is positive.
fn canonical(direction: Vector3) -> Vector3 {
    let unit = direction.try_normalize(f64::MIN_POSITIVE).unwrap_or_else(Vector3::z);
    unit * unit[unit.iamax()].signum()
}

impl WeakAxis {
    /// The motion in words, to follow "can".
    pub fn in_words(&self) -> String {
        let [x, y, z] = self.direction;
        let line = match self.point {
            Some([px, py, pz]) => format!("({x:.2}, {y:.2}, {z:.2}) through ({px:.4}, {py:.4}, {pz:.4})"),
            None => format!("({x:.2}, {y:.2}, {z:.2})"),
        };
        match self.kind {
            AxisKind::Translation => format!("slide along {line}"),
            AxisKind::Rotation => format!("turn about the axis {line}"),
            AxisKind::Screw => format!("turn and slide along the axis {line}"),
        }
    }
}
