//! Retrieval of anything by its shape as a whole: code-made things, turned, with noise, differently meshed, find their
//! own kind among others.

use std::collections::BTreeMap;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use visage::geometry::{Mesh, Motion, Point3, Vector3};
use visage::retrieval::measures::RankingMeasures;
use visage::saliency::{CurvedSurface, ShapeProfile, Side, orientation};
use visage::synthetic::shapes;

/// The profile of a mesh, as it is made for signatures.
fn profile(mesh: &Mesh) -> ShapeProfile {
    let side = orientation::side_of_mesh(mesh);
    let surface = CurvedSurface::from_mesh(mesh, side.first_sign());
    let total: f64 = surface.areas.iter().sum();
    let weighted = || surface.points.iter().zip(&surface.areas);
    let center = Point3::from(weighted().map(|(p, a)| p.coords * *a).sum::<Vector3>() / total);
    let radius = (weighted().map(|(p, a)| (p - center).norm_squared() * a).sum::<f64>() / total).sqrt();
    ShapeProfile::of(&surface, radius, side != Side::Unknown)
}

/// Turned at random, with 0.3 mm of noise on some, and every face of some cut into four.
fn varied(mesh: Mesh, variation: u64) -> Mesh {
    let mut rng = ChaCha8Rng::seed_from_u64(variation);
    let mut mesh = if variation % 3 == 1 { subdivided(mesh) } else { mesh };
    let noise = if variation % 3 == 2 { 0.3 } else { 0.0 };
    let mut number = || rng.random_range(-1.0..1.0);
    let mut vector = |most: f64| Vector3::new(number(), number(), number()) * most;
    let motion = Motion::new(vector(300.0), vector(3.0));
    for vertex in &mut mesh.vertices {
        *vertex = motion * (*vertex + vector(noise));
    }
    mesh
}

fn subdivided(mesh: Mesh) -> Mesh {
    let mut vertices = mesh.vertices.clone();
    let mut between = BTreeMap::new();
    let mut faces = Vec::new();
    for [a, b, c] in mesh.faces {
        let [ab, bc, ca] = [(a, b), (b, c), (c, a)].map(|(p, q)| {
            *between.entry((p.min(q), p.max(q))).or_insert_with(|| {
                vertices.push(nalgebra::center(&mesh.vertices[p as usize], &mesh.vertices[q as usize]));
                vertices.len() as u32 - 1
            })
        });
        faces.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
    }
    Mesh { vertices, faces }
}

#[test]
fn things_find_their_own_kind() {
    let kinds = ["bean", "animal", "bracket", "gem", "leaf", "propeller", "mug", "torus"];
    let shapes = shapes::catalogue();
    let models: Vec<(usize, u64)> = (0..kinds.len()).flat_map(|kind| (0..3).map(move |seed| (kind, seed))).collect();
    let profiles: Vec<(usize, ShapeProfile)> = models
        .par_iter()
        .map(|&(kind, seed)| {
            let shape = shapes.iter().find(|shape| shape.name == kinds[kind]).expect("it is in the catalogue");
            (kind, profile(&varied(shape.mesh(seed + 1), seed)))
        })
        .collect();
    let measured: Vec<RankingMeasures> = profiles
        .iter()
        .enumerate()
        .map(|(index, (kind, probe))| {
            let others = profiles.iter().enumerate().filter(|(other, _)| *other != index);
            let mut ranked: Vec<(f64, bool)> =
                others.map(|(_, (other, p))| (probe.likeness(p).expect("both have one"), other == kind)).collect();
            ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
            let members: Vec<bool> = ranked.into_iter().map(|(_, is_member)| is_member).collect();
            RankingMeasures::of(&members).expect("two others are of its kind")
        })
        .collect();
    let mean = RankingMeasures::mean(&measured).expect("there are probes");
    println!("{mean:?}");
    assert!(mean.nearest_neighbour >= 0.95 && mean.first_tier >= 0.9 && mean.average_precision >= 0.93, "{mean:?}");
}
