//! Is it of the standard's class? The verdict on a signature, by either method.

use super::dense_fit::Fit;
use super::signature::Signature;
use super::standard::FaceStandard;
use super::sum_of_distances::sum_of_distances;
use super::triangle::Triangle;
use super::triangle_candidates::Cost;
use visage_geometry::{Point3, Vector3};

/// How a model is judged against a standard.
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
)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum MatchMethod {
    /// Triangles of salient regions with roles, chirality and normals, then the standard's surface fitted there: the residual
    /// decides.
    #[default]
    Verified,
    /// The triangles alone.
    Descriptors,
    /// The paper's triangle alone: kept for its Table 3, finds faces on anything.
    Literal,
}

impl MatchMethod {
    /// Every method, the default first.
    pub const ALL: &[MatchMethod] = <MatchMethod as strum::VariantArray>::VARIANTS;

    /// The name used in queries and answers.
    pub fn name(self) -> &'static str {
        self.into()
    }
}

/// How a signature was judged.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Verdict {
    /// In [0, 1], high is good, calibrated.
    pub score: f64,
    /// Least-squares matching error E_FT, mm on the standard.
    pub matching_error_mm: f64,
    /// The paper's total vertex distance, mm on the standard.
    pub sum_of_distances_mm: f64,
    /// The best triangle: right eye, left eye, nose; in the model's frame and unit.
    pub triangle: Option<[Point3; 3]>,
    /// What the triangle costs, for the descriptors method.
    pub cost: Option<Cost>,
    /// How the standard's surface fits, for the verified method.
    pub fit: Option<Fit>,
}

/// Scores from this on are a match: a face is then likelier than not, on the set that the score was fitted to.
pub const MATCH_SCORE: f64 = 0.5;

// The scores are logistic in the method's figure; both parameters are the maximum-likelihood fit over all models
// of the public set at once (39 faces, 47 others), every one described as if its unit were unknown.

/// The cost at which a face and another thing are equally likely.
pub const COST_AT_HALF: f64 = 2.05;
visage_geometry::tuning! {
    const TUNING: Tuning {
        /// How fast the score falls with the cost.
        cost_slope: f64 = 4.9,
        /// How fast the score falls with the residual, per mm: those two then score about 0.9 and 0.1.
        residual_slope: f64 = 3.7,
        /// How fast the literal score falls with the total vertex distance, per mm.
        literal_slope: f64 = 0.34,
    }
}

/// The dense residual at which the verified method says "face", mm on the standard: the geometric mean of the worst
/// face's and the best other thing's on the public set, which it splits without error.
pub const RESIDUAL_AT_HALF_MM: f64 = 2.5;
/// `Thres_FT`: the total vertex distance at which the literal method says "face", mm on the standard.
///
/// The paper prints none. At 2.8 mm it finds two thirds of the faces of the public set and takes four in ten other
/// things for faces; no value does much better, since with N = 10 the best triangle of any object is about as near.
pub const THRES_FT_MM: f64 = 2.8;

fn logistic(x: f64) -> f64 {
    1.0 / (1.0 + (-x).exp())
}

fn descriptor_score(cost: f64) -> f64 {
    logistic(TUNING.cost_slope * (COST_AT_HALF - cost))
}

fn fit_score(residual_mm: f64) -> f64 {
    logistic(TUNING.residual_slope * (RESIDUAL_AT_HALF_MM - residual_mm))
}

fn literal_score(sum_of_distances_mm: f64) -> f64 {
    logistic(TUNING.literal_slope * (THRES_FT_MM - sum_of_distances_mm))
}

impl Verdict {
    /// No triangle at all.
    fn none(standard: &FaceStandard) -> Verdict {
        // a point for a triangle leaves the whole standard
        let error = standard.annotated.size();
        Verdict {
            score: 0.0,
            matching_error_mm: error,
            sum_of_distances_mm: 3f64.sqrt() * error,
            triangle: None,
            cost: None,
            fit: None,
        }
    }
}

/// Judges a signature against a standard.
pub fn judge(signature: &Signature, standard: &FaceStandard, method: MatchMethod) -> Verdict {
    match method {
        MatchMethod::Descriptors => by_descriptors(signature, standard),
        MatchMethod::Verified => by_fit(signature, standard),
        MatchMethod::Literal => by_triangle(signature, standard),
    }
}

