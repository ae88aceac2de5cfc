use std::io::{Cursor, Write};

use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use super::*;
use crate::DeclaredUnit;

fn all(bytes: &[u8]) -> Result<Reading, FormatError> {
    read(bytes, &ReadLimits::default())
}

fn message(bytes: &[u8]) -> String {
    all(bytes).expect_err("refused").to_string()
}

/// A file of parts.
fn package(parts: &[(&str, &str)]) -> Vec<u8> {
    let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default().compression_method(CompressionMethod::Deflated);
    for (name, text) in parts {
        writer.start_file(*name, options).expect("to memory");
        writer.write_all(text.as_bytes()).expect("to memory");
    }
    writer.finish().expect("to memory").into_inner()
}

const RELATIONS: &str = r#"<?xml version="1.0"?><Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">
    <Relationship Target="/Metadata/thumbnail.png" Id="rel-2" Type="http://x/metadata/thumbnail"/>
    <Relationship Target="/3D/a.model" Id="rel-1" Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>"#;

const MESH: &str = r#"<mesh><vertices><vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/><vertex x="0" y="2e0" z="0"/></vertices>
    <triangles><triangle v1="0" v2="1" v3="2"/></triangles></mesh>"#;

fn model(head: &str, resources: &str, build: &str) -> String {
    format!(r#"<model {head} xmlns="http://x"><resources>{resources}</resources><build>{build}</build></model>"#)
}

fn file(head: &str, resources: &str, build: &str) -> Vec<u8> {
    package(&[("_rels/.rels", RELATIONS), ("3D/a.model", &model(head, resources, build))])
}

#[test]
fn what_is_built_is_read_where_it_is_built() {
    let objects = format!(
        r#"<object id="1">{MESH}</object>
        <object id="2"><components><component objectid="1"/>
        <component objectid="1" transform="0 1 0 -1 0 0 0 0 1 10 20 30"/></components></object>
        <object id="3">{MESH}</object>"#
    );
    let items = r#"<item objectid="2" transform="1 0 0 0 1 0 0 0 1 0 0 5"/>"#;
    let reading = all(&file(r#"unit="inch""#, &objects, items)).expect("sound");
    assert_eq!(reading.unit, Some(DeclaredUnit { metres: 0.0254 }));
    let points = &reading.surface.cloud.points;
    assert_eq!(points.len(), 6, "an object that is not built is not there");
    assert_eq!((points[1], points[4]), (Point3::new(1.0, 0.0, 5.0), Point3::new(10.0, 21.0, 35.0)));
    assert_eq!(reading.surface.faces, [[0, 1, 2], [3, 4, 5]]);
    assert_eq!(reading.surface.cloud.colors, None);
    let mirrored = r#"<item objectid="1" transform="-1 0 0 0 1 0 0 0 1 0 0 0"/>"#;
    let reading = all(&file("", &objects, mirrored)).expect("sound");
    assert_eq!((reading.surface.faces, reading.unit), (vec![[0, 2, 1]], Some(DeclaredUnit { metres: 0.001 })));
    assert_eq!(all(&file("", &objects, "")).expect("sound").surface.cloud.len(), 12, "of no list all");
}

#[test]
fn objects_may_be_in_other_parts() {
    let item = r#"<item objectid="1" p:path="/3D/Objects/b.model"/>"#;
    let parts = [
        ("_rels/.rels", RELATIONS),
        ("3D/a.model", &model("", "", item)),
        ("3D/Objects/b.model", &model("", &format!(r#"<object id="1">{MESH}</object>"#), "")),
    ];
    assert_eq!(all(&package(&parts)).expect("sound").surface.cloud.len(), 3);
    assert!(message(&package(&parts[..2])).contains("3D/Objects/b.model: "), "{}", message(&package(&parts[..2])));
}

#[test]
fn colours_of_triangles_go_to_their_vertices() {
    let colored = MESH.replace(r#"v3="2""#, r#"v3="2" pid="5" p1="0" p2="1" p3="2""#);
    let objects = format!(
        r##"<m:colorgroup id="5"><m:color color="#FF0000"/><m:color color="#00FF0080"/><m:color color="#0000ff"/></m:colorgroup>
        <basematerials id="6"><base name="x" displaycolor="#102030FF"/></basematerials>
        <object id="1">{colored}</object><object id="2" pid="6" pindex="0">{MESH}</object>
        <object id="3">{MESH}</object>"##
    );
    let colors = all(&file("", &objects, "")).expect("sound").surface.cloud.colors.expect("colours");
    assert_eq!(colors[..3], [[255, 0, 0], [0, 255, 0], [0, 0, 255]]);
    assert_eq!((colors[3], colors[6]), ([16, 32, 48], [0; 3]));
}

#[test]
fn what_is_wrong_is_named() {
    let object = format!(r#"<object id="1">{MESH}</object>"#);
    let deep: String = (1..60)
        .map(|k| format!(r#"<object id="{k}"><components><component objectid="{}"/></components></object>"#, k + 1))
        .collect();
    let cases = [
        (b"PK no zip".to_vec(), "the whole file: it is no whole zip archive"),
        (file("", &object, r#"<item objectid="7"/>"#), "object 7: it is built, but 3D/a.model does not have it"),
        (file("", &object.replace("2e0", "two"), ""), "3D/a.model, line 1: \"two\" is no number"),
        (file("", &object.replace(r#" z="0""#, ""), ""), "3D/a.model, line 1: a vertex lacks x, y or z"),
        (file("", &object.replace("v3=\"2\"", "v3=\"-2\""), ""), "3D/a.model, line 2: \"-2\" is no index"),
        (file(r#"unit="parsec""#, &object, ""), "3D/a.model, line 1: there is no unit \"parsec\""),
        (file("", &object, r#"<item objectid="1" transform="1 0 0"/>"#), "a transform has twelve numbers"),
        (file("", &deep, r#"<item objectid="1"/>"#), "components are more than 32 deep"),
        (file("", "", ""), "there are no points"),
        (package(&[("3D/3dmodel.model", "<model><resources></model>")]), "3D/3dmodel.model, line 1: "),
    ];
    for (bytes, expected) in cases {
        assert!(message(&bytes).contains(expected), "{}", message(&bytes));
    }
    let beyond = object.replace("v3=\"2\"", "v3=\"9\"");
    assert_eq!(all(&file("", &beyond, "")).expect("points").dropped.faces, 1);
}

#[test]
fn bombs_are_refused() {
    let object = format!(r#"<object id="0">{MESH}</object>"#);
    // each object is two of the one before
    let doubled: String = (1..31)
        .map(|k| {
            let part = format!(r#"<component objectid="{}"/>"#, k - 1);
            format!(r#"<object id="{k}"><components>{part}{part}</components></object>"#)
        })
        .collect();
    let limits = ReadLimits { max_points: 1000, max_faces: 1000, max_bytes: 1 << 20 };
    let built = r#"<item objectid="30"/>"#;
    let error = read(&file("", &format!("{object}{doubled}"), built), &limits);
    assert!(matches!(error, Err(FormatError::TooManyBytes { .. })), "{error:?}");
    let empty = r#"<object id="0"/>"#;
    let error = read(&file("", &format!("{empty}{doubled}"), built), &limits);
    assert!(matches!(error, Err(FormatError::TooManyBytes { .. })), "{error:?}");
    let blank = file(&" ".repeat(2 << 20), &object, "");
    assert!(blank.len() < 10_000);
    assert!(matches!(read(&blank, &limits), Err(FormatError::TooManyBytes { limit, .. }) if limit == 1 << 20));
    let vertices = format!(r#"<object id="1"><mesh>{}</mesh></object>"#, r#"<vertex x="0" y="0" z="0"/>"#.repeat(1001));
    let error = read(&file("", &vertices, ""), &limits);
    assert_eq!(error, Err(FormatError::TooLarge { what: "points", found: 1001, limit: 1000 }));
}

#[test]
fn a_file_cut_anywhere_is_an_error_and_changed_bytes_never_panic() {
    let objects = format!(r#"<object id="1">{MESH}</object>"#);
    let text = model("", &objects, r#"<item objectid="1"/>"#);
    let whole = package(&[("3D/3dmodel.model", &text)]);
    for length in 0..whole.len() {
        assert!(all(&whole[..length]).is_err(), "{length}");
    }
    let mut state = 7u64;
    let mut next = |below: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % below
    };
    let mut read_well = 0;
    for _ in 0..1000 {
        let mut changed = text.clone().into_bytes();
        for _ in 0..1 + next(2) {
            let place = next(changed.len());
            changed[place] = b"0123456789-.e<>\"=/ "[next(19)];
        }
        let changed = String::from_utf8_lossy(&changed).into_owned();
        read_well += usize::from(all(&package(&[("3D/3dmodel.model", &changed)])).is_ok());
        let mut broken = whole.clone();
        let place = next(broken.len());
        broken[place] = next(256) as u8;
        let _ = all(&broken);
    }
    assert!(read_well > 50, "{read_well}: the changes are too rough to reach anything");
}
