//! Faces on code-made objects: every person has one, where it is known to be, and nothing else has.

use visage::faces;
use visage::gallery::{Match, MatchMethod, judge};
use visage::geometry::{Cloud, Point3, Surface, Unit, Vector3};
use visage::progress::Progress;
use visage::synthetic::head::{Proportions, head};
use visage::synthetic::{Specimen, objects};

fn surface(specimen: &Specimen) -> Surface {
    let cloud = Cloud::from_points(specimen.mesh.vertices.clone());
    Surface { cloud, faces: specimen.mesh.faces.clone(), ..Surface::default() }
}

fn judged(specimen: &Specimen, unit: Unit) -> Match {
    judged_surface(&surface(specimen), unit)
}

fn judged_surface(surface: &Surface, unit: Unit) -> Match {
    let signature = faces::describe(surface, unit, &Progress::silent()).expect("a sound surface");
    judge(&signature, "face", MatchMethod::Descriptors).expect("the standard face is built in")
}

#[test]
fn people_have_a_face_at_its_place() {
    for (seed, unit) in [(1, Unit::Mm), (2, Unit::Unknown), (5, Unit::Mm)] {
        let person = head(&Proportions::of(seed));
        let verdict = judged(&person, unit);
        assert!(verdict.is_match, "person {seed}: {verdict:?}");
        let triangle = verdict.triangle.expect("a match has a triangle");
        for (name, corner) in ["eye_r_inner", "eye_l_inner", "nose_tip"].iter().zip(triangle) {
            let beside = (person.landmarks[name] - Point3::from(corner)).norm();
            assert!(beside < 6.0, "person {seed}: {name} is found {beside:.1} mm beside its place");
        }
    }
}

#[test]
fn bumps_jugs_and_blobs_have_none() {
    let others = [("bumps", objects::head_with_bumps()), ("jug", objects::jug()), ("blob", objects::blob(2, 20_000))];
    for (name, specimen) in others {
        let verdict = judged(&specimen, Unit::Mm);
        assert!(!verdict.is_match && verdict.score < 0.2, "{name}: {verdict:?}");
    }
}

/// What may come with a head.
fn beside(head: &Surface, others: Vec<Point3>) -> Surface {
    let mut surface = head.clone();
    surface.cloud.points.extend(others);
    surface
}

#[test]
fn points_far_off_and_points_that_are_none_hide_no_face() {
    let person = surface(&head(&Proportions::of(1)));
    let cloud = Surface { faces: Vec::new(), ..person.clone() };
    let far = |count: i32, distance: f64| -> Vec<Point3> {
        (0..count).map(|k| Point3::new(distance, f64::from(k % 5) * 20.0, f64::from(k / 5) * 20.0)).collect()
    };
    let all_about = |count: i32, distance: f64| -> Vec<Point3> {
        let angle = |k: i32| 2.4 * f64::from(k);
        (0..count).map(|k| Point3::new(angle(k).cos(), (1.7 * angle(k)).sin(), angle(k).sin()) * distance).collect()
    };
    let others = [
        ("one point at 10 m", far(1, 1e4)),
        ("one at 100 m", far(1, 1e5)),
        ("one at 1000 km", far(1, 1e9)),
        ("20 at 10 m", far(20, 1e4)),
        ("20 at 10 m and one at 10 km", [far(20, 1e4), far(1, 1e7)].concat()),
        ("100 all about", all_about(100, 3e3)),
        ("20 000 without a return", vec![Point3::new(0.0, 0.0, -9999.0); 20_000]),
        ("as many, and a few far off", [vec![Point3::new(900.0, 0.0, 0.0); 30_000], far(3, 2e4)].concat()),
    ];
    for unit in [Unit::Mm, Unit::Unknown] {
        for (what, others) in &others {
            for (form, head) in [("cloud", &cloud), ("mesh", &person)] {
                let verdict = judged_surface(&beside(head, others.clone()), unit);
                assert!(verdict.is_match, "{form} with {what}, {}: {verdict:?}", unit.name());
            }
        }
    }
}

#[test]
fn bits_of_a_mesh_far_off_hide_no_face() {
    let mut person = surface(&head(&Proportions::of(2)));
    for k in 0..5u32 {
        let first = person.cloud.len() as u32;
        let place = Vector3::new(8e3, 500.0 * f64::from(k), 0.0);
        let corners = [Vector3::zeros(), Vector3::x() * 8.0, Vector3::y() * 8.0];
        person.cloud.points.extend(corners.map(|corner| Point3::from(place + corner)));
        person.faces.push([first, first + 1, first + 2]);
    }
    for unit in [Unit::Mm, Unit::Unknown] {
        let verdict = judged_surface(&person, unit);
        assert!(verdict.is_match, "{}: {verdict:?}", unit.name());
    }
}

#[test]
fn a_mesh_of_loose_triangles_has_its_face() {
    let person = surface(&head(&Proportions::of(2)));
    let points = person.faces.iter().flatten().map(|v| person.cloud.points[*v as usize]).collect();
    let faces = (0..person.faces.len() as u32).map(|face| [3 * face, 3 * face + 1, 3 * face + 2]).collect();
    let loose = Surface { cloud: Cloud::from_points(points), faces, ..Surface::default() };
    let verdict = judged_surface(&loose, Unit::Mm);
    assert!(verdict.is_match, "{verdict:?}");
    let [whole, loose] = [&person, &loose].map(|surface| judged_surface(surface, Unit::Mm).score);
    assert!((whole - loose).abs() < 0.02, "{whole} {loose}");
}

#[test]
fn a_wall_behind_or_a_floor_below_hides_no_face() {
    let person = surface(&head(&Proportions::of(1)));
    let cloud = Surface { faces: Vec::new(), ..person.clone() };
    let bounds = cloud.cloud.bounds().expect("a head has points");
    let steps = || (-150..=150).map(|k| 8.0 * f64::from(k));
    let plane = |place: &dyn Fn(f64, f64) -> Point3| -> Vec<Point3> {
        steps().flat_map(|a| steps().map(move |b| (a, b))).map(|(a, b)| place(a, b)).collect()
    };
    let wall = plane(&|x, y| Point3::new(x, y, bounds.min.z - 60.0));
    let floor = plane(&|x, z| Point3::new(x, bounds.min.y - 5.0, z));
    for (what, others) in [("wall", &wall), ("floor", &floor)] {
        for unit in [Unit::Mm, Unit::Unknown] {
            let verdict = judged_surface(&beside(&cloud, others.clone()), unit);
            assert!(verdict.is_match, "{what}, {}: {verdict:?}", unit.name());
        }
    }
    let jug = surface(&objects::jug());
    let before_wall = beside(&Surface { faces: Vec::new(), ..jug }, wall);
    assert!(!judged_surface(&before_wall, Unit::Mm).is_match);
}
