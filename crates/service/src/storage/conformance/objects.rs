//! Files: staged, published whole, read back as they were, set aside, swept.

use tokio::io::{AsyncReadExt, AsyncSeekExt};

use super::ObjectPlace;
use crate::storage::{ObjectError, ObjectStore, StagedFile, TRASH_DAYS};
use visage_domain::{AssetRecord, FileId, ModelId, ScanRecord, ScanSetId, StandardId, StoredFile};

async fn staged(objects: &dyn ObjectStore, content: &[u8]) -> StagedFile {
    let mut writer = objects.receive().await.expect("staging");
    for chunk in content.chunks(3) {
        writer.write(chunk).await.expect("written");
    }
    writer.finish().await.expect("finished")
}

/// What of a staged file arrives whose handle is dropped once it is open.
async fn sent_and_gone(objects: &dyn ObjectStore, content: &[u8]) -> Vec<u8> {
    let file = staged(objects, content).await;
    let mut reader = objects.open_staged(&file).await.expect("there");
    drop(file);
    let mut read = Vec::new();
    reader.read_to_end(&mut read).await.expect("readable");
    read
}

fn checksum(content: &[u8]) -> String {
    blake3::hash(content).to_hex().to_string()
}

fn asset(name: &str, content: &[u8]) -> AssetRecord {
    AssetRecord { name: name.to_owned(), bytes: content.len() as u64, checksum: checksum(content) }
}

fn scan(file_id: FileId, content: &[u8]) -> ScanRecord {
    let (name, bytes) = ("a.ply".to_owned(), content.len() as u64);
    ScanRecord { name, file_id, points: 1, bytes, checksum: checksum(content), reading: None }
}

fn model(objects: &dyn ObjectStore, files: &[(&str, &[u8])]) -> ModelId {
    let (staged, id) = (objects.stage_model().expect("staged"), ModelId::new());
    for (name, content) in files {
        assert_eq!(objects.write_asset(&staged, name, content).expect("written"), checksum(content));
    }
    objects.keep_model(&staged, id).expect("kept");
    id
}

pub async fn a_scan_arrives_whole_and_goes_with_its_set(place: &impl ObjectPlace) {
    let objects = place.open();
    let (set, files) = (ScanSetId::new(), [FileId::new(), FileId::new()]);
    for file in files {
        let upload = staged(objects.as_ref(), b"ten points").await;
        assert_eq!((upload.bytes, upload.checksum.clone()), (10, checksum(b"ten points")));
        assert_eq!(objects.read_staged(&upload).expect("there"), b"ten points");
        assert_eq!(sent_and_gone(objects.as_ref(), b"a copy").await, b"a copy");
        assert!(!objects.listing().expect("listed").contains(&StoredFile::Scan(set, file)));
        objects.keep_scan(&upload, set, file).expect("kept");
        drop(upload);
        assert_eq!(objects.read_scan(set, &scan(file, b"ten points")).expect("there"), b"ten points");
        objects.check_scan(set, &scan(file, b"ten points")).expect("sound");
    }
    objects.remove(StoredFile::Scan(set, files[0])).expect("removed");
    assert_eq!(objects.listing().expect("listed"), [StoredFile::Scan(set, files[1])]);
    for _ in 0..2 {
        // the second time there is nothing left to remove
        objects.remove(StoredFile::ScanSet(set)).expect("removed");
        assert!(objects.read_scan(set, &scan(files[1], b"ten points")).is_err());
    }
}

pub async fn what_is_given_up_leaves_nothing(place: &impl ObjectPlace) {
    let objects = place.open();
    let mut writer = objects.receive().await.expect("staging");
    writer.write(b"half").await.expect("written");
    drop(writer);
    drop(staged(objects.as_ref(), b"whole but unwanted").await);
    let unwanted = objects.stage_model().expect("staged");
    objects.write_asset(&unwanted, "cloud.ply", b"unwanted").expect("written");
    drop(unwanted);
    assert_eq!(objects.listing().expect("listed"), []);
    drop(objects);
    assert_eq!(place.open().sweep_staging().expect("swept"), 0, "nothing is left for the next process");
}

/// Nothing of it is seen before, and all of it from then on.
pub async fn a_model_is_kept_with_all_its_files_and_goes_with_them(place: &impl ObjectPlace) {
    let objects = place.open();
    let (upload, id) = (staged(objects.as_ref(), b"the mesh").await, ModelId::new());
    let staged = objects.stage_model().expect("staged");
    objects.take_asset(&staged, "mesh.ply", &upload).expect("taken over");
    objects.write_asset(&staged, "report.json", b"{}").expect("written");
    assert_eq!(objects.listing().expect("listed"), []);
    let files = [("mesh.ply", &b"the mesh"[..]), ("report.json", b"{}")];
    let is_there = |name: &str, content: &[u8]| objects.check_asset(id, &asset(name, content)).expect("sound");
    assert_eq!(files.map(|(name, content)| is_there(name, content)), [false, false]);
    objects.keep_model(&staged, id).expect("kept");
    drop((staged, upload));
    assert_eq!(files.map(|(name, content)| is_there(name, content)), [true, true]);
    assert_eq!(objects.listing().expect("listed"), [StoredFile::Model(id)]);
    objects.remove(StoredFile::Model(id)).expect("removed");
    objects.remove(StoredFile::Model(id)).expect("no trouble if it is gone");
    assert_eq!(files.map(|(name, content)| is_there(name, content)), [false, false]);
    assert_eq!(objects.listing().expect("listed"), []);
}

