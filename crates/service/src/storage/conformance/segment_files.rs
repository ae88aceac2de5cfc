//! Files of the index.

use std::io;

use super::ObjectPlace;
use visage_domain::SegmentId;

pub async fn a_file_of_the_index_is_there_when_it_is_whole_and_lent_also_after_it_is_removed(place: &impl ObjectPlace) {
    let (whole, broken) = (SegmentId::new(), SegmentId::new());
    let objects = place.open();
    objects.keep_segment(whole, &mut |to| to.write_all(&[7; 10_000])).expect("kept");
    let refused = objects.keep_segment(broken, &mut |to| {
        to.write_all(&[1; 10_000])?;
        Err(io::ErrorKind::StorageFull.into())
    });
    assert!(refused.expect_err("it was broken off").is_storage_full());
    assert_eq!(objects.segment_listing().expect("listed"), [whole]);
    assert!(objects.map_segment(broken).expect("looked").is_none());
    assert!(objects.open_segment(broken).expect("looked").is_none());
    assert!(objects.listing().expect("listed").is_empty(), "the inventory is not about them");
    drop(objects);

    let objects = place.open();
    assert_eq!(objects.sweep_staging().expect("swept"), 0, "nothing half was left");
    let lent = objects.map_segment(whole).expect("read").expect("there");
    let mut read = Vec::new();
    let mut file = objects.open_segment(whole).expect("read").expect("there");
    file.read_to_end(&mut read).expect("read");
    objects.remove_segment(whole).expect("removed");
    objects.remove_segment(whole).expect("no trouble if it is gone");
    assert_eq!((lent.len(), &lent[..]), (10_000, &read[..]));
    assert!(objects.segment_listing().expect("listed").is_empty());
}
