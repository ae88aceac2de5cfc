//! The same gallery in files: what searching in mapped files costs more than in memory.

use std::fs::File;
use std::io::BufWriter;

use anyhow::{Context, ensure};

use super::load::Question;
use visage::gallery::{Gallery, SegmentHandle};

/// Writes each segment into a file and uses it from there; the files go with the folder.
pub fn of(gallery: &Gallery) -> anyhow::Result<(Gallery, tempfile::TempDir)> {
    let folder = tempfile::tempdir().context("making a temporary folder")?;
    let mut mapped = Gallery::default();
    let segments: Vec<SegmentHandle> = gallery.segments().collect();
    for (number, segment) in segments.iter().enumerate().rev() {
        let path = folder.path().join(number.to_string());
        let mut file = BufWriter::new(File::create(&path)?);
        let image = segment.encode();
        image.write_to(&mut file)?;
        file.into_inner().map_err(std::io::IntoInnerError::into_error)?.sync_all()?;
        let bytes = visage_mapping::map(&File::open(&path)?)?;
        mapped.attach(SegmentHandle::decode(number as u128, image.checksum(), &bytes)?);
    }
    Ok((mapped, folder))
}

/// Fails at the first answer that differs in anything.
pub fn compare(memory: &Gallery, mapped: &Gallery, questions: &[Question], limit: usize) -> anyhow::Result<()> {
    for question in questions.iter().take(50) {
        let [a, b] = [memory, mapped].map(|gallery| format!("{:?}", question.ask(gallery, limit)));
        ensure!(a == b, "an answer from files differs");
    }
    Ok(())
}
