//! Where the next page of an answer begins.

use base64::Engine;
use base64::engine::general_purpose::URL_SAFE_NO_PAD;

use super::super::problem::{Code, Problem};
use crate::retrieval::Rank;

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

/// The cursor of the page after the one that ends at `last`: fingerprint, score and id.
pub fn after(question: &Fingerprint, last: Rank) -> String {
    let mut bytes = Vec::with_capacity(32);
    bytes.extend(question);
    bytes.extend(last.score.to_be_bytes());
    bytes.extend(last.model_id.to_be_bytes());
    URL_SAFE_NO_PAD.encode(bytes)
}

/// Reads a cursor; one of another question is refused.
pub fn read(cursor: &str, question: &Fingerprint) -> Result<Rank, Problem> {
    let refused = |detail: &str| {
        let hint = "send next_cursor of the page before, with the same question";
        Problem::new(Code::InvalidField, format!("cursor {detail}"), hint)
    };
    let bytes: [u8; 32] = URL_SAFE_NO_PAD
        .decode(cursor)
        .ok()
        .and_then(|bytes| bytes.try_into().ok())
        .ok_or_else(|| refused("is none that was given out"))?;
    let (asked, rank) = bytes.split_at(8);
    if asked != question {
        return Err(refused("belongs to another question"));
    }
    let (score, id) = rank.split_at(8);
    let number = |bytes: &[u8]| bytes.iter().fold(0u128, |number, byte| number << 8 | u128::from(*byte));
    let score = f64::from_bits(number(score) as u64);
    if !(0.0..=1.0).contains(&score) {
        return Err(refused("is none that was given out"));
    }
    Ok(Rank { score, model_id: number(id) })
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
}
