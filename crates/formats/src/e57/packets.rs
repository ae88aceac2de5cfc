//! The packets of a scan's points: each holds a piece of every field's stream of bits.

use e57::{PointCloud, RecordDataType};

use super::REPAIR;
use super::pages::Pages;
use crate::FormatError;

/// Kinds of packets.
const INDEX: u8 = 0;
const DATA: u8 = 1;
const IGNORED: u8 = 2;
/// Bytes of the head of a section, and of a data packet's.
const SECTION: usize = 32;
const PACKET: usize = 6;
/// Bytes behind a stream, so that whole words can be read at its end.
const PADDING: usize = 16;

/// How the values of a field are stored.
#[derive(Debug, Clone, Copy)]
enum Kind {
    Single,
    Double,
    Whole { min: i64, scale: f64, offset: f64 },
}

/// A field's bits that have not been used yet.
#[derive(Debug)]
pub(super) struct Stream {
    kind: Kind,
    bits: usize,
    /// Passed over, where nobody asks for its values.
    is_wanted: bool,
    bytes: Vec<u8>,
    /// The next bit.
    position: usize,
}

/// Bits of a field's values: none where there is one value only.
pub(super) fn bits(kind: &RecordDataType) -> usize {
    match *kind {
        RecordDataType::Single { .. } => 32,
        RecordDataType::Double { .. } => 64,
        RecordDataType::Integer { min, max } | RecordDataType::ScaledInteger { min, max, .. } => {
            let range = (i128::from(max) - i128::from(min)).max(0);
            (i128::BITS - range.leading_zeros()) as usize
        }
    }
}

impl Stream {
    fn new(kind: &RecordDataType, is_wanted: bool) -> Self {
        let bits = bits(kind);
        let kind = match *kind {
            RecordDataType::Single { .. } => Kind::Single,
            RecordDataType::Double { .. } => Kind::Double,
            RecordDataType::Integer { min, .. } => Kind::Whole { min, scale: 1.0, offset: 0.0 },
            RecordDataType::ScaledInteger { min, scale, offset, .. } => Kind::Whole { min, scale, offset },
        };
        Stream { kind, bits, is_wanted, bytes: vec![0; PADDING], position: 0 }
    }

    /// Appends a packet's piece; what has been used goes.
    fn append(&mut self, piece: &[u8]) {
        let used = self.position / 8;
        self.bytes.truncate(self.bytes.len() - PADDING);
        self.bytes.drain(..used);
        self.position -= 8 * used;
        self.bytes.extend_from_slice(piece);
        self.bytes.resize(self.bytes.len() + PADDING, 0);
    }

    /// How many values are there; any number of one that takes no bits.
    fn available(&self) -> usize {
        (8 * (self.bytes.len() - PADDING) - self.position).checked_div(self.bits).unwrap_or(usize::MAX)
    }

    /// Fills in the next values; so many are there.
    fn take(&mut self, values: &mut [f64]) {
        let word = |bytes: &[u8], at: usize| -> u64 {
            bytes.get(at..at + 8).and_then(|word| word.try_into().ok()).map_or(0, u64::from_le_bytes)
        };
        match self.kind {
            // streams of floats are whole bytes
            Kind::Single => {
                for (index, value) in values.iter_mut().enumerate() {
                    *value = f64::from(f32::from_bits(word(&self.bytes, self.position / 8 + 4 * index) as u32));
                }
            }
            Kind::Double => {
                for (index, value) in values.iter_mut().enumerate() {
                    *value = f64::from_bits(word(&self.bytes, self.position / 8 + 8 * index));
                }
            }
            Kind::Whole { min, scale, offset } => {
                let mask = if self.bits >= 64 { u64::MAX } else { (1 << self.bits) - 1 };
                for (index, value) in values.iter_mut().enumerate() {
                    let bit = self.position + index * self.bits;
                    let (byte, shift) = (bit / 8, bit % 8);
                    let mut number = word(&self.bytes, byte) >> shift;
                    if shift + self.bits > 64 {
                        number |= word(&self.bytes, byte + 8) << (64 - shift);
                    }
                    *value = min.wrapping_add((number & mask) as i64) as f64 * scale + offset;
                }
            }
        }
        self.position += self.bits * values.len();
    }
}

