//! Systems of linear equations that are not symmetric.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::lu::partial_pivoting as lu;
use faer::{Mat, Par};

/// Solves Aᵀ x = b for every column; the matrix is given up.
pub(crate) fn solve_transposed(mut matrix: Mat<f64>, columns: &mut Mat<f64>) {
    let (n, par) = (matrix.nrows(), Par::rayon(0));
    if n == 0 {
        return;
    }
    let (mut forward, mut backward) = (vec![0_usize; n], vec![0_usize; n]);
    let mut memory = MemBuffer::new(lu::factor::lu_in_place_scratch::<usize, f64>(n, n, par, Default::default()));
    let (_, permutation) = lu::factor::lu_in_place(
        matrix.as_mut(),
        &mut forward,
        &mut backward,
        par,
        MemStack::new(&mut memory),
        Default::default(),
    );
    let scratch = lu::solve::solve_transpose_in_place_scratch::<usize, f64>(n, columns.ncols(), par);
    let mut memory = MemBuffer::new(scratch);
    lu::solve::solve_transpose_in_place(
        matrix.as_ref(),
        matrix.as_ref(),
        permutation,
        columns.as_mut(),
        par,
        MemStack::new(&mut memory),
    );
}
