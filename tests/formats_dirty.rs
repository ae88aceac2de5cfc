//! Files as programs leave them: what can be read without doubt is read, what is not sound costs itself and is counted.
//! Each row of the tables stands for reports about files that other readers lose or misread.

use proptest::prelude::*;
use visage::formats::{self, Dropped, ReadLimits, Reading};
use visage::geometry::{Point3, RangeGrid};

fn read(name: &str, bytes: &[u8]) -> Reading {
    formats::read(name, bytes, &ReadLimits::default())
        .unwrap_or_else(|error| panic!("{name}: {error}\n{}", String::from_utf8_lossy(bytes)))
}

fn refusal(name: &str, bytes: &[u8]) -> String {
    formats::read(name, bytes, &ReadLimits::default()).expect_err("refused").to_string()
}

/// An ASCII PLY of `vertices` rows.
fn ply(vertices: usize, properties: &str, more: &str, body: &str) -> String {
    let xyz = "property float x\nproperty float y\nproperty float z\n";
    format!("ply\nformat ascii 1.0\nelement vertex {vertices}\n{xyz}{properties}{more}end_header\n{body}")
}

fn pcd(fields: &str, size: &str, kind: &str, points: usize, body: &str) -> String {
    format!(
        "VERSION 0.7\nFIELDS x y z{fields}\nSIZE 4 4 4{size}\nTYPE F F F{kind}\nWIDTH {points}\nHEIGHT 1\n\
         POINTS {points}\nDATA ascii\n{body}"
    )
}

/// What a file must give: points, triangles, the first point's colour, and what was dropped.
struct Case {
    what: &'static str,
    name: &'static str,
    text: String,
    points: usize,
    faces: usize,
    color: Option<[u8; 3]>,
    dropped: Dropped,
}

impl Case {
    fn new(what: &'static str, name: &'static str, text: impl Into<String>, points: usize) -> Case {
        Case { what, name, text: text.into(), points, faces: 0, color: None, dropped: Dropped::default() }
    }

    fn faces(self, faces: usize) -> Case {
        Case { faces, ..self }
    }

    fn color(self, color: [u8; 3]) -> Case {
        Case { color: Some(color), ..self }
    }

    fn drops(self, dropped: Dropped) -> Case {
        Case { dropped, ..self }
    }
}

fn none() -> Dropped {
    Dropped::default()
}

