//! What a database has to offer for models that come from another data folder.

use async_trait::async_trait;

use crate::storage::DatabaseError;
use visage_domain::ImportedModel;

/// Models that were stored elsewhere.
#[async_trait]
pub trait Imports {
    /// Stores models, the jobs that made them as jobs that have ended, and the scan sets of these where there are none of their ids; all
    /// or nothing. The index follows at the next start.
    async fn import_models(&self, models: &[ImportedModel]) -> Result<(), DatabaseError>;
}
