//! Exact values, errors told against errors made, fields in closed form.

use std::f64::consts::{FRAC_2_PI, FRAC_PI_2};
use std::sync::Arc;

use meshes::profile::{Curve, revolved};
use meshes::{Shape, Vec3};
use serde_json::Value;

use super::*;
use crate::constants::COULOMB;

fn body(shape: &Shape, electrode: usize, height: f64) -> AxialBody {
    let profile = revolved(shape).unwrap().swap_remove(0).profile;
    AxialBody { profile, electrode, height, flipped: false }
}

fn bodies(shapes: &[(Shape, f64)]) -> Vec<AxialBody> {
    shapes.iter().enumerate().map(|(k, (shape, height))| body(shape, k, *height)).collect()
}

fn problem(bodies: &[AxialBody]) -> AxialProblem<'_> {
    let electrodes = 1 + bodies.iter().map(|b| b.electrode).max().unwrap();
    AxialProblem { bodies, electrodes, sources: &[], ground: None }
}

fn solved(bodies: &[AxialBody], accuracy: f64) -> AxialSolution {
    problem(bodies).solve(accuracy).unwrap()
}

fn sphere(radius: f64) -> Shape {
    Shape::Sphere { radius }
}

fn ring(radius: f64, wire_radius: f64) -> Shape {
    Shape::Ring { radius, wire_radius }
}

fn disc(radius: f64) -> Shape {
    Shape::Disc { radius, hole_radius: 0.0, thickness: 0.0 }
}

fn cases(file: &str) -> Vec<Value> {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/reference").join(file);
    let all: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    all["cases"].as_array().unwrap().clone()
}

/// Geometries of the reference file with their capacitance matrices over 4πε0, m.
fn exact_geometries() -> Vec<(String, Vec<AxialBody>, Vec<Vec<f64>>)> {
    let mut all = Vec::new();
    for case in cases("capacitance.json") {
        let input = |key: &str| case["inputs"][key].as_f64().unwrap();
        let output = |key: &str| case["outputs"][key].as_f64().unwrap();
        let id = case["id"].as_str().unwrap();
        let single = |shape: Shape| (bodies(&[(shape, 0.0)]), vec![vec![output("C_over_4pi_eps0")]]);
        let pair = |shapes: &[(Shape, f64)]| {
            let [c11, c12, c22] = ["c11", "c12", "c22"].map(|c| output(&format!("{c}_over_4pi_eps0")));
            (bodies(shapes), vec![vec![c11, c12], vec![c12, c22]])
        };
        let (bodies, exact) = match case["inputs"]["shape"].as_str().unwrap() {
            "sphere" if !id.contains("field") => single(sphere(input("a"))),
            "disc" => single(disc(input("a"))),
            "open_cap" => {
                let opening = input("half_angle_deg").to_radians();
                single(Shape::EndCap { radius: input("a"), opening, thickness: 0.0 })
            }
            "torus" => single(ring(input("ring_radius"), input("tube_radius"))),
            "two_spheres" => pair(&[(sphere(input("a")), 0.0), (sphere(input("b")), input("centre_distance"))]),
            "concentric_spheres" => pair(&[(sphere(input("a_inner")), 0.0), (sphere(input("b_outer_shell")), 0.0)]),
            _ => continue,
        };
        all.push((id.to_owned(), bodies, exact));
    }
    for case in cases("composite.json") {
        let of = |e: &Value| {
            let number = |key: &str| e[key].as_f64().unwrap();
            let shape = if e["type"] == "torus" { ring(number("R"), number("a")) } else { disc(number("a")) };
            (shape, number("z"))
        };
        let shapes: Vec<_> = case["inputs"]["electrodes"].as_array().unwrap().iter().map(of).collect();
        let row = |r: &Value| r.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect();
        let exact = case["outputs"]["c_matrix_over_4pi_eps0"].as_array().unwrap().iter().map(row).collect();
        all.push((case["id"].as_str().unwrap().to_owned(), bodies(&shapes), exact));
    }
    all
}

fn error(solution: &AxialSolution, exact: &[Vec<f64>]) -> f64 {
    let largest = exact.iter().flatten().fold(0.0_f64, |m, c| m.max(c.abs()));
    let got = solution.capacitance.matrix.iter().flatten();
    got.zip(exact.iter().flatten()).map(|(a, b)| (a * COULOMB - b).abs()).fold(0.0, f64::max) / largest
}

