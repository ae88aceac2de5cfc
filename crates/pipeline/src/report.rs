//! The whole `result` part of a model's report: the registration's, with what the pipeline knows of the scans.

use std::collections::BTreeMap;

use serde::Serialize;

use super::orient::NormalsFrom;
pub use super::surface_report::{Estimate, LayerReport, LayersReport, SimplifiedReport, SurfaceOutcome};
use visage_formats::Dropped;
use visage_registration::global::placement::Origin;
use visage_registration::method::Method;
use visage_registration::quality::{Quality, Verdict};
use visage_registration::report::{RegistrationReport, ViewReport};

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
                start_from_final: None,
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
            "start_from_final",
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
