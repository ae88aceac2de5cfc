//! Models as they go over the wire.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::base::link;
use super::reading_view::ReadingView;
use super::scan_set_views::UnitView;
use super::schemas::{self, ShortText};
use super::verdicts::VerdictView;
use visage_domain::asset::Asset;
use visage_domain::{AssetRecord, ModelId, ModelRecord};
use visage_shape::faces::{LeftOut, SignatureSummary};

/// What a signature holds.
#[derive(Debug, Clone, Serialize, ToSchema)]
#[schema(as = SignatureSummary)]
pub struct SignatureView {
    /// Version of the operator that made it.
    pub version: u32,
    /// Salient regions.
    pub regions: usize,
    /// Facial triangles kept.
    pub triangles: usize,
    /// Points of the model that it was made without.
    pub left_out: LeftOutView,
}

/// Points that a description does without.
#[derive(Debug, Clone, Serialize, ToSchema)]
#[schema(as = LeftOut)]
pub struct LeftOutView {
    /// Points where nothing was seen, such as 0 0 0 or -9999 for all of them.
    pub no_return: usize,
    /// Points that repeat another one, or that no face has.
    pub repeated: usize,
    /// Points far from the rest.
    pub strays: usize,
}

impl From<&SignatureSummary> for SignatureView {
    fn from(summary: &SignatureSummary) -> Self {
        let LeftOut { no_return, repeated, strays } = summary.left_out;
        SignatureView {
            version: summary.version,
            regions: summary.regions,
            triangles: summary.triangles,
            left_out: LeftOutView { no_return, repeated, strays },
        }
    }
}

/// One file of a model.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct AssetView {
    /// Its name.
    #[schema(example = json!(Asset::Cloud.name()))]
    pub name: String,
    /// Its size.
    pub bytes: u64,
    /// BLAKE3 of its content, hexadecimal; also its `ETag`.
    pub checksum: String,
    /// The media type it is sent as.
    #[schema(example = "application/octet-stream")]
    pub media_type: String,
    /// Where to fetch it.
    pub href: String,
}

impl AssetView {
    fn of(model: ModelId, asset: &AssetRecord) -> Self {
        AssetView {
            name: asset.name.clone(),
            bytes: asset.bytes,
            checksum: asset.checksum.clone(),
            media_type: media_type(&asset.name).to_owned(),
            href: format!("{}/{}", address(model), asset.name),
        }
    }
}

/// The media type that a file of a model is sent as; that of any bytes for a file of another version of this program.
pub fn media_type(name: &str) -> &'static str {
    Asset::media_type_of(name).unwrap_or("application/octet-stream")
}

/// The address of a model.
pub fn address(id: ModelId) -> String {
    link(&format!("/v1/models/{id}"))
}

/// A model in a list.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct ModelSummary {
    /// Its id.
    #[schema(format = "uuid")]
    pub id: String,
    /// A name for people.
    pub name: String,
    /// Its class, if it has one.
    pub label: Option<String>,
    /// The unit of its coordinates.
    pub unit: UnitView,
    /// Its points.
    pub points: u64,
    /// The verdict on its registration: `good`, `doubtful` or `failed`; null for an uploaded model.
    pub quality: Option<String>,
    /// Its signature; null if it has none and so is not found by queries.
    pub signature: Option<SignatureView>,
    /// The job that made it; null for an uploaded model.
    #[schema(format = "uuid")]
    pub job_id: Option<String>,
    /// The scans it was made of; null for an uploaded model.
    #[schema(format = "uuid")]
    pub scan_set_id: Option<String>,
    /// When it was stored.
    #[schema(format = DateTime)]
    pub created_at: String,
    /// Its address.
    pub href: String,
}

impl ModelSummary {
    /// A stored model.
    pub fn of(model: &ModelRecord) -> Self {
        ModelSummary {
            id: model.id.to_string(),
            name: model.name.clone(),
            label: model.label.clone(),
            unit: model.unit.into(),
            points: model.points,
            quality: model.quality.clone(),
            signature: model.signature.as_ref().map(Into::into),
            job_id: model.job_id.map(|id| id.to_string()),
            scan_set_id: model.scan_set_id.map(|id| id.to_string()),
            created_at: model.id.created_at().to_string(),
            href: address(model.id),
        }
    }
}

/// A model with its files and its report.
#[derive(Debug, Clone, Serialize, ToSchema)]
#[schema(as = Model)]
pub struct ModelView {
    /// What a list shows of it.
    #[serde(flatten)]
    pub summary: ModelSummary,
    /// Its files.
    pub assets: Vec<AssetView>,
    /// What of an uploaded file was not taken; null if all of it was. Of a registered model, `report` says it scan by scan.
    pub reading: Option<ReadingView>,
    /// The content of `report.json`: `result` (the same for the same scans) and `run` (times, memory, host); null for
    /// an uploaded model.
    #[schema(value_type = Option<Object>)]
    pub report: Option<serde_json::Value>,
    /// What it is by each standard that it is judged against.
    pub verdicts: Vec<VerdictView>,
}

impl ModelView {
    /// A stored model.
    pub fn of(model: &ModelRecord, assets: &[AssetRecord], report: Option<serde_json::Value>) -> Self {
        ModelView {
            summary: ModelSummary::of(model),
            assets: assets.iter().map(|asset| AssetView::of(model.id, asset)).collect(),
            reading: model.reading.as_deref().and_then(ReadingView::of_stored),
            report,
            verdicts: Vec::new(),
        }
    }
}

/// A page of models.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct ModelList {
    /// Newest first.
    pub items: Vec<ModelSummary>,
    /// What to send as `cursor` for the next page; null on the last one.
    pub next_cursor: Option<String>,
}

/// The form by which a finished model is put into the gallery.
#[derive(Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[expect(dead_code, reason = "only describes the form")]
pub struct NewModelForm {
    #[schema(schema_with = schemas::model)]
    model: Vec<u8>,
    /// Its class, such as `face`.
    #[schema(required = false, value_type = ShortText)]
    label: String,
    /// A name for people; the file's name if not given.
    #[schema(required = false, value_type = ShortText)]
    name: String,
    /// The unit of its coordinates; not known if not given.
    #[schema(required = false)]
    unit: UnitView,
}
