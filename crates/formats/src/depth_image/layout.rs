//! Which files of a folder are depth images, and what belongs to each: as Open3D, TUM RGB-D, RealSense and phones lay
//! them out.

use std::collections::BTreeMap;

use super::Intrinsics;

/// The depth images of a folder.
#[derive(Debug, Clone, PartialEq)]
pub struct Layout {
    /// Whose layout it is.
    pub name: &'static str,
    /// Depth values of a metre.
    pub per_metre: f64,
    /// The images, in natural order.
    pub frames: Vec<Frame>,
}

/// One depth image.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// The depth image, as it was named.
    pub depth: String,
    /// The picture of the same view, a PNG, if there is one.
    pub picture: Option<String>,
    /// Its intrinsics.
    pub intrinsics: IntrinsicsOf,
}

/// Where intrinsics are from.
#[derive(Debug, Clone, PartialEq)]
pub enum IntrinsicsOf {
    /// From this file.
    File(String),
    /// Those that are published of the camera that the names tell.
    Known(Intrinsics),
    /// There are none in the folder.
    Missing,
}

/// Most cameras write millimetres.
const MILLIMETRES: f64 = 1000.0;
/// What the TUM RGB-D benchmark writes.
const TUM: f64 = 5000.0;
/// Files with the intrinsics of all images.
const SHARED: &[&str] = &[
    "camera_intrinsic.json",
    "camera_intrinsics.json",
    "intrinsic.json",
    "intrinsics.json",
    "depth_intrinsics.json",
    "camera.json",
    "camera_matrix.csv",
    "intrinsics.txt",
    "camera_intrinsic.txt",
    "calibration.txt",
    "metadata.json",
];
/// Folders of pictures beside a folder of depth images.
const PICTURES: &[&str] = &["color", "colour", "image", "images", "rgb"];
/// The cameras of the TUM RGB-D benchmark, by what names say (from its documentation).
const FREIBURG: [(&str, [f64; 4]); 3] = [
    ("freiburg1", [517.3, 516.5, 318.6, 255.3]),
    ("freiburg2", [520.9, 521.0, 325.1, 249.7]),
    ("freiburg3", [535.4, 539.2, 320.1, 247.6]),
];

/// How a name tells a depth image, and how the names of its own files follow.
struct Naming {
    name: &'static str,
    /// The stem of a depth image, without the part that says so; the same for its files.
    stem: fn(&str) -> Option<String>,
    picture: fn(&str) -> Vec<String>,
    intrinsics: fn(&str) -> Vec<String>,
}

/// The depth images of a folder: `folder` is its name, `names` are its files, in subfolders as `depth/000000.png`.
///
/// `None` if there are none, or nothing but their names tells so.
pub fn layout(folder: &str, names: &[&str]) -> Option<Layout> {
    let by_name: BTreeMap<String, &str> = names.iter().map(|name| (name.replace('\\', "/"), *name)).collect();
    let has = |name: &str| by_name.contains_key(name);
    let shared = SHARED.iter().find(|name| has(name)).map(|name| (*name).to_owned());
    let is_tum = has("depth.txt");
    let known = FREIBURG.iter().find(|(name, _)| is_tum && folder.to_lowercase().contains(name)).map(
        |(_, [fx, fy, cx, cy])| {
            let (fx, fy, cx, cy) = (*fx, *fy, *cx, *cy);
            IntrinsicsOf::Known(Intrinsics { size: Some((640, 480)), fx, fy, cx, cy })
        },
    );
    for naming in NAMINGS {
        let mut frames: Vec<Frame> = by_name
            .keys()
            .filter_map(|name| {
                let stem = (naming.stem)(name)?;
                let first = |names: Vec<String>| names.into_iter().find(|name| has(name));
                let own = first((naming.intrinsics)(&stem)).or_else(|| shared.clone()).map(IntrinsicsOf::File);
                Some(Frame {
                    depth: by_name[name].to_owned(),
                    picture: first((naming.picture)(&stem)).map(|name| by_name[&name].to_owned()),
                    intrinsics: own.or_else(|| known.clone()).unwrap_or(IntrinsicsOf::Missing),
                })
            })
            .collect();
        // a name alone is no proof: PNG files may be pictures of depths
        let is_sure = is_tum || frames.iter().any(|frame| frame.intrinsics != IntrinsicsOf::Missing);
        if frames.is_empty() || !is_sure {
            continue;
        }
        frames.sort_by(|a, b| natord::compare(&a.depth, &b.depth));
        let name = match naming.name {
            "depth folder" if is_tum => "TUM RGB-D",
            "depth folder" if shared.as_deref() == Some("camera_matrix.csv") => "Stray Scanner",
            "depth folder" => "Open3D",
            name => name,
        };
        return Some(Layout { name, per_metre: if is_tum { TUM } else { MILLIMETRES }, frames });
    }
    None
}

