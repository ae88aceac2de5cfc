//! Every kind of picture of things that are made by code: what is on it, that it stays as it is, and that threads don't show.

use visage_geometry::progress::Progress;
use visage_geometry::{Cloud, Motion, Point3, Surface, Unit, Vector3, se3};
use visage_picture::camera::Side;
use visage_picture::color::{ALARM, GROUND, category};
use visage_picture::image::{Image, Rgb};
use visage_picture::size::Size;
use visage_report::found::{Findings, Found, Pair, Round, View};
use visage_report::material::{Axis, Plane};
use visage_report::{Kind, Made, Material, PictureError, Wish, draw};
use visage_shape::faces::describe;

/// By how much the second of two scans was off before its pose was refined, mm.
const OFF_AT_FIRST: Vector3 = Vector3::new(8.0, 3.0, 0.0);

/// A head as a mesh, in mm.
fn head() -> Surface {
    let mesh = visage_synthetic::head::head(&visage_synthetic::head::Proportions::AVERAGE).mesh;
    Surface { cloud: Cloud::from_points(mesh.vertices), faces: mesh.faces, ..Surface::default() }
}

/// A ball as the points of two scans, a half of it each, that overlap.
fn two_scans() -> Material {
    let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    let direction = |k: usize| {
        let z = 1.0 - 2.0 * (k as f64 + 0.5) / 20_000.0;
        let (sine, cosine) = (golden * k as f64).sin_cos();
        let around = (1.0 - z * z).sqrt();
        Vector3::new(around * cosine, around * sine, z)
    };
    let directions: Vec<Vector3> = (0..20_000).map(direction).collect();
    let cloud = Cloud {
        points: directions.iter().map(|d| Point3::from(d * 50.0)).collect(),
        normals: Some(directions.iter().map(|d| d.cast()).collect()),
        ..Cloud::default()
    };
    let views = directions.iter().enumerate().map(|(k, d)| u16::from(d.x + if k % 2 == 0 { 0.2 } else { -0.2 } > 0.0));
    let row = |name: &str| View { name: name.to_owned(), placed: true, ..View::default() };
    let view = |name: &str, from_final: Vector3| View {
        start_from_final: Some(se3::to_rows(&Motion::new(from_final, Vector3::zeros()))),
        ..row(name)
    };
    let pair = Pair { i: 0, j: 1, overlap_i_j: 0.4, overlap_j_i: 0.4, trust: 1.0, ..Pair::default() };
    let rounds =
        [0.1, 0.01, 0.001].map(|turn| Round { rotation_change: turn, tolerance: 10.0 * turn, ..Round::default() });
    let result = Findings {
        views: vec![view("left.ply", Vector3::zeros()), view("right.ply", OFF_AT_FIRST)],
        pairs: vec![pair],
        overlaps: vec![vec![1.0, 0.4], vec![0.4, 1.0]],
        rounds: rounds.to_vec(),
        ..Findings::default()
    };
    Material {
        views: Some(views.collect()),
        surface: Surface { cloud, ..Surface::default() },
        found: Some(Found { result, ..Found::default() }),
        unit: Unit::Mm,
        ..Material::default()
    }
}

fn made(kind: Kind, of: &Material, change: impl FnOnce(&mut Wish)) -> Image {
    let mut wish = Wish { size: Size::clamped(160, 120), ..Wish::of(kind) };
    change(&mut wish);
    match draw(kind, of, &wish, &Progress::silent()).unwrap_or_else(|error| panic!("{kind}: {error}")) {
        Made::Image(image) => image,
        Made::Plot(drawing) => drawing.to_image(),
    }
}

fn count(image: &Image, is_it: impl Fn(&Rgb) -> bool) -> usize {
    image.pixels().iter().filter(|pixel| is_it(pixel)).count()
}

/// Mean brightness, 0 to 255, of each of 8 x 8 fields.
fn fields(image: &Image) -> [[u32; 8]; 8] {
    let (width, height) = (image.size().width() as usize, image.size().height() as usize);
    let mut sums = [[0u32; 8]; 8];
    for (index, pixel) in image.pixels().iter().enumerate() {
        let (x, y) = (index % width * 8 / width, index / width * 8 / height);
        sums[y][x] += pixel.iter().map(|value| u32::from(*value)).sum::<u32>() / 3;
    }
    sums.map(|row| row.map(|sum| sum * 64 / (width * height) as u32))
}

