use super::*;
use crate::camera::{Axes, Side};
use visage_geometry::{Mesh, Vector3};

/// A ball of radius 1 of rings of triangles, wound outward.
fn ball(rings: u32) -> Mesh {
    let columns = 2 * rings;
    let place = |row: u32, column: u32| {
        let (sine, cosine) = (std::f64::consts::PI * f64::from(row) / f64::from(rings)).sin_cos();
        let (y, x) = (std::f64::consts::TAU * f64::from(column) / f64::from(columns)).sin_cos();
        Point3::new(sine * x, cosine, -sine * y)
    };
    let vertices = (0..=rings).flat_map(|row| (0..columns).map(move |column| place(row, column))).collect();
    let index = |row: u32, column: u32| row * columns + column % columns;
    let faces = (0..rings).flat_map(|row| (0..columns).map(move |column| (row, column))).flat_map(|(row, column)| {
        let [a, b, c, d] =
            [index(row, column), index(row + 1, column), index(row + 1, column + 1), index(row, column + 1)];
        [[a, b, c], [a, c, d]]
    });
    Mesh { vertices, faces: faces.collect() }
}

fn scene<'a>(mesh: &'a Mesh, colors: Option<&'a [Rgb]>, paint: Paint) -> Scene<'a> {
    Scene { points: &mesh.vertices, normals: None, faces: &mesh.faces, colors, paint, spacing: 0.05 }
}

fn drawn(scene: &Scene, side: Side, size: &str) -> Rendered {
    let size = size.parse().expect("a size");
    let camera = Camera::fit(scene.points, Axes::of_side(side), size, side == Side::Default);
    render(scene, &camera, size, &Progress::silent()).expect("not canceled")
}

fn brightness(image: &Image, x: i64, y: i64) -> u32 {
    image.at(x, y).expect("inside").iter().map(|value| u32::from(*value)).sum()
}

#[test]
fn a_ball_is_round_and_lit_from_the_upper_left() {
    let mesh = ball(48);
    for &side in Side::ALL {
        let rendered = drawn(&scene(&mesh, None, Paint::Material), side, "200x200");
        let expected = std::f64::consts::PI / 4.0 * 0.88f64.powi(2);
        assert!((rendered.covered() - expected).abs() < 0.02, "{side}: {}", rendered.covered());
        let image = &rendered.image;
        assert_eq!(image.at(3, 3), Some(GROUND));
        assert!(brightness(image, 70, 70) > brightness(image, 130, 130) + 60, "{side}");
        // nothing is missing and nothing shines through
        let inside = (40..160).flat_map(|y| (60..140).map(move |x| (x, y)));
        assert!(inside.clone().all(|(x, y)| image.at(x, y) != Some(GROUND)));
    }
}

#[test]
fn neighbours_leave_no_gap_whatever_their_size() {
    let mut mesh = ball(160);
    // far smaller than samples
    assert!(mesh.faces.len() > 100_000);
    let rendered = drawn(&scene(&mesh, None, Paint::Flat), Side::Front, "64x64");
    let plain = crate::color::PLAIN;
    let inside = (12..52).flat_map(|y| (12..52).map(move |x| (x, y)));
    let ring = |(x, y): &(i64, i64)| (x - 32).pow(2) + (y - 32).pow(2) < 24 * 24;
    assert!(inside.filter(ring).all(|(x, y)| rendered.image.at(x, y) == Some(plain)));
    // two triangles, far larger than bands
    mesh.vertices = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|[x, y]| Point3::new(x, y, 0.0)).to_vec();
    mesh.faces = vec![[0, 1, 2], [0, 2, 3]];
    let rendered = drawn(&scene(&mesh, None, Paint::Flat), Side::Front, "300x300");
    assert!((30..270).all(|k| rendered.image.at(k, 300 - k) == Some(plain) && rendered.image.at(k, k) == Some(plain)));
}

#[test]
fn the_inner_side_of_an_open_surface_is_told_from_the_outer() {
    let mut half = ball(48);
    half.faces.retain(|face| face.iter().all(|corner| half.vertices[*corner as usize].z < 0.01));
    let outside = drawn(&scene(&half, None, Paint::Material), Side::Back, "100x100");
    let inside = drawn(&scene(&half, None, Paint::Material), Side::Front, "100x100");
    let middle = |rendered: &Rendered| rendered.image.at(50, 50).expect("inside");
    assert!(middle(&inside)[2] >= middle(&inside)[0], "blue: {:?}", middle(&inside));
    assert!(middle(&outside)[0] > middle(&outside)[2], "plaster: {:?}", middle(&outside));
    assert!(brightness(&outside.image, 50, 50) > brightness(&inside.image, 50, 50) + 60);
}

#[test]
fn hollows_are_darker_than_the_open() {
    // a plane with a deep well
    let side = 101u32;
    let place = |k: u32| {
        let (x, y) = (f64::from(k % side), f64::from(k / side));
        let is_well = (x - 50.0).abs() < 9.0 && (y - 50.0).abs() < 9.0;
        Point3::new(x, y, if is_well { -5.0 } else { 0.0 })
    };
    let vertices = (0..side * side).map(place).collect();
    let corner = |k: u32| k / (side - 1) * side + k % (side - 1);
    let squares = (0..(side - 1).pow(2)).map(corner);
    let faces = squares.flat_map(|a| [[a, a + 1, a + side + 1], [a, a + side + 1, a + side]]).collect();
    let mesh = Mesh { vertices, faces };
    let rendered = drawn(&scene(&mesh, None, Paint::Material), Side::Front, "300x300");
    // both look straight at who looks; the one at the wall of the well sees less of the sky
    let (open, hollow) = (brightness(&rendered.image, 60, 60), brightness(&rendered.image, 150, 167));
    assert!(hollow + 40 < open, "{hollow} {open}");
}

