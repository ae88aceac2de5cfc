//! What speaks for and against a model: the figures behind a verdict, its landmarks, and the reason for a no.

use visage_geometry::{Point3, Unit};
use visage_shape::faces::modes::LANDMARKS;
use visage_shape::faces::{self, FaceStandard, MatchMethod, Signature, Verdict, judgement};

/// Why a model is no match.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Reason {
    /// Nowhere are there the places that make a triangle.
    NoTriangle,
    /// There are triangles, but nowhere does the standard's surface come near.
    NoSurface,
    /// The surface at the best place is another one.
    SurfaceDiffers {
        /// What is left between the two, mm on the standard.
        residual_mm: f64,
    },
    /// The best triangle is not the standard's.
    TriangleDiffers {
        /// What it costs.
        cost: f64,
    },
    /// The corners of the best triangle are too far off.
    CornersDiffer {
        /// The paper's total vertex distance, mm on the standard.
        sum_of_distances_mm: f64,
    },
    /// The score does not reach the threshold that was asked for, or of a question without a standard.
    BelowThreshold {
        /// The score.
        score: f64,
        /// The threshold.
        threshold: f64,
    },
}

impl Reason {
    /// A stable name.
    pub fn code(&self) -> &'static str {
        match self {
            Reason::NoTriangle => "no_triangle",
            Reason::NoSurface => "no_surface",
            Reason::SurfaceDiffers { .. } => "surface_differs",
            Reason::TriangleDiffers { .. } => "triangle_differs",
            Reason::CornersDiffer { .. } => "corners_differ",
            Reason::BelowThreshold { .. } => "below_threshold",
        }
    }
}

impl std::fmt::Display for Reason {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Reason::NoTriangle => write!(f, "no three places on it are salient the way the standard's are"),
            Reason::NoSurface => write!(f, "the standard's surface lies nowhere near its own"),
            Reason::SurfaceDiffers { residual_mm } => {
                let limit = judgement::RESIDUAL_AT_HALF_MM;
                write!(f, "its surface differs from the standard's by {residual_mm:.2} mm; {limit} mm is the most")
            }
            Reason::TriangleDiffers { cost } => {
                write!(f, "its best triangle costs {cost:.2}; {} is the most", judgement::COST_AT_HALF)
            }
            Reason::CornersDiffer { sum_of_distances_mm } => {
                let limit = judgement::THRES_FT_MM;
                write!(f, "its best triangle is {sum_of_distances_mm:.2} mm off; {limit} mm is the most")
            }
            Reason::BelowThreshold { score, threshold } => {
                write!(f, "its score is {score:.3}; {threshold:.3} was asked for")
            }
        }
    }
}

/// A verdict with what it rests on.
#[derive(Debug, Clone, PartialEq)]
pub struct Evidence {
    /// The method it was reached by.
    pub method: MatchMethod,
    /// Score and figures.
    pub verdict: Verdict,
    /// From which score on it is a match.
    pub threshold: f64,
    /// The landmarks in the model's frame and unit, by name; empty unless the dense check finds the standard there.
    pub landmarks: Vec<(&'static str, Point3)>,
    /// How many triangles there were to choose from.
    pub candidates: usize,
    /// That the unit given makes the model too small or too large for the standard, in words, if so.
    pub size_in_doubt: Option<String>,
}

impl Evidence {
    /// Judges a signature; the standard's own threshold applies if none is given.
    pub fn new(
        signature: &Signature,
        standard: &FaceStandard,
        method: MatchMethod,
        threshold: Option<f64>,
    ) -> Evidence {
        let verdict = faces::judge(signature, standard, method);
        let threshold = threshold.unwrap_or(judgement::MATCH_SCORE);
        let dense = match method {
            MatchMethod::Verified => verdict,
            _ => faces::judge(signature, standard, MatchMethod::Verified),
        };
        let is_there = dense.fit.is_some() && dense.score >= judgement::MATCH_SCORE.min(threshold);
        let landmarks = signature.landmarks().filter(|_| is_there);
        Evidence {
            method,
            verdict,
            threshold,
            size_in_doubt: size_in_doubt(signature, standard),
            landmarks: landmarks.map(|places| LANDMARKS.into_iter().zip(places).collect()).unwrap_or_default(),
            candidates: match method {
                MatchMethod::Literal => judgement::triples(&signature.regions().collect::<Vec<_>>()).count(),
                _ => signature.candidates().count(),
            },
        }
    }

    /// Whether the score reaches the threshold.
    pub fn is_match(&self) -> bool {
        self.verdict.score >= self.threshold
    }

