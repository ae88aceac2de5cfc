//! The kinds of pose files, and how each is recognised: by what stands in it, since endings tell little.

use super::node::Node;
use super::{Fault, PoseFile, colmap, conf, json, lines, log, matrices, meshlab, quaternions, text, uos};
use crate::quote;

/// A kind of pose file.
pub struct Kind {
    /// What people call it.
    pub name: &'static str,
    /// How it looks.
    pub looks: &'static str,
    /// What its poses are, and whose.
    pub meaning: &'static str,
    content: Content,
}

/// What a kind is recognised by, and read by.
enum Content {
    Json { fits: fn(&Node) -> bool, read: fn(&Node) -> Result<PoseFile, Fault> },
    Text { fits: fn(&str) -> bool, read: fn(&str) -> Result<PoseFile, Fault> },
}

const BY_NAME: &str = "scan to world, by name";
const BY_ORDER: &str = "scan to world, by order";
const BY_FILE: &str = "scan to world, by the names of the files";

const FRAMES: &str = "3DTK `.frames`";
const START: &str = "3DTK `.pose`";
pub(super) const MATRICES: &str = "bare matrices";
/// Kinds of which programs write a file a scan. Where several are in a folder, the first counts: a registration's end
/// before its start.
pub(super) const OF_ONE_SCAN: [&str; 3] = [FRAMES, MATRICES, START];

/// Every kind of pose file, in the order in which they are tried.
pub const KINDS: &[Kind] = &[
    Kind {
        name: "Open3D pose graph",
        looks: "JSON with `nodes`, each with a `pose` of 16 numbers, column by column",
        meaning: BY_ORDER,
        content: Content::Json { fits: json::is_pose_graph, read: json::pose_graph },
    },
    Kind {
        name: "Open3D camera trajectory",
        looks: "JSON with `parameters`, each with an `extrinsic` of 16 numbers, column by column",
        meaning: "world to scan, inverted; by order",
        content: Content::Json { fits: json::is_trajectory, read: json::trajectory },
    },
    Kind {
        name: "NeRF `transforms.json`",
        looks: "JSON with `frames`, each with `file_path` and `transform_matrix`",
        meaning: "scan to world, by name; camera axes as the surfaces say",
        content: Content::Json { fits: json::is_transforms, read: json::transforms },
    },
    Kind {
        name: "JSON list of matrices",
        looks: "a list of 4x4 or 3x4 matrices (or `{\"poses\": [...]}`), or of objects with a name and a matrix",
        meaning: "scan to world, by name if there are names, else by order",
        content: Content::Json { fits: json::is_list, read: json::list },
    },
    Kind {
        name: "JSON by name",
        looks: "`{\"scan name\": matrix}` or `{\"poses\": {...}}`; 4x4 or 3x4, nested or flat; `null` for no pose",
        meaning: BY_NAME,
        content: Content::Json { fits: |node| matches!(node, Node::Map(_)), read: json::by_name },
    },
    Kind {
        name: "MeshLab project",
        looks: "XML (`.mlp`) with an `MLMesh` and an `MLMatrix44` a scan",
        meaning: BY_NAME,
        content: Content::Text { fits: |text| text.trim_start().starts_with('<'), read: meshlab::read_mlp },
    },
    Kind {
        name: "Stanford `.conf`",
        looks: "lines `bmesh FILE tx ty tz qx qy qz qw`",
        meaning: BY_NAME,
        content: Content::Text { fits: conf::fits, read: conf::read },
    },
    Kind {
        name: "MeshLab alignment",
        looks: "the number of scans, then for each its name, `#` and 4 rows (`.aln`)",
        meaning: BY_NAME,
        content: Content::Text { fits: meshlab::is_aln, read: meshlab::read_aln },
    },
    Kind {
        name: "Open3D trajectory",
        looks: "for each scan 3 whole numbers and 4 rows (`.log`)",
        meaning: BY_ORDER,
        content: Content::Text { fits: log::fits, read: log::read },
    },
    Kind {
        name: "COLMAP `images.txt`",
        looks: "lines `ID qw qx qy qz tx ty tz CAMERA NAME`, each followed by a line of points",
        meaning: "world to scan, inverted; by name",
        content: Content::Text { fits: colmap::fits, read: colmap::read },
    },
    Kind {
        name: "quaternion table",
        looks: "columns with a header that names `tx ty tz qx qy qz qw`, and `name` if there are names",
        meaning: "scan to world, by name if there are names, else by order",
        content: Content::Text { fits: quaternions::is_table, read: quaternions::read_table },
    },
    Kind {
        name: "TUM trajectory",
        looks: "lines `time tx ty tz qx qy qz qw`, or with a name instead of the time",
        meaning: "scan to world, by name or time, else by order",
        content: Content::Text { fits: quaternions::is_tum, read: quaternions::read_tum },
    },
    Kind {
        name: FRAMES,
        looks: "lines of a matrix column by column and a whole number, of which the last counts; one file a scan",
        meaning: BY_FILE,
        content: Content::Text { fits: uos::is_frames, read: uos::read_frames },
    },
    Kind {
        name: START,
        looks: "a line with a place and a line with three angles in degrees; one file a scan",
        meaning: BY_FILE,
        content: Content::Text { fits: uos::is_pose, read: uos::read_pose },
    },
    Kind {
        name: "KITTI poses",
        looks: "12 numbers a line (or 16), row by row; a name may stand before them",
        meaning: "scan to world, by name if there are names, else by order",
        content: Content::Text { fits: matrices::is_flat, read: matrices::read_flat },
    },
    Kind {
        name: MATRICES,
        looks: "4 rows of 4 numbers (or 3) a scan, nothing else; one file a scan (CloudCompare) or all in one",
        meaning: "scan to world, by the names of the files, else by order",
        content: Content::Text { fits: matrices::is_bare, read: matrices::read_bare },
    },
    Kind {
        name: "text blocks",
        looks: "for each scan a line with its name, then 4 rows of 4 numbers (or 3)",
        meaning: BY_NAME,
        content: Content::Text { fits: text::fits, read: text::read },
    },
];