#[test]
fn colours_of_figures_can_be_read_off() {
    let mesh = ball(32);
    let red: Vec<Rgb> = vec![[200, 30, 30]; mesh.vertices.len()];
    for (paint, least) in [(Paint::Flat, 200), (Paint::Figure, 150)] {
        let rendered = drawn(&scene(&mesh, Some(&red), paint), Side::Front, "100x100");
        let [r, g, b] = rendered.image.at(50, 50).expect("inside");
        assert!(r >= least && g < 40 && b < 40, "{paint:?}: {r} {g} {b}");
    }
}

#[test]
fn points_cover_their_surface() {
    let mesh = ball(60);
    let normals: Vec<_> = mesh.vertices.iter().map(|p| p.coords.cast::<f32>()).collect();
    for normals in [Some(&*normals), None] {
        let scene = Scene { normals, faces: &[], ..scene(&mesh, None, Paint::Material) };
        let image = drawn(&scene, Side::Front, "120x120").image;
        let inside = (40..80).flat_map(|y| (40..80).map(move |x| (x, y)));
        assert!(inside.clone().all(|(x, y)| image.at(x, y) != Some(GROUND)));
        assert!(brightness(&image, 40, 40) > brightness(&image, 85, 85) + 40, "lit from the upper left");
    }
}

#[test]
fn the_same_bytes_for_any_number_of_threads() {
    let mesh = ball(90);
    let colors: Vec<Rgb> = (0..mesh.vertices.len()).map(crate::color::category).collect();
    let normals: Vec<_> = mesh.vertices.iter().map(|p| p.coords.cast::<f32>()).collect();
    let of_mesh = scene(&mesh, Some(&colors), Paint::Material);
    let of_cloud = Scene { faces: &[], normals: Some(&normals), ..of_mesh };
    let bare = Scene { faces: &[], normals: None, ..of_mesh };
    for scene in [of_mesh, of_cloud, bare] {
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            pool.install(|| drawn(&scene, Side::Default, "203x157").image.to_png().expect("written"))
        };
        let one = with(1);
        assert!(one == with(3) && one == with(7));
    }
}

#[test]
fn of_equally_near_things_the_first_is_seen() {
    let vertices = [[0.0, 0.0], [4.0, 0.0], [0.0, 4.0]].map(|[x, y]| Point3::new(x, y, 0.0));
    let mesh =
        Mesh { vertices: vertices.iter().chain(&vertices).copied().collect(), faces: vec![[0, 1, 2], [3, 4, 5]] };
    let colors = [[200, 0, 0], [200, 0, 0], [200, 0, 0], [0, 0, 200], [0, 0, 200], [0, 0, 200]];
    let image = drawn(&scene(&mesh, Some(&colors), Paint::Flat), Side::Front, "64x64").image;
    assert!(image.pixels().iter().all(|[_, _, blue]| *blue < 10 || *blue > 100));
    assert!(image.pixels().contains(&[200, 0, 0]) && !image.pixels().contains(&[0, 0, 200]));
}

#[test]
fn hostile_coordinates_and_indices_are_drawn_or_left_out() {
    let numbers = [0.0, 1.0, -1.0, f64::NAN, f64::INFINITY, 1e300, -1e-300, 1e12];
    let points: Vec<Point3> =
        (0..512).map(|k| Point3::new(numbers[k % 8], numbers[k / 8 % 8], numbers[k / 64])).collect();
    let faces: Vec<[u32; 3]> = (0..512).map(|k| [k, (k * 7) % 512, (k * 31) % 512]).collect();
    for faces in [&faces[..], &[]] {
        let scene = Scene {
            points: &points,
            normals: None,
            faces,
            colors: Some(&[[1; 3]]),
            paint: Paint::Material,
            spacing: f64::NAN,
        };
        for side in [Side::Default, Side::Front] {
            assert_eq!(drawn(&scene, side, "40x30").image.pixels().len(), 1200);
        }
    }
    let ball = ball(4);
    let wrong = Scene { points: &points[..3], faces: &[[0, 1, 99]], ..scene(&ball, None, Paint::Flat) };
    assert_eq!(drawn(&wrong, Side::Front, "40x30").covered(), 0.0);
}

#[test]
fn heaps_of_large_triangles_take_bounded_work() {
    let corners = |k: u32| [[-5.0, -5.0], [5.0, -5.0], [0.0, 5.0]].map(|[x, y]| Point3::new(x, y, f64::from(k) * 1e-4));
    let vertices: Vec<Point3> = (0..60_000).flat_map(corners).collect();
    let faces = (0..60_000).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
    let mesh = Mesh { vertices, faces };
    let rendered = drawn(&scene(&mesh, None, Paint::Flat), Side::Front, "400x400");
    assert!(rendered.covered() > 0.3);
}

#[test]
fn a_stop_is_obeyed() {
    struct Nobody;
    impl visage_geometry::progress::ProgressSink for Nobody {
        fn report(&self, _: visage_geometry::progress::Stage, _: f64) {}
    }
    let raised = std::sync::Arc::new(std::sync::atomic::AtomicBool::new(true));
    let progress = Progress::new(std::sync::Arc::new(Nobody), raised);
    let mesh = ball(8);
    let size = Size::clamped(64, 64);
    let camera = Camera::fit(&mesh.vertices, Axes::looking(Vector3::z(), Vector3::y()), size, false);
    assert_eq!(render(&scene(&mesh, None, Paint::Flat), &camera, size, &progress).err(), Some(Canceled));
}
