//! From a surface to its facial triangles, over all scale levels and, where it is open, both sides; then the dense
//! check of the best of them.

use super::candidates::{Candidate, candidates};
use super::dense::DenseSignature;
use super::features::{features, places};
use super::landmarks::{self, Landmarks};
use super::modes::Weights;
use super::similarity::Similarity;
use super::standard::{INNER_EYE_DISTANCE_MM, Standard};
use super::target::Target;
use super::template::{self, TEMPLATE_POINTS};
use super::verification::{Fit, KEPT_SHARE, PROPORTION_WEIGHT, Placement, RIGID_PROPORTIONS, Search, fit_pose, score};
use crate::geometry::{Bounds, Mesh, Motion, Point3, Unit, Vector3};
use crate::progress::{Canceled, Progress};
use crate::saliency::{CellGrid, Patches, Samples, Side};

/// Expected inner-eye distances as shares of the bounding box's diagonal, for files of unknown unit: from a
/// torso up to a mask from brow to mouth (the faces of the public set: 0.048 to 0.16).
const LEVELS_OF_DIAGONAL: [f64; 6] = [0.045, 0.06, 0.08, 0.106, 0.141, 0.188];
/// The same where the unit is known, as shares of the standard's inner-eye distance: people differ, and a nose or an
/// eye corner that is missed at one scale is met at the next.
const LEVELS_OF_TRUE_SIZE: [f64; 3] = [0.85, 1.0, 1.18];
/// Where the unit is known, a face must have this size relative to the standard (74 faces: 0.85 to 1.16).
const TRUE_SIZES: std::ops::RangeInclusive<f64> = 0.75..=1.3;
/// Samples a level: their spacing as a share of the expected inner-eye distance.
const SPACING: f64 = 0.1;
/// A level that would need more samples than this is skipped: such a face would be a detail of the object. A closer look
/// at a solid full of walls makes do with coarser ones.
const MOST_SAMPLES: usize = 80_000;

/// Triangles dearer than this are not worth a closer look. The cheapest of every face of the public set costs less than 3;
/// with 4 here, eight of their copies with holes, bits around them or shoulders were lost.
const MOST_COST: f64 = 7.0;
/// The first look, on the level's samples.
const FIRST_LOOK: Search = Search {
    points: 60,
    rounds: 4,
    most_growth: 1.3,
    proportion_weight: RIGID_PROPORTIONS,
    kept_share: KEPT_SHARE,
    rigid_rounds: 4,
};
/// The second look, of the best few, on finer samples.
const SECOND_LOOK: Search = Search {
    points: TEMPLATE_POINTS,
    rounds: 30,
    most_growth: 1.2,
    proportion_weight: PROPORTION_WEIGHT,
    kept_share: 0.95,
    rigid_rounds: 3,
};
/// How many get the second look.
const FINALISTS: usize = 4;
/// A first look this many times worse than the best gets none.
const HOPELESS: f64 = 1.6;
/// A second look that ends this near is at a face (no other thing of the public set: below 3), and no other place is
/// looked at.
const GOOD_ENOUGH_MM: f64 = 2.0;
/// A standard so many times too small or too large can come to rest on a face, its eyes on the face's: the best place is
/// looked at from these sizes as well.
const OTHER_SIZES: [f64; 2] = [0.8, 1.25];
/// What stays in place then: the sellion, about.
const BETWEEN_THE_EYES: [f64; 3] = [0.0, 36.0, 112.0];
/// Where the standard fits worse than this, mm, it does not lie on a face, and no other sizes are tried.
const FAR_FROM_A_FACE_MM: f64 = 5.0;
/// Fits whose corners lie this near to each other stand at one place, mm on the standard.
const SAME_PLACE_MM: f64 = 6.0;
/// The spacing of the finer samples, mm on the standard, and how far around the face they reach.
const FINE_SPACING_MM: f64 = 3.0;
const FINE_REACH_MM: f64 = 80.0;
/// Normals are averaged over this radius, mm on the standard: about an edge of a head of 5000 vertices.
const SMOOTHING_MM: f64 = 6.0;
/// Samples nearer to each other than this share of that radius are averaged by way of coarser ones: a quarter of the work.
const LEAST_SPACING_OF_MEANS: f64 = 0.4;
/// Spacing and reach for the last look, at one place: landmarks and heights.
const CLOSE_SPACING_MM: f64 = 1.5;
const CLOSE_REACH_MM: f64 = 95.0;
/// What is around these is looked at: the middle of the fitted region, and for the last look that of forehead and chin.
const MIDDLE: [f64; 3] = [0.0, 20.0, 100.0];
const CLOSE_MIDDLE: [f64; 3] = [0.0, 0.0, 100.0];

