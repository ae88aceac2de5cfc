//! An index of some parts of the gallery, before and after all that may happen to it. A module of `#[cfg(test)]`.

use std::sync::atomic::Ordering::SeqCst;

use super::tests::{Place, models, publish};
use super::*;
use visage_domain::{NewModel, StoredContent};
use visage_gallery::TopK;
use visage_shape::faces::signature::example::example;

/// A process that has mapped what is there and has no part whole yet. It merges when it likes.
async fn started(place: &Place) -> LiveGallery {
    let live = LiveGallery::default();
    live.load_parts(&place.storage, Parts::NONE).await.expect("loaded");
    live
}

async fn until_nobody_merges(live: &LiveGallery) {
    while live.shared.merging.load(SeqCst) {
        tokio::task::yield_now().await;
    }
}

async fn release(place: &Place, live: &LiveGallery, parts: Parts) {
    while !live.release(&place.storage, parts).await.expect("released") {
        tokio::task::yield_now().await;
    }
}

/// The parts that are whole answer as a gallery does that is made of all signatures of theirs that are stored, alone and all together.
async fn are_exact(place: &Place, live: &LiveGallery) {
    let stored = place.storage.database.signatures_after(None, 100_000).await.expect("read");
    let whole = live.whole_parts();
    for asked in [Parts::ALL, (0..128).collect(), (100..=255).step_by(3).collect()] {
        let wanted = whole.common(&asked);
        let signatures = stored.iter().filter(|(id, _)| wanted.hold(part_of(*id))).map(|(id, content)| {
            let StoredContent::Whole(content) = content else { panic!("whole") };
            (id.number(), Signature::from_bytes(content).expect("of this version"))
        });
        let anew = Gallery::build(signatures.collect());
        let ask = |gallery: &Gallery| {
            let probes = [0.3, 1.7, 4.4].map(|seed| gallery.by_probe(&example(seed, 6), None, &TopK::best(60)));
            (probes, gallery.by_standard("face", Default::default(), &TopK::best(2000)), gallery.len())
        };
        assert_eq!(live.ask_parts(&asked, |gallery, parts| (ask(gallery), parts)), Ok((ask(&anew), wanted)));
    }
    // of what is not whole nothing is kept that filters would be asked about
    let catalogue = live.catalogue();
    let known = stored.iter().filter(|(id, _)| catalogue.facets(id.number()).is_some());
    assert!(
        known.filter(|(id, _)| whole.hold(part_of(*id))).count()
            >= live.ask_parts(&whole, |g, _| g.len()).expect("ready")
    );
}

/// Every so-many-th part, from one on.
fn some(number: u32) -> Parts {
    (0..=255).filter(|part: &u8| (u32::from(*part).wrapping_mul(37) + number * 11).is_multiple_of(3)).collect()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn whatever_happens_the_parts_that_are_whole_answer_exactly() {
    let place = Place::new().await;
    let mut live = started(&place).await;
    let mut there: Vec<NewModel> = Vec::new();
    // no law in it, and the same every time
    let mut number = 7u32;
    for step in 0..70 {
        number = number.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        match number >> 29 {
            0 | 1 => {
                let new = models(step * 30..step * 30 + 30);
                publish(&place, &live, &new).await;
                there.extend(new);
            }
            2 => {
                for _ in 0..there.len().min(12) {
                    let gone = there.swap_remove(number as usize % there.len());
                    place.delete(&live, gone.id).await;
                }
            }
            3 | 4 => assert!(live.acquire(&place.storage, some(number >> 8)).await.expect("acquired")),
            5 => release(&place, &live, some(number >> 8)).await,
            6 => live.tidy_up(),
            _ => {
                until_nobody_merges(&live).await;
                live = started(&place).await;
                assert_eq!(live.whole_parts(), Parts::NONE);
                live.acquire(&place.storage, some(number >> 8)).await.expect("acquired");
            }
        }
        are_exact(&place, &live).await;
    }
    assert!(there.len() > 200 && place.files().await.0 > 1, "the test must meet files");
    live.acquire(&place.storage, Parts::ALL.without(&live.whole_parts())).await.expect("acquired");
    are_exact(&place, &live).await;
    place.is_exact(&live).await;
    // and whoever takes over with all roles
    until_nobody_merges(&live).await;
    drop(live);
    place.is_exact(&place.process().await).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_happens_while_parts_are_made_whole_is_not_lost() {
    let place = Place::new().await;
    let live = started(&place).await;
    let old = models(0..400);
    place.store(&old).await;
    for round in 0..8u32 {
        let new = models(400 + round * 20..420 + round * 20);
        let changing = async {
            for (new, old) in new.chunks(1).zip(&old[round as usize * 20..]) {
                publish(&place, &live, new).await;
                place.delete(&live, old.id).await;
            }
        };
        let parts = Parts::ALL.without(&some(round));
        let (acquired, ()) = tokio::join!(live.acquire(&place.storage, parts), changing);
        assert!(acquired.expect("acquired"));
        are_exact(&place, &live).await;
        release(&place, &live, some(round + 1)).await;
        are_exact(&place, &live).await;
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_index_that_is_given_up_has_its_parts_made_whole_anew() {
    let place = Place::new().await;
    let live = started(&place).await;
    publish(&place, &live, &models(0..100)).await;
    live.acquire(&place.storage, some(1)).await.expect("acquired");
    live.give_up();
    assert_eq!((live.whole_parts(), live.ask_parts(&Parts::ALL, |_, _| ())), (Parts::NONE, Err(NotReady)));
    assert!(!live.acquire(&place.storage, some(1)).await.expect("it is to be loaded"));
    live.load_parts(&place.storage, Parts::NONE).await.expect("loaded");
    assert!(live.acquire(&place.storage, some(1)).await.expect("acquired"));
    are_exact(&place, &live).await;
}
