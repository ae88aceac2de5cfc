//! Images of a surface: unrolled from cylinders about its axes, and seen along them.

use std::f64::consts::TAU;

use nalgebra::Matrix3;

use super::area_samples::AreaSamples;

/// Rows of every map, and columns of one that is seen along an axis; a cylinder's has twice as many.
pub(super) const SIDE: usize = 64;

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// The radius and half the height of a cylinder, in mean distances of the surface from its centroid.
        cylinder: f64 = 3.0,
        /// Half the edge of what is seen along an axis, in the same unit.
        window: f64 = 2.5,
        /// A place that no sample met is filled if so many of its eight neighbours were met,
        neighbours: usize = 5,
        /// so many times.
        fillings: usize = 2,
        /// The power of the cosine to the radius: only what faces outward counts.
        facing: i32 = 4,
    }
}

/// An image of [`SIDE`] rows.
#[derive(Debug, Clone)]
pub(super) struct Map {
    pub width: usize,
    pub values: Vec<f32>,
}

impl Map {
    fn new(width: usize) -> Map {
        Map { width, values: vec![0.0; width * SIDE] }
    }

    fn each(&self, of: impl Fn(f32) -> f32) -> Map {
        Map { width: self.width, values: self.values.iter().map(|value| of(*value)).collect() }
    }
}

/// What is seen of samples in a frame, for an axis: the farthest sample in each direction from the axis as its distance, how much
/// it faces away from the axis, and how much along it.
pub(super) fn panorama(samples: &AreaSamples, frame: &Matrix3<f64>, axis: usize) -> [Map; 3] {
    let width = 2 * SIDE;
    let [mut radius, mut outward, mut along] = [(); 3].map(|()| Map::new(width));
    let (across, up) = ((axis + 1) % 3, (axis + 2) % 3);
    for (point, normal) in samples.points.iter().zip(&samples.normals) {
        let (p, n) = (frame * point, frame * normal);
        let Some(row) = cell(p[axis] / TUNING.cylinder) else { continue };
        let distance = p[across].hypot(p[up]);
        let turn = p[up].atan2(p[across]) / TAU + 0.5;
        let place = row * width + ((turn * width as f64) as usize).min(width - 1);
        // more than nothing: a sample on the axis was met
        let far = ((distance / TUNING.cylinder) as f32).max(1e-6);
        if far > radius.values[place] {
            radius.values[place] = far;
            outward.values[place] =
                ((n[across] * p[across] + n[up] * p[up]) / distance.max(f64::MIN_POSITIVE)).abs() as f32;
            along.values[place] = n[axis].abs() as f32;
        }
    }
    fill(&mut radius, [&mut outward, &mut along], true);
    [radius, outward.each(|cosine| cosine.powi(TUNING.facing)), along]
}

/// What is seen of samples in a frame along an axis: where there is something, and how much it faces the viewer, from either end.
pub(super) fn views(samples: &AreaSamples, frame: &Matrix3<f64>, axis: usize) -> [Map; 3] {
    let (mut silhouette, mut ends) = (Map::new(SIDE), [(); 2].map(|()| [Map::new(SIDE), Map::new(SIDE)]));
    for (point, normal) in samples.points.iter().zip(&samples.normals) {
        let (p, n) = (frame * point, frame * normal);
        let places = [(axis + 2) % 3, (axis + 1) % 3].map(|other| cell(p[other] / TUNING.window));
        let [Some(row), Some(column)] = places else { continue };
        let place = row * SIDE + column;
        for (end, sign) in ends.iter_mut().zip([1.0, -1.0]) {
            let near = ((0.5 + 0.5 * sign * p[axis] / TUNING.window) as f32).clamp(1e-4, 1.0);
            if near > end[0].values[place] {
                end[0].values[place] = near;
                end[1].values[place] = n[axis].abs() as f32;
            }
        }
    }
    for [depth, facing] in &mut ends {
        fill(depth, [facing], false);
    }
    let [[depth, above], [_, below]] = ends;
    silhouette.values = depth.values.iter().map(|depth| f32::from(u8::from(*depth > 0.0))).collect();
    [silhouette, above, below]
}

/// The row or column of a place, between -1 and 1.
fn cell(place: f64) -> Option<usize> {
    let at = ((place + 1.0) * 0.5 * SIDE as f64).floor();
    (0.0..SIDE as f64).contains(&at).then_some(at as usize)
}

/// Fills small gaps of a map, and of those that belong to it, by the mean of the neighbours; a panorama goes on at its other end.
fn fill<const N: usize>(map: &mut Map, mut others: [&mut Map; N], is_round: bool) {
    let width = map.width;
    for _ in 0..TUNING.fillings {
        let before = map.values.clone();
        let gaps = (0..before.len()).filter(|place| before[*place] == 0.0);
        let mut filled = Vec::new();
        for gap in gaps {
            let met: Vec<usize> = around(gap, width, is_round).filter(|place| before[*place] > 0.0).collect();
            if met.len() >= TUNING.neighbours {
                filled.push((gap, met));
            }
        }
        let mean =
            |values: &[f32], met: &[usize]| met.iter().map(|place| values[*place]).sum::<f32>() / met.len() as f32;
        for (gap, met) in filled {
            map.values[gap] = mean(&before, &met);
            // neighbours that were filled just now don't count: they are not among those met
            others.iter_mut().for_each(|other| other.values[gap] = mean(&other.values, &met));
        }
    }
}

/// The neighbours of a place.
fn around(place: usize, width: usize, is_round: bool) -> impl Iterator<Item = usize> {
    let (row, column) = (place / width, place % width);
    let rows = row.saturating_sub(1)..(row + 2).min(SIDE);
    rows.flat_map(move |y| {
        [width - 1, 0, 1].into_iter().filter_map(move |step| {
            let x = column + step;
            let is_beyond = !(width..2 * width).contains(&x) && step == width - 1 || x >= width && step != width - 1;
            (is_round || !is_beyond).then_some(y * width + x % width)
        })
    })
}
