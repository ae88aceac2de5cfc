//! What moved before a scanner that stood still, as it stood in each of the scans.
//!
//! All scans share one eye and one world: that of the background. So each picture says of any place in that world whether the
//! scanner saw the thing there, or through there to what is behind: the outline of a small thing holds it where its few
//! points do not.

use rayon::prelude::*;

use super::Sensor;
use super::depth_image::{DepthImage, Seen};
use super::standing_still::Still;
use super::viewpoint::angle_between_rays;
use crate::view::{View, median};
use visage_geometry::neighbours::{IndexedPoints, LocalPoint};
use visage_geometry::normals::{local_planes, plane_through};
use visage_geometry::{Motion, Point3, Vector3};

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Side of a picture's cells, in angles between neighbouring rays.
        cell: f32 = 1.5,
        /// What is at least so much wider than what moved is left out of the pictures: a factor of the angle.
        margin: f64 = 1.3,
        /// Points whose plane is a normal: enough to average noise.
        neighbours: usize = 16,
        /// Depths differ from this on, in what the set resolves,
        in_front: f32 = 3.0,
        /// and surfaces are the same within this along their normals,
        on: f32 = 0.8,
        /// with this cosine of these, if they are no farther apart
        like: f32 = 0.75,
        /// than this, in spacings.
        near: f32 = 3.0,
        /// Surfaces that look so much the other way may be two sides of a thin wall, and say nothing.
        opposed: f32 = -0.4,
        /// A point where another picture looks through speaks against a motion as so many that agree speak for it: less than of
        /// surfels (`global/votes.rs`), since single points fly at edges.
        looked_through: f32 = 10.0,
        /// Places of the background at which it is asked where it faces,
        facing_samples: usize = 500,
        /// the share of them that make a direction one that much of it faces,
        facing_share: f64 = 0.1,
        /// the cosine within which they are one,
        facing_like: f32 = 0.98,
        /// and how many directions are told at most.
        directions: usize = 3,
    }
}

/// Views of what moved, in the world of what stood still, about the middle of what moved.
#[derive(Debug, Clone)]
pub struct Turning {
    /// For each view its local frame to that world.
    pub world_from_local: Vec<Motion>,
    /// For each view what moved.
    pub views: Vec<Stood>,
    /// The middle of what moved, in the world of the poses that it was found by.
    pub middle: Vector3,
    /// From where all was seen, about the middle.
    pub eye: Vector3,
    /// The farthest that any of it is from the middle.
    pub reach: f64,
    /// The median distance of its points from their neighbours.
    pub spacing: f64,
    /// Directions that much of what stands still faces: of the floor or the table on which things turn.
    pub facing: Vec<Vector3>,
    resolution: f32,
}

/// What moved, as it stood in one view.
#[derive(Debug, Clone)]
pub struct Stood {
    /// Its points,
    pub indexed: IndexedPoints,
    /// and their unit normals, towards the scanner.
    pub normals: Vec<nalgebra::Vector3<f32>>,
    /// All that the scanner saw about there, background and all.
    picture: DepthImage,
}

