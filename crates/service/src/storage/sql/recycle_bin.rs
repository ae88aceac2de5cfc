//! What was deleted and can still be put back: its rows are moved into tables of the same columns, and moved back.

use async_trait::async_trait;
use sqlx::AssertSqlSafe;

use super::rows::row;
use super::{
    COLUMNS, Connection, Store, Writing, damaged, evaluations, files, jobs, outbox, replays, scan_sets, sql_limit,
    stored_id, to_u64,
};
use crate::storage::database::RecycleBin;
use crate::storage::{DatabaseError, Deleted, Purged, Unseen};
use visage_domain::{
    AssetRecord, BinDue, BinId, BinRecord, Deletable, Event, ModelId, Page, PageRequest, ScanRecord, ScanSetId,
    StoredFile,
};

/// The tables whose rows are moved, parents first, with what tells the rows that belong to the rows of an entry (`$1`).
pub(in super::super) const TABLES: [(&str, &str); 8] = [
    ("scan_set", "id = $2"),
    ("scan", "scan_set_id IN (SELECT id FROM binned_scan_set WHERE bin_id = $1)"),
    ("expiry", "scan_set_id IN (SELECT id FROM binned_scan_set WHERE bin_id = $1)"),
    ("job", "id = $2 OR scan_set_id = $2"),
    ("model", "id = $2 OR job_id = $2 OR scan_set_id = $2"),
    ("asset", "model_id IN (SELECT id FROM binned_model WHERE bin_id = $1)"),
    ("signature", "model_id IN (SELECT id FROM binned_model WHERE bin_id = $1)"),
    // the standard may be deleted meanwhile: then it has no examples
    ("example", "model_id IN (SELECT id FROM binned_model WHERE bin_id = $1)"),
];

const ENTRY: &str = "SELECT bin.*,
    (SELECT count(*) FROM binned_model WHERE bin_id = bin.id) AS models,
    CAST((SELECT coalesce(sum(bytes), 0) FROM binned_scan WHERE bin_id = bin.id)
       + (SELECT coalesce(sum(bytes), 0) FROM binned_asset WHERE bin_id = bin.id) AS BIGINT) AS bytes FROM bin";

row! {
    struct Row {
        id: String,
        kind: String,
        thing: String,
        name: String,
        label: Option<String>,
        models: i64,
        bytes: i64,
    }
}

impl Row {
    fn record(self) -> Result<BinRecord, DatabaseError> {
        Ok(BinRecord {
            id: stored_id!(BinId, &self.id)?,
            thing: Deletable::parse(&self.kind, &self.thing).ok_or_else(|| damaged("an id", &self.thing))?,
            name: self.name,
            label: self.label,
            models: to_u64(self.models),
            bytes: to_u64(self.bytes),
        })
    }
}

