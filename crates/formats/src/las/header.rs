//! The head of a LAS file and its further records.

use super::REPAIR;
use crate::FormatError;

/// Bytes of the smallest head, that of LAS 1.0 to 1.2.
const HEAD: usize = 227;
/// Bytes of the head of a further record.
const RECORD_HEAD: usize = 54;
/// For each point format: bytes of a record, where its colour is.
const FORMATS: [(usize, Option<usize>); 11] = [
    (20, None),
    (28, None),
    (26, Some(20)),
    (34, Some(28)),
    (57, None),
    (63, Some(28)),
    (30, None),
    (36, Some(30)),
    (38, Some(30)),
    (59, None),
    (67, Some(30)),
];

/// What the head of a file says.
#[derive(Debug)]
pub(super) struct Header {
    /// The point format, 0 to 10.
    pub format: u8,
    pub is_compressed: bool,
    /// Bytes of a record, and of those that its format knows.
    pub record: usize,
    pub known: usize,
    pub count: u64,
    /// Where the records begin.
    pub start: usize,
    pub scale: [Scale; 3],
    pub offset: [f64; 3],
    /// Where in a record the colour is.
    pub color: Option<usize>,
    /// The byte and the bit that say that a point is withheld.
    pub withheld: (usize, u8),
    /// Where the further records begin, and how many there are.
    records: (usize, u32),
}

/// The step of a coordinate.
#[derive(Debug, Clone, Copy)]
pub(super) enum Scale {
    /// One part of a whole number of them: a decimal fraction comes out as it was meant.
    Part(f64),
    /// Anything else.
    Step(f64),
}

impl Scale {
    fn new(step: f64) -> Self {
        let parts = (1.0 / step).round();
        if parts >= 1.0 && (1.0 / parts - step).abs() <= 1e-12 * step { Scale::Part(parts) } else { Scale::Step(step) }
    }

    /// The coordinate of a number.
    #[inline]
    pub(super) fn of(self, number: i32, offset: f64) -> f64 {
        match self {
            Scale::Part(parts) => f64::from(number) / parts + offset,
            Scale::Step(step) => f64::from(number) * step + offset,
        }
    }
}

impl Header {
    pub(super) fn of(bytes: &[u8]) -> Result<Header, FormatError> {
        if !bytes.starts_with(b"LASF") {
            let problem = format!("a LAS file begins with LASF, this one with {}", crate::quote(bytes));
            return Err(FormatError::malformed("byte 0", problem, "send a LAS or LAZ file"));
        }
        let size = usize::from(number(bytes, 94).map(u16::from_le_bytes).unwrap_or_default()).max(HEAD);
        let Some(head) = bytes.get(..size) else {
            let declared = format!("a head of {size} bytes");
            return Err(FormatError::Truncated { declared, found: format!("its {} bytes", bytes.len()) });
        };
        let word = |at: usize| number(head, at).map_or(0, u32::from_le_bytes);
        let double = |at: usize| number(head, at).map_or(0.0, f64::from_le_bytes);
        let wrong = |place: &str, problem: String| FormatError::malformed(place, problem, REPAIR);
        let (packed, record) = (head[104], usize::from(u16::from_le_bytes([head[105], head[106]])));
        let format = packed & 0x3f;
        let Some((known, color)) = FORMATS.get(usize::from(format)).copied() else {
            return Err(wrong("byte 104", format!("there is no point format {format}")));
        };
        if record < known {
            return Err(wrong(
                "byte 105",
                format!("a record of point format {format} has {known} bytes, not {record}"),
            ));
        }
        let (scale, offset) =
            ([0, 1, 2].map(|axis| double(131 + 8 * axis)), [0, 1, 2].map(|axis| double(155 + 8 * axis)));
        if !scale.iter().all(|step| step.is_normal() && *step > 0.0) {
            return Err(wrong("byte 131", format!("{scale:?} is no scale")));
        }
        if !offset.iter().all(|x| x.is_finite()) {
            return Err(wrong("byte 155", format!("{offset:?} is no offset")));
        }
        let is_recent = (head[24], head[25]) >= (1, 4) && size >= 375;
        let count = match number(head, 247).map_or(0, u64::from_le_bytes) {
            count if is_recent && count > 0 => count,
            _ => u64::from(word(107)),
        };
        Ok(Header {
            format,
            // one bit was used before the other
            is_compressed: packed & 0xc0 != 0,
            record,
            known,
            count,
            start: word(96) as usize,
            scale: scale.map(Scale::new),
            offset,
            color,
            withheld: if format < 6 { (15, 0x80) } else { (15, 0x04) },
            records: (size, word(100)),
        })
    }

    /// The bytes of a further record, by who made it and its number.
    pub(super) fn record_of<'a>(&self, bytes: &'a [u8], user: &str, id: u16) -> Option<&'a [u8]> {
        let (mut at, count) = self.records;
        for _ in 0..count {
            let head = bytes.get(at..at + RECORD_HEAD)?;
            let length = usize::from(u16::from_le_bytes([head[20], head[21]]));
            at += RECORD_HEAD;
            let name = head[2..18].split(|byte| *byte == 0).next().unwrap_or_default();
            if u16::from_le_bytes([head[18], head[19]]) == id && name.eq_ignore_ascii_case(user.as_bytes()) {
                return bytes.get(at..at + length);
            }
            at += length;
        }
        None
    }
}

/// Bytes at a place.
fn number<const N: usize>(bytes: &[u8], at: usize) -> Option<[u8; N]> {
    bytes.get(at..at + N)?.try_into().ok()
}