fn ply_cases() -> Vec<Case> {
    let rgb = |kind: &str| ["red", "green", "blue"].map(|name| format!("property {kind} {name}\n")).concat();
    let bytes = rgb("uchar");
    let face = "element face 2\nproperty list uchar int vertex_indices\n";
    let strips = "element tristrips 1\nproperty list int int vertex_indices\n";
    let size = "obj_info num_cols 512\nobj_info num_rows 400\n";
    let square = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n";
    let triangles = |rows: &str| ply(4, "", face, &format!("{square}{rows}"));
    let normals = "property float nx\nproperty float ny\nproperty float nz\n";
    let note = |text: &str| Dropped { notes: vec![text.to_owned()], ..none() };
    vec![
        Case::new("NaN vertices are no return", "a.ply", ply(3, "", "", "0 0 0\nnan nan nan\n1 1 1\n"), 2)
            .drops(Dropped { no_return: 1, ..none() }),
        Case::new(
            "NaN as Microsoft writes it",
            "a.ply",
            ply(3, "", "", "-nan(ind) 0 0\n1 1 1\n-1.#IND 0 1.#QNAN\n"),
            1,
        )
        .drops(Dropped { no_return: 2, ..none() }),
        Case::new("NaN normals", "a.ply", ply(2, normals, "", "0 0 0 nan nan nan\n1 1 1 0 0 1\n"), 2)
            .drops(Dropped { normals: 1, ..none() }),
        Case::new("NaN intensity", "a.ply", ply(2, "property float intensity\n", "", "0 0 0 nan\n1 1 1 5\n"), 2)
            .drops(Dropped { intensities: 1, ..none() }),
        Case::new("NaN colour", "a.ply", ply(2, &rgb("float"), "", "0 0 0 1 0 0\n1 1 1 nan 0 0\n"), 2)
            .color([255, 0, 0])
            .drops(Dropped { colors: 1, ..none() }),
        Case::new("a 64-bit property", "a.ply", ply(1, "property int64 t\n", "", "0 0 0 1699999999999999999\n"), 1),
        Case::new("rows over two lines", "a.ply", ply(2, &bytes, "", "0 0 0 \n1 2 3\n1 1 1 \n4 5 6\n"), 2)
            .color([1, 2, 3]),
        Case::new("all rows in one line", "a.ply", ply(2, &bytes, "", "0 0 0 1 2 3 1 1 1 4 5 6"), 2).color([1, 2, 3]),
        Case::new("the mark of UTF-8", "a.ply", format!("\u{feff}{}", ply(1, "", "", "0 0 0\n")), 1),
        Case::new("faces named otherwise", "a.ply", triangles("3 0 1 2\n4 0 1 2 3\n").replace("_i", "I"), 4).faces(3),
        Case::new("a bad face", "a.ply", triangles("3 0 1 -1\n4 0 1 2 3\n"), 4)
            .faces(2)
            .drops(Dropped { faces: 1, ..none() }),
        Case::new("a face of no return", "a.ply", triangles("3 0 1 2\n3 3 1 0\n").replace("1 1 0", "nan 1 0"), 3)
            .faces(1)
            .drops(Dropped { no_return: 1, faces: 1, ..none() }),
        Case::new("strips", "a.ply", ply(4, "", strips, &format!("{square}8 0 1 3 2 -1 2 1 0\n")), 4).faces(3),
        Case::new(
            "a grid that is not its size",
            "a.ply",
            ply(1, "", &(size.to_owned() + &face.replace("face 2", "range_grid 4")), "0 0 0\n1 0\n0\n0\n0\n"),
            1,
        )
        .drops(note("the range grid is not used: num_cols 512 x num_rows 400 does not give its 4 pixels")),
    ]
}

fn pcd_cases() -> Vec<Case> {
    let plain = pcd("", "", "", 2, "0 0 0\n1 1 1\n");
    vec![
        Case::new("infinite is no return too", "a.pcd", pcd("", "", "", 3, "0 0 0\ninf inf inf\n1 1 1\n"), 2)
            .drops(Dropped { no_return: 1, ..none() }),
        Case::new("channels a byte each", "a.pcd", pcd(" r g b", " 1 1 1", " U U U", 1, "0 0 0 7 8 9\n"), 1)
            .color([7, 8, 9]),
        Case::new("no colour is not red", "a.pcd", pcd(" rgb", " 4", " F", 2, "0 0 0 1.0e-38\n1 1 1 nan\n"), 2)
            .color([0x6c, 0xe3, 0xee])
            .drops(Dropped { colors: 1, ..none() }),
        Case::new("a comment behind values", "a.pcd", plain.replace("x y z", "x y z   # XYZ data"), 2),
        Case::new("no width", "a.pcd", plain.replace("WIDTH 2\nHEIGHT 1", "WIDTH 0\nHEIGHT 0"), 2),
        Case::new("a viewpoint that is none", "a.pcd", plain.replace("WIDTH", "VIEWPOINT 0 0\nWIDTH"), 2)
            .drops(Dropped { notes: vec!["VIEWPOINT is not used: it is seven numbers".into()], ..none() }),
        Case::new("the mark of UTF-8", "a.pcd", format!("\u{feff}{plain}"), 2),
    ]
}

