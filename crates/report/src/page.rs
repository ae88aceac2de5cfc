//! All of a model on one page that needs nothing else: no script, no other file, no network.

use askama::Template;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;

use super::advice::{self, Advice, InWords};
use super::draw::draw;
use super::found::{Found, Pair, View};
use super::kind::Kind;
use super::material::{Made, Material, PictureError, Wish};
use visage_geometry::progress::{Canceled, Progress};
use visage_picture::legend::number;
use visage_picture::size::Size;

/// The pictures of a page, in their order.
pub const PICTURES: &[Kind] = &[
    Kind::Shaded,
    Kind::Views,
    Kind::Start,
    Kind::Section,
    Kind::Support,
    Kind::Landmarks,
    Kind::Graph,
    Kind::Overlap,
    Kind::Convergence,
];
/// More scans or pairs are counted and not listed.
const MOST_ROWS: usize = 400;

/// A picture on the page.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Shown {
    kind: Kind,
    uri: String,
}

impl Shown {
    /// A picture that was made.
    ///
    /// # Errors
    /// What its encoder says.
    pub fn new(kind: Kind, made: &Made) -> Result<Shown, super::material::WriteError> {
        let uri = match made.to_svg() {
            Some(svg) => format!("data:image/svg+xml;base64,{}", STANDARD.encode(svg)),
            None => format!("data:image/png;base64,{}", STANDARD.encode(made.to_png()?)),
        };
        Ok(Shown { kind, uri })
    }
}

/// Draws a picture for the page; `None` for what this model has no picture of.
///
/// # Errors
/// [`Canceled`], while it is at work.
pub fn shown(kind: Kind, of: &Material, progress: &Progress) -> Result<Option<Shown>, Canceled> {
    // plots keep the size that their letters are made for
    let size = if kind.is_plot() { Size::clamped(720, 600) } else { Size::clamped(720, 540) };
    match draw(kind, of, &Wish { size, ..Wish::of(kind) }, progress) {
        Ok(made) => Ok(Shown::new(kind, &made).ok()),
        Err(PictureError::Canceled(canceled)) => Err(canceled),
        Err(PictureError::Lacking { .. } | PictureError::Surface(_)) => Ok(None),
    }
}

/// What the page is of.
#[derive(Debug, Clone, Default)]
pub struct Subject {
    /// The model's name.
    pub name: String,
    /// Its id, if it has one.
    pub id: Option<String>,
    /// Its points.
    pub points: u64,
    /// The unit of its lengths, as its name.
    pub unit: &'static str,
    /// What its report says, if it has one.
    pub found: Option<Found>,
    /// The options that it was made with, by name.
    pub options: Vec<(String, String)>,
}

/// Options by name; those that have no value are left out.
pub fn options_in_words(options: &impl serde::Serialize) -> Vec<(String, String)> {
    let fields = serde_json::to_value(options).unwrap_or_default();
    let word = |value: &serde_json::Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
    let fields = fields.as_object().into_iter().flatten().filter(|(_, value)| !value.is_null());
    fields.map(|(name, value)| (name.clone(), word(value))).collect()
}