/// The factor by which the error told may miss the error made.
const TOLD: f64 = 1.5;

/// An error at which rounding begins to tell.
const ROUNDING: f64 = 1e-12;

fn assert_told(id: &str, accuracy: f64, made: f64, told: f64) {
    // The capacitances themselves are rounded: 1e-14 and the condition of the equations.
    assert!(made <= accuracy && told <= accuracy.max(2e-13), "{id} to {accuracy:e}: made {made:e}, told {told:e}");
    let ratio = told / made;
    assert!(
        made < ROUNDING || (1.0 / TOLD..TOLD).contains(&ratio),
        "{id} to {accuracy:e}: made {made:e}, told {told:e}"
    );
    assert!(made < 2.0 * told, "{id} to {accuracy:e}: made {made:e}, told {told:e}");
}

#[test]
fn errors_told_are_errors_made() {
    let mut seen = 0;
    for (id, bodies, exact) in exact_geometries() {
        for accuracy in [1e-2, 1e-3, 1e-5, 1e-7, 1e-9, 1e-11] {
            let solution = solved(&bodies, accuracy);
            let (made, told) = (error(&solution, &exact), solution.data.capacitance_error);
            println!("{id} to {accuracy:.0e}: {} unknowns, made {made:.1e}, told {told:.1e}", solution.unknowns());
            assert_told(&id, accuracy, made, told);
            assert!(solution.data.misfit <= accuracy && solution.capacitance.asymmetry <= accuracy);
        }
        seen += 1;
    }
    assert!(seen >= 29, "{seen} geometries");
}

/// Pieces of straight line from corner to corner.
fn turned(corners: &[[f64; 2]], closed: bool) -> AxialBody {
    let curves = corners.windows(2).map(|w| Curve::Line { from: w[0], to: w[1] }).collect();
    AxialBody { profile: Profile { curves, closed }, electrode: 0, height: 0.0, flipped: false }
}

#[test]
fn narrow_gaps_are_resolved() {
    // Equal spheres: c11 = a sinh μ Σ 1/sinh((2n + 1)μ), c12 = -a sinh μ Σ 1/sinh(2nμ), cosh μ = d/2a. Smythe, section 5.082.
    for gap in [1e-2_f64, 1e-4, 1e-6] {
        let mu = (gap + 0.25 * gap * gap).sqrt().asinh();
        let sum = |first: i32| -> f64 {
            let term = |n: i32| mu.sinh() / (f64::from(2 * n + first) * mu).sinh();
            (0..200_000).map(term).take_while(|t| *t > 1e-18).sum()
        };
        let (c11, c12) = (sum(1), -sum(2));
        let exact = [vec![c11, c12], vec![c12, c11]];
        let bodies = bodies(&[(sphere(1.0), 0.0), (sphere(1.0), 2.0 + gap)]);
        for accuracy in [1e-3, 1e-6, 1e-8] {
            let solution = solved(&bodies, accuracy);
            let (made, told) = (error(&solution, &exact), solution.data.capacitance_error);
            println!("{gap:.0e} to {accuracy:.0e}: {} unknowns, {made:.1e} {told:.1e}", solution.unknowns());
            // The gap itself is rounded, to 1e-16 over its width.
            assert!(
                made < told * TOLD + 1e-16 / gap + 1e-12 && told <= accuracy,
                "{gap:e}: made {made:e}, told {told:e}"
            );
        }
    }
    // A shell in a shell: one over the gap.
    let bodies = bodies(&[(sphere(0.999), 0.0), (sphere(1.0), 0.0)]);
    let c = solved(&bodies, 1e-8).capacitance.matrix[0][0] * COULOMB;
    assert!((c / 999.0 - 1.0).abs() < 1e-10, "{c}");
}