fn obj_cases() -> Vec<Case> {
    let square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";
    vec![
        Case::new("the mark of UTF-8 before a vertex", "a.obj", format!("\u{feff}{square}f 1 2 4\n"), 4).faces(1),
        Case::new("CR alone", "a.obj", format!("{square}f 1 2 3 4\n").replace('\n', "\r"), 4).faces(2),
        Case::new("faces before vertices", "a.obj", format!("f 1 2 3 4\n{square}"), 4).faces(2),
        Case::new("a continued line", "a.obj", format!("{square}f 1 2 3 \\\n4\n"), 4).faces(2),
        Case::new("normals that never come", "a.obj", format!("{square}f 1/1/1 2/2/1 3/3/1\n"), 4).faces(1),
        Case::new("normals after faces", "a.obj", format!("{square}f 1//1 2//1 3//1 4//1\nvn 0 0 1\n"), 4).faces(2),
        Case::new("a NaN normal", "a.obj", format!("{square}vn nan nan nan\nvn 0 0 1\nf 1//1 2//2 3//2 4//2\n"), 4)
            .faces(2)
            .drops(Dropped { normals: 1, ..none() }),
        Case::new("NaN as Microsoft writes it", "a.obj", format!("{square}vn -nan(ind) 0 0\nf 1//1 2//1 3//1\n"), 4)
            .faces(1)
            .drops(Dropped { normals: 4, ..none() }),
        Case::new("a NaN vertex", "a.obj", "v 0 0 0\nv nan nan nan\nv 1 0 0\nv 1 1 0\nf 1 2 3\nf 1 3 4\n", 3)
            .faces(1)
            .drops(Dropped { no_return: 1, faces: 1, ..none() }),
        Case::new("a face of nothing", "a.obj", format!("{square}f 1 2 9\nf 1 2 3\n"), 4)
            .faces(1)
            .drops(Dropped { faces: 1, ..none() }),
        Case::new("colours up to 255", "a.obj", "v 0 0 0 255 0 10\nv 1 0 0 0 0 0\n", 2).color([255, 0, 10]),
    ]
}

/// A text of facets, each of three corners.
fn stl(facets: &[[&str; 3]]) -> String {
    let corners = |facet: &[&str; 3]| facet.map(|corner| format!("   vertex {corner}\n")).concat();
    let facet = |facet| format!(" facet normal 0 0 0\n  outer loop\n{}  endloop\n endfacet\n", corners(facet));
    format!("solid a\n{}endsolid a\n", facets.iter().map(facet).collect::<String>())
}

fn stl_cases() -> Vec<Case> {
    let square = stl(&[["0 0 0", "1 0 0", "0 1 0"], ["1 0 0", "1 1 0", "0 1 0"]]);
    let nan = stl(&[["0 0 0", "1 0 0", "0 1 0"], ["1 0 0", "-nan(ind) 1 0", "0 1 0"]]);
    vec![
        Case::new("corners of equal place", "a.stl", square.as_str(), 4).faces(2),
        Case::new("corners of nearly equal place", "a.stl", square.replacen("1 0 0", "1.0000001 0 0", 1), 5).faces(2),
        Case::new("zero with a sign", "a.stl", square.replacen("0 1 0", "-0.0 1 -0", 1), 4).faces(2),
        Case::new("a facet without an area", "a.stl", stl(&[["0 0 0", "0 0 0", "0 1 0"]]), 2).faces(1),
        Case::new("a NaN corner", "a.stl", nan, 3).faces(1).drops(Dropped { faces: 1, ..none() }),
        Case::new("names with words of the format", "a.stl", square.replace("solid a", "solid my vertex endloop"), 4)
            .faces(2),
        Case::new("several solids", "a.stl", square.repeat(2), 4).faces(4),
        Case::new("capitals", "a.STL", square.to_uppercase(), 4).faces(2),
        Case::new("the mark of UTF-8", "a.stl", format!("\u{feff}{square}"), 4).faces(2),
        Case::new("no endsolid", "a.stl", square.replace("endsolid a\n", ""), 4)
            .faces(2)
            .drops(Dropped { notes: vec!["there is no endsolid: the file may be cut short".into()], ..none() }),
    ]
}

#[test]
fn every_dirty_file_gives_what_it_holds() {
    for case in ply_cases().into_iter().chain(pcd_cases()).chain(obj_cases()).chain(stl_cases()) {
        let Reading { surface, dropped, .. } = read(case.name, case.text.as_bytes());
        let what = case.what;
        assert_eq!(surface.cloud.len(), case.points, "{what}");
        assert_eq!(surface.faces.len(), case.faces, "{what}");
        assert_eq!(surface.cloud.colors.map(|colors| colors[0]), case.color, "{what}");
        assert_eq!(dropped, case.dropped, "{what}");
        assert_eq!(surface.cloud.points.last(), Some(&surface.cloud.points[case.points - 1]), "{what}");
    }
}

