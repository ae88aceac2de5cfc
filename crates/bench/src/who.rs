//! `visage-bench who`: does what is left of a scanned head tell whose it is, among many?
//!
//! The people are code-made heads: eight measures and a relief of each one's own. A probe is one of them with a third of its triangles, noise of 0.3 mm on the
//! standard and turned at random. How hard that is depends on how near the nearest pairs are, so that is measured too, for
//! the same number of comparisons on the real heads of a labelled set if one is given.

use std::f64::consts::TAU;
use std::path::PathBuf;

use clap::Args;
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;

use super::faces::dataset;
use visage::faces::{self, DenseSignature, Signature};
use visage::gallery::{Gallery, ModelId, TopK};
use visage::geometry::{Cloud, Mesh, Motion, Surface, Unit, Vector3};
use visage::progress::Progress;
use visage::synthetic::head::{Proportions, head};

/// How many people there are.
#[derive(Debug, Args)]
pub struct WhoArgs {
    /// Code-made people in the gallery
    #[arg(long, default_value_t = 1000)]
    people: u64,
    /// How many of them are asked about
    #[arg(long, default_value_t = 200)]
    probes: u64,
    /// How much people differ: 1 for 4 to 9 % in each of eight measures, 3 for as much as real heads
    #[arg(long, default_value_t = 3.0)]
    variety: f64,
    /// How much each face's own relief differs from the measures' face, mm (root mean square)
    #[arg(long, default_value_t = 0.5)]
    relief: f64,
    /// A labelled set: the nearest pairs of its heads (ICT and SIMPOP) are measured as well
    #[arg(long)]
    data: Option<PathBuf>,
}

/// Waves of each face's own relief.
const WAVES: usize = 24;
/// Their lengths: from a nose's width to a face's.
const WAVE_LENGTHS_MM: std::ops::Range<f64> = 30.0..120.0;
/// Noise of a probe, mm on the standard.
const NOISE_MM: f64 = 0.3;

/// What became of a probe.
struct Answer {
    person: u64,
    is_own: bool,
    /// Dense distance to its own head and to the head that came first, mm.
    own: f64,
    first: f64,
}

/// Runs the measurement and prints it.
pub fn run(args: WhoArgs) -> anyhow::Result<()> {
    let people: Vec<Signature> =
        (0..args.people).into_par_iter().map(|seed| described(&person(seed, &args))).collect::<Result<_, _>>()?;
    let gallery = Gallery::build(people.iter().enumerate().map(|(id, s)| (id as ModelId, s.clone())).collect());
    let step = (args.people / args.probes.max(1)).max(1);
    let asked: Vec<u64> = (0..args.people).step_by(step as usize).take(args.probes as usize).collect();
    let found = asked
        .par_iter()
        .map(|&seed| {
            let probe = described(&remnant(&person(seed, &args), seed))?;
            let best = gallery.by_probe(&probe, None, &TopK::best(1)).first().map(|found| found.model_id as u64);
            let distance = |person: u64| {
                let both = probe.dense().zip(people.get(person as usize)?.dense())?;
                both.0.distance_mm(both.1)
            };
            let [own, first] = [Some(seed), best].map(|person| person.and_then(distance).unwrap_or(f64::INFINITY));
            Ok(Answer { is_own: best == Some(seed), person: seed, own, first })
        })
        .collect::<anyhow::Result<Vec<Answer>>>()?;
    let missed: Vec<&Answer> = found.iter().filter(|answer| !answer.is_own).collect();
    println!("rank-1: {} of {} probes among {} people", found.len() - missed.len(), found.len(), people.len());
    for Answer { person, own, first, .. } in missed {
        println!("- missed: person {person}, {own:.2} mm from its own head, {first:.2} from the first");
    }
    println!("\n| dense distance, mm | least | 1 % | median | greatest |\n| --- | ---: | ---: | ---: | ---: |");
    println!("{}", row("probe to its own head", found.iter().map(|answer| answer.own).collect()));
    println!("{}", row("head to the nearest other", nearest(&people)));
    if let Some(data) = args.data {
        let rows = dataset::read(&data)?;
        let heads =
            rows.into_iter().filter(|row| row.face && (row.file.contains("ict_") || row.file.contains("simpop_")));
        let real: Vec<Signature> = heads
            .collect::<Vec<_>>()
            .into_par_iter()
            .map(|row| described_surface(&dataset::load(&data, &row)?))
            .collect::<Result<_, _>>()?;
        println!("{}", row(&format!("the same of {} real heads", real.len()), nearest(&real)));
        println!("{}", row("any two real heads", pairs(&real)));
        let few: Vec<Signature> = people.iter().take(real.len()).cloned().collect();
        println!("{}", row("any two of as many code-made heads", pairs(&few)));
    }
    Ok(())
}

