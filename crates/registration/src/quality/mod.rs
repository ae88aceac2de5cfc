//! The verdict on a registration: what it would look like if it were wrong, and whether it does.
//!
//! - [`evidence`]: what is known when it is judged, and the judgement
//! - [`sharpness`]: whether surfaces that come near each other touch
//! - [`free_space`], [`walls`], [`colour`]: surface where another scanner looked through; views on both faces of a wall; colours
//!   that don't agree
//! - [`witness`]: the same, for the confidence of one view

pub mod colour;
pub mod evidence;
pub mod free_space;
pub mod sharpness;
pub mod walls;
pub mod witness;

pub use self::evidence::{Evidence, Finding, Surfaces, judge};

/// How a registration ended.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, serde::Serialize, serde::Deserialize, strum::IntoStaticStr,
)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum Quality {
    /// Nothing speaks against it.
    Good,
    /// Something does; look before using it.
    Doubtful,
    /// It is wrong, or too little of it is right.
    Failed,
}

impl Quality {
    /// As reports name it.
    pub fn name(self) -> &'static str {
        self.into()
    }
}

/// A verdict and what it rests on.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Verdict {
    /// The verdict.
    pub quality: Quality,
    /// Why it is not better, in words; empty for `good`.
    pub reasons: Vec<String>,
    /// Sharpness of each view, 0 to 1; absent for a view with nothing near it.
    pub sharpness: Vec<Option<f64>>,
}

/// Thresholds, set between what right and wrong registrations show (docs/ALGORITHM.md, "Verdict").
pub(crate) mod limits {
    /// Sharpness of a view from which on it lies on the others, and below which it is wrong.
    pub const SHARP: f64 = 0.85;
    /// Sharpness below which a result is doubtful: the error of a share of 150 to 400 points, 3 %, above that. On code-made sets
    /// half of the views from 0.85 to 0.9 are right, and 96 % of those above 0.95 (docs/results/scanners.md).
    pub const SURELY_SHARP: f64 = 0.88;
    pub const BLUNT: f64 = 0.6;
    /// Disagreement of a pair with the averaged poses, in spacings.
    pub const DISAGREEMENT: f64 = 2.0;
    /// Robust averaging may overrule a few such pairs; more than this share is a doubt.
    pub const OVERRULED: f64 = 0.25;
    /// Trimmed RMS of a pair, in spacings.
    pub const RESIDUAL: f64 = 1.5;
    /// How far a view's surface may lie from where the joint cost is least, in spacings.
    pub const UNREST: f64 = 1.0;
    /// Probability that the place of a view is right, where it was found by surface.
    pub const LEAST_SURE: f64 = 0.9;
    /// Agreement of a view's texture with the neighbour it agrees with best, in what noise allows: on right poses 0.7 and
    /// more, on a bottle that is turned at random 0.2 to 0.4.
    pub const TEXTURE: f64 = 0.5;
    /// Share of a view without a side that lies on the other face of a wall than the rest of it.
    pub const MIXED_FACES: f64 = 0.05;
    /// Share of a view's points, where another saw something, that may lie before it; and of how many points.
    pub const LOOKED_THROUGH: f64 = 0.03;
    pub const LOOKED_THROUGH_POINTS: usize = 30;
}
