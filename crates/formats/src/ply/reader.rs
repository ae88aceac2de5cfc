//! Rows of numbers to a [`Surface`](visage_geometry::Surface).

use super::body::{Ascii, Binary, Body, Fault};
use super::faces::{self, Faces};
use super::grid;
use super::header::{Element, Encoding, Header, Kind, Property, ScalarType};
use crate::budget::Budget;
use crate::colors::Channels;
use crate::points::{Layout, PACKED, Points, SLOTS, Values, slot_of};
use crate::{FormatError, ReadLimits, Reading, text_start};

/// Reads a PLY file: points with their attributes, triangles and the range grid, as far as the file has them.
///
/// Read of each vertex: `x y z` (any number type), `nx ny nz`, `red green blue` (or `r g b`, `diffuse_red` and so on,
/// of any type and range; or packed as `rgb`) and `intensity` (or `scalar_intensity`). Polygons are cut into fans of
/// triangles, strips of triangles (`tristrips`) are taken apart. Rows of an ASCII file need not be lines.
///
/// # Errors
/// [`FormatError::Truncated`] when the file declares more than it holds (checked before anything is allocated),
/// [`FormatError::TooLarge`] and [`FormatError::TooManyBytes`] beyond the limits, [`FormatError::Malformed`] with the
/// row and the line or byte for the rest: no vertices, words that are no numbers, coordinates that are too large.
pub fn read(bytes: &[u8], limits: &ReadLimits) -> Result<Reading, FormatError> {
    let header = Header::parse(bytes, text_start(bytes)?)?;
    header.check_counts((bytes.len() - header.body_start) as u64)?;
    let plan = Plan::new(&header, limits)?;
    match header.encoding {
        Encoding::Ascii => plan.read(Ascii::<false>::new(bytes, header.body_start)).or_else(|error| {
            // what is wrong is said of the rows as lines, which is how nearly all files are meant
            plan.read(Ascii::<true>::new(bytes, header.body_start)).map_err(|_| error)
        }),
        Encoding::LittleEndian => plan.read(Binary::<false>::new(bytes, header.body_start)),
        Encoding::BigEndian => plan.read(Binary::<true>::new(bytes, header.body_start)),
    }
}

/// What is to be read, after the header alone has been judged.
struct Plan<'a> {
    header: &'a Header,
    limits: &'a ReadLimits,
    vertices: &'a Element,
}

impl<'a> Plan<'a> {
    fn new(header: &'a Header, limits: &'a ReadLimits) -> Result<Self, FormatError> {
        let element = |name: &str| header.elements.iter().find(|e| e.name == name);
        let count = |name: &str| element(name).map_or(0, |e| e.count);
        let counts = [("points", count("vertex"), limits.most_points()), ("faces", count("face"), limits.max_faces)];
        for (what, found, limit) in counts {
            if found > limit {
                return Err(FormatError::TooLarge { what, found, limit });
            }
        }
        match element("vertex") {
            Some(vertices) if vertices.count > 0 => Ok(Plan { header, limits, vertices }),
            _ => Err(FormatError::malformed("header", "there are no vertices", "send a file with points")),
        }
    }

    fn read(&self, mut body: impl Body) -> Result<Reading, FormatError> {
        let mut budget = self.limits.budget();
        let mut points = None;
        let mut faces = Faces::new(self.vertices.count, self.limits.max_faces);
        let mut grid = grid::Grid::default();
        for element in &self.header.elements {
            body.begin_element();
            match element.name.as_str() {
                "vertex" if points.is_none() => points = Some(read_vertices(element, &mut budget, &mut body)?),
                "face" => faces::read(element, &mut faces, &mut budget, &mut body)?,
                "tristrips" => faces::read_strips(element, &mut faces, &mut budget, &mut body)?,
                "range_grid" => grid.read(self.header, element, self.vertices.count, &mut budget, &mut body)?,
                _ => skip_element(element, &mut body)?,
            }
            body.end_element().map_err(|fault| fault.at(&element.name, 0, element.count, &body))?;
        }
        body.end().map_err(|fault| fault.at("end", 0, 0, &body))?;
        let mut points = points
            .ok_or_else(|| FormatError::malformed("header", "there are no vertices", "send a file with points"))?;
        points.dropped.faces += faces.dropped;
        points.dropped.notes.extend(faces.note.into_iter().chain(grid.note));
        points.finish(faces.triangles, grid.grid, None)
    }
}

