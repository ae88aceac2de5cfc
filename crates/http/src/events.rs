//! `/v1/jobs/{id}/events`: the progress of a job as server-sent events.

use std::convert::Infallible;
use std::time::{Duration, Instant};

use axum::extract::State;
use axum::http::HeaderMap;
use axum::response::sse::{Event, KeepAlive, Sse};
use bytes::Bytes;
use futures_util::Stream;
use tokio::sync::watch;

use super::extract::Path;
use super::jobs::{TAG, look_at, parse_id, shown};
use super::problem::Problem;
use super::responses;
use super::state::AppState;
use super::{access, base};
use visage_domain::JobId;
use visage_service::app::access::Shown;

/// The least time between two events.
const PACE: Duration = Duration::from_millis(200);
/// How often a job that reports nothing is looked at all the same.
const LOOK: Duration = Duration::from_secs(5);
/// How often at most it is looked whether the key or session is still valid.
const CHECK: Duration = Duration::from_secs(1);

/// Follow a job by server-sent events.
///
/// One `progress` event at once and one whenever something changes (at most five a second), each with the job as
/// `GET /v1/jobs/{id}` gives it; then one `end` event, after which the stream ends. It also ends when the server
/// shuts down, the job is deleted, or the key or session by which it was begun is not valid any more: connect again to
/// see which.
#[utoipa::path(
    get, path = "/v1/jobs/{id}/events", tag = TAG, operation_id = "followJob",
    params(("id" = String, Path, format = "uuid", description = "The job.")),
    responses(responses::Events, responses::NotFound, responses::Other)
)]
pub async fn events(
    State(state): State<AppState>,
    Path(id): Path<String>,
    headers: HeaderMap,
) -> Result<Sse<impl Stream<Item = Result<Event, Infallible>>>, Problem> {
    let id = parse_id(&id)?;
    let changes = state.context.monitor.changes();
    // a job that is not there is a 404, not an empty stream
    look_at(&state, id).await?;
    // what can't be read is nothing: it was let through without
    let by = access::shown(&headers).unwrap_or_default();
    let follower = Follower { state, id, by, checked: Instant::now(), changes, last: None, ended: false };
    let base = base::current();
    let stream = futures_util::stream::unfold(follower, move |mut follower| {
        // addresses in events are those of the request
        let next = base::within(base.clone(), async move { Some((follower.next().await?, follower)) });
        async move { next.await.map(|(event, follower)| (Ok(event), follower)) }
    });
    Ok(Sse::new(stream).keep_alive(KeepAlive::default()))
}

struct Follower {
    state: AppState,
    id: JobId,
    /// By what it was begun.
    by: Option<Shown>,
    /// When that was last seen to be valid.
    checked: Instant,
    changes: watch::Receiver<u64>,
    last: Option<Bytes>,
    ended: bool,
}

impl Follower {
    /// The next event; `None` ends the stream.
    async fn next(&mut self) -> Option<Event> {
        while !self.ended {
            if self.last.is_some() && !(self.wait().await && self.may_go_on().await) {
                return None;
            }
            // seen as of now: what changes during the look rings again
            self.changes.mark_unchanged();
            let look = look_at(&self.state, self.id).await.ok()?;
            let data = shown(&look).ok()?;
            self.ended = look.job().status.is_finished();
            if self.last.as_ref() != Some(&data) || self.ended {
                let event = Event::default().event(if self.ended { "end" } else { "progress" });
                let event = event.data(std::str::from_utf8(&data).ok()?);
                self.last = Some(data);
                return Some(event);
            }
        }
        None
    }

    /// Whether whoever follows may still look: a key can be revoked, and a session end, while a job runs.
    async fn may_go_on(&mut self) -> bool {
        if self.checked.elapsed() < CHECK {
            return true;
        }
        self.checked = Instant::now();
        access::may_still(&self.state, self.by).await
    }

    /// Waits for news; false when the stream has to end.
    async fn wait(&mut self) -> bool {
        let stop = self.state.stop.clone();
        let changes = &mut self.changes;
        let news = async {
            tokio::time::sleep(PACE).await;
            // an error would mean that the monitor is gone, and the state holds it
            let _ = tokio::time::timeout(LOOK, changes.changed()).await;
        };
        tokio::select! {
            () = stop.cancelled() => false,
            () = news => true,
        }
    }
}
