//! How sure a join of two groups is, as a probability.

use super::link::Link;
use super::scene::Scene;

/// What a join rests on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grounds {
    /// Strengths of all pairs between the groups, added.
    pub strength: f64,
    /// The strongest pair's.
    pub strongest: f64,
    /// Share of what all pairs say that agrees.
    pub consistency: f64,
    /// Strength of the best other way to lay the groups on each other, in that of this one.
    pub rival: f64,
    /// Of the points of the strongest pairs that come near each other, the share that touches at full resolution.
    pub touching: f64,
}

/// Groups are joined if the strongest pair is this strong,
const STRONG: f64 = 0.08;
/// or all together, with none weak, are this strong;
const STRONG_TOGETHER: f64 = 0.16;
const NOT_WEAK: f64 = 0.05;
/// and if this share of all that their views say of each other agrees.
const CONSISTENT: f64 = 0.7;

impl Grounds {
    /// Adds up what all pairs say.
    pub fn of(scene: &Scene, measured: &[Link]) -> Self {
        let agree: f64 = measured.iter().map(|link| link.evidence.agree()).sum();
        let conflict: f64 = measured.iter().map(|link| link.evidence.conflict()).sum();
        Grounds {
            strength: measured.iter().map(|link| scene.strength(link)).sum(),
            strongest: measured.iter().map(|link| scene.strength(link)).fold(0.0, f64::max),
            consistency: agree / (agree + conflict).max(1.0),
            rival: 0.0,
            touching: 0.0,
        }
    }

    /// Whether they are enough to join two groups.
    pub fn suffice(&self) -> bool {
        let strong = self.strongest >= STRONG || (self.strength >= STRONG_TOGETHER && self.strongest >= NOT_WEAK);
        strong && self.consistency >= CONSISTENT
    }
}

/// Coefficients of the logistic model: constant, ln strength, consistency, rival, touching.
pub const MODEL: [f64; 5] = [-9.0, 2.0, 8.0, -2.0, 9.0];

/// The probability that a join with these grounds is right.
pub fn confidence(grounds: &Grounds) -> f64 {
    let z: f64 = MODEL.iter().zip(features(grounds)).map(|(c, x)| c * x).sum();
    1.0 / (1.0 + (-z).exp())
}

/// What the model looks at.
pub fn features(grounds: &Grounds) -> [f64; 5] {
    [1.0, grounds.strength.max(1e-3).ln(), grounds.consistency, grounds.rival, grounds.touching]
}
