//! Zip archives.

use std::io::Cursor;

use memchr::memmem;
use zip::ZipArchive;
use zip::result::ZipError;

use super::{Collector, check_entries};
use crate::{FormatError, quote};

/// The signature before each line of the list of files.
const LISTED: &[u8] = b"PK\x01\x02";
/// The signature of the end of a list of many files, and where after it their number stands.
const LARGE_END: &[u8] = b"PK\x06\x06";
const LARGE_COUNT: usize = 32;

pub(super) fn read<'a>(bytes: &[u8], mut collector: Collector<'a>) -> Result<Collector<'a>, FormatError> {
    check_counts(bytes, &collector)?;
    let mut archive = ZipArchive::new(Cursor::new(bytes)).map_err(|error| damaged("archive", &error))?;
    if archive.has_duplicate_names() {
        let problem = "two files in the archive have the same name";
        return Err(FormatError::malformed("the list of files", problem, "pack each file once, under its own name"));
    }
    for index in 0..archive.len() {
        collector.count()?;
        // as it is packed: what is not wanted need not be readable
        let (raw, is_link, is_encrypted, is_folder) = {
            let entry = archive.by_index_raw(index).map_err(|error| damaged("archive", &error))?;
            (name_of(&entry)?, entry.is_symlink(), entry.encrypted(), entry.is_dir())
        };
        if is_folder {
            continue;
        }
        if is_link {
            collector.pass_over(&raw, "is a link");
            continue;
        }
        let Some(path) = collector.accept(&raw)? else { continue };
        let shown = format!("file {}", quote(path.as_bytes()));
        if is_encrypted {
            let problem = "it is encrypted";
            return Err(FormatError::malformed(shown, problem, "pack the files without a password"));
        }
        let entry = archive.by_index(index).map_err(|error| damaged(&shown, &error))?;
        let size = entry.size();
        collector.take(path, size, entry)?;
    }
    Ok(collector)
}

/// Bounds the list of files before anything is made of it.
fn check_counts(bytes: &[u8], collector: &Collector) -> Result<(), FormatError> {
    let limits = collector.limits;
    let listed = memmem::find_iter(bytes, LISTED).take(usize::try_from(limits.max_entries).unwrap_or(usize::MAX));
    let listed = listed.count() as u64;
    // one more than are allowed is enough
    let beyond = memmem::find_iter(bytes, LISTED).nth(listed as usize).is_some();
    check_entries(listed + u64::from(beyond), limits)?;
    for end in memmem::find_iter(bytes, LARGE_END) {
        let count = bytes.get(end + LARGE_COUNT..).and_then(<[u8]>::first_chunk);
        check_entries(count.map_or(0, |count| u64::from_le_bytes(*count)), limits)?;
    }
    Ok(())
}

/// The name of an entry: UTF-8 if it is that, whatever the archive says; else in the encoding of old systems.
fn name_of<R: std::io::Read>(entry: &zip::read::ZipFile<'_, R>) -> Result<String, FormatError> {
    match std::str::from_utf8(entry.name_raw()) {
        Ok(name) => Ok(name.to_owned()),
        Err(_) => entry.name().map(|name| name.into_owned()).map_err(|error| damaged("archive", &error)),
    }
}

fn damaged(place: &str, error: &ZipError) -> FormatError {
    match error {
        ZipError::CompressionMethodNotSupported(_) | ZipError::UnsupportedArchive(_) => {
            let problem = format!("it is packed in a way that is not read here ({error})");
            FormatError::malformed(place, problem, "pack it as plain zip (deflate), or as tar.gz")
        }
        _ => {
            let problem = format!("the zip file is damaged or cut short ({error})");
            FormatError::malformed(place, problem, "pack or upload it again")
        }
    }
}
