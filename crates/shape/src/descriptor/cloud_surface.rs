//! The surface that the points of a cloud are of: places and normals with less noise, and how much area a point stands for.
//!
//! A plane is laid through each point's neighbours of its own side: as many of them as lie in it as far as the cloud's noise lets them. On
//! legs and blades that is few, where more would be of another part; where all there is beside the surface is noise, many. Normals are
//! then averaged over neighbours that agree as far as the cloud's do, so that edges stay edges.

use nalgebra::Matrix3;
use rayon::prelude::*;

use crate::saliency::median;
use crate::saliency::orientation::OrientedCloud;
use visage_geometry::normals::least_spread;
use visage_geometry::{Point3, Vector3};

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Neighbours are of a point's own side if the cosine of their normals is more than this: the back of a thin wall is not, what
        /// goes on beyond an edge is.
        same_side: f64 = -0.5,
        /// Sides that are nearer to each other than so many standard deviations of the noise are one: no one can tell them apart.
        apart: f64 = 2.0,
        /// So many neighbours, the point among them, may make its plane: the most that lie in it,
        neighbours: [usize; 4] = [16, 11, 8, 6],
        /// that is, whose variance across it is less than this many times the noise's: sixteen points of a plane have less in 99 of 100.
        in_plane: f64 = 2.2,
        /// Fewer are taken only as far as noise then turns the plane by no more than this, radians.
        slope: f64 = 0.1,
        /// and where it turns that of the most by more than this, all neighbours count alike (a ball of points has some 0.18). These two, and
        /// how normals agree, were set on clouds of every fourth model of the training half in docs/results/things.md.
        most_slope: f64 = 0.13,
        /// Of few neighbours a plane takes up more of the noise than its three parameters: up to so much of it where noise and spacing are alike.
        noise_of_few: f64 = 3.0,
        /// Averages over neighbours, each of which counts as a power of the cosine of both normals:
        averages: usize = 2,
        /// the one by which the usual cosine counts this much, and at most this one.
        usual: f64 = 0.8,
        agreement: f64 = 8.0,
        /// A point stands for no more than so many times the median point's area: one in the air has no neighbours.
        most_area: f64 = 4.0,
    }
}

/// The surface at the points of a cloud.
pub(super) struct CloudSurface {
    pub points: Vec<Point3>,
    /// Unit normals, of the sides of the cloud's; zero where the neighbours tell none.
    pub normals: Vec<Vector3>,
    /// The area that each point stands for.
    pub areas: Vec<f64>,
}

impl CloudSurface {
    /// That of a cloud. Runs inside the caller's rayon pool.
    pub fn of(cloud: &OrientedCloud) -> CloudSurface {
        let each = |at: &(dyn Fn(usize) -> (Point3, Vector3) + Sync)| -> (Vec<Point3>, Vec<Vector3>) {
            (0..cloud.points.len()).into_par_iter().map(at).unzip()
        };
        let noise2 = noise2(cloud);
        let areas = areas(cloud, noise2);
        let (mut points, mut normals) = each(&|index| plane(cloud, index, noise2));
        let power = agreement(cloud, &normals, noise2);
        for _ in 0..TUNING.averages {
            (points, normals) = each(&|index| averaged(cloud, (&points, &normals), index, noise2, power));
        }
        CloudSurface { points, normals, areas }
    }
}

/// The disc that holds a point's neighbours is there for those of its side.
fn areas(cloud: &OrientedCloud, noise2: f64) -> Vec<f64> {
    let area = |index: usize| {
        let sharing = of_its_side(cloud, &cloud.normals, index, noise2).count().max(1) as f64;
        std::f64::consts::PI * cloud.proximity.farthest(index).powi(2) / sharing
    };
    let mut areas: Vec<f64> = (0..cloud.points.len()).map(area).collect();
    if let Some(usual) = median(areas.clone()) {
        areas.iter_mut().for_each(|area| *area = area.min(TUNING.most_area * usual));
    }
    areas
}

