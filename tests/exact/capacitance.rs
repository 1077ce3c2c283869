//! Capacitances in closed form, with the order of convergence.

use field::influence::Testing;
use field::{BoundaryProblem, constants::COULOMB};
use graintrap_tests::{Reference, at, reference, several, single};
use meshes::{Placement, Shape, SurfaceMesh, Vec3};

/// Capacitance over 4πε0, m.
fn capacitance(mesh: &SurfaceMesh, testing: Testing) -> f64 {
    let basis = BoundaryProblem { testing, ..BoundaryProblem::new(mesh) }.solve().unwrap();
    basis.capacitance.matrix[0][0] * COULOMB
}

/// The shape of a reference case of a single electrode, where graintrap has that shape.
fn shape(case: &Reference) -> Option<(Shape, &'static str)> {
    let shape = match case.inputs["shape"].as_str()? {
        "sphere" if case.inputs["E0_along_z"].is_null() => {
            (Shape::Sphere { radius: case.input("a") }, "C_over_4pi_eps0")
        }
        "disc" => (Shape::Disc { radius: case.input("a"), hole_radius: 0.0, thickness: 0.0 }, "C_over_4pi_eps0"),
        "open_cap" => {
            let opening = case.input("half_angle_deg").to_radians();
            (Shape::EndCap { radius: case.input("a"), opening, thickness: 0.0 }, "C_over_4pi_eps0")
        }
        "torus" => {
            let (radius, wire_radius) = (case.input("ring_radius"), case.input("tube_radius"));
            (Shape::Ring { radius, wire_radius }, "C_over_4pi_eps0")
        }
        "cube" => (Shape::Box { size: [case.input("side"); 3] }, "C_over_4pi_eps0"),
        "square_plate" => (Shape::Plate { size: [case.input("side"); 2], thickness: 0.0 }, "C_over_4pi_eps0"),
        _ => return None,
    };
    Some(shape)
}

/// What about 2000 panels of constant charge must reach.
fn goal(shape: &Shape) -> f64 {
    match shape {
        Shape::Ring { .. } => 3e-3,
        _ => 1e-3,
    }
}

#[test]
fn exact_capacitances_with_2000_panels() {
    let mut seen = 0;
    for case in reference("capacitance.json") {
        let Some((shape, key)) = shape(&case) else { continue };
        let exact = case.output(key);
        let mut errors = Vec::new();
        for panels in [500, 2000] {
            let mesh = single(&shape, panels);
            errors.push((mesh.panels() as f64, capacitance(&mesh, Testing::Galerkin) / exact - 1.0));
        }
        let [(n0, e0), (n1, e1)] = errors[..] else { unreachable!() };
        // In panel size, which is (panels)^(-1/2).
        let order = 2.0 * (e0 / e1).abs().ln() / (n1 / n0).ln();
        println!("{:24} {n0:5} panels {e0:9.2e}, {n1:5} panels {e1:9.2e}, order {order:.2}", case.id);
        assert!(e1.abs() < goal(&shape), "{}: relative error {e1:e} with {n1} panels", case.id);
        assert!(
            e1 < 0.0 || matches!(shape, Shape::Ring { .. }),
            "{}: Galerkin capacitances are bounds from below",
            case.id
        );
        assert!((1.5..3.2).contains(&order), "{}: order {order}", case.id);
        seen += 1;
    }
    assert!(seen >= 20, "{seen} cases");
}

#[test]
fn exact_capacitances_by_collocation() {
    // The plain method is the judge of the other: same limit, larger error.
    for case in reference("capacitance.json") {
        let Some((shape, key)) = shape(&case) else { continue };
        let mesh = single(&shape, 1000);
        let exact = case.output(key);
        let plain = capacitance(&mesh, Testing::Collocation) / exact - 1.0;
        let galerkin = capacitance(&mesh, Testing::Galerkin) / exact - 1.0;
        println!("{:24} {:5} panels: collocation {plain:9.2e}, Galerkin {galerkin:9.2e}", case.id, mesh.panels());
        assert!(plain.abs() < 6e-3, "{}: {plain:e}", case.id);
        assert!((plain - galerkin).abs() < 5e-3, "{}: they must converge to the same value", case.id);
    }
}

