//! Questions that come in at a fixed rate, whether or not earlier ones are answered.

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::cpu_seconds;
use super::population::Population;
use visage::config::available_threads;
use visage::faces::Signature;
use visage::gallery::{Gallery, Match, MatchMethod, TopK};
use visage::geometry::{Point3, Vector3};

/// A kind of question.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A bare triangle, seen from one side.
    Triangle,
    /// A bare triangle that may be seen from either side.
    TriangleEitherSide,
    /// The face, by one of the methods.
    Standard,
    /// A face: who is it like?
    DenseProbe,
    /// Something that is surely no face.
    ThingProbe,
}

/// One question.
pub enum Question {
    Triangle { corners: [Point3; 3], outward: Option<Vector3> },
    Standard(MatchMethod),
    Probe(Box<Signature>),
}

impl Kind {
    fn name(self) -> &'static str {
        match self {
            Kind::Triangle => "by triangle",
            Kind::TriangleEitherSide => "by triangle, either side",
            Kind::Standard => "by standard",
            Kind::DenseProbe => "by dense probe",
            Kind::ThingProbe => "by a thing as probe",
        }
    }
}

impl Question {
    /// All kinds.
    pub const KINDS: [Kind; 5] =
        [Kind::Triangle, Kind::TriangleEitherSide, Kind::Standard, Kind::DenseProbe, Kind::ThingProbe];

    /// The question with this number. Half of the triangles and probes are of models that are not in the gallery,
    /// half of models that are.
    pub fn new(kind: Kind, population: &Population, models: u64, number: u64) -> Question {
        let mut rng = ChaCha8Rng::seed_from_u64(number);
        let mut model =
            || population.model(rng.random_range(0..models) + if number.is_multiple_of(2) { models } else { 0 });
        match kind {
            Kind::Standard => {
                let methods = [MatchMethod::Verified, MatchMethod::Descriptors, MatchMethod::Literal];
                Question::Standard(methods[number as usize % methods.len()])
            }
            Kind::Triangle | Kind::TriangleEitherSide => {
                let regions: Vec<_> =
                    std::iter::repeat_with(model).find_map(|s| at_least_three(&s)).unwrap_or_default();
                let first = number as usize % (regions.len() - 2);
                let corners = [0, 1, 2].map(|k| regions[first + k].0);
                let outward = [0, 1, 2].map(|k| regions[first + k].1).into_iter().sum();
                Question::Triangle { corners, outward: (kind == Kind::Triangle).then_some(outward) }
            }
            Kind::ThingProbe => {
                let no_face = |s: &Signature| s.fit().is_none_or(|fit| fit.residual_mm > 5.0);
                let probe = std::iter::repeat_with(&mut model).take(1000).find(no_face);
                Question::Probe(Box::new(probe.unwrap_or_else(model)))
            }
            Kind::DenseProbe => {
                let sure = |s: &Signature| s.dense().is_some() && s.fit().is_some_and(|fit| fit.residual_mm < 1.6);
                let probe = std::iter::repeat_with(&mut model).take(1000).find(sure);
                Question::Probe(Box::new(probe.unwrap_or_else(model)))
            }
        }
    }

    /// The gallery's answer.
    pub fn ask(&self, gallery: &Gallery, limit: usize) -> Vec<Match> {
        let top_k = TopK::best(limit);
        match self {
            Question::Triangle { corners, outward } => gallery.by_triangle(*corners, *outward, &top_k),
            Question::Standard(method) => gallery.by_standard("face", *method, &top_k).unwrap_or_default(),
            Question::Probe(probe) => gallery.by_probe(probe, None, &top_k),
        }
    }
}

fn at_least_three(signature: &Signature) -> Option<Vec<(Point3, Vector3)>> {
    let regions: Vec<_> = signature.regions().map(|region| (region.center, region.normal)).collect();
    (regions.len() >= 3).then_some(regions)
}

/// Asks everything, all of one kind, at `rate` a second on as many threads as the machine has, and gives a row of the table. Times count
/// from when a question came in.
pub fn answered(gallery: &Gallery, kind: Kind, questions: &[Question], limit: usize, rate: f64) -> String {
    let next = AtomicUsize::new(0);
    let waits = Mutex::new(Vec::with_capacity(questions.len()));
    let (cpu, start) = (cpu_seconds(), Instant::now());
    std::thread::scope(|scope| {
        for _ in 0..available_threads() {
            scope.spawn(|| {
                loop {
                    let number = next.fetch_add(1, Ordering::Relaxed);
                    let Some(question) = questions.get(number) else { break };
                    let due = start + Duration::from_secs_f64(number as f64 / rate);
                    std::thread::sleep(due.saturating_duration_since(Instant::now()));
                    std::hint::black_box(question.ask(gallery, limit));
                    let wait = due.elapsed().as_secs_f64();
                    waits.lock().unwrap_or_else(std::sync::PoisonError::into_inner).push(wait);
                }
            });
        }
    });
    let cpu = cpu_seconds() - cpu;
    let mut waits = waits.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
    waits.sort_by(f64::total_cmp);
    let at = |share: f64| waits.get(((waits.len() as f64 * share) as usize).min(waits.len().saturating_sub(1)));
    let ms = |share: f64| at(share).map_or(f64::NAN, |wait| 1000.0 * wait);
    let (name, count) = (kind.name(), questions.len());
    format!(
        "| {name} | {count} | {:.2} | {:.2} | {:.2} | {:.2} |",
        ms(0.5),
        ms(0.99),
        ms(1.0),
        1000.0 * cpu / count.max(1) as f64
    )
}
