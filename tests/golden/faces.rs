//! Faces on code-made objects: every person has one, where it is known to be, and nothing else has.

use visage::faces;
use visage::geometry::{Cloud, Point3, Surface, Unit};
use visage::progress::Progress;
use visage::retrieval::{Match, MatchMethod, judge};
use visage::synthetic::head::{Proportions, head};
use visage::synthetic::{Specimen, objects};

fn judged(specimen: &Specimen, unit: Unit) -> Match {
    let cloud = Cloud::from_points(specimen.mesh.vertices.clone());
    let surface = Surface { cloud, faces: specimen.mesh.faces.clone(), ..Surface::default() };
    let signature = faces::describe(&surface, unit, &Progress::silent()).expect("a sound surface");
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
