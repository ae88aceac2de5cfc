//! Which files of the index count, and what they don't tell.

use super::DatabasePlace;
use crate::storage::Database;
use visage_domain::{
    ModelId, NewModel, Parts, SeatId, SegmentId, SegmentRecord, StoredContent, StoredSignature, part_of,
};
use visage_shape::faces::SignatureSummary;

fn signature(content: &[u8]) -> StoredSignature {
    let summary = SignatureSummary { version: 1, regions: 2, triangles: 3, left_out: Default::default() };
    StoredSignature { version: 1, summary, content: content.to_vec() }
}

fn model(content: &[u8]) -> NewModel {
    NewModel { signature: Some(signature(content)), ..NewModel::example(None) }
}

fn checksum(content: &[u8]) -> u128 {
    u128::from_be_bytes(*blake3::hash(content).as_bytes().first_chunk().expect("32 bytes"))
}

fn record(models: u64) -> SegmentRecord {
    SegmentRecord { id: SegmentId::new(), models, bytes: 1 << 40, checksum: u32::MAX }
}

async fn unfiled(db: &dyn Database) -> Vec<(ModelId, bool)> {
    let unfiled = db.unfiled_after(&Parts::ALL, None, 100).await.expect("read");
    unfiled.into_iter().map(|model| (model.id, model.signature.is_some())).collect()
}

pub async fn a_model_is_unfiled_until_a_file_tells_its_very_signature(place: &impl DatabasePlace) {
    let db = place.open(SeatId::new()).await;
    let db = db.as_ref();
    db.keep_index().await.expect("a node");
    let models = [b"a", b"b", b"c"].map(|content| model(content));
    db.create_models(&models).await.expect("stored");
    drop(db.create_model(&NewModel::example(None), None).await.expect("one without a signature"));
    let read = db.unfiled_after(&Parts::ALL, None, 2).await.expect("read");
    let (content, facets) = read[0].signature.clone().expect("it has one");
    assert_eq!((read.len(), content), (2, StoredContent::Whole(b"a".to_vec())));
    assert_eq!((facets.label.as_deref(), facets.unit), (Some("face"), visage_geometry::Unit::Mm));
    assert_eq!(db.unfiled_after(&Parts::ALL, Some(read[1].id), 2).await.expect("read").len(), 1);

    let ids = models.each_ref().map(|model| model.id);
    let new = [record(2), record(1)];
    db.swap_segments(&new, &[]).await.expect("swapped");
    // the second has been described anew meanwhile
    drop(db.renew_signature(ids[1], &signature(b"other")).await.expect("renewed"));
    db.file_models(&[(ids[0], checksum(b"a")), (ids[1], checksum(b"b"))]).await.expect("filed");
    assert_eq!(unfiled(db).await, [(ids[1], true), (ids[2], true)]);

    for id in [ids[0], ids[2]] {
        drop(db.delete_model(id).await.expect("deleted"));
    }
    assert_eq!(unfiled(db).await, [(ids[0], false), (ids[1], true), (ids[2], false)]);
    db.file_models(&[(ids[0], checksum(b"a"))]).await.expect("it is gone");
    db.forget_unfiled(&[ids[1], ids[2]]).await.expect("forgotten");
    assert_eq!(unfiled(db).await, [(ids[0], false), (ids[1], true)], "one has a signature, one may be in a file");

    let next = record(3);
    db.swap_segments(&[next], &[new[0].id]).await.expect("swapped");
    assert_eq!(db.segments().await.expect("read"), [new[1], next]);
}

pub async fn what_was_in_lost_files_is_unfiled(place: &impl DatabasePlace) {
    let db = place.open(SeatId::new()).await;
    let db = db.as_ref();
    db.keep_index().await.expect("a node");
    let models: Vec<NewModel> = (0..9000u32).map(|number| model(&number.to_le_bytes())).collect();
    db.create_models(&models).await.expect("stored");
    let new = [record(8000), record(1000)];
    db.swap_segments(&new, &[]).await.expect("swapped");
    let known = models.iter().zip(0u32..).map(|(model, number)| (model.id, checksum(&number.to_le_bytes())));
    db.file_models(&known.collect::<Vec<_>>()).await.expect("filed");
    assert!(unfiled(db).await.is_empty());
    let told: Vec<ModelId> = models[8000..].iter().map(|model| model.id).collect();
    db.lose_segments(&[new[0].id], &told).await.expect("lost");
    let all = db.unfiled_after(&Parts::ALL, None, 10_000).await.expect("read");
    assert!(all.iter().map(|model| model.id).eq(models[..8000].iter().map(|model| model.id)));
    assert_eq!(db.segments().await.expect("read"), [new[1]]);
}

pub async fn parts_are_asked_for_apart_and_can_be_given_up(place: &impl DatabasePlace) {
    let db = place.open(SeatId::new()).await;
    let db = db.as_ref();
    db.keep_index().await.expect("a node");
    let models: Vec<NewModel> = (0..40u32).map(|number| model(&number.to_le_bytes())).collect();
    db.create_models(&models).await.expect("stored");
    let some: Parts = models[..3].iter().map(|model| part_of(model.id)).collect();
    let of_them = |parts: &Parts| -> Vec<ModelId> {
        models.iter().map(|model| model.id).filter(|id| parts.hold(part_of(*id))).collect()
    };
    let listed = async |parts: &Parts| -> Vec<ModelId> {
        db.unfiled_after(parts, None, 100).await.expect("read").iter().map(|model| model.id).collect()
    };
    for parts in [Parts::NONE, some, Parts::ALL.without(&some), Parts::ALL] {
        assert_eq!(listed(&parts).await, of_them(&parts));
    }
    let known: Vec<(ModelId, u128)> =
        models.iter().zip(0u32..).map(|(model, number)| (model.id, checksum(&number.to_le_bytes()))).collect();
    db.file_models(&known).await.expect("filed");
    assert!(listed(&Parts::ALL).await.is_empty());
    for _ in 0..2 {
        db.unfile_parts(&some).await.expect("given up");
        assert_eq!(listed(&Parts::ALL).await, of_them(&some), "once and again");
    }
}

pub async fn each_node_has_an_index_of_its_own(place: &impl DatabasePlace) {
    let (first, second) = (place.open(SeatId::new()).await, place.open(SeatId::new()).await);
    first.keep_index().await.expect("a node");
    let models = [b"a", b"b"].map(|content| model(content));
    let ids = models.each_ref().map(|model| model.id);
    first.create_models(&models).await.expect("stored");
    first.swap_segments(&[record(1)], &[]).await.expect("swapped");
    first.file_models(&[(ids[0], checksum(b"a"))]).await.expect("filed");

    second.keep_index().await.expect("another node");
    assert!(second.segments().await.expect("read").is_empty());
    assert_eq!(unfiled(second.as_ref()).await, [(ids[0], true), (ids[1], true)], "no file of its tells anything");
    let of_second = record(2);
    second.swap_segments(&[of_second], &[]).await.expect("swapped");
    second.file_models(&[(ids[0], checksum(b"a")), (ids[1], checksum(b"b"))]).await.expect("filed");
    second.keep_index().await.expect("it is known");
    assert!(unfiled(second.as_ref()).await.is_empty());
    assert_eq!(unfiled(first.as_ref()).await, [(ids[1], true)]);

    drop(first.delete_model(ids[0]).await.expect("deleted"));
    assert_eq!(unfiled(second.as_ref()).await, [(ids[0], false)], "either learns of what the other does");
    first.lose_segments(&[of_second.id], &[]).await.expect("it is not its own");
    assert_eq!(second.segments().await.expect("read"), [of_second]);
}
