//! Charges on panels from their potentials, without the dense matrix.

use std::time::Instant;

use faer::{Mat, MatRef};

use super::krylov;
use super::operator::{PanelOperator, Scheme};
use super::points::PointsError;
use super::precondition::Patches;
use crate::panel::Panel;

/// How it went.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct IterativeReport {
    /// Applications of the operator, of which each serves all columns of a group.
    pub iterations: usize,
    /// Largest residual of a column, root mean square over that of its right-hand side, with the operator as it is.
    pub residual: f64,
    /// Bytes at the peak.
    pub bytes: u64,
    /// Preparing the operator, s.
    pub operator_seconds: f64,
    /// Preparing the approximate inverse, s.
    pub inverse_seconds: f64,
    /// Iterating, s.
    pub solve_seconds: f64,
}

/// Why there is no solution.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum IterativeError {
    /// A panel without area, or with a corner that is not finite.
    #[error("panel {panel} has no area")]
    Degenerate {
        /// Which panel.
        panel: usize,
    },
    /// The tolerance is out of range.
    #[error("the tolerance {asked:e} is not between 1e-8 and 0.1")]
    Tolerance {
        /// What was asked.
        asked: f64,
    },
    /// Rows of right-hand sides are not as many as panels, or not numbers.
    #[error("right-hand side {column} needs {panels} finite numbers, one for each panel")]
    RightHandSide {
        /// Which column.
        column: usize,
        /// Number of panels.
        panels: usize,
    },
    /// The points that stand for the panels cannot be summed.
    #[error(transparent)]
    Points(#[from] PointsError),
    /// Too many iterations.
    #[error(
        "GMRES stopped at {residual:.1e} after {iterations} iterations, asked {asked:.0e}: panels almost on each other, or very long and thin?"
    )]
    NotConverged {
        /// Largest relative residual.
        residual: f64,
        /// Iterations.
        iterations: usize,
        /// What was asked.
        asked: f64,
    },
}

/// Iterations after which something is wrong: a million panels take some thirty.
const MOST: usize = 150;

/// Right-hand sides advanced together.
const TOGETHER: usize = 8;

/// The residual over the tolerance. The inverse amplifies what varies from panel to panel, by panels over the size of the
/// whole; charges on spheres and graded electrodes are within the tolerance with this (`solutions_are_as_good_as_asked`).
const RESIDUAL: f64 = 0.1;

/// Accuracy of the operator over the tolerance, asked of charges of random sign; for those of a solution it is some ten times
/// better.
const OPERATOR: f64 = 1.0;

/// Bytes that [`solve_panels`] needs at its peak for so many panels and right-hand sides, from above for surfaces.
pub fn bytes_needed(panels: usize, columns: usize, tolerance: f64) -> u64 {
    let (n, k) = (panels as u64, columns.clamp(1, TOGETHER) as u64);
    let digits = (-tolerance.log10()).clamp(1.0, 8.0);
    // Points and sparse entries, patches, expansions of the columns, and the Krylov space.
    let fixed = 1500.0 + 250.0 * digits;
    let per_column = 8.0 * (12.0 + 8.0 * digits) + 150.0 + 60.0 * digits * digits;
    (n as f64 * (fixed + 900.0 + k as f64 * per_column)) as u64 + (64 << 20)
}

/// Solves Σ_j P_ij q_j = b_i for charges over metres (charges over Coulomb's constant come of potentials in volts), P the
/// Galerkin matrix of [`crate::influence::potential_coefficients`], to a relative `tolerance` of the charges: root mean square
/// over panels, up to some 10⁴ of them. What the inverse amplifies grows with the number of panels along an electrode: with
/// 10⁵ single panels' charges miss by 1.8e-4 at 1e-4 and by 2.3e-3 at 1e-3 (`cargo bench --bench multipole -- solve`). Sums
/// over electrodes are far better: 7e-6 at 1e-3 with 2500 panels. `progress` hears iterations and the residual over the one that is wanted.
///
/// # Errors
/// See [`IterativeError`].
pub fn solve_panels(
    panels: &[Panel],
    right_hand_sides: MatRef<'_, f64>,
    tolerance: f64,
    progress: &mut dyn FnMut(usize, f64),
) -> Result<(Mat<f64>, IterativeReport), IterativeError> {
    if !(1e-8..=0.1).contains(&tolerance) {
        return Err(IterativeError::Tolerance { asked: tolerance });
    }
    let n = panels.len();
    // An area that is not a number is caught as well.
    if let Some(panel) = panels.iter().position(|p| !(p.area > 0.0 && p.area.is_finite())) {
        return Err(IterativeError::Degenerate { panel });
    }
    for column in 0..right_hand_sides.ncols() {
        if right_hand_sides.nrows() != n || !right_hand_sides.col(column).iter().all(|v| v.is_finite()) {
            return Err(IterativeError::RightHandSide { column, panels: n });
        }
    }
    let start = Instant::now();
    let mut charges = Mat::zeros(n, right_hand_sides.ncols());
    let mut report = IterativeReport::default();
    if n == 0 || right_hand_sides.ncols() == 0 {
        return Ok((charges, report));
    }
    let mut operator = PanelOperator::with_scheme(panels, Scheme::of(OPERATOR * tolerance))?;
    report.operator_seconds = start.elapsed().as_secs_f64();
    let inverse = Patches::new(&operator);
    operator.forget_entries();
    report.inverse_seconds = start.elapsed().as_secs_f64() - report.operator_seconds;
    let order = &operator.clusters.order;
    let wanted = RESIDUAL * tolerance;
    for first in (0..right_hand_sides.ncols()).step_by(TOGETHER) {
        let columns = TOGETHER.min(right_hand_sides.ncols() - first);
        let right = Mat::from_fn(n, columns, |i, c| right_hand_sides[(order[i] as usize, first + c)]);
        let outcome = krylov::solve(
            |x| operator.apply_sorted(x),
            |x| inverse.apply(x),
            right.as_ref(),
            wanted,
            MOST,
            |iteration, residual| progress(iteration, residual / wanted),
        );
        if outcome.residual > wanted {
            let (residual, iterations) = (outcome.residual, outcome.iterations);
            return Err(IterativeError::NotConverged { residual, iterations, asked: wanted });
        }
        for c in 0..columns {
            for (i, &p) in order.iter().enumerate() {
                charges[(p as usize, first + c)] = outcome.solution[(i, c)];
            }
        }
        let krylov = 8 * (n * columns * (2 * outcome.iterations + 4)) as u64;
        let bytes = operator.bytes() + inverse.bytes() + operator.bytes_applied(columns) + krylov;
        report.bytes = report.bytes.max(bytes);
        report.iterations += outcome.iterations;
        report.residual = report.residual.max(outcome.residual);
    }
    report.solve_seconds = start.elapsed().as_secs_f64() - report.operator_seconds - report.inverse_seconds;
    Ok((charges, report))
}
