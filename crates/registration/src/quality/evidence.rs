//! What is known of a registration when it is judged, and the judgement: once, in one place, whatever is known.

use super::free_space::Intrusion;
use super::sharpness::sharpness;
use super::walls::mixed_faces;
use super::{Quality, Verdict, limits};
use crate::covariance::PoseCovariance;
use crate::covariance::weak_axes::weak_axes;
use crate::outcome::{Outcome, PairOutcome};
use crate::resolution::resolution;
use crate::view::View;

/// What the surfaces of placed views say by themselves.
#[derive(Debug, Clone, PartialEq)]
pub struct Surfaces {
    /// What the views resolve at their poses: a length.
    pub resolution: f64,
    /// Sharpness of each view; see [`mod@super::sharpness`].
    pub sharpness: Vec<Option<f64>>,
    /// For each view without a side the share that lies on the other face of a wall than the rest of it.
    pub mixed_faces: Vec<Option<f64>>,
}

impl Surfaces {
    /// Measures them at the poses of `result`.
    pub fn measure(views: &[View], result: &Outcome) -> Self {
        let resolution = resolution(views, result);
        let mixed_faces = result.surfels.as_ref().map(|surfels| mixed_faces(result, surfels)).unwrap_or_default();
        Surfaces { resolution, sharpness: sharpness(views, result, resolution), mixed_faces }
    }
}

/// Something that was found out elsewhere, in words, and how good a registration with it can be at best.
#[derive(Debug, Clone, PartialEq)]
pub struct Finding {
    /// No better than this.
    pub at_best: Quality,
    /// Why.
    pub reason: String,
}

impl Finding {
    /// A reason to look before the result is used.
    pub fn doubt(reason: String) -> Self {
        Finding { at_best: Quality::Doubtful, reason }
    }
}

/// All that is known. What is empty or `None` says nothing.
#[derive(Debug, Clone, Copy)]
pub struct Evidence<'a> {
    /// The names of the scans.
    pub names: &'a [String],
    /// Poses and pairs.
    pub result: &'a Outcome,
    /// What the surfaces say.
    pub surfaces: &'a Surfaces,
    /// For each view the probability that its place is right, where places were found by surface.
    pub confidences: Option<&'a [f64]>,
    /// Where scanners looked through surface.
    pub intrusions: &'a [Intrusion],
    /// If all views were taken from one place, and what moved before it could not be placed, the share of each that moved.
    pub moved: Option<&'a [f64]>,
    /// For each view the covariance of its pose,
    pub covariances: &'a [Option<PoseCovariance>],
    /// and the length in which its displacements are told.
    pub unit: f64,
    /// For each view how well its colours agree with those of its neighbours.
    pub colours: &'a [Option<f64>],
    /// What was found out elsewhere.
    pub findings: &'a [Finding],
}

impl<'a> Evidence<'a> {
    /// What poses and surfaces say by themselves.
    pub fn of_surfaces(names: &'a [String], result: &'a Outcome, surfaces: &'a Surfaces) -> Self {
        Evidence {
            names,
            result,
            surfaces,
            confidences: None,
            intrusions: &[],
            moved: None,
            covariances: &[],
            unit: surfaces.resolution,
            colours: &[],
            findings: &[],
        }
    }
}

/// Judges a registration by all that is known of it.
pub fn judge(evidence: &Evidence) -> Verdict {
    let sharpness = evidence.surfaces.sharpness.clone();
    let mut verdict = Verdict { quality: Quality::Good, reasons: Vec::new(), sharpness };
    judge_placement(evidence, &mut verdict);
    judge_sharpness(evidence, &mut verdict);
    judge_pairs(evidence, &mut verdict);
    judge_walls(evidence, &mut verdict);
    judge_confidences(evidence, &mut verdict);
    judge_free_space(evidence, &mut verdict);
    judge_what_stands_still(evidence, &mut verdict);
    judge_covariances(evidence, &mut verdict);
    judge_colours(evidence, &mut verdict);
    for finding in evidence.findings {
        verdict.lower(finding.at_best, finding.reason.clone());
    }
    verdict
}

impl Verdict {
    /// Adds a reason for which it is no better than `quality`.
    fn lower(&mut self, quality: Quality, reason: String) {
        self.quality = self.quality.max(quality);
        self.reasons.push(reason);
    }

    fn doubt(&mut self, reason: String) {
        self.lower(Quality::Doubtful, reason);
    }
}

