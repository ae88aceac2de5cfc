//! Scan sets and models, lists, and what holds for every write.

use std::future::poll_fn;
use std::task::Poll;

use super::{DatabasePlace, scan_set};
use crate::storage::DatabaseError;
use visage_domain::asset::Origin;
use visage_domain::{
    FileId, MatchedModel, ModelFacets, ModelFilter, ModelId, NewModel, NewScanSet, PageRequest, PoseFile, PutScan,
    ScanRecord, ScanSetId, SeatId, StoredContent, StoredSignature,
};
use visage_geometry::Unit;
use visage_shape::faces::SignatureSummary;

fn scan(name: &str) -> ScanRecord {
    let (file_id, checksum) = (FileId::new(), "ab".to_owned());
    ScanRecord { name: name.to_owned(), file_id, points: 3, bytes: 9, checksum, reading: Some("{}".to_owned()) }
}

pub async fn scans_come_back_in_natural_order(place: &impl DatabasePlace) {
    let db = place.open(SeatId::new()).await;
    let db = db.as_ref();
    let id = scan_set(db, &["scan10.ply", "scan2.ply", "scan1.ply"]).await;
    let set = db.scan_set(id).await.expect("stored");
    let names: Vec<&str> = set.scans.iter().map(|scan| scan.name.as_str()).collect();
    assert_eq!(names, ["scan1.ply", "scan2.ply", "scan10.ply"]);
}

pub async fn a_scan_is_replaced_and_the_limit_holds(place: &impl DatabasePlace) {
    let db = place.open(SeatId::new()).await;
    let db = db.as_ref();
    let id = scan_set(db, &["a.ply"]).await;
    let first = scan("b.ply");
    assert_eq!(db.put_scan(id, &first, 2).await.expect("put"), PutScan::Created);
    assert_eq!(db.scan_set(id).await.expect("stored").scans[1].reading.as_deref(), Some("{}"));
    let again = scan("b.ply");
    assert_eq!(db.put_scan(id, &again, 2).await.expect("put"), PutScan::Replaced(first.file_id));
    let refused = db.put_scan(id, &scan("c.ply"), 2).await.expect_err("full");
    assert!(matches!(refused, DatabaseError::TooManyScans { limit: 2 }));
    assert_eq!(db.delete_scan(id, "b.ply").await.expect("there"), again.file_id);
    assert!(matches!(db.delete_scan(id, "b.ply").await, Err(DatabaseError::NotFound { kind: "scan", .. })));
}

pub async fn lists_are_paged_newest_first(place: &impl DatabasePlace) {
    let db = place.open(SeatId::new()).await;
    let db = db.as_ref();
    let mut ids = Vec::new();
    for _ in 0..3 {
        ids.push(scan_set(db, &[]).await);
    }
    let first = db.scan_sets(&PageRequest { before: None, limit: 2 }).await.expect("listed");
    assert_eq!(first.items.iter().map(|set| set.id).collect::<Vec<_>>(), [ids[2], ids[1]]);
    assert!(first.more);
    let rest = PageRequest { before: Some(ids[1].to_string()), limit: 2 };
    let rest = db.scan_sets(&rest).await.expect("listed");
    assert_eq!(rest.items.len(), 1);
    assert!(!rest.more);
}

pub async fn a_model_goes_with_all_its_parts(place: &impl DatabasePlace) {
    let db = place.open(SeatId::new()).await;
    let db = db.as_ref();
    let summary = SignatureSummary { version: 1, regions: 2, triangles: 3, left_out: Default::default() };
    let signature = StoredSignature { version: 1, summary: summary.clone(), content: vec![1, 2, 3] };
    let model = NewModel { signature: Some(signature), ..NewModel::example(None) };
    drop(db.create_model(&model, None).await.expect("stored"));
    assert_eq!(db.model(model.id).await.expect("there").signature, Some(summary));
    assert_eq!(db.assets(model.id).await.expect("read"), model.assets);
    let whole = StoredContent::Whole(vec![1, 2, 3]);
    assert_eq!(db.signatures_after(None, 5).await.expect("read"), [(model.id, whole)]);
    assert!(db.signatures_after(Some(model.id), 5).await.expect("read").is_empty());
    drop(db.delete_model(model.id).await.expect("deleted"));
    assert!(db.assets(model.id).await.expect("read").is_empty());
    assert!(db.signatures_after(None, 5).await.expect("read").is_empty());
    assert!(matches!(db.delete_model(model.id).await, Err(DatabaseError::NotFound { kind: "model", .. })));
}

