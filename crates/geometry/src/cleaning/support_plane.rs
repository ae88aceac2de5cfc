//! Turntable, floor and wall: large planes with nothing behind them, about an object that stands before them.
//!
//! A face of the object may be as large and as flat, and have the rest of the object before it, as the bottom of a crate
//! has. But it does not go on beyond the rest all around, as a floor goes on about what stands on it.

use std::f64::consts::TAU;

use super::coarse_scan::CoarseScan;
use crate::Vector3;
use crate::neighbours::LocalPoint;
use crate::normals::least_spread;

/// Tells the direction from a point to the scanner.
pub type ToScanner<'a> = &'a dyn Fn(&LocalPoint) -> Vector3;

/// A plane with nothing of the object on it or behind it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Support {
    /// Unit normal, towards the object (local frame).
    pub normal: Vector3,
    /// `normal . p` of its points.
    pub offset: f64,
    /// What lies no farther than this before the plane belongs to it, a length.
    pub reach: f64,
}

/// Supports of a scan at most: a floor and two walls.
pub const MOST: usize = 3;
/// Surfels from which a plane is sought.
const SEEDS: usize = 150;
/// Distances from a plane of the surfels that it is fitted to, in edges, step by step.
const FITS: [f64; 4] = [1.0, 0.6, 0.35, 0.25];
/// Cosine of the normals of a plane's surfels.
const LIKE: f64 = 0.92;
/// A plane is large from this share of the surfels on.
const LARGE: f64 = 0.12;
/// Of the surfels beside a support no more than this share may lie behind it, counted in those on it: the rim of a table.
const BEHIND: f64 = 0.2;
/// How far before a plane its points may lie: so many of its own root mean square heights,
const FLAT: f64 = 4.0;
/// range accuracies,
const NOISE: f64 = 5.0;
/// and spacings at least.
const LEAST_REACH: f64 = 0.75;
/// What stands before a support is at least this share of the surfels.
const LEAST_OBJECT: f64 = 0.03;
/// Directions about the object in which a support should go on beyond it,
const SECTORS: usize = 36;
/// and in which share of them it has to,
pub const AROUND: f64 = 0.6;
/// and where the set is known to have one.
pub const AROUND_IF_EXPECTED: f64 = 0.45;
/// It goes on if it reaches this many edges beyond the object.
const BEYOND: f64 = 2.0;

impl Support {
    /// How far a place lies before the plane; negative: behind.
    fn height(&self, place: &Vector3) -> f64 {
        self.normal.dot(place) - self.offset
    }

    /// Whether what lies there is part of the support, or behind it.
    pub fn holds(&self, place: &Vector3) -> bool {
        self.height(place) < self.reach
    }

    /// Whether the scanner stood before it.
    fn faces(&self, coarse: &CoarseScan, to_scanner: ToScanner) -> bool {
        let Some(nearest) =
            (0..coarse.count()).find(|surfel| self.height(&coarse.position(*surfel)).abs() < self.reach)
        else {
            return false;
        };
        self.normal.dot(&to_scanner(&coarse.points[nearest])) > 0.0
    }

    fn has(&self, coarse: &CoarseScan, surfel: usize, tolerance: f64) -> bool {
        self.height(&coarse.position(surfel)).abs() < tolerance && coarse.normals[surfel].dot(&self.normal).abs() > LIKE
    }
}

/// Surfels that follow each other, to which the plane of a seed is fitted at first sight.
const WINDOW: usize = 13;
/// Every few surfels are enough to pass most seeds over.
const FEW: usize = 4;
/// At first sight a plane is large from this share of [`LARGE`] on,
const NEARLY_LARGE: f64 = 0.8;
/// and has next to nothing behind it up to so many times [`BEHIND`].
const NEARLY_BEHIND: f64 = 1.5;

/// Whether a large plane with hardly anything behind it is to be expected, at first sight: no normals are needed. A
/// support has so many seeds on it, and is so much larger than this asks, that none goes unseen.
pub fn may_have_support(coarse: &CoarseScan) -> bool {
    let count = coarse.count();
    let places: Vec<Vector3> = (0..count).map(|surfel| coarse.position(surfel)).collect();
    let few: Vec<Vector3> = places.iter().step_by(FEW).copied().collect();
    let is_bounding = |plane: &Support, places: &[Vector3], tolerance: f64| {
        let (on, before) = places.iter().map(|place| plane.height(place)).fold((0, 0), |(on, before), height| {
            (on + usize::from(height.abs() < tolerance), before + usize::from(height >= tolerance))
        });
        let behind = (places.len() - on - before).min(before) as f64;
        on as f64 >= NEARLY_LARGE * LARGE * places.len() as f64 && behind <= NEARLY_BEHIND * BEHIND * on as f64
    };
    let seems_bounding = |window: &[Vector3]| {
        let Some(mut plane) = fitted(window).filter(|plane| is_bounding(plane, &few, FITS[0] * coarse.edge)) else {
            return false;
        };
        for tolerance in FITS {
            let is_on = |place: &&Vector3| plane.height(place).abs() < tolerance * coarse.edge;
            let on: Vec<Vector3> = places.iter().filter(is_on).copied().collect();
            let Some(closer) = fitted(&on) else { return false };
            plane = closer;
        }
        is_bounding(&plane, &places, FITS[FITS.len() - 1] * coarse.edge)
    };
    // all that follow each other near the seed lie on its plane, but at the plane's border
    places.windows(WINDOW).step_by(count.div_ceil(SEEDS).max(1)).any(seems_bounding)
}

