//! Uniformly charged triangles, rectangles and thin rings.

use field::panel::{Panel, brute_force, quadrature};
use field::{Source, SourceKind, constants::COULOMB};
use graintrap_tests::{Reference, numbers, reference, vector};
use meshes::Vec3;

/// The triangles a reference case is made of: one, or two for a rectangle.
fn panels(case: &Reference) -> Vec<Panel> {
    let corners: Vec<Vec3> = case.inputs["vertices"].as_array().unwrap().iter().map(vector).collect();
    (2..corners.len()).map(|k| Panel::new([corners[0], corners[k - 1], corners[k]])).collect()
}

#[test]
fn exact_panel_integrals() {
    let mut seen = 0;
    for case in reference("elements.json").iter().filter(|c| c.inputs["vertices"].is_array()) {
        let (point, parts) = (vector(&case.inputs["point"]), panels(case));
        let (mut potential, mut gradient) = (0.0, Vec3::zeros());
        for panel in &parts {
            let (p, g) = panel.potential_and_gradient(&point);
            potential += p;
            gradient += g;
        }
        let (phi, e) = (case.output("phi"), vector(&case.outputs["E"]));
        // The reference asks 1e-10; the closed form has eleven digits next to an edge and fourteen elsewhere.
        assert!((potential / phi - 1.0).abs() < 1e-11, "{}: potential {potential} instead of {phi}", case.id);
        assert!((gradient + e).norm() < 1e-11 * e.norm().max(1.0), "{}: field {} instead of {e}", case.id, -gradient);
        seen += 1;
    }
    assert!(seen >= 20, "{seen} cases");
}

#[test]
fn exact_panel_integrals_judges() {
    for case in reference("elements.json").iter().filter(|c| c.inputs["vertices"].is_array()) {
        let (point, parts) = (vector(&case.inputs["point"]), panels(case));
        let phi = case.output("phi");
        let slow: f64 = parts.iter().map(|p| brute_force::potential_and_gradient(p, &point).0).sum();
        assert!((slow / phi - 1.0).abs() < 1e-9, "{}: brute force {slow} instead of {phi}", case.id);
        let distance = parts.iter().map(|p| (p.centroid - point).norm() / p.radius).fold(f64::INFINITY, f64::min);
        if distance > 8.0 {
            let far: f64 = parts.iter().map(|p| quadrature::potential_and_gradient(p, &point, 5).0).sum();
            assert!((far / phi - 1.0).abs() < 1e-7, "{}: quadrature {far} instead of {phi}", case.id);
        }
    }
}

#[test]
fn exact_thin_ring() {
    let mut seen = 0;
    for case in reference("elements.json").iter().filter(|c| c.id.starts_with("ring.")) {
        let (radius, rho, z) = (case.input("R"), case.input("rho"), case.input("z"));
        let frame = [Vec3::x(), Vec3::y(), Vec3::z()];
        let ring = Source { kind: SourceKind::ThinRing { radius }, center: Vec3::zeros(), frame };
        // Along some direction in the plane that is not an axis.
        let direction = Vec3::new(0.6, 0.8, 0.0);
        let (potential, gradient) = ring.potential_and_gradient(&(direction * rho + Vec3::z() * z));
        let expected = [case.output("phi"), case.output("E_rho"), case.output("E_z")];
        let got = [potential, -gradient.dot(&direction), -gradient.z].map(|x| x / COULOMB);
        let scale = expected[1].abs().max(expected[2].abs());
        for (got, expected) in got.iter().zip(expected) {
            // Points computed as 0.6 ρ and 0.8 ρ are off by rounding, which next to the ring (0.001 away) is 1e-13 of ρ/0.001.
            let slack = 1e-11 * expected.abs().max(1e-6 * scale);
            assert!((got - expected).abs() <= slack, "{}: {got} instead of {expected}", case.id);
        }
        seen += 1;
    }
    assert_eq!(seen, 20, "cases");
    assert_eq!(numbers(&serde_json::json!([1.0])), [1.0]);
}
