//! A balanced kd-tree with leaves of sixteen points, stored so that a leaf is compared without branches.

use super::collect::{Any, Collect, KNearest, Nearest, NearestTwo, Neighbour, Within};
use super::{LocalPoint, distance2};

/// Points in a leaf: four SSE registers a coordinate; eight were slower far from the surface.
const LEAF: usize = 16;

/// An inner node: the axis and the coordinate at which it divides its points.
#[derive(Debug, Clone, Copy)]
struct Split {
    axis: u32,
    value: f32,
}

/// A point on its way into a leaf: building moves the positions themselves, so that it reads memory in order.
#[derive(Clone, Copy)]
struct Entry {
    position: LocalPoint,
    index: u32,
}

/// A part of the tree that is still to be visited.
#[derive(Clone, Copy)]
struct Cell {
    node: usize,
    /// A squared distance that all of the part has from the query, at least.
    distance2: f32,
}

/// Fewer than 2^32 points make fewer than 30 levels; one cell waits on each.
const MAX_DEPTH: usize = 32;

/// Up to [`LEAF`] points, coordinate by coordinate; unused places lie at infinity.
#[derive(Debug, Clone)]
struct Leaf {
    coordinates: [[f32; LEAF]; 3],
    indices: [u32; LEAF],
}

/// An immutable kd-tree over finite f32 points. Equal points, planes and single points are all fine.
///
/// The tree is complete: inner node `k` (from 1) has the children `2k` and `2k + 1`, leaves follow the inner nodes.
#[derive(Debug, Clone)]
pub struct KdTree {
    splits: Vec<Split>,
    leaves: Vec<Leaf>,
    len: usize,
}

impl KdTree {
    /// Builds the tree in O(n log n). The points must be finite and fewer than 2^32.
    #[inline]
    pub fn new(points: &[LocalPoint]) -> Self {
        let mut entries: Vec<Entry> =
            (0u32..).zip(points).map(|(index, &position)| Entry { position, index }).collect();
        let leaf_count = points.len().div_ceil(LEAF).next_power_of_two();
        let mut tree = KdTree {
            splits: vec![Split { axis: 0, value: 0.0 }; leaf_count],
            leaves: Vec::with_capacity(leaf_count),
            len: points.len(),
        };
        tree.divide(1, &mut entries);
        tree
    }

    /// Leaves out the points whose `places` are [`KdTree::GONE`]; the others go by the indices there, below `len`. The
    /// tree stays as deep as it is, so this is for a few points.
    #[inline]
    pub fn renumber(&mut self, places: &[u32], len: usize) {
        self.leaves.iter_mut().for_each(|leaf| leaf.renumber(places));
        self.len = len;
    }

    /// The place of a point that goes.
    pub const GONE: u32 = u32::MAX;

    /// The number of points.
    #[inline]
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there are no points.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    fn divide(&mut self, node: usize, entries: &mut [Entry]) {
        if node >= self.splits.len() {
            self.leaves.push(Leaf::of(entries));
            return;
        }
        let axis = widest_axis(entries);
        let middle = entries.len() / 2;
        let mut value = 0.0;
        if middle < entries.len() {
            let (_, median, _) =
                entries.select_nth_unstable_by(middle, |a, b| a.position[axis].total_cmp(&b.position[axis]));
            value = median.position[axis];
        }
        self.splits[node] = Split { axis: axis as u32, value };
        let (left, right) = entries.split_at_mut(middle);
        self.divide(2 * node, left);
        self.divide(2 * node + 1, right);
    }

    /// The nearest point at a squared distance below `max_distance2`; `None` if there is none.
    #[inline]
    pub fn nearest(&self, query: &LocalPoint, max_distance2: f32) -> Option<Neighbour> {
        let mut nearest = Nearest { best: Neighbour { index: u32::MAX, distance2: max_distance2 } };
        self.search(query, &mut nearest);
        (nearest.best.index != u32::MAX).then_some(nearest.best)
    }

    /// Whether there is a point at a squared distance below `radius2`.
    #[inline]
    pub fn has_within(&self, query: &LocalPoint, radius2: f32) -> bool {
        let mut any = Any { radius2, found: false };
        self.search(query, &mut any);
        any.found
    }

    /// Like [`KdTree::nearest`], but starts from a point that is thought to be near (the last answer to almost the
    /// same query): the better the guess, the less is searched. `guess` is a point of the tree and its squared
    /// distance from the query; the answer is never farther away.
    #[inline]
    pub fn nearest_from(&self, query: &LocalPoint, guess: Neighbour, max_distance2: f32) -> Option<Neighbour> {
        if guess.distance2 >= max_distance2 {
            return self.nearest(query, max_distance2);
        }
        let mut nearest = Nearest { best: guess };
        self.search(query, &mut nearest);
        Some(nearest.best)
    }

