//! Exact values, errors told against errors made, fields in closed form.

use std::f64::consts::{FRAC_PI_2, PI};

use meshes::profile::revolved;
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

fn solved(bodies: &[AxialBody], accuracy: f64) -> AxialSolution {
    let electrodes = 1 + bodies.iter().map(|b| b.electrode).max().unwrap();
    AxialProblem { bodies, electrodes, sources: &[], ground: None }.solve(accuracy).unwrap()
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

#[test]
fn errors_told_are_errors_made() {
    for (id, bodies, exact) in exact_geometries() {
        for accuracy in [1e-2, 1e-3, 1e-5, 1e-7, 1e-9, 1e-11] {
            let start = std::time::Instant::now();
            let electrodes = exact.len();
            let solution = AxialProblem { bodies: &bodies, electrodes, sources: &[], ground: None }.solve(accuracy);
            let solution = match solution { Ok(s) => s, Err(e) => { println!("{id} {accuracy}: {e}"); continue; } };
            let seconds = start.elapsed().as_secs_f64();
            let (made, told) = (error(&solution, &exact), solution.data.capacitance_error);
            println!("{id:32} {accuracy:.0e}: made {made:.1e} told {told:.1e} ratio {:.2} misfit {:.1e} asym {:.1e} {} unknowns {:.1} ms",
                told / made, solution.data.misfit, solution.data.asymmetry, solution.unknowns(), 1e3 * seconds);
        }
    }
}

#[test]
fn shapes_with_corners() {
    let shapes = [
        ("annulus", Shape::Disc { radius: 1.0, hole_radius: 0.4, thickness: 0.0 }),
        ("narrow annulus", Shape::Disc { radius: 1.0, hole_radius: 0.01, thickness: 0.0 }),
        ("thick disc", Shape::Disc { radius: 1.0, hole_radius: 0.0, thickness: 0.2 }),
        ("thin thick disc", Shape::Disc { radius: 1.0, hole_radius: 0.0, thickness: 0.01 }),
        ("thick annulus", Shape::Disc { radius: 1.0, hole_radius: 0.4, thickness: 0.2 }),
        ("closed cylinder", Shape::Cylinder { radius: 1.0, length: 2.0, caps: true }),
        ("open cylinder", Shape::Cylinder { radius: 1.0, length: 2.0, caps: false }),
        ("needle", Shape::Cylinder { radius: 0.01, length: 2.0, caps: true }),
        ("rod", Shape::Rod { radius: 0.1, length: 2.0 }),
        ("thick cap", Shape::EndCap { radius: 1.0, opening: 1.2, thickness: 0.05 }),
        ("thick bowl", Shape::EndCap { radius: 1.0, opening: 2.5, thickness: 0.1 }),
        ("hyperbolic ring", Shape::HyperbolicRing { r0: 1.0, z0: 0.7, extent: 2.0 }),
        ("hyperbolic cap", Shape::HyperbolicCap { r0: 1.0, z0: 0.7, extent: 2.0 }),
        ("thin torus", ring(1.0, 1e-4)),
    ];
    for (name, shape) in shapes {
        let bodies = bodies(&[(shape, 0.0)]);
        let problem = AxialProblem { bodies: &bodies, electrodes: 1, sources: &[], ground: None };
        let (best, judge) = match problem.solve_with_judge(3e-11) { Ok(s) => s, Err(e) => { println!("{name}: {e}"); continue; } };
        let exact = judge.capacitance.matrix.clone();
        println!("{name}: {:.15} +- {:.1e} misfit {:.1e} {}", exact[0][0] * COULOMB, best.data.capacitance_error, best.data.misfit, best.unknowns());
        for accuracy in [1e-2, 1e-3, 1e-5, 1e-7, 1e-9] {
            let start = std::time::Instant::now();
            let solution = solved(&bodies, accuracy);
            let seconds = start.elapsed().as_secs_f64();
            let (made, told) = ((solution.capacitance.matrix[0][0] / exact[0][0] - 1.0).abs(), solution.data.capacitance_error);
            println!("   {accuracy:.0e}: made {made:.1e} told {told:.1e} ratio {:.2} misfit {:.1e} {} unknowns {:.1} ms",
                told / made, solution.data.misfit, solution.unknowns(), 1e3 * seconds);
        }
    }
}

/// A field in closed form: potential and its derivatives along ρ and z.
type Form = fn(f64, f64) -> [f64; 3];

fn of_sphere(rho: f64, z: f64) -> [f64; 3] {
    let r = rho.hypot(z);
    [1.0 / r, -rho / r.powi(3), -z / r.powi(3)]
}

/// Disc of radius one at 1 V: φ = (2/π) arcsin(2/(l₁ + l₂)), l = √((ρ ± 1)² + z²); Jackson, problem 3.4 in another form.
/// Near the disc by arccos: cos = √((1 - λ²)...) as in oblate coordinates, ζ = sinh μ: φ = (2/π) arccot ζ.
fn of_disc(rho: f64, z: f64) -> [f64; 3] {
    // ζ² = (s + √(s² + 4z²))/2, s = ρ² + z² - 1; for s < 0 by the other root, without cancellation.
    let s = rho * rho + z * z - 1.0;
    let root = s.hypot(2.0 * z);
    let zeta2 = if s > 0.0 { 0.5 * (s + root) } else { 2.0 * z * z / (root - s) };
    let zeta = zeta2.sqrt();
    // ρ²/(1 + ζ²) + z²/ζ² = 1: ∂ζ/∂x from it. |∇ζ|: dζ/dz = z(1 + ζ²)/(ζ root), dζ/dρ = ρ ζ/root/... with root = ζ² + ξ².
    let (by_rho, by_z) = (rho * zeta / root, z * (1.0 + zeta2) / (zeta * root));
    let slope = -2.0 / PI / (1.0 + zeta2);
    [2.0 / PI * (1.0_f64).atan2(zeta), slope * by_rho, slope * by_z]
}

#[test]
fn fields_in_closed_form_far_near_and_on_the_axis() {
    let forms: [(Shape, Form); 2] = [(sphere(1.0), of_sphere), (disc(1.0), of_disc)];
    for (shape, form) in forms {
        let solution = solved(&bodies(&[(shape.clone(), 0.0)]), 1e-10);
        let sum = AxialSum::every(&solution, Axis::default());
        let near = |d: f64| match shape {
            Shape::Sphere { .. } => vec![[(1.0 + d) * 0.6, (1.0 + d) * 0.8], [0.0, 1.0 + d], [1.0 + d, 0.0], [1e-9, -1.0 - d]],
            _ => vec![[0.3, d], [0.0, -d], [0.95, d], [0.999, -d], [1e-9, d]],
        };
        let mut sets = vec![(100.0, vec![[60.0, 80.0], [0.0, -100.0], [100.0, 0.0]]), (1.0, vec![[1.5, 0.7], [0.0, 2.0], [1e-7, 1.2], [0.3, 1.0]])];
        for d in [0.3, 0.1, 1e-2, 1e-3, 1e-4, 1e-6, 1e-8, 1e-9] {
            sets.push((d, near(d)));
        }
        for (d, points) in sets {
            let mut worst = [0.0_f64; 2];
            for [rho, z] in points {
                let s = sum.sum(&[Vec3::new(0.6 * rho, 0.8 * rho, z)]);
                let [potential, along_rho, along_z] = form(rho, z);
                let wanted = Vec3::new(0.6 * along_rho, 0.8 * along_rho, along_z);
                worst[0] = worst[0].max((s[0] / potential - 1.0).abs());
                worst[1] = worst[1].max((Vec3::new(s[1], s[2], s[3]) - wanted).norm() / wanted.norm());
            }
            println!("{d:.0e} {worst:?}");
        }
        let on: Vec<Vec3> = match shape { Shape::Sphere{..} => vec![Vec3::new(0.6, 0.0, 0.8), Vec3::new(0.0, 0.0, 1.0), Vec3::new(1.0, 0.0, 0.0)], _ => vec![Vec3::new(0.5, 0.0, 0.0), Vec3::zeros(), Vec3::new(1.0,0.0,0.0), Vec3::new(0.999, 0.0, 0.0)] };
        for p in on { println!("{p:?} {:?}", sum.sum(&[p])); }
    }
}

#[test]
fn speed() {
    let bodies = bodies(&[(ring(1.0, 0.05), -1.0), (ring(1.0, 0.05), 1.0)]);
    for accuracy in [1e-4, 1e-6, 1e-9] {
        let solution = solved(&bodies, accuracy);
        let sum = AxialSum::new(&solution, &[std::sync::Arc::from([1.0, 1.0].as_slice())], Axis::default());
        let step = [0.819_172_513_396_164_4, 0.671_043_606_703_789_2, 0.549_700_477_901_970_6];
        for half in [0.5, 1.5] {
        let points: Vec<Vec3> = (0..20000).map(|k| Vec3::from_fn(|i, _| 2.0 * half * ((k as f64 * step[i]).fract() - 0.5))).collect();
        let start = std::time::Instant::now();
        let sums = sum.sum(&points);
        let seconds = start.elapsed().as_secs_f64();
        println!("{accuracy:.0e} box {half}: {} rings, {:.0} ns a point, {:.2} ns a ring, {}", sum.rings(), seconds * 1e9 / 20000.0, seconds * 1e9 / 20000.0 / sum.rings() as f64, sums[0]);
        }
    }
}
