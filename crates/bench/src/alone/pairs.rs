//! Every pair of scans registered by itself, from the two scans alone, by class of overlap.

use std::path::Path;

use anyhow::Context;

use super::damage::Damage;
use super::orders::{Scorer, cpu_seconds, registered};
use super::set::KnownSet;
use visage::formats::{ply, poses};
use visage::geometry::{Motion, se3};
use visage::registration::view::common_spacing;

/// Lower limits of the classes of overlap.
const CLASSES: [f64; 4] = [0.5, 0.3, 0.1, 0.0];
/// A motion is right if it is off by less than this angle.
const RIGHT_DEG: f64 = 5.0;
/// The order and turns of the scans.
const SEED: u64 = 1000;

/// How the pairs of a class ended.
#[derive(Debug, Clone, Copy, Default)]
struct Tally {
    pairs: usize,
    right: usize,
    wrong: usize,
    wrong_but_good: usize,
}

/// Registers the pairs of each set after each damage and prints a table.
pub fn run(data: &Path, sets: &[String], damages: &[Damage], write: Option<&Path>) -> anyhow::Result<()> {
    println!("| damage | set | overlap | pairs | right | wrong | of these `good` | CPU s a pair |");
    println!("| --- | --- | --- | ---: | ---: | ---: | ---: | ---: |");
    for damage in damages {
        for name in sets {
            let whole = KnownSet::read(data, name)?.made_strange(SEED);
            let scorer = Scorer::new(&whole)?;
            let damaged = damaged(&whole, *damage, common_spacing(&scorer.views));
            if let Some(folder) = write {
                write_set(&damaged, &scorer, &folder.join(format!("{name}_{damage}")))?;
            }
            let begin = cpu_seconds()?;
            let tallies = tally(&damaged, &scorer)?;
            let seconds = (cpu_seconds()? - begin) / scorer.pairs.len().max(1) as f64;
            for (class, tally) in CLASSES.iter().zip(&tallies) {
                println!(
                    "| {damage} | {name} | from {class} | {} | {} | {} | {} | {seconds:.2} |",
                    tally.pairs, tally.right, tally.wrong, tally.wrong_but_good
                );
            }
        }
    }
    Ok(())
}

fn damaged(set: &KnownSet, damage: Damage, spacing: f64) -> KnownSet {
    let worse = |(view, cloud)| damage.done_to(cloud, spacing, view as u64);
    KnownSet {
        name: set.name.clone(),
        clouds: set.clouds.iter().enumerate().map(worse).collect(),
        poses: set.poses.clone(),
    }
}

/// Registers all pairs; those that end without a place for one of the scans are neither right nor wrong.
fn tally(set: &KnownSet, scorer: &Scorer) -> anyhow::Result<[Tally; CLASSES.len()]> {
    let mut tallies = [Tally::default(); CLASSES.len()];
    for pair in &scorer.pairs {
        let (i, j) = pair.views;
        let overlap = pair.overlaps.0.min(pair.overlaps.1);
        let class = CLASSES.iter().position(|least| overlap >= *least).unwrap_or(CLASSES.len() - 1);
        let tally = &mut tallies[class];
        tally.pairs += 1;
        let both = |items: &[visage::geometry::Cloud]| vec![items[i].clone(), items[j].clone()];
        let two =
            KnownSet { name: set.name.clone(), clouds: both(&set.clouds), poses: vec![set.poses[i], set.poses[j]] };
        let outcome = registered(&two, &[])?;
        let (Some(pose_i), Some(pose_j)) = (outcome.poses[0].1, outcome.poses[1].1) else { continue };
        let is_right = angle_deg(&pose_i.inv_mul(&pose_j), &set.poses[i].inv_mul(&set.poses[j])) < RIGHT_DEG;
        tally.right += usize::from(is_right);
        tally.wrong += usize::from(!is_right);
        tally.wrong_but_good += usize::from(!is_right && outcome.report.to_json()["verdict"]["quality"] == "good");
    }
    Ok(tallies)
}

fn angle_deg(a: &Motion, b: &Motion) -> f64 {
    se3::rotation_angle(&(a.rotation.inverse() * b.rotation)).to_degrees()
}

/// Writes `s0.ply` ..., `poses.json` and `overlaps.json` (pairs with their lesser overlap).
fn write_set(set: &KnownSet, scorer: &Scorer, folder: &Path) -> anyhow::Result<()> {
    std::fs::create_dir_all(folder).with_context(|| format!("making {}", folder.display()))?;
    let write = |name: &str, bytes: &[u8]| {
        std::fs::write(folder.join(name), bytes).with_context(|| format!("writing {name} to {}", folder.display()))
    };
    let name = |view: usize| format!("s{view}.ply");
    for (view, cloud) in set.clouds.iter().enumerate() {
        write(&name(view), &ply::write_cloud(cloud, None))?;
    }
    let posed: Vec<(String, Option<Motion>)> =
        set.poses.iter().enumerate().map(|(view, pose)| (name(view), Some(*pose))).collect();
    write("poses.json", poses::write_json(&posed).as_bytes())?;
    let overlaps: Vec<(usize, usize, f64)> =
        scorer.pairs.iter().map(|pair| (pair.views.0, pair.views.1, pair.overlaps.0.min(pair.overlaps.1))).collect();
    write("overlaps.json", serde_json::to_string(&overlaps)?.as_bytes())
}
