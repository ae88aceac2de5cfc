//! The parts of a glTF document that are read.

use std::borrow::Cow;
use std::collections::BTreeMap;

use serde::Deserialize;
use serde::de::IgnoredAny;

use super::REPAIR;
use crate::FormatError;
use crate::budget::Budget;

/// What a thing of the document takes at most (bytes): a node with its matrix.
const THING: usize = 512;

#[derive(Deserialize)]
pub(super) struct Document<'a> {
    #[serde(borrow, default)]
    pub buffers: Vec<Buffer<'a>>,
    #[serde(default, rename = "bufferViews")]
    pub views: Vec<BufferView>,
    #[serde(default)]
    pub accessors: Vec<Accessor>,
    #[serde(default)]
    pub meshes: Vec<Mesh>,
    #[serde(default)]
    pub nodes: Vec<Node>,
    #[serde(default)]
    pub scenes: Vec<Scene>,
    pub scene: Option<usize>,
    #[serde(default)]
    pub materials: Vec<Material>,
    #[serde(default)]
    pub textures: Vec<Texture>,
    #[serde(borrow, default)]
    pub images: Vec<Image<'a>>,
    #[serde(default)]
    pub samplers: Vec<Sampler>,
    #[serde(default, rename = "extensionsRequired")]
    pub required: Vec<String>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Buffer<'a> {
    pub byte_length: u64,
    #[serde(borrow)]
    pub uri: Option<Cow<'a, str>>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct BufferView {
    pub buffer: usize,
    #[serde(default)]
    pub byte_offset: u64,
    pub byte_length: u64,
    pub byte_stride: Option<u64>,
    #[serde(default)]
    pub extensions: BTreeMap<String, IgnoredAny>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Accessor {
    pub buffer_view: Option<usize>,
    #[serde(default)]
    pub byte_offset: u64,
    pub component_type: u32,
    #[serde(default)]
    pub normalized: bool,
    pub count: u64,
    #[serde(rename = "type")]
    pub kind: String,
    pub sparse: Option<Sparse>,
}

#[derive(Deserialize)]
pub(super) struct Sparse {
    pub count: u64,
    pub indices: SparsePart,
    pub values: SparsePart,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct SparsePart {
    pub buffer_view: usize,
    #[serde(default)]
    pub byte_offset: u64,
    pub component_type: Option<u32>,
}

#[derive(Deserialize)]
pub(super) struct Mesh {
    #[serde(default)]
    pub primitives: Vec<Primitive>,
}

#[derive(Deserialize)]
pub(super) struct Primitive {
    #[serde(default)]
    pub attributes: BTreeMap<String, usize>,
    pub indices: Option<usize>,
    pub mode: Option<u32>,
    pub material: Option<usize>,
    #[serde(default)]
    pub extensions: BTreeMap<String, IgnoredAny>,
}

#[derive(Deserialize)]
pub(super) struct Node {
    pub mesh: Option<usize>,
    #[serde(default)]
    pub children: Vec<usize>,
    pub matrix: Option<[f64; 16]>,
    pub translation: Option<[f64; 3]>,
    pub rotation: Option<[f64; 4]>,
    pub scale: Option<[f64; 3]>,
    #[serde(default)]
    pub extensions: BTreeMap<String, IgnoredAny>,
}

#[derive(Deserialize)]
pub(super) struct Scene {
    #[serde(default)]
    pub nodes: Vec<usize>,
}

#[derive(Deserialize)]
pub(super) struct Material {
    #[serde(rename = "pbrMetallicRoughness")]
    pub surface: Option<Pbr>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Pbr {
    pub base_color_factor: Option<[f64; 4]>,
    pub base_color_texture: Option<TextureUse>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct TextureUse {
    pub index: usize,
    #[serde(default)]
    pub tex_coord: u32,
    #[serde(default)]
    pub extensions: TextureExtensions,
}

#[derive(Deserialize, Default)]
pub(super) struct TextureExtensions {
    #[serde(rename = "KHR_texture_transform")]
    pub transform: Option<TextureTransform>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct TextureTransform {
    #[serde(default)]
    pub offset: [f64; 2],
    #[serde(default)]
    pub rotation: f64,
    pub scale: Option<[f64; 2]>,
    pub tex_coord: Option<u32>,
}

#[derive(Deserialize)]
pub(super) struct Texture {
    pub source: Option<usize>,
    pub sampler: Option<usize>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Image<'a> {
    #[serde(borrow)]
    pub uri: Option<Cow<'a, str>>,
    pub buffer_view: Option<usize>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Sampler {
    pub wrap_s: Option<u32>,
    pub wrap_t: Option<u32>,
}

/// Parses the text. What it may take is counted from its braces before.
pub(super) fn parse<'a>(json: &'a [u8], budget: &mut Budget) -> Result<Document<'a>, FormatError> {
    budget.take_description(memchr::memchr_iter(b'{', json).count() as u64, THING)?;
    // lists of numbers and of names
    budget.take_description(memchr::memchr2_iter(b',', b'[', json).count() as u64, 2 * size_of::<String>())?;
    serde_json::from_slice(json).map_err(|error| {
        let place = format!("line {}, column {}", error.line(), error.column());
        let problem = format!("it is no glTF: {error}");
        FormatError::malformed(place, problem, "send a glTF 2.0 file")
    })
}

/// Extensions that change how things look and not where they are.
const HARMLESS: &[&str] =
    &["KHR_materials_", "KHR_texture_", "EXT_texture_", "MSFT_texture_", "KHR_lights_", "KHR_mesh_quantization"];

/// Refuses what can't be read without an extension that is not read here.
pub(super) fn check_extensions(document: &Document) -> Result<(), FormatError> {
    let is_harmless = |name: &str| HARMLESS.iter().any(|known| name.starts_with(known));
    let required = document.required.iter().find(|name| !is_harmless(name));
    let of_views = document.views.iter().flat_map(|view| view.extensions.keys());
    let of_nodes = document.nodes.iter().flat_map(|node| node.extensions.keys());
    let changes = of_views.chain(of_nodes).find(|name| name.contains("meshopt") || name.contains("gpu_instancing"));
    let primitives = document.meshes.iter().flat_map(|mesh| &mesh.primitives);
    let packed = primitives.flat_map(|primitive| primitive.extensions.keys()).find(|name| name.contains("draco"));
    match required.or(changes).or(packed) {
        Some(name) => Err(extension(name)),
        None => Ok(()),
    }
}

fn extension(name: &str) -> FormatError {
    let (what, remedy) = if name.contains("draco") {
        ("geometry compressed by Draco", "export without Draco compression (`gltf-transform copy` unpacks it too)")
    } else if name.contains("meshopt") {
        ("geometry compressed by meshopt", "export without meshopt compression (`gltf-transform copy` unpacks it too)")
    } else if name.contains("instancing") {
        ("instances", "export with instances applied")
    } else {
        ("an extension that is not read here", "export it as plain glTF 2.0")
    };
    let problem = format!("the file has {what} ({:.60})", name.escape_debug().to_string());
    FormatError::malformed("extensions", problem, remedy)
}

/// One of a list, by its index.
pub(super) fn at<'a, T>(list: &'a [T], what: &str, index: usize) -> Result<&'a T, FormatError> {
    list.get(index).ok_or_else(|| {
        let problem = format!("it is named, but there are {}", list.len());
        FormatError::malformed(format!("{what} {index}"), problem, REPAIR)
    })
}
