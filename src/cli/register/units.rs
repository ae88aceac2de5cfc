//! The unit of a set: what the user says, else what the files declare.

use crate::formats::{DeclaredUnit, Reading};
use crate::geometry::Unit;

/// The unit in which the scans of a set are registered.
#[derive(Debug, PartialEq)]
pub struct Settled {
    /// The unit of all scans.
    pub unit: Unit,
    /// For each scan what its lengths are multiplied by, 1 for most.
    pub factors: Vec<f64>,
    /// What the user should know of it.
    pub notes: Vec<String>,
}

/// Settles the unit of scans that declare these. What is given counts; else what is declared, if there is no doubt; scans
/// in several units are to be converted.
pub fn settle(given: Option<Unit>, scans: &[(&str, Option<DeclaredUnit>)]) -> Settled {
    let declared: Vec<(&str, DeclaredUnit)> = scans.iter().filter_map(|(name, unit)| Some((*name, (*unit)?))).collect();
    let ones = vec![1.0; scans.len()];
    if let Some(unit) = given {
        let other = declared.iter().filter(|(_, declared)| declared.unit() != Some(unit));
        let others: Vec<_> = other.collect();
        let note = others.first().map(|(name, declared)| {
            let (count, words) = (others.len(), in_words(*declared));
            format!(
                "{count} scans declare another unit than --unit {}, such as {name} ({words}): what is given counts",
                unit.name()
            )
        });
        return Settled { unit, factors: ones, notes: note.into_iter().collect() };
    }
    let Some((first, of_first)) = declared.first() else {
        return Settled { unit: Unit::Unknown, factors: ones, notes: Vec::new() };
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
        let Some(declared) = declared.filter(|declared| declared.unit() != Some(unit)) else { continue };
        *factor = declared.metres / metres;
        notes.push(format!("{name} is in {}: its lengths are converted to {words}", in_words(declared)));
    }
    let silent: Vec<&str> = scans.iter().filter(|(_, unit)| unit.is_none()).map(|(name, _)| *name).collect();
    if let Some(name) = silent.first() {
        let count = silent.len();
        notes.push(format!("{count} scans declare no unit, such as {name}: they are taken to be in {words}, too"));
    }
    Settled { unit, factors, notes }
}

/// Multiplies all lengths of a scan.
pub fn scale(reading: &mut Reading, factor: f64) {
    if factor == 1.0 {
        return;
    }
    reading.surface.cloud.points.iter_mut().chain(&mut reading.surface.sensor).for_each(|point| *point *= factor);
}

fn is_same(a: DeclaredUnit, b: DeclaredUnit) -> bool {
    (a.metres - b.metres).abs() <= 1e-9 * a.metres
}

fn in_words(declared: DeclaredUnit) -> String {
    declared.unit().map_or_else(|| format!("units of {} m", declared.metres), |unit| unit.name().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Cloud, Point3};

    const M: Option<DeclaredUnit> = Some(DeclaredUnit::METRE);
    const MM: Option<DeclaredUnit> = Some(DeclaredUnit { metres: 0.001 });
    const FOOT: Option<DeclaredUnit> = Some(DeclaredUnit { metres: 0.3048 });

    fn of(given: Option<Unit>, declared: &[Option<DeclaredUnit>]) -> (Unit, Vec<f64>, String) {
        let names = ["a", "b", "c"];
        let Settled { unit, factors, notes } =
            settle(given, &names.into_iter().zip(declared.iter().copied()).collect::<Vec<_>>());
        (unit, factors, notes.join("; "))
    }

    #[test]
    fn what_is_given_counts_and_a_difference_is_said() {
        assert_eq!(of(Some(Unit::Mm), &[None, MM]), (Unit::Mm, vec![1.0; 2], String::new()));
        let (unit, factors, note) = of(Some(Unit::Mm), &[None, M]);
        assert_eq!((unit, factors), (Unit::Mm, vec![1.0; 2]));
        assert_eq!(note, "1 scans declare another unit than --unit mm, such as b (m): what is given counts");
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
    fn points_and_the_scanner_are_scaled() {
        let mut reading = Reading::default();
        reading.surface.cloud = Cloud::from_points(vec![Point3::new(1.0, 2.0, 3.0)]);
        reading.surface.sensor = Some(Point3::new(0.0, 0.0, 1.0));
        scale(&mut reading, 10.0);
        assert_eq!(reading.surface.cloud.points, [Point3::new(10.0, 20.0, 30.0)]);
        assert_eq!(reading.surface.sensor, Some(Point3::new(0.0, 0.0, 10.0)));
    }
}
