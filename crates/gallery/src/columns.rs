//! Columns by name, as a segment's file holds them: a head, a directory, and one array after the other.
//!
//! ```text
//! head        64 bytes: magic, format, order of bytes, versions of what is inside, number of models and of columns,
//!             and the CRC-32C of head and directory
//! directory   64 bytes a column: its name, the size of an item, the CRC-32C of its bytes, where it begins, its length
//! columns     each from a multiple of 64 on, with zeros up to the next
//! ```
//! Numbers are as this machine keeps them, which on every machine that is supported is the little end first; a file of another order
//! is refused, like one of another version. A struct says which of its fields are columns in one line each ([`stored`]).

use std::collections::BTreeMap;
use std::io;

use bytemuck::{Pod, Zeroable};
use bytes::Bytes;

use super::column::Column;

/// The layout told above.
const FORMAT: u32 = 1;
const MAGIC: [u8; 8] = *b"VISAGSEG";
/// Reads differently where bytes come in another order.
const ORDER: u32 = 0x0403_0201;
/// Columns begin at multiples of this: as much as any item wants, and a line of cache.
const ALIGNMENT: usize = 64;
/// More columns are no segment.
const MOST_COLUMNS: usize = 256;
const NAME_BYTES: usize = 40;
/// Bytes that are read at once to be checked.
const CHUNK: usize = 1 << 18;

/// Why a file is not used.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum SegmentError {
    /// It was written by another version, or on a machine with another order of bytes.
    #[error("it is of another version")]
    OtherVersion,
    /// It is not as it was written.
    #[error("it is damaged: {0}")]
    Damaged(String),
}

pub(super) fn damaged(what: impl Into<String>) -> SegmentError {
    SegmentError::Damaged(what.into())
}

#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Head {
    magic: [u8; 8],
    format: u32,
    order: u32,
    versions: [u32; 2],
    models: u64,
    bytes: u64,
    columns: u32,
    /// Of the head without this, and of the directory.
    checksum: u32,
    rest: [u8; 16],
}

#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Entry {
    name: [u8; NAME_BYTES],
    item: u32,
    /// Of the column's bytes and the zeros after them.
    checksum: u32,
    start: u64,
    bytes: u64,
}

const HEAD: usize = size_of::<Head>();
const ENTRY: usize = size_of::<Entry>();
const ZEROS: [u8; ALIGNMENT] = [0; ALIGNMENT];

impl Head {
    fn checksum(&self, directory: &[u8]) -> u32 {
        let head = Head { checksum: 0, ..*self };
        crc32c::crc32c_append(crc32c::crc32c(bytemuck::bytes_of(&head)), directory)
    }

    /// The head of a file and the length of its directory.
    fn read(bytes: &[u8], versions: [u32; 2]) -> Result<(Head, usize), SegmentError> {
        let bytes = bytes.get(..HEAD).ok_or_else(|| damaged("it ends in its head"))?;
        let head: Head = bytemuck::pod_read_unaligned(bytes);
        if head.magic != MAGIC {
            return Err(damaged("it does not begin as a segment"));
        }
        if (head.format, head.order, head.versions) != (FORMAT, ORDER, versions) {
            return Err(SegmentError::OtherVersion);
        }
        let columns = head.columns as usize;
        if columns > MOST_COLUMNS {
            return Err(damaged(format!("it would have {columns} columns")));
        }
        Ok((head, columns * ENTRY))
    }

    /// The entries of the directory, each where the one before ends.
    fn entries(&self, directory: &[u8]) -> Result<Vec<Entry>, SegmentError> {
        if self.checksum(directory) != self.checksum {
            return Err(damaged("the checksum of its head differs"));
        }
        let mut at = (HEAD + directory.len()) as u64;
        let entries = directory.chunks_exact(ENTRY).map(|bytes| {
            let entry: Entry = bytemuck::pod_read_unaligned(bytes);
            let end = entry.start.checked_add(entry.bytes).filter(|end| *end <= self.bytes);
            let end = end.filter(|_| entry.start == at).ok_or_else(|| damaged("its columns overlap"))?;
            at = end.next_multiple_of(ALIGNMENT as u64);
            Ok(entry)
        });
        let entries: Vec<Entry> = entries.collect::<Result<_, _>>()?;
        if at == self.bytes { Ok(entries) } else { Err(damaged("it has another length than it says")) }
    }
}

