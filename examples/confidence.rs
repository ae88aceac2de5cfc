//! The coefficients of a view's confidence, and how far it can be trusted.
//!
//! `cargo run --release --example confidence -- [--svg FILE] ROWS...` takes the rows that `--example scanners` and
//! `--example scans_alone` write. It fits the coefficients on the kinds of sensor and scene that are for fitting and on
//! half of the objects, freely and near those built in, and shows how often views of each confidence are right: on those, and on the kinds kept aside, with the
//! coefficients fitted here and with those built in.

use std::fmt::Write as _;

use nalgebra::{SMatrix, SVector};
use visage::registration::global::confidence::{FEATURES, MODEL, STILL, SURE};
use visage::synthetic::scenery::SceneKind;
use visage::synthetic::sensors::SensorKind;

/// Which views a row belongs to.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    Fitted,
    FittedObject,
    Aside,
    Turntable,
    Object,
}

impl Kind {
    fn is_fitted(self) -> bool {
        matches!(self, Kind::Fitted | Kind::FittedObject)
    }
}

const KINDS: [(Kind, &str); 5] = [
    (Kind::Fitted, "sensors and scenes for fitting"),
    (Kind::FittedObject, "objects from all sides, even places of the catalogue, for fitting"),
    (Kind::Aside, "sensors or scenes kept aside"),
    (Kind::Turntable, "turntables (kept aside)"),
    (Kind::Object, "objects from all sides, odd places (kept aside)"),
];

/// A placed view.
struct Row {
    kind: Kind,
    right: bool,
    stands_still: bool,
    features: [f64; FEATURES],
}

impl Row {
    fn read(line: &str) -> Option<Row> {
        let cells: Vec<&str> = line.split('\t').collect();
        let (kind, right, features) = match *cells.first()? {
            "view" => {
                let sensor: SensorKind = cells[1].parse().ok()?;
                let scene: SceneKind = cells[2].parse().ok()?;
                let kind = match scene {
                    SceneKind::Turntable => Kind::Turntable,
                    _ if sensor.is_for_fitting() && scene.is_for_fitting() => Kind::Fitted,
                    _ => Kind::Aside,
                };
                (kind, cells[7], cells.get(14)?.split(',').collect())
            }
            "row" if cells[9] == "1" => {
                let is_even = cells[2].parse::<usize>().ok()?.is_multiple_of(2);
                let kind = if is_even { Kind::FittedObject } else { Kind::Object };
                (kind, cells[10], cells[14..].to_vec())
            }
            _ => return None,
        };
        let stands_still = features.contains(&"still");
        let numbers: Vec<f64> = features.iter().filter_map(|cell| cell.parse().ok()).collect();
        Some(Row { kind, right: right == "1", stands_still, features: numbers.try_into().ok()? })
    }

    fn confidence(&self, model: &[f64; FEATURES]) -> f64 {
        let z: f64 = model.iter().zip(&self.features).map(|(c, x)| c * x).sum();
        let z = if self.stands_still { z - STILL } else { z };
        1.0 / (1.0 + (-z).exp())
    }
}

fn main() -> anyhow::Result<()> {
    let mut files: Vec<String> = std::env::args().skip(1).collect();
    let svg = match files.iter().position(|word| word == "--svg") {
        Some(place) if place + 1 < files.len() => files.drain(place..place + 2).nth(1),
        _ => None,
    };
    anyhow::ensure!(!files.is_empty(), "[--svg FILE] ROWS...");
    let texts: Vec<String> = files.iter().map(std::fs::read_to_string).collect::<Result<_, _>>()?;
    let rows: Vec<Row> = texts.iter().flat_map(|text| text.lines()).filter_map(Row::read).collect();
    let training: Vec<&Row> = rows.iter().filter(|row| row.kind.is_fitted()).collect();
    let fitted = fit(&training, &[0.0; FEATURES], FREE);
    println!("fitted on {} placed views: {fitted:.3?}", training.len());
    let near = fit(&training, &MODEL, NEAR);
    println!("near those built in: {near:.3?}");
    for (name, model) in [("fitted", &fitted), ("near those built in", &near), ("as built in", &MODEL)] {
        println!(
            "\n| {name} | placed views | sure ({SURE}) | right of sure | sure (0.95) | right of sure |\n| --- | ---: | ---: | ---: | ---: | ---: |"
        );
        for (kind, of) in KINDS {
            let those: Vec<&Row> = rows.iter().filter(|row| row.kind == kind).collect();
            println!("| {of} | {} | {} | {} |", those.len(), sure(&those, model, SURE), sure(&those, model, 0.95));
        }
    }
    let others: Vec<&Row> = rows.iter().filter(|row| !row.kind.is_fitted()).collect();
    println!("\n| confidence | views not fitted | mean confidence | right |\n| --- | ---: | ---: | ---: |");
    for (bounds, (count, mean, right)) in BINS.windows(2).zip(bins(&others, &MODEL)) {
        println!("| {}-{} | {count} | {mean:.3} | {right:.3} |", bounds[0], bounds[1]);
    }
    if let Some(path) = svg {
        std::fs::write(path, curve(&bins(&others, &MODEL)))?;
    }
    Ok(())
}

