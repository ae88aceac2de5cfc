//! Scan sets as they go over the wire.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::base::link;
use super::names;
use super::problem::Problem;
use super::reading_view::ReadingView;
use super::schemas::{self, ScanName, ShortText};
use visage_domain::{NewScanSet, PassedOver, PoseFile, ScanRecord, ScanSetId, ScanSetRecord};
use visage_geometry::Unit;
use visage_service::jobs::admission::{self, PoseFit};

/// A unit of length.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[schema(as = Unit)]
#[serde(rename_all = "snake_case")]
pub enum UnitView {
    /// Millimetres.
    Mm,
    /// Centimetres.
    Cm,
    /// Metres.
    M,
    /// Inches.
    In,
    /// Not known.
    #[default]
    Unknown,
}

impl From<Unit> for UnitView {
    fn from(unit: Unit) -> Self {
        match unit {
            Unit::Mm => UnitView::Mm,
            Unit::Cm => UnitView::Cm,
            Unit::M => UnitView::M,
            Unit::In => UnitView::In,
            Unit::Unknown => UnitView::Unknown,
        }
    }
}

impl From<UnitView> for Unit {
    fn from(unit: UnitView) -> Self {
        match unit {
            UnitView::Mm => Unit::Mm,
            UnitView::Cm => Unit::Cm,
            UnitView::M => Unit::M,
            UnitView::In => Unit::In,
            UnitView::Unknown => Unit::Unknown,
        }
    }
}

/// A scan set that is stored empty, to be filled scan by scan.
#[derive(Debug, Clone, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct NewScanSetBody {
    /// A name for people.
    #[schema(value_type = Option<ShortText>)]
    pub name: Option<String>,
    /// The unit of all its scans.
    #[serde(default)]
    pub unit: UnitView,
}

impl NewScanSetBody {
    /// The scan set to be stored.
    pub fn new_set(self) -> Result<NewScanSet, Problem> {
        let id = ScanSetId::new();
        let name = self.name.map(|name| names::text("name", &name)).transpose()?;
        let name = name.unwrap_or_else(|| format!("scan set {id}"));
        Ok(NewScanSet { id, name, unit: self.unit.into(), scans: Vec::new(), poses: None, passed_over: Vec::new() })
    }
}

/// The form by which a scan set is stored in one call.
#[derive(Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[expect(dead_code, reason = "only describes the form")]
pub struct ScanSetForm {
    #[schema(required = false, schema_with = schemas::scans)]
    scans: Vec<Vec<u8>>,
    /// The initial poses: a pose file of any kind.
    #[schema(required = false, value_type = String, format = Binary)]
    poses: Vec<u8>,
    /// A name for people.
    #[schema(required = false, value_type = ShortText)]
    name: String,
    /// The unit of all scans; not known if not given.
    #[schema(required = false)]
    unit: UnitView,
}

/// One scan.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct ScanView {
    /// Its file name.
    #[schema(value_type = ScanName)]
    pub name: String,
    /// Its points.
    #[schema(example = 40256)]
    pub points: u64,
    /// The size of the file.
    #[schema(example = 2_018_433)]
    pub bytes: u64,
    /// BLAKE3 of the file, hexadecimal.
    pub checksum: String,
    /// What of the file was not taken; null if all of it was.
    pub reading: Option<ReadingView>,
}

impl ScanView {
    /// A stored scan.
    pub fn of(scan: &ScanRecord) -> Self {
        ScanView {
            name: scan.name.clone(),
            points: scan.points,
            bytes: scan.bytes,
            checksum: scan.checksum.clone(),
            reading: scan.reading.as_deref().and_then(ReadingView::of_stored),
        }
    }
}

/// The initial poses of a scan set, held against its scans.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct PosesView {
    /// The name of the pose file.
    pub file: String,
    /// How many poses it holds.
    pub count: usize,
    /// Names in it for which there is no scan: ignored.
    pub unknown_scans: Vec<String>,
    /// Scans that it does not name: they are placed by their surface.
    pub scans_without_pose: Vec<String>,
    /// What was done to make the file fit: rounded rotations, names that are nearly those of scans.
    pub notes: Vec<String>,
}

impl PosesView {
    /// A stored pose file, held against the scans. It was read before it was stored, but scans may have come and gone
    /// since, so that it does not fit any more.
    fn held(scans: &[&str], file: &PoseFile) -> Self {
        match admission::fit_poses(scans, file) {
            Ok(fit) => PosesView::of(&file.name, &fit),
            Err(error) => PosesView {
                file: file.name.clone(),
                count: 0,
                unknown_scans: Vec::new(),
                scans_without_pose: scans.iter().map(|name| (*name).to_owned()).collect(),
                notes: vec![error.to_string()],
            },
        }
    }

