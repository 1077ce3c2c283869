use meshes::{Shape, patches};

use super::*;
use crate::constants::COULOMB;

fn solved(shape: &Shape, accuracy: f64) -> Refined {
    let patches = patches(shape).unwrap();
    let electrode = vec![0; patches.len()];
    let names = ["a".to_owned()];
    let problem = CurvedProblem { names: &names, sources: &[], ground: None, symmetric: true, max_bytes: u64::MAX, by: CurvedBy::Size };
    let difference = |fine: &CurvedSolution, coarse: &CurvedSolution| {
        let capacitance = (coarse.totals[0][0] / fine.totals[0][0] - 1.0).abs();
        crate::Errors { capacitance, field: 0.0 }
    };
    let begins = |mesh: &CurvedMesh| eprint!(" {}^{}", mesh.elements.len(), mesh.order);
    solve_to(&problem, &patches, &electrode, accuracy, 60_000, &difference, &begins, &|_| ()).unwrap()
}

/// Values of both ways to solve on one mesh.
fn both(
    shapes: &[(Shape, meshes::Placement)],
    cuts: usize,
    order: usize,
    accuracy: f64,
    symmetric: bool,
    ground: Option<crate::Plane>,
) -> [CurvedSolution; 2] {
    let mut mesh =
        CurvedMesh { patches: Vec::new(), electrode: Vec::new(), electrodes: shapes.len(), elements: Vec::new(), order };
    for (e, (shape, placement)) in shapes.iter().enumerate() {
        for patch in patches(shape).unwrap() {
            let whole = Element { patch: mesh.patches.len() as u32, low: [0.0; 2], high: [1.0; 2] };
            let mut parts = vec![whole];
            for _ in 0..cuts {
                parts = parts.iter().flat_map(|p| p.halves(0)).flat_map(|p| p.halves(1)).collect();
            }
            mesh.elements.extend(parts);
            mesh.patches.push(patch.placed(placement).unwrap());
            mesh.electrode.push(e as u32);
        }
    }
    let names: Vec<String> = shapes.iter().map(|_| "a".to_owned()).collect();
    [CurvedBy::Matrix, CurvedBy::Multipoles].map(|by| {
        let problem = CurvedProblem { names: &names, sources: &[], ground, symmetric, max_bytes: u64::MAX, by };
        problem.solve(&mesh, accuracy, &|_| ()).unwrap()
    })
}

/// Largest differences of charges of electrodes and of values at points, against the largest of each.
fn apart([a, b]: &[CurvedSolution; 2]) -> (f64, f64) {
    let of = |x: &[f64], y: &[f64]| {
        let largest = x.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        x.iter().zip(y).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max) / largest
    };
    (of(&a.totals.concat(), &b.totals.concat()), of(&a.charge.values, &b.charge.values))
}

fn square_holes(holes: f64) -> Shape {
    use meshes::{GridPattern, Hole, Outline};
    Shape::GridPlate {
        outline: Outline::Rectangle([holes + 0.3; 2]),
        pitch: 1.0,
        pattern: GridPattern::Perforated { hole: Hole::Square, open: 0.7, thickness: 0.0 },
    }
}

