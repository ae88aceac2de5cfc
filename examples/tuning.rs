//! How much registration from scans alone depends on each of its constants: each is made 20 % smaller and 20 % larger.
//!
//! `cargo run --release --features vary --example tuning -- SET...` registers the code-made sets (each `SENSOR_SCENE_SEED`, or a
//! seed for all of them) once as they are and twice for each constant that was used, and prints what changed, most first.
//! It runs `scanners`, which has to be built beside it with the same feature. A constant that changes nothing can go.

use std::collections::BTreeSet;
use std::process::Command;

use anyhow::{Context, ensure};

/// What a constant is taken times.
const FACTORS: [f64; 2] = [0.8, 1.2];
/// A view is sure from this confidence on.
const SURE: f64 = 0.9;

fn main() -> anyhow::Result<()> {
    let sets: Vec<String> = std::env::args().skip(1).collect();
    ensure!(!sets.is_empty(), "which sets? SENSOR_SCENE_SEED..., or SEED...");
    let (base, constants) = measure(&sets, None)?;
    println!("As they are: {}\n", base.words());
    println!("| constant | times | right | sure | wrong and sure | views that end elsewhere | CPU |");
    println!("| --- | ---: | ---: | ---: | ---: | ---: | ---: |");
    let mut still = Vec::new();
    let mut rows = Vec::new();
    for constant in &constants {
        let mut changed = 0;
        for factor in FACTORS {
            let (found, _) = measure(&sets, Some((constant, factor)))?;
            let elsewhere = base.places.iter().zip(&found.places).filter(|(a, b)| a != b).count();
            changed += elsewhere;
            let by = |now: usize, before: usize| format!("{:+}", now as i64 - before as i64);
            let row = format!(
                "| `{constant}` | {factor} | {} | {} | {} | {elsewhere} | {:+.0} % |",
                by(found.right, base.right),
                by(found.sure, base.sure),
                by(found.wrong_sure, base.wrong_sure),
                100.0 * (found.cpu_s / base.cpu_s - 1.0),
            );
            eprintln!("{row}");
            if elsewhere > 0 || found.cpu_s > 1.05 * base.cpu_s || found.cpu_s < 0.95 * base.cpu_s {
                rows.push((found.right.abs_diff(base.right) + found.sure.abs_diff(base.sure), row));
            }
        }
        if changed == 0 {
            still.push(constant.as_str());
        }
    }
    rows.sort_by_key(|(change, _)| std::cmp::Reverse(*change));
    rows.iter().for_each(|(_, row)| println!("{row}"));
    println!("\nNo view moved with: {}", still.join(", "));
    Ok(())
}

/// What came of the sets.
#[derive(Default)]
struct Found {
    views: usize,
    right: usize,
    sure: usize,
    wrong_sure: usize,
    cpu_s: f64,
    /// Where each view came to lie, by how far off it is.
    places: Vec<String>,
}

impl Found {
    fn words(&self) -> String {
        let Found { views, right, sure, wrong_sure, cpu_s, .. } = self;
        format!("{views} views, {right} right, {sure} sure, {wrong_sure} of them wrong, {cpu_s:.1} CPU s")
    }
}

/// Registers the sets in a process of their own; which constants were used.
fn measure(sets: &[String], varied: Option<(&str, f64)>) -> anyhow::Result<(Found, BTreeSet<String>)> {
    let program = std::env::current_exe()?.with_file_name("scanners");
    let mut command = Command::new(&program);
    command.arg("measure").args(sets);
    if let Some((name, factor)) = varied {
        command.env("VISAGE_VARY", format!("{name}={factor}"));
    }
    let output = command.output().with_context(|| format!("starting {}", program.display()))?;
    ensure!(output.status.success(), "{varied:?}: {}", String::from_utf8_lossy(&output.stderr));
    let (mut found, mut constants) = (Found::default(), BTreeSet::new());
    for line in String::from_utf8(output.stdout)?.lines() {
        let cells: Vec<&str> = line.split('\t').collect();
        let cell = |k: usize| cells.get(k).copied().unwrap_or_default();
        match cell(0) {
            "view" => {
                let (is_right, is_sure) = (cell(7) == "1", cell(9).parse::<f64>().is_ok_and(|sure| sure >= SURE));
                found.views += 1;
                found.right += usize::from(is_right);
                found.sure += usize::from(is_sure);
                found.wrong_sure += usize::from(is_sure && !is_right);
                found.places.push(format!("{} {}", cell(10), cell(11)));
            }
            "set" => found.cpu_s += cell(8).parse::<f64>().unwrap_or(0.0),
            "constant" => drop(constants.insert(cell(1).to_owned())),
            _ => {}
        }
    }
    Ok((found, constants))
}