/// A surface ready to be sampled at any spacing, with consistent unit normals.
#[derive(Debug, Clone, Copy)]
pub struct Oriented<'a> {
    /// What is sampled.
    pub form: Form<'a>,
    /// The box around it.
    pub bounds: Bounds,
    /// Which side the normals point to.
    pub side: Side,
}

/// What a surface is made of.
#[derive(Debug, Clone, Copy)]
pub enum Form<'a> {
    /// A mesh with faces.
    Mesh(&'a Mesh),
    /// A cloud with a patch of surface at every point.
    Cloud(&'a Patches),
}

/// What the cheap part found, and what became of the best of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Detection {
    /// The facial triangles of all levels, cheapest first.
    pub candidates: Vec<Candidate>,
    /// The best fit of the standard's surface, if any triangle was worth a closer look.
    pub face: Option<FoundFace>,
}

/// The place where the standard's surface fits best, and what can be read off the surface there.
#[derive(Debug, Clone, PartialEq)]
pub struct FoundFace {
    /// How the standard's surface fits.
    pub fit: Fit,
    /// The landmarks, refined on the surface.
    pub landmarks: Landmarks,
    /// What tells this face from others.
    pub dense: DenseSignature,
}

impl Detection {
    /// The same on the moved surface.
    pub fn moved(&self, motion: &Motion) -> Detection {
        Detection {
            candidates: self.candidates.iter().map(|candidate| candidate.moved(motion)).collect(),
            face: self.face.as_ref().map(|face| face.moved(motion)),
        }
    }
}

impl FoundFace {
    /// The same on the moved surface.
    pub fn moved(&self, motion: &Motion) -> FoundFace {
        FoundFace {
            fit: Fit { pose: self.fit.pose.moved(motion), ..self.fit },
            landmarks: self.landmarks.map(|place| motion * place),
            dense: self.dense.clone(),
        }
    }
}

/// A fit that may be looked at again, with the side it was found on.
#[derive(Debug, Clone, Copy)]
struct Finalist {
    fit: Fit,
    sign: f64,
}

impl Finalist {
    /// Whether the corners of the standard's triangle lie at about the same places.
    fn stands_with(&self, other: &Finalist, standard: &Standard) -> bool {
        let apart = |p: &Point3| (self.fit.pose.point(p) - other.fit.pose.point(p)).norm();
        let most = SAME_PLACE_MM * self.fit.pose.scale;
        self.sign == other.sign && standard.annotated.corners.iter().all(|corner| apart(corner) < most)
    }

    /// The plain standard at the same place, larger. Its proportions are taken back about the middle of the head: a
    /// surface that had been flattened then starts before the face, not inside it.
    fn grown(&self, growth: f64) -> Finalist {
        let (center, still) = (Point3::from(BETWEEN_THE_EYES), Vector3::zeros());
        let grown = self.fit.pose.nudged(&center, &still, &Vector3::repeat(growth), &still);
        let pose = Similarity { stretch: Vector3::repeat(1.0), ..grown };
        Finalist { fit: Fit { pose, weights: Weights::zeros(), ..self.fit }, ..*self }
    }
}

