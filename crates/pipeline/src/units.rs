//! The unit of a set: what the user says, else what the files declare; and scans that seem to be in another one.

use std::collections::BTreeMap;

use super::{NamedScan, PipelineError, PoseMatrix, RegisteredModel, Start};
use visage_formats::DeclaredUnit;
use visage_formats::written::scaled;
use visage_geometry::Unit;
use visage_registration::quality::Finding;
use visage_registration::view::View;

/// The unit in which the scans of a set are registered.
#[derive(Debug, Clone, PartialEq)]
pub struct Settled {
    /// The unit of all scans.
    pub unit: Unit,
    /// For each scan what its lengths are multiplied by, 1 for most.
    pub factors: Vec<f64>,
    /// What the user should know of it.
    pub notes: Vec<String>,
    /// The matrices of a model that scans are added to, as they were before the scans were converted.
    base: BTreeMap<String, PoseMatrix>,
}

/// Settles the unit of scans that declare these. What is given counts; else what is declared, if there is no doubt; scans
/// in several units are to be converted, and so are those of which a person `said` the unit.
///
/// # Errors
/// [`PipelineError::Unusable`] if the unit of some scans is said, but nothing tells that of the others.
pub fn settle(
    given: Option<Unit>,
    scans: &[(&str, Option<DeclaredUnit>)],
    said: &BTreeMap<String, Unit>,
) -> Result<Settled, PipelineError> {
    let mut settled = settle_declared(given, scans, said);
    if said.is_empty() {
        return Ok(settled);
    }
    let Some(mm) = settled.unit.in_mm() else {
        return Err(PipelineError::Unusable {
            code: super::hints::CODE,
            scan: said.keys().next().cloned(),
            message: "the unit of some scans is said, but not that of the others".into(),
            hint: "say the unit of the set, too (--unit, or unit of the scan set)".into(),
        });
    };
    for (factor, (name, _)) in settled.factors.iter_mut().zip(scans) {
        if let Some((unit, of_scan)) = said.get(*name).and_then(|unit| Some((unit, unit.in_mm()?))) {
            *factor = of_scan / mm;
            let (own, all) = (unit.name(), settled.unit.name());
            settled.notes.push(format!("{name} is in {own}, as was said: its lengths are converted to {all}"));
        }
    }
    Ok(settled)
}

fn settle_declared(
    given: Option<Unit>,
    scans: &[(&str, Option<DeclaredUnit>)],
    said: &BTreeMap<String, Unit>,
) -> Settled {
    let is_said = |name: &str| said.contains_key(name);
    let declared: Vec<(&str, DeclaredUnit)> =
        scans.iter().filter(|(name, _)| !is_said(name)).filter_map(|(name, unit)| Some((*name, (*unit)?))).collect();
    let ones = vec![1.0; scans.len()];
    if let Some(unit) = given {
        let other = declared.iter().filter(|(_, declared)| declared.unit() != Some(unit));
        let others: Vec<_> = other.collect();
        let note = others.first().map(|(name, declared)| {
            let (count, words) = (others.len(), in_words(*declared));
            format!(
                "{count} scans declare another unit than {}, such as {name} ({words}): what is given counts",
                unit.name()
            )
        });
        return Settled { unit, factors: ones, notes: note.into_iter().collect(), base: BTreeMap::new() };
    }
    let Some((first, of_first)) = declared.first() else {
        return Settled { unit: Unit::Unknown, factors: ones, notes: Vec::new(), base: BTreeMap::new() };
    };
    let unit = declared.iter().find_map(|(_, declared)| declared.unit()).unwrap_or(Unit::M);
    let metres = unit.in_mm().map_or(1.0, |mm| mm / 1000.0);
    let agree = declared.iter().all(|(_, declared)| is_same(*declared, *of_first));
    let mut notes = Vec::new();
    let words = unit.name();
    if agree && of_first.unit().is_some() {
        notes.push(format!("the unit is {words}, as {} scans declare, such as {first}", declared.len()));
    }
    let mut factors = ones;
    for (factor, (name, declared)) in factors.iter_mut().zip(scans) {
        let declared = declared.filter(|declared| declared.unit() != Some(unit) && !is_said(name));
        let Some(declared) = declared else { continue };
        *factor = declared.metres / metres;
        notes.push(format!("{name} is in {}: its lengths are converted to {words}", in_words(declared)));
    }
    let is_silent = |(name, unit): &&(&str, Option<DeclaredUnit>)| unit.is_none() && !is_said(name);
    let silent: Vec<&str> = scans.iter().filter(is_silent).map(|(name, _)| *name).collect();
    if let Some(name) = silent.first() {
        let count = silent.len();
        notes.push(format!("{count} scans declare no unit, such as {name}: they are taken to be in {words}, too"));
    }
    Settled { unit, factors, notes, base: BTreeMap::new() }
}

