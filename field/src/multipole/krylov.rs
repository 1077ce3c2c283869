//! GMRES for several right-hand sides together: each application of the operator serves all of them, and each solution is
//! sought in the space of all.
//!
//! Source: Saad 2003, section 6.12 (block GMRES) with right preconditioning (section 9.3.2); blocks are made orthonormal by
//! classical Gram-Schmidt done twice, and a direction that is in the space already is left out (deflation). Preconditioned
//! directions are kept (flexible GMRES, section 9.4.1): an approximate inverse in single precision is not quite linear, and
//! applied once more to the sum would leave residuals of 1e-7 and more.

use faer::linalg::matmul::matmul;
use faer::linalg::solvers::SolveLstsq;
use faer::{Accum, Mat, MatRef, Par};
use rayon::prelude::*;

/// What came out.
pub(crate) struct Outcome {
    pub solution: Mat<f64>,
    pub iterations: usize,
    /// Largest residual of a column over its right-hand side, both root mean square.
    pub residual: f64,
}

/// Rows whose inner products are summed together; the sums of all such pieces are added in order.
const PIECE: usize = 8192;

/// A new direction smaller than this part of what it was before orthogonalisation is in the space already.
const DEPENDENT: f64 = 1e-10;

/// Solves `A x = b` with `A⁻¹ ≈ precondition` until every column's residual is below `tolerance` of its right-hand side, or
/// the iterations are used up.
pub(crate) fn solve(
    apply: impl Fn(MatRef<'_, f64>) -> Mat<f64>,
    precondition: impl Fn(MatRef<'_, f64>) -> Mat<f64>,
    right: MatRef<'_, f64>,
    tolerance: f64,
    most: usize,
    mut progress: impl FnMut(usize, f64),
) -> Outcome {
    let (n, k) = (right.nrows(), right.ncols());
    let norms: Vec<f64> = (0..k).map(|c| inner(right.col(c).as_mat(), right.col(c).as_mat())[(0, 0)].sqrt()).collect();
    // Columns of equal size, so that deflation looks at all alike.
    let scaled = Mat::from_fn(n, k, |i, c| if norms[c] > 0.0 { right[(i, c)] / norms[c] } else { 0.0 });
    let (mut basis, mut directions): (Vec<Mat<f64>>, Vec<Mat<f64>>) = (Vec::new(), Vec::new());
    // Coefficients of A M v_j over the basis, one list for each v_j.
    let mut hessenberg: Vec<Vec<f64>> = Vec::new();
    let (first, start) = orthonormal(scaled, &basis);
    if first.ncols() == 0 {
        return Outcome { solution: Mat::zeros(n, k), iterations: 0, residual: 0.0 };
    }
    basis.push(first);
    let mut iterations = 0;
    let (mut coefficients, mut residual) = (Mat::zeros(0, k), 1.0);
    while iterations < most {
        let Some(last) = basis.last() else { break };
        let direction = precondition(last.as_ref());
        let image = apply(direction.as_ref());
        directions.push(direction);
        iterations += 1;
        let (next, columns) = orthonormal(image, &basis);
        hessenberg.extend(columns);
        let done = next.ncols() == 0;
        let width: usize = basis.iter().map(Mat::ncols).sum::<usize>() + next.ncols();
        (coefficients, residual) = least_squares(&hessenberg, &start, width);
        progress(iterations, residual);
        if residual <= tolerance || done {
            break;
        }
        basis.push(next);
    }
    // x = Σ (M V) y
    let mut solution = Mat::<f64>::zeros(n, k);
    let mut row = 0;
    for block in &directions {
        product_into(&mut solution, block, coefficients.get(row..row + block.ncols(), ..), 1.0);
        row += block.ncols();
    }
    for c in 0..k {
        for i in 0..n {
            solution[(i, c)] *= norms[c];
        }
    }
    Outcome { solution, iterations, residual }
}

/// Makes the columns orthonormal to the basis and to each other. Returns what is left, and for each column its coefficients
/// over the basis with that appended.
fn orthonormal(mut columns: Mat<f64>, basis: &[Mat<f64>]) -> (Mat<f64>, Vec<Vec<f64>>) {
    let (n, k) = (columns.nrows(), columns.ncols());
    let size: Vec<f64> = (0..k).map(|c| norm(columns.col(c))).collect();
    let mut over: Vec<Vec<f64>> = vec![Vec::new(); k];
    for pass in 0..2 {
        let mut row = 0;
        for block in basis {
            let part = inner(block.as_ref(), columns.as_ref());
            product_into(&mut columns, block, part.as_ref(), -1.0);
            for (c, over) in over.iter_mut().enumerate() {
                for b in 0..block.ncols() {
                    if pass == 0 {
                        over.push(part[(b, c)]);
                    } else {
                        over[row + b] += part[(b, c)];
                    }
                }
            }
            row += block.ncols();
        }
    }
    let mut kept: Vec<usize> = Vec::new();
    for c in 0..k {
        for pass in 0..2 {
            for (position, &b) in kept.iter().enumerate() {
                let part = inner(columns.col(b).as_mat(), columns.col(c).as_mat())[(0, 0)];
                for i in 0..n {
                    let value = columns[(i, b)];
                    columns[(i, c)] -= part * value;
                }
                if pass == 0 {
                    over[c].push(part);
                } else {
                    let at = over[c].len() - kept.len() + position;
                    over[c][at] += part;
                }
            }
        }
        let length = norm(columns.col(c));
        if length > DEPENDENT * size[c] {
            for i in 0..n {
                columns[(i, c)] /= length;
            }
            over[c].push(length);
            kept.push(c);
        }
    }
    (Mat::from_fn(n, kept.len(), |i, c| columns[(i, kept[c])]), over)
}

/// The y of least ‖start - H y‖ for each column, and the largest of the norms.
fn least_squares(hessenberg: &[Vec<f64>], start: &[Vec<f64>], width: usize) -> (Mat<f64>, f64) {
    let entry = |list: &Vec<f64>, i: usize| list.get(i).copied().unwrap_or(0.0);
    let h = Mat::from_fn(width, hessenberg.len(), |i, j| entry(&hessenberg[j], i));
    let b = Mat::from_fn(width, start.len(), |i, c| entry(&start[c], i));
    let y = h.qr().solve_lstsq(&b);
    let mut rest = b;
    matmul(&mut rest, Accum::Add, &h, &y, -1.0, Par::Seq);
    let largest = (0..start.len()).map(|c| rest.col(c).norm_l2()).fold(0.0, f64::max);
    (y, largest)
}

/// aᵀ b, the same for any number of threads.
fn inner(a: MatRef<'_, f64>, b: MatRef<'_, f64>) -> Mat<f64> {
    let n = a.nrows();
    let parts: Vec<Mat<f64>> = (0..n.div_ceil(PIECE))
        .into_par_iter()
        .map(|p| {
            let range = p * PIECE..((p + 1) * PIECE).min(n);
            let mut part = Mat::zeros(a.ncols(), b.ncols());
            let (a, b) = (a.get(range.clone(), ..), b.get(range, ..));
            matmul(&mut part, Accum::Replace, a.transpose(), b, 1.0, Par::Seq);
            part
        })
        .collect();
    parts.into_iter().fold(Mat::zeros(a.ncols(), b.ncols()), |sum, part| sum + part)
}

fn norm(column: faer::ColRef<'_, f64>) -> f64 {
    inner(column.as_mat(), column.as_mat())[(0, 0)].sqrt()
}

/// `to += factor · a · b`.
fn product_into(to: &mut Mat<f64>, a: &Mat<f64>, b: MatRef<'_, f64>, factor: f64) {
    to.par_row_chunks_mut(PIECE).enumerate().for_each(|(p, to)| {
        let a = a.get(p * PIECE..p * PIECE + to.nrows(), ..);
        matmul(to, Accum::Add, a, b, factor, Par::Seq);
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dependent_right_hand_sides_are_solved() {
        let n = 30;
        let a = Mat::from_fn(n, n, |i, j| if i == j { 3.0 } else { 1.0 / (1.0 + i as f64 + 2.0 * j as f64) });
        let exact = Mat::from_fn(n, 4, |i, c| match c {
            0 => 1.0,
            1 => i as f64,
            2 => 2.0 * i as f64 - 3.0,
            _ => 0.0,
        });
        let b = &a * &exact;
        let found = solve(|x| &a * x, |x| x.to_owned(), b.as_ref(), 1e-12, 40, |_, _| ());
        let error = (&found.solution - &exact).norm_max();
        assert!(found.residual < 1e-12 && error < 1e-9, "{} {error}", found.residual);
    }
}
