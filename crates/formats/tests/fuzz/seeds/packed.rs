//! What is packed, or has lengths around it: gzip, NPZ, 3MF and glTF. What is in it is changed.

use std::io::{Cursor, Write};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::GzEncoder;
use visage_formats::{gltf, ply};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use super::{Seed, binary, cloud, floats, mesh, meshes};

/// The packed file of some bytes.
pub fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(bytes).expect("in memory");
    encoder.finish().expect("in memory")
}

/// A zip of files.
pub fn zipped(files: &[(&str, &[u8])], method: CompressionMethod) -> Vec<u8> {
    let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default().compression_method(method);
    for (name, bytes) in files {
        writer.start_file(*name, options).expect("to memory");
        writer.write_all(bytes).expect("to memory");
    }
    writer.finish().expect("to memory").into_inner()
}

pub fn gz() -> Vec<Seed> {
    let packed = |seed: Seed| Seed { name: format!("{}.gz", seed.name), wrap: gzip, ..seed };
    let mut seeds: Vec<Seed> = meshes::ply().into_iter().take(3).map(packed).collect();
    seeds.push(Seed::plain("raw.ply.gz", gzip(&ply::write_mesh(&mesh()))));
    seeds
}

pub fn npz() -> Vec<Seed> {
    let one = |bytes: &[u8]| zipped(&[("points.npy", bytes)], CompressionMethod::Stored);
    let mut seeds: Vec<Seed> = binary::npy()
        .into_iter()
        .map(|seed| Seed { name: seed.name.replace(".npy", ".npz"), wrap: one, ..seed })
        .collect();
    let points = binary::array("'<f4'", "False", "(20, 4)", &floats());
    let colors = binary::array("'|u1'", "False", "(20, 3)", &floats()[..60]);
    let faces = binary::array("'<i4'", "False", "(2, 3)", &[0; 24]);
    let arrays: [(&str, &[u8]); 3] = [("points.npy", &points), ("colors.npy", &colors), ("faces.npy", &faces)];
    seeds.push(Seed::plain("raw.npz", zipped(&arrays, CompressionMethod::Deflated)));
    seeds
}

const RELATIONS: &str = r#"<?xml version="1.0"?><Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">
    <Relationship Target="/3D/a.model" Id="r" Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>"#;

/// A package of a model.
fn package(model: &[u8]) -> Vec<u8> {
    zipped(&[("_rels/.rels", RELATIONS.as_bytes()), ("3D/a.model", model)], CompressionMethod::Deflated)
}

pub fn threemf() -> Vec<Seed> {
    const MESH: &str = r#"<mesh><vertices><vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/><vertex x="0" y="2e0" z="0"/>
        </vertices><triangles><triangle v1="0" v2="1" v3="2" pid="5" p1="0" p2="1"/></triangles></mesh>"#;
    let model = |resources: &str, build: &str| {
        format!(
            r#"<?xml version="1.0" encoding="UTF-8"?><model unit="inch" xmlns="http://x" xmlns:m="http://y">
            <metadata name="Title">t</metadata><resources>{resources}</resources><build>{build}</build></model>"#
        )
    };
    let colors = r##"<m:colorgroup id="5"><m:color color="#FF0000"/><m:color color="#00FF0080"/></m:colorgroup>
        <basematerials id="6"><base name="a" displaycolor="#123456"/></basematerials>"##;
    let objects = format!(
        r#"{colors}<object id="1" pid="6" pindex="0">{MESH}</object><object id="2"><components><component objectid="1"/>
        <component objectid="1" transform="0 1 0 -1 0 0 0 0 1 10 20 30"/></components></object>
        <object id="3"><components><component objectid="2"/></components></object>"#
    );
    let items = r#"<item objectid="3" transform="1 0 0 0 1 0 0 0 1 0 0 5"/><item objectid="1"/>"#;
    let wrapped = |name: &str, text: String| Seed { name: name.into(), bytes: text.into_bytes(), wrap: package };
    let plain = model(&format!(r#"<object id="1">{MESH}</object>"#), r#"<item objectid="1"/>"#);
    vec![
        Seed::plain("raw.3mf", package(plain.as_bytes())),
        wrapped("plain.3mf", plain),
        wrapped("parts.3mf", model(&objects, items)),
    ]
}

const INDICES: [u16; 6] = [0, 1, 2, 1, 3, 2];

/// The numbers of a square: corners, indices, colours, places in a picture, and the picture.
fn square() -> Vec<u8> {
    let floats = |values: &[f32]| values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>();
    let corners = floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0]);
    let indices: Vec<u8> = INDICES.iter().flat_map(|index| index.to_le_bytes()).collect();
    let colors = [[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255], [9, 9, 9, 255]].concat();
    let coordinates = floats(&[0.1, 0.1, 0.9, 0.1, 0.1, 0.9, 0.9, 0.9]);
    [corners, indices, colors, coordinates, super::beside::rgb_png()].concat()
}

