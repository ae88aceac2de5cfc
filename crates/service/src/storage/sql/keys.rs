//! Keys and the sessions of browsers that have shown one.

use jiff::Timestamp;

use super::rows::row;
use super::{Store, damaged, sql_limit, stored_id, stored_name, timestamp, to_i64};
use crate::storage::DatabaseError;
use crate::storage::database::Keys;
use async_trait::async_trait;
use visage_domain::{KeyId, KeyRecord, NewKey, NewSession, Page, PageRequest, SecretHash, SessionId};

row! {
    struct KeyRow {
        id: String,
        name: String,
        scope: String,
        secret: Vec<u8>,
        expires_at: Option<i64>,
        revoked_at: Option<i64>,
    }
}

impl KeyRow {
    fn record(self) -> Result<(KeyRecord, SecretHash), DatabaseError> {
        let key = KeyRecord {
            id: stored_id!(KeyId, &self.id)?,
            name: self.name,
            scope: stored_name("a scope", &self.scope)?,
            expires_at: self.expires_at.map(timestamp).transpose()?,
            revoked_at: self.revoked_at.map(timestamp).transpose()?,
        };
        Ok((key, hash(self.secret)?))
    }
}

row! {
    struct SessionRow {
        key_id: String,
        secret: Vec<u8>,
        expires_at: i64,
    }
}

fn hash(bytes: Vec<u8>) -> Result<SecretHash, DatabaseError> {
    bytes.try_into().map_err(|_| damaged("a hash", "it has not 32 bytes"))
}

#[async_trait]
impl Keys for Store {
    async fn create_key(&self, key: &NewKey, limit: usize) -> Result<(), DatabaseError> {
        let mut tx = self.begin().await?;
        let count: i64 =
            sqlx::query_scalar("SELECT count(*) FROM api_key WHERE revoked_at IS NULL").fetch_one(&mut *tx).await?;
        if count >= to_i64(limit as u64) {
            return Err(DatabaseError::TooManyKeys { limit });
        }
        sqlx::query("INSERT INTO api_key (id, name, scope, secret, expires_at) VALUES ($1, $2, $3, $4, $5)")
            .bind(key.id.to_string())
            .bind(&key.name)
            .bind(key.scope.name())
            .bind(key.secret.as_slice())
            .bind(key.expires_at.map(Timestamp::as_millisecond))
            .execute(&mut *tx)
            .await?;
        tx.commit().await
    }

    async fn keys(&self, page: &PageRequest) -> Result<Page<KeyRecord>, DatabaseError> {
        let rows: Vec<KeyRow> =
            sqlx::query_as("SELECT * FROM api_key WHERE $1 IS NULL OR id < $1 ORDER BY id DESC LIMIT $2")
                .bind(page.before.as_deref())
                .bind(sql_limit(page))
                .fetch_all(&self.readers)
                .await?;
        let records = rows.into_iter().map(|row| Ok(row.record()?.0)).collect::<Result<Vec<_>, DatabaseError>>()?;
        Ok(Page::cut(records, page.limit))
    }

    async fn key(&self, id: KeyId) -> Result<Option<(KeyRecord, SecretHash)>, DatabaseError> {
        let row: Option<KeyRow> = sqlx::query_as("SELECT * FROM api_key WHERE id = $1")
            .bind(id.to_string())
            .fetch_optional(&self.readers)
            .await?;
        row.map(KeyRow::record).transpose()
    }

    async fn has_keys(&self) -> Result<bool, DatabaseError> {
        Ok(sqlx::query_scalar("SELECT EXISTS (SELECT 1 FROM api_key)").fetch_one(&self.readers).await?)
    }

    async fn revoke_key(&self, id: KeyId) -> Result<(), DatabaseError> {
        let revoke = || async {
            let mut tx = self.begin_any().await?;
            let done = sqlx::query("UPDATE api_key SET revoked_at = coalesce(revoked_at, $1) WHERE id = $2")
                .bind(tx.now_ms())
                .bind(id.to_string())
                .execute(&mut *tx)
                .await?;
            if done.rows_affected() == 0 {
                return Err(DatabaseError::NotFound { kind: "key", id: id.to_string() });
            }
            for what in ["DELETE FROM session WHERE key_id = $1", "DELETE FROM webhook WHERE key_id = $1"] {
                sqlx::query(what).bind(id.to_string()).execute(&mut *tx).await?;
            }
            tx.commit().await
        };
        self.with_reserve(revoke).await
    }

    async fn create_session(&self, session: &NewSession) -> Result<(), DatabaseError> {
        let mut tx = self.begin().await?;
        sqlx::query("INSERT INTO session (id, key_id, secret, expires_at) VALUES ($1, $2, $3, $4)")
            .bind(session.id.to_string())
            .bind(session.key.to_string())
            .bind(session.secret.as_slice())
            .bind(session.expires_at.as_millisecond())
            .execute(&mut *tx)
            .await?;
        tx.commit().await
    }

    async fn session(&self, id: SessionId) -> Result<Option<NewSession>, DatabaseError> {
        let row: Option<SessionRow> = sqlx::query_as("SELECT key_id, secret, expires_at FROM session WHERE id = $1")
            .bind(id.to_string())
            .fetch_optional(&self.readers)
            .await?;
        let Some(row) = row else { return Ok(None) };
        Ok(Some(NewSession {
            id,
            key: stored_id!(KeyId, &row.key_id)?,
            secret: hash(row.secret)?,
            expires_at: timestamp(row.expires_at)?,
        }))
    }

    async fn delete_session(&self, id: SessionId) -> Result<(), DatabaseError> {
        let delete = || async {
            let mut tx = self.begin_any().await?;
            sqlx::query("DELETE FROM session WHERE id = $1").bind(id.to_string()).execute(&mut *tx).await?;
            tx.commit().await
        };
        self.with_reserve(delete).await
    }

    async fn forget_old_sessions(&self) -> Result<u64, DatabaseError> {
        let mut tx = self.begin_any().await?;
        let delete = "DELETE FROM session WHERE expires_at <= $1";
        let done = sqlx::query(delete).bind(tx.now_ms()).execute(&mut *tx).await?;
        tx.commit().await?;
        Ok(done.rows_affected())
    }
}
