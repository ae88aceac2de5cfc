//! The bucket in memory, or, where `VISAGE_S3` is the address of an S3 server with a bucket `visage`, on that.

use std::path::Path;
use std::time::Duration;

use bytes::Bytes;
use object_store::memory::InMemory;

use super::*;
use crate::storage::conformance::ObjectPlace;
use crate::storage::{ObjectStore, StagedFile};
use visage_domain::{AssetRecord, FileId, ModelId, ScanRecord, ScanSetId, StoredFile};

/// Room in the cache.
const CACHE: u64 = 100;

/// A bucket of a test, and a data folder beside it.
struct BucketPlace {
    folder: tempfile::TempDir,
    prefix: String,
    memory: Arc<InMemory>,
}

impl BucketPlace {
    fn bucket(&self) -> Bucket {
        let Ok(endpoint) = std::env::var("VISAGE_S3") else {
            return Bucket::new("s3://memory".to_owned(), &self.prefix, self.memory.clone()).expect("threads");
        };
        let url = format!("s3://visage/{}", self.prefix).parse().expect("a bucket");
        connect(&BucketSettings { url, endpoint: Some(endpoint), region: None, cache_bytes: CACHE }).expect("set up")
    }

    fn files(&self) -> BucketFiles {
        let local = Arc::new(LocalFiles::open(self.folder.path(), Duration::ZERO).expect("nobody else has it"));
        BucketFiles::open(local, self.bucket(), CACHE).expect("opened")
    }

    fn cached(&self, place: &str) -> std::path::PathBuf {
        self.folder.path().join("cache").join(place)
    }
}

impl ObjectPlace for BucketPlace {
    fn new() -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        // without its database a folder that holds something is not opened again
        std::fs::write(folder.path().join("visage.sqlite"), "a database").expect("written");
        BucketPlace { folder, prefix: format!("test/{}", FileId::new()), memory: Arc::default() }
    }

    fn open(&self) -> Arc<dyn ObjectStore> {
        Arc::new(self.files())
    }

    fn damage(&self, file: StoredFile, asset: Option<&str>) {
        let place = asset.map_or(file.to_string(), |asset| format!("{file}/{asset}"));
        let bucket = self.bucket();
        let mut content = bucket.small("reading", &place).expect("read").expect("published").to_vec();
        content[0] ^= 1;
        bucket.remove("removing", &place).expect("removed");
        bucket.put_new("putting", &place, content.into()).expect("put");
        // what the cache has is sound still
        let _ = std::fs::remove_file(self.cached(&place));
    }
}

mod conformance {
    use super::BucketPlace;

    crate::storage::conformance::object_conformance!(BucketPlace);
}

async fn staged(objects: &dyn ObjectStore, content: &[u8]) -> StagedFile {
    let mut writer = objects.receive().await.expect("staging");
    writer.write(content).await.expect("written");
    writer.finish().await.expect("finished")
}

fn scan(content: &[u8]) -> ScanRecord {
    let (name, bytes, checksum) =
        ("a.ply".to_owned(), content.len() as u64, blake3::hash(content).to_hex().to_string());
    ScanRecord { name, file_id: FileId::new(), points: 1, bytes, checksum, reading: None }
}