/// The neighbours of a point, itself among them, nearest first, without those of another side: whose normals look the other way and which
/// are farther across the surface than noise may have brought them.
fn of_its_side<'a>(
    cloud: &'a OrientedCloud,
    normals: &'a [Vector3],
    index: usize,
    noise2: f64,
) -> impl Iterator<Item = usize> + 'a {
    let (point, normal) = (cloud.points[index], normals[index]);
    cloud.proximity.of(index).filter(move |other| {
        let across = normal.dot(&(cloud.points[*other] - point));
        normals[*other].dot(&normal) > TUNING.same_side || across * across < TUNING.apart.powi(2) * noise2
    })
}

/// A plane through some neighbours of a point.
struct Plane {
    /// From the point to their mean.
    mean: Vector3,
    normal: Vector3,
    /// Their variance across it, without what its three parameters take up.
    variance: f64,
    /// The sum of their squared distances from their mean along a direction in it.
    lever: f64,
}

impl Plane {
    /// That of the nearest `count`, of offsets from the point.
    fn of(near: &[Vector3], count: usize) -> Plane {
        let mean = near[..count].iter().sum::<Vector3>() / count as f64;
        let moment: Matrix3<f64> = near[..count].iter().map(|p| (p - mean) * (p - mean).transpose()).sum();
        let (normal, spread) = least_spread(&moment);
        let spread = spread.max(0.0);
        Plane { mean, normal, variance: spread / (count as f64 - 3.0), lever: 0.5 * (moment.trace() - spread) }
    }
}

/// From a point to its neighbours of its side, itself among them, nearest first.
fn offsets(cloud: &OrientedCloud, index: usize, noise2: f64) -> Vec<Vector3> {
    of_its_side(cloud, &cloud.normals, index, noise2).map(|other| cloud.points[other] - cloud.points[index]).collect()
}

/// The variance of the points across their surface, of the median point: what the most neighbours have, or so many times what the fewest have
/// where that is less, for there the surface bends more than noise moves points. Infinite where it turns the planes of the most too far to
/// tell sides, edges and narrow parts by: all neighbours then count alike.
fn noise2(cloud: &OrientedCloud) -> f64 {
    let [most, .., fewest] = TUNING.neighbours;
    let usual = |count: usize, of: fn(&Plane) -> f64| {
        let of_point = |index: usize| {
            let near = offsets(cloud, index, 0.0);
            (near.len() >= count).then(|| of(&Plane::of(&near, count)))
        };
        median((0..cloud.points.len()).into_par_iter().filter_map(of_point).collect())
    };
    let of_few = TUNING.noise_of_few * usual(fewest, |plane| plane.variance).unwrap_or(0.0);
    let noise2 = usual(most, |plane| plane.variance).unwrap_or(of_few).min(of_few);
    let is_rough = usual(most, |plane| plane.lever).is_some_and(|lever| noise2 > TUNING.most_slope.powi(2) * lever);
    if is_rough { f64::INFINITY } else { noise2 }
}

/// A point moved into the plane of the most neighbours that lie in one, and its normal.
fn plane(cloud: &OrientedCloud, index: usize, noise2: f64) -> (Point3, Vector3) {
    let (point, normal) = (cloud.points[index], cloud.normals[index]);
    let near = offsets(cloud, index, noise2);
    let mut best = None;
    for count in TUNING.neighbours.into_iter().filter(|count| *count <= near.len()) {
        let Plane { mean, normal, variance, lever } = Plane::of(&near, count);
        let slope = if best.is_some() { TUNING.slope } else { TUNING.most_slope };
        if noise2 > slope * slope * lever {
            break;
        }
        best = Some((mean, normal));
        if variance <= TUNING.in_plane * noise2 {
            break;
        }
    }
    let Some((mean, across)) = best else { return (point, normal) };
    (point + across * across.dot(&mean), if across.dot(&normal) < 0.0 { -across } else { across })
}

/// The power of the cosine between normals that neighbours count as.
fn agreement(cloud: &OrientedCloud, normals: &[Vector3], noise2: f64) -> f64 {
    let of_point = |index: usize| {
        let (sum, count) = of_its_side(cloud, normals, index, noise2)
            .filter(|other| *other != index)
            .fold((0.0, 0.0), |(sum, count), other| (sum + normals[other].dot(&normals[index]).abs(), count + 1.0));
        (count > 0.0).then(|| sum / count)
    };
    let Some(usual) = median((0..cloud.points.len()).into_par_iter().filter_map(of_point).collect()) else {
        return TUNING.agreement;
    };
    if noise2.is_infinite() {
        return 0.0;
    }
    (TUNING.usual.ln() / usual.clamp(0.1, 0.999).ln()).min(TUNING.agreement)
}

