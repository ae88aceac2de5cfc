//! What disturbances do to a verdict.

use std::fmt::Write;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::tables::verdict;
use super::{Judged, described};
use crate::faces::judgement::MATCH_SCORE;
use crate::faces::similarity::Similarity;
use crate::faces::{MatchMethod, judge, standard};
use crate::geometry::{Cloud, Motion, Point3, Surface, Vector3};

/// The spread of the noise on thinned clouds, mm on the standard.
const NOISE_MM: f64 = 0.2;

/// A disturbance: of the model, given where its face lies (if it has one), seeded.
type Disturbance = fn(&Surface, Option<&Similarity>, &mut ChaCha8Rng) -> Surface;

const DISTURBANCES: [(&str, bool, Disturbance); 7] = [
    ("turned at random", false, turned),
    ("subdivided", false, subdivided),
    ("a quarter of the vertices, 0.2 mm noise, bare cloud", false, thinned),
    ("upper half of the face's head", true, |s, p, _| cut(s, p, |q| q.y > -20.0)),
    ("front half", true, |s, p, _| cut(s, p, |q| q.z > 40.0)),
    ("left half", true, |s, p, _| cut(s, p, |q| q.x > 0.0)),
    ("right half", true, |s, p, _| cut(s, p, |q| q.x < 0.0)),
];

/// For each disturbance: how many verdicts stay, and how much scores change. Halves are cut of faces only.
pub fn table(all: &[Judged]) -> String {
    let mut text = String::from(
        "\n## Disturbed\nThe change of the score is the largest and the median over the models.\n\n\
         | disturbance | same verdict | largest change | median | other verdict |\n| --- | --- | --- | --- | --- |\n",
    );
    for (name, faces_only, disturb) in DISTURBANCES {
        let models: Vec<&Judged> = all.iter().filter(|m| m.row.face || !faces_only).collect();
        let pairs: Vec<(f64, f64, &str)> = models
            .par_iter()
            .enumerate()
            .map(|(seed, model)| {
                let before = verdict(model, MatchMethod::Verified);
                let pose = before.fit.map(|fit| fit.pose);
                let copy = disturb(&model.surface, pose.as_ref(), &mut ChaCha8Rng::seed_from_u64(seed as u64));
                let after = described(&copy).map_or(0.0, |s| judge(&s, &standard::face(), MatchMethod::Verified).score);
                (before.score, after, model.row.file.as_str())
            })
            .collect();
        let stays = |(before, after, _): &&(f64, f64, &str)| (*before >= MATCH_SCORE) == (*after >= MATCH_SCORE);
        let kept = pairs.iter().filter(stays).count();
        let mut changes: Vec<f64> = pairs.iter().map(|(before, after, _)| (before - after).abs()).collect();
        changes.sort_by(f64::total_cmp);
        let (most, median) = (changes.last().copied().unwrap_or(0.0), changes.get(changes.len() / 2).copied());
        let lost: Vec<&str> = pairs.iter().filter(|pair| !stays(pair)).map(|(_, _, file)| *file).collect();
        let _ = writeln!(
            text,
            "| {name} | {kept} of {} | {most:.3} | {:.4} | {} |",
            pairs.len(),
            median.unwrap_or(0.0),
            lost.join(", ")
        );
    }
    text
}

fn turned(surface: &Surface, _: Option<&Similarity>, random: &mut ChaCha8Rng) -> Surface {
    let axis = Vector3::from_fn(|_, _| random.random_range(-3.0..3.0));
    let motion = Motion::new(Vector3::new(30.0, -7.0, 2.0), axis);
    Surface { cloud: surface.cloud.moved(&motion), faces: surface.faces.clone(), ..Surface::default() }
}

/// Every face cut into four.
fn subdivided(surface: &Surface, _: Option<&Similarity>, _: &mut ChaCha8Rng) -> Surface {
    let mut points = surface.cloud.points.clone();
    let mut middles = std::collections::BTreeMap::new();
    let mut middle = |a: u32, b: u32| {
        *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
            points.push(nalgebra::center(&points[a as usize], &points[b as usize]));
            points.len() as u32 - 1
        })
    };
    let mut faces = Vec::with_capacity(4 * surface.faces.len());
    for &[a, b, c] in &surface.faces {
        let (d, e, f) = (middle(a, b), middle(b, c), middle(c, a));
        faces.extend([[a, d, f], [d, b, e], [f, e, c], [d, e, f]]);
    }
    Surface { cloud: Cloud::from_points(points), faces, ..Surface::default() }
}

fn thinned(surface: &Surface, pose: Option<&Similarity>, random: &mut ChaCha8Rng) -> Surface {
    // without a face there is no millimetre: a head's height is about 250 of them
    let diagonal = surface.cloud.bounds().map_or(1.0, |b| b.diagonal());
    let noise = NOISE_MM * pose.map_or(diagonal / 350.0, |pose| pose.scale);
    let mut points = Vec::new();
    for point in &surface.cloud.points {
        if random.random_range(0..4) == 0 {
            // the sum of twelve has the variance 1
            let normal = |_, _| (0..12).map(|_| random.random_range(-0.5..0.5)).sum::<f64>();
            points.push(point + Vector3::from_fn(normal) * noise);
        }
    }
    Surface { cloud: Cloud::from_points(points), ..Surface::default() }
}

/// The faces whose corners all lie on the kept side, in the standard's frame.
fn cut(surface: &Surface, pose: Option<&Similarity>, keep: impl Fn(&Point3) -> bool) -> Surface {
    let Some(pose) = pose else { return surface.clone() };
    let kept: Vec<bool> = surface.cloud.points.iter().map(|p| keep(&pose.standard_point(p))).collect();
    let faces = surface.faces.iter().filter(|face| face.iter().all(|&v| kept[v as usize])).copied().collect();
    // vertices without faces are no surface: they would only widen the box
    let mut places = vec![u32::MAX; kept.len()];
    let mut points = Vec::new();
    for (v, point) in surface.cloud.points.iter().enumerate().filter(|(v, _)| kept[*v]) {
        places[v] = points.len() as u32;
        points.push(*point);
    }
    let renumber = |face: [u32; 3]| face.map(|v| places[v as usize]);
    let faces: Vec<[u32; 3]> = Vec::into_iter(faces).map(renumber).collect();
    Surface { cloud: Cloud::from_points(points), faces, ..Surface::default() }
}
