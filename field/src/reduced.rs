//! The matrix of panels reduced by symmetry: one unknown for each orbit of panels.

use std::time::Instant;

use faer::{Mat, Par};
use meshes::{SurfaceMesh, Vec3};
use rayon::prelude::*;

use crate::boundary_problem::Solved;
use crate::influence::{Testing, galerkin};
use crate::linear::solve_transposed;
use crate::panel::Panel;
use crate::plane::Plane;
use crate::symmetry::Symmetry;

/// Potential of panel `j` (with its image) on panel `i`, 1/m.
fn entry(panels: &[Panel], images: Option<&[Panel]>, testing: Testing, i: usize, j: usize) -> f64 {
    match testing {
        Testing::Galerkin => {
            galerkin(&panels[i], &panels[j], i == j)
                - images.map_or(0.0, |images| galerkin(&panels[i], &images[j], false))
        }
        Testing::Collocation => {
            let at = |panel: &Panel| panel.potential(&panels[i].centroid) / panel.area;
            at(&panels[j]) - images.map_or(0.0, |images| at(&images[j]))
        }
    }
}

/// Charges on the panels (V m) for wanted potentials, from one matrix for each sector of the symmetry.
pub(crate) fn solve(
    mesh: &SurfaceMesh,
    panels: &[Panel],
    images: Option<&[Panel]>,
    ground: Option<&Plane>,
    testing: Testing,
    wanted: &Mat<f64>,
    progress: &(dyn Fn(f64) + Sync),
) -> Solved {
    let start = Instant::now();
    let centroids: Vec<Vec3> = panels.iter().map(|panel| panel.centroid).collect();
    let symmetry = Symmetry::find(&centroids, &mesh.electrode, wanted, ground.map(|plane| &plane.normal));
    let mut solved = Solved {
        charge: Mat::zeros(panels.len(), wanted.ncols()),
        coarse: None,
        unknowns: 0,
        iterations: 0,
        residual: 0.0,
        bytes: 0,
        assembly_seconds: 0.0,
        solve_seconds: 0.0,
    };
    let sectors: Vec<(u32, Mat<f64>)> = symmetry.parts(wanted);
    let orbits: Vec<_> = sectors.iter().map(|(sector, _)| symmetry.orbits(*sector)).collect();
    let mut matrices: Vec<Mat<f64>> = orbits.iter().map(|(_, own)| Mat::zeros(own.len(), own.len())).collect();
    let done = std::sync::atomic::AtomicUsize::new(0);
    let rows: Vec<Vec<Vec<f64>>> = symmetry
        .representatives
        .par_iter()
        .map(|&i| {
            let row: Vec<f64> = (0..panels.len()).map(|j| entry(panels, images, testing, i as usize, j)).collect();
            let n = done.fetch_add(1, std::sync::atomic::Ordering::Relaxed) + 1;
            progress(0.9 * n as f64 / symmetry.representatives.len() as f64);
            orbits.iter().map(|(of, own)| Symmetry::folded(&row, of, own.len())).collect()
        })
        .collect();
    for (&i, folded) in symmetry.representatives.iter().zip(&rows) {
        for ((matrix, (_, own)), row) in matrices.iter_mut().zip(&orbits).zip(folded) {
            if let Ok(column) = own.binary_search(&i) {
                matrix.col_as_slice_mut(column).copy_from_slice(row);
            }
        }
    }
    drop(rows);
    solved.assembly_seconds = start.elapsed().as_secs_f64();
    for (((_, part), (of, own)), matrix) in sectors.iter().zip(&orbits).zip(matrices) {
        solved.unknowns += own.len();
        solved.bytes += 8 * (own.len() * own.len()) as u64;
        let mut columns = Mat::from_fn(own.len(), part.ncols(), |i, c| part[(own[i] as usize, c)]);
        solve_transposed(matrix, &mut columns, Par::rayon(0));
        Symmetry::unfold(&columns, of, &mut solved.charge);
    }
    solved.solve_seconds = start.elapsed().as_secs_f64() - solved.assembly_seconds;
    solved
}