#[test]
fn edges_and_corners_converge() {
    let of = |shape: Shape| body(&shape, 0, 0.0);
    let shapes = [
        ("annulus", of(Shape::Disc { radius: 1.0, hole_radius: 0.4, thickness: 0.0 })),
        ("annulus with a narrow hole", of(Shape::Disc { radius: 1.0, hole_radius: 0.01, thickness: 0.0 })),
        ("thick disc", of(Shape::Disc { radius: 1.0, hole_radius: 0.0, thickness: 0.2 })),
        ("disc of a hundredth", of(Shape::Disc { radius: 1.0, hole_radius: 0.0, thickness: 0.01 })),
        ("thick annulus", of(Shape::Disc { radius: 1.0, hole_radius: 0.4, thickness: 0.2 })),
        ("closed cylinder", of(Shape::Cylinder { radius: 1.0, length: 2.0, caps: true })),
        ("open cylinder", of(Shape::Cylinder { radius: 1.0, length: 2.0, caps: false })),
        ("needle", of(Shape::Cylinder { radius: 0.01, length: 2.0, caps: true })),
        ("rod", of(Shape::Rod { radius: 0.1, length: 2.0 })),
        ("thick cap", of(Shape::EndCap { radius: 1.0, opening: 1.2, thickness: 0.05 })),
        ("thick bowl", of(Shape::EndCap { radius: 1.0, opening: 2.5, thickness: 0.1 })),
        ("hyperbolic ring", of(Shape::HyperbolicRing { r0: 1.0, z0: 0.7, extent: 2.0 })),
        ("hyperbolic cap", of(Shape::HyperbolicCap { r0: 1.0, z0: 0.7, extent: 2.0 })),
        // Angles of which no power makes whole numbers, outwards and inwards.
        ("double cone", turned(&[[0.0, 1.0], [0.8, 0.0], [0.0, -1.5]], false)),
        ("ring of three sides", turned(&[[1.0, 0.3], [1.3, -0.1], [0.8, -0.2], [1.0, 0.3]], true)),
        ("stepped pin", turned(&[[0.0, 1.0], [0.2, 1.0], [0.2, 0.1], [0.9, 0.0], [0.0, -0.3]], false)),
    ];
    for (name, body) in shapes {
        let bodies = [body];
        // Odd corners take hundreds of unknowns.
        let odd = ["double cone", "ring of three sides", "stepped pin"].contains(&name);
        let start = std::time::Instant::now();
        let (finest, judge) = problem(&bodies).solve_with_judge(if odd { 1e-8 } else { 1e-10 }).unwrap();
        println!(
            "{name}: {:.14} m over 4πε0, {} unknowns, {:.0} ms",
            judge.capacitance.matrix[0][0] * COULOMB,
            finest.unknowns(),
            1e3 * start.elapsed().as_secs_f64()
        );
        for accuracy in [1e-3, 1e-5, 1e-7, 1e-9].into_iter().take(if odd { 3 } else { 4 }) {
            let solution = solved(&bodies, accuracy);
            let made = (solution.capacitance.matrix[0][0] / judge.capacitance.matrix[0][0] - 1.0).abs();
            println!(
                "  {accuracy:.0e}: {} unknowns, {made:.1e} {:.1e}",
                solution.unknowns(),
                solution.data.capacitance_error
            );
            assert_told(name, accuracy, made, solution.data.capacitance_error);
        }
    }
}

/// A field in closed form: potential and its derivatives along ρ and z.
type Form = fn(f64, f64) -> [f64; 3];

fn of_sphere(rho: f64, z: f64) -> [f64; 3] {
    let r = rho.hypot(z);
    [1.0 / r, -rho / r.powi(3), -z / r.powi(3)]
}

/// Disc of radius one: φ = (2/π) arccot ζ in oblate coordinates, ρ² = (1 + ζ²)(1 - ξ²), z = ζ ξ, for which
/// ∂ζ/∂ρ = ρ ζ/(1 + ζ²)(ζ² + ξ²) (1 + ζ²) = ρ ζ/(ζ² + ξ²), ∂ζ/∂z = z (1 + ζ²)/ζ (ζ² + ξ²). Smythe, section 5.27.
fn of_disc(rho: f64, z: f64) -> [f64; 3] {
    // ζ² = (s + √(s² + 4z²))/2, s = ρ² + z² - 1, and for s < 0 by the other root, without cancellation.
    let s = rho * rho + z * z - 1.0;
    let root = s.hypot(2.0 * z);
    let zeta2 = if s > 0.0 { 0.5 * (s + root) } else { 2.0 * z * z / (root - s) };
    let zeta = zeta2.sqrt();
    let slope = -FRAC_2_PI / (1.0 + zeta2);
    [FRAC_2_PI * 1.0_f64.atan2(zeta), slope * rho * zeta / root, slope * z * (1.0 + zeta2) / (zeta * root)]
}

