//! What holds of every answer, and the answer in words.

use visage_formats::{FormatError, Reading};
use visage_geometry::{MAX_COORDINATE, RangeGrid};

use super::bounds::LIMITS;

/// How answers of refused files begin.
pub const REFUSED: &str = "refused: ";

/// A reading is sound, a refusal short.
pub fn reading(result: Result<Reading, FormatError>) -> String {
    let reading = match result {
        Ok(reading) => reading,
        Err(error) => return refusal(&error),
    };
    let (surface, count) = (&reading.surface, reading.surface.cloud.len());
    assert!(count > 0 && count as u64 <= LIMITS.max_points && surface.faces.len() as u64 <= LIMITS.max_faces);
    assert!(surface.cloud.points.iter().all(|p| p.iter().all(|x| x.abs() <= MAX_COORDINATE)));
    assert!(surface.faces.iter().flatten().all(|vertex| (*vertex as usize) < count));
    assert!(surface.cloud.normals.as_ref().is_none_or(|normals| normals.len() == count));
    assert!(surface.cloud.normals.iter().flatten().all(|normal| normal.iter().all(|x| x.is_finite())));
    assert!(surface.cloud.colors.as_ref().is_none_or(|colors| colors.len() == count));
    assert!(surface.cloud.intensities.as_ref().is_none_or(|values| values.len() == count));
    assert!(surface.cloud.intensities.iter().flatten().all(|value| value.is_finite()));
    assert!(surface.sensor.is_none_or(|sensor| sensor.iter().all(|x| x.is_finite())));
    assert!(reading.unit.is_none_or(|unit| unit.metres.is_finite() && unit.metres > 0.0));
    if let Some(grid) = &surface.grid {
        assert_eq!(grid.columns * grid.rows, grid.pixels.len());
        assert!(grid.pixels.iter().all(|pixel| *pixel == RangeGrid::EMPTY || (*pixel as usize) < count));
    }
    // notes are for people
    assert!(reading.dropped.notes.iter().all(|note| note.len() < 2000), "{}", reading.dropped);
    let cloud = &surface.cloud;
    format!(
        "read: {} {} {} {} {} {} {} {}",
        !surface.faces.is_empty(),
        cloud.normals.is_some(),
        cloud.colors.is_some(),
        cloud.intensities.is_some(),
        surface.grid.is_some(),
        surface.sensor.is_some(),
        reading.unit.is_some(),
        reading.dropped,
    )
}

/// A refusal is for people: short, and of a kind that the reader may give.
pub fn refusal(error: &FormatError) -> String {
    let text = error.to_string();
    let is_of_names = matches!(error, FormatError::UnknownExtension { .. } | FormatError::Packed { .. });
    assert!(!is_of_names, "the name is known: {text}");
    assert!(text.len() < 1500, "{text}");
    format!("{REFUSED}{text}")
}
