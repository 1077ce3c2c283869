//! The seam between ways of applying a matrix: dense, without a matrix, reduced by symmetry, by multipoles.

use faer::{ColMut, ColRef, Mat, Par};
use rayon::prelude::*;

use crate::influence::galerkin;
use crate::panel::Panel;

/// A linear map from charges to potentials.
pub trait LinearOperator: Send + Sync {
    /// Length of what comes out.
    fn rows(&self) -> usize;

    /// Length of what goes in.
    fn cols(&self) -> usize;

    /// `y = A x`. The result does not depend on the number of threads.
    ///
    /// # Panics
    /// `x` or `y` has another length.
    fn apply(&self, x: &[f64], y: &mut [f64]);
}

impl LinearOperator for Mat<f64> {
    fn rows(&self) -> usize {
        self.nrows()
    }

    fn cols(&self) -> usize {
        self.ncols()
    }

    fn apply(&self, x: &[f64], y: &mut [f64]) {
        let (x, y) = (ColRef::from_slice(x), ColMut::from_slice_mut(y));
        // One thread: faer splits sums by thread number, which would change the last bits.
        faer::linalg::matmul::matmul(y, faer::Accum::Replace, self, x, 1.0, Par::Seq);
    }
}

/// The Galerkin matrix of potential coefficients (1/m), computed entry by entry as it is applied: slow, and judge of all others.
#[derive(Clone, Copy, Debug)]
pub struct GalerkinOperator<'a> {
    /// The panels.
    pub panels: &'a [Panel],
}

impl LinearOperator for GalerkinOperator<'_> {
    fn rows(&self) -> usize {
        self.panels.len()
    }

    fn cols(&self) -> usize {
        self.panels.len()
    }

    fn apply(&self, x: &[f64], y: &mut [f64]) {
        y.par_iter_mut().enumerate().for_each(|(i, y)| *y = self.row(i, x));
    }
}

impl GalerkinOperator<'_> {
    /// One entry of the product, Σ_j P_ij x_j.
    pub fn row(&self, i: usize, x: &[f64]) -> f64 {
        let one = &self.panels[i];
        self.panels.iter().zip(x).enumerate().map(|(j, (other, x))| galerkin(one, other, i == j) * x).sum()
    }
}
