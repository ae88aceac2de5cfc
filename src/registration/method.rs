//! The registration methods a caller may choose.

use super::joint;
use super::multiview::{self, Multiview, MultiviewOptions};
use super::view::View;
use crate::geometry::Motion;
use crate::progress::{Canceled, Progress};

/// How a scan set is registered.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// All poses refined together on all correspondences, coarse to fine: no averaging error is left.
    #[default]
    Joint,
    /// Algorithm 1 of the paper: trimmed ICP with the adaptive threshold, motion averaging, repeat.
    MaAticp,
}

impl Method {
    /// Every method, the default first.
    pub const ALL: [Method; 2] = [Method::Joint, Method::MaAticp];

    /// The name used in options, reports and messages.
    pub fn name(self) -> &'static str {
        match self {
            Method::Joint => "joint",
            Method::MaAticp => "ma-aticp",
        }
    }

    /// What its levels run with, for reports.
    pub fn levels(self) -> serde_json::Value {
        match self {
            Method::Joint => serde_json::json!(joint::PASSES),
            Method::MaAticp => serde_json::json!(multiview::LEVELS),
        }
    }

    /// Registers `views` from `initial` poses (local frame to world). View 0 keeps its pose.
    pub fn register(
        self,
        views: &[View],
        initial: &[Motion],
        options: &MultiviewOptions,
        progress: &Progress,
    ) -> Result<Multiview, Canceled> {
        match self {
            Method::Joint => joint::joint(views, initial, options, progress),
            Method::MaAticp => multiview::ma_aticp(views, initial, &multiview::LEVELS, options, progress),
        }
    }
}

impl std::fmt::Display for Method {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

impl std::str::FromStr for Method {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let names = Method::ALL.map(Method::name);
        Method::ALL
            .into_iter()
            .find(|method| method.name() == text)
            .ok_or_else(|| format!("{text:?} is no method; use one of: {}", names.join(", ")))
    }
}
