//! Compressed records: chunks, which the crate `laz` unpacks one by one, on all threads of the caller's pool.
//!
//! The crate trusts what it reads. What could make it take memory, or panic, is checked before: the number of chunks,
//! the items of a record, the sizes of layers; a chunk that makes it panic all the same is an error.

use std::io::{Cursor, Seek, SeekFrom};

use laz::laszip::ChunkTable;
use laz::{DecompressionSelection, LasZipDecompressor, LazVlr};
use rayon::prelude::*;

use super::header::Header;
use super::{REPAIR, Records};
use crate::guard::guarded;
use crate::{FormatError, ReadLimits};

/// Kinds of compression: all records in one chunk, chunks, chunks whose records are stored field by field.
const ONE_CHUNK: u16 = 1;
const CHUNKS: u16 = 2;
const LAYERS: u16 = 3;
/// Bytes of an item, and where they begin.
const ITEM: usize = 6;
const ITEMS: usize = 34;
/// For each point format: the items that its records are compressed as.
const ITEMS_OF: [&[u16]; 11] = [
    &[6],
    &[6, 7],
    &[6, 8],
    &[6, 7, 8],
    &[6, 7, 9],
    &[6, 7, 8, 9],
    &[10],
    &[10, 11],
    &[10, 12],
    &[10, 13],
    &[10, 12, 13],
];
/// For an item, by its number: its layers.
const fn layers(item: u16) -> usize {
    match item {
        10 => 9,
        12 => 2,
        _ => 1,
    }
}
/// Items of further bytes, without and with layers.
const BYTES: u16 = 0;
const LAYERED_BYTES: u16 = 14;
/// The most further bytes: each has models of its own.
const MOST_BYTES: usize = 192;
/// A chunk has so many points on average, beyond the first of them: making the models ready takes time.
const LEAST_POINTS: u64 = 50;
const FREE_CHUNKS: u64 = 1000;
/// What is unpacked at a time (bytes), in one chunk at least.
const BATCH: usize = 16 << 20;

/// A compressed piece of the file.
struct Chunk<'a> {
    bytes: &'a [u8],
    points: usize,
}

pub(super) fn read(bytes: &[u8], header: &Header, limits: &ReadLimits, into: &mut Records) -> Result<(), FormatError> {
    let found = header.count.saturating_mul(header.record as u64);
    if found > limits.max_bytes {
        let what = "its points are compressed and make";
        return Err(FormatError::TooManyBytes { what, found, limit: limits.max_bytes });
    }
    let record = header.record_of(bytes, "laszip encoded", 22204);
    let record = record.ok_or_else(|| wrong("there is no record that says how it is compressed"))?;
    let (kind, layers) = check_items(record, header)?;
    let vlr = LazVlr::from_buffer(record).map_err(|error| wrong(&error.to_string()))?;
    // a chunk alone is a file of one chunk
    let alone = [&ONE_CHUNK.to_le_bytes(), &record[2..]].concat();
    let alone = LazVlr::from_buffer(alone).map_err(|error| wrong(&error.to_string()))?;
    let chunks = if kind == ONE_CHUNK {
        vec![Chunk { bytes: bytes.get(header.start..).unwrap_or_default(), points: header.count as usize }]
    } else {
        chunks(bytes, header, &vlr)?
    };
    let mut rest = &chunks[..];
    while !rest.is_empty() {
        let mut size = 0;
        let fits = |chunk: &&Chunk| {
            size += chunk.points * header.record;
            size <= BATCH
        };
        let (batch, behind) = rest.split_at(rest.iter().take_while(fits).count().max(1));
        rest = behind;
        let unpacked: Vec<Result<Vec<u8>, FormatError>> = batch
            .par_iter()
            .map(|chunk| {
                if layers > 0 {
                    check_layers(chunk.bytes, header.record, layers)?;
                }
                unpack(chunk, header, &alone)
            })
            .collect();
        for records in unpacked {
            into.push(&records?)?;
        }
    }
    Ok(())
}

fn wrong(problem: &str) -> FormatError {
    FormatError::malformed("the compressed points", problem.chars().take(200).collect::<String>(), REPAIR)
}

fn cut() -> FormatError {
    FormatError::Truncated { declared: "more compressed points".into(), found: "their chunks".into() }
}

