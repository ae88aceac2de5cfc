//! What columns without names are: only what leaves no doubt.

use crate::points::{COLOR, NORMAL};

/// Rows from which is told what the columns are.
pub(crate) const SAMPLE: usize = 1 << 10;
/// A length this near to 1 is that of a normal: files round them to two digits.
const UNIT_TOLERANCE: f64 = 0.02;
/// Fewer rows do not show that a column counts them.
const LEAST_COUNTED: usize = 8;

/// What the values of a triple of columns look like.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Triple {
    Normal,
    Color,
}

impl Triple {
    /// Where its values go.
    pub(crate) fn slot(self) -> usize {
        match self {
            Triple::Normal => NORMAL,
            Triple::Color => COLOR,
        }
    }

    /// In words, for messages.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Triple::Normal => "normals",
            Triple::Color => "colours",
        }
    }

    /// Whether the values of a row can be this.
    #[inline]
    pub(crate) fn fits(self, values: [f64; 3]) -> bool {
        let is_known = !values.iter().any(|x| x.is_nan());
        match self {
            Triple::Color => !is_known || values.iter().all(|x| (0.0..=255.0).contains(x) && x.fract() == 0.0),
            Triple::Normal => {
                let length2: f64 = values.iter().map(|x| x * x).sum();
                !is_known || length2 == 0.0 || (length2.sqrt() - 1.0).abs() <= UNIT_TOLERANCE
            }
        }
    }

    /// Whether a row can be this and nothing else.
    fn shows(self, values: [f64; 3]) -> bool {
        match self {
            Triple::Color => values.iter().any(|x| *x > 1.0),
            // 0 0 1 may be a dark blue
            Triple::Normal => values.iter().any(|x| *x < 0.0 || x.fract() != 0.0),
        }
    }
}

/// What was found out about the columns.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Guess {
    /// Whether the first column counts the points.
    pub(crate) is_counted: bool,
    /// The first columns of triples.
    pub(crate) triples: Vec<(usize, Triple)>,
}

impl Guess {
    /// From sample rows, all with as many values; words that are no numbers are NaN. `known` columns are none to guess.
    pub(crate) fn of(rows: &[Vec<f64>], columns: usize, known: usize) -> Self {
        let is_counted = known == 0 && columns > 3 && rows.len() >= LEAST_COUNTED && counts(rows);
        let first = known.max(3 + usize::from(is_counted));
        let at = |row: &Vec<f64>, place: usize| [row[place], row[place + 1], row[place + 2]];
        let mut triples = Vec::new();
        for place in first..columns.saturating_sub(2) {
            for triple in [Triple::Normal, Triple::Color] {
                let fits = rows.iter().all(|row| triple.fits(at(row, place)));
                if fits && rows.iter().any(|row| triple.shows(at(row, place))) {
                    triples.push((place, triple));
                }
            }
        }
        // where two would do, or share a column, neither is sure
        let doubtful = |(place, triple): (usize, Triple)| {
            let others = triples.iter().filter(|other| **other != (place, triple));
            others.into_iter().any(|(other, kind)| *kind == triple || other.abs_diff(place) < 3)
        };
        let triples = triples.iter().copied().filter(|found| !doubtful(*found)).collect();
        Guess { is_counted, triples }
    }
}

/// Whether the first values go up by one from row to row.
fn counts(rows: &[Vec<f64>]) -> bool {
    rows.iter().enumerate().all(|(index, row)| row[0].fract() == 0.0 && row[0] - rows[0][0] == index as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn guess(rows: &[&[f64]]) -> Guess {
        let rows: Vec<Vec<f64>> = rows.iter().map(|row| row.to_vec()).collect();
        Guess::of(&rows, rows[0].len(), 0)
    }

    #[test]
    fn what_leaves_no_doubt_is_taken() {
        let color = guess(&[&[1.5, 0.0, 0.0, 12.0, 0.0, 255.0], &[0.0, 0.5, 0.0, 0.0, 0.0, 0.0]]);
        assert_eq!(color.triples, [(3, Triple::Color)]);
        let both = guess(&[&[0.0, 0.0, 0.0, 0.6, 0.0, -0.8, 12.0, 3.0, 255.0], &[0.5; 9].map(|_| 0.0)]);
        assert_eq!(both.triples, [(3, Triple::Normal), (6, Triple::Color)]);
        let intensity_first = guess(&[&[0.0, 0.0, 0.0, -1402.0, 12.0, 0.0, 255.0]]);
        assert_eq!(intensity_first.triples, [(4, Triple::Color)]);
    }

    #[test]
    fn what_may_be_something_else_is_not() {
        // blue or upwards
        assert_eq!(guess(&[&[0.0, 0.0, 0.0, 0.0, 0.0, 1.0]]).triples, []);
        // fractions may be a colour or anything
        assert_eq!(guess(&[&[0.0, 0.0, 0.0, 0.5, 0.25, 0.3]]).triples, []);
        // a fourth byte before or behind
        assert_eq!(guess(&[&[0.0, 0.0, 0.0, 9.0, 12.0, 0.0, 255.0]]).triples, []);
        // numbers that are too large
        assert_eq!(guess(&[&[0.0, 0.0, 0.0, 12.0, 0.0, 256.0]]).triples, []);
    }

    #[test]
    fn a_column_that_counts_is_found_in_rows_enough() {
        let rows: Vec<Vec<f64>> = (0..9).map(|k| vec![f64::from(k) + 7.0, 0.5, 0.25, f64::from(k)]).collect();
        assert!(Guess::of(&rows, 4, 0).is_counted);
        assert!(!Guess::of(&rows[..3], 4, 0).is_counted);
        assert!(!Guess::of(&rows, 3, 0).is_counted);
    }
}
