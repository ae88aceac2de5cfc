//! Scans whose picture ends in the middle of a surface: a camera's frame, a cut-out, a part of a room.
//!
//! Of a whole object before a wide view it says much that a scanner saw nothing beside it. Of a frame it says nothing.
//! Which of both a scan is shows where another one lies on it: much surface beyond the picture, and hardly any that
//! contradicts what is inside.

use super::link::Link;
use super::sketch::Sketch;
use super::votes::SurfelVotes;

/// Surfels that have to agree before a link says something of pictures.
const LEAST_AGREE: f64 = 60.0;
/// Of what is said inside both pictures this share has to agree.
const COHERENT: f64 = 0.75;
/// A picture is cropped if this share of what should be in it is missed: on right motions of whole objects hardly anything
/// is, whatever the scanner.
const MISSED: f64 = 0.12;

/// Frames come in sets: fewer than this share of cropped pictures are whole objects that were laid on each other wrongly,
const FRAMES: f64 = 1.0 / 3.0;
/// and where this share of a large set is cropped all are: one scanner took them, and of some the best link shows it by
/// chance not.
const ALL_FRAMES: f64 = 2.0 / 3.0;

/// How many sketches of a set have to be cropped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Frames {
    /// As many as come in sets.
    Some,
    /// So many that all are: plain enough before anything is laid together.
    All,
}

/// Marks the sketches that are cropped by what the best links of their pairs say together; whether any is.
pub fn crop(sketches: &mut [Sketch], links: &[Link], wanted: Frames) -> bool {
    let mut said: Vec<(f64, f64)> = vec![(0.0, 0.0); sketches.len()];
    for link in best_of_pairs(links) {
        for (picture, votes) in [(link.i, &link.evidence.j_in_i), (link.j, &link.evidence.i_in_j)] {
            said[picture].0 += votes.missed;
            said[picture].1 += votes.agree;
        }
    }
    let is_cropped = |view: &usize| said[*view].0 > MISSED * (said[*view].0 + said[*view].1);
    let cropped: Vec<usize> = (0..sketches.len()).filter(is_cropped).collect();
    let is_share = |share: f64| cropped.len() as f64 >= share * sketches.len() as f64;
    if cropped.is_empty() || !is_share(if wanted == Frames::All { ALL_FRAMES } else { FRAMES }) {
        return false;
    }
    if wanted == Frames::All {
        sketches.iter_mut().for_each(|sketch| sketch.sight.crop());
    } else {
        cropped.into_iter().for_each(|view| sketches[view].sight.crop());
    }
    true
}

/// For each pair the link that most agrees, if that is coherent.
fn best_of_pairs(links: &[Link]) -> Vec<&Link> {
    let mut best: std::collections::BTreeMap<(usize, usize), &Link> = std::collections::BTreeMap::new();
    for link in links.iter().filter(|link| is_coherent(link)) {
        let known = best.entry((link.i, link.j)).or_insert(link);
        if balance(link) > balance(known) {
            *known = link;
        }
    }
    best.into_values().collect()
}

fn inside(link: &Link) -> (f64, f64) {
    let votes: SurfelVotes = link.evidence.both();
    (votes.agree, votes.contradict + votes.looked_through)
}

fn balance(link: &Link) -> f64 {
    let (agree, against) = inside(link);
    agree - against
}

fn is_coherent(link: &Link) -> bool {
    let (agree, against) = inside(link);
    agree >= LEAST_AGREE && agree >= COHERENT * (agree + against)
}
