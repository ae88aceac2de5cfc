//! Error answers as the contract names them, so that each operation lists the ones it can give.

use std::collections::BTreeMap;

use utoipa::openapi::{ContentBuilder, Ref, RefOr, Response, ResponseBuilder};

use super::problem::ProblemBody;

macro_rules! problem_responses {
    ($($(#[$doc:meta])* $name:ident = $status:literal, $description:literal;)*) => {
        $(
            $(#[$doc])*
            pub struct $name;

            impl utoipa::IntoResponses for $name {
                fn responses() -> BTreeMap<String, RefOr<Response>> {
                    BTreeMap::from([($status.to_owned(), problem($description))])
                }
            }
        )*
    };
}

problem_responses! {
    /// 400
    BadRequest = "400", "The request can't be read (`malformed_request`, `digest_mismatch`).";
    /// 401
    Unauthorized = "401", "There is no valid key (`unauthorized`).";
    /// 403
    InsufficientScope = "403", "The key does not allow this (`insufficient_scope`), or the request comes from elsewhere \
                                (`foreign_host`, `foreign_origin`).";
    /// 404
    NotFound = "404", "There is no such resource (`not_found`).";
    /// 406
    NotAcceptable = "406", "There is no such format, or it can't hold this (`not_acceptable`); `hint` lists what there is.";
    /// 408
    Stalled = "408", "The body came too slowly or not to its end (`upload_stalled`).";
    /// 409
    Conflict = "409", "An unfinished job, its status or a request in progress forbids it (`in_use`, `wrong_status`, \
                       `request_in_progress`, `scan_changed`), or two models are not in one unit (`other_unit`).";
    /// 409
    OriginDeleted = "409", "What it was made of is in the recycle bin itself (`origin_deleted`).";
    /// 409
    PieceConflict = "409", "The piece does not begin where the last one has ended (`offset_mismatch`), a newer request goes on \
                            with the file (`request_in_progress`), or an unfinished job needs the scan set (`in_use`).";
    /// 412
    OtherState = "412", "The resource is not as `If-Match` or `If-None-Match` wants it (`precondition_failed`).";
    /// 413
    TooLarge = "413", "The body is larger than `GET /v1/info` allows (`too_large`).";
    /// 415
    WrongType = "415", "The body has another type than is read here (`unsupported_media_type`).";
    /// 416
    BadRange = "416", "The file is shorter than the range asked for (`range_not_satisfiable`).";
    /// 422
    Unprocessable = "422", "The request is well formed but can't be carried out: `code`, `scan` and `hint` say why.";
    /// 429
    QueueFull = "429", "Too many jobs are waiting (`queue_full`); `Retry-After` says when to try again.";
    /// 429
    TooMany = "429", "The key has asked for too much or has as much as it may have (`rate_limited`, `quota_exceeded`), or too \
                      many jobs are waiting (`queue_full`); `Retry-After` says when to try again.";
    /// 502
    NotFetched = "502", "The file could not be fetched from where it is said to be (`fetch_failed`).";
    /// 503
    NotReady = "503", "The server is starting or stopping (`not_ready`, `shutting_down`), can't reach what keeps files \
                      or records (`storage_unreachable`), or nobody can search a part of the gallery (`not_searched`); see \
                      `Retry-After`.";
    /// Any other error.
    Other = "default", "Any other error.";
}

/// 304
pub struct Unchanged;

impl utoipa::IntoResponses for Unchanged {
    fn responses() -> BTreeMap<String, RefOr<Response>> {
        let answer = ResponseBuilder::new().description("The content is the one that is known.");
        BTreeMap::from([("304".to_owned(), answer.build().into())])
    }
}

/// 200: server-sent events. They have no schema: the body is no JSON, and what a schema means here is told differently by
/// generators (the text as a whole) and checkers (each event).
pub struct Events;

impl utoipa::IntoResponses for Events {
    fn responses() -> BTreeMap<String, RefOr<Response>> {
        let answer = ResponseBuilder::new()
            .description("Events named `progress`, then one named `end`; the data is a job as JSON.")
            .content("text/event-stream", ContentBuilder::new().build());
        BTreeMap::from([("200".to_owned(), answer.build().into())])
    }
}

fn problem(description: &str) -> RefOr<Response> {
    let schema = Ref::from_schema_name(<ProblemBody as utoipa::ToSchema>::name());
    ResponseBuilder::new()
        .description(description)
        .content("application/problem+json", ContentBuilder::new().schema(Some(schema)).build())
        .build()
        .into()
}
