//! The parts into which the gallery is divided where several servers search it: a model's part follows from its id.
//!
//! Parts don't depend on what is in the index, nor on how it is cut into segments: each server has segments of its own, and a model is in
//! the same part on all of them, be it in a file, in memory, or only in the database yet.

use std::fmt;
use std::str::FromStr;

use super::{ModelId, SeatId};

/// How many parts there are: as many values as the last byte of an id has. With a hundred searchers each has five of them, so
/// that none has much more to do than the others; a message names any of them in 64 letters.
pub const PARTS: usize = 256;
/// How many servers have each part: one of them may be gone.
pub const COPIES: usize = 2;

const WORDS: usize = PARTS / 64;

/// A part, by its number.
pub type Part = u8;

/// The part of a model: the last byte of its id, which is random in a UUID of version 7.
pub fn part_of(model: ModelId) -> Part {
    part_of_number(model.number())
}

/// The same for an id as a number.
pub fn part_of_number(model: u128) -> Part {
    model.to_be_bytes()[15]
}

/// Some of the parts. As text 64 hexadecimal digits, part 0 in the lowest bit of the last one.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Parts([u64; WORDS]);

impl Parts {
    /// None of them.
    pub const NONE: Parts = Parts([0; WORDS]);
    /// All of them.
    pub const ALL: Parts = Parts([u64::MAX; WORDS]);

    /// Whether a part is among them.
    pub fn hold(&self, part: Part) -> bool {
        self.0[usize::from(part) / 64] >> (part % 64) & 1 == 1
    }

    /// Adds a part.
    pub fn insert(&mut self, part: Part) {
        self.0[usize::from(part) / 64] |= 1 << (part % 64);
    }

    /// Those that are in either.
    #[must_use]
    pub fn and(&self, others: &Parts) -> Parts {
        self.combined(others, |a, b| a | b)
    }

    /// Those that are in both.
    #[must_use]
    pub fn common(&self, others: &Parts) -> Parts {
        self.combined(others, |a, b| a & b)
    }

    /// Those that are not among the others.
    #[must_use]
    pub fn without(&self, others: &Parts) -> Parts {
        self.combined(others, |a, b| a & !b)
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        *self == Parts::NONE
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.0.iter().map(|word| word.count_ones() as usize).sum()
    }

    /// One after the other, ascending.
    pub fn iter(&self) -> impl Iterator<Item = Part> + '_ {
        (0..=Part::MAX).filter(|part| self.hold(*part))
    }

    fn combined(&self, others: &Parts, word: impl Fn(u64, u64) -> u64) -> Parts {
        Parts(std::array::from_fn(|k| word(self.0[k], others.0[k])))
    }
}

impl FromIterator<Part> for Parts {
    fn from_iter<I: IntoIterator<Item = Part>>(parts: I) -> Parts {
        let mut all = Parts::NONE;
        parts.into_iter().for_each(|part| all.insert(part));
        all
    }
}

impl fmt::Display for Parts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().rev().try_for_each(|word| write!(f, "{word:016x}"))
    }
}

/// A text that names no parts.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("parts of the gallery are named by 64 hexadecimal digits")]
pub struct NoParts;

impl FromStr for Parts {
    type Err = NoParts;

    fn from_str(text: &str) -> Result<Parts, NoParts> {
        if text.len() != 16 * WORDS || !text.bytes().all(|byte| byte.is_ascii_hexdigit()) {
            return Err(NoParts);
        }
        let mut parts = Parts::NONE;
        for (word, digits) in parts.0.iter_mut().rev().zip(text.as_bytes().chunks(16)) {
            let digits = std::str::from_utf8(digits).map_err(|_| NoParts)?;
            *word = u64::from_str_radix(digits, 16).map_err(|_| NoParts)?;
        }
        Ok(parts)
    }
}

