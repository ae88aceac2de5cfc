//! Which column is what, told from the lines at the start of a file.

use super::dialect::{Dialect, MOST_COLUMNS};
use super::guess::{Guess, SAMPLE, Triple};
use super::names::{Name, have_positions, names_of, unit_of};
use crate::points::{COLOR, NORMAL, SLOTS, X};
use crate::text::{TextLines, has_fraction, words};
use crate::{DeclaredUnit, FormatError, quote};
use visage_geometry::Unit;

/// The slot of what is not kept.
pub(super) const UNUSED: usize = SLOTS;

/// The names that a format gives to the first columns of rows with so many values, where no header does.
pub(super) type Usual = fn(usize) -> Option<&'static [&'static str]>;

/// How the rows of a file are read.
#[derive(Debug, Clone)]
pub(super) struct Columns {
    pub(super) dialect: Dialect,
    /// Where the value of each column goes.
    pub(super) slots: Vec<usize>,
    /// What no name says.
    pub(super) guess: Guess,
    /// Whether the colours are written as whole numbers.
    pub(super) whole_colors: bool,
    pub(super) unit: Option<DeclaredUnit>,
    /// The line of the first row, for messages.
    pub(super) first_line: usize,
    /// Bytes of a row, by and large.
    pub(super) row_bytes: usize,
    pub(super) notes: Vec<String>,
}

/// Whether the line says nothing of points.
#[inline]
pub(super) fn is_comment(line: &[u8]) -> bool {
    matches!(line, [b'#' | b'%' | b';', ..] | [b'/', b'/', ..])
}

/// The number of points, if that is all that a line says.
pub(super) fn count_in(line: &[u8]) -> Option<u64> {
    let is_digits = !line.is_empty() && line.iter().all(u8::is_ascii_digit);
    std::str::from_utf8(line).ok().filter(|_| is_digits)?.parse().ok()
}

/// Whether the line says how large a scan is: `640 x 480`.
fn is_size(line: &[u8]) -> bool {
    let words: Vec<&[u8]> = words(line).take(4).collect();
    matches!(words[..], [columns, b"x", rows] if count_in(columns).is_some() && count_in(rows).is_some())
}

impl Columns {
    /// From the first lines of `text`.
    pub(super) fn of(text: &[u8], usual: Usual) -> Result<Self, FormatError> {
        let head = Head::of(text)?;
        let count = head.columns();
        if count > MOST_COLUMNS {
            return Err(FormatError::TooLarge { what: "columns", found: count as u64, limit: MOST_COLUMNS as u64 });
        }
        let sample = head.sample(count);
        let mut columns = Columns {
            dialect: head.dialect,
            slots: vec![UNUSED; count],
            guess: Guess::default(),
            whole_colors: false,
            unit: None,
            first_line: head.first_line,
            row_bytes: head.rows.iter().map(|row| row.len() + 1).sum::<usize>() / head.rows.len().max(1),
            notes: Vec::new(),
        };
        let names = columns.header(&head, count)?;
        match names {
            Some(names) => columns.take_names(&names),
            None => columns.take_guess(&sample, usual(count).unwrap_or_default()),
        }
        columns.check_positions(&head)?;
        let colors = columns.slots.iter().zip(0..).filter(|(slot, _)| (COLOR..COLOR + 3).contains(*slot));
        let colors: Vec<usize> = colors.map(|(_, column)| column).collect();
        columns.whole_colors = head.are_whole(&colors);
        Ok(columns)
    }

    /// The names of the columns, if a line before the first row says them.
    fn header(&mut self, head: &Head, count: usize) -> Result<Option<Vec<Name>>, FormatError> {
        let remedy = "name the columns in the first line, such as x y z intensity";
        for (line, words) in head.before.iter().rev() {
            let place = || format!("line {line}");
            let is_comment = is_comment(words);
            let names = names_of(words, &self.dialect, count);
            if let Some(names) = names.filter(|names| !is_comment || have_positions(names)) {
                if !have_positions(&names) {
                    let problem = format!("the header names no x, y and z: {}", quote(words));
                    return Err(FormatError::malformed(place(), problem, remedy));
                }
                let unit =
                    unit_of(&names, words).map_err(|problem| FormatError::malformed(place(), problem, remedy))?;
                self.unit = unit.and_then(Unit::in_mm).map(|mm| DeclaredUnit { metres: mm / 1000.0 });
                return Ok(Some(names));
            }
            if is_comment {
                continue;
            }
            let fields = self.dialect.fields(words);
            let named: Vec<Name> = fields.iter().map(|field| Name::of(&String::from_utf8_lossy(field))).collect();
            if have_positions(&named) {
                let problem = format!("the header names {} columns, but the rows have {count}", fields.len());
                return Err(FormatError::malformed(place(), problem, remedy));
            }
            self.notes.push(format!("line {line} is passed over: {}", quote(words)));
        }
        Ok(None)
    }

    /// Of columns with the same name the first counts.
    fn take_names(&mut self, names: &[Name]) {
        for (column, name) in names.iter().enumerate() {
            if let Some(slot) = name.slot.filter(|slot| !self.slots.contains(slot)) {
                self.slots[column] = slot;
            }
        }
    }

