//! Standards made by users: the classes, and the examples marked for them.

use super::rows::row;
use super::{Connection, Store, damaged, evaluations, files, replays, stored_id, stored_name, to_i64, to_u64};
use crate::storage::DatabaseError;
use crate::storage::database::{Standards, Upkeep};
use async_trait::async_trait;
use visage_domain::{AssetRecord, Examples, JobId, NewStandard, Replay, StandardId, StandardRecord, StoredFile};
use visage_shape::standards::Standard;

row! {
    struct StandardRow {
        id: String,
        name: String,
        asset: String,
        bytes: i64,
        checksum: String,
        unit: String,
        annotation: String,
        class: String,
    }
}

impl StandardRow {
    fn record(self) -> Result<StandardRecord, DatabaseError> {
        Ok(StandardRecord {
            id: stored_id!(StandardId, &self.id)?,
            name: self.name,
            asset: AssetRecord { name: self.asset, bytes: to_u64(self.bytes), checksum: self.checksum },
            unit: stored_name("a unit", &self.unit)?,
            annotation: serde_json::from_str(&self.annotation).map_err(|error| damaged("an annotation", error))?,
            definition: serde_json::from_str(&self.class).map_err(|error| damaged("a standard", error))?,
        })
    }
}

#[async_trait]
impl Standards for Store {
    async fn create_standard(
        &self,
        standard: &NewStandard,
        limit: usize,
        replay: &(dyn Fn(Option<JobId>) -> Option<Replay> + Send + Sync),
    ) -> Result<Option<JobId>, DatabaseError> {
        let mut tx = self.begin().await?;
        let (count, taken): (i64, bool) =
            sqlx::query_as("SELECT (SELECT count(*) FROM standard), EXISTS (SELECT 1 FROM standard WHERE name = $1)")
                .bind(&standard.name)
                .fetch_one(&mut *tx)
                .await?;
        if taken {
            return Err(DatabaseError::NameTaken { kind: "standard", name: standard.name.clone() });
        }
        if to_u64(count) >= limit as u64 {
            return Err(DatabaseError::TooManyStandards { limit });
        }
        insert(&mut tx, standard).await?;
        mark(&mut tx, standard.id, &standard.examples).await?;
        files::settle(&mut tx, StoredFile::Standard(standard.id)).await?;
        let job = evaluations::queue_if_due(&mut tx).await?;
        if let Some(replay) = replay(job) {
            replays::insert(&mut tx, &replay).await?;
        }
        tx.commit().await?;
        Ok(job)
    }

    async fn standards(&self) -> Result<Vec<StandardRecord>, DatabaseError> {
        let rows: Vec<StandardRow> =
            sqlx::query_as("SELECT * FROM standard ORDER BY id").fetch_all(&self.readers).await?;
        rows.into_iter().map(StandardRow::record).collect()
    }

    async fn standard(&self, name_or_id: &str) -> Result<StandardRecord, DatabaseError> {
        let row: Option<StandardRow> = sqlx::query_as("SELECT * FROM standard WHERE name = $1 OR id = $1")
            .bind(name_or_id)
            .fetch_optional(&self.readers)
            .await?;
        row.ok_or_else(|| not_found(name_or_id))?.record()
    }

    async fn renew_standard(&self, id: StandardId, standard: &Standard) -> Result<(), DatabaseError> {
        let content = serde_json::to_string(standard).map_err(|error| damaged("a standard", error))?;
        sqlx::query("UPDATE standard SET version = $1, class = $2 WHERE id = $3")
            .bind(i64::from(standard.version))
            .bind(content)
            .bind(id.to_string())
            .execute(&self.writer)
            .await?;
        Ok(())
    }

    async fn examples(&self, id: StandardId) -> Result<Examples, DatabaseError> {
        let rows: Vec<(String, bool)> =
            sqlx::query_as("SELECT model_id, is_positive FROM example WHERE standard_id = $1 ORDER BY model_id")
                .bind(id.to_string())
                .fetch_all(&self.readers)
                .await?;
        let mut examples = Examples::default();
        for (model, is_positive) in rows {
            let list = if is_positive { &mut examples.positive } else { &mut examples.negative };
            list.push(stored_id!(ModelId, &model)?);
        }
        Ok(examples)
    }

    async fn mark_examples(&self, id: StandardId, examples: &Examples) -> Result<(), DatabaseError> {
        let mut tx = self.begin().await?;
        sqlx::query("DELETE FROM example WHERE standard_id = $1").bind(id.to_string()).execute(&mut *tx).await?;
        let is_there: bool = sqlx::query_scalar("SELECT EXISTS (SELECT 1 FROM standard WHERE id = $1)")
            .bind(id.to_string())
            .fetch_one(&mut *tx)
            .await?;
        if !is_there {
            return Err(not_found(&id.to_string()));
        }
        mark(&mut tx, id, examples).await?;
        tx.commit().await?;
        Ok(())
    }

    async fn delete_standard(&self, id: StandardId) -> Result<(), DatabaseError> {
        self.with_reserve(|| self.delete_standard_once(id)).await?;
        self.fold_log().await;
        Ok(())
    }
}

impl Store {
    async fn delete_standard_once(&self, id: StandardId) -> Result<(), DatabaseError> {
        let mut tx = self.begin_any().await?;
        replays::delete_of(&mut tx, &id.to_string()).await?;
        let done = sqlx::query("DELETE FROM standard WHERE id = $1").bind(id.to_string()).execute(&mut *tx).await?;
        if done.rows_affected() == 0 {
            return Err(not_found(&id.to_string()));
        }
        files::leave(&mut tx, StoredFile::Standard(id)).await?;
        tx.commit().await
    }
}

fn not_found(name_or_id: &str) -> DatabaseError {
    DatabaseError::NotFound { kind: "standard", id: name_or_id.chars().take(64).collect() }
}

async fn insert(db: &mut Connection, standard: &NewStandard) -> Result<(), DatabaseError> {
    let annotation = serde_json::to_string(&standard.annotation).map_err(|error| damaged("an annotation", error))?;
    let content = serde_json::to_string(&standard.definition).map_err(|error| damaged("a standard", error))?;
    sqlx::query(
        "INSERT INTO standard (id, name, asset, bytes, checksum, unit, annotation, version, class)
         VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9)",
    )
    .bind(standard.id.to_string())
    .bind(&standard.name)
    .bind(&standard.asset.name)
    .bind(to_i64(standard.asset.bytes))
    .bind(&standard.asset.checksum)
    .bind(standard.unit.name())
    .bind(annotation)
    .bind(i64::from(standard.definition.version))
    .bind(content)
    .execute(db)
    .await?;
    Ok(())
}

/// Marks examples; a model that is not there is an error.
async fn mark(db: &mut Connection, id: StandardId, examples: &Examples) -> Result<(), DatabaseError> {
    let positive = examples.positive.iter().map(|model| (model, true));
    for (model, is_positive) in positive.chain(examples.negative.iter().map(|model| (model, false))) {
        let done = sqlx::query(
            "INSERT INTO example (standard_id, model_id, is_positive) SELECT $1, id, $2 FROM model WHERE id = $3",
        )
        .bind(id.to_string())
        .bind(is_positive)
        .bind(model.to_string())
        .execute(&mut *db)
        .await?;
        if done.rows_affected() == 0 {
            return Err(DatabaseError::NotFound { kind: "model", id: model.to_string() });
        }
    }
    Ok(())
}
