//! Standards as they go over the wire.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::base::link;
use super::problem::{Code, Problem};
use super::scan_set_views::UnitView;
use super::schemas::{self, Corners, Landmarks};
use visage_domain::{Examples, JobId, ModelId, StandardId, StandardRecord};
use visage_geometry::Point3;
use visage_service::app::standards::Standing;
use visage_shape::faces::judgement::MATCH_SCORE;
use visage_shape::standards::{Annotation, CornerChoice, CornerKind, Landmark, SelectiveTriangle};

/// What the surface does at a corner.
#[derive(Debug, Clone, Copy, Serialize, Deserialize, ToSchema)]
#[schema(as = CornerKind)]
#[serde(rename_all = "snake_case")]
pub enum KindView {
    /// It stands out in every direction, as a nose tip does.
    Cap,
    /// It is hollow in every direction, as an inner eye corner is.
    Pit,
}

impl From<KindView> for CornerKind {
    fn from(kind: KindView) -> Self {
        match kind {
            KindView::Cap => CornerKind::Cap,
            KindView::Pit => CornerKind::Pit,
        }
    }
}

impl From<CornerKind> for KindView {
    fn from(kind: CornerKind) -> Self {
        match kind {
            CornerKind::Cap => KindView::Cap,
            CornerKind::Pit => KindView::Pit,
        }
    }
}

/// The form by which a standard is made.
#[derive(Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[expect(dead_code, reason = "only describes the form")]
pub struct NewStandardForm {
    #[schema(schema_with = schemas::model_of_class)]
    model: Vec<u8>,
    /// The name that queries ask for: letters, digits, `-` and `_`.
    #[schema(min_length = 1, max_length = 64, pattern = "^[A-Za-z0-9_-]+$", example = "teapot")]
    name: String,
    /// The unit of its coordinates. Where it is known, models of known unit must have about the same size.
    #[schema(required = false)]
    unit: UnitView,
    /// As JSON: 3 to 64 named places of the surface, `{"spout": [x, y, z], ...}`, in the file's coordinates; at least
    /// three of them must be caps or pits.
    #[schema(value_type = Landmarks, example = json!({"spout": [-96, 60, 12], "knob": [0, 79, 0], "handle": [105, 4, 0]}))]
    landmarks: BTreeMap<String, [f64; 3]>,
    /// JSON: the three landmarks that form the selective triangle, `["spout", "knob", "handle"]` or
    /// `[{"landmark": "spout", "kind": "cap"}, ...]`; chosen by their curvature if not given.
    #[schema(required = false)]
    triangle: String,
    /// JSON: ids of stored models of the class.
    #[schema(required = false)]
    positive: String,
    /// JSON: ids of stored models that are other things.
    #[schema(required = false)]
    negative: String,
}

/// Models that are marked for a standard.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = Examples)]
pub struct ExamplesView {
    /// Models of the class.
    #[serde(default)]
    #[schema(required = false, format = "uuid", max_items = 1000)]
    pub positive: Vec<String>,
    /// Other things.
    #[serde(default)]
    #[schema(required = false, format = "uuid", max_items = 1000)]
    pub negative: Vec<String>,
}

/// The most examples of a standard.
const MOST_EXAMPLES: usize = 1000;

impl ExamplesView {
    /// The examples as the database knows them.
    pub fn examples(&self) -> Result<Examples, Problem> {
        let ids =
            |list: &[String]| list.iter().map(|text| super::models::parse_id(text)).collect::<Result<Vec<_>, _>>();
        let (positive, negative) = (ids(&self.positive)?, ids(&self.negative)?);
        let mut all: Vec<ModelId> = positive.iter().chain(&negative).copied().collect();
        let count = all.len();
        all.sort_unstable();
        all.dedup();
        if all.len() < count {
            let hint = "mark each model once, as positive or as negative";
            return Err(Problem::new(Code::InvalidField, "a model is marked twice", hint));
        }
        if count > MOST_EXAMPLES {
            let detail = format!("{count} models are marked; a standard takes at most {MOST_EXAMPLES}");
            return Err(Problem::new(Code::InvalidField, detail, "mark fewer"));
        }
        Ok(Examples { positive, negative })
    }
}

impl From<&Examples> for ExamplesView {
    fn from(examples: &Examples) -> Self {
        let ids = |list: &[ModelId]| list.iter().map(ModelId::to_string).collect();
        ExamplesView { positive: ids(&examples.positive), negative: ids(&examples.negative) }
    }
}

