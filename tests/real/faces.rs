//! Faces against everything else on the public set: `VISAGE_DATA=... cargo test --release -- --ignored`.

use std::sync::OnceLock;
use std::time::Instant;

use rand::{RngExt, SeedableRng, seq::SliceRandom};
use rand_chacha::ChaCha8Rng;
use visage::faces::judgement::MATCH_SCORE;
use visage::faces::modes::LANDMARKS;
use visage::faces::{self, MatchMethod, Signature, standard};
use visage::formats::{ReadLimits, read_surface};
use visage::gallery::{Gallery, TopK, measures};
use visage::geometry::{Cloud, Motion, Point3, Surface, Unit, Vector3};
use visage::progress::Progress;

use crate::{data, read};

struct Row {
    file: String,
    face: bool,
    /// A whole head or face of the two morphable models: one that can be told from the others.
    person: bool,
    /// Exact or published landmarks in the order of [`LANDMARKS`]; others are left out.
    landmarks: Vec<Option<Point3>>,
}

/// The rows of the manifest with ambiguous = 0. No field before the landmarks holds a comma outside of quotes that
/// matters here: quoted commas are taken out first.
fn public_set() -> Vec<Row> {
    let text = std::fs::read_to_string(data("faces/manifest.csv")).expect("the manifest is there");
    let plain: String = text
        .split('"')
        .enumerate()
        .map(|(k, part)| if k % 2 == 1 { part.replace(',', ";") } else { part.to_owned() })
        .collect();
    let mut lines = plain.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let header = lines.next().expect("a header");
    let column = |name: &str| header.iter().position(|c| *c == name).expect("a known column");
    let marks = LANDMARKS.map(column);
    let [ambiguous, label, method, completeness] =
        ["ambiguous", "label", "landmark_method", "completeness"].map(column);
    let position = |field: &str| -> Option<Point3> {
        let values: Vec<f64> = field.split_whitespace().filter_map(|v| v.parse().ok()).collect();
        <[f64; 3]>::try_from(values).ok().map(Point3::from)
    };
    lines
        .filter(|fields| fields[ambiguous] == "0")
        .map(|fields| {
            let holds = fields[method] == "exact" || fields[method].starts_with("published");
            let modelled = fields[0].contains("/ict_") || fields[0].contains("/simpop_");
            Row {
                file: fields[0].to_owned(),
                face: fields[label] == "face",
                person: modelled && fields[completeness] == "whole",
                landmarks: marks.map(|c| position(fields[c]).filter(|_| holds)).to_vec(),
            }
        })
        .collect()
}

fn load(file: &str) -> Surface {
    let bytes = read(data("faces").join(file));
    read_surface(file, &bytes, &ReadLimits::default()).expect("a sound model")
}

fn described(surface: &Surface) -> Signature {
    faces::describe(surface, Unit::Unknown, &Progress::silent()).expect("a sound model")
}

/// Each row of the public set with its model and signature, every unit taken as unknown.
fn gallery() -> &'static [(Row, Surface, Signature)] {
    static MODELS: OnceLock<Vec<(Row, Surface, Signature)>> = OnceLock::new();
    MODELS.get_or_init(|| {
        let start = Instant::now();
        let mut reading = 0.0;
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool");
        let models: Vec<_> = pool.install(|| {
            public_set()
                .into_iter()
                .map(|row| {
                    let begun = Instant::now();
                    let surface = load(&row.file);
                    reading += begun.elapsed().as_secs_f64();
                    let signature = described(&surface);
                    (row, surface, signature)
                })
                .collect()
        });
        let each = (start.elapsed().as_secs_f64() - reading) / models.len() as f64;
        println!("{} models, {each:.3} s each on one thread", models.len());
        models
    })
}

/// The scores of the faces and of the others, best first.
fn scores(method: MatchMethod) -> [Vec<f64>; 2] {
    let mut judged: Vec<(f64, &Row)> = gallery()
        .iter()
        .map(|(row, _, signature)| (faces::judge(signature, &standard::face(), method).score, row))
        .collect();
    judged.sort_by(|a, b| b.0.total_cmp(&a.0));
    for (score, row) in &judged {
        println!("{method:?} {score:.3} {} {}", if row.face { "face " } else { "other" }, row.file);
    }
    [true, false].map(|face| judged.iter().filter(|(_, row)| row.face == face).map(|(score, _)| *score).collect())
}

