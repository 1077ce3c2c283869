//! Systems of linear equations that are not symmetric.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::lu::partial_pivoting as lu;
use faer::perm::PermRef;
use faer::{Mat, Par};

/// Solves A x = b for every column, in place; the matrix is given up.
pub(crate) fn solve(matrix: Mat<f64>, columns: &mut Mat<f64>, par: Par) {
    let (n, width) = (matrix.nrows(), columns.ncols());
    factorised(matrix, par, |matrix, permutation| {
        let mut memory = MemBuffer::new(lu::solve::solve_in_place_scratch::<usize, f64>(n, width, par));
        let (lower, upper, memory) = (matrix.as_ref(), matrix.as_ref(), MemStack::new(&mut memory));
        lu::solve::solve_in_place(lower, upper, permutation, columns.as_mut(), par, memory);
    });
}

/// Solves Aᵀ x = b for every column, in place; the matrix is given up.
pub(crate) fn solve_transposed(matrix: Mat<f64>, columns: &mut Mat<f64>, par: Par) {
    let (n, width) = (matrix.nrows(), columns.ncols());
    factorised(matrix, par, |matrix, permutation| {
        let mut memory = MemBuffer::new(lu::solve::solve_transpose_in_place_scratch::<usize, f64>(n, width, par));
        let (lower, upper, memory) = (matrix.as_ref(), matrix.as_ref(), MemStack::new(&mut memory));
        lu::solve::solve_transpose_in_place(lower, upper, permutation, columns.as_mut(), par, memory);
    });
}

/// Hands on both factors, one below the other's diagonal, and the order of the rows. An empty matrix has none.
fn factorised(mut matrix: Mat<f64>, par: Par, with: impl FnOnce(&Mat<f64>, PermRef<'_, usize>)) {
    let n = matrix.nrows();
    if n == 0 {
        return;
    }
    let (mut forward, mut backward) = (vec![0_usize; n], vec![0_usize; n]);
    let mut memory = MemBuffer::new(lu::factor::lu_in_place_scratch::<usize, f64>(n, n, par, Default::default()));
    let memory = MemStack::new(&mut memory);
    let (_, permutation) =
        lu::factor::lu_in_place(matrix.as_mut(), &mut forward, &mut backward, par, memory, Default::default());
    with(&matrix, permutation);
}
