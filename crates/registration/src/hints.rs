//! What a person says of scans where machines can't tell: picked points, pairs that overlap, regions to use or leave.
//!
//! Everything is in the scans' own frames and unit. It is checked without the scans, so that nonsense is refused at once.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::pairwise::rigid_fit::RigidFit;
use visage_geometry::{MAX_COORDINATE, Motion, Point3, Unit, Vector3};

/// A place in a scan's own frame.
pub type Place = [f64; 3];

/// The least pairs of picked points that fix a motion.
pub const LEAST_PICKS: usize = 3;
/// The most hints of one kind, and the most pairs of one hint: more are no work of a person.
pub const MOST: usize = 1000;
visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Picked points whose second spread is less than this share of the first lie in a line: the turn about it is free.
        in_line: f64 = 0.05,
        /// Picked points that no motion brings nearer to each other than this share of their spread are not the same places.
        misfit: f64 = 0.25,
    }
}

/// All hints of a registration.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Hints {
    /// Points that are the same place in two scans.
    pub points: Vec<PickedPoints>,
    /// Pairs of scans that overlap.
    pub overlaps: Vec<[String; 2]>,
    /// Parts of scans to use or to leave out.
    pub regions: Vec<RegionHint>,
    /// The units of scans that are in another one than the rest.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub units: BTreeMap<String, Unit>,
}

/// Places that were picked in two scans.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PickedPoints {
    /// One scan,
    pub a: String,
    /// the other one,
    pub b: String,
    /// and the same places in both: first in `a`, then in `b`.
    pub pairs: Vec<[Place; 2]>,
}

/// A part of a scan: exactly one of `use` and `leave` is there.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RegionHint {
    /// The scan.
    pub scan: String,
    /// Only what lies in such regions of the scan is used.
    #[serde(rename = "use", default, skip_serializing_if = "Option::is_none")]
    pub only: Option<Region>,
    /// What lies here is left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub leave: Option<Region>,
}

/// A part of space: exactly one of both is there.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Region {
    /// A box along the axes.
    #[serde(rename = "box", default, skip_serializing_if = "Option::is_none")]
    pub cuboid: Option<Cuboid>,
    /// A ball.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sphere: Option<Sphere>,
}

/// A box along the axes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cuboid {
    /// Its corner with the least coordinates,
    pub min: Place,
    /// and that with the largest.
    pub max: Place,
}

/// A ball.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sphere {
    /// Its middle.
    pub center: Place,
    /// Its radius.
    pub radius: f64,
}

/// Why hints can't be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{message}")]
pub struct HintError {
    /// The scan concerned, if it is one.
    pub scan: Option<String>,
    /// What is wrong.
    pub message: String,
    /// What to do about it.
    pub remedy: &'static str,
}

impl Hints {
    /// Whether nothing is said.
    pub fn is_empty(&self) -> bool {
        *self == Hints::default()
    }

    /// Checks what can be checked without the scans, which have these names.
    pub fn check(&self, names: &[&str]) -> Result<(), HintError> {
        for (what, count) in
            [("points", self.points.len()), ("overlaps", self.overlaps.len()), ("regions", self.regions.len())]
        {
            if count > MOST {
                let message = format!("the hints hold {count} {what}, at most {MOST} are read");
                return Err(HintError { scan: None, message, remedy: "give those that matter" });
            }
        }
        let named = self.points.iter().map(|picked| (&picked.a, &picked.b));
        for (a, b) in named.chain(self.overlaps.iter().map(|[a, b]| (a, b))) {
            known(a, names)?;
            known(b, names)?;
            if a == b {
                let message = format!("a hint names {a} twice: it is about two scans");
                return Err(HintError { scan: Some(a.clone()), message, remedy: "name two different scans" });
            }
        }
        for (name, unit) in &self.units {
            known(name, names)?;
            if *unit == Unit::Unknown {
                let message = format!("the hints say that the unit of {name} is unknown");
                return Err(HintError { scan: Some(name.clone()), message, remedy: "say mm, cm, m or in" });
            }
        }
        self.points.iter().try_for_each(PickedPoints::check)?;
        self.regions.iter().try_for_each(|region| {
            known(&region.scan, names)?;
            region.check()
        })
    }

