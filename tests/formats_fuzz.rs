//! Sound files of every format, changed at random but with their structure in mind: never a panic, no long wait, no
//! memory beyond the budget, and whatever is read is sound.
//!
//! A plain run tries a few thousand files; `VISAGE_FUZZ_SECONDS=600 cargo test --release --test formats_fuzz` goes on
//! for ten minutes. `VISAGE_FUZZ_SEED` begins elsewhere; a failure names the seed of its file.

use std::time::{Duration, Instant};

use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use visage::formats::depth_image::{self, Intrinsics};
use visage::formats::{self, FormatError, ReadLimits, Reading, poses};
use visage::geometry::{Cloud, MAX_COORDINATE, Mesh, Motion, Point3, RangeGrid, Vector3};

/// Files without a time budget.
const FILES: u64 = 4000;
/// One small file must not take longer.
const PATIENCE: Duration = Duration::from_secs(5);
/// What reading files of some kB under small limits may add to the process.
const MOST_GROWTH: u64 = 64 << 20;

/// The camera of the depth image.
const CAMERA: Intrinsics = Intrinsics { size: Some((8, 6)), fx: 8.0, fy: 8.0, cx: 3.5, cy: 2.5 };

const LIMITS: ReadLimits = ReadLimits { max_points: 5_000, max_faces: 10_000, max_bytes: 1 << 20 };

/// Where a scan of PTX is.
const PTX_PLACE: &str = "1 2 3\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n1 2 3 1\n";
const VTK_HEAD: &str = "# vtk DataFile Version 3.0\nt\nASCII\nDATASET POLYDATA\n";
const VTK_TAIL: &str = "POLYGONS 2 8\n3 0 1 6\n3 0 6 5\nTRIANGLE_STRIPS 1 5\n4 7 8 9 10\nPOINT_DATA 20\n\
    SCALARS intensity float 1\nLOOKUP_TABLE default\n0 1 2 3 4 5 6 7 8 9 0 1 2 3 4 5 6 7 8 9\n";
/// An array of 20 x 4 floats; the two bytes before the brace are the length of what follows.
const NPY_HEAD: &[u8] = b"\x93NUMPY\x01\0\x3f\0{'descr': '<f4', 'fortran_order': False, 'shape': (20, 4), }  \n";