#[test]
fn fields_in_closed_form_far_near_and_on_the_axis() {
    let far = vec![[60.0, 80.0], [0.0, -100.0], [100.0, 0.0], [1.5, 0.7], [0.0, 2.0], [1e-7, 1.2], [0.3, 1.0]];
    let beside_sphere =
        |d: f64| vec![[(1.0 + d) * 0.6, (1.0 + d) * 0.8], [0.0, 1.0 + d], [1.0 + d, 0.0], [1e-9, -1.0 - d]];
    let beside_disc = |d: f64| vec![[0.3, d], [0.0, -d], [0.95, d], [0.999, -d], [1e-9, d]];
    type Beside = fn(f64) -> Vec<[f64; 2]>;
    let forms: [(Shape, Form, Beside); 2] =
        [(sphere(1.0), of_sphere, beside_sphere), (disc(1.0), of_disc, beside_disc)];
    for (shape, form, beside) in forms {
        let sum = AxialSum::every(&solved(&bodies(&[(shape, 0.0)]), 1e-11), Axis::default());
        // Distance, and what the gradient may miss: near the surface rounding of the point, 1e-16 over the distance.
        let near = [0.3, 0.1, 1e-2, 1e-4, 1e-6, 1e-9];
        let sets = [(1.0, far.clone())].into_iter().chain(near.map(|d| (d, beside(d))));
        for (d, points) in sets {
            for [rho, z] in points {
                let s = sum.sum(&[Vec3::new(0.6 * rho, 0.8 * rho, z)]);
                let [potential, along_rho, along_z] = form(rho, z);
                let wanted = Vec3::new(0.6 * along_rho, 0.8 * along_rho, along_z);
                let missed = (Vec3::new(s[1], s[2], s[3]) - wanted).norm() / wanted.norm();
                assert!((s[0] / potential - 1.0).abs() < 1e-11, "{rho} {z}: {} {potential}", s[0]);
                assert!(missed < 1e-9 + 1e-16 / d, "{rho} {z}: gradient misses by {missed:e}");
            }
        }
    }
}

#[test]
fn on_the_surface_potential_and_gradient_are_right() {
    let sum = AxialSum::every(&solved(&bodies(&[(sphere(1.0), 0.0)]), 1e-10), Axis::default());
    for p in [Vec3::new(0.6, 0.0, 0.8), Vec3::z(), -Vec3::y(), Vec3::new(0.0, 0.96, -0.28)] {
        let s = sum.sum(&[p]);
        // Two steps of 1e-6 lengths beside the surface: the square of that, and rounding over it.
        assert!((s[0] - 1.0).abs() < 1e-10 && (Vec3::new(s[1], s[2], s[3]) + p).norm() < 1e-8, "{p}: {s:?}");
    }
    let sum = AxialSum::every(&solved(&bodies(&[(disc(1.0), 0.0)]), 1e-10), Axis::default());
    for p in [Vec3::new(0.5, 0.0, 0.0), Vec3::zeros(), Vec3::y() * 0.9] {
        let s = sum.sum(&[p]);
        // The mean of both sides of a flat sheet is zero.
        assert!((s[0] - 1.0).abs() < 1e-9 && Vec3::new(s[1], s[2], s[3]).norm() < 1e-8, "{p}: {s:?}");
    }
    let edge = sum.sum(&[Vec3::x()]);
    assert!((edge[0] - 1.0).abs() < 1e-8 && edge.iter().all(|x| x.is_finite()), "{edge:?}");
    // Inside a solid there is no field.
    let bodies = bodies(&[(Shape::Cylinder { radius: 1.0, length: 2.0, caps: true }, 0.0)]);
    let sum = AxialSum::every(&solved(&bodies, 1e-9), Axis::default());
    for p in [Vec3::zeros(), Vec3::new(0.3, 0.5, -0.7), Vec3::new(0.0, 0.95, 0.95)] {
        let s = sum.sum(&[p]);
        assert!((s[0] - 1.0).abs() < 1e-9 && Vec3::new(s[1], s[2], s[3]).norm() < 1e-7, "{p}: {s:?}");
    }
}

