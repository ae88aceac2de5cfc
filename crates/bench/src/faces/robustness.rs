//! What disturbances do to a verdict.

use std::fmt::Write;

use rayon::prelude::*;

use super::disturbances::{DISTURBANCES, Disturbance, Subject};
use super::tables::verdict;
use super::{Judged, described};
use visage::faces::judgement::MATCH_SCORE;
use visage::faces::{MatchMethod, judge, standard};

/// A model's score before and after a disturbance.
struct Change<'a> {
    file: &'a str,
    before: f64,
    after: f64,
}

impl Change<'_> {
    fn keeps_its_verdict(&self) -> bool {
        (self.before >= MATCH_SCORE) == (self.after >= MATCH_SCORE)
    }

    fn size(&self) -> f64 {
        (self.before - self.after).abs()
    }
}

/// For each disturbance whose name contains one of `names` (all if there are none): how many verdicts stay, and how much
/// scores change. Some are for faces only. A model's disturbances are the same whichever other models take part.
pub fn table(all: &[Judged], names: &[String]) -> String {
    let mut text = String::from(
        "\n## Disturbed\nThe change of the score is the largest and the median over the models.\n\n\
         | disturbance | same verdict | largest change | of | median | other verdict |\n| --- | --- | --- | --- | --- | --- |\n",
    );
    let is_wanted = |d: &&Disturbance| names.is_empty() || names.iter().any(|name| d.name.contains(name.as_str()));
    for disturbance in DISTURBANCES.iter().filter(is_wanted) {
        let models: Vec<&Judged> = all.iter().filter(|m| m.row.face || !disturbance.faces_only).collect();
        let mut changes: Vec<Change> = models.par_iter().map(|model| changed(disturbance, model)).collect();
        let kept = changes.iter().filter(|change| change.keeps_its_verdict()).count();
        changes.sort_by(|a, b| b.size().total_cmp(&a.size()));
        let most = changes.first().map_or(String::new(), |c| format!("{:.3} | {}", c.size(), c.file));
        let median = changes.get(changes.len() / 2).map_or(0.0, Change::size);
        let lost = changes.iter().filter(|change| !change.keeps_its_verdict());
        let lost: Vec<String> = lost.map(|c| format!("{} ({:.2} to {:.2})", c.file, c.before, c.after)).collect();
        let (name, count) = (disturbance.name, changes.len());
        let _ = writeln!(text, "| {name} | {kept} of {count} | {most} | {median:.4} | {} |", lost.join(", "));
    }
    text
}

fn changed<'a>(disturbance: &Disturbance, model: &'a Judged) -> Change<'a> {
    let before = verdict(model, MatchMethod::Verified);
    // elsewhere a fit is no face, and its scale no millimetre
    let pose = before.fit.filter(|_| model.row.face).map(|fit| fit.pose);
    let copy = disturbance.apply(&Subject { surface: &model.surface, pose }, seed_of(&model.row.file));
    let after = described(&copy).map_or(0.0, |s| judge(&s, &standard::face(), MatchMethod::Verified).score);
    Change { file: &model.row.file, before: before.score, after }
}

/// FNV-1a: the seed goes with the name.
fn seed_of(file: &str) -> u64 {
    file.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}