impl Settled {
    /// Brings the scans to the unit, with what is said of places in them, the poses that they have in a model, and those that
    /// their own files tell. Other poses are in the unit of the set.
    pub fn apply(&mut self, scans: &mut [NamedScan], start: &mut Start) {
        self.base.clone_from(&start.base);
        for (scan, factor) in scans.iter_mut().zip(&self.factors).filter(|(_, factor)| **factor != 1.0) {
            scan.surface = scaled(std::mem::take(&mut scan.surface), *factor);
            start.hints.scale(&scan.name, *factor);
            if let Some(pose) = start.poses.get_mut(&scan.name).filter(|_| start.of_scan_files) {
                pose.translation.vector *= *factor;
            }
            if let Some(matrix) = start.base.get_mut(&scan.name) {
                turn_scaled(matrix, 1.0 / factor);
            }
        }
    }

    /// Lets the matrices of a model map the scans as their files have them.
    pub fn undo(&self, scans: &[String], outcome: &mut RegisteredModel) {
        for (name, factor) in scans.iter().zip(&self.factors).filter(|(_, factor)| **factor != 1.0) {
            let of_scan = outcome.matrices.iter_mut().filter(|(scan, _)| scan == name);
            for matrix in of_scan.filter_map(|(_, matrix)| matrix.as_mut()) {
                match self.base.get(name) {
                    // to the last bit
                    Some(base) => *matrix = *base,
                    None => turn_scaled(matrix, *factor),
                }
            }
        }
        outcome.report.unit_notes.clone_from(&self.notes);
    }
}

/// Multiplies what a matrix does to lengths, but not where it takes the origin.
fn turn_scaled(matrix: &mut [[f64; 4]; 4], factor: f64) {
    matrix.iter_mut().take(3).flat_map(|row| row.iter_mut().take(3)).for_each(|value| *value *= factor);
}

fn is_same(a: DeclaredUnit, b: DeclaredUnit) -> bool {
    (a.metres - b.metres).abs() <= 1e-9 * a.metres
}

fn in_words(declared: DeclaredUnit) -> String {
    declared.unit().map_or_else(|| format!("units of {} m", declared.metres), |unit| unit.name().to_owned())
}

/// What a length in one unit is in another, by the units' names.
const CONVERSIONS: &[(f64, Unit, Unit)] = &[
    (1000.0, Unit::M, Unit::Mm),
    (100.0, Unit::M, Unit::Cm),
    (39.37, Unit::M, Unit::In),
    (25.4, Unit::In, Unit::Mm),
    (10.0, Unit::Cm, Unit::Mm),
];
/// Scans of one object may be seen from near and from afar, in parts and as a whole: so much their sizes and spacings may
/// be from what a conversion makes of them.
const LEEWAY: f64 = 2.0;

