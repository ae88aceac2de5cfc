use std::collections::BTreeMap;

use super::*;
use visage_geometry::{Mesh, Point3};

/// A closed torus of `2 n m` triangles, wound outward; its colour changes around it.
fn torus(n: u32, m: u32) -> SurfaceMesh {
    let place = |k: u32| {
        let (u, v) = (f64::from(k / m) / f64::from(n), f64::from(k % m) / f64::from(m));
        let ((su, cu), (sv, cv)) = ((u * std::f64::consts::TAU).sin_cos(), (v * std::f64::consts::TAU).sin_cos());
        Point3::new((10.0 + 3.0 * cv) * cu, (10.0 + 3.0 * cv) * su, 3.0 * sv)
    };
    let cell = |k: u32| {
        let (i, j) = (k / m, k % m);
        let at = |i: u32, j: u32| (i % n) * m + j % m;
        [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]]
    };
    let vertices: Vec<Point3> = (0..n * m).map(place).collect();
    let colors = vertices.iter().map(|place| [((place.x + 13.0) * 9.0) as u8, 77, 0]).collect();
    let support = Some(vec![2.0; vertices.len()]);
    SurfaceMesh { mesh: Mesh { vertices, faces: (0..n * m).flat_map(cell).collect() }, colors: Some(colors), support }
}

/// A flat sheet of a checkered outline: `side` squares each way.
fn sheet(side: u32) -> SurfaceMesh {
    let row = side + 1;
    let place = |k: u32| Point3::new(f64::from(k % row), f64::from(k / row), 0.0);
    let cell = |k: u32| {
        let a = k / side * row + k % side;
        [[a, a + 1, a + row + 1], [a, a + row + 1, a + row]]
    };
    let mesh = Mesh { vertices: (0..row * row).map(place).collect(), faces: (0..side * side).flat_map(cell).collect() };
    SurfaceMesh { mesh, ..SurfaceMesh::default() }
}

/// For each edge how often it is passed in its direction, and against it.
fn edges(mesh: &Mesh) -> BTreeMap<[u32; 2], [usize; 2]> {
    let mut found: BTreeMap<[u32; 2], [usize; 2]> = BTreeMap::new();
    for face in &mesh.faces {
        for k in 0..3 {
            let (a, b) = (face[k], face[(k + 1) % 3]);
            found.entry([a.min(b), a.max(b)]).or_default()[usize::from(a > b)] += 1;
        }
    }
    found
}

fn euler(mesh: &Mesh) -> i64 {
    mesh.vertices.len() as i64 - edges(mesh).len() as i64 + mesh.faces.len() as i64
}

fn to(surface: &SurfaceMesh, target: Target) -> Simplified {
    simplify(surface, &target, &Progress::silent()).expect("not canceled")
}

fn triangles(count: usize) -> Target {
    Target { triangles: Some(count), max_error: None }
}

#[test]
fn a_torus_stays_a_torus_with_its_attributes() {
    let torus = torus(200, 80);
    let Simplified { surface, report } = to(&torus, triangles(2000));
    assert!((1990..=2000).contains(&report.triangles) && report.from_triangles == 32_000, "{report:?}");
    assert_eq!((report.triangles, report.vertices), (surface.mesh.faces.len(), surface.mesh.vertices.len()));
    assert!(edges(&surface.mesh).values().all(|passed| *passed == [1, 1]) && euler(&surface.mesh) == 0);
    // triangles of 2000 have edges of about 0.8: on a bend of 1 in 3 their middles are some 0.02 off
    assert!(report.error.max < 0.06 && report.error.mean < 0.015, "{report:?}");
    let volume = |mesh: &Mesh| mesh.signed_volume_6();
    assert!((volume(&surface.mesh) / volume(&torus.mesh) - 1.0).abs() < 0.01);
    let colors = surface.colors.expect("colours stay");
    for (vertex, color) in surface.mesh.vertices.iter().zip(&colors) {
        assert!((f64::from(color[0]) - (vertex.x + 13.0) * 9.0).abs() < 8.0 && color[1] == 77, "{vertex} {color:?}");
    }
    assert_eq!(surface.support, Some(vec![2.0; report.vertices]));
}