/// Landmarks as a form gives them: alone, or as part of a larger file.
#[derive(Deserialize)]
#[serde(untagged)]
pub enum LandmarksPart {
    /// `{"landmarks": {...}, ...}`
    Within {
        /// Name and position of each.
        landmarks: BTreeMap<String, [f64; 3]>,
    },
    /// `{...}`
    Alone(BTreeMap<String, [f64; 3]>),
}

/// A corner as a form gives it.
#[derive(Deserialize)]
#[serde(untagged)]
pub enum CornerPart {
    /// Its name; the kind is found out.
    Name(String),
    /// Name and kind.
    Kind {
        /// The landmark.
        landmark: String,
        /// Cap or pit.
        kind: Option<KindView>,
    },
}

/// The most landmarks, and the most characters of a name.
const MOST_LANDMARKS: usize = 64;
const LONGEST_NAME: usize = 64;

/// What a user says of the surface.
pub fn annotation(landmarks: LandmarksPart, triangle: Option<[CornerPart; 3]>) -> Result<Annotation, Problem> {
    let (LandmarksPart::Within { landmarks } | LandmarksPart::Alone(landmarks)) = landmarks;
    if landmarks.len() > MOST_LANDMARKS {
        let detail = format!("{} landmarks; at most {MOST_LANDMARKS} are taken", landmarks.len());
        return Err(Problem::new(Code::InvalidField, detail, "name fewer places"));
    }
    let is_plain =
        |name: &str| (1..=LONGEST_NAME).contains(&name.chars().count()) && !name.chars().any(char::is_control);
    if let Some(name) = landmarks.keys().find(|name| !is_plain(name)) {
        let detail = format!("a landmark's name has 1 to {LONGEST_NAME} characters in one line, not {name:?}");
        return Err(Problem::new(Code::InvalidField, detail, "shorten it"));
    }
    let landmark = |(name, place): (String, [f64; 3])| Landmark { name, place: Point3::from(place) };
    let choice = |corner: CornerPart| match corner {
        CornerPart::Name(name) => CornerChoice { name, kind: None },
        CornerPart::Kind { landmark, kind } => CornerChoice { name: landmark, kind: kind.map(Into::into) },
    };
    Ok(Annotation {
        landmarks: landmarks.into_iter().map(landmark).collect(),
        triangle: triangle.map(|corners| corners.map(choice)),
    })
}

/// A standard that can be asked for.
#[derive(Debug, Clone, Serialize, ToSchema)]
#[serde(untagged)]
pub enum AnyStandard {
    /// Made by a user.
    #[schema(title = "uploaded")]
    Uploaded(Box<StandardView>),
    /// Part of the program.
    #[schema(title = "built in")]
    BuiltIn(Box<BuiltInView>),
}

/// A standard that is part of the program.
#[derive(Debug, Clone, Serialize, Deserialize, ToSchema)]
#[schema(as = BuiltInStandard)]
pub struct BuiltInView {
    /// The name that queries ask for.
    #[schema(example = "face")]
    pub name: String,
    /// True.
    pub built_in: bool,
    /// The unit of its figures.
    pub unit: String,
    /// What its axes are.
    pub frame: String,
    /// The landmarks at the corners of its triangle.
    pub corners: Vec<String>,
    /// The triangle as it is annotated.
    #[schema(value_type = Corners)]
    pub facial_triangle: Vec<Vec<f64>>,
    /// The triangle as the operator finds it.
    #[schema(value_type = Corners)]
    pub detected_triangle: Vec<Vec<f64>>,
    /// The size S of the annotated triangle, mm.
    pub size_mm: f64,
    /// Its place on Kendall's sphere.
    pub shape: Vec<f64>,
    /// The score from which on a model is a match.
    pub score_threshold: f64,
    /// The total vertex distance at which the literal method says yes.
    pub thres_ft_mm: f64,
    /// How models may be judged against it.
    pub methods: Vec<String>,
}

/// A selective triangle.
#[derive(Debug, Clone, Serialize, ToSchema)]
#[schema(as = SelectiveTriangle)]
pub struct TriangleView {
    /// The landmarks at its corners.
    pub corners: Vec<String>,
    /// What the surface does there.
    pub kinds: Vec<KindView>,
    /// The size S of the annotated triangle, in the file's unit.
    pub size: f64,
    /// Its place on Kendall's sphere of radius 1/2.
    pub shape: Vec<f64>,
    /// Whether the normals at the corners tell its outer side.
    pub has_side: bool,
}

