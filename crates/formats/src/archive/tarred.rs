//! Tar archives.

use std::io::Read;

use tar::{Archive, EntryType};

use super::{ArchiveLimits, Collector};
use crate::FormatError;

/// Everything in a tar file stands in blocks of so many bytes.
const BLOCK: u64 = 512;

/// Bytes of a tar file beside those of its files: headers, long names and what fills up blocks.
pub(super) fn overhead(limits: &ArchiveLimits) -> u64 {
    const BLOCKS_OF_ENTRY: u64 = 8;
    limits.max_entries.saturating_mul(BLOCKS_OF_ENTRY * BLOCK)
}

pub(super) fn read<'a>(bytes: &[u8], mut collector: Collector<'a>) -> Result<Collector<'a>, FormatError> {
    let damaged = |error: &dyn std::fmt::Display| {
        let problem = format!("the tar file is damaged or cut short ({error})");
        FormatError::malformed("archive", problem, "pack or upload it again")
    };
    let mut archive = Archive::new(bytes);
    // where the last entry ends
    let mut end = 0;
    for entry in archive.entries().map_err(|error| damaged(&error))? {
        let entry = entry.map_err(|error| damaged(&error))?;
        collector.count()?;
        let size = entry.size();
        let raw = String::from_utf8_lossy(&entry.path_bytes()).into_owned();
        let start = entry.raw_file_position();
        end = start.saturating_add(size.div_ceil(BLOCK).saturating_mul(BLOCK));
        match entry.header().entry_type() {
            // an old tar marks a folder by the end of its name
            EntryType::Regular | EntryType::Continuous if !raw.ends_with('/') => {
                if start.saturating_add(size) > bytes.len() as u64 {
                    return Err(FormatError::Truncated {
                        declared: format!("a file of {size} bytes"),
                        found: format!("the {} bytes of the archive", bytes.len()),
                    });
                }
                if let Some(path) = collector.accept(&raw)? {
                    collector.take(path, size, entry.take(size))?;
                }
            }
            EntryType::Regular | EntryType::Continuous | EntryType::Directory | EntryType::XGlobalHeader => {}
            EntryType::Symlink | EntryType::Link => collector.pass_over(&raw, "is a link"),
            EntryType::GNUSparse => collector.pass_over(&raw, "is a file with holes"),
            _ => collector.pass_over(&raw, "is no file"),
        }
    }
    // a block of zeros ends the list; without it files may be missing
    let is_zero = |block: &[u8]| block.iter().all(|byte| *byte == 0);
    let ending = usize::try_from(end).ok().and_then(|end| bytes.get(end..));
    if !ending.and_then(<[u8]>::first_chunk::<{ BLOCK as usize }>).is_some_and(|block| is_zero(block)) {
        return Err(FormatError::Truncated {
            declared: "a tar file that ends with zeros".into(),
            found: format!("its {} bytes", bytes.len()),
        });
    }
    Ok(collector)
}
