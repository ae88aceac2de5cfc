//! Answers held against brute force: everything is measured on every model, from the signatures themselves.

use anyhow::ensure;
use rayon::prelude::*;

use super::load::{Kind, Question};
use super::population::Population;
use visage::faces::judgement::triples;
use visage::faces::{self, MatchMethod, Shape, Signature, Triangle, standard};
use visage::gallery::{self, Gallery, ModelId};
use visage::geometry::{Point3, Vector3};

/// Compares the answers to some questions of each kind; fails at the first that differs. Gives the number compared.
pub fn compare(
    gallery: &Gallery,
    population: &Population,
    models: u64,
    count: usize,
    limit: usize,
) -> anyhow::Result<usize> {
    let kinds = [Kind::Triangle, Kind::TriangleEitherSide, Kind::DenseProbe, Kind::ThingProbe];
    let mut questions: Vec<Question> =
        kinds.iter().flat_map(|kind| (0..count as u64).map(|k| Question::new(*kind, population, models, k))).collect();
    questions.push(Question::Standard(MatchMethod::Verified));
    let brute = brute_force(&questions, population, models, limit);
    for (question, brute) in questions.iter().zip(&brute) {
        let found: Vec<(f64, ModelId)> =
            question.ask(gallery, limit).into_iter().map(|m| (1.0 - m.score, m.model_id)).collect();
        ensure!(found.len() == brute.len(), "{} models were found, {} by brute force", found.len(), brute.len());
        for (rank, (found, brute)) in found.iter().zip(brute).enumerate() {
            // the same figure by another order of operations
            let same = found.1 == brute.1 && (found.0 - brute.0).abs() < 1e-9;
            ensure!(same, "rank {rank}: model {} ({}), by brute force {} ({})", found.1, found.0, brute.1, brute.0);
        }
    }
    Ok(questions.len())
}

/// For each question the `limit` models of least cost, ties by id.
fn brute_force(questions: &[Question], population: &Population, models: u64, limit: usize) -> Vec<Vec<(f64, ModelId)>> {
    let shapes: Vec<Vec<Shape>> = questions.iter().map(labelings).collect();
    let numbers: Vec<u64> = (0..models).collect();
    let mut best: Vec<Vec<(f64, ModelId)>> = vec![Vec::new(); questions.len()];
    for chunk in numbers.chunks(1 << 14) {
        let models: Vec<Signature> = chunk.par_iter().map(|&number| population.model(number)).collect();
        let likenesses: Vec<Vec<f64>> = questions.iter().map(|question| likenesses(question, &models)).collect();
        let costs: Vec<Vec<Option<f64>>> = models
            .par_iter()
            .enumerate()
            .map(|(k, model)| {
                let of_probes: Vec<Option<f64>> = likenesses.iter().map(|likeness| likeness.get(k).copied()).collect();
                costs(questions, &shapes, &of_probes, model)
            })
            .collect();
        for (number, costs) in chunk.iter().zip(costs) {
            for (best, cost) in best.iter_mut().zip(costs) {
                best.extend(cost.map(|cost| (cost, ModelId::from(*number))));
            }
        }
        for best in &mut best {
            best.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            best.truncate(limit);
        }
    }
    best
}

/// How like each model is to the probe of a question; nothing for other questions.
fn likenesses(question: &Question, models: &[Signature]) -> Vec<f64> {
    match question {
        Question::Probe(probe) => gallery::likenesses(probe, models),
        Question::Triangle { .. } | Question::Standard(_) => Vec::new(),
    }
}

/// What a model costs each question: 1 minus its score; `None` where it has nothing in common with it.
fn costs(
    questions: &[Question],
    shapes: &[Vec<Shape>],
    likenesses: &[Option<f64>],
    model: &Signature,
) -> Vec<Option<f64>> {
    let all = shapes_of(model);
    let judged = faces::judge(model, &standard::face(), MatchMethod::Verified).score;
    let cost = |((question, shapes), likeness): ((&Question, &Vec<Shape>), &Option<f64>)| match question {
        Question::Triangle { .. } => {
            let chords = all.iter().flat_map(|shape| shapes.iter().map(|query| query.chord(shape)));
            Some(chords.fold(f64::INFINITY, f64::min)).filter(|chord| chord.is_finite())
        }
        Question::Standard(_) => Some(1.0 - judged),
        Question::Probe(_) => likeness.filter(|likeness| *likeness > 0.0).map(|likeness| 1.0 - likeness),
    };
    questions.iter().zip(shapes).zip(likenesses).map(cost).collect()
}

/// Every triangle of a model, labelled one way.
fn shapes_of(model: &Signature) -> Vec<Shape> {
    let regions: Vec<(Point3, Vector3)> = model.regions().map(|r| (r.center, r.normal)).collect();
    let facial = model.candidates().map(|c| [0, 1, 2].map(|k| (c.corners[k], c.normals[k])));
    let shape = |corners: [(Point3, Vector3); 3]| {
        Triangle::new(corners.map(|c| c.0)).shape(&corners.iter().map(|c| c.1).sum::<Vector3>())
    };
    triples(&regions).chain(facial).map(shape).collect()
}

/// A triangle's shape with its corners in every order, seen from the given side or from both.
fn labelings(question: &Question) -> Vec<Shape> {
    let Question::Triangle { corners: [a, b, c], outward } = question else { return Vec::new() };
    let side = outward.unwrap_or_else(|| (b - a).cross(&(c - a)));
    let sides = if outward.is_some() { vec![side] } else { vec![side, -side] };
    let orders = [[a, b, c], [b, c, a], [c, a, b], [b, a, c], [a, c, b], [c, b, a]];
    let shapes = sides.iter().flat_map(|side| orders.map(|order| Triangle::new(order.map(|p| *p)).shape(side)));
    shapes.collect()
}
