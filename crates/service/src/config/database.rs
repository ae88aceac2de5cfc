//! Where the database is when not in the data folder: on a PostgreSQL server.

use std::convert::Infallible;
use std::fmt;
use std::str::FromStr;

/// The address of a database, such as `postgres://user@host/name`. It may hold a password, so it is only ever shown masked.
#[derive(Clone, PartialEq, Eq)]
pub struct DatabaseUrl(String);

impl DatabaseUrl {
    /// With the password, for whoever opens the database.
    pub fn secret(&self) -> &str {
        &self.0
    }

    /// An address as it may be shown.
    pub fn masked(text: &str) -> String {
        DatabaseUrl(text.to_owned()).to_string()
    }

    /// Whether it names a database of PostgreSQL.
    pub fn is_postgres(&self) -> bool {
        ["postgres://", "postgresql://"].iter().any(|scheme| self.0.starts_with(scheme))
    }
}

/// Any text is taken: a complaint about an argument would show it, and the password with it.
impl FromStr for DatabaseUrl {
    type Err = Infallible;

    fn from_str(text: &str) -> Result<Self, Infallible> {
        Ok(DatabaseUrl(text.to_owned()))
    }
}

/// Without the password, and without what stands behind a question mark, which may hold one too.
impl fmt::Display for DatabaseUrl {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let address = self.0.split(['?', '#']).next().unwrap_or_default();
        let Some((scheme, rest)) = address.split_once("://") else { return f.write_str("(no address)") };
        match rest.rsplit_once('@') {
            None => write!(f, "{scheme}://{rest}"),
            Some((who, place)) => write!(f, "{scheme}://{}@{place}", who.split(':').next().unwrap_or_default()),
        }
    }
}

impl fmt::Debug for DatabaseUrl {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "DatabaseUrl({self})")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_password_is_never_shown() {
        for (text, shown) in [
            ("postgres://visage:geheim@db.example:5433/visage", "postgres://visage@db.example:5433/visage"),
            ("postgres://visage:ge@h:eim@db/visage?password=geheim", "postgres://visage@db/visage"),
            ("postgresql:///visage?host=/run/postgresql", "postgresql:///visage"),
            ("visage:geheim@db", "(no address)"),
        ] {
            let url: DatabaseUrl = text.parse().unwrap_or_else(|never| match never {});
            assert_eq!((url.to_string(), format!("{url:?}")), (shown.to_owned(), format!("DatabaseUrl({shown})")));
            assert_eq!(url.secret(), text);
        }
    }
}
