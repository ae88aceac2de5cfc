//! Which files of a folder are scans.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};

use super::depth_folder::DepthFolder;
use super::unfolded::Unfolded;
use super::{textures, unpacked::Unpacked};
use crate::formats::{self, FORMATS, Format, FormatError, ReadLimits, Reader, Reading, poses::PoseFile};

/// A scan of a folder, or a file that is none.
pub(super) struct Listed {
    /// Its name, by which poses and reports speak of it.
    pub name: String,
    /// The file, from the folder on: the same unless it holds several scans.
    pub file: String,
    /// Whether the file's name is UTF-8 as it stands.
    is_utf8: bool,
}

impl Listed {
    fn file(name: String, is_utf8: bool) -> Self {
        Listed { file: name.clone(), name, is_utf8 }
    }
}

/// The scans and other files of a folder by name.
pub struct Folder {
    path: PathBuf,
    /// What the user calls it.
    shown: PathBuf,
    files: Vec<Listed>,
    /// The depth images, if there are no other scans; `files` are these, then.
    depth: Option<DepthFolder>,
    /// The scans of files that hold several.
    unfolded: Unfolded,
    /// Folders in it that are not looked into.
    folders: Vec<String>,
}

impl Folder {
    /// Lists a folder; where it holds no scans itself, with the folders in it.
    pub fn list(path: &Path) -> anyhow::Result<Self> {
        let mut files = Vec::new();
        let folders = list_into(path, "", false, &mut files)?;
        let mut folder = Folder::of(path, path, files)?;
        if folders.is_empty() || folder.scans().next().is_some() {
            folder.folders = folders;
            return Ok(folder);
        }
        let mut files = Vec::new();
        list_into(path, "", true, &mut files)?;
        Folder::of(path, path, files)
    }

    /// Lists what an archive held, in folders too.
    pub fn of_archive(archive: &Path, unpacked: &Unpacked) -> anyhow::Result<Self> {
        let mut files = Vec::new();
        list_into(unpacked.folder(), "", true, &mut files)?;
        Folder::of(unpacked.folder(), archive, files)
    }

    /// A file as the only one of its folder.
    pub fn of_file(file: &Path) -> anyhow::Result<Self> {
        let name = file.file_name().unwrap_or_default();
        let listed = Listed::file(name.to_string_lossy().into_owned(), name.to_str().is_some());
        formats::check_name(&listed.name)?;
        let path = file.parent().unwrap_or(Path::new(""));
        Ok(Folder {
            path: path.to_owned(),
            shown: path.to_owned(),
            files: vec![listed],
            depth: None,
            unfolded: Unfolded::default(),
            folders: Vec::new(),
        })
    }

    fn of(path: &Path, shown: &Path, mut files: Vec<Listed>) -> anyhow::Result<Self> {
        files.sort_by(|a, b| a.name.cmp(&b.name));
        let (path, shown) = (path.to_owned(), shown.to_owned());
        let unfolded = Unfolded::default();
        let mut folder = Folder { path, shown, files, depth: None, unfolded, folders: Vec::new() };
        // the text files of a camera may be anything, too
        if folder.scans().all(|listed| formats::is_common(&listed.file)) {
            folder.depth = DepthFolder::find(&folder.path)?;
        }
        if let Some(depth) = &folder.depth {
            let file = |name: &str| Listed::file(name.to_owned(), !name.contains(char::REPLACEMENT_CHARACTER));
            folder.files = depth.names().map(file).collect();
        }
        Ok(folder)
    }

    /// Unfolds the files that hold several scans, so far as they may be wanted.
    pub fn unfold(&mut self, glob: Option<&str>) -> anyhow::Result<()> {
        if self.depth.is_some() {
            return Ok(());
        }
        let files = |listed: Vec<&Listed>| listed.into_iter().map(|listed| listed.file.clone()).collect::<Vec<_>>();
        let chosen = glob.map(|glob| self.matching(glob)).transpose()?.map(files).unwrap_or_default();
        // a glob that fits no file may fit a scan in one
        let files = if chosen.is_empty() { files(self.scans().collect()) } else { chosen };
        let others: Vec<&str> = self.files.iter().map(|listed| listed.file.as_str()).collect();
        self.unfolded = Unfolded::read(&self.path, &files, &others);
        let scans = self.unfolded.names().map(|(name, file)| {
            let (name, file) = (name.to_owned(), file.to_owned());
            Listed { name, file, is_utf8: true }
        });
        let scans: Vec<Listed> = scans.collect();
        self.files.retain(|listed| !scans.iter().any(|scan| scan.file == listed.file));
        self.files.extend(scans);
        Ok(())
    }

