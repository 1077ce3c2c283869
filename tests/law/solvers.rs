//! Solvers of one problem agree: what one does by a matrix another does by symmetry or by iterations.

use field::influence::Testing;
use field::{BoundaryProblem, By, ElectrodeBasis, Source, SourceKind};
use meshes::{GridPattern, Hole, Outline, Placement, Shape, SurfaceMesh, Vec3, triangulate};

/// A plate with holes between two discs; the discs are mirror images of each other.
fn sandwich() -> SurfaceMesh {
    let holes = GridPattern::Perforated { hole: Hole::Square, open: 0.25, thickness: 0.0 };
    let grid = Shape::GridPlate { outline: Outline::Rectangle([1.6, 1.6]), pitch: 0.5, pattern: holes };
    let disc = Shape::Disc { radius: 0.8, hole_radius: 0.0, thickness: 0.0 };
    let part = |shape: &Shape, z: f64, fineness: f64| {
        let at = Placement { center: Vec3::z() * z, axis: Vec3::z(), up: None };
        triangulate(shape, fineness).unwrap().placed(&at).unwrap()
    };
    SurfaceMesh::assemble([
        ("grid".to_owned(), part(&grid, 0.0, 0.8)),
        ("upper".to_owned(), part(&disc, 0.5, 0.8)),
        ("lower".to_owned(), part(&disc, -0.5, 0.8)),
    ])
}

fn solved(mesh: &SurfaceMesh, sources: &[Source], testing: Testing, by: By) -> ElectrodeBasis {
    BoundaryProblem { sources, testing, by, with_coarse: true, ..BoundaryProblem::new(mesh) }.solve().unwrap()
}

/// Largest difference of charges, against the largest of each basis function.
fn apart(a: &ElectrodeBasis, b: &ElectrodeBasis) -> f64 {
    let largest = |k: usize| a.charge.col(k).iter().fold(0.0_f64, |m, q| m.max(q.abs()));
    let apart = |k: usize| (0..a.panels.len()).map(|p| (a.charge[(p, k)] - b.charge[(p, k)]).abs()).fold(0.0, f64::max);
    (0..a.functions()).map(|k| apart(k) / largest(k)).fold(0.0, f64::max)
}

fn field_along_x() -> Source {
    Source { kind: SourceKind::Uniform, center: Vec3::zeros(), frame: [Vec3::y(), Vec3::z(), Vec3::x()] }
}

#[test]
fn law_symmetry_and_the_whole_matrix_give_the_same_charges() {
    let mesh = sandwich();
    // One disc at 1 V is not symmetric, nor is a field across: both are put together from even and odd parts.
    for sources in [vec![], vec![field_along_x()]] {
        for testing in [Testing::Galerkin, Testing::Collocation] {
            let (whole, reduced) =
                (solved(&mesh, &sources, testing, By::Dense), solved(&mesh, &sources, testing, By::Symmetry));
            // Rounding times the condition of the matrix, 1e4.
            let off = apart(&whole, &reduced);
            println!("{testing:?}: {off:.1e} apart, {} of {} unknowns", reduced.report.unknowns, whole.report.unknowns);
            assert!(off < 1e-9, "{testing:?}: {off}");
            // Diagonals of the triangles keep fewer symmetries than the electrodes have: even and odd charges are left.
            let saved = reduced.report.matrix_bytes as f64 / whole.report.matrix_bytes as f64;
            assert!(saved < 0.75 || !sources.is_empty(), "{saved}");
        }
    }
}

#[test]
fn law_iterations_give_the_charges_of_the_matrix() {
    let mesh = sandwich();
    let whole = solved(&mesh, &[field_along_x()], Testing::Galerkin, By::Dense);
    for tolerance in [1e-3, 1e-5] {
        let iterated = solved(&mesh, &[field_along_x()], Testing::Galerkin, By::Multipoles { tolerance });
        let off = apart(&whole, &iterated);
        println!("asked {tolerance:.0e}, {off:.1e} apart after {} iterations", iterated.report.iterations);
        // Root mean square is what is asked; the matrix itself is known to 1e-6 of its entries, and single small panels feel
        // that more than sums do.
        assert!(off < 10.0 * tolerance + 3e-5, "{tolerance}: {off}");
        let largest = whole.capacitance.matrix[0][0];
        for (a, b) in whole.capacitance.matrix.iter().flatten().zip(iterated.capacitance.matrix.iter().flatten()) {
            assert!((a - b).abs() < tolerance * largest, "{tolerance}: {a} {b}");
        }
        assert!(iterated.report.iterations > 0 && whole.report.iterations == 0);
        // Symmetric before it is made so, to the rounding of sums of thousands.
        assert!(iterated.capacitance.asymmetry < 1e-12, "{}", iterated.capacitance.asymmetry);
    }
}

#[test]
fn law_coarser_capacitances_of_iterations() {
    let mesh = sandwich();
    let (whole, iterated) = (
        solved(&mesh, &[], Testing::Galerkin, By::Dense),
        solved(&mesh, &[], Testing::Galerkin, By::Multipoles { tolerance: 1e-4 }),
    );
    let drop = |basis: &ElectrodeBasis| basis.capacitance.matrix[0][0] - basis.coarse.as_ref().unwrap().matrix[0][0];
    // The mean density of a group stands for the coarse solution, which is nearest in energy: more, but not much more.
    let ratio = drop(&iterated) / drop(&whole);
    println!("coarser by {:.2e} and {:.2e}", drop(&whole), drop(&iterated));
    assert!((0.9..2.5).contains(&ratio), "{ratio}");
}
