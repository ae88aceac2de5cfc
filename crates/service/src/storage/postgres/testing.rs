//! Databases for tests, on the server that VISAGE_TEST_POSTGRES names (a database there from which others can be created). Without
//! it these tests are not run: they are ignored, and `.ci/postgres` asks for them.

use std::sync::Arc;

use async_trait::async_trait;
use sqlx::postgres::PgConnectOptions;
use sqlx::{AssertSqlSafe, ConnectOptions, Connection};

use super::move_in::TABLES;
use super::{Claim, PostgresDatabase};
use crate::config::DatabaseUrl;
use crate::storage::conformance::DatabasePlace;
use crate::storage::database::Upkeep;
use crate::storage::sqlite::SqliteDatabase;
use crate::storage::{Database, NoReserve};
use visage_domain::{FolderId, SeatId};

/// A database of its own.
pub(crate) struct PostgresPlace {
    url: DatabaseUrl,
}

/// The server that tests use.
fn server() -> String {
    std::env::var("VISAGE_TEST_POSTGRES").expect("VISAGE_TEST_POSTGRES names a database of a server for tests")
}

impl PostgresPlace {
    /// Where it is.
    pub(super) fn url(&self) -> &DatabaseUrl {
        &self.url
    }

    async fn open_beside(&self) -> PostgresDatabase {
        PostgresDatabase::open_beside(&self.url, Arc::new(NoReserve)).await.expect("opened")
    }
}

#[async_trait]
impl DatabasePlace for PostgresPlace {
    async fn new() -> Self {
        let (server, name) = (server(), format!("visage_{}", FolderId::new().to_string().replace('-', "")));
        let mut admin = server.parse::<PgConnectOptions>().expect("an address").connect().await.expect("a server");
        sqlx::query(AssertSqlSafe(format!("CREATE DATABASE {name}"))).execute(&mut admin).await.expect("created");
        admin.close().await.expect("closed");
        let (before, after) = server.split_once('?').map_or((server.as_str(), ""), |(before, after)| (before, after));
        let before = before.rsplit_once('/').expect("an address").0;
        let url: DatabaseUrl = format!("{before}/{name}?{after}").parse().unwrap_or_else(|never| match never {});
        let claim = Claim { seat: SeatId::new(), is_shared: false };
        let first =
            PostgresDatabase::open_for(&url, claim, Arc::new(NoReserve), Default::default()).await.expect("new");
        first.put_folder_id(FolderId::new()).await.expect("stored");
        PostgresPlace { url }
    }

    async fn open(&self, seat: SeatId) -> Arc<dyn Database> {
        Arc::new(self.open_beside().await.on_seat(seat))
    }

    /// What the server says when its disk is full.
    async fn open_full(&self) -> Arc<dyn Database> {
        let database = self.open_beside().await;
        let full = "CREATE FUNCTION full_disk() RETURNS trigger LANGUAGE plpgsql AS
            $$ BEGIN RAISE SQLSTATE '53100' USING MESSAGE = 'No space left on device'; END $$";
        sqlx::query(full).execute(&database.writer).await.expect("made");
        let trigger = "CREATE TRIGGER full_disk BEFORE INSERT ON scan_set EXECUTE FUNCTION full_disk()";
        sqlx::query(trigger).execute(&database.writer).await.expect("made");
        Arc::new(database)
    }
}

/// What is in no list of what is moved would be left behind; a column that one database lacks, too.
#[tokio::test]
#[ignore = "takes a server: .ci/postgres has one"]
async fn both_databases_have_the_same_tables_with_the_same_columns_and_all_are_moved() {
    let place = PostgresPlace::new().await;
    let ours = place.open_beside().await;
    let folder = tempfile::tempdir().expect("a temporary folder");
    let theirs = SqliteDatabase::open(&folder.path().join("test.sqlite")).await.expect("new");
    let mut of_ours: Vec<(String, String)> = sqlx::query_as(
        "SELECT table_name::text, column_name::text FROM information_schema.columns WHERE table_schema = current_schema()",
    )
    .fetch_all(&ours.readers)
    .await
    .expect("read");
    let mut of_theirs: Vec<(String, String)> = sqlx::query_as(
        "SELECT s.name, c.name FROM sqlite_schema AS s, pragma_table_info(s.name) AS c
         WHERE s.type = 'table' AND s.name NOT LIKE 'sqlite_%'",
    )
    .fetch_all(theirs.rows())
    .await
    .expect("read");
    let mut moved: Vec<&str> = TABLES.to_vec();
    moved.push("_sqlx_migrations");
    for columns in [&mut of_ours, &mut of_theirs] {
        columns.sort();
        assert!(columns.len() > 100);
    }
    // what several processes have to learn of each other
    of_ours.retain(|(table, _)| !table.starts_with("gallery_"));
    assert_eq!(of_ours, of_theirs);
    let mut tables: Vec<&str> = of_ours.iter().map(|(table, _)| table.as_str()).collect();
    tables.dedup();
    moved.sort_unstable();
    assert_eq!(tables, moved);
}

mod conformance {
    use super::PostgresPlace;

    crate::storage::conformance::database_conformance!(PostgresPlace, #[ignore = "takes a server: .ci/postgres has one"]);
}