    /// A pose file that fits like this.
    pub fn of(file: &str, fit: &PoseFit) -> Self {
        PosesView {
            file: file.to_owned(),
            count: fit.poses.len() + fit.unknown_scans.len(),
            unknown_scans: fit.unknown_scans.clone(),
            scans_without_pose: fit.scans_without_pose.clone(),
            notes: fit.notes.clone(),
        }
    }
}

/// A file that came in an archive and was not kept.
#[derive(Debug, Clone, Serialize, ToSchema)]
#[schema(as = PassedOver)]
pub struct PassedOverView {
    /// Which one.
    #[schema(example = "readme.md in set.zip")]
    pub file: String,
    /// Why: "it ...".
    #[schema(example = "is no scan, and no file of poses that is used")]
    pub why: String,
}

impl PassedOverView {
    fn of(passed: &PassedOver) -> Self {
        PassedOverView { file: passed.file.clone(), why: passed.why.clone() }
    }
}

/// A scan set.
#[derive(Debug, Clone, Serialize, ToSchema)]
#[schema(as = ScanSet)]
pub struct ScanSetView {
    /// Its id.
    #[schema(format = "uuid")]
    pub id: String,
    /// A name for people.
    pub name: String,
    /// The unit of all its scans.
    pub unit: UnitView,
    /// Its scans in natural order of the names. Views are in the order of the pose file.
    pub scans: Vec<ScanView>,
    /// Its initial poses; null if there are none.
    pub poses: Option<PosesView>,
    /// Files that came in archives and were not kept.
    pub passed_over: Vec<PassedOverView>,
    /// When it was created.
    #[schema(format = DateTime)]
    pub created_at: String,
    /// Where to go from here.
    pub links: ScanSetLinks,
}

/// Addresses of a scan set.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct ScanSetLinks {
    /// The scan set itself.
    #[serde(rename = "self")]
    pub self_: String,
    /// Where its poses are put.
    pub poses: String,
    /// Its jobs.
    pub jobs: String,
}

impl ScanSetLinks {
    fn of(id: ScanSetId) -> Self {
        let self_ = address(id);
        ScanSetLinks { poses: format!("{self_}/poses"), jobs: link(&format!("/v1/jobs?scan_set_id={id}")), self_ }
    }
}

/// The address of a scan set.
pub fn address(id: ScanSetId) -> String {
    link(&format!("/v1/scan-sets/{id}"))
}

impl ScanSetView {
    /// A stored scan set.
    pub fn of(set: &ScanSetRecord) -> Self {
        Self::new(set.id, &set.name, set.unit, &set.scans, set.poses.as_ref(), &set.passed_over)
    }

    /// A scan set that is about to be stored.
    pub fn of_new(set: &NewScanSet) -> Self {
        Self::new(set.id, &set.name, set.unit, &set.scans, set.poses.as_ref(), &set.passed_over)
    }

    fn new(
        id: ScanSetId,
        name: &str,
        unit: Unit,
        scans: &[ScanRecord],
        poses: Option<&PoseFile>,
        passed_over: &[PassedOver],
    ) -> Self {
        let names: Vec<&str> = scans.iter().map(|scan| scan.name.as_str()).collect();
        ScanSetView {
            id: id.to_string(),
            name: name.to_owned(),
            unit: unit.into(),
            scans: scans.iter().map(ScanView::of).collect(),
            poses: poses.map(|file| PosesView::held(&names, file)),
            passed_over: passed_over.iter().map(PassedOverView::of).collect(),
            created_at: id.created_at().to_string(),
            links: ScanSetLinks::of(id),
        }
    }
}

/// A page of scan sets.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct ScanSetList {
    /// Newest first.
    pub items: Vec<ScanSetView>,
    /// What to send as `cursor` for the next page; null on the last one.
    pub next_cursor: Option<String>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_named_as_in_the_geometry() {
        for unit in [Unit::Mm, Unit::Cm, Unit::M, Unit::In, Unit::Unknown] {
            let view = UnitView::from(unit);
            assert_eq!(Unit::from(view), unit);
            assert_eq!(serde_json::to_value(view).expect("plain data"), unit.name());
        }
    }
}