    /// Why it is no match; `None` if it is one.
    pub fn reason(&self) -> Option<Reason> {
        let Verdict { score, sum_of_distances_mm, triangle, cost, fit, .. } = self.verdict;
        if self.is_match() {
            return None;
        }
        if self.candidates == 0 && triangle.is_none() {
            return Some(Reason::NoTriangle);
        }
        let by_own_threshold = score < judgement::MATCH_SCORE;
        Some(match (self.method, fit, cost) {
            (MatchMethod::Verified, None, _) => Reason::NoSurface,
            (MatchMethod::Verified, Some(fit), _) if by_own_threshold => {
                Reason::SurfaceDiffers { residual_mm: fit.residual_mm }
            }
            (MatchMethod::Descriptors, _, Some(cost)) if by_own_threshold => {
                Reason::TriangleDiffers { cost: cost.total() }
            }
            (MatchMethod::Literal, ..) if by_own_threshold => Reason::CornersDiffer { sum_of_distances_mm },
            _ => Reason::BelowThreshold { score, threshold: self.threshold },
        })
    }
}

/// The diagonals of things that hold what a standard is of, in sizes of its triangle: from a mask to a bust.
const SIZES: std::ops::Range<f64> = 2.0..20.0;
/// A scene may be larger than what is looked for in it, but not so much.
const LARGEST: f64 = 400.0;

/// What is wrong with the size of a model in its unit, if in another unit it would be that of what is looked for.
fn size_in_doubt(signature: &Signature, standard: &FaceStandard) -> Option<String> {
    let mm = signature.unit_mm()?;
    let size = standard.annotated.size();
    let of = |mm: f64| signature.diagonal() * mm / size;
    if (SIZES.start..LARGEST).contains(&of(mm)) {
        return None;
    }
    let units = [Unit::Mm, Unit::Cm, Unit::M, Unit::In];
    let (other, other_mm) =
        units.iter().filter_map(|unit| Some((unit, unit.in_mm()?))).find(|(_, mm)| SIZES.contains(&of(*mm)))?;
    Some(format!(
        "its diagonal is {} in the unit given, and would be {} in {}: is the unit right?",
        length(signature.diagonal() * mm),
        length(signature.diagonal() * other_mm),
        other.name()
    ))
}

/// A length in words, for people.
fn length(mm: f64) -> String {
    match mm {
        mm if mm < 10.0 => format!("{mm:.2} mm"),
        mm if mm < 10_000.0 => format!("{mm:.0} mm"),
        mm => format!("{:.0} m", mm / 1000.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_shape::faces::Size;
    use visage_shape::faces::dense_fit::Fit;
    use visage_shape::faces::detection::Detection;
    use visage_shape::faces::signature::example::example;
    use visage_shape::faces::standard;

    fn evidence(seed: f64, count: usize, method: MatchMethod, threshold: Option<f64>) -> Evidence {
        Evidence::new(&example(seed, count), &standard::face(), method, threshold)
    }

    #[test]
    fn a_face_has_its_landmarks_and_no_reason() {
        // residuals of the examples are 1.5 + sin(seed)
        let face = evidence(-1.0, 8, MatchMethod::Verified, None);
        assert!(face.is_match() && face.reason().is_none());
        assert_eq!(face.landmarks.len(), LANDMARKS.len());
        assert_eq!(face.landmarks[4].0, "nose_tip");
        assert_eq!(face.candidates, 1);
    }

    #[test]
    fn a_size_that_another_unit_would_explain_is_said() {
        let standard = standard::face();
        let of = |diagonal: f64, unit: Unit| {
            let size = Size { origin: Point3::origin(), diagonal, radius: diagonal / 4.0, unit };
            size_in_doubt(&Signature::new(&size, &[], &Detection { candidates: Vec::new(), face: None }), &standard)
        };
        let found = of(0.3, Unit::Mm).expect("a head in metres");
        assert_eq!(found, "its diagonal is 0.30 mm in the unit given, and would be 300 mm in m: is the unit right?");
        assert!(
            of(300.0, Unit::M)
                .expect("a head in millimetres")
                .starts_with("its diagonal is 300 m in the unit given, and")
        );
        assert_eq!((of(300.0, Unit::Mm), of(0.3, Unit::M), of(0.3, Unit::Unknown)), (None, None, None));
        assert_eq!((of(1.8, Unit::M), of(8.0, Unit::M)), (None, None), "a person, and a room");
    }

    #[test]
    fn a_no_names_what_was_wrong() {
        let face = evidence(-1.0, 8, MatchMethod::Verified, None);
        let fit = face.verdict.fit.map(|fit| Fit { residual_mm: 3.25, ..fit });
        let no = Evidence { verdict: Verdict { score: 0.2, fit, ..face.verdict }, ..face };
        assert_eq!(no.reason(), Some(Reason::SurfaceDiffers { residual_mm: 3.25 }));
        assert!(no.reason().is_some_and(|reason| reason.to_string().contains("3.25 mm; 2.5 mm is the most")));
        let strict = evidence(-1.0, 8, MatchMethod::Verified, Some(0.9999));
        assert!(matches!(strict.reason(), Some(Reason::BelowThreshold { threshold: 0.9999, .. })));
        assert_eq!(strict.landmarks.len(), LANDMARKS.len(), "it is a face all the same");
        let none = evidence(0.1, 2, MatchMethod::Literal, None);
        assert_eq!(none.reason(), Some(Reason::NoTriangle));
        let off = evidence(0.1, 3, MatchMethod::Literal, None);
        assert_eq!(off.candidates, 1);
        assert_eq!(off.reason().map(|reason| reason.code()), Some("corners_differ"));
    }
}