#[async_trait]
impl RecycleBin for Store {
    async fn put_in_bin(&self, thing: Deletable) -> Result<Deleted, DatabaseError> {
        // it frees nothing, so it is refused on a full disk, where the deletion for good is not
        let mut tx = self.begin().await?;
        let (entry, id) = (BinId::new().to_string(), thing.to_string());
        match thing {
            Deletable::ScanSet(set) => scan_sets::check_free(&mut tx, set).await?,
            Deletable::Job(job) => jobs::check_finished(&mut tx, job).await?,
            Deletable::Model(_) => {}
        }
        let (table, described) = match thing {
            Deletable::ScanSet(_) => ("scan_set", "name, NULL"),
            Deletable::Job(_) => (
                "job",
                "coalesce((SELECT name FROM model WHERE job_id = job.id),
                          (SELECT name FROM scan_set WHERE id = job.scan_set_id), kind), label",
            ),
            Deletable::Model(_) => ("model", "name, label"),
        };
        let noted = sqlx::query(AssertSqlSafe(format!(
            "INSERT INTO bin (id, kind, thing, name, label) SELECT $1, $3, id, {described} FROM {table} WHERE id = $2"
        )))
        .bind(&entry)
        .bind(&id)
        .bind(thing.kind())
        .execute(&mut *tx)
        .await?;
        if noted.rows_affected() == 0 {
            return Err(DatabaseError::NotFound { kind: table, id });
        }
        for (name, of_entry) in TABLES {
            let columns = columns(&mut tx, name).await?;
            let copy = format!(
                "INSERT INTO binned_{name} (bin_id, {columns}) SELECT $1, {columns} FROM {name} WHERE {of_entry}"
            );
            sqlx::query(AssertSqlSafe(copy)).bind(&entry).bind(&id).execute(&mut *tx).await?;
        }
        let resources: Vec<String> = sqlx::query_scalar(
            "SELECT id FROM binned_job WHERE bin_id = $1 UNION SELECT id FROM binned_model WHERE bin_id = $1 UNION SELECT $2",
        )
        .bind(&entry)
        .bind(&id)
        .fetch_all(&mut *tx)
        .await?;
        for resource in resources {
            replays::delete_of(&mut tx, &resource).await?;
        }
        // what is derived from it goes by foreign keys
        sqlx::query(AssertSqlSafe(format!("DELETE FROM {table} WHERE id = $1"))).bind(&id).execute(&mut *tx).await?;
        let models = models_of(&mut tx, &entry).await?;
        for model in &models {
            outbox::tell(&mut tx, &Event::ModelDeleted(*model)).await?;
        }
        Ok(Deleted { models, purged: Purged::default(), unseen: tx.commit_unseen(self).await? })
    }

    async fn bin(&self, page: &PageRequest) -> Result<Page<BinRecord>, DatabaseError> {
        let list = format!("{ENTRY} WHERE $1 IS NULL OR id < $1 ORDER BY id DESC LIMIT $2");
        let rows: Vec<Row> = sqlx::query_as(AssertSqlSafe(list))
            .bind(page.before.as_deref())
            .bind(sql_limit(page))
            .fetch_all(&self.readers)
            .await?;
        let records = rows.into_iter().map(Row::record).collect::<Result<Vec<_>, _>>()?;
        Ok(Page::cut(records, page.limit))
    }

    async fn binned(&self, thing: &str) -> Result<BinRecord, DatabaseError> {
        let one = format!("{ENTRY} WHERE thing = $1");
        let row: Option<Row> = sqlx::query_as(AssertSqlSafe(one)).bind(thing).fetch_optional(&self.readers).await?;
        row.ok_or_else(|| not_found(thing))?.record()
    }

    async fn restore(&self, thing: &str) -> Result<(Vec<ModelId>, Unseen), DatabaseError> {
        let mut tx = self.begin().await?;
        let entry: Option<String> =
            sqlx::query_scalar("SELECT id FROM bin WHERE thing = $1").bind(thing).fetch_optional(&mut *tx).await?;
        let entry = entry.ok_or_else(|| not_found(thing))?;
        check_origin(&mut tx, &entry).await?;
        for (name, _) in TABLES {
            let columns = columns(&mut tx, name).await?;
            let is_known = if name == "example" { "AND standard_id IN (SELECT id FROM standard)" } else { "" };
            let copy = format!(
                "INSERT INTO {name} ({columns}) SELECT {columns} FROM binned_{name} WHERE bin_id = $1 {is_known}"
            );
            sqlx::query(AssertSqlSafe(copy)).bind(&entry).execute(&mut *tx).await?;
        }
        let models = models_of(&mut tx, &entry).await?;
        forget_entry(&mut tx, &entry).await?;
        for model in &models {
            outbox::tell(&mut tx, &Event::ModelAdded(*model)).await?;
        }
        // verdicts are made anew, and signatures of another version
        evaluations::queue_if_due(&mut tx).await?;
        Ok((models, tx.commit_unseen(self).await?))
    }

    async fn purge(&self, entries: &[BinId]) -> Result<Purged, DatabaseError> {
        let entries: Vec<String> = entries.iter().map(BinId::to_string).collect();
        let purge = || async {
            let mut tx = self.begin_any().await?;
            let mut purged = Purged::default();
            for entry in &entries {
                purge_entry(&mut tx, entry, &mut purged).await?;
            }
            tx.commit().await?;
            Ok(purged)
        };
        self.with_reserve(purge).await
    }

    async fn purge_due(&self, due: &BinDue) -> Result<Purged, DatabaseError> {
        self.with_reserve(|| self.purge_due_once(due)).await
    }

    async fn binned_scans(&self) -> Result<Vec<(ScanSetId, ScanRecord)>, DatabaseError> {
        scan_sets::binned_scans(&self.readers).await
    }

    async fn binned_assets(&self) -> Result<Vec<(ModelId, AssetRecord)>, DatabaseError> {
        let rows: Vec<(String, String, i64, String)> =
            sqlx::query_as("SELECT model_id, name, bytes, checksum FROM binned_asset ORDER BY model_id, name")
                .fetch_all(&self.readers)
                .await?;
        let asset = |(model, name, bytes, checksum): (String, String, i64, String)| {
            Ok((stored_id!(ModelId, &model)?, AssetRecord { name, bytes: to_u64(bytes), checksum }))
        };
        rows.into_iter().map(asset).collect()
    }
}