    /// Whether a point of a scan is used; `None` if nothing is said of that scan.
    pub fn filter(&self, scan: &str) -> Option<impl Fn(&Point3) -> bool> {
        let of_scan: Vec<&RegionHint> = self.regions.iter().filter(|region| region.scan == scan).collect();
        let only: Vec<&Region> = of_scan.iter().filter_map(|region| region.only.as_ref()).collect();
        let left: Vec<&Region> = of_scan.iter().filter_map(|region| region.leave.as_ref()).collect();
        (!of_scan.is_empty()).then_some(move |point: &Point3| {
            (only.is_empty() || only.iter().any(|region| region.holds(point)))
                && !left.iter().any(|region| region.holds(point))
        })
    }

    /// Multiplies the lengths in what is said of places in a scan.
    pub fn scale(&mut self, scan: &str, factor: f64) {
        let scale = |place: &mut Place| place.iter_mut().for_each(|x| *x *= factor);
        for picked in &mut self.points {
            for (side, name) in [(0, &picked.a), (1, &picked.b)] {
                if name == scan {
                    picked.pairs.iter_mut().for_each(|pair| scale(&mut pair[side]));
                }
            }
        }
        for hint in self.regions.iter_mut().filter(|hint| hint.scan == scan) {
            for region in hint.only.iter_mut().chain(&mut hint.leave) {
                if let Some(Cuboid { min, max }) = &mut region.cuboid {
                    scale(min);
                    scale(max);
                }
                if let Some(Sphere { center, radius }) = &mut region.sphere {
                    scale(center);
                    *radius *= factor;
                }
            }
        }
    }

    /// Lets what is said of `copy` be said of the scan `of`, which has the same points; `of_from_copy` maps the frame of
    /// the first into that of the second.
    pub fn adopt(&mut self, of: &str, copy: &str, of_from_copy: &Motion) {
        let moved = |place: Place| -> Place { (of_from_copy * Point3::from(place)).coords.into() };
        let rename = |name: &mut String| {
            let is_copy = name == copy;
            if is_copy {
                *name = of.to_owned();
            }
            is_copy
        };
        for picked in &mut self.points {
            let is_copy = [rename(&mut picked.a), rename(&mut picked.b)];
            for pair in &mut picked.pairs {
                pair.iter_mut().zip(is_copy).filter(|(_, is)| *is).for_each(|(place, _)| *place = moved(*place));
            }
        }
        self.overlaps.iter_mut().flatten().for_each(|name| {
            rename(name);
        });
        self.points.retain(|picked| picked.a != picked.b);
        self.overlaps.retain(|[a, b]| a != b);
    }
}