impl Oriented<'_> {
    /// The points it was made of.
    pub(crate) fn points(&self) -> Box<dyn Iterator<Item = Point3> + '_> {
        match self.form {
            Form::Mesh(mesh) => Box::new(mesh.vertices.iter().copied()),
            Form::Cloud(patches) => Box::new(patches.centers()),
        }
    }

    pub(crate) fn sampled(&self, spacing: f64) -> Samples {
        match self.form {
            Form::Mesh(mesh) => Samples::from_mesh(mesh, spacing),
            Form::Cloud(patches) => patches.sampled(spacing, |_| true),
        }
    }

    /// Samples of the part within `reach` of `center`.
    pub(crate) fn sampled_around(&self, center: &Point3, reach: f64, spacing: f64) -> Samples {
        let near = |p: &Point3| (p - center).norm_squared() < reach * reach;
        match self.form {
            Form::Mesh(mesh) => Samples::from_part(mesh, spacing, near),
            Form::Cloud(patches) => patches.sampled(spacing, near),
        }
    }

    /// The area of a mesh, about that of a cloud.
    pub(crate) fn area(&self) -> f64 {
        match self.form {
            Form::Mesh(mesh) => (0..mesh.faces.len()).map(|f| 0.5 * mesh.area_normal(f).norm()).sum(),
            Form::Cloud(patches) => patches.area(),
        }
    }
}

/// Finds the facial triangles and verifies the best. `progress` is asked between levels.
pub fn detect(surface: &Oriented, unit: Unit, standard: &Standard, progress: &Progress) -> Result<Detection, Canceled> {
    let diagonal = surface.bounds.diagonal();
    let levels: Vec<f64> = match unit.in_mm() {
        Some(mm) => LEVELS_OF_TRUE_SIZE.iter().map(|share| share * INNER_EYE_DISTANCE_MM / mm).collect(),
        None => LEVELS_OF_DIAGONAL.iter().map(|share| share * diagonal).collect(),
    };
    let area = surface.area();
    let (mut found, mut finalists) = (Vec::new(), Vec::new());
    let mut finest: Option<Samples> = None;
    for expected in levels {
        progress.check()?;
        let spacing = SPACING * expected;
        // a plane passes through at least area / spacing^2 cells: don't even start where that is too many
        if diagonal <= 0.0 || area / (spacing * spacing) > MOST_SAMPLES as f64 {
            continue;
        }
        let samples = finest.as_ref().map_or_else(|| surface.sampled(spacing), |finest| finest.coarser(spacing));
        if samples.points.len() <= MOST_SAMPLES {
            detect_level(&samples, expected, surface.side, standard, &mut found, &mut finalists);
            finest.get_or_insert(samples);
        }
    }
    progress.check()?;
    found.retain(|c| is_true_size(c.triangle().size() / standard.detected.size(), unit));
    finalists.retain(|f| is_true_size(f.fit.pose.scale, unit));
    found.sort_by(|a, b| a.cost(standard).total().total_cmp(&b.cost(standard).total()));
    Ok(Detection { candidates: found, face: verified(surface, unit, finalists, standard) })
}

/// Whether a face may be so many model units a millimetre of the standard; any will do where the unit is unknown.
fn is_true_size(scale: f64, unit: Unit) -> bool {
    unit.in_mm().is_none_or(|mm| TRUE_SIZES.contains(&(scale * mm)))
}

/// Adds a level's triangles and their first fits.
fn detect_level(
    samples: &Samples,
    expected: f64,
    side: Side,
    standard: &Standard,
    found: &mut Vec<Candidate>,
    finalists: &mut Vec<Finalist>,
) {
    use rayon::prelude::*;
    let grid = CellGrid::new(&samples.points, 0.18 * expected);
    let features = features(samples, &grid, expected);
    for &sign in side.signs() {
        let target = Target { samples, grid: &grid, sign };
        let level = candidates(&places(samples, &grid, &features, expected, sign), expected, standard);
        let promising: Vec<&Candidate> = level.iter().filter(|c| c.cost(standard).total() < MOST_COST).collect();
        let fits: Vec<Fit> = promising.par_iter().map(|candidate| first_look(&target, candidate, standard)).collect();
        finalists.extend(fits.into_iter().map(|fit| Finalist { fit, sign }));
        found.extend(level);
    }
}

