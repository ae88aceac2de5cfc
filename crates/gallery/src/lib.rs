//! Which models are alike: an exact index of faces, triangles and shapes in memory. Pure.
//!
//! ```
//! use visage_gallery::{Gallery, TopK};
//! use visage_shape::faces::signature::example::example;
//!
//! let gallery = Gallery::build((1..=20).map(|id| (id, example(0.3 * id as f64, 4))).collect());
//! let found = gallery.by_probe(&example(0.3 * 7.0, 4), None, &TopK::best(3));
//! assert_eq!(found[0].model_id, 7, "a model is most like itself");
//! ```
//!
//! - [`gallery`]: which models there are, their ranking against each standard (`by_standard`; scores are made by
//!   `visage_shape::faces::judgement`), the three kinds of query
//! - `top_k`, [`catalogue`]: which part of a ranking is asked for; filters by label, time, unit, source
//! - [`evidence`]: the figures behind a verdict, landmarks, the reason for a no
//! - `segment`, `live_segment`: some of the models, packed and indexed; [`merge`]: how segments grow; `merged_ranking`: their rankings as one;
//!   `gathered`: those of galleries that are searched apart
//! - `indexed_model`: one model made ready; `outline`: its triangles' corners
//! - [`triangles`]: a model's triangles as points of Kendall's sphere
//! - [`triangle_index`]: those points of many models in one static tree; `triangle_query`: a bare triangle in every way
//!   it may be met
//! - `probe`: the search for the models that look like a probe; `likeness`: what that means, put together of
//!   `shape_rows` and `dense_rows`; `probe_pass`, `face_order`: what rules out most models before that, by their `pca_code`, their
//!   `partial_distance` and a `trimmed_lower_bound` of it
//! - `near_shapes`: what may be the same thing as a stored model
//! - `region_likeness`, `by_regions`: the paper's likeness, by triangles; `by_view`: that of single scans
//! - `best`: the best few so far
//! - [`segment_handle`]: segments to and from bytes; `column`, `columns`: arrays that are owned or lent by a file, and where they lie in it;
//!   `facet_rows`: what filters ask, packed
//! - [`measures`]: how well a ranking tells two classes apart

mod best;
mod by_regions;
mod by_view;
pub mod catalogue;
mod column;
pub mod columns;
mod dense_rows;
pub mod evidence;
mod face_order;
mod facet_rows;
pub mod gallery;
mod gathered;
mod indexed_model;
mod likeness;
mod live_segment;
pub mod measures;
pub mod merge;
mod merged_ranking;
mod near_shapes;
mod outline;
mod partial_distance;
mod pca_basis;
mod pca_code;
mod probe;
mod probe_pass;
mod region_likeness;
mod segment;
pub mod segment_handle;
mod shape_rows;
mod top_k;
pub mod triangle_index;
mod triangle_query;
pub mod triangles;
mod trimmed_lower_bound;

pub use catalogue::{Catalogue, Facets, Filter, Source};
pub use columns::{SegmentError, SegmentImage};
pub use evidence::{Evidence, Reason};
pub use gallery::Gallery;
pub use gathered::gathered;
pub use indexed_model::IndexedModel;
pub use likeness::SAME_PERSON_MM;
pub use probe::{Comparison, Likeness, PROBE_MATCH_SCORE, compare, likenesses};
pub use segment_handle::SegmentHandle;
pub use top_k::{Rank, TopK};
pub use visage_shape::faces::MatchMethod;

use visage_geometry::Point3;
use visage_shape::faces::{self, FaceStandard, Signature, Verdict, judgement, standard};

/// A model's identifier (the bytes of its UUID as a number: ordered by time).
pub type ModelId = u128;

