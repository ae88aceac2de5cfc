//! All rows of a database of SQLite, moved into a new one.

use futures_util::TryStreamExt;
use sqlx::postgres::PgConnection;
use sqlx::sqlite::SqliteRow;
use sqlx::{AssertSqlSafe, Postgres, QueryBuilder, Row};

use super::PostgresDatabase;
use crate::storage::DatabaseError;
use crate::storage::database::Upkeep;
use crate::storage::sqlite::SqliteDatabase;

/// All tables, those first that others refer to. Triggers of `signature` write into `unfiled`, which therefore comes after it.
pub(super) const TABLES: [&str; 32] = [
    "folder",
    "scan_set",
    "scan",
    "expiry",
    "upload",
    "job",
    "model",
    "asset",
    "signature",
    "replay",
    "standard",
    "example",
    "verdict",
    "loose_file",
    "api_key",
    "session",
    "audit",
    "made_by",
    "webhook",
    "delivery",
    "node",
    "segment",
    "unfiled",
    "bin",
    "binned_scan_set",
    "binned_scan",
    "binned_expiry",
    "binned_job",
    "binned_model",
    "binned_asset",
    "binned_signature",
    "binned_example",
];
/// Rows in one statement.
const AT_ONCE: usize = 200;

/// What was moved: tables and their numbers of rows.
pub type Moved = Vec<(&'static str, u64)>;

impl PostgresDatabase {
    /// Takes all rows over, in one transaction; refused unless there are none yet. `None` if exactly these rows are here already:
    /// an attempt was broken off after its commit.
    pub async fn move_in(&self, from: &SqliteDatabase) -> Result<Option<Moved>, DatabaseError> {
        let mut tx = self.begin_any().await?;
        let (mut theirs, mut ours) = (Vec::new(), Vec::new());
        for table in TABLES {
            let count = format!("SELECT count(*) FROM {table}");
            let there: i64 = sqlx::query_scalar(AssertSqlSafe(count)).fetch_one(from.rows()).await?;
            theirs.push((table, u64::try_from(there).unwrap_or(0)));
            ours.push((table, count_of(&mut tx, table).await?));
        }
        if ours.iter().any(|(_, rows)| *rows > 0) {
            let is_same = from.folder_id().await? == self.folder_id().await? && ours == theirs;
            return if is_same { Ok(None) } else { Err(DatabaseError::NotEmpty) };
        }
        for table in TABLES {
            copy(&mut tx, from, table).await?;
        }
        let mut moved = Vec::new();
        for (table, there) in theirs {
            let here = count_of(&mut tx, table).await?;
            if here != there {
                let reason = format!("{there} rows of {table} became {here}");
                return Err(DatabaseError::Damaged { what: "rows", reason });
            }
            moved.push((table, here));
        }
        tx.commit().await?;
        // plans are made by how much there is
        sqlx::query("ANALYZE").execute(&self.writer).await?;
        Ok(Some(moved))
    }
}

async fn count_of(db: &mut PgConnection, table: &str) -> Result<u64, DatabaseError> {
    let count = format!("SELECT count(*) FROM {table}");
    let rows: i64 = sqlx::query_scalar(AssertSqlSafe(count)).fetch_one(db).await?;
    Ok(u64::try_from(rows).unwrap_or(0))
}

async fn copy(db: &mut PgConnection, from: &SqliteDatabase, table: &str) -> Result<(), DatabaseError> {
    let columns: Vec<(String, String)> = sqlx::query_as(
        "SELECT column_name::text, data_type::text FROM information_schema.columns
         WHERE table_schema = current_schema() AND table_name = $1 ORDER BY ordinal_position",
    )
    .bind(table)
    .fetch_all(&mut *db)
    .await?;
    if table == "unfiled" {
        sqlx::query("DELETE FROM unfiled").execute(&mut *db).await?;
    }
    let names = columns.iter().map(|(name, _)| format!("\"{name}\"")).collect::<Vec<_>>().join(", ");
    let select = format!("SELECT {names} FROM {table}");
    let mut rows = sqlx::query(AssertSqlSafe(select)).fetch(from.rows()).try_chunks(AT_ONCE);
    while let Some(chunk) = rows.try_next().await.map_err(|broken| broken.1)? {
        let mut insert = QueryBuilder::<Postgres>::new(format!("INSERT INTO {table} ({names}) VALUES "));
        for (index, row) in chunk.iter().enumerate() {
            insert.push(if index == 0 { "(" } else { ", (" });
            for (place, (_, kind)) in columns.iter().enumerate() {
                if place > 0 {
                    insert.push(", ");
                }
                push(&mut insert, row, place, kind)?;
            }
            insert.push(")");
        }
        insert.build().execute(&mut *db).await?;
    }
    Ok(())
}

fn push(insert: &mut QueryBuilder<Postgres>, row: &SqliteRow, place: usize, kind: &str) -> Result<(), DatabaseError> {
    match kind {
        "bigint" => insert.push_bind(row.try_get::<Option<i64>, _>(place)?),
        "boolean" => insert.push_bind(row.try_get::<Option<bool>, _>(place)?),
        "double precision" => insert.push_bind(row.try_get::<Option<f64>, _>(place)?),
        "bytea" => insert.push_bind(row.try_get::<Option<Vec<u8>>, _>(place)?),
        _ => insert.push_bind(row.try_get::<Option<String>, _>(place)?),
    };
    Ok(())
}
