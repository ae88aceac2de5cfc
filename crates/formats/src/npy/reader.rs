//! Arrays to a [`Surface`](visage_geometry::Surface).

use super::array::{Array, Kind, Scalar};
use crate::archive::{self, ArchiveLimits};
use crate::budget::Budget;
use crate::colors::Channels;
use crate::columns::guess::{Guess, SAMPLE, Triple};
use crate::points::{COLOR, INTENSITY, Layout, NORMAL, PACKED, Points, SLOTS, X, slot_of};
use crate::{FormatError, ReadLimits, Reading, quote};
use visage_geometry::RangeGrid;

const REPAIR: &str = "repair the file or save it again";
/// More columns than this are no measurements of a point.
const MOST_COLUMNS: usize = 64;
/// Arrays that a file may hold.
const MOST_ARRAYS: u64 = 1 << 10;

/// Reads an array of points: N x 3 or more columns, rows x columns x 3 or more for an organised scan, or structured with
/// fields `x`, `y`, `z`. What columns beyond the third hold is told as in text: whole numbers up to 255 are a colour, what has
/// the length 1 is a normal, and what leaves doubt is not taken.
///
/// # Errors
/// [`FormatError::Truncated`] when the array is longer than the file, [`FormatError::TooLarge`] and
/// [`FormatError::TooManyBytes`] beyond the limits, [`FormatError::Malformed`] for arrays of another form or type.
pub fn read(bytes: &[u8], limits: &ReadLimits) -> Result<Reading, FormatError> {
    let array = Array::parse(bytes)?;
    let mut slots = Sources::default();
    slots.points(&array)?;
    slots.surface(&array, None, limits)
}

/// Reads a file of several arrays: `points` (or `xyz`, `pcd`, `vertices`), and as far as they are there `normals`, `colors`,
/// `intensities` and `faces`.
///
/// # Errors
/// As [`read`]; [`FormatError::Malformed`] when no array has such a name, or others don't have as many rows.
pub fn read_npz(bytes: &[u8], limits: &ReadLimits) -> Result<Reading, FormatError> {
    let bounds =
        ArchiveLimits { max_entries: MOST_ARRAYS, max_file_bytes: limits.max_bytes, max_total_bytes: limits.max_bytes };
    let contents = archive::entries("arrays.zip", bytes, &bounds)?;
    let named = |names: &[&str]| {
        let is_named = |path: &str| {
            let name = path.to_ascii_lowercase();
            name.strip_suffix(".npy").is_some_and(|name| names.contains(&name))
        };
        contents.entries.iter().find(|entry| is_named(&entry.path))
    };
    let parsed = |names: &[&str]| {
        let entry = named(names);
        entry.map(|entry| Array::parse(&entry.bytes).map_err(|error| in_array(&entry.path, error))).transpose()
    };
    let points = parsed(&["points", "xyz", "pcd", "vertices", "verts", "positions", "pos"])?;
    let only = || contents.entries.iter().find(|_| contents.entries.len() == 1);
    let points = match points {
        Some(points) => points,
        None => match only() {
            Some(entry) => Array::parse(&entry.bytes).map_err(|error| in_array(&entry.path, error))?,
            None => {
                let names: Vec<&str> = contents.entries.iter().map(|entry| entry.path.as_str()).take(8).collect();
                let problem = format!("none of its arrays is named points: {}", quote(names.join(", ").as_bytes()));
                return Err(FormatError::malformed("the list of arrays", problem, "save the points as `points`"));
            }
        },
    };
    let mut sources = Sources::default();
    sources.points(&points)?;
    let attributes = [
        (&["normals", "normal"][..], NORMAL, 3),
        (&["colors", "color", "rgb"], COLOR, 3),
        (&["intensities", "intensity"], INTENSITY, 1),
    ];
    let mut arrays = Vec::new();
    for (names, slot, columns) in attributes {
        if let Some(array) = parsed(names)? {
            let has_columns = array.columns() >= columns || (columns == 1 && array.shape.len() == 1);
            // rows alone of an array without columns
            let rows = if array.shape.len() == 1 { array.shape[0] } else { array.rows() };
            if !has_columns || rows != points.rows() {
                let problem = format!("{} is {:?}, the points are {:?}", names[0], array.shape, points.shape);
                return Err(FormatError::malformed("the list of arrays", problem, "save arrays of equal length"));
            }
            arrays.push((slot, columns, array));
        }
    }
    let faces = parsed(&["faces", "triangles"])?;
    sources.attributes = arrays;
    sources.surface(&points, faces.as_ref(), limits)
}

