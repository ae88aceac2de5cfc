//! The whole `result` part of a model's report: the registration's, with what the pipeline knows of the scans.

use std::collections::BTreeMap;

use serde::Serialize;

use super::orient::NormalsFrom;
use visage_formats::Dropped;
use visage_registration::global::placement::Origin;
use visage_registration::method::Method;
use visage_registration::quality::{Quality, Verdict};
use visage_registration::report::{RegistrationReport, ViewReport};
use visage_surface::distance::Distances;
use visage_surface::reconstruct::SurfaceReport;
use visage_surface::reconstruct::layers::{Layer, Layers};
use visage_surface::simplify::SimplifyReport;

/// The `result` part of a report (deterministic: the same scans give the same bytes).
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ModelReport {
    /// The registration's, with a row for each scan.
    #[serde(flatten)]
    pub registration: RegistrationReport<ScanReport>,
    /// How the mesh came about, lengths in the unit of the scans; absent if there is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub surface: Option<SurfaceOutcome>,
    /// Whether a face was found and cut out of cloud and mesh, if that was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub face_cut: Option<bool>,
    /// What became of hints, if any were given of pairs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hints: Option<HintsReport>,
    /// How given poses were read, where their file leaves it open.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pose_convention: Option<PoseConventionReport>,
    /// What was done to make the pose file fit.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub pose_notes: Vec<String>,
    /// How the unit was found, and which scans were converted to it. Their poses hold the scale, so that they map the
    /// scans as they are in the files.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub unit_notes: Vec<String>,
}

impl ModelReport {
    /// As `report.json` holds it: keys in the order of the alphabet.
    pub fn to_json(&self) -> serde_json::Value {
        // it can't fail: all keys are strings
        serde_json::to_value(self).unwrap_or_default()
    }
}

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

/// The `result` part of the report of a model that was given a surface.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ResurfacedReport {
    /// The model whose points it has.
    pub of_model: String,
    /// The unit of lengths.
    pub unit: &'static str,
    /// Where the normals come from.
    pub normals: NormalsFrom,
    /// The distance of neighbours in a scan.
    pub spacing: f64,
    /// How the mesh came about.
    pub surface: SurfaceOutcome,
    /// Whether a face was found and cut out of cloud and mesh, if that was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub face_cut: Option<bool>,
}

impl ResurfacedReport {
    /// As `report.json` holds it: keys in the order of the alphabet.
    pub fn to_json(&self) -> serde_json::Value {
        // it can't fail: all keys are strings
        serde_json::to_value(self).unwrap_or_default()
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

/// How given poses were read.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PoseConventionReport {
    /// The convention that was taken.
    pub read_as: &'static str,
    /// For each that was tried the share of points that lie by other scans.
    pub touching: BTreeMap<&'static str, f64>,
}

/// One scan.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ScanReport {
    /// What the registration says of its view.
    #[serde(flatten)]
    pub view: ViewReport,
    /// Whether its normals are known to be outward; absent if nobody needed the cloud.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub normals_outward: Option<bool>,
    /// The points that were left out of it.
    pub left_out: LeftOutReport,
    /// The scan that it has the points of, if it is a copy.
    pub copy_of: Option<String>,
    /// Whether the place of the scanner in its file is a pose.
    #[serde(skip_serializing_if = "is_false")]
    pub viewpoint_is_pose: bool,
    /// Its scale, where scales are looked for or given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scale: Option<f64>,
    /// Whether its pose was to stay, where scans are added to a model.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fixed: Option<bool>,
    /// What of its file was not taken, if anything.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reading: Option<Dropped>,
}

/// Points that were left out of a scan, and why.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct LeftOutReport {
    /// Nothing was seen there.
    pub no_return: usize,
    /// They repeat others.
    pub repeated: usize,
    /// Hints leave them out.
    #[serde(skip_serializing_if = "is_zero")]
    pub regions: usize,
    /// They stood still while the object moved.
    #[serde(skip_serializing_if = "is_zero")]
    pub still: usize,
    /// What cleaning found; absent if everything was to be kept.
    #[serde(flatten)]
    pub cleaning: Option<CleaningReport>,
}

/// Points that cleaning left out.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct CleaningReport {
    /// Of planes that the object stands on or before.
    pub support: usize,
    /// Far from the rest.
    pub strays: usize,
}

/// What became of hints.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct HintsReport {
    /// Points that were picked in two scans.
    pub points: Vec<PickedReport>,
    /// Scans that were said to overlap.
    pub overlaps: Vec<OverlapReport>,
}

/// Points that were picked in two scans.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PickedReport {
    /// The one scan.
    pub a: String,
    /// The other.
    pub b: String,
    /// How many pairs of points.
    pub pairs: usize,
    /// Whether the scans lie as they say.
    pub followed: bool,
    /// What is left between the points when they alone are laid on each other.
    pub misfit: f64,
    /// What is left at the poses found; null if the two don't hang together.
    pub residual: Option<f64>,
    /// The farthest two of them.
    pub largest: Option<f64>,
}

