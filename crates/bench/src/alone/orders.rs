//! Whole sets from their scans alone, in many orders.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::Context;
use nix::sys::resource::{UsageWho, getrusage};
use nix::sys::time::TimeValLike;

use super::set::KnownSet;
use visage::geometry::neighbours::{IndexedPoints, LocalPoint};
use visage::geometry::{Motion, Surface, Unit};
use visage::pipeline::{self, NamedScan, Options, RegisteredModel};
use visage::progress::Progress;
use visage::registration::objective::{ScoredPair, objective};
use visage::registration::overlap::overlaps;
use visage::registration::view::View;
use visage::registration::view::common_spacing;

/// Pairs with more overlap than this at the true poses are scored, as far as they lie within so many spacings.
const SCORED_OVERLAP: f64 = 0.5;
const TOUCHING: f64 = 2.0;
/// A registration from scans alone may be worse than that from the poses by this share of the objective.
const ALLOWED_EXCESS: f64 = 0.005;

/// Registers each set in so many orders and prints a table.
pub fn run(data: &Path, sets: &[String], orders: u64) -> anyhow::Result<()> {
    println!("| set | orders | all placed | `good` | plane, mm | from the poses, mm | within 0.5 % | CPU s each |");
    println!("| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |");
    for name in sets {
        let set = KnownSet::read(data, name)?;
        let scorer = Scorer::new(&set)?;
        let with_poses = scorer.plane_mm(&registered(&set, &set.poses)?).context("a view was left out")?;
        let (mut placed, mut good, mut within, mut seconds) = (0, 0, 0, 0.0);
        let (mut least, mut most) = (f64::INFINITY, 0.0f64);
        for order in 0..orders {
            let strange = set.made_strange(order);
            let begin = cpu_seconds()?;
            let outcome = registered(&strange, &[])?;
            seconds += cpu_seconds()? - begin;
            good += usize::from(outcome.report.to_json()["verdict"]["quality"] == "good");
            let Some(plane_mm) = Scorer::new(&strange)?.plane_mm(&outcome) else { continue };
            placed += 1;
            within += usize::from(plane_mm <= (1.0 + ALLOWED_EXCESS) * with_poses);
            (least, most) = (least.min(plane_mm), most.max(plane_mm));
        }
        println!(
            "| {name} | {orders} | {placed} | {good} | {least:.5}-{most:.5} | {with_poses:.5} | {within} | {:.2} |",
            seconds / orders.max(1) as f64
        );
    }
    Ok(())
}

/// Registers a set by the default method; without `poses` from its scans alone.
pub fn registered(set: &KnownSet, poses: &[Motion]) -> anyhow::Result<RegisteredModel> {
    let name = |view: usize| format!("s{view}.ply");
    let scan = |(view, cloud): (usize, &visage::geometry::Cloud)| NamedScan {
        name: name(view),
        surface: Surface { cloud: cloud.clone(), ..Surface::default() },
    };
    let scans = set.clouds.iter().enumerate().map(scan).collect();
    let initial: BTreeMap<String, Motion> = poses.iter().enumerate().map(|(view, pose)| (name(view), *pose)).collect();
    let options = Options { cloud: false, signature: false, ..Options::default() };
    Ok(pipeline::run(scans, &initial, Unit::M, &options, &Progress::silent())?)
}

/// User and system seconds of this process.
pub fn cpu_seconds() -> anyhow::Result<f64> {
    let usage = getrusage(UsageWho::RUSAGE_SELF).context("asking for the CPU time of this process")?;
    Ok((usage.user_time().num_microseconds() + usage.system_time().num_microseconds()) as f64 * 1e-6)
}

/// What poses of a set are scored by.
pub struct Scorer {
    /// The prepared scans.
    pub views: Vec<View>,
    /// Overlaps at the true poses, both ways, of all pairs i < j.
    pub pairs: Vec<ScoredPair>,
}

impl Scorer {
    /// Measures the overlaps.
    pub fn new(set: &KnownSet) -> anyhow::Result<Scorer> {
        let views: Vec<View> =
            set.clouds.iter().map(View::new).collect::<Result<_, _>>().context("an unusable scan")?;
        let truth: Vec<Motion> = views.iter().zip(&set.poses).map(|(view, pose)| view.local_pose(pose)).collect();
        let targets: Vec<&IndexedPoints> = views.iter().map(|view| &view.indexed).collect();
        let queries: Vec<&[LocalPoint]> = views.iter().map(View::points).collect();
        let reach = TOUCHING * common_spacing(&views);
        let xi = overlaps(&targets, &queries, &truth, reach, &Progress::silent())?;
        let of = |i, j| ScoredPair { views: (i, j), overlaps: (xi.directed(i, j), xi.directed(j, i)) };
        let pairs = (0..views.len()).flat_map(|i| (i + 1..views.len()).map(move |j| (i, j)));
        Ok(Scorer { pairs: pairs.map(|(i, j)| of(i, j)).collect(), views })
    }

    /// The plane objective in mm; `None` if a view has no place.
    fn plane_mm(&self, outcome: &RegisteredModel) -> Option<f64> {
        const MM: f64 = 1e3;
        let local = |(view, (_, pose)): (&View, &(String, Option<Motion>))| Some(view.local_pose(&(*pose)?));
        let poses: Vec<Motion> = self.views.iter().zip(&outcome.poses).map(local).collect::<Option<_>>()?;
        let scored: Vec<ScoredPair> =
            self.pairs.iter().filter(|pair| pair.overlaps.0.min(pair.overlaps.1) > SCORED_OVERLAP).copied().collect();
        Some(MM * objective(&self.views, &poses, &scored).plane)
    }
}
