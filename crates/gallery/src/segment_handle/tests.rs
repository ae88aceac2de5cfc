use proptest::prelude::*;

use super::super::{IndexedModel, Likeness, MatchMethod, Source, TopK};
use super::*;
use visage_geometry::{Point3, Unit, Vector3};
use visage_shape::faces::signature::example::example;

fn entry(k: u128) -> IndexedModel {
    let signature = match example(0.37 * (k % 50) as f64, 4 + (k % 5) as usize) {
        of_no_shape if k % 11 == 3 => of_no_shape.with_shape(None),
        signature => signature,
    };
    let label = (k.is_multiple_of(3)).then(|| format!("kind/{}", k % 7).into());
    let facets = Facets { label, unit: Unit::Cm, source: Source::Registered };
    IndexedModel::new(k, signature).described_by(facets, 7 * k)
}

/// Enough models for every kind of column.
pub(super) fn gallery(models: u128) -> Gallery {
    let mut gallery = Gallery::default();
    gallery.append(&(0..models).map(entry).collect::<Vec<_>>());
    gallery
}

pub(super) fn encoded(gallery: &Gallery) -> Vec<u8> {
    SegmentHandle::of(&gallery.segments[0]).encode().to_bytes()
}

/// A sound file.
fn decode(file: u128, bytes: &Bytes) -> SegmentHandle {
    let checksum = check(&mut &bytes[..]).expect("sound");
    SegmentHandle::decode(file, checksum, bytes).expect("sound")
}

/// Everything that can be asked, as text: equal only if the bytes of all answers are.
pub(super) fn answers(gallery: &Gallery) -> String {
    let mut answers = Vec::new();
    for seed in [0.3, 1.1, 5.2] {
        let probe = example(seed, 6);
        for likeness in [Likeness::Shape, Likeness::SalientRegions, Likeness::View] {
            answers.push(gallery.by_likeness(&probe, likeness, None, &TopK::best(30)));
        }
    }
    for &method in MatchMethod::ALL {
        answers.push(gallery.by_standard("face", method, &TopK::best(500)).expect("built in"));
    }
    let corners = [[0.0, 0.0, 0.0], [40.0, 3.0, 0.0], [17.0, 30.0, 5.0]].map(Point3::from);
    for outward in [None, Some(Vector3::z())] {
        answers.push(gallery.by_triangle(corners, outward, &TopK::best(40)));
    }
    format!("{answers:?}")
}

#[test]
fn a_segment_from_its_file_answers_as_the_one_in_memory() {
    let mut memory = gallery(300);
    let bytes = Bytes::from(encoded(&memory));
    let stored = decode(5, &bytes);
    assert_eq!(check(&mut &bytes[..]), Ok(stored.encode().checksum()));
    assert_eq!(stored.encode().to_bytes(), bytes, "it is written as it was");
    let described: Vec<_> = stored.descriptions().collect();
    assert!(described.iter().all(|(id, facets, revision)| *revision == 7 * id && *facets == entry(*id).facets));
    let mut mapped = Gallery::default();
    mapped.attach(stored);
    assert_eq!(answers(&mapped), answers(&memory));
    // and so do both after the same changes, and merged
    for gallery in [&mut memory, &mut mapped] {
        (0..120).for_each(|id| assert!(gallery.remove(id)));
        (400..440).for_each(|id| gallery.put(&entry(id)));
        gallery.tidy();
    }
    assert_eq!(answers(&mapped), answers(&memory));
    assert!(!answers(&memory).contains("model_id: 7,"));
}

#[test]
fn what_was_in_a_file_is_owed_one_until_it_is_stored_again() {
    let mut gallery = gallery(300);
    assert!(gallery.to_be_stored().is_some(), "it is large enough");
    let memory = gallery.to_be_stored().expect("in memory");
    let bytes = Bytes::from(memory.encode().to_bytes());
    assert!(gallery.remove(5));
    assert!(gallery.settle(&memory, decode(1, &bytes)));
    assert!(gallery.to_be_stored().is_none() && gallery.len() == 299 && !gallery.remove(5));
    gallery.put(&entry(900));
    assert!(gallery.to_be_stored().is_none(), "the young one waits for more");
    (0..290).for_each(|id| assert_eq!(gallery.remove(id), id != 5));
    gallery.tidy();
    let owed = gallery.to_be_stored().expect("however small it is");
    assert_eq!(owed.ids(), (290..300).collect::<Vec<u128>>());
    gallery.put(&entry(901));
    assert_eq!(gallery.to_be_stored().map(|s| s.ids().to_vec()), Some(owed.ids().to_vec()), "nothing is added to it");
    assert!(!gallery.settle(&memory, owed), "that one is not there any more");
}

#[test]
fn a_segment_that_is_detached_takes_its_models_along() {
    let mut gallery = Gallery::default();
    gallery.attach(decode(9, &Bytes::from(encoded(&self::gallery(40)))));
    gallery.put(&entry(77));
    assert!(!gallery.detach(8) && gallery.len() == 41);
    assert!(gallery.detach(9) && gallery.len() == 1 && gallery.segments().all(|s| s.file().is_none()));
}

#[test]
fn no_place_at_which_a_file_may_end_is_taken_for_its_end() {
    let sound = Bytes::from(encoded(&gallery(120)));
    let checksum = check(&mut &sound[..]).expect("sound");
    for end in (0..sound.len()).step_by(61).chain(0..2000).chain(sound.len() - 200..sound.len()) {
        let torn = sound.slice(..end);
        assert!(
            SegmentHandle::decode(1, checksum, &torn).is_err() && check(&mut &torn[..]).is_err(),
            "it ends at {end}"
        );
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]
    #[test]
    fn a_flipped_byte_of_any_column_is_found_and_ends_nothing(share in 0.0..1.0f64, flip in 1u8..=255) {
        let mut bytes = encoded(&gallery(120));
        let checksum = check(&mut &bytes[..]).expect("sound");
        let at = ((bytes.len() as f64 * share) as usize).min(bytes.len() - 1);
        bytes[at] ^= flip;
        prop_assert!(check(&mut &bytes[..]).is_err());
        // until that is found it may answer wrongly, but it answers
        if let Ok(segment) = SegmentHandle::decode(1, checksum, &bytes.into()) {
            let mut gallery = Gallery::default();
            gallery.attach(segment);
            answers(&gallery);
        }
    }
}

/// Bump [`RULES`] when this fails: segments that were written before hold other verdicts.
#[test]
fn verdicts_are_those_of_the_files_that_were_written_under_these_rules() {
    let told: Vec<String> = [4, 9, 33, 47]
        .map(|k| {
            let scores = entry(k).standings.map(|standing| format!("{:.6}", standing.score));
            scores.join(" ")
        })
        .to_vec();
    assert_eq!(
        (RULES, told.join("; ").as_str()),
        (
            1,
            "0.988258 0.503810 0.505639; 0.943490 0.987787 0.196824; 0.950022 0.993246 0.302569; 0.988164 0.999375 0.254533"
        )
    );
}
