//! Closer looks at the places where the standard's surface may lie: a second fit on finer samples, other sizes, and at the
//! best place what can be read off the surface.

use super::candidates::{Candidate, distinct};
use super::dense_fit::{Fit, PROPORTION_WEIGHT, Search};
use super::dense_signature::DenseSignature;
use super::detection::{FoundFace, MOST_SAMPLES, is_true_size};
use super::landmarks;
use super::levels::look;
use super::modes::Weights;
use super::sampled_surface::SampledSurface;
use super::similarity::Similarity;
use super::standard::FaceStandard;
use super::target::Target;
use super::template::{self, TEMPLATE_POINTS};
use crate::saliency::{CellGrid, Samples};
use visage_geometry::progress::{Canceled, Progress};
use visage_geometry::{Point3, Unit, Vector3};

/// The second look, of the best few, on finer samples.
const SECOND_LOOK: Search = Search {
    points: TEMPLATE_POINTS,
    rounds: 30,
    most_growth: 1.2,
    proportion_weight: PROPORTION_WEIGHT,
    kept_share: 0.95,
    rigid_rounds: 3,
};
visage_geometry::tuning! {
    const TUNING: Tuning {
        /// How many get the second look.
        candidates: usize = 4,
        /// A first look this many times worse than the best gets none.
        hopeless: f64 = 1.6,
        /// A first look this good gets its second before finer levels are searched (faces of the public set at the level of their
        /// size: below 3.7; other things: above 3.9).
        likely_mm: f64 = 3.5,
        /// A standard so many times too small or too large can come to rest on a face, its eyes on the face's: the best place is
        /// looked at from these sizes as well.
        other_sizes: [f64; 2] = [0.8, 1.25],
        /// What stays in place then: the sellion, about.
        between_the_eyes: [f64; 3] = [0.0, 36.0, 112.0],
        /// Where the standard fits worse than this, mm, it does not lie on a face, and no other sizes are tried.
        far_from_a_face_mm: f64 = 5.0,
        /// The spacing of the finer samples, mm on the standard,
        fine_spacing_mm: f64 = 3.0,
        /// and how far around the face they reach.
        fine_reach_mm: f64 = 80.0,
        /// Normals are averaged over this radius, mm on the standard: about an edge of a head of 5000 vertices.
        smoothing_mm: f64 = 6.0,
        /// Samples nearer to each other than this share of that radius are averaged by way of coarser ones: a quarter of the work.
        least_spacing_of_means: f64 = 0.4,
        /// The spacing for the last look, at one place, mm on the standard: landmarks and heights,
        close_spacing_mm: f64 = 1.5,
        /// and its reach.
        close_reach_mm: f64 = 95.0,
        /// What is around the middle of the fitted region is looked at,
        middle: [f64; 3] = [0.0, 20.0, 100.0],
        /// and for the last look around that of forehead and chin.
        close_middle: [f64; 3] = [0.0, 0.0, 100.0],
    }
}

/// A second look that ends this near is at a face (no other thing of the public set: below 3), and no other place is
/// looked at.
pub(super) const GOOD_ENOUGH_MM: f64 = 2.0;

impl Candidate {
    /// Whether a point of the surface may belong to a triangle of this face, the fits around its corners included.
    pub(super) fn reaches(&self, point: &Point3) -> bool {
        let pose = &self.fit.pose;
        (point - pose.point(&Point3::from(TUNING.middle))).norm() < TUNING.fine_reach_mm * pose.scale
    }

    /// The plain standard at the same place, larger. Its proportions are taken back about the middle of the head: a
    /// surface that had been flattened then starts before the face, not inside it.
    fn grown(&self, growth: f64) -> Candidate {
        let (center, still) = (Point3::from(TUNING.between_the_eyes), Vector3::zeros());
        let grown = self.fit.pose.nudged(&center, &still, &Vector3::repeat(growth), &still);
        let pose = Similarity { stretch: Vector3::repeat(1.0), ..grown };
        Candidate { fit: Fit { pose, weights: Weights::zeros(), ..self.fit }, ..*self }
    }
}