#[test]
fn what_has_no_sound_value_at_all_is_not_there() {
    let normals = "property float nx\nproperty float ny\nproperty float nz\nproperty float intensity\n";
    let cloud = read("a.ply", ply(1, normals, "", "0 0 0 nan 0 0 inf\n").as_bytes()).surface.cloud;
    assert_eq!((cloud.normals, cloud.intensities), (None, None));
    assert!(refusal("a.ply", ply(1, "", "", "nan 0 0\n").as_bytes()).contains("no coordinates are finite"));
}

#[test]
fn utf16_is_refused_with_the_remedy() {
    let utf16 = |text: &str| -> Vec<u8> { text.encode_utf16().flat_map(u16::to_le_bytes).collect() };
    for name in ["a.ply", "a.pcd", "a.obj", "a.stl"] {
        for text in ["\u{feff}v 0 0 0\n", "v 0 0 0\n"] {
            assert_eq!(refusal(name, &utf16(text)), "byte 0: the text is UTF-16; save the file as UTF-8");
        }
    }
}

#[test]
fn a_compressed_file_counts_as_what_it_unpacks_to() {
    // a zero, then copies of it: 88 bytes from each
    let size: u32 = 131_071 * 32_748;
    let copies = (size as usize - 1) / 264;
    let rest = (size as usize - 1) % 264;
    let mut packed = vec![0u8, 0];
    packed.extend([0xe0, 0xff, 0].repeat(copies));
    packed.extend([0xe0, (rest - 9) as u8, 0]);
    let mut file = b"FIELDS x y z pad\nSIZE 4 4 4 8\nTYPE F F F F\nCOUNT 1 1 1 4092\nWIDTH 131071\nHEIGHT 1\n\
                     POINTS 131071\nDATA binary_compressed\n"
        .to_vec();
    file.extend((packed.len() as u32).to_le_bytes());
    file.extend(size.to_le_bytes());
    file.extend(&packed);
    let message = refusal("a.pcd", &file);
    assert!(message.starts_with("unpacked, it has 4292313108 bytes, more than the 536870912"), "{message}");
}

/// A grid, numbers of an OBJ and lists can outgrow the points: all come out of one budget.
#[test]
fn nothing_grows_beyond_the_budget() {
    let limits = ReadLimits { max_points: 10, max_faces: 10, ..ReadLimits::default() };
    let refused = |name: &str, text: String| formats::read(name, text.as_bytes(), &limits).expect_err(name).to_string();
    let grid = "obj_info num_cols 100\nobj_info num_rows 10\nelement range_grid 1000\n\
                property list uchar int vertex_indices\n";
    let grid = ply(1, "", grid, &format!("0 0 0\n{}", "0\n".repeat(1000)));
    assert!(refused("a.ply", grid).starts_with("what it holds takes "));
    assert!(refused("a.obj", format!("v 0 0 0\n{}", "vn 0 0 1\n".repeat(1000))).starts_with("what it holds takes "));
    let strip: Vec<String> = (0..20).map(|k| format!("{k} 0 0")).collect();
    let strip: Vec<[&str; 3]> = strip.windows(3).map(|corners| [0, 1, 2].map(|k| corners[k].as_str())).collect();
    assert_eq!(refused("a.stl", stl(&strip)), "points 11 exceeds the limit of 10; thin the scan or raise the limit");
    let fan = ply(
        1,
        "",
        "element face 1\nproperty list uint uchar vertex_indices\n",
        &format!("0 0 0\n1000{}\n", " 0".repeat(1000)),
    );
    assert_eq!(refused("a.ply", fan), "faces 11 exceeds the limit of 10; thin the scan or raise the limit");
}

const LINE_ENDS: [&str; 4] = ["\n", "\r\n", "\r", "\n\r"];