/// One ranked answer.
#[derive(Debug, Clone, PartialEq)]
pub struct Match {
    /// The stored model (0 for a probe that is judged without being stored).
    pub model_id: ModelId,
    /// In [0, 1], high is good.
    pub score: f64,
    /// Least-squares matching error, mm on the standard; for a query by probe or triangle: of the best pair of
    /// triangles, the query's scaled to the size of the standard face triangle.
    pub matching_error_mm: f64,
    /// The paper's total vertex distance, on the same scale.
    pub sum_of_distances_mm: f64,
    /// Whether `score` passes the threshold.
    pub is_match: bool,
    /// The corners in the model's frame: right eye, left eye, nose (for faces).
    pub triangle: Option<[[f64; 3]; 3]>,
}

impl Match {
    fn of(model_id: ModelId, verdict: &Verdict, threshold: f64) -> Match {
        Match {
            model_id,
            score: verdict.score,
            matching_error_mm: verdict.matching_error_mm,
            sum_of_distances_mm: verdict.sum_of_distances_mm,
            is_match: verdict.score >= threshold,
            triangle: verdict.triangle.map(|corners| corners.map(|p: Point3| p.into())),
        }
    }
}

/// The score from which on a model has the triangle that was asked for.
pub fn triangle_match_score() -> f64 {
    triangle_query::TriangleQuery::match_score()
}

/// One probe judged against a standard without being stored; `None` if there is no such standard.
pub fn judge(probe: &Signature, standard: &str, method: MatchMethod) -> Option<Match> {
    let standard = standard::by_name(standard)?;
    Some(Match::of(0, &faces::judge(probe, &standard, method), judgement::MATCH_SCORE))
}

/// The standards that are built in, as the API lists them.
pub fn standards() -> Vec<serde_json::Value> {
    vec![standard_json(&standard::face())]
}

fn standard_json(standard: &FaceStandard) -> serde_json::Value {
    let corners = |t: &faces::Triangle| t.corners.map(<[f64; 3]>::from);
    serde_json::json!({
        "name": standard.name,
        "built_in": true,
        "unit": "mm",
        "frame": "x: subject's left, y: up, z: out of the face",
        "corners": ["eye_r_inner", "eye_l_inner", "nose_tip"],
        "facial_triangle": corners(&standard.annotated),
        "detected_triangle": corners(&standard.detected),
        "size_mm": standard.annotated.size(),
        "shape": standard.annotated_shape().coordinates(),
        "score_threshold": judgement::MATCH_SCORE,
        "thres_ft_mm": judgement::THRES_FT_MM,
        "methods": MatchMethod::ALL.iter().map(|method| method.name()).collect::<Vec<_>>(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_shape::faces::signature::example::example;

    #[test]
    fn the_face_lists_every_method_under_the_name_that_queries_use() {
        let listed = standards()[0]["methods"].clone();
        assert_eq!(listed, serde_json::json!(MatchMethod::ALL), "as a query spells them");
        assert_eq!(listed[0], serde_json::json!(MatchMethod::default()));
        assert_eq!(listed.as_array().map(Vec::len), Some(3));
    }

    #[test]
    fn only_known_standards_are_judged() {
        assert_eq!(judge(&example(0.1, 5), "teapot", MatchMethod::Literal), None);
        let verdict = judge(&example(0.1, 5), "face", MatchMethod::Descriptors).expect("the face is built in");
        assert_eq!(verdict.is_match, verdict.score >= 0.5);
        assert!(verdict.triangle.is_some());
    }

    #[test]
    fn without_regions_there_is_no_triangle_and_no_match() {
        let verdict = judge(&example(0.1, 2), "face", MatchMethod::Literal).expect("the face is built in");
        assert_eq!((verdict.score, verdict.is_match, verdict.triangle), (0.0, false, None));
        assert!(verdict.matching_error_mm.is_finite());
    }

    #[test]
    fn the_face_is_listed_with_its_figures() {
        let listed = standards();
        assert_eq!(listed[0]["name"], "face");
        assert!((listed[0]["size_mm"].as_f64().expect("a number") - 47.05).abs() < 0.01);
    }
}