impl Turning {
    /// Of `views`, which are cut to what moved from the `wholes` that stand `still`. `None` where a view has no place before the
    /// background, or it is not known from where they were seen.
    pub fn of(still: &Still, views: &[View], wholes: &[View]) -> Option<Self> {
        let poses: Vec<Motion> = still.poses.iter().copied().collect::<Option<_>>()?;
        let eye = still.eye?;
        let placed = |view: &View, pose: &Motion| -> Vec<Point3> {
            let place = |point: &LocalPoint| pose * nalgebra::Point3::from(*point).cast::<f64>();
            view.points().iter().map(place).collect()
        };
        let between = |(pose, (view, whole)): (&Motion, (&View, &View))| {
            pose * nalgebra::Translation3::from(view.center - whole.center)
        };
        let moved_poses: Vec<Motion> = poses.iter().zip(views.iter().zip(wholes)).map(between).collect();
        let moved: Vec<Vec<Point3>> = views.iter().zip(&moved_poses).map(|(view, pose)| placed(view, pose)).collect();
        let count = moved.iter().map(Vec::len).sum::<usize>().max(1) as f64;
        let middle = moved.iter().flatten().map(|p| p.coords).sum::<Vector3>() / count;
        let ahead = (middle - eye.coords).try_normalize(f64::MIN_POSITIVE)?;
        let cosine = |p: &Point3| (p - eye).try_normalize(f64::MIN_POSITIVE).map_or(-1.0, |way| way.dot(&ahead));
        let widest = moved.iter().flatten().map(cosine).fold(1.0, f64::min).acos();
        let least_cosine = (TUNING.margin * widest).min(std::f64::consts::PI).cos();
        let about = |points: &[Point3]| -> Vec<LocalPoint> {
            points.iter().map(|p| (p.coords - middle).cast::<f32>().into()).collect()
        };
        let eye_about = eye.coords - middle;
        let stood = |(moved, (whole, pose)): (&Vec<Point3>, (&View, &Motion))| {
            let seen: Vec<Point3> = placed(whole, pose).into_iter().filter(|p| cosine(p) >= least_cosine).collect();
            Stood::new(about(moved), &about(&seen), &eye_about)
        };
        let stood: Vec<Stood> =
            moved.par_iter().zip(wholes.par_iter().zip(&poses)).with_max_len(1).map(stood).collect();
        let reach = stood.iter().flat_map(|view| &view.indexed.points).map(|p| nalgebra::Vector3::from(*p).norm());
        let reach = f64::from(reach.fold(0.0f32, f32::max));
        let mut spacings: Vec<f32> = views.iter().map(|view| view.spacing as f32).collect();
        let spacing = f64::from(median(&mut spacings)?);
        let facing = facing(wholes.first()?).into_iter().map(|direction| poses[0] * direction).collect();
        let world_from_local = moved_poses.iter().map(|pose| nalgebra::Translation3::from(-middle) * pose).collect();
        let resolution = still.resolution as f32;
        Some(Turning { world_from_local, views: stood, middle, eye: eye_about, reach, spacing, facing, resolution })
    }

    /// How much speaks for it that what view j saw stands in view i where `motion` moves it, a point asked: 2 if all agree. Some
    /// `samples` of either view are asked.
    pub fn agreement(&self, i: usize, j: usize, motion: &Motion, samples: usize) -> f64 {
        self.agreement_within(i, j, motion, samples, 0.0)
    }

    /// The same of a motion that may be off by a length.
    pub fn agreement_within(&self, i: usize, j: usize, motion: &Motion, samples: usize, slack: f64) -> f64 {
        let slack = slack as f32;
        let said = self.said(j, i, motion, samples, slack) + self.said(i, j, &motion.inverse(), samples, slack);
        f64::from(said)
    }

    /// What points of one view, moved, say in another.
    fn said(&self, from: usize, to: usize, motion: &Motion, samples: usize, slack: f32) -> f32 {
        let motion = motion.cast::<f32>();
        let rotation = motion.rotation.to_rotation_matrix();
        let (own, other) = (&self.views[from], &self.views[to]);
        let near2 = (TUNING.near * self.spacing as f32 + slack).powi(2);
        let (on, in_front) = (TUNING.on * self.resolution + slack, TUNING.in_front * self.resolution + slack);
        let step = own.indexed.points.len().div_ceil(samples).max(1);
        let (mut asked, mut balance) = (0.0f32, 0.0f32);
        for (point, normal) in own.indexed.points.iter().zip(&own.normals).step_by(step) {
            asked += 1.0;
            let place = rotation * nalgebra::Vector3::from(*point) + motion.translation.vector;
            if let Seen::Surface { height } = other.picture.look(&place)
                && height > in_front
            {
                balance -= TUNING.looked_through;
                continue;
            }
            let Some(target) = other.indexed.tree.nearest(&place.into(), near2) else { continue };
            let (normal, other_normal) = (rotation * normal, other.normals[target.index as usize]);
            let cosine = normal.dot(&other_normal);
            let offset = place - nalgebra::Vector3::from(other.indexed.points[target.index as usize]);
            let mean = normal + other_normal;
            if cosine > TUNING.like && (mean.dot(&offset) / mean.norm()).abs() < on {
                balance += 1.0;
            } else if cosine > TUNING.opposed {
                balance -= 1.0;
            }
        }
        balance / asked.max(1.0)
    }
}

