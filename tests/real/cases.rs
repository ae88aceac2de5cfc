//! The folder of cases that others have met: one row a case, with what it is to give. `VISAGE_CASES` names the folder, else
//! it is `../cases` seen from `VISAGE_DATA`. A case without a row fails the test.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

use visage::faces::{self, MatchMethod, standard};
use visage::formats::{self, ReadLimits, Reading, poses};
use visage::gallery::evidence::Evidence;
use visage::geometry::{Motion, Unit};
use visage::progress::Progress;

use crate::{data, read};

/// What a case is looked at for.
enum Look {
    /// The first scan of the folder, or the named file, is read.
    Read(Reads),
    /// The pose file is read, and its poses are near the true ones of the scans beside it.
    Poses(&'static str),
    /// `visage register FOLDER ARGUMENTS`; `@` in an argument stands for the folder.
    Register(&'static [&'static str], fn(&Run)),
    /// The files are asked whether they show a face, in millimetres.
    Face(&'static [&'static str], fn(&Evidence)),
    /// It needs a server, other programs or other rights: the test named does what it describes.
    Elsewhere(&'static str),
}

/// What a file is to give. The reference is a scan of 7991 coloured points.
struct Reads {
    file: Option<&'static str>,
    points: usize,
    /// Whether the colours are those of the reference.
    colors: bool,
    faces: usize,
    /// A part of what is said of it, if anything is.
    said: &'static str,
}

const WHOLE: Reads = Reads { file: None, points: 7991, colors: true, faces: 0, said: "" };
const PLAIN: Reads = Reads { colors: false, ..WHOLE };

/// A run of the program.
struct Run {
    folder: PathBuf,
    succeeded: bool,
    /// Both streams.
    said: String,
    poses: BTreeMap<String, Motion>,
}

impl Run {
    fn says(&self, words: &str) {
        assert!(self.said.contains(words), "{}: {words:?} is not in\n{}", self.folder.display(), self.said);
    }

    fn refused(&self, words: &str) {
        assert!(!self.succeeded, "{}: {}", self.folder.display(), self.said);
        self.says(words);
    }

    fn placed(&self, count: usize) {
        assert_eq!(self.poses.len(), count, "{}: {}", self.folder.display(), self.said);
    }

    /// How far points of a scan are off beside those of the first, against the true poses (root mean square).
    fn error(&self, scan: &str) -> f64 {
        let truth = truth();
        let (first, found) = (&self.poses["scan_00.ply"], &self.poses[scan]);
        let off = (truth["scan_00.ply"].inverse() * truth[scan]).inverse() * (first.inverse() * found);
        let points = surface(&self.folder.join(scan)).surface.cloud.points;
        let squares = points.iter().step_by(17).map(|point| (off * point - point).norm_squared());
        let count = points.iter().step_by(17).count();
        (squares.sum::<f64>() / count as f64).sqrt()
    }
}

/// Everything was read and all scans found their places.
fn all_three(run: &Run) {
    run.placed(3);
}

const REFERENCE: &str = "_reference";

