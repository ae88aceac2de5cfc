//! Parts of the gallery are searched for other servers of the same database: `POST /internal/search`. It is none of the contract: what is sent
//! and answered is between servers of one version, and nobody else has the secret.

use axum::Router;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, header};
use axum::middleware::from_fn_with_state;
use axum::routing::post;

use super::body::{self, read_body};
use super::problem::{Code, Problem};
use super::state::AppState;
use visage_domain::NodeSecret;
use visage_service::app::live_gallery::NotReady;
use visage_service::app::queries::QueryError;
use visage_service::app::search::Elsewhere;
use visage_service::app::search::answering::{self, AnsweringError};

/// Where others ask.
pub const PATH: &str = "/internal/search";
/// The most of a question: a signature as large as they may be has 0.7 MB in base 64, and a body of a query is smaller.
const MOST_BYTES: usize = 2 << 20;

/// The route, for a server that searches. Who may ask is decided by the secret alone: names, keys and origins are for clients.
pub fn router(state: &AppState) -> Router {
    let router = Router::new().route(PATH, post(search));
    router.layer(from_fn_with_state(state.clone(), body::paced)).with_state(state.clone())
}

async fn search(State(state): State<AppState>, request: Request) -> Result<Vec<u8>, Problem> {
    let secret = state.context.node_secret().await?;
    // before anything of the body is read
    if !secret.is_some_and(|secret| is_shown(&secret, request.headers())) {
        let hint = "ask by POST /v1/queries: this is for servers that use the same database";
        return Err(Problem::new(Code::Unauthorized, "the request does not come from a server of this service", hint));
    }
    let message = read_body(&state, request, MOST_BYTES).await?;
    Ok(answering::answer(&state.context, &message).await?)
}

/// Whether a request shows the secret. Hashes are compared, which takes the same time wherever they differ.
fn is_shown(secret: &NodeSecret, headers: &HeaderMap) -> bool {
    let shown = headers.get(header::AUTHORIZATION).and_then(|value| value.as_bytes().strip_prefix(b"Bearer "));
    shown.is_some_and(|shown| blake3::hash(shown) == blake3::hash(secret.0.as_bytes()))
}

impl From<AnsweringError> for Problem {
    fn from(error: AnsweringError) -> Self {
        match error {
            AnsweringError::NoMessage(error) => {
                Problem::new(Code::MalformedRequest, error.to_string(), "run the same version on all servers")
            }
            AnsweringError::Other => {
                let hint = "look again who searches: a server says so every 2 s";
                Problem::new(Code::ForeignHost, "another server is meant", hint)
            }
            AnsweringError::Query(error) => error.into(),
        }
    }
}

impl From<QueryError> for Problem {
    fn from(error: QueryError) -> Self {
        let detail = error.to_string();
        match error {
            QueryError::NotReady(error) => error.into(),
            QueryError::NotSearched { .. } => {
                let hint = "try again in a moment, or send \"partial\": true for what the others find; the operator starts servers \
                            with --roles search";
                Problem::new(Code::NotSearched, detail, hint).retry_after(5)
            }
            QueryError::Elsewhere(error) => error.into(),
            QueryError::UnknownStandard(name) => super::queries::unknown_standard(&name),
            QueryError::Database(error) => error.into(),
            QueryError::Task(error) => Problem::internal(error),
        }
    }
}

impl From<NotReady> for Problem {
    fn from(error: NotReady) -> Self {
        Problem::new(Code::NotReady, error.to_string(), "try again in a moment").retry_after(2)
    }
}

impl From<Elsewhere> for Problem {
    fn from(error: Elsewhere) -> Self {
        let hint = "ask a server that has the whole index: one that runs with --roles api,search";
        Problem::new(Code::IndexElsewhere, error.to_string(), hint)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_very_secret_opens() {
        let secret = NodeSecret("5f0c".to_owned());
        let shown = |value: &[u8]| {
            let mut headers = HeaderMap::new();
            headers.insert(header::AUTHORIZATION, value.try_into().expect("a header"));
            is_shown(&secret, &headers)
        };
        assert!(shown(b"Bearer 5f0c"));
        for other in [
            &b""[..],
            b"Bearer ",
            b"Bearer 5f0",
            b"Bearer 5f0c ",
            b"Bearer 5F0C",
            b"5f0c",
            b"bearer 5f0c",
            b"Bearer \xff",
        ] {
            assert!(!shown(other), "{}", String::from_utf8_lossy(other));
        }
        assert!(!is_shown(&secret, &HeaderMap::new()));
        assert!(!format!("{secret:?}").contains("5f0c"));
    }
}
