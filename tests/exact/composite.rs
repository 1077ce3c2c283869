//! Rings, discs and their combinations: the geometries of the Granular Imager study.

use std::f64::consts::TAU;
use std::num::NonZeroUsize;

use field::constants::COULOMB;
use field::{BasisField, BoundaryProblem, ElectrodeBasis, Samples};
use gauss_quad::GaussLegendre;
use graintrap_tests::{Reference, number, numbers, reference, several};
use meshes::{Placement, Shape, Vec3};
use serde_json::Value;

fn electrode(e: &Value) -> (Shape, Placement) {
    let (z, a) = (number(&e["z"]), number(&e["a"]));
    let shape = match e["type"].as_str() {
        Some("torus") => Shape::Ring { radius: number(&e["R"]), wire_radius: a },
        Some("disc") => Shape::Disc { radius: a, hole_radius: 0.0, thickness: 0.0 },
        other => panic!("{other:?}"),
    };
    (shape, graintrap_tests::at(Vec3::z() * z))
}

fn solved(case: &Reference, panels: usize) -> ElectrodeBasis {
    let parts: Vec<_> = case.inputs["electrodes"]
        .as_array()
        .unwrap()
        .iter()
        .map(|e| {
            let (shape, placement) = electrode(e);
            (shape, placement, panels)
        })
        .collect();
    BoundaryProblem::new(&several(&parts)).solve().unwrap()
}

/// A_l of φ = Σ A_l r^l P_l about a centre on the axis: the mean of φ P_l over a sphere, times (2l + 1)/r^l. Gauss's rule in
/// cosθ and equal steps of azimuth are exact for the first dozen multipoles.
fn axial_multipole(field: &dyn BasisField, center: Vec3, l: usize, radius: f64) -> f64 {
    let around = 12;
    let rule = GaussLegendre::new(NonZeroUsize::new(12).unwrap());
    let mut points = Vec::new();
    let mut weights = Vec::new();
    for (c, weight) in rule.as_node_weight_pairs() {
        let s = (1.0 - c * c).sqrt();
        for k in 0..around {
            let (sin, cos) = (TAU * k as f64 / around as f64).sin_cos();
            points.push(center + Vec3::new(s * cos, s * sin, *c) * radius);
            weights.push(0.5 * weight / around as f64);
        }
    }
    let mut samples = Samples::default();
    field.sample(&points, &mut samples);
    let legendre = |c: f64| match l {
        0 => 1.0,
        2 => 0.5 * (3.0 * c * c - 1.0),
        _ => panic!("P_{l} is not needed"),
    };
    let mean: f64 = (0..points.len())
        .map(|k| weights[k] * samples.potential[k] * legendre((points[k].z - center.z) / radius))
        .sum();
    (2 * l + 1) as f64 * mean / radius.powi(l as i32)
}

#[test]
fn exact_composite_geometries() {
    for case in reference("composite.json") {
        if !["two_equal_tori_fig14", "ring_and_plate_config1", "ring_two_plates"].contains(&case.id.as_str()) {
            continue;
        }
        let basis = solved(&case, 1500);
        println!("{}: {} panels", case.id, basis.panels.len());
        let exact: Vec<Vec<f64>> =
            case.outputs["c_matrix_over_4pi_eps0"].as_array().unwrap().iter().map(numbers).collect();
        let largest = exact.iter().flatten().fold(0.0_f64, |m, c| m.max(c.abs()));
        for (i, row) in exact.iter().enumerate() {
            for (k, c) in row.iter().enumerate() {
                let got = basis.capacitance.matrix[i][k] * COULOMB;
                println!("  C[{i}][{k}] {:9.2e}", got / c - 1.0);
                // The goal for constant charge: 3e-3 of each entry, entries below a tenth of the largest of that.
                assert!(
                    (got - c).abs() < 3e-3 * c.abs().max(0.1 * largest),
                    "{}: C[{i}][{k}] {got} instead of {c}",
                    case.id
                );
            }
        }
        let center = Vec3::z() * case.input("centre_z");
        let points: Vec<Vec3> = case.inputs["points_rho_z"]
            .as_array()
            .unwrap()
            .iter()
            .map(numbers)
            .map(|p| Vec3::new(0.6 * p[0], 0.8 * p[0], p[1]))
            .collect();
        for excitation in case.outputs["excitations"].as_array().unwrap() {
            let volts = numbers(&excitation["V"]);
            let field = basis.combined(std::slice::from_ref(&volts));
            let mut samples = Samples::default();
            field.sample(&points, &mut samples);
            let mut worst = (0.0_f64, 0.0_f64);
            let (phi, e_rho, e_z) =
                (numbers(&excitation["phi"]), numbers(&excitation["E_rho"]), numbers(&excitation["E_z"]));
            let strongest = e_rho.iter().zip(&e_z).map(|(a, b)| a.hypot(*b)).fold(0.0, f64::max);
            for p in 0..points.len() {
                let outward = Vec3::new(0.6, 0.8, 0.0);
                let error = (samples.potential[p] - phi[p]).abs();
                let g = samples.gradient[p];
                let field_error = (-g.dot(&outward) - e_rho[p]).hypot(-g.z - e_z[p]) / strongest;
                worst = (worst.0.max(error), worst.1.max(field_error));
            }
            let a2 = axial_multipole(&field, center, 2, 0.1);
            let exact_a2 = numbers(&excitation["A_l"])[2];
            // In place of a ratio the coefficient itself where symmetry makes it zero.
            let a2_error = if exact_a2.abs() > 1e-9 {
                format!("A2 {:.1e}", a2 / exact_a2 - 1.0)
            } else {
                format!("A2 {a2:.1e} V/m² instead of 0")
            };
            println!("  V {volts:?}: potential {:.1e} V, field {:.1e}, {a2_error}", worst.0, worst.1);
            let most = volts.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
            assert!(worst.0 < 1e-3 * most, "{}: potentials miss by {} of {most} V", case.id, worst.0);
            assert!(worst.1 < 5e-3, "{}: fields miss by {} of the strongest", case.id, worst.1);
            let slack = 1e-2 * exact_a2.abs().max(1e-3);
            assert!((a2 - exact_a2).abs() < slack, "{}: A2 {a2} instead of {exact_a2}", case.id);
        }
    }
}
