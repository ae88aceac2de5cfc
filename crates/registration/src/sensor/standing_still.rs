//! What stands still while an object turns before the scanner.
//!
//! A turntable's background is mostly larger than the object, looks the same in every scan, and fits perfectly. But scans
//! that were taken from one place and show the same were taken because something moved, and of that a background says
//! nothing. So where the scanner stood still, only what did not may tell how the views lie: pictures of depth show it ray by ray.

use rayon::prelude::*;

use crate::joint::surfels::Surfels;
use crate::outcome::Outcome;
use crate::sensor::Sensor;
use crate::sensor::viewpoint::{self, angle_between_rays, is_single};
use crate::view::View;
use visage_geometry::neighbours::{IndexedPoints, LocalPoint, Neighbour};
use visage_geometry::{Motion, Point3, UnionFind, Vector3};

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Edge of the surfels by which pictures are compared, in what the set resolves.
        edge: f64 = 2.5,
        /// Surface is the same within this distance along the normal, in edges,
        on: f32 = 0.5,
        /// and this cosine of the normals: sides are seldom known for sure, and of no use here.
        like: f32 = 0.8,
        /// A surfel meets surface within this distance, in edges.
        near: f32 = 1.6,
        /// Scanners stand at one place if they are no farther apart than this share of their distance from what they saw,
        one_place: f64 = 0.02,
        /// the origin of a scan can be such a place within so many radii of the scan,
        far: f64 = 10.0,
        /// and if that is only read off the density of their points.
        guessed_place: f64 = 0.15,
        /// Scans from one place show the same if this share of both is the same surface (code-made turntables: 0.75 and more).
        same_picture: f64 = 0.5,
        /// Where it is not known from where they were taken, they have to show this much of the same (code-made turntables: 0.75
        /// to 0.95; scans from different places: less than 0.65),
        same_all_over: f64 = 0.7,
        /// and break off at the same places: of the rims that meet surface this share meets a rim (turntables: 0.55 to 0.85).
        same_rims: f64 = 0.53,
        /// Pairs of views that share less of what they show than this, as it was measured already, need not be compared.
        least_overlap: f64 = 0.25,
        /// What is said of a surfel is what is said within this distance of it, in edges: wider than edges of things and noise are.
        around: f32 = 2.5,
        /// Rays of another picture that are asked about a point: surface seen from the side has depths of its own at each.
        rays: usize = 4,
        /// They are asked if the nearest is no farther than this, in typical angles between neighbouring rays.
        beside: f32 = 3.0,
        /// Depths are the same within this, in what the set resolves: both have noise.
        same_depth: f64 = 2.0,
        /// Other pictures that a point is held against, at most.
        pictures: usize = 8,
        /// Points of a picture, at most.
        picture_points: usize = 40_000,
        /// What is said of so many points together is said of each:
        together: usize = 20,
        /// they moved if they are looked through in more than this share: what stands still never is, but for noise at edges.
        looked_through: f32 = 0.2,
        /// What moved hangs together over gaps of this many spacings,
        link: f64 = 5.0,
        /// is spread over less than this share of what all points are spread over,
        compact: f64 = 0.7,
        /// and parts of fewer points than this are noise at edges,
        least_points: usize = 15,
        /// or of less than this share of the largest part.
        least_share: f64 = 0.05,
    }
}

/// Views that were taken from one place.
pub struct Still {
    /// `poses[i]` maps the local frame of i into the world; `None` = unplaced.
    pub(super) poses: Vec<Option<Motion>>,
    /// The place in the world, if it is known.
    pub(super) eye: Option<Point3>,
    /// Whether it is known of each scanner that it stood there, not guessed.
    pub is_known: bool,
    /// What the set resolves.
    pub(super) resolution: f64,
    /// The views' surfaces, coarsely.
    surfels: Vec<Surfels>,
}

