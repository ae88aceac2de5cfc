//! What a request needs to be allowed: the one table of it. The contract tells the same (`contract`).
//!
//! What is kept lies under `/v1`. There whoever only looks needs `read`, and everything else needs `write`, unless a
//! line of the table says otherwise: a new resource is closed without anybody thinking of it.

use axum::http::Method;
use visage_domain::Scope;

/// What a request needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Need {
    /// Nothing: it tells nothing of what is kept.
    Nothing,
    /// A key of this scope, or of one that includes it.
    Scope(Scope),
}

/// Where the usual rule does not hold.
const TABLE: &[(&str, &str, Need)] = &[
    // a question changes nothing, though it is sent as a body
    ("POST", "/v1/queries", Need::Scope(Scope::Read)),
    ("POST", "/v1/queries/probe", Need::Scope(Scope::Read)),
    // whoever has a key may sign in; who one is and signing out are for everybody
    ("POST", "/v1/session", Need::Scope(Scope::Metrics)),
    ("GET", "/v1/session", Need::Nothing),
    ("DELETE", "/v1/session", Need::Nothing),
    ("GET", "/v1/keys", Need::Scope(Scope::Admin)),
    ("POST", "/v1/keys", Need::Scope(Scope::Admin)),
    ("DELETE", "/v1/keys/{id}", Need::Scope(Scope::Admin)),
    ("GET", "/v1/audit", Need::Scope(Scope::Admin)),
    // whoever makes the service tell others of everything is its operator
    ("GET", "/v1/webhooks", Need::Scope(Scope::Admin)),
    ("POST", "/v1/webhooks", Need::Scope(Scope::Admin)),
    ("GET", "/v1/webhooks/{id}", Need::Scope(Scope::Admin)),
    ("DELETE", "/v1/webhooks/{id}", Need::Scope(Scope::Admin)),
    ("POST", "/v1/webhooks/{id}/ping", Need::Scope(Scope::Admin)),
    ("GET", "/v1/webhooks/{id}/deliveries", Need::Scope(Scope::Admin)),
    ("POST", "/v1/webhooks/{id}/replay", Need::Scope(Scope::Admin)),
    ("POST", "/v1/webhooks/{id}/deliveries/{delivery_id}/replay", Need::Scope(Scope::Admin)),
    ("GET", "/metrics", Need::Scope(Scope::Metrics)),
];

/// What a request of this method needs at this place: a path as the contract writes it, or as it was sent if there is
/// nothing.
pub fn of(method: &Method, path: &str) -> Need {
    let method = if method == Method::HEAD { &Method::GET } else { method };
    let line = TABLE.iter().find(|(of, at, _)| *of == method.as_str() && *at == path);
    if let Some((_, _, need)) = line {
        return *need;
    }
    let is_kept = path.strip_prefix("/v1").is_some_and(|rest| rest.is_empty() || rest.starts_with('/'));
    match method.as_str() {
        // signs of life, the contract, the files of a page
        "GET" | "OPTIONS" if !is_kept => Need::Nothing,
        "GET" | "OPTIONS" => Need::Scope(Scope::Read),
        _ => Need::Scope(Scope::Write),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::router::contract;

    #[test]
    fn what_is_kept_is_closed_and_changes_need_more_than_looking() {
        let need = |method: &str, path: &str| of(&Method::from_bytes(method.as_bytes()).expect("a method"), path);
        for (method, path, scope) in [
            ("GET", "/v1/models", Scope::Read),
            ("HEAD", "/v1/models/{id}/cloud", Scope::Read),
            ("GET", "/v1/some/day", Scope::Read),
            ("GET", "/v1", Scope::Read),
            ("DELETE", "/v1/models/{id}", Scope::Write),
            ("PATCH", "/v1/some/day", Scope::Write),
            ("TRACE", "/v1/models", Scope::Write),
            ("POST", "/healthz", Scope::Write),
            ("HEAD", "/v1/keys", Scope::Admin),
            ("GET", "/metrics", Scope::Metrics),
        ] {
            assert_eq!(need(method, path), Need::Scope(scope), "{method} {path}");
        }
        for path in ["/healthz", "/openapi.yaml", "/", "/v1something"] {
            assert_eq!(need("GET", path), Need::Nothing, "{path}");
        }
    }

    #[test]
    fn the_table_names_what_there_is() {
        let contract = serde_json::to_value(contract()).expect("plain data");
        for (method, path, _) in TABLE {
            let operation = &contract["paths"][path][method.to_ascii_lowercase()];
            assert!(operation.is_object(), "there is no {method} {path}");
        }
    }
}