/// Reads the text of a pose file by the first kind that it fits.
pub(super) fn read(text: &str) -> Result<PoseFile, Fault> {
    if lines::data(text).next().is_none() {
        return Err(Fault::file("there is no pose in it"));
    }
    let node = if looks_like_json(text) { Some(Node::read(text)?) } else { None };
    for kind in KINDS {
        let read = match (&kind.content, &node) {
            (Content::Json { fits, read }, Some(node)) if fits(node) => read(node),
            (Content::Text { fits, read }, None) if fits(text) => read(text),
            _ => continue,
        };
        return read.map(|file| PoseFile { kind: kind.name, ..file });
    }
    Err(match node {
        Some(_) => Fault::file("it is JSON, but neither an object nor a list of matrices"),
        None => unknown(text),
    })
}

/// The name of the kind of text that is no JSON.
pub(super) fn of_text(text: &str) -> Option<&'static str> {
    let kind = |kind: &&Kind| matches!(kind.content, Content::Text { fits, .. } if fits(text));
    if looks_like_json(text) { None } else { KINDS.iter().find(kind).map(|kind| kind.name) }
}

/// What numpy prints begins with brackets, too, but has no commas.
fn looks_like_json(text: &str) -> bool {
    let text = text.trim_start();
    let first = text.lines().next().unwrap_or_default();
    let is_printed = first.starts_with("[[") && !first.contains(',') && lines::count_numbers(first) == Some(4);
    text.starts_with(['{', '[']) && !is_printed
}

/// Says what stands in a text that is of no kind.
fn unknown(text: &str) -> Fault {
    let (index, line) = lines::data(text).next().unwrap_or_default();
    let seen = match lines::count_numbers(line) {
        Some(count) => format!("{count} number(s)"),
        None => format!("{} word(s)", lines::words(line).len()),
    };
    Fault::line(index, format!("{} begins no pose file that is read here: it has {seen}", quote(line.as_bytes())))
}

/// How a pose file may look, for messages.
pub fn remedy() -> String {
    "send JSON {\"scan name\": 4x4 row-major}, Stanford .conf, a name line and 4 rows for each scan, MeshLab .aln or .mlp, \
     a trajectory (TUM, KITTI, Open3D .log or JSON), 3DTK .pose or .frames, COLMAP images.txt, transforms.json or a table with a header"
        .to_owned()
}

/// The kinds as a table in Markdown, for the documentation.
pub fn markdown() -> String {
    let mut text = "| pose file | looks like | poses |\n| --- | --- | --- |\n".to_owned();
    for Kind { name, looks, meaning, .. } in KINDS {
        text.push_str(&format!("| {name} | {looks} | {meaning} |\n"));
    }
    text
}
