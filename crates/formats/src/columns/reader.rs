//! Rows of text to points.

use super::guess::Triple;
use super::layout::{Columns, UNUSED, Usual, count_in, is_comment};
use crate::colors::Channels;
use crate::points::{Layout, Points, SLOTS};
use crate::text::TextLines;
use crate::{FormatError, ReadLimits, Reading, number, quote, text_start};

const REPAIR: &str = "repair the file or export it again";
/// The shortest row: three digits, and what parts them.
const LEAST_ROW: u64 = 6;

/// Reads columns; `usual` says what the format has in rows of so many values where no header does.
pub(super) fn read(bytes: &[u8], limits: &ReadLimits, usual: Usual) -> Result<Reading, FormatError> {
    let text = &bytes[text_start(bytes)?..];
    if memchr::memchr(0, &text[..text.len().min(1 << 12)]).is_some() {
        return Err(FormatError::malformed("byte 0", "this is no text: there are zero bytes in it", "send text"));
    }
    let mut columns = Columns::of(text, usual)?;
    // each turn takes back what the last one has shown to be wrong: three at most
    loop {
        match Rows::read(text, limits, &columns) {
            Ok(points) => {
                let mut reading = points.finish(Vec::new(), None, None)?;
                reading.unit = columns.unit;
                reading.dropped.notes.extend(columns.notes);
                return Ok(reading);
            }
            Err(Stop::NotAsGuessed(triple, line)) => columns = columns.without(triple, line),
            Err(Stop::Error(error)) => return Err(error),
        }
    }
}

/// Why reading stopped.
enum Stop {
    /// A row shows that columns are not what the first rows made of them.
    NotAsGuessed((usize, Triple), usize),
    Error(FormatError),
}

impl From<FormatError> for Stop {
    fn from(error: FormatError) -> Self {
        Stop::Error(error)
    }
}

/// The rows of a file on the way.
struct Rows<'a> {
    columns: &'a Columns,
    points: Points,
    lines: TextLines<'a>,
    /// Points that lines with a count promise, and rows so far.
    declared: Option<u64>,
    rows: u64,
    /// The value of a first column that counts, in the first row.
    first_count: Option<f64>,
}

impl<'a> Rows<'a> {
    fn read(text: &'a [u8], limits: &ReadLimits, columns: &'a Columns) -> Result<Points, Stop> {
        let has = |slot: usize| columns.slots.contains(&slot);
        let is_guessed = columns.guess.triples.iter().any(|(_, triple)| *triple == Triple::Color);
        let channels = match (is_guessed, columns.whole_colors) {
            (true, _) => Channels::Bytes,
            (false, true) => Channels::Whole(u32::MAX),
            (false, false) => Channels::Floats,
        };
        let layout = Layout::of(has, |_| channels)?;
        let expected = (text.len() / columns.row_bytes.max(LEAST_ROW as usize)) as u64;
        let room = expected.min(limits.most_points()) as usize;
        let lines = TextLines::new(text);
        let points = Points::new(&layout, room);
        let mut rows = Rows { columns, points, lines, declared: None, rows: 0, first_count: None };
        rows.take_all(limits, layout.bytes())?;
        rows.finish()
    }

    fn take_all(&mut self, limits: &ReadLimits, bytes: usize) -> Result<(), Stop> {
        let mut budget = limits.budget();
        let limit = limits.most_points();
        while let Some(line) = self.lines.next_filled() {
            if self.is_no_row(line)? {
                continue;
            }
            if self.rows >= limit {
                return Err(FormatError::TooLarge { what: "points", found: limit + 1, limit }.into());
            }
            budget.take(1, bytes)?;
            self.take(line)?;
        }
        Ok(())
    }

    /// Whether the line is none that holds a point: it comes before the first, is a comment, or a count.
    #[inline]
    fn is_no_row(&mut self, line: &[u8]) -> Result<bool, FormatError> {
        if is_comment(line) {
            return Ok(true);
        }
        // the shortest row with three values is as long as a count of five digits
        if line.len() <= 20
            && let Some(count) = count_in(line)
        {
            let total = self.declared.unwrap_or(self.rows).saturating_add(count);
            if self.declared.is_some_and(|declared| declared != self.rows) || (self.declared.is_none() && self.rows > 0)
            {
                let problem = format!("one number, {count}, stands where a point is expected");
                return Err(FormatError::malformed(self.place(), problem, REPAIR));
            }
            let left = self.lines.rest().len() as u64 + 1;
            if count.saturating_mul(LEAST_ROW) > left {
                let found = format!("the {left} bytes after line {}", self.lines.number());
                return Err(FormatError::Truncated { declared: format!("{count} points"), found });
            }
            self.declared = Some(total);
            return Ok(true);
        }
        Ok(self.lines.number() < self.columns.first_line)
    }

