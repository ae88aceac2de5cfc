//! Keys: who may ask the service, and for what.

use jiff::Timestamp;
use visage_geometry::names::UnknownName;

use super::{KeyId, SessionId};

/// What a key allows. Each scope includes those before it.
#[derive(
    Debug,
    Clone,
    Copy,
    PartialEq,
    Eq,
    PartialOrd,
    Ord,
    Hash,
    serde::Serialize,
    serde::Deserialize,
    utoipa::ToSchema,
    strum::VariantArray,
    strum::IntoStaticStr,
    strum::EnumString,
    strum::Display,
)]
#[serde(rename_all = "lowercase")]
#[strum(serialize_all = "lowercase", parse_err_ty = UnknownName, parse_err_fn = no_scope)]
pub enum Scope {
    /// Figures about the service, and nothing of what it keeps.
    Metrics,
    /// What is kept, and questions about it.
    Read,
    /// Uploads, jobs, deletions.
    Write,
    /// Keys and the audit log.
    Admin,
}

impl Scope {
    /// All of them, least first.
    pub const ALL: &[Scope] = <Scope as strum::VariantArray>::VARIANTS;

    /// As it is written.
    pub fn name(self) -> &'static str {
        self.into()
    }
}

fn no_scope(text: &str) -> UnknownName {
    UnknownName::of::<Scope>("scope", text)
}

/// BLAKE3 of the secret part of a key or session: what is stored in its place. The secret is 256 random bits, so
/// nothing slower is needed against guessing.
pub type SecretHash = [u8; 32];

/// A key that is to be stored.
#[derive(Debug, Clone)]
pub struct NewKey {
    /// Its id.
    pub id: KeyId,
    /// What it is for, in the words of who made it.
    pub name: String,
    /// What it allows.
    pub scope: Scope,
    /// The hash of its secret.
    pub secret: SecretHash,
    /// From when on it is not taken any more.
    pub expires_at: Option<Timestamp>,
}

/// A key as it is shown: without its secret, which nobody has but its owner.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct KeyRecord {
    /// Its id.
    pub id: KeyId,
    /// What it is for.
    pub name: String,
    /// What it allows.
    pub scope: Scope,
    /// From when on it is not taken any more.
    pub expires_at: Option<Timestamp>,
    /// Since when it is revoked.
    pub revoked_at: Option<Timestamp>,
}

impl KeyRecord {
    /// Whether it is taken at this time.
    pub fn is_valid(&self, now: Timestamp) -> bool {
        self.revoked_at.is_none() && self.expires_at.is_none_or(|end| now < end)
    }
}

/// A session that is to be stored: a browser that has shown a key.
#[derive(Debug, Clone)]
pub struct NewSession {
    /// Its id.
    pub id: SessionId,
    /// The key that was shown: the session allows what that does, for as long as that does.
    pub key: KeyId,
    /// The hash of its secret.
    pub secret: SecretHash,
    /// From when on it is not taken any more.
    pub expires_at: Timestamp,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scopes_include_those_before_them_and_are_read_as_they_are_written() {
        assert!(Scope::ALL.is_sorted());
        for &scope in Scope::ALL {
            assert_eq!(scope.name().parse(), Ok(scope));
        }
        assert!("root".parse::<Scope>().is_err_and(|error| error.to_string().contains("admin")));
    }

    #[test]
    fn a_key_is_valid_until_it_is_revoked_or_expires() {
        let now = Timestamp::UNIX_EPOCH;
        let later = now + jiff::SignedDuration::from_secs(1);
        let key = KeyRecord {
            id: KeyId::new(),
            name: "k".into(),
            scope: Scope::Read,
            expires_at: Some(later),
            revoked_at: None,
        };
        assert!(key.is_valid(now));
        assert!(!key.is_valid(later));
        assert!(!KeyRecord { revoked_at: Some(now), ..key }.is_valid(now));
    }
}