/// The second looks taken at a surface.
pub(super) struct Refinement<'a> {
    surface: &'a SampledSurface<'a>,
    unit: Unit,
    standard: &'a FaceStandard,
    /// The first fits that were looked at again.
    taken: Vec<Candidate>,
    /// The best of the second fits, and the samples around it.
    best: Option<(Candidate, (Samples, CellGrid))>,
}

impl<'a> Refinement<'a> {
    /// None yet.
    pub(super) fn new(surface: &'a SampledSurface, unit: Unit, standard: &'a FaceStandard) -> Refinement<'a> {
        Refinement { surface, unit, standard, taken: Vec::new(), best: None }
    }

    /// The best of them, if it can only be a face.
    pub(super) fn face(&self) -> Option<&Candidate> {
        self.best.as_ref().map(|(best, _)| best).filter(|best| best.fit.residual_mm < GOOD_ENOUGH_MM)
    }

    /// A look at the best of a level's first fits, if it is so good that it may be a face.
    pub(super) fn take_if_likely(&mut self, level: &[Candidate], progress: &Progress) -> Result<(), Canceled> {
        let best = level.iter().min_by(|a, b| a.fit.residual_mm.total_cmp(&b.fit.residual_mm));
        if let Some(best) = best.filter(|best| best.fit.residual_mm < TUNING.likely_mm) {
            self.take(best, progress)?;
        }
        Ok(())
    }

    /// Looks at the best of all first fits until one shows a face.
    pub(super) fn take_at_best_of(&mut self, fitted: Vec<Candidate>, progress: &Progress) -> Result<(), Canceled> {
        for candidate in distinct(fitted, &self.standard.annotated.corners, TUNING.candidates, TUNING.hopeless) {
            if self.face().is_some() {
                break;
            }
            self.take(&candidate, progress)?;
        }
        Ok(())
    }

    fn take(&mut self, first: &Candidate, progress: &Progress) -> Result<(), Canceled> {
        progress.check()?;
        if self.taken.contains(first) {
            return Ok(());
        }
        self.taken.push(*first);
        let near = around(self.surface, &first.fit.pose, TUNING.middle, TUNING.fine_spacing_mm, TUNING.fine_reach_mm);
        progress.check()?;
        let look = second_look(&near, first);
        if self.best.as_ref().is_none_or(|(best, _)| look.is_better_than(best)) {
            self.best = Some((look, near));
        }
        Ok(())
    }

    /// What the surface shows at the best place, which is looked at from other sizes before.
    pub(super) fn closest(self, progress: &Progress) -> Result<Option<FoundFace>, Canceled> {
        progress.check()?;
        let Some((best, near)) = self.best else { return Ok(None) };
        let sizes = TUNING.other_sizes.iter().filter(|_| best.fit.residual_mm <= TUNING.far_from_a_face_mm);
        let others = sizes.map(|growth| second_look(&near, &best.grown(*growth)));
        let possible = others.filter(|other| is_true_size(other.fit.pose.scale, self.unit));
        let best = possible.fold(best, |best, other| if other.is_better_than(&best) { other } else { best });
        progress.check()?;
        Ok(Some(closest_look(self.surface, &best)))
    }
}

fn second_look((samples, grid): &(Samples, CellGrid), candidate: &Candidate) -> Candidate {
    let target = Target { samples, grid, sign: candidate.sign };
    look(&target, template::face(), &candidate.fit.placement(), &SECOND_LOOK)
}