/// A row for each folder.
const CASES: &[(&str, Look)] = &[
    ("dir-appledouble", Look::Register(&["--unit", "mm"], all_three)),
    ("dir-brackets", Look::Register(&["--scans", "scan[00].ply"], |run| run.refused("1 scan(s) given"))),
    ("dir-gz", Look::Register(&["--unit", "mm"], all_three)),
    ("dir-latin1-name", Look::Register(&["--unit", "mm"], |run| run.refused("no UTF-8"))),
    ("dir-other-formats", Look::Register(&["--unit", "mm"], other_formats)),
    ("dir-out-is-dir", Look::Register(&["--out", "@"], |run| run.refused("is the folder of the scans"))),
    ("dir-out-is-file", Look::Register(&["--out", "@/out"], |run| run.refused("is a file"))),
    ("face-metres-sent-as-mm", Look::Face(&["head_in_metres.ply"], told_its_size)),
    (
        "face-one-far-point",
        Look::Face(&["head.ply", "head_and_one_point_10_m_away.ply", "head_and_20_points_10_m_away.ply"], |evidence| {
            assert!(evidence.verdict.score > 0.9, "{:?}", evidence.verdict)
        }),
    ),
    ("http-db-locked", Look::Elsewhere("tests/api/storage.rs")),
    ("http-disk-full-poisons-writer", Look::Elsewhere("tests/api/long/full_disk.rs")),
    ("http-file-names", Look::Elsewhere("tests/api/archives.rs")),
    ("obj-bom-first-vertex", Look::Read(PLAIN)),
    ("obj-cr-only", Look::Read(PLAIN)),
    ("obj-face-one-bad", Look::Read(Reads { faces: ANY, said: "triangles without their vertices", ..PLAIN })),
    ("obj-forward-reference", Look::Read(Reads { faces: ANY, ..PLAIN })),
    ("obj-line-continuation", Look::Read(Reads { faces: 2, ..PLAIN })),
    ("obj-missing-vn", Look::Read(Reads { faces: ANY, ..PLAIN })),
    // refused with the remedy, as the README allows
    ("obj-utf16", Look::Read(Reads { points: 0, said: "the text is UTF-16; save the file as UTF-8", ..PLAIN })),
    ("obj-v-nan", Look::Read(Reads { points: 7103, said: "without a return", ..PLAIN })),
    ("obj-vn-after-f", Look::Read(Reads { faces: ANY, ..PLAIN })),
    ("obj-vn-nan", Look::Read(Reads { faces: ANY, ..PLAIN })),
    ("obj-vn-nan-ind", Look::Read(Reads { faces: ANY, ..PLAIN })),
    ("pcd-comment-after-values", Look::Read(PLAIN)),
    ("pcd-inf", Look::Read(Reads { points: 6849, said: "without a return", ..PLAIN })),
    ("pcd-organised-nan", Look::Register(&["--unit", "mm"], |run| run.placed(8))),
    ("pcd-organised-zeros", Look::Register(&["--unit", "mm"], zeros)),
    ("pcd-r-g-b-u1", Look::Read(WHOLE)),
    ("pcd-rgb-nan", Look::Read(Reads { said: "without a sound colour", ..PLAIN })),
    ("pcd-viewpoint-identity", Look::Register(&["--unit", "mm"], all_three)),
    ("pcd-viewpoint-is-a-pose", Look::Register(&["--unit", "mm"], all_three)),
    ("pcd-width-0-height", Look::Read(PLAIN)),
    ("ply-ascii-all-on-one-line", Look::Read(PLAIN)),
    ("ply-ascii-row-over-lines", Look::Read(WHOLE)),
    ("ply-bom", Look::Read(WHOLE)),
    ("ply-colour-float-0-255", Look::Read(WHOLE)),
    ("ply-colour-rgb-names", Look::Read(WHOLE)),
    ("ply-colour-ushort16", Look::Read(WHOLE)),
    ("ply-face-name-vertexIndices", Look::Read(Reads { faces: 100, ..PLAIN })),
    ("ply-face-one-bad-index", Look::Read(Reads { faces: 99, said: "triangles without their vertices", ..PLAIN })),
    ("ply-grid-mismatch", Look::Read(Reads { points: 4, said: "grid", ..PLAIN })),
    ("ply-header-crlf-but-endheader-lf", Look::Read(WHOLE)),
    ("ply-header-lf-cr", Look::Read(PLAIN)),
    ("ply-header-mixed-ends-crlf-then-lf-comment", Look::Read(WHOLE)),
    ("ply-int64-property", Look::Read(PLAIN)),
    ("ply-msvc-nan-tokens", Look::Read(PLAIN)),
    ("ply-nan-intensity", Look::Read(Reads { said: "without a sound intensity", ..WHOLE })),
    ("ply-nan-normals", Look::Read(Reads { said: "without a sound normal", ..WHOLE })),
    ("ply-nan-vertices", Look::Read(Reads { points: 6393, said: "without a return", ..PLAIN })),
    ("ply-tristrips", Look::Read(Reads { file: Some("face_tristrips.ply"), points: ANY, faces: 11_650, ..PLAIN })),
    ("ply-zeros-for-invalid", Look::Register(&["--unit", "mm", "--poses", "@/poses.json"], zeros)),
    ("poses-3x4-json", Look::Poses("poses.json")),
    ("poses-3x4-text", Look::Poses("poses.txt")),
    ("poses-case-differs", Look::Poses("poses.json")),
    ("poses-cloudcompare-matrix", Look::Register(&["--unit", "mm", "--poses", "@"], all_three)),
    ("poses-colmap", Look::Poses("images.txt")),
    ("poses-dot-slash", Look::Poses("poses.json")),
    ("poses-kitti", Look::Poses("poses.txt")),
    ("poses-meshlab-aln", Look::Poses("project.aln")),
    ("poses-meshlab-mlp", Look::Poses("project.mlp")),
    // its camera axes are told by the surfaces alone
    ("poses-nerf-transforms", Look::Register(&["--unit", "mm", "--poses", "@/transforms.json"], all_three)),
    ("poses-nfc-nfd", Look::Poses("poses.json")),
    ("poses-no-extension", Look::Poses("poses.json")),
    ("poses-open3d-log", Look::Poses("trajectory.log")),
    ("poses-open3d-posegraph", Look::Poses("pose_graph.json")),
    ("poses-rounded-2-decimals", Look::Poses("poses.txt")),
    ("poses-rounded-3-decimals", Look::Poses("poses.txt")),
    ("poses-text-commas", Look::Poses("poses.txt")),
    ("poses-tum", Look::Poses("traj.txt")),
    ("poses-windows-path", Look::Poses("poses.json")),
    ("reg-duplicate-scan", Look::Register(&["--unit", "mm"], duplicate)),
    ("reg-mixed-units", Look::Register(&["--unit", "mm"], mixed_units)),
    ("reg-repeated-points", Look::Register(&["--unit", "mm", "--poses", "@/poses.json"], repeated)),
    ("reg-triangle-soup", Look::Register(&["--unit", "mm", "--poses", "@/poses.json"], soup)),
    ("reg-utm-float", Look::Register(&["--unit", "m"], rounded)),
    ("service", Look::Elsewhere("tests/api: storage, pressure, hosts, slow, long/full_disk")),
];