/// The planes, `most` at the most, that the object of a scan stands on or before; each has to go on beyond it in this
/// share of the directions.
pub fn supports(coarse: &CoarseScan, candidates: &[Support], around: f64, most: usize) -> Vec<Support> {
    // a voxel where two planes meet, or the object and a plane, lies off both
    let near = FITS[1] * coarse.edge;
    let is_on = |surfel: usize, planes: &[Support]| {
        planes.iter().any(|plane| plane.height(&coarse.position(surfel)) < plane.reach.max(near))
    };
    // with all of them taken away the object is left; where that is nothing, some of them are the object's own
    let is_about = |taken: &Vec<Support>| {
        let object: Vec<usize> = (0..coarse.count()).filter(|surfel| !is_on(*surfel, taken)).collect();
        object.len() as f64 >= LEAST_OBJECT * coarse.count() as f64
            && taken.iter().all(|plane| share_around(coarse, plane, &object) >= around)
    };
    selections(candidates).into_iter().filter(|taken| taken.len() <= most).find(is_about).unwrap_or_default()
}

/// All ways to choose some of the planes, most first, the earlier ones first.
fn selections(planes: &[Support]) -> Vec<Vec<Support>> {
    let chosen = |mask: usize| planes.iter().enumerate().filter(|(k, _)| mask >> k & 1 == 1).map(|(_, p)| *p).collect();
    let mut all: Vec<Vec<Support>> = (1..1usize << planes.len()).map(chosen).collect();
    all.sort_by_key(|chosen| std::cmp::Reverse(chosen.len()));
    all
}

/// Large planes with hardly anything behind them as seen by the scanner, the largest first.
pub fn bounding_planes(coarse: &CoarseScan, to_scanner: Option<ToScanner>) -> Vec<Support> {
    let mut free: Vec<usize> =
        (0..coarse.count()).filter(|surfel| coarse.normals[*surfel] != Vector3::zeros()).collect();
    let least = (LARGE * coarse.count() as f64).max(20.0) as usize;
    let mut found = Vec::new();
    // a few more than are wanted: faces of the object may be larger
    for _ in 0..2 * MOST {
        let Some((plane, members)) = largest_plane(coarse, &free).filter(|(_, members)| members.len() >= least) else {
            break;
        };
        free.retain(|surfel| !members.contains(surfel));
        if let Some(support) = bounding(coarse, plane, members.len())
            && to_scanner.is_none_or(|to_scanner| support.faces(coarse, to_scanner))
            && found.len() < MOST
        {
            found.push(support);
        }
    }
    found
}

/// The plane that holds most of the `free` surfels, with those in order.
fn largest_plane(coarse: &CoarseScan, free: &[usize]) -> Option<(Support, Vec<usize>)> {
    let members = |plane: &Support, tolerance: f64| -> Vec<usize> {
        free.iter().copied().filter(|surfel| plane.has(coarse, *surfel, tolerance)).collect()
    };
    let step = free.len().div_ceil(SEEDS).max(1);
    let seed_plane = |surfel: &usize| {
        let normal = coarse.normals[*surfel];
        Support { normal, offset: normal.dot(&coarse.position(*surfel)), reach: 0.0 }
    };
    let count = |plane: &Support| free.iter().filter(|s| plane.has(coarse, **s, FITS[0] * coarse.edge)).count();
    let seeds = free.iter().step_by(step).map(seed_plane);
    let (_, mut plane) = seeds.map(|plane| (count(&plane), plane)).max_by_key(|(count, _)| *count)?;
    let mut on = members(&plane, FITS[0] * coarse.edge);
    for tolerance in FITS {
        plane = fitted(&on.iter().map(|surfel| coarse.position(*surfel)).collect::<Vec<_>>())?;
        on = members(&plane, tolerance * coarse.edge);
    }
    Some((plane, on))
}

/// The plane of places, with the root mean square height of them as its reach.
fn fitted(places: &[Vector3]) -> Option<Support> {
    if places.len() < 3 {
        return None;
    }
    let count = places.len() as f64;
    let mean = places.iter().sum::<Vector3>() / count;
    let mut scatter = nalgebra::Matrix3::zeros();
    for place in places {
        let d = place - mean;
        scatter += d * d.transpose();
    }
    let (normal, spread) = least_spread(&(scatter / count));
    Some(Support { normal, offset: normal.dot(&mean), reach: spread.max(0.0).sqrt() })
}