/// Which models are of the class, and what that rests on.
#[derive(Debug, Clone, Serialize, ToSchema)]
#[schema(as = Threshold)]
pub struct ThresholdView {
    /// The residual at which the score is 0.5, mm on the standard.
    pub limit_mm: f64,
    /// The score from which on a model is a match.
    pub score: f64,
    /// `examples`, or `default` without any that were judged.
    pub rests_on: &'static str,
    /// Examples of the class that it rests on.
    pub positives: usize,
    /// Examples of other things that it rests on.
    pub negatives: usize,
    /// Examples that are not judged yet.
    pub pending: usize,
    /// The share of pairs of a positive and a negative example in the right order; null without such pairs.
    pub auc: Option<f64>,
    /// Examples that the limit learned from the others judges rightly, and examples in all; null without both kinds.
    pub leave_one_out: Option<LeaveOneOutView>,
}

/// How the procedure does on examples it has not seen.
#[derive(Debug, Clone, Serialize, ToSchema)]
#[schema(as = LeaveOneOut)]
pub struct LeaveOneOutView {
    /// Judged rightly.
    pub right: usize,
    /// In all.
    pub of: usize,
}

/// A standard made by a user.
#[derive(Debug, Clone, Serialize, ToSchema)]
#[schema(as = Standard)]
pub struct StandardView {
    /// Its id.
    #[schema(format = "uuid")]
    pub id: String,
    /// The name that queries ask for.
    pub name: String,
    /// False.
    pub built_in: bool,
    /// The unit of its file.
    pub unit: UnitView,
    /// The landmarks, in the coordinates of its file.
    #[schema(value_type = Landmarks)]
    pub landmarks: BTreeMap<String, [f64; 3]>,
    /// The triangles that its place is found by, the most telling first.
    pub triangles: Vec<TriangleView>,
    /// Points of its dense region.
    pub region_points: usize,
    /// Units of its file in one mm on the standard: it is scaled so that its first triangle is as large as the face's.
    pub scale: f64,
    /// The version of the operator that made it.
    pub version: u32,
    /// Which models are of the class.
    pub threshold: ThresholdView,
    /// The models that are marked.
    pub examples: ExamplesView,
    /// Models that are judged against it.
    pub judged: u64,
    /// Models that are not yet.
    pub pending: u64,
    /// When it was stored.
    #[schema(format = DateTime)]
    pub created_at: String,
    /// Its address.
    pub href: String,
    /// The job that judges the stored models, where there are any; only in the answer to the request that made it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub evaluation: Option<String>,
}

/// The address of a standard.
pub fn address(id: StandardId) -> String {
    link(&format!("/v1/standards/{id}"))
}

impl StandardView {
    /// A stored standard.
    pub fn of(standard: &StandardRecord, standing: &Standing, evaluation: Option<JobId>) -> Self {
        let (definition, learned) = (&standard.definition, &standing.learned);
        let marked = standing.examples.positive.len() + standing.examples.negative.len();
        StandardView {
            id: standard.id.to_string(),
            name: standard.name.clone(),
            built_in: false,
            unit: standard.unit.into(),
            landmarks: standard.annotation.landmarks.iter().map(|l| (l.name.clone(), l.place.into())).collect(),
            triangles: definition.triangles.iter().map(|triangle| triangle_view(triangle, definition.scale)).collect(),
            region_points: definition.points.len(),
            scale: definition.scale,
            version: definition.version,
            threshold: ThresholdView {
                limit_mm: learned.limit_mm,
                score: MATCH_SCORE,
                rests_on: if learned.positives + learned.negatives > 0 { "examples" } else { "default" },
                positives: learned.positives,
                negatives: learned.negatives,
                pending: marked.saturating_sub(learned.positives + learned.negatives),
                auc: learned.auc,
                leave_one_out: learned.leave_one_out.map(|l| LeaveOneOutView { right: l.right, of: l.of }),
            },
            examples: (&standing.examples).into(),
            judged: standing.judged.0,
            pending: standing.judged.1,
            created_at: standard.id.created_at().to_string(),
            href: address(standard.id),
            evaluation: evaluation.map(super::job_views::address),
        }
    }
}

fn triangle_view(triangle: &SelectiveTriangle, scale: f64) -> TriangleView {
    let annotated = triangle.annotated();
    TriangleView {
        corners: triangle.corners.iter().map(|corner| corner.name.clone()).collect(),
        kinds: triangle.corners.iter().map(|corner| corner.kind.into()).collect(),
        size: annotated.size() * scale,
        shape: annotated.shape(&triangle.outward()).coordinates().to_vec(),
        has_side: triangle.has_side(),
    }
}

/// The list of standards.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct StandardList {
    /// The built-in one first, then those of users in the order in which they were made.
    pub items: Vec<AnyStandard>,
}
