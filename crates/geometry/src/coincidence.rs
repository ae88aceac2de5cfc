//! Points that are no points of their own: places that stand for "no return", and repetitions of other points.
//!
//! A scanner that saw nothing may write 0 0 0, -9999 or its own place; a mesh of loose triangles names each corner once
//! a triangle; an export may write everything several times, perhaps rounded differently. All of these would otherwise
//! pass for surface, or for a very fine one.

use super::neighbours::{IndexedPoints, LocalPoint};
use super::{Point3, Surface};

/// A place is no return from so many points on,
const LEAST_RETURNS: u32 = 8;
/// if it holds so many times the points of the most crowded place of the surface: a corner of loose triangles holds
/// some six, seldom twice that.
const CROWDED: u32 = 8;
/// Values that stand for no return in one file, at most.
const MOST_VALUES: usize = 8;

/// Points that are asked whether they have near copies.
const SAMPLES: usize = 120;
/// Their nearest neighbours that are looked at: more than there are copies of a point.
const NEIGHBOURS: usize = 33;
/// Copies of a point are so many times nearer to each other than to the next: on a surface, even one that was sampled
/// at random, hardly any neighbour is so much farther off than the one before.
const JUMP: f32 = 5.0;
/// From this share of the samples on copies are the rule. At random, one sample in 25 looks as if it had one.
const COPIED: f64 = 0.25;

/// Which points of a surface are kept, and why the others are not.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Coincidence {
    /// Points where nothing was seen.
    pub no_return: usize,
    /// Points that repeat another one.
    pub repeated: usize,
    /// For each point whether it is kept; empty if all are.
    pub kept: Vec<bool>,
}

impl Coincidence {
    /// Looks for points at exactly the same place, and at the scanner's own.
    pub fn of(surface: &Surface) -> Self {
        let points = &surface.cloud.points;
        let groups = Repeated::new(points);
        let is_no_return = groups.no_returns(points);
        let mut found = Coincidence::default();
        let is_at_sensor = |p: &Point3| surface.sensor == Some(*p);
        if groups.is_empty() && !points.iter().any(is_at_sensor) {
            return found;
        }
        found.kept = vec![true; points.len()];
        for (kept, _) in found.kept.iter_mut().zip(points).filter(|(_, p)| is_at_sensor(p)) {
            *kept = false;
            found.no_return += 1;
        }
        for (group, is_no_return) in groups.groups().zip(is_no_return) {
            if is_at_sensor(&points[group[0] as usize]) {
                continue;
            }
            let gone = if is_no_return { group } else { &group[1..] };
            gone.iter().for_each(|&index| found.kept[index as usize] = false);
            *(if is_no_return { &mut found.no_return } else { &mut found.repeated }) += gone.len();
        }
        found
    }

    /// The surface of the points that are kept.
    #[inline]
    pub fn applied(&self, surface: Surface) -> Surface {
        if self.kept.is_empty() { surface } else { surface.kept(&self.kept) }
    }

    /// How many are not kept.
    #[inline]
    pub fn left_out(&self) -> usize {
        self.no_return + self.repeated
    }
}

/// For each point the first one at exactly its place; `None` if all places differ.
#[inline]
pub fn first_copies(points: &[Point3]) -> Option<Vec<u32>> {
    let groups = Repeated::new(points);
    let mut firsts: Vec<u32> = (0..points.len() as u32).collect();
    for group in groups.groups() {
        group.iter().for_each(|&index| firsts[index as usize] = group[0]);
    }
    (!groups.is_empty()).then_some(firsts)
}

/// Points that lie at exactly one place with others.
struct Repeated {
    /// Their indices, place by place, ascending within a place.
    indices: Vec<u32>,
    /// Where each place begins in `indices`, and the end.
    starts: Vec<usize>,
}

/// The bits of a place; both zeros are one.
fn bits(point: &Point3) -> [u64; 3] {
    [point.x, point.y, point.z].map(|x| (x + 0.0).to_bits())
}