    /// The scans of files that hold several.
    pub fn unfolded(&self) -> &Unfolded {
        &self.unfolded
    }

    /// The depth images of the folder, if they are what it holds.
    pub fn depth(&self) -> Option<&DepthFolder> {
        self.depth.as_ref()
    }

    /// Reads a scan of the folder.
    pub fn read(&self, name: &str) -> anyhow::Result<Reading> {
        if let Some(depth) = &self.depth {
            return depth.read(name);
        }
        if let Some(reading) = self.unfolded.take(name) {
            return Ok(reading);
        }
        let path = self.path.join(name);
        let bytes = std::fs::read(&path).with_context(|| format!("reading {}", path.display()))?;
        let limits = ReadLimits::default();
        textures::read(&self.path, name, &bytes, &limits).with_context(|| format!("reading {}", self.shown(name)))
    }

    /// A file of the folder as the user finds it.
    fn shown(&self, name: &str) -> String {
        self.shown.join(name).display().to_string()
    }

    /// The files that may be scans, and the scans in them.
    fn scans(&self) -> impl Iterator<Item = &Listed> {
        let names: Vec<&str> = self.files.iter().map(|listed| listed.file.as_str()).collect();
        let are_scans = formats::scan_files(&names);
        let is_depth = self.depth.is_some();
        self.files.iter().zip(are_scans).filter(move |(_, is_scan)| is_depth || *is_scan).map(|(listed, _)| listed)
    }

    /// The names of all files, and of the scans in them.
    pub(super) fn names(&self) -> impl Iterator<Item = &str> {
        self.files.iter().map(|listed| listed.name.as_str())
    }

    /// The files that are no scans, and where they are.
    pub fn other_files(&self) -> impl Iterator<Item = (&str, PathBuf)> {
        let scans: Vec<&str> = self.scans().map(|listed| listed.file.as_str()).collect();
        let others = self.files.iter().filter(move |listed| !scans.contains(&listed.file.as_str()));
        others.map(|listed| (listed.file.as_str(), self.path.join(&listed.file)))
    }

    /// Names the poses of a file as the scans are named, which are those that `glob` chooses, if it is given.
    pub fn fit(&self, glob: Option<&str>, poses: PoseFile) -> anyhow::Result<PoseFile> {
        let chosen = glob.map(|glob| self.matching(glob)).transpose()?;
        let scans = match &chosen {
            Some(chosen) => chosen.iter().map(|listed| listed.name.as_str()).collect(),
            None => self.scans().map(|listed| listed.name.as_str()).collect::<Vec<_>>(),
        };
        Ok(poses.named_as(&scans)?)
    }

    /// The scans to register, in the order of the views: that of the base model, then of the pose file, else natural
    /// order of the names.
    pub fn choose(
        &self,
        glob: Option<&str>,
        poses: Option<&PoseFile>,
        base: Option<&PoseFile>,
    ) -> anyhow::Result<Vec<String>> {
        let mut names: Vec<String> = match (glob, poses) {
            (Some(glob), _) => self.matching(glob)?.into_iter().map(|listed| listed.name.clone()).collect(),
            (None, Some(poses)) => self.posed(poses, base)?,
            (None, None) => {
                self.depth.as_ref().map_or(Ok(()), DepthFolder::check_count)?;
                self.scans().map(|listed| listed.name.clone()).collect()
            }
        };
        let place_in = |file: Option<&PoseFile>, name: &String| {
            file.and_then(|file| file.poses.iter().position(|(posed, _)| posed == name)).unwrap_or(usize::MAX)
        };
        let place = |name: &String| (place_in(base, name), place_in(poses, name));
        names.sort_by(|a, b| place(a).cmp(&place(b)).then_with(|| natord::compare(a, b)));
        if names.is_empty() {
            bail!("{}", self.without_scans(glob));
        }
        if let Some(Listed { name, .. }) = self.files.iter().find(|file| !file.is_utf8 && names.contains(&file.name)) {
            bail!("the name of {name} in {} is no UTF-8: rename the file", self.shown.display());
        }
        if let Some(named) = poses.and_then(|poses| poses.poses.first()) {
            let fits = |name: &String| place_in(poses, name) < usize::MAX;
            let named = &named.0;
            ensure!(
                names.iter().any(fits),
                "the pose file names none of the scans: it names {named}, not {}",
                names[0]
            );
        }
        Ok(names)
    }

