//! The tables of the report, in Markdown.

use std::fmt::Write;

use super::Judged;
use visage::faces::judgement::MATCH_SCORE;
use visage::faces::modes::LANDMARKS;
use visage::faces::{self, MatchMethod, Verdict, standard};
use visage::gallery::measures;

/// The methods in the order in which they build on each other.
pub const METHODS: [(MatchMethod, &str); 3] = [
    (MatchMethod::Literal, "literal triangle"),
    (MatchMethod::Descriptors, "+ descriptors"),
    (MatchMethod::Verified, "+ dense verification"),
];

/// The verdict by a method.
pub fn verdict(judged: &Judged, method: MatchMethod) -> Verdict {
    faces::judge(&judged.signature, &standard::face(), method)
}

/// The scores of the faces and of the others.
pub fn scores(all: &[Judged], method: MatchMethod) -> [Vec<f64>; 2] {
    [true, false]
        .map(|face| all.iter().filter(|m| m.row.face == face).map(|m| verdict(m, method).score).collect::<Vec<f64>>())
}

/// All tables.
pub fn all(all: &[Judged]) -> String {
    let mut text = String::new();
    let faces = all.iter().filter(|m| m.row.face).count();
    let _ = writeln!(text, "# Faces: {faces} faces and {} other things, units taken as unknown\n", all.len() - faces);
    steps(&mut text, all);
    residuals(&mut text, all);
    landmarks(&mut text, all);
    matching_errors(&mut text, all);
    text
}

fn steps(text: &mut String, all: &[Judged]) {
    let _ = writeln!(
        text,
        "## Step by step\n\n| method | AUC | faces found | others taken for faces |\n| --- | --- | --- | --- |"
    );
    for (method, name) in METHODS {
        let [faces, others] = scores(all, method);
        let auc = measures::auc(&faces, &others).map_or("-".to_owned(), |auc| format!("{auc:.3}"));
        let over = |scores: &[f64]| scores.iter().filter(|score| **score >= MATCH_SCORE).count();
        let (found, wrong) = (over(&faces), over(&others));
        let _ = writeln!(text, "| {name} | {auc} | {found} of {} | {wrong} of {} |", faces.len(), others.len());
    }
}

fn residuals(text: &mut String, all: &[Judged]) {
    let mut fits: Vec<(f64, &Judged)> = all.iter().filter_map(|m| Some((m.signature.fit()?.residual_mm, m))).collect();
    fits.sort_by(|a, b| a.0.total_cmp(&b.0));
    let worst = fits.iter().rev().find(|(_, m)| m.row.face);
    let best = fits.iter().find(|(_, m)| !m.row.face);
    if let (Some((worst_mm, worst)), Some((best_mm, best))) = (worst, best) {
        let (face, other) = (&worst.row.file, &best.row.file);
        let ratio = worst_mm / best_mm;
        let _ = writeln!(
            text,
            "\nDense residual: worst face {worst_mm:.2} mm ({face}), best other thing {best_mm:.2} mm ({other}), ratio {ratio:.2}."
        );
    }
}

fn landmarks(text: &mut String, all: &[Judged]) {
    let _ = writeln!(
        text,
        "\n## Landmarks\nError in mm on the standard, over models whose landmarks are exact or published.\n\n\
         | landmark | models | median | 90 % |\n| --- | --- | --- | --- |"
    );
    for (index, name) in LANDMARKS.iter().enumerate() {
        let mut errors: Vec<f64> = all
            .iter()
            .filter(|m| m.row.face && m.row.landmarks_hold)
            .filter_map(|m| {
                let (truth, fit, found) = (m.row.landmarks.get(name)?, m.signature.fit()?, m.signature.landmarks()?);
                Some((found[index] - truth).norm() / fit.pose.scale)
            })
            .collect();
        errors.sort_by(f64::total_cmp);
        if let (Some(median), Some(high)) = (errors.get(errors.len() / 2), errors.get(errors.len() * 9 / 10)) {
            let _ = writeln!(text, "| {name} | {} | {median:.2} | {high:.2} |", errors.len());
        }
    }
}

fn matching_errors(text: &mut String, all: &[Judged]) {
    let _ = writeln!(
        text,
        "\n## The paper's Table 3 for these faces\nSum of the three distances after the paper's alignment, mm on the \
         standard: of the best triangle of salient regions (method `literal`), and of the best facial triangle.\n\n\
         | face | literal | descriptors | dense residual |\n| --- | --- | --- | --- |"
    );
    for model in all.iter().filter(|m| m.row.face) {
        let [literal, facial] = [MatchMethod::Literal, MatchMethod::Descriptors].map(|m| verdict(model, m));
        let residual = model.signature.fit().map_or("-".to_owned(), |fit| format!("{:.2}", fit.residual_mm));
        let (a, b) = (literal.sum_of_distances_mm, facial.sum_of_distances_mm);
        let _ = writeln!(text, "| {} | {a:.2} | {b:.2} | {residual} |", model.row.file);
    }
}
