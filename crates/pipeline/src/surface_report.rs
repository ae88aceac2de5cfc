//! What the report of a model says of its surface.

use serde::Serialize;

use visage_surface::distance::Distances;
use visage_surface::reconstruct::SurfaceReport;
use visage_surface::reconstruct::layers::{Layer, Layers};
use visage_surface::simplify::SimplifyReport;

/// How a mesh came about; lengths in the unit of the scans.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct SurfaceOutcome {
    /// How the surface was made of the cloud.
    #[serde(flatten)]
    pub reconstruction: SurfaceReport,
    /// What was reckoned with before the work began.
    pub estimate: Estimate,
    /// What became of it, if it was to be coarser.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub simplified: Option<SimplifiedReport>,
    /// How the scans lie on each other; absent if they share too little, or it is not known which point is of which.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub layers: Option<LayersReport>,
    /// Why it is to be looked at before it is used: scans that lie apart more than their noise explains.
    pub reasons: Vec<String>,
}

/// How the scans of a surface lie on each other.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct LayersReport {
    /// Standard deviation of the points of one scan from the surface that they are of.
    pub noise: f64,
    /// The distance of neighbours in a scan: what it resolves.
    pub spacing: f64,
    /// The scans that overlap others.
    pub scans: Vec<LayerReport>,
}

/// One scan of a surface among the others.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LayerReport {
    /// Its number among the views.
    pub view: u16,
    /// Its name, if it is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// How far it lies from those that it overlaps, beyond what the noise makes.
    pub distance: f64,
}

impl LayersReport {
    /// What was found, of scans of this spacing.
    pub fn new(layers: Layers, spacing: f64) -> Self {
        let scan = |layer: Layer| LayerReport { view: layer.view, name: None, distance: layer.distance };
        LayersReport { noise: layers.noise, spacing, scans: layers.scans.into_iter().map(scan).collect() }
    }

    /// The scans that lie apart from the others, the farthest first: by more than the noise, and by more than scans resolve or
    /// much more than the others do.
    fn apart(&self) -> Vec<&LayerReport> {
        let is_apart = |(index, scan): &(usize, &LayerReport)| {
            let others = self.scans.iter().enumerate().filter(|(other, _)| other != index);
            let mut others: Vec<f64> = others.map(|(_, other)| other.distance).collect();
            others.sort_by(f64::total_cmp);
            // of two scans both lie apart, and neither is the one
            let usual = if others.len() > 1 { others[others.len() / 2] } else { f64::INFINITY };
            scan.distance > OUTLYING * self.noise && (scan.distance > self.spacing || scan.distance > OUTLYING * usual)
        };
        let mut apart: Vec<&LayerReport> =
            self.scans.iter().enumerate().filter(is_apart).map(|(_, scan)| scan).collect();
        apart.sort_by(|a, b| b.distance.total_cmp(&a.distance));
        apart
    }

    /// What is to be said where scans lie apart.
    fn reason(&self) -> Option<String> {
        let apart = self.apart();
        let worst = apart.first()?;
        let name = worst.name.clone().unwrap_or_else(|| format!("scan {}", worst.view));
        let others = match apart.len() - 1 {
            0 => String::new(),
            1 => ", and another one lies apart, too".into(),
            count => format!(", and {count} others lie apart, too"),
        };
        let (distance, times, noise) = (digits(worst.distance), worst.distance / self.noise, digits(self.noise));
        Some(format!(
            "where scans overlap, {name} lies {distance} from the others, {times:.1} times the noise of one scan \
             ({noise}){others}: the surface runs between the layers; look at its pose, or leave it out"
        ))
    }
}

/// A length in three digits, whatever its unit.
fn digits(length: f64) -> String {
    let size = if length == 0.0 { 0.0 } else { length.abs().log10().floor() };
    format!("{length:.0$}", (2.0 - size).clamp(0.0, 12.0) as usize)
}

impl SurfaceOutcome {
    /// Names the scans by their views, and says what is to be said of them.
    pub(super) fn name(&mut self, names: &[String]) {
        let Some(layers) = &mut self.layers else { return };
        for scan in &mut layers.scans {
            scan.name = names.get(usize::from(scan.view)).cloned();
        }
        self.reasons = layers.reason().into_iter().collect();
    }
}

/// What is so many times larger than usual is not of the same kind: two standard deviations.
const OUTLYING: f64 = 2.0;

/// What work was reckoned to take before it began, by the points that it begins with.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Estimate {
    /// Memory at the peak, bytes.
    pub memory_bytes: u64,
    /// Seconds of a processor.
    pub cpu_seconds: f64,
}

/// Bytes that a surface takes for each point of its cloud, beside the cloud: grid, mesh, and the queue that makes it coarser.
const SURFACE_BYTES_PER_POINT: u64 = 300;
/// Seconds of a processor for a million points.
const SURFACE_SECONDS_PER_MILLION: f64 = 5.0;

impl Estimate {
    /// What the surface of so many points takes.
    pub fn of_surface(points: usize) -> Estimate {
        let seconds = SURFACE_SECONDS_PER_MILLION * points as f64 / 1e6;
        let memory_bytes = SURFACE_BYTES_PER_POINT.saturating_mul(points as u64);
        Estimate { memory_bytes, cpu_seconds: (seconds * 100.0).round() / 100.0 }
    }
}

/// A mesh that was made coarser.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SimplifiedReport {
    /// What became of it, and how far it is from what it was.
    #[serde(flatten)]
    pub of_surface: SimplifyReport,
    /// The same distances in spacings of a scan.
    pub error_spacings: Distances,
}

impl SimplifiedReport {
    /// The report of a mesh from scans of this spacing.
    pub fn new(of_surface: SimplifyReport, spacing: f64) -> Self {
        SimplifiedReport { of_surface, error_spacings: of_surface.error.in_units_of(spacing) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scan_that_lies_apart_is_named_and_what_all_scans_do_is_not() {
        let outcome = |noise: f64, distances: &[f64]| {
            let layer = |(view, distance): (usize, &f64)| Layer { view: view as u16, distance: *distance };
            let layers = Layers { noise, scans: distances.iter().enumerate().map(layer).collect() };
            let layers = Some(LayersReport::new(layers, 1.0));
            let mut outcome = SurfaceOutcome { layers, ..SurfaceOutcome::default() };
            outcome.name(&["a.ply", "b.ply", "c.ply", "d.ply"].map(str::to_owned));
            outcome.reasons
        };
        let reasons = outcome(0.1, &[0.05, 0.06, 0.5, 0.04]);
        assert_eq!(reasons.len(), 1);
        assert!(
            reasons[0].starts_with("where scans overlap, c.ply lies 0.500 from the others, 5.0 times"),
            "{reasons:?}"
        );
        // bent scans lie on each other as well as they can
        assert!(outcome(0.1, &[0.3, 0.25, 0.4, 0.3]).is_empty());
        assert!(outcome(0.5, &[0.05, 0.06, 0.9, 0.04]).is_empty(), "it may be noise");
        assert!(outcome(0.1, &[0.5, 0.5]).is_empty());
        let reasons = outcome(0.1, &[1.2, 1.2]);
        assert!(reasons[0].contains(", and another one lies apart, too"), "{reasons:?}");
    }
}