impl Store {
    async fn purge_due_once(&self, due: &BinDue) -> Result<Purged, DatabaseError> {
        let (mut tx, mut purged): (Writing, _) = (self.begin_any().await?, Purged::default());
        let entries: Vec<String> = sqlx::query_scalar(
            "SELECT id FROM bin WHERE id < $1
             UNION SELECT bin_id FROM binned_scan_set WHERE id < $2
             UNION SELECT bin_id FROM binned_expiry WHERE at <= $3
             UNION SELECT bin.id FROM bin WHERE kind = 'model' AND thing < $4",
        )
        .bind(due.before.to_string())
        .bind(due.scan_sets_before.map(|id| id.to_string()))
        .bind(due.now.as_millisecond())
        .bind(due.models_before.map(|id| id.to_string()))
        .fetch_all(&mut *tx)
        .await?;
        for entry in entries {
            purge_entry(&mut tx, &entry, &mut purged).await?;
        }
        // of scan sets and jobs that stay in the bin, the models go that are too old
        let models: Vec<String> = sqlx::query_scalar("SELECT id FROM binned_model WHERE id < $1")
            .bind(due.models_before.map(|id| id.to_string()))
            .fetch_all(&mut *tx)
            .await?;
        for model in models {
            for (table, column) in
                [("example", "model_id"), ("signature", "model_id"), ("asset", "model_id"), ("model", "id")]
            {
                let delete = format!("DELETE FROM binned_{table} WHERE {column} = $1");
                sqlx::query(AssertSqlSafe(delete)).bind(&model).execute(&mut *tx).await?;
            }
            leave_model(&mut tx, stored_id!(ModelId, &model)?, &mut purged).await?;
        }
        tx.commit().await?;
        Ok(purged)
    }
}

fn not_found(thing: &str) -> DatabaseError {
    DatabaseError::NotFound { kind: "entry of the recycle bin", id: thing.chars().take(64).collect() }
}

/// The columns of a table, as SQL lists them.
async fn columns(db: &mut Connection, table: &str) -> Result<String, DatabaseError> {
    Ok(sqlx::query_scalar(COLUMNS).bind(table).fetch_one(db).await?)
}

async fn models_of(db: &mut Connection, entry: &str) -> Result<Vec<ModelId>, DatabaseError> {
    let ids: Vec<String> = sqlx::query_scalar("SELECT id FROM binned_model WHERE bin_id = $1 ORDER BY id")
        .bind(entry)
        .fetch_all(db)
        .await?;
    ids.iter().map(|text| stored_id!(ModelId, text)).collect()
}