/// Scans that were said to overlap.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct OverlapReport {
    /// The one scan.
    pub a: String,
    /// The other.
    pub b: String,
    /// Whether they hang together.
    pub together: bool,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde asks so")]
fn is_false(value: &bool) -> bool {
    !value
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde asks so")]
fn is_zero(value: &usize) -> bool {
    *value == 0
}

impl ModelReport {
    /// A report of scans of which nothing is known: for tests of what is done with reports.
    #[doc(hidden)]
    pub fn example(names: &[&str]) -> ModelReport {
        let scan = |name: &&str| ScanReport {
            view: ViewReport {
                name: (*name).to_owned(),
                points: 7,
                spacing: 0.5,
                range_accuracy: 0.25,
                placed: true,
                residual: None,
                residual_spacings: None,
                uncertainty: None,
                pose: Some(Origin::Given),
                confidence: None,
                evidence: None,
                unplaced: None,
                group: None,
            },
            normals_outward: None,
            left_out: LeftOutReport::default(),
            copy_of: None,
            viewpoint_is_pose: false,
            scale: None,
            fixed: None,
            reading: None,
        };
        let registration = RegistrationReport {
            method: Method::default().name(),
            unit: "mm",
            spacing: 0.5,
            verdict: Verdict { quality: Quality::Good, reasons: Vec::new(), sharpness: Vec::new() },
            views: names.iter().map(scan).collect(),
            pairs: Vec::new(),
            overlaps: Vec::new(),
            levels: Method::Icp.levels(),
            rounds: Vec::new(),
            confidence: None,
            alternatives: Vec::new(),
            groups: Vec::new(),
        };
        ModelReport {
            registration,
            surface: None,
            face_cut: None,
            hints: None,
            pose_convention: None,
            pose_notes: Vec::new(),
            unit_notes: Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, json};

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

    fn keys(value: &Value) -> Vec<&str> {
        value.as_object().expect("an object").keys().map(String::as_str).collect()
    }

    /// What other programs read: keys come and go only where it is said.
    #[test]
    fn the_keys_are_those_of_always() {
        let report = ModelReport::example(&["a.ply"]).to_json();
        let whole = [
            "alternatives",
            "confidence",
            "groups",
            "levels",
            "method",
            "overlaps",
            "pairs",
            "rounds",
            "spacing",
            "unit",
            "verdict",
            "views",
        ];
        assert_eq!(keys(&report), whole);
        let of_scan = [
            "confidence",
            "copy_of",
            "evidence",
            "group",
            "left_out",
            "name",
            "placed",
            "points",
            "pose",
            "range_accuracy",
            "residual",
            "residual_spacings",
            "spacing",
            "uncertainty",
            "unplaced",
        ];
        assert_eq!(keys(&report["views"][0]), of_scan);
        assert_eq!(report["views"][0]["pose"], "given");
        assert_eq!(report["views"][0]["left_out"], json!({"no_return": 0, "repeated": 0}));
        assert_eq!(report["verdict"], json!({"quality": "good", "reasons": [], "sharpness": []}));
        assert!(report["levels"][0]["max_iterations"].is_u64());
    }

    #[test]
    fn what_is_said_of_some_scans_alone_has_a_key_there() {
        let mut report = ModelReport::example(&["a.ply", "b.ply"]);
        let scan = &mut report.registration.views[1];
        scan.left_out = LeftOutReport {
            regions: 1,
            still: 2,
            cleaning: Some(CleaningReport { support: 3, strays: 4 }),
            ..LeftOutReport::default()
        };
        scan.normals_outward = Some(true);
        scan.viewpoint_is_pose = true;
        scan.scale = Some(1.5);
        scan.fixed = Some(false);
        scan.copy_of = Some("a.ply".to_owned());
        report.hints = Some(HintsReport {
            points: Vec::new(),
            overlaps: vec![OverlapReport { a: "a.ply".to_owned(), b: "b.ply".to_owned(), together: true }],
        });
        let report = report.to_json();
        let (plain, full) = (keys(&report["views"][0]), &report["views"][1]);
        let more: Vec<&str> = keys(full).into_iter().filter(|key| !plain.contains(key)).collect();
        assert_eq!(more, ["fixed", "normals_outward", "scale", "viewpoint_is_pose"]);
        let left_out = json!({"no_return": 0, "regions": 1, "repeated": 0, "still": 2, "strays": 4, "support": 3});
        assert_eq!(full["left_out"], left_out);
        assert_eq!((&full["copy_of"], &full["scale"]), (&json!("a.ply"), &json!(1.5)));
        let overlaps = json!([{"a": "a.ply", "b": "b.ply", "together": true}]);
        assert_eq!(report["hints"], json!({"points": [], "overlaps": overlaps}));
    }
}