impl PickedPoints {
    fn check(&self) -> Result<(), HintError> {
        let Self { a, b, pairs } = self;
        let refused = |message, remedy| Err(HintError { scan: Some(b.clone()), message, remedy });
        if pairs.len() < LEAST_PICKS {
            let message = format!(
                "{} pair(s) of points are picked in {a} and {b}, at least {LEAST_PICKS} fix a motion",
                pairs.len()
            );
            return refused(message, "pick more places that are seen in both scans, not all in a line");
        }
        if pairs.len() > MOST {
            let message = format!("{} pairs of points are picked in {a} and {b}, at most {MOST} are read", pairs.len());
            return refused(message, "give the clearest ones");
        }
        if let Some(place) = pairs.iter().flatten().find(|place| !is_sound(place)) {
            let message = format!("a point picked in {a} and {b} lies at {place:?}");
            return refused(message, "give coordinates up to 1e12 in the scan's own frame and unit");
        }
        for (side, name) in [(0, a), (1, b)] {
            let (first, second) = spreads(pairs.iter().map(|pair| pair[side]));
            if second <= TUNING.in_line * first {
                let message = format!("the points picked in {name} (with {a} and {b}) lie in one place or in a line");
                let remedy = "pick at least one place off that line: the turn about it is not fixed";
                return Err(HintError { scan: Some(name.clone()), message, remedy });
            }
        }
        let fit = PickFit::of(pairs);
        let spread = spreads(pairs.iter().map(|pair| pair[0])).0;
        if fit.is_none_or(|fit| fit.rms > TUNING.misfit * spread) {
            let rms = fit.map_or(f64::INFINITY, |fit| fit.rms);
            let message = format!(
                "no motion brings the points picked in {a} and {b} onto each other: they stay {rms:.3} apart, and are \
                 spread by {spread:.3}"
            );
            return refused(message, "check that each pair is one place, first in a, then in b, and the unit of both");
        }
        Ok(())
    }
}

/// The motion that picked points fix.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PickFit {
    /// Maps the second frame into the first.
    pub a_from_b: Motion,
    /// Root mean square distance of the pairs after it.
    pub rms: f64,
}

impl PickFit {
    /// The motion that brings the second of each pair onto the first.
    pub fn of(pairs: &[[Place; 2]]) -> Option<PickFit> {
        let middle = |side: usize| {
            pairs.iter().map(|pair| Vector3::from(pair[side])).sum::<Vector3>() / pairs.len().max(1) as f64
        };
        let [middle_a, middle_b] = [middle(0), middle(1)];
        let mut fit = RigidFit::default();
        for [a, b] in pairs {
            let [a, b] = [Vector3::from(*a) - middle_a, Vector3::from(*b) - middle_b].map(|v| v.cast::<f32>());
            fit.add(&b.into(), &a.into());
        }
        let turned = fit.solve()?;
        let a_from_b = nalgebra::Translation3::from(middle_a) * turned * nalgebra::Translation3::from(-middle_b);
        Some(PickFit { a_from_b, rms: pick_distances(pairs, &a_from_b).0 })
    }

    /// The error of a single pick that such a misfit of so many pairs shows: six of their coordinates are used up.
    pub fn pick_error(&self, pairs: usize) -> f64 {
        let n = pairs as f64;
        self.rms * (3.0 * n / (3.0 * n - 6.0).max(1.0)).sqrt()
    }
}

/// Root mean square and largest distance of the pairs at a motion that maps the second frame into the first.
pub fn pick_distances(pairs: &[[Place; 2]], a_from_b: &Motion) -> (f64, f64) {
    let distance2 = |[a, b]: &[Place; 2]| (a_from_b * Point3::from(*b) - Point3::from(*a)).norm_squared();
    let squares: Vec<f64> = pairs.iter().map(distance2).collect();
    let mean = squares.iter().sum::<f64>() / squares.len().max(1) as f64;
    (mean.sqrt(), squares.iter().fold(0.0f64, |most, square| most.max(*square)).sqrt())
}

impl RegionHint {
    fn check(&self) -> Result<(), HintError> {
        let refused = |message: &str, remedy| {
            let message = format!("a region of {} {message}", self.scan);
            Err(HintError { scan: Some(self.scan.clone()), message, remedy })
        };
        let region = match (&self.only, &self.leave) {
            (Some(region), None) | (None, Some(region)) => region,
            _ => return refused("is not either `use` or `leave`", "give one of both for each region"),
        };
        match (&region.cuboid, &region.sphere) {
            (Some(Cuboid { min, max }), None) => {
                if !(is_sound(min) && is_sound(max) && min.iter().zip(max).all(|(min, max)| min <= max)) {
                    return refused(
                        "is a box without an inside",
                        "give `min` with the smaller coordinates, up to 1e12",
                    );
                }
            }
            (None, Some(Sphere { center, radius })) => {
                if !(is_sound(center) && *radius > 0.0 && *radius <= MAX_COORDINATE) {
                    return refused("is a sphere without an inside", "give a `radius` above 0, and places up to 1e12");
                }
            }
            _ => return refused("is not either a `box` or a `sphere`", "give one of both for each region"),
        }
        Ok(())
    }
}