fn first_look(target: &Target, candidate: &Candidate, standard: &Standard) -> Fit {
    let pose =
        Similarity::of_triangles(&standard.detected, &standard.outward, &candidate.triangle(), &candidate.outward());
    let start = Placement { pose, weights: Weights::zeros() };
    let placement = fit_pose(target, template::face(), &start, &FIRST_LOOK);
    score(target, template::face(), FIRST_LOOK.points, &placement)
}

/// The best few that stand at places of their own: many triangles lead to the same one. Ties by order.
fn distinct(mut finalists: Vec<Finalist>, standard: &Standard) -> Vec<Finalist> {
    finalists.sort_by(|a, b| a.fit.residual_mm.total_cmp(&b.fit.residual_mm));
    let mut kept: Vec<Finalist> = Vec::new();
    for finalist in finalists {
        let hopeless = kept.first().is_some_and(|best| finalist.fit.residual_mm > HOPELESS * best.fit.residual_mm);
        if hopeless || kept.len() == FINALISTS {
            break;
        }
        if !kept.iter().any(|other| other.stands_with(&finalist, standard)) {
            kept.push(finalist);
        }
    }
    kept
}

/// The best of the second looks at the best of the first.
fn verified(surface: &Oriented, unit: Unit, finalists: Vec<Finalist>, standard: &Standard) -> Option<FoundFace> {
    let mut best: Option<(Finalist, (Samples, CellGrid))> = None;
    for finalist in distinct(finalists, standard) {
        let near = around(surface, &finalist.fit.pose, MIDDLE, FINE_SPACING_MM, FINE_REACH_MM);
        let look = second_look(&near, &finalist);
        if best.as_ref().is_none_or(|(best, _)| is_better(&look, best)) {
            best = Some((look, near));
        }
        if look.fit.residual_mm < GOOD_ENOUGH_MM {
            break;
        }
    }
    let (best, near) = best?;
    let sizes = OTHER_SIZES.iter().filter(|_| best.fit.residual_mm <= FAR_FROM_A_FACE_MM);
    let others = sizes.map(|growth| second_look(&near, &best.grown(*growth)));
    let possible = others.filter(|other| is_true_size(other.fit.pose.scale, unit));
    Some(closest_look(surface, &possible.fold(best, |best, other| if is_better(&other, &best) { other } else { best })))
}

fn is_better(one: &Finalist, other: &Finalist) -> bool {
    one.fit.residual_mm < other.fit.residual_mm
}

fn second_look((samples, grid): &(Samples, CellGrid), finalist: &Finalist) -> Finalist {
    let target = Target { samples, grid, sign: finalist.sign };
    let placement = fit_pose(&target, template::face(), &finalist.fit.placement(), &SECOND_LOOK);
    Finalist { fit: score(&target, template::face(), SECOND_LOOK.points, &placement), sign: finalist.sign }
}

/// What the surface shows at the place that was settled on.
fn closest_look(surface: &Oriented, found: &Finalist) -> FoundFace {
    let (samples, grid) = around(surface, &found.fit.pose, CLOSE_MIDDLE, CLOSE_SPACING_MM, CLOSE_REACH_MM);
    let target = Target { samples: &samples, grid: &grid, sign: found.sign };
    let placement = found.fit.placement();
    FoundFace {
        fit: found.fit,
        landmarks: landmarks::landmarks(&target, &placement),
        dense: DenseSignature::new(&target, template::face(), &placement),
    }
}

