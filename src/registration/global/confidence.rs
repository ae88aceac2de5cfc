//! What a join of two groups has to rest on, and how sure a view of a refined group is, as a probability.

use super::link::Link;
use super::scene::Scene;
use super::standing::Standing;
use crate::registration::quality::limits;
use crate::registration::witness::Witness;

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

/// Coefficients of the logistic model; see [`features`] and docs/results/scanners.md.
pub const MODEL: [f64; FEATURES] = [1.28, -0.32, -0.91, -0.78, 0.77, -0.69, -0.57, 2.39, -0.43, 0.98, -1.94];
/// What the logarithm of the odds loses where something moved before a background that holds the views: one of both is wrong.
const STILL: f64 = 4.0;
/// A view is called sure from this confidence on.
pub const SURE: f64 = limits::LEAST_SURE;
/// Numbers that the model looks at.
pub const FEATURES: usize = 11;
/// Displacement by one standard deviation where it is not known: what is usual, in the size of the set,
const USUAL_DISPLACEMENT: f64 = 3e-3;
/// and what is added to it, so that none is free of doubt.
const LEAST_DISPLACEMENT: f64 = 1e-4;
/// Agreement of colours that is as good as any.
const COLOURS_AGREE: f64 = 0.8;

/// The probability that a view that stands so is right.
pub fn confidence(standing: &Standing, witness: &Witness) -> f64 {
    let z: f64 = MODEL.iter().zip(features(standing, witness)).map(|(c, x)| c * x).sum();
    let z = if witness.stands_still { z - STILL } else { z };
    1.0 / (1.0 + (-z).exp())
}

/// What the model looks at.
pub fn features(standing: &Standing, witness: &Witness) -> [f64; FEATURES] {
    let s = standing;
    [
        1.0,
        s.unseen.sqrt(),
        s.contradict.max(s.group_contradict).sqrt(),
        s.group_rival,
        s.held.max(0.01).ln(),
        s.rms.max(0.1).ln(),
        (1.0 - s.sharpness).sqrt(),
        s.agreeing,
        (witness.displacement.unwrap_or(USUAL_DISPLACEMENT) + LEAST_DISPLACEMENT).ln(),
        witness.colours.map_or(0.0, |agreement| agreement.min(COLOURS_AGREE) - COLOURS_AGREE),
        f64::from(u8::from(witness.is_looked_through)),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_speaks_against_a_place_makes_it_less_sure() {
        let right = Standing {
            overlap: 0.6,
            unseen: 0.0,
            contradict: 0.0,
            group_contradict: 0.0,
            rms: 1.0,
            agreeing: 0.8,
            held: 0.2,
            group_rival: 0.0,
            sharpness: 1.0,
        };
        let none = Witness::default();
        assert!(confidence(&right, &none) > SURE);
        let worse = [
            Standing { unseen: 0.05, ..right },
            Standing { contradict: 0.3, ..right },
            Standing { group_contradict: 0.1, ..right },
            Standing { group_rival: 1.0, ..right },
            Standing { sharpness: 0.7, ..right },
            Standing { rms: 2.0, ..right },
            Standing { agreeing: 0.2, ..right },
        ];
        for standing in worse {
            assert!(confidence(&standing, &none) < confidence(&right, &none), "{standing:?}");
        }
        let against = [
            Witness { displacement: Some(0.02), ..none },
            Witness { is_looked_through: true, ..none },
            Witness { colours: Some(0.2), ..none },
            Witness { stands_still: true, ..none },
        ];
        for witness in against {
            assert!(confidence(&right, &witness) < confidence(&right, &none), "{witness:?}");
        }
    }
}
