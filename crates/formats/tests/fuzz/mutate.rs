//! Changes of files: of bits, of numbers in binary and in text, of words and of pieces.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::seeds::Seed;

/// Words that are odd in every format.
const ODD: &[&str] = &[
    "nan",
    "-nan(ind)",
    "inf",
    "-1.#IND",
    "1e400",
    "1e20",
    "-1",
    "0",
    "1",
    "255",
    "256",
    "65535",
    "65536",
    "2147483647",
    "2147483648",
    "-2147483648",
    "4294967295",
    "4294967296",
    "9223372036854775807",
    "18446744073709551615",
    "1000000000000",
    "1e-320",
    "0.1",
    "-0",
    "\\",
    "#",
    "\"",
    "'",
    ",",
    ";",
    "\t",
    "\0",
    "\u{feff}",
    "\u{fffd}",
    "%",
    "/",
    "..",
];

/// Numbers that are odd as lengths and counts.
const EXTREMES: [u64; 16] = [
    0,
    1,
    2,
    3,
    0x7f,
    0xff,
    0x7fff,
    0xffff,
    0x7fff_ffff,
    0x8000_0000,
    0xffff_ffff,
    0x7fff_ffff_ffff_ffff,
    0x8000_0000_0000_0000,
    u64::MAX,
    0x7ff8_0000_0000_0000,
    0x7f80_0000,
];

/// Any of them.
pub fn pick<'a, T>(random: &mut ChaCha8Rng, from: &'a [T]) -> &'a T {
    &from[random.random_range(0..from.len())]
}

/// A range of a file, at most `most` bytes long.
fn range(random: &mut ChaCha8Rng, file: &[u8], most: usize) -> std::ops::Range<usize> {
    let start = random.random_range(0..=file.len());
    start..(start + random.random_range(0..=most)).min(file.len())
}

/// One change.
pub fn change(random: &mut ChaCha8Rng, file: &mut Vec<u8>, others: &[Seed], words: &[&str]) {
    match random.random_range(0..16) {
        0 if !file.is_empty() => {
            let place = random.random_range(0..file.len());
            file[place] ^= 1 << random.random_range(0..8);
        }
        1 => {
            let cut = range(random, file, 40);
            file.drain(cut);
        }
        2 => {
            let copied = range(random, file, 60);
            let copied = file[copied].repeat(random.random_range(1..20));
            let place = random.random_range(0..=file.len());
            file.splice(place..place, copied);
        }
        3 => {
            let other = &pick(random, others).bytes;
            let from = range(random, other, 300);
            let to = range(random, file, 300);
            file.splice(to, other[from].iter().copied());
        }
        4 => {
            let other = &pick(random, others).bytes;
            let (head, tail) = (random.random_range(0..=file.len()), random.random_range(0..=other.len()));
            file.truncate(head);
            file.extend(&other[tail..]);
        }
        5 => file.truncate(random.random_range(0..=file.len())),
        6 => line_ends(random, file),
        7..=9 => binary_number(random, file),
        10 | 11 => text_number(random, file),
        12 => {
            let place = random.random_range(0..=file.len());
            file.splice(place..place, word(random, words).bytes());
        }
        _ => {
            let Some(range) = a_word(random, file) else { return };
            file.splice(range, word(random, words).bytes());
        }
    }
}

/// A word of the format, or an odd one.
fn word<'a>(random: &mut ChaCha8Rng, words: &[&'a str]) -> &'a str {
    let from = if words.is_empty() || random.random_bool(0.4) { ODD } else { words };
    from[random.random_range(0..from.len())]
}

fn line_ends(random: &mut ChaCha8Rng, file: &mut Vec<u8>) {
    let end = *pick(random, &[&b"\r\n"[..], b"\r", b"\n\r", b" ", b""]);
    let share = *pick(random, &[1.0, 0.3]);
    let mut changed = Vec::with_capacity(file.len());
    for byte in &*file {
        if *byte == b'\n' && random.random_bool(share) { changed.extend(end) } else { changed.push(*byte) }
    }
    *file = changed;
}

/// A number of one to eight bytes, replaced by an extreme one, the length of the file, or one near to it.
fn binary_number(random: &mut ChaCha8Rng, file: &mut [u8]) {
    let size = *pick(random, &[1, 2, 4, 4, 8]);
    if file.len() < size {
        return;
    }
    let mut place = random.random_range(0..=file.len() - size);
    // fields of heads are near to the beginning, and aligned
    if random.random_bool(0.5) {
        place = place.min(random.random_range(0..=128)).min(file.len() - size) / size * size;
    }
    let is_big = random.random_bool(0.3);
    let field = &mut file[place..place + size];
    let mut bytes = [0; 8];
    bytes[..size].copy_from_slice(field);
    if is_big {
        bytes[..size].reverse();
    }
    let old = u64::from_le_bytes(bytes);
    let new = match random.random_range(0..5) {
        0 => old.wrapping_add(random.random_range(1..4)),
        1 => old.wrapping_sub(random.random_range(1..4)),
        2 => old.wrapping_mul(1 << random.random_range(1..30)),
        3 => random.random_range(0..1 << 17),
        _ => *pick(random, &EXTREMES),
    };
    let mut bytes = new.to_le_bytes();
    if is_big {
        bytes[..size].reverse();
    }
    field.copy_from_slice(&bytes[..size]);
}

/// A run of digits, made another number.
fn text_number(random: &mut ChaCha8Rng, file: &mut Vec<u8>) {
    let starts: Vec<usize> =
        (0..file.len()).filter(|k| file[*k].is_ascii_digit() && (*k == 0 || !file[*k - 1].is_ascii_digit())).collect();
    if starts.is_empty() {
        return;
    }
    let start = *pick(random, &starts);
    let length = file[start..].iter().position(|byte| !byte.is_ascii_digit()).unwrap_or(file.len() - start);
    let old: i64 =
        std::str::from_utf8(&file[start..start + length]).ok().and_then(|text| text.parse().ok()).unwrap_or(7);
    let new = match random.random_range(0..6) {
        0 => old.wrapping_add(1).to_string(),
        1 => old.wrapping_sub(1).to_string(),
        2 => old.wrapping_mul(1000).to_string(),
        3 => pick(random, &EXTREMES).to_string(),
        4 => "9".repeat(random.random_range(1..400)),
        _ => random.random_range(0..70_000).to_string(),
    };
    file.splice(start..start + length, new.into_bytes());
}

/// A run of bytes between blanks, brackets and commas.
fn a_word(random: &mut ChaCha8Rng, file: &[u8]) -> Option<std::ops::Range<usize>> {
    let is_between = |byte: u8| byte.is_ascii_whitespace() || b",;:<>[]{}()=\"'/".contains(&byte);
    let starts: Vec<usize> =
        (0..file.len()).filter(|k| !is_between(file[*k]) && (*k == 0 || is_between(file[*k - 1]))).collect();
    if starts.is_empty() {
        return None;
    }
    let start = *pick(random, &starts);
    let length = file[start..].iter().position(|byte| is_between(*byte)).unwrap_or(file.len() - start);
    Some(start..start + length.min(40))
}
