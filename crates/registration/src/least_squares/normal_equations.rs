//! Sums over the correspondences of two surfaces, of as many rows as a view has unknowns (`D`): six, or seven where scales
//! are sought.

use nalgebra::{SMatrix, SVector};

use super::pose_system::{DAMPING, PoseSystem};
use visage_geometry::{Motion, se3};

/// Unknowns of a rigid view: the twist `(u, w)`.
pub const RIGID: usize = 6;
/// Unknowns of a view whose scale is sought too: the twist, then the logarithm of the scale, `(u, w, ln s)`.
pub const SCALED: usize = 7;

/// What the correspondences of one directed pair add, for twists of the world frame.
///
/// A correspondence between view a's surface and view b's at one place `x` with the residual
/// `r = n . (p_a - p_b)` changes with a's twist by `J' xi_a` and with b's by `-J' xi_b`, `J = (n, x cross n)`, and
/// `n . x` for the scale about the origin. That one place stands for both surfaces keeps scales from collapsing: the
/// noise of a's points says that a is too large as much as that of b's points says it of b.
#[derive(Debug, Clone, Copy)]
pub struct PairBlock<const D: usize> {
    /// Sum of `w J J'`.
    pub information: SMatrix<f64, D, D>,
    /// Sum of `w J r`.
    pub gradient: SVector<f64, D>,
    /// Sum of `w r^2`.
    pub cost: f64,
    /// Sum of `w`.
    pub weight: f64,
}

/// Sums over correspondences in some frame; of the matrix only the upper triangle.
#[derive(Debug, Clone)]
pub struct NormalEquations<const D: usize> {
    upper: [[f64; D]; D],
    gradient: [f64; D],
    cost: f64,
    weight: f64,
}

impl<const D: usize> Default for NormalEquations<D> {
    fn default() -> Self {
        NormalEquations { upper: [[0.0; D]; D], gradient: [0.0; D], cost: 0.0, weight: 0.0 }
    }
}

impl<const D: usize> NormalEquations<D> {
    /// Adds a correspondence with unit normal `n` at the place `x` and residual `r`.
    #[inline]
    pub fn add(&mut self, n: &nalgebra::Vector3<f64>, x: &nalgebra::Vector3<f64>, r: f64, weight: f64) {
        let c = x.cross(n);
        let mut row = [0.0; D];
        row[..RIGID].copy_from_slice(&[n.x, n.y, n.z, c.x, c.y, c.z]);
        if D == SCALED {
            row[D - 1] = n.dot(x);
        }
        for i in 0..D {
            let weighted = weight * row[i];
            self.gradient[i] += weighted * r;
            for (sum, value) in self.upper[i][i..].iter_mut().zip(&row[i..]) {
                *sum += weighted * value;
            }
        }
        self.cost += weight * r * r;
        self.weight += weight;
    }

    /// The block for twists of the world, if the sums were taken in the frame that `pose` maps into the world, in a
    /// unit of `scale` world units.
    pub fn into_world(mut self, pose: &Motion, scale: f64) -> PairBlock<D> {
        if D == SCALED {
            self.rescale(scale);
        }
        let local = self.information();
        let adjoint = adjoint::<D>(&pose.inverse());
        PairBlock {
            information: adjoint.transpose() * local * adjoint,
            gradient: adjoint.transpose() * SVector::from(self.gradient),
            cost: self.cost,
            weight: self.weight,
        }
    }

    /// Sum of `w J J'` in the frame of the sums.
    pub fn information(&self) -> SMatrix<f64, D, D> {
        SMatrix::from_fn(|i, j| self.upper[i.min(j)][i.max(j)])
    }

    /// The sums had lengths been taken in world units.
    fn rescale(&mut self, scale: f64) {
        let factor = |i: usize| if i < 3 { 1.0 } else { scale };
        for i in 0..D {
            self.gradient[i] *= factor(i) * scale;
            for j in i..D {
                self.upper[i][j] *= factor(i) * factor(j);
            }
        }
        self.cost *= scale * scale;
    }
}