/// The kind of compression and the number of its layers. A record has to be compressed as its format demands.
fn check_items(record: &[u8], header: &Header) -> Result<(u16, usize), FormatError> {
    let number = |at: usize| record.get(at..at + 2).map(|pair| u16::from_le_bytes([pair[0], pair[1]]));
    let (Some(kind), Some(count)) = (number(0), number(ITEMS - 2)) else { return Err(cut()) };
    let expected = ITEMS_OF.get(usize::from(header.format)).copied().unwrap_or_default();
    let more = header.record - header.known;
    if usize::from(count) != expected.len() + usize::from(more > 0) {
        return Err(wrong(&format!("{count} items are not those of point format {}", header.format)));
    }
    if more > MOST_BYTES {
        let problem = format!("a point has {more} further bytes, more than {MOST_BYTES}");
        return Err(FormatError::malformed("the compressed points", problem, "export without extra dimensions"));
    }
    let (mut bytes, mut all_layers, mut versions) = (0, 0, [false; 2]);
    for index in 0..usize::from(count) {
        let at = ITEMS + ITEM * index;
        let (Some(item), Some(size), Some(version)) = (number(at), number(at + 2), number(at + 4)) else {
            return Err(cut());
        };
        let is_right = match expected.get(index) {
            Some(expected) => item == *expected,
            None => (item == BYTES || item == LAYERED_BYTES) && usize::from(size) == more,
        };
        if !is_right || !(1..=4).contains(&version) {
            return Err(wrong(&format!("item {item} of version {version} is not of point format {}", header.format)));
        }
        versions[usize::from(version > 2)] = true;
        bytes += usize::from(size);
        all_layers += if item == LAYERED_BYTES { more } else { layers(item) };
    }
    let is_layered = versions[1];
    if bytes != header.record || versions == [true; 2] || !matches!(kind, ONE_CHUNK | CHUNKS | LAYERS) {
        return Err(wrong("its items contradict each other"));
    }
    Ok((kind, if is_layered { all_layers } else { 0 }))
}

/// The chunks of a file that has a table of them.
fn chunks<'a>(bytes: &'a [u8], header: &Header, vlr: &LazVlr) -> Result<Vec<Chunk<'a>>, FormatError> {
    let place = |at: usize| -> Option<usize> {
        let bytes: [u8; 8] = bytes.get(at..at.checked_add(8)?)?.try_into().ok()?;
        usize::try_from(i64::from_le_bytes(bytes)).ok().filter(|place| *place > header.start)
    };
    // a writer that can't go back puts it at the end
    let table = place(header.start).or_else(|| place(bytes.len().checked_sub(8)?));
    let count = table.and_then(|table| bytes.get(table + 4..table + 8)).and_then(|count| count.try_into().ok());
    let (Some(table), Some(count)) = (table, count.map(u32::from_le_bytes)) else {
        let problem = "there is no table of chunks: the file was not written to its end";
        return Err(FormatError::malformed("the compressed points", problem, "export or upload it again"));
    };
    if u64::from(count) > FREE_CHUNKS + header.count / LEAST_POINTS {
        return Err(wrong(&format!("{count} chunks for {} points", header.count)));
    }
    let read = || {
        let mut source = Cursor::new(bytes);
        source.seek(SeekFrom::Start(header.start as u64)).map_err(|error| wrong(&error.to_string()))?;
        ChunkTable::read_from(source, vlr).map_err(|error| wrong(&error.to_string()))
    };
    let table_of = caught(read)?;
    let mut left = header.count;
    let mut rest = bytes.get(header.start + 8..table).unwrap_or_default();
    let mut chunks = Vec::with_capacity(table_of.len());
    for entry in table_of.as_ref() {
        let points = entry.point_count.min(left);
        let size = usize::try_from(entry.byte_count).ok().filter(|size| *size <= rest.len()).ok_or_else(cut)?;
        let (chunk, behind) = rest.split_at(size);
        rest = behind;
        left -= points;
        if points > 0 {
            chunks.push(Chunk { bytes: chunk, points: points as usize });
        }
    }
    if left > 0 { Err(cut()) } else { Ok(chunks) }
}

/// Whether the layers of a chunk are in it.
fn check_layers(chunk: &[u8], record: usize, layers: usize) -> Result<(), FormatError> {
    // the first record as it is, and the number of all
    let sizes = chunk.get(record + 4..record + 4 + 4 * layers).ok_or_else(cut)?;
    let size = |size: &[u8]| u64::from(u32::from_le_bytes([size[0], size[1], size[2], size[3]]));
    let needed: u64 = sizes.chunks_exact(4).map(size).sum();
    if needed > (chunk.len() - record - 4 - 4 * layers) as u64 { Err(cut()) } else { Ok(()) }
}

/// The records of a chunk.
fn unpack(chunk: &Chunk, header: &Header, alone: &LazVlr) -> Result<Vec<u8>, FormatError> {
    // only what is used
    let selection = DecompressionSelection(
        DecompressionSelection::Z
            | DecompressionSelection::INTENSITY
            | DecompressionSelection::FLAGS
            | DecompressionSelection::RGB,
    );
    caught(|| {
        let broken = |error: String| {
            let problem = format!("a chunk of {} points: {error:.150}", chunk.points);
            FormatError::malformed("the compressed points", problem, REPAIR)
        };
        let source = Cursor::new(chunk.bytes);
        let unpacker = LasZipDecompressor::selective(source, alone.clone(), selection);
        let mut unpacker = unpacker.map_err(|error| broken(error.to_string()))?;
        let mut records = vec![0; chunk.points * header.record];
        unpacker.decompress_many(&mut records).map_err(|error| broken(error.to_string()))?;
        Ok(records)
    })
}

/// Runs what may panic on bytes that no writer makes.
fn caught<T>(run: impl FnOnce() -> Result<T, FormatError>) -> Result<T, FormatError> {
    guarded(run).unwrap_or_else(|| Err(wrong("they make no sense")))
}
