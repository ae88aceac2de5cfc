//! How registration from scans alone ends on code-made scans of six kinds of sensor and eight kinds of scene.
//!
//! `cargo run --release --example scanners -- measure SEED... > ROWS` scans every scene by every sensor for each seed, runs the
//! whole pipeline without poses, and writes a row for each view and one for each set; `... -- summary ROWS...` prints the tables by
//! sensor and by scene; `... -- export SEED FOLDER [NAME...]` writes the sets, or those whose names contain NAME, as folders of
//! PLY files with their true poses in `gt.json`. `measure` takes `SENSOR_SCENE_SEED` instead of a seed for a single set.

use std::collections::BTreeMap;
use std::path::Path;

use nix::sys::resource::{UsageWho, getrusage};
use serde::Deserialize;
use visage::formats::ply::write_cloud;
use visage::geometry::{Motion, Point3, Unit, Vector3, se3};
use visage::pipeline::{self, NamedScan, Options, Start};
use visage::progress::Progress;
use visage::registration::global::confidence::features;
use visage::registration::global::report::ViewEvidence;
use visage::synthetic::scenery::SceneKind;
use visage::synthetic::sensors::{SensorKind, SensorSet, sensor_set};

/// A placed view is right within this share of the set's size (root mean square),
const OFF: f64 = 0.01;
/// and this angle.
const OFF_DEGREES: f64 = 2.0;
/// A view is sure from this confidence on.
const SURE: f64 = 0.9;
/// A view that overlaps a neighbour by more than this has enough overlap.
const ENOUGH: f64 = 0.4;

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    #[cfg(feature = "vary")]
    if let Ok(varied) = std::env::var("VISAGE_VARY") {
        let (name, factor) = varied.split_once('=').ok_or_else(|| anyhow::anyhow!("VISAGE_VARY is NAME=FACTOR"))?;
        visage::geometry::tuning::vary(name, factor.parse()?);
    }
    match words[..] {
        ["measure", ref seeds @ ..] => {
            println!("{HEADER}");
            for wanted in seeds {
                let (name, seed) = wanted.rsplit_once('_').map_or((None, *wanted), |(name, seed)| (Some(name), seed));
                let seed: u64 = seed.parse()?;
                let is_wanted = |(sensor, scene): &(SensorKind, SceneKind)| {
                    name.is_none_or(|name| format!("{}_{}", sensor.name(), scene.name()) == name)
                };
                for (sensor, scene) in all().filter(is_wanted) {
                    print!("{}", measure(sensor, scene, seed)?);
                }
            }
            #[cfg(feature = "vary")]
            visage::geometry::tuning::used().iter().for_each(|name| println!("constant\t{name}"));
        }
        ["summary", ref files @ ..] => {
            let texts: Vec<String> = files.iter().map(std::fs::read_to_string).collect::<Result<_, _>>()?;
            summary(&texts.concat());
        }
        ["export", seed, folder, ref names @ ..] => {
            let seed = seed.parse()?;
            for (sensor, scene) in all() {
                let name = format!("{}_{}_{seed}", sensor.name(), scene.name());
                if names.is_empty() || names.iter().any(|part| name.contains(part)) {
                    export(&sensor_set(sensor, scene, seed), &Path::new(folder).join(name))?;
                }
            }
        }
        _ => anyhow::bail!("measure SEED..., summary ROWS... or export SEED FOLDER [NAME...]"),
    }
    Ok(())
}

/// Every sensor with every scene.
fn all() -> impl Iterator<Item = (SensorKind, SceneKind)> {
    SensorKind::ALL.iter().flat_map(|sensor| SceneKind::ALL.iter().map(move |scene| (*sensor, *scene)))
}

/// The columns of the rows.
const HEADER: &str = "#view\tsensor\tscene\tseed\tviews\tview\tplaced\tright\toverlap\tconfidence\toff_percent\toff_deg\tsharpness\tgrip\tfeatures\n\
                      #set\tsensor\tscene\tseed\tviews\tplaced\tright\tquality\tcpu_s\tmaking_cpu_s\tpoints\tworst_percent\tworst_deg\treasons";

/// Processor time of this process so far, s.
fn cpu() -> anyhow::Result<f64> {
    let usage = getrusage(UsageWho::RUSAGE_SELF)?;
    let seconds = |time: nix::sys::time::TimeVal| time.tv_sec() as f64 + 1e-6 * time.tv_usec() as f64;
    Ok(seconds(usage.user_time()) + seconds(usage.system_time()))
}