/// Whether all placed views were taken from one place and show the same, so that nothing can be told of what moved by what
/// did not. `resolution` is what the set resolves.
pub fn from_one_place(views: &[View], sensors: &[Option<Sensor>], result: &Outcome, resolution: f64) -> Option<Still> {
    let pose = |view: usize| result.placed[view].then(|| result.local_poses[view]);
    let poses: Vec<Option<Motion>> = (0..views.len()).map(pose).collect();
    let placed: Vec<usize> = (0..views.len()).filter(|view| result.placed[*view]).collect();
    let (first, rest) = placed.split_first()?;
    if rest.is_empty() || rest.iter().any(|view| result.overlaps.mutual(*first, *view) < TUNING.least_overlap) {
        return None;
    }
    let known = |view: usize| sensors[view].and_then(|sensor| sensor.position());
    // from far off rays are parallel, and the origin of a map is no scanner
    let origin = |view: usize| Some(-views[view].center).filter(|eye| eye.norm() <= TUNING.far * views[view].radius);
    let known_eye = common_place(&placed, &poses, &known, TUNING.one_place);
    let mut eye = known_eye.or_else(|| {
        let can_be = |view: &usize| is_single(views[*view].points(), &-views[*view].center);
        common_place(&placed, &poses, &origin, TUNING.one_place).filter(|_| placed.iter().all(can_be))
    });
    let edge = TUNING.edge * resolution;
    let surfels: Vec<Surfels> = views.par_iter().with_max_len(1).map(|view| Surfels::new(view, edge)).collect();
    let common = Common::of(&surfels, &poses, &placed, edge);
    let is_same = match eye {
        Some(_) => common.same >= TUNING.same_picture,
        None => common.same >= TUNING.same_all_over && common.rims >= TUNING.same_rims,
    };
    if eye.is_none() && is_same {
        let found: Vec<Option<Vector3>> =
            views.par_iter().map(|view| viewpoint::find(&view.indexed, view.radius)).collect();
        eye = place_of_most(&placed, &poses, &|view| found[view]);
    }
    is_same.then(|| Still { poses, eye, is_known: known_eye.is_some(), resolution, surfels })
}

/// Where the scanners stood and how far from what they saw, by the places in their local frames.
fn places(
    placed: &[usize],
    poses: &[Option<Motion>],
    eye: &dyn Fn(usize) -> Option<Vector3>,
) -> Vec<Option<(Point3, f64)>> {
    let seen_from = |view: &usize| Some((poses[*view]? * Point3::from(eye(*view)?), eye(*view)?.norm()));
    placed.iter().map(seen_from).collect()
}

/// The one place of all scanners.
fn common_place(
    placed: &[usize],
    poses: &[Option<Motion>],
    eye: &dyn Fn(usize) -> Option<Vector3>,
    tolerance: f64,
) -> Option<Point3> {
    let places = places(placed, poses, eye).into_iter().collect::<Option<Vec<(Point3, f64)>>>()?;
    let &(first, distance) = places.first()?;
    let are_together = places.iter().all(|(place, _)| (place - first).norm() <= tolerance * distance);
    let mean = places.iter().map(|(place, _)| place.coords).sum::<Vector3>() / places.len() as f64;
    are_together.then_some(Point3::from(mean))
}

/// The place near which most scanners stood, more than half of those asked and two at least.
fn place_of_most(placed: &[usize], poses: &[Option<Motion>], eye: &dyn Fn(usize) -> Option<Vector3>) -> Option<Point3> {
    let places: Vec<(Point3, f64)> = places(placed, poses, eye).into_iter().flatten().collect();
    let near = |(place, distance): &(Point3, f64)| -> Vec<Vector3> {
        let near = places.iter().filter(|(other, _)| (other - place).norm() <= TUNING.guessed_place * distance);
        near.map(|(other, _)| other.coords).collect()
    };
    let most = places.iter().map(near).max_by_key(Vec::len)?;
    (most.len() >= 2 && 2 * most.len() > placed.len())
        .then(|| Point3::from(most.iter().sum::<Vector3>() / most.len() as f64))
}

/// What the placed views have in common with the first.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Common {
    /// The least share of a view's surfels that are the same in the other view.
    same: f64,
    /// Of rims that meet surface the share that meets a rim.
    rims: f64,
}

impl Common {
    fn of(surfels: &[Surfels], poses: &[Option<Motion>], placed: &[usize], edge: f64) -> Common {
        let pairs: Vec<(usize, usize)> =
            placed[1..].iter().flat_map(|&view| [(placed[0], view), (view, placed[0])]).collect();
        let met: Vec<(f64, [usize; 2])> = pairs
            .par_iter()
            .filter_map(|&(i, j)| {
                let met = meet(&surfels[i], &surfels[j], &poses[j]?.inv_mul(&poses[i]?), edge as f32);
                let rim = |k: &usize| met[*k].target.is_some() && !surfels[i].is_inner[*k];
                let is_rim = |k: &usize| met[*k].target.is_some_and(|target| !surfels[j].is_inner[target]);
                let rims: Vec<usize> = (0..met.len()).filter(rim).collect();
                let same = met.iter().filter(|met| met.is_same).count() as f64 / met.len().max(1) as f64;
                Some((same, [rims.len(), rims.iter().filter(|k| is_rim(k)).count()]))
            })
            .collect();
        let rims = met.iter().fold([0, 0], |sum, (_, rims)| [sum[0] + rims[0], sum[1] + rims[1]]);
        let same = met.iter().map(|(same, _)| *same).fold(1.0, f64::min);
        Common { same, rims: rims[1] as f64 / rims[0].max(1) as f64 }
    }
}

