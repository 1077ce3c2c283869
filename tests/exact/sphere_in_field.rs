//! A floating sphere in a uniform field: the conductor's answer to an outside source.

use field::{BasisField, BoundaryProblem, Samples, Source, SourceKind};
use graintrap_tests::{reference, single};
use meshes::{Shape, Vec3};

#[test]
fn exact_sphere_in_field() {
    for case in reference("capacitance.json").iter().filter(|c| c.id.starts_with("sphere_in_field")) {
        let (a, e0) = (case.input("a"), case.input("E0_along_z"));
        let mesh = single(&Shape::Sphere { radius: a }, 2000);
        let frame = [Vec3::x(), Vec3::y(), Vec3::z()];
        let sources = [Source { kind: SourceKind::Uniform, center: Vec3::zeros(), frame }];
        let basis = BoundaryProblem { sources: &sources, ..BoundaryProblem::new(&mesh) }.solve().unwrap();
        // An isolated sphere: its voltage follows from its total charge, zero.
        let floating = basis.capacitance.floating_voltages(&[true], &basis.induced);
        let voltage = floating[0][1] * e0;
        assert!(
            voltage.abs() < 1e-3 * e0 * a,
            "by symmetry the sphere stays at the potential of its centre: {voltage}"
        );
        let field = basis.combined(&[vec![voltage, e0]]);
        let mut samples = Samples::default();
        field.sample(&[Vec3::z() * (2.0 * a), Vec3::x() * (2.0 * a), Vec3::z() * (0.3 * a)], &mut samples);
        // Discretisation: 2000 panels of constant charge, 5e-4 in the capacitance.
        let close = |got: f64, key: &str| {
            let exact = case.output(key);
            assert!((got / exact - 1.0).abs() < 2e-3, "{}: {key} {got} instead of {exact}", case.id);
        };
        close(samples.potential[0], "phi_total_at_(0,0,2a)");
        close(-samples.gradient[0].z, "Ez_total_at_(0,0,2a)");
        close(-samples.gradient[1].z, "Ez_total_at_(2a,0,0)");
        // Inside the conductor there is no field.
        assert_eq!((samples.potential[2], samples.gradient[2]), (voltage, Vec3::zeros()));
    }
}
