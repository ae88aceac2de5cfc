//! LZF, the compression of PCD: runs of literal bytes, and copies of what came before.

use std::ops::Range;

/// One byte of input gives at most so many of output: a copy of 264 bytes takes three.
pub(super) const MAX_GROWTH: usize = 88;
/// How far back a copy can reach.
const REACH: usize = 1 << 13;
/// So much is unpacked before what is wanted of it is taken.
const PORTION: usize = 1 << 16;

/// Unpacks `packed`, which makes `length` bytes, and keeps those in the ranges `wanted` (in ascending order, apart from
/// each other), one after the other; `None` if it is damaged. Never holds more than that and a portion of some 74 kB.
pub(super) fn unpack(packed: &[u8], length: usize, wanted: &[Range<usize>]) -> Option<Vec<u8>> {
    let mut kept = Vec::with_capacity(wanted.iter().map(ExactSizeIterator::len).sum());
    let mut portion: Vec<u8> = Vec::with_capacity(REACH + PORTION + MAX_GROWTH * 3);
    // where the portion begins, and how much of it was looked at
    let (mut start, mut taken) = (0, 0);
    let mut input = packed;
    while let Some((control, rest)) = input.split_first() {
        input = rest;
        let control = usize::from(*control);
        if control < 32 {
            let (literal, rest) = input.split_at_checked(control + 1)?;
            portion.extend_from_slice(literal);
            input = rest;
        } else {
            let mut count = control >> 5;
            if count == 7 {
                count += usize::from(*input.split_off_first()?);
            }
            let back = ((control & 31) << 8) + usize::from(*input.split_off_first()?) + 1;
            let from = portion.len().checked_sub(back)?;
            let mut left = count + 2;
            // a copy may reach into itself: what it has made so far repeats, and is copied with it
            while left > 0 {
                let copied = left.min(portion.len() - from);
                portion.extend_from_within(from..from + copied);
                left -= copied;
            }
        }
        if start + portion.len() > length {
            return None;
        }
        if portion.len() >= REACH + PORTION {
            take(&portion[taken..], start + taken, wanted, &mut kept);
            let gone = portion.len() - REACH;
            portion.drain(..gone);
            (start, taken) = (start + gone, REACH);
        }
    }
    take(&portion[taken..], start + taken, wanted, &mut kept);
    (start + portion.len() == length).then_some(kept)
}

/// Takes what is wanted of `bytes`, which begin at `start`.
fn take(bytes: &[u8], start: usize, wanted: &[Range<usize>], kept: &mut Vec<u8>) {
    for range in wanted {
        let from = range.start.max(start);
        let to = range.end.min(start + bytes.len());
        if from < to {
            kept.extend_from_slice(&bytes[from - start..to - start]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(packed: &[u8], length: usize) -> Option<Vec<u8>> {
        unpack(packed, length, std::slice::from_ref(&(0..length)))
    }

    #[test]
    fn literals_copies_and_overlapping_copies_are_unpacked() {
        assert_eq!(all(&[2, b'a', b'b', b'c'], 3).as_deref(), Some(&b"abc"[..]));
        // "abc", then 4 bytes from 3 back
        assert_eq!(all(&[2, b'a', b'b', b'c', 2 << 5, 2], 7).as_deref(), Some(&b"abcabca"[..]));
        // "a", then 7 + 5 + 2 bytes from 1 back
        assert_eq!(all(&[0, b'a', 7 << 5, 5, 0], 15).as_deref(), Some(&[b'a'; 15][..]));
    }

    #[test]
    fn only_what_is_wanted_is_kept_across_portions() {
        // 8192 literal bytes that count, then copies of 264 bytes from 8192 back, again and again
        let literals: Vec<u8> = (0..REACH).map(|k| (k * k % 251) as u8).collect();
        let mut packed: Vec<u8> = literals.chunks(32).flat_map(|run| [&[31], run].concat()).collect();
        let copies = 3000;
        packed.extend([(7 << 5) | 31, 255, 255].repeat(copies));
        let length = REACH + copies * 264;
        let expected = |range: Range<usize>| range.map(|k| literals[k % REACH]).collect::<Vec<u8>>();
        assert_eq!(all(&packed, length), Some(expected(0..length)));
        let wanted = [5..9, 70_000..140_000, length - 3..length];
        let kept = unpack(&packed, length, &wanted).expect("sound");
        assert_eq!(kept, wanted.map(expected).concat());
    }

    #[test]
    fn damaged_input_is_none() {
        let damaged: [(&[u8], usize); 6] = [
            (&[2, b'a'], 3),
            (&[0, b'a', 1 << 5, 1], 4),
            (&[0, b'a', 7 << 5], 10),
            (&[0, b'a'], 2),
            (&[1, b'a', b'b'], 1),
            (&[0, b'a', 7 << 5, 255, 0], 20),
        ];
        for (packed, length) in damaged {
            assert_eq!(all(packed, length), None, "{packed:?}");
        }
    }
}
