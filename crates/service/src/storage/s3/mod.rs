//! Files in a bucket of an S3 store, under the names that they have in a data folder (`local_files`):
//!
//! ```text
//! PREFIX/visage.folder                whose bucket it is: the id of the data folder
//! PREFIX/scan-sets/{set}/{file}       scans
//! PREFIX/models/{model}/{asset}       files of models
//! PREFIX/standards/{standard}/{asset} files that standards were made of
//! PREFIX/trash/{id}/...               what a start found without a row, for a while
//! ```
//! The database stays in the data folder, and so does what is on its way (`staging`, `uploads`), the index (`segments`, made of
//! signatures), and a cache of files that were fetched or have just been put (`cache`). An object is there before its row, whole
//! or not at all, and is never written to again; the files of a model come one after the other.
//!
//! - `bucket`: objects come and go; `client`: HTTP to the store
//! - `cache`: files on the local disk, as many as there is room for
//! - `files`: both as an [`ObjectStore`](crate::storage::ObjectStore); `segments`: files of the index

mod bucket;
mod cache;
mod client;
mod files;
mod segments;
#[cfg(test)]
mod tests;

use std::fs::File;
use std::io::{self, Read, Seek};
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use object_store::aws::AmazonS3Builder;
use object_store::{BackoffConfig, RetryConfig};

use crate::config::BucketSettings;
use crate::storage::ObjectError;
use crate::storage::local_files::LocalFiles;
use visage_domain::FolderId;

pub(crate) use bucket::Bucket;
use cache::Cache;

/// A request that failed for want of an answer is sent again so often, within so long.
const RETRIES: usize = 3;
const RETRIED_FOR: Duration = Duration::from_secs(15);
/// The first pause before that; each is twice as long as the one before.
const FIRST_PAUSE: Duration = Duration::from_millis(200);
const LONGEST_PAUSE: Duration = Duration::from_secs(2);
/// Who uses a bucket.
const MARKER: &str = "visage.folder";
const OPENING: &str = "opening the object store";

/// A bucket as it is set up, with the keys of the environment. Nothing is sent yet.
pub(crate) fn connect(settings: &BucketSettings) -> Result<Bucket, ObjectError> {
    set_up(AmazonS3Builder::from_env(), settings, client::ANSWER)
}

fn set_up(builder: AmazonS3Builder, settings: &BucketSettings, answer: Duration) -> Result<Bucket, ObjectError> {
    let place = settings.url.to_string();
    let refused = |error: object_store::Error| {
        let reason = format!("it can't be set up: {error}");
        ObjectError::Refused { doing: OPENING, place: place.clone(), reason }
    };
    let is_plain = settings.endpoint.as_ref().is_some_and(|endpoint| endpoint.starts_with("http://"));
    let retry = RetryConfig {
        backoff: BackoffConfig { init_backoff: FIRST_PAUSE, max_backoff: LONGEST_PAUSE, base: 2.0 },
        max_retries: RETRIES,
        retry_timeout: RETRIED_FOR,
    };
    let mut builder = builder
        .with_bucket_name(&settings.url.bucket)
        .with_allow_http(is_plain)
        .with_retry(retry)
        .with_http_connector(client::Wires { tls: !is_plain, answer });
    if let Some(endpoint) = &settings.endpoint {
        builder = builder.with_endpoint(endpoint);
    }
    if let Some(region) = &settings.region {
        builder = builder.with_region(region);
    }
    let store = Arc::new(builder.build().map_err(refused)?);
    Bucket::new(place.clone(), &settings.url.prefix, store).map_err(|source| ObjectError::Io { doing: OPENING, source })
}

/// Files in a bucket, with a data folder beside it.
#[derive(Debug)]
pub(crate) struct BucketFiles(Arc<Parts>);

/// What a call needs, off the async threads too.
#[derive(Debug)]
struct Parts {
    local: Arc<LocalFiles>,
    bucket: Bucket,
    cache: Cache,
}

impl BucketFiles {
    /// Takes a bucket into use for a data folder. Blocks.
    pub(crate) fn open(local: Arc<LocalFiles>, bucket: Bucket, cache_bytes: u64) -> Result<BucketFiles, ObjectError> {
        let cache = Cache::open(local.cache_folder(), cache_bytes)
            .map_err(|source| ObjectError::Io { doing: "opening the cache of files", source })?;
        Ok(BucketFiles(Arc::new(Parts { local, bucket, cache })))
    }
}

