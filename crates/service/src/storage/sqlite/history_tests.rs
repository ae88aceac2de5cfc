//! Databases as every earlier version has left them, made by that version's own SQL: each keeps all that it holds.

use sqlx::sqlite::{SqliteConnectOptions, SqlitePool, SqlitePoolOptions};

use super::{SqliteDatabase, migrations, now_ms};
use crate::storage::database::*;
use visage_domain::{
    FileId, FolderId, JobId, JobKind, JobStatus, ModelId, PageRequest, ScanSetId, StandardId, StoredContent,
    StoredFile, StoredSignature,
};
use visage_shape::faces::signature::example::example;

/// What is in an old database.
struct Old {
    set: ScanSetId,
    scan: FileId,
    jobs: [JobId; 2],
    model: ModelId,
    signature: StoredSignature,
    standard: StandardId,
    folder: FolderId,
    going: ModelId,
}

/// How many migrations there are.
fn versions() -> usize {
    migrations::migrator().iter().count()
}

/// An empty database of a version.
async fn empty(file: &std::path::Path, version: usize) -> SqlitePool {
    let options = SqliteConnectOptions::new().filename(file).create_if_missing(true).foreign_keys(false);
    let pool = SqlitePoolOptions::new().max_connections(1).connect_with(options).await.expect("a new database");
    let mut before = migrations::migrator();
    before.migrations.to_mut().truncate(version);
    before.run(&pool).await.expect("migrated");
    pool
}

async fn run(pool: &SqlitePool, sql: String) {
    sqlx::query(sqlx::AssertSqlSafe(sql.clone())).execute(pool).await.unwrap_or_else(|error| panic!("{sql}: {error}"));
}

/// Fills each table that the version has, with all columns that tell something.
async fn fill(pool: &SqlitePool, version: usize) -> Old {
    let old = Old {
        set: ScanSetId::new(),
        scan: FileId::new(),
        jobs: [JobId::new(), JobId::new()],
        model: ModelId::new(),
        signature: (&example(0.3, 5)).into(),
        standard: StandardId::new(),
        folder: FolderId::new(),
        going: ModelId::new(),
    };
    let Old { set, scan, jobs: [done, waiting], model, standard, folder, going, .. } = &old;
    let with = |since: usize, text: &str| if version >= since { text.to_owned() } else { String::new() };
    let options = serde_json::to_string(&visage_domain::options::Options::default()).expect("plain data");
    run(
        pool,
        format!(
            "INSERT INTO scan_set (id, name, unit, poses_name, poses) VALUES ('{set}', 'a set', 'mm', 'p', x'7b7d')"
        ),
    )
    .await;
    run(
        pool,
        format!(
            "INSERT INTO scan (scan_set_id, name, file_id, points, bytes, checksum)
             VALUES ('{set}', 'a.ply', '{scan}', 10, 100, 'c')"
        ),
    )
    .await;
    for (job, status) in [(done, "succeeded"), (waiting, "queued")] {
        let (column, value) = (with(3, ", kind"), with(3, ", 'register'"));
        let sql = format!(
            "INSERT INTO job (id, scan_set_id, label, options, status{column})
             VALUES ('{job}', '{set}', 'a label', '{options}', '{status}'{value})"
        );
        run(pool, sql).await;
    }
    run(
        pool,
        format!(
            "INSERT INTO model (id, job_id, scan_set_id, name, label, unit, points, quality)
             VALUES ('{model}', '{done}', '{set}', 'a model', 'a label', 'mm', 1, 'good')"
        ),
    )
    .await;
    run(pool, format!("INSERT INTO asset (model_id, name, bytes, checksum) VALUES ('{model}', 'cloud.ply', 7, 'd')"))
        .await;
    sqlx::query("INSERT INTO signature (model_id, version, summary, content) VALUES (?, ?, ?, ?)")
        .bind(model.to_string())
        .bind(old.signature.version)
        .bind(serde_json::to_string(&old.signature.summary).expect("plain data"))
        .bind(&old.signature.content)
        .execute(pool)
        .await
        .expect("stored");
    run(
        pool,
        format!(
            "INSERT INTO replay (route, key, body_hash, status, location, body, resource_id, created_at)
             VALUES ('POST /v1/jobs', 'k', 'h', 202, '/v1/jobs/{waiting}', '{{}}', '{waiting}', {})",
            now_ms()
        ),
    )
    .await;
    if version >= 3 {
        run(
            pool,
            format!(
                "INSERT INTO standard (id, name, asset, bytes, checksum, unit, annotation, version, class)
                 VALUES ('{standard}', 'mugs', 'model.ply', 5, 'e', 'mm', '{{}}', 0, '{{}}')"
            ),
        )
        .await;
        run(pool, format!("INSERT INTO example VALUES ('{standard}', '{model}', 1)")).await;
        let verdict = format!(
            "INSERT INTO verdict (standard_id, model_id, version, residual_mm) VALUES ('{standard}', '{model}', 0, 0.5)"
        );
        run(pool, verdict).await;
    }
    if version >= 4 {
        run(pool, format!("INSERT INTO folder (only_row, id) VALUES (1, '{folder}')")).await;
        let loose = format!("INSERT INTO loose_file (kind, id, is_deleted, since) VALUES ('model', '{going}', 1, 0)");
        run(pool, loose).await;
    }
    old
}