/// A sound file of each kind, by the name that says how it is read.
fn seeds() -> Vec<(&'static str, Vec<u8>)> {
    let points: Vec<Point3> =
        (0..20).map(|k| Point3::new(f64::from(k % 5), f64::from(k / 5), 0.1 * f64::from(k))).collect();
    let cloud = Cloud {
        normals: Some(vec![nalgebra::Vector3::z(); 20]),
        colors: Some(vec![[1, 2, 3]; 20]),
        intensities: Some(vec![0.5; 20]),
        ..Cloud::from_points(points.clone())
    };
    let mesh = Mesh { vertices: points.clone(), faces: vec![[0, 1, 6], [0, 6, 5], [7, 8, 9]] };
    let rows = |write: &dyn Fn(&Point3) -> String| points.iter().map(write).collect::<String>();
    let xyz = rows(&|p| format!("{} {} {}\n", p.x, p.y, p.z));
    let colored = rows(&|p| format!("{} {} {} 0.5 0.25 1 7\n", p.x, p.y, p.z));
    let pcd_head = |data: &str| {
        format!(
            "VERSION 0.7\nFIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F U\nCOUNT 1 1 1 1\nWIDTH 5\nHEIGHT 4\n\
             VIEWPOINT 0 0 9 1 0 0 0\nPOINTS 20\nDATA {data}\n"
        )
    };
    let ply = |before: &str, after: &str, body: &str| {
        let xyz = "property float x\nproperty float y\nproperty float z\n";
        format!("ply\nformat ascii 1.0\n{before}element vertex 20\n{xyz}{after}end_header\n{body}").into_bytes()
    };
    let channels = "property float red\nproperty float green\nproperty float blue\nproperty int64 time\n";
    let strips = "element tristrips 1\nproperty list int int vertex_indices\n";
    let grid = "element range_grid 4\nproperty list uchar int vertex_indices\n";
    let obj = rows(&|p| format!("v {} {} {} 0.1 0.2 0.3\n", p.x, p.y, p.z)) + &"vn 0 0 1\n".repeat(20);
    let facet = |face: &[u32; 3]| {
        let corners = face.map(|vertex| points[vertex as usize]).map(|p| format!("vertex {} {} {}\n", p.x, p.y, p.z));
        format!("facet normal 0 0 1\nouter loop\n{}endloop\nendfacet\n", corners.concat())
    };
    let text_stl = format!("solid a\n{}endsolid a\n", mesh.faces.iter().map(facet).collect::<String>());
    let binary: Vec<u8> = points
        .iter()
        .flat_map(|p| [p.x, p.y, p.z].map(|x| (x as f32).to_le_bytes()).concat().into_iter().chain([1, 2, 3, 0]))
        .collect();
    let literal: Vec<u8> = binary.chunks(32).flat_map(|run| [&[run.len() as u8 - 1], run].concat()).collect();
    let sizes = [(literal.len() as u32).to_le_bytes(), (binary.len() as u32).to_le_bytes()].concat();
    let named: Vec<_> = (0..3)
        .map(|k| (format!("scan {k}.ply"), Some(Motion::new(Vector3::x() * f64::from(k), Vector3::y()))))
        .collect();
    let floats: Vec<u8> =
        points.iter().flat_map(|p| [p.x, p.y, p.z, 0.5]).flat_map(|x| (x as f32).to_le_bytes()).collect();
    let blocks = "a.ply\n1 0 0 1\n0 1 0 2\n0 0 1 3\n0 0 0 1\n# b\nb.ply\n1 0 0 1\n0 1 0 2\n0 0 1 3\n0 0 0 1\n";
    let frames = "{\"frames\": [{\"file_path\": \"a\", \"transform_matrix\": [[1,0,0,4],[0,1,0,5],[0,0,1,6]]}]}";
    vec![
        ("cloud.ply", formats::ply::write_cloud(&cloud, Some(&[0; 20]))),
        ("mesh.ply", formats::ply::write_mesh(&mesh)),
        ("text.ply", ply("", channels, &colored)),
        ("strips.ply", ply("", strips, &format!("{xyz}9 0 1 2 3 -1 4 5 6 7\n"))),
        ("grid.ply", ply("obj_info num_cols 2\nobj_info num_rows 2\n", grid, &format!("{xyz}1 0\n0\n1 1\n0\n"))),
        ("text.pcd", [pcd_head("ascii"), rows(&|p| format!("{} {} {} 66051\n", p.x, p.y, p.z))].concat().into_bytes()),
        ("binary.pcd", [pcd_head("binary").as_bytes(), &binary].concat()),
        ("packed.pcd", [pcd_head("binary_compressed").as_bytes(), &sizes, &literal].concat()),
        ("mesh.obj", format!("{obj}f 1/1/1 2/1/2 3/1/3 4/1/4\n").into_bytes()),
        ("text.stl", text_stl.into_bytes()),
        ("binary.stl", formats::stl::write_mesh(&mesh)),
        ("mesh.off", formats::off::write_mesh(&mesh)),
        ("cloud.off", formats::off::write_cloud(&cloud)),
        ("cloud.obj", formats::obj::write_cloud(&cloud)),
        ("cloud.pcd", formats::pcd::write_cloud(&cloud)),
        ("cloud.xyz", formats::columns::write_cloud(&cloud)),
        ("table.csv", format!("id;X[mm];Y[mm];Z[mm];R;G;B\n{}", "1;0,5;1;2;255;0;9\n".repeat(20)).into_bytes()),
        ("bare.txt", rows(&|p| format!("{} {} {} 0.6 0 -0.8 200 3 4\n", p.x, p.y, p.z)).into_bytes()),
        ("leica.pts", format!("20\n{}", rows(&|p| format!("{} {} {} -12 9 9 9\n", p.x, p.y, p.z))).into_bytes()),
        ("leica.ptx", format!("5\n4\n{PTX_PLACE}{}", rows(&|p| format!("{} {} {} 0.5\n", p.x, p.y, p.z))).into_bytes()),
        ("mesh.vtk", format!("{VTK_HEAD}POINTS 20 float\n{xyz}{VTK_TAIL}").into_bytes()),
        ("array.npy", [NPY_HEAD, &floats].concat()),
        ("lidar.bin", floats.repeat(8)),
        ("scan.3d", format!("5 x 4\n{xyz}").into_bytes()),
        ("cloud.glb", formats::gltf::write_cloud(&cloud)),
        ("mesh.glb", formats::gltf::write_mesh(&mesh)),
        ("cloud.e57", formats::e57::write_cloud(&cloud)),
        ("cloud.las", formats::las::write_cloud(&cloud)),
        ("poses.json", poses::write_json(&named).into_bytes()),
        ("poses.conf", poses::write_conf(&named).into_bytes()),
        ("poses.txt", blocks.as_bytes().to_vec()),
        ("poses.aln", poses::write_aln(&named).into_bytes()),
        ("poses.mlp", poses::write_mlp(&named).into_bytes()),
        ("poses.log", poses::write_log(&named).into_bytes()),
        ("poses-table.txt", b"name,tx,ty,tz,qx,qy,qz,qw\na,1,2,3,0,0,0,1\nb,4,5,6,0,0,0,1\n".to_vec()),
        ("poses-images.txt", b"1 1 0 0 0 4 5 6 1 a.png\n1.5 2 -1\n2 1 0 0 0 1 2 3 1 b.png\n\n".to_vec()),
        ("poses-kitti.txt", b"1 0 0 4 0 1 0 5 0 0 1 6\n1 0 0 1 0 1 0 2 0 0 1 3\n".to_vec()),
        ("poses-frames.json", frames.as_bytes().to_vec()),
        ("depth.png", depth_png()),
    ]
}

