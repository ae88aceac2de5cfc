//! What disturbances do to a verdict.

use std::fmt::Write;

use rayon::prelude::*;

use super::disturbances::{DISTURBANCES, Disturbance, Subject};
use super::tables::verdict;
use super::{Judged, described};
use crate::faces::judgement::MATCH_SCORE;
use crate::faces::{MatchMethod, judge, standard};

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
}

/// For each disturbance: how many verdicts stay, and how much scores change. Some are for faces only.
pub fn table(all: &[Judged]) -> String {
    let mut text = String::from(
        "\n## Disturbed\nThe change of the score is the largest and the median over the models.\n\n\
         | disturbance | same verdict | largest change | median | other verdict |\n| --- | --- | --- | --- | --- |\n",
    );
    for disturbance in &DISTURBANCES {
        let models: Vec<&Judged> = all.iter().filter(|m| m.row.face || !disturbance.faces_only).collect();
        let changes: Vec<Change> =
            models.par_iter().enumerate().map(|(seed, model)| changed(disturbance, model, seed as u64)).collect();
        let kept = changes.iter().filter(|change| change.keeps_its_verdict()).count();
        let mut sizes: Vec<f64> = changes.iter().map(|change| (change.before - change.after).abs()).collect();
        sizes.sort_by(f64::total_cmp);
        let (most, median) = (sizes.last().copied().unwrap_or(0.0), sizes.get(sizes.len() / 2).copied());
        let lost = changes.iter().filter(|change| !change.keeps_its_verdict()).map(|change| change.file);
        let _ = writeln!(
            text,
            "| {} | {kept} of {} | {most:.3} | {:.4} | {} |",
            disturbance.name,
            changes.len(),
            median.unwrap_or(0.0),
            lost.collect::<Vec<_>>().join(", ")
        );
    }
    text
}

fn changed<'a>(disturbance: &Disturbance, model: &'a Judged, seed: u64) -> Change<'a> {
    let before = verdict(model, MatchMethod::Verified);
    // elsewhere a fit is no face, and its scale no millimetre
    let pose = before.fit.filter(|_| model.row.face).map(|fit| fit.pose);
    let copy = disturbance.apply(&Subject { surface: &model.surface, pose }, seed);
    let after = described(&copy).map_or(0.0, |s| judge(&s, &standard::face(), MatchMethod::Verified).score);
    Change { file: &model.row.file, before: before.score, after }
}
