//! From matches, most of them wrong, to a few motions that many of them agree on.
//!
//! Two matches are compatible if a rigid motion can make both: distance and angles between their oriented points are
//! the same in both views. Right matches are compatible with each other, wrong ones rarely; two matches belong together
//! the more, the more matches are compatible with both (second-order compatibility; Chen, Sun, Yang, Tao, "SC2-PCR",
//! CVPR 2022).

use super::coarse_view::CoarseView;
use super::matching::Match;
use crate::pairwise::rigid_fit::RigidFit;
use visage_geometry::Motion;

/// A motion and the matches it explains.
#[derive(Debug, Clone, PartialEq)]
pub struct Proposal {
    /// Maps view j's local frame into view i's.
    pub i_from_j: Motion,
    /// Matches that it explains.
    pub support: usize,
}

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Distances between compatible matches may differ by this many edges.
        distance_tolerance: f32 = 1.0,
        /// Matches nearer to each other than this (in edges) say little of each other.
        least_distance: f32 = 4.0,
        /// Cosine's tolerance of compatible angles.
        angle_tolerance: f32 = 0.25,
        /// Two places lie on one plane if the cosine of their normals is more than this (18 degrees)
        parallel: f32 = 0.95,
        /// and the sine of the line between them against the plane less than this (12 degrees).
        level: f32 = 0.2,
        /// Matches that a motion is first fitted to.
        first_fit: usize = 24,
        /// Seeds tried.
        seeds: usize = 40,
        /// A match is explained if its points meet within this many edges,
        explained: f32 = 1.5,
        /// and its normals within this cosine.
        explained_cosine: f32 = 0.8,
    }
}

/// The oriented points of a match.
struct Oriented {
    p: nalgebra::Vector3<f32>,
    n: nalgebra::Vector3<f32>,
    q: nalgebra::Vector3<f32>,
    m: nalgebra::Vector3<f32>,
}

/// A symmetric relation of matches, one row of bits each.
struct Relation {
    words: usize,
    bits: Vec<u64>,
}

impl Relation {
    fn row(&self, k: usize) -> &[u64] {
        &self.bits[k * self.words..(k + 1) * self.words]
    }

    fn common(&self, k: usize, l: usize) -> u32 {
        self.row(k).iter().zip(self.row(l)).map(|(a, b)| (a & b).count_ones()).sum()
    }

    fn members(&self, k: usize) -> impl Iterator<Item = usize> {
        self.row(k).iter().enumerate().flat_map(|(word, bits)| {
            let mut rest = *bits;
            std::iter::from_fn(move || {
                (rest != 0).then(|| {
                    let bit = rest.trailing_zeros() as usize;
                    rest &= rest - 1;
                    word * 64 + bit
                })
            })
        })
    }
}

/// Which matches may support each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Support {
    /// All that a rigid motion can make both.
    Any,
    /// Of these, those whose places don't lie on one plane: any two places of a plane fit any two as far apart, so they
    /// say next to nothing of each other. Where ground or walls are most of a view, they are most of the matches.
    AcrossPlanes,
}

/// The `count` motions that explain most matches, no two of them alike; the best first.
pub fn proposals(
    i: &CoarseView,
    j: &CoarseView,
    matches: &[Match],
    support: Support,
    edge: f64,
    count: usize,
) -> Vec<Proposal> {
    let oriented: Vec<Oriented> = matches
        .iter()
        .map(|m| {
            let (a, b) = (m.of_i as usize, m.of_j as usize);
            Oriented { p: i.position(a), n: i.normals[a], q: j.position(b), m: j.normals[b] }
        })
        .collect();
    let relation = compatibility(&oriented, support, edge as f32);
    let mut kept: Vec<Proposal> = Vec::new();
    let mut used = vec![false; oriented.len()];
    for seed in seeds(&relation, oriented.len()) {
        if used[seed] {
            continue;
        }
        let mut ranked: Vec<(u32, usize)> = relation.members(seed).map(|k| (relation.common(seed, k), k)).collect();
        ranked.sort_by(|a, b| b.0.cmp(&a.0).then(a.1.cmp(&b.1)));
        let first: Vec<usize> =
            std::iter::once(seed).chain(ranked.iter().take(TUNING.first_fit).map(|(_, k)| *k)).collect();
        let Some(mut motion) = fit(&oriented, &first, edge) else { continue };
        let mut inliers = explained(&oriented, &motion, edge as f32);
        for _ in 0..2 {
            let Some(refitted) = fit(&oriented, &inliers, edge) else { break };
            motion = refitted;
            inliers = explained(&oriented, &motion, edge as f32);
        }
        inliers.iter().for_each(|k| used[*k] = true);
        let proposal = Proposal { i_from_j: motion, support: inliers.len() };
        match kept.iter_mut().find(|other| alike(&other.i_from_j, &motion, j.radius, 4.0 * edge)) {
            Some(other) if other.support < proposal.support => *other = proposal,
            Some(_) => {}
            None => kept.push(proposal),
        }
    }
    kept.retain(|proposal| proposal.support >= 3);
    kept.sort_by_key(|proposal| std::cmp::Reverse(proposal.support));
    kept.truncate(count);
    kept
}