#[test]
fn a_flat_sheet_keeps_its_rim() {
    let sheet = sheet(40);
    let Simplified { surface, report } = to(&sheet, triangles(40));
    assert!(report.triangles <= 40, "{report:?}");
    assert!(report.error.max < 1e-3, "{report:?}");
    let area: f64 = (0..surface.mesh.faces.len()).map(|face| surface.mesh.area_normal(face).z / 2.0).sum();
    assert!((area - 1600.0).abs() < 0.05, "{area}");
    assert!((0..surface.mesh.faces.len()).all(|face| surface.mesh.area_normal(face).z > 0.0), "none is turned over");
}

#[test]
fn an_error_that_is_allowed_is_held_and_used() {
    let torus = torus(200, 80);
    for allowed in [0.02, 0.1] {
        let target = Target { triangles: None, max_error: Some(allowed) };
        let report = to(&torus, target).report;
        assert!(report.error.max <= allowed && report.error.max > 0.3 * allowed, "{report:?}");
        assert!(report.triangles < 16_000, "{report:?}");
        let both = to(&torus, Target { triangles: Some(20_000), ..target }).report;
        assert!((19_900..=20_000).contains(&both.triangles) && both.error.max <= allowed, "{both:?}");
    }
    let none = to(&torus, Target { triangles: None, max_error: Some(0.0) });
    assert_eq!((none.surface, none.report.error), (torus, Distances::default()));
}

#[test]
fn the_result_is_the_same_for_any_number_of_threads() {
    let torus = torus(120, 60);
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| to(&torus, Target { triangles: Some(900), max_error: Some(1.0) }))
    };
    let one = with(1);
    assert_eq!(one, with(3));
    let levels = levels(&torus, &[900, 300], &Progress::silent()).expect("not canceled");
    assert!(levels[0].mesh.faces.len() > levels[1].mesh.faces.len() && levels[1].mesh.faces.len() <= 300);
}

#[test]
fn where_a_surface_branches_it_is_left_as_it_is() {
    // three sheets that meet in a line, and triangles that are none
    let mut mesh = sheet(10).mesh;
    let first = mesh.vertices.len() as u32;
    mesh.vertices.extend((0..=10).map(|k| Point3::new(5.0, f64::from(k), 2.0)));
    for k in 0..10 {
        let line = k * 11 + 5;
        mesh.faces.extend([[line, line + 11, first + k], [line + 11, first + k + 1, first + k]]);
    }
    mesh.faces.push([3, 3, 4]);
    let before = edges(&Mesh { faces: mesh.faces[..mesh.faces.len() - 1].to_vec(), ..mesh.clone() });
    let branches =
        |edges: &BTreeMap<[u32; 2], [usize; 2]>| edges.values().filter(|passed| passed[0] + passed[1] > 2).count();
    let surface = SurfaceMesh { mesh, ..SurfaceMesh::default() };
    let made = to(&surface, triangles(30)).surface.mesh;
    assert!(made.faces.len() < 150);
    assert_eq!((branches(&before), branches(&edges(&made))), (10, 10));
    for face in made.faces {
        assert!(face[0] != face[1] && face[1] != face[2] && face[2] != face[0]);
    }
}

#[test]
fn nothing_is_less_than_a_tetrahedron_and_nothing_at_all_is_no_fault() {
    let corner = |x: f64, y: f64, z: f64| Point3::new(x, y, z);
    let vertices = vec![corner(0.0, 0.0, 0.0), corner(1.0, 0.0, 0.0), corner(0.0, 1.0, 0.0), corner(0.0, 0.0, 1.0)];
    let mesh = Mesh { vertices, faces: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]] };
    let tetrahedron = SurfaceMesh { mesh, ..SurfaceMesh::default() };
    assert_eq!(to(&tetrahedron, triangles(0)).surface, tetrahedron);
    let nothing = SurfaceMesh::default();
    assert_eq!(to(&nothing, triangles(10)).surface, nothing);
    assert_eq!(to(&nothing, Target { triangles: None, max_error: Some(1.0) }).surface, nothing);
    let canceled =
        Progress::new(std::sync::Arc::new(Silent), std::sync::Arc::new(std::sync::atomic::AtomicBool::new(true)));
    assert_eq!(simplify(&torus(20, 20), &triangles(9), &canceled), Err(Canceled));
}

struct Silent;

impl visage_geometry::progress::ProgressSink for Silent {
    fn report(&self, _: visage_geometry::progress::Stage, _: f64) {}
}