const NAMINGS: [Naming; 3] = [
    Naming {
        name: "depth folder",
        stem: |name| png(name.strip_prefix("depth/")?).filter(|stem| !stem.contains('/')),
        picture: |stem| PICTURES.iter().map(|folder| format!("{folder}/{stem}.png")).collect(),
        intrinsics: |stem| ["depth", "camera", "intrinsics"].map(|folder| format!("{folder}/{stem}.json")).to_vec(),
    },
    Naming {
        name: "RealSense",
        stem: |name| png(name)?.strip_suffix("_Depth").map(str::to_owned),
        picture: |stem| vec![format!("{stem}_Color.png")],
        intrinsics: |stem| {
            vec![format!("{stem}_Depth_metadata.csv"), format!("{stem}_metadata.csv"), format!("{stem}.json")]
        },
    },
    Naming {
        name: "3D Scanner App",
        stem: |name| png(name)?.strip_prefix("depth_").map(str::to_owned),
        picture: |stem| vec![format!("frame_{stem}.png")],
        intrinsics: |stem| vec![format!("frame_{stem}.json")],
    },
];

/// The name of a PNG without its ending.
fn png(name: &str) -> Option<String> {
    let (stem, ending) = name.rsplit_once('.')?;
    ending.eq_ignore_ascii_case("png").then(|| stem.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(folder: &str, names: &[&str]) -> Layout {
        layout(folder, names).unwrap_or_else(|| panic!("{names:?} are depth images"))
    }

    fn file(name: &str) -> IntrinsicsOf {
        IntrinsicsOf::File(name.to_owned())
    }

    #[test]
    fn depth_folders_are_told_apart_by_what_is_beside_them() {
        let frames = ["depth/10.png", "depth/9.png", "color/9.png", "color/10.jpg"];
        let open3d = of("scan", &[&frames[..], &["camera_intrinsic.json", "README"]].concat());
        assert_eq!((open3d.name, open3d.per_metre), ("Open3D", 1000.0));
        let [nine, ten] = open3d.frames.as_slice() else { panic!("two frames") };
        assert_eq!((nine.depth.as_str(), nine.picture.as_deref()), ("depth/9.png", Some("color/9.png")));
        assert_eq!((ten.picture.as_deref(), &ten.intrinsics), (None, &file("camera_intrinsic.json")));
        let tum = of("rgbd_dataset_freiburg2_desk", &["depth.txt", "depth/1.5.png", "rgb.txt"]);
        assert_eq!((tum.name, tum.per_metre), ("TUM RGB-D", 5000.0));
        assert!(matches!(tum.frames[0].intrinsics, IntrinsicsOf::Known(Intrinsics { fx: 520.9, .. })));
        assert_eq!(of("desk", &["depth.txt", "depth/1.5.png"]).frames[0].intrinsics, IntrinsicsOf::Missing);
        let stray = of("x", &["depth\\000000.png", "camera_matrix.csv", "odometry.csv", "confidence/000000.png"]);
        assert_eq!((stray.name, stray.frames.len()), ("Stray Scanner", 1));
        assert_eq!(stray.frames[0].depth, "depth\\000000.png");
    }

    #[test]
    fn frames_with_files_of_their_own() {
        let realsense = of("x", &["a_Depth.png", "a_Color.png", "a_Depth_metadata.csv"]);
        assert_eq!((realsense.name, realsense.frames[0].picture.as_deref()), ("RealSense", Some("a_Color.png")));
        assert_eq!(realsense.frames[0].intrinsics, file("a_Depth_metadata.csv"));
        let phone = of("x", &["depth_00001.png", "frame_00001.json", "frame_00001.jpg", "info.json"]);
        assert_eq!((phone.name, &phone.frames[0].intrinsics), ("3D Scanner App", &file("frame_00001.json")));
    }

    #[test]
    fn other_folders_have_no_layout() {
        for names in [&["a.ply", "b.png"][..], &["depth/a.png"], &["a_Depth.png"], &["camera_intrinsic.json"], &[]] {
            assert_eq!(layout("depth", names), None, "{names:?}");
        }
    }
}