fn document(primitive: &str, node: &str, more: &str, buffer: &str) -> String {
    let picture = super::beside::rgb_png().len();
    format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0{node}}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0{primitive}}}]}}],
        "buffers":[{{{buffer}"byteLength":{}}}],
        "bufferViews":[{{"buffer":0,"byteLength":48}},{{"buffer":0,"byteOffset":48,"byteLength":12}},
        {{"buffer":0,"byteOffset":60,"byteLength":16}},{{"buffer":0,"byteOffset":76,"byteLength":32}},
        {{"buffer":0,"byteOffset":108,"byteLength":{picture}}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3"}},
        {{"bufferView":1,"componentType":5123,"count":6,"type":"SCALAR"}},
        {{"bufferView":2,"componentType":5121,"normalized":true,"count":4,"type":"VEC4"}},
        {{"bufferView":3,"componentType":5126,"count":4,"type":"VEC2"}},
        {{"componentType":5126,"count":4,"type":"VEC3","sparse":{{"count":2,"indices":{{"bufferView":1,"componentType":5123}},
        "values":{{"bufferView":0}}}}}}]{more}}}"#,
        square().len()
    )
}

/// A binary file of a document.
fn with_square(json: &[u8]) -> Vec<u8> {
    let mut json = json.to_vec();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut binary = square();
    binary.resize(binary.len().next_multiple_of(4), 0);
    let words = |words: &[u32]| words.iter().flat_map(|word| word.to_le_bytes()).collect::<Vec<u8>>();
    let length = 12 + 8 + json.len() + 8 + binary.len();
    let head = words(&[2, length as u32, json.len() as u32, 0x4e4f_534a]);
    [b"glTF", &head[..], &json, &words(&[binary.len() as u32, 0x004e_4942]), &binary].concat()
}

const TEXTURE: &str = r#","materials":[{"pbrMetallicRoughness":{"baseColorTexture":{"index":0},"baseColorFactor":[1,0.5,1,1]}}],
    "textures":[{"source":0,"sampler":0}],"samplers":[{"wrapS":33071,"wrapT":33648}],"images":[{"bufferView":4,"mimeType":"image/png"}]"#;

fn documents(buffer: &str) -> Vec<String> {
    let document = |primitive: &str, node: &str, more: &str| document(primitive, node, more, buffer);
    let two = document(
        "},\"indices\":1",
        r#","translation":[1,2,3]},{"children":[0],"scale":[2,2,-2],"rotation":[0,0,1,0]"#,
        "",
    );
    vec![
        document("},\"indices\":1", "", ""),
        document(r#","COLOR_0":2},"mode":5"#, r#","matrix":[1,0,0,0,0,1,0,0,0,0,1,0,5,6,7,1]"#, ""),
        document(r#","TEXCOORD_0":3},"material":0,"indices":1"#, "", TEXTURE),
        document(r#","NORMAL":0},"mode":6"#, "", ""),
        document("},\"mode\":0", "", "").replacen("\"POSITION\":0", "\"POSITION\":4", 1),
        two.replacen("\"scenes\":[{\"nodes\":[0]}]", "\"scenes\":[{\"nodes\":[1]}]", 1),
    ]
}

pub fn glb() -> Vec<Seed> {
    let wrapped = |text: String| Seed { name: "scene.glb".into(), bytes: text.into_bytes(), wrap: with_square };
    let mut seeds: Vec<Seed> = documents("").into_iter().map(wrapped).collect();
    seeds.push(Seed::plain("cloud.glb", gltf::write_cloud(&cloud())));
    seeds.push(Seed::plain("mesh.glb", gltf::write_mesh(&mesh())));
    seeds
}

pub fn gltf() -> Vec<Seed> {
    let uri = format!("\"uri\":\"data:application/octet-stream;base64,{}\",", STANDARD.encode(square()));
    documents(&uri).into_iter().map(|text| Seed::plain("scene.gltf", text)).collect()
}
