//! What the surface looks like around a point, whatever the pose: fast point feature histograms.
//!
//! Rusu, Blodow, Beetz, "Fast point feature histograms (FPFH) for 3D registration", ICRA 2009, on oriented normals. The
//! histograms' square roots are kept, so that the Euclidean distance is the Hellinger distance.

use visage_geometry::neighbours::IndexedPoints;

/// Bins of each of the three angles.
const BINS: usize = 11;
/// Numbers in a descriptor.
pub const LENGTH: usize = 3 * BINS;

/// One description.
pub type Descriptor = [f32; LENGTH];

/// Descriptions number by number, so that one is compared with all in vector code.
#[derive(Debug, Clone)]
pub struct Descriptors {
    /// `LENGTH` columns of `len` numbers.
    columns: Vec<f32>,
    len: usize,
}

impl Descriptors {
    fn new(rows: &[Descriptor]) -> Self {
        let columns = (0..LENGTH).flat_map(|column| rows.iter().map(move |row| row[column])).collect();
        Descriptors { columns, len: rows.len() }
    }

    /// One of them.
    pub fn get(&self, index: usize) -> Descriptor {
        std::array::from_fn(|column| self.columns[column * self.len + index])
    }

    /// How many they are.
    pub fn count(&self) -> usize {
        self.len
    }

    /// At most `count` of them, spread evenly over the view.
    pub fn spread(&self, count: usize) -> Descriptors {
        let step = self.len.div_ceil(count.max(1)).max(1);
        let rows: Vec<Descriptor> = (0..self.len).step_by(step).map(|index| self.get(index)).collect();
        Descriptors::new(&rows)
    }

    /// The squared distances of some descriptions from each of these: one row of `len` for each asked.
    pub fn distances2<const QUERIED: usize>(&self, queried: &[Descriptor; QUERIED], rows: &mut [Vec<f32>; QUERIED]) {
        for row in rows.iter_mut() {
            row.clear();
            row.resize(self.len, 0.0);
        }
        for (number, column) in self.columns.chunks_exact(self.len.max(1)).enumerate() {
            for (row, descriptor) in rows.iter_mut().zip(queried) {
                let value = descriptor[number];
                for (sum, other) in row.iter_mut().zip(column) {
                    *sum += (value - other) * (value - other);
                }
            }
        }
    }
}

/// Radius of the neighbourhood described, in edges.
pub const REACH: f64 = 5.0;

/// Describes the surface around the surfels `at`.
pub fn describe(indexed: &IndexedPoints, normals: &[nalgebra::Vector3<f32>], at: &[u32], edge: f64) -> Descriptors {
    let reach2 = (REACH * edge).powi(2) as f32;
    let mut neighbours: Vec<(u32, f32)> = Vec::new();
    let mut starts = vec![0usize];
    let mut simple: Vec<Descriptor> = Vec::with_capacity(normals.len());
    for (index, point) in indexed.points.iter().enumerate() {
        let mut histogram = [0.0; LENGTH];
        indexed.tree.for_each_within(point, reach2, |n| {
            if n.index as usize != index {
                neighbours.push((n.index, n.distance2));
                let there = n.index as usize;
                let offset =
                    nalgebra::Vector3::from(indexed.points[there]) - nalgebra::Vector3::from(indexed.points[index]);
                vote(&mut histogram, &normals[index], &normals[there], &offset);
            }
        });
        normalise(&mut histogram);
        simple.push(histogram);
        starts.push(neighbours.len());
    }
    let described: Vec<Descriptor> = at
        .iter()
        .map(|&index| {
            let index = index as usize;
            let around = &neighbours[starts[index]..starts[index + 1]];
            let mut sum = [0.0; LENGTH];
            for &(there, distance2) in around {
                let weight = 1.0 / distance2.max(f32::MIN_POSITIVE).sqrt();
                for (s, v) in sum.iter_mut().zip(&simple[there as usize]) {
                    *s += weight * v;
                }
            }
            normalise(&mut sum);
            for (s, v) in sum.iter_mut().zip(&simple[index]) {
                *s += v;
            }
            sum.map(|s| s.max(0.0).sqrt())
        })
        .collect();
    Descriptors::new(&described)
}

