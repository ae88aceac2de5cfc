//! The gallery while it is being loaded: refused for now, and nothing that happens meanwhile is lost.

use crate::common::*;
use reqwest::StatusCode;
use reqwest::multipart::{Form, Part};
use serde_json::{Value, json};
use sqlx::sqlite::{SqliteConnectOptions, SqlitePool};

/// Enough that loading takes longer than the first requests.
const COPIES: i64 = 6000;

/// Stores copies of the model that is there, as a crowd of other models.
pub async fn multiply(folder: &std::path::Path, copies: i64) {
    let options = SqliteConnectOptions::new().filename(folder.join("visage.sqlite"));
    let pool = SqlitePool::connect_with(options).await.expect("the server's database");
    let numbers = "WITH RECURSIVE number (k) AS (SELECT 1 UNION ALL SELECT k + 1 FROM number WHERE k < ?)";
    let id = "printf('00000000-0000-7000-8000-%012x', k)";
    for insertion in [
        format!("{numbers} INSERT INTO model (id, name, unit, points) SELECT {id}, 'copy', 'mm', 7 FROM number"),
        format!(
            "{numbers} INSERT INTO signature (model_id, version, summary, content)
             SELECT {id}, version, summary, content FROM number, signature"
        ),
    ] {
        sqlx::query(sqlx::AssertSqlSafe(insertion)).bind(copies).execute(&pool).await.expect("inserted");
    }
    pool.close().await;
}

fn model_form(phase: f64) -> Form {
    let mesh = Part::bytes(files::bumpy_sphere(phase)).file_name("ball.obj");
    Form::new().part("model", mesh).text("unit", "mm")
}

#[tokio::test]
async fn until_the_gallery_is_loaded_queries_wait_and_uploads_do_not() {
    let server = TestServer::start().await;
    expect_json(server.post_form("/v1/models", model_form(0.3)).await, StatusCode::CREATED).await;
    let TestServer { folder, handle, .. } = server;
    assert!(handle.shutdown().await);
    multiply(folder.path(), COPIES).await;

    let server = TestServer::start_on(folder, |_| {}).await;
    let question = json!({"standard": "face", "limit": 3});
    for early in [server.get("/readyz").await, server.post("/v1/queries", &question).await] {
        assert_eq!(early.status(), StatusCode::SERVICE_UNAVAILABLE);
        assert!(early.headers().contains_key("retry-after"));
    }
    let info = expect_json(server.get("/v1/info").await, StatusCode::OK).await;
    assert_eq!(info.pointer("/load/searchable_models").unwrap_or(&Value::Null), &Value::Null);
    let uploaded = server.post_form("/v1/models", model_form(0.7)).await;
    let uploaded = text(&expect_json(uploaded, StatusCode::CREATED).await, "/id");
    let gone = format!("/v1/models/00000000-0000-7000-8000-{:012x}", 5);
    assert_eq!(server.delete(&gone).await, StatusCode::NO_CONTENT);

    while server.get("/readyz").await.status() != StatusCode::OK {
        tokio::time::sleep(std::time::Duration::from_millis(10)).await;
    }
    let answer = expect_json(server.post("/v1/queries", &question).await, StatusCode::OK).await;
    assert_eq!(answer["searched"], COPIES + 1);
    let answer = server.post("/v1/queries", &json!({"model_id": uploaded, "limit": 1000})).await;
    assert_eq!(expect_json(answer, StatusCode::OK).await["searched"], COPIES + 1);
}