fn padding(bytes: usize) -> &'static [u8] {
    &ZEROS[..bytes.next_multiple_of(ALIGNMENT) - bytes]
}

/// A segment as it is written: its head, its directory, and its columns where they are.
#[derive(Debug)]
pub struct SegmentImage<'a> {
    start: Vec<u8>,
    columns: Vec<&'a [u8]>,
    bytes: u64,
    checksum: u32,
}

impl<'a> SegmentImage<'a> {
    pub(super) fn of(content: &'a impl Stored, models: usize, versions: [u32; 2]) -> SegmentImage<'a> {
        let mut list = ColumnList::default();
        content.write("", &mut list);
        let mut at = HEAD + list.0.len() * ENTRY;
        let mut directory = Vec::with_capacity(list.0.len() * ENTRY);
        for (name, item, bytes) in &list.0 {
            debug_assert!(name.len() <= NAME_BYTES, "{name}");
            let mut entry = Entry {
                name: [0; NAME_BYTES],
                item: *item as u32,
                checksum: crc32c::crc32c_append(crc32c::crc32c(bytes), padding(bytes.len())),
                start: at as u64,
                bytes: bytes.len() as u64,
            };
            entry.name.iter_mut().zip(name.bytes()).for_each(|(to, from)| *to = from);
            directory.extend_from_slice(bytemuck::bytes_of(&entry));
            at += bytes.len().next_multiple_of(ALIGNMENT);
        }
        let (magic, columns, rest) = (MAGIC, list.0.len() as u32, [0; 16]);
        let (bytes, models) = (at as u64, models as u64);
        let mut head =
            Head { magic, format: FORMAT, order: ORDER, versions, models, bytes, columns, checksum: 0, rest };
        head.checksum = head.checksum(&directory);
        let start = [bytemuck::bytes_of(&head), &directory].concat();
        SegmentImage { start, columns: list.0.into_iter().map(|c| c.2).collect(), bytes, checksum: head.checksum }
    }

    /// Bytes of the file.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// The checksum of its head, which holds those of all columns.
    pub fn checksum(&self) -> u32 {
        self.checksum
    }

    /// Writes it.
    pub fn write_to(&self, to: &mut (impl io::Write + ?Sized)) -> io::Result<()> {
        to.write_all(&self.start)?;
        for column in &self.columns {
            to.write_all(column)?;
            to.write_all(padding(column.len()))?;
        }
        Ok(())
    }

    /// The bytes of the file.
    pub fn to_bytes(&self) -> Vec<u8> {
        let padded = self.columns.iter().flat_map(|column| [*column, padding(column.len())]);
        [self.start.as_slice()].into_iter().chain(padded).collect::<Vec<_>>().concat()
    }
}

/// Reads a whole file, from its beginning, and holds every byte against the checksums; answers with that of its head. What kind of
/// columns it has is not looked at.
pub fn check(file: &mut impl io::Read, versions: [u32; 2]) -> Result<u32, SegmentError> {
    let broken = |error: io::Error| damaged(error.to_string());
    let mut start = vec![0; HEAD];
    file.read_exact(&mut start).map_err(broken)?;
    let (head, directory) = Head::read(&start, versions)?;
    let mut directory = vec![0; directory];
    file.read_exact(&mut directory).map_err(broken)?;
    let mut buffer = vec![0; CHUNK];
    for entry in head.entries(&directory)? {
        let (mut left, mut checksum) = (entry.bytes.next_multiple_of(ALIGNMENT as u64), 0);
        while left > 0 {
            let chunk = &mut buffer[..left.min(CHUNK as u64) as usize];
            file.read_exact(chunk).map_err(broken)?;
            checksum = crc32c::crc32c_append(checksum, chunk);
            left -= chunk.len() as u64;
        }
        if checksum != entry.checksum {
            return Err(damaged(format!("the checksum of {} differs", name_of(&entry))));
        }
    }
    match file.read(&mut buffer[..1]).map_err(broken)? {
        0 => Ok(head.checksum),
        _ => Err(damaged("there is more than it says")),
    }
}

fn name_of(entry: &Entry) -> String {
    let end = entry.name.iter().position(|byte| *byte == 0).unwrap_or(NAME_BYTES);
    String::from_utf8_lossy(&entry.name[..end]).into_owned()
}

/// The columns of a file, to be taken by name.
pub(super) struct Columns {
    columns: BTreeMap<String, (usize, Bytes)>,
    /// Models, as the head says.
    pub models: u64,
    /// The checksum of the head.
    pub checksum: u32,
}

impl Columns {
    /// Those of a file. Its head and its length are checked; its columns are not read ([`check`] does).
    pub fn of(bytes: &Bytes, versions: [u32; 2]) -> Result<Columns, SegmentError> {
        let (head, directory) = Head::read(bytes, versions)?;
        if head.bytes != bytes.len() as u64 {
            return Err(damaged(format!("it has {} bytes of {}", bytes.len(), head.bytes)));
        }
        let directory = bytes.get(HEAD..HEAD + directory).ok_or_else(|| damaged("it ends in its directory"))?;
        let mut columns = BTreeMap::new();
        for entry in head.entries(directory)? {
            let start = entry.start as usize;
            let column = bytes.slice(start..start + entry.bytes as usize);
            columns.insert(name_of(&entry), (entry.item as usize, column));
        }
        Ok(Columns { columns, models: head.models, checksum: head.checksum })
    }

