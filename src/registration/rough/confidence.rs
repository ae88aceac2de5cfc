//! What a join of two groups has to rest on, and how sure a view of a refined group is, as a probability.

use super::link::Link;
use super::scene::Scene;
use super::standing::Standing;
use crate::registration::quality::limits;

/// What a join rests on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grounds {
    /// Scores of all pairs between the groups, added.
    pub score: f64,
    /// The best pair's.
    pub best: f64,
    /// Score of the best other way to lay the groups on each other, in that of this one.
    pub rival: f64,
    /// Of the points of the best pairs that come near each other, the share that touches at full resolution.
    pub touching: f64,
}

/// Groups are joined if the best pair scores this,
const STRONG: f64 = 0.16;
/// or all together score this, with one that is not weak.
const STRONG_TOGETHER: f64 = 0.32;
const NOT_WEAK: f64 = 0.1;

impl Grounds {
    /// Adds up what all pairs say.
    pub fn of(scene: &Scene, measured: &[Link]) -> Self {
        let scores = measured.iter().map(|link| scene.score(link));
        Grounds { score: scores.clone().sum(), best: scores.fold(0.0, f64::max), rival: 0.0, touching: 0.0 }
    }

    /// Whether they are enough to join two groups.
    pub fn suffice(&self) -> bool {
        self.best >= STRONG || (self.score >= STRONG_TOGETHER && self.best >= NOT_WEAK)
    }
}

/// Coefficients of the logistic model; see [`features`] and docs/results/scans_alone.md.
pub const MODEL: [f64; FEATURES] = [6.928, -4.254, -2.835, -2.573, 0.743, -2.466, -1.753];
/// A view is called sure from this confidence on.
pub const SURE: f64 = limits::LEAST_SURE;
/// Numbers that the model looks at.
pub const FEATURES: usize = 7;

/// The probability that a view that stands so is right.
pub fn confidence(standing: &Standing) -> f64 {
    let z: f64 = MODEL.iter().zip(features(standing)).map(|(c, x)| c * x).sum();
    1.0 / (1.0 + (-z).exp())
}

/// What the model looks at.
pub fn features(standing: &Standing) -> [f64; FEATURES] {
    let s = standing;
    [
        1.0,
        s.through.sqrt(),
        s.crossing.max(s.group_crossing).sqrt(),
        s.group_rival,
        s.hold.max(0.01).ln(),
        s.rms.max(0.1).ln(),
        (1.0 - s.sharpness).sqrt(),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_speaks_against_a_place_makes_it_less_sure() {
        let right = Standing {
            overlap: 0.6,
            through: 0.0,
            crossing: 0.0,
            group_crossing: 0.0,
            rms: 1.0,
            hold: 0.2,
            group_rival: 0.0,
            sharpness: 1.0,
        };
        assert!(confidence(&right) > SURE);
        let worse = [
            Standing { through: 0.05, ..right },
            Standing { crossing: 0.3, ..right },
            Standing { group_crossing: 0.1, ..right },
            Standing { group_rival: 1.0, ..right },
            Standing { sharpness: 0.7, ..right },
            Standing { rms: 2.0, ..right },
        ];
        for standing in worse {
            assert!(confidence(&standing) < confidence(&right), "{standing:?}");
        }
    }
}
