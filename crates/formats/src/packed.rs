//! Files packed with gzip, `scan.ply.gz`: they are read as what is in them.

use std::borrow::Cow;
use std::io::{ErrorKind, Read};

use super::{FormatError, ReadLimits};

/// How the names of packed files end.
const ENDING: &str = ".gz";
/// Bytes that one packed byte can make at most.
const MAX_GROWTH: u64 = 1032;
/// The bytes by which such a file begins.
const MAGIC: [u8; 2] = [0x1f, 0x8b];
/// Bytes of a packed file of nothing.
const LEAST: usize = 18;

/// The name of what is in a packed file, `None` if the name is that of no packed file.
pub fn inner_name(name: &str) -> Option<&str> {
    let at = name.len().checked_sub(ENDING.len())?;
    let (inner, ending) = name.split_at_checked(at)?;
    ending.eq_ignore_ascii_case(ENDING).then_some(inner)
}

/// The name and the bytes of a file as they are read: those of a packed one are unpacked.
///
/// # Errors
/// [`FormatError::TooManyBytes`] when it unpacks to more than is allowed, before it takes more than that;
/// [`FormatError::Truncated`] and [`FormatError::Malformed`] when it is damaged.
pub fn unpacked<'a>(
    name: &'a str,
    bytes: &'a [u8],
    limits: &ReadLimits,
) -> Result<(&'a str, Cow<'a, [u8]>), FormatError> {
    match inner_name(name) {
        Some(inner) => Ok((inner, unpack(bytes, limits.max_bytes)?.into())),
        None => Ok((name, bytes.into())),
    }
}

/// Packs a file. The same bytes always give the same: no time is noted.
pub fn pack(bytes: &[u8]) -> Vec<u8> {
    use std::io::Write;
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    // writing to memory can't fail
    let written = encoder.write_all(bytes).and_then(|()| encoder.finish());
    written.unwrap_or_default()
}

/// Unpacks a file, to at most `limit` bytes.
pub(super) fn unpack(bytes: &[u8], limit: u64) -> Result<Vec<u8>, FormatError> {
    let too_many = |found| FormatError::TooManyBytes { what: "unpacked, it has", found, limit };
    if !bytes.starts_with(&MAGIC) {
        let problem = "this is no gzip file, as its name says";
        return Err(FormatError::malformed("byte 0", problem, "leave out .gz if the file is not packed"));
    }
    // the last bytes tell the size, of its last part if it has several: a hint, and a word to be taken at
    let declared = bytes.last_chunk().map_or(0, |size| u64::from(u32::from_le_bytes(*size)));
    let possible = (bytes.len() as u64).saturating_mul(MAX_GROWTH);
    if bytes.len() >= LEAST && declared > limit && declared <= possible {
        return Err(too_many(declared));
    }
    let mut unpacked = Vec::with_capacity(declared.min(possible).min(limit) as usize);
    let decoder = flate2::bufread::MultiGzDecoder::new(bytes);
    let read = decoder.take(limit.saturating_add(1)).read_to_end(&mut unpacked);
    match read {
        _ if unpacked.len() as u64 > limit => Err(too_many(unpacked.len() as u64)),
        Ok(_) => Ok(unpacked),
        Err(error) if error.kind() == ErrorKind::UnexpectedEof => Err(FormatError::Truncated {
            declared: "a gzip file".into(),
            found: format!("it, after {} unpacked bytes", unpacked.len()),
        }),
        Err(error) => {
            let place = format!("unpacked byte {}", unpacked.len());
            Err(FormatError::malformed(place, format!("the gzip file is damaged ({error})"), "pack or upload it again"))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{check_name, obj, read, read_scans};
    use std::io::Write;

    const TEXT: &[u8] = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

    fn pack(bytes: &[u8]) -> Vec<u8> {
        let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
        encoder.write_all(bytes).expect("in memory");
        encoder.finish().expect("in memory")
    }

    #[test]
    fn a_packed_file_is_read_as_what_is_in_it() {
        let limits = ReadLimits::default();
        let plain = read("a.obj", TEXT, &limits).expect("sound");
        for name in ["a.obj.gz", "A.OBJ.GZ"] {
            assert_eq!(read(name, &pack(TEXT), &limits).as_ref(), Ok(&plain), "{name}");
            assert_eq!(read_scans(name, &pack(TEXT), &limits).expect("one").len(), 1);
            assert_eq!(check_name(name), Ok(&obj::FORMAT));
        }
        // as `cat a.gz b.gz` makes them
        let parts = [pack(&TEXT[..9]), pack(&TEXT[9..])].concat();
        assert_eq!(read("a.obj.gz", &parts, &limits), Ok(plain));
    }

    #[test]
    fn names_that_say_nothing_of_what_is_in_it_are_refused() {
        let message = |name: &str| check_name(name).expect_err(name).to_string();
        assert!(message("a.doc.gz").starts_with("files ending in \"doc.gz\" are not read; send "));
        for (name, ending) in [("a.gz", "gz"), (".gz", "gz"), ("a.tar.gz", "tar.gz"), ("a.ply.gz.gz", "gz.gz")] {
            assert!(message(name).starts_with(&format!("files ending in \"{ending}\" are packed; unpack")), "{name}");
        }
        assert_eq!(inner_name("ä.gz"), Some("ä"));
        assert_eq!((inner_name("gz"), inner_name("€€"), inner_name("a.ply")), (None, None, None));
    }

    #[test]
    fn bombs_are_refused_before_they_take_memory() {
        let limits = ReadLimits { max_bytes: 1 << 16, ..ReadLimits::default() };
        let bomb = pack(&vec![b'\n'; 1 << 20]);
        let told = unpack(&bomb, limits.max_bytes).expect_err("too large").to_string();
        assert!(told.starts_with("unpacked, it has 1048576 bytes, more than the 65536 that are allowed"), "{told}");
        // one that lies about its size is stopped at the limit
        let mut lying = bomb;
        let end = lying.len() - 4;
        lying[end..].fill(0);
        let stopped = read("a.obj.gz", &lying, &limits).expect_err("too large").to_string();
        assert!(stopped.starts_with("unpacked, it has 65537 bytes"), "{stopped}");
    }

    #[test]
    fn damage_is_named_and_never_read() {
        let whole = pack(TEXT);
        for length in 0..whole.len() {
            assert!(unpack(&whole[..length], 1 << 20).is_err(), "{length}");
        }
        for place in 10..whole.len() {
            let mut changed = whole.clone();
            changed[place] ^= 0x10;
            assert_ne!(unpack(&changed, 1 << 20).ok().filter(|bytes| bytes != TEXT).map(|_| place), Some(place));
        }
        assert!(unpack(TEXT, 1 << 20).expect_err("plain").to_string().contains("leave out .gz"));
    }
}