/// Scans that are as many times smaller or larger than the others, in size and in spacing, as one unit is than another, and
/// that have no place: it may be for that reason alone.
pub(super) fn suspects(views: &[View], names: &[String], placed: &[bool], unit: Unit) -> Vec<Finding> {
    let mut findings = Vec::new();
    for (index, view) in views.iter().enumerate() {
        // of two scans it is enough to name one
        if placed[index] && (views.len() > 2 || index > 0 || placed.iter().all(|placed| *placed)) {
            continue;
        }
        let others = |of: fn(&View) -> f64| {
            let mut all: Vec<f64> =
                views.iter().enumerate().filter(|(k, _)| *k != index).map(|(_, view)| of(view)).collect();
            all.sort_by(f64::total_cmp);
            all.get(all.len() / 2).copied()
        };
        let (Some(spacing), Some(radius)) = (others(|view| view.spacing), others(|view| view.radius)) else { continue };
        let smaller = [spacing / view.spacing, radius / view.radius];
        let is_smaller = smaller[0] > 1.0;
        let times = smaller.map(|ratio| if is_smaller { ratio } else { 1.0 / ratio });
        let fits = |of: f64| times.iter().all(|times| (of / LEEWAY..=of * LEEWAY).contains(times));
        let mean = times[0].max(f64::MIN_POSITIVE).ln() / 2.0 + times[1].max(f64::MIN_POSITIVE).ln() / 2.0;
        let off = |of: f64| (of.ln() - mean).abs();
        let nearest = CONVERSIONS.iter().filter(|(of, ..)| fits(*of)).min_by(|a, b| off(a.0).total_cmp(&off(b.0)));
        let Some((of, large, small)) = nearest else { continue };
        let (own, among) = if is_smaller { (large, small) } else { (small, large) };
        // where the unit of the set is told, that of the scan follows
        let ratio = if is_smaller { *of } else { 1.0 / of };
        let told = unit.in_mm().map(|mm| mm * ratio);
        let of_told =
            told.and_then(|mm| CONVERSIONS.iter().flat_map(|(_, a, b)| [a, b]).find(|unit| is_near(**unit, mm)));
        let name = &names[index];
        let said = of_told.unwrap_or(own).name();
        findings.push(Finding::doubt(format!(
            "{name} is about {of} times {} than the others, in size and in spacing ({:.3} for {spacing:.3}): {} among {}? If so, say \
             it with the hint {{\"units\": {{{name:?}: \"{said}\"}}}}",
            if is_smaller { "smaller" } else { "larger" },
            view.spacing,
            in_plural(*own),
            in_plural(*among)
        )));
    }
    findings
}

fn is_near(unit: Unit, mm: f64) -> bool {
    unit.in_mm().is_some_and(|of_unit| (of_unit / mm - 1.0).abs() < 0.01)
}