impl Stood {
    /// Of the points of what moved and of all that was `seen` about there.
    fn new(moved: Vec<LocalPoint>, seen: &[LocalPoint], eye: &Vector3) -> Self {
        let eye32 = eye.cast::<f32>();
        let (directions, mut ranges): (Vec<LocalPoint>, Vec<f32>) = seen
            .iter()
            .filter_map(|p| {
                let way = nalgebra::Vector3::from(*p) - eye32;
                Some((LocalPoint::from(way.try_normalize(f32::MIN_POSITIVE)?), way.norm()))
            })
            .unzip();
        let apart = angle_between_rays(&IndexedPoints::new(directions));
        let cell = TUNING.cell * apart * median(&mut ranges).unwrap_or(1.0);
        let mut picture = DepthImage::new(seen, &Sensor::At(*eye), cell.into());
        picture.crop();
        let indexed = IndexedPoints::new(moved);
        let toward = |(point, plane): (&LocalPoint, visage_geometry::normals::LocalPlane)| {
            let normal = nalgebra::Vector3::from(plane.normal);
            if normal.dot(&(eye32 - nalgebra::Vector3::from(*point))) < 0.0 { -normal } else { normal }
        };
        let planes = local_planes(&indexed, &indexed.points, TUNING.neighbours);
        let normals = indexed.points.iter().zip(planes).map(toward).collect();
        Stood { indexed, normals, picture }
    }
}

/// The directions that most of a view's surface faces, in its local frame; the signs are arbitrary.
fn facing(view: &View) -> Vec<Vector3> {
    let step = view.points().len().div_ceil(TUNING.facing_samples).max(1);
    let mut found = Vec::new();
    let normal = |point: &LocalPoint| {
        view.indexed.tree.k_nearest_unordered(point, TUNING.neighbours, 0.0, &mut found);
        nalgebra::Vector3::from(plane_through(view.points(), &found).normal)
    };
    let mut normals: Vec<nalgebra::Vector3<f32>> = view.points().iter().step_by(step).map(normal).collect();
    let least = TUNING.facing_share * normals.len() as f64;
    let mut directions = Vec::new();
    while directions.len() < TUNING.directions {
        let alike = |a: &nalgebra::Vector3<f32>| normals.iter().filter(|b| a.dot(b).abs() > TUNING.facing_like).count();
        let Some((count, direction)) = normals.iter().map(|a| (alike(a), *a)).max_by_key(|(count, _)| *count) else {
            break;
        };
        if (count as f64) < least.max(1.0) {
            break;
        }
        let signed = |b: &&nalgebra::Vector3<f32>| direction.dot(b).abs() > TUNING.facing_like;
        let mean: nalgebra::Vector3<f32> = normals.iter().filter(signed).map(|b| b * direction.dot(b).signum()).sum();
        directions.push(mean.normalize().cast::<f64>());
        normals.retain(|b| direction.dot(b).abs() <= TUNING.facing_like);
    }
    directions
}

/// Balls that turn about an axis before a floor and a wall, for tests: few points of what moved, much of what did not.
#[cfg(test)]
pub(crate) mod balls {
    use super::super::standing_still::from_one_place;
    use super::*;
    use crate::outcome::Outcome;
    use crate::overlap::OverlapMatrix;
    use visage_geometry::Cloud;

    /// Middles, from the axis, and radii.
    const BALLS: [([f64; 3], f64); 4] =
        [([9.0, 0.0, 0.0], 6.0), ([-5.0, 8.0, 2.0], 4.5), ([0.0, -7.0, 6.0], 5.0), ([-2.0, 1.0, -9.0], 3.5)];
    /// A place on the axis.
    const ON_AXIS: Vector3 = Vector3::new(2.0, -1.0, 120.0);

