//! What queries need of stored models besides the index: facets to filter by, and what an answer shows.

use super::rows::row;
use super::signatures::checked;
use super::{Store, damaged, has_words, stored_id, stored_name, words};
use crate::storage::DatabaseError;
use crate::storage::database::Matches;
use async_trait::async_trait;
use visage_domain::asset::Origin;
use visage_domain::{MatchedModel, ModelFacets, ModelId, StoredContent};
use visage_geometry::Unit;

row! {
    struct Row {
        id: String,
        name: String,
        label: Option<String>,
        unit: String,
        uploaded: bool,
        content: Option<Vec<u8>>,
        checksum: Option<String>,
    }
}

impl Row {
    fn model(self) -> Result<MatchedModel, DatabaseError> {
        let unit: Unit = stored_name("a unit", &self.unit)?;
        let origin = if self.uploaded { Origin::Uploaded } else { Origin::Registered };
        let id = stored_id!(ModelId, &self.id)?;
        let signature = match self.content.map(|content| checked(content, self.checksum.as_deref())) {
            Some(StoredContent::Damaged) => {
                tracing::error!(model.id = %id, "the stored signature is damaged; the next start has it made anew");
                None
            }
            Some(StoredContent::Whole(content)) => Some(content),
            None => None,
        };
        Ok(MatchedModel { id, name: self.name, facets: ModelFacets { label: self.label, unit, origin }, signature })
    }
}

#[async_trait]
impl Matches for Store {
    async fn matched_models(&self, ids: &[ModelId]) -> Result<Vec<MatchedModel>, DatabaseError> {
        let list: Vec<String> = ids.iter().map(ModelId::to_string).collect();
        let list = serde_json::to_string(&list).map_err(|error| damaged("ids", error))?;
        let rows: Vec<Row> = sqlx::query_as(
            "SELECT model.id, name, label, unit, job_id IS NULL AS uploaded, content, checksum FROM model
             LEFT JOIN signature ON signature.model_id = model.id
             WHERE model.id IN (SELECT value FROM json_each($1)) ORDER BY model.id",
        )
        .bind(list)
        .fetch_all(&self.readers)
        .await?;
        rows.into_iter().map(Row::model).collect()
    }

    async fn models_with_words(&self, words: &[String]) -> Result<Vec<ModelId>, DatabaseError> {
        let ids: Vec<String> = sqlx::query_scalar(concat!("SELECT id FROM model WHERE ", has_words!("$1")))
            .bind(words::patterns(words))
            .fetch_all(&self.readers)
            .await?;
        ids.iter().map(|id| stored_id!(ModelId, id)).collect()
    }

    async fn facets(&self) -> Result<Vec<(ModelId, ModelFacets)>, DatabaseError> {
        let rows: Vec<Row> = sqlx::query_as(
            "SELECT model.id, '' AS name, label, unit, job_id IS NULL AS uploaded, NULL AS content,
                    NULL AS checksum FROM model
             JOIN signature ON signature.model_id = model.id",
        )
        .fetch_all(&self.readers)
        .await?;
        rows.into_iter().map(|row| row.model().map(|model| (model.id, model.facets))).collect()
    }
}