pub async fn models_are_given_as_far_as_they_are_there(place: &impl DatabasePlace) {
    let db = place.open(SeatId::new()).await;
    let db = db.as_ref();
    let summary = SignatureSummary { version: 1, regions: 2, triangles: 3, left_out: Default::default() };
    let signature = StoredSignature { version: 1, summary, content: vec![1, 2, 3] };
    let described = NewModel { signature: Some(signature), ..NewModel::example(None) };
    let bare = NewModel::example(None);
    for model in [&described, &bare] {
        drop(db.create_model(model, None).await.expect("stored"));
    }
    let facets = ModelFacets { label: Some("face".to_owned()), unit: Unit::Mm, origin: Origin::Uploaded };
    let found = db.matched_models(&[bare.id, ModelId::new(), described.id]).await.expect("read");
    let expected = |model: &NewModel, signature: Option<Vec<u8>>| MatchedModel {
        id: model.id,
        name: "uploaded".to_owned(),
        facets: facets.clone(),
        signature,
    };
    assert_eq!(found, [expected(&described, Some(vec![1, 2, 3])), expected(&bare, None)]);
    assert_eq!(db.facets().await.expect("read"), [(described.id, facets)]);
}

pub async fn models_are_found_by_words_of_their_names_and_labels(place: &impl DatabasePlace) {
    let db = place.open(SeatId::new()).await;
    let named = |name: &str, label: Option<&str>| NewModel {
        name: name.to_owned(),
        label: label.map(str::to_owned),
        ..NewModel::example(None)
    };
    for model in [named("Große Äpfel 100%", Some("Fruit")), named("a*b [7]", None), named("ÄPFEL_2", Some("fruit"))]
    {
        drop(db.create_model(&model, None).await.expect("stored"));
    }
    let page = PageRequest { before: None, limit: 2 };
    for (text, names) in [
        ("äpfel", vec!["ÄPFEL_2", "Große Äpfel 100%"]),
        ("FRUIT äp", vec!["ÄPFEL_2", "Große Äpfel 100%"]),
        ("fruit groß", vec!["Große Äpfel 100%"]),
        // signs that mean something in patterns stand for themselves
        ("100%", vec!["Große Äpfel 100%"]),
        ("_2", vec!["ÄPFEL_2"]),
        ("*b", vec!["a*b [7]"]),
        ("[7]", vec!["a*b [7]"]),
        ("?", vec![]),
        ("'; --", vec![]),
    ] {
        let words = text.split_whitespace().map(str::to_owned).collect();
        let found = db.models(&ModelFilter { words, ..ModelFilter::default() }, &page).await.expect("read");
        let found: Vec<&str> = found.items.iter().map(|model| model.name.as_str()).collect();
        assert_eq!(found, names, "{text}");
    }
    // of all that a query may answer with there are no pages
    for (words, count) in [(vec![], 3), (vec!["fruit"], 2), (vec!["fruit", "_2"], 1), (vec!["fruit", "a*b"], 0)] {
        let words: Vec<String> = words.into_iter().map(str::to_owned).collect();
        assert_eq!(db.models_with_words(&words).await.expect("read").len(), count, "{words:?}");
    }
    // a page is full of what fits, and goes on after it
    let words = vec!["fruit".to_owned()];
    let filter = ModelFilter { words, ..ModelFilter::default() };
    let first = db.models(&filter, &PageRequest { before: None, limit: 1 }).await.expect("read");
    assert!(first.more && first.items.len() == 1, "{first:?}");
    let before = Some(first.items[0].id.to_string());
    let rest = db.models(&filter, &PageRequest { before, limit: 1 }).await.expect("read");
    assert!(!rest.more && rest.items[0].name == "Große Äpfel 100%", "{rest:?}");
}

pub async fn a_query_waits_for_what_is_committed_but_not_in_the_index(place: &impl DatabasePlace) {
    let db = place.open(SeatId::new()).await;
    db.settled().await;
    let unseen = db.create_model(&NewModel::example(None), None).await.expect("stored");
    let mut query = std::pin::pin!(db.settled());
    let waits = poll_fn(|context| Poll::Ready(query.as_mut().poll(context).is_pending())).await;
    assert!(waits, "the index does not know the model yet");
    drop(unseen);
    query.await;
}

pub async fn a_full_database_says_so_and_is_as_it_was(place: &impl DatabasePlace) {
    let db = place.open_full().await;
    let poses = PoseFile { name: "poses".to_owned(), content: vec![7; 100_000] };
    let (name, unit) = ("large".to_owned(), Unit::Mm);
    let (scans, passed_over) = (Vec::new(), Vec::new());
    let set = NewScanSet { id: ScanSetId::new(), name, unit, scans, poses: Some(poses), passed_over };
    for _ in 0..2 {
        let refused = db.create_scan_set(&set, None).await.expect_err("full");
        assert!(matches!(refused, DatabaseError::Full), "{refused}");
        assert!(!refused.leaves_in_doubt());
    }
    assert!(matches!(db.scan_set(set.id).await, Err(DatabaseError::NotFound { .. })));
    assert_eq!(db.scan_sets(&PageRequest { before: None, limit: 2 }).await.expect("listed").items.len(), 0);
}