#[test]
fn gradients_are_derivatives_and_rules_join() {
    let shapes = [(ring(1.0, 0.05), -1.0), (Shape::Disc { radius: 0.8, hole_radius: 0.1, thickness: 0.1 }, 0.5)];
    let bodies = bodies(&shapes);
    let frame = [Vec3::y(), Vec3::z(), Vec3::x()];
    let axis = Axis { origin: Vec3::new(0.1, -0.2, 0.3), frame };
    for accuracy in [1e-3, 1e-8] {
        let sum = AxialSum::every(&solved(&bodies, accuracy), axis);
        for k in 0..60 {
            let u = |i: usize| (k as f64 * [0.819_172_513_4, 0.671_043_606_7, 0.549_700_477_9][i]).fract() - 0.5;
            let p = Vec3::new(3.0 * u(0), 4.0 * u(1), 4.0 * u(2));
            let h = 1e-4;
            let at = |d: Vec3| sum.sum(&[p + d * h]);
            let here = at(Vec3::zeros());
            for c in 0..2 {
                let numeric =
                    Vec3::from_fn(|i, _| (at(Vec3::ith(i, 1.0))[4 * c] - at(-Vec3::ith(i, 1.0))[4 * c]) / (2.0 * h));
                let gradient = Vec3::new(here[4 * c + 1], here[4 * c + 2], here[4 * c + 3]);
                // h² times a third derivative; 1e-11 from rule to rule over h would be 1e-7.
                assert!((numeric - gradient).norm() < 1e-5 * gradient.norm().max(0.1), "{p}: {gradient} {numeric}");
            }
        }
    }
}

#[test]
fn composite_geometries_have_the_fields_of_the_reference() {
    let centre = |case: &Value| case["inputs"]["centre_z"].as_f64().unwrap();
    let numbers = |v: &Value| -> Vec<f64> { v.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect() };
    let geometries = exact_geometries();
    for case in cases("composite.json") {
        let (_, bodies, _) = geometries.iter().find(|g| g.0 == case["id"].as_str().unwrap()).unwrap();
        let solution = solved(bodies, 1e-9);
        for excitation in case["outputs"]["excitations"].as_array().unwrap() {
            let sum = AxialSum::new(&solution, &[numbers(&excitation["V"]).into()], Axis::default());
            let [phi, e_rho, e_z, a_l] = ["phi", "E_rho", "E_z", "A_l"].map(|key| numbers(&excitation[key]));
            let points: Vec<Vec<f64>> =
                case["inputs"]["points_rho_z"].as_array().unwrap().iter().map(numbers).collect();
            let size = e_rho.iter().zip(&e_z).map(|(a, b)| a.hypot(*b)).fold(0.0, f64::max);
            for (k, p) in points.iter().enumerate() {
                let s = sum.sum(&[Vec3::new(p[0], 0.0, p[1])]);
                // What was asked, 1e-9; the reference has 12 digits.
                assert!((s[0] - phi[k]).abs() < 1e-9, "{} at {p:?}: {} {}", case["id"], s[0], phi[k]);
                assert!((s[1] + e_rho[k]).hypot(s[3] + e_z[k]) < 1e-8 * size, "{} at {p:?}: {s:?}", case["id"]);
            }
            // A2 is half the second derivative along the axis: from the gradient at five points.
            let h = 2e-3;
            let along = |i: f64| sum.sum(&[Vec3::z() * (centre(&case) + i * h)])[3];
            let second = (8.0 * (along(1.0) - along(-1.0)) - along(2.0) + along(-2.0)) / (12.0 * h);
            // h⁴/30 of a fifth derivative, some 1e5 at most, and rounding over h.
            assert!((0.5 * second - a_l[2]).abs() < 1e-7 * (1.0 + a_l[2].abs()), "{}: {second} {}", case["id"], a_l[2]);
        }
    }
}

