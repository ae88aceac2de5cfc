//! The pages that an E57 file is divided into, each with its checksum.

use crate::FormatError;

/// Bytes of a page, with and without its checksum. The standard knows one size.
const PAGE: usize = 1024;
const CONTENT: usize = PAGE - 4;

/// The content of a file's pages.
pub(super) struct Pages<'a> {
    bytes: &'a [u8],
    /// The page whose checksum was seen to be right last: reads follow each other.
    checked: Option<usize>,
}

impl<'a> Pages<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Result<Self, FormatError> {
        if !bytes.len().is_multiple_of(PAGE) {
            let declared = format!("pages of {PAGE} bytes");
            let found = format!("the last of its {} pages", bytes.len() / PAGE + 1);
            return Err(FormatError::Truncated { declared, found });
        }
        Ok(Pages { bytes, checked: None })
    }

    /// Where a place of the file is in its content.
    pub(super) fn logical(place: u64) -> u64 {
        let page = PAGE as u64;
        place / page * CONTENT as u64 + (place % page).min(CONTENT as u64)
    }

    /// The content behind a place of the file.
    pub(super) fn read(&mut self, place: u64, size: usize, what: &str) -> Result<Vec<u8>, FormatError> {
        let mut content = Vec::new();
        self.read_content(Self::logical(place), size, what, &mut content)?;
        Ok(content)
    }

    /// Replaces `into` by content.
    pub(super) fn read_content(
        &mut self,
        start: u64,
        size: usize,
        what: &str,
        into: &mut Vec<u8>,
    ) -> Result<(), FormatError> {
        let all = (self.bytes.len() / PAGE * CONTENT) as u64;
        if start.saturating_add(size as u64) > all {
            let declared = format!("{size} bytes for {what}");
            return Err(FormatError::Truncated { declared, found: "the last page".into() });
        }
        into.clear();
        into.reserve(size);
        let mut at = start as usize;
        while into.len() < size {
            let (page, offset) = (at / CONTENT, at % CONTENT);
            let content = self.page(page)?;
            let part = &content[offset..CONTENT.min(offset + size - into.len())];
            into.extend_from_slice(part);
            at += part.len();
        }
        Ok(())
    }

    /// The content of a page whose checksum is right.
    fn page(&mut self, page: usize) -> Result<&'a [u8], FormatError> {
        let bytes = self.bytes.get(page * PAGE..(page + 1) * PAGE).unwrap_or_default();
        let Some((content, sum)) = bytes.split_at_checked(CONTENT) else {
            return Err(FormatError::Truncated { declared: format!("page {page}"), found: "the file".into() });
        };
        if self.checked != Some(page) {
            if crc32c::crc32c(content).to_be_bytes() != sum {
                let problem = "its checksum is wrong: bytes of it were changed";
                return Err(FormatError::malformed(format!("page {page}"), problem, "export or upload it again"));
            }
            self.checked = Some(page);
        }
        Ok(content)
    }
}
