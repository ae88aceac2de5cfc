//! The colours of a surface, from the points around each vertex.

use rayon::prelude::*;

use super::balance::Overlaps;
use super::field::{REACH, falloff};
use super::samples::Frame;
use visage_geometry::neighbours::IndexedPoints;
use visage_geometry::{Cloud, Point3};

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Edge of the voxels whose points are averaged, in cells: as many as a vertex needs, and no more.
        voxel: f32 = 0.5,
        /// Places at which views are compared, about.
        compared: usize = 400_000,
    }
}
/// How far a vertex looks for points, in cells: colour is finer than shape.
const NEAR: f32 = 0.6 * REACH;

/// For each vertex, given in cells, the mean colour of the points around; that of the nearest ones where none is near.
/// With the view of each point, views are made equally bright first, and those without any colour have no say.
pub fn colors(frame: &Frame, cloud: &Cloud, views: Option<&[u16]>, vertices: &[[f32; 3]]) -> Option<Vec<[u8; 3]>> {
    let points = Colored { colors: cloud.colors.as_ref()?, views: views.filter(|views| views.len() == cloud.len()) };
    let is_colored = points.is_colored();
    let mut order: Vec<(u64, u32)> = cloud
        .points
        .par_iter()
        .enumerate()
        .filter(|(index, _)| is_colored[points.view(*index)])
        .map(|(index, point)| (voxel(frame, point), index as u32))
        .collect();
    order.par_sort_unstable();
    let voxels: Vec<&[(u64, u32)]> = order.chunk_by(|a, b| a.0 == b.0).collect();
    let gains = points.gains(&voxels, is_colored.len());
    let mean = |voxel: &&[(u64, u32)]| {
        let (mut place, mut color) = ([0.0f32; 3], [0.0f32; 3]);
        for (_, index) in *voxel {
            let index = *index as usize;
            let (at, own, gain) = (frame.local(&cloud.points[index]), points.colors[index], &gains[points.view(index)]);
            for k in 0..3 {
                place[k] += at[k];
                color[k] += f32::from(own[k]) * gain[k];
            }
        }
        let count = voxel.len() as f32;
        (place.map(|x| x / count), color.map(|x| x / count))
    };
    let (places, means): (Vec<[f32; 3]>, Vec<[f32; 3]>) = voxels.par_iter().map(mean).unzip();
    if places.is_empty() {
        return Some(vec![[0; 3]; vertices.len()]);
    }
    let indexed = IndexedPoints::new(places);
    let rounded = |color: [f32; 3]| color.map(|x| x.round().clamp(0.0, 255.0) as u8);
    let of = |vertex: &[f32; 3]| {
        let (mut sum, mut weight) = ([0.0f32; 3], 0.0f32);
        indexed.tree.for_each_within(vertex, NEAR * NEAR, |near| {
            let share = falloff(near.distance2 * (REACH / NEAR).powi(2));
            weight += share;
            (0..3).for_each(|k| sum[k] += share * means[near.index as usize][k]);
        });
        if weight > 0.0 {
            return rounded(sum.map(|x| x / weight));
        }
        let nearest = indexed.tree.nearest(vertex, f32::INFINITY);
        nearest.map_or([0; 3], |near| rounded(means[near.index as usize]))
    };
    Some(vertices.par_iter().map(of).collect())
}

/// The voxel that holds a point.
fn voxel(frame: &Frame, point: &Point3) -> u64 {
    frame.local(point).iter().fold(0, |key, x| key << 21 | (x / TUNING.voxel).max(0.0) as u64)
}

/// The colours of points and the views that they are of.
struct Colored<'a> {
    colors: &'a [[u8; 3]],
    views: Option<&'a [u16]>,
}

