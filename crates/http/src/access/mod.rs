//! Who may: each request is held against what it needs before anything else looks at it.
//!
//! - `needs`: what each route needs, one table
//! - `credentials`: what a request shows: a key, or the session of a browser
//! - `contract`: the same in the contract
//! - `quotas`: how much a key may ask for; `audit`: what was done is written down

mod audit;
mod contract;
mod credentials;
mod needs;
mod quotas;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use axum::extract::{MatchedPath, Request, State};
use axum::http::header::{self, HeaderValue};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};

use super::forwarded::Client;
use super::problem::{Code, Problem};
use super::state::AppState;
use visage_domain::{KeyRecord, Scope};
use visage_service::app::access::{self, Shown};
use visage_service::app::shared_reads::SharedReads;
use visage_service::storage::{Database, DatabaseError};

pub use contract::tell;
use credentials::Unreadable;
pub use credentials::{SESSION_COOKIE, session_of, shown};
pub use needs::Need;
pub use quotas::Usage;

/// Who has sent a request.
#[derive(Debug, Clone, Default)]
pub struct Caller {
    /// The key that was shown, directly or by a session.
    pub key: Option<KeyRecord>,
    /// What may be done with the request; `None` for nothing but what is for everybody.
    pub scope: Option<Scope>,
}

/// Whether those without a key may do everything.
#[derive(Debug, Clone)]
pub struct Anonymous {
    /// The operator has said so, or nobody else reaches the service.
    may_be: bool,
    /// It stays so, whatever keys there are.
    is_open: bool,
    /// There was a key once; this never becomes untrue again.
    has_keys: Arc<AtomicBool>,
    /// Each request asks whether there is a key by now: those that come at once ask together.
    looking: Arc<SharedReads<(), bool>>,
}

impl Anonymous {
    /// By whether the operator said that everybody may, and whether others than programs of this machine reach it.
    pub fn new(is_open: bool, is_exposed: bool) -> Anonymous {
        Anonymous { may_be: is_open || !is_exposed, is_open, has_keys: Arc::default(), looking: Arc::default() }
    }

    async fn is_allowed(&self, database: &Arc<dyn Database>) -> Result<bool, DatabaseError> {
        if self.is_open || !self.may_be {
            return Ok(self.may_be);
        }
        // keys are made by other processes too
        let look = || {
            let database = database.clone();
            async move { database.has_keys().await }
        };
        if !self.has_keys.load(Ordering::Relaxed) && *self.looking.get((), look).await? {
            self.has_keys.store(true, Ordering::Relaxed);
        }
        Ok(!self.has_keys.load(Ordering::Relaxed))
    }
}

/// The place of a request as the contract writes it, or its path if there is nothing there.
pub fn place(request: &Request) -> &str {
    request.extensions().get::<MatchedPath>().map_or_else(|| request.uri().path(), MatchedPath::as_str)
}

/// Lets through what may be done, says to handlers for whom, and writes down what was.
pub async fn permitted(State(state): State<AppState>, mut request: Request, next: Next) -> Response {
    let need = needs::of(request.method(), place(&request));
    let shown = credentials::shown(request.headers());
    let (caller, refusal) = match caller(&state, shown, need).await {
        Ok(caller) => (caller, None),
        Err((problem, caller)) => (caller, Some(problem)),
    };
    let is_allowed = refusal.is_none();
    let admitted = match refusal {
        Some(problem) => Err(problem),
        None if need == Need::Nothing => Ok(None),
        None => {
            let size = quotas::Size::of(&request, place(&request));
            let config = &state.context.config.quotas;
            let who = quotas::Who::of(&caller, Client::of(&request));
            quotas::admitted(config, &state.usage, state.context.database.as_ref(), who, size).await
        }
    };
    // what is beyond a quota was allowed but not done, and may come by the thousand
    let is_noted = admitted.is_ok() || !is_allowed;
    let pending = if is_noted { audit::Pending::of(&state, &request, need, &caller) } else { None };
    let response = match admitted {
        Ok(_uploading) => {
            request.extensions_mut().insert(caller);
            next.run(request).await
        }
        Err(problem) => problem.into_response(),
    };
    if let Some(pending) = pending {
        pending.answered(response.status(), response.headers().get(header::LOCATION).cloned()).await;
    }
    response
}

