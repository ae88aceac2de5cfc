use super::*;
use visage_geometry::{Cloud, Mesh, Point3};

fn all(bytes: &[u8]) -> Result<Reading, FormatError> {
    read(bytes, &ReadLimits::default())
}

fn message(bytes: &[u8]) -> String {
    all(bytes).expect_err("refused").to_string()
}

/// A binary file of a text and a buffer.
fn glb(json: &str, binary: &[u8]) -> Vec<u8> {
    let mut json = json.as_bytes().to_vec();
    json.resize(json.len().next_multiple_of(4), b' ');
    let length = HEAD + 2 * CHUNK_HEAD + json.len() + binary.len();
    let words = |words: &[u32]| words.iter().flat_map(|word| word.to_le_bytes()).collect::<Vec<u8>>();
    let head = words(&[2, length as u32, json.len() as u32, JSON]);
    [MAGIC, &head, &json, &words(&[binary.len() as u32, BIN]), binary].concat()
}

fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

/// The corners of a unit square, in the order of a strip.
const SQUARE: [f32; 12] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0];

/// A square whose primitive, node and further parts are given.
fn square(primitive: &str, node: &str, more: &str) -> Vec<u8> {
    let indices = [0u16, 1, 2, 1, 3, 2].iter().flat_map(|index| index.to_le_bytes()).collect::<Vec<u8>>();
    let colors = [[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255], [9, 9, 9, 255]].concat();
    let coordinates = floats(&[0.1, 0.1, 0.9, 0.1, 0.1, 0.9, 0.9, 0.9]);
    let binary = [floats(&SQUARE), indices, colors, coordinates].concat();
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0{node}}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0{primitive}}}]}}],
        "buffers":[{{"byteLength":{}}}],
        "bufferViews":[{{"buffer":0,"byteLength":48}},{{"buffer":0,"byteOffset":48,"byteLength":12}},
        {{"buffer":0,"byteOffset":60,"byteLength":16}},{{"buffer":0,"byteOffset":76,"byteLength":32}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3"}},
        {{"bufferView":1,"componentType":5123,"count":6,"type":"SCALAR"}},
        {{"bufferView":2,"componentType":5121,"normalized":true,"count":4,"type":"VEC4"}},
        {{"bufferView":3,"componentType":5126,"count":4,"type":"VEC2"}}]{more}}}"#,
        binary.len()
    );
    glb(&json, &binary)
}

#[test]
fn what_is_written_comes_back() {
    let place = |x: f64| Point3::new(500_000.125 + x, 4_500_000.25, 100.0 + x);
    let vertices: Vec<Point3> = (0..5).map(|k| place(f64::from(k) * 0.5)).collect();
    let cloud = Cloud {
        normals: Some(vec![nalgebra::Vector3::x(); 5]),
        colors: Some((0..5).map(|c| [c, 2, 255]).collect()),
        intensities: Some(vec![0.5, 1.0, 2.0, 3.0, -1.0]),
        ..Cloud::from_points(vertices.clone())
    };
    let reading = all(&write_cloud(&cloud)).expect("sound");
    assert_eq!((reading.surface.cloud, reading.unit), (cloud, Some(DeclaredUnit::METRE)), "no millimetre is lost");
    assert!(reading.dropped.is_empty());
    let mesh = Mesh { vertices, faces: vec![[0, 1, 2], [4, 3, 2]] };
    assert_eq!(all(&write_mesh(&mesh)).expect("sound").surface.mesh(), Some(mesh));
}

