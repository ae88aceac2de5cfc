//! Nearest neighbours: a bucket kd-tree over f32 points, built once a scan and level.
//!
//! Registration asks millions of times for the one nearest point within a distance, mostly with a good guess at
//! hand. No crate offers that bounded search without allocating, and the bound matters more than the tree
//! (docs/ARCHITECTURE.md), so the tree is our own; tests hold it against kiddo and brute force.

mod collect;
mod kdtree;
mod pursuit;

pub use collect::Neighbour;
pub use kdtree::KdTree;
pub use pursuit::Pursuit;

/// A position relative to its cloud's own center: f32 is exact enough there and halves the memory traffic.
pub type LocalPoint = [f32; 3];

/// The squared distance of two points.
#[inline]
pub fn distance2(a: &LocalPoint, b: &LocalPoint) -> f32 {
    let d = [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
}

/// Points with the tree over them.
#[derive(Debug, Clone)]
pub struct IndexedPoints {
    /// The points, in the order in which answers count them.
    pub points: Vec<LocalPoint>,
    /// The tree over `points`.
    pub tree: KdTree,
}

impl IndexedPoints {
    /// Indexes finite points.
    #[inline]
    pub fn new(points: Vec<LocalPoint>) -> Self {
        let tree = KdTree::new(&points);
        IndexedPoints { points, tree }
    }

    /// Leaves out the points for which `kept` does not hold. The tree stays as it is but for them, so this is for a few.
    #[inline]
    pub fn keep(&mut self, kept: &[bool]) {
        let mut next = 0;
        let mut place = |kept: &bool| {
            next += u32::from(*kept);
            if *kept { next - 1 } else { KdTree::GONE }
        };
        let places: Vec<u32> = kept.iter().map(&mut place).collect();
        let mut stays = kept.iter();
        self.points.retain(|_| stays.next().copied().unwrap_or(true));
        self.tree.renumber(&places, self.points.len());
    }

    /// The point nearest to `query` at a squared distance below `max_distance2`. `last` is the index answered for
    /// almost the same query before (or any number that is no index): a good one makes the search short.
    #[inline]
    pub fn nearest_from(&self, query: &LocalPoint, last: u32, max_distance2: f32) -> Option<Neighbour> {
        match self.points.get(last as usize) {
            Some(point) => {
                let guess = Neighbour { index: last, distance2: distance2(query, point) };
                self.tree.nearest_from(query, guess, max_distance2)
            }
            None => self.tree.nearest(query, max_distance2),
        }
    }
}