#[test]
fn sources_induce_what_they_must() {
    // A sphere of radius a, grounded, in a uniform field and beside a point charge on the axis.
    let a = 0.5;
    let bodies = bodies(&[(sphere(a), 0.0)]);
    let uniform = |_: f64, z: f64| -z;
    let d = 0.8;
    let point = move |rho: f64, z: f64| COULOMB / rho.hypot(z - d);
    let sources: [AxialSource; 2] = [&uniform, &point];
    let problem = AxialProblem { bodies: &bodies, electrodes: 1, sources: &sources, ground: None };
    let solution = problem.solve(1e-10).unwrap();
    let sum = AxialSum::every(&solution, Axis::default());
    for p in [Vec3::new(0.0, 0.0, 2.0 * a), Vec3::new(0.7, 0.2, -0.3), Vec3::new(0.0, a + 1e-6, 0.0)] {
        let s = sum.sum(&[p]);
        // φ = E z a³/r³, and the image charge -a/d at a²/d.
        let dipole = p.z * (a / p.norm()).powi(3);
        assert!((s[4] - dipole).abs() < 1e-10, "{} {dipole}", s[4]);
        let image = -a / d * COULOMB / (p - Vec3::z() * (a * a / d)).norm();
        assert!((s[8] / image - 1.0).abs() < 1e-9, "{} {image}", s[8]);
    }
    assert!(solution.data.induced[0][0].abs() * COULOMB < 1e-11);
    assert!((solution.data.induced[0][1] + a / d).abs() < 1e-9);
    // σ = 3 ε0 E cosθ, with the sign of the field that makes the potential -z.
    for t in [0.0, 0.3, 0.77] {
        let sigma = 3.0 * crate::constants::EPSILON_0 * (t * FRAC_PI_2).cos();
        assert!((solution.density(1, 0, 0, t).unwrap() / sigma - 1.0).abs() < 1e-8);
    }
    // On the whole as on an isolated sphere: σ = ε0 V / a.
    assert!((solution.density(0, 0, 1, 0.4).unwrap() / (crate::constants::EPSILON_0 / a) - 1.0).abs() < 1e-9);
    assert!(solution.density(3, 0, 0, 0.4).is_none() && solution.density(0, 0, 2, 0.4).is_none());
}

#[test]
fn a_grounded_plane_is_the_mirror_of_the_other_sign() {
    let height = -0.35;
    let shapes = [(Shape::EndCap { radius: 0.5, opening: 0.9, thickness: 0.0 }, 0.0), (ring(0.6, 0.05), 0.2)];
    let above = bodies(&shapes);
    let mut both = above.clone();
    both.extend(above.iter().map(|b| AxialBody {
        electrode: b.electrode + 2,
        height: 2.0 * height - b.height,
        flipped: true,
        ..b.clone()
    }));
    let grounded = AxialProblem { bodies: &above, electrodes: 2, sources: &[], ground: Some(height) };
    let grounded = grounded.solve(1e-9).unwrap();
    let mirrored = solved(&both, 1e-9);
    let c = &mirrored.capacitance.matrix;
    for (i, row) in grounded.capacitance.matrix.iter().enumerate() {
        for (k, got) in row.iter().enumerate() {
            let wanted = c[i][k] - c[i][k + 2];
            assert!((got - wanted).abs() * COULOMB < 1e-10, "{i} {k}: {got} {wanted}");
        }
    }
    let sign = |i: usize, k: usize| f64::from(u8::from(i == k)) - f64::from(u8::from(i == k + 2));
    let weights = |k: usize| -> Arc<[f64]> { (0..4).map(|i| sign(i, k)).collect() };
    let pair = AxialSum::new(&mirrored, &[weights(0), weights(1)], Axis::default());
    let plane = AxialSum::every(&grounded, Axis::default());
    for p in [Vec3::new(0.1, 0.2, 0.0), Vec3::new(0.3, -0.3, -0.3), Vec3::new(0.0, 0.0, 1.0), Vec3::new(0.5, 0.0, 0.2)]
    {
        for (a, b) in plane.sum(&[p]).iter().zip(pair.sum(&[p])) {
            assert!((a - b).abs() < 1e-7, "{p}: {a} {b}");
        }
    }
    let on_plane = plane.sum(&[Vec3::new(0.2, 0.1, height)]);
    assert!(on_plane[0].abs() < 1e-14 && on_plane[1].abs() < 1e-14 && on_plane[3].abs() > 0.1);
}

#[test]
fn the_same_bits_with_any_number_of_threads() {
    let bodies = bodies(&[(ring(1.0, 0.1), 0.0), (disc(0.8), -0.7), (sphere(0.2), 0.3)]);
    let points: Vec<Vec3> = (0..50).map(|k| Vec3::new(0.03 * f64::from(k), 0.1, 0.02 * f64::from(k) - 0.4)).collect();
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let solution = solved(&bodies, 1e-8);
            let sums = AxialSum::every(&solution, Axis::default()).sum(&points);
            (solution.data, sums)
        })
    };
    let one = run(1);
    assert!(one == run(2) && one == run(3));
}