/// What a surfel meets in another view.
#[derive(Debug, Clone, Copy, Default)]
struct Met {
    /// The other view's surfel near it.
    target: Option<usize>,
    /// Whether both are one surface.
    is_same: bool,
}

/// What a view's surfels meet in another one.
fn meet(own: &Surfels, other: &Surfels, motion: &Motion, edge: f32) -> Vec<Met> {
    let motion = motion.cast::<f32>();
    let meet = |(place, normal): (&LocalPoint, &[f32; 3])| {
        let moved = (motion * nalgebra::Point3::from(*place)).coords;
        let Some(found) = other.indexed.tree.nearest(&moved.into(), (TUNING.near * edge).powi(2)) else {
            return Met::default();
        };
        let target = found.index as usize;
        let normal = motion.rotation * nalgebra::Vector3::from(*normal);
        let other_normal = nalgebra::Vector3::from(other.normals[target]);
        let cosine = normal.dot(&other_normal);
        let offset = moved - nalgebra::Vector3::from(other.indexed.points[target]);
        let mean = (normal * cosine.signum() + other_normal).normalize();
        Met { target: Some(target), is_same: cosine.abs() > TUNING.like && mean.dot(&offset).abs() < TUNING.on * edge }
    };
    own.indexed.points.iter().zip(&own.normals).map(meet).collect()
}

/// A view as the scanner saw it: the directions of its rays and how far they went.
struct Picture {
    directions: IndexedPoints,
    ranges: Vec<f32>,
    /// The typical angle between neighbouring rays.
    apart: f32,
}

impl Picture {
    fn new(view: &View, pose: &Motion, eye: &Point3) -> Self {
        let points = view.points();
        let step = points.len().div_ceil(TUNING.picture_points).max(1);
        let (directions, ranges): (Vec<LocalPoint>, Vec<f32>) =
            points.iter().step_by(step).filter_map(|point| ray(point, pose, eye)).unzip();
        let directions = IndexedPoints::new(directions);
        let apart = angle_between_rays(&directions);
        Picture { directions, ranges, apart }
    }

    /// Whether the scanner saw the same surface in this direction, or something behind what is `range` away, each 0 or 1; both
    /// are 0 where that is hidden, or nothing was seen.
    fn say(&self, direction: &LocalPoint, range: f32, same: f32, found: &mut Vec<Neighbour>) -> [f32; 2] {
        self.directions.tree.k_nearest(direction, TUNING.rays, f32::INFINITY, found);
        let reach2 = (TUNING.beside * self.apart).powi(2);
        if !found.iter().any(|n| n.distance2 <= reach2) {
            return [0.0; 2];
        }
        let beyond = |n: &Neighbour| self.ranges[n.index as usize] - range;
        if found.iter().any(|n| beyond(n).abs() <= same) {
            [1.0, 0.0]
        } else if found.iter().all(|n| beyond(n) > same) {
            [0.0, 1.0]
        } else {
            [0.0; 2]
        }
    }
}

/// The direction in which a point was seen, and how far.
fn ray(point: &LocalPoint, pose: &Motion, eye: &Point3) -> Option<(LocalPoint, f32)> {
    let way = pose * nalgebra::Point3::from(*point).cast::<f64>() - eye;
    let range = way.norm();
    let direction = way.try_normalize(f64::MIN_POSITIVE)?;
    Some((direction.cast::<f32>().into(), range as f32))
}

