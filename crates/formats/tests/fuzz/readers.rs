//! The readers: what makes their seeds, and how they are called.

use std::collections::BTreeSet;

use visage_formats::archive::{self, ArchiveLimits};
use visage_formats::depth_image::{self, Intrinsics};
use visage_formats::{FORMATS, obj_textures, poses, read};

use super::bounds::LIMITS;
use super::check::{self, REFUSED};
use super::seeds::{self, Seed, archives, beside, binary, lidar, meshes, packed, text};
use super::words::{COLUMNS, E57, GLTF, LAS, NPY, OBJ, PCD, PLY, POSES, STL, THREEMF, VTK};

/// A reader and what it is tried with.
pub struct Target {
    /// What it is called here: the ending of its files, or what it reads.
    pub name: &'static str,
    /// Sound files.
    pub seeds: fn() -> Vec<Seed>,
    /// Words that its format knows.
    pub words: &'static [&'static str],
    /// Reads a file by its name, and says what came of it.
    pub read: fn(&str, &[u8]) -> String,
}

/// All of them. Those of formats are called as their files end.
pub const READERS: &[Target] = &[
    Target { name: "ply", seeds: meshes::ply, words: PLY, read: surface },
    Target { name: "pcd", seeds: binary::pcd, words: PCD, read: surface },
    Target { name: "obj", seeds: meshes::obj, words: OBJ, read: surface },
    Target { name: "stl", seeds: meshes::stl, words: STL, read: surface },
    Target {
        name: "off",
        seeds: meshes::off,
        words: &["OFF", "COFF", "NOFF", "STOFF", "4OFF", "nOFF", "BINARY"],
        read: surface,
    },
    Target { name: "xyz", seeds: text::xyz, words: COLUMNS, read: surface },
    Target { name: "xyzn", seeds: text::xyzn, words: COLUMNS, read: surface },
    Target { name: "xyzrgb", seeds: text::xyzrgb, words: COLUMNS, read: surface },
    Target { name: "pts", seeds: text::pts, words: COLUMNS, read: surface },
    Target { name: "ptx", seeds: text::ptx, words: &["1 0 0 0", "0 0 0 1", "0 0 0"], read: surface },
    Target { name: "vtk", seeds: meshes::vtk, words: VTK, read: surface },
    Target { name: "npy", seeds: binary::npy, words: NPY, read: surface },
    Target { name: "npz", seeds: packed::npz, words: NPY, read: surface },
    Target { name: "bin", seeds: binary::kitti, words: &[], read: surface },
    Target { name: "3d", seeds: text::uos, words: COLUMNS, read: surface },
    Target { name: "glb", seeds: packed::glb, words: GLTF, read: surface },
    Target { name: "gltf", seeds: packed::gltf, words: GLTF, read: surface },
    Target { name: "3mf", seeds: packed::threemf, words: THREEMF, read: surface },
    Target { name: "e57", seeds: lidar::e57, words: E57, read: surface },
    Target { name: "las", seeds: lidar::las, words: LAS, read: surface },
    Target { name: "laz", seeds: lidar::laz, words: LAS, read: surface },
    Target { name: "gz", seeds: packed::gz, words: PLY, read: surface },
    Target {
        name: "archive",
        seeds: archives::all,
        words: &["../", "/", "__MACOSX/", "PK\u{1}\u{2}", "ustar"],
        read: archive_files,
    },
    Target {
        name: "depth",
        seeds: beside::depth,
        words: &["IHDR", "IDAT", "PLTE", "tRNS", "IEND", "acTL", "iCCP"],
        read: depth,
    },
    Target {
        name: "layout",
        seeds: beside::layout,
        words: &["depth/", "_Depth.png", "depth_", ".png", "depth.txt", "\\"],
        read: layout,
    },
    Target {
        name: "intrinsics",
        seeds: beside::intrinsics,
        words: &["fx", "K", "intrinsic_matrix", "width", "null"],
        read: intrinsics,
    },
    Target { name: "textures", seeds: beside::textures, words: OBJ, read: textures },
    Target { name: "poses", seeds: seeds::poses::all, words: POSES, read: pose_file },
    Target { name: "matrices", seeds: seeds::poses::folder, words: POSES, read: pose_folder },
];

