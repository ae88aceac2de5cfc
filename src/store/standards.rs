//! Standards made by users: the classes, and the examples marked for them.

use sqlx::{FromRow, SqliteConnection};

use super::{
    AssetRecord, JobId, ModelId, Replay, StandardId, Store, StoreError, StoredFile, damaged, evaluations, replays,
    stored_id, sweep, to_i64, to_u64,
};
use crate::classes::{Annotation, Class};
use crate::geometry::Unit;

/// A standard that is to be stored.
#[derive(Debug, Clone)]
pub struct NewStandard {
    /// Its id.
    pub id: StandardId,
    /// Its name: unique.
    pub name: String,
    /// The file it was made of.
    pub asset: AssetRecord,
    /// The unit of that file.
    pub unit: Unit,
    /// The landmarks as they were given.
    pub annotation: Annotation,
    /// What was made of them.
    pub class: Class,
    /// Models of the class, and others.
    pub examples: Examples,
}

/// A stored standard.
#[derive(Debug, Clone)]
pub struct StandardRecord {
    /// Its id.
    pub id: StandardId,
    /// Its name.
    pub name: String,
    /// The file it was made of.
    pub asset: AssetRecord,
    /// The unit of that file.
    pub unit: Unit,
    /// The landmarks as they were given.
    pub annotation: Annotation,
    /// What was made of them.
    pub class: Class,
}

/// Models that were marked for a standard.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Examples {
    /// Those of its class.
    pub positive: Vec<ModelId>,
    /// Others.
    pub negative: Vec<ModelId>,
}

#[derive(FromRow)]
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

impl StandardRow {
    fn record(self) -> Result<StandardRecord, StoreError> {
        Ok(StandardRecord {
            id: stored_id!(StandardId, &self.id)?,
            name: self.name,
            asset: AssetRecord { name: self.asset, bytes: to_u64(self.bytes), checksum: self.checksum },
            unit: self.unit.parse().map_err(|reason: String| damaged("a unit", reason))?,
            annotation: serde_json::from_str(&self.annotation).map_err(|error| damaged("an annotation", error))?,
            class: serde_json::from_str(&self.class).map_err(|error| damaged("a class", error))?,
        })
    }
}

impl Store {
    /// Stores a standard with its examples, and queues the evaluation of the stored models against it; answers with the
    /// job if there is anything to be done. `replay` makes the answer that is kept from that job.
    pub async fn create_standard(
        &self,
        standard: &NewStandard,
        limit: usize,
        replay: impl FnOnce(Option<JobId>) -> Option<Replay>,
    ) -> Result<Option<JobId>, StoreError> {
        let mut tx = self.begin().await?;
        let (count, taken): (i64, bool) = sqlx::query_as("SELECT count(*), coalesce(max(name = ?), 0) FROM standard")
            .bind(&standard.name)
            .fetch_one(&mut *tx)
            .await?;
        if taken {
            return Err(StoreError::NameTaken { kind: "standard", name: standard.name.clone() });
        }
        if to_u64(count) >= limit as u64 {
            return Err(StoreError::TooManyStandards { limit });
        }
        insert(&mut tx, standard).await?;
        mark(&mut tx, standard.id, &standard.examples).await?;
        sweep::settle(&mut tx, StoredFile::Standard(standard.id)).await?;
        let job = evaluations::queue_if_due(&mut tx).await?;
        if let Some(replay) = replay(job) {
            replays::insert(&mut tx, &replay).await?;
        }
        tx.commit().await?;
        Ok(job)
    }

    /// All standards, in the order in which they were made.
    pub async fn standards(&self) -> Result<Vec<StandardRecord>, StoreError> {
        let rows: Vec<StandardRow> =
            sqlx::query_as("SELECT * FROM standard ORDER BY id").fetch_all(&self.readers).await?;
        rows.into_iter().map(StandardRow::record).collect()
    }