#[test]
fn exact_two_spheres() {
    for case in reference("capacitance.json").iter().filter(|c| c.inputs["shape"] == "two_spheres") {
        let (a, b, d) = (case.input("a"), case.input("b"), case.input("centre_distance"));
        let gap = d - a - b;
        let parts = [(a, Vec3::zeros()), (b, Vec3::z() * d)].map(|(r, c)| (Shape::Sphere { radius: r }, at(c), 1500));
        let mesh = several(&parts);
        let basis = BoundaryProblem::new(&mesh).solve().unwrap();
        let c = &basis.capacitance.matrix;
        for (got, key) in [
            (c[0][0], "c11_over_4pi_eps0"),
            (c[0][1], "c12_over_4pi_eps0"),
            (c[1][1], "c22_over_4pi_eps0"),
            (c[0][0] + 2.0 * c[0][1] + c[1][1], "C_both_same_potential"),
        ] {
            let (got, exact) = (got * COULOMB, case.output(key));
            let error = (got - exact).abs() / case.output("c11_over_4pi_eps0");
            println!("{:32} {key:24} {error:.2e}", case.id);
            // Panels are 0.09 wide; where they are wider than the gap they cannot follow the charge in it.
            let tolerance = if gap > 0.3 { 2e-3 } else { 0.02 / gap * 0.1 };
            assert!(error < tolerance, "{}: {key} {got} instead of {exact}", case.id);
        }
    }
}

#[test]
fn exact_concentric_spheres() {
    for case in reference("capacitance.json").iter().filter(|c| c.inputs["shape"] == "concentric_spheres") {
        let radii = [case.input("a_inner"), case.input("b_outer_shell")];
        let mut mesh = several(&radii.map(|radius| (Shape::Sphere { radius }, Placement::default(), 1500)));
        mesh.electrodes[1].hollow = true;
        let basis = BoundaryProblem::new(&mesh).solve().unwrap();
        for (i, k, key) in [(0, 0, "c11_over_4pi_eps0"), (0, 1, "c12_over_4pi_eps0"), (1, 1, "c22_over_4pi_eps0")] {
            let (got, exact) = (basis.capacitance.matrix[i][k] * COULOMB, case.output(key));
            // Two faceted spheres a tenth apart: facets of 0.09 stand off by 1e-3, a hundredth of the gap.
            let tolerance = if radii[1] - radii[0] > 0.5 { 3e-3 } else { 2e-2 };
            assert!((got / exact - 1.0).abs() < tolerance, "{}: {key} {got} instead of {exact}", case.id);
        }
        // The inner sphere's row sums to zero: what is left of it is the error of the solution.
        assert!(basis.capacitance.defects(1e-3).is_empty());
    }
}

#[test]
fn wires_hold_the_charge_of_round_ones() {
    let ring = Shape::Ring { radius: 1.0, wire_radius: 0.01 };
    let exact =
        reference("capacitance.json").iter().find(|c| c.id == "torus.a=0.01.R=1").unwrap().output("C_over_4pi_eps0");
    let mesh = meshes::triangulate(&ring, 0.75).unwrap();
    let sides = mesh.vertices.iter().filter(|v| (v.y / v.x).abs() < 1e-9 && v.x > 0.0).count();
    assert_eq!(sides, 6, "a hexagon round the wire");
    let got = capacitance(&SurfaceMesh::assemble([("ring".to_string(), mesh)]), Testing::Galerkin);
    // A hexagon of the wire's surface area would miss by 4.0 % in radius, 4.0 % / ln(8 R/a) = 6e-3 in capacitance.
    assert!((got / exact - 1.0).abs() < 2.5e-3, "{}", got / exact - 1.0);
}

#[test]
fn the_coarser_charge_tells_the_error() {
    // A uniform mesh of a square, as an imported one may be: the estimate from groups of panels against the true error.
    let n = 24;
    let at = |i: usize, j: usize| (i * (n + 1) + j) as u32;
    let mut square = meshes::Triangulation::default();
    for i in 0..=n {
        for j in 0..=n {
            square.vertices.push(Vec3::new(i as f64 / n as f64, j as f64 / n as f64, 0.0));
        }
    }
    for i in 0..n {
        for j in 0..n {
            let corners = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            square.triangles.extend([[corners[0], corners[1], corners[2]], [corners[0], corners[2], corners[3]]]);
        }
    }
    let mesh = SurfaceMesh::assemble([("square".to_string(), square)]);
    let basis = BoundaryProblem { with_coarse: true, ..BoundaryProblem::new(&mesh) }.solve().unwrap();
    let exact =
        reference("capacitance.json").iter().find(|c| c.id == "square_plate.side=1").unwrap().output("C_over_4pi_eps0");
    let coarse = basis.coarse.unwrap();
    let (fine, coarser) = (basis.capacitance.matrix[0][0] * COULOMB, coarse.matrix[0][0] * COULOMB);
    let error = (exact - fine) / exact;
    let estimate = (fine - coarser) / fine / (coarse.size_ratio - 1.0);
    println!("true error {error:.2e}, estimate {estimate:.2e}, groups of {:.2}", coarse.size_ratio.powi(2));
    assert!(coarser < fine && fine < exact, "coarser charges give less capacitance");
    // First order (charge at a free edge, uniform panels): right within a factor of two.
    assert!((0.5..2.0).contains(&(estimate / error)));
}
