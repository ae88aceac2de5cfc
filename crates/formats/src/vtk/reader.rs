//! The sections of a legacy VTK file to a [`Surface`](visage_geometry::Surface).

use super::arrays::{Cursor, Scalar, text_words};
use super::cells::{Cells, Shape, Triangles};
use crate::budget::Budget;
use crate::colors::Channels;
use crate::points::{COLOR, INTENSITY, Layout, NORMAL, Points, SLOTS, X, slot_of};
use crate::{FormatError, ReadLimits, Reading, quote, text_start};

const REPAIR: &str = "repair the file or export it again";
/// Components of a tuple at most: a tensor has nine.
const MOST_COMPONENTS: u64 = 1 << 12;

/// Reads a legacy VTK file: the points of a POLYDATA, UNSTRUCTURED_GRID or STRUCTURED_GRID; of their data normals, colours
/// and intensities; polygons, strips and cells that are surfaces.
///
/// # Errors
/// [`FormatError::Truncated`] when the file declares more than it holds (checked before anything is allocated),
/// [`FormatError::TooLarge`] and [`FormatError::TooManyBytes`] beyond the limits, [`FormatError::Malformed`] with the byte
/// for the rest: datasets without listed points, unknown keywords, words that are no numbers, lists of cells that don't add up.
pub fn read(bytes: &[u8], limits: &ReadLimits) -> Result<Reading, FormatError> {
    let mut cursor = Cursor::new(bytes, text_start(bytes)?);
    let first = cursor.any_line().unwrap_or_default();
    if !first.to_ascii_lowercase().starts_with(b"# vtk datafile") {
        let begins = if first.is_empty() { "nothing".into() } else { quote(first) };
        let problem = format!("a legacy VTK file begins with `# vtk DataFile`, this one with {begins}");
        return Err(FormatError::malformed("byte 0", problem, "send a legacy .vtk file, or PLY"));
    }
    // the title may be blank
    cursor.any_line();
    let encoding = cursor.line().unwrap_or_default();
    cursor.is_binary = match encoding.to_ascii_uppercase().as_slice() {
        b"ASCII" => false,
        b"BINARY" => true,
        _ => return Err(cursor.wrong(format!("ASCII or BINARY is expected, but here is {}", quote(encoding)))),
    };
    let mut file = File {
        cursor,
        limits,
        budget: limits.budget(),
        positions: Vec::new(),
        normals: Vec::new(),
        colors: None,
        intensities: Vec::new(),
        fans: Vec::new(),
        strips: Vec::new(),
        cells: Cells::default(),
        types: Vec::new(),
        section: Section::Dataset,
    };
    while let Some(line) = file.cursor.line() {
        file.section(line)?;
    }
    file.finish()
}

/// What the data that come next belong to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Section {
    Dataset,
    Points(u64),
    Cells(u64),
}

struct File<'a> {
    cursor: Cursor<'a>,
    limits: &'a ReadLimits,
    budget: Budget,
    positions: Vec<[f64; 3]>,
    /// Empty where the file has none.
    normals: Vec<[f32; 3]>,
    colors: Option<(Channels, Vec<[f32; 3]>)>,
    intensities: Vec<f32>,
    fans: Vec<Cells>,
    strips: Vec<Cells>,
    cells: Cells,
    types: Vec<Shape>,
    section: Section,
}