fn judge_placement(Evidence { names, result, .. }: &Evidence, verdict: &mut Verdict) {
    let unplaced: Vec<&str> =
        names.iter().zip(&result.placed).filter(|(_, placed)| !**placed).map(|(name, _)| name.as_str()).collect();
    if unplaced.is_empty() {
        return;
    }
    let placed = names.len() - unplaced.len();
    let quality = if placed < 2 { Quality::Failed } else { Quality::Doubtful };
    verdict.lower(quality, format!("without a place among the others: {}", unplaced.join(", ")));
}

fn judge_sharpness(Evidence { names, surfaces, .. }: &Evidence, verdict: &mut Verdict) {
    let mut wrong = 0;
    for (sharpness, name) in surfaces.sharpness.iter().zip(*names) {
        let Some(sharpness) = sharpness.filter(|sharpness| *sharpness < limits::SURELY_SHARP) else { continue };
        wrong += usize::from(sharpness < limits::BLUNT);
        let touching = sharpness * 100.0;
        verdict.doubt(format!("{name} crosses its neighbours: of the points near them only {touching:.0} % touch"));
    }
    if 2 * wrong > names.len() {
        verdict.lower(Quality::Failed, format!("{wrong} of {} views don't fit their neighbours", names.len()));
    }
}

fn judge_pairs(Evidence { names, result, surfaces, .. }: &Evidence, verdict: &mut Verdict) {
    let spacing = surfaces.resolution;
    let apart = |pair: &PairOutcome| pair.disagreement / spacing > limits::DISAGREEMENT;
    let overruled: Vec<&PairOutcome> = result.pairs.iter().filter(|pair| apart(pair)).collect();
    if overruled.len() as f64 > limits::OVERRULED * result.pairs.len() as f64 {
        let named: Vec<String> = overruled
            .iter()
            .map(|pair| format!("{} - {} ({:.1})", names[pair.i], names[pair.j], pair.disagreement / spacing))
            .collect();
        verdict.doubt(format!("pairs that disagree with the averaged poses (by spacings): {}", named.join(", ")));
    }
    for pair in &result.pairs {
        let (a, b) = (&names[pair.i], &names[pair.j]);
        // too few points that touch have no distance
        if pair.correspondences == 0 {
            verdict.doubt(format!("{a} and {b} were laid on each other, and hardly a point touches"));
            continue;
        }
        let residual = pair.mean_distance2.sqrt() / spacing;
        if residual > limits::RESIDUAL && !apart(pair) {
            verdict.doubt(format!("{a} and {b} lie {residual:.1} spacings apart"));
        }
    }
}

fn judge_walls(Evidence { names, surfaces, .. }: &Evidence, verdict: &mut Verdict) {
    for (mixed, name) in surfaces.mixed_faces.iter().zip(*names) {
        if mixed.is_some_and(|share| share > limits::MIXED_FACES) {
            let remedy = "tell where the scanner stood";
            verdict.doubt(format!(
                "{name} lies on both faces of a thin wall, and which of them it saw is not clear: {remedy}"
            ));
        }
    }
}

/// A view whose place was found by its surface and that is not sure speaks against the whole.
fn judge_confidences(Evidence { names, result, confidences, .. }: &Evidence, verdict: &mut Verdict) {
    for ((sure, placed), name) in confidences.unwrap_or_default().iter().zip(&result.placed).zip(*names) {
        if *placed && *sure < limits::LEAST_SURE {
            let percent = sure * 100.0;
            verdict.doubt(format!("{name} may lie elsewhere: that its place is right is {percent:.0} % sure"));
        }
    }
}

/// A view may not have surface where another looked through.
fn judge_free_space(Evidence { names, intrusions, .. }: &Evidence, verdict: &mut Verdict) {
    for found in intrusions.iter().filter(|found| found.counts()) {
        let (name, other, percent) = (&names[found.view], &names[found.seen_by], found.share * 100.0);
        verdict.doubt(format!("{name} has {percent:.0} % of its surface there where {other} looked through"));
    }
}

/// A background that stands still holds scans from one place together, also when what stood before it was turned.
fn judge_what_stands_still(Evidence { names, moved, .. }: &Evidence, verdict: &mut Verdict) {
    let Some(moved) = moved else { return };
    let most = moved.iter().zip(*names).max_by(|a, b| a.0.total_cmp(b.0)).filter(|(share, _)| **share > 0.0);
    let seen = match most {
        Some((share, name)) => {
            let percent = (100.0 * share).ceil();
            format!("what moved before it, up to {percent:.0} % of {name}, could not be placed")
        }
        None => "if an object was turned before it, the object is not placed".into(),
    };
    verdict.doubt(format!(
        "all scans were taken from one place and show the same: what stands still holds them together, and {seen}; \
         cut the rest away (`regions` of the hints) or leave it out"
    ));
}