/// Where a model gets its place by one step, whoever sees it sees all of it. Not every place for files can do that.
pub async fn a_model_is_published_by_one_step(place: &impl ObjectPlace) {
    let objects = place.open();
    let (upload, id) = (staged(objects.as_ref(), b"the mesh").await, ModelId::new());
    let staged = objects.stage_model().expect("staged");
    objects.take_asset(&staged, "mesh.ply", &upload).expect("taken over");
    objects.write_asset(&staged, "report.json", b"{}").expect("written");
    let watcher = objects.clone();
    let watching = std::thread::spawn(move || {
        while !watcher.listing().expect("listed").contains(&StoredFile::Model(id)) {
            std::thread::yield_now();
        }
        [("mesh.ply", &b"the mesh"[..]), ("report.json", b"{}")]
            .map(|(name, content)| watcher.read_asset(id, &asset(name, content)).expect("sound").is_some())
    });
    objects.keep_model(&staged, id).expect("kept");
    assert_eq!(watching.join().expect("no panic"), [true, true]);
}

pub async fn files_are_sent_whole_or_from_some_place_on(place: &impl ObjectPlace) {
    let objects = place.open();
    let id = model(objects.as_ref(), &[("cloud.ply", b"three points")]);
    let mut file = objects.open_asset(id, &asset("cloud.ply", b"three points")).await.expect("sound").expect("there");
    let mut content = String::new();
    file.seek(std::io::SeekFrom::Start(6)).await.expect("within it");
    file.read_to_string(&mut content).await.expect("read");
    assert_eq!(content, "points");
    let other = asset("mesh.ply", b"");
    assert!(objects.open_asset(id, &other).await.expect("asked").is_none());
    assert!(objects.read_asset(id, &other).expect("asked").is_none());
    assert!(objects.read_asset(ModelId::new(), &other).expect("asked").is_none());
}

pub async fn a_flipped_byte_is_not_given_out(place: &impl ObjectPlace) {
    let objects = place.open();
    let content = b"three points";
    let id = model(objects.as_ref(), &[("cloud.ply", content)]);
    let (set, file, standard) = (ScanSetId::new(), FileId::new(), StandardId::new());
    objects.keep_scan(&staged(objects.as_ref(), content).await, set, file).expect("kept");
    objects.keep_standard(&staged(objects.as_ref(), content).await, standard, "model.ply").expect("kept");
    let (cloud, of_standard) = (asset("cloud.ply", content), asset("model.ply", content));
    assert_eq!(objects.read_asset(id, &cloud).expect("sound").as_deref(), Some(&content[..]));
    assert_eq!(objects.read_standard(standard, &of_standard).expect("sound"), content);

    place.damage(StoredFile::Model(id), Some("cloud.ply"));
    place.damage(StoredFile::Scan(set, file), None);
    place.damage(StoredFile::Standard(standard), Some("model.ply"));
    let is_damaged = |error: ObjectError| matches!(error, ObjectError::Damaged { .. });
    assert!(is_damaged(objects.read_asset(id, &cloud).expect_err("damaged")));
    assert!(is_damaged(objects.check_asset(id, &cloud).expect_err("damaged")));
    assert!(objects.open_asset(id, &cloud).await.is_err_and(is_damaged));
    assert!(is_damaged(objects.read_scan(set, &scan(file, content)).expect_err("damaged")));
    assert!(is_damaged(objects.check_scan(set, &scan(file, content)).expect_err("damaged")));
    assert!(is_damaged(objects.read_standard(standard, &of_standard).expect_err("damaged")));
}

pub async fn what_is_set_aside_is_kept_for_a_while(place: &impl ObjectPlace) {
    let objects = place.open();
    let (id, stays) = (model(objects.as_ref(), &[("a", b"x")]), model(objects.as_ref(), &[("a", b"y")]));
    objects.set_aside(&[StoredFile::Model(id)]).expect("set aside");
    assert_eq!(objects.listing().expect("listed"), [StoredFile::Model(stays)]);
    let now = jiff::Timestamp::now();
    assert_eq!(objects.empty_trash(now).expect("looked"), 0);
    let later = now + jiff::SignedDuration::from_hours(24 * i64::from(TRASH_DAYS) + 1);
    assert_eq!(objects.empty_trash(later).expect("emptied"), 1);
    assert_eq!(objects.listing().expect("listed"), [StoredFile::Model(stays)]);
}

pub async fn what_a_process_was_making_goes_when_it_has_ended(place: &impl ObjectPlace) {
    let ended = place.open();
    // as if it had been killed
    std::mem::forget(staged(ended.as_ref(), b"half").await);
    std::mem::forget(ended.stage_model().expect("staged"));
    assert_eq!(ended.sweep_staging().expect("looked"), 0, "it lives");
    drop(ended);
    let next = place.open();
    let own = staged(next.as_ref(), b"mine").await;
    assert_eq!(next.sweep_staging().expect("swept"), 2);
    assert_eq!(next.read_staged(&own).expect("it is on its way"), b"mine");
}
