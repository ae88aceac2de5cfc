//! Where a face is: what is taken out of a copy that must not show whose it is.

use super::judgement::{MATCH_SCORE, MatchMethod, judge};
use super::modes::{self, LANDMARKS};
use super::similarity::Similarity;
use super::{Signature, standard, template};
use visage_geometry::Point3;

/// How far the outline of the standard's region is grown, mm on the standard: temples, brows and chin tell persons apart too.
const MARGIN_MM: f64 = 14.0;
/// The half width of the outline, mm: that of the standard's region.
const HALF_WIDTH_MM: f64 = 56.0;
/// The highest place of the standard's region, mm.
const HIGHEST_MM: f64 = 72.0;
/// How far behind the deepest place of the standard's region its face ends, mm.
const DEPTH_MM: f64 = 10.0;
/// How far the face may stand out before the standard's highest place, mm: noses, beards, glasses.
const OUT_MM: f64 = 40.0;

/// The region of a face that was found.
#[derive(Debug, Clone, PartialEq)]
pub struct FaceExtent {
    pose: Similarity,
    /// The lowest place of the outline, mm on the standard: below the chin.
    lowest: f64,
    /// From the back to the front, mm on the standard.
    depth: [f64; 2],
}

impl FaceExtent {
    /// The region of the face that a signature holds; `None` if it holds none.
    pub fn of(signature: &Signature) -> Option<FaceExtent> {
        let verdict = judge(signature, &standard::face(), MatchMethod::Verified);
        let fit = verdict.fit.filter(|_| verdict.score >= MATCH_SCORE)?;
        let shaped = template::face().shaped(&fit.weights, template::TEMPLATE_POINTS);
        let z = || shaped.points.iter().map(|point| point.z);
        let depth = [z().fold(f64::INFINITY, f64::min) - DEPTH_MM, z().fold(f64::NEG_INFINITY, f64::max) + OUT_MM];
        let chin = LANDMARKS.iter().position(|name| *name == "chin");
        let found = chin.zip(signature.landmarks()).map(|(chin, all)| fit.pose.standard_point(&all[chin]).y);
        let carried = chin.map_or(0.0, |chin| modes::landmarks(&fit.weights)[chin].y);
        Some(FaceExtent { pose: fit.pose, lowest: found.unwrap_or(carried).min(carried) - MARGIN_MM, depth })
    }

    /// Whether a place of the model is in it.
    pub fn holds(&self, place: &Point3) -> bool {
        let at = self.pose.standard_point(place);
        let middle = (HIGHEST_MM + MARGIN_MM + self.lowest) / 2.0;
        let half_height = (HIGHEST_MM + MARGIN_MM - self.lowest) / 2.0;
        let frame = (at.x / (HALF_WIDTH_MM + MARGIN_MM)).powi(4) + ((at.y - middle) / half_height).powi(4);
        frame < 1.0 && (self.depth[0]..=self.depth[1]).contains(&at.z)
    }
}
