//! Names of columns as programs write them, with the unit that may stand behind.

use super::dialect::{Dialect, Separator};
use crate::points::{self, COLOR, INTENSITY, NORMAL, X};
use crate::quote;
use visage_geometry::Unit;

/// A name in a header line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Name {
    /// What the column holds, if it is known here.
    pub(super) slot: Option<usize>,
    /// The unit of lengths that stands behind the name.
    pub(super) unit: Option<Unit>,
}

impl Name {
    /// `x`, `"X"`, `x[mm]`, `X (m)`, `Points:0`, `Normals_2`.
    pub(super) fn of(word: &str) -> Self {
        let word = word.trim_matches([' ', '"', '\'', '*', ',']).to_ascii_lowercase();
        let unit_start = word.find(['[', '(']).unwrap_or(word.len());
        let (name, unit) = word.split_at(unit_start);
        let unit = unit.trim_matches(['[', ']', '(', ')', ' ']).parse().ok().filter(|unit| *unit != Unit::Unknown);
        Name { slot: slot_of(name.trim().trim_end_matches([':', '_'])), unit }
    }
}

/// The slot of a column: names that all formats know, and those of tables.
fn slot_of(name: &str) -> Option<usize> {
    if let Some((array, component)) = name.rsplit_once([':', '_'])
        && let (Some(first), Ok(component @ 0..3)) = (array_slot(array), component.parse::<usize>())
    {
        return Some(first + component);
    }
    Some(match name {
        "pos_x" | "position_x" | "coord_x" | "x_coord" | "point_x" | "px" => X,
        "pos_y" | "position_y" | "coord_y" | "y_coord" | "point_y" | "py" => X + 1,
        "pos_z" | "position_z" | "coord_z" | "z_coord" | "point_z" | "pz" => X + 2,
        "rf" | "rd" => COLOR,
        "gf" | "gn" => COLOR + 1,
        "bf" | "bu" => COLOR + 2,
        "i" | "int" | "remission" => INTENSITY,
        _ => return points::slot_of(name).filter(|slot| *slot != points::PACKED),
    })
}

/// The first slot of an array whose components are columns, as ParaView writes them.
fn array_slot(array: &str) -> Option<usize> {
    match array {
        "points" | "coordinates" | "position" | "point" => Some(X),
        "normals" | "normal" => Some(NORMAL),
        "rgb" | "colors" | "color" => Some(COLOR),
        _ => None,
    }
}

/// The names of a header line that has as many as there are columns; comment signs in front are passed over.
pub(super) fn names_of(line: &[u8], dialect: &Dialect, columns: usize) -> Option<Vec<Name>> {
    // what is longer names no columns
    let text = String::from_utf8_lossy(&line[..line.len().min(1 << 16)]);
    let text = text.trim_start_matches(['#', '/', '%', ';', ' ']);
    let blanks = Dialect { separator: Separator::Blanks, decimal_comma: false };
    let commas = Dialect { separator: Separator::Comma, ..blanks };
    // a comment may part its words by other signs than the rows
    [*dialect, blanks, commas].iter().find_map(|dialect| {
        let mut fields = dialect.fields(text.as_bytes());
        // rows may end with a separator where the names don't, and the other way round
        while fields.len() > columns && fields.last().is_some_and(|field| field.is_empty()) {
            fields.pop();
        }
        let names = || fields.iter().map(|field| Name::of(&String::from_utf8_lossy(field))).collect();
        (fields.len() == columns).then(names)
    })
}

/// Whether these columns hold positions.
pub(super) fn have_positions(names: &[Name]) -> bool {
    (X..X + 3).all(|slot| names.iter().any(|name| name.slot == Some(slot)))
}

/// The unit of the positions, `None` if it isn't said.
///
/// # Errors
/// What is wrong if the axes have different ones.
pub(super) fn unit_of(names: &[Name], line: &[u8]) -> Result<Option<Unit>, String> {
    let mut units = names.iter().filter(|name| name.slot.is_some_and(|slot| slot < NORMAL)).map(|name| name.unit);
    let first = units.next().flatten();
    if units.all(|unit| unit == first) {
        return Ok(first);
    }
    Err(format!("the axes have different units: {}", quote(line)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_many_programs_are_known() {
        let slots = |line: &str, columns| {
            let names = names_of(line.as_bytes(), &Dialect::of(b"1 2 3"), columns).expect(line);
            names.iter().map(|name| name.slot.map_or(99, |slot| slot)).collect::<Vec<_>>()
        };
        assert_eq!(slots("//X Y Z R G B", 6), [0, 1, 2, 6, 7, 8]);
        assert_eq!(slots("# x, y, z, nx, ny, nz, intensity", 7), [0, 1, 2, 3, 4, 5, 9]);
        assert_eq!(
            slots("\"Points:0\",\"Points:1\",\"Points:2\",\"RGB:0\",\"RGB:1\",\"RGB:2\"", 6),
            [0, 1, 2, 6, 7, 8]
        );
        assert_eq!(slots("Normals_0 Normals_1 Normals_2 time", 4), [3, 4, 5, 99]);
        assert_eq!(slots("X,Y,Z,Red,Green,Blue,Reflectance,", 7), [0, 1, 2, 6, 7, 8, 9]);
        assert_eq!(names_of(b"a title", &Dialect::of(b"1 2 3"), 3), None);
    }

    #[test]
    fn units_stand_behind_the_names_and_must_agree() {
        let read = |line: &str| {
            let names = names_of(line.as_bytes(), &Dialect::of(b"1,2,3"), 3).expect(line);
            assert!(have_positions(&names), "{line}");
            unit_of(&names, line.as_bytes())
        };
        assert_eq!(read("x[mm],y[mm],z[mm]"), Ok(Some(Unit::Mm)));
        assert_eq!(read("X (m), Y (m), Z (m)"), Ok(Some(Unit::M)));
        assert_eq!(read("x,y,z"), Ok(None));
        assert!(read("x[mm],y[mm],z[m]").expect_err("two units").contains("different units"));
    }
}
