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
    solve_to(&problem, &patches, &electrode, accuracy, 8000, &difference, &begins, &|_| ()).unwrap()
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