#[test]
fn a_head_looks_as_it_always_did() {
    let material = Material { surface: head(), unit: Unit::Mm, ..Material::default() };
    let image = made(Kind::Thumbnail, &material, |wish| wish.size = Size::clamped(64, 64));
    let expected: [[u32; 8]; 8] = [
        [249, 249, 245, 234, 233, 246, 249, 249],
        [249, 247, 217, 216, 211, 204, 248, 249],
        [249, 238, 198, 201, 198, 177, 229, 249],
        [249, 236, 177, 186, 171, 151, 214, 249],
        [249, 234, 167, 184, 165, 178, 219, 249],
        [249, 249, 190, 160, 171, 164, 241, 249],
        [249, 249, 198, 131, 148, 174, 249, 249],
        [249, 249, 245, 226, 241, 249, 249, 249],
    ];
    let found = fields(&image);
    let off = |y: usize, x: usize| found[y][x].abs_diff(expected[y][x]);
    let worst = (0..64).map(|k| off(k / 8, k % 8)).max();
    assert!(worst <= Some(6), "{found:?}");
}

#[test]
fn a_model_with_a_face_is_seen_from_before_the_face_whatever_its_frame() {
    let upright = head();
    let motion = visage_geometry::Motion::new(Vector3::new(40.0, -7.0, 5.0), Vector3::new(0.4, 2.2, -1.0));
    let picture = |surface: Surface| {
        let signature = describe(&surface, Unit::Mm, &Progress::silent()).expect("described");
        let material = Material { surface, signature: Some(signature), unit: Unit::Mm, ..Material::default() };
        fields(&made(Kind::Thumbnail, &material, |wish| wish.size = Size::clamped(64, 64)))
    };
    let (still, moved) = (picture(upright.clone()), picture(upright.moved(&motion)));
    let off: u32 = (0..64).map(|k| still[k / 8][k % 8].abs_diff(moved[k / 8][k % 8])).sum();
    assert!(off < 64 * 8, "{still:?}\n{moved:?}");
}

#[test]
fn scans_have_the_colours_that_the_key_names() {
    let image = made(Kind::Views, &two_scans(), |wish| {
        wish.side = Side::Front;
        wish.size = Size::clamped(400, 300);
    });
    let is_like = |pixel: &Rgb, color: Rgb| {
        // shaded, so darker or brighter, but of the same hue
        let order = |c: &Rgb| [c[0] > c[1], c[1] > c[2], c[0] > c[2]];
        *pixel != GROUND && order(pixel) == order(&color)
    };
    for view in 0..2 {
        assert!(count(&image, |pixel| is_like(pixel, category(view))) > 5000, "{view}");
    }
}

#[test]
fn a_section_is_a_line_with_a_part_magnified() {
    let material = two_scans();
    let size = Size::clamped(400, 300);
    let cut = |plane: Plane| {
        made(Kind::Section, &material, |wish| {
            wish.plane = Some(plane);
            wish.size = size;
        })
    };
    let middle = cut(Plane { axis: Axis::Z, offset: None });
    let of_view = |image: &Image, view: usize| count(image, |pixel| *pixel == category(view));
    assert!(of_view(&middle, 0) > 100 && of_view(&middle, 1) > 100);
    // beyond it nothing is cut
    let beyond = cut(Plane { axis: Axis::Z, offset: Some(70.0) });
    assert_eq!((of_view(&beyond, 0), of_view(&beyond, 1)), (of_view(&beyond, 0).min(80), of_view(&beyond, 1).min(80)));
}

#[test]
fn what_nobody_saw_stands_out() {
    let surface = head();
    let support: Vec<f32> = surface.cloud.points.iter().map(|p| if p.y > 60.0 { 0.0 } else { 20.0 }).collect();
    let material = Material { surface, support: Some(support), ..Material::default() };
    let image = made(Kind::Support, &material, |wish| wish.side = Side::Front);
    let red = count(&image, |[r, g, b]| *r > 110 && *g < 90 && *b < 80);
    assert!(red > 300, "{red}");
    assert!(ALARM[0] > 110);
}

#[test]
fn a_grown_model_is_red_on_its_outside() {
    let surface = head();
    let mut grown = surface.clone();
    grown.cloud.points.iter_mut().for_each(|p| *p *= 1.03);
    let picture = |model: &Surface, other: &Surface| {
        let material = Material { surface: model.clone(), other: Some(other.clone()), ..Material::default() };
        made(Kind::Deviation, &material, |wish| wish.side = Side::Front)
    };
    let red = |image: &Image| count(image, |[r, g, b]| *r > g.saturating_add(30) && *r > b.saturating_add(30));
    let blue = |image: &Image| count(image, |[r, g, b]| *b > r.saturating_add(30) && *b > g.saturating_add(10));
    let (outside, inside) = (picture(&grown, &surface), picture(&surface, &grown));
    assert!(red(&outside) > 5 * blue(&outside), "{} {}", red(&outside), blue(&outside));
    assert!(blue(&inside) > 5 * red(&inside), "{} {}", red(&inside), blue(&inside));
}

