//! The audit log: who did what to what.

use super::{AuditId, KeyId};

/// A request that changed something, or was refused for want of a right.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AuditEntry {
    /// Its id, which holds the time.
    pub id: AuditId,
    /// The key that was shown; `None` for who needed none or had none.
    pub key: Option<KeyId>,
    /// From where it came, as far as that is known.
    pub client: Option<String>,
    /// The id of the request, as in the log.
    pub request: String,
    /// The method.
    pub method: String,
    /// The path as the contract writes it: `/v1/models/{id}`.
    pub route: String,
    /// The id or name of what it was done to.
    pub target: Option<String>,
    /// The status of the answer.
    pub status: u16,
}

impl AuditEntry {
    /// The id of what the request has made, if it has made something that is kept.
    pub fn made(&self) -> Option<&str> {
        let has_no_files = ["/v1/keys", "/v1/webhooks"].contains(&self.route.as_str());
        let is_kept = self.method == "POST" && matches!(self.status, 201 | 202) && !has_no_files;
        // a job that is stopped or tried again was made before
        self.target.as_deref().filter(|_| is_kept && !self.route.contains('{'))
    }
}

/// Which entries are asked for.
#[derive(Debug, Clone, Default)]
pub struct AuditFilter {
    /// Those of what has this id or name.
    pub target: Option<String>,
    /// Those of this key.
    pub key: Option<KeyId>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_made_is_told_from_what_is_done_to_it() {
        let entry = |method: &str, route: &str, status| AuditEntry {
            id: AuditId::new(),
            key: None,
            client: None,
            request: String::new(),
            method: method.to_owned(),
            route: route.to_owned(),
            target: Some("x".to_owned()),
            status,
        };
        assert_eq!(entry("POST", "/v1/models", 201).made(), Some("x"));
        assert_eq!(entry("POST", "/v1/jobs", 202).made(), Some("x"));
        for (method, route, status) in [
            ("POST", "/v1/models", 422),
            ("POST", "/v1/jobs/{id}/cancel", 202),
            ("POST", "/v1/keys", 201),
            ("PUT", "/v1/scan-sets/{id}/scans/{name}", 201),
            ("DELETE", "/v1/models/{id}", 204),
        ] {
            assert_eq!(entry(method, route, status).made(), None, "{method} {route} {status}");
        }
    }
}