/// A point moved to where its neighbours are along its normal, and the mean of their normals.
fn averaged(
    cloud: &OrientedCloud,
    (points, normals): (&[Point3], &[Vector3]),
    index: usize,
    noise2: f64,
    power: f64,
) -> (Point3, Vector3) {
    let (mut facing, mut offset, mut sum) = (Matrix3::zeros(), Vector3::zeros(), 0.0);
    for other in of_its_side(cloud, normals, index, noise2) {
        let weight = normals[other].dot(&normals[index]).abs().powf(power);
        facing += normals[other] * normals[other].transpose() * weight;
        offset += (points[other] - points[index]) * weight;
        sum += weight;
    }
    if sum <= 0.0 {
        return (points[index], normals[index]);
    }
    let eigen = facing.symmetric_eigen();
    let normal = eigen.eigenvectors.column(eigen.eigenvalues.imax()).into_owned();
    let normal = if normal.dot(&normals[index]) < 0.0 { -normal } else { normal };
    (points[index] + normal * (offset.dot(&normal) / sum), normal)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::saliency::orientation::Side;
    use crate::saliency::proximity::Proximity;
    use visage_geometry::progress::Progress;

    fn oriented(points: Vec<Point3>, normals: Vec<Vector3>) -> OrientedCloud {
        let proximity = Proximity::new(&points, &Progress::silent()).expect("not canceled");
        OrientedCloud { points, normals, side: Side::Outward, proximity }
    }

    #[test]
    fn both_sides_of_a_wall_thinner_than_the_spacing_count_and_stay_apart() {
        let place = |k: usize, z: f64| Point3::new((k % 40) as f64, (k / 40) as f64, z);
        let points: Vec<Point3> = (0..3200).map(|k| place(k / 2, 0.3 * (k % 2) as f64)).collect();
        let normals = (0..3200).map(|k| Vector3::z() * if k % 2 == 0 { -1.0 } else { 1.0 }).collect();
        let cloud = oriented(points, normals);
        let surface = CloudSurface::of(&cloud);
        let area: f64 = surface.areas.iter().sum();
        // discs of a grid's neighbours are a little small; shared by both sides they would be half of that
        assert!((0.65..1.2).contains(&(area / 3200.0)), "{area}");
        for ((point, normal), before) in surface.points.iter().zip(&surface.normals).zip(&cloud.points) {
            assert!((point - before).norm() < 1e-6 && normal.z.abs() > 0.999, "{before} {point} {normal}");
        }
    }

    #[test]
    fn an_edge_stays_an_edge() {
        // a floor and a wall that meet at x = 0, z = 0; the rows beside it have too few neighbours of their own
        let side = |k: usize| (0.5 + (k % 20) as f64, (k / 20) as f64);
        let floor = (0..400).map(side).map(|(x, y)| Point3::new(x, y, 0.0));
        let wall = (0..400).map(side).map(|(z, y)| Point3::new(0.0, y, z));
        let points: Vec<Point3> = floor.chain(wall).collect();
        let rounded = Vector3::new(1.0, 0.0, 1.0).normalize();
        let normals = points.iter().map(|p| {
            let is_at_the_edge = p.x + p.z < 1.0;
            if is_at_the_edge {
                rounded
            } else if p.z == 0.0 {
                Vector3::z()
            } else {
                Vector3::x()
            }
        });
        let normals = normals.collect();
        let surface = CloudSurface::of(&oriented(points, normals));
        let faces = [Vector3::z(), Vector3::x()];
        let sharp = (0..800).filter(|k| surface.normals[*k].dot(&faces[k / 400]) > 0.99).count();
        assert!(sharp >= 760, "{sharp} of 800");
    }

    #[test]
    fn nothing_has_no_surface_and_a_point_alone_keeps_its_place() {
        assert!(CloudSurface::of(&oriented(Vec::new(), Vec::new())).areas.is_empty());
        let alone = CloudSurface::of(&oriented(vec![Point3::new(1.0, 2.0, 3.0)], vec![Vector3::zeros()]));
        assert_eq!((alone.points[0], alone.normals[0]), (Point3::new(1.0, 2.0, 3.0), Vector3::zeros()));
    }
}
