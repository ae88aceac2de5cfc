//! The zip archive of a 3MF file.

use std::io::{Cursor, Read};

use memchr::memmem;
use zip::ZipArchive;

use super::REPAIR;
use crate::{FormatError, ReadLimits};

/// The most files that an archive may list.
const MOST_FILES: usize = 10_000;
/// The signature before each line of the list of files; that of the end of a long list, and where its number stands.
const LISTED: &[u8] = b"PK\x01\x02";
const LARGE_END: &[u8] = b"PK\x06\x06";
const LARGE_COUNT: usize = 32;
/// What the first of all files tells: where the model is.
const RELATIONS: &str = "_rels/.rels";
/// Where it is, where nothing tells.
const MODEL: &str = "3D/3dmodel.model";

/// The parts of a file.
pub(super) struct Package<'a> {
    archive: ZipArchive<Cursor<&'a [u8]>>,
    /// Bytes that may still be unpacked.
    left: u64,
    limit: u64,
}

impl<'a> Package<'a> {
    pub(super) fn new(bytes: &'a [u8], limits: &ReadLimits) -> Result<Self, FormatError> {
        // bounded before anything is made of the list
        let is_long = memmem::find_iter(bytes, LISTED).nth(MOST_FILES).is_some();
        let mut ends =
            memmem::find_iter(bytes, LARGE_END).map(|end| bytes.get(end + LARGE_COUNT..end + LARGE_COUNT + 8));
        let is_longer = ends.any(|count| {
            let count = count.and_then(|count| count.try_into().ok()).map_or(0, u64::from_le_bytes);
            count > MOST_FILES as u64
        });
        if is_long || is_longer {
            let limit = MOST_FILES as u64;
            return Err(FormatError::TooLarge { what: "parts of the file", found: limit + 1, limit });
        }
        let archive = ZipArchive::new(Cursor::new(bytes)).map_err(|error| {
            let problem = format!("it is no whole zip archive, as 3MF files are ({error})");
            FormatError::malformed("the whole file", problem, "export or upload it again")
        })?;
        Ok(Package { archive, left: limits.max_bytes, limit: limits.max_bytes })
    }

    /// The name of the model to begin with.
    pub(super) fn root(&mut self) -> Result<String, FormatError> {
        if self.archive.index_for_name(RELATIONS).is_none() {
            return Ok(MODEL.into());
        }
        let text = self.text(RELATIONS)?;
        let mut found = None;
        super::model::elements(&text, RELATIONS, |element| {
            let is_model = element.get("Type").is_some_and(|kind| kind.ends_with("/3dmodel"));
            if found.is_none() && element.name == "Relationship" && is_model {
                found = element.get("Target").map(|target| plain(&target));
            }
            Ok(())
        })?;
        Ok(found.unwrap_or_else(|| MODEL.into()))
    }

    /// The text of a part.
    pub(super) fn text(&mut self, name: &str) -> Result<String, FormatError> {
        let shown: String = name.escape_debug().take(80).collect();
        let damaged = |error: &dyn std::fmt::Display| FormatError::malformed(shown.clone(), error.to_string(), REPAIR);
        let part = self.archive.by_name(name).map_err(|error| damaged(&error))?;
        let too_many = |found, limit| FormatError::TooManyBytes { what: "unpacked, it has", found, limit };
        // a size may be a lie: memory grows by what is there
        let mut bytes = Vec::new();
        let read = part.take(self.left.saturating_add(1)).read_to_end(&mut bytes);
        if bytes.len() as u64 > self.left {
            return Err(too_many(self.limit.saturating_add(1), self.limit));
        }
        read.map_err(|error| damaged(&error))?;
        self.left -= bytes.len() as u64;
        let text = String::from_utf8(bytes);
        text.map_err(|_| FormatError::malformed(shown, "its text is not UTF-8", "save the file as UTF-8"))
    }
}

/// The name of a part as the archive has it.
pub(super) fn plain(name: &str) -> String {
    name.trim_start_matches('/').to_owned()
}
