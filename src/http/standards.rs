//! `/v1/standards`: the classes that can be asked for.

use axum::Json;
use serde::Serialize;
use utoipa::ToSchema;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::queries::TAG;
use super::responses;
use super::state::AppState;
use crate::retrieval;

/// The routes of this resource.
pub fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(standards))
}

/// The classes that can be asked for.
#[derive(Debug, Clone, Serialize, ToSchema)]
struct StandardList {
    /// What is known of each: its name, its triangle in millimetres, its threshold.
    #[schema(value_type = Vec<Object>)]
    items: Vec<serde_json::Value>,
}

/// List the classes that can be asked for.
#[utoipa::path(
    get, path = "/v1/standards", tag = TAG, operation_id = "listStandards",
    responses((status = 200, description = "The built-in standards.", body = StandardList), responses::Other)
)]
async fn standards() -> Json<StandardList> {
    Json(StandardList { items: retrieval::standards() })
}