#[test]
fn strips_fans_and_points_are_drawn() {
    let faces = |primitive: &str| all(&square(primitive, "", "")).expect(primitive).surface.faces;
    assert_eq!(faces(r#"},"indices":1"#), [[0, 1, 2], [1, 3, 2]]);
    assert_eq!(faces(r#"},"mode":5"#), [[0, 1, 2], [2, 1, 3]]);
    assert_eq!(faces(r#"},"mode":6"#), [[0, 1, 2], [0, 2, 3]]);
    assert_eq!(faces(r#"},"mode":4"#), [[0, 1, 2]]);
    assert!(faces(r#"},"mode":0"#).is_empty());
    let error = message(&square(r#"},"mode":1"#, "", ""));
    assert!(error.contains("the scene draws no points and no triangles"), "{error}");
}

#[test]
fn nodes_move_what_they_hold_and_a_mirror_turns_triangles() {
    let root = r#"},{"children":[0],"scale":[-2,2,2],"rotation":[0,0,0.7071067811865476,0.7071067811865476]"#;
    let bytes = square(r#"},"indices":1"#, &format!(r#","translation":[10,0,0]{root}"#), "");
    let bytes = replaced(&bytes, r#""nodes":[0]"#, r#""nodes":[1]"#);
    let surface = all(&bytes).expect("sound").surface;
    let point = surface.cloud.points[1];
    assert!((point - Point3::new(0.0, -22.0, 0.0)).norm() < 1e-12, "{point}");
    assert_eq!(surface.faces[0], [0, 2, 1]);
    let bytes = square(r#"},"indices":1"#, r#","matrix":[1,0,0,0,0,1,0,0,0,0,1,0,5,6,7,1]"#, "");
    assert_eq!(all(&bytes).expect("sound").surface.cloud.points[3], Point3::new(6.0, 7.0, 7.0));
}

/// The same file with other words of the same length in its text.
fn replaced(bytes: &[u8], from: &str, to: &str) -> Vec<u8> {
    assert_eq!(from.len(), to.len());
    let at = memchr::memmem::find(bytes, from.as_bytes()).expect("it is there");
    [&bytes[..at], to.as_bytes(), &bytes[at + to.len()..]].concat()
}

#[test]
fn colours_come_from_vertices_factors_and_pictures() {
    let colors = |bytes: &[u8]| all(bytes).expect("sound").surface.cloud.colors.expect("colours");
    let of_vertices = colors(&square(r#","COLOR_0":2},"indices":1"#, "", ""));
    assert_eq!(of_vertices, [[255, 0, 0], [0, 255, 0], [0, 0, 255], [9, 9, 9]]);
    assert_eq!(all(&square(r#"},"indices":1"#, "", "")).expect("sound").surface.cloud.colors, None);
    let material = r#","materials":[{"pbrMetallicRoughness":{"baseColorFactor":[1,0.5,0,1]}}]"#;
    assert_eq!(colors(&square(r#"},"material":0"#, "", material))[0], [255, 188, 0]);

    let mut png = Vec::new();
    let mut encoder = png::Encoder::new(&mut png, 2, 2);
    encoder.set_color(png::ColorType::Rgb);
    let mut writer = encoder.write_header().expect("a header");
    writer.write_image_data(&[1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12]).expect("pixels");
    writer.finish().expect("an end");
    let uri = base64::Engine::encode(&base64::engine::general_purpose::STANDARD, &png);
    let material = |uri: &str| {
        format!(
            r#","materials":[{{"pbrMetallicRoughness":{{"baseColorTexture":{{"index":0}}}}}}],
            "textures":[{{"source":0}}],"images":[{{"uri":"{uri}"}}]"#
        )
    };
    let primitive = r#","TEXCOORD_0":3},"indices":1,"material":0"#;
    let of_picture = colors(&square(primitive, "", &material(&format!("data:image/png;base64,{uri}"))));
    assert_eq!(of_picture, [[1, 2, 3], [4, 5, 6], [7, 8, 9], [10, 11, 12]]);
    let reading = all(&square(primitive, "", &material("wood.png"))).expect("the geometry is there");
    assert_eq!(reading.dropped.notes, ["colours of material 0: texture \"wood.png\" is in another file"]);
    assert_eq!(reading.surface.cloud.colors, None);
}

#[test]
fn sparse_values_replace_others_and_integers_are_fractions_when_they_say_so() {
    let binary = [vec![2, 0, 1, 0], floats(&[7.0, 8.0, 9.0, 4.0, 5.0, 6.0])].concat();
    let json = r#"{"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],
        "meshes":[{"primitives":[{"attributes":{"POSITION":0},"mode":0}]}],"buffers":[{"byteLength":28}],
        "bufferViews":[{"buffer":0,"byteLength":4},{"buffer":0,"byteOffset":4,"byteLength":24}],
        "accessors":[{"componentType":5126,"count":3,"type":"VEC3","sparse":{"count":2,
        "indices":{"bufferView":0,"componentType":5123},"values":{"bufferView":1}}}]}"#;
    let points = all(&glb(json, &binary)).expect("sound").surface.cloud.points;
    assert_eq!(points, [Point3::origin(), Point3::new(4.0, 5.0, 6.0), Point3::new(7.0, 8.0, 9.0)]);
    let error = message(&glb(&json.replace("\"count\":3", "\"count\":2"), &binary));
    assert!(error.contains("accessor 0: it changes a value beyond its 2"), "{error}");
    let json = r#"{"nodes":[{"mesh":0}],"meshes":[{"primitives":[{"attributes":{"POSITION":0},"mode":0}]}],
        "buffers":[{"byteLength":16}],"bufferViews":[{"buffer":0,"byteLength":16,"byteStride":8}],
        "accessors":[{"bufferView":0,"componentType":5122,"normalized":true,"count":2,"type":"VEC3"}]}"#;
    let binary = [0x7fffu16, 0x8001, 0, 99, 0x8000, 0, 0, 99].iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
    let points = all(&glb(json, &binary)).expect("sound").surface.cloud.points;
    assert_eq!(points, [Point3::new(1.0, -1.0, 0.0), Point3::new(-1.0, 0.0, 0.0)]);
}

#[test]
fn a_text_may_hold_its_buffer_and_other_files_are_refused() {
    let uri = base64::Engine::encode(&base64::engine::general_purpose::STANDARD, floats(&SQUARE));
    let json = format!(
        r#"{{"nodes":[{{"mesh":0}}],"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"mode":5}}]}}],
        "buffers":[{{"byteLength":48,"uri":"data:application/octet-stream;base64,{uri}"}}],
        "bufferViews":[{{"buffer":0,"byteLength":48}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3"}}]}}"#
    );
    let surface = all(json.as_bytes()).expect("sound").surface;
    assert_eq!((surface.cloud.len(), surface.faces.len()), (4, 2));
    let start = json.find("data:").expect("a URI");
    let end = start + json[start..].find('"').expect("its end");
    let other = format!("{}mesh.bin{}", &json[..start], &json[end..]);
    assert_eq!(
        message(other.as_bytes()),
        "buffer 0: it is in another file, \"mesh.bin\"; export it as one file, as .glb"
    );
}

#[test]
fn compressed_geometry_is_refused_with_a_way_out() {
    let draco = square(r#"},"extensions":{"KHR_draco_mesh_compression":{"bufferView":0}}"#, "", "");
    let error = message(&draco);
    assert!(error.contains("compressed by Draco") && error.contains("export without Draco compression"), "{error}");
    let other = square("}", "", r#","extensionsRequired":["EXT_meshopt_compression"]"#);
    assert!(message(&other).contains("export without meshopt compression"));
    let odd = square("}", "", r#","extensionsRequired":["ODD_thing"]"#);
    assert!(message(&odd).contains("an extension that is not read here (ODD_thing)"));
}

#[test]
fn what_is_wrong_is_named() {
    let whole = square(r#"},"indices":1"#, "", "");
    let cases = [
        (replaced(&whole, r#""nodes":[0]"#, r#""nodes":[7]"#), "node 7: it is named, but there are 1"),
        (replaced(&whole, r#""mesh":0"#, r#""mesh":9"#), "mesh 9: it is named, but there are 1"),
        (
            replaced(&whole, r#""count":4"#, r#""count":5"#),
            "it declares 60 bytes for accessor 0 but ends within the 48",
        ),
        (replaced(&whole, r#""byteLength":48"#, r#""byteLength":99"#), "accessor"),
        (replaced(&whole, "\"VEC3\"", "\"VEC7\""), "accessor 0: its values are \"VEC7\""),
        (square("}", r#","children":[0]"#, ""), "node 0: it has two parents, or is its own"),
        (square(r#","NORMAL":1}"#, "", ""), "mesh 0, primitive 0: NORMAL has 6 values for 4 vertices"),
        (b"glTF\x01\0\0\0\x14\0\0\0".to_vec(), "byte 4: it is glTF 1; export it as glTF 2.0"),
        (b"{\"nodes\": 3}".to_vec(), "line 1, column 11: it is no glTF"),
    ];
    for (bytes, message) in cases {
        match all(&bytes) {
            Err(error) => assert!(error.to_string().contains(message), "{error} is not {message}"),
            Ok(_) => assert_eq!(message, "accessor", "{message}: it is read"),
        }
    }
}

#[test]
fn a_file_cut_anywhere_is_an_error() {
    let whole = square(r#","COLOR_0":2},"indices":1"#, "", "");
    for length in 0..whole.len() {
        assert!(all(&whole[..length]).is_err(), "{length}");
    }
}

#[test]
fn limits_hold_also_where_a_mesh_is_drawn_often() {
    let bytes = square(r#"},"indices":1"#, "", "");
    let limited = |max_points, max_faces| read(&bytes, &ReadLimits { max_points, max_faces, ..ReadLimits::default() });
    assert_eq!(limited(3, 9), Err(FormatError::TooLarge { what: "points", found: 4, limit: 3 }));
    assert_eq!(limited(100, 1), Err(FormatError::TooLarge { what: "faces", found: 2, limit: 1 }));
    let nodes = vec![r#"{"mesh":0}"#; 41].join(",");
    let json = format!(
        r#"{{"nodes":[{nodes}],"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"mode":5}}]}}],
        "buffers":[{{"byteLength":48}}],"bufferViews":[{{"buffer":0,"byteLength":48}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3"}}]}}"#
    );
    let often = glb(&json, &floats(&SQUARE));
    assert_eq!(all(&often).expect("sound").surface.cloud.len(), 164);
    let limits = ReadLimits { max_points: 100, max_faces: 1000, ..ReadLimits::default() };
    assert!(matches!(read(&often, &limits), Err(FormatError::TooLarge { what: "points", .. })));
    // a count without bytes behind it
    let zeros = r#"{"nodes":[{"mesh":0}],"meshes":[{"primitives":[{"attributes":{"POSITION":0},"mode":0}]}],
        "accessors":[{"componentType":5126,"count":18446744073709551615,"type":"VEC3"}]}"#;
    assert!(matches!(all(zeros.as_bytes()), Err(FormatError::TooLarge { what: "points", .. })));
}
