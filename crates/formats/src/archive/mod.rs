//! Archives, zip and tar (also packed with gzip), as a list of files: a whole set of scans in one upload.
//!
//! Nothing is written anywhere: the paths only name the files. Those that could name a place outside of the archive, links,
//! and what systems leave in archives (`__MACOSX`, `._scan.ply`, `Thumbs.db`) are passed over and listed. An archive that is
//! damaged, encrypted, or names two files alike is refused whole, since a set that lacks a scan is another set.

mod tarred;
mod writer;
mod zipped;

use std::collections::BTreeSet;
use std::io::Read;

use super::{FormatError, ReadLimits, packed, quote};

pub use writer::ZipWriter;

/// Bounds on what an archive may unpack to.
#[derive(Debug, Clone, Copy)]
pub struct ArchiveLimits {
    /// Entries, folders and all.
    pub max_entries: u64,
    /// Bytes of one file.
    pub max_file_bytes: u64,
    /// Bytes of all files.
    pub max_total_bytes: u64,
}

impl ArchiveLimits {
    /// For archives of files that may be as large as `limits` says each.
    pub fn of(limits: &ReadLimits) -> Self {
        const FILES: u64 = 8;
        ArchiveLimits {
            max_entries: 10_000,
            max_file_bytes: limits.max_bytes,
            max_total_bytes: limits.max_bytes.saturating_mul(FILES),
        }
    }
}

impl Default for ArchiveLimits {
    fn default() -> Self {
        ArchiveLimits::of(&ReadLimits::default())
    }
}

/// A file of an archive.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Entry {
    /// Where it is in the archive: relative, parted by `/`, without `.` and `..`.
    pub path: String,
    /// What is in it.
    pub bytes: Vec<u8>,
}

/// What an archive holds.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Contents {
    /// Its files, in the order in which they stand there.
    pub entries: Vec<Entry>,
    /// What was passed over, with why: `(path, reason)`. Folders are not among it.
    pub passed_over: Vec<(String, &'static str)>,
}

/// How the names of archives end.
const ENDINGS: &[(&str, Kind)] =
    &[(".zip", Kind::Zip), (".tar", Kind::Tar), (".tar.gz", Kind::TarGz), (".tgz", Kind::TarGz)];

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Zip,
    Tar,
    TarGz,
}

fn kind_of(name: &str) -> Option<Kind> {
    let name = name.to_ascii_lowercase();
    ENDINGS.iter().find(|(ending, _)| name.ends_with(ending)).map(|(_, kind)| *kind)
}

/// Whether a file of this name is an archive that can be unfolded.
pub fn is_archive(name: &str) -> bool {
    kind_of(name).is_some()
}

/// The files of an archive; its name says of which kind it is.
///
/// # Errors
/// [`FormatError::TooLarge`] and [`FormatError::TooManyBytes`] beyond the limits, before more than they allow is unpacked;
/// [`FormatError::Truncated`] and [`FormatError::Malformed`] for one that is damaged, encrypted or without files, or that
/// names two files alike.
pub fn entries(name: &str, bytes: &[u8], limits: &ArchiveLimits) -> Result<Contents, FormatError> {
    let mut entries = Vec::new();
    let passed_over = each(name, bytes, limits, |entry| {
        entries.push(entry);
        Ok::<(), FormatError>(())
    })?;
    Ok(Contents { entries, passed_over })
}

/// Hands the files of an archive to `take` one by one, so that no more than one is in memory; gives what was passed over,
/// with why. What was taken before an error is to be thrown away.
///
/// # Errors
/// Those of [`entries`], and what `take` gives, which ends it.
pub fn each<E: From<FormatError>>(
    name: &str,
    bytes: &[u8],
    limits: &ArchiveLimits,
    mut take: impl FnMut(Entry) -> Result<(), E>,
) -> Result<Vec<(String, &'static str)>, E> {
    let mut not_taken = None;
    let mut keep = |entry: Entry| match take(entry) {
        Ok(()) => Ok(()),
        Err(error) => {
            not_taken = Some(error);
            Err(FormatError::malformed("archive", "a file of it can't be kept", "see why"))
        }
    };
    let passed_over = unfold(name, bytes, limits, &mut keep);
    match not_taken {
        Some(error) => Err(error),
        None => Ok(passed_over?),
    }
}

fn unfold(
    name: &str,
    bytes: &[u8],
    limits: &ArchiveLimits,
    keep: Keep,
) -> Result<Vec<(String, &'static str)>, FormatError> {
    let collected = match kind_of(name) {
        Some(Kind::Zip) => zipped::read(bytes, Collector::new(bytes, limits, keep))?,
        Some(Kind::Tar) => tarred::read(bytes, Collector::new(bytes, limits, keep))?,
        Some(Kind::TarGz) => {
            let most = limits.max_total_bytes.min(most_from(bytes));
            let unpacked = packed::unpack(bytes, most.saturating_add(tarred::overhead(limits)))?;
            tarred::read(&unpacked, Collector::new(bytes, limits, keep))?
        }
        None => {
            let problem = format!("{} is no archive that can be unfolded", quote(name.as_bytes()));
            return Err(FormatError::malformed("name", problem, "send a .zip, .tar, .tar.gz or .tgz file"));
        }
    };
    if collected.kept == 0 {
        let why = collected.passed_over.first().map(|(path, why)| format!(": {} {why}", quote(path.as_bytes())));
        let problem = format!("there are no files in the archive{}", why.unwrap_or_default());
        return Err(FormatError::malformed("the whole archive", problem, "pack the scans themselves"));
    }
    Ok(collected.passed_over)
}