    fn place(&self) -> String {
        format!("line {}", self.lines.number())
    }

    #[inline]
    fn take(&mut self, line: &[u8]) -> Result<(), Stop> {
        let mut values = [0.0; SLOTS + 1];
        let mut cursor = Cursor { line, position: 0 };
        for slot in &self.columns.slots {
            if *slot == UNUSED {
                cursor.skip(self.columns).ok_or_else(|| self.wrong(line, None))?;
            } else {
                let value = cursor.number(self.columns);
                values[*slot] = value.map_err(|word| self.wrong(line, Some(word)))?;
            }
        }
        if cursor.position <= line.len() {
            return Err(self.wrong(line, None).into());
        }
        for (column, triple) in &self.columns.guess.triples {
            let slot = triple.slot();
            if !triple.fits([values[slot], values[slot + 1], values[slot + 2]]) {
                return Err(Stop::NotAsGuessed((*column, *triple), self.lines.number()));
            }
        }
        if self.columns.guess.is_counted {
            self.check_count(line)?;
        }
        self.rows += 1;
        let [kept @ .., _] = &values;
        let place = || format!("line {}", self.lines.number());
        Ok(self.points.push(kept).map_err(|problem| FormatError::malformed(place(), problem, REPAIR))?)
    }

    /// A first column that counts in the first rows must do so in all: else it may be an x.
    fn check_count(&mut self, line: &[u8]) -> Result<(), FormatError> {
        let dialect = &self.columns.dialect;
        let value = dialect.fields(line).first().and_then(|field| dialect.number(field)).unwrap_or(f64::NAN);
        let first = *self.first_count.get_or_insert(value);
        if value == first + self.rows as f64 {
            return Ok(());
        }
        let problem = "the first column counts the points in the lines before, but not here: it may be x or a number";
        let remedy = "name the columns in the first line, such as x y z intensity";
        Err(FormatError::malformed(self.place(), problem, remedy))
    }

    /// What is wrong with a line of which a value is missing, superfluous, or no number.
    #[cold]
    fn wrong(&self, line: &[u8], word: Option<&[u8]>) -> FormatError {
        let (found, count) = (self.columns.dialect.fields(line).len(), self.columns.slots.len());
        let first = self.columns.first_line;
        let problem = match word {
            _ if found != count => format!("it has {found} values, but line {first} has {count}"),
            word => format!("{} is no number", quote(word.unwrap_or(line))),
        };
        FormatError::malformed(self.place(), problem, REPAIR)
    }

    fn finish(mut self) -> Result<Points, Stop> {
        match self.declared {
            Some(declared) if declared > self.rows => {
                let (declared, found) = (format!("{declared} points"), format!("point {}", self.rows));
                return Err(FormatError::Truncated { declared, found }.into());
            }
            Some(declared) if declared < self.rows => {
                let note = format!("{declared} points are declared, there are {}: all are read", self.rows);
                self.points.dropped.notes.push(note);
            }
            _ => {}
        }
        Ok(self.points)
    }
}

/// A place in a row.
struct Cursor<'a> {
    line: &'a [u8],
    /// Where the next value begins; beyond the end behind the last one.
    position: usize,
}

impl<'a> Cursor<'a> {
    #[inline]
    fn rest(&self) -> &'a [u8] {
        self.line.get(self.position..).unwrap_or_default()
    }

    #[inline]
    fn skip_blanks(&mut self) {
        while matches!(self.line.get(self.position), Some(b' ' | b'\t')) {
            self.position += 1;
        }
    }

    /// The next number; the error is the word that is none.
    #[inline]
    fn number(&mut self, columns: &Columns) -> Result<f64, &'a [u8]> {
        self.skip_blanks();
        if !columns.dialect.decimal_comma
            && let Some((value, length)) = number::leading(self.rest())
        {
            match self.line.get(self.position + length) {
                None => {
                    self.position = self.line.len() + 1;
                    return Ok(value);
                }
                Some(byte) if columns.dialect.parts(*byte) => {
                    self.position += length + 1;
                    return Ok(value);
                }
                Some(_) => {}
            }
        }
        self.spelled(columns)
    }

    /// A number in another spelling, in quotes, or an empty value.
    #[cold]
    fn spelled(&mut self, columns: &Columns) -> Result<f64, &'a [u8]> {
        let word = self.skip(columns).ok_or(&[][..])?;
        columns.dialect.number(word).ok_or(word)
    }

    /// Passes over a value; `None` where there is none any more.
    #[inline]
    fn skip(&mut self, columns: &Columns) -> Option<&'a [u8]> {
        self.skip_blanks();
        let rest = self.line.get(self.position..)?;
        let length = rest.iter().position(|byte| columns.dialect.parts(*byte)).unwrap_or(rest.len());
        self.position += length + 1;
        Some(&rest[..length])
    }
}