impl File<'_> {
    /// Reads what a line of keywords announces.
    fn section(&mut self, line: &[u8]) -> Result<(), FormatError> {
        let words = text_words(line);
        let keyword = words.first().map(|word| word.to_ascii_uppercase()).unwrap_or_default();
        let count = |place: usize| words.get(place).and_then(|word| word.parse::<u64>().ok());
        let broken = |file: &Self| file.cursor.wrong(format!("this line can't be read: {}", quote(line)));
        let needed = |place: usize, file: &Self| count(place).ok_or_else(|| broken(file));
        let scalar =
            |place: usize, file: &Self| words.get(place).and_then(|name| Scalar::of(name)).ok_or_else(|| broken(file));
        let name = words.get(1).copied().unwrap_or_default();
        match keyword.as_str() {
            "DATASET" => self.dataset(name),
            // those of a structured grid; how many points there are, POINTS says
            "DIMENSIONS" => Ok(()),
            "POINTS" => self.points(needed(1, self)?, scalar(2, self)?),
            "VERTICES" | "LINES" | "POLYGONS" | "TRIANGLE_STRIPS" | "CELLS" => {
                let counts = (needed(1, self)?, needed(2, self)?);
                let cells = Cells::read(&mut self.cursor, counts, &mut self.budget)?;
                match keyword.as_str() {
                    "POLYGONS" => self.fans.push(cells),
                    "TRIANGLE_STRIPS" => self.strips.push(cells),
                    "CELLS" => self.cells = cells,
                    _ => {}
                }
                Ok(())
            }
            "CELL_TYPES" => self.cell_types(needed(1, self)?),
            "POINT_DATA" | "CELL_DATA" => {
                let count = needed(1, self)?;
                self.section = if keyword == "POINT_DATA" { Section::Points(count) } else { Section::Cells(count) };
                Ok(())
            }
            "SCALARS" => {
                let components = count(3).unwrap_or(1);
                let scalar = scalar(2, self)?;
                if self.cursor.peek().is_some_and(|next| next.to_ascii_uppercase().starts_with(b"LOOKUP_TABLE")) {
                    self.cursor.line();
                }
                self.array(name, self.tuples(), components, scalar)
            }
            // fractions in text, bytes in binary files
            "COLOR_SCALARS" => {
                let scalar = if self.cursor.is_binary { Scalar::U8 } else { Scalar::F32 };
                self.array("rgb", self.tuples(), needed(2, self)?, scalar)
            }
            "LOOKUP_TABLE" => {
                let scalar = if self.cursor.is_binary { Scalar::U8 } else { Scalar::F32 };
                self.cursor.skip(needed(2, self)?.saturating_mul(4), scalar)
            }
            "NORMALS" => self.array("normals", self.tuples(), 3, scalar(2, self)?),
            "VECTORS" => self.array("", self.tuples(), 3, scalar(2, self)?),
            "TENSORS" => self.array("", self.tuples(), 9, scalar(2, self)?),
            "TENSORS6" => self.array("", self.tuples(), 6, scalar(2, self)?),
            "TEXTURE_COORDINATES" => self.array("", self.tuples(), needed(2, self)?, scalar(3, self)?),
            "GLOBAL_IDS" | "PEDIGREE_IDS" | "EDGE_FLAGS" => self.array("", self.tuples(), 1, scalar(2, self)?),
            "FIELD" => self.field(needed(2, self)?),
            // to the next blank line
            "METADATA" => {
                while self.cursor.any_line().is_some_and(|line| !line.is_empty()) {}
                Ok(())
            }
            _ => Err(self.cursor.wrong(format!("{} is no keyword that is known here", quote(line)))),
        }
    }

    fn dataset(&mut self, name: &str) -> Result<(), FormatError> {
        if ["POLYDATA", "UNSTRUCTURED_GRID", "STRUCTURED_GRID"].contains(&&*name.to_ascii_uppercase()) {
            return Ok(());
        }
        let problem = format!("a dataset {} does not list points of a surface", quote(name.as_bytes()));
        let place = format!("byte {}", self.cursor.position);
        Err(FormatError::malformed(place, problem, "export the surface as POLYDATA, or as PLY"))
    }

    /// Tuples that an array of this section has.
    fn tuples(&self) -> u64 {
        match self.section {
            Section::Dataset => 0,
            Section::Points(count) | Section::Cells(count) => count,
        }
    }

    fn points(&mut self, count: u64, scalar: Scalar) -> Result<(), FormatError> {
        let limit = self.limits.most_points();
        if count > limit {
            return Err(FormatError::TooLarge { what: "points", found: count, limit });
        }
        if !self.positions.is_empty() {
            return Err(self.cursor.wrong("there are two lists of points"));
        }
        self.positions = self.triples(count, 3, scalar)?;
        Ok(())
    }

    /// The first three components of so many tuples.
    fn triples(&mut self, count: u64, components: u64, scalar: Scalar) -> Result<Vec<[f64; 3]>, FormatError> {
        self.cursor.check(count.saturating_mul(components), scalar)?;
        self.budget.take(count, size_of::<[f64; 3]>())?;
        let mut all = Vec::with_capacity(count as usize);
        let (mut tuple, mut place) = ([0.0; 3], 0);
        self.cursor.numbers(count.saturating_mul(components), scalar, |value| {
            if let Some(component) = tuple.get_mut(place as usize) {
                *component = value;
            }
            place += 1;
            if place == components {
                all.push(tuple);
                place = 0;
            }
        })?;
        Ok(all)
    }

    fn cell_types(&mut self, count: u64) -> Result<(), FormatError> {
        self.cursor.check(count, Scalar::I32)?;
        self.budget.take(count, size_of::<Shape>())?;
        let types = &mut self.types;
        self.cursor.numbers(count, Scalar::I32, |value| types.push(Shape::of(value)))
    }

    /// Arrays with a name each; those of the points may be attributes.
    fn field(&mut self, arrays: u64) -> Result<(), FormatError> {
        for _ in 0..arrays {
            let Some(line) = self.cursor.line() else {
                let found = format!("byte {}", self.cursor.position);
                return Err(FormatError::Truncated { declared: format!("{arrays} arrays"), found });
            };
            let words = text_words(line);
            if words.first().is_some_and(|word| word.eq_ignore_ascii_case("METADATA")) {
                while self.cursor.any_line().is_some_and(|line| !line.is_empty()) {}
                continue;
            }
            let broken = || self.cursor.wrong(format!("an array is expected, but here is {}", quote(line)));
            let [name, components, tuples, kind] = words[..] else { return Err(broken()) };
            let (Ok(components), Ok(tuples)) = (components.parse::<u64>(), tuples.parse::<u64>()) else {
                return Err(broken());
            };
            match Scalar::of(kind) {
                Some(scalar) => self.array(name, tuples, components, scalar)?,
                None if kind.eq_ignore_ascii_case("string") => {
                    self.cursor.skip_texts(components.saturating_mul(tuples))?;
                }
                None => return Err(broken()),
            }
        }
        Ok(())
    }

    /// Reads an array: an attribute of the points if its name and form say so, else it is passed over.
    fn array(&mut self, name: &str, tuples: u64, components: u64, scalar: Scalar) -> Result<(), FormatError> {
        if components > MOST_COMPONENTS {
            return Err(FormatError::TooLarge { what: "components", found: components, limit: MOST_COMPONENTS });
        }
        let is_of_points = self.section == Section::Points(tuples) && tuples == self.positions.len() as u64;
        let name = name.to_ascii_lowercase();
        let is_color = ["rgb", "rgba", "color", "colors", "rgb_color", "diffuse"].contains(&name.as_str());
        let is_color = matches!(components, 3 | 4) && (is_color || scalar == Scalar::U8);
        let is_normal = components == 3 && ["normals", "normal", "normals_"].contains(&name.as_str());
        if is_of_points && is_normal && self.normals.is_empty() {
            let normals = self.triples(tuples, components, scalar)?;
            self.budget.take(tuples, size_of::<[f32; 3]>())?;
            self.normals = normals.iter().map(|normal| normal.map(|x| x as f32)).collect();
        } else if is_of_points && is_color && self.colors.is_none() {
            let colors = self.triples(tuples, components, scalar)?;
            self.budget.take(tuples, size_of::<[f32; 3]>())?;
            let colors = colors.iter().map(|color| color.map(|channel| channel as f32)).collect();
            self.colors = Some((channels(scalar), colors));
        } else if is_of_points && components == 1 && slot_of(&name) == Some(INTENSITY) && self.intensities.is_empty() {
            self.cursor.check(tuples, scalar)?;
            self.budget.take(tuples, size_of::<f32>())?;
            let intensities = &mut self.intensities;
            self.cursor.numbers(tuples, scalar, |value| intensities.push(value as f32))?;
        } else {
            self.cursor.skip(tuples.saturating_mul(components), scalar)?;
        }
        Ok(())
    }

    fn finish(mut self) -> Result<Reading, FormatError> {
        if self.positions.is_empty() {
            let problem = "there are no points";
            return Err(FormatError::malformed("the whole file", problem, "send a file with points"));
        }
        let has = |slot| match slot {
            X..NORMAL => true,
            NORMAL..COLOR => !self.normals.is_empty(),
            COLOR..INTENSITY => self.colors.is_some(),
            INTENSITY => !self.intensities.is_empty(),
            _ => false,
        };
        let channels = self.colors.as_ref().map_or(Channels::Floats, |(channels, _)| *channels);
        let layout = Layout::of(has, |_| channels)?;
        self.budget.take(self.positions.len() as u64, layout.bytes())?;
        let mut points = Points::new(&layout, self.positions.len());
        for (index, position) in self.positions.iter().enumerate() {
            let mut values = [0.0; SLOTS];
            values[X..X + 3].copy_from_slice(position);
            if let Some(normal) = self.normals.get(index) {
                values[NORMAL..NORMAL + 3].copy_from_slice(&normal.map(f64::from));
            }
            if let Some(color) = self.colors.as_ref().and_then(|(_, colors)| colors.get(index)) {
                values[COLOR..COLOR + 3].copy_from_slice(&color.map(f64::from));
            }
            values[INTENSITY] = self.intensities.get(index).copied().map_or(0.0, f64::from);
            let place = || format!("point {index}");
            points.push(&values).map_err(|problem| FormatError::malformed(place(), problem, REPAIR))?;
        }
        let mut triangles = Triangles::new(self.positions.len(), self.limits);
        for cells in &self.fans {
            triangles.take(cells, |_| Shape::Fan, &mut self.budget)?;
        }
        for cells in &self.strips {
            triangles.take(cells, |_| Shape::Strip, &mut self.budget)?;
        }
        if self.types.len() == self.cells.len() {
            triangles.take(&self.cells, |cell| self.types[cell], &mut self.budget)?;
        } else {
            points.dropped.notes.push("the cells are not used: their types are missing".into());
        }
        points.dropped.faces += triangles.dropped;
        if triangles.bodies > 0 {
            let note = format!("{} cells are not used: they are no triangles, polygons or strips", triangles.bodies);
            points.dropped.notes.push(note);
        }
        points.finish(triangles.faces, None, None)
    }
}

