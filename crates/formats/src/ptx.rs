//! PTX of Leica: one or several scans in text, each a grid of points in the scanner's frame, and where the scanner was.
//!
//! A pixel that saw nothing is written as `0 0 0`. Pixels come column by column.

use super::budget::Budget;
use super::colors::Channels;
use super::format::{BYTES, Content, Format, Reader, Writers};
use super::points::{COLOR, INTENSITY, Layout, NORMAL, Points, SLOTS, X};
use super::text::{TextLines, has_fraction, numbers, words};
use super::{DeclaredUnit, FormatError, ReadLimits, ScanReading, checked_coordinate, quote, text_start};
use visage_geometry::se3::nearest_motion;
use visage_geometry::{Motion, Point3, RangeGrid};

/// Its line in the table of formats.
pub const FORMAT: Format = Format {
    name: "PTX",
    endings: &["ptx"],
    media_type: BYTES,
    holds: &[Content::Points, Content::Colors, Content::Intensities, Content::Grid, Content::Sensor, Content::Poses],
    reader: Reader::Scans(read),
    writers: Writers::NONE,
};

const REPAIR: &str = "repair the file or export it again";
/// The shortest row of a pixel: four digits, and what parts them.
const LEAST_ROW: u64 = 8;
/// How far (Frobenius) a rotation in the file may be from an exact one: its digits may be rounded to two decimals.
const ROUNDED: f64 = 3.0 * 0.5e-2;

/// Reads the scans of a PTX file: points in the frame of the scanner, intensities, colours, the grid, and the pose.
///
/// # Errors
/// [`FormatError::Truncated`] when the file declares more pixels than it holds (checked before anything is allocated),
/// [`FormatError::TooLarge`] and [`FormatError::TooManyBytes`] beyond the limits for all scans together,
/// [`FormatError::Malformed`] with the line for the rest: a header that is none, a matrix that is no rigid motion, rows
/// with more or fewer values than the first one, words that are no numbers.
pub fn read(bytes: &[u8], limits: &ReadLimits) -> Result<Vec<ScanReading>, FormatError> {
    let text = &bytes[text_start(bytes)?..];
    let mut file = File { lines: TextLines::new(text), limits, budget: limits.budget(), pixels: 0 };
    let mut scans: Vec<ScanReading> = Vec::new();
    let mut empty = Vec::new();
    while let Some(line) = file.lines.next_filled() {
        match file.scan(line)? {
            Some(mut scan) => {
                scan.reading.unit = Some(DeclaredUnit::METRE);
                scans.push(scan);
            }
            None => empty.push(scans.len() + empty.len() + 1),
        }
    }
    let Some(first) = scans.first_mut() else {
        let problem = "there are no points: no scan of it saw anything";
        return Err(FormatError::malformed("the whole file", problem, "send a PTX file with points"));
    };
    if let (Some(scan), count) = (empty.first(), empty.len()) {
        first
            .reading
            .dropped
            .notes
            .push(format!("{count} scans without a point are left out, the first is scan {scan}"));
    }
    // what knows of no poses writes the same one for all
    let pose = first.world_from_scan;
    if scans.len() > 1 && scans.iter().all(|scan| scan.world_from_scan == pose) {
        scans.iter_mut().for_each(|scan| scan.world_from_scan = None);
    }
    Ok(scans)
}

/// The file on the way.
struct File<'a> {
    lines: TextLines<'a>,
    limits: &'a ReadLimits,
    budget: Budget,
    /// Pixels of all scans so far.
    pixels: u64,
}

/// The values of a pixel's row, by how many there are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Row {
    count: usize,
    has_fractions: bool,
}

/// Values that a row has at most.
const MOST_VALUES: usize = 7;

impl<'a> File<'a> {
    fn wrong(&self, problem: impl Into<String>) -> FormatError {
        FormatError::malformed(format!("line {}", self.lines.number()), problem, REPAIR)
    }

