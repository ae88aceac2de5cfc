//! How sure a view of a refined component is, as a probability.

use super::pose_support::PoseSupport;
use crate::quality::limits;
use crate::quality::witness::Witness;

/// Coefficients of the logistic model; see [`features`]. Fitted by `examples/confidence.rs` on code-made sets of three of six
/// sensors with four of eight scenes and on half of the objects; docs/results/scanners.md shows how it holds on the others.
pub const MODEL: [f64; FEATURES] = [0.66, -1.85, -0.55, -0.10, 0.63, -2.05, -1.65, 1.96, -0.57, 1.09, -1.30, -0.58];
/// What the logarithm of the odds loses where something moved before a background that holds the views: one of both is wrong.
pub const STILL: f64 = 4.0;
/// A view is called sure from this confidence on.
pub const SURE: f64 = limits::LEAST_SURE;
/// Numbers that the model looks at.
pub const FEATURES: usize = 12;

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// Displacement by one standard deviation where it is not known: what is usual, in the size of the set,
        usual_displacement: f64 = 3e-3,
        /// and what is added to it, so that none is free of doubt.
        least_displacement: f64 = 1e-4,
        /// Nearer to each other than this, in the noise of the set, surfaces lie by chance: where few surfels agree (99 % of right
        /// views have more).
        least_rms: f64 = 0.8,
        /// Another place that does so much better than a view's own says no more by doing better still.
        most_rival: f64 = 1.5,
        /// Agreement of colours that is as good as any.
        colours_agree: f64 = 0.8,
    }
}

/// The probability that a view that stands so is right.
pub fn confidence(support: &PoseSupport, witness: &Witness) -> f64 {
    let z: f64 = MODEL.iter().zip(features(support, witness)).map(|(c, x)| c * x).sum();
    let z = if witness.stands_still { z - STILL } else { z };
    1.0 / (1.0 + (-z).exp())
}

/// What the model looks at.
pub fn features(support: &PoseSupport, witness: &Witness) -> [f64; FEATURES] {
    let s = support;
    [
        1.0,
        s.unseen.sqrt(),
        s.contradict.max(s.component_contradict).sqrt(),
        s.component_rival,
        s.held.max(0.01).ln(),
        s.rms.max(TUNING.least_rms).ln(),
        (1.0 - s.sharpness).sqrt(),
        s.agreeing,
        0.5 * (looseness(witness.displacement) + looseness(witness.jackknife)),
        witness.colours.map_or(0.0, |agreement| agreement.min(TUNING.colours_agree) - TUNING.colours_agree),
        f64::from(u8::from(witness.is_looked_through)),
        s.rival.min(TUNING.most_rival),
    ]
}

/// The logarithm of a displacement by one standard deviation.
fn looseness(displacement: Option<f64>) -> f64 {
    (displacement.unwrap_or(TUNING.usual_displacement) + TUNING.least_displacement).ln()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_speaks_against_a_place_makes_it_less_sure() {
        let right = PoseSupport {
            overlap: 0.6,
            unseen: 0.0,
            contradict: 0.0,
            component_contradict: 0.0,
            rms: 1.0,
            agreeing: 0.8,
            held: 0.2,
            rival: 0.0,
            component_rival: 0.0,
            sharpness: 1.0,
        };
        let none = Witness::default();
        assert!(confidence(&right, &none) > SURE);
        let worse = [
            PoseSupport { unseen: 0.05, ..right },
            PoseSupport { contradict: 0.3, ..right },
            PoseSupport { component_contradict: 0.1, ..right },
            PoseSupport { component_rival: 1.0, ..right },
            PoseSupport { rival: 1.0, ..right },
            PoseSupport { sharpness: 0.7, ..right },
            PoseSupport { rms: 2.0, ..right },
            PoseSupport {
                unseen: 1.0,
                held: 0.0,
                component_rival: 1.5,
                agreeing: 0.25,
                sharpness: 0.0,
                rms: 0.0,
                ..right
            },
            PoseSupport { agreeing: 0.2, ..right },
        ];
        for support in worse {
            assert!(confidence(&support, &none) < confidence(&right, &none), "{support:?}");
        }
        // where hardly anything agrees it says nothing that it lies near
        let alone = PoseSupport { unseen: 1.0, held: 0.0, agreeing: 0.25, sharpness: 0.0, rms: 0.0, ..right };
        assert!(confidence(&alone, &none) < 0.5);
        let against = [
            Witness { displacement: Some(0.02), ..none },
            Witness { jackknife: Some(0.02), ..none },
            Witness { is_looked_through: true, ..none },
            Witness { colours: Some(0.2), ..none },
            Witness { stands_still: true, ..none },
        ];
        for witness in against {
            assert!(confidence(&right, &witness) < confidence(&right, &none), "{witness:?}");
        }
    }
}
