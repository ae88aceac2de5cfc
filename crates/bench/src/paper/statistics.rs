//! Means and deviations over trials.

use super::trial::{MethodResult, TrialRecord};
use visage::pipeline::Method;

/// Mean and standard deviation (of the sample, n - 1).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spread {
    /// The mean.
    pub mean: f64,
    /// The standard deviation; one value has none.
    pub deviation: Option<f64>,
}

impl Spread {
    /// Of some values; `None` of none.
    pub fn of(values: &[f64]) -> Option<Spread> {
        if values.is_empty() {
            return None;
        }
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
        Some(Spread { mean, deviation: (values.len() > 1).then(|| (squares / (n - 1.0)).sqrt()) })
    }
}

/// The trials of one set and level of noise.
pub fn trials_of<'a>(records: &[&'a TrialRecord], set: &str, noise: usize) -> Vec<&'a TrialRecord> {
    records.iter().filter(|record| record.key.set == set && record.key.noise == noise).copied().collect()
}

/// A figure of one method over trials.
pub fn spread(trials: &[&TrialRecord], method: Method, figure: impl Fn(&MethodResult) -> f64) -> Option<Spread> {
    let values: Vec<f64> = trials.iter().filter_map(|trial| trial.of(method)).map(figure).collect();
    Spread::of(&values)
}

/// In how many trials one method's Obj is below another's.
pub fn wins(trials: &[&TrialRecord], one: Method, other: Method) -> usize {
    let better = |trial: &&&TrialRecord| match (trial.of(one), trial.of(other)) {
        (Some(one), Some(other)) => one.obj_mm2 < other.obj_mm2,
        _ => false,
    };
    trials.iter().filter(better).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_deviation_is_that_of_a_sample() {
        assert_eq!(Spread::of(&[]), None);
        assert_eq!(Spread::of(&[2.0]), Some(Spread { mean: 2.0, deviation: None }));
        let spread = Spread::of(&[1.0, 2.0, 3.0]).expect("three values");
        assert_eq!(spread, Spread { mean: 2.0, deviation: Some(1.0) });
    }
}
