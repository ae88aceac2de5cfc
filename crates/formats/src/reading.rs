//! What a file gave, and what of it was not taken.

use std::fmt;

use visage_geometry::{Motion, Surface, Unit};

/// A file that was read.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Reading {
    /// What it describes.
    pub surface: Surface,
    /// What of it was not taken.
    pub dropped: Dropped,
    /// The unit of its coordinates, where the file or its format says so.
    pub unit: Option<DeclaredUnit>,
}

/// One of the scans of a file that may hold several.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ScanReading {
    /// What the file calls it.
    pub name: Option<String>,
    /// The scan in its own frame.
    pub reading: Reading,
    /// Where it is in the frame that the file's scans share, if the file says so.
    pub world_from_scan: Option<Motion>,
}

impl From<Reading> for ScanReading {
    /// The only scan of a file.
    fn from(reading: Reading) -> Self {
        ScanReading { name: None, reading, world_from_scan: None }
    }
}

/// A unit of length as a file declares it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DeclaredUnit {
    /// Metres in one such unit.
    pub metres: f64,
}

impl DeclaredUnit {
    /// Metres.
    pub const METRE: DeclaredUnit = DeclaredUnit { metres: 1.0 };

    /// The same among the units that can be chosen, if it is one of them.
    pub fn unit(self) -> Option<Unit> {
        let is_same = |unit: &Unit| unit.in_mm().is_some_and(|mm| (self.metres * 1000.0 - mm).abs() <= 1e-9 * mm);
        [Unit::Mm, Unit::Cm, Unit::M, Unit::In].into_iter().find(is_same)
    }
}

/// What of a file was not taken, because it can't be used. Nothing else of the file is lost by it.
#[derive(Debug, Clone, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Dropped {
    /// Points without a return: a coordinate is NaN or infinite. They are left out.
    pub no_return: u64,
    /// Triangles that name a vertex which isn't there or is left out. They are left out.
    pub faces: u64,
    /// Points whose normal is not sound: they have none (0 0 0).
    pub normals: u64,
    /// Points whose colour is not sound: they are black.
    pub colors: u64,
    /// Points whose intensity is not sound: it is 0.
    pub intensities: u64,
    /// What else was passed over, in words.
    pub notes: Vec<String>,
}

impl Dropped {
    /// Adds what was not taken of another scan of the same file, `name` says of which.
    pub(super) fn add(&mut self, other: Dropped, name: &str) {
        self.no_return += other.no_return;
        self.faces += other.faces;
        self.normals += other.normals;
        self.colors += other.colors;
        self.intensities += other.intensities;
        self.notes.extend(other.notes.into_iter().map(|note| format!("{name}: {note}")));
    }

    /// Whether everything in the file was taken.
    pub fn is_empty(&self) -> bool {
        *self == Dropped::default()
    }
}

impl fmt::Display for Dropped {
    /// In one line, for people.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let counted = [
            (self.no_return, "points without a return left out"),
            (self.faces, "triangles without their vertices left out"),
            (self.normals, "points without a sound normal"),
            (self.colors, "points without a sound colour"),
            (self.intensities, "points without a sound intensity"),
        ];
        let counted = counted.iter().filter(|(count, _)| *count > 0).map(|(count, what)| format!("{count} {what}"));
        let all: Vec<String> = counted.chain(self.notes.iter().cloned()).collect();
        f.write_str(&all.join("; "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_dropped_is_said_in_one_line() {
        let dropped = Dropped { no_return: 3, colors: 1, notes: vec!["no grid".into()], ..Dropped::default() };
        assert_eq!(dropped.to_string(), "3 points without a return left out; 1 points without a sound colour; no grid");
        assert!(!dropped.is_empty() && Dropped::default().is_empty());
    }

    #[test]
    fn a_declared_unit_is_one_that_can_be_chosen_or_none() {
        let unit = |metres| DeclaredUnit { metres }.unit();
        assert_eq!((unit(1.0), unit(0.001), unit(0.0254)), (Some(Unit::M), Some(Unit::Mm), Some(Unit::In)));
        assert_eq!((unit(0.3048), unit(1e-6)), (None, None));
    }
}