/// A depth image of 8 x 6 pixels.
fn depth_png() -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, 8, 6);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Sixteen);
    let data: Vec<u8> = (0..48u16).flat_map(|k| (900 + 7 * k).to_be_bytes()).collect();
    encoder.write_header().expect("a header").write_image_data(&data).expect("data");
    bytes
}

const ODD_WORDS: &[&str] = &[
    "nan",
    "-nan(ind)",
    "inf",
    "-1.#IND",
    "1e400",
    "1e20",
    "-1",
    "0",
    "4294967295",
    "18446744073709551615",
    "1000000000000",
    "\\",
    "#",
    "vertex",
    "face",
    "list",
    "uchar",
    "double",
    "int64",
    "x",
    "rgb",
    "1//1",
    "solid",
    "endsolid",
    "endloop",
    "-1/-1/-1",
    "null",
    "[",
    "{",
    "binary",
    "ascii",
    "\u{feff}",
];

fn pick<'a, T>(random: &mut ChaCha8Rng, from: &'a [T]) -> &'a T {
    &from[random.random_range(0..from.len())]
}

/// A range of a file, at most `most` bytes long.
fn range(random: &mut ChaCha8Rng, file: &[u8], most: usize) -> std::ops::Range<usize> {
    let start = random.random_range(0..=file.len());
    start..(start + random.random_range(0..=most)).min(file.len())
}

