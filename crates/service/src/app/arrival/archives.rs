//! Archives of a whole set: unpacked file by file into the staging, so that no more than one file is in memory beside the
//! archive.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::textures::{self, Beside};
use super::{ArrivalError, Coming, Content, Desk, ReceivedFile, depth};
use crate::storage::{ObjectError, StagedFile};
use visage_domain::PassedOver;
use visage_formats::archive::{self, ArchiveLimits, Entry};
use visage_formats::{FormatError, check_name, extension, is_common, scan_files, surface_endings};

/// Endings of files that are no scans, no poses and no depth images: they are not even staged.
const NOTHING: &[&str] = &["avi", "doc", "docx", "html", "mov", "mp4", "pdf", "tif", "tiff", "zip"];
/// Endings of files that belong to others, if they are of any use.
const PICTURES: &[&str] = &["jpeg", "jpg", "png"];
const NOT_READ: &str = "has a format that is not read";

/// An archive that was unpacked.
pub(super) struct Unpacked {
    name: String,
    /// Its files by their paths from the folder that holds all of them.
    files: BTreeMap<String, StagedFile>,
    /// What its OBJ files may need.
    beside: Arc<Beside>,
    passed_over: Vec<PassedOver>,
}

/// What ends the unpacking.
enum Stop {
    Format(FormatError),
    Objects(ObjectError),
}

impl From<FormatError> for Stop {
    fn from(error: FormatError) -> Self {
        Stop::Format(error)
    }
}

impl Unpacked {
    /// Unpacks an archive to at most `left` bytes, and takes them from it.
    pub async fn of(desk: &Desk, file: ReceivedFile, left: &mut u64) -> Result<Self, ArrivalError> {
        let most = *left;
        let unpacked = desk.work(move |desk| Unpacked::read(desk, &file, most)).await?;
        *left -= unpacked.files.values().map(|file| file.bytes).sum::<u64>().min(most);
        Ok(unpacked)
    }

    fn read(desk: &Desk, file: &ReceivedFile, most: u64) -> Result<Self, ArrivalError> {
        let bytes = desk.objects.read_staged(&file.staged)?;
        let limits = ArchiveLimits::of(&desk.limits.read_limits());
        let limits = ArchiveLimits { max_total_bytes: most, ..limits };
        let (name, files) = (file.name.clone(), BTreeMap::new());
        let mut unpacked = Unpacked { name, files, beside: Arc::default(), passed_over: Vec::new() };
        let left_out = archive::each(&file.name, &bytes, &limits, |Entry { path, bytes }| {
            match why_not(&path, bytes.len(), desk.limits.pose_file_bytes) {
                Some(why) => unpacked.pass_over(&path, why),
                None => {
                    let staged = desk.stage(&bytes).map_err(Stop::Objects)?;
                    unpacked.files.insert(path, staged);
                }
            }
            Ok(())
        });
        let left_out = left_out.map_err(|stop| match stop {
            Stop::Format(error) => ArrivalError::Unreadable { file: file.name.clone(), archive: None, error },
            Stop::Objects(error) => error.into(),
        })?;
        left_out.iter().for_each(|(path, why)| unpacked.pass_over(path, why));
        unpacked.strip();
        Ok(unpacked)
    }

    /// Names the files by their paths from the folder that holds all of them.
    fn strip(&mut self) {
        let folders = |path: &str| path.split('/').rev().skip(1).map(str::to_owned).collect::<Vec<_>>();
        let mut common: Option<Vec<String>> = None;
        for path in self.files.keys() {
            let own: Vec<String> = folders(path).into_iter().rev().collect();
            let shared = match &common {
                Some(common) => common.iter().zip(&own).take_while(|(a, b)| a == b).count(),
                None => own.len(),
            };
            common = Some(own[..shared].to_vec());
        }
        let length = common.unwrap_or_default().iter().map(|folder| folder.len() + 1).sum::<usize>();
        let files = std::mem::take(&mut self.files);
        self.files = files.into_iter().map(|(path, file)| (path[length..].to_owned(), file)).collect();
    }

    fn pass_over(&mut self, path: &str, why: &str) {
        self.passed_over.push(PassedOver { file: super::file_in(path, Some(&self.name)), why: why.to_owned() });
    }

    /// Takes the scans out.
    ///
    /// # Errors
    /// [`ArrivalError::Unreadable`] if there are none.
    pub fn scans(&mut self) -> Result<Vec<Coming>, ArrivalError> {
        let names: Vec<&str> = self.files.keys().map(String::as_str).collect();
        let chosen = names.iter().zip(scan_files(&names)).filter_map(|(name, is_scan)| is_scan.then_some(*name));
        let chosen: Vec<String> = chosen.map(str::to_owned).collect();
        // the text files of a camera may be anything, too
        if chosen.iter().all(|name| is_common(name))
            && let Some(scans) = depth::of_archive(&self.name, &mut self.files)
        {
            let coming =
                |(name, scan)| Coming { name, archive: Some(self.name.clone()), content: Content::Depth(scan) };
            return Ok(scans.into_iter().map(coming).collect());
        }
        if chosen.is_empty() {
            let problem = format!("none of its {} files is a scan", self.files.len() + self.passed_over.len());
            let remedy = format!("pack the scans themselves (read are: {})", surface_endings().join(", "));
            let error = FormatError::Malformed { place: "the archive".into(), problem, remedy };
            return Err(ArrivalError::Unreadable { file: self.name.clone(), archive: None, error });
        }
        if chosen.iter().any(|name| textures::may_be_textured(name)) {
            self.beside = Arc::new(Beside::take_from(&mut self.files));
        }
        let (archive, files) = (&self.name, &mut self.files);
        let take = |name: String| {
            let file = files.remove(&name)?;
            let content = match textures::may_be_textured(&name) {
                true => Content::Textured(file, self.beside.clone()),
                false => Content::File(file),
            };
            Some(Coming { name, archive: Some(archive.clone()), content })
        };
        Ok(chosen.into_iter().filter_map(take).collect())
    }

    /// What is neither a scan nor belongs to one.
    pub fn others(&self) -> impl Iterator<Item = (&String, &StagedFile)> {
        self.files.iter()
    }

    /// Takes out a file that is used.
    pub fn take(&mut self, name: &str) {
        self.files.remove(name);
    }

    /// Takes out a file that is not used.
    pub fn leave(&mut self, name: &str, why: &str) {
        self.files.remove(name);
        self.pass_over(name, why);
    }

    /// What is not kept, with why.
    pub fn passed_over(mut self) -> Vec<PassedOver> {
        for name in std::mem::take(&mut self.files).into_keys().chain(self.beside.unused()) {
            let is_picture = PICTURES.contains(&extension(&name).as_str());
            self.pass_over(&name, if is_picture { NOT_READ } else { "is no scan, and no file of poses that is used" });
        }
        self.passed_over.sort_by(|a, b| natord::compare(&a.file, &b.file));
        self.passed_over
    }
}

/// Why a file can't be of any use, by its name and size.
fn why_not(path: &str, bytes: usize, most_poses: usize) -> Option<&'static str> {
    let ending = extension(path);
    if check_name(path).is_ok() || PICTURES.contains(&&*ending) {
        return None;
    }
    if archive::is_archive(path) {
        return Some("is an archive in the archive: send it by itself");
    }
    if NOTHING.contains(&ending.as_str()) {
        return Some(NOT_READ);
    }
    (bytes > most_poses).then_some("is no scan, and larger than a pose file may be")
}