#[test]
fn multipoles_solve_as_the_matrix_does() {
    use meshes::{Placement, Vec3};
    let ground = crate::Plane { point: Vec3::new(0.0, 0.0, -0.6), normal: Vec3::z() };
    let tilted = Placement { center: Vec3::new(0.2, 0.1, 1.4), axis: Vec3::new(0.3, -0.2, 1.0), up: None };
    let plate = vec![(square_holes(3.0), Placement::default())];
    let two = vec![
        (Shape::Disc { radius: 1.0, hole_radius: 0.3, thickness: 0.0 }, Placement::default()),
        (Shape::Plate { size: [1.0, 2.0], thickness: 0.2 }, tilted),
    ];
    for (shapes, cuts, order) in [(&plate, 1, 3), (&two, 2, 4)] {
        for (accuracy, ground, symmetric) in
            [(1e-4, None, true), (1e-5, Some(ground), true), (1e-5, Some(ground), false), (1e-8, None, true)]
        {
            let solved = both(shapes, cuts, order, accuracy, symmetric, ground);
            let (totals, values) = apart(&solved);
            println!(
                "{} unknowns, symmetry {}, {accuracy:e}: {totals:.1e} {values:.1e}, {} iterations, residual {:.1e}",
                solved[1].unknowns, solved[1].symmetry, solved[1].iterations, solved[1].residual
            );
            assert!(solved[0].iterations == 0 && solved[1].iterations > 0);
            // Totals see the residual averaged; single points see it over the size of an element.
            assert!(totals < 2.0 * accuracy && values < 100.0 * accuracy, "{totals:.1e} {values:.1e}");
        }
    }
}

#[test]
fn the_number_of_threads_does_not_matter() {
    let plate = vec![(square_holes(3.0), meshes::Placement::default())];
    let values = [1, 2, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let [_, solved] = pool.install(|| both(&plate, 1, 3, 1e-5, true, None));
        solved.charge.values.iter().map(|v| v.to_bits()).collect::<Vec<u64>>()
    });
    assert!(values[0] == values[1] && values[1] == values[2]);
}

#[test]
fn explore() {
    use std::f64::consts::PI;
    let cases = [
        ("sphere", Shape::Sphere { radius: 1.0 }, 1.0),
        ("disc", Shape::Disc { radius: 1.0, hole_radius: 0.0, thickness: 0.0 }, 2.0 / PI),
        ("bowl", Shape::EndCap { radius: 1.0, opening: PI / 2.0, thickness: 0.0 }, (PI / 2.0 + 1.0) / PI),
        ("plate", Shape::Plate { size: [1.0, 1.0], thickness: 0.0 }, 0.366788004),
        ("cube", Shape::Box { size: [1.0; 3] }, 0.66067815409957),
    ];
    use meshes::{GridPattern, Hole, Outline};
    let grid = |n: f64, hole, open| Shape::GridPlate {
        outline: Outline::Rectangle([n, n]),
        pitch: 1.0,
        pattern: GridPattern::Perforated { hole, open, thickness: 0.0 },
    };
    let more = [
        ("torus", Shape::Ring { radius: 1.0, wire_radius: 0.05 }, 1.0),
        ("annulus", Shape::Disc { radius: 1.0, hole_radius: 0.5, thickness: 0.0 }, 1.0),
        ("thick", Shape::Disc { radius: 1.0, hole_radius: 0.0, thickness: 0.05 }, 1.0),
        ("cylinder", Shape::Cylinder { radius: 1.0, length: 2.0, caps: true }, 1.0),
        ("grid 3", grid(3.3, Hole::Square, 0.7), 1.0),
        ("grid 10", grid(10.3, Hole::Square, 0.7), 1.0),
        ("round 10", grid(10.3, Hole::Round, 0.6), 1.0),
    ];
    for (name, shape, exact) in cases.into_iter().chain(more) {
        for accuracy in [1e-3, 1e-4, 1e-5, 1e-6] {
            if name.ends_with("10") && accuracy < 5e-6 {
                continue;
            }
            let start = std::time::Instant::now();
            let r = solved(&shape, accuracy);
            let c = r.solution.totals[0][0] * COULOMB;
            println!(
                "{name} asked {accuracy:.0e} error {:.9} estimate {:.2e} unknowns {} symmetry {} judge {} {:.3} s (fill {:.3} solve {:.3})",
                if exact == 1.0 { c } else { c / exact - 1.0 },
                r.errors.capacitance,
                r.solution.unknowns,
                r.solution.symmetry,
                r.judged_by,
                start.elapsed().as_secs_f64(),
                r.solution.assembly_seconds,
                r.solution.solve_seconds
            );
        }
    }
}
