//! The registration methods a caller may choose.

use crate::averaging::{self, Level, Recipe};
use crate::joint::{self, Pass};
use crate::outcome::{MethodOptions, Outcome};
use crate::pairwise::{self, Pairwise};
use crate::view::View;
use visage_geometry::Motion;
use visage_geometry::names::UnknownName;
use visage_geometry::progress::{Canceled, Progress};

/// How a scan set is registered.
#[derive(
    Debug,
    Clone,
    Copy,
    Default,
    PartialEq,
    Eq,
    serde::Serialize,
    serde::Deserialize,
    strum::VariantArray,
    strum::IntoStaticStr,
    strum::EnumString,
    strum::Display,
)]
#[serde(rename_all = "kebab-case")]
#[strum(serialize_all = "kebab-case", parse_err_ty = UnknownName, parse_err_fn = no_method)]
pub enum Method {
    /// All poses refined together on all correspondences, coarse to fine: no averaging error is left.
    #[default]
    Joint,
    /// Algorithm 1 of the paper: trimmed ICP with the adaptive threshold, motion averaging, repeat.
    MaAticp,
    /// The paper's first baseline: plain ICP, motion averaging, repeat.
    MaIcp,
    /// The paper's second baseline: trimmed ICP, low-rank and sparse decomposition, repeat.
    LrsL1alm,
    /// Trimmed ICP of two scans.
    Tricp,
    /// Plain ICP of two scans.
    Icp,
}

impl Method {
    /// Every method, the default first.
    pub const ALL: &[Method] = <Method as strum::VariantArray>::VARIANTS;

    /// The name used in options, reports and messages.
    pub fn name(self) -> &'static str {
        self.into()
    }

    /// The number of scans it takes, if it does not take any number.
    pub fn exact_scans(self) -> Option<usize> {
        match self {
            Method::Joint | Method::MaAticp | Method::MaIcp | Method::LrsL1alm => None,
            Method::Tricp | Method::Icp => Some(pairwise::SCANS),
        }
    }

    /// What its levels run with, for reports.
    pub fn levels(self) -> Levels {
        match self {
            Method::Joint => Levels::Joint(&joint::PASSES),
            Method::MaAticp => Levels::Averaging(Recipe::MA_ATICP.levels),
            Method::MaIcp => Levels::Averaging(Recipe::MA_ICP.levels),
            Method::LrsL1alm => Levels::Averaging(Recipe::LRS_L1ALM.levels),
            Method::Tricp => Levels::Pairwise([Pairwise::TRICP]),
            Method::Icp => Levels::Pairwise([Pairwise::ICP]),
        }
    }

    /// Registers `views` from `initial` poses (local frame to world). View 0 keeps its pose.
    pub fn register(
        self,
        views: &[View],
        initial: &[Motion],
        options: &MethodOptions,
        progress: &Progress,
    ) -> Result<Outcome, Canceled> {
        match self {
            Method::Joint => joint::joint(views, initial, options, progress),
            Method::MaAticp => averaging::register(&Recipe::MA_ATICP, views, initial, options, progress),
            Method::MaIcp => averaging::register(&Recipe::MA_ICP, views, initial, options, progress),
            Method::LrsL1alm => averaging::register(&Recipe::LRS_L1ALM, views, initial, options, progress),
            Method::Tricp => Pairwise::TRICP.register(views, initial, progress),
            Method::Icp => Pairwise::ICP.register(views, initial, progress),
        }
    }
}

/// What the levels of a method run with.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
#[serde(untagged)]
pub enum Levels {
    /// Of the joint refinement.
    Joint(&'static [Pass]),
    /// Of registration by pairs and motion averaging.
    Averaging(&'static [Level]),
    /// Of one pair.
    Pairwise([Pairwise; 1]),
}

fn no_method(text: &str) -> UnknownName {
    UnknownName::of::<Method>("method", text)
}
