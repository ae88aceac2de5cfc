//! How alike two models are by their triangles of salient regions: do the probe's triangles occur on the other, with
//! the same shape, the same relative size and the same pattern of caps and pits?
//!
//! Turn, place and scale don't matter. A triangle counts `(1 - d^2)^2` for the most similar one of the model, `d`
//! being the distance in shape and size in units of [`MOST_CHORD`] and [`MOST_LOG_SIZE`]; the likeness is the mean
//! over the probe's triangles.

use super::outline::{Outline, Outlines};
use super::triangle_query::scaled;
use super::triangles::IndexedTriangle;
use visage_shape::faces::{Shape, Signature, Triangle, sum_of_distances};

/// Triangles farther apart than this on the sphere (of radius 1/2) have nothing in common.
const MOST_CHORD: f64 = 0.08;
/// Nor have those whose relative sizes differ by more than this, as a logarithm.
const MOST_LOG_SIZE: f64 = 0.2;
/// Cells along an axis of the sphere; their edge is [`MOST_CHORD`] and a little more.
const CELLS: usize = 12;
/// Ways in which three corners can be caps and pits.
const PATTERNS: usize = 8;

/// The probe's triangles, each found from every cell of the sphere from which it is near enough to count.
#[derive(Debug)]
pub(super) struct ProbeRegions {
    triangles: Vec<IndexedTriangle>,
    /// What is near to each cell, of each pattern of caps and pits, one after the other; and where each begins.
    near: Vec<Labelled>,
    starts: Vec<usize>,
}

/// One of the probe's triangles in one labelling: what it is compared by.
#[derive(Debug, Clone, Copy)]
struct Labelled {
    place: u32,
    shape: Shape,
    log_size: f64,
}

impl Labelled {
    fn new(place: u32, triangle: &IndexedTriangle) -> Labelled {
        Labelled { place, shape: triangle.shape, log_size: triangle.log_size }
    }
}

/// How alike a model is.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct RegionLikeness {
    /// In [0, 1].
    pub mean: f64,
    /// The pair of least chord among the probe's triangles and their counterparts.
    pub best: Option<Pair>,
}

/// One of the probe's triangles and its counterpart.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Pair {
    pub chord: f64,
    /// The probe's triangle by its place.
    place: usize,
    /// The model's.
    pub found: IndexedTriangle,
}

/// The triangle of a model that is most like one of the probe's. Small: there are many, and one of them is looked at.
#[derive(Debug, Clone, Copy)]
struct Counterpart {
    kernel: f64,
    chord: f64,
    number: u16,
}

impl ProbeRegions {
    pub fn new(probe: &Signature) -> ProbeRegions {
        let mut outlines = Outlines::default();
        outlines.push(probe);
        let triangles: Vec<IndexedTriangle> = outlines.outline(0).of_regions().map(|(_, triangle)| triangle).collect();
        let mut found: Vec<(usize, Labelled)> = Vec::new();
        let mut starts = vec![0; CELLS * CELLS * CELLS * PATTERNS + 1];
        for (place, triangle) in (0u32..).zip(&triangles) {
            for labelled in triangle.labelings() {
                for cell in around(&labelled.shape) {
                    let cell = with_pattern(cell, labelled.convex);
                    starts[cell + 1] += 1;
                    found.push((cell, Labelled::new(place, &labelled)));
                }
            }
        }
        found.sort_by_key(|(cell, _)| *cell);
        for cell in 1..starts.len() {
            starts[cell] += starts[cell - 1];
        }
        ProbeRegions { triangles, near: found.into_iter().map(|(_, labelled)| labelled).collect(), starts }
    }

    fn near(&self, found: &IndexedTriangle) -> &[Labelled] {
        let cell = with_pattern(cell(&found.shape), found.convex);
        &self.near[self.starts[cell]..self.starts[cell + 1]]
    }

    /// How alike a model is.
    pub fn likeness(&self, model: &Outline) -> RegionLikeness {
        let mut counterparts: Vec<Option<Counterpart>> = vec![None; self.triangles.len()];
        for (number, found) in model.of_regions() {
            for labelled in self.near(&found) {
                if let Some((kernel, chord)) = alike(labelled, &found) {
                    let slot = &mut counterparts[labelled.place as usize];
                    // the greatest kernel; of equals the least chord, then the first triangle
                    let is_better = |other: &Counterpart| {
                        kernel > other.kernel || kernel == other.kernel && (chord, number) < (other.chord, other.number)
                    };
                    if slot.as_ref().is_none_or(is_better) {
                        *slot = Some(Counterpart { kernel, chord, number });
                    }
                }
            }
        }
        let total: f64 = counterparts.iter().flatten().map(|counterpart| counterpart.kernel).sum();
        let placed =
            counterparts.into_iter().enumerate().filter_map(|(place, counterpart)| Some((place, counterpart?)));
        let best = placed.min_by(|(_, a), (_, b)| a.chord.total_cmp(&b.chord));
        let pair = |(place, counterpart): (usize, Counterpart)| {
            let found = model.triangle(counterpart.number)?;
            Some(Pair { chord: counterpart.chord, place, found })
        };
        RegionLikeness { mean: total / self.triangles.len().max(1) as f64, best: best.and_then(pair) }
    }

