//! A bucket, or what is below a prefix of one: whole objects come and go, under names that are used once.

use std::collections::BTreeSet;
use std::fs::File;
use std::future::Future;
use std::io::{self, Seek, Write};
use std::sync::Arc;
use std::sync::mpsc;

use bytes::Bytes;
use futures_util::{StreamExt, TryStreamExt, stream};
use object_store::path::Path;
use object_store::{Error, ObjectStore, ObjectStoreExt, PutMode, PutPayload};
use tokio::runtime::Runtime;

use crate::storage::ObjectError;
use crate::storage::local_files::copies::{Source, Wanted};

/// What is larger is sent in parts of this size.
const PART: usize = 16 << 20;
/// So many threads send and receive; they wait most of the time.
const THREADS: usize = 2;

/// A bucket. Its calls block, from wherever they come: the network is waited for on threads of its own.
#[derive(Debug)]
pub(crate) struct Bucket {
    name: String,
    prefix: Path,
    store: Arc<dyn ObjectStore>,
    runtime: Option<Runtime>,
}

impl Drop for Bucket {
    fn drop(&mut self) {
        // also where nothing may block
        if let Some(runtime) = self.runtime.take() {
            runtime.shutdown_background();
        }
    }
}

/// What a fetch has run into.
enum Fetch {
    Store(Error),
    Disk(io::Error),
}

impl From<Error> for Fetch {
    fn from(error: Error) -> Self {
        Fetch::Store(error)
    }
}

impl Bucket {
    /// What is below a prefix of a store; `name` is what people call it.
    pub(super) fn new(name: String, prefix: &str, store: Arc<dyn ObjectStore>) -> io::Result<Bucket> {
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(THREADS)
            .thread_name("objects")
            .enable_all()
            .build()?;
        Ok(Bucket { name, prefix: Path::from(prefix), store, runtime: Some(runtime) })
    }

    /// What people call it.
    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    fn at(&self, place: &str) -> Path {
        self.prefix.parts().chain(Path::from(place).parts()).collect()
    }

    /// Stores an object of which there is none yet. If it is there already, with this content, an answer was lost: that is no
    /// trouble. Another content stays what it is.
    pub(super) fn put_new(&self, doing: &'static str, place: &str, content: Bytes) -> Result<(), ObjectError> {
        let (store, path, bytes) = (self.store.clone(), self.at(place), content.clone());
        let put = async move {
            if bytes.len() <= PART {
                return store.put_opts(&path, bytes.into(), PutMode::Create.into()).await.map(drop);
            }
            // S3 takes the condition for a whole object only: names are never used twice, so looking before is enough
            match store.head(&path).await {
                Err(Error::NotFound { .. }) => send_parts(store.as_ref(), &path, &bytes).await,
                Ok(_) => Err(Error::AlreadyExists { path: path.to_string(), source: "it was there before".into() }),
                Err(error) => Err(error),
            }
        };
        match self.wait(doing, put) {
            Ok(Err(Error::AlreadyExists { .. } | Error::Precondition { .. })) => {
                match self.checksum(doing, place)? == Some(blake3::hash(&content).to_hex().to_string()) {
                    true => Ok(()),
                    false => Err(ObjectError::Taken { what: format!("{}/{place}", self.name) }),
                }
            }
            Ok(put) => put.map_err(|error| self.said(doing, error)),
            Err(ended) => Err(ended),
        }
    }

    /// Copies an object into a file; answers with the BLAKE3 of its content, or `None` if it is not there.
    pub(crate) fn fetch(
        &self,
        doing: &'static str,
        place: &str,
        into: impl Write + Send + 'static,
    ) -> Result<Option<String>, ObjectError> {
        let (store, path) = (self.store.clone(), self.at(place));
        match self.wait(doing, async move { received(store.as_ref(), &path, into).await })? {
            Ok(hash) => Ok(Some(hash.to_hex().to_string())),
            Err(Fetch::Disk(source)) => Err(ObjectError::Io { doing, source }),
            Err(Fetch::Store(Error::NotFound { source, .. })) if !is_of_bucket(&source.to_string()) => Ok(None),
            Err(Fetch::Store(error)) => Err(self.said(doing, error)),
        }
    }

    /// The BLAKE3 of an object, which is read for it; `None` if it is not there.
    pub(super) fn checksum(&self, doing: &'static str, place: &str) -> Result<Option<String>, ObjectError> {
        self.fetch(doing, place, io::sink())
    }

    /// The content of a small object; `None` if it is not there.
    pub(super) fn small(&self, doing: &'static str, place: &str) -> Result<Option<Bytes>, ObjectError> {
        let (store, path) = (self.store.clone(), self.at(place));
        match self.wait(doing, async move { store.get(&path).await?.bytes().await })? {
            Err(Error::NotFound { source, .. }) if !is_of_bucket(&source.to_string()) => Ok(None),
            got => got.map(Some).map_err(|error| self.said(doing, error)),
        }
    }

    /// Removes an object; no trouble if it is gone.
    pub(super) fn remove(&self, doing: &'static str, place: &str) -> Result<(), ObjectError> {
        self.remove_all(doing, vec![self.at(place)])
    }

    /// Removes all objects below a place.
    pub(super) fn remove_below(&self, doing: &'static str, place: &str) -> Result<(), ObjectError> {
        let there = self.below(doing, place)?;
        self.remove_all(doing, there)
    }

    fn remove_all(&self, doing: &'static str, paths: Vec<Path>) -> Result<(), ObjectError> {
        if paths.is_empty() {
            return Ok(());
        }
        let store = self.store.clone();
        let removed = async move {
            let mut removed = store.delete_stream(stream::iter(paths.into_iter().map(Ok)).boxed());
            while let Some(one) = removed.next().await {
                match one {
                    Err(Error::NotFound { source, .. }) if !is_of_bucket(&source.to_string()) => {}
                    one => drop(one?),
                }
            }
            Ok(())
        };
        self.wait(doing, removed)?.map_err(|error| self.said(doing, error))
    }

