//! The gallery over what is stored, before and after all that may happen to it. A module of `#[cfg(test)]`.

use std::collections::BTreeMap;
use std::sync::atomic::Ordering::SeqCst;

use super::*;
use crate::storage::conformance::memory::MemoryPlace;
use crate::storage::conformance::{DatabasePlace, ObjectPlace};
use crate::storage::sqlite::testing::SqlitePlace;
use loading::PAGE;
use visage_domain::{NewModel, SeatId, StoredSignature};
use visage_gallery::TopK;
use visage_shape::faces::signature::example::example;

/// A database and files that outlive the galleries that are loaded from them.
pub(super) struct Place {
    pub storage: Storage,
    database: SqlitePlace,
}

impl Place {
    pub async fn new() -> Place {
        let database = SqlitePlace::new().await;
        let storage = Storage { database: database.open(SeatId::new()).await, objects: MemoryPlace::new().open() };
        storage.database.keep_index().await.expect("a node");
        Place { storage, database }
    }

    /// A process that has loaded the gallery, and merges only when it is told to.
    pub async fn process(&self) -> LiveGallery {
        let live = LiveGallery::default();
        live.shared.merging.store(true, SeqCst);
        live.load(&self.storage).await.expect("loaded");
        live
    }

    pub async fn store(&self, models: &[NewModel]) {
        self.storage.database.create_models(models).await.expect("stored");
    }

    pub async fn delete(&self, live: &LiveGallery, id: ModelId) {
        drop(self.storage.database.delete_model(id).await.expect("deleted"));
        live.remove(id);
    }

    /// Everything that the gallery and a new one over what is stored answer to some questions, which must be the same.
    pub async fn is_exact(&self, live: &LiveGallery) {
        let stored = self.storage.database.signatures_after(None, 100_000).await.expect("read");
        let signatures = stored.into_iter().map(|(id, content)| match content {
            visage_domain::StoredContent::Whole(content) => {
                (id.number(), Signature::from_bytes(&content).expect("of this version"))
            }
            visage_domain::StoredContent::Damaged => panic!("whole"),
        });
        let anew = Gallery::build(signatures.collect());
        assert_eq!(live.ask(Gallery::len), Ok(anew.len()));
        for seed in [0.3, 1.7, 4.4] {
            let ask = |gallery: &Gallery| gallery.by_probe(&example(seed, 6), None, &TopK::best(50));
            assert_eq!(live.ask(ask), Ok(ask(&anew)));
            let judged = |gallery: &Gallery| gallery.by_standard("face", Default::default(), &TopK::best(2000));
            assert_eq!(live.ask(judged), Ok(judged(&anew)));
        }
    }

    pub async fn files(&self) -> (usize, usize) {
        let listed = self.storage.database.segments().await.expect("read").len();
        (listed, self.storage.objects.segment_listing().expect("listed").len())
    }

    /// Flips a bit in the middle of a file, where nothing points to anything.
    fn flipped(&self) -> visage_domain::SegmentId {
        let objects = &self.storage.objects;
        let id = objects.segment_listing().expect("listed")[0];
        let mut content = objects.map_segment(id).expect("read").expect("there").to_vec();
        let middle = content.len() / 2;
        content[middle] ^= 0x40;
        objects.keep_segment(id, &mut |to| to.write_all(&content)).expect("written");
        id
    }

    async fn unfiled(&self) -> usize {
        self.storage.database.unfiled_after(&visage_domain::Parts::ALL, None, 100_000).await.expect("read").len()
    }
}

/// Models whose signature is stored, told apart by a number.
pub(super) fn models(numbers: std::ops::Range<u32>) -> Vec<NewModel> {
    let model = |number: u32| {
        let signature = example(0.037 * f64::from(number), 3 + (number % 4) as usize);
        NewModel { signature: Some(StoredSignature::from(&signature)), ..NewModel::example(None) }
    };
    numbers.map(model).collect()
}

fn signature(model: &NewModel) -> Signature {
    Signature::from_bytes(&model.signature.as_ref().expect("it has one").content).expect("of this version")
}

pub(super) async fn publish(place: &Place, live: &LiveGallery, models: &[NewModel]) {
    place.store(models).await;
    for model in models {
        live.publish(place.storage.database.as_ref(), model.id, signature(model)).await.expect("published");
    }
}

async fn merge(live: &LiveGallery) {
    let live = live.clone();
    tokio::task::spawn_blocking(move || live.merge()).await.expect("no panic");
}

