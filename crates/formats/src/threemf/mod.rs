//! 3MF, the format of 3D printing: a zip archive with objects as XML, put together by components and a list of what is
//! to be built; with a unit, and perhaps colours.

mod model;
mod package;
mod writer;

#[cfg(test)]
mod tests;

use std::collections::HashMap;

use nalgebra::Matrix4;

use super::budget::Budget;
use super::colors::Channels;
use super::format::{BYTES, Content, Format, Reader, Writers};
use super::points::{COLOR, INTENSITY, Layout, NORMAL, Points, SLOTS, X};
use super::{FormatError, ReadLimits, Reading};
use model::{Model, Object, Part};
use package::Package;
use visage_geometry::Point3;
pub use writer::write_mesh;

/// Its line in the table of formats.
pub const FORMAT: Format = Format {
    name: "3MF",
    endings: &["3mf"],
    media_type: BYTES,
    holds: &[Content::Mesh, Content::Colors],
    reader: Reader::Surface(read),
    writers: Writers { mesh: Some(write_mesh), ..Writers::NONE },
};

const REPAIR: &str = "repair the file or export it again";
/// Components in components: no program goes so deep.
const MOST_DEPTH: usize = 32;

/// Reads what a file wants to be built, as one surface; of a file that doesn't say, all objects.
///
/// # Errors
/// [`FormatError::TooLarge`] and [`FormatError::TooManyBytes`] beyond the limits, before more than they allow is
/// unpacked; [`FormatError::Malformed`] with the part and the object for the rest: no zip archive, objects that aren't
/// there, words that are no numbers.
pub fn read(bytes: &[u8], limits: &ReadLimits) -> Result<Reading, FormatError> {
    let mut budget = limits.budget();
    let mut package = Package::new(bytes, limits)?;
    let root = package.root()?;
    let mut models = HashMap::new();
    let model = Model::read(&mut package, &root, limits, &mut budget)?;
    let unit = model.unit;
    let mut open: Vec<Placed> = Vec::new();
    for part in model.built().iter().rev() {
        open.push(Placed::new(part, &root, Matrix4::identity(), 0));
    }
    models.insert(root, model);
    // all parts first: only then it is known whether any has colours
    let mut placed = Vec::new();
    while let Some(part) = open.pop() {
        budget.take(1, size_of::<Placed>() + part.model.len())?;
        if !models.contains_key(&part.model) {
            let model = Model::read(&mut package, &part.model, limits, &mut budget)?;
            models.insert(part.model.clone(), model);
        }
        let object = object(&models, &part)?;
        if part.depth >= MOST_DEPTH {
            let problem = format!("components are more than {MOST_DEPTH} deep");
            return Err(FormatError::malformed(format!("object {}", part.object), problem, REPAIR));
        }
        for component in object.components.iter().rev() {
            open.push(Placed::new(component, &part.model, part.world_from_object, part.depth + 1));
        }
        if !object.vertices.is_empty() {
            placed.push(part);
        }
    }
    let mut reading = draw(&models, &placed, limits, &mut budget)?;
    reading.unit = Some(unit);
    Ok(reading)
}

/// An object where it is built.
struct Placed {
    /// The part of the package that it is in.
    model: String,
    object: u32,
    world_from_object: Matrix4<f64>,
    depth: usize,
}

impl Placed {
    fn new(part: &Part, model: &str, world_from_parent: Matrix4<f64>, depth: usize) -> Self {
        Placed {
            model: part.model.clone().unwrap_or_else(|| model.to_owned()),
            object: part.object,
            world_from_object: world_from_parent * part.parent_from_object,
            depth,
        }
    }
}

fn object<'a>(models: &'a HashMap<String, Model>, part: &Placed) -> Result<&'a Object, FormatError> {
    models.get(&part.model).and_then(|model| model.objects.get(&part.object)).ok_or_else(|| {
        let problem = format!("it is built, but {:.80} does not have it", part.model.escape_debug().to_string());
        FormatError::malformed(format!("object {}", part.object), problem, REPAIR)
    })
}

/// The placed objects as one surface.
fn draw(
    models: &HashMap<String, Model>,
    placed: &[Placed],
    limits: &ReadLimits,
    budget: &mut Budget,
) -> Result<Reading, FormatError> {
    let objects = placed.iter().map(|part| object(models, part)).collect::<Result<Vec<_>, _>>()?;
    let is_colored = objects.iter().any(|object| !object.colors.is_empty());
    let layout =
        Layout::of(|slot| slot < NORMAL || (is_colored && (COLOR..INTENSITY).contains(&slot)), |_| Channels::Bytes)?;
    let count = |of: fn(&Object) -> usize| objects.iter().map(|object| of(object) as u64).sum::<u64>();
    let (vertices, triangles) = (count(|object| object.vertices.len()), count(|object| object.triangles.len()));
    let limit = limits.most_points();
    if vertices > limit {
        return Err(FormatError::TooLarge { what: "points", found: vertices, limit });
    }
    if triangles > limits.max_faces {
        return Err(FormatError::TooLarge { what: "faces", found: triangles, limit: limits.max_faces });
    }
    budget.take(vertices, layout.bytes())?;
    budget.take(triangles, size_of::<[u32; 3]>())?;
    let mut points = Points::new(&layout, vertices as usize);
    let mut faces = Vec::with_capacity(triangles as usize);
    for (part, object) in placed.iter().zip(objects) {
        let first = points.seen() as u32;
        for (index, vertex) in object.vertices.iter().enumerate() {
            let mut values = [0.0; SLOTS];
            let place = part.world_from_object.transform_point(&Point3::from(*vertex));
            values[X..X + 3].copy_from_slice(place.coords.as_slice());
            let color = object.colors.get(index).copied().flatten();
            values[COLOR..INTENSITY].copy_from_slice(&color.map_or([f64::NAN; 3], |color| color.map(f64::from)));
            points.push(&values).map_err(|problem| {
                FormatError::malformed(format!("object {}, vertex {index}", part.object), problem, REPAIR)
            })?;
        }
        let turns = part.world_from_object.fixed_view::<3, 3>(0, 0).determinant() < 0.0;
        for triangle in &object.triangles {
            if triangle.iter().any(|vertex| *vertex as usize >= object.vertices.len()) {
                points.dropped.faces += 1;
                continue;
            }
            let [a, b, c] = triangle.map(|vertex| first + vertex);
            faces.push(if turns { [a, c, b] } else { [a, b, c] });
        }
    }
    points.finish(faces, None, None)
}
