//! LZF, the compression of PCD: runs of literal bytes, and copies of what came before.

/// One byte of input gives at most so many of output: a copy of 264 bytes takes three.
pub(super) const MAX_GROWTH: usize = 88;

/// Unpacks `packed` into exactly `length` bytes; `None` if it is damaged. The caller has checked `length`.
pub(super) fn unpack(packed: &[u8], length: usize) -> Option<Vec<u8>> {
    let mut out = Vec::with_capacity(length);
    let mut input = packed.iter().copied();
    while let Some(control) = input.next() {
        let control = usize::from(control);
        if control < 32 {
            for _ in 0..=control {
                out.push(input.next()?);
            }
        } else {
            let mut count = control >> 5;
            if count == 7 {
                count += usize::from(input.next()?);
            }
            let back = ((control & 31) << 8) + usize::from(input.next()?) + 1;
            let from = out.len().checked_sub(back)?;
            // byte by byte: a copy may reach into itself
            for k in from..from + count + 2 {
                out.push(out[k]);
            }
        }
        if out.len() > length {
            return None;
        }
    }
    (out.len() == length).then_some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn literals_copies_and_overlapping_copies_are_unpacked() {
        assert_eq!(unpack(&[2, b'a', b'b', b'c'], 3).as_deref(), Some(&b"abc"[..]));
        // "abc", then 4 bytes from 3 back
        assert_eq!(unpack(&[2, b'a', b'b', b'c', 2 << 5, 2], 7).as_deref(), Some(&b"abcabca"[..]));
        // "a", then 7 + 5 + 2 bytes from 1 back
        assert_eq!(unpack(&[0, b'a', 7 << 5, 5, 0], 15).as_deref(), Some(&[b'a'; 15][..]));
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
            assert_eq!(unpack(packed, length), None, "{packed:?}");
        }
    }
}