#[tokio::test]
async fn it_is_ready_only_when_loaded() {
    let place = Place::new().await;
    let gallery = LiveGallery::default();
    assert_eq!(gallery.ask(Gallery::len), Err(NotReady));
    // deleting a model nobody knows is no trouble, before or after
    gallery.remove(ModelId::new());
    assert_eq!(gallery.load(&place.storage).await.expect("loaded"), 0);
    assert!(gallery.is_ready());
    gallery.remove(ModelId::new());
    assert_eq!(gallery.ask(Gallery::len), Ok(0));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn all_pages_are_loaded_and_changes_meanwhile_are_not_lost() {
    let place = Place::new().await;
    let models: Vec<NewModel> = (0..PAGE + 10).flat_map(|_| models(8..9)).collect();
    place.store(&models).await;
    let gallery = LiveGallery::default();
    let (late, gone) = (ModelId::new(), models[17].id);
    gallery.insert(late, example(0.9, 6));
    gallery.remove(gone);
    assert_eq!(gallery.load(&place.storage).await.expect("loaded"), models.len());
    let best = gallery.ask(|g| g.by_probe(&example(0.9, 6), None, &TopK::best(1))).expect("ready");
    assert_eq!(best[0].model_id, late.number());
    let all = gallery.ask(|g| g.by_probe(&example(0.3, 5), None, &TopK::best(5000))).expect("ready");
    assert!(all.iter().all(|found| found.model_id != gone.number()));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn additions_are_seen_at_once_while_segments_are_merged() {
    let place = Place::new().await;
    let gallery = LiveGallery::default();
    gallery.load(&place.storage).await.expect("loaded");
    for count in 1..600 {
        gallery.insert(ModelId::new(), example(0.01 * count as f64, 3));
        assert_eq!(gallery.ask(Gallery::len), Ok(count));
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_second_start_maps_what_the_first_one_made_and_reads_no_signature() {
    let place = Place::new().await;
    let stored = models(0..300);
    place.store(&stored).await;
    assert_eq!(place.unfiled().await, 300);
    place.is_exact(&place.process().await).await;
    assert_eq!((place.files().await, place.unfiled().await), ((1, 1), 0));
    let live = place.process().await;
    assert!(live.gallery().expect("ready").segments().all(|segment| segment.file().is_some()));
    place.is_exact(&live).await;
    let facets = live.catalogue().facets(stored[7].id.number()).cloned();
    assert_eq!(facets.and_then(|facets| facets.label).as_deref(), Some("face"));
    live.examine(&place.storage).await.expect("all is sound");
    assert_eq!(place.files().await, (1, 1));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_deleted_model_is_in_no_answer_of_a_later_start() {
    let place = Place::new().await;
    let stored = models(0..200);
    place.store(&stored).await;
    let live = place.process().await;
    for model in &stored[..120] {
        place.delete(&live, model.id).await;
    }
    // one is described anew
    let other: StoredSignature = (&example(77.0, 6)).into();
    drop(place.storage.database.renew_signature(stored[150].id, &other).await.expect("renewed"));
    drop(live);
    assert_eq!(place.unfiled().await, 121);
    let live = place.process().await;
    place.is_exact(&live).await;
    merge(&live).await;
    place.is_exact(&live).await;
    let live = place.process().await;
    place.is_exact(&live).await;
    assert_eq!(place.files().await, (1, 1), "the gaps are closed");
    assert!(place.unfiled().await <= 1, "no file tells anything of what was deleted");
}

/// What happens between two starts, cut off after some steps of those that put segments into files.
async fn interrupted(steps: usize) -> (Place, bool) {
    let place = Place::new().await;
    let first = models(0..150);
    place.store(&first).await;
    let live = place.process().await;
    live.files().expect("loaded").fuse.store(steps, SeqCst);
    publish(&place, &live, &models(1000..1070)).await;
    merge(&live).await;
    for model in &first[..100] {
        place.delete(&live, model.id).await;
    }
    merge(&live).await;
    place.is_exact(&live).await;
    let ended = live.files().expect("loaded").fuse.load(SeqCst) == 0;
    (place, ended)
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn wherever_a_merge_is_cut_off_the_next_start_answers_as_if_it_were_not() {
    let mut steps = 0;
    loop {
        let (place, ended) = interrupted(steps).await;
        let live = place.process().await;
        place.is_exact(&live).await;
        let (listed, there) = place.files().await;
        assert_eq!(listed, there, "what did not count is removed; {steps} steps");
        assert!(files::damaged_files(&place.storage).await.expect("read").is_empty());
        // and goes on from there
        merge(&live).await;
        publish(&place, &live, &models(5000..5070)).await;
        merge(&live).await;
        place.is_exact(&place.process().await).await;
        if !ended {
            assert!(steps > 12, "the test must meet steps: {steps}");
            return;
        }
        steps += 1;
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_file_that_is_lost_damaged_or_of_another_version_is_made_anew() {
    let place = Place::new().await;
    place.store(&models(0..100)).await;
    drop(place.process().await);
    place.store(&models(100..230)).await;
    drop(place.process().await);
    let ids: Vec<_> = place.storage.database.segments().await.expect("read").iter().map(|s| s.id).collect();
    assert_eq!(ids.len(), 2);
    type Damage = dyn Fn(&mut Vec<u8>);
    let change = |change: &Damage| {
        let objects = &place.storage.objects;
        let id = objects.segment_listing().expect("listed")[0];
        let mut content = objects.map_segment(id).expect("read").expect("there").to_vec();
        change(&mut content);
        objects.keep_segment(id, &mut |to| to.write_all(&content)).expect("written");
    };
    let changes: [&Damage; 4] = [
        &|content| content.truncate(content.len() / 2),
        &|content| content[9] ^= 1,
        &|content| content[40] ^= 1,
        &|content| content.clear(),
    ];
    for (k, damage) in changes.into_iter().enumerate() {
        change(damage);
        assert_eq!(files::damaged_files(&place.storage).await.expect("read").len(), 1);
        place.is_exact(&place.process().await).await;
        assert!(files::damaged_files(&place.storage).await.expect("read").is_empty(), "case {k}");
    }
    let lost = place.storage.objects.segment_listing().expect("listed")[0];
    place.storage.objects.remove_segment(lost).expect("removed");
    place.is_exact(&place.process().await).await;
    assert_eq!(place.unfiled().await, 0);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_byte_that_flipped_in_a_column_is_found_after_the_start_and_what_it_spoilt_is_made_anew() {
    let place = Place::new().await;
    place.store(&models(0..300)).await;
    drop(place.process().await);
    let id = place.flipped();
    let live = place.process().await;
    // as the server's chores do
    let (examiner, storage) = (live.clone(), place.storage.clone());
    tokio::spawn(async move { examiner.examine(&storage).await }).await.expect("no panic").expect("made anew");
    place.is_exact(&live).await;
    assert!(!place.storage.objects.segment_listing().expect("listed").contains(&id));
    place.is_exact(&place.process().await).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_could_not_be_made_anew_is_loaded_again() {
    let place = Place::new().await;
    place.store(&models(0..300)).await;
    drop(place.process().await);
    place.flipped();
    let live = place.process().await;
    place.storage.database.close().await;
    live.examine(&place.storage).await.expect_err("no signature can be read");
    assert!(!live.is_ready(), "no answer without what is lost");
    live.lost().await;
    let storage = Storage { database: place.database.open(SeatId::new()).await, ..place.storage.clone() };
    live.load(&storage).await.expect("loaded");
    Place { storage, ..place }.is_exact(&live).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_can_not_be_written_stays_in_memory_and_is_written_later() {
    let place = Place::new().await;
    place.store(&models(0..150)).await;
    let live = place.process().await;
    let (before, fuse) = (place.files().await, live.files().expect("loaded"));
    fuse.fuse.store(0, SeqCst);
    publish(&place, &live, &models(1000..1700)).await;
    merge(&live).await;
    place.is_exact(&live).await;
    assert!(live.is_stuck());
    assert_eq!(place.files().await, before);
    fuse.fuse.store(usize::MAX, SeqCst);
    live.shared.is_stuck.store(false, SeqCst);
    merge(&live).await;
    assert!(place.unfiled().await < 128 && place.files().await.0 > 0);
    place.is_exact(&live).await;
    place.is_exact(&place.process().await).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn whatever_happened_a_start_answers_from_what_is_stored() {
    use rand_free::Random;
    let place = Place::new().await;
    let mut random = Random(7);
    let mut truth: BTreeMap<ModelId, ()> = BTreeMap::new();
    let mut live = place.process().await;
    for round in 0..24 {
        match random.below(4) {
            0 | 1 => {
                let new = models(10_000 * round..10_000 * round + random.below(120) as u32);
                truth.extend(new.iter().map(|model| (model.id, ())));
                publish(&place, &live, &new).await;
            }
            2 => {
                let gone: Vec<ModelId> = truth.keys().copied().filter(|_| random.below(3) == 0).collect();
                for id in gone {
                    truth.remove(&id);
                    place.delete(&live, id).await;
                }
            }
            _ => {
                live = place.process().await;
                live.files().expect("loaded").fuse.store(random.below(40), SeqCst);
            }
        }
        merge(&live).await;
        assert_eq!(live.ask(Gallery::len), Ok(truth.len()), "round {round}");
    }
    place.is_exact(&live).await;
    place.is_exact(&place.process().await).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn damage_is_not_merged_into_a_sound_file() {
    let place = Place::new().await;
    let stored = models(0..300);
    place.store(&stored).await;
    drop(place.process().await);
    let id = place.flipped();
    let live = place.process().await;
    for model in &stored[..150] {
        place.delete(&live, model.id).await;
    }
    merge(&live).await;
    place.is_exact(&live).await;
    assert!(!place.storage.objects.segment_listing().expect("listed").contains(&id));
    place.is_exact(&place.process().await).await;
}

/// Numbers that look like chance, without a crate for them.
mod rand_free {
    pub struct Random(pub u64);

    impl Random {
        pub fn below(&mut self, bound: u64) -> usize {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((self.0 >> 33) % bound) as usize
        }
    }
}
