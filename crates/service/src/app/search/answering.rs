//! What a server that searches answers to one that asks.

use super::message::{Asked, Found, NoMessage};
use crate::app::context::ServiceContext;
use crate::app::live_gallery::NotReady;
use crate::app::queries::{self, QueryError};

/// Why there is no answer to another server.
#[derive(Debug, thiserror::Error)]
pub enum AnsweringError {
    /// It sent something else.
    #[error(transparent)]
    NoMessage(#[from] NoMessage),
    /// The one that it means was here, or will be.
    #[error("another server is meant")]
    Other,
    /// The gallery can't be asked.
    #[error(transparent)]
    Query(#[from] QueryError),
}

/// Answers a message of another server: about those of the parts that this one has whole, with all that was committed up to the version of the
/// gallery that the other has read.
pub async fn answer(context: &ServiceContext, message: &[u8]) -> Result<Vec<u8>, AnsweringError> {
    let Asked { node, version, parts, question } = Asked::decode(message)?;
    if node != context.database.owner().seat {
        return Err(AnsweringError::Other);
    }
    let has_followed = context.gallery.follow_to(context.database.as_ref(), version).await.map_err(QueryError::from)?;
    if !has_followed {
        return Err(QueryError::from(NotReady).into());
    }
    let found: Found = queries::found_here(context, &question, parts).await?;
    Ok(found.encode())
}