    /// What a glob fits: by its own name, or by that of the file that holds it.
    fn matching(&self, glob: &str) -> anyhow::Result<Vec<&Listed>> {
        let matcher = globset::Glob::new(glob).context("--scans")?.compile_matcher();
        // a name fits itself, whatever its signs mean in a glob
        let fits = |name: &str| name == glob || (matcher.is_match(name) && !name.starts_with('.'));
        Ok(self.files.iter().filter(|listed| fits(&listed.name) || fits(&listed.file)).collect())
    }

    fn posed(&self, poses: &PoseFile, base: Option<&PoseFile>) -> anyhow::Result<Vec<String>> {
        let is_there = |name: &str| self.names().any(|file| file == name);
        let missing: Vec<&str> = poses.poses.iter().map(|p| p.0.as_str()).filter(|name| !is_there(name)).collect();
        ensure!(
            missing.is_empty(),
            "the pose file names scans that are not in {}: {}",
            self.shown.display(),
            missing.join(", ")
        );
        let posed = || poses.poses.iter().chain(base.iter().flat_map(|base| &base.poses));
        Ok(self.names().filter(|name| posed().any(|(posed, _)| posed == name)).map(str::to_owned).collect())
    }

    fn without_scans(&self, glob: Option<&str>) -> String {
        let path = self.shown.display();
        match glob {
            Some(glob) => format!("no file in {path} fits --scans '{glob}' (in it * ? [...] {{...}} stand for others)"),
            None => {
                let packed = |name: &&str| matches!(formats::check_name(name), Err(FormatError::Packed { .. }));
                let packed = self.names().filter(packed).count();
                let packed = if packed > 0 {
                    format!("; {packed} files are packed: unpack them{}", self.archive_in_words())
                } else {
                    String::new()
                };
                format!("no scans in {path} (read are: {}{packed})", formats::surface_endings().join(", "))
            }
        }
    }

    /// An archive of the folder could be given itself.
    fn archive_in_words(&self) -> String {
        let archive = self.names().find(|name| formats::archive::is_archive(name));
        archive.map_or_else(String::new, |name| format!(", or give {name} itself"))
    }

    /// What is passed over of the folder when its scans are not chosen, with why, in words: other formats, what may be
    /// anything, hidden files, folders, and poses, but for the pose file that is used.
    pub fn passed_over(&self, used: Option<&str>) -> Vec<String> {
        if self.depth.is_some() {
            return Vec::new();
        }
        let others: Vec<&str> = self.other_files().map(|(name, _)| name).filter(|name| Some(*name) != used).collect();
        let mut notes = Vec::new();
        if let Some(poses) = others.iter().find(|name| used.is_none() && is_pose_file(name)) {
            notes.push(format!("{poses} is not used; give it with --poses if the scans are to start from it"));
        }
        let is_hidden = |name: &str| name.split('/').any(|part| part.starts_with('.'));
        let is_scan = |name: &str| formats::check_name(name).is_ok();
        let of = |is_it: &dyn Fn(&str) -> bool| -> Vec<&str> {
            let rest = others.iter().copied().filter(|name| name.contains('.') && !is_pose_file(name));
            rest.filter(|name| is_it(name)).collect()
        };
        let groups = [
            (of(&|name| is_hidden(name) && is_scan(name)), "what is hidden is none of a set"),
            (
                of(&|name| !is_hidden(name) && is_scan(name)),
                "text may be anything, and there are other scans (--scans takes it)",
            ),
            (of(&|name| !is_hidden(name) && !is_scan(name)), "that format is not read"),
        ];
        for (names, why) in groups.iter().filter(|(names, _)| !names.is_empty()) {
            let files = if names.len() == 1 { "1 file is".to_owned() } else { format!("{} files are", names.len()) };
            notes.push(format!("{files} passed over, since {why}: {}", listed(names)));
        }
        if !self.folders.is_empty() {
            let folders: Vec<&str> = self.folders.iter().map(String::as_str).collect();
            let why = "since there are scans beside them";
            notes.push(format!("{} folders are not looked into, {why}: {}", folders.len(), listed(&folders)));
        }
        notes
    }
}