    fn take<T: Pod>(&self, name: &str) -> Result<Column<T>, SegmentError> {
        let found = self.columns.get(name).filter(|(item, _)| *item == size_of::<T>());
        let column = found.and_then(|(_, bytes)| Column::from_bytes(bytes.clone()));
        column.ok_or_else(|| damaged(format!("there is no {name}")))
    }
}

/// The columns that are to be written: name, size of an item, bytes.
#[derive(Default)]
pub(super) struct ColumnList<'a>(Vec<(String, usize, &'a [u8])>);

/// What is kept as columns.
pub(super) trait Stored: Sized {
    /// Lists its columns, whose names begin with `name`.
    fn write<'a>(&'a self, name: &str, to: &mut ColumnList<'a>);

    /// Made of its columns, whose names begin with `name`.
    fn read(name: &str, from: &Columns) -> Result<Self, SegmentError>;
}

impl<T: Pod> Stored for Column<T> {
    fn write<'a>(&'a self, name: &str, to: &mut ColumnList<'a>) {
        to.0.push((name.to_owned(), size_of::<T>(), self.as_bytes()));
    }

    fn read(name: &str, from: &Columns) -> Result<Self, SegmentError> {
        from.take(name)
    }
}

/// A number alone is a column of one.
macro_rules! numbers {
    ($($kind:ty),*) => {$(
        impl Stored for $kind {
            fn write<'a>(&'a self, name: &str, to: &mut ColumnList<'a>) {
                to.0.push((name.to_owned(), size_of::<$kind>(), bytemuck::bytes_of(self)));
            }

            fn read(name: &str, from: &Columns) -> Result<Self, SegmentError> {
                let column: Column<$kind> = from.take(name)?;
                match &*column {
                    [number] => Ok(*number),
                    _ => Err(damaged(format!("{name} is not one number"))),
                }
            }
        }
    )*};
}
numbers!(f32, u32);

impl<S: Stored, const N: usize> Stored for [S; N] {
    fn write<'a>(&'a self, name: &str, to: &mut ColumnList<'a>) {
        self.iter().enumerate().for_each(|(k, item)| item.write(&format!("{name}.{k}"), to));
    }

    fn read(name: &str, from: &Columns) -> Result<Self, SegmentError> {
        let items: Result<Vec<S>, SegmentError> = (0..N).map(|k| S::read(&format!("{name}.{k}"), from)).collect();
        items?.try_into().map_err(|_| damaged(name))
    }
}

/// One that is not there has no columns.
impl<S: Stored> Stored for Option<S> {
    fn write<'a>(&'a self, name: &str, to: &mut ColumnList<'a>) {
        self.iter().for_each(|item| item.write(name, to));
    }

    fn read(name: &str, from: &Columns) -> Result<Self, SegmentError> {
        let is_there = from.columns.keys().any(|key| key.strip_prefix(name).is_some_and(|rest| rest.starts_with('.')));
        is_there.then(|| S::read(name, from)).transpose()
    }
}

