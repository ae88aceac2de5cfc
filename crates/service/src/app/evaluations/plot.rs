//! An evaluation as a picture: the ROC curve on the left, the figures of the rankings as bars on the right.

use std::fmt::Write;

use super::{Evaluation, Rankings, VerdictFigures};

/// Edge of a panel, and the room around it, pixels.
const PANEL: f64 = 320.0;
const MARGIN: f64 = 60.0;
const STYLE: &str = "<style>text{font:13px sans-serif;fill:#222}.grid{stroke:#ddd}.axis{stroke:#222;fill:none}\
                     .curve{stroke:#1f5fa8;stroke-width:2;fill:none}.chance{stroke:#999;stroke-dasharray:4}\
                     .bar{fill:#1f5fa8}</style>";

/// The picture.
pub fn svg(evaluation: &Evaluation) -> String {
    let (width, height) = (2.0 * PANEL + 3.0 * MARGIN, PANEL + 2.0 * MARGIN);
    let mut panels = String::new();
    match &evaluation.verdicts {
        Some(verdicts) => curve(&mut panels, verdicts),
        None => note(&mut panels, MARGIN, "verdicts: too few labelled models"),
    }
    match &evaluation.rankings {
        Some(rankings) => bars(&mut panels, rankings, PANEL + 2.0 * MARGIN),
        None => note(&mut panels, PANEL + 2.0 * MARGIN, "rankings: no two models share a label"),
    }
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" \
         height=\"{height}\">{STYLE}<rect width=\"100%\" height=\"100%\" fill=\"white\"/>{panels}</svg>\n"
    )
}

fn curve(out: &mut String, verdicts: &VerdictFigures) {
    frame(out, MARGIN);
    let place = |x: f64, y: f64| format!("{:.1},{:.1}", MARGIN + x * PANEL, MARGIN + (1.0 - y) * PANEL);
    let points = verdicts.roc.iter().map(|point| place(point.false_positive_rate, point.true_positive_rate));
    let points: Vec<String> = std::iter::once(place(0.0, 0.0)).chain(points).collect();
    let (left, right, bottom) = (MARGIN, MARGIN + PANEL, MARGIN + PANEL);
    line(out, "chance", [left, bottom, right, MARGIN]);
    let _ = write!(out, "<polyline class=\"curve\" points=\"{}\"/>", points.join(" "));
    let [low, high] = verdicts.auc_interval;
    let label = escaped(&verdicts.label);
    text(
        out,
        left,
        MARGIN - 28.0,
        &format!("{label}: {} of {}", verdicts.positives, verdicts.positives + verdicts.negatives),
    );
    let figures =
        format!("AUC {:.3} ({low:.3} to {high:.3}), equal error rate {:.3}", verdicts.auc, verdicts.equal_error_rate);
    text(out, left, MARGIN - 10.0, &figures);
    text(out, left + 0.3 * PANEL, bottom + 36.0, "false positive rate");
    let _ = write!(
        out,
        "<text transform=\"translate({:.1} {:.1}) rotate(-90)\">true positive rate</text>",
        left - 38.0,
        bottom - 0.3 * PANEL
    );
}

fn bars(out: &mut String, rankings: &Rankings, left: f64) {
    frame(out, left);
    let figures = &rankings.mean;
    let bars = [
        ("NN", figures.nearest_neighbour),
        ("tier 1", figures.first_tier),
        ("tier 2", figures.second_tier),
        ("DCG", figures.discounted_cumulative_gain),
        ("mAP", figures.average_precision),
    ];
    let step = PANEL / bars.len() as f64;
    text(out, left, MARGIN - 10.0, &format!("{} probes, {} classes", rankings.probes, rankings.classes.len()));
    for (index, (name, value)) in bars.into_iter().enumerate() {
        let (x, top) = (left + (index as f64 + 0.15) * step, MARGIN + (1.0 - value) * PANEL);
        let (width, height) = (0.7 * step, value * PANEL);
        let _ = write!(
            out,
            "<rect class=\"bar\" x=\"{x:.1}\" y=\"{top:.1}\" width=\"{width:.1}\" height=\"{height:.1}\"/>"
        );
        text(out, x, MARGIN + PANEL + 36.0, name);
        text(out, x, top - 4.0, &format!("{value:.2}"));
    }
}

/// A square from 0 to 1 with a grid of quarters.
fn frame(out: &mut String, left: f64) {
    for quarter in 0..=4 {
        let (share, end) = (f64::from(quarter) / 4.0, left + PANEL);
        let y = MARGIN + (1.0 - share) * PANEL;
        line(out, "grid", [left, y, end, y]);
        text(out, left - 30.0, y + 4.0, &format!("{share:.2}"));
    }
    let _ = write!(
        out,
        "<rect class=\"axis\" x=\"{left:.1}\" y=\"{MARGIN:.1}\" width=\"{PANEL:.1}\" height=\"{PANEL:.1}\"/>"
    );
}

fn line(out: &mut String, class: &str, [x1, y1, x2, y2]: [f64; 4]) {
    let _ = write!(out, "<line class=\"{class}\" x1=\"{x1:.1}\" y1=\"{y1:.1}\" x2=\"{x2:.1}\" y2=\"{y2:.1}\"/>");
}

fn text(out: &mut String, x: f64, y: f64, content: &str) {
    let _ = write!(out, "<text x=\"{x:.1}\" y=\"{y:.1}\">{content}</text>");
}

fn note(out: &mut String, left: f64, content: &str) {
    text(out, left, MARGIN + 0.5 * PANEL, content);
}

/// Labels are users' text.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_gallery::measures::RocPoint;

    #[test]
    fn the_curve_runs_from_corner_to_corner_and_labels_are_text() {
        let point = |false_positive_rate, true_positive_rate| RocPoint {
            threshold: 0.5,
            true_positive_rate,
            false_positive_rate,
        };
        let verdicts = VerdictFigures {
            label: "<script>".to_owned(),
            positives: 2,
            negatives: 3,
            auc: 0.75,
            auc_interval: [0.5, 1.0],
            equal_error_rate: 0.25,
            best_accuracy: 0.8,
            best_threshold: 0.5,
            roc: vec![point(0.0, 0.5), point(1.0, 1.0)],
        };
        let svg = svg(&Evaluation { models: 5, labels: 2, verdicts: Some(verdicts), rankings: None });
        assert!(svg.contains("points=\"60.0,380.0 60.0,220.0 380.0,60.0\""), "{svg}");
        assert!(svg.contains("&lt;script&gt;: 2 of 5") && !svg.contains("<script>"));
        assert!(svg.contains("AUC 0.750 (0.500 to 1.000)") && svg.contains("no two models share a label"));
    }
}