/// Motions that nothing holds, and poses that are not at rest.
fn judge_covariances(Evidence { names, covariances, unit, .. }: &Evidence, verdict: &mut Verdict) {
    for (pose, name) in covariances.iter().zip(*names) {
        let Some(pose) = pose else { continue };
        let axes = weak_axes(pose, *unit);
        if let Some(first) = axes.first() {
            let motions: Vec<String> = axes.iter().map(|axis| axis.in_words()).collect();
            verdict.doubt(format!("{name} can {}: {}", motions.join(", and "), first.why));
        }
        let unrest = pose.unrest() / unit;
        if unrest > limits::UNREST {
            verdict.doubt(format!("{name} would fit better {unrest:.1} spacings from where it was left"));
        }
    }
}

/// Views with texture that does not agree with that of any neighbour.
fn judge_colours(Evidence { names, colours, .. }: &Evidence, verdict: &mut Verdict) {
    for (agreement, name) in colours.iter().zip(*names) {
        if agreement.is_some_and(|agreement| agreement < limits::TEXTURE) {
            verdict.doubt(format!("the colours of {name} don't agree with its neighbours' where their surfaces meet"));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_geometry::{Cloud, Motion, Point3};

    fn sheets() -> [View; 2] {
        let sheet = || (0..400).map(|k| Point3::new(f64::from(k % 20), f64::from(k / 20), 0.0));
        [(); 2].map(|()| View::new(&Cloud::from_points(sheet().collect())).expect("a sound sheet"))
    }

    fn names() -> [String; 2] {
        ["a.ply".into(), "b.ply".into()]
    }

    #[test]
    fn a_pair_without_a_point_that_touches_has_no_distance() {
        let views = sheets();
        let result = Outcome {
            placed: vec![true; 2],
            pairs: vec![PairOutcome::unmeasured(0, 1, Motion::identity())],
            ..Outcome::alone(2)
        };
        let surfaces = Surfaces::measure(&views, &result);
        let verdict = judge(&Evidence::of_surfaces(&names(), &result, &surfaces));
        assert_eq!(verdict.quality, Quality::Doubtful);
        assert!(verdict.reasons.iter().any(|reason| reason.contains("hardly a point")), "{:?}", verdict.reasons);
        assert!(!verdict.reasons.iter().any(|reason| reason.contains("inf")), "{:?}", verdict.reasons);
    }

    #[test]
    fn each_kind_of_evidence_lowers_the_verdict_by_its_own_reason() {
        let views = sheets();
        let result = Outcome { placed: vec![true; 2], ..Outcome::alone(2) };
        let surfaces = Surfaces { sharpness: vec![Some(1.0); 2], ..Surfaces::measure(&views, &result) };
        let names = names();
        let sound = Evidence::of_surfaces(&names, &result, &surfaces);
        assert_eq!(judge(&sound).quality, Quality::Good, "{:?}", judge(&sound).reasons);
        let intrusions = [Intrusion { view: 0, seen_by: 1, share: 0.2, points: 100 }];
        let blunt = Surfaces { sharpness: vec![Some(0.7), Some(1.0)], ..surfaces.clone() };
        let mixed = Surfaces { mixed_faces: vec![None, Some(0.3)], ..surfaces.clone() };
        let findings = [Finding::doubt("a copy".into())];
        let cases = [
            (Evidence { surfaces: &blunt, ..sound }, "crosses its neighbours"),
            (Evidence { surfaces: &mixed, ..sound }, "thin wall"),
            (Evidence { confidences: Some(&[0.5, 1.0]), ..sound }, "50 % sure"),
            (Evidence { intrusions: &intrusions, ..sound }, "looked through"),
            (Evidence { moved: Some(&[0.02, 0.071]), ..sound }, "8 % of b.ply"),
            (Evidence { colours: &[None, Some(0.1)], ..sound }, "colours of b.ply"),
            (Evidence { findings: &findings, ..sound }, "a copy"),
        ];
        for (evidence, words) in cases {
            let verdict = judge(&evidence);
            assert_eq!(verdict.quality, Quality::Doubtful, "{words}");
            assert!(verdict.reasons.len() == 1 && verdict.reasons[0].contains(words), "{:?}", verdict.reasons);
        }
    }
}
