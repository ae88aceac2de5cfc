//! Where the next page of an answer or of a list begins. A cursor leads back to what it was given out for, and to nothing
//! else.

use base64::Engine;
use base64::engine::general_purpose::URL_SAFE_NO_PAD;

use super::problem::{Code, Problem};
use visage_gallery::Rank;

/// Tells one question from another.
pub type Fingerprint = [u8; 8];

/// What tells questions apart, hashed: the same for each page of one question.
pub fn fingerprint(parts: &[&[u8]]) -> Fingerprint {
    let mut hasher = blake3::Hasher::new();
    for part in parts {
        hasher.update(&(part.len() as u64).to_le_bytes());
        hasher.update(part);
    }
    let mut first = [0; 8];
    hasher.finalize_xof().fill(&mut first);
    first
}

/// The cursor of the page of a ranking after the one that ends at `last`: fingerprint, score and id.
pub fn after(question: &Fingerprint, last: Rank) -> String {
    let mut bytes = Vec::with_capacity(32);
    bytes.extend(question);
    bytes.extend(last.score.to_be_bytes());
    bytes.extend(last.model_id.to_be_bytes());
    URL_SAFE_NO_PAD.encode(bytes)
}

/// Reads a cursor of a ranking; one of another question is refused.
pub fn read(cursor: &str, question: &Fingerprint) -> Result<Rank, Problem> {
    let place: [u8; 24] = place(cursor, question)?;
    let (score, id) = place.split_at(8);
    let score = f64::from_bits(number(score) as u64);
    if !(0.0..=1.0).contains(&score) {
        return Err(refused(UNKNOWN));
    }
    Ok(Rank { score, model_id: number(id) })
}

/// The cursor of the page of a list after the one that ends with the item of this id.
pub fn after_item(list: &Fingerprint, last: u128) -> String {
    after_items(list, [last])
}

/// The same where two items tell the place.
pub fn after_items<const N: usize>(list: &Fingerprint, last: [u128; N]) -> String {
    URL_SAFE_NO_PAD.encode([list.as_slice(), last.map(u128::to_be_bytes).as_flattened()].concat())
}

/// Reads a cursor of a list; one of another list, or of other filters, is refused.
pub fn read_item(cursor: &str, list: &Fingerprint) -> Result<u128, Problem> {
    place(cursor, list).map(u128::from_be_bytes)
}

/// Reads a cursor of a list in which two items tell the place.
pub fn read_items(cursor: &str, list: &Fingerprint) -> Result<[u128; 2], Problem> {
    let place: [u8; 32] = place(cursor, list)?;
    let (first, second) = place.split_at(16);
    Ok([number(first), number(second)])
}

const UNKNOWN: &str = "is none that was given out";

fn refused(detail: &str) -> Problem {
    let hint = "send next_cursor of the page before, with the same question or filters";
    Problem::new(Code::InvalidField, format!("cursor {detail}"), hint)
}

/// The place in a cursor, if it is one of this question.
fn place<const N: usize>(cursor: &str, question: &Fingerprint) -> Result<[u8; N], Problem> {
    let bytes = URL_SAFE_NO_PAD.decode(cursor).map_err(|_| refused(UNKNOWN))?;
    let (asked, place) = bytes.split_at_checked(question.len()).ok_or_else(|| refused(UNKNOWN))?;
    let place = place.try_into().map_err(|_| refused(UNKNOWN))?;
    if asked == question { Ok(place) } else { Err(refused("belongs to another question or list")) }
}

fn number(bytes: &[u8]) -> u128 {
    bytes.iter().fold(0, |number, byte| number << 8 | u128::from(*byte))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cursor_leads_back_to_its_question_alone() {
        let last = Rank { score: 0.123_456_789, model_id: u128::MAX - 5 };
        let (this, other) = (fingerprint(&[b"ab", b"c"]), fingerprint(&[b"a", b"bc"]));
        assert_ne!(this, other);
        let cursor = after(&this, last);
        assert_eq!(read(&cursor, &this).expect("its own"), last);
        assert!(read(&cursor, &other).is_err());
        for damaged in ["", "x", &cursor[1..], "____________________________________________"] {
            assert!(read(damaged, &this).is_err(), "{damaged}");
        }
    }

    #[test]
    fn a_cursor_of_a_list_is_of_no_other() {
        let (this, other) = (fingerprint(&[b"jobs"]), fingerprint(&[b"models"]));
        let last = u128::MAX - 7;
        let cursor = after_item(&this, last);
        assert_eq!(read_item(&cursor, &this).expect("its own"), last);
        assert!(read_item(&cursor, &other).is_err());
        let ranked = after(&this, Rank { score: 0.5, model_id: 1 });
        for wrong in [last.to_string(), String::new(), "zzz".to_owned(), ranked, format!("{cursor}AA")] {
            assert!(read_item(&wrong, &this).is_err(), "{wrong}");
        }
    }
}