impl Repeated {
    fn new(points: &[Point3]) -> Self {
        // a filter first: most points are alone, and sorting all of them would cost more than what follows
        let mask = (8 * points.len()).next_power_of_two() as u64 - 1;
        let slot = |point: &Point3| {
            let mixed = bits(point).into_iter().fold(0u64, |hash, x| {
                let mixed = (hash ^ x).wrapping_mul(0x9e37_79b9_7f4a_7c15);
                mixed ^ (mixed >> 32)
            });
            let slot = mixed & mask;
            ((slot / 64) as usize, 1u64 << (slot % 64))
        };
        let words = mask as usize / 64 + 1;
        let (mut once, mut again) = (vec![0u64; words], vec![0u64; words]);
        for point in points {
            let (word, bit) = slot(point);
            again[word] |= once[word] & bit;
            once[word] |= bit;
        }
        let is_suspect = |point: &Point3| {
            let (word, bit) = slot(point);
            again[word] & bit != 0
        };
        let mut suspects: Vec<u32> =
            (0u32..).zip(points).filter(|(_, point)| is_suspect(point)).map(|(index, _)| index).collect();
        suspects.sort_unstable_by_key(|&index| (bits(&points[index as usize]), index));
        let mut repeated = Repeated { indices: Vec::new(), starts: vec![0] };
        for group in suspects.chunk_by(|&a, &b| bits(&points[a as usize]) == bits(&points[b as usize])) {
            if group.len() > 1 {
                repeated.indices.extend_from_slice(group);
                repeated.starts.push(repeated.indices.len());
            }
        }
        repeated
    }

    fn is_empty(&self) -> bool {
        self.indices.is_empty()
    }

    fn groups(&self) -> impl Iterator<Item = &[u32]> {
        self.starts.windows(2).map(|ends| &self.indices[ends[0]..ends[1]])
    }

    /// For each place whether it stands for no return: the few that are far more crowded than any other.
    fn no_returns(&self, points: &[Point3]) -> Vec<bool> {
        let mut counts: Vec<u32> = self.groups().map(|group| group.len() as u32).collect();
        let original = counts.clone();
        counts.sort_unstable_by_key(|count| std::cmp::Reverse(*count));
        // every other point is alone at its place
        counts.truncate(MOST_VALUES + 1);
        let others = (points.len() > self.indices.len()) as u32;
        let next = |k: usize| counts.get(k + 1).copied().unwrap_or(others);
        let is_far_above = |k: &usize| counts[*k] >= LEAST_RETURNS && next(*k) > 0 && counts[*k] / CROWDED >= next(*k);
        let last = (0..counts.len().min(MOST_VALUES)).rfind(is_far_above);
        let least = last.map_or(u32::MAX, |k| counts[k]);
        original.into_iter().map(|count| count >= least).collect()
    }
}

/// The distance within which points are copies of each other although they don't coincide, if such copies are the rule.
pub fn copy_distance(indexed: &IndexedPoints) -> Option<f32> {
    let count = SAMPLES.min(indexed.points.len());
    let (mut found, mut within, mut beyond) = (Vec::new(), Vec::new(), Vec::new());
    for sample in (0..count).map(|k| indexed.points[k * indexed.points.len() / count]) {
        indexed.tree.k_nearest(&sample, NEIGHBOURS, f32::INFINITY, &mut found);
        let distances: Vec<f32> = found.iter().map(|n| n.distance2.sqrt()).filter(|d| *d > 0.0).collect();
        let jump = distances.windows(2).max_by(|a, b| (a[1] / a[0]).total_cmp(&(b[1] / b[0])));
        if let Some(jump) = jump.filter(|jump| jump[1] > JUMP * jump[0]) {
            within.push(jump[0]);
            beyond.push(jump[1]);
        }
    }
    if within.is_empty() || (within.len() as f64) < COPIED * count as f64 {
        return None;
    }
    let middle = |values: &mut Vec<f32>| {
        let middle = values.len() / 2;
        *values.select_nth_unstable_by(middle, f32::total_cmp).1
    };
    let (within, beyond) = (middle(&mut within), middle(&mut beyond));
    (beyond > within).then(|| (within * beyond).sqrt())
}