/// The first of some names.
fn listed(names: &[&str]) -> String {
    const MOST: usize = 5;
    let dots = if names.len() > MOST { ", ..." } else { "" };
    format!("{}{dots}", names[..names.len().min(MOST)].join(", "))
}

/// Lists the files of a folder by their paths from it, and those of the folders in it if they are wanted; gives the
/// folders that are not looked into.
fn list_into(path: &Path, prefix: &str, with_folders: bool, files: &mut Vec<Listed>) -> anyhow::Result<Vec<String>> {
    let mut folders = Vec::new();
    let entries = std::fs::read_dir(path).with_context(|| format!("reading the folder {}", path.display()))?;
    for entry in entries {
        let entry = entry.with_context(|| format!("reading the folder {}", path.display()))?;
        let name = entry.file_name();
        let shown = format!("{prefix}{}", name.to_string_lossy());
        // a link to a folder may lead around in a circle
        let is_folder = entry.file_type().is_ok_and(|kind| kind.is_dir()) && !shown.starts_with('.');
        if entry.path().is_file() {
            files.push(Listed::file(shown, name.to_str().is_some()));
        } else if is_folder && with_folders {
            folders.extend(list_into(&entry.path(), &format!("{shown}/"), with_folders, files)?);
        } else if is_folder {
            folders.push(shown);
        }
    }
    folders.sort();
    Ok(folders)
}