/// The page could not be written.
#[derive(Debug, thiserror::Error)]
#[error("the page can't be written: {0}")]
pub struct PageError(#[from] askama::Error);

/// The page.
///
/// # Errors
/// What the template says; it has nothing to say of what is in memory.
pub fn html(subject: &Subject, pictures: &[Shown]) -> Result<String, PageError> {
    let found = subject.found.as_ref();
    let nothing = Found::default();
    let of = found.unwrap_or(&nothing);
    let links = of.links();
    let weak = of.weak();
    let page = Page {
        subject,
        verdict: advice::verdict(found),
        reasons: of.result.verdict.as_ref().map(|verdict| verdict.reasons.as_slice()).unwrap_or_default(),
        advice: advice::advice(of),
        not_shown: advice::not_shown(found),
        pictures,
        facts: facts(subject, of),
        views: of.result.views.iter().take(MOST_ROWS).map(ViewRow::new).collect(),
        more_views: of.result.views.len().saturating_sub(MOST_ROWS),
        pairs: links.iter().zip(&weak).take(MOST_ROWS).map(|(pair, weak)| PairRow::new(of, pair, *weak)).collect(),
        more_pairs: links.len().saturating_sub(MOST_ROWS),
        notes: of.result.pose_notes.iter().chain(&of.result.unit_notes).collect(),
        run: run(of),
    };
    Ok(page.render()?)
}

#[derive(Template)]
#[template(path = "report.html")]
struct Page<'a> {
    subject: &'a Subject,
    verdict: InWords,
    reasons: &'a [String],
    advice: Vec<Advice>,
    not_shown: Vec<&'static str>,
    pictures: &'a [Shown],
    facts: Vec<(&'static str, String)>,
    views: Vec<ViewRow<'a>>,
    more_views: usize,
    pairs: Vec<PairRow<'a>>,
    more_pairs: usize,
    notes: Vec<&'a String>,
    run: Vec<(String, String)>,
}

/// A scan as a row of text.
struct ViewRow<'a> {
    name: &'a str,
    points: u64,
    place: &'static str,
    residual: String,
    confidence: String,
    displacement: String,
}

impl<'a> ViewRow<'a> {
    fn new(view: &'a View) -> Self {
        let displacement = view.uncertainty.as_ref().and_then(|uncertainty| uncertainty.displacement_spacings);
        ViewRow {
            name: &view.name,
            points: view.points,
            place: match (view.placed, &view.copy_of) {
                (_, Some(_)) => "copy",
                (true, None) => "yes",
                (false, None) => "no",
            },
            residual: figure(view.residual_spacings),
            confidence: view.confidence.map_or_else(dash, |sure| format!("{:.0} %", 100.0 * sure)),
            displacement: figure(displacement),
        }
    }
}

/// Two scans as a row of text.
struct PairRow<'a> {
    a: &'a str,
    b: &'a str,
    overlap: String,
    residual: String,
    disagreement: String,
    is_weak: bool,
}

impl<'a> PairRow<'a> {
    fn new(found: &'a Found, pair: &Pair, is_weak: bool) -> Self {
        let name = |index: usize| found.result.views.get(index).map_or("", |view| view.name.as_str());
        let spacings = |length: f64| figure(Some(length / found.result.spacing));
        let percent = |share: f64| if share.is_finite() { format!("{:.0} %", 100.0 * share) } else { dash() };
        PairRow {
            a: name(pair.i),
            b: name(pair.j),
            overlap: format!("{} / {}", percent(pair.overlap_i_j), percent(pair.overlap_j_i)),
            residual: spacings(pair.trimmed_rms),
            disagreement: spacings(pair.disagreement),
            is_weak,
        }
    }
}

fn dash() -> String {
    "\u{2013}".to_owned()
}

fn figure(value: Option<f64>) -> String {
    value.filter(|value| value.is_finite()).map_or_else(dash, number)
}

/// What the model is, in a few figures.
fn facts(subject: &Subject, found: &Found) -> Vec<(&'static str, String)> {
    let unit = if subject.unit == "unknown" { "" } else { subject.unit };
    let result = &found.result;
    let mut facts = vec![("Points", subject.points.to_string())];
    if !result.views.is_empty() {
        let placed = result.views.iter().filter(|view| view.placed).count();
        facts.push(("Scans", format!("{placed} of {} have a place", result.views.len())));
    }
    if let Some(confidence) = result.confidence {
        facts.push(("Confidence", format!("{:.0} %", 100.0 * confidence)));
    }
    if result.spacing.is_finite() && result.spacing > 0.0 {
        facts.push(("Spacing of the scans", format!("{} {unit}", number(result.spacing))));
    }
    if let Some(surface) = &result.surface {
        facts.push(("Triangles", surface.triangles.to_string()));
        facts.push(("Holes", format!("{} closed, {} left open", surface.closed_holes, surface.open_holes)));
        facts.push(("Never seen", format!("{:.1} % of the surface", 100.0 * surface.unseen_area)));
    }
    facts.push(("Unit", subject.unit.to_owned()));
    facts
}

