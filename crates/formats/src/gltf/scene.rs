//! The nodes of a scene, and what they draw as one surface.

use std::collections::HashMap;

use nalgebra::{Matrix3, Matrix4, Quaternion, UnitQuaternion};

use super::REPAIR;
use super::accessor::Buffers;
use super::document::{Document, Material, Node, Primitive, at};
use super::shapes::Mode;
use super::texture::Texture;
use crate::budget::Budget;
use crate::colors::Channels;
use crate::points::{COLOR, INTENSITY, Layout, NORMAL, Points, SLOTS, X};
use crate::{FormatError, ReadLimits, Reading};
use visage_geometry::{Point3, Vector3};

/// A primitive and where its node puts it.
struct Drawn<'a> {
    primitive: &'a Primitive,
    mode: Mode,
    position: usize,
    world_from_node: Matrix4<f64>,
    /// "mesh 0, primitive 1".
    place: String,
}

/// Reads the scene that is shown first.
pub(super) fn read(
    document: &Document,
    buffers: &Buffers,
    limits: &ReadLimits,
    mut budget: Budget,
) -> Result<Reading, FormatError> {
    let mut notes = Vec::new();
    let drawn = drawn(document, &mut budget, &mut notes)?;
    let textures = textures(document, buffers, &drawn, &mut budget, &mut notes)?;
    let has = |name: &str| drawn.iter().any(|drawn| drawn.primitive.attributes.contains_key(name));
    let is_colored = has("COLOR_0")
        || drawn.iter().any(|drawn| {
            let material = drawn.primitive.material;
            material.is_some_and(|index| textures.contains_key(&index)) || factor(document, material).is_some()
        });
    let layout = Layout::of(
        |slot| match slot {
            X..NORMAL => true,
            NORMAL..COLOR => has("NORMAL"),
            COLOR..INTENSITY => is_colored,
            INTENSITY => has("_INTENSITY"),
            _ => false,
        },
        |_| Channels::Bytes,
    )?;
    let points = Points::new(&layout, 0);
    let mut scene = Scene { source: Source { document, buffers, textures }, limits, layout, points, faces: Vec::new() };
    for drawn in &drawn {
        // what is read of a primitive is taken from a copy: it is given back behind it
        scene.draw(drawn, &mut budget)?;
    }
    scene.points.dropped.notes = notes;
    scene.points.finish(scene.faces, None, None)
}

/// All primitives of the scene in the order of its nodes.
fn drawn<'a>(
    document: &'a Document,
    budget: &mut Budget,
    notes: &mut Vec<String>,
) -> Result<Vec<Drawn<'a>>, FormatError> {
    let roots = match document.scenes.get(document.scene.unwrap_or(0)) {
        Some(scene) => scene.nodes.clone(),
        None => {
            let mut is_child = vec![false; document.nodes.len()];
            for child in document.nodes.iter().flat_map(|node| &node.children) {
                is_child.iter_mut().skip(*child).take(1).for_each(|is_child| *is_child = true);
            }
            (0..is_child.len()).filter(|node| !is_child[*node]).collect()
        }
    };
    let mut drawn = Vec::new();
    let mut lines = 0;
    let mut is_seen = vec![false; document.nodes.len()];
    let mut open: Vec<(usize, Matrix4<f64>)> = roots.iter().rev().map(|root| (*root, Matrix4::identity())).collect();
    while let Some((index, world_from_parent)) = open.pop() {
        let node = at(&document.nodes, "node", index)?;
        if std::mem::replace(&mut is_seen[index], true) {
            let problem = "it has two parents, or is its own";
            return Err(FormatError::malformed(format!("node {index}"), problem, REPAIR));
        }
        let world_from_node = world_from_parent * motion(node);
        open.extend(node.children.iter().rev().map(|child| (*child, world_from_node)));
        let Some(mesh) = node.mesh else { continue };
        for (number, primitive) in at(&document.meshes, "mesh", mesh)?.primitives.iter().enumerate() {
            let (Some(mode), Some(position)) = (Mode::of(primitive.mode), primitive.attributes.get("POSITION")) else {
                lines += 1;
                continue;
            };
            budget.take(1, size_of::<Drawn>() + 40)?;
            let place = format!("mesh {mesh}, primitive {number}");
            drawn.push(Drawn { primitive, mode, position: *position, world_from_node, place });
        }
    }
    if lines > 0 {
        notes.push(format!("{lines} primitives of lines or without positions"));
    }
    if drawn.is_empty() {
        let problem = "the scene draws no points and no triangles";
        return Err(FormatError::malformed("the whole file", problem, "export it with its meshes or points"));
    }
    Ok(drawn)
}