/// Takes a file that was unpacked.
type Keep<'k> = &'k mut dyn FnMut(Entry) -> Result<(), FormatError>;

/// Bytes that may be made of an archive at most: scans don't pack better, bombs do. Small ones may always unpack.
fn most_from(archive: &[u8]) -> u64 {
    const MOST_GROWTH: u64 = 250;
    const ALWAYS: u64 = 16 << 20;
    (archive.len() as u64).saturating_mul(MOST_GROWTH).max(ALWAYS)
}

/// Takes the files of an archive one by one, within the limits.
struct Collector<'a> {
    limits: &'a ArchiveLimits,
    keep: Keep<'a>,
    /// Files that were taken.
    kept: u64,
    passed_over: Vec<(String, &'static str)>,
    /// The paths so far, with those that differ in case only counted as one: many disks can't hold both.
    paths: BTreeSet<String>,
    entries: u64,
    /// Bytes that may still be unpacked, and why no more.
    left: u64,
    total: u64,
}

impl<'a> Collector<'a> {
    fn new(archive: &[u8], limits: &'a ArchiveLimits, keep: Keep<'a>) -> Self {
        let total = limits.max_total_bytes.min(most_from(archive));
        Collector {
            limits,
            keep,
            kept: 0,
            passed_over: Vec::new(),
            paths: BTreeSet::new(),
            entries: 0,
            left: total,
            total,
        }
    }

    /// Counts an entry of whatever kind.
    fn count(&mut self) -> Result<(), FormatError> {
        self.entries += 1;
        check_entries(self.entries, self.limits)
    }

    /// Lists an entry that is not taken.
    fn pass_over(&mut self, path: &str, why: &'static str) {
        // names come from outside: not longer than a path is
        const MOST: usize = 1 << 10;
        self.passed_over.push((path.chars().take(MOST).collect(), why));
    }

    /// The path under which a file is kept; one that is not is listed.
    fn accept(&mut self, raw: &str) -> Result<Option<String>, FormatError> {
        let path = match clean(raw) {
            Ok(path) => path,
            Err(why) => {
                self.pass_over(raw, why);
                return Ok(None);
            }
        };
        if !self.paths.insert(path.to_lowercase()) {
            let problem = format!("two files in the archive are named {}", quote(path.as_bytes()));
            return Err(FormatError::malformed(
                "the list of files",
                problem,
                "pack each file once, under its own name",
            ));
        }
        Ok(Some(path))
    }

    /// Unpacks a file that declares `size` bytes, as far as that is known.
    fn take(&mut self, path: String, size: u64, content: impl Read) -> Result<(), FormatError> {
        let (each, all) = (self.limits.max_file_bytes, self.left);
        self.check_size(size)?;
        // what is declared may be a lie: only what is there makes memory grow
        let mut bytes = Vec::new();
        let read = content.take(each.min(all).saturating_add(1)).read_to_end(&mut bytes);
        self.check_size(bytes.len() as u64)?;
        read.map_err(|error| {
            let problem = format!("the file {} is damaged ({error})", quote(path.as_bytes()));
            FormatError::malformed("archive", problem, "pack or upload it again")
        })?;
        self.left -= bytes.len() as u64;
        self.kept += 1;
        (self.keep)(Entry { path, bytes })
    }

    fn check_size(&self, size: u64) -> Result<(), FormatError> {
        if size > self.limits.max_file_bytes {
            let limit = self.limits.max_file_bytes;
            return Err(FormatError::TooManyBytes { what: "a file of the archive has", found: size, limit });
        }
        if size > self.left {
            let found = (self.total - self.left).saturating_add(size);
            return Err(FormatError::TooManyBytes { what: "unpacked, the archive has", found, limit: self.total });
        }
        Ok(())
    }
}

fn check_entries(found: u64, limits: &ArchiveLimits) -> Result<(), FormatError> {
    let limit = limits.max_entries;
    if found > limit { Err(FormatError::TooLarge { what: "entries of the archive", found, limit }) } else { Ok(()) }
}

/// The path of a file as it is kept, or why it is passed over.
fn clean(raw: &str) -> Result<String, &'static str> {
    // old programs of Windows part folders by backslashes
    let path = raw.replace('\\', "/");
    let has_drive = path.as_bytes().get(1) == Some(&b':') && path.as_bytes()[0].is_ascii_alphabetic();
    if path.starts_with('/') || has_drive {
        return Err("has an absolute path");
    }
    let parts: Vec<&str> = path.split('/').filter(|part| !part.is_empty() && *part != ".").collect();
    if parts.contains(&"..") {
        return Err("leads out of the archive");
    }
    if path.chars().any(char::is_control) {
        return Err("has a name with control characters");
    }
    let Some(name) = parts.last() else { return Err("has no name") };
    if parts.contains(&"__MACOSX") || name.starts_with("._") {
        return Err("is what a Mac notes of a file");
    }
    if parts.iter().any(|part| part.starts_with('.')) {
        return Err("is hidden");
    }
    if ["thumbs.db", "desktop.ini"].contains(&&*name.to_lowercase()) {
        return Err("is what Windows notes of a folder");
    }
    Ok(parts.join("/"))
}

#[cfg(test)]
mod tests;