/// What an entry was made of is there, or comes back with it.
async fn check_origin(db: &mut Connection, entry: &str) -> Result<(), DatabaseError> {
    let missing: Option<(String, String)> = sqlx::query_as(
        "SELECT 'scan set', scan_set_id FROM (
             SELECT scan_set_id FROM binned_job WHERE bin_id = $1 UNION SELECT scan_set_id FROM binned_model WHERE bin_id = $1) AS origin
         WHERE scan_set_id IS NOT NULL AND scan_set_id NOT IN (SELECT id FROM scan_set UNION SELECT id FROM binned_scan_set WHERE bin_id = $1)
         UNION ALL
         SELECT 'job', job_id FROM binned_model WHERE bin_id = $1
         AND job_id IS NOT NULL AND job_id NOT IN (SELECT id FROM job UNION SELECT id FROM binned_job WHERE bin_id = $1)
         LIMIT 1",
    )
    .bind(entry)
    .fetch_optional(db)
    .await?;
    match missing {
        None => Ok(()),
        Some((kind, id)) => {
            let kind = if kind == "job" { "job" } else { "scan set" };
            Err(DatabaseError::OriginDeleted { kind, id })
        }
    }
}

/// Takes the rows of an entry out of the bin.
async fn forget_entry(db: &mut Connection, entry: &str) -> Result<(), DatabaseError> {
    for (table, _) in TABLES {
        let delete = format!("DELETE FROM binned_{table} WHERE bin_id = $1");
        sqlx::query(AssertSqlSafe(delete)).bind(entry).execute(&mut *db).await?;
    }
    sqlx::query("DELETE FROM bin WHERE id = $1").bind(entry).execute(db).await?;
    Ok(())
}

/// Forgets an entry for good, with the entries of what was made of its things.
async fn purge_entry(db: &mut Writing, entry: &str, purged: &mut Purged) -> Result<(), DatabaseError> {
    let thing: Option<String> =
        sqlx::query_scalar("SELECT thing FROM bin WHERE id = $1").bind(entry).fetch_optional(&mut **db).await?;
    // it went with another one
    let Some(thing) = thing else { return Ok(()) };
    forget_for_good(db, entry, purged).await?;
    purge_made_of(db, &thing, purged).await
}

/// Forgets for good what was made of a scan set or a job that is gone for good; part of a larger transaction.
pub(super) async fn purge_made_of(db: &mut Writing, thing: &str, purged: &mut Purged) -> Result<(), DatabaseError> {
    let entries: Vec<String> = sqlx::query_scalar(
        "SELECT bin_id FROM binned_job WHERE scan_set_id = $1
         UNION SELECT bin_id FROM binned_model WHERE scan_set_id = $1 OR job_id = $1",
    )
    .bind(thing)
    .fetch_all(&mut **db)
    .await?;
    for entry in entries {
        forget_for_good(db, &entry, purged).await?;
    }
    Ok(())
}

async fn forget_for_good(db: &mut Writing, entry: &str, purged: &mut Purged) -> Result<(), DatabaseError> {
    let models = models_of(db, entry).await?;
    let sets: Vec<String> =
        sqlx::query_scalar("SELECT id FROM binned_scan_set WHERE bin_id = $1").bind(entry).fetch_all(&mut **db).await?;
    forget_entry(db, entry).await?;
    purged.entries += 1;
    for model in models {
        leave_model(db, model, purged).await?;
    }
    for set in sets {
        let set = StoredFile::ScanSet(stored_id!(ScanSetId, &set)?);
        files::leave(db, set).await?;
        purged.files.push(set);
    }
    Ok(())
}

async fn leave_model(db: &mut Writing, model: ModelId, purged: &mut Purged) -> Result<(), DatabaseError> {
    files::leave(db, StoredFile::Model(model)).await?;
    purged.files.push(StoredFile::Model(model));
    Ok(())
}
