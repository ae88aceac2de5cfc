//! The colours of a surface, from the points around each vertex.

use rayon::prelude::*;

use super::field::{REACH, falloff};
use super::samples::Frame;
use visage_geometry::neighbours::IndexedPoints;
use visage_geometry::thinning::representatives;
use visage_geometry::{Cloud, Point3};

/// Edge of the voxels that one point stands for, in cells: as many points as a vertex needs, and no more.
const VOXEL: f32 = 0.5;
/// How far a vertex looks for points, in cells: colour is finer than shape.
const NEAR: f32 = 0.6 * REACH;

/// For each vertex, given in cells, the mean colour of the points around; the nearest one's where none is near.
pub fn colors(frame: &Frame, cloud: &Cloud, vertices: &[[f32; 3]]) -> Option<Vec<[u8; 3]>> {
    let colors = cloud.colors.as_ref()?;
    let places: Vec<[f32; 3]> = cloud.points.par_iter().map(|point: &Point3| frame.local(point)).collect();
    let kept = representatives(&places, VOXEL);
    let indexed = IndexedPoints::new(kept.iter().map(|index| places[*index as usize]).collect());
    let of = |vertex: &[f32; 3]| {
        let (mut sum, mut weight) = ([0.0f32; 3], 0.0f32);
        indexed.tree.for_each_within(vertex, NEAR * NEAR, |near| {
            let share = falloff(near.distance2 * (REACH / NEAR).powi(2));
            weight += share;
            let color = colors[kept[near.index as usize] as usize];
            (0..3).for_each(|k| sum[k] += share * f32::from(color[k]));
        });
        if weight > 0.0 {
            return sum.map(|x| (x / weight).round() as u8);
        }
        let nearest = indexed.tree.nearest(vertex, f32::INFINITY);
        nearest.map_or([0; 3], |near| colors[kept[near.index as usize] as usize])
    };
    Some(vertices.par_iter().map(of).collect())
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
        let found = colors(&frame, &cloud, &vertices).expect("the points have colours");
        assert_eq!(found[..2], [[200, 10, 0], [0, 10, 200]]);
        assert!([[200, 10, 0], [0, 10, 200]].contains(&found[2]), "far from all points the nearest one's");
        assert_eq!(colors(&frame, &Cloud::from_points(cloud.points.clone()), &vertices), None);
    }
}