/// Says which fields of a struct are stored: all of them, each a column, a number, or something stored itself.
macro_rules! stored {
    (impl[$($generics:tt)*] $kind:ty { $($field:ident),* $(,)? }) => {
        impl<$($generics)*> $crate::columns::Stored for $kind {
            fn write<'a>(&'a self, name: &str, to: &mut $crate::columns::ColumnList<'a>) {
                $($crate::columns::Stored::write(&self.$field, &$crate::columns::within(name, stringify!($field)), to);)*
            }

            fn read(name: &str, from: &$crate::columns::Columns) -> Result<Self, $crate::columns::SegmentError> {
                Ok(Self {
                    $($field: $crate::columns::Stored::read(&$crate::columns::within(name, stringify!($field)), from)?,)*
                })
            }
        }
    };
    ($kind:ty { $($field:ident),* $(,)? }) => {
        $crate::columns::stored! { impl[] $kind { $($field),* } }
    };
}
pub(super) use stored;

/// The name of a field of what has a name.
pub(super) fn within(name: &str, field: &str) -> String {
    if name.is_empty() { field.to_owned() } else { format!("{name}.{field}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    const VERSIONS: [u32; 2] = [1, 2];

    #[derive(Debug, PartialEq)]
    struct Inner {
        of_words: Column<u16>,
        unit: f32,
    }

    stored!(Inner { of_words, unit });

    #[derive(Debug, PartialEq)]
    struct Outer {
        wide: Column<[f64; 3]>,
        pair: [Column<u8>; 2],
        there: Option<Inner>,
        missing: Option<Inner>,
        count: u32,
    }

    stored!(Outer { wide, pair, there, missing, count });

    fn outer() -> Outer {
        Outer {
            wide: vec![[1.0, 2.0, 3.0], [-0.5, f64::MAX, 0.0]].into(),
            pair: [vec![1u8, 2, 3].into(), Column::default()],
            there: Some(Inner { of_words: vec![7u16; 40].into(), unit: 0.25 }),
            missing: None,
            count: 9,
        }
    }

    fn file() -> Vec<u8> {
        SegmentImage::of(&outer(), 2, VERSIONS).to_bytes()
    }

    fn read(bytes: &[u8]) -> Result<Outer, SegmentError> {
        let columns = Columns::of(&Bytes::copy_from_slice(bytes), VERSIONS)?;
        assert_eq!(columns.models, 2);
        Outer::read("", &columns)
    }

    #[test]
    fn what_is_written_is_read() {
        let (outer, mut written) = (outer(), Vec::new());
        let image = SegmentImage::of(&outer, 2, VERSIONS);
        image.write_to(&mut written).expect("into memory");
        assert_eq!(written, image.to_bytes());
        assert_eq!(image.bytes(), written.len() as u64);
        assert_eq!(read(&written).expect("sound"), outer);
        assert_eq!(check(&mut &written[..], VERSIONS), Ok(image.checksum()));
    }

    #[test]
    fn no_flipped_bit_and_no_other_length_is_taken_for_sound() {
        let sound = file();
        for at in 0..8 * sound.len() {
            let mut flipped = sound.clone();
            flipped[at / 8] ^= 1 << (at % 8);
            assert!(check(&mut &flipped[..], VERSIONS).is_err(), "bit {at}");
            // what is in a column is not looked at here
            let _ = read(&flipped);
        }
        for end in 0..sound.len() {
            assert!(check(&mut &sound[..end], VERSIONS).is_err() && read(&sound[..end]).is_err(), "ends at {end}");
        }
        let longer = [&sound[..], &[0]].concat();
        assert!(check(&mut &longer[..], VERSIONS).is_err() && read(&longer).is_err());
    }

    #[test]
    fn another_version_is_no_damage() {
        let other = [1, 3];
        assert_eq!(Columns::of(&file().into(), other).err(), Some(SegmentError::OtherVersion));
        assert_eq!(check(&mut &file()[..], other), Err(SegmentError::OtherVersion));
    }
}
