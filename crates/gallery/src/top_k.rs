//! Which part of a ranking is asked for.

use std::cmp::Reverse;

use super::ModelId;

/// A place in a ranking: higher scores come first, of equals the lower id.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rank {
    /// Never negative.
    pub score: f64,
    /// The model.
    pub model_id: ModelId,
}

impl Rank {
    /// Ascending in the order of the ranking. Scores are never negative, so their bits order as they do.
    pub fn key(&self) -> (Reverse<u64>, ModelId) {
        (Reverse(self.score.to_bits()), self.model_id)
    }
}

/// Which models of a ranking are wanted.
///
/// A page goes on where another ended by the rank of its last match, not by a count: models that come or go in the
/// meantime neither repeat nor hide others, since the rank of a stored model against one question never changes.
#[derive(Clone, Copy)]
pub struct TopK<'a> {
    /// At most so many.
    pub limit: usize,
    /// Only what comes after this rank.
    pub after: Option<Rank>,
    /// The score from which on a model is a match; the question's own if not given.
    pub threshold: Option<f64>,
    /// Leave out what is no match.
    pub only_matches: bool,
    /// Only models that this takes.
    pub accepts: &'a (dyn Fn(ModelId) -> bool + Sync),
}

impl TopK<'_> {
    /// The `limit` best of all.
    pub fn best(limit: usize) -> Self {
        TopK { limit, after: None, threshold: None, only_matches: false, accepts: &|_| true }
    }

    /// Whether a model with this score is wanted; `threshold` is that of the question.
    pub fn takes(&self, score: f64, model_id: ModelId, threshold: f64) -> bool {
        let rank = Rank { score, model_id };
        self.after.is_none_or(|after| after.key() < rank.key())
            && (!self.only_matches || score >= threshold)
            && (self.accepts)(model_id)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn higher_scores_come_first_then_lower_ids() {
        let rank = |score, model_id| Rank { score, model_id };
        let mut ranks = [rank(0.1, 1), rank(0.9, 3), rank(0.9, 2), rank(0.0, 0)];
        ranks.sort_by_key(Rank::key);
        assert_eq!(ranks.map(|r| r.model_id), [2, 3, 1, 0]);
    }

    #[test]
    fn every_condition_must_hold() {
        let odd = |id: ModelId| id % 2 == 1;
        let after = Some(Rank { score: 0.5, model_id: 4 });
        let top_k = TopK { after, only_matches: true, accepts: &odd, ..TopK::best(5) };
        assert!(top_k.takes(0.5, 5, 0.4) && top_k.takes(0.4, 1, 0.4));
        assert!(!top_k.takes(0.5, 3, 0.4), "before the page");
        assert!(!top_k.takes(0.3, 1, 0.4), "no match");
        assert!(!top_k.takes(0.5, 6, 0.4), "not accepted");
        assert!(TopK::best(5).takes(0.0, 6, 0.4));
    }
}