fn in_array(path: &str, error: FormatError) -> FormatError {
    match error {
        FormatError::Malformed { place, problem, remedy } => {
            FormatError::malformed(format!("array {}, {place}", quote(path.as_bytes())), problem, remedy)
        }
        other => other,
    }
}

/// Reads one value of any row.
type ValueReader<'a> = Box<dyn Fn(u64) -> f64 + 'a>;

/// Where the values of points come from.
#[derive(Default)]
struct Sources<'a> {
    /// Slots and columns of the array of points.
    columns: Vec<(usize, usize)>,
    guess: Guess,
    /// First slots, how many, and arrays of their own.
    attributes: Vec<(usize, usize, Array<'a>)>,
    notes: Vec<String>,
}

impl<'a> Sources<'a> {
    /// Finds out what the columns of the array of points are.
    fn points(&mut self, array: &Array) -> Result<(), FormatError> {
        if array.is_structured {
            let mut first = 0;
            for field in &array.fields {
                let slot = slot_of_field(&field.name, field.count);
                if let Some((slot, count)) = slot.filter(|_| field.scalar.kind != Kind::Other) {
                    self.columns.extend((0..count).map(|k| (slot + k, first + k)));
                }
                first += field.count;
            }
            return Ok(());
        }
        let columns = array.columns();
        let form = format!("{:?}", array.shape);
        if array.shape.len() < 2 || !(3..=MOST_COLUMNS).contains(&columns) || !array.has_rows() {
            let problem = format!("its shape is {form}, not points x 3 or more");
            return Err(FormatError::malformed("header", problem, "save an array of shape (points, 3)"));
        }
        self.columns = (0..3).map(|axis| (X + axis, axis)).collect();
        let values: Vec<_> = (0..columns).map(|column| array.column(column)).collect();
        let row = |row: u64| values.iter().map(|value| value(row)).collect::<Vec<f64>>();
        let sample: Vec<Vec<f64>> = (0..array.rows().min(SAMPLE as u64)).map(row).collect();
        // the first columns are known to be positions, whatever they look like
        let mut guess = Guess::of(&sample, columns, 3);
        let fits = |(column, triple): &(usize, Triple)| {
            let fits = |row| triple.fits([0, 1, 2].map(|k| values[column + k](row)));
            (0..array.rows()).all(fits)
        };
        guess.triples.retain(fits);
        for (column, triple) in &guess.triples {
            self.columns.extend((0..3).map(|k| (triple.slot() + k, column + k)));
        }
        if self.columns.len() < columns {
            let unused = columns - self.columns.len();
            self.notes.push(format!(
                "{unused} of {columns} columns are not used: nothing says for sure what is in there; save a structured array \
                 with fields such as x y z intensity"
            ));
        }
        self.guess = guess;
        Ok(())
    }