/// The servers that should have a part, at most [`COPIES`] of those that there are, the first choice first: rendezvous hashing (Thaler and
/// Ravishankar 1998). Each server has a weight by part, and the greatest win: so a server that comes or goes moves no part but those
/// that it wins or had won.
pub fn placed(part: Part, servers: &[SeatId]) -> Vec<SeatId> {
    let mut ranked = servers.to_vec();
    ranked.sort_unstable_by_key(|server| (std::cmp::Reverse(weight(part, *server)), *server));
    ranked.dedup();
    ranked.truncate(COPIES);
    ranked
}

/// The parts that a server should have.
pub fn placed_on(server: SeatId, servers: &[SeatId]) -> Parts {
    (0..=Part::MAX).filter(|part| placed(*part, servers).contains(&server)).collect()
}

/// How much a server wants a part: the same on every machine and in every version, since all have to agree.
pub fn weight(part: Part, server: SeatId) -> u64 {
    let number = server.number();
    mixed(mixed(mixed((number >> 64) as u64) ^ number as u64) ^ u64::from(part))
}

/// Spreads numbers evenly: the step of splitmix64 (Steele, Lea and Flood 2014).
fn mixed(number: u64) -> u64 {
    let mut mixed = number.wrapping_add(0x9e37_79b9_7f4a_7c15);
    mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    mixed ^ (mixed >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn servers(count: u128) -> Vec<SeatId> {
        (0..count).map(|k| SeatId::from_number((k + 1) * 0x0199_c6a0_6d5b_7a35_9d2c_6f3b_8d1e_4a71)).collect()
    }

    #[test]
    fn parts_are_told_as_text_and_nothing_else_is_taken_for_some() {
        let some: Parts = [0, 1, 63, 64, 200, 255].into_iter().collect();
        assert_eq!(some.to_string().parse(), Ok(some));
        assert_eq!(some.iter().collect::<Vec<_>>(), [0, 1, 63, 64, 200, 255]);
        assert_eq!((some.len(), Parts::ALL.len(), Parts::NONE.len()), (6, PARTS, 0));
        assert!(
            Parts::ALL.without(&some).common(&some).is_empty() && Parts::ALL.without(&some).and(&some) == Parts::ALL
        );
        for text in ["", "0", &"g".repeat(64), &"0".repeat(63), &"0".repeat(65), &"+".repeat(64), &"é".repeat(32)] {
            assert_eq!(text.parse::<Parts>(), Err(NoParts), "{text}");
        }
    }

    #[test]
    fn the_part_of_a_model_is_what_the_end_of_its_id_says() {
        let model = ModelId::new();
        let text = model.to_string();
        assert_eq!(format!("{:02x}", part_of(model)), text[34..], "statements of SQL look at these letters");
        assert_eq!(part_of(model), part_of_number(model.number()));
    }

    #[test]
    fn every_part_has_two_servers_and_none_has_too_much() {
        for count in 1..12 {
            let servers = servers(count);
            let copies = COPIES.min(servers.len());
            assert!((0..=Part::MAX).all(|part| placed(part, &servers).len() == copies));
            let loads: Vec<usize> = servers.iter().map(|server| placed_on(*server, &servers).len()).collect();
            assert_eq!(loads.iter().sum::<usize>(), copies * PARTS);
            let even = copies * PARTS / servers.len();
            assert!(loads.iter().all(|load| 10 * load > 6 * even && 10 * load < 14 * even), "{loads:?}, {even}");
        }
        assert!(placed(7, &[]).is_empty());
        let one = servers(1)[0];
        assert_eq!(placed(7, &[one, one]), [one], "nobody is two");
    }

    #[test]
    fn who_goes_moves_only_what_it_had_and_the_order_of_the_list_does_not_matter() {
        let all = servers(7);
        for gone in &all {
            let mut left: Vec<SeatId> = all.iter().filter(|server| *server != gone).copied().collect();
            left.reverse();
            for part in 0..=Part::MAX {
                let (before, after) = (placed(part, &all), placed(part, &left));
                let stay: Vec<SeatId> = before.iter().filter(|server| *server != gone).copied().collect();
                assert_eq!(after[..stay.len()], stay, "what stays keeps its order");
                assert_eq!(after.len(), COPIES);
            }
        }
    }
}