/// The points of a scan, packet by packet.
pub(super) struct Packets<'a> {
    pages: Pages<'a>,
    place: &'a str,
    /// Where the next packet begins, in the content of the pages.
    next: u64,
    /// Where the section says that it ends: what stands there is no packet.
    end: u64,
    packet: Vec<u8>,
    streams: Vec<Stream>,
    /// Points that have not been read yet.
    left: u64,
    /// Bytes of packets that may still be read, of all scans: each is read once.
    unread: &'a mut u64,
}

impl<'a> Packets<'a> {
    /// Begins with the first packet. Fields that are not wanted are passed over.
    pub(super) fn new(
        bytes: &'a [u8],
        cloud: &PointCloud,
        place: &'a str,
        is_wanted: impl Fn(usize) -> bool,
        unread: &'a mut u64,
    ) -> Result<Self, FormatError> {
        let mut pages = Pages::new(bytes)?;
        let section = pages.read(cloud.file_offset, SECTION, place)?;
        let number = |at: usize| section[at..at + 8].try_into().map_or(0, u64::from_le_bytes);
        if section[0] != 1 {
            return Err(FormatError::malformed(place, "its points are not where the description says", REPAIR));
        }
        let fields = cloud.prototype.iter().enumerate();
        let streams = fields.map(|(index, field)| Stream::new(&field.data_type, is_wanted(index))).collect();
        let next = Pages::logical(number(16));
        let end = Pages::logical(cloud.file_offset).saturating_add(number(8));
        Ok(Packets { pages, place, next, end, packet: Vec::new(), streams, left: cloud.records, unread })
    }

    /// How many points can be taken now; packets are read until there are some. 0 behind the last.
    pub(super) fn available(&mut self) -> Result<usize, FormatError> {
        while self.left > 0 {
            let wanted = self.streams.iter().filter(|stream| stream.is_wanted);
            let count = wanted.map(Stream::available).min().unwrap_or(usize::MAX);
            if count > 0 {
                return Ok(usize::try_from(self.left).unwrap_or(usize::MAX).min(count));
            }
            self.read_packet()?;
        }
        Ok(0)
    }

    /// Fills in a wanted field of the next points.
    pub(super) fn take(&mut self, field: usize, values: &mut [f64]) {
        if let Some(stream) = self.streams.get_mut(field) {
            stream.take(values);
        }
    }

    /// All wanted fields of so many points have been taken.
    pub(super) fn advance(&mut self, count: usize) {
        self.left = self.left.saturating_sub(count as u64);
    }

    fn read_packet(&mut self) -> Result<(), FormatError> {
        let (is_behind, left) = (self.next >= self.end, self.left);
        self.read_next_packet().map_err(|error| if is_behind { self.cut(left) } else { error })
    }

    fn cut(&self, left: u64) -> FormatError {
        FormatError::Truncated {
            declared: format!("{left} more points of {}", self.place),
            found: "its packets".into(),
        }
    }

    fn read_next_packet(&mut self) -> Result<(), FormatError> {
        let place = self.place;
        let wrong = |problem: &str| FormatError::malformed(place, problem, REPAIR);
        self.pages.read_content(self.next, 4, self.place, &mut self.packet)?;
        let size = usize::from(u16::from_le_bytes([self.packet[2], self.packet[3]])) + 1;
        if !size.is_multiple_of(4) {
            return Err(wrong(&format!("a packet of {size} bytes does not end with a word")));
        }
        match self.unread.checked_sub(size as u64) {
            Some(unread) => *self.unread = unread,
            None => return Err(wrong("its packets are those of another scan")),
        }
        match self.packet[0] {
            INDEX | IGNORED => {}
            DATA => {
                self.pages.read_content(self.next, size, self.place, &mut self.packet)?;
                let count = self.streams.len();
                let declared =
                    self.packet.get(4..PACKET).map_or(0, |count| usize::from(count[0]) | usize::from(count[1]) << 8);
                if declared != count {
                    return Err(wrong(&format!("a packet has {declared} streams for {count} fields")));
                }
                let mut start = PACKET + 2 * count;
                for (index, stream) in self.streams.iter_mut().enumerate() {
                    let size = self.packet.get(PACKET + 2 * index..PACKET + 2 * index + 2);
                    let size = size.map_or(0, |size| usize::from(size[0]) | usize::from(size[1]) << 8);
                    let piece = self.packet.get(start..start + size).ok_or_else(|| wrong("a packet is too short"))?;
                    start += size;
                    if stream.is_wanted {
                        stream.append(piece);
                    }
                }
            }
            kind => return Err(wrong(&format!("there is no packet of kind {kind}"))),
        }
        self.next += size as u64;
        Ok(())
    }
}
