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