/// What programs call the channels of a colour.
const NAMES: &[[&str; 3]] = &[
    ["red", "green", "blue"],
    ["r", "g", "b"],
    ["diffuse_red", "diffuse_green", "diffuse_blue"],
    ["Red", "Green", "Blue"],
];
/// Types of PLY and PCD for a channel, and what a byte is multiplied with in that range.
const KINDS: &[(&str, &str, &str, f64)] = &[
    ("uchar", " 1", " U", 1.0),
    ("ushort", " 2", " U", 257.0),
    ("ushort", " 2", " U", 1.0),
    ("uint", " 4", " U", 16_843_009.0),
    ("int", " 4", " I", 1.0),
    ("float", " 4", " F", 1.0 / 255.0),
    ("float", " 4", " F", 1.0),
    ("double", " 8", " F", 257.0),
];

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, ..ProptestConfig::default() })]

    /// Any line end, or one after the other, in any reader: text.
    #[test]
    fn line_ends_of_text_do_not_matter(
        ends in prop::collection::vec(prop::sample::select(&LINE_ENDS[..]), 1..30),
        mixed: bool,
    ) {
        let (channels, rows) = ("property uchar r\nproperty uchar g\nproperty uchar b\n", "0 0 0 1 2 3\n1 0 0 4 5 6\n");
        let face = "element face 1\nproperty list uchar int vertex_indices\n";
        let texts = [
            ("a.ply", ply(3, channels, face, &format!("{rows}1 1 0 7 8 9\n3 0 1 2\n"))),
            ("a.pcd", pcd(" r g b", " 1 1 1", " U U U", 2, rows)),
            ("a.stl", stl(&[["0 0 0", "1 0 0", "0 1 0"], ["1 0 0", "1 1 0", "0 1 0"]])),
            ("a.obj", "# a comment\nv 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n".to_owned()),
        ];
        for (name, text) in texts {
            let expected = read(name, text.as_bytes());
            let mut all = ends.iter().cycle();
            let mut end = || if mixed { all.next().copied().unwrap_or("\n") } else { ends[0] };
            let lines: String = text.lines().map(|line| line.to_owned() + end()).collect();
            prop_assert_eq!(read(name, lines.as_bytes()), expected);
        }
    }

    /// The same before a binary body that may begin like a line end.
    #[test]
    fn line_ends_of_a_header_do_not_shift_the_body(
        end in prop::sample::select(&LINE_ENDS[..]),
        first in prop::sample::select(vec![*b"\r\n\r\n", *b"\n\r\n\r", *b"\n\n\n\n", *b"\r\r\r\r", *b"abcA"]),
    ) {
        let x = f32::from_le_bytes(first);
        let body = [x, 2.0, 3.0].map(f32::to_le_bytes).concat();
        let ply = "ply\nformat binary_little_endian 1.0\ncomment a\nelement vertex 1\nproperty float x\nproperty float y\n\
                   property float z\nend_header\n";
        let pcd = "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 1\nHEIGHT 1\nPOINTS 1\nDATA binary\n";
        for (name, header) in [("a.ply", ply), ("a.pcd", pcd)] {
            let file = [header.replace('\n', end).as_bytes(), &body].concat();
            prop_assert_eq!(read(name, &file).surface.cloud.points, [Point3::new(f64::from(x), 2.0, 3.0)]);
        }
    }

    /// Any type, range and name of colours, in PLY and PCD.
    #[test]
    fn colours_of_any_type_range_and_name_are_the_same(
        colors in prop::collection::vec(prop::array::uniform3(any::<u8>()), 1..8),
        names in prop::sample::select(NAMES),
        kind in prop::sample::select(KINDS),
    ) {
        // full light is among them, so that the range can be seen
        let colors: Vec<[u8; 3]> = colors.into_iter().chain([[255; 3]]).collect();
        let (ply_kind, size, pcd_kind, factor) = kind;
        let value = |channel: &u8| (f64::from(*channel) * factor).to_string();
        let row = |color: &[u8; 3]| format!("0 0 0 {}\n", color.iter().map(value).collect::<Vec<_>>().join(" "));
        let rows: String = colors.iter().map(row).collect();
        let properties = names.map(|name| format!("property {ply_kind} {name}\n")).concat();
        let ply = ply(colors.len(), &properties, "", &rows);
        prop_assert_eq!(read("a.ply", ply.as_bytes()).surface.cloud.colors, Some(colors.clone()));
        let fields = format!(" {}", names.join(" "));
        let pcd = pcd(&fields, &size.repeat(3), &pcd_kind.repeat(3), colors.len(), &rows);
        prop_assert_eq!(read("a.pcd", pcd.as_bytes()).surface.cloud.colors, Some(colors));
    }

    /// Packed colours survive in text and in bytes, whether the type is a float or a whole number.
    #[test]
    fn packed_colours_are_the_same(
        color in prop::array::uniform3(any::<u8>()),
        opacity in prop::sample::select(vec![0u8, 255]),
    ) {
        let [red, green, blue] = color;
        let bits = u32::from_le_bytes([blue, green, red, opacity]);
        for kind in ["F", "U"] {
            let header = format!("FIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F {kind}\nWIDTH 1\nHEIGHT 1\nDATA binary\n");
            let file = [header.as_bytes(), &[0; 12], &bits.to_le_bytes()].concat();
            prop_assert_eq!(read("a.pcd", &file).surface.cloud.colors, Some(vec![color]), "{}", kind);
        }
        for kind in ["float", "uint"] {
            let header = ply(1, &format!("property {kind} rgb\n"), "", "").replace("ascii", "binary_little_endian");
            let file = [header.as_bytes(), &[0; 12], &bits.to_le_bytes()].concat();
            prop_assert_eq!(read("a.ply", &file).surface.cloud.colors, Some(vec![color]), "{}", kind);
        }
    }

    /// Whatever is NaN, in whatever share: sound points keep what is sound of them, and the counts add up.
    #[test]
    fn what_is_nan_costs_itself_alone(rows in prop::collection::vec((any::<[bool; 4]>(), 0..1000u16), 1..20)) {
        let word = |is_sound: bool, sound: String| if is_sound { sound } else { "nan".to_owned() };
        let row = |([point, normal, color, intensity], x): &([bool; 4], u16)| {
            let one = |is_sound: bool| word(is_sound, "1".into());
            let x = word(*point, x.to_string());
            format!("{x} 0 0 {} 0 0 {} 0 0 {}\n", one(*normal), one(*color), one(*intensity))
        };
        let kept: Vec<_> = rows.iter().filter(|row| row.0[0]).collect();
        let names = ["nx", "ny", "nz", "r", "g", "b", "intensity"];
        let properties = names.map(|name| format!("property float {name}\n")).concat();
        let body: String = rows.iter().map(row).collect();
        let fields = format!(" {}", names.join(" "));
        let files = [
            ("a.ply", ply(rows.len(), &properties, "", &body)),
            ("a.pcd", pcd(&fields, &" 4".repeat(7), &" F".repeat(7), rows.len(), &body)),
        ];
        for (name, text) in files {
            let result = formats::read(name, text.as_bytes(), &ReadLimits::default());
            if kept.is_empty() {
                prop_assert!(result.is_err());
                continue;
            }
            let Reading { surface, dropped, .. } = result.expect("some points are sound");
            let unsound = |k: usize| kept.iter().filter(|row| !row.0[k]).count() as u64;
            let xs: Vec<f64> = surface.cloud.points.iter().map(|p| p.x).collect();
            prop_assert_eq!(xs, kept.iter().map(|row| f64::from(row.1)).collect::<Vec<_>>());
            prop_assert_eq!(dropped.no_return, (rows.len() - kept.len()) as u64);
            let counts = [dropped.normals, dropped.colors, dropped.intensities];
            prop_assert_eq!(counts, [unsound(1), unsound(2), unsound(3)]);
            let all = kept.len() as u64;
            prop_assert_eq!(surface.cloud.normals.is_some(), unsound(1) < all);
            prop_assert_eq!(surface.cloud.colors.is_some(), unsound(2) < all);
            if let Some(colors) = surface.cloud.colors {
                for (color, row) in colors.iter().zip(&kept) {
                    prop_assert_eq!(color[0], if row.0[2] { 255 } else { 0 });
                }
            }
        }
    }
}

#[test]
fn a_grid_keeps_its_pixels_when_points_go() {
    let grid =
        "obj_info num_cols 2\nobj_info num_rows 1\nelement range_grid 2\nproperty list uchar int vertex_indices\n";
    let surface = read("a.ply", ply(2, "", grid, "nan 0 0\n1 1 1\n1 0\n1 1\n").as_bytes()).surface;
    assert_eq!(surface.grid.expect("a grid").pixels, [RangeGrid::EMPTY, 0]);
}