    /// The turn of the balls by an angle about the axis of this direction.
    pub fn turn(direction: &Vector3, angle: f64) -> Motion {
        let rotation = nalgebra::UnitQuaternion::from_scaled_axis(direction.normalize() * angle);
        Motion::from_parts((ON_AXIS - rotation * ON_AXIS).into(), rotation)
    }

    /// What a scanner at the origin sees of the balls, and of all.
    fn seen(turn: &Motion) -> (Vec<Point3>, Vec<Point3>) {
        let (mut moved, mut all) = (Vec::new(), Vec::new());
        for (row, column) in (0..110).flat_map(|row| (0..110).map(move |column| (row, column))) {
            let way = Vector3::new(f64::from(column) / 110.0 - 0.5, f64::from(row) / 110.0 - 0.5, 1.0);
            let on_ball = BALLS.iter().filter_map(|(middle, radius)| {
                let middle = turn * Point3::from(ON_AXIS + Vector3::from(*middle));
                let along = way.dot(&middle.coords) / way.norm_squared();
                let rest = radius * radius - (way * along - middle.coords).norm_squared();
                (rest > 0.0).then(|| along - (rest / way.norm_squared()).sqrt())
            });
            let ball = on_ball.fold(f64::INFINITY, f64::min);
            let wall = if column % 40 < 12 { 180.0 } else { 200.0 };
            let floor = if way.y < 0.0 { -30.0 / way.y } else { f64::INFINITY };
            let place = Point3::from(way * ball.min(wall).min(floor));
            all.push(place);
            if ball < wall.min(floor) {
                moved.push(place);
            }
        }
        (moved, all)
    }

    /// The views of the balls turned by some angles.
    pub fn turning(direction: &Vector3, angles: &[f64]) -> Turning {
        let view = |points: Vec<Point3>| View::new(&Cloud::from_points(points)).expect("a sound scan");
        let (views, wholes): (Vec<View>, Vec<View>) = angles
            .iter()
            .map(|angle| seen(&turn(direction, *angle)))
            .map(|(moved, all)| (view(moved), view(all)))
            .unzip();
        let poses: Vec<Motion> = wholes.iter().map(|whole| whole.local_pose(&Motion::identity())).collect();
        let everywhere = vec![vec![1.0; views.len()]; views.len()];
        let result = Outcome { overlaps: OverlapMatrix::from_rows(everywhere), ..Outcome::at(&poses) };
        let sensors: Vec<Option<Sensor>> = wholes.iter().map(|whole| Some(Sensor::At(-whole.center))).collect();
        let still = from_one_place(&wholes, &sensors, &result, 1.0).expect("they are from one place");
        Turning::of(&still, &views, &wholes).expect("all stand before the background")
    }

    /// The true motion of what moved from where view j has it to where view i has it, about the middle of all that moved.
    pub fn motion(turning: &Turning, direction: &Vector3, [of_i, of_j]: [f64; 2]) -> Motion {
        let middle = nalgebra::Translation3::from(turning.middle);
        middle.inverse() * turn(direction, of_i - of_j) * middle
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thing_agrees_with_itself_where_it_was_turned_and_is_looked_through_elsewhere() {
        let direction = Vector3::new(0.2, 1.0, 0.1);
        let angles = [0.0, 0.7];
        let turning = balls::turning(&direction, &angles);
        let right = balls::motion(&turning, &direction, [angles[0], angles[1]]);
        let said = |motion: &Motion| turning.agreement(0, 1, motion, 200);
        assert!(said(&right) > 0.8, "{}", said(&right));
        let wrong =
            [0.5, -0.5, 2.0, 3.0].map(|angle| said(&(right * balls::motion(&turning, &direction, [angle, 0.0]))));
        assert!(wrong.iter().all(|said| *said < 0.0), "{wrong:?}");
    }

    #[test]
    fn a_background_tells_which_way_its_floor_faces() {
        let turning = balls::turning(&Vector3::y(), &[0.0, 0.7]);
        assert!(turning.facing.iter().any(|direction| direction.y.abs() > 0.999), "{:?}", turning.facing);
    }
}
