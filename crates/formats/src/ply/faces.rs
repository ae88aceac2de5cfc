//! Polygons and strips of triangles.

use super::body::{Body, Fault};
use super::header::{Element, Kind, Property, ScalarType};
use super::reader::{for_each_row, skip_element};
use crate::FormatError;
use crate::budget::Budget;
use crate::points::NONE;

/// The least triangles that room is made for.
const LEAST: usize = 1 << 10;

/// The triangles read so far.
pub(super) struct Faces {
    pub(super) triangles: Vec<[u32; 3]>,
    /// How many named a vertex that isn't there.
    pub(super) dropped: u64,
    /// Why faces of the file were not read.
    pub(super) note: Option<String>,
    vertices: u64,
    limit: u64,
}

impl Faces {
    /// None yet, over so many vertices; at most `limit`.
    pub(super) fn new(vertices: u64, limit: u64) -> Self {
        Faces { triangles: Vec::new(), dropped: 0, note: None, vertices, limit }
    }

    /// The index as it is kept: [`NONE`] for a vertex that isn't there.
    #[inline]
    fn vertex(&self, index: i64) -> u32 {
        match u64::try_from(index) {
            Ok(vertex) if vertex < self.vertices => vertex as u32,
            _ => NONE,
        }
    }

    #[inline]
    fn push(&mut self, triangle: [u32; 3], budget: &mut Budget) -> Result<(), Fault> {
        if triangle.contains(&NONE) {
            self.dropped += 1;
            return Ok(());
        }
        if self.triangles.len() == self.triangles.capacity() {
            self.grow(self.triangles.len().max(LEAST) as u64, budget)?;
        }
        self.triangles.push(triangle);
        Ok(())
    }

    /// Makes room for `more` triangles, as far as the limit allows.
    #[cold]
    fn grow(&mut self, more: u64, budget: &mut Budget) -> Result<(), FormatError> {
        let more = more.min(self.limit - self.triangles.len() as u64);
        if more == 0 {
            return Err(FormatError::TooLarge { what: "faces", found: self.limit + 1, limit: self.limit });
        }
        budget.take(more, size_of::<[u32; 3]>())?;
        self.triangles.reserve_exact(more as usize);
        Ok(())
    }
}

/// The list of vertices among the properties, with the types of its length and its items.
fn corner_list(properties: &[Property]) -> Option<(usize, ScalarType, ScalarType)> {
    properties.iter().enumerate().find_map(|(place, property)| {
        let name = property.name.to_ascii_lowercase().replace('_', "");
        let is_corners = matches!(name.as_str(), "vertexindices" | "vertexindex" | "vertexindexes");
        match property.kind {
            Kind::List { count, item } if is_corners && !item.is_float() => Some((place, count, item)),
            _ => None,
        }
    })
}

/// Calls `corner` with the length of the list of vertices, and then for each of its items, row by row.
fn for_each_corner<B: Body>(
    element: &Element,
    faces: &mut Faces,
    body: &mut B,
    mut corner: impl FnMut(&mut Faces, u64, i64) -> Result<(), Fault>,
) -> Result<(), FormatError> {
    let Some((place, count, item)) = corner_list(&element.properties) else {
        if element.count > 0 {
            let problem = "is not read: it has no list vertex_indices of whole numbers";
            faces.note = Some(format!("the element {} {problem}", element.name));
        }
        return skip_element(element, body);
    };
    for_each_row(element, body, |body| {
        body.begin_row()?;
        for (index, property) in element.properties.iter().enumerate() {
            if index != place {
                body.skip(property.kind)?;
                continue;
            }
            for k in 0..body.list_length(count)? {
                corner(faces, k, body.integer(item)?)?;
            }
        }
        body.end_row()
    })
}

/// Reads polygons, each as a fan around its first corner; with fewer than three corners one is nothing.
pub(super) fn read(
    element: &Element,
    faces: &mut Faces,
    budget: &mut Budget,
    body: &mut impl Body,
) -> Result<(), FormatError> {
    if element.count > 0 {
        faces.grow(element.count, budget)?;
    }
    let mut fan = [NONE; 2];
    for_each_corner(element, faces, body, |faces, k, index| {
        let vertex = faces.vertex(index);
        match k {
            0 | 1 => fan[k as usize] = vertex,
            _ => {
                faces.push([fan[0], fan[1], vertex], budget)?;
                fan[1] = vertex;
            }
        }
        Ok(())
    })
}

/// Reads strips: each vertex makes a triangle with the two before it, every other one wound the other way; -1 begins
/// a new strip. Triangles with a vertex twice join strips and are nothing.
pub(super) fn read_strips(
    element: &Element,
    faces: &mut Faces,
    budget: &mut Budget,
    body: &mut impl Body,
) -> Result<(), FormatError> {
    let (mut last, mut length) = ([NONE; 2], 0u64);
    for_each_corner(element, faces, body, |faces, k, index| {
        if k == 0 || index == -1 {
            length = 0;
        }
        if index == -1 {
            return Ok(());
        }
        let vertex = faces.vertex(index);
        let [a, b] = last;
        if length >= 2 && a != b && b != vertex && vertex != a {
            faces.push(if length % 2 == 0 { [a, b, vertex] } else { [b, a, vertex] }, budget)?;
        }
        last = [b, vertex];
        length += 1;
        Ok(())
    })
}
