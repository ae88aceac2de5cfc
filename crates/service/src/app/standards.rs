//! Standards made by users come, learn from examples, and go; models are ranked by the verdicts that are stored.

use std::collections::HashMap;

use super::context::ServiceContext;
use crate::storage::inventory::StorageError;
use crate::storage::{DatabaseError, ObjectStore, StagedFile};
use visage_domain::{
    Examples, JobId, ModelId, NewStandard, Replay, StandardId, StandardRecord, StoredFile, StoredVerdict,
};
use visage_shape::standards::limit::{self, Learned};

/// The most standards that are kept: every model is judged against each.
pub const MOST_STANDARDS: usize = 32;

/// What is known of a standard beside what it is.
#[derive(Debug, Clone)]
pub struct Standing {
    /// The models that are marked.
    pub examples: Examples,
    /// What was learned of them.
    pub learned: Learned,
    /// Models judged, and not yet.
    pub judged: (u64, u64),
}

/// The verdicts against a standard.
#[derive(Debug, Clone)]
pub struct Ranking {
    /// The standard.
    pub standard: StandardRecord,
    /// What its examples tell.
    pub learned: Learned,
    /// Best first, ties by id.
    pub verdicts: Vec<StoredVerdict>,
    /// Models that are judged against it.
    pub judged: u64,
    /// Models that are not yet: the answer is not complete until there are none.
    pub pending: u64,
}

/// Stores a standard with its file, and with the answer that the client gets once the evaluation that it demands is
/// known; answers with that. Must run to its end.
pub async fn add(
    context: &ServiceContext,
    standard: &NewStandard,
    file: StagedFile,
    replay: &(dyn Fn(Option<JobId>) -> Option<Replay> + Send + Sync),
) -> Result<Option<JobId>, StorageError> {
    let (storage, id, asset) = (context.storage(), standard.id, standard.asset.name.clone());
    storage.database.expect_files(&[StoredFile::Standard(id)]).await?;
    storage.blocking(move |objects: &dyn ObjectStore| objects.keep_standard(&file, id, &asset)).await?;
    let created = storage.database.create_standard(standard, MOST_STANDARDS, replay).await;
    let job = storage.or_remove(StoredFile::Standard(id), created).await?;
    context.monitor.announce_work();
    Ok(job)
}

/// Deletes a standard with its file and all verdicts against it.
pub async fn delete(context: &ServiceContext, id: StandardId) -> Result<(), StorageError> {
    context.database.delete_standard(id).await?;
    context.storage().remove(StoredFile::Standard(id)).await
}

/// How many are marked, what they tell, how many models are judged.
pub async fn standing(context: &ServiceContext, id: StandardId) -> Result<Standing, DatabaseError> {
    Ok(Standing {
        examples: context.database.examples(id).await?,
        learned: learned(context, id).await?,
        judged: context.database.judged(id).await?,
    })
}

/// What the examples of a standard tell, as far as they are judged.
pub async fn learned(context: &ServiceContext, id: StandardId) -> Result<Learned, DatabaseError> {
    let (positive, negative) = context.database.example_residuals(id).await?;
    Ok(limit::learn(&positive, &negative))
}

/// The standard of this name or id; `None` if there is none.
pub async fn named(context: &ServiceContext, name: &str) -> Result<Option<StandardRecord>, DatabaseError> {
    match context.database.standard(name).await {
        Ok(standard) => Ok(Some(standard)),
        Err(DatabaseError::NotFound { .. }) => Ok(None),
        Err(error) => Err(error),
    }
}

/// The `limit` best verdicts against the standard of this name; `None` if there is none.
pub async fn ranking(context: &ServiceContext, name: &str, limit: usize) -> Result<Option<Ranking>, DatabaseError> {
    let Some(standard) = named(context, name).await? else { return Ok(None) };
    let learned = learned(context, standard.id).await?;
    let (judged, pending) = context.database.judged(standard.id).await?;
    let verdicts = context.database.ranking(standard.id, limit).await?;
    Ok(Some(Ranking { standard, learned, verdicts, judged, pending }))
}

/// How a model was judged against each standard that it is judged against already.
pub async fn verdicts_on(
    context: &ServiceContext,
    model: ModelId,
) -> Result<Vec<(StandardRecord, Learned, StoredVerdict)>, DatabaseError> {
    let verdicts = context.database.verdicts_on(model).await?;
    if verdicts.is_empty() {
        return Ok(Vec::new());
    }
    let standards = context.database.standards().await?;
    let standards: HashMap<StandardId, StandardRecord> = standards.into_iter().map(|each| (each.id, each)).collect();
    let mut judged = Vec::new();
    for verdict in verdicts {
        if let Some(standard) = standards.get(&verdict.standard_id) {
            judged.push((standard.clone(), learned(context, standard.id).await?, verdict));
        }
    }
    Ok(judged)
}