/// Whether two motions move the points of a view of this radius to the same places, to within `tolerance`.
pub fn alike(a: &Motion, b: &Motion, radius: f64, tolerance: f64) -> bool {
    let difference = a.inv_mul(b);
    difference.translation.vector.norm() + difference.rotation.angle() * radius * 0.7 < tolerance
}

fn compatibility(oriented: &[Oriented], support: Support, edge: f32) -> Relation {
    let words = oriented.len().div_ceil(64);
    let mut relation = Relation { words, bits: vec![0; words * oriented.len()] };
    for k in 0..oriented.len() {
        for l in k + 1..oriented.len() {
            let (a, b) = (&oriented[k], &oriented[l]);
            if compatible(a, b, edge) && (support == Support::Any || !is_on_one_plane(a, b)) {
                relation.bits[k * words + l / 64] |= 1 << (l % 64);
                relation.bits[l * words + k / 64] |= 1 << (k % 64);
            }
        }
    }
    relation
}

#[inline]
fn compatible(a: &Oriented, b: &Oriented, edge: f32) -> bool {
    let (d, e) = (b.p - a.p, b.q - a.q);
    let (length, other) = (d.norm(), e.norm());
    if (length - other).abs() > TUNING.distance_tolerance * edge || length.min(other) < TUNING.least_distance * edge {
        return false;
    }
    (a.n.dot(&b.n) - a.m.dot(&b.m)).abs() < TUNING.angle_tolerance
        && (a.n.dot(&d) / length - a.m.dot(&e) / other).abs() < TUNING.angle_tolerance
        && (b.n.dot(&d) / length - b.m.dot(&e) / other).abs() < TUNING.angle_tolerance
}

/// Whether both places of view i lie on one plane.
#[inline]
fn is_on_one_plane(a: &Oriented, b: &Oriented) -> bool {
    let d = b.p - a.p;
    a.n.dot(&b.n) > TUNING.parallel && a.n.dot(&d).abs() < TUNING.level * d.norm()
}

/// The matches that belong together with most others, the best first.
fn seeds(relation: &Relation, count: usize) -> Vec<usize> {
    let mut ranked: Vec<(u64, usize)> = (0..count)
        .map(|k| (relation.members(k).map(|l| u64::from(relation.common(k, l))).sum::<u64>(), k))
        .filter(|(score, _)| *score > 0)
        .collect();
    ranked.sort_by(|a, b| b.0.cmp(&a.0).then(a.1.cmp(&b.1)));
    // seeds are spread over the ranking: the first explained set uses up most of its head
    ranked.into_iter().map(|(_, k)| k).take(4 * TUNING.seeds).collect()
}

/// The motion that brings the q onto the p and their normals onto each other.
fn fit(oriented: &[Oriented], chosen: &[usize], edge: f64) -> Option<Motion> {
    if chosen.len() < 3 {
        return None;
    }
    // a normal counts as a point on its tip, so that few matches fix the turn about the line they lie on
    let lever = (3.0 * edge) as f32;
    let mut fit = RigidFit::default();
    for k in chosen {
        let o = &oriented[*k];
        fit.add(&o.q.into(), &o.p.into());
        fit.add(&(o.q + o.m * lever).into(), &(o.p + o.n * lever).into());
    }
    fit.solve()
}

fn explained(oriented: &[Oriented], motion: &Motion, edge: f32) -> Vec<usize> {
    let motion = motion.cast::<f32>();
    let (rotation, shift) = (motion.rotation.to_rotation_matrix(), motion.translation.vector);
    let limit2 = (TUNING.explained * edge).powi(2);
    let is_explained = |o: &Oriented| {
        (rotation * o.q + shift - o.p).norm_squared() < limit2 && (rotation * o.m).dot(&o.n) > TUNING.explained_cosine
    };
    (0..oriented.len()).filter(|k| is_explained(&oriented[*k])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_of_one_plane_may_be_asked_not_to_support_each_other() {
        let place = |x: f32, z: f32, n: [f32; 3]| {
            let (p, n) = (nalgebra::Vector3::new(x, 0.0, z), nalgebra::Vector3::from(n));
            Oriented { p, n, q: p, m: n }
        };
        let (up, ahead) = ([0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]);
        let floor = place(0.0, 0.0, up);
        // more floor, a wall, a step, and a slope
        let others =
            [place(9.0, 0.2, up), place(9.0, 2.0, ahead), place(9.0, 3.0, up), place(9.0, 0.0, [0.6, 0.0, 0.8])];
        let oriented: Vec<Oriented> = std::iter::once(floor).chain(others).collect();
        let supporting = |support: Support| compatibility(&oriented, support, 1.0).members(0).collect::<Vec<usize>>();
        assert_eq!(supporting(Support::Any), [1, 2, 3, 4]);
        assert_eq!(supporting(Support::AcrossPlanes), [2, 3, 4]);
    }
}
