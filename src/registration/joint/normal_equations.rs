//! The sparse normal equations over all poses: one 6x6 block a pair.

use nalgebra::{DMatrix, Matrix6, Vector6};
use nalgebra_sparse::factorization::CscCholesky;
use nalgebra_sparse::{CooMatrix, CscMatrix};

use crate::geometry::Motion;
use crate::geometry::se3::{self, Twist};

/// What the correspondences of one directed pair add, for twists of the world frame.
///
/// A correspondence between view a's surface and view b's at one place `x` with the residual
/// `r = n . (p_a - p_b)` changes with a's twist by `J' xi_a` and with b's by `-J' xi_b`, `J = (n, x cross n)`.
#[derive(Debug, Clone, Copy, Default)]
pub struct PairBlock {
    /// Sum of `w J J'`.
    pub information: Matrix6<f64>,
    /// Sum of `w J r`.
    pub gradient: Vector6<f64>,
    /// Sum of `w r^2`.
    pub cost: f64,
    /// Sum of `w`.
    pub weight: f64,
}

/// Sums over correspondences in some frame; the upper triangle row by row.
#[derive(Debug, Clone, Default)]
pub struct PairSums {
    upper: [f64; 21],
    gradient: [f64; 6],
    cost: f64,
    weight: f64,
}

impl PairSums {
    /// Adds a correspondence with unit normal `n` at the place `x` and residual `r`.
    #[inline]
    pub fn add(&mut self, n: &nalgebra::Vector3<f64>, x: &nalgebra::Vector3<f64>, r: f64, weight: f64) {
        let c = x.cross(n);
        let row = [n.x, n.y, n.z, c.x, c.y, c.z];
        let mut k = 0;
        for i in 0..6 {
            let weighted = weight * row[i];
            self.gradient[i] += weighted * r;
            for value in &row[i..] {
                self.upper[k] += weighted * value;
                k += 1;
            }
        }
        self.cost += weight * r * r;
        self.weight += weight;
    }

    /// The twist that moves view a onto view b, both in the frame of the sums; `None` if nothing holds it.
    pub fn step(&self) -> Option<Twist> {
        let information = self.information();
        let damping = Matrix6::from_diagonal_element(DAMPING * information.trace() / 6.0);
        let twist = -(information + damping).cholesky()?.solve(&Vector6::from(self.gradient));
        twist.iter().all(|x| x.is_finite()).then_some(twist)
    }

    /// The block for twists of the world, if the sums were taken in the frame that `pose` maps into the world.
    pub fn into_world(self, pose: &Motion) -> PairBlock {
        let local = self.information();
        let adjoint = adjoint(&pose.inverse());
        PairBlock {
            information: adjoint.transpose() * local * adjoint,
            gradient: adjoint.transpose() * Vector6::from(self.gradient),
            cost: self.cost,
            weight: self.weight,
        }
    }

    /// Sum of `w J J'` in the frame of the sums.
    pub fn information(&self) -> Matrix6<f64> {
        let mut information = Matrix6::zeros();
        let mut k = 0;
        for i in 0..6 {
            for j in i..6 {
                information[(i, j)] = self.upper[k];
                information[(j, i)] = self.upper[k];
                k += 1;
            }
        }
        information
    }
}

/// The matrix that turns a twist of one frame into the same twist of the frame `motion` maps into.
pub fn adjoint(motion: &Motion) -> Matrix6<f64> {
    let rotation = motion.rotation.to_rotation_matrix();
    let mut adjoint = Matrix6::zeros();
    adjoint.fixed_view_mut::<3, 3>(0, 0).copy_from(rotation.matrix());
    adjoint.fixed_view_mut::<3, 3>(3, 3).copy_from(rotation.matrix());
    adjoint.fixed_view_mut::<3, 3>(0, 3).copy_from(&(se3::skew(&motion.translation.vector) * rotation.matrix()));
    adjoint
}