/// Samples of the surface around a place of the face; all in mm on the standard.
fn around(
    surface: &Oriented,
    pose: &Similarity,
    middle: [f64; 3],
    spacing_mm: f64,
    reach_mm: f64,
) -> (Samples, CellGrid) {
    let spacing = spacing_mm * pose.scale;
    let center = pose.point(&Point3::from(middle));
    let mut samples = surface.sampled_around(&center, reach_mm * pose.scale, spacing);
    while samples.points.len() > MOST_SAMPLES {
        samples = samples.coarser(2.0 * samples.spacing);
    }
    let grid = CellGrid::new(&samples.points, 2.0 * samples.spacing);
    let radius = SMOOTHING_MM * pose.scale;
    samples.normals = if samples.spacing < LEAST_SPACING_OF_MEANS * radius {
        let coarser = samples.coarser(2.0 * samples.spacing);
        samples.smoothed_normals(&coarser, &CellGrid::new(&coarser.points, radius), radius)
    } else {
        samples.smoothed_normals(&samples, &grid, radius)
    };
    (samples, grid)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Square sheets of 300 mm, 10 mm apart, each of four triangles about its middle.
    fn sheets() -> Mesh {
        let mut mesh = Mesh::default();
        for layer in 0..21u32 {
            let z = 10.0 * f64::from(layer);
            let rim = [[-150.0, -150.0], [150.0, -150.0], [150.0, 150.0], [-150.0, 150.0]];
            mesh.vertices.push(Point3::new(0.0, 0.0, z));
            mesh.vertices.extend(rim.map(|[x, y]| Point3::new(x, y, z)));
            mesh.faces.extend((0..4).map(|k| [0, 1 + k, 1 + (k + 1) % 4].map(|v| 5 * layer + v)));
        }
        mesh
    }

    #[test]
    fn other_sizes_are_tried_only_where_the_unit_allows_them() {
        assert!(is_true_size(1.25, Unit::Mm) && is_true_size(0.125, Unit::Cm));
        assert!(!is_true_size(1.25 * 1.25, Unit::Mm) && !is_true_size(0.8 * 0.8, Unit::Mm));
        assert!(is_true_size(40.0, Unit::Unknown));
    }

    #[test]
    fn a_larger_standard_is_plain_and_keeps_its_scale_to_the_growth() {
        let stretch = Vector3::new(1.25, 0.8, 1.0);
        let pose = Similarity { scale: 2.0, stretch, motion: Motion::translation(1.0, 2.0, 3.0) };
        let fit = Fit { pose, weights: Weights::repeat(1.0), residual_mm: 2.0, observed: 1.0 };
        let grown = Finalist { fit, sign: -1.0 }.grown(1.25);
        assert!((grown.fit.pose.scale - 2.5).abs() < 1e-12 && grown.sign == -1.0);
        assert_eq!((grown.fit.pose.stretch, grown.fit.weights), (Vector3::repeat(1.0), Weights::zeros()));
        let between = Point3::from(BETWEEN_THE_EYES);
        let factors = grown.fit.pose.scale * (Vector3::repeat(1.0) - stretch);
        let moved = grown.fit.pose.point(&between) - pose.point(&between);
        assert!((moved - factors.component_mul(&between.coords)).norm() < 1e-9);
    }

    #[test]
    fn a_solid_full_of_walls_is_looked_at_more_coarsely() {
        let mesh = sheets();
        let bounds = mesh.bounds().expect("it has vertices");
        let surface = Oriented { form: Form::Mesh(&mesh), bounds, side: Side::Unknown };
        let pose = Similarity { scale: 1.0, stretch: Vector3::repeat(1.0), motion: Motion::identity() };
        let (samples, _) = around(&surface, &pose, CLOSE_MIDDLE, CLOSE_SPACING_MM, CLOSE_REACH_MM);
        assert!(samples.points.len() > 10_000 && samples.points.len() <= MOST_SAMPLES, "{}", samples.points.len());
        assert_eq!(samples.spacing, 2.0 * CLOSE_SPACING_MM);
    }
}