/// How many views are sure, and the share of these that is right.
fn sure(rows: &[&Row], model: &[f64; FEATURES], threshold: f64) -> String {
    let sure: Vec<&&Row> = rows.iter().filter(|row| row.confidence(model) >= threshold).collect();
    let right = sure.iter().filter(|row| row.right).count();
    format!("{} | {:.1} %", sure.len(), 100.0 * right as f64 / sure.len().max(1) as f64)
}

/// How much the coefficients are held near zero,
const FREE: f64 = 1.0;
/// and near those built in, which more views may have been fitted on than there are rows.
const NEAR: f64 = 10.0;

/// Logistic regression by Newton's steps, its coefficients (but the constant) `held` near some.
fn fit(rows: &[&Row], near: &[f64; FEATURES], held: f64) -> [f64; FEATURES] {
    let near = SVector::<f64, FEATURES>::from(*near);
    let mut model = near;
    for _ in 0..50 {
        let mut gradient = -held * (model - near);
        gradient[0] = 0.0;
        let mut curvature = SMatrix::<f64, FEATURES, FEATURES>::identity() * held;
        for row in rows.iter().filter(|row| !row.stands_still) {
            let x = SVector::from(row.features);
            let p = row.confidence(&model.into());
            gradient += x * (f64::from(u8::from(row.right)) - p);
            curvature += x * x.transpose() * (p * (1.0 - p));
        }
        let Some(step) = curvature.cholesky().map(|c| c.solve(&gradient)) else { break };
        model += step;
    }
    model.into()
}

/// Bounds of the bins of the reliability table.
const BINS: [f64; 9] = [0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 0.97, 0.99, 1.0];

/// For each bin: views, their mean confidence, the share that is right.
fn bins(rows: &[&Row], model: &[f64; FEATURES]) -> Vec<(usize, f64, f64)> {
    BINS.windows(2)
        .map(|bounds| {
            let inside = |p: f64| p >= bounds[0] && (p < bounds[1] || bounds[1] == 1.0);
            let within: Vec<&&Row> = rows.iter().filter(|row| inside(row.confidence(model))).collect();
            let count = within.len().max(1) as f64;
            let mean = within.iter().map(|row| row.confidence(model)).sum::<f64>() / count;
            (within.len(), mean, within.iter().filter(|row| row.right).count() as f64 / count)
        })
        .collect()
}

/// The reliability curve: mean confidence across, share that is right upward.
fn curve(bins: &[(usize, f64, f64)]) -> String {
    let at = |mean: f64, right: f64| (40.0 + 240.0 * mean, 270.0 - 240.0 * right);
    let mut svg = String::from(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"320\" height=\"310\" font-family=\"sans-serif\" font-size=\"11\">\n\
         <rect x=\"40\" y=\"30\" width=\"240\" height=\"240\" fill=\"none\" stroke=\"#888\"/>\n\
         <path d=\"M40 270L280 30\" stroke=\"#bbb\" stroke-dasharray=\"4\"/>\n\
         <text x=\"100\" y=\"298\">mean confidence, 0 to 1</text>\n\
         <text x=\"40\" y=\"20\">share of views that are right, 0 to 1 (area: number of views)</text>\n",
    );
    for (count, mean, right) in bins.iter().filter(|bin| bin.0 > 0) {
        let (x, y) = at(*mean, *right);
        let radius = 1.5 + (*count as f64).sqrt() / 6.0;
        let _ =
            writeln!(svg, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius:.1}\" fill=\"#27c\" fill-opacity=\"0.6\"/>");
    }
    svg + "</svg>\n"
}
