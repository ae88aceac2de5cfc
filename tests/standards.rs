//! A class that is no face, made of one code-made teapot: the others of its class are told from other things.

use visage::geometry::{Cloud, Mesh, Motion, Point3, Surface, Unit, Vector3};
use visage::progress::Progress;
use visage::standards::{Annotation, CornerKind, Landmark, Standard, limit};
use visage::synthetic::{objects, shapes};

fn teapot(seed: u64) -> Mesh {
    shape("teapot", seed)
}

fn shape(name: &str, seed: u64) -> Mesh {
    let catalogue = shapes::catalogue();
    catalogue.iter().find(|shape| shape.name == name).expect("it is in the catalogue").mesh(seed)
}

fn turned(mesh: Mesh, turn: f64) -> Surface {
    let motion = Motion::new(Vector3::new(turn, 2.0, -turn), Vector3::new(turn, -0.7 * turn, 0.3));
    Surface { cloud: Cloud::from_points(mesh.vertices).moved(&motion), faces: mesh.faces, ..Surface::default() }
}

fn class() -> Standard {
    let mesh = teapot(1);
    let farthest = |far: &dyn Fn(&Point3) -> f64| {
        *mesh.vertices.iter().max_by(|a, b| far(a).total_cmp(&far(b))).expect("a mesh with vertices")
    };
    let landmark = |name: &str, place: Point3| Landmark { name: name.to_owned(), place };
    let landmarks = vec![
        landmark("spout", farthest(&|p| p.y - p.x)),
        landmark("knob", farthest(&|p| p.y - 2.0 * p.x.abs())),
        landmark("handle", farthest(&|p| p.x)),
    ];
    let surface = Surface { cloud: Cloud::from_points(mesh.vertices), faces: mesh.faces, ..Surface::default() };
    let annotation = Annotation { landmarks, triangle: None };
    Standard::annotated(&surface, Unit::Mm, &annotation, &Progress::silent()).expect("three caps")
}

#[test]
fn teapots_are_told_from_jugs_mugs_and_other_things() {
    let class = class();
    assert!(class.triangles[0].corners.iter().all(|corner| corner.kind == CornerKind::Cap));
    let residual = |mesh: Mesh, turn: f64| {
        let found = class.find(&turned(mesh, turn), Unit::Unknown, &Progress::silent()).expect("a sound surface");
        found.map_or(limit::NOTHING_FOUND_MM, |found| found.residual_mm)
    };
    let of_class: Vec<f64> = [(2, 0.4), (3, -1.3)].map(|(seed, turn)| residual(teapot(seed), turn)).into();
    let others = [objects::jug().mesh, shape("mug", 1), shape("vase", 1)];
    let others: Vec<f64> = others.into_iter().zip([0.9, -0.5, 1.7]).map(|(mesh, turn)| residual(mesh, turn)).collect();
    let learned = limit::learn(&of_class, &others);
    assert_eq!(learned.auc, Some(1.0), "{of_class:?} {others:?}");
    assert!(of_class.iter().all(|r| *r < limit::DEFAULT_LIMIT_MM), "{of_class:?}");
    assert!(others.iter().all(|r| *r > limit::DEFAULT_LIMIT_MM), "{others:?}");
}
