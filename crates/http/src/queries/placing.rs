//! Where a probe lies on what was found, as the API shows it.

use serde::Serialize;
use utoipa::ToSchema;

use super::super::describe;
use super::super::problem::{Code, Problem};
use super::super::schemas::Matrix;
use super::super::state::AppState;
use visage_domain::ModelId;
use visage_service::app::placing::{Placed, Placing, PlacingError, Probe};

/// Matches of a page that a probe is laid onto: each takes about a second.
const PLACED: usize = 5;

/// Where a probe lies on a model, verified on the surfaces of both. Lengths are in the unit of the model.
#[derive(Debug, Clone, Copy, Serialize, ToSchema)]
#[schema(as = Place)]
pub struct PlaceView {
    /// The matrix that brings the probe onto the model, row by row: turn, scale, mirror and shift.
    #[schema(value_type = Matrix)]
    pub model_from_probe: [[f64; 4]; 4],
    /// Lengths on the model in one of the probe, both in the units of their files.
    pub scale: f64,
    /// Whether the probe's mirror image lies so; what is about its own mirror image is not told to be mirrored.
    pub is_mirrored: bool,
    /// The share of the probe's surface that lies on the model's.
    #[schema(minimum = 0, maximum = 1)]
    pub probe_overlap: f64,
    /// The share of the model's surface that the probe covers.
    #[schema(minimum = 0, maximum = 1)]
    pub model_overlap: f64,
    /// The root mean square distance of the surfaces where the probe lies on the model; null if it lies nowhere on it.
    pub residual: Option<f64>,
    /// How near to each other surfaces agree.
    pub tolerance: f64,
    /// How far the probe's surface is from the model's, as a share of the smaller one's mean distance from its centroid: a root mean square of
    /// all of it, in which what is far off counts 0.15. Copies stay below 0.001, other things of one kind may come as near as 0.002.
    #[schema(minimum = 0, maximum = 0.15)]
    pub deviation: f64,
}

impl From<Placed> for PlaceView {
    fn from(Placed { pose, verified }: Placed) -> Self {
        PlaceView {
            model_from_probe: pose.matrix(),
            scale: pose.scale,
            is_mirrored: pose.mirrored,
            probe_overlap: verified.probe_overlap,
            model_overlap: verified.model_overlap,
            residual: verified.residual,
            tolerance: verified.tolerance,
            deviation: verified.deviation(),
        }
    }
}

/// Lays the probe onto the first of the models, in their order.
pub async fn placed(
    state: &AppState,
    probe: Probe,
    mut models: Vec<ModelId>,
) -> Result<Vec<Option<PlaceView>>, Problem> {
    models.truncate(PLACED);
    let placing = Placing::find(&state.context, probe, models).await?;
    let turn = describe::turn_of(state, placing.bytes()).await?;
    let context = state.context.clone();
    let placed = describe::computed(state, turn, move |_, progress| Ok(placing.run(&context, progress)?)).await?;
    Ok(placed.into_iter().map(|placed| placed.map(PlaceView::from)).collect())
}

impl From<PlacingError> for Problem {
    fn from(error: PlacingError) -> Self {
        match error {
            PlacingError::File(error) => error.into(),
            PlacingError::Probe(_) => {
                Problem::new(Code::InvalidField, error.to_string(), "leave place out, or send more of the surface")
            }
            PlacingError::Canceled(_) => Problem::internal(error),
        }
    }
}