    fn take_guess(&mut self, sample: &[Vec<f64>], usual: &[&str]) {
        let count = self.slots.len();
        self.guess = Guess::of(sample, count, usual.len());
        let names: Vec<Name> = usual.iter().map(|name| Name::of(name)).collect();
        self.take_names(&names);
        let first = usize::from(self.guess.is_counted);
        self.slots[first..].iter_mut().zip(X..X + 3).for_each(|(slot, axis)| *slot = axis);
        for (column, triple) in &self.guess.triples {
            self.slots[*column..].iter_mut().zip(triple.slot()..triple.slot() + 3).for_each(|(to, slot)| *to = slot);
        }
        if self.guess.is_counted {
            self.notes.push("column 1 is passed over: it counts the points".into());
        }
        let unused: Vec<String> = (first + 3..count).filter(|c| self.slots[*c] == UNUSED).map(column_name).collect();
        if !unused.is_empty() {
            let columns = list(&unused);
            self.notes.push(format!(
                "{columns} not used: nothing says for sure what is in there; name the columns in the first line, such as \
                 x y z intensity"
            ));
        }
    }

    /// Takes back what a row has shown to be no such triple.
    pub(super) fn without(mut self, triple: (usize, Triple), line: usize) -> Self {
        let (column, kind) = triple;
        self.slots[column..].iter_mut().take(3).for_each(|slot| *slot = UNUSED);
        self.guess.triples.retain(|other| *other != triple);
        let (first, last) = (column + 1, column + 3);
        self.notes.push(format!(
            "columns {first} to {last} are not used: they look like {}, but not in line {line}",
            kind.name()
        ));
        self
    }

    /// Where positions are to be, there must be numbers.
    fn check_positions(&self, head: &Head) -> Result<(), FormatError> {
        let fields = head.rows.first().map(|row| self.dialect.fields(row)).unwrap_or_default();
        for (column, field) in fields.iter().enumerate() {
            if self.slots[column] < NORMAL && self.dialect.number(field).is_none() {
                let problem = format!("{} is {}, where a coordinate is expected", column_name(column), quote(field));
                let remedy = "name the columns in the first line, such as label x y z";
                return Err(FormatError::malformed(format!("line {}", self.first_line), problem, remedy));
            }
        }
        Ok(())
    }
}

fn column_name(column: usize) -> String {
    format!("column {}", column + 1)
}

fn list(names: &[String]) -> String {
    const MOST: usize = 8;
    let shown = names[..names.len().min(MOST)].join(", ");
    let more = if names.len() > MOST { format!(" and {} more", names.len() - MOST) } else { String::new() };
    format!("{shown}{more} {}", if names.len() == 1 { "is" } else { "are" })
}

/// The lines at the start of a file.
struct Head<'a> {
    dialect: Dialect,
    /// Lines before the first row, with their numbers.
    before: Vec<(usize, &'a [u8])>,
    first_line: usize,
    /// The first rows.
    rows: Vec<&'a [u8]>,
}

impl<'a> Head<'a> {
    fn of(text: &'a [u8]) -> Result<Self, FormatError> {
        /// Lines that may come before the first row, and how many of them are looked at.
        const MOST_BEFORE: usize = 1 << 10;
        let mut lines = TextLines::new(text);
        let mut before = Vec::new();
        let first = loop {
            let Some(line) = lines.next_filled() else { return Err(no_rows(text, &before)) };
            if !is_comment(line) && Dialect::of(line).is_row(line) {
                break line;
            }
            if line.get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"ncols")) {
                let problem = "this is a grid of heights (Esri ASCII), no list of points";
                return Err(FormatError::malformed("line 1", problem, "export it as points: x y z"));
            }
            if count_in(line).is_none() && !is_size(line) {
                before.push((lines.number(), line));
            }
            if before.len() > MOST_BEFORE {
                return Err(no_rows(text, &before));
            }
        };
        let first_line = lines.number();
        let mut rows = vec![first];
        while rows.len() < SAMPLE
            && let Some(line) = lines.next_filled()
        {
            if !is_comment(line) && count_in(line).is_none() {
                rows.push(line);
            }
        }
        // a first row of whole numbers does not show how fractions are written
        let dialect = Dialect::of(first);
        let with_comma = rows.iter().map(|row| Dialect::of(row)).find(|of_row| of_row.decimal_comma);
        let dialect = with_comma.filter(|of_row| of_row.separator == dialect.separator).unwrap_or(dialect);
        Ok(Head { dialect, before, first_line, rows })
    }

    fn columns(&self) -> usize {
        self.rows.first().map_or(0, |row| self.dialect.fields(row).len())
    }

    /// The values of the first rows; NaN for words that are no numbers, and where a row has too few.
    fn sample(&self, columns: usize) -> Vec<Vec<f64>> {
        let values = |row: &&[u8]| {
            let fields = self.dialect.fields(row);
            let value =
                |column: usize| fields.get(column).and_then(|field| self.dialect.number(field)).unwrap_or(f64::NAN);
            (0..columns).map(value).collect()
        };
        self.rows.iter().map(values).collect()
    }

    /// Whether all values of these columns are written without a fraction.
    fn are_whole(&self, columns: &[usize]) -> bool {
        self.rows.iter().all(|row| {
            let fields = self.dialect.fields(row);
            columns.iter().all(|column| fields.get(*column).is_none_or(|field| !has_fraction(field)))
        })
    }
}

fn no_rows(text: &[u8], before: &[(usize, &[u8])]) -> FormatError {
    let found = match before.iter().find(|(_, line)| !is_comment(line)) {
        Some((line, words)) => format!("; line {line} is {}", quote(words)),
        None if text.trim_ascii().is_empty() => "; the file is empty".into(),
        None => String::new(),
    };
    let problem = format!("no line holds a point, three numbers or more{found}");
    FormatError::malformed("the whole file", problem, "send one point a line: x y z")
}