impl Region {
    fn holds(&self, point: &Point3) -> bool {
        let in_box = |Cuboid { min, max }: &Cuboid| (0..3).all(|k| min[k] <= point[k] && point[k] <= max[k]);
        let in_sphere = |ball: &Sphere| (point - Point3::from(ball.center)).norm() <= ball.radius;
        self.cuboid.as_ref().is_some_and(in_box) || self.sphere.as_ref().is_some_and(in_sphere)
    }
}

fn known(name: &str, names: &[&str]) -> Result<(), HintError> {
    if names.contains(&name) {
        return Ok(());
    }
    let message = format!("the hints name {name:?}, which is none of the scans");
    Err(HintError { scan: Some(name.to_owned()), message, remedy: "name scans as their files are called" })
}

fn is_sound(place: &Place) -> bool {
    place.iter().all(|x| x.abs() <= MAX_COORDINATE)
}

/// The first and the second principal spread of some places.
fn spreads(places: impl Iterator<Item = Place> + Clone) -> (f64, f64) {
    let count = places.clone().count().max(1) as f64;
    let middle = places.clone().map(Vector3::from).sum::<Vector3>() / count;
    let scatter: nalgebra::Matrix3<f64> =
        places.map(|place| Vector3::from(place) - middle).map(|d| d * d.transpose()).sum();
    let mut eigenvalues: Vec<f64> = (scatter / count).symmetric_eigenvalues().iter().copied().collect();
    eigenvalues.sort_by(f64::total_cmp);
    (eigenvalues[2].max(0.0).sqrt(), eigenvalues[1].max(0.0).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    const NAMES: [&str; 2] = ["a.ply", "b.ply"];

    fn hints(text: &str) -> Hints {
        serde_json::from_str(text).expect("hints")
    }

    fn picked(pairs: &[[Place; 2]]) -> Hints {
        let points = vec![PickedPoints { a: "a.ply".into(), b: "b.ply".into(), pairs: pairs.to_vec() }];
        Hints { points, ..Hints::default() }
    }

    fn refused(hints: &Hints) -> String {
        let error = hints.check(&NAMES).expect_err("unusable");
        assert!(!error.remedy.is_empty());
        error.message
    }

    #[test]
    fn three_pairs_fix_a_motion_and_their_misfit_is_told() {
        let truth = Motion::new(Vector3::new(4e6, -2.0, 9.0), Vector3::new(0.3, -1.1, 2.0));
        let places = [[1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 3.0], [1.0, 1.0, 1.0]];
        let pairs: Vec<[Place; 2]> = places.iter().map(|b| [(truth * Point3::from(*b)).coords.into(), *b]).collect();
        let fit = PickFit::of(&pairs[..3]).expect("three pairs");
        assert!((fit.a_from_b.rotation.inverse() * truth.rotation).angle() < 1e-4 && fit.rms < 1e-3, "{fit:?}");
        assert_eq!(picked(&pairs).check(&NAMES), Ok(()));
        let mut off = pairs.clone();
        off[3][0][0] += 0.4;
        let fit = PickFit::of(&off).expect("four pairs");
        assert!(fit.rms > 0.02 && pick_distances(&off, &truth).1 > 0.39, "{fit:?}");
        assert!(fit.pick_error(4) > fit.rms);
    }

    #[test]
    fn what_fixes_no_motion_is_refused_with_a_remedy() {
        let pair = |x: f64, y: f64| [[x, y, 0.0], [x, y, 1.0]];
        assert!(refused(&picked(&[pair(0.0, 0.0), pair(1.0, 0.0)])).contains("at least 3"));
        assert!(refused(&picked(&[pair(0.0, 0.0), pair(1.0, 0.0), pair(5.0, 0.01)])).contains("in a line"));
        assert!(refused(&picked(&[pair(0.0, 0.0), pair(1.0, 0.0), pair(0.0, f64::NAN)])).contains("lies at"));
        let swapped = [[[0.0; 3], [9.0, 0.0, 0.0]], [[9.0, 0.0, 0.0], [0.0; 3]], [[0.0, 5.0, 0.0], [9.0, 5.0, 0.0]]];
        assert_eq!(picked(&swapped).check(&NAMES), Ok(()), "a half turn explains those");
        let mixed = [[[0.0; 3], [9.0, 0.0, 0.0]], [[9.0, 0.0, 0.0], [9.5, 0.0, 1.0]], [[0.0, 5.0, 0.0], [0.0; 3]]];
        assert!(refused(&picked(&mixed)).contains("no motion"));
    }

    #[test]
    fn names_and_regions_are_checked() {
        assert!(refused(&hints(r#"{"overlaps": [["a.ply", "c.ply"]]}"#)).contains("c.ply"));
        assert!(refused(&hints(r#"{"overlaps": [["a.ply", "a.ply"]]}"#)).contains("twice"));
        assert!(refused(&hints(r#"{"regions": [{"scan": "a.ply"}]}"#)).contains("either"));
        assert!(refused(&hints(r#"{"regions": [{"scan": "a.ply", "use": {}}]}"#)).contains("either"));
        let inside_out = r#"{"regions": [{"scan": "a.ply", "leave": {"box": {"min": [1,0,0], "max": [0,1,1]}}}]}"#;
        assert!(refused(&hints(inside_out)).contains("box"));
        let empty = r#"{"regions": [{"scan": "b.ply", "leave": {"sphere": {"center": [0,0,0], "radius": 0}}}]}"#;
        assert!(refused(&hints(empty)).contains("sphere"));
        assert!(serde_json::from_str::<Hints>(r#"{"point": []}"#).is_err(), "unknown fields are no hints");
    }

    #[test]
    fn regions_keep_what_they_say() {
        let hints = hints(
            r#"{"regions": [
                {"scan": "a.ply", "use": {"box": {"min": [0,0,0], "max": [4,4,4]}}},
                {"scan": "a.ply", "use": {"sphere": {"center": [9,0,0], "radius": 1}}},
                {"scan": "a.ply", "leave": {"sphere": {"center": [0,0,0], "radius": 1}}}]}"#,
        );
        assert_eq!(hints.check(&NAMES), Ok(()));
        let is_used = hints.filter("a.ply").expect("something is said of it");
        let used = [[2.0, 2.0, 2.0], [9.5, 0.0, 0.0], [0.5, 0.0, 0.0], [6.0, 0.0, 0.0]].map(|p| is_used(&p.into()));
        assert_eq!(used, [true, true, false, false]);
        assert!(hints.filter("b.ply").is_none());
    }

    #[test]
    fn what_is_said_of_a_copy_is_said_of_its_original() {
        let mut hints = hints(
            r#"{"points": [{"a": "c.ply", "b": "b.ply", "pairs": [[[0,0,0],[1,1,1]]]}],
                "overlaps": [["c.ply", "a.ply"], ["c.ply", "b.ply"]]}"#,
        );
        hints.adopt("a.ply", "c.ply", &Motion::translation(5.0, 0.0, 0.0));
        assert_eq!(hints.points[0].a, "a.ply");
        assert_eq!(hints.points[0].pairs, [[[5.0, 0.0, 0.0], [1.0, 1.0, 1.0]]]);
        assert_eq!(hints.overlaps, [["a.ply".to_owned(), "b.ply".to_owned()]]);
    }
}
