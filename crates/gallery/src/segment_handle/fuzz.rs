//! Sound files whose columns were changed at random, sealed again as if they had been written so: whatever is in them, reading ends with
//! an error or with a segment that answers, never with a panic.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::tests::{answers, encoded, gallery};
use super::*;

const HEAD: usize = 64;
const ENTRY: usize = 64;
/// Where the head says how long the file is, how many columns it has, and what its checksum is.
const LENGTH: usize = 32;
const COLUMNS: usize = 40;
const CHECKSUM: usize = 44;
/// Where an entry says how large an item is, what the checksum is, where the column begins and how long it is.
const ITEM: usize = 40;
const SUM: usize = 44;
const START: usize = 48;
const BYTES: usize = 56;
/// Files that are tried.
const FILES: u64 = 300;

/// A column by the entry of its directory, and its bytes.
type Column = ([u8; ENTRY], Vec<u8>);

fn number<const N: usize>(bytes: &[u8], at: usize) -> u64 {
    bytes[at..at + N].iter().rev().fold(0, |all, byte| all << 8 | u64::from(*byte))
}

fn taken_apart(file: &[u8]) -> Vec<Column> {
    let columns = number::<4>(file, COLUMNS) as usize;
    let column = |entry: &[u8]| {
        let (start, bytes) = (number::<8>(entry, START) as usize, number::<8>(entry, BYTES) as usize);
        (entry.try_into().expect("an entry"), file[start..start + bytes].to_vec())
    };
    file[HEAD..HEAD + columns * ENTRY].chunks_exact(ENTRY).map(column).collect()
}

/// A file of these columns, with every checksum as it should be.
fn sealed(head: &[u8], columns: &[Column]) -> (Vec<u8>, u32) {
    let (mut directory, mut content) = (Vec::new(), Vec::new());
    let first = HEAD + columns.len() * ENTRY;
    for (entry, bytes) in columns {
        let (mut entry, start) = (*entry, first + content.len());
        content.extend_from_slice(bytes);
        content.resize(content.len().next_multiple_of(64), 0);
        entry[SUM..START].copy_from_slice(&crc32c::crc32c(&content[start - first..]).to_le_bytes());
        entry[START..BYTES].copy_from_slice(&(start as u64).to_le_bytes());
        entry[BYTES..].copy_from_slice(&(bytes.len() as u64).to_le_bytes());
        directory.extend_from_slice(&entry);
    }
    let mut head = head.to_vec();
    head[LENGTH..COLUMNS].copy_from_slice(&((first + content.len()) as u64).to_le_bytes());
    head[COLUMNS..CHECKSUM].copy_from_slice(&(columns.len() as u32).to_le_bytes());
    head[CHECKSUM..CHECKSUM + 4].fill(0);
    let checksum = crc32c::crc32c(&[&head[..], &directory].concat());
    head[CHECKSUM..CHECKSUM + 4].copy_from_slice(&checksum.to_le_bytes());
    ([head, directory, content].concat(), checksum)
}

fn change(random: &mut ChaCha8Rng, columns: &mut Vec<Column>) {
    let which = random.random_range(0..columns.len());
    let item = number::<4>(&columns[which].0, ITEM).max(1) as usize;
    let bytes = &mut columns[which].1;
    match random.random_range(0..10) {
        0..6 if !bytes.is_empty() => {
            // a number, or a part of one
            let at = random.random_range(0..bytes.len());
            let values = [0, 1, 0x7f, 0x80, 0xff, random.random::<u8>()];
            let value = values[random.random_range(0..values.len())];
            let end = (at + random.random_range(1..9)).min(bytes.len());
            bytes[at..end].fill(value);
        }
        6 => bytes.truncate(bytes.len() / item / 2 * item),
        7 => bytes.extend(vec![random.random::<u8>(); item * random.random_range(1..4)]),
        8 => drop(columns.remove(which)),
        _ => {
            let other = random.random_range(0..columns.len());
            let taken = columns[other].1.clone();
            columns[which].1 = taken;
        }
    }
}

#[test]
fn no_file_that_is_sealed_ends_more_than_itself() {
    let sound = encoded(&gallery(110));
    let (head, columns) = (&sound[..HEAD], taken_apart(&sound));
    assert_eq!(sealed(head, &columns).0, sound, "taken apart and put together it is the same");
    let mut answered = 0;
    for seed in 0..FILES {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut columns = columns.clone();
        for _ in 0..random.random_range(1..4) {
            change(&mut random, &mut columns);
        }
        let (file, checksum) = sealed(head, &columns);
        assert_eq!(check(&mut &file[..]), Ok(checksum));
        let answer = std::panic::catch_unwind(|| {
            let segment = SegmentHandle::decode(1, checksum, &file.into()).ok()?;
            let mut gallery = Gallery::default();
            gallery.attach(segment);
            gallery.remove(3);
            answers(&gallery);
            // it may be merged, too
            let merged = gallery.due_to_forget().map(|merge| merge.run());
            merged.is_some_and(|merged| gallery.adopt(merged)).then_some(())
        });
        answered += u32::from(answer.unwrap_or_else(|_| panic!("seed {seed}")).is_some());
    }
    assert!(answered > 0, "some changes are not noticed");
}