fn flip(file: &Path) {
    let mut content = std::fs::read(file).expect("cached");
    content[0] ^= 1;
    // another file: the bucket in memory may share the pages of this one
    let other = file.with_extension("new");
    std::fs::write(&other, content).expect("written");
    std::fs::rename(&other, file).expect("changed");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_damaged_file_of_the_cache_is_fetched_anew() {
    let place = BucketPlace::new();
    let (set, scan, files) = (ScanSetId::new(), scan(b"ten points"), place.files());
    files.keep_scan(&staged(&files, b"ten points").await, set, scan.file_id).expect("kept");
    let cached = place.cached(&StoredFile::Scan(set, scan.file_id).to_string());
    assert!(cached.exists(), "a job reads it soon");
    drop(files);
    flip(&cached);
    assert_eq!(place.files().read_scan(set, &scan).expect("sound"), b"ten points");
    assert_eq!(std::fs::read(&cached).expect("cached again"), b"ten points");
    std::fs::remove_file(&cached).expect("removed");
    assert_eq!(place.files().read_scan(set, &scan).expect("fetched"), b"ten points");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_does_not_fit_into_the_cache_is_read_all_the_same_and_nothing_stays_of_what_is_removed() {
    let place = BucketPlace::new();
    let (id, large, files) = (ModelId::new(), vec![7; 1000], place.files());
    let checksum = blake3::hash(&large).to_hex().to_string();
    let asset = AssetRecord { name: "large".to_owned(), bytes: 1000, checksum };
    let model = files.stage_model().expect("staged");
    files.write_asset(&model, "large", &large).expect("written");
    files.write_asset(&model, "small", b"small").expect("written");
    files.keep_model(&model, id).expect("kept");
    for _ in 0..2 {
        assert_eq!(files.read_asset(id, &asset).expect("sound").as_deref(), Some(&large[..]));
        assert!(files.0.cache.bytes() <= CACHE);
    }
    let folder = place.cached(&StoredFile::Model(id).to_string());
    assert!(folder.join("small").exists() && !folder.join("large").exists());
    files.remove(StoredFile::Model(id)).expect("removed");
    assert!(!folder.exists());
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_is_broken_off_is_finished_or_removed_and_nothing_is_written_over() {
    let place = BucketPlace::new();
    let (bucket, files, id) = (place.bucket(), place.files(), ModelId::new());
    let at = |name: &str| format!("{}/{name}", StoredFile::Model(id));
    // an answer that was lost, with a file in several parts
    let large: Vec<u8> = (0..9_000_000u32).flat_map(u32::to_le_bytes).collect();
    for _ in 0..2 {
        bucket.put_new("putting", &at("a"), large.clone().into()).expect("it is there");
        bucket.put_new("putting", &at("b"), "b".into()).expect("it is there");
    }
    assert_eq!(files.listing().expect("listed"), [StoredFile::Model(id)], "also what is there in part");
    for (name, other) in [("a", Bytes::from(vec![0; large.len()])), ("b", "other".into())] {
        let refused = bucket.put_new("putting", &at(name), other).expect_err("it is something else");
        assert!(matches!(refused, ObjectError::Taken { .. }), "{refused}");
    }
    assert_eq!(bucket.checksum("reading", &at("a")).expect("read"), Some(blake3::hash(&large).to_hex().to_string()));
    let model = files.stage_model().expect("staged");
    files.write_asset(&model, "b", b"b").expect("written");
    files.write_asset(&model, "c", b"c").expect("written");
    files.keep_model(&model, id).expect("the rest of it");
    assert_eq!(bucket.names("listing", &StoredFile::Model(id).to_string()).expect("listed"), ["a", "b", "c"]);
    files.remove(StoredFile::Model(id)).expect("removed");
    assert_eq!(files.listing().expect("listed"), []);
}

#[test]
fn a_bucket_is_used_by_one_data_folder() {
    let (place, ours, other) = (BucketPlace::new(), FolderId::new(), FolderId::new());
    let bucket = place.bucket();
    for _ in 0..2 {
        assert_eq!(claim(&bucket, ours).expect("claimed"), Some(ours));
    }
    assert_eq!(claim(&bucket, other).expect("looked"), Some(ours));
}

#[test]
fn what_can_not_be_reached_is_said_so_and_what_is_refused_with_the_remedy() {
    // a port that nobody listens on: it was free a moment ago
    let free = std::net::TcpListener::bind("127.0.0.1:0").expect("a port").local_addr().expect("an address");
    let settings = |endpoint: String, bucket: &str| BucketSettings {
        url: format!("s3://{bucket}/x").parse().expect("a bucket"),
        endpoint: Some(endpoint),
        region: None,
        cache_bytes: 0,
    };
    let asked_for = |settings: &BucketSettings, answer: Duration| {
        let builder = AmazonS3Builder::new().with_access_key_id("nobody").with_secret_access_key("wrong");
        let bucket = set_up(builder, settings, answer).expect("set up");
        bucket.small("reading", "a").expect_err("it can't be read")
    };
    let asked = |settings: &BucketSettings| asked_for(settings, client::ANSWER);
    // one that takes connections and says nothing
    let silent = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = silent.local_addr().expect("an address");
    let refused = asked_for(&settings(format!("http://{address}"), "visage"), Duration::from_millis(100));
    assert!(matches!(refused, ObjectError::Unreachable { .. }), "{refused}");
    let refused = asked(&settings(format!("http://{free}"), "visage"));
    assert!(matches!(refused, ObjectError::Unreachable { .. }) && refused.is_unreachable(), "{refused}");
    assert!(refused.to_string().contains("s3://visage/x"), "{refused}");
    if let Ok(endpoint) = std::env::var("VISAGE_S3") {
        let refused = asked(&settings(endpoint.clone(), "visage"));
        assert!(refused.to_string().contains("AWS_ACCESS_KEY_ID"), "{refused}");
        let missing = connect(&settings(endpoint, "no-such-bucket")).expect("set up");
        let refused = missing.small("reading", "a").expect_err("there is none");
        assert!(refused.to_string().contains("there is no such bucket: make it"), "{refused}");
    }
}