/// As many as there are.
const ANY: usize = usize::MAX;

fn other_formats(run: &Run) {
    // since it was written, all three formats are read: two of the files are stubs, which is said of the first
    run.refused("scan_0");
}

fn zeros(run: &Run) {
    run.placed(8);
    run.says("quality good");
    run.says("points where nothing was seen");
}

fn told_its_size(evidence: &Evidence) {
    assert!(!evidence.is_match());
    let doubt = evidence.size_in_doubt.as_deref().expect("its size is in doubt");
    // the README measures the height, 0.3 mm; what is known of a model is its diagonal
    assert!(doubt.starts_with("its diagonal is 0.46 mm in the unit given") && doubt.contains("456 mm in m"), "{doubt}");
}

fn duplicate(run: &Run) {
    run.says("a copy bears out nothing");
    // the README saw three scans that were doubtful by themselves: now they are good, with and without the copy
    let alone = register(&run.folder, &["--unit", "mm", "--scans", "scan_0?.ply"]);
    let quality = |run: &Run| {
        run.said.lines().find_map(|line| line.strip_prefix("quality ")?.split(':').next().map(str::to_owned))
    };
    assert_eq!(quality(run), quality(&alone));
}

fn mixed_units(run: &Run) {
    run.says("scan_00.ply is about 1000 times smaller than the others");
    run.says("metres among millimetres?");
    run.says(r#"{"units": {"scan_00.ply": "m"}}"#);
    // corrected when it is asked for: all scans find their places, and that of the odd one holds the scale
    let mended = register(&run.folder, &["--unit", "mm", "--unit-of", "scan_00.ply=m"]);
    mended.says("scan_00.ply is in m, as was said");
    assert!(!mended.said.contains("without a place"), "{}", mended.said);
}

fn repeated(run: &Run) {
    for scan in ["scan_01.ply", "scan_02.ply"] {
        assert!(run.error(scan) < 0.06, "{scan}: {}", run.error(scan));
    }
}

fn soup(run: &Run) {
    run.placed(8);
    for scan in 1..8 {
        let scan = format!("scan_{scan:02}.ply");
        assert!(run.error(&scan) < 0.06, "{scan}: {}", run.error(&scan));
    }
}

fn rounded(run: &Run) {
    run.says("single precision rounds them");
    run.says("subtract an offset before the export");
}

fn cases() -> PathBuf {
    std::env::var_os("VISAGE_CASES").map_or_else(|| data("../cases"), PathBuf::from)
}

fn surface(path: &Path) -> Reading {
    let name = path.to_string_lossy();
    formats::read(&name, &read(path), &ReadLimits::default()).unwrap_or_else(|error| panic!("{name}: {error}"))
}

fn truth() -> BTreeMap<String, Motion> {
    let path = cases().join(REFERENCE).join("head_poses.json");
    poses::read("head_poses.json", &read(path)).expect("sound").to_map()
}

/// The scans of a folder by name.
fn scans(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let mut names: Vec<String> =
        entries.map(|entry| entry.expect("listed").file_name().to_string_lossy().into()).collect();
    names.retain(|name| formats::check_name(name).is_ok_and(|format| format.is_surface()) && !name.ends_with(".txt"));
    names.sort();
    names
}

fn register(folder: &Path, arguments: &[&str]) -> Run {
    let out = tempfile::tempdir().expect("a temporary folder");
    let arguments = arguments.iter().map(|argument| argument.replace('@', &folder.to_string_lossy()));
    let arguments: Vec<String> = arguments.collect();
    let mut command = Command::new(env!("CARGO_BIN_EXE_visage"));
    command.arg("register").arg(folder).args(["--no-cloud", "--no-signature", "--threads", "2"]).args(&arguments);
    if !arguments.iter().any(|argument| argument == "--out") {
        command.arg("--out").arg(out.path());
    }
    let done = command.output().expect("the program runs");
    let said = [String::from_utf8_lossy(&done.stdout), String::from_utf8_lossy(&done.stderr)].concat();
    let found = std::fs::read(out.path().join("poses.json")).ok();
    let found = found.map(|bytes| poses::read_scaled("poses.json", &bytes).expect("sound").to_map());
    Run { folder: folder.to_owned(), succeeded: done.status.success(), said, poses: found.unwrap_or_default() }
}

fn check_reading(folder: &Path, expected: &Reads) {
    let name = expected.file.map_or_else(|| scans(folder)[0].clone(), str::to_owned);
    let read = formats::read(&name, &read(folder.join(&name)), &ReadLimits::default());
    let place = folder.join(&name);
    let place = place.display();
    let reading = match read {
        Ok(reading) => reading,
        Err(error) => {
            assert!(expected.points == 0 && error.to_string().contains(expected.said), "{place}: {error}");
            return;
        }
    };
    let Reading { surface, dropped, .. } = reading;
    let is_as = |expected: usize, found: usize| expected == ANY || expected == found;
    assert!(is_as(expected.points, surface.cloud.len()), "{place}: {} points", surface.cloud.len());
    assert!(is_as(expected.faces, surface.faces.len()), "{place}: {} triangles", surface.faces.len());
    assert!(dropped.to_string().contains(expected.said), "{place}: {dropped}");
    let reference = self::surface(&cases().join(REFERENCE).join("scan_00.ply")).surface.cloud;
    if surface.cloud.len() == reference.len() {
        let off = surface.cloud.points.iter().zip(&reference.points).map(|(a, b)| (a - b).norm());
        assert!(off.fold(0.0, f64::max) < 1e-3, "{place}: coordinates differ");
    }
    if expected.colors {
        assert_eq!(surface.cloud.colors, reference.colors, "{place}");
    }
}

fn check_poses(folder: &Path, file: &str) {
    let names = scans(folder);
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let place = folder.join(file);
    let file = poses::read_scaled(file, &read(&place)).and_then(|file| file.named_as(&names));
    let found = file.unwrap_or_else(|error| panic!("{}: {error}", place.display())).to_map();
    let truth: Vec<Motion> = truth().into_values().collect();
    for (name, truth) in names.iter().zip(truth) {
        let pose = found.get(*name).unwrap_or_else(|| panic!("{}: no pose of {name}", place.display()));
        let off = (pose.translation.vector - truth.translation.vector).norm();
        let degrees = pose.rotation.angle_to(&truth.rotation).to_degrees();
        // they are a start
        assert!(off < 40.0 && degrees < 5.0, "{}: {name} is {off} and {degrees} off", place.display());
    }
}

fn check_face(folder: &Path, file: &str, expected: fn(&Evidence)) {
    let surface = surface(&folder.join(file)).surface;
    let signature = faces::describe(&surface, Unit::Mm, &Progress::silent()).expect("a surface");
    expected(&Evidence::new(&signature, &standard::face(), MatchMethod::default(), None));
}

#[test]
#[ignore = "needs VISAGE_DATA"]
fn every_case_gives_what_it_is_to_give() {
    let folder = cases();
    let there: BTreeSet<String> = std::fs::read_dir(&folder)
        .unwrap_or_else(|error| panic!("{}: {error}", folder.display()))
        .map(|entry| entry.expect("listed").file_name().to_string_lossy().into_owned())
        .filter(|name| name != REFERENCE)
        .collect();
    let rows: BTreeSet<String> = CASES.iter().map(|(name, _)| (*name).to_owned()).collect();
    assert_eq!(there, rows, "each case has a row");
    let mut failed = Vec::new();
    for (name, look) in CASES {
        let folder = folder.join(name);
        let check = std::panic::AssertUnwindSafe(|| match look {
            Look::Read(expected) => check_reading(&folder, expected),
            Look::Poses(file) => check_poses(&folder, file),
            Look::Register(arguments, expected) => expected(&register(&folder, arguments)),
            Look::Face(files, expected) => files.iter().for_each(|file| check_face(&folder, file, *expected)),
            Look::Elsewhere(test) => println!("{name}: see {test}"),
        });
        let begin = std::time::Instant::now();
        // one that is wrong does not hide the others
        if std::panic::catch_unwind(check).is_err() {
            failed.push(*name);
        }
        println!("{name}: {:.1} s", begin.elapsed().as_secs_f64());
    }
    assert!(failed.is_empty(), "{failed:?}");
}