fn person(seed: u64, args: &WhoArgs) -> Mesh {
    let p = Proportions::of(seed);
    let nearer = |factor: f64| 1.0 + args.variety * (factor - 1.0);
    let proportions = Proportions {
        size: nearer(p.size),
        eye_distance: nearer(p.eye_distance),
        nose_length: nearer(p.nose_length),
        nose_depth: nearer(p.nose_depth),
        nose_width: nearer(p.nose_width),
        mouth_width: nearer(p.mouth_width),
        jaw_width: nearer(p.jaw_width),
        chin_depth: nearer(p.chin_depth),
    };
    let mut mesh = head(&proportions).mesh;
    raise(&mut mesh, seed, args.relief);
    mesh
}

/// Moves the surface along its normals by [`WAVES`] waves of random length, direction and phase: eight measures alone
/// make a thousand heads lie far nearer to each other than real ones do.
fn raise(mesh: &mut Mesh, seed: u64, relief_mm: f64) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(1);
    let waves: [(Vector3, f64); WAVES] = std::array::from_fn(|_| {
        let direction = Vector3::from_fn(|_, _| StandardNormal.sample(&mut rng));
        let length_mm = rng.random_range(WAVE_LENGTHS_MM);
        (direction.normalize() * (TAU / length_mm), rng.random_range(0.0..TAU))
    });
    let amplitude = relief_mm * (2.0 / WAVES as f64).sqrt();
    let normals = mesh.vertex_normals();
    for (vertex, normal) in mesh.vertices.iter_mut().zip(normals) {
        let height: f64 = waves.iter().map(|(wave, phase)| (wave.dot(&vertex.coords) + phase).cos()).sum();
        *vertex += normal * (amplitude * height);
    }
}

/// A third of the triangles, turned, with noise. Code-made heads are in mm of the standard.
fn remnant(mesh: &Mesh, seed: u64) -> Mesh {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut faces = mesh.faces.clone();
    faces.shuffle(&mut rng);
    faces.truncate(mesh.faces.len() / 3);
    let axis = Vector3::from_fn(|_, _| rng.random_range(-3.0..3.0));
    let motion = Motion::new(Vector3::new(30.0, -7.0, 2.0), axis);
    let mut noisy = |p: &visage::geometry::Point3| {
        motion * p
            + Vector3::from_fn(|_, _| {
                let x: f64 = StandardNormal.sample(&mut rng);
                NOISE_MM * x
            })
    };
    Mesh { vertices: mesh.vertices.iter().map(&mut noisy).collect(), faces }
}

fn described(mesh: &Mesh) -> anyhow::Result<Signature> {
    let cloud = Cloud { points: mesh.vertices.clone(), ..Cloud::default() };
    described_surface(&Surface { cloud, faces: mesh.faces.clone(), ..Surface::default() })
}

fn described_surface(surface: &Surface) -> anyhow::Result<Signature> {
    Ok(faces::describe(surface, Unit::Unknown, &Progress::silent())?)
}

/// For each head the dense distance to the nearest other.
fn nearest(heads: &[Signature]) -> Vec<f64> {
    let dense: Vec<&DenseSignature> = heads.iter().filter_map(Signature::dense).collect();
    let distances = |k: usize| {
        let others = dense.iter().enumerate().filter(move |(other, _)| *other != k);
        others.filter_map(|(_, other)| dense[k].distance_mm(other)).fold(f64::INFINITY, f64::min)
    };
    (0..dense.len()).into_par_iter().map(distances).collect()
}

/// The dense distance of every two heads.
fn pairs(heads: &[Signature]) -> Vec<f64> {
    let dense: Vec<&DenseSignature> = heads.iter().filter_map(Signature::dense).collect();
    (0..dense.len())
        .flat_map(|k| dense[..k].iter().filter_map(|other| other.distance_mm(dense[k])).collect::<Vec<_>>())
        .collect()
}

fn row(name: &str, mut values: Vec<f64>) -> String {
    values.sort_by(f64::total_cmp);
    let at = |share: f64| values.get(((values.len() as f64 * share) as usize).min(values.len().saturating_sub(1)));
    let cell = |share: f64| at(share).map_or("-".to_owned(), |value| format!("{value:.2}"));
    format!("| {name} | {} | {} | {} | {} |", cell(0.0), cell(0.01), cell(0.5), cell(1.0))
}
