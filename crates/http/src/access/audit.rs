//! What was done, and by whom: a line of the audit log for each request that changes something.

use axum::extract::Request;
use axum::http::{HeaderValue, Method, StatusCode};

use super::{Caller, Need, place};
use crate::forwarded::Client;
use crate::state::AppState;
use visage_domain::{AuditEntry, AuditId, Scope};

/// The status of a request whose client left before the answer: what it asked for may have been done.
const LEFT: u16 = 499;

/// An entry that is to be written when the status is known; when the client leaves before, that is written.
pub struct Pending {
    state: AppState,
    entry: Option<AuditEntry>,
}

impl Pending {
    /// For a request that changes something; `None` for one that only looks.
    pub fn of(state: &AppState, request: &Request, need: Need, caller: &Caller) -> Option<Pending> {
        let changes = matches!(need, Need::Scope(scope) if scope >= Scope::Write) || place(request) == "/v1/session";
        // what strangers are refused is in the log of requests; it must not fill this one
        if caller.scope.is_none() || !changes || request.method() == Method::GET || request.method() == Method::HEAD {
            return None;
        }
        let id = request.headers().get("x-request-id").and_then(|id| id.to_str().ok()).unwrap_or_default();
        let entry = AuditEntry {
            id: AuditId::new(),
            key: caller.key.as_ref().map(|key| key.id),
            client: Client::of(request).map(|client| client.address.to_string()),
            request: id.to_owned(),
            method: request.method().as_str().to_owned(),
            route: place(request).chars().take(200).collect(),
            target: named(place(request), request.uri().path()),
            status: LEFT,
        };
        Some(Pending { state: state.clone(), entry: Some(entry) })
    }

    /// Writes the entry. An answer is not held back when that fails: what it tells has been done. Nor is one that tells of a
    /// failure of the service, such as a locked database, in which this would wait once more.
    pub async fn answered(mut self, status: StatusCode, location: Option<HeaderValue>) {
        let Some(mut entry) = self.entry.take() else { return };
        entry.status = status.as_u16();
        if entry.target.is_none() {
            // what was made
            let location = location.as_ref().and_then(|value| value.to_str().ok());
            entry.target = location.and_then(|path| path.rsplit('/').next()).map(str::to_owned);
        }
        if status.is_server_error() {
            self.entry = Some(entry);
            return;
        }
        write(&self.state, &entry).await;
    }
}

impl Drop for Pending {
    fn drop(&mut self) {
        if let (Some(entry), Ok(runtime)) = (self.entry.take(), tokio::runtime::Handle::try_current()) {
            let state = self.state.clone();
            runtime.spawn(async move { write(&state, &entry).await });
        }
    }
}

async fn write(state: &AppState, entry: &AuditEntry) {
    if let Err(error) = state.context.database.record(entry).await {
        tracing::error!(
            method = entry.method,
            route = entry.route,
            status = entry.status,
            "not in the audit log: {error}"
        );
    }
}

/// What the first parameter of a path stands for.
fn named(template: &str, path: &str) -> Option<String> {
    let mut parts = template.split('/').zip(path.split('/'));
    let (_, value) = parts.find(|(part, _)| part.starts_with('{'))?;
    Some(value.chars().take(200).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_target_is_what_the_path_names_first() {
        assert_eq!(named("/v1/models/{id}", "/v1/models/x").as_deref(), Some("x"));
        assert_eq!(named("/v1/scan-sets/{id}/scans/{name}", "/v1/scan-sets/x/scans/a.ply").as_deref(), Some("x"));
        assert_eq!(named("/v1/models", "/v1/models"), None);
    }
}
