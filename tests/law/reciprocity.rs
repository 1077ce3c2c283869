//! Green's reciprocity: what a charge does to an electrode and the electrode to the charge is one number.

use field::influence::Testing;
use field::{BasisField, BoundaryProblem, ElectrodeBasis, Samples, Source, SourceKind};
use graintrap_tests::{clear_points, ring_disc_sphere};
use meshes::Vec3;

/// Largest |Q_k + φ_k(p)| over all electrodes and points: Q_k what a charge of 1 C at p induces on electrode k, all
/// grounded, φ_k(p) the potential there with electrode k alone at 1 V.
fn reciprocity_error(basis: &ElectrodeBasis, points: &[Vec3]) -> f64 {
    let electrodes = basis.mesh.electrodes.len();
    let units: Vec<Vec<f64>> =
        (0..electrodes).map(|k| (0..basis.functions()).map(|l| f64::from(u8::from(k == l))).collect()).collect();
    let mut samples = Samples::default();
    basis.combined(&units).sample(points, &mut samples);
    let mut worst = 0.0_f64;
    for p in 0..points.len() {
        for k in 0..electrodes {
            worst = worst.max((basis.induced[k][p] + samples.potential[p * electrodes + k]).abs());
        }
    }
    worst
}

#[test]
fn law_induced_charge_is_minus_the_unit_potential() {
    let frame = [Vec3::x(), Vec3::y(), Vec3::z()];
    let mut collocation = Vec::new();
    for panels in [150, 600] {
        let mesh = ring_disc_sphere(panels);
        // Half a metre away: the right-hand sides are by a rule of degree 5 on panels whose radius is below 0.16.
        let points = clear_points(&mesh, 1.6, 0.5, 12, 7);
        let sources: Vec<Source> =
            points.iter().map(|&center| Source { kind: SourceKind::Point, center, frame }).collect();
        let solved = |testing| {
            let problem = BoundaryProblem { sources: &sources, testing, ..BoundaryProblem::new(&mesh) };
            reciprocity_error(&problem.solve().unwrap(), &points)
        };
        let (galerkin, plain) = (solved(Testing::Galerkin), solved(Testing::Collocation));
        println!("{} panels: Galerkin {galerkin:.1e}, collocation {plain:.1e} V per V", mesh.panels());
        // With a symmetric matrix both are the same sum; what is left is the rule of degree 5 in the right-hand sides, a
        // thousandth of (0.16/0.5)⁶. Measured 1.2e-7 and, with panels of half the size, 1.1e-10.
        assert!(galerkin < 1e-6, "{galerkin:e}");
        collocation.push(plain);
    }
    // Collocation obeys in the limit of many panels only: discretisation, of first order in the panel size at least.
    // Measured 8.3e-4 and 5.2e-5.
    assert!(collocation[1] < 0.6 * collocation[0] && collocation[1] < 3e-4, "{collocation:?}");
}

#[test]
fn law_capacitance_is_symmetric() {
    let mut errors = Vec::new();
    for panels in [150, 600] {
        let mesh = ring_disc_sphere(panels);
        let solved = |testing| BoundaryProblem { testing, ..BoundaryProblem::new(&mesh) }.solve().unwrap().capacitance;
        let (galerkin, plain) = (solved(Testing::Galerkin), solved(Testing::Collocation));
        let largest = galerkin.matrix.iter().flatten().fold(0.0_f64, |m, c| m.max(c.abs()));
        let apart = (0..3)
            .flat_map(|i| (0..3).map(move |k| (i, k)))
            .map(|(i, k)| (galerkin.matrix[i][k] - plain.matrix[i][k]).abs() / largest)
            .fold(0.0, f64::max);
        println!(
            "{} panels: asymmetry Galerkin {:.1e}, collocation {:.1e}; they differ by {apart:.1e}",
            mesh.panels(),
            galerkin.asymmetry,
            plain.asymmetry
        );
        // Rounding times the condition number of some thousand panels.
        assert!(galerkin.asymmetry < 1e-12, "{:e}", galerkin.asymmetry);
        errors.push((plain.asymmetry, apart));
    }
    // Collocation's asymmetry and its distance from Galerkin are discretisation, and go away with it: first order at worst.
    assert!(errors[1].0 < 0.6 * errors[0].0 && errors[1].1 < 0.6 * errors[0].1, "{errors:?}");
}