/// The motion of a node within its parent, whichever way it is written.
fn motion(node: &Node) -> Matrix4<f64> {
    if let Some(matrix) = node.matrix {
        return Matrix4::from_column_slice(&matrix);
    }
    let [x, y, z, w] = node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]);
    let rotation = UnitQuaternion::try_new(Quaternion::new(w, x, y, z), 0.0).unwrap_or_default();
    let scale = Matrix4::new_nonuniform_scaling(&Vector3::from(node.scale.unwrap_or([1.0; 3])));
    let translation = Matrix4::new_translation(&Vector3::from(node.translation.unwrap_or_default()));
    translation * rotation.to_homogeneous() * scale
}

/// The factor of a material's colour, in the scale of its pictures.
fn factor(document: &Document, material: Option<usize>) -> Option<[f64; 3]> {
    let [red, green, blue, _] = surface(document.materials.get(material?)?)?.base_color_factor?;
    // factors are of light, pictures are not
    let shown = |light: f64| {
        let light = light.clamp(0.0, 1.0);
        if light <= 0.0031308 { 12.92 * light } else { 1.055 * light.powf(1.0 / 2.4) - 0.055 }
    };
    Some([red, green, blue].map(shown))
}

fn surface(material: &Material) -> Option<&super::document::Pbr> {
    material.surface.as_ref()
}

/// The textures of the materials that are used, by material.
fn textures<'a>(
    document: &'a Document,
    buffers: &Buffers,
    drawn: &[Drawn],
    budget: &mut Budget,
    notes: &mut Vec<String>,
) -> Result<HashMap<usize, Texture<'a>>, FormatError> {
    let mut textures = HashMap::new();
    let mut used: Vec<usize> = drawn.iter().filter_map(|drawn| drawn.primitive.material).collect();
    used.sort_unstable();
    used.dedup();
    for index in used {
        let material = at(&document.materials, "material", index)?;
        let Some(used) = surface(material).and_then(|surface| surface.base_color_texture.as_ref()) else { continue };
        match Texture::read(document, buffers, used, budget)? {
            Ok(texture) => {
                textures.insert(index, texture);
            }
            Err(reason) => notes.push(format!("colours of material {index}: {reason}")),
        }
    }
    Ok(textures)
}

/// Where the values of vertices come from.
struct Source<'a> {
    document: &'a Document<'a>,
    buffers: &'a Buffers<'a>,
    textures: HashMap<usize, Texture<'a>>,
}

/// What has been drawn so far.
struct Scene<'a> {
    source: Source<'a>,
    limits: &'a ReadLimits,
    layout: Layout,
    points: Points,
    faces: Vec<[u32; 3]>,
}

impl Scene<'_> {
    fn draw(&mut self, drawn: &Drawn, budget: &mut Budget) -> Result<(), FormatError> {
        let Drawn { primitive, mode, position, place, .. } = drawn;
        let count = self.source.buffers.count(*position)?;
        let corners = match primitive.indices {
            Some(indices) => self.source.buffers.count(indices)?,
            None => count,
        };
        self.check("points", count, self.points.seen() as u64, self.limits.most_points())?;
        let triangles = mode.triangles(corners);
        self.check("faces", triangles, self.faces.len() as u64, self.limits.max_faces)?;
        // what is kept stays taken; what serves only this primitive is given back
        budget.take(count, self.layout.bytes())?;
        budget.take(triangles, size_of::<[u32; 3]>())?;
        let mut passing = budget.clone();
        let indices = primitive.indices.map(|index| self.source.buffers.indices(index, &mut passing)).transpose()?;
        passing.take(count, size_of::<u32>())?;
        let corner = |place: usize| match &indices {
            Some(indices) => indices.get(place).copied().unwrap_or(u32::MAX),
            None => place as u32,
        };
        let mut is_used = vec![*mode == Mode::Points || indices.is_none(); count as usize];
        for place in 0..indices.as_ref().map_or(0, Vec::len) {
            is_used.iter_mut().skip(corner(place) as usize).take(1).for_each(|is_used| *is_used = true);
        }
        let vertices = self.source.vertices(drawn, count, &mut passing)?;
        let first = self.points.seen() as u32;
        // where each vertex is among the points of the whole file
        let mut places = vec![u32::MAX; count as usize];
        let used = is_used.iter().enumerate().filter(|(_, is_used)| **is_used);
        for (point, (vertex, _)) in (first..).zip(used) {
            places[vertex] = point;
            self.points
                .push(&vertices.values(vertex))
                .map_err(|problem| FormatError::malformed(format!("{place}, vertex {vertex}"), problem, REPAIR))?;
        }
        let turns = drawn.world_from_node.fixed_view::<3, 3>(0, 0).determinant() < 0.0;
        for triangle in 0..triangles as usize {
            let vertex = |place| places.get(corner(place) as usize).copied().unwrap_or(u32::MAX);
            let [a, b, c] = mode.corners(triangle).map(vertex);
            if a.max(b).max(c) == u32::MAX {
                self.points.dropped.faces += 1;
            } else if a != b && b != c && c != a {
                // corners that are the same join parts of a strip
                self.faces.push(if turns { [a, c, b] } else { [a, b, c] });
            }
        }
        Ok(())
    }

    fn check(&self, what: &'static str, more: u64, there: u64, limit: u64) -> Result<(), FormatError> {
        let found = there.saturating_add(more);
        if found > limit { Err(FormatError::TooLarge { what, found, limit }) } else { Ok(()) }
    }
}