/// Calls `read` for each row of an element.
pub(super) fn for_each_row<B: Body>(
    element: &Element,
    body: &mut B,
    mut read: impl FnMut(&mut B) -> Result<(), Fault>,
) -> Result<(), FormatError> {
    for row in 0..element.count as usize {
        read(body).map_err(|fault| fault.at(&element.name, row, element.count, body))?;
    }
    Ok(())
}

pub(super) fn skip_element(element: &Element, body: &mut impl Body) -> Result<(), FormatError> {
    if element.properties.is_empty() {
        return Ok(());
    }
    for_each_row(element, body, |body| body.skip_row(&element.properties))
}

/// The slot of what is not kept.
const UNUSED: usize = SLOTS;

/// One vertex property: how it is read and where its value goes.
#[derive(Debug, Clone, Copy)]
struct Column {
    kind: Kind,
    slot: usize,
}

impl Column {
    fn of(property: &Property) -> Self {
        let slot = match property.kind {
            Kind::Scalar(_) => slot_of(&property.name).unwrap_or(UNUSED),
            Kind::List { .. } => UNUSED,
        };
        Column { kind: property.kind, slot }
    }

    fn channels(&self) -> Channels {
        match self.kind {
            Kind::Scalar(ScalarType::U8) => Channels::Bytes,
            Kind::Scalar(ScalarType::I8) => Channels::SignedBytes,
            Kind::Scalar(ScalarType::I16) => Channels::Whole(u32::from(i16::MAX.unsigned_abs())),
            Kind::Scalar(ScalarType::U16) => Channels::Whole(u32::from(u16::MAX)),
            Kind::Scalar(scalar) if !scalar.is_float() => Channels::Whole(u32::MAX),
            _ => Channels::Floats,
        }
    }
}

fn read_vertices(element: &Element, budget: &mut Budget, body: &mut impl Body) -> Result<Points, FormatError> {
    let columns: Vec<Column> = element.properties.iter().map(Column::of).collect();
    let column = |slot: usize| columns.iter().find(|column| column.slot == slot);
    let channels = |slot: usize| column(slot).map_or(Channels::Floats, Column::channels);
    let layout = Layout::of(|slot| column(slot).is_some(), channels)?;
    budget.take(element.count, layout.bytes())?;
    let mut points = Points::new(&layout, element.count as usize);
    // lists and packed colours are not just numbers
    let is_plain = |column: &Column| matches!(column.kind, Kind::Scalar(_)) && column.slot != PACKED;
    let slots: Vec<usize> = columns.iter().map(|column| column.slot).collect();
    let plain_slots = columns.iter().all(is_plain).then_some(&*slots);
    for_each_row(element, body, |body| read_vertex(&columns, plain_slots, &mut points, body))?;
    Ok(points)
}

#[inline]
fn read_vertex(
    columns: &[Column],
    plain_slots: Option<&[usize]>,
    points: &mut Points,
    body: &mut impl Body,
) -> Result<(), Fault> {
    let mut values: [f64; SLOTS + 1] = [0.0; SLOTS + 1];
    if !plain_slots.is_some_and(|slots| body.plain_row(slots, &mut values)) {
        body.begin_row()?;
        for column in columns {
            match column.kind {
                Kind::Scalar(scalar) if column.slot == PACKED => values[PACKED] = body.packed(scalar)?,
                Kind::Scalar(scalar) => values[column.slot] = body.number(scalar)?,
                list => body.skip(list)?,
            }
        }
        body.end_row()?;
    }
    let [kept @ .., _] = &values;
    let kept: &Values = kept;
    Ok(points.push(kept)?)
}

#[cfg(test)]
mod tests;
