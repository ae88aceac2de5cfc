//! Who asks: keys are made and revoked, and what a request shows is held against them.
//!
//! - `token`: what a key or a session is to its owner, and how it is checked

mod token;

use jiff::{SignedDuration, Timestamp};

use crate::storage::{Database, DatabaseError};
use visage_domain::{KeyId, KeyRecord, NewKey, NewSession, Scope, SessionId};

pub use token::{NoRandomness, NoToken, Token};

/// Keys that may be valid at a time.
pub const MOST_KEYS: usize = 1000;
/// How long a browser stays signed in.
pub const SESSION: SignedDuration = SignedDuration::from_hours(12);

/// Why a key or session could not be made.
#[derive(Debug, thiserror::Error)]
pub enum AccessError {
    /// The database.
    #[error(transparent)]
    Database(#[from] DatabaseError),
    /// The system.
    #[error(transparent)]
    Randomness(#[from] NoRandomness),
}

/// What a request shows of who it is from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shown {
    /// A key, as `Authorization: Bearer`.
    Key(Token),
    /// A session, as a cookie.
    Session(Token),
}

/// Makes a key; its token is told this once.
pub async fn create_key(
    database: &dyn Database,
    name: String,
    scope: Scope,
    expires_at: Option<Timestamp>,
) -> Result<(KeyRecord, Token), AccessError> {
    let id = KeyId::new();
    let token = Token::new(id.number())?;
    database.create_key(&NewKey { id, name: name.clone(), scope, secret: token.hash(), expires_at }, MOST_KEYS).await?;
    Ok((KeyRecord { id, name, scope, expires_at, revoked_at: None }, token))
}

/// Whose key or session is shown; `None` if it is none that is valid now.
pub async fn identify(
    database: &dyn Database,
    shown: Shown,
    now: Timestamp,
) -> Result<Option<KeyRecord>, DatabaseError> {
    let key = match shown {
        Shown::Key(token) => {
            let found = database.key(KeyId::from_number(token.id())).await?;
            found.filter(|(_, secret)| token.is_of(secret)).map(|(key, _)| key)
        }
        Shown::Session(token) => {
            let session = database.session(SessionId::from_number(token.id())).await?;
            match session.filter(|session| token.is_of(&session.secret) && now < session.expires_at) {
                Some(session) => database.key(session.key).await?.map(|(key, _)| key),
                None => None,
            }
        }
    };
    Ok(key.filter(|key| key.is_valid(now)))
}

/// Begins a session of who has shown a key; it ends with the key at the latest. Its token is told this once.
pub async fn sign_in(
    database: &dyn Database,
    key: &KeyRecord,
    now: Timestamp,
) -> Result<(Token, Timestamp), AccessError> {
    let id = SessionId::new();
    let token = Token::new(id.number())?;
    let end = now.saturating_add(SESSION).unwrap_or(now);
    let expires_at = key.expires_at.map_or(end, |last| last.min(end));
    database.create_session(&NewSession { id, key: key.id, secret: token.hash(), expires_at }).await?;
    Ok((token, expires_at))
}

/// Ends a session, if the token is of one.
pub async fn sign_out(database: &dyn Database, token: Token) -> Result<(), DatabaseError> {
    let id = SessionId::from_number(token.id());
    match database.session(id).await? {
        Some(session) if token.is_of(&session.secret) => database.delete_session(id).await,
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::super::context::testing::context;
    use super::*;

    fn later(now: Timestamp, hours: i64) -> Timestamp {
        now + SignedDuration::from_hours(hours)
    }

    #[tokio::test]
    async fn a_key_is_known_by_its_secret_until_it_is_revoked() {
        let (context, _place) = context().await;
        let db = context.database.as_ref();
        assert!(!db.has_keys().await.expect("asked"));
        let now = Timestamp::now();
        let (key, token) = create_key(db, "scanner".into(), Scope::Write, None).await.expect("made");
        let (_, other) = create_key(db, "other".into(), Scope::Read, None).await.expect("made");
        let who = async |shown| identify(db, shown, now).await.expect("asked");
        assert_eq!(who(Shown::Key(token)).await, Some(key.clone()));
        // the id of one with the secret of the other, and a key where a session is meant
        let mixed: Token = Token::new(token.id()).expect("random");
        assert_eq!(who(Shown::Key(mixed)).await, None);
        assert_eq!(who(Shown::Session(token)).await, None);
        db.revoke_key(key.id).await.expect("revoked");
        assert_eq!(who(Shown::Key(token)).await, None);
        assert!(who(Shown::Key(other)).await.is_some());
        assert!(db.has_keys().await.expect("asked"), "a revoked key is no reason to let everybody in");
    }

    #[tokio::test]
    async fn a_session_ends_with_its_key_its_time_or_when_it_is_told() {
        let (context, _place) = context().await;
        let db = context.database.as_ref();
        let now = Timestamp::now();
        let (key, _) = create_key(db, "page".into(), Scope::Read, Some(later(now, 1))).await.expect("made");
        let (token, end) = sign_in(db, &key, now).await.expect("signed in");
        assert_eq!(end.as_millisecond(), later(now, 1).as_millisecond(), "not longer than the key");
        let known = async |token, time| identify(db, Shown::Session(token), time).await.expect("asked").is_some();
        assert!(known(token, now).await);
        assert!(!known(token, later(now, 2)).await);
        sign_out(db, token).await.expect("ended");
        assert!(!known(token, now).await);
        let (again, _) = sign_in(db, &key, now).await.expect("signed in");
        assert!(known(again, now).await);
        db.revoke_key(key.id).await.expect("revoked");
        assert!(!known(again, now).await);
    }

    #[tokio::test]
    async fn there_are_not_more_keys_than_are_kept() {
        let (context, _place) = context().await;
        let db = context.database.as_ref();
        let key = |limit| {
            let token = Token::new(KeyId::new().number()).expect("random");
            let id = KeyId::from_number(token.id());
            let key = NewKey { id, name: "k".into(), scope: Scope::Read, secret: token.hash(), expires_at: None };
            async move { db.create_key(&key, limit).await.map(|()| id) }
        };
        let first = key(1).await.expect("made");
        assert!(matches!(key(1).await, Err(DatabaseError::TooManyKeys { limit: 1 })));
        db.revoke_key(first).await.expect("revoked");
        key(1).await.expect("there is room again");
    }
}