/// Every format, kind of poses, archive and layout of depth images has a seed.
pub fn check_table() {
    let names: BTreeSet<&str> = READERS.iter().map(|target| target.name).collect();
    assert_eq!(names.len(), READERS.len(), "two readers have one name");
    for format in FORMATS.iter().filter(|format| format.is_surface()) {
        assert!(names.contains(format.ending()), "{} is not tried: it needs a line in READERS", format.name);
    }
    let kinds: BTreeSet<&str> = seeds::poses::all()
        .iter()
        .map(|seed| poses::read_scaled(&seed.name, &seed.bytes).expect(&seed.name).kind)
        .collect();
    for kind in poses::KINDS {
        assert!(kinds.contains(kind.name), "poses of the kind {} have no seed", kind.name);
    }
}

fn surface(name: &str, bytes: &[u8]) -> String {
    check::reading(read(name, bytes, &LIMITS))
}

fn archive_files(name: &str, bytes: &[u8]) -> String {
    let limits =
        ArchiveLimits { max_entries: 200, max_file_bytes: LIMITS.max_bytes, max_total_bytes: LIMITS.max_bytes };
    let mut total = 0;
    let each = archive::each(name, bytes, &limits, |entry| {
        total += entry.bytes.len();
        let is_inside = |part: &str| !part.is_empty() && part != ".." && part != "." && !part.contains(['\\', '\0']);
        assert!(entry.path.split('/').all(is_inside), "{:?}", entry.path);
        Ok(())
    });
    match each {
        Ok(passed_over) => {
            assert!(total as u64 <= limits.max_total_bytes && passed_over.len() as u64 <= limits.max_entries);
            let why: BTreeSet<&str> = passed_over.into_iter().map(|(_, why)| why).collect();
            format!("read: {why:?}")
        }
        Err(error) => check::refusal(&error),
    }
}

/// A depth image and, behind the mark between parts, a picture.
fn depth(_: &str, bytes: &[u8]) -> String {
    const CAMERA: Intrinsics = Intrinsics { size: Some((8, 6)), fx: 8.0, fy: 8.0, cx: 3.5, cy: 2.5 };
    let parts = beside::parts(bytes);
    check::reading(depth_image::read(parts[0], &CAMERA, 1000.0, parts.get(1).copied(), &LIMITS))
}

fn layout(folder: &str, bytes: &[u8]) -> String {
    let text = String::from_utf8_lossy(bytes);
    let names: Vec<&str> = text.lines().collect();
    match depth_image::layout(folder, &names) {
        Some(layout) => {
            assert!(!layout.frames.is_empty() && layout.per_metre > 0.0);
            assert!(layout.frames.iter().all(|frame| names.contains(&frame.depth.as_str())));
            format!("read: {}", layout.name)
        }
        None => format!("{REFUSED}none"),
    }
}

fn intrinsics(name: &str, bytes: &[u8]) -> String {
    match depth_image::read_intrinsics(name, bytes) {
        Ok(camera) => {
            assert!([camera.fx, camera.fy, camera.cx, camera.cy].iter().all(|x| x.is_finite()) && camera.fx > 0.0);
            format!("read: {}", camera.size.is_some())
        }
        Err(error) => check::refusal(&error),
    }
}

/// An OBJ file, its materials and a picture.
fn textures(_: &str, bytes: &[u8]) -> String {
    let parts = beside::parts(bytes);
    let resolve = |path: &str| {
        let part = if path.ends_with("mtl") { parts.get(1) } else { parts.get(2) };
        part.map(|bytes| std::borrow::Cow::Borrowed(*bytes))
    };
    check::reading(obj_textures::read(parts[0], &LIMITS, &resolve))
}

fn pose_file(name: &str, bytes: &[u8]) -> String {
    poses_answer(poses::read_scaled(name, bytes))
}

/// A file a scan, with the mark between them.
fn pose_folder(_: &str, bytes: &[u8]) -> String {
    let names: Vec<String> = (0..9).map(|k| format!("scan{k:03}.txt")).collect();
    let files: Vec<(&str, &[u8])> = names.iter().map(String::as_str).zip(beside::parts(bytes)).collect();
    poses_answer(poses::read_folder(&files))
}

fn poses_answer(result: Result<poses::PoseFile, visage_formats::FormatError>) -> String {
    match result {
        Ok(file) => {
            let is_sound = |pose: &visage_geometry::Motion| pose.to_homogeneous().iter().all(|x| x.is_finite());
            assert!(file.poses.iter().all(|(_, pose)| is_sound(pose)) && file.scales.values().all(|s| s.is_finite()));
            let read = format!("read: {} {:?} {:?}", file.kind, file.naming, file.notes());
            match file.named_as(&["scan 0.ply", "scan 1.ply", "a"]) {
                Ok(named) => format!("{read} {:?}", named.notes()),
                Err(error) => format!("{read} {}", check::refusal(&error)),
            }
        }
        Err(error) => check::refusal(&error),
    }
}