    /// The standard with this name or id.
    pub async fn standard(&self, name_or_id: &str) -> Result<StandardRecord, StoreError> {
        let row: Option<StandardRow> = sqlx::query_as("SELECT * FROM standard WHERE name = ?1 OR id = ?1")
            .bind(name_or_id)
            .fetch_optional(&self.readers)
            .await?;
        row.ok_or_else(|| not_found(name_or_id))?.record()
    }

    /// Puts a class that was made anew in the place of one of another version.
    pub async fn renew_standard(&self, id: StandardId, class: &Class) -> Result<(), StoreError> {
        let content = serde_json::to_string(class).map_err(|error| damaged("a class", error))?;
        sqlx::query("UPDATE standard SET version = ?, class = ? WHERE id = ?")
            .bind(class.version)
            .bind(content)
            .bind(id.to_string())
            .execute(&self.writer)
            .await?;
        Ok(())
    }

    /// The examples of a standard.
    pub async fn examples(&self, id: StandardId) -> Result<Examples, StoreError> {
        let rows: Vec<(String, bool)> =
            sqlx::query_as("SELECT model_id, is_positive FROM example WHERE standard_id = ? ORDER BY model_id")
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

    /// Puts examples in the place of those that were marked before.
    pub async fn mark_examples(&self, id: StandardId, examples: &Examples) -> Result<(), StoreError> {
        let mut tx = self.begin().await?;
        sqlx::query("DELETE FROM example WHERE standard_id = ?").bind(id.to_string()).execute(&mut *tx).await?;
        let is_there: bool = sqlx::query_scalar("SELECT EXISTS (SELECT 1 FROM standard WHERE id = ?)")
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

    /// Deletes a standard with its examples and the verdicts against it.
    pub async fn delete_standard(&self, id: StandardId) -> Result<(), StoreError> {
        self.with_reserve(|| self.delete_standard_once(id)).await?;
        self.fold_log().await;
        Ok(())
    }

    async fn delete_standard_once(&self, id: StandardId) -> Result<(), StoreError> {
        let mut tx = self.begin_any().await?;
        replays::delete_of(&mut tx, &id.to_string()).await?;
        let done = sqlx::query("DELETE FROM standard WHERE id = ?").bind(id.to_string()).execute(&mut *tx).await?;
        if done.rows_affected() == 0 {
            return Err(not_found(&id.to_string()));
        }
        sweep::leave(&mut tx, StoredFile::Standard(id)).await?;
        tx.commit().await
    }
}

fn not_found(name_or_id: &str) -> StoreError {
    StoreError::NotFound { kind: "standard", id: name_or_id.chars().take(64).collect() }
}

async fn insert(db: &mut SqliteConnection, standard: &NewStandard) -> Result<(), StoreError> {
    let annotation = serde_json::to_string(&standard.annotation).map_err(|error| damaged("an annotation", error))?;
    let class = serde_json::to_string(&standard.class).map_err(|error| damaged("a class", error))?;
    sqlx::query(
        "INSERT INTO standard (id, name, asset, bytes, checksum, unit, annotation, version, class)
         VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)",
    )
    .bind(standard.id.to_string())
    .bind(&standard.name)
    .bind(&standard.asset.name)
    .bind(to_i64(standard.asset.bytes))
    .bind(&standard.asset.checksum)
    .bind(standard.unit.name())
    .bind(annotation)
    .bind(standard.class.version)
    .bind(class)
    .execute(db)
    .await?;
    Ok(())
}

/// Marks examples; a model that is not there is an error.
async fn mark(db: &mut SqliteConnection, id: StandardId, examples: &Examples) -> Result<(), StoreError> {
    let positive = examples.positive.iter().map(|model| (model, true));
    for (model, is_positive) in positive.chain(examples.negative.iter().map(|model| (model, false))) {
        let done = sqlx::query(
            "INSERT INTO example (standard_id, model_id, is_positive) SELECT ?, id, ? FROM model WHERE id = ?",
        )
        .bind(id.to_string())
        .bind(is_positive)
        .bind(model.to_string())
        .execute(&mut *db)
        .await?;
        if done.rows_affected() == 0 {
            return Err(StoreError::NotFound { kind: "model", id: model.to_string() });
        }
    }
    Ok(())
}