async fn caller(
    state: &AppState,
    shown: Result<Option<Shown>, Unreadable>,
    need: Need,
) -> Result<Caller, (Problem, Caller)> {
    let nobody = |problem| (problem, Caller::default());
    let shown = match shown {
        Ok(shown) => shown,
        // signs of life do not depend on what else is sent along
        Err(_) if need == Need::Nothing => None,
        Err(error) => return Err(nobody(unknown(&error.to_string()))),
    };
    let database = state.context.database.as_ref();
    let identified = async {
        let key = match shown {
            Some(shown) => access::identify(database, shown, jiff::Timestamp::now()).await?,
            None => None,
        };
        let is_refused = key.is_none() && matches!(shown, Some(Shown::Key(_)));
        // whoever shows a wrong key has to learn it, and is nobody meanwhile
        let all = !is_refused && key.is_none() && state.anonymous.is_allowed(&state.context.database).await?;
        let scope = key.as_ref().map(|key| key.scope).or(all.then_some(Scope::Admin));
        Ok((Caller { key, scope }, is_refused))
    };
    let Need::Scope(needed) = need else {
        // a database that is busy must not make a living server look dead
        return Ok(identified.await.map(|(caller, _)| caller).unwrap_or_else(|_: DatabaseError| Caller::default()));
    };
    let (caller, is_refused) = identified.await.map_err(|error: DatabaseError| nobody(error.into()))?;
    match caller.scope {
        Some(scope) if scope >= needed => Ok(caller),
        Some(scope) => Err((too_little(needed, scope), caller)),
        None if is_refused => Err((unknown("the key is not known, has expired or was revoked"), caller)),
        None if shown.is_some() => Err((unknown("the session is over"), caller)),
        None => Err((missing(), caller)),
    }
}

/// Whether who has begun something with this may go on with it; when that can't be found out, nobody may.
pub async fn may_still(state: &AppState, shown: Option<Shown>) -> bool {
    let database = state.context.database.as_ref();
    let identified = async {
        if let Some(shown) = shown {
            let is_known = access::identify(database, shown, jiff::Timestamp::now()).await?.is_some();
            if is_known || matches!(shown, Shown::Key(_)) {
                return Ok(is_known);
            }
        }
        state.anonymous.is_allowed(&state.context.database).await
    };
    identified.await.unwrap_or(false)
}

fn missing() -> Problem {
    let hint = "send a key as `Authorization: Bearer KEY`, or sign in with one (POST /v1/session); the operator makes keys \
                with `visage key create`";
    Problem::new(Code::Unauthorized, "the request needs a key", hint)
        .header(header::WWW_AUTHENTICATE, HeaderValue::from_static("Bearer realm=\"visage\""))
}

fn unknown(detail: &str) -> Problem {
    Problem::new(
        Code::Unauthorized,
        detail,
        "send a key that is valid; the operator makes keys with `visage key create`",
    )
    .header(header::WWW_AUTHENTICATE, HeaderValue::from_static("Bearer realm=\"visage\", error=\"invalid_token\""))
}

fn too_little(needed: Scope, given: Scope) -> Problem {
    let detail = format!("the request needs a key of scope {needed}, this one has {given}");
    let challenge = format!("Bearer realm=\"visage\", error=\"insufficient_scope\", scope=\"{needed}\"");
    let problem = Problem::new(Code::InsufficientScope, detail, "ask the operator for a key with more rights");
    match HeaderValue::try_from(challenge) {
        Ok(challenge) => problem.header(header::WWW_AUTHENTICATE, challenge),
        Err(_) => problem,
    }
}
