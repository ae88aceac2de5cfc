//! The face of a whole standing person in merged depth-camera views whose skins are doubled; a body without a head has none.

use visage::faces::judgement::MATCH_SCORE;
use visage::faces::{MatchMethod, Signature, describe, judge, standard};
use visage::geometry::{Surface, Unit};
use visage::progress::Progress;
use visage::registration::sensor::Sensor;
use visage::registration::view::View;
use visage::surface::merge::{PosedView, merge};
use visage::synthetic::depth_views::{ALL_AROUND, DepthCamera, depth_views, ring};
use visage::synthetic::truth::disturb;
use visage::synthetic::{Specimen, body};

/// Eight views with 2 mm of noise, some 4 mm off at the head, merged.
fn merged(person: &Specimen) -> Surface {
    let camera = DepthCamera { noise: 2.0, step: 2.4, resolution: 3.6, ..DepthCamera::default() };
    let set = depth_views(&person.mesh, ring(&person.mesh, &camera, 8, 1, ALL_AROUND), &camera, 1);
    let given = disturb(&set.poses, 0.001, 2.5, 1);
    let views: Vec<View> = set.scans.iter().map(|scan| View::new(&scan.cloud).expect("a sound scan")).collect();
    let posed: Vec<PosedView> = (views.iter().zip(&set.scans).zip(&given))
        .map(|((view, scan), pose)| PosedView {
            view,
            scan: &scan.cloud,
            local_pose: view.local_pose(pose),
            placed: true,
            sensor: Some(Sensor::At(-view.center)),
        })
        .collect();
    let (model, _) = merge(&posed, &Progress::silent()).expect("not canceled");
    Surface { cloud: model.cloud, ..Surface::default() }
}

fn described(surface: &Surface, unit: Unit) -> Signature {
    describe(surface, unit, &Progress::silent()).expect("a sound surface")
}

#[test]
fn the_face_of_a_standing_person_is_found_in_a_merge_with_doubled_skins() {
    let person = body::person(5);
    let surface = merged(&person);
    for unit in [Unit::Mm, Unit::Unknown] {
        let signature = described(&surface, unit);
        let verdict = judge(&signature, &standard::face(), MatchMethod::Verified);
        assert!(verdict.score >= MATCH_SCORE, "{verdict:?}");
        let corners = verdict.triangle.expect("a face was found");
        for (name, corner) in ["eye_r_inner", "eye_l_inner", "nose_tip"].iter().zip(&corners) {
            let off = (person.landmarks[name] - corner).norm();
            assert!(off < 12.0, "{name} is {off} mm off");
        }
    }
}

#[test]
fn a_body_without_a_head_has_no_face() {
    let verdict = judge(&described(&merged(&body::headless(5)), Unit::Mm), &standard::face(), MatchMethod::Verified);
    assert!(verdict.score < MATCH_SCORE, "{verdict:?}");
}