    /// The paper's total vertex distance of a pair whose sizes are made equal, over the ways to label it.
    pub fn least_sum(&self, pair: &Pair, size: f64) -> f64 {
        let probe = &self.triangles[pair.place];
        let standard = scaled(&Triangle::new(probe.corners), size);
        let sums = pair.found.labelings().map(|labelled| {
            sum_of_distances(&Triangle::new(labelled.corners), &pair.found.outward, &standard, &probe.outward)
        });
        sums.into_iter().fold(f64::INFINITY, f64::min)
    }
}

/// The cell of one coordinate.
fn step(x: f64) -> usize {
    (((x + 0.5) * CELLS as f64).max(0.0) as usize).min(CELLS - 1)
}

fn index([x, y, z]: [usize; 3]) -> usize {
    (x * CELLS + y) * CELLS + z
}

/// A cell's part that holds what has this pattern.
fn with_pattern(cell: usize, [a, b, c]: [bool; 3]) -> usize {
    cell * PATTERNS + 4 * usize::from(a) + 2 * usize::from(b) + usize::from(c)
}

fn cell(shape: &Shape) -> usize {
    index(shape.coordinates().map(step))
}

/// The cells that hold whatever is within [`MOST_CHORD`] of a shape.
fn around(shape: &Shape) -> impl Iterator<Item = usize> {
    let [x, y, z] = shape.coordinates().map(|x| step(x - MOST_CHORD)..=step(x + MOST_CHORD));
    x.flat_map(move |x| {
        let z = z.clone();
        y.clone().flat_map(move |y| z.clone().map(move |z| index([x, y, z])))
    })
}

/// The kernel of two triangles of one pattern in one labelling and their chord, if they are near enough to count.
fn alike(probe: &Labelled, other: &IndexedTriangle) -> Option<(f64, f64)> {
    let chord = probe.shape.chord(&other.shape);
    let distance2 = (chord / MOST_CHORD).powi(2) + ((probe.log_size - other.log_size) / MOST_LOG_SIZE).powi(2);
    (distance2 < 1.0).then(|| ((1.0 - distance2).powi(2), chord))
}

#[cfg(test)]
mod tests {
    use super::super::outline::triangles_of;
    use super::super::triangles::Origin;
    use super::*;
    use visage_shape::faces::signature::example::example;

    fn likeness(probe: &Signature, model: &Signature) -> RegionLikeness {
        let mut outlines = Outlines::default();
        outlines.push(model);
        ProbeRegions::new(probe).likeness(&outlines.outline(0))
    }

    #[test]
    fn triangles_are_alike_only_with_the_same_pattern_and_size() {
        let triangle = triangles_of(&example(0.2, 5))[0];
        let labelled = Labelled::new(0, &triangle);
        assert_eq!(alike(&labelled, &triangle), Some((1.0, 0.0)));
        assert_eq!(alike(&labelled, &IndexedTriangle { log_size: triangle.log_size + 0.21, ..triangle }), None);
        let (kernel, _) = alike(&labelled, &IndexedTriangle { log_size: triangle.log_size + 0.1, ..triangle })
            .expect("half of the most is near enough");
        assert!((kernel - 0.5625).abs() < 1e-12);

        let regions = ProbeRegions::new(&example(0.2, 5));
        let [a, b, c] = triangle.convex;
        let is_itself = |near: &Labelled| near.shape == triangle.shape;
        assert!(regions.near(&triangle).iter().any(is_itself));
        let other = IndexedTriangle { convex: [!a, b, c], ..triangle };
        assert!(!regions.near(&other).iter().any(is_itself));
    }

    #[test]
    fn it_is_the_mean_of_the_best_kernels() {
        for (probe, model) in [(0.81, 0.8), (2.0, 9.3), (0.1, 0.1)] {
            let (probe, model) = (example(probe, 8), example(model, 8));
            let [of_probe, of_model] =
                [&probe, &model].map(|s| triangles_of(s).into_iter().filter(|t| t.origin == Origin::Regions));
            let of_model: Vec<IndexedTriangle> = of_model.collect();
            let kernels = of_probe.map(|triangle| {
                let pairs = triangle.labelings().into_iter().flat_map(|l| {
                    let same_pattern = of_model.iter().filter(move |m| m.convex == l.convex);
                    same_pattern.filter_map(move |m| alike(&Labelled::new(0, &l), m))
                });
                pairs.map(|(kernel, _)| kernel).fold(0.0, f64::max)
            });
            let kernels: Vec<f64> = kernels.collect();
            let mean = kernels.iter().sum::<f64>() / kernels.len() as f64;
            assert!((likeness(&probe, &model).mean - mean).abs() < 1e-12);
        }
    }

    #[test]
    fn a_model_is_like_itself() {
        let itself = likeness(&example(0.3, 7), &example(0.3, 7));
        assert!((itself.mean - 1.0).abs() < 1e-12 && itself.best.expect("it has triangles").chord == 0.0);
        let nothing = likeness(&example(0.3, 7), &example(0.3, 2));
        assert_eq!(nothing, RegionLikeness { mean: 0.0, best: None });
        assert_eq!(likeness(&example(0.3, 1), &example(0.3, 7)).mean, 0.0);
    }
}
