//! The poses of a model in another format.

use std::sync::Arc;

use tokio::sync::Semaphore;

use super::{Desk, PosesAs, RenditionError, content, model_of, stage};
use crate::app::context::ServiceContext;
use crate::storage::StagedFile;
use visage_domain::asset::Asset;
use visage_domain::{AssetRecord, ModelId};
use visage_formats::archive::ZipWriter;
use visage_formats::poses::{self, PoseFile};
use visage_geometry::Motion;

/// The stored file that others are made of.
#[derive(Debug)]
pub struct PosesSource {
    model: ModelId,
    /// The file.
    pub asset: AssetRecord,
}

impl PosesSource {
    /// Finds it.
    pub async fn find(context: &ServiceContext, id: ModelId) -> Result<Self, RenditionError> {
        let (_, assets) = model_of(context, id).await?;
        let asset = assets.into_iter().find(|asset| asset.name == Asset::Poses.name());
        let hint = "only models that were registered from scans have poses";
        let asset = asset.ok_or(RenditionError::Missing { model: id, what: "poses", hint })?;
        Ok(PosesSource { model: id, asset })
    }

    /// Writes it in another format.
    pub async fn write(
        &self,
        context: &ServiceContext,
        permits: &Arc<Semaphore>,
        wanted: PosesAs,
    ) -> Result<StagedFile, RenditionError> {
        let (model, asset) = (self.model, self.asset.clone());
        Desk::new(context, permits)
            .work(0, move |objects| {
                let file = parse(&content(objects, model, &asset)?, &asset.name)?;
                stage(objects, &written(&file, wanted)?)
            })
            .await
    }
}

/// The poses in a stored file.
pub(super) fn parse(content: &[u8], name: &str) -> Result<PoseFile, RenditionError> {
    poses::read_scaled(name, content).map_err(|error| RenditionError::Unreadable { name: name.to_owned(), error })
}

/// The bytes of poses in a format.
fn written(file: &PoseFile, wanted: PosesAs) -> Result<Vec<u8>, RenditionError> {
    let name = match wanted {
        PosesAs::File(format) => format.name,
        PosesAs::Matrices => "text of one matrix",
    };
    if let Some(scan) = file.scales.keys().next() {
        let why = format!("the matrix of {scan} holds a scale, and these formats hold motions alone; fetch the JSON");
        return Err(RenditionError::Unfit { format: name, why });
    }
    let placed = file.poses.iter().map(|(name, pose)| (name.clone(), Some(*pose)));
    let all: Vec<(String, Option<Motion>)> =
        placed.chain(file.unplaced.iter().map(|name| (name.clone(), None))).collect();
    match wanted {
        PosesAs::File(format) => {
            let has_blank = |(name, _): &&(String, Option<Motion>)| name.chars().any(char::is_whitespace);
            if let (true, Some((scan, _))) = (*format == poses::CONF, all.iter().find(has_blank)) {
                let why = format!("the name {scan:?} has a blank");
                return Err(RenditionError::Unfit { format: name, why });
            }
            Ok(format.writers.poses.map(|write| write(&all).into_bytes()).unwrap_or_default())
        }
        PosesAs::Matrices => {
            let mut zip = ZipWriter::new(Vec::new());
            for (name, pose) in &file.poses {
                zip.add(&format!("{name}.txt"), poses::write_matrix(pose).as_bytes())?;
            }
            Ok(zip.finish()?)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_formats::archive::{ArchiveLimits, entries};

    const TWO: &[u8] = b"{\"a b.ply\": [[1,0,0,4],[0,1,0,5],[0,0,1,6],[0,0,0,1]], \"c.ply\": null}";

    #[test]
    fn poses_are_written_in_what_can_hold_them() {
        let file = parse(TWO, "poses.json").expect("sound");
        let text = |wanted| String::from_utf8(written(&file, wanted).expect("fits")).expect("text");
        assert!(text(PosesAs::File(&poses::ALN)).starts_with("1\na b.ply\n#\n1 0 0 4\n"));
        assert!(text(PosesAs::File(&poses::JSON)).contains("null"));
        let refused = written(&file, PosesAs::File(&poses::CONF)).expect_err("a blank").to_string();
        assert_eq!(refused, "Stanford `.conf` can't hold this: the name \"a b.ply\" has a blank");
        let zip = written(&file, PosesAs::Matrices).expect("fits");
        let entries = entries("m.zip", &zip, &ArchiveLimits::default()).expect("sound").entries;
        assert_eq!((entries.len(), entries[0].path.as_str()), (1, "a b.ply.txt"));
        assert!(entries[0].bytes.starts_with(b"1 0 0 4\n"));
        let scaled = parse(b"{\"a.ply\": [[2,0,0,4],[0,2,0,5],[0,0,2,6],[0,0,0,1]]}", "poses.json").expect("scaled");
        assert!(
            written(&scaled, PosesAs::File(&poses::LOG)).expect_err("a scale").to_string().contains("holds a scale")
        );
    }
}
