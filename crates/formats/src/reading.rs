//! What a file gave, and what of it was not taken.

use std::fmt;

use visage_geometry::Surface;

/// A file that was read.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Reading {
    /// What it describes.
    pub surface: Surface,
    /// What of it was not taken.
    pub dropped: Dropped,
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
}
