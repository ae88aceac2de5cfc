//! The mesh of a registered set, against the object that was scanned.

use std::collections::BTreeMap;

use visage::geometry::neighbours::IndexedPoints;
use visage::geometry::{Mesh, Point3, Unit};
use visage::pipeline::{self, Fill, NamedScan, Options, RegisteredModel};
use visage::progress::Progress;
use visage::synthetic::Specimen;
use visage::synthetic::head::{Proportions, head};
use visage::synthetic::scanner::Scanner;
use visage::synthetic::truth::disturb;

const SCANNER: Scanner = Scanner { views: 8, distance: 600.0, resolution: 2.5, noise: 0.15, grazing_angle: 75.0 };

fn registered(specimen: &Specimen, options: Options) -> RegisteredModel {
    let set = SCANNER.scan_set(&specimen.mesh, 1);
    let names: Vec<String> = (0..set.scans.len()).map(|view| format!("scan_{view:02}.ply")).collect();
    let begin = names.iter().cloned().zip(disturb(&set.poses, 0.04, 3.0, 1)).collect();
    let scans = names.into_iter().zip(set.scans).map(|(name, surface)| NamedScan { name, surface }).collect();
    pipeline::run(scans, &begin, Unit::Mm, &options, &Progress::silent()).expect("a sound set")
}

/// Without the signature, which takes its time.
fn options(fill: Fill) -> Options {
    Options { fill, signature: false, ..Options::default() }
}

/// How many edges belong to one triangle alone, as a share of all.
fn share_of_rims(mesh: &Mesh) -> f64 {
    let mut edges: BTreeMap<[u32; 2], usize> = BTreeMap::new();
    for face in &mesh.faces {
        for k in 0..3 {
            let (a, b) = (face[k], face[(k + 1) % 3]);
            *edges.entry([a.min(b), a.max(b)]).or_default() += 1;
        }
    }
    assert!(edges.values().all(|count| *count <= 2), "an edge of three triangles");
    edges.values().filter(|count| **count == 1).count() as f64 / edges.len() as f64
}

#[test]
fn a_head_gets_a_mesh_that_says_what_was_seen() {
    let specimen = head(&Proportions::of(1));
    let outcome = registered(&specimen, options(Fill::Small));
    let surface = outcome.mesh.expect("a mesh is made when nothing is said");
    assert_eq!(outcome.report.surface.as_ref(), Some(&surface.report));
    let layers = surface.report.layers.as_ref().expect("the scans overlap");
    assert!(layers.scans.iter().all(|scan| scan.name.is_some() && scan.distance < layers.spacing), "{layers:?}");
    assert!(surface.report.reasons.is_empty(), "{:?}", surface.report.reasons);
    let mesh = &surface.surface.mesh;
    assert_eq!(outcome.report.to_json()["surface"]["triangles"], mesh.faces.len());
    let support = surface.surface.support.as_ref().expect("it says what was seen");
    assert_eq!((support.len(), surface.report.reconstruction.vertices), (mesh.vertices.len(), mesh.vertices.len()));
    let preview = surface.preview.as_ref().expect("a small copy is made when nothing is said");
    assert!(preview.mesh.faces.len() <= 20_000 && preview.mesh.signed_volume_6() > 0.0);
    assert!(mesh.signed_volume_6() > 0.0, "it is inside out");
    let rims = share_of_rims(mesh);
    assert!(rims < 0.02, "{rims} of the edges are rims");
    let seen = support.iter().filter(|support| **support >= 1.0).count();
    assert!(seen as f64 > 0.95 * mesh.vertices.len() as f64, "{seen} of {} vertices were seen", mesh.vertices.len());
    // view 0 keeps its pose, so the world is that of the head
    let truth = IndexedPoints::new(specimen.mesh.vertices.iter().map(|p| p.coords.cast::<f32>().into()).collect());
    let mut distances: Vec<f32> = mesh
        .vertices
        .iter()
        .filter_map(|vertex| truth.tree.nearest(&vertex.coords.cast::<f32>().into(), f32::INFINITY))
        .map(|near| near.distance2.sqrt())
        .collect();
    distances.sort_by(f32::total_cmp);
    let (median, most) = (distances[distances.len() / 2], distances[distances.len() * 95 / 100]);
    println!("rims {rims:.4}, seen {seen} of {}, distances {median:.3} and {most:.3} mm", mesh.vertices.len());
    assert!(median < 1.5 && most < 3.0, "{median} and {most} mm from the head's vertices");
}

#[test]
fn all_holes_are_closed_where_that_is_wanted() {
    let specimen = head(&Proportions::of(1));
    let surface = registered(&specimen, options(Fill::All)).mesh.expect("a mesh");
    assert_eq!(share_of_rims(&surface.surface.mesh), 0.0);
    assert_eq!(surface.report.reconstruction.open_holes, 0);
    assert!(surface.surface.support.is_some_and(|support| support.contains(&0.0)), "what nobody saw says so");
}

#[test]
fn where_no_mesh_or_no_cloud_is_wanted_there_is_none() {
    let specimen = head(&Proportions::of(1));
    for wanted in [Options { mesh: false, ..options(Fill::Small) }, Options { cloud: false, ..options(Fill::Small) }] {
        let outcome = registered(&specimen, wanted.clone());
        assert_eq!((&outcome.mesh, &outcome.report.surface), (&None, &None), "{wanted:?}");
        assert_eq!(outcome.cloud.is_some(), wanted.cloud);
        assert!(outcome.report.to_json().get("surface").is_none());
    }
}

#[test]
fn the_face_is_cut_out_where_that_is_wanted() {
    let specimen = head(&Proportions::of(1));
    let whole = registered(&specimen, Options { signature: true, ..options(Fill::Small) });
    let cut = registered(&specimen, Options { deface: true, ..options(Fill::Small) });
    assert_eq!((whole.report.face_cut, cut.report.face_cut), (None, Some(true)));
    assert!(cut.signature.is_none(), "it was not asked for");
    let landmarks = whole.signature.as_ref().and_then(|signature| signature.landmarks()).expect("a face");
    let nearest = |outcome: &RegisteredModel, place: &Point3| {
        let cloud = &outcome.cloud.as_ref().expect("a cloud").cloud.points;
        let mesh = &outcome.mesh.as_ref().expect("a mesh").surface.mesh.vertices;
        cloud.iter().chain(mesh).map(|point| (point - place).norm()).fold(f64::INFINITY, f64::min)
    };
    for place in &landmarks {
        assert!(nearest(&whole, place) < 6.0 && nearest(&cut, place) > 12.0, "{place}: {}", nearest(&cut, place));
    }
    let count = |outcome: &RegisteredModel| outcome.cloud.as_ref().expect("a cloud").cloud.len() as f64;
    assert!((0.4..0.9).contains(&(count(&cut) / count(&whole))), "the rest of the head stays");
}