impl Still {
    /// For each point of each of `views` whether it moved against what stands still: whether most others that have something
    /// there have another surface, or looked through it. `wholes` are the views as they were compared; `shifts` lead from the
    /// others' local frames to theirs. Views without a place are left as they are.
    pub fn moved(&self, views: &[View], wholes: &[View], shifts: &[Vector3]) -> Vec<Vec<bool>> {
        let picture = |(view, pose): (&View, &Option<Motion>)| Some(Picture::new(view, pose.as_ref()?, &self.eye?));
        let pictures: Vec<Option<Picture>> = wholes.par_iter().zip(&self.poses).with_max_len(1).map(picture).collect();
        let moved = |view: usize| {
            let points = views[view].points();
            let Some(pose) = self.poses[view] else { return vec![true; points.len()] };
            let others: Vec<usize> =
                (0..self.poses.len()).filter(|other| *other != view && self.poses[*other].is_some()).collect();
            let others: Vec<usize> =
                others.iter().step_by(others.len().div_ceil(TUNING.pictures).max(1)).copied().collect();
            let is_crossed = self.crossed(view, &others);
            let shift = nalgebra::Translation3::from(shifts[view]);
            let near = |point: &LocalPoint| {
                let place = shift.cast::<f32>() * nalgebra::Point3::from(*point);
                self.surfels[view].indexed.tree.nearest(&place.coords.into(), f32::INFINITY)
            };
            let pictures: Vec<&Picture> = others.iter().filter_map(|other| pictures[*other].as_ref()).collect();
            let mut moved = self.looked_through(&views[view], &(pose * shift), &pictures);
            for (moved, point) in moved.iter_mut().zip(points) {
                *moved |= near(point).is_some_and(|surfel| is_crossed[surfel.index as usize]);
            }
            large_parts(points, &moved, TUNING.link * views[view].spacing)
        };
        (0..views.len()).into_par_iter().with_max_len(1).map(moved).collect()
    }

    /// Whether what `moved` of the views stands in one part of the scene, as a thing does: noise is everywhere.
    pub fn is_compact(&self, views: &[View], shifts: &[Vector3], moved: &[Vec<bool>]) -> bool {
        let spread = |only_moved: bool| {
            let (mut count, mut sum, mut squares) = (0.0, Vector3::zeros(), 0.0);
            for (view, (points, moved)) in views.iter().map(|view| view.points()).zip(moved).enumerate() {
                let Some(pose) = self.poses[view] else { continue };
                let pose = pose * nalgebra::Translation3::from(shifts[view]);
                for (point, _) in points.iter().zip(moved).filter(|(_, moved)| !only_moved || **moved) {
                    let place = (pose * nalgebra::Point3::from(*point).cast::<f64>()).coords;
                    (count, sum, squares) = (count + 1.0, sum + place, squares + place.norm_squared());
                }
            }
            (squares / f64::max(count, 1.0) - (sum / f64::max(count, 1.0)).norm_squared()).max(0.0).sqrt()
        };
        spread(true) < TUNING.compact * spread(false)
    }

    /// For each surfel of a view whether, around it, more of what it meets in the others is another surface than the same.
    fn crossed(&self, view: usize, others: &[usize]) -> Vec<bool> {
        let own = &self.surfels[view];
        let edge = (TUNING.edge * self.resolution) as f32;
        let mut balance = vec![0.0f32; own.normals.len()];
        for other in others.iter().copied() {
            let Some((own_pose, pose)) = self.poses[view].zip(self.poses[other]) else { continue };
            let surfels = &self.surfels[other];
            let met = meet(own, surfels, &pose.inv_mul(&own_pose), edge);
            for (k, met) in met.into_iter().enumerate() {
                let is_inner = met.target.is_some_and(|target| surfels.is_inner[target] && own.is_inner[k]);
                balance[k] += if met.is_same { 1.0 } else { -f32::from(u8::from(is_inner)) };
            }
        }
        let around = |place: &LocalPoint| {
            let mut sum = 0.0;
            own.indexed
                .tree
                .for_each_within(place, (TUNING.around * edge).powi(2), |n| sum += balance[n.index as usize]);
            sum < 0.0
        };
        own.indexed.points.iter().map(around).collect()
    }

    /// For each point of a view whether the others' pictures look through it and what is about it.
    fn looked_through(&self, view: &View, pose: &Motion, pictures: &[&Picture]) -> Vec<bool> {
        let points = view.points();
        let Some(eye) = self.eye else { return vec![false; points.len()] };
        let same = (TUNING.same_depth * self.resolution) as f32;
        let mut found = Vec::new();
        let sum = |said: &mut dyn Iterator<Item = [f32; 2]>| said.fold([0.0; 2], |[a, b], [c, d]| [a + c, b + d]);
        let mut said: Vec<[f32; 2]> = Vec::with_capacity(points.len());
        for point in points {
            said.push(match ray(point, pose, &eye) {
                Some((direction, range)) => {
                    sum(&mut pictures.iter().map(|picture| picture.say(&direction, range, same, &mut found)))
                }
                None => [0.0; 2],
            });
        }
        let is_through = |point: &LocalPoint| {
            view.indexed.tree.k_nearest_unordered(point, TUNING.together, 0.0, &mut found);
            let [same, through] = sum(&mut found.iter().map(|n| said[n.index as usize]));
            through > TUNING.looked_through * (same + through)
        };
        points.iter().map(is_through).collect()
    }
}