impl NormalEquations<RIGID> {
    /// The twist that moves view a onto view b, both in the frame of the sums; `None` if nothing holds it.
    pub fn step(&self) -> Option<se3::Twist> {
        let information = self.information();
        let damping = SMatrix::from_diagonal_element(DAMPING * information.trace() / 6.0);
        let twist = -(information + damping).cholesky()?.solve(&SVector::from(self.gradient));
        twist.iter().all(|x| x.is_finite()).then_some(twist)
    }
}

/// The matrix that turns a twist of one frame into the same twist of the frame `motion` maps into.
pub fn adjoint<const D: usize>(motion: &Motion) -> SMatrix<f64, D, D> {
    let rotation = motion.rotation.to_rotation_matrix();
    let mut adjoint = SMatrix::<f64, D, D>::zeros();
    adjoint.view_mut((0, 0), (3, 3)).copy_from(rotation.matrix());
    adjoint.view_mut((3, 3), (3, 3)).copy_from(rotation.matrix());
    adjoint.view_mut((0, 3), (3, 3)).copy_from(&(se3::skew(&motion.translation.vector) * rotation.matrix()));
    if D == SCALED {
        adjoint.view_mut((0, D - 1), (3, 1)).copy_from(&-motion.translation.vector);
        adjoint[(D - 1, D - 1)] = 1.0;
    }
    adjoint
}

/// The twists of all views that minimise the linearised cost, zero for anchors; `None` if there is no solution.
pub fn solve<const D: usize>(
    pairs: &[(usize, usize)],
    blocks: &[PairBlock<D>],
    columns: &[Option<usize>],
) -> Option<Vec<SVector<f64, D>>> {
    let mut system = PoseSystem::new(columns)?;
    for (pair, block) in pairs.iter().zip(blocks) {
        system.add(*pair, &block.information, &block.gradient);
    }
    system.damped().solve()
}

#[cfg(test)]
mod tests {
    use super::super::pose_system::columns;
    use super::*;
    use visage_geometry::{Point3, Vector3};

    /// Solves for view 1 (= a), whose points are brought by `disturbed` from where they belong, against view 0 (= b);
    /// sums are taken in `frame`, in a unit of `unit` world units.
    fn solved<const D: usize>(disturbed: impl Fn(Point3) -> Point3, frame: &Motion, unit: f64) -> SVector<f64, D> {
        let mut sums = NormalEquations::<D>::default();
        for k in 0..60 {
            let x = Vector3::new((k % 5) as f64, (k % 7) as f64, (k % 3) as f64);
            let n = Vector3::new((k % 4) as f64 - 1.5, (k % 6) as f64 - 2.5, 1.0).normalize();
            let world = frame * Point3::from(x * unit);
            let moved = (frame.inverse() * disturbed(world)).coords / unit;
            sums.add(&n, &x, n.dot(&(moved - x)), 1.0);
        }
        let twists =
            solve(&[(1, 0)], &[sums.into_world(frame, unit)], &columns::<D>(2, |view| view == 1)).expect("all is held");
        assert_eq!(twists[0].norm(), 0.0);
        twists[1]
    }

    fn frame() -> Motion {
        Motion::new(Vector3::new(5.0, 1.0, -2.0), Vector3::new(0.4, 1.2, -0.3))
    }

    #[test]
    fn one_step_undoes_a_small_motion() {
        let disturbed = Motion::new(Vector3::new(1e-4, -2e-4, 3e-4), Vector3::new(2e-4, 1e-4, -3e-4));
        let twist: SVector<f64, RIGID> = solved(|p| disturbed * p, &frame(), 1.0);
        let left = se3::log(&(se3::exp(&twist) * disturbed)).norm();
        assert!(left < 1e-6, "{left}");
    }

    #[test]
    fn one_step_undoes_a_small_scale_about_the_origin_in_any_unit() {
        let disturbed = Motion::new(Vector3::new(1e-4, -2e-4, 3e-4), Vector3::new(2e-4, 1e-4, -3e-4));
        for unit in [1.0, 0.8] {
            let twist: SVector<f64, SCALED> = solved(|p| disturbed * (p * 1.0003), &frame(), unit);
            assert!((twist[6] + 3e-4).abs() < 1e-6, "{twist}");
            let rigid = se3::Twist::from_iterator(twist.iter().copied());
            assert!(se3::log(&(se3::exp(&rigid) * disturbed)).norm() < 2e-6, "{twist}");
        }
    }
}