    fn surface(mut self, array: &Array, faces: Option<&Array>, limits: &ReadLimits) -> Result<Reading, FormatError> {
        let (rows, limit) = (array.rows(), limits.most_points());
        if rows > limit {
            return Err(FormatError::TooLarge { what: "points", found: rows, limit });
        }
        // an attribute with an array of its own does not come from a column too
        let own = |slot: usize| self.attributes.iter().any(|(first, count, _)| (*first..first + count).contains(&slot));
        self.columns.retain(|(slot, _)| !own(*slot));
        let mut readers: Vec<(usize, Scalar, ValueReader)> = Vec::new();
        for (slot, column) in &self.columns {
            if let Some(scalar) = array.scalar(*column) {
                readers.push((*slot, scalar, Box::new(array.column(*column))));
            }
        }
        for (slot, count, array) in &self.attributes {
            for k in 0..*count {
                if let Some(scalar) = array.scalar(k) {
                    readers.push((slot + k, scalar, Box::new(array.column(k))));
                }
            }
        }
        let reader = |slot: usize| readers.iter().find(|(of, _, _)| *of == slot);
        let is_guessed = self.guess.triples.iter().any(|(_, triple)| *triple == Triple::Color) && !own(COLOR);
        let channels = |slot| reader(slot).map_or(Channels::Floats, |(_, scalar, _)| channels(*scalar, is_guessed));
        let layout = Layout::of(|slot| reader(slot).is_some(), channels)?;
        let mut budget = limits.budget();
        budget.take(rows, layout.bytes())?;
        let mut points = Points::new(&layout, rows as usize);
        for row in 0..rows {
            let mut values = [0.0; SLOTS];
            for (slot, scalar, read) in &readers {
                let value = read(row);
                values[*slot] = if *slot == PACKED { packed(value, *scalar) } else { value };
            }
            let place = || format!("point {row}");
            points.push(&values).map_err(|problem| FormatError::malformed(place(), problem, REPAIR))?;
        }
        points.dropped.notes.append(&mut self.notes);
        let grid = grid_of(array, &mut budget)?;
        let faces = faces.map(|faces| triangles(faces, rows, limits, &mut budget, &mut points.dropped.faces));
        points.finish(faces.transpose()?.unwrap_or_default(), grid, None)
    }
}

/// The first slot of a field and how many it fills.
fn slot_of_field(name: &str, count: usize) -> Option<(usize, usize)> {
    match (name.to_ascii_lowercase().as_str(), count) {
        ("xyz" | "points" | "position" | "positions", 3) => Some((X, 3)),
        ("normal" | "normals" | "nxyz", 3) => Some((NORMAL, 3)),
        ("rgb" | "color" | "colors", 3) => Some((COLOR, 3)),
        (name, 1) => slot_of(name).map(|slot| (slot, 1)),
        _ => None,
    }
}

/// A packed colour from its number.
fn packed(value: f64, scalar: Scalar) -> f64 {
    crate::points::packed_color_of(value, scalar.kind == Kind::Float)
}

fn channels(scalar: Scalar, is_guessed: bool) -> Channels {
    match (scalar.kind, scalar.size) {
        _ if is_guessed => Channels::Bytes,
        (Kind::Unsigned, 1) => Channels::Bytes,
        (Kind::Unsigned, 2) => Channels::Whole(u32::from(u16::MAX)),
        (Kind::Unsigned | Kind::Signed, _) => Channels::Whole(u32::MAX),
        _ => Channels::Floats,
    }
}

/// The grid of an array of rows x columns x values.
fn grid_of(array: &Array, budget: &mut Budget) -> Result<Option<RangeGrid>, FormatError> {
    let (rows, columns) = match array.shape[..] {
        [rows, columns, _] if !array.is_structured => (rows, columns),
        [rows, columns] if array.is_structured => (rows, columns),
        _ => return Ok(None),
    };
    budget.take(array.rows(), size_of::<u32>())?;
    let pixels = (0..array.rows() as u32).collect();
    Ok(Some(RangeGrid { columns: columns as usize, rows: rows as usize, pixels }))
}

fn triangles(
    array: &Array,
    points: u64,
    limits: &ReadLimits,
    budget: &mut Budget,
    dropped: &mut u64,
) -> Result<Vec<[u32; 3]>, FormatError> {
    let (count, limit) = (array.rows(), limits.max_faces);
    if array.columns() != 3 || array.shape.len() != 2 || array.is_structured {
        let problem = format!("the faces are {:?}, not triangles x 3", array.shape);
        return Err(FormatError::malformed("the list of arrays", problem, "save triangles, or leave the faces out"));
    }
    if count > limit {
        return Err(FormatError::TooLarge { what: "faces", found: count, limit });
    }
    budget.take(count, size_of::<[u32; 3]>())?;
    let corners = [0, 1, 2].map(|corner| array.column(corner));
    let is_vertex = |index: f64| index >= 0.0 && index < points as f64 && index.fract() == 0.0;
    let mut faces = Vec::with_capacity(count as usize);
    for row in 0..count {
        let face = [corners[0](row), corners[1](row), corners[2](row)];
        if face.iter().all(|index| is_vertex(*index)) {
            faces.push(face.map(|index| index as u32));
        } else {
            *dropped += 1;
        }
    }
    Ok(faces)
}

#[cfg(test)]
mod tests;
