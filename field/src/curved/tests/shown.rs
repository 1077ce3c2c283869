use meshes::{SurfaceMesh, triangulate};

use super::*;
use crate::ElectrodeBasis;
use crate::constants::COULOMB;

/// A disc's density, infinite at its edge, is shown on panels: their charges add up to the capacitances, and away from the edge
/// they are those of the exact density, 1 / (π² k sqrt(a² - r²)) on both sides together (Maxwell, art. 152).
#[test]
fn charges_shown_add_up() {
    let disc = Shape::Disc { radius: 1.0, hole_radius: 0.0, thickness: 0.0 };
    let setup = Setup::one(disc).and(plate(1.0, 1.0), [0.0, 0.0, 40.0], [0.0, 1.0, 1.0]);
    let solution = setup.solved(1e-7).solution;
    let parts =
        setup.shapes.iter().enumerate().map(|(k, (shape, placement))| {
            (k.to_string(), triangulate(shape, 1.0).unwrap().placed(placement).unwrap())
        });
    let mesh = SurfaceMesh::assemble(parts);
    let basis = ElectrodeBasis::from_curved(mesh, Vec::new(), None, solution);
    let matrix = &basis.capacitance.matrix;
    for k in 0..2 {
        for e in 0..2 {
            let sum: f64 = basis.mesh.panels_of(e).map(|p| basis.charge[(p, k)]).sum();
            assert!((sum - matrix[e][k]).abs() < 1e-13 * matrix[0][0], "{e} {k}: {sum} {}", matrix[e][k]);
        }
    }
    let density = basis.charge_density(0);
    let mut worst = 0.0_f64;
    for p in basis.mesh.panels_of(0) {
        let r = basis.panels[p].centroid.norm();
        let exact = 1.0 / (std::f64::consts::PI.powi(2) * COULOMB * (1.0 - r * r).sqrt());
        if r < 0.8 {
            worst = worst.max((density[p] / exact - 1.0).abs());
        }
    }
    // Panels are a twentieth of the radius wide: second differences of the density over that. The plate is 40 radii away.
    assert!(worst < 2e-2, "{worst}");
}