/// Where each view's six unknowns begin; anchors have none.
pub fn columns(n: usize, anchors: &[usize]) -> Vec<Option<usize>> {
    let mut next = 0;
    (0..n)
        .map(|view| {
            (!anchors.contains(&view)).then(|| {
                next += 6;
                next - 6
            })
        })
        .collect()
}

/// Added to the diagonal, relative to its mean: keeps a direction that nothing holds from dividing by zero.
const DAMPING: f64 = 1e-9;

/// The twists of all views that minimise the linearised cost, zero for anchors; `None` if there is no solution.
pub fn solve(pairs: &[(usize, usize)], blocks: &[PairBlock], columns: &[Option<usize>]) -> Option<Vec<Twist>> {
    let unknowns = columns.iter().flatten().count() * 6;
    if unknowns == 0 {
        return None;
    }
    let mut matrix = CooMatrix::new(unknowns, unknowns);
    let mut right = DMatrix::<f64>::zeros(unknowns, 1);
    let mut trace = 0.0;
    for (&(a, b), block) in pairs.iter().zip(blocks) {
        for (view, sign) in [(a, -1.0), (b, 1.0)] {
            if let Some(k) = columns[view] {
                push(&mut matrix, k, k, &block.information, 1.0);
                trace += block.information.trace();
                let mut rows = right.rows_mut(k, 6);
                rows += block.gradient * sign;
            }
        }
        if let (Some(k), Some(l)) = (columns[a], columns[b]) {
            push(&mut matrix, k, l, &block.information, -1.0);
            push(&mut matrix, l, k, &block.information, -1.0);
        }
    }
    for k in 0..unknowns {
        matrix.push(k, k, DAMPING * trace / unknowns as f64);
    }
    let solution = CscCholesky::factor(&CscMatrix::from(&matrix)).ok()?.solve(&right);
    let twist = |k: usize| Twist::from_iterator(solution.rows(k, 6).iter().copied());
    solution
        .iter()
        .all(|x| x.is_finite())
        .then(|| columns.iter().map(|column| column.map_or_else(Twist::zeros, twist)).collect())
}

fn push(matrix: &mut CooMatrix<f64>, row: usize, column: usize, block: &Matrix6<f64>, sign: f64) {
    for i in 0..6 {
        for j in 0..6 {
            matrix.push(row + i, column + j, sign * block[(i, j)]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Point3, Vector3};

    #[test]
    fn one_step_undoes_a_small_motion() {
        let disturbed = Motion::new(Vector3::new(1e-4, -2e-4, 3e-4), Vector3::new(2e-4, 1e-4, -3e-4));
        let frame = Motion::new(Vector3::new(5.0, 1.0, -2.0), Vector3::new(0.4, 1.2, -0.3));
        let mut sums = PairSums::default();
        for k in 0..60 {
            let x = Vector3::new((k % 5) as f64, (k % 7) as f64, (k % 3) as f64);
            let n = Vector3::new((k % 4) as f64 - 1.5, (k % 6) as f64 - 2.5, 1.0).normalize();
            // view 1 (= a) lies at `disturbed`, view 0 (= b) where it belongs; sums are taken in `frame`
            let world = frame * Point3::from(x);
            let moved = frame.inverse() * (disturbed * world);
            sums.add(&n, &x, n.dot(&(moved.coords - x)), 1.0);
        }
        let twists = solve(&[(1, 0)], &[sums.into_world(&frame)], &columns(2, &[0])).expect("six directions are held");
        assert_eq!(twists[0], Twist::zeros());
        let left = se3::exp(&twists[1]) * disturbed;
        assert!(se3::log(&left).norm() < 1e-6, "{}", se3::log(&left).norm());
    }

    #[test]
    fn nothing_to_solve_is_none() {
        assert!(solve(&[], &[], &columns(1, &[0])).is_none());
    }
}
