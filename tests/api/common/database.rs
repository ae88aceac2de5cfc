//! Where servers have their database: in their folder or, with VISAGE_TEST_DATABASE=postgres, on the server that VISAGE_TEST_POSTGRES
//! names, each folder one of its own.

use std::path::Path;

use visage::config::DatabaseUrl;

/// The address of the database that goes with a folder, if that is on a server; made when there is none.
pub fn database_for(folder: &Path) -> Option<DatabaseUrl> {
    match std::env::var("VISAGE_TEST_DATABASE").ok()?.as_str() {
        "postgres" => Some(made_for(folder)),
        other => panic!("VISAGE_TEST_DATABASE is {other:?}, not postgres"),
    }
}

#[cfg(not(feature = "postgres"))]
fn made_for(_: &Path) -> DatabaseUrl {
    panic!("these tests were built without --features postgres")
}

/// The address of the database that goes with a folder, made when there is none.
#[cfg(feature = "postgres")]
pub fn made_for(folder: &Path) -> DatabaseUrl {
    let folder = folder.to_owned();
    // tests are async, and so is sqlx: on a thread of its own that is no matter
    let made = std::thread::spawn(move || {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().expect("a runtime");
        runtime.block_on(make(&folder))
    });
    made.join().expect("a database")
}

#[cfg(feature = "postgres")]
async fn make(folder: &Path) -> DatabaseUrl {
    use sqlx::{AssertSqlSafe, ConnectOptions, Connection, postgres::PgConnectOptions};
    let server = std::env::var("VISAGE_TEST_POSTGRES").expect("VISAGE_TEST_POSTGRES names a database of a server");
    let name = format!("of_{}", &blake3::hash(folder.as_os_str().as_encoded_bytes()).to_hex()[..16]);
    let mut admin = server.parse::<PgConnectOptions>().expect("an address").connect().await.expect("a server");
    let found = "SELECT EXISTS (SELECT 1 FROM pg_database WHERE datname = $1)";
    let is_there: bool = sqlx::query_scalar(found).bind(&name).fetch_one(&mut admin).await.expect("asked");
    if !is_there {
        sqlx::query(AssertSqlSafe(format!("CREATE DATABASE {name}"))).execute(&mut admin).await.expect("created");
    }
    admin.close().await.expect("closed");
    let (before, after) = server.split_once('?').map_or((server.as_str(), ""), |(before, after)| (before, after));
    let before = before.rsplit_once('/').expect("an address").0;
    format!("{before}/{name}?{after}").parse().unwrap_or_else(|never| match never {})
}