#[test]
#[ignore = "needs VISAGE_DATA"]
fn descriptors_tell_faces_from_other_things() {
    let [faces, others] = scores(MatchMethod::Descriptors);
    let auc = measures::auc(&faces, &others).expect("both classes are there");
    let right =
        faces.iter().filter(|s| **s >= MATCH_SCORE).count() + others.iter().filter(|s| **s < MATCH_SCORE).count();
    let accuracy = right as f64 / (faces.len() + others.len()) as f64;
    println!("descriptors: AUC {auc:.3}, accuracy at the threshold {accuracy:.3}");
    assert!(auc >= 0.97, "{auc}");
    assert!(accuracy >= 0.85, "{accuracy}");
}

#[test]
#[ignore = "needs VISAGE_DATA"]
fn the_dense_check_splits_faces_from_other_things() {
    let [faces, others] = scores(MatchMethod::Verified);
    let auc = measures::auc(&faces, &others).expect("both classes are there");
    let residual = |(_, _, signature): &&(Row, Surface, Signature)| signature.fit().map_or(99.0, |fit| fit.residual_mm);
    let worst_face = gallery().iter().filter(|(row, ..)| row.face).map(|m| residual(&m)).fold(0.0, f64::max);
    let best_other = gallery().iter().filter(|(row, ..)| !row.face).map(|m| residual(&m)).fold(99.0, f64::min);
    println!("verified: AUC {auc:.3}, worst face {worst_face:.2} mm, best other {best_other:.2} mm");
    assert_eq!(auc, 1.0);
    assert!(faces.iter().all(|s| *s >= MATCH_SCORE) && others.iter().all(|s| *s < MATCH_SCORE));
    assert!(worst_face <= 0.75 * best_other);
}

#[test]
#[ignore = "needs VISAGE_DATA"]
fn landmarks_are_where_the_models_say() {
    for (index, name) in LANDMARKS.iter().enumerate() {
        let mut errors: Vec<f64> = gallery()
            .iter()
            .filter_map(|(row, _, signature)| {
                let (truth, found) = (row.landmarks[index]?, signature.landmarks()?[index]);
                Some((found - truth).norm() / signature.fit()?.pose.scale)
            })
            .collect();
        errors.sort_by(f64::total_cmp);
        let median = errors[errors.len() / 2];
        println!("{name}: median {median:.2} mm over {} models", errors.len());
        assert!(errors.len() >= 30 && median <= 2.5, "{name}: {median:.2} mm");
    }
}

/// A third of the triangles, turned, with noise of 0.3 mm on the standard.
fn remnant(surface: &Surface, mm: f64, seed: u64) -> Surface {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut faces = surface.faces.clone();
    faces.shuffle(&mut random);
    faces.truncate(surface.faces.len() / 3);
    let axis = Vector3::from_fn(|_, _| random.random_range(-3.0..3.0));
    let motion = Motion::new(Vector3::new(30.0, -7.0, 2.0), axis);
    let mut copy = Surface { cloud: surface.cloud.moved(&motion), faces, ..Surface::default() };
    for point in &mut copy.cloud.points {
        // the sum of twelve has the variance 1
        let normal = |_, _| (0..12).map(|_| random.random_range(-0.5..0.5)).sum::<f64>();
        *point += Vector3::from_fn(normal) * 0.3 * mm;
    }
    copy
}

#[test]
#[ignore = "needs VISAGE_DATA"]
fn a_third_of_a_head_tells_who_it_is() {
    let people: Vec<_> = gallery().iter().filter(|(row, ..)| row.person).collect();
    assert_eq!(people.len(), 30);
    let index = Gallery::build(people.iter().enumerate().map(|(id, (.., s))| (id as u128, s.clone())).collect());
    let mut first = 0;
    for (id, (row, surface, signature)) in people.iter().enumerate() {
        let mm = signature.fit().expect("a face").pose.scale;
        let ranked = index.by_probe(&described(&remnant(surface, mm, id as u64)), None, &TopK::best(2));
        let scores: Vec<f64> = ranked.iter().map(|m| m.score).collect();
        println!("{} {scores:.2?}", row.file);
        first += usize::from(ranked[0].model_id == id as u128);
    }
    println!("who is it: {first} of {}", people.len());
    assert!(first >= 29, "{first}");
}

