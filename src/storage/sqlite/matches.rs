//! What queries need of stored models besides the index: facets to filter by, and what an answer shows.

use sqlx::FromRow;

use super::{SqliteDatabase, damaged, stored_id};
use crate::domain::asset::Origin;
use crate::domain::{MatchedModel, ModelFacets, ModelId, StoredContent};
use crate::geometry::Unit;
use crate::storage::DatabaseError;
use crate::storage::database::Matches;
use async_trait::async_trait;

#[derive(FromRow)]
struct Row {
    id: String,
    name: String,
    label: Option<String>,
    unit: String,
    uploaded: bool,
    content: Option<Vec<u8>>,
    checksum: Option<String>,
}

impl Row {
    fn model(self) -> Result<MatchedModel, DatabaseError> {
        let unit: Unit = self.unit.parse().map_err(|reason: String| damaged("a unit", reason))?;
        let origin = if self.uploaded { Origin::Uploaded } else { Origin::Registered };
        let id = stored_id!(ModelId, &self.id)?;
        let signature = match self.content.map(|content| StoredContent::checked(content, self.checksum.as_deref())) {
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
impl Matches for SqliteDatabase {
    async fn matched_models(&self, ids: &[ModelId]) -> Result<Vec<MatchedModel>, DatabaseError> {
        let list: Vec<String> = ids.iter().map(ModelId::to_string).collect();
        let list = serde_json::to_string(&list).map_err(|error| damaged("ids", error))?;
        let rows: Vec<Row> = sqlx::query_as(
            "SELECT model.id, name, label, unit, job_id IS NULL AS uploaded, content, checksum FROM model
             LEFT JOIN signature ON signature.model_id = model.id
             WHERE model.id IN (SELECT value FROM json_each(?)) ORDER BY model.id",
        )
        .bind(list)
        .fetch_all(&self.readers)
        .await?;
        rows.into_iter().map(Row::model).collect()
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

#[cfg(test)]
mod tests {
    use super::super::testing;
    use super::*;
    use crate::domain::asset::Origin;
    use crate::domain::{NewModel, StoredSignature};
    use crate::faces::SignatureSummary;
    use crate::storage::database::*;

    #[tokio::test]
    async fn models_are_given_as_far_as_they_are_there() {
        let (store, _folder) = testing::store().await;
        let summary = SignatureSummary { version: 1, regions: 2, triangles: 3, left_out: Default::default() };
        let signature = StoredSignature { version: 1, summary, content: vec![1, 2, 3] };
        let described = NewModel { signature: Some(signature), ..NewModel::test(None) };
        let bare = NewModel::test(None);
        for model in [&described, &bare] {
            drop(store.create_model(model, None).await.expect("stored"));
        }
        let facets = ModelFacets { label: Some("face".to_owned()), unit: Unit::Mm, origin: Origin::Uploaded };
        let found = store.matched_models(&[bare.id, ModelId::new(), described.id]).await.expect("read");
        let expected = |model: &NewModel, signature: Option<Vec<u8>>| MatchedModel {
            id: model.id,
            name: "uploaded".to_owned(),
            facets: facets.clone(),
            signature,
        };
        assert_eq!(found, [expected(&described, Some(vec![1, 2, 3])), expected(&bare, None)]);
        assert_eq!(store.facets().await.expect("read"), [(described.id, facets)]);
    }
}
