//! Which files rows know, and which are on their way.

use super::{DatabasePlace, scan_set};
use visage_domain::{NewModel, SeatId, StoredFile};

pub async fn everything_stored_is_known(place: &impl DatabasePlace) {
    let db = place.open(SeatId::new()).await;
    let db = db.as_ref();
    let set = scan_set(db, &["a.ply", "b.ply"]).await;
    let model = NewModel::example(None);
    drop(db.create_model(&model, None).await.expect("stored"));
    let (known, _) = db.known_files().await.expect("read");
    assert!(known.knows(StoredFile::ScanSet(set)));
    assert_eq!(known.scans.len(), 2);
    assert!(known.knows(StoredFile::Model(model.id)));
    assert_eq!(known.needed().count(), 3);
}

pub async fn a_file_is_loose_before_it_has_a_row_and_after(place: &impl DatabasePlace) {
    let db = place.open(SeatId::new()).await;
    let db = db.as_ref();
    let model = NewModel::example(None);
    let file = StoredFile::Model(model.id);
    let loose = async || {
        let (_, loose) = db.known_files().await.expect("read");
        loose.into_iter().map(|loose| (loose.file, loose.is_deleted)).collect::<Vec<_>>()
    };
    db.expect_files(&[file]).await.expect("stored");
    assert_eq!(loose().await, [(file, false)]);
    drop(db.create_model(&model, None).await.expect("stored"));
    assert_eq!(loose().await, []);
    drop(db.delete_model(model.id).await.expect("deleted"));
    assert_eq!(loose().await, [(file, true)]);
    db.forget_loose(&[file]).await.expect("forgotten");
    assert_eq!(loose().await, []);
}

pub async fn a_file_on_its_way_has_an_owner(place: &impl DatabasePlace) {
    let seat = SeatId::new();
    let [a, b] = [place.open(seat).await, place.open(SeatId::new()).await];
    let model = NewModel::example(None);
    let file = StoredFile::Model(model.id);
    a.expect_files(&[file]).await.expect("stored");
    let next = place.open(seat).await;
    let now = jiff::Timestamp::now();
    let (_, loose) = b.known_files().await.expect("read");
    assert_eq!(loose[0].owner, Some(a.owner()));
    let is_left = [&a, &b, &next].map(|db| loose[0].is_left(db.owner(), now));
    assert_eq!(is_left, [false, false, true], "only its seat has changed hands");
    // the row takes it back, and leaves a file that is anybody's to remove
    drop(a.create_model(&model, None).await.expect("stored"));
    drop(b.delete_model(model.id).await.expect("deleted"));
    let (_, loose) = a.known_files().await.expect("read");
    assert!(loose[0].is_left(a.owner(), now) && loose[0].is_left(b.owner(), now));
}