fn in_plural(unit: Unit) -> &'static str {
    match unit {
        Unit::Mm => "millimetres",
        Unit::Cm => "centimetres",
        Unit::M => "metres",
        Unit::In => "inches",
        Unit::Unknown => "unknown units",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_geometry::{Cloud, Point3, Surface};

    const M: Option<DeclaredUnit> = Some(DeclaredUnit::METRE);
    const MM: Option<DeclaredUnit> = Some(DeclaredUnit { metres: 0.001 });
    const FOOT: Option<DeclaredUnit> = Some(DeclaredUnit { metres: 0.3048 });

    fn of(given: Option<Unit>, declared: &[Option<DeclaredUnit>]) -> (Unit, Vec<f64>, String) {
        let names = ["a", "b", "c"];
        let Settled { unit, factors, notes, .. } =
            settle(given, &names.into_iter().zip(declared.iter().copied()).collect::<Vec<_>>(), &BTreeMap::new())
                .expect("nothing is said");
        (unit, factors, notes.join("; "))
    }

    #[test]
    fn what_is_given_counts_and_a_difference_is_said() {
        assert_eq!(of(Some(Unit::Mm), &[None, MM]), (Unit::Mm, vec![1.0; 2], String::new()));
        let (unit, factors, note) = of(Some(Unit::Mm), &[None, M]);
        assert_eq!((unit, factors), (Unit::Mm, vec![1.0; 2]));
        assert_eq!(note, "1 scans declare another unit than mm, such as b (m): what is given counts");
    }

    #[test]
    fn what_is_declared_counts_if_nothing_is_given() {
        assert_eq!(of(None, &[None, None]), (Unit::Unknown, vec![1.0; 2], String::new()));
        assert_eq!(of(None, &[M, M]).2, "the unit is m, as 2 scans declare, such as a");
        let (unit, factors, note) = of(None, &[None, MM, MM]);
        assert_eq!((unit, factors), (Unit::Mm, vec![1.0; 3]));
        assert!(note.ends_with("1 scans declare no unit, such as a: they are taken to be in mm, too"), "{note}");
    }

    #[test]
    fn several_units_and_rare_ones_are_converted() {
        let (unit, factors, note) = of(None, &[MM, M, MM]);
        assert_eq!((unit, factors), (Unit::Mm, vec![1.0, 1000.0, 1.0]));
        assert_eq!(note, "b is in m: its lengths are converted to mm");
        let (unit, factors, note) = of(None, &[FOOT, FOOT]);
        assert_eq!((unit, factors), (Unit::M, vec![0.3048; 2]));
        assert!(note.starts_with("a is in units of 0.3048 m: its lengths are converted to m; b is"), "{note}");
    }

    #[test]
    fn what_a_person_says_of_a_scan_counts_more_than_its_file() {
        let said = |unit| [("b".to_owned(), unit)].into();
        let scans = [("a", None), ("b", MM), ("c", None)];
        let settled = settle(Some(Unit::Mm), &scans, &said(Unit::M)).expect("clear");
        assert_eq!((settled.unit, settled.factors), (Unit::Mm, vec![1.0, 1000.0, 1.0]));
        assert_eq!(settled.notes, ["b is in m, as was said: its lengths are converted to mm"]);
        assert!(settle(None, &scans, &said(Unit::M)).is_err(), "in what unit are the others?");
    }

    #[test]
    fn scans_places_and_matrices_are_scaled_and_the_matrices_are_those_of_the_files() {
        let mut cloud = Cloud::from_points(vec![Point3::new(1.0, 2.0, 3.0)]);
        cloud.colors = Some(vec![[1, 2, 3]]);
        let surface = Surface { cloud, sensor: Some(Point3::new(0.0, 0.0, 1.0)), ..Surface::default() };
        let mut scans = [NamedScan { name: "a".to_owned(), surface }];
        let identity = [[1.0, 0.0, 0.0, 5.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];
        let hints =
            serde_json::json!({"regions": [{"scan": "a", "leave": {"sphere": {"center": [1, 0, 0], "radius": 2}}}]});
        let hints = serde_json::from_value(hints).expect("hints");
        let told = [("a".to_owned(), visage_geometry::Motion::translation(1.0, 0.0, 2.0))].into();
        let base = [("a".to_owned(), identity)].into();
        let mut start = Start { base, hints, poses: told, of_scan_files: true, ..Start::default() };
        let mut settled = Settled { unit: Unit::Mm, factors: vec![10.0], notes: Vec::new(), base: BTreeMap::new() };
        settled.apply(&mut scans, &mut start);
        assert_eq!(scans[0].surface.cloud.points, [Point3::new(10.0, 20.0, 30.0)]);
        assert_eq!(scans[0].surface.sensor, Some(Point3::new(0.0, 0.0, 10.0)));
        assert!((start.base["a"][0][0], start.base["a"][0][3]) == (0.1, 5.0));
        assert_eq!(start.poses["a"].translation.vector, nalgebra::Vector3::new(10.0, 0.0, 20.0));
        // poses that were given are in the unit of the set
        let mut given = Start { of_scan_files: false, ..start.clone() };
        settled.apply(&mut scans.clone(), &mut given);
        assert_eq!(given.poses["a"].translation.vector.x, 10.0);
        let sphere = start.hints.regions[0].leave.as_ref().and_then(|region| region.sphere.as_ref()).expect("there");
        assert_eq!((sphere.center, sphere.radius), ([10.0, 0.0, 0.0], 20.0));
    }

    /// A grid of so many points a side, `step` apart.
    fn view(step: f64) -> View {
        let points = (0..400).map(|k| Point3::new(f64::from(k % 20) * step, f64::from(k / 20) * step, 0.0));
        View::of(&Surface { cloud: Cloud::from_points(points.collect()), ..Surface::default() }).expect("a view")
    }

    #[test]
    fn a_scan_in_another_unit_is_named_with_the_ratio() {
        let names = ["a", "b", "c"].map(str::to_owned);
        let of = |steps: [f64; 3], placed: [bool; 3], unit| {
            let views = steps.map(view);
            suspects(&views, &names, &placed, unit).iter().map(|finding| finding.reason.clone()).collect::<Vec<_>>()
        };
        let found = of([0.0015, 1.5, 1.4], [false, true, true], Unit::Mm);
        assert_eq!(found.len(), 1);
        assert!(found[0].starts_with("a is about 1000 times smaller than the others"), "{found:?}");
        assert!(
            found[0].contains("metres among millimetres?") && found[0].ends_with("{\"units\": {\"a\": \"m\"}}"),
            "{found:?}"
        );
        let found = of([25.0, 1.0, 1.0], [false, true, true], Unit::In);
        assert!(found[0].contains("millimetres among inches?") && found[0].ends_with("\"mm\"}}"), "{found:?}");
        assert!(of([0.0015, 1.5, 1.4], [true; 3], Unit::Mm).is_empty(), "it has found its place");
        assert!(of([0.5, 1.5, 1.4], [false, true, true], Unit::Mm).is_empty(), "finer, but no unit explains it");
    }
}