/// How it was made.
fn run(found: &Found) -> Vec<(String, String)> {
    let run = &found.run;
    let mut rows = Vec::new();
    let mut put = |name: &str, value: Option<String>| rows.extend(value.map(|value| (name.to_owned(), value)));
    put("visage", run.version.clone());
    put("Version of signatures", run.signature_version.map(|version| version.to_string()));
    put("Method", found.result.method.clone());
    put("Threads", run.threads.map(|threads| threads.to_string()));
    let seconds: f64 = run.seconds.values().filter_map(serde_json::Value::as_f64).sum();
    put("Seconds", (!run.seconds.is_empty()).then(|| format!("{seconds:.1}")));
    put("Most memory", run.peak_memory_bytes.map(|bytes| format!("{} MB", bytes / 1_000_000)));
    put("System", run.host.os.as_ref().map(|os| format!("{os} {}", run.host.arch.as_deref().unwrap_or_default())));
    rows
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::found::{Findings, Verdict};

    const HOSTILE: &str = "<script>alert(\"1\")</script>&'\u{202e}.ply";

    fn subject() -> Subject {
        let view = |name: &str| View { name: name.to_owned(), placed: true, points: 7, ..View::default() };
        let pair = Pair { i: 0, j: 1, trust: 1.0, overlap_i_j: 0.5, overlap_j_i: f64::NAN, ..Pair::default() };
        let result = Findings {
            views: vec![view(HOSTILE), view("b.ply")],
            pairs: vec![pair],
            spacing: 0.5,
            verdict: Some(Verdict { quality: "doubtful".to_owned(), reasons: vec![HOSTILE.to_owned()] }),
            pose_notes: vec![HOSTILE.to_owned()],
            method: Some(HOSTILE.to_owned()),
            ..Findings::default()
        };
        Subject {
            name: HOSTILE.to_owned(),
            id: None,
            points: 14,
            unit: "mm",
            found: Some(Found { result, ..Found::default() }),
            options: vec![(HOSTILE.to_owned(), HOSTILE.to_owned())],
        }
    }

    #[test]
    fn text_from_outside_stays_text() {
        let html = html(&subject(), &[]).expect("written");
        assert!(!html.contains("<script") && html.matches("&#60;script&#62;").count() >= 6, "{html}");
        assert!(html.contains("Look at this before you use it"));
    }

    #[test]
    fn a_page_needs_nothing_from_elsewhere() {
        let material = Material { found: subject().found, ..Material::default() };
        let of_kind = |kind: &Kind| shown(*kind, &material, &Progress::silent()).expect("not canceled");
        let pictures: Vec<Shown> = PICTURES.iter().filter_map(of_kind).collect();
        assert_eq!(pictures.len(), 2, "there is no surface: the graph and the overlap");
        let html = html(&subject(), &pictures).expect("written");
        assert!(html.starts_with("<!doctype html>") && html.trim_end().ends_with("</html>"));
        assert_eq!(html.matches("src=\"data:image/svg+xml;base64,").count(), 2);
        assert_eq!(html.matches(" alt=\"").count(), 2);
        let elsewhere = ["http:", "https:", "url(", "@import", "<link", "srcset", "<iframe", "javascript:"];
        assert!(elsewhere.iter().all(|word| !html.contains(word)));
    }

    #[test]
    fn an_uploaded_model_has_a_page_too() {
        let plain = Subject { name: "mug".to_owned(), points: 9, unit: "unknown", ..Subject::default() };
        let html = html(&plain, &[]).expect("written");
        assert!(html.contains("Uploaded as it is") && !html.contains("<h2>Scans</h2>"), "{html}");
    }
}