    /// The next line, where `what` is expected.
    fn line(&mut self, what: &str) -> Result<&'a [u8], FormatError> {
        self.lines.next_filled().ok_or_else(|| FormatError::Truncated {
            declared: what.to_owned(),
            found: format!("line {}", self.lines.number()),
        })
    }

    /// So many numbers in a line of the header.
    fn header<const N: usize>(&mut self, what: &str) -> Result<[f64; N], FormatError> {
        let line = self.line(what)?;
        let mut values = [0.0; N];
        let count = numbers(line, &mut values).unwrap_or_default();
        if count < N || words(line).count() > N || values.iter().any(|x| !x.is_finite()) {
            return Err(self.wrong(format!("{what} has {N} numbers, but here is {}", quote(line))));
        }
        Ok(values)
    }

    /// A count, alone in its line.
    fn count(&self, line: &[u8], what: &str) -> Result<u64, FormatError> {
        let number = std::str::from_utf8(line).ok().and_then(|text| text.parse().ok());
        number.ok_or_else(|| self.wrong(format!("the number of {what} is expected, but here is {}", quote(line))))
    }

    /// Reads a scan, of which the first line is read; `None` if it saw nothing.
    fn scan(&mut self, first: &[u8]) -> Result<Option<ScanReading>, FormatError> {
        let columns = self.count(first, "columns")?;
        let line = self.line("the number of rows")?;
        let rows = self.count(line, "rows")?;
        // where the scanner is, and its axes, stand in the matrix again
        self.header::<3>("the place of the scanner")?;
        for _ in 0..3 {
            self.header::<3>("an axis of the scanner")?;
        }
        let mut matrix = [[0.0; 4]; 4];
        for row in &mut matrix {
            *row = self.header("a row of the matrix")?;
        }
        let motion = motion_of(matrix).map_err(|problem| self.wrong(problem))?;
        self.check_size(columns, rows)?;
        self.budget.take(1, size_of::<ScanReading>())?;
        if columns * rows == 0 {
            return Ok(None);
        }
        self.pixels(columns as usize, rows as usize, motion)
    }

    /// Checks the pixels that a scan declares, before anything is allocated.
    fn check_size(&mut self, columns: u64, rows: u64) -> Result<(), FormatError> {
        let left = self.lines.rest().len() as u64;
        // the last row may lack its line end
        let pixels = columns.checked_mul(rows).filter(|pixels| pixels.saturating_mul(LEAST_ROW) <= left + 1);
        let Some(pixels) = pixels else {
            return Err(FormatError::Truncated {
                declared: format!("{columns} x {rows} pixels"),
                found: format!("the {left} bytes after line {}", self.lines.number()),
            });
        };
        self.pixels = self.pixels.saturating_add(pixels);
        let limit = self.limits.most_points();
        if self.pixels > limit {
            return Err(FormatError::TooLarge { what: "points", found: self.pixels, limit });
        }
        Ok(())
    }

    fn pixels(&mut self, columns: usize, rows: usize, motion: Motion) -> Result<Option<ScanReading>, FormatError> {
        let pixels = columns * rows;
        let mut points = None;
        let mut first: Option<Row> = None;
        let mut has_points = false;
        for pixel in 0..pixels {
            let cut =
                || FormatError::Truncated { declared: format!("{pixels} pixels"), found: format!("pixel {pixel}") };
            let line = self.lines.next_filled().ok_or_else(cut)?;
            let mut row = [0.0; MOST_VALUES];
            let no_number = |word: &[u8]| self.wrong(format!("{} is no number", quote(word)));
            let count = numbers(line, &mut row).map_err(no_number)?;
            let has_more = count == MOST_VALUES && words(line).count() > count;
            let layout = *first.get_or_insert_with(|| Row::of(line, count));
            if has_more || count != layout.count || !matches!(count, 3 | 4 | 7) {
                let problem =
                    format!("a pixel has x y z, intensity and perhaps r g b as the one before: {}", quote(line));
                return Err(self.wrong(problem));
            }
            if points.is_none() {
                let layout = layout.layout()?;
                self.budget.take(pixels as u64, layout.bytes() + size_of::<u32>())?;
                points = Some(Points::new(&layout, pixels));
            }
            let values = values_of(&row);
            has_points |= values[X..X + 3].iter().all(|x| x.is_finite());
            let place = || format!("line {}", self.lines.number());
            if let Some(points) = &mut points {
                points.push(&values).map_err(|problem| FormatError::malformed(place(), problem, REPAIR))?;
            }
        }
        let Some(points) = points.filter(|_| has_points) else { return Ok(None) };
        // pixels come column by column, grids go row by row
        let place = |pixel: usize| ((pixel % columns) * rows + pixel / columns) as u32;
        let grid = RangeGrid { columns, rows, pixels: (0..pixels).map(place).collect() };
        let reading = points.finish(Vec::new(), Some(grid), Some(Point3::origin()))?;
        Ok(Some(ScanReading { name: None, reading, world_from_scan: Some(motion) }))
    }
}