impl Colored<'_> {
    fn view(&self, index: usize) -> usize {
        self.views.map_or(0, |views| usize::from(views[index]))
    }

    /// For each view whether any of its points isn't black: those of scans without colours are. Of points whose views are
    /// not known nothing is said.
    fn is_colored(&self) -> Vec<bool> {
        let Some(views) = self.views else { return vec![true] };
        let mut found = vec![false; views.iter().max().map_or(0, |most| usize::from(*most) + 1)];
        for (view, color) in views.iter().zip(self.colors) {
            found[usize::from(*view)] |= *color != [0; 3];
        }
        found
    }

    /// The factors by which the views become equally bright.
    fn gains(&self, voxels: &[&[(u64, u32)]], views: usize) -> Vec<[f32; 3]> {
        let mut overlaps = Overlaps::default();
        if self.views.is_none() {
            return overlaps.gains(views);
        }
        for voxel in voxels.iter().step_by(voxels.len() / TUNING.compared + 1) {
            // one point of each view; points of a voxel are in the order of the cloud, so that of views
            let mut said: Vec<(u16, [f32; 3])> = Vec::new();
            for (_, index) in *voxel {
                let index = *index as usize;
                let view = self.view(index) as u16;
                if said.last().is_none_or(|(last, _)| *last != view) {
                    said.push((view, self.colors[index].map(f32::from)));
                }
            }
            // each with the next one and the one after that: all hang together, and many views don't cost their square
            for step in 1..=2 {
                for k in step..said.len() {
                    overlaps.add(said[k - step], said[k]);
                }
            }
        }
        overlaps.gains(views)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_geometry::Bounds;

    #[test]
    fn colours_follow_the_points_around() {
        let points: Vec<Point3> =
            (0..400).map(|k| Point3::new(f64::from(k % 20) * 0.5, f64::from(k / 20) * 0.5, 0.0)).collect();
        let colors_of = |p: &Point3| if p.x < 5.0 { [200, 10, 0] } else { [0, 10, 200] };
        let cloud = Cloud { colors: Some(points.iter().map(colors_of).collect()), ..Cloud::from_points(points) };
        let frame = Frame::around(&Bounds::of(&cloud.points).expect("points"), 1.0);
        let vertices = [[1.0, 5.0, 0.1], [9.0, 5.0, 0.1], [5.0, 5.0, 30.0]].map(|p: [f64; 3]| frame.local(&p.into()));
        let found = colors(&frame, &cloud, None, &vertices).expect("the points have colours");
        assert_eq!(found[..2], [[200, 10, 0], [0, 10, 200]]);
        assert!([[200, 10, 0], [0, 10, 200]].contains(&found[2]), "far from all points the nearest one's");
        assert_eq!(colors(&frame, &Cloud::from_points(cloud.points.clone()), None, &vertices), None);
    }

    #[test]
    fn views_become_equally_bright_and_scans_without_colours_dont_darken() {
        // three views of a plane with a pattern, each of two thirds of it, and a fourth without colours
        let exposures = [1.2f64, 0.8, 1.0 / (1.2 * 0.8), 0.0];
        let truth = |x: f64, y: f64| 120.0 + 40.0 * (0.11 * x).sin() * (0.07 * y).cos();
        let (mut cloud, mut views) = (Cloud::default(), Vec::new());
        let mut colors_of = Vec::new();
        for (view, exposure) in exposures.iter().enumerate() {
            for k in 0..9600 {
                // the pattern's points of different views lie beside each other
                let (x, y) = (f64::from(k % 120) + 0.2 * view as f64, f64::from(k / 120) + 0.1 * view as f64);
                if view < 3 && ((x / 40.0) as usize) % 3 == view {
                    continue;
                }
                cloud.points.push(Point3::new(x, y, 0.0));
                colors_of.push([(truth(x, y) * exposure).round().min(255.0) as u8; 3]);
                views.push(view as u16);
            }
        }
        cloud.colors = Some(colors_of);
        let frame = Frame::around(&Bounds::of(&cloud.points).expect("points"), 2.0);
        let places: Vec<Point3> =
            (0..1000).map(|k| Point3::new(5.0 + f64::from(k % 110), 5.0 + f64::from(k % 70), 0.0)).collect();
        let vertices: Vec<[f32; 3]> = places.iter().map(|p| frame.local(p)).collect();
        let error = |views: Option<&[u16]>| {
            let found = colors(&frame, &cloud, views, &vertices).expect("colours");
            let off = |(p, color): (&Point3, &[u8; 3])| (f64::from(color[1]) - truth(p.x, p.y)).abs();
            places.iter().zip(&found).map(off).fold((0.0, 0.0f64), |(sum, most), x| (sum + x / 1000.0, most.max(x)))
        };
        let (mean, most) = error(Some(&views));
        assert!(mean < 3.0 && most < 8.0, "{mean} {most}");
        assert!(error(None).0 > 20.0, "without views black points darken");
    }
}