#[test]
fn a_kept_solution_is_the_solution() {
    let bodies = bodies(&[(ring(1.0, 0.1), 0.0), (disc(0.8), -0.7)]);
    let (solution, judge) = problem(&bodies).solve_with_judge(1e-5).unwrap();
    let kept = serde_json::to_string(&solution.data).unwrap();
    let restored = AxialSolution::restored(&bodies, serde_json::from_str(&kept).unwrap()).unwrap();
    assert_eq!(restored.data.elements, solution.data.elements);
    // JSON may round the last bit.
    let close = |(a, b): (&f64, &f64)| (a - b).abs() <= 1e-15 * b.abs();
    assert!(restored.data.charges.iter().zip(&solution.data.charges).all(close));
    let points = [Vec3::new(0.3, 0.2, 0.1), Vec3::new(0.0, 0.5, -0.69)];
    assert!(restored.difference_at(&solution, &points).iter().all(|d| d.potential < 1e-14 && d.gradient < 1e-13));
    // The field's error is of the size of that on the surface.
    let differences = solution.difference_at(&judge, &points);
    assert!(
        differences.iter().all(|d| d.potential > 0.0 && d.potential < 1e-5 && d.gradient < 1e-3),
        "{differences:?}"
    );
    let mut broken = solution.data.clone();
    broken.charges.pop();
    assert_eq!(AxialSolution::restored(&bodies, broken).unwrap_err(), AxialError::Data);
    assert_eq!(AxialSolution::restored(&bodies[..1], solution.data).unwrap_err(), AxialError::Data);
}

#[test]
fn a_flipped_body_is_its_mirror_image() {
    let cap = |height: f64, flipped: bool| AxialBody {
        flipped,
        ..body(&Shape::EndCap { radius: 1.0, opening: 1.0, thickness: 0.05 }, 0, height)
    };
    let (up, down) = (solved(&[cap(0.3, false)], 1e-8), solved(&[cap(0.3, true)], 1e-8));
    assert!((up.capacitance.matrix[0][0] / down.capacitance.matrix[0][0] - 1.0).abs() < 1e-13);
    let [a, b] = [&up, &down].map(|s| AxialSum::every(s, Axis::default()));
    // On the outer pole, where the field is that outside, and away.
    for (x, z) in [(0.0, 1.05), (0.5, 0.2), (0.2, -0.5)] {
        let (p, q) = (a.sum(&[Vec3::new(x, 0.0, 0.3 + z)]), b.sum(&[Vec3::new(x, 0.0, 0.3 - z)]));
        let same = [p[0] - q[0], p[1] - q[1], p[3] + q[3]];
        assert!(same.iter().all(|d| d.abs() < 1e-9), "{p:?} {q:?}");
        assert!(p[3].abs() > 0.1);
    }
}

#[test]
fn what_cannot_be_solved_is_said() {
    let one = bodies(&[(sphere(1.0), 0.0)]);
    let tell = |bodies: &[AxialBody], electrodes: usize, sources: &[AxialSource], ground: Option<f64>| {
        AxialProblem { bodies, electrodes, sources, ground }.solve(1e-6).unwrap_err()
    };
    assert_eq!(tell(&[], 0, &[], None), AxialError::NoBody);
    assert_eq!(tell(&one, 0, &[], None), AxialError::NoSuchElectrode { body: 0, electrode: 0, electrodes: 0 });
    assert_eq!(tell(&one, 2, &[], None), AxialError::NoBodyOf { electrode: 1 });
    assert_eq!(tell(&one, 1, &[], Some(0.3)), AxialError::AcrossGround { body: 0 });
    assert_eq!(
        tell(&one, 1, &[&|_: f64, _: f64| f64::INFINITY], None),
        AxialError::SourceOnBody { source_number: 1, body: 0 }
    );
    let point = turned(&[[1.0, 0.0], [1.0, 0.0]], false);
    assert_eq!(tell(&[point], 1, &[], None), AxialError::Degenerate { body: 0, piece: 0 });
    let beyond = turned(&[[1.0, 0.0], [-1.0, 0.0]], false);
    assert_eq!(tell(&[beyond], 1, &[], None), AxialError::Degenerate { body: 0, piece: 0 });
    // A sphere twice, and spheres that cut each other.
    let twice = bodies(&[(sphere(1.0), 0.0), (sphere(1.0), 0.0)]);
    let crossed = bodies(&[(sphere(1.0), 0.0), (sphere(1.0), 1.0)]);
    for bodies in [twice, crossed] {
        let error = tell(&bodies, 2, &[], None);
        println!("{error}");
        assert!(matches!(error, AxialError::Accuracy { .. } | AxialError::Singular), "{error}");
    }
}
