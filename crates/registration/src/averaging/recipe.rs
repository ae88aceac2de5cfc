//! What a method of the paper's family runs with: its levels, and how relative motions are made to agree.

/// Which correspondences of a pair ICP keeps.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum TrimRule {
    /// The share that the moved view overlaps the other.
    Overlap,
    /// The share that minimises TrICP's objective, found in each iteration: overlaps at rough poses say little.
    Search,
    /// All of them: plain ICP.
    Nothing,
}

/// When the mean squared distance of the kept correspondences is small enough for ICP to end.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum StopRule {
    /// Below the adaptive threshold [P2].
    Adaptive,
    /// Below this many squared spacings, whatever the overlap.
    Fixed(f64),
}

/// How far ICP looks for counterparts: points beyond have none.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Reach {
    /// So many tolerances of the overlap.
    Tolerances(f64),
    /// A distance that stays the same, in spacings.
    Spacings(f64),
}

/// A step from coarse to fine. Lengths in spacings.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Level {
    /// Edge of the voxels to which queries are thinned; 0 keeps all points.
    pub query_edge: f64,
    /// Whether the targets are thinned like the queries.
    pub thin_targets: bool,
    /// Tolerance of the overlap in the first round; halved each round down to `least_tolerance`.
    pub tolerance: f64,
    /// The tolerance it ends with.
    pub least_tolerance: f64,
    /// How far ICP looks for counterparts.
    pub reach: Reach,
    /// ICP fits at most, per pair and round.
    pub max_iterations: usize,
    /// Rounds end when no view turns by more than moves its own points by this much.
    pub settled: f64,
    /// Queries of a view by which its overlaps are measured, at most; all if absent.
    pub overlap_samples: Option<usize>,
    /// Pairs that a view gets even if none of them exceeds xi_0.
    pub min_degree: usize,
    /// What ICP keeps.
    pub trim: TrimRule,
    /// When ICP is content.
    pub stop: StopRule,
}

/// How the relative motions of a round become poses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Agreement {
    /// Motion averaging [P3]-[P10], weighted by overlap and robust.
    MotionAveraging,
    /// Low-rank and sparse decomposition of the matrix of relative motions.
    LowRankSparse,
}

/// A method of the family: Algorithm 1 with these parts.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Recipe {
    /// How relative motions become poses.
    pub agreement: Agreement,
    /// Coarse to fine.
    pub levels: &'static [Level],
}

/// A threshold that is set by hand has to be strict, or it ends pairs too early on some data: this one is a tenth of
/// the spacing, below what interleaved grids can reach, so that ICP runs until it stagnates.
const STRICT: StopRule = StopRule::Fixed(0.01);

const COARSE: Level = Level {
    query_edge: 6.0,
    thin_targets: true,
    tolerance: 10.0,
    least_tolerance: 5.0,
    reach: Reach::Tolerances(6.0),
    max_iterations: 40,
    settled: 0.5,
    overlap_samples: None,
    min_degree: 0,
    trim: TrimRule::Search,
    stop: StopRule::Adaptive,
};

const FINE: Level = Level {
    query_edge: 3.0,
    thin_targets: false,
    tolerance: 3.0,
    least_tolerance: 2.0,
    reach: Reach::Tolerances(2.0),
    max_iterations: 20,
    settled: 0.03,
    overlap_samples: None,
    min_degree: 0,
    trim: TrimRule::Overlap,
    stop: StopRule::Adaptive,
};

/// Algorithm 1 as the paper has it: one level of all points. Only what can't change the outcome by more than the sampling
/// does is spared: far searches of trimmed ICP, overlaps to better than 2 %, steps of a hundredth of the spacing.
const PAPER: Level = Level {
    query_edge: 0.0,
    thin_targets: false,
    tolerance: 10.0,
    least_tolerance: 2.0,
    reach: Reach::Tolerances(2.0),
    max_iterations: 20,
    settled: 0.1,
    overlap_samples: Some(2000),
    min_degree: 0,
    trim: TrimRule::Overlap,
    stop: StopRule::Adaptive,
};

/// The level with plain ICP: every nearest point within a fixed distance (in spacings) counts, as much as any other.
/// Without any bound, points that the other view did not see drag partly overlapping scans on top of each other.
const fn plain(level: Level, distance: f64) -> Level {
    Level { reach: Reach::Spacings(distance), trim: TrimRule::Nothing, stop: STRICT, ..level }
}

/// The level with trimmed ICP that knows no adaptive threshold.
const fn strict(level: Level) -> Level {
    Level { stop: STRICT, ..level }
}

impl Recipe {
    /// The paper's method: trimmed ICP with the adaptive threshold, motion averaging.
    pub const MA_ATICP: Recipe = Recipe { agreement: Agreement::MotionAveraging, levels: &[COARSE, FINE] };
    /// Its first baseline: plain ICP, motion averaging.
    pub const MA_ICP: Recipe =
        Recipe { agreement: Agreement::MotionAveraging, levels: &[plain(COARSE, 18.0), plain(FINE, 6.0)] };
    /// Its second baseline: trimmed ICP, low-rank and sparse decomposition.
    pub const LRS_L1ALM: Recipe =
        Recipe { agreement: Agreement::LowRankSparse, levels: &[strict(COARSE), strict(FINE)] };

    /// [`Recipe::MA_ATICP`] as in the paper's experiments.
    pub const PAPER_MA_ATICP: Recipe = Recipe { levels: &[PAPER], ..Recipe::MA_ATICP };
    /// [`Recipe::MA_ICP`] as in the paper's experiments: its error there (0.85 mm^2 on the bunny) is that of a bound of
    /// three to four spacings, where plain ICP without any gives 8.
    pub const PAPER_MA_ICP: Recipe = Recipe { levels: &[plain(PAPER, 4.0)], ..Recipe::MA_ICP };
    /// [`Recipe::LRS_L1ALM`] as in the paper's experiments.
    pub const PAPER_LRS_L1ALM: Recipe = Recipe { levels: &[strict(PAPER)], ..Recipe::LRS_L1ALM };
}