/// One pair's three angles in the Darboux frame of `normal`.
fn vote(
    histogram: &mut Descriptor,
    normal: &nalgebra::Vector3<f32>,
    other: &nalgebra::Vector3<f32>,
    offset: &nalgebra::Vector3<f32>,
) {
    let distance = offset.norm();
    let direction = offset / distance.max(f32::MIN_POSITIVE);
    let v = normal.cross(&direction);
    let across = v.norm();
    if across < 1e-6 {
        return;
    }
    let v = v / across;
    let w = normal.cross(&v);
    let alpha = v.dot(other);
    let phi = normal.dot(&direction);
    let theta = w.dot(other).atan2(normal.dot(other)) / std::f32::consts::PI;
    for (row, value) in [alpha, phi, theta].into_iter().enumerate() {
        // votes are shared between neighbouring bins, so that a small change moves little
        let place = ((value + 1.0) * 0.5 * BINS as f32 - 0.5).clamp(0.0, (BINS - 1) as f32);
        let low = place as usize;
        let share = place - low as f32;
        histogram[row * BINS + low] += 1.0 - share;
        histogram[row * BINS + (low + 1).min(BINS - 1)] += share;
    }
}

/// Each angle's histogram sums to one.
fn normalise(histogram: &mut Descriptor) {
    for row in histogram.chunks_exact_mut(BINS) {
        let sum: f32 = row.iter().sum();
        if sum > 0.0 {
            row.iter_mut().for_each(|v| *v /= sum);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::global::fixture::{EDGE, Fixture};

    /// The squared distance of two descriptions.
    fn distance2(a: &Descriptor, b: &Descriptor) -> f32 {
        a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
    }

    #[test]
    fn all_distances_at_once_are_those_one_by_one() {
        let fixture = Fixture::from_around(&[0.0]);
        let all = &fixture.coarse_views[0].descriptors;
        let queried = [all.get(0), all.get(all.count() / 2)];
        let mut rows = [Vec::new(), Vec::new()];
        all.distances2(&queried, &mut rows);
        for (row, descriptor) in rows.iter().zip(&queried) {
            assert_eq!(row.len(), all.count());
            let alone = (0..all.count()).map(|index| distance2(descriptor, &all.get(index)));
            assert!(row.iter().zip(alone).all(|(a, b)| (a - b).abs() < 1e-4));
        }
        assert_eq!(all.spread(7).count(), all.count().div_ceil(all.count().div_ceil(7)));
    }

    #[test]
    fn the_same_place_looks_alike_from_another_view_and_turned() {
        let fixture = Fixture::from_around(&[0.0, 40.0]);
        let (i, j) = (&fixture.coarse_views[0], &fixture.coarse_views[1]);
        let motion = fixture.i_from_j(0, 1).cast::<f32>();
        // of the descriptions of view j's surfels the distance from that of the nearest surfel of view i, and from any
        let (mut same, mut any) = (Vec::new(), Vec::new());
        for (place, &surfel) in j.inner.iter().enumerate().step_by(5) {
            let moved = motion * nalgebra::Point3::from(j.position(surfel as usize));
            let Some(near) = i.indexed.tree.nearest(&moved.coords.into(), (0.3 * EDGE * 0.3 * EDGE) as f32) else {
                continue;
            };
            let Some(at) = i.inner.iter().position(|inner| *inner == near.index) else { continue };
            same.push(distance2(&j.descriptors.get(place), &i.descriptors.get(at)));
            any.push(distance2(&j.descriptors.get(place), &i.descriptors.get((at * 7 + 13) % i.inner.len())));
        }
        let median = |mut numbers: Vec<f32>| {
            numbers.sort_by(f32::total_cmp);
            numbers[numbers.len() / 2]
        };
        assert!(same.len() > 20, "{}", same.len());
        let (same, any) = (median(same), median(any));
        assert!(same < 0.5 * any, "{same} {any}");
    }
}
