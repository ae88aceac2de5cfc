//! The tables of the recycle bin, held against those that they stand for.

use super::dialect::COLUMNS;
use super::sql::recycle_bin::TABLES;
use super::testing;

/// A migration that forgets the bin would lose a column at the first restore.
#[tokio::test]
async fn the_tables_of_the_bin_have_the_columns_of_those_they_stand_for() {
    let (store, _folder) = testing::store().await;
    let mut db = store.readers.acquire().await.expect("a connection");
    for (table, _) in TABLES {
        let mut names = async |table: &str| {
            let names: String = sqlx::query_scalar(COLUMNS).bind(table).fetch_one(&mut *db).await.expect("read");
            let mut names: Vec<String> = names.split(", ").map(str::to_owned).collect();
            names.sort();
            names
        };
        let mut own = names(table).await;
        own.push("\"bin_id\"".to_owned());
        own.sort();
        assert_eq!(names(&format!("binned_{table}")).await, own, "{table}");
    }
}

/// What refers to a table of the bin would be deleted with the row and not come back.
#[tokio::test]
async fn every_table_that_goes_with_a_set_a_job_or_a_model_is_in_the_bin_or_made_anew() {
    let (store, _folder) = testing::store().await;
    let tables: Vec<String> = sqlx::query_scalar(
        "SELECT DISTINCT s.name FROM sqlite_schema AS s, pragma_foreign_key_list(s.name) AS f
         WHERE f.\"table\" IN ('scan_set', 'job', 'model') ORDER BY 1",
    )
    .fetch_all(&store.readers)
    .await
    .expect("read");
    let made_anew = ["verdict", "upload"];
    for table in &tables {
        let is_kept = TABLES.iter().any(|(name, _)| name == table);
        assert!(is_kept || made_anew.contains(&table.as_str()), "{table} is deleted and not put back");
    }
    assert!(tables.len() >= 7, "{tables:?}");
}
