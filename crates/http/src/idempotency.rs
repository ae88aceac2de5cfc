//! Repeated POSTs: the same key with the same body gets the same answer, and nothing is done twice.

use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};

use super::problem::Problem;
use super::state::{AppState, Occupied};
use visage_domain::{Replay, ReplayKey};

/// The answer to a POST that created something.
#[derive(Debug, Clone)]
pub struct Created {
    status: StatusCode,
    location: String,
    body: String,
    retry_after: Option<u64>,
    replayed: bool,
}

impl Created {
    /// An answer with `body` as JSON.
    pub fn new(status: StatusCode, location: String, body: &impl serde::Serialize) -> Result<Self, Problem> {
        let body = serde_json::to_string(body).map_err(Problem::internal)?;
        Ok(Created { status, location, body, retry_after: None, replayed: false })
    }

    /// Says when to look again.
    pub fn retry_after(mut self, seconds: u64) -> Self {
        self.retry_after = Some(seconds);
        self
    }

    /// What is kept of it for a repeated request.
    pub fn replay(&self, key: &ReplayKey, resource_id: String) -> Replay {
        Replay {
            key: key.clone(),
            status: self.status.as_u16(),
            location: self.location.clone(),
            body: self.body.clone(),
            resource_id,
        }
    }
}

impl IntoResponse for Created {
    fn into_response(self) -> Response {
        let mut response = (self.status, self.body).into_response();
        let headers = response.headers_mut();
        headers.insert(header::CONTENT_TYPE, HeaderValue::from_static("application/json"));
        if let Ok(location) = HeaderValue::try_from(self.location) {
            headers.insert(header::LOCATION, location);
        }
        if let Some(seconds) = self.retry_after {
            headers.insert(header::RETRY_AFTER, seconds.into());
        }
        if self.replayed {
            headers.insert("idempotent-replayed", HeaderValue::from_static("true"));
        }
        response
    }
}

/// One POST and its key, if it has one.
pub struct Attempt {
    occupied: Option<Occupied>,
    key: Option<ReplayKey>,
}

impl Attempt {
    /// Before the body is read: refuses a request whose twin is being worked on.
    pub fn begin(state: &AppState, route: &'static str, key: Option<&str>) -> Result<Self, Problem> {
        let occupied = key.map(|key| state.occupy(route, key)).transpose()?;
        Ok(Attempt { occupied, key: None })
    }

    /// Once the body is known: the answer that was given before, if it was.
    pub async fn known(
        &mut self,
        state: &AppState,
        body_hash: impl FnOnce() -> String,
    ) -> Result<Option<Created>, Problem> {
        let Some(occupied) = &self.occupied else { return Ok(None) };
        let key = occupied.replay_key(body_hash());
        let replay = state.context.database.replay(&key).await?;
        self.key = Some(key);
        let Some(replay) = replay else { return Ok(None) };
        let status = StatusCode::from_u16(replay.status).map_err(Problem::internal)?;
        Ok(Some(Created { status, location: replay.location, body: replay.body, retry_after: None, replayed: true }))
    }

    /// What is to be kept with the created resource.
    pub fn replay(&self, created: &Created, resource_id: String) -> Option<Replay> {
        self.key.as_ref().map(|key| created.replay(key, resource_id))
    }
}