fn channels(scalar: Scalar) -> Channels {
    match scalar {
        Scalar::U8 => Channels::Bytes,
        Scalar::I8 => Channels::SignedBytes,
        Scalar::U16 => Channels::Whole(u32::from(u16::MAX)),
        Scalar::F32 | Scalar::F64 => Channels::Floats,
        _ => Channels::Whole(u32::MAX),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_geometry::Cloud;

    /// As VTK 4.2 writes a square with a normal and a colour a point.
    const TEXT: &str = "# vtk DataFile Version 4.2\nvtk output\nASCII\nDATASET POLYDATA\nPOINTS 4 float\n0 0 0 1 0 0 1 1 0\n\
        0 1 0.5 \n\nPOLYGONS 1 5\n4 0 1 2 3 \n\nTRIANGLE_STRIPS 1 5\n4 0 1 3 2\n\nCELL_DATA 2\nSCALARS part int\n\
        LOOKUP_TABLE default\n1 2\nPOINT_DATA 4\nNORMALS Normals float\n0 0 1 0 0 1 0 0 1 0 0 1\nCOLOR_SCALARS c 3\n1 0 0 0 1 0 \
        0 0 1 1 1 1\nFIELD FieldData 2\nintensity 1 4 double\n0 0.5 1 2\nname 1 2 string\na\nb c\nMETADATA\nINFORMATION 0\n\n\
        SCALARS time float 1\nLOOKUP_TABLE default\n0 1 2 3\n";

    fn read_bytes(bytes: &[u8]) -> Result<Reading, FormatError> {
        read(bytes, &ReadLimits::default())
    }

    /// The same in bytes, with the cells of version 5.1.
    fn binary() -> Vec<u8> {
        let floats = |values: &[f32]| values.iter().flat_map(|x| x.to_be_bytes()).collect::<Vec<u8>>();
        let ids = |values: &[i64]| values.iter().flat_map(|x| x.to_be_bytes()).collect::<Vec<u8>>();
        [
            b"# vtk DataFile Version 5.1\nvtk output\nBINARY\nDATASET POLYDATA\nPOINTS 4 float\n".to_vec(),
            floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.5]),
            b"\nMETADATA\nINFORMATION 1\nNAME L2_NORM_RANGE LOCATION vtkDataArray\nDATA 2 0 1\n\n".to_vec(),
            b"POLYGONS 2 4\nOFFSETS vtktypeint64\n".to_vec(),
            ids(&[0, 4]),
            b"\nCONNECTIVITY vtktypeint64\n".to_vec(),
            ids(&[0, 1, 2, 3]),
            b"\nTRIANGLE_STRIPS 2 4\nOFFSETS vtktypeint64\n".to_vec(),
            ids(&[0, 4]),
            b"\nCONNECTIVITY vtktypeint64\n".to_vec(),
            ids(&[0, 1, 3, 2]),
            b"\nPOINT_DATA 4\nSCALARS rgb unsigned_char 4\nLOOKUP_TABLE default\n".to_vec(),
            vec![255, 0, 0, 9, 0, 255, 0, 9, 0, 0, 255, 9, 255, 255, 255, 9],
            b"\nNORMALS Normals float\n".to_vec(),
            floats(&[0.0, 0.0, 1.0].repeat(4)),
            b"\nFIELD FieldData 1\nIntensity 1 4 double\n".to_vec(),
            [0.0f64, 0.5, 1.0, 2.0].iter().flat_map(|x| x.to_be_bytes()).collect(),
            b"\n".to_vec(),
        ]
        .concat()
    }

    #[test]
    fn text_and_bytes_of_every_version_say_the_same() {
        let reading = read_bytes(TEXT.as_bytes()).expect("text");
        let Cloud { points, normals, colors, intensities } = &reading.surface.cloud;
        assert_eq!((points.len(), points[3].z), (4, 0.5));
        assert_eq!(normals.as_ref().map(|n| n[0]), Some(nalgebra::Vector3::z()));
        assert_eq!(colors, &Some(vec![[255, 0, 0], [0, 255, 0], [0, 0, 255], [255, 255, 255]]));
        assert_eq!(intensities, &Some(vec![0.0, 0.5, 1.0, 2.0]));
        assert_eq!(reading.surface.faces, [[0, 1, 2], [0, 2, 3], [0, 1, 3], [3, 1, 2]]);
        assert!(reading.dropped.is_empty(), "{}", reading.dropped);
        assert_eq!(read_bytes(&binary()).as_ref(), Ok(&reading));
        assert_eq!(read_bytes(TEXT.replace('\n', "\r\n").as_bytes()).as_ref(), Ok(&reading));
    }

    #[test]
    fn cells_that_are_surfaces_are_taken() {
        let text = "# vtk DataFile Version 2.0\n\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 4 double\n0 0 0 1 0 0 0 1 0 1 1 0\n\
            CELLS 5 21\n3 0 1 2\n4 0 1 2 3\n4 0 1 3 2\n2 0 1\n3 0 1 9\nCELL_TYPES 5\n5 8 10 3 5\n";
        let reading = read_bytes(text.as_bytes()).expect("sound");
        assert_eq!(reading.surface.faces, [[0, 1, 2], [0, 1, 3], [0, 3, 2]]);
        assert_eq!((reading.dropped.faces, reading.dropped.notes.len()), (1, 1));
        let grid = "# vtk DataFile Version 2.0\nt\nASCII\nDATASET STRUCTURED_GRID\nDIMENSIONS 2 1 1\nPOINTS 2 int\n0 0 0 1 0 0\n";
        assert_eq!(read_bytes(grid.as_bytes()).expect("sound").surface.cloud.len(), 2);
    }

    #[test]
    fn what_is_wrong_is_named() {
        let cases = [
            ("", "byte 0: a legacy VTK file begins with `# vtk DataFile`, this one with nothing"),
            ("<VTKFile>", "byte 0: a legacy VTK file begins with `# vtk DataFile`, this one with \"<VTKFile>\""),
            ("# vtk DataFile Version 3.0\nt\nZIP\n", "byte 33: ASCII or BINARY is expected, but here is \"ZIP\""),
        ];
        for (text, start) in cases {
            let error = read_bytes(text.as_bytes()).expect_err(text).to_string();
            assert!(error.starts_with(start), "{error}");
        }
        let cases = [
            ("POLYDATA", "STRUCTURED_POINTS", "a dataset \"STRUCTURED_POINTS\" does not list points"),
            ("POINTS 4 float", "POINTS 99999999999 float", "99999999999 exceeds the limit"),
            ("POINTS 4 float", "POINTS 4444 float", "it declares 13332 numbers but ends within the"),
            ("POINTS 4 float", "POINTS 4 half", "this line can't be read: \"POINTS 4 half\""),
            ("POLYGONS 1 5", "POLYGONS 2 5", "5 numbers don't make 2 cells"),
            ("4 0 1 2 3", "9 0 1 2 3", "5 numbers don't make 1 cells"),
            ("1 1 0", "1 one 0", "\"one\" is no number"),
            ("1 1 0", "1 1e20 0", "point 2: y is 1e20, which is too large"),
            ("CELL_DATA 2", "CELL_DATUM 2", "\"CELL_DATUM 2\" is no keyword that is known here"),
        ];
        for (sound, broken, message) in cases {
            let error = read_bytes(TEXT.replacen(sound, broken, 1).as_bytes()).expect_err(broken).to_string();
            assert!(error.contains(message), "{error}");
        }
    }

    #[test]
    fn cut_or_changed_bytes_never_panic() {
        let whole = binary();
        for length in 0..whole.len() {
            let _ = read_bytes(&whole[..length]);
            for change in [0x01, 0x80, 0xff] {
                let mut changed = whole.clone();
                changed[length] ^= change;
                let _ = read_bytes(&changed);
            }
        }
    }
}