/// What the surface shows at the place that was settled on.
fn closest_look(surface: &SampledSurface, found: &Candidate) -> FoundFace {
    let (samples, grid) =
        around(surface, &found.fit.pose, TUNING.close_middle, TUNING.close_spacing_mm, TUNING.close_reach_mm);
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
    surface: &SampledSurface,
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
    let radius = TUNING.smoothing_mm * pose.scale;
    samples.normals = if samples.spacing < TUNING.least_spacing_of_means * radius {
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
    use crate::faces::sampled_surface::Form;
    use crate::saliency::Side;
    use visage_geometry::{Mesh, Motion};

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

    fn first_fit(shift: Vector3) -> Candidate {
        let motion = Motion::new(shift, Vector3::zeros());
        let pose = Similarity { scale: 1.0, stretch: Vector3::repeat(1.0), motion };
        Candidate { fit: Fit { pose, weights: Weights::zeros(), residual_mm: 3.0, observed: 1.0 }, sign: 1.0 }
    }

    #[test]
    fn once_a_face_is_found_no_other_place_is_looked_at() {
        let mesh = template::tests::relief_mesh();
        let bounds = mesh.bounds().expect("it has vertices");
        let surface = SampledSurface { form: Form::Mesh(&mesh), bounds, side: Side::Outward };
        let standard = crate::faces::standard::face();
        let mut looks = Refinement::new(&surface, Unit::Unknown, &standard);
        let [amiss, near] = [Vector3::new(-45.0, 20.0, 15.0), Vector3::new(2.0, -2.0, 1.0)].map(first_fit);
        let silent = Progress::silent();
        let unlikely = Candidate { fit: Fit { residual_mm: TUNING.likely_mm, ..near.fit }, ..near };
        looks.take_if_likely(&[unlikely], &silent).expect("not canceled");
        assert!(looks.taken.is_empty(), "not good enough for a look before finer levels");
        looks.take_if_likely(&[amiss], &silent).expect("not canceled");
        assert!(looks.face().is_none(), "half beside the face");
        // the one amiss was looked at before, the good one ends the search
        let fitted = vec![amiss, near, first_fit(Vector3::new(0.0, 25.0, 0.0))];
        looks.take_at_best_of(fitted, &silent).expect("not canceled");
        assert_eq!(looks.taken, [amiss, near]);
        let face = looks.face().expect("it lies right on it");
        let nose = &standard.annotated.corners[2];
        assert!(face.reaches(nose) && !face.reaches(&Point3::new(0.0, 20.0, -20.0)));
        assert!((face.fit.pose.point(nose) - nose).norm() < 1.0);
    }

    #[test]
    fn a_larger_standard_is_plain_and_keeps_its_scale_to_the_growth() {
        let stretch = Vector3::new(1.25, 0.8, 1.0);
        let pose = Similarity { scale: 2.0, stretch, motion: Motion::translation(1.0, 2.0, 3.0) };
        let fit = Fit { pose, weights: Weights::repeat(1.0), residual_mm: 2.0, observed: 1.0 };
        let grown = Candidate { fit, sign: -1.0 }.grown(1.25);
        assert!((grown.fit.pose.scale - 2.5).abs() < 1e-12 && grown.sign == -1.0);
        assert_eq!((grown.fit.pose.stretch, grown.fit.weights), (Vector3::repeat(1.0), Weights::zeros()));
        let between = Point3::from(TUNING.between_the_eyes);
        let factors = grown.fit.pose.scale * (Vector3::repeat(1.0) - stretch);
        let moved = grown.fit.pose.point(&between) - pose.point(&between);
        assert!((moved - factors.component_mul(&between.coords)).norm() < 1e-9);
    }

    #[test]
    fn a_solid_full_of_walls_is_looked_at_more_coarsely() {
        let mesh = sheets();
        let bounds = mesh.bounds().expect("it has vertices");
        let surface = SampledSurface { form: Form::Mesh(&mesh), bounds, side: Side::Unknown };
        let pose = Similarity { scale: 1.0, stretch: Vector3::repeat(1.0), motion: Motion::identity() };
        let (samples, _) = around(&surface, &pose, TUNING.close_middle, TUNING.close_spacing_mm, TUNING.close_reach_mm);
        assert!(samples.points.len() > 10_000 && samples.points.len() <= MOST_SAMPLES, "{}", samples.points.len());
        assert_eq!(samples.spacing, 2.0 * TUNING.close_spacing_mm);
    }
}