#[test]
#[ignore = "needs VISAGE_DATA"]
fn the_literal_triangle_hardly_tells_them_apart() {
    let [faces, others] = scores(MatchMethod::Literal);
    let auc = measures::auc(&faces, &others).expect("both classes are there");
    println!("literal, N = 10: AUC {auc:.3}");
    assert!((0.6..0.85).contains(&auc), "{auc}: nearer to chance or to perfect than the paper's triangle can be");
}

/// The model turned, grown, moved, wound the other way round and with noise of 0.05 % of its diagonal.
fn disturbed(surface: &Surface, seed: u64) -> Surface {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let axis = Vector3::from_fn(|_, _| random.random_range(-3.0..3.0));
    let motion = Motion::new(Vector3::new(30.0, -7.0, 2.0), axis);
    let noise = 0.0005 * surface.cloud.bounds().expect("a sound model").diagonal();
    let mut copy = surface.moved(&motion);
    for point in &mut copy.cloud.points {
        *point = Point3::from((point.coords + Vector3::from_fn(|_, _| random.random_range(-noise..noise))) * 3.7);
    }
    copy
}

#[test]
#[ignore = "needs VISAGE_DATA"]
fn a_disturbed_copy_finds_its_original() {
    let models = gallery();
    let index = Gallery::build(models.iter().enumerate().map(|(id, (.., s))| (id as u128, s.clone())).collect());
    let mut first = 0;
    for (id, (row, surface, _)) in models.iter().enumerate() {
        let ranked = index.by_probe(&described(&disturbed(surface, id as u64)), None, &TopK::best(3));
        let rank = ranked.iter().position(|m| m.model_id == id as u128);
        println!("{} rank {rank:?} scores {:.2?}", row.file, ranked.iter().map(|m| m.score).collect::<Vec<_>>());
        first += usize::from(rank == Some(0));
    }
    let share = first as f64 / models.len() as f64;
    println!("probe: {first} of {} copies find their original first ({share:.2})", models.len());
    assert!(share >= 0.7, "{share}");
}

/// A quarter of the vertices with 0.2 mm of noise on the standard, without triangles.
fn sparse_cloud(surface: &Surface, mm: f64, seed: u64) -> Surface {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut points = surface.cloud.points.clone();
    points.shuffle(&mut random);
    points.truncate(points.len() / 4);
    for point in &mut points {
        let normal = |_, _| (0..12).map(|_| random.random_range(-0.5..0.5)).sum::<f64>();
        *point += Vector3::from_fn(normal) * 0.2 * mm;
    }
    Surface { cloud: Cloud::from_points(points), ..Surface::default() }
}

#[test]
#[ignore = "needs VISAGE_DATA"]
fn sparse_noisy_clouds_keep_their_verdict() {
    // every fourth model: the whole table is `visage-bench faces --robustness`
    for (id, (row, surface, signature)) in gallery().iter().enumerate().step_by(4) {
        let fit = signature.fit().filter(|_| row.face);
        let diagonal = surface.cloud.bounds().expect("a sound model").diagonal();
        let cloud = sparse_cloud(surface, fit.map_or(diagonal / 350.0, |fit| fit.pose.scale), id as u64);
        let judge = |s: &Signature| faces::judge(s, &standard::face(), MatchMethod::Verified).score;
        let [before, after] = [judge(signature), judge(&described(&cloud))];
        println!("{} {before:.3} {after:.3}", row.file);
        assert_eq!(before >= MATCH_SCORE, after >= MATCH_SCORE, "{}: {before} {after}", row.file);
    }
}

#[test]
#[ignore = "needs VISAGE_DATA"]
fn turned_and_inward_wound_faces_stay_faces() {
    let (mut kept, mut all) = (0, 0);
    for (id, (row, surface, signature)) in gallery().iter().enumerate() {
        let mut copy = disturbed(surface, 1000 + id as u64);
        for face in &mut copy.faces {
            face.swap(0, 1);
        }
        let judge = |s: &Signature| faces::judge(s, &standard::face(), MatchMethod::Descriptors).score;
        let [before, after] = [judge(signature), judge(&described(&copy))];
        println!("{} {before:.3} {after:.3}", row.file);
        all += 1;
        kept += usize::from((before >= MATCH_SCORE) == (after >= MATCH_SCORE));
    }
    println!("turned, inward wound, noise: {kept} of {all} verdicts stay");
    assert!(kept * 10 >= all * 8, "{kept} of {all}");
}