    /// The nearest point below `max_distance2`, and the squared distance of the second nearest (`max_distance2` if
    /// there is none below it). `guess` is a point of the tree with its squared distance.
    #[inline]
    pub fn nearest_two(
        &self,
        query: &LocalPoint,
        guess: Option<Neighbour>,
        max_distance2: f32,
    ) -> (Option<Neighbour>, f32) {
        let nobody = Neighbour { index: u32::MAX, distance2: max_distance2 };
        let best = guess.filter(|guess| guess.distance2 < max_distance2).unwrap_or(nobody);
        let mut two = NearestTwo { best, rival_distance2: max_distance2 };
        self.search(query, &mut two);
        ((two.best.index != u32::MAX).then_some(two.best), two.rival_distance2)
    }

    /// The `k` nearest points at squared distances below `max_distance2`, nearest first, into `found`.
    pub fn k_nearest(&self, query: &LocalPoint, k: usize, max_distance2: f32, found: &mut Vec<Neighbour>) {
        found.clear();
        if k > 0 {
            self.search(query, &mut KNearest { k, max_distance2, found });
        }
    }

    /// The `k` nearest points, in no order, into `found`: cheaper than [`KdTree::k_nearest`] with a good guess
    /// `guess2` of the squared distance within which they lie. `found` may serve as scratch; the answer is the same for
    /// every guess but for its order.
    pub fn k_nearest_unordered(&self, query: &LocalPoint, k: usize, guess2: f32, found: &mut Vec<Neighbour>) {
        found.clear();
        self.search(query, &mut Within { radius2: guess2, visit: |neighbour| found.push(neighbour) });
        if found.len() < k {
            self.k_nearest(query, k, f32::INFINITY, found);
        } else if k > 0 {
            found.select_nth_unstable_by(k - 1, |a, b| a.distance2.total_cmp(&b.distance2));
            found.truncate(k);
        }
    }

    /// Calls `visit` for each point at a squared distance below `radius2`, in the order of the tree.
    pub fn for_each_within(&self, query: &LocalPoint, radius2: f32, visit: impl FnMut(Neighbour)) {
        self.search(query, &mut Within { radius2, visit });
    }

    /// Visits the leaves near the query, the most promising first, as long as they may hold a point within the
    /// collector's bound. A loop with its own stack: this is the hottest code of registration.
    #[inline]
    fn search(&self, query: &LocalPoint, collect: &mut impl Collect) {
        let inner_end = self.splits.len();
        let mut postponed = [Cell { node: 1, distance2: 0.0 }; MAX_DEPTH];
        let mut waiting = 1;
        while waiting > 0 {
            waiting -= 1;
            let Cell { mut node, distance2: cell2 } = postponed[waiting];
            if cell2 >= collect.bound() {
                continue;
            }
            while node < inner_end {
                let Split { axis, value } = self.splits[node];
                let difference = query[axis as usize] - value;
                let right_first = usize::from(difference >= 0.0);
                // the axes' distances are not summed: keeping them apart costs more than the leaves it would spare
                let beyond2 = cell2.max(difference * difference);
                if beyond2 < collect.bound() {
                    postponed[waiting] = Cell { node: 2 * node + 1 - right_first, distance2: beyond2 };
                    waiting += 1;
                }
                node = 2 * node + right_first;
            }
            self.leaves[node - inner_end].scan(query, collect);
        }
    }
}

impl Leaf {
    fn of(entries: &[Entry]) -> Self {
        let mut leaf = Leaf { coordinates: [[f32::INFINITY; LEAF]; 3], indices: [u32::MAX; LEAF] };
        for (place, entry) in entries.iter().enumerate() {
            leaf.indices[place] = entry.index;
            for (along, coordinate) in leaf.coordinates.iter_mut().zip(entry.position) {
                along[place] = coordinate;
            }
        }
        leaf
    }

    fn renumber(&mut self, places: &[u32]) {
        for slot in 0..LEAF {
            let Some(place) = places.get(self.indices[slot] as usize) else { continue };
            self.indices[slot] = *place;
            if *place == KdTree::GONE {
                self.coordinates.iter_mut().for_each(|along| along[slot] = f32::INFINITY);
            }
        }
    }

    #[inline]
    fn scan(&self, query: &LocalPoint, collect: &mut impl Collect) {
        let [xs, ys, zs] = &self.coordinates;
        let mut distances2 = [0.0f32; LEAF];
        // two loops: the first has no branches, so the compiler turns it into vector code
        for (place, slot) in distances2.iter_mut().enumerate() {
            *slot = distance2(query, &[xs[place], ys[place], zs[place]]);
        }
        for (distance2, index) in distances2.into_iter().zip(self.indices) {
            if distance2 < collect.bound() {
                collect.offer(Neighbour { index, distance2 });
            }
        }
    }
}