/// Says whose bucket it is, unless it says so already; answers with whose it is. Blocks.
pub(crate) fn claim(bucket: &Bucket, id: FolderId) -> Result<Option<FolderId>, ObjectError> {
    let found = match bucket.small(OPENING, MARKER)? {
        Some(found) => found,
        None => {
            let written = format!("{id}\n");
            match bucket.put_new(OPENING, MARKER, written.clone().into()) {
                // another one was quicker
                Err(ObjectError::Taken { .. }) => bucket.small(OPENING, MARKER)?.unwrap_or_default(),
                put => put.map(|()| written.into())?,
            }
        }
    };
    Ok(std::str::from_utf8(&found).ok().and_then(|text| FolderId::parse(text.trim())))
}

/// An object and what it has to be.
#[derive(Debug, Clone)]
struct Wanted {
    place: String,
    checksum: String,
    /// Its name for messages.
    what: String,
    doing: &'static str,
}

impl Parts {
    /// The file of an object that is what was stored; `None` if it is not there. Fetched unless the cache has it. Blocks.
    fn opened(&self, wanted: &Wanted) -> Result<Option<File>, ObjectError> {
        match self.held(wanted) {
            Some(file) => Ok(Some(file)),
            None => self.fetched(wanted),
        }
    }

    /// The same as what is in it.
    fn content(&self, wanted: &Wanted) -> Result<Option<Vec<u8>>, ObjectError> {
        let Some(mut file) = self.opened(wanted)? else { return Ok(None) };
        let mut content = Vec::new();
        let read = file.read_to_end(&mut content);
        read.map_err(|source| ObjectError::Io { doing: wanted.doing, source })?;
        Ok(Some(content))
    }

    fn held(&self, wanted: &Wanted) -> Option<File> {
        let mut cached = self.cache.file(&wanted.place)?;
        if cached.is_sound {
            return Some(cached.file);
        }
        let mut hasher = blake3::Hasher::new();
        let read = hasher.update_reader(&mut cached.file).is_ok() && cached.file.rewind().is_ok();
        if read && hasher.finalize().to_hex().as_str() == wanted.checksum {
            self.cache.trust(&wanted.place, &cached.file);
            return Some(cached.file);
        }
        tracing::warn!(file = wanted.place, "a file of the cache is damaged: it is fetched anew");
        let _ = self.cache.forget(&wanted.place);
        None
    }

    fn fetched(&self, wanted: &Wanted) -> Result<Option<File>, ObjectError> {
        let disk = |source: io::Error| ObjectError::Io { doing: wanted.doing, source };
        let staged = self.local.stage_apart();
        let path = self.local.staged_path(staged.id());
        let into = crate::storage::local_files::create_private_file(&path).map_err(disk)?;
        let Some(found) = self.bucket.fetch(wanted.doing, &wanted.place, into)? else { return Ok(None) };
        if found != wanted.checksum {
            return Err(ObjectError::Damaged { what: wanted.what.clone() });
        }
        let file = File::open(&path).map_err(disk)?;
        self.take(&path, &wanted.place);
        Ok(Some(file))
    }

    /// Whether an object is there; an error if it is not what was stored. It is read where it is kept. Blocks.
    fn checked(&self, wanted: &Wanted) -> Result<bool, ObjectError> {
        match self.bucket.checksum(wanted.doing, &wanted.place)? {
            None => Ok(false),
            Some(found) if found == wanted.checksum => Ok(true),
            Some(_) => Err(ObjectError::Damaged { what: wanted.what.clone() }),
        }
    }

    /// Puts a file that has arrived where it belongs, and keeps it at hand: it is read soon.
    fn put(&self, doing: &'static str, file: &Path, place: &str) -> Result<(), ObjectError> {
        let disk = |source: io::Error| ObjectError::Io { doing, source };
        // nobody writes to it any more, and it is in a folder that only this user may enter
        let content = visage_mapping::map(&File::open(file).map_err(disk)?).map_err(disk)?;
        self.bucket.put_new(doing, place, content)
    }

    /// Into the cache. What can't be there is fetched when it is wanted.
    fn take(&self, file: &Path, place: &str) {
        if let Err(error) = self.cache.take(file, place) {
            tracing::warn!(file = place, "the cache of files: {error}");
        }
    }
}
