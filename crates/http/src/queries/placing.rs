//! Where a probe lies on what was found, as the API shows it.

use serde::Serialize;
use utoipa::ToSchema;

use super::super::describe;
use super::super::problem::{Code, Problem};
use super::super::schemas::Matrix;
use super::super::state::AppState;
use visage_domain::ModelId;
use visage_service::app::placing::{Placed, Placing, PlacingError, Probe, Shows, Sighted};

/// Matches of a page that a probe is laid onto: each takes about a second. Of a single scan more, since its views know less.
fn most_placed(shows: Shows) -> usize {
    match shows {
        Shows::Whole => 5,
        Shows::SingleScan => 10,
    }
}

/// What a single scan's scanner would have seen of a model that lies so, in shares of it.
#[derive(Debug, Clone, Copy, Serialize, ToSchema)]
#[schema(as = Sighted)]
pub struct SightedView {
    /// Stands where the scanner looked through.
    #[schema(minimum = 0, maximum = 1)]
    pub in_front: f64,
    /// Stands where it saw nothing.
    #[schema(minimum = 0, maximum = 1)]
    pub missed: f64,
    /// Is behind what it saw.
    #[schema(minimum = 0, maximum = 1)]
    pub behind: f64,
}

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
    /// all of it, in which what is far off counts 0.15. Copies with half the triangles are mostly within 0.001 and
    /// can reach 0.04; other things of one kind may come as near as 0.002.
    #[schema(minimum = 0, maximum = 0.15)]
    pub deviation: f64,
    /// The probability that the probe is the same object as the model, or a scan of it, by all of this.
    #[schema(minimum = 0, maximum = 1)]
    pub same_object: f64,
    /// Of a single scan: what its scanner should have seen and did not.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sighted: Option<SightedView>,
}

impl From<Sighted> for SightedView {
    fn from(Sighted { in_front, missed, behind }: Sighted) -> Self {
        SightedView { in_front, missed, behind }
    }
}

impl From<Placed> for PlaceView {
    fn from(Placed { pose, verified, sighted, same_object }: Placed) -> Self {
        PlaceView {
            model_from_probe: pose.matrix(),
            scale: pose.scale,
            is_mirrored: pose.mirrored,
            probe_overlap: verified.probe_overlap,
            model_overlap: verified.model_overlap,
            residual: verified.residual,
            tolerance: verified.tolerance,
            deviation: verified.deviation(),
            same_object,
            sighted: sighted.map(SightedView::from),
        }
    }
}

/// Lays the probe onto the first of the models, in their order.
pub async fn placed(
    state: &AppState,
    probe: Probe,
    shows: Shows,
    mut models: Vec<ModelId>,
) -> Result<Vec<Option<Placed>>, Problem> {
    models.truncate(most_placed(shows));
    let placing = Placing::find(&state.context, probe, shows, models).await?;
    let turn = describe::turn_of(state, placing.bytes()).await?;
    let context = state.context.clone();
    describe::computed(state, turn, move |_, progress| Ok(placing.run(&context, progress)?)).await
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
