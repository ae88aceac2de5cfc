//! The sparse system over all poses: what each pair of views says of their motions, solved at once.

use nalgebra::{DMatrix, SMatrix};
use nalgebra_sparse::factorization::CscCholesky;
use nalgebra_sparse::{CooMatrix, CscMatrix};

/// Normal equations over the poses of many views with `D` unknowns each and `W` right sides: the Laplacian of the graph of
/// pairs, with a `D x D` block for a pair. Views that keep their pose have no unknowns.
pub struct PoseSystem<'a, const D: usize, const W: usize> {
    columns: &'a [Option<usize>],
    unknowns: usize,
    matrix: CooMatrix<f64>,
    right: DMatrix<f64>,
    trace: f64,
}

/// Added to the diagonal, relative to its mean: keeps a direction that nothing holds from dividing by zero.
pub const DAMPING: f64 = 1e-9;

/// Where each view's `D` unknowns begin; views that keep their pose have none.
pub fn columns<const D: usize>(n: usize, is_free: impl Fn(usize) -> bool) -> Vec<Option<usize>> {
    let mut next = 0;
    let mut column = |view: usize| {
        is_free(view).then(|| {
            next += D;
            next - D
        })
    };
    (0..n).map(&mut column).collect()
}

impl<'a, const D: usize, const W: usize> PoseSystem<'a, D, W> {
    /// Of views whose unknowns begin at `columns`; `None` if there are none.
    pub fn new(columns: &'a [Option<usize>]) -> Option<Self> {
        let unknowns = columns.iter().flatten().count() * D;
        let (matrix, right) = (CooMatrix::new(unknowns, unknowns), DMatrix::zeros(unknowns, W));
        (unknowns > 0).then_some(PoseSystem { columns, unknowns, matrix, right, trace: 0.0 })
    }

    /// Adds what views `a` and `b` say of each other: `information` of the difference of their unknowns, and `gradient`
    /// by those of a, which is the opposite of that by those of b.
    pub fn add(&mut self, (a, b): (usize, usize), information: &SMatrix<f64, D, D>, gradient: &SMatrix<f64, D, W>) {
        for (view, sign) in [(a, -1.0), (b, 1.0)] {
            if let Some(k) = self.columns[view] {
                push(&mut self.matrix, k, k, information, 1.0);
                self.trace += information.trace();
                let mut rows = self.right.rows_mut(k, D);
                rows += gradient * sign;
            }
        }
        if let (Some(k), Some(l)) = (self.columns[a], self.columns[b]) {
            push(&mut self.matrix, k, l, information, -1.0);
            push(&mut self.matrix, l, k, information, -1.0);
        }
    }

    /// Adds [`DAMPING`] to the diagonal.
    pub fn damped(mut self) -> Self {
        for k in 0..self.unknowns {
            self.matrix.push(k, k, DAMPING * self.trace / self.unknowns as f64);
        }
        self
    }

    /// The unknowns of all views that minimise the cost, zero for those that keep their pose; `None` if the pairs don't
    /// hold them.
    pub fn solve(self) -> Option<Vec<SMatrix<f64, D, W>>> {
        let solution = solve_positive(&self.matrix, &self.right)?;
        let of_view = |k: usize| SMatrix::from_fn(|i, j| solution[(k + i, j)]);
        Some(self.columns.iter().map(|column| column.map_or_else(SMatrix::zeros, of_view)).collect())
    }

    /// The inverse of the matrix: the covariance of all unknowns at noise 1; `None` if the pairs don't hold them.
    pub fn inverse(self) -> Option<DMatrix<f64>> {
        solve_positive(&self.matrix, &DMatrix::identity(self.unknowns, self.unknowns))
    }
}

fn push<const D: usize>(matrix: &mut CooMatrix<f64>, row: usize, column: usize, block: &SMatrix<f64, D, D>, sign: f64) {
    for i in 0..D {
        for j in 0..D {
            matrix.push(row + i, column + j, sign * block[(i, j)]);
        }
    }
}

fn solve_positive(matrix: &CooMatrix<f64>, right: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let solution = CscCholesky::factor(&CscMatrix::from(matrix)).ok()?.solve(right);
    solution.iter().all(|x| x.is_finite()).then_some(solution)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::SVector;

    /// Differences along a chain of three views, of which the first stays.
    fn chain(differences: [f64; 2]) -> Option<Vec<SVector<f64, 1>>> {
        let columns = columns::<1>(3, |view| view != 0);
        let mut system = PoseSystem::<1, 1>::new(&columns)?;
        for (k, difference) in differences.into_iter().enumerate() {
            system.add((k, k + 1), &SMatrix::from([[2.0]]), &SMatrix::from([[2.0 * difference]]));
        }
        system.solve()
    }

    #[test]
    fn a_chain_adds_up_its_differences() {
        let found = chain([1.5, -0.5]).expect("held").into_iter().map(|x| x[0]);
        let expected = [0.0, 1.5, 1.0];
        assert!(found.zip(expected).all(|(x, expected)| (x - expected).abs() < 1e-12));
    }

    #[test]
    fn the_inverse_is_the_covariance_of_the_chain() {
        let columns = columns::<1>(3, |view| view != 0);
        let mut system = PoseSystem::<1, 1>::new(&columns).expect("two are free");
        for pair in [(0, 1), (1, 2)] {
            system.add(pair, &SMatrix::from([[2.0]]), &SMatrix::zeros());
        }
        let inverse = system.inverse().expect("held");
        assert!((inverse - nalgebra::dmatrix![0.5, 0.5; 0.5, 1.0]).norm() < 1e-12);
    }

    #[test]
    fn what_nothing_holds_is_none() {
        let held = columns::<6>(1, |_| false);
        assert!(PoseSystem::<6, 1>::new(&held).is_none());
        let loose = columns::<6>(2, |view| view == 1);
        assert!(PoseSystem::<6, 1>::new(&loose).expect("one is free").solve().is_none());
        let (information, nothing) = (SMatrix::<f64, 6, 6>::zeros(), SVector::<f64, 6>::zeros());
        let mut system = PoseSystem::<6, 1>::new(&loose).expect("one is free");
        system.add((0, 1), &information, &nothing);
        assert!(system.damped().solve().is_none());
    }
}