    fn below(&self, doing: &'static str, place: &str) -> Result<Vec<Path>, ObjectError> {
        let (store, path) = (self.store.clone(), self.at(place));
        let listed = async move { store.list(Some(&path)).map_ok(|found| found.location).try_collect().await };
        self.wait(doing, listed)?.map_err(|error| self.said(doing, error))
    }

    /// The names of all objects below a place, as they go on from there.
    pub(super) fn names(&self, doing: &'static str, place: &str) -> Result<Vec<String>, ObjectError> {
        let root = self.at(place);
        let name = |path: &Path| {
            let parts = path.prefix_match(&root)?;
            Some(parts.map(|part| part.as_ref().to_owned()).collect::<Vec<_>>().join("/"))
        };
        Ok(self.below(doing, place)?.iter().filter_map(name).collect())
    }

    /// What objects are grouped by below a place: the first parts of their names that have several. Stores can say these alone,
    /// but some keep folders, and tell those in which nothing is left any more.
    pub(super) fn groups(&self, doing: &'static str, place: &str) -> Result<BTreeSet<String>, ObjectError> {
        let names = self.names(doing, place)?;
        Ok(names.iter().filter_map(|name| Some(name.split_once('/')?.0.to_owned())).collect())
    }

    /// Moves an object within the bucket, without fetching it.
    pub(super) fn rename(&self, doing: &'static str, from: &str, to: &str) -> Result<(), ObjectError> {
        let (store, from, to) = (self.store.clone(), self.at(from), self.at(to));
        match self.wait(doing, async move { store.rename(&from, &to).await })? {
            Err(Error::NotFound { source, .. }) if !is_of_bucket(&source.to_string()) => Ok(()),
            moved => moved.map_err(|error| self.said(doing, error)),
        }
    }

    /// Has it done on the bucket's own threads, and waits.
    fn wait<T: Send + 'static>(
        &self,
        doing: &'static str,
        work: impl Future<Output = T> + Send + 'static,
    ) -> Result<T, ObjectError> {
        let ended =
            || ObjectError::Io { doing, source: io::Error::other("the threads of the object store have ended") };
        let runtime = self.runtime.as_ref().ok_or_else(ended)?;
        let (send, receive) = mpsc::sync_channel(1);
        runtime.spawn(async move {
            // whoever waits does so until there is an answer
            let _ = send.send(work.await);
        });
        receive.recv().map_err(|_| ended())
    }

    /// What the store says, as what it means for us.
    fn said(&self, doing: &'static str, error: Error) -> ObjectError {
        let (place, reason) = (self.name.clone(), error.to_string());
        match error {
            Error::NotFound { .. } if is_of_bucket(&reason) => {
                let reason = "there is no such bucket: make it, or correct --objects".to_owned();
                ObjectError::Refused { doing, place, reason }
            }
            Error::NotFound { source, .. } => {
                ObjectError::Io { doing, source: io::Error::new(io::ErrorKind::NotFound, source) }
            }
            Error::PermissionDenied { .. } | Error::Unauthenticated { .. } => {
                let reason = format!(
                    "it does not accept the keys: AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY have to be those of somebody who \
                     may list, read, write and delete there ({reason})"
                );
                ObjectError::Refused { doing, place, reason }
            }
            // where roles are found on machines of Amazon's
            _ if reason.contains("169.254.169.254") => {
                let reason = format!("there are no keys: set AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY ({reason})");
                ObjectError::Refused { doing, place, reason }
            }
            Error::AlreadyExists { path, .. } | Error::Precondition { path, .. } => ObjectError::Taken { what: path },
            _ => ObjectError::Unreachable { doing, place, reason },
        }
    }
}

/// A backup has the files of a bucket in it.
impl Source for Bucket {
    fn open(&self, file: &Wanted, scratch: &std::path::Path) -> io::Result<Option<File>> {
        let place = match &file.asset {
            Some(asset) => format!("{}/{asset}", file.of),
            None => file.of.to_string(),
        };
        // has no name, so nothing is left of it
        let mut fetched = tempfile::tempfile_in(scratch)?;
        let found = self.fetch("copying a file", &place, fetched.try_clone()?).map_err(io::Error::other)?;
        fetched.rewind()?;
        Ok(found.map(|_| fetched))
    }
}

/// Whether it is the bucket that is not there.
fn is_of_bucket(said: &str) -> bool {
    said.contains("NoSuchBucket")
}

async fn send_parts(store: &dyn ObjectStore, path: &Path, content: &Bytes) -> object_store::Result<()> {
    let mut upload = store.put_multipart(path).await?;
    let sent = async {
        for begin in (0..content.len()).step_by(PART) {
            let part = content.slice(begin..content.len().min(begin + PART));
            upload.put_part(PutPayload::from(part)).await?;
        }
        upload.complete().await
    };
    let sent = sent.await;
    if sent.is_err() {
        // what can't be said now is for the bucket's own rule on uploads that were given up
        let _ = upload.abort().await;
    }
    sent.map(drop)
}

async fn received(store: &dyn ObjectStore, path: &Path, mut into: impl Write) -> Result<blake3::Hash, Fetch> {
    let mut chunks = store.get(path).await?.into_stream();
    let mut hasher = blake3::Hasher::new();
    while let Some(chunk) = chunks.try_next().await? {
        hasher.update(&chunk);
        into.write_all(&chunk).map_err(Fetch::Disk)?;
    }
    into.flush().map_err(Fetch::Disk)?;
    Ok(hasher.finalize())
}