impl Source<'_> {
    /// The attributes of a primitive's vertices.
    fn vertices(&self, drawn: &Drawn, count: u64, budget: &mut Budget) -> Result<Vertices<'_>, FormatError> {
        let primitive = drawn.primitive;
        let has_count = |name: &str, index: usize| match self.buffers.count(index)? {
            found if found == count => Ok(()),
            found => {
                let problem = format!("{name} has {found} values for {count} vertices");
                Err(FormatError::malformed(drawn.place.clone(), problem, REPAIR))
            }
        };
        let attribute = |name: &str| -> Result<Option<usize>, FormatError> {
            let Some(index) = primitive.attributes.get(name) else { return Ok(None) };
            has_count(name, *index).map(|()| Some(*index))
        };
        let material = primitive.material;
        let texture = material.and_then(|index| self.textures.get(&index));
        let coordinates = match texture {
            Some(texture) => attribute(&texture.coordinates)?,
            None => None,
        };
        let colors = attribute("COLOR_0")?;
        let is_plain = |index: &usize| self.buffers.width(*index).is_ok_and(|width| width == 1);
        let linear = drawn.world_from_node.fixed_view::<3, 3>(0, 0).into_owned();
        let factor = factor(self.document, material);
        Ok(Vertices {
            world_from_node: drawn.world_from_node,
            // normals stay upright on what is stretched
            world_from_normals: linear.try_inverse().map(|inverse| inverse.transpose() * linear.determinant().signum()),
            positions: self.buffers.values(drawn.position, budget)?,
            normals: attribute("NORMAL")?.map(|index| self.buffers.values(index, budget)).transpose()?,
            colors: match colors {
                Some(index) => Some((self.buffers.values(index, budget)?, self.color_scale(index)?)),
                None => None,
            },
            intensities: attribute("_INTENSITY")?
                .filter(is_plain)
                .map(|index| self.buffers.values(index, budget))
                .transpose()?,
            texture: texture.zip(coordinates.map(|index| self.buffers.values(index, budget)).transpose()?),
            has_color: colors.is_some() || texture.is_some() || factor.is_some(),
            factor: factor.unwrap_or([1.0; 3]),
        })
    }

    /// What full light is in an accessor of colours: 1, or for whole numbers that are not said to be fractions what
    /// they hold.
    fn color_scale(&self, index: usize) -> Result<f64, FormatError> {
        let accessor = at(&self.document.accessors, "accessor", index)?;
        Ok(match (accessor.normalized, accessor.component_type) {
            (false, 5121) => 255.0,
            (false, 5123) => 65535.0,
            _ => 1.0,
        })
    }
}

/// The vertices of one primitive.
struct Vertices<'a> {
    world_from_node: Matrix4<f64>,
    world_from_normals: Option<Matrix3<f64>>,
    positions: Vec<[f32; 3]>,
    normals: Option<Vec<[f32; 3]>>,
    colors: Option<(Vec<[f32; 3]>, f64)>,
    intensities: Option<Vec<[f32; 1]>>,
    texture: Option<(&'a Texture<'a>, Vec<[f32; 2]>)>,
    has_color: bool,
    factor: [f64; 3],
}

impl Vertices<'_> {
    /// The values of a vertex in the frame of the scene; NaN for an attribute that it has not.
    fn values(&self, vertex: usize) -> [f64; SLOTS] {
        let mut values = [f64::NAN; SLOTS];
        let position = self.positions.get(vertex).map_or([f64::NAN; 3], |position| position.map(f64::from));
        let placed = self.world_from_node.transform_point(&Point3::from(position));
        values[X..X + 3].copy_from_slice(placed.coords.as_slice());
        if let (Some(normals), Some(turn)) = (&self.normals, &self.world_from_normals) {
            let normal = turn * Vector3::from(normals[vertex].map(f64::from));
            values[NORMAL..NORMAL + 3].copy_from_slice(normal.as_slice());
        }
        if let Some(intensities) = &self.intensities {
            values[INTENSITY] = f64::from(intensities[vertex][0]);
        }
        if self.has_color {
            let of_texture = match &self.texture {
                Some((texture, coordinates)) => texture.color(coordinates[vertex]).map(|color| color.map(f64::from)),
                None => Some([255.0; 3]),
            };
            let of_vertex = match &self.colors {
                Some((colors, full)) => colors[vertex].map(|channel| f64::from(channel) / full),
                None => [1.0; 3],
            };
            if let Some(color) = of_texture {
                for channel in 0..3 {
                    values[COLOR + channel] = color[channel] * of_vertex[channel] * self.factor[channel];
                }
            }
        }
        values
    }
}