/// The cheapest facial triangle.
fn by_descriptors(signature: &Signature, standard: &FaceStandard) -> Verdict {
    let costs = signature.candidates().map(|c| (c.cost(standard), c));
    let Some((cost, best)) = costs.min_by(|a, b| a.0.total().total_cmp(&b.0.total())) else {
        return Verdict::none(standard);
    };
    let (triangle, outward) = (best.triangle(), best.outward());
    Verdict {
        score: descriptor_score(cost.total()),
        matching_error_mm: triangle
            .shape(&outward)
            .matching_error(&standard.detected_shape(), standard.detected.size()),
        sum_of_distances_mm: sum_of_distances(&triangle, &outward, &standard.detected, &standard.outward),
        triangle: Some(best.corners),
        cost: Some(cost),
        fit: None,
    }
}

/// The best fit of the standard's surface. The triangle is the annotated one as the fit lays it into the model.
fn by_fit(signature: &Signature, standard: &FaceStandard) -> Verdict {
    let Some(fit) = signature.fit() else {
        return Verdict::none(standard);
    };
    let triangle = standard.annotated.corners.map(|p| fit.pose.point(&p));
    Verdict {
        score: fit_score(fit.residual_mm),
        triangle: Some(triangle),
        fit: Some(fit),
        ..by_descriptors(signature, standard)
    }
}

/// Algorithm 2 of the paper: all C(N, 3) triangles of the salient regions, all labelings, the least E_FT.
///
/// The paper's alignment brings the planes together without asking which side is outside, so a triangle may
/// be seen from either side: six labelings, each with the side that its own winding gives.
fn by_triangle(signature: &Signature, standard: &FaceStandard) -> Verdict {
    let regions: Vec<Point3> = signature.regions().map(|r| r.center).collect();
    let shape_standard = standard.annotated_shape();
    let mut best: Option<(f64, Triangle, Vector3)> = None;
    for [a, b, c] in triples(&regions) {
        for corners in [[a, b, c], [b, c, a], [c, a, b], [b, a, c], [a, c, b], [c, b, a]] {
            let triangle = Triangle::new(corners);
            // the winding of FT_S as seen from outside: right eye, left eye, nose run clockwise
            let outward = -(corners[1] - corners[0]).cross(&(corners[2] - corners[0]));
            let error = triangle.shape(&outward).matching_error(&shape_standard, standard.annotated.size());
            // sqrt 2 times this error is the least the sum of distances can be: most need no closer look
            if best.as_ref().is_none_or(|(sum, ..)| 2f64.sqrt() * error < *sum) {
                let sum = sum_of_distances(&triangle, &outward, &standard.annotated, &standard.outward);
                if best.as_ref().is_none_or(|(least, ..)| sum < *least) {
                    best = Some((sum, triangle, outward));
                }
            }
        }
    }
    let Some((sum, triangle, outward)) = best else {
        return Verdict::none(standard);
    };
    Verdict {
        score: literal_score(sum),
        matching_error_mm: triangle.shape(&outward).matching_error(&shape_standard, standard.annotated.size()),
        sum_of_distances_mm: sum,
        triangle: Some(triangle.corners),
        cost: None,
        fit: None,
    }
}

/// All choices of three, in lexicographic order.
pub fn triples<T: Copy>(items: &[T]) -> impl Iterator<Item = [T; 3]> + '_ {
    (0..items.len()).flat_map(move |i| {
        (i + 1..items.len()).flat_map(move |j| (j + 1..items.len()).map(move |k| [items[i], items[j], items[k]]))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_are_n_choose_three_triangles() {
        let all: Vec<[i32; 3]> = triples(&[1, 2, 3, 4]).collect();
        assert_eq!(all, [[1, 2, 3], [1, 2, 4], [1, 3, 4], [2, 3, 4]]);
        assert_eq!(triples(&[0; 10]).count(), 120);
        assert_eq!(triples(&[0; 2]).count(), 0);
    }

    #[test]
    fn the_thresholds_are_where_the_score_is_half() {
        assert_eq!(literal_score(THRES_FT_MM), MATCH_SCORE);
        assert_eq!(descriptor_score(COST_AT_HALF), MATCH_SCORE);
        assert_eq!(fit_score(RESIDUAL_AT_HALF_MM), MATCH_SCORE);
        assert!(descriptor_score(0.0) > 0.99 && descriptor_score(6.0) < 0.01);
    }
}
