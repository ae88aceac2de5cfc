//! Models: what they are made of, and their files.

use super::asset::{Asset, Kind, Origin};
use super::{JobId, ModelId, ScanSetId, StoredSignature};
use visage_geometry::Unit;
use visage_shape::faces::SignatureSummary;

/// One file of a model.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AssetRecord {
    /// Its name in the API and on disk; one of ours, never a user's.
    pub name: String,
    /// Its size.
    pub bytes: u64,
    /// BLAKE3 of its content, hexadecimal.
    pub checksum: String,
}

/// A model that is to be stored.
#[derive(Debug, Clone)]
pub struct NewModel {
    /// Its id.
    pub id: ModelId,
    /// The job it comes from, and the scan set if there is one; `None` for an uploaded one.
    pub origin: Option<(JobId, Option<ScanSetId>)>,
    /// A name for people.
    pub name: String,
    /// Its class, if it has one.
    pub label: Option<String>,
    /// The unit of its coordinates.
    pub unit: Unit,
    /// Its points.
    pub points: u64,
    /// The verdict on its registration.
    pub quality: Option<String>,
    /// Its files.
    pub assets: Vec<AssetRecord>,
    /// What of an uploaded file was not taken (JSON); `None` if all of it was.
    pub reading: Option<String>,
    /// Its signature.
    pub signature: Option<StoredSignature>,
}

/// A stored model.
#[derive(Debug, Clone)]
pub struct ModelRecord {
    /// Its id.
    pub id: ModelId,
    /// The job it comes from; `None` for an uploaded one.
    pub job_id: Option<JobId>,
    /// The scan set it comes from; `None` for an uploaded one.
    pub scan_set_id: Option<ScanSetId>,
    /// A name for people.
    pub name: String,
    /// Its class, if it has one.
    pub label: Option<String>,
    /// The unit of its coordinates.
    pub unit: Unit,
    /// Its points.
    pub points: u64,
    /// The verdict on its registration.
    pub quality: Option<String>,
    /// What of an uploaded file was not taken (JSON); `None` if all of it was.
    pub reading: Option<String>,
    /// What the API shows of its signature.
    pub signature: Option<SignatureSummary>,
}

impl ModelRecord {
    /// Where it comes from.
    pub fn origin(&self) -> Origin {
        if self.job_id.is_some() { Origin::Registered } else { Origin::Uploaded }
    }

    /// Of its files the one of this kind that shows all of it: coarse copies are for pages alone.
    pub fn whole<'a>(&self, files: &'a [AssetRecord], kind: Kind) -> Option<&'a AssetRecord> {
        let is_whole = |asset: &Asset| asset.role().kind == kind && !asset.is_coarse_copy();
        let names = Asset::of(self.origin()).into_iter().filter(is_whole).map(Asset::name);
        names.into_iter().find_map(|name| files.iter().find(|file| file.name == name))
    }
}

/// Which models a list shows.
#[derive(Debug, Clone, Default)]
pub struct ModelFilter {
    /// Only those of this class.
    pub label: Option<String>,
    /// Only those made from this scan set.
    pub scan_set_id: Option<ScanSetId>,
    /// Only those that have each of these in their name or label, in large letters or small.
    pub words: Vec<String>,
}

/// What filters ask of a model.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ModelFacets {
    /// Its class, if it has one.
    pub label: Option<String>,
    /// The unit of its coordinates.
    pub unit: Unit,
    /// Where it comes from.
    pub origin: Origin,
}

/// A model as an answer shows it.
#[derive(Debug, Clone, PartialEq)]
pub struct MatchedModel {
    /// Its id.
    pub id: ModelId,
    /// Its name.
    pub name: String,
    /// What filters ask of it.
    pub facets: ModelFacets,
    /// Its signature's bytes, if it has one that is whole.
    pub signature: Option<Vec<u8>>,
}

impl NewModel {
    /// A small model, of the given job or uploaded: for tests of what keeps models.
    #[doc(hidden)]
    pub fn example(origin: Option<(JobId, ScanSetId)>) -> NewModel {
        NewModel {
            id: ModelId::new(),
            origin: origin.map(|(job, set)| (job, Some(set))),
            name: origin.map_or("uploaded", |_| "registered").to_owned(),
            label: Some("face".to_owned()),
            unit: Unit::Mm,
            points: 7,
            quality: None,
            assets: vec![AssetRecord { name: Asset::Report.name().into_owned(), bytes: 2, checksum: "00".to_owned() }],
            reading: None,
            signature: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_coarse_copy_is_never_taken_for_the_surface() {
        let model = ModelRecord {
            id: ModelId::new(),
            job_id: Some(JobId::new()),
            scan_set_id: None,
            name: "head".into(),
            label: None,
            unit: Unit::default(),
            points: 3,
            quality: None,
            reading: None,
            signature: None,
        };
        let file = |asset: &Asset| AssetRecord { name: asset.name().into(), bytes: 1, checksum: String::new() };
        // as a database lists them
        let mut files: Vec<AssetRecord> = Asset::RESULTS.iter().map(file).collect();
        files.sort_by(|a, b| a.name.cmp(&b.name));
        let whole = |files: &[AssetRecord], kind| model.whole(files, kind).map(|file| file.name.clone());
        assert_eq!(whole(&files, Kind::Mesh).as_deref(), Some("mesh.ply"));
        assert_eq!(whole(&files, Kind::Cloud).as_deref(), Some("cloud.ply"));
        files.retain(|file| file.name != "mesh.ply");
        assert_eq!(whole(&files, Kind::Mesh), None);
    }
}
