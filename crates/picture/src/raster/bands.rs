//! Which things touch which band of rows.

use rayon::prelude::*;

use super::Grid;
use visage_geometry::progress::{Canceled, Progress};

/// Rows of pixels in a band: its samples stay in the cache of a core.
pub(super) const BAND: usize = 16;
/// Things that are looked at between two looks at the flag that stops.
const PATIENCE: usize = 1 << 14;
/// Samples that may be looked at for one picture, a second's work. Beyond it only every so-many-th thing is drawn: nothing that
/// was measured has so much before and behind itself.
const MOST_WORK: u64 = 1_000_000_000;

/// What a sample holds: nearness above, and below it the thing, such that the greater one is to be seen.
pub(super) type Key = u64;

/// The key of a thing that is so near; nearness is positive.
#[inline]
pub(super) fn key(nearness: f32, thing: u32) -> Key {
    (Key::from(nearness.to_bits()) << 32) | Key::from(!thing)
}

/// The nearness and the thing of a key; `None` for a sample where nothing is.
#[inline]
pub(super) fn of_key(key: Key) -> Option<(f32, u32)> {
    (key != 0).then_some((f32::from_bits((key >> 32) as u32), !(key as u32)))
}

/// The samples of a band, row by row.
pub(super) struct Samples<'a> {
    pub keys: &'a mut [Key],
    /// The first row of samples.
    pub first: usize,
    /// Rows of samples.
    pub rows: usize,
    /// Samples in a row.
    pub columns: usize,
}

/// Columns and rows of samples, both ends included.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Rect {
    pub left: i32,
    pub right: i32,
    pub top: i32,
    pub bottom: i32,
}

impl Rect {
    /// What of it is within so many columns and rows from these.
    #[inline]
    pub(super) fn within(self, columns: usize, first: usize, rows: usize) -> Option<Rect> {
        let cut = Rect {
            left: self.left.max(0),
            right: self.right.min(columns as i32 - 1),
            top: self.top.max(first as i32),
            bottom: self.bottom.min((first + rows) as i32 - 1),
        };
        (cut.left <= cut.right && cut.top <= cut.bottom).then_some(cut)
    }
}

/// What is seen of a thing at a place.
pub(super) struct Look {
    /// In the axes of the picture, of length 1, to who looks.
    pub normal: [f32; 3],
    /// Its light when it is lit in full.
    pub light: [f32; 3],
    /// Whether it is the inner side that is seen.
    pub is_inside: bool,
}

/// Things that cover samples.
pub(super) trait Covering: Sync {
    /// How many.
    fn len(&self) -> usize;
    /// A box around the samples that a thing covers; `None` if it covers none.
    fn rect(&self, thing: usize) -> Option<Rect>;
    /// Puts a thing before what is farther.
    fn cover(&self, thing: usize, samples: &mut Samples);
    /// How it looks at a place, in samples from the left and from the top.
    fn look(&self, thing: usize, at: [f32; 2]) -> Look;
}

/// The things of each band, in order.
pub(super) struct Bands {
    /// Where each band begins in `things`.
    starts: Vec<usize>,
    things: Vec<u32>,
}

impl Bands {
    pub(super) fn new(of: &impl Covering, grid: Grid, progress: &Progress) -> Result<Bands, Canceled> {
        let rows = BAND * grid.fine;
        let count = grid.height.div_ceil(BAND);
        let chunks: Vec<usize> = (0..of.len()).step_by(PATIENCE).collect();
        // for each thing the first and the last band, and what it costs; the first is beyond the last for what is not seen
        let touched = chunks.into_par_iter().map(|start| {
            progress.check()?;
            let end = (start + PATIENCE).min(of.len());
            let mut work = 0u64;
            let bands = (start..end).map(|thing| {
                let Some(rect) = of.rect(thing).and_then(|rect| rect.within(grid.columns(), 0, grid.rows())) else {
                    return [1u16, 0];
                };
                work += (rect.right - rect.left + 1) as u64 * (rect.bottom - rect.top + 1) as u64;
                [(rect.top as usize / rows) as u16, (rect.bottom as usize / rows) as u16]
            });
            Ok((bands.collect::<Vec<_>>(), work))
        });
        let touched: Vec<(Vec<[u16; 2]>, u64)> = touched.collect::<Result<_, Canceled>>()?;
        let work: u64 = touched.iter().map(|(_, work)| work).sum();
        let step = work.div_ceil(MOST_WORK).max(1) as usize;
        let all = || {
            let bands = touched.iter().flat_map(|(bands, _)| bands).enumerate();
            bands.filter(move |(thing, [first, last])| first <= last && thing % step == 0)
        };
        let mut starts = vec![0usize; count + 1];
        for (_, [first, last]) in all() {
            (*first..=*last).for_each(|band| starts[usize::from(band) + 1] += 1);
        }
        for band in 0..count {
            starts[band + 1] += starts[band];
        }
        let mut next = starts.clone();
        let mut things = vec![0u32; starts[count]];
        for (thing, [first, last]) in all() {
            for band in *first..=*last {
                let place = &mut next[usize::from(band)];
                things[*place] = thing as u32;
                *place += 1;
            }
        }
        Ok(Bands { starts, things })
    }

    /// The things of a band.
    pub(super) fn of(&self, band: usize) -> &[u32] {
        &self.things[self.starts[band]..self.starts[band + 1]]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_greater_key_is_nearer_and_of_equal_ones_the_first() {
        assert!(key(2.0, 9) > key(1.0, 3));
        assert!(key(1.0, 3) > key(1.0, 9));
        assert_eq!(of_key(key(0.5, 7)), Some((0.5, 7)));
        assert_eq!(of_key(0), None);
    }
}