/// Whether a file can't be anything but poses, by its ending. JSON may be anything.
fn is_pose_file(name: &str) -> bool {
    let is_of = |format: &&Format| format.endings.contains(&&*formats::extension(name));
    let of_poses = |format: &&&Format| matches!(format.reader, Reader::Poses(_)) && **format != &formats::poses::JSON;
    FORMATS.iter().filter(of_poses).any(is_of)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder(names: &[&str]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().expect("a temporary folder");
        names.iter().for_each(|name| std::fs::write(folder.path().join(name), "").expect("written"));
        folder
    }

    fn pose_file(names: &[&str]) -> PoseFile {
        let rows = "1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";
        let text: String = names.iter().map(|name| format!("{name}\n{rows}")).collect();
        formats::poses::read("poses.txt", text.as_bytes()).expect("sound")
    }

    #[test]
    fn droppings_are_passed_over_and_other_formats_are_mentioned() {
        let folder = folder(&["a10.ply", "a9.PCD", "._a9.PCD", ".b.ply", "c.jpg", "d.csv", "e.doc", "README"]);
        let list = Folder::list(folder.path()).expect("listed");
        assert_eq!(list.choose(None, None, None).expect("two scans"), ["a9.PCD", "a10.ply"]);
        assert_eq!(list.choose(Some("*"), None, None).expect("a glob").len(), 6, "all but the hidden ones");
        let expected = [
            "2 files are passed over, since what is hidden is none of a set: ._a9.PCD, .b.ply",
            "1 file is passed over, since text may be anything, and there are other scans (--scans takes it): d.csv",
            "2 files are passed over, since that format is not read: c.jpg, e.doc",
        ];
        assert_eq!(list.passed_over(None), expected);
    }

    #[test]
    fn folders_are_looked_into_where_there_is_nothing_beside_them() {
        let place = folder(&["readme.md"]);
        for (sub, name) in [("front", "a.ply"), ("back/far", "a.ply"), (".git", "b.ply")] {
            std::fs::create_dir_all(place.path().join(sub)).expect("made");
            std::fs::write(place.path().join(sub).join(name), "").expect("written");
        }
        let list = Folder::list(place.path()).expect("listed");
        assert_eq!(list.choose(None, None, None).expect("two"), ["back/far/a.ply", "front/a.ply"]);
        std::fs::write(place.path().join("c.ply"), "").expect("written");
        let list = Folder::list(place.path()).expect("listed");
        assert_eq!(list.choose(None, None, None).expect("one"), ["c.ply"]);
        let note = "2 folders are not looked into, since there are scans beside them: back, front";
        assert_eq!(list.passed_over(None).last().map(String::as_str), Some(note));
    }

    #[test]
    fn an_exact_name_fits_itself_and_a_glob_that_fits_nothing_is_shown() {
        let folder = folder(&["scan[00].ply", "scan_01.ply"]);
        let list = Folder::list(folder.path()).expect("listed");
        assert_eq!(list.choose(Some("scan[00].ply"), None, None).expect("itself"), ["scan[00].ply"]);
        let error = list.choose(Some("scan[12].ply"), None, None).expect_err("none").to_string();
        assert!(error.contains("fits --scans 'scan[12].ply'"), "{error}");
    }

    #[test]
    fn packed_scans_are_scans_and_archives_are_to_be_unpacked() {
        let list = |names: &[&str]| Folder::list(folder(names).path()).expect("listed").choose(None, None, None);
        assert_eq!(list(&["a.ply.gz", "b.PLY.GZ", "c.ply"]).expect("three"), ["a.ply.gz", "b.PLY.GZ", "c.ply"]);
        let error = list(&["a.zip", "b.ply.xz"]).expect_err("none").to_string();
        assert!(error.ends_with("; 2 files are packed: unpack them, or give a.zip itself)"), "{error}");
        assert!(error.contains(&format!("(read are: {};", formats::surface_endings().join(", "))), "{error}");
    }

    #[test]
    fn files_that_may_be_anything_are_scans_where_there_are_no_others() {
        let list = |names: &[&str]| Folder::list(folder(names).path()).expect("listed").choose(None, None, None);
        assert_eq!(list(&["a.ply", "poses.txt", "times.csv"]).expect("one"), ["a.ply"]);
        assert_eq!(list(&["a.txt", "b.csv.gz"]).expect("two"), ["a.txt", "b.csv.gz"]);
    }

    #[test]
    fn poses_must_fit_and_nearly_the_same_names_do() {
        let folder = folder(&["a.ply", "b.ply"]);
        let list = Folder::list(folder.path()).expect("listed");
        let poses = list.fit(None, pose_file(&["./b.ply", "A"])).expect("clear");
        assert_eq!(list.choose(None, Some(&poses), None).expect("both"), ["b.ply", "a.ply"]);
        let poses = list.fit(None, pose_file(&["0.ply"])).expect("clear");
        let error = list.choose(None, Some(&poses), None).expect_err("there is none").to_string();
        assert!(error.starts_with("the pose file names scans that are not in"), "{error}");
        let error = list.choose(Some("*.ply"), Some(&poses), None).expect_err("fits nothing").to_string();
        assert_eq!(error, "the pose file names none of the scans: it names 0.ply, not a.ply");
    }

    #[test]
    fn poses_without_names_go_to_the_scans_that_are_chosen() {
        let folder = folder(&["s10.ply", "s9.ply", "other.ply"]);
        let list = Folder::list(folder.path()).expect("listed");
        let line = "1 0 0 4 0 1 0 5 0 0 1 6\n";
        let file = || formats::poses::read("poses.txt", line.repeat(2).as_bytes()).expect("sound");
        let poses = list.fit(Some("s*.ply"), file()).expect("as many");
        assert_eq!(list.choose(Some("s*.ply"), Some(&poses), None).expect("both"), ["s9.ply", "s10.ply"]);
        let error = list.fit(None, file()).expect_err("one scan more").to_string();
        assert!(error.contains("2 pose(s) for 3 scan(s)"), "{error}");
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_name_that_is_no_utf8_is_said() {
        use std::os::unix::ffi::OsStrExt;
        let folder = folder(&["a.ply"]);
        let name = std::ffi::OsStr::from_bytes(b"b\xfcste.ply");
        std::fs::write(folder.path().join(name), "").expect("written");
        let error = Folder::list(folder.path()).expect("listed").choose(None, None, None).expect_err("refused");
        assert!(error.to_string().ends_with("is no UTF-8: rename the file"), "{error}");
    }
}