/// The plane with its normal towards what lies before it, if next to nothing lies behind. Until then `reach` is the
/// root mean square height of its surfels.
fn bounding(coarse: &CoarseScan, plane: Support, members: usize) -> Option<Support> {
    let off = FITS[FITS.len() - 1] * coarse.edge;
    let heights = (0..coarse.count()).map(|surfel| plane.height(&coarse.position(surfel)));
    let (before, behind) = heights.fold((0, 0), |(before, behind), height| {
        (before + usize::from(height > off), behind + usize::from(height < -off))
    });
    let sign = if behind > before { -1.0 } else { 1.0 };
    let reach = (FLAT * plane.reach).max(NOISE * coarse.range_accuracy).max(LEAST_REACH * coarse.spacing);
    let plane = Support { normal: plane.normal * sign, offset: plane.offset * sign, reach };
    (before.min(behind) as f64 <= BEHIND * members as f64).then_some(plane)
}

/// In which share of the directions along it the plane reaches beyond the object.
fn share_around(coarse: &CoarseScan, plane: &Support, object: &[usize]) -> f64 {
    let across = plane.normal.cross(&Vector3::ith(plane.normal.iamin(), 1.0)).normalize();
    let along = plane.normal.cross(&across);
    let project = |surfel: usize| {
        let place = coarse.position(surfel);
        nalgebra::Vector2::new(place.dot(&across), place.dot(&along))
    };
    let middle = object.iter().map(|surfel| project(*surfel)).sum::<nalgebra::Vector2<f64>>() / object.len() as f64;
    let farthest = |surfels: &mut dyn Iterator<Item = usize>| {
        let mut radii = [0.0f64; SECTORS];
        for surfel in surfels {
            let offset = project(surfel) - middle;
            let sector = (offset.y.atan2(offset.x).rem_euclid(TAU) / TAU * SECTORS as f64) as usize % SECTORS;
            radii[sector] = radii[sector].max(offset.norm());
        }
        radii
    };
    let of_object = farthest(&mut object.iter().copied());
    let of_plane = farthest(&mut (0..coarse.count()).filter(|s| plane.has(coarse, *s, FITS[1] * coarse.edge)));
    let beyond = of_plane.iter().zip(&of_object).filter(|(plane, object)| **plane > **object + BEYOND * coarse.edge);
    beyond.count() as f64 / SECTORS as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Point3;
    use crate::neighbours::IndexedPoints;

    /// Points 2 mm apart; the scanner stood far off along `toward`.
    fn found(points: Vec<Point3>, toward: Option<Vector3>) -> Vec<Support> {
        let middle = points.iter().map(|p| p.coords).sum::<Vector3>() / points.len() as f64;
        let indexed = IndexedPoints::new(points.iter().map(|p| (p.coords - middle).cast::<f32>().into()).collect());
        let coarse = CoarseScan::new(&indexed.points, 2.0, 0.0).with_normals(&indexed);
        let toward = toward.map(|toward| move |_: &LocalPoint| toward);
        let candidates = bounding_planes(&coarse, toward.as_ref().map(|toward| toward as ToScanner));
        supports(&coarse, &candidates, AROUND, MOST)
    }

    fn grid(place: impl Fn(f64, f64) -> Option<Point3>) -> Vec<Point3> {
        let steps = || (-50..=50).map(|k| 2.0 * f64::from(k));
        steps().flat_map(|x| steps().map(move |y| (x, y))).filter_map(|(x, y)| place(x, y)).collect()
    }

    fn dome_on_floor() -> Vec<Point3> {
        grid(|x, y| Some(Point3::new(x, y, (900.0 - x * x - y * y).max(0.0).sqrt())))
    }

    #[test]
    fn a_floor_about_a_dome_is_a_support_as_long_as_it_faces_the_scanner() {
        let [support] = found(dome_on_floor(), None)[..] else { panic!("there is one floor") };
        assert!(support.normal.z > 0.999, "towards the dome");
        assert_eq!(found(dome_on_floor(), Some(Vector3::z())).len(), 1);
        assert!(found(dome_on_floor(), Some(-Vector3::z())).is_empty(), "seen from below it is a lid");
    }

    #[test]
    fn a_wall_behind_and_a_floor_below_are_two() {
        let mut points = grid(|x, y| (x.hypot(y) > 30.0).then(|| Point3::new(x, y, 0.0)));
        points.extend(grid(|x, z| (z > -94.0).then(|| Point3::new(x, 100.0, z + 96.0))));
        // well above the floor: what stands low before a wall is bounded by the floor
        let dome = dome_on_floor().into_iter().filter(|p| p.z > 0.0);
        points.extend(dome.map(|p| Point3::new(p.x, p.y, p.z + 60.0)));
        assert_eq!(found(points, None).len(), 2);
    }

    #[test]
    fn angles_trays_and_bare_planes_are_objects() {
        assert!(found(grid(|x, y| Some(Point3::new(x, y, 0.0))), None).is_empty());
        let mut angle = grid(|x, y| Some(Point3::new(x, y, 0.0)));
        angle.extend(grid(|x, z| (z > -98.0).then(|| Point3::new(x, 100.0, z + 100.0))));
        assert!(found(angle, None).is_empty());
        let tray = grid(|x, y| Some(Point3::new(x, y, 0.5 * (x.abs().max(y.abs()) - 70.0).max(0.0))));
        assert!(found(tray, None).is_empty());
    }
}