/// One change, of bytes, of words or of lines.
fn change(random: &mut ChaCha8Rng, file: &mut Vec<u8>, others: &[(&'static str, Vec<u8>)]) {
    match random.random_range(0..9) {
        0 if !file.is_empty() => {
            let place = random.random_range(0..file.len());
            file[place] ^= 1 << random.random_range(0..8);
        }
        1 => {
            let cut = range(random, file, 40);
            file.drain(cut);
        }
        2 => {
            let copied = range(random, file, 40);
            let copied = file[copied].repeat(random.random_range(1..20));
            let place = random.random_range(0..=file.len());
            file.splice(place..place, copied);
        }
        3 => {
            let other = &pick(random, others).1;
            let from = range(random, other, 200);
            let to = range(random, file, 200);
            file.splice(to, other[from].iter().copied());
        }
        4 => file.truncate(random.random_range(0..=file.len())),
        5 => {
            let end = *pick(random, &[&b"\r\n"[..], b"\r", b"\n\r", b" ", b""]);
            let only_some = random.random_bool(0.5);
            let changed: Vec<u8> = file
                .iter()
                .flat_map(|byte| match byte {
                    b'\n' if !only_some || random.random_bool(0.3) => end.to_vec(),
                    other => vec![*other],
                })
                .collect();
            *file = changed;
        }
        6 => {
            let bytes: [u8; 4] =
                *pick(random, &[[0xff; 4], [0; 4], [0, 0, 0xc0, 0x7f], [0, 0, 0x80, 0xff], [1, 0, 0, 0]]);
            let place = random.random_range(0..=file.len());
            let end = (place + 4).min(file.len());
            file.splice(place..end, bytes);
        }
        _ => {
            let words: Vec<usize> = (0..file.len())
                .filter(|k| !file[*k].is_ascii_whitespace() && (*k == 0 || file[*k - 1].is_ascii_whitespace()))
                .collect();
            if words.is_empty() {
                return;
            }
            let start = *pick(random, &words);
            let length = file[start..].iter().position(u8::is_ascii_whitespace).unwrap_or(file.len() - start);
            file.splice(start..start + length.min(30), pick(random, ODD_WORDS).bytes());
        }
    }
}

fn read(name: &str, file: &[u8]) -> Result<Reading, FormatError> {
    match name {
        "depth.png" => depth_image::read(file, &CAMERA, 1000.0, Some(file), &LIMITS),
        _ => formats::read(name, file, &LIMITS),
    }
}

fn check(name: &str, file: &[u8]) {
    if name.starts_with("poses") {
        if let Ok(read) = poses::read_scaled(name, file) {
            assert!(read.poses.iter().all(|(_, pose)| pose.to_homogeneous().iter().all(|x| x.is_finite())));
        }
        return;
    }
    match read(name, file) {
        Ok(reading) => {
            let (surface, count) = (&reading.surface, reading.surface.cloud.len());
            assert!(count > 0 && count as u64 <= LIMITS.max_points && surface.faces.len() as u64 <= LIMITS.max_faces);
            assert!(surface.cloud.points.iter().all(|p| p.iter().all(|x| x.abs() <= MAX_COORDINATE)));
            assert!(surface.faces.iter().flatten().all(|vertex| (*vertex as usize) < count));
            assert!(surface.cloud.normals.as_ref().is_none_or(|normals| normals.len() == count));
            assert!(surface.cloud.normals.iter().flatten().all(|normal| normal.iter().all(|x| x.is_finite())));
            assert!(surface.cloud.colors.as_ref().is_none_or(|colors| colors.len() == count));
            assert!(surface.cloud.intensities.as_ref().is_none_or(|values| values.len() == count));
            if let Some(grid) = &surface.grid {
                assert_eq!(grid.columns * grid.rows, grid.pixels.len());
                assert!(grid.pixels.iter().all(|pixel| *pixel == RangeGrid::EMPTY || (*pixel as usize) < count));
            }
        }
        Err(FormatError::UnknownExtension { .. } | FormatError::Packed { .. }) => panic!("{name} has a known ending"),
        Err(error) => assert!(error.to_string().len() < 1000, "{error}"),
    }
}

/// The most memory the process has held, where the system says so.
fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    line.split_ascii_whitespace().nth(1)?.parse::<u64>().ok().map(|kib| kib << 10)
}

#[test]
fn changed_files_are_read_soundly_or_refused() {
    let number = |name: &str| std::env::var(name).ok().map(|text| text.parse::<u64>().expect(name));
    let first = number("VISAGE_FUZZ_SEED").unwrap_or(0);
    let seconds = number("VISAGE_FUZZ_SECONDS").map(Duration::from_secs);
    let seeds = seeds();
    seeds.iter().for_each(|(name, file)| {
        check(name, file);
        assert!(name.starts_with("poses") || read(name, file).is_ok(), "{name} is sound");
    });
    let (begin, before) = (Instant::now(), peak_memory());
    let mut seed = first;
    while seconds.map_or(seed < first + FILES, |budget| begin.elapsed() < budget) {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let (name, mut file) = pick(&mut random, &seeds).clone();
        for _ in 0..1 + random.next_u32() % 5 {
            change(&mut random, &mut file, &seeds);
        }
        let started = Instant::now();
        let outcome = std::panic::catch_unwind(|| check(name, &file));
        assert!(outcome.is_ok(), "VISAGE_FUZZ_SEED={seed}: {name} fails: {}", file.escape_ascii());
        assert!(started.elapsed() < PATIENCE, "VISAGE_FUZZ_SEED={seed}: {name} takes {:?}", started.elapsed());
        seed += 1;
    }
    if let Some((before, after)) = before.zip(peak_memory()) {
        assert!(after < before + MOST_GROWTH, "memory grew from {before} to {after} bytes");
    }
    println!("{} changed files in {:?}", seed - first, begin.elapsed());
}