/// Registers a set from its scans.
fn measure(sensor: SensorKind, scene: SceneKind, seed: u64) -> anyhow::Result<String> {
    let begun = cpu()?;
    let set = sensor_set(sensor, scene, seed);
    let made = cpu()?;
    let count = set.scans.len();
    let scans = set.scans.iter().enumerate();
    let scans = scans.map(|(k, scan)| NamedScan { name: format!("scan{k}.ply"), surface: scan.clone() }).collect();
    let options = Options { cloud: false, signature: false, ..Options::default() };
    let outcome = pipeline::run_from(scans, &Start::default(), Unit::Unknown, &options, &Progress::silent());
    let done = cpu()?;
    let key = format!("{}\t{}\t{seed}\t{count}", sensor.name(), scene.name());
    let spent = format!("{:.2}\t{:.2}", done - made, made - begun);
    let points: usize = set.scans.iter().map(|scan| scan.cloud.len()).sum::<usize>() / count;
    let outcome = match outcome {
        Ok(outcome) => outcome,
        Err(error) => {
            let rows: String = (0..count)
                .map(|view| {
                    format!(
                        "view\t{key}\t{view}\t0\t0\t{:.3}\t\t\t\t\t{:.3}\n",
                        set.best_overlap(view),
                        set.grips[view]
                    )
                })
                .collect();
            return Ok(format!("{rows}set\t{key}\t0\t0\trefused\t{spent}\t{points}\t\t\t{error}\n"));
        }
    };
    let placed: Vec<Option<Motion>> = outcome.poses.iter().map(|(_, pose)| *pose).collect();
    let errors = errors(&set, &placed);
    let is_right =
        |error: &Option<(f64, f64)>| error.is_some_and(|(off, degrees)| off <= OFF && degrees <= OFF_DEGREES);
    let verdict = &outcome.report.to_json()["verdict"];
    let cell = |number: &serde_json::Value| number.as_f64().map(|x| format!("{x:.4}")).unwrap_or_default();
    let mut rows = String::new();
    for view in 0..count {
        let error = errors[view].map(|(off, degrees)| format!("{:.3}\t{degrees:.2}", 100.0 * off));
        rows += &format!(
            "view\t{key}\t{view}\t{}\t{}\t{:.3}\t{}\t{}\t{}\t{:.3}\t{}\n",
            u8::from(errors[view].is_some()),
            u8::from(is_right(&errors[view])),
            set.best_overlap(view),
            cell(&outcome.report.to_json()["views"][view]["confidence"]),
            error.unwrap_or_else(|| "\t".into()),
            cell(&verdict["sharpness"][view]),
            set.grips[view],
            features_of(&outcome.report.to_json()["views"][view]["evidence"]),
        );
    }
    let reasons: Vec<&str> = verdict["reasons"].as_array().into_iter().flatten().filter_map(|r| r.as_str()).collect();
    let worst = |of: fn(&(f64, f64)) -> f64| errors.iter().flatten().map(of).fold(0.0, f64::max);
    rows += &format!(
        "set\t{key}\t{}\t{}\t{}\t{spent}\t{points}\t{:.3}\t{:.2}\t{}\n",
        errors.iter().flatten().count(),
        errors.iter().filter(|error| is_right(error)).count(),
        verdict["quality"].as_str().unwrap_or("refused"),
        worst(|e| 100.0 * e.0),
        worst(|e| e.1),
        reasons.join(" | "),
    );
    Ok(rows)
}

/// What the confidence of a view looks at, with commas between.
fn features_of(evidence: &serde_json::Value) -> String {
    let Ok(evidence) = ViewEvidence::deserialize(evidence) else { return String::new() };
    let ViewEvidence { support, witness } = evidence;
    let still = if witness.stands_still { ",still" } else { "" };
    let features: Vec<String> = features(&support, &witness).iter().map(|x| format!("{x:.5}")).collect();
    features.join(",") + still
}

/// For each placed view how far off it is, as a share of the set's size, and by which angle, for the choice of world by which most
/// are right. Fewer than two placed views say nothing.
fn errors(set: &SensorSet, placed: &[Option<Motion>]) -> Vec<Option<(f64, f64)>> {
    let step = |scan: &visage::geometry::Surface| (scan.cloud.len() / 2_000).max(1);
    let points: Vec<Vec<Point3>> =
        set.scans.iter().map(|scan| scan.cloud.points.iter().step_by(step(scan)).copied().collect()).collect();
    let world: Vec<Point3> =
        points.iter().zip(&set.poses).flat_map(|(points, pose)| points.iter().map(move |p| pose * p)).collect();
    let extent = |axis: usize| {
        let mut along: Vec<f64> = world.iter().map(|point| point[axis]).collect();
        along.sort_by(f64::total_cmp);
        let at = |share: f64| along[(share * (along.len() - 1) as f64) as usize];
        at(0.99) - at(0.01)
    };
    let size = Vector3::new(extent(0), extent(1), extent(2)).norm();
    let by_reference = |reference: usize| {
        let world = set.poses[reference] * placed[reference]?.inverse();
        let error = |view: usize| {
            let found = world * placed[view]?;
            let squares: f64 = points[view].iter().map(|p| (found * p - set.poses[view] * p).norm_squared()).sum();
            let angle = se3::rotation_angle(&(found.rotation.inverse() * set.poses[view].rotation)).to_degrees();
            Some(((squares / points[view].len() as f64).sqrt() / size, angle))
        };
        let errors: Vec<Option<(f64, f64)>> = (0..placed.len()).map(error).collect();
        let right = errors.iter().flatten().filter(|(off, degrees)| *off <= OFF && *degrees <= OFF_DEGREES).count();
        let sum: f64 = errors.iter().flatten().map(|(off, _)| off).sum();
        Some((right, sum, errors))
    };
    let none = vec![None; placed.len()];
    if placed.iter().flatten().count() < 2 {
        return none;
    }
    let all = (0..placed.len()).filter_map(by_reference);
    all.max_by(|a, b| a.0.cmp(&b.0).then(b.1.total_cmp(&a.1))).map_or(none, |(_, _, errors)| errors)
}

