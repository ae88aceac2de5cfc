//! Whether two views can lie as a motion says: the surface itself is asked, descriptions only propose.

use super::sight::Seen;
use super::sketch::Sketch;
use crate::geometry::Motion;

/// What the surfels of one view say when they are put into another.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Testimony {
    /// Surfels asked.
    pub asked: usize,
    /// Those that lie on the other view's surface, and look the same way.
    pub agree: usize,
    /// Those that lie where the other view's scanner has looked through.
    pub in_sight: usize,
    /// Those that face the other view's scanner, and where it saw nothing far and wide.
    pub missed: usize,
    /// Those near the other view's surface that cross it or look another way.
    pub cross: usize,
    /// Those of them that look the opposite way and lie behind it: as the far side of a thin wall does.
    pub opposed: usize,
    /// Sum of the squared distances, along the normal, of those that agree.
    pub squares: f64,
}

/// Both directions.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Evidence {
    /// View j's surfels in view i.
    pub j_in_i: Testimony,
    /// View i's surfels in view j.
    pub i_in_j: Testimony,
}

/// A surfel agrees within this distance along the normal, in edges,
const ON: f32 = 0.35;
/// and this cosine of the normals.
const LIKE: f32 = 0.85;
/// Two sides of a wall have normals of less than this cosine.
const OPPOSED: f32 = -0.4;
/// A surfel is near a surface within this distance, in edges.
const NEAR: f32 = 1.6;
/// It stands in front of a surface from this distance on, in edges.
const IN_FRONT: f32 = 1.5;
/// A surface faces a scanner that it should be seen by from this cosine of its normal on.
const FACING: f32 = 0.6;
/// A surfel where the other scanner looked through, or saw nothing, counts as so many that cross: on right motions
/// there are few, while noise and edges bring some across each other. More would refuse right joins of real scans, which
/// have holes where laser or camera did not reach.
const NOT_SEEN: f64 = 2.0;

impl Testimony {
    /// Share of the surfels asked that agree.
    pub fn overlap(&self) -> f64 {
        self.agree as f64 / self.asked.max(1) as f64
    }
}

impl Evidence {
    /// The smaller share.
    pub fn overlap(&self) -> f64 {
        self.j_in_i.overlap().min(self.i_in_j.overlap())
    }

    /// Surfels that agree, both ways.
    pub fn agree(&self) -> f64 {
        (self.j_in_i.agree + self.i_in_j.agree) as f64
    }

    /// Surfels that can't be where the motion puts them, both ways.
    pub fn conflict(&self) -> f64 {
        self.cross() + NOT_SEEN * (self.in_sight() + self.missed())
    }

    /// Surfels that stand where the other scanner looked through, both ways.
    pub fn in_sight(&self) -> f64 {
        (self.j_in_i.in_sight + self.i_in_j.in_sight) as f64
    }

    /// Surfels that cross the other surface, both ways.
    pub fn cross(&self) -> f64 {
        (self.j_in_i.cross + self.i_in_j.cross) as f64
    }

    /// Those of them that may be the far side of a thin wall, both ways.
    pub fn opposed(&self) -> f64 {
        (self.j_in_i.opposed + self.i_in_j.opposed) as f64
    }

    /// Surfels that the other scanner should have seen and did not, both ways.
    pub fn missed(&self) -> f64 {
        (self.j_in_i.missed + self.i_in_j.missed) as f64
    }

    /// Sum of the squared distances of the surfels that agree, both ways.
    pub fn squares(&self) -> f64 {
        self.j_in_i.squares + self.i_in_j.squares
    }

    /// Root mean square distance of the surfels that agree, a length.
    pub fn rms(&self) -> f64 {
        (self.squares() / self.agree().max(1.0)).sqrt()
    }

    /// Share of what speaks for the motion among all that speaks.
    pub fn consistency(&self) -> f64 {
        self.agree() / (self.agree() + self.conflict()).max(1.0)
    }
}

/// Asks both views, at most about `samples` surfels each.
pub fn verify(i: &Sketch, j: &Sketch, motion_i_j: &Motion, edge: f64, samples: usize) -> Evidence {
    Evidence {
        j_in_i: testify(j, i, motion_i_j, edge as f32, samples),
        i_in_j: testify(i, j, &motion_i_j.inverse(), edge as f32, samples),
    }
}

/// Whether a surface in `other`'s frame faces its scanner.
fn is_facing(other: &Sketch, place: &nalgebra::Vector3<f32>, normal: &nalgebra::Vector3<f32>) -> bool {
    let toward = other.sight.toward_scanner(place);
    toward.dot(normal) > FACING * toward.norm()
}

/// Puts surfels of `view` into `other`; `motion` maps the frame of the first into that of the second.
fn testify(view: &Sketch, other: &Sketch, motion: &Motion, edge: f32, samples: usize) -> Testimony {
    let motion = motion.cast::<f32>();
    let (rotation, shift) = (motion.rotation.to_rotation_matrix(), motion.translation.vector);
    let step = view.inner.len().div_ceil(samples).max(1);
    let mut testimony = Testimony::default();
    for &index in view.inner.iter().step_by(step) {
        let index = index as usize;
        testimony.asked += 1;
        let moved = rotation * view.position(index) + shift;
        let nearest = other.indexed.tree.nearest(&moved.into(), (NEAR * edge).powi(2));
        let Some(target) = nearest.map(|n| n.index as usize) else {
            match other.sight.look(&moved) {
                Seen::Surface { height } => testimony.in_sight += usize::from(height > IN_FRONT * edge),
                Seen::Nothing if is_facing(other, &moved, &(rotation * view.normals[index])) => testimony.missed += 1,
                _ => {}
            }
            continue;
        };
        let normal = rotation * view.normals[index];
        let other_normal = other.normals[target];
        let cosine = normal.dot(&other_normal);
        let offset = moved - other.position(target);
        let mean = normal + other_normal;
        let along = if cosine > -0.9 { mean.dot(&offset) / mean.norm() } else { normal.dot(&offset) };
        if cosine > LIKE && along.abs() < ON * edge {
            testimony.agree += 1;
            testimony.squares += f64::from(along * along);
        } else if other.is_inner[target] {
            testimony.cross += 1;
            testimony.opposed += usize::from(cosine < OPPOSED && other_normal.dot(&offset) < 0.0);
        }
    }
    testimony
}