/// Keeps the first of all points within `distance` of each other; says for each point whether it is kept.
#[inline]
pub fn without_copies(indexed: &IndexedPoints, distance: f32) -> Vec<bool> {
    let mut kept = vec![true; indexed.points.len()];
    for index in 0..indexed.points.len() {
        if kept[index] {
            let point: &LocalPoint = &indexed.points[index];
            indexed.tree.for_each_within(point, distance * distance, |near| {
                if near.index as usize > index {
                    kept[near.index as usize] = false;
                }
            });
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Cloud;

    fn sheet() -> Vec<Point3> {
        (0..900).map(|k| Point3::new(f64::from(k % 30), f64::from(k / 30), 0.3 * f64::from(k % 7))).collect()
    }

    fn found(points: Vec<Point3>, sensor: Option<Point3>) -> (usize, usize, usize) {
        let surface = Surface { cloud: Cloud::from_points(points), sensor, ..Surface::default() };
        let found = Coincidence::of(&surface);
        let left = found.applied(surface).cloud.len();
        assert!(left <= 901);
        (found.no_return, found.repeated, left)
    }

    fn with(others: &[(Point3, usize)]) -> Vec<Point3> {
        let others = others.iter().flat_map(|(place, count)| std::iter::repeat_n(*place, *count));
        sheet().into_iter().chain(others).collect()
    }

    #[test]
    fn what_is_no_return_and_what_repeats() {
        let far = Point3::new(0.0, 0.0, -9999.0);
        let minus_one = Point3::new(-1.0, -1.0, -1.0);
        let six = || sheet().into_iter().flat_map(|p| [p; 6]);
        let cases = [
            ("a sound sheet", sheet(), (0, 0, 900)),
            ("one far point is a stray", with(&[(far, 1)]), (0, 0, 901)),
            ("a few of them are one", with(&[(far, 7)]), (0, 6, 901)),
            ("from eight on they are none", with(&[(far, 8)]), (8, 0, 900)),
            ("most of a scan", with(&[(far, 50_000)]), (50_000, 0, 900)),
            ("two values", with(&[(far, 5000), (minus_one, 60)]), (5060, 0, 900)),
            ("both zeros", with(&[(Point3::new(0.0, 0.0, -0.5), 4), (Point3::new(-0.0, 0.0, -0.5), 4)]), (8, 0, 900)),
            ("each point six times", six().collect(), (0, 4500, 900)),
            ("and no returns", six().chain([far; 60]).collect(), (60, 4500, 900)),
            ("but not if they may be a crowded corner", six().chain([far; 40]).collect(), (0, 4539, 901)),
            ("all in one place", vec![far; 700], (0, 699, 1)),
            ("nothing", Vec::new(), (0, 0, 0)),
        ];
        for (what, points, expected) in cases {
            assert_eq!(found(points, None), expected, "{what}");
        }
        assert_eq!(found(with(&[(minus_one, 1)]), Some(minus_one)), (1, 0, 900), "the scanner's own place");
    }

    #[test]
    fn a_cloud_spread_at_random_has_no_copies_and_one_of_clumps_has() {
        let random = |k: u32| f32::from((k.wrapping_mul(2_654_435_761) >> 16) as u16) / 65536.0;
        let spread = |k: u32| [random(3 * k), random(3 * k + 1), 0.0];
        let points: Vec<LocalPoint> = (0..4000).map(spread).collect();
        assert_eq!(copy_distance(&IndexedPoints::new(points)), None);
        let lines: Vec<LocalPoint> = (0..4000).map(|k| [(k % 400) as f32 * 0.05, (k / 400) as f32, 0.0]).collect();
        assert_eq!(copy_distance(&IndexedPoints::new(lines)), None, "points side by side along the lines of a scanner");
        let clump = |k: u32| [0, 1, 2].map(|axis| spread(k / 5)[axis] + 1e-5 * random(7 * k + axis as u32));
        let indexed = IndexedPoints::new((0..4000).map(clump).collect());
        let distance = copy_distance(&indexed).expect("every point comes five times");
        let kept = without_copies(&indexed, distance).into_iter().filter(|kept| *kept).count();
        assert!((760..=800).contains(&kept), "{kept} of 800 places");
        assert_eq!(copy_distance(&IndexedPoints::new(Vec::new())), None);
    }
}