#[tokio::test]
async fn every_earlier_database_keeps_all_that_it_holds() {
    for version in 1..versions() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let file = folder.path().join("old.sqlite");
        let pool = empty(&file, version).await;
        let old = fill(&pool, version).await;
        pool.close().await;

        let db = SqliteDatabase::open(&file).await.unwrap_or_else(|error| panic!("version {version}: {error}"));
        let set = db.scan_set(old.set).await.expect("kept");
        assert_eq!((set.name.as_str(), set.scans.len(), set.scans[0].file_id), ("a set", 1, old.scan), "{version}");
        assert_eq!(set.poses.expect("kept").content, b"{}", "{version}");
        let [done, waiting] = [db.job(old.jobs[0]).await.expect("kept"), db.job(old.jobs[1]).await.expect("kept")];
        assert_eq!((done.kind, done.status, done.model_id), (JobKind::Register, JobStatus::Succeeded, Some(old.model)));
        assert_eq!((waiting.status, waiting.scan_set_id), (JobStatus::Queued, Some(old.set)), "{version}");
        let model = db.model(old.model).await.expect("kept");
        assert_eq!((model.label.as_deref(), model.quality.as_deref()), (Some("a label"), Some("good")), "{version}");
        assert!(model.signature.is_some());
        assert_eq!(db.assets(old.model).await.expect("kept").len(), 1);
        let signatures = db.signatures_after(None, 10).await.expect("kept");
        assert!(
            matches!(&signatures[..], [(id, StoredContent::Whole(_))] if *id == old.model),
            "{version}: {signatures:?}"
        );
        if version >= 3 {
            let counts: (i64, i64, i64) = sqlx::query_as(
                "SELECT (SELECT count(*) FROM standard), (SELECT count(*) FROM example), (SELECT count(*) FROM verdict)",
            )
            .fetch_one(&db.readers)
            .await
            .expect("counted");
            assert_eq!(counts, (1, 1, 1), "{version}");
        }
        if version >= 4 {
            assert_eq!(db.folder_id().await.expect("read"), Some(old.folder), "{version}");
            let (_, loose) = db.known_files().await.expect("read");
            assert_eq!(loose.iter().map(|entry| entry.file).collect::<Vec<_>>(), [StoredFile::Model(old.going)]);
        }
        assert_eq!(db.integrity().await.expect("read"), Vec::<String>::new(), "{version}");
        let broken: Vec<(String,)> = sqlx::query_as("SELECT \"table\" FROM pragma_foreign_key_check")
            .fetch_all(&db.readers)
            .await
            .expect("read");
        assert_eq!(broken, [], "{version}");
        // what came later is there, and empty
        assert!(!db.has_keys().await.expect("asked"));
        let page = PageRequest { before: None, limit: 10 };
        assert!(db.audit(&Default::default(), &page).await.expect("listed").items.is_empty());
        assert_eq!(db.census().await.expect("counted").models, 1);
        db.close().await;
    }
}

/// Whatever the version of an old database, its schema is in the end that of a new one.
#[tokio::test]
async fn every_way_leads_to_the_same_schema() {
    let schema = async |file: &std::path::Path| {
        let db = SqliteDatabase::open(file).await.expect("opened");
        let sql: Vec<(String, String, Option<String>)> =
            sqlx::query_as("SELECT type, name, sql FROM sqlite_schema ORDER BY type, name")
                .fetch_all(&db.readers)
                .await
                .expect("read");
        db.close().await;
        sql
    };
    let folder = tempfile::tempdir().expect("a temporary folder");
    let new = schema(&folder.path().join("new.sqlite")).await;
    for version in 1..versions() {
        let file = folder.path().join(format!("{version}.sqlite"));
        let pool = empty(&file, version).await;
        fill(&pool, version).await;
        pool.close().await;
        assert_eq!(schema(&file).await, new, "from version {version}");
    }
}

/// A program does not touch the database of a later one, nor one that another version is using.
#[tokio::test]
async fn a_later_or_an_earlier_database_is_not_used_beside_a_server() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("old.sqlite");
    empty(&file, versions() - 1).await.close().await;
    let refused = SqliteDatabase::open_beside(&file).await.expect_err("another version");
    assert!(matches!(refused, crate::storage::DatabaseError::OtherVersion), "{refused}");
    let db = SqliteDatabase::open(&file).await.expect("brought up to date");
    SqliteDatabase::open_beside(&file).await.expect("the same version").close().await;
    sqlx::query(
        "INSERT INTO _sqlx_migrations (version, description, success, checksum, execution_time)
         VALUES (9999, 'later', 1, x'00', 0)",
    )
    .execute(&db.writer)
    .await
    .expect("as a later program would");
    db.close().await;
    assert!(SqliteDatabase::open_beside(&file).await.is_err());
    assert!(SqliteDatabase::open(&file).await.is_err());
}
