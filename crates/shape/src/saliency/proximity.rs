//! The nearest neighbours of every point of a cloud, and how densely it is sampled there.

use rayon::prelude::*;

use super::median;
use visage_geometry::neighbours::{KdTree, LocalPoint};
use visage_geometry::progress::{Canceled, Progress};
use visage_geometry::{Bounds, Point3};

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// So many neighbours say how a surface runs: enough to average noise, few enough to stay on it.
        neighbours: usize = 16,
    }
}

/// For every point its nearest points, itself included.
#[derive(Debug, Clone, Default)]
pub struct Proximity {
    /// Each point's neighbours, nearest first: most have `TUNING.neighbours`, but where distances are too large for their squares
    /// some are not found.
    neighbours: Lists,
    /// The distance of the last of them.
    farthest: Vec<f64>,
}

/// A list of points for every point.
#[derive(Debug, Clone, Default)]
pub struct Lists {
    /// Where each list begins in `items`, and the end.
    starts: Vec<u32>,
    items: Vec<u32>,
}

impl Lists {
    /// The list of a point.
    pub fn of(&self, index: usize) -> impl ExactSizeIterator<Item = usize> + '_ {
        self.items[self.starts[index] as usize..self.starts[index + 1] as usize].iter().map(|&item| item as usize)
    }
}

impl Proximity {
    /// Looks up the neighbours of all points.
    pub fn new(points: &[Point3], progress: &Progress) -> Result<Proximity, Canceled> {
        let middle = Bounds::of(points).map_or(Point3::origin(), |b| b.center());
        let local: Vec<LocalPoint> = points.iter().map(|p| (p - middle).cast::<f32>().into()).collect();
        let tree = KdTree::new(&local);
        let per_point = TUNING.neighbours.min(points.len());
        let found: Vec<(Vec<u32>, f64)> = local
            .par_iter()
            .with_min_len(256)
            .map_init(Vec::new, |found, point| {
                progress.check()?;
                tree.k_nearest(point, per_point, f32::INFINITY, found);
                let farthest = found.last().map_or(0.0, |n| f64::from(n.distance2).sqrt());
                Ok((found.iter().map(|n| n.index).collect(), farthest))
            })
            .collect::<Result<_, Canceled>>()?;
        let (neighbours, farthest): (Vec<Vec<u32>>, Vec<f64>) = found.into_iter().unzip();
        let mut starts = vec![0];
        for (point, neighbours) in neighbours.iter().enumerate() {
            starts.push(starts[point] + neighbours.len() as u32);
        }
        Ok(Proximity { neighbours: Lists { starts, items: neighbours.concat() }, farthest })
    }

    /// The neighbours of a point, nearest first, itself included.
    pub fn of(&self, index: usize) -> impl ExactSizeIterator<Item = usize> + '_ {
        self.neighbours.of(index)
    }

    /// For every point the points that have it among their neighbours.
    pub fn reversed(&self) -> Lists {
        let count = self.farthest.len();
        let mut starts = vec![0u32; count + 1];
        for &neighbour in &self.neighbours.items {
            starts[neighbour as usize + 1] += 1;
        }
        for point in 0..count {
            starts[point + 1] += starts[point];
        }
        let mut next = starts.clone();
        let mut items = vec![0; self.neighbours.items.len()];
        for point in 0..count {
            for neighbour in self.of(point) {
                let slot = &mut next[neighbour];
                items[*slot as usize] = point as u32;
                *slot += 1;
            }
        }
        Lists { starts, items }
    }

    /// The distance of the last neighbour.
    pub fn farthest(&self, index: usize) -> f64 {
        self.farthest[index]
    }

    /// The edge of the square that a point near this one stands for: its neighbours share a disc.
    pub fn spacing(&self, index: usize) -> f64 {
        self.farthest[index] * (std::f64::consts::PI / self.of(index).len().max(1) as f64).sqrt()
    }

    /// The median of [`Proximity::spacing`].
    pub fn usual_spacing(&self) -> f64 {
        median((0..self.farthest.len()).map(|index| self.spacing(index)).collect()).unwrap_or(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn proximity(points: &[Point3]) -> Proximity {
        Proximity::new(points, &Progress::silent()).expect("not canceled")
    }

    #[test]
    fn distances_beyond_all_numbers_have_fewer_neighbours_and_do_no_harm() {
        for scale in [1e-30, 1.0, 1e19, 1e30, 1e38] {
            let points: Vec<Point3> = (0..40).map(|k| Point3::new(scale * f64::from(k), 0.0, 0.0)).collect();
            let proximity = proximity(&points);
            let listed: usize = (0..points.len()).map(|point| proximity.of(point).count()).sum();
            let reversed = proximity.reversed();
            assert_eq!(listed, (0..points.len()).map(|point| reversed.of(point).count()).sum::<usize>());
        }
    }

    #[test]
    fn a_grid_tells_its_spacing_wherever_it_lies() {
        let points: Vec<Point3> =
            (0..900).map(|k| Point3::new(7e5 + 0.5 * f64::from(k % 30), 0.5 * f64::from(k / 30), 3.0)).collect();
        let proximity = proximity(&points);
        assert!((proximity.usual_spacing() / 0.5 - 1.0).abs() < 0.1, "{}", proximity.usual_spacing());
        let middle = 15 * 30 + 15;
        assert_eq!(proximity.of(middle).next(), Some(middle));
        assert!(proximity.of(middle).all(|n| (points[n] - points[middle]).norm() <= proximity.farthest(middle) + 1e-6));
    }

    #[test]
    fn reversed_lists_hold_the_same_pairs() {
        let points: Vec<Point3> =
            (0..200).map(|k| Point3::new(f64::from(k * k % 97), f64::from(k % 13), 0.0)).collect();
        let proximity = proximity(&points);
        let reversed = proximity.reversed();
        for point in 0..points.len() {
            assert!(reversed.of(point).all(|lister| proximity.of(lister).any(|n| n == point)));
        }
        let all: usize = (0..points.len()).map(|point| reversed.of(point).count()).sum();
        assert_eq!(all, 200 * TUNING.neighbours);
    }

    #[test]
    fn few_points_are_all_neighbours() {
        let points = [Point3::origin(), Point3::new(1.0, 0.0, 0.0)];
        let proximity = proximity(&points);
        assert_eq!(proximity.of(1).collect::<Vec<_>>(), [1, 0]);
        assert_eq!(super::Proximity::new(&[], &Progress::silent()).expect("not canceled").usual_spacing(), 0.0);
    }
}
