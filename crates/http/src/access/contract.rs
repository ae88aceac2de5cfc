//! What the contract tells of access: made from the table that is enforced.

use axum::http::Method;
use utoipa::IntoResponses;
use utoipa::openapi::path::Operation;
use utoipa::openapi::security::{ApiKey, ApiKeyValue, Http, HttpAuthScheme, SecurityRequirement, SecurityScheme};
use utoipa::openapi::{Components, OpenApi, RefOr};

use super::SESSION_COOKIE;
use super::needs::{self, Need};
use crate::responses;

const KEY: &str = "key";
const SESSION: &str = "session";

/// Adds to each operation what it needs, and how it is refused.
pub fn tell(document: &mut OpenApi) {
    let components = document.components.get_or_insert_with(Components::new);
    let mut key = Http::new(HttpAuthScheme::Bearer);
    key.bearer_format = Some("visage_ and 64 characters".to_owned());
    key.description = Some("A key that `visage key create` or `POST /v1/keys` has made.".to_owned());
    components.add_security_scheme(KEY, SecurityScheme::Http(key));
    let cookie = ApiKeyValue::with_description(SESSION_COOKIE, "The session of a browser: `POST /v1/session`.");
    components.add_security_scheme(SESSION, SecurityScheme::ApiKey(ApiKey::Cookie(cookie)));
    for (path, item) in &mut document.paths.paths {
        let operations = [
            (Method::GET, &mut item.get),
            (Method::PUT, &mut item.put),
            (Method::POST, &mut item.post),
            (Method::DELETE, &mut item.delete),
            (Method::PATCH, &mut item.patch),
            (Method::HEAD, &mut item.head),
            (Method::OPTIONS, &mut item.options),
        ];
        for (method, operation) in operations {
            let Some(operation) = operation else { continue };
            let Need::Scope(scope) = needs::of(&method, path) else { continue };
            operation.security = Some(vec![
                // where nobody else reaches the service and no key was made
                SecurityRequirement::default(),
                SecurityRequirement::new(KEY, [scope.name()]),
                SecurityRequirement::new(SESSION, [scope.name()]),
            ]);
            let refusals = [
                responses::Unauthorized::responses(),
                responses::InsufficientScope::responses(),
                responses::TooMany::responses(),
            ];
            operation.responses.responses.extend(refusals.into_iter().flatten());
            if method == Method::HEAD {
                without_bodies(operation);
            }
        }
    }
}

/// What is said to HEAD has no body, errors neither.
fn without_bodies(operation: &mut Operation) {
    for response in operation.responses.responses.values_mut() {
        if let RefOr::T(response) = response {
            response.content.clear();
        }
    }
}
