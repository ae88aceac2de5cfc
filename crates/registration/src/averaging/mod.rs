//! Multi-view registration: Algorithm 1 of the paper, coarse to fine.
//!
//! A round is: directed overlaps, pairs above xi_0, ICP of each pair from the current poses, agreement of the relative
//! motions. Rounds repeat until no view turns any more. The members of the family differ in what ICP keeps, when it
//! ends and how motions are made to agree: a [`Recipe`]. The paper runs on all points; here the *queries* are thinned to
//! voxels (targets keep all points), the first level is coarse, and searches are bounded: all of it is reported.
//!
//! - [`rounds`]: the loop, Algorithm 1; [`agreement`]: from relative motions to poses
//! - [`motion_averaging`]: on SE(3), the paper's [P3] to [P10]; [`low_rank`]: the baseline LRS-L1ALM
//! - [`recipe`]: the members of the family; a new one is a [`Recipe`] there

mod agreement;
pub mod low_rank;
pub mod motion_averaging;
pub mod paper_objective;
mod recipe;
mod rounds;

pub use self::recipe::{Agreement, Level, Reach, Recipe, StopRule, TrimRule};
pub use self::rounds::register;