fn widest_axis(entries: &[Entry]) -> usize {
    let mut min = [f32::INFINITY; 3];
    let mut max = [f32::NEG_INFINITY; 3];
    for Entry { position, .. } in entries {
        for axis in 0..3 {
            min[axis] = min[axis].min(position[axis]);
            max[axis] = max[axis].max(position[axis]);
        }
    }
    (0..3).max_by(|&a, &b| (max[a] - min[a]).total_cmp(&(max[b] - min[b]))).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    /// Clouds of the kinds that break trees: random, on a grid, flat, all equal, few.
    fn clouds() -> Vec<Vec<LocalPoint>> {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(7);
        let mut random = |n: usize, flat: f32| -> Vec<LocalPoint> {
            (0..n).map(|_| [rng.random::<f32>(), rng.random::<f32>(), rng.random::<f32>() * flat]).collect()
        };
        let mut clouds = vec![random(3000, 1.0), random(500, 0.0), random(5, 1.0), random(1, 1.0), random(129, 1.0)];
        clouds.push((0..1600).map(|i| [(i % 40) as f32, (i / 40) as f32, 0.0]).collect());
        clouds.push(vec![[0.25; 3]; 700]);
        clouds
    }

    fn queries(cloud: &[LocalPoint]) -> Vec<LocalPoint> {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(11);
        (0..200)
            .map(|_| {
                let base = cloud[rng.random_range(0..cloud.len())];
                base.map(|x| x + (rng.random::<f32>() - 0.5) * 0.3)
            })
            .collect()
    }

    fn brute(cloud: &[LocalPoint], query: &LocalPoint) -> Vec<f32> {
        let mut all: Vec<f32> = cloud.iter().map(|p| distance2(query, p)).collect();
        all.sort_by(f32::total_cmp);
        all
    }

    #[test]
    fn agrees_with_brute_force_and_kiddo() {
        for cloud in clouds() {
            let tree = KdTree::new(&cloud);
            let reference: kiddo::ImmutableKdTree<f32, 3> =
                kiddo::ImmutableKdTree::new_from_slice(&cloud).expect("the immutable tree takes any finite points");
            for query in queries(&cloud) {
                let expected = brute(&cloud, &query);
                let found = tree.nearest(&query, f32::INFINITY).expect("an unbounded search finds a point");
                assert_eq!(found.distance2, expected[0]);
                assert_eq!(distance2(&query, &cloud[found.index as usize]), found.distance2);
                let theirs: f32 =
                    reference.query(&query).nearest_one::<kiddo::dist::SquaredEuclidean<f32>>().execute().distance;
                assert!((theirs - found.distance2).abs() <= 1e-6 * found.distance2.max(1e-6));
            }
        }
    }

    #[test]
    fn the_bound_is_exclusive_and_kept() {
        for cloud in clouds() {
            let tree = KdTree::new(&cloud);
            for query in queries(&cloud) {
                let nearest2 = brute(&cloud, &query)[0];
                assert!(tree.nearest(&query, nearest2).is_none());
                let found = tree.nearest(&query, nearest2 * 1.001 + f32::MIN_POSITIVE);
                assert_eq!(found.map(|n| n.distance2), Some(nearest2));
            }
        }
    }

    #[test]
    fn k_nearest_and_radius_agree_with_brute_force() {
        let mut found = Vec::new();
        for cloud in clouds() {
            let tree = KdTree::new(&cloud);
            for query in queries(&cloud) {
                let expected = brute(&cloud, &query);
                tree.k_nearest(&query, 12, f32::INFINITY, &mut found);
                let distances2: Vec<f32> = found.iter().map(|n| n.distance2).collect();
                assert_eq!(distances2, expected[..cloud.len().min(12)]);
                for guess2 in [0.0, 0.01, 0.3] {
                    tree.k_nearest_unordered(&query, 12, guess2, &mut found);
                    let mut distances2: Vec<f32> = found.iter().map(|n| n.distance2).collect();
                    distances2.sort_by(f32::total_cmp);
                    assert_eq!(distances2, expected[..cloud.len().min(12)]);
                }
                let mut inside = 0;
                tree.for_each_within(&query, 0.05, |_| inside += 1);
                assert_eq!(inside, expected.iter().filter(|d| **d < 0.05).count());
                assert_eq!(tree.has_within(&query, 0.0025), expected[0] < 0.0025);
            }
        }
    }

    #[test]
    fn without_some_points_it_answers_like_a_new_tree() {
        for cloud in clouds() {
            let stays = |index: usize| index % 5 != 2;
            let rest: Vec<LocalPoint> = (0..cloud.len()).filter(|k| stays(*k)).map(|k| cloud[k]).collect();
            let mut next = 0..;
            let places: Vec<u32> = (0..cloud.len())
                .map(|k| if stays(k) { next.next().unwrap_or(KdTree::GONE) } else { KdTree::GONE })
                .collect();
            let mut tree = KdTree::new(&cloud);
            tree.renumber(&places, rest.len());
            assert_eq!(tree.len(), rest.len());
            for query in queries(&cloud) {
                let found = tree.nearest(&query, f32::INFINITY).expect("one is left");
                assert_eq!(found.distance2, brute(&rest, &query)[0]);
                assert_eq!(distance2(&query, &rest[found.index as usize]), found.distance2);
            }
        }
    }

    #[test]
    fn an_empty_tree_finds_nothing() {
        let tree = KdTree::new(&[]);
        assert!(tree.is_empty());
        assert_eq!(tree.nearest(&[0.0; 3], f32::INFINITY), None);
    }
}
