//! The one measure of evidence: what surfels of one view say of their place in another, and how much that speaks for it.
//!
//! A surfel put where a motion takes it meets one of five things: the other view's surface, which agrees; a surface that
//! crosses it; space that the other scanner looked through; space where it should have been seen and nothing was; or it
//! is hidden, on a rim or outside the picture, and says nothing. Their counts, weighed by how much more often each is met
//! on right motions than on wrong ones, are the score: the logarithm of the odds, up to the number of surfels that say the
//! same thing because they are neighbours. Scores of pairs are added.

visage_geometry::tuning! {
    const TUNING: Tuning {
        /// A surfel that crosses a surface weighs as many that agree. On right motions 3 to 6 % of what is said does, on wrong
        /// ones 14 to 26 %: by itself it would weigh four, but crossings come in patches, where noise or a thin wall is.
        contradict: f64 = 1.0,
        /// A surfel where the other scanner looked through: 0.1 % on right motions, 4 to 8 % on wrong ones.
        looked_through: f64 = 25.0,
        /// A surfel that the other scanner should have seen: 0 to 3 % on right motions (holes where light does not come back, and
        /// frames that end), 7 to 9 % on wrong ones.
        missed: f64 = 10.0,
    }
}

/// What surfels say when they are put into another view; counts.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct SurfelVotes {
    /// Surfels that were put there.
    pub queried: f64,
    /// Those that lie on the other view's surface, and look the same way.
    pub agree: f64,
    /// Those near the other view's surface that cross it or look another way.
    pub contradict: f64,
    /// Those that lie where the other view's scanner has looked through.
    pub looked_through: f64,
    /// Those that face the other view's scanner, and where it saw nothing far and wide.
    pub missed: f64,
    /// Those behind the other surface that look the opposite way: as the far side of a thin wall does. They say nothing.
    pub hidden: f64,
    /// Sum of the squared distances, along the normal, of those that agree: squared lengths.
    pub squares: f64,
}

impl SurfelVotes {
    /// Share of the surfels queried that agree.
    pub fn overlap(&self) -> f64 {
        self.agree / self.queried.max(1.0)
    }

    /// What speaks against the motion, in surfels that agree.
    pub fn against(&self) -> f64 {
        TUNING.contradict * self.contradict + TUNING.looked_through * self.looked_through + TUNING.missed * self.missed
    }

    /// How much speaks for the motion, a surfel queried: 1 if all agree.
    pub fn score(&self) -> f64 {
        self.balance() / self.queried.max(1.0)
    }

    /// How much speaks for the motion, in surfels that agree.
    pub fn balance(&self) -> f64 {
        self.agree - self.against()
    }

    /// Share of what agrees among all that is said, 0 to 1. What is unseen counts twice and the far side of a thin wall as a
    /// crossing: for questions that are queried before it is known where pictures end, and where walls are thin.
    pub fn consistency(&self) -> f64 {
        self.agree / (self.agree + self.contradict + self.hidden + 2.0 * self.unseen()).max(1.0)
    }

    /// How many say something.
    pub fn said(&self) -> f64 {
        self.agree + self.contradict + self.unseen()
    }

    /// How many are where the other scanner saw no surface.
    pub fn unseen(&self) -> f64 {
        self.looked_through + self.missed
    }

    /// Mean squared distance of the surfels that agree, a squared length.
    pub fn mean_square(&self) -> f64 {
        self.squares / self.agree.max(1.0)
    }

    /// Root mean square distance of the surfels that agree, a length.
    pub fn rms(&self) -> f64 {
        self.mean_square().sqrt()
    }
}

impl std::ops::Add for SurfelVotes {
    type Output = SurfelVotes;

    fn add(self, other: SurfelVotes) -> SurfelVotes {
        SurfelVotes {
            queried: self.queried + other.queried,
            agree: self.agree + other.agree,
            contradict: self.contradict + other.contradict,
            looked_through: self.looked_through + other.looked_through,
            missed: self.missed + other.missed,
            hidden: self.hidden + other.hidden,
            squares: self.squares + other.squares,
        }
    }
}

impl std::iter::Sum for SurfelVotes {
    fn sum<I: Iterator<Item = SurfelVotes>>(votes: I) -> SurfelVotes {
        votes.fold(SurfelVotes::default(), |sum, votes| sum + votes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn free_space_weighs_more_than_crossing_and_what_is_hidden_nothing() {
        let agreeing = SurfelVotes { queried: 100.0, agree: 60.0, ..SurfelVotes::default() };
        let crossing = SurfelVotes { contradict: 2.0, ..agreeing };
        let missed = SurfelVotes { missed: 2.0, ..agreeing };
        let through = SurfelVotes { looked_through: 2.0, ..agreeing };
        let hidden = SurfelVotes { hidden: 2.0, ..agreeing };
        let scores = [hidden, agreeing, crossing, missed, through].map(|votes| votes.score());
        assert_eq!(scores[0], scores[1]);
        assert!(scores[1..].is_sorted_by(|a, b| a > b), "{scores:?}");
    }

    #[test]
    fn scores_of_pairs_add_up() {
        let votes = SurfelVotes { queried: 50.0, agree: 30.0, contradict: 4.0, ..SurfelVotes::default() };
        let sum: SurfelVotes = [votes, votes].into_iter().sum();
        assert_eq!((sum.queried, sum.balance()), (100.0, 2.0 * votes.balance()));
    }
}
