//! Panels by the thousand: charges by iterations with sums by multipoles.

use std::time::Instant;

use faer::{Mat, Par};
use meshes::SurfaceMesh;

use crate::boundary_problem::{SolveError, Solved};
use crate::coarse::{CoarseCapacitance, groups};
use crate::constants::COULOMB;
use crate::linear;
use crate::multipole::{PanelOperator, solve_keeping};
use crate::panel::Panel;

/// Charges on the panels (V m) for wanted mean potentials, to a relative tolerance.
///
/// # Errors
/// The iterations did not arrive.
pub(crate) fn solve(
    mesh: &SurfaceMesh,
    panels: &[Panel],
    wanted: &Mat<f64>,
    tolerance: f64,
    with_coarse: bool,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Solved, SolveError> {
    let start = Instant::now();
    let mut first = None;
    // The residual falls by about the same factor each time: the logarithm tells how far it is.
    let mut told = |_: usize, left: f64| {
        let first = *first.get_or_insert(left.max(1.0 + 1e-9));
        progress((1.0 - left.max(1.0).ln() / first.ln()).clamp(0.0, 1.0));
    };
    let (mut charge, report, operator) = solve_keeping(panels, wanted.as_ref(), tolerance, &mut told)?;
    let moved = make_reciprocal(mesh, &mut charge);
    let coarse = operator.filter(|_| with_coarse).map(|operator| coarser(mesh, panels, &charge, &operator));
    Ok(Solved {
        coarse,
        unknowns: panels.len(),
        iterations: report.iterations,
        residual: report.residual.max(moved),
        bytes: report.bytes,
        assembly_seconds: report.operator_seconds + report.inverse_seconds,
        solve_seconds: start.elapsed().as_secs_f64() - report.operator_seconds - report.inverse_seconds,
        charge,
    })
}

/// Mixes the unit charges so that the charges on the electrodes are a symmetric matrix, as those of the exact solution are
/// (Green's reciprocity); returns how far that moves a voltage, V per V.
///
/// With T the charges on the electrodes (row) in each solution (column), the mixture M with T M = (T + Tᵀ)/2 differs from one by
/// no more than what the iterations left. Checked by `law_iterations_give_the_charges_of_the_matrix`.
fn make_reciprocal(mesh: &SurfaceMesh, charge: &mut Mat<f64>) -> f64 {
    let n = mesh.electrodes.len();
    let total = Mat::from_fn(n, n, |i, k| mesh.panels_of(i).map(|p| charge[(p, k)]).sum::<f64>());
    let mut mixture = faer::Scale(0.5) * (&total + total.transpose());
    linear::solve(total, &mut mixture, Par::Seq);
    let mixed = charge.subcols(0, n) * &mixture;
    charge.subcols_mut(0, n).copy_from(&mixed);
    let off = |i: usize, k: usize| (mixture[(i, k)] - f64::from(u8::from(i == k))).abs();
    (0..n).flat_map(|i| (0..n).map(move |k| (i, k))).map(|(i, k)| off(i, k)).fold(0.0, f64::max)
}

/// The capacitances of a charge that is constant on groups of panels, from that of the panels.
///
/// Of all such charges the coarse solution is the one nearest to the fine one in energy, and C_fine - C_coarse is the energy
/// of the difference, δᵀ P δ. For it stands the mean density of each group, which is nearly as near: the difference comes out
/// somewhat too large. Checked by `law_coarser_capacitances_of_iterations`.
fn coarser(mesh: &SurfaceMesh, panels: &[Panel], charge: &Mat<f64>, operator: &PanelOperator) -> CoarseCapacitance {
    let (group, count) = groups(mesh);
    let electrodes = mesh.electrodes.len();
    let mut area = vec![0.0; count];
    for (panel, &g) in panels.iter().zip(&group) {
        area[g as usize] += panel.area;
    }
    let mut rough = Mat::<f64>::zeros(panels.len(), electrodes);
    for k in 0..electrodes {
        let mut total = vec![0.0; count];
        for (p, &g) in group.iter().enumerate() {
            total[g as usize] += charge[(p, k)];
        }
        for (p, &g) in group.iter().enumerate() {
            rough[(p, k)] = charge[(p, k)] - total[g as usize] * panels[p].area / area[g as usize];
        }
    }
    let potential = operator.apply_columns(rough.as_ref());
    let energy = |i: usize, k: usize| -> f64 { (0..panels.len()).map(|p| rough[(p, i)] * potential[(p, k)]).sum() };
    let total = |i: usize, k: usize| -> f64 { mesh.panels_of(i).map(|p| charge[(p, k)]).sum() };
    let matrix = (0..electrodes)
        .map(|i| {
            let mean = |f: &dyn Fn(usize, usize) -> f64, k: usize| 0.5 * (f(i, k) + f(k, i));
            (0..electrodes).map(|k| (mean(&total, k) - mean(&energy, k)) / COULOMB).collect()
        })
        .collect();
    CoarseCapacitance { matrix, size_ratio: (panels.len() as f64 / count as f64).sqrt() }
}
