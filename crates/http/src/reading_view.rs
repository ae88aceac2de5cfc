//! What of a file was not taken when it was read, as it goes over the wire and as it is stored.

use serde::Serialize;
use utoipa::ToSchema;

use visage_formats::Dropped;

/// What of a file was not taken, because it can't be used; everything else was.
#[derive(Debug, Clone, Serialize, ToSchema)]
#[schema(as = Reading)]
pub struct ReadingView {
    /// Points without a return (a coordinate is NaN or infinite): left out.
    #[schema(example = 1598)]
    pub no_return: u64,
    /// Triangles that name a vertex which isn't there or is left out: left out.
    pub faces: u64,
    /// Points whose normal is not sound: they have none.
    pub normals: u64,
    /// Points whose colour is not sound: they are black.
    pub colors: u64,
    /// Points whose intensity is not sound: it is 0.
    pub intensities: u64,
    /// What else was passed over, in words.
    pub notes: Vec<String>,
}

impl From<Dropped> for ReadingView {
    fn from(dropped: Dropped) -> Self {
        let Dropped { no_return, faces, normals, colors, intensities, notes } = dropped;
        ReadingView { no_return, faces, normals, colors, intensities, notes }
    }
}

impl ReadingView {
    /// From what [`stored`] made.
    pub fn of_stored(text: &str) -> Option<Self> {
        serde_json::from_str::<Dropped>(text).ok().map(Into::into)
    }
}

/// What is kept of it with the file; nothing if all of the file was taken.
pub fn stored(dropped: &Dropped) -> Option<String> {
    (!dropped.is_empty()).then(|| serde_json::to_string(dropped).ok()).flatten()
}