/// Of chosen points those in parts that hang together over gaps of `link` and are no specks.
fn large_parts(points: &[LocalPoint], is_chosen: &[bool], link: f64) -> Vec<bool> {
    let chosen: Vec<usize> = (0..points.len()).filter(|k| is_chosen[*k]).collect();
    let parts = parts(points, &chosen, link as f32);
    let largest = parts.iter().map(Vec::len).max().unwrap_or(0);
    let mut large = vec![false; points.len()];
    for part in parts {
        if part.len() >= TUNING.least_points.max((TUNING.least_share * largest as f64) as usize) {
            part.into_iter().for_each(|k| large[k] = true);
        }
    }
    large
}

/// Sets of chosen points that hang together, in order.
fn parts(points: &[LocalPoint], chosen: &[usize], link: f32) -> Vec<Vec<usize>> {
    let indexed = IndexedPoints::new(chosen.iter().map(|k| points[*k]).collect());
    let mut groups = UnionFind::new(chosen.len());
    for (k, place) in indexed.points.iter().enumerate() {
        indexed.tree.for_each_within(place, link * link, |n| {
            groups.join(k, n.index as usize);
        });
    }
    let mut parts: Vec<Vec<usize>> = Vec::new();
    for (k, number) in groups.numbered().into_iter().enumerate() {
        if number == parts.len() {
            parts.push(Vec::new());
        }
        parts[number].push(chosen[k]);
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::overlap::OverlapMatrix;
    use visage_geometry::Cloud;

    /// What a scanner at `eye` sees of a wall with a ledge, and of a box of side 20 before it: rays on a grid of angles.
    fn scan(eye: Point3, box_at: [f64; 2]) -> View {
        let mut points = Vec::new();
        for (row, column) in (0..90).flat_map(|row| (0..90).map(move |column| (row, column))) {
            let way = Vector3::new(f64::from(column) / 90.0 - 0.5, f64::from(row) / 90.0 - 0.5, 1.0);
            let to_wall = (if row % 40 < 12 { 180.0 } else { 200.0 } - eye.z) / way.z;
            let to_box = (120.0 - eye.z) / way.z;
            let at = eye + way * to_box;
            let is_on_box = (at.x - box_at[0]).abs() < 10.0 && (at.y - box_at[1]).abs() < 10.0;
            points.push(eye.coords + way * if is_on_box { to_box } else { to_wall });
        }
        View::new(&Cloud::from_points(points.into_iter().map(|p| Point3::from(p - eye.coords)).collect()))
            .expect("a sound scan")
    }

    /// Views at the places where the wall has them.
    fn still(views: &[View], eyes: &[Point3]) -> Option<Still> {
        let pose = |(view, eye): (&View, &Point3)| view.local_pose(&Motion::translation(eye.x, eye.y, eye.z));
        let poses: Vec<Motion> = views.iter().zip(eyes).map(pose).collect();
        let everywhere = vec![vec![1.0; views.len()]; views.len()];
        let overlaps = OverlapMatrix::from_rows(everywhere);
        let result = Outcome { overlaps, ..Outcome::at(&poses) };
        from_one_place(views, &vec![None; views.len()], &result, 2.0)
    }

    #[test]
    fn of_scans_from_one_place_the_box_moved_and_the_wall_did_not() {
        let eye = Point3::new(3.0, -2.0, 5.0);
        let views = [[-30.0, 0.0], [0.0, 20.0], [25.0, -15.0]].map(|at| scan(eye, at));
        let still = still(&views, &[eye; 3]).expect("they are from one place");
        for (view, moved) in views.iter().zip(still.moved(&views, &views, &[Vector3::zeros(); 3])) {
            let is_on_box = |point: &LocalPoint| f64::from(point[2]) + view.center.z + eye.z < 150.0;
            let (mut on_box, mut right, mut wrong) = (0, 0, 0);
            for (point, moved) in view.points().iter().zip(moved) {
                on_box += usize::from(is_on_box(point));
                right += usize::from(is_on_box(point) && moved);
                wrong += usize::from(!is_on_box(point) && moved);
            }
            assert!(on_box > 80 && right * 10 > on_box * 9 && wrong * 3 < on_box, "{right} and {wrong} of {on_box}");
        }
    }

    #[test]
    fn scans_from_other_places_are_not_from_one() {
        let eyes = [Point3::new(3.0, -2.0, 5.0), Point3::new(-60.0, -2.0, 5.0), Point3::new(50.0, 30.0, 15.0)];
        let views = eyes.map(|eye| scan(eye, [0.0, 0.0]));
        assert!(still(&views, &eyes).is_none());
    }
}
