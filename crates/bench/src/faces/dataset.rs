//! A labelled set: `manifest.csv` and the models it names.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::Context;

use visage::faces::modes::LANDMARKS;
use visage::formats;
use visage::geometry::{Point3, Surface};

/// A row of the manifest.
pub struct Row {
    /// The model's path below the set's folder.
    pub file: String,
    /// Whether it is labelled a face.
    pub face: bool,
    /// Whether its landmarks are exact or published, not fitted or picked by hand.
    pub landmarks_hold: bool,
    /// The landmarks it has.
    pub landmarks: BTreeMap<&'static str, Point3>,
}

/// The rows with ambiguous = 0.
pub fn read(folder: &Path) -> anyhow::Result<Vec<Row>> {
    let path = folder.join("manifest.csv");
    let text = std::fs::read_to_string(&path)
        .with_context(|| format!("{} can't be read; --data names a folder with a manifest.csv", path.display()))?;
    let mut lines = text.lines().map(split_csv);
    let header = lines.next().context("the manifest is empty")?;
    let rows = lines.map(|fields| header.iter().cloned().zip(fields).collect::<BTreeMap<String, String>>());
    rows.filter(|row| field(row, "ambiguous") == "0").map(|row| parsed(&row)).collect()
}

/// The model of a row.
pub fn load(folder: &Path, row: &Row) -> anyhow::Result<Surface> {
    let path = folder.join(&row.file);
    let bytes = std::fs::read(&path).with_context(|| format!("{} can't be read", path.display()))?;
    formats::read_surface(&row.file, &bytes, &formats::ReadLimits::default())
        .with_context(|| format!("{} can't be understood", path.display()))
}

fn field<'a>(row: &'a BTreeMap<String, String>, name: &str) -> &'a str {
    row.get(name).map_or("", String::as_str)
}

fn parsed(row: &BTreeMap<String, String>) -> anyhow::Result<Row> {
    let file = field(row, "file").to_owned();
    let method = field(row, "landmark_method");
    let mut landmarks = BTreeMap::new();
    for name in LANDMARKS {
        let numbers: Result<Vec<f64>, _> = field(row, name).split_whitespace().map(str::parse).collect();
        let numbers = numbers.with_context(|| format!("{name} of {file} is no position"))?;
        if let Ok(place) = <[f64; 3]>::try_from(numbers) {
            landmarks.insert(name, Point3::from(place));
        }
    }
    let landmarks_hold = method == "exact" || method.starts_with("published");
    Ok(Row { face: field(row, "label") == "face", file, landmarks_hold, landmarks })
}

/// Splits at commas that are not inside quotes.
fn split_csv(line: &str) -> Vec<String> {
    let (mut fields, mut quoted) = (vec![String::new()], false);
    for character in line.chars() {
        match (character, fields.last_mut()) {
            ('"', _) => quoted = !quoted,
            (',', _) if !quoted => fields.push(String::new()),
            (other, Some(last)) => last.push(other),
            (_, None) => {}
        }
    }
    fields
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quoted_commas_do_not_split() {
        assert_eq!(split_csv("a,\"b, c\",,d"), ["a", "b, c", "", "d"]);
    }
}