/// What came of some sets.
#[derive(Default)]
struct Tally {
    views: usize,
    placed: usize,
    right: usize,
    /// Views with enough overlap, and those of them that are sure.
    enough: usize,
    enough_sure: usize,
    sure: usize,
    sure_right: usize,
    sets: usize,
    good: usize,
    /// All views placed and right.
    whole: usize,
    wrong: usize,
    good_wrong: usize,
    cpu_s: f64,
}

impl Tally {
    fn count(&mut self, cells: &[&str]) {
        let number = |k: usize| cells.get(k).and_then(|cell| cell.parse::<f64>().ok()).unwrap_or(0.0);
        if cells[0] == "view" {
            let (placed, right) = (number(6) == 1.0, number(7) == 1.0);
            let sure = placed && number(9) >= SURE;
            let enough = number(8) > ENOUGH;
            for (counter, is) in [
                (&mut self.views, true),
                (&mut self.placed, placed),
                (&mut self.right, right),
                (&mut self.sure, sure),
                (&mut self.sure_right, sure && right),
                (&mut self.enough, enough),
                (&mut self.enough_sure, enough && sure),
            ] {
                *counter += usize::from(is);
            }
        } else {
            let (good, wrong) = (cells[7] == "good", number(6) < number(5));
            self.sets += 1;
            self.good += usize::from(good);
            self.whole += usize::from(number(6) == number(4));
            self.wrong += usize::from(wrong);
            self.good_wrong += usize::from(good && wrong);
            self.cpu_s += number(8);
        }
    }

    fn row(&self, name: &str) -> String {
        let share = |part: usize, whole: usize| format!("{:.0} %", 100.0 * part as f64 / whole.max(1) as f64);
        format!(
            "| {name} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {:.2} |",
            self.views,
            share(self.placed, self.views),
            share(self.right, self.views),
            share(self.sure_right, self.sure),
            share(self.enough_sure, self.enough),
            self.sets,
            self.whole,
            self.good,
            self.wrong,
            self.good_wrong,
            self.cpu_s / self.sets.max(1) as f64,
        )
    }
}

fn summary(text: &str) {
    let rows: Vec<Vec<&str>> = text
        .lines()
        .map(|line| line.split('\t').collect())
        .filter(|c: &Vec<&str>| ["view", "set"].contains(&c[0]))
        .collect();
    let table = |title: &str, name: &dyn Fn(&[&str]) -> Option<String>| {
        println!(
            "\n| {title} | views | placed | right | right of sure | sure of overlap > {ENOUGH} | sets | all right | good | wrong | \
             good and wrong | CPU s a set |\n| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |"
        );
        let mut tallies: BTreeMap<String, Tally> = BTreeMap::new();
        for row in &rows {
            if let Some(name) = name(row) {
                tallies.entry(name).or_default().count(row);
            }
        }
        tallies.iter().for_each(|(name, tally)| println!("{}", tally.row(name)));
    };
    table("sensor", &|row| Some(row[1].into()));
    table("scene", &|row| Some(row[2].into()));
    let fitted = |row: &[&str]| {
        let sensor = row[1].parse().is_ok_and(SensorKind::is_for_fitting);
        sensor && row[2].parse().is_ok_and(SceneKind::is_for_fitting)
    };
    table("kinds", &|row| Some(if fitted(row) { "for fitting" } else { "sensor or scene kept aside" }.into()));
    table("all", &|_| Some("sum".into()));
    println!("\n| sensor and scene | all right / good / wrong / good and wrong of sets |\n| --- | --- |");
    let mut cells: BTreeMap<(&str, &str), Tally> = BTreeMap::new();
    rows.iter().for_each(|row| cells.entry((row[1], row[2])).or_default().count(row));
    for ((sensor, scene), tally) in cells {
        let Tally { whole, good, wrong, good_wrong, sets, .. } = tally;
        println!("| {sensor}, {scene} | {whole} / {good} / {wrong} / {good_wrong} of {sets} |");
    }
}

/// Writes a set as a folder of PLY files and `gt.json`.
fn export(set: &SensorSet, folder: &Path) -> anyhow::Result<()> {
    std::fs::create_dir_all(folder)?;
    let mut truth = serde_json::Map::new();
    for (view, (scan, pose)) in set.scans.iter().zip(&set.poses).enumerate() {
        let name = format!("scan{view}.ply");
        std::fs::write(folder.join(&name), write_cloud(&scan.cloud, None))?;
        truth.insert(name, serde_json::json!(se3::to_rows(pose)));
    }
    std::fs::write(folder.join("gt.json"), serde_json::to_vec(&truth)?)?;
    Ok(())
}