#[test]
fn a_face_has_its_places_and_its_triangle() {
    let surface = head();
    let signature = describe(&surface, Unit::Mm, &Progress::silent()).expect("described");
    let material = Material { surface, signature: Some(signature), unit: Unit::Mm, ..Material::default() };
    let plain = made(Kind::Shaded, &material, |wish| wish.side = Side::Front);
    for kind in [Kind::Landmarks, Kind::Regions, Kind::Saliency] {
        let image = made(kind, &material, |wish| wish.side = Side::Front);
        let changed = image.pixels().iter().zip(plain.pixels()).filter(|(a, b)| a != b).count();
        assert!(changed > 300, "{kind}: {changed}");
    }
}

#[test]
fn a_section_shows_where_scans_were_before_their_poses_were_refined() {
    let scans = two_scans();
    let plane = Some(Plane { axis: Axis::Z, offset: None });
    let section = |kind, of: &Material| {
        made(kind, of, |wish| {
            wish.size = Size::clamped(320, 240);
            wish.plane = plane;
        })
    };
    let (start, end) = (section(Kind::Start, &scans), section(Kind::Section, &scans));
    // the scan that was right from the beginning stays where it is to the pixel; the other one had been elsewhere
    let places = |image: &Image, color: Rgb| -> Vec<usize> {
        (0..image.pixels().len()).filter(|index| image.pixels()[*index] == color).collect()
    };
    let is_legend = |index: &usize| index % 320 < 40 || index / 320 > 210;
    let drawn = |image: &Image, view: usize| {
        places(image, category(view)).into_iter().filter(|index| !is_legend(index)).collect::<Vec<_>>()
    };
    assert!(drawn(&end, 0).len() > 50 && drawn(&end, 1).len() > 50);
    let covered = drawn(&end, 0).iter().filter(|index| !drawn(&start, 0).contains(index)).count();
    assert!(covered * 4 < drawn(&end, 0).len(), "{covered} of {}", drawn(&end, 0).len());
    let moved = drawn(&end, 1).iter().filter(|index| !drawn(&start, 1).contains(index)).count();
    assert!(moved * 2 > drawn(&end, 1).len(), "{moved} of {}", drawn(&end, 1).len());
    let mut silent = scans.clone();
    let rows = silent.found.as_mut().map(|found| &mut found.result.views).expect("a report");
    rows.iter_mut().for_each(|row| row.start_from_final = None);
    let error = draw(Kind::Start, &silent, &Wish::of(Kind::Start), &Progress::silent()).expect_err("it is not known");
    assert!(error.to_string().contains("before their poses were refined"), "{error}");
}

#[test]
fn plots_come_as_pixels_and_as_text() {
    let material = two_scans();
    for kind in [Kind::Overlap, Kind::Graph, Kind::Convergence] {
        let made = draw(kind, &material, &Wish::of(kind), &Progress::silent()).expect("drawn");
        let svg = made.to_svg().expect("a plot");
        assert!(svg.contains("left.ply") || kind == Kind::Convergence, "{svg}");
        assert!(made.to_png().expect("written").len() > 2000, "{kind}");
    }
}

#[test]
fn what_a_model_lacks_is_said_with_a_remedy() {
    let bare = Material { surface: head(), ..Material::default() };
    let empty = Material::default();
    for kind in Kind::ALL {
        for material in [&bare, &empty] {
            match draw(*kind, material, &Wish { size: Size::clamped(64, 64), ..Wish::of(*kind) }, &Progress::silent()) {
                Ok(_) => assert!(material.surface.cloud.len() > 3 && !kind.is_plot(), "{kind}"),
                Err(PictureError::Lacking { kind: named, lacks, remedy }) => {
                    assert_eq!(named, kind.name());
                    assert!(lacks.len() > 10 && remedy.len() > 10);
                }
                Err(error) => panic!("{kind}: {error}"),
            }
        }
    }
}

#[test]
fn the_least_size_is_drawn_too() {
    let scans = two_scans();
    for kind in Kind::ALL {
        let wish = Wish { size: Size::clamped(16, 16), ..Wish::of(*kind) };
        match draw(*kind, &scans, &wish, &Progress::silent()) {
            Ok(made) => assert!(made.to_png().is_ok(), "{kind}"),
            Err(error) => assert!(matches!(error, PictureError::Lacking { .. }), "{kind}: {error}"),
        }
    }
}

#[test]
fn the_same_bytes_for_any_number_of_threads() {
    let scans = two_scans();
    let surface = head();
    let signature = describe(&surface, Unit::Mm, &Progress::silent()).expect("described");
    let other = Some(two_scans().surface);
    let of_mesh = Material { surface, signature: Some(signature), other, ..Material::default() };
    for kind in Kind::ALL {
        let material =
            if matches!(kind, Kind::Views | Kind::Section | Kind::Start) || kind.is_plot() { &scans } else { &of_mesh };
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            let wish = Wish { size: Size::clamped(96, 80), ..Wish::of(*kind) };
            pool.install(|| {
                draw(*kind, material, &wish, &Progress::silent()).ok().map(|made| made.to_png().expect("written"))
            })
        };
        assert!(with(1) == with(3), "{kind}");
    }
}