impl Row {
    fn of(line: &[u8], count: usize) -> Self {
        let mut colors = words(line).skip(4);
        Row { count, has_fractions: colors.any(has_fraction) }
    }

    fn layout(self) -> Result<Layout, FormatError> {
        let has = |slot| match slot {
            X..NORMAL => true,
            COLOR..INTENSITY => self.count == MOST_VALUES,
            INTENSITY => self.count > 3,
            _ => false,
        };
        Layout::of(has, |_| if self.has_fractions { Channels::Floats } else { Channels::Whole(u32::MAX) })
    }
}

/// The values of a pixel; one that saw nothing has no coordinates.
fn values_of(row: &[f64; MOST_VALUES]) -> [f64; SLOTS] {
    let mut values = [0.0; SLOTS];
    let [x, y, z, intensity, red, green, blue] = *row;
    let is_seen = [x, y, z] != [0.0; 3];
    values[X..X + 3].copy_from_slice(&if is_seen { [x, y, z] } else { [f64::NAN; 3] });
    values[COLOR..COLOR + 3].copy_from_slice(&[red, green, blue]);
    values[INTENSITY] = intensity;
    values
}

/// The motion into the frame that the scans share, from a matrix that is multiplied from the left: its last row is the
/// translation. Some programs write it the other way round.
fn motion_of(matrix: [[f64; 4]; 4]) -> Result<Motion, String> {
    let transposed = std::array::from_fn(|row| std::array::from_fn(|column| matrix[column][row]));
    let is_usual = matrix.iter().map(|row| row[3]).eq([0.0, 0.0, 0.0, 1.0]);
    let rows: [[f64; 4]; 4] = if is_usual { transposed } else { matrix };
    let nearest = nearest_motion(&rows, ROUNDED).map_err(|problem| problem.to_string())?;
    if nearest.scale != 1.0 {
        return Err(format!("the matrix holds a scale of {}", nearest.scale));
    }
    for coordinate in nearest.motion.translation.vector.iter() {
        checked_coordinate(*coordinate).map_err(|problem| format!("the translation {problem}"))?;
    }
    Ok(nearest.motion)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{read as read_file, read_scans};

    /// A header of 2 columns and 3 rows; the scanner was turned by 90 degrees about z and moved.
    const HEAD: &str = "2\n3\n10 20 30\n0 1 0\n-1 0 0\n0 0 1\n0 1 0 0\n-1 0 0 0\n0 0 1 0\n10 20 30 1\n";
    const PIXELS: &str =
        "1 0 0 0.5 255 0 9\n2 0 0 0.25 1 2 3\n0 0 0 0.5 0 0 0\n4 0 0 1 0 0 0\n5 0 0 0 0 0 0\n6 0 1 0 7 7 7\n";

    fn scans(text: &str) -> Result<Vec<ScanReading>, FormatError> {
        read_scans("a.ptx", text.as_bytes(), &ReadLimits::default())
    }

    #[test]
    fn a_scan_has_its_grid_attributes_and_place() {
        let text = [HEAD, PIXELS].concat();
        let scan = scans(&text).expect("sound").remove(0);
        let surface = &scan.reading.surface;
        let xs: Vec<f64> = surface.cloud.points.iter().map(|p| p.x).collect();
        assert_eq!(xs, [1.0, 2.0, 4.0, 5.0, 6.0]);
        assert_eq!(surface.cloud.colors.as_ref().expect("colours")[..2], [[255, 0, 9], [1, 2, 3]]);
        assert_eq!(surface.cloud.intensities.as_ref().expect("intensities")[..3], [0.5, 0.25, 1.0]);
        let empty = RangeGrid::EMPTY;
        assert_eq!(surface.grid, Some(RangeGrid { columns: 2, rows: 3, pixels: vec![0, 2, 1, 3, empty, 4] }));
        assert_eq!((surface.sensor, scan.reading.dropped.no_return), (Some(Point3::origin()), 1));
        let world = scan.world_from_scan.expect("a place") * Point3::new(1.0, 0.0, 0.0);
        assert!((world - Point3::new(10.0, 21.0, 30.0)).norm() < 1e-12, "{world}");
        // written the other way round
        let other =
            text.replace("0 1 0 0\n-1 0 0 0\n0 0 1 0\n10 20 30 1\n", "0 -1 0 10\n1 0 0 20\n0 0 1 30\n0 0 0 1\n");
        assert_eq!(scans(&other).expect("sound")[0].world_from_scan, scan.world_from_scan);
    }

    #[test]
    fn several_scans_are_read_one_by_one_and_united() {
        let second = HEAD.replace("10 20 30 1\n", "0 0 0 1\n") + "1 0 0 0.5\n".repeat(6).as_str();
        let nothing = HEAD.to_owned() + "0 0 0 0.5\n".repeat(6).as_str();
        let text = [HEAD, PIXELS, &nothing, &second].concat();
        let read = scans(&text).expect("two of three");
        assert_eq!(read.iter().map(|scan| scan.reading.surface.cloud.len()).collect::<Vec<_>>(), [5, 6]);
        let note = "1 scans without a point are left out, the first is scan 2";
        assert_eq!(read[0].reading.dropped.notes, [note]);
        let united = read_file("a.ptx", text.as_bytes(), &ReadLimits::default()).expect("united").surface;
        assert_eq!((united.cloud.len(), united.grid), (11, None));
        assert!((united.cloud.points[0] - Point3::new(10.0, 21.0, 30.0)).norm() < 1e-12);
        assert!((united.cloud.points[5] - Point3::new(0.0, 1.0, 0.0)).norm() < 1e-12);
        // the same pose for all says nothing
        assert!(scans(&[HEAD, PIXELS].concat().repeat(2)).expect("two").iter().all(|s| s.world_from_scan.is_none()));
    }

    #[test]
    fn what_is_wrong_is_named_by_line() {
        let whole = [HEAD, PIXELS].concat();
        let cases = [
            (whole.replacen("2\n3\n", "two\n3\n", 1), "line 1: the number of columns is expected, but here is \"two\""),
            (whole.replacen("10 20 30\n", "10 20\n", 1), "line 3: the place of the scanner has 3 numbers"),
            (whole.replacen("0 1 0 0\n", "0 2 0 0\n", 1), "line 10: the 3x3 block is no rotation"),
            (whole.replacen("-1 0 0 0\n", "-1 0 0\n", 1), "line 8: a row of the matrix has 4 numbers"),
            (whole.replacen("2 0 0 0.25 1 2 3\n", "2 0 0 0.25\n", 1), "line 12: a pixel has x y z, intensity"),
            (whole.replacen("2 0 0 0.25", "2 zero 0 0.25", 1), "line 12: \"zero\" is no number"),
            (whole.replacen("2 0 0 0.25", "2 1e20 0 0.25", 1), "line 12: y is 1e20, which is too large"),
            (
                whole.replacen("2\n3\n", "4000000000\n4000000000\n", 1),
                "the file is cut short: it declares 4000000000 x",
            ),
            (whole.clone() + "2\n", "the file is cut short: it declares the number of rows but ends within line 17"),
            (HEAD.to_owned() + &"0 0 0 0\n".repeat(6), "the whole file: there are no points"),
            (String::new(), "the whole file: there are no points"),
        ];
        for (text, start) in cases {
            let error = scans(&text).expect_err(&text).to_string();
            assert!(error.starts_with(start), "{error}");
        }
        for length in 0..whole.len() - 2 {
            assert!(scans(&whole[..length]).is_err(), "{length}");
        }
        let limits = ReadLimits { max_points: 5, ..ReadLimits::default() };
        let error = read(whole.as_bytes(), &limits);
        assert_eq!(error, Err(FormatError::TooLarge { what: "points", found: 6, limit: 5 }));
    }
}
