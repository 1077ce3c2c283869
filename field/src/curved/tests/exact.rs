use std::f64::consts::PI;

use meshes::profile::revolved;

use super::*;
use crate::SourceKind;
use crate::axial::{AxialBody, AxialProblem};
use crate::constants::COULOMB;

/// The error made is at most what was asked, and at most five times what was told (or rounding).
fn holds(name: &str, asked: f64, made: f64, refined: &Refined) {
    let told = refined.errors.capacitance;
    assert!(told <= asked, "{name} asked {asked:.0e}: told {told:.1e}, not reached");
    assert!(made <= asked, "{name} asked {asked:.0e}: made {made:.1e}");
    assert!(made <= 5.0 * told + 1e-12, "{name} asked {asked:.0e}: made {made:.1e}, told only {told:.1e}");
}

#[test]
fn capacitances_of_single_electrodes_are_exact() {
    let cases = [
        ("sphere", sphere(1.0), 1.0),
        ("disc", Shape::Disc { radius: 1.0, hole_radius: 0.0, thickness: 0.0 }, 2.0 / PI),
        // Kelvin: a bowl of half angle a has (a + sin a)/π.
        ("bowl", Shape::EndCap { radius: 1.0, opening: PI / 2.0, thickness: 0.0 }, (PI / 2.0 + 1.0) / PI),
        // Both known to the digits given (Read 1997; Hwang and Mascagni 2004, refined since).
        ("plate", plate(1.0, 1.0), 0.366788004),
        ("cube", cube(), 0.66067815409957),
    ];
    for (name, shape, exact) in cases {
        for asked in [1e-3, 1e-4, 1e-5] {
            let refined = Setup::one(shape.clone()).solved(asked);
            let made = (refined.solution.totals[0][0] * COULOMB / exact - 1.0).abs();
            holds(name, asked, made, &refined);
        }
    }
}

#[test]
fn bodies_on_one_axis_agree_with_their_generating_curves() {
    let tube = |caps| Shape::Cylinder { radius: 0.4, length: 1.5, caps };
    let disc = |hole_radius, thickness| Shape::Disc { radius: 1.0, hole_radius, thickness };
    let cases = [
        ("torus", vec![(ring(1.0, 0.1), 0.0)]),
        ("annulus", vec![(disc(0.5, 0.0), 0.0)]),
        ("thick disc", vec![(disc(0.0, 0.05), 0.0)]),
        ("thin disc", vec![(disc(0.0, 1e-3), 0.0)]),
        ("tube and ball", vec![(tube(false), 0.0), (sphere(0.2), 0.1)]),
        ("can", vec![(tube(true), 0.0)]),
        ("thin rod", vec![(Shape::Rod { radius: 1e-3, length: 1.0 }, 0.0)]),
        ("thick bowl", vec![(Shape::EndCap { radius: 1.0, opening: 1.2, thickness: 0.1 }, 0.0)]),
        ("rings", vec![(ring(1.0, 0.1), 0.0), (ring(0.7, 0.05), 0.6)]),
        ("spheres", vec![(sphere(1.0), 0.0), (sphere(0.1), 1.3)]),
    ];
    for (name, parts) in cases {
        let body = |(electrode, (shape, height)): (usize, &(Shape, f64))| AxialBody {
            profile: revolved(shape).unwrap().swap_remove(0).profile,
            electrode,
            height: *height,
            flipped: false,
        };
        let bodies: Vec<AxialBody> = parts.iter().enumerate().map(body).collect();
        let problem = AxialProblem { bodies: &bodies, electrodes: parts.len(), sources: &[], ground: None };
        let exact = problem.solve(1e-7).unwrap().capacitance.matrix;
        // About an axis that is none of the coordinates'.
        let axis = Vec3::new(0.3, -0.5, 0.8).normalize();
        let along = |height: f64| -> [f64; 3] { (axis * height).into() };
        let setup = parts.iter().fold(Setup::default(), |s, (shape, h)| s.and(shape.clone(), along(*h), axis.into()));
        let refined = setup.solved(1e-4);
        holds(name, 1e-4, apart_by(&exact, &refined.solution.totals), &refined);
    }
}

#[test]
fn a_gap_far_narrower_than_patches_is_seen() {
    // Equal spheres, with cosh b = distance / 2 radii: c11 = sinh b Σ 1/sinh (2n - 1) b, c12 = -sinh b Σ 1/sinh 2n b
    // (Smythe 1968, 5.08).
    // The narrowest on a coordinate axis: without symmetry it takes ten times as long.
    let oblique = Vec3::new(1.0, 2.0, 2.0) / 3.0;
    for (gap, axis) in [(1e-1, oblique), (1e-2, oblique), (1e-3_f64, Vec3::z())] {
        let b = (1.0 + 0.5 * gap).acosh();
        let sum = |first: u32| (0..4000).map(|n| 1.0 / (f64::from(first + 2 * n) * b).sinh()).sum::<f64>() * b.sinh();
        let (own, other) = (sum(1) / COULOMB, -sum(2) / COULOMB);
        let setup = Setup::one(sphere(1.0)).and(sphere(1.0), (axis * (2.0 + gap)).into(), Z);
        let refined = setup.solved(1e-2);
        let exact = [vec![own, other], vec![other, own]];
        holds(&format!("gap {gap}"), 1e-2, apart_by(&exact, &refined.solution.totals), &refined);
    }
}

#[test]
fn errors_told_hold_for_electrodes_beside_and_across_each_other() {
    let cases = [
        ("crossed rings", Setup::one(ring(1.0, 0.1)).and(ring(0.7, 0.05), [0.0; 3], [1.0, 0.0, 0.0])),
        ("ring and plate", Setup::one(ring(1.0, 0.1)).and(plate(2.0, 1.0), [0.2, 0.1, -0.5], Z)),
        ("tilted plates", Setup::one(plate(1.0, 1.0)).and(plate(1.0, 0.5), [0.1, 0.0, 0.5], [0.2, 0.3, 1.0])),
        ("square holes", Setup::one(perforated(2.2, Hole::Square, 0.0))),
        ("round holes", Setup::one(perforated(2.2, Hole::Round, 0.0))),
        ("thick, square holes", Setup::one(perforated(2.2, Hole::Square, 0.1))),
        ("thick, round holes", Setup::one(perforated(2.2, Hole::Round, 0.1))),
    ];
    for (name, setup) in cases {
        // Ten times better is as good as exact against a factor of five.
        let truth = setup.solved(3e-5).solution.totals;
        let refined = setup.solved(3e-4);
        holds(name, 3e-4, apart_by(&truth, &refined.solution.totals), &refined);
    }
}

#[test]
fn a_grounded_plane_is_the_mirrored_electrode_at_the_opposite_voltage() {
    let (center, mirrored) = ([0.1, 0.2, 0.5], [0.1, 0.2, -0.5]);
    let disc = Shape::Disc { radius: 0.4, hole_radius: 0.1, thickness: 0.1 };
    let ground = Some(Plane { point: Vec3::zeros(), normal: Vec3::z() });
    let above = Setup { ground, ..Setup::default() }.and(disc.clone(), center, Z);
    let pair = Setup::default().and(disc.clone(), center, Z).and(disc, mirrored, Z);
    let solution = above.solved_on(&above.mesh(4, 0), 1e-8);
    let both = pair.solved_on(&pair.mesh(4, 0), 1e-8);
    let expected = both.totals[0][0] - both.totals[0][1];
    // Elements at the plane are near on one side only: to the accuracy of integrals.
    let apart = (solution.totals[0][0] / expected - 1.0).abs();
    assert!(apart < 1e-7, "{apart:.1e}");
}

fn source(kind: SourceKind, center: Vec3) -> Source {
    Source { kind, center, frame: [Vec3::x(), Vec3::y(), Vec3::z()] }
}

#[test]
fn a_sphere_and_a_cube_in_a_uniform_field_have_their_dipoles() {
    // Polarisability over volume: 3 of a sphere, 3.644305190268 of a cube (Helsing and Perfekt 2013).
    let volume = 4.0 * PI / 3.0;
    for (shape, exact, cuts) in [(sphere(1.0), 3.0 * volume, 0), (cube(), 3.644305190268, 1)] {
        let setup = Setup { sources: vec![source(SourceKind::Uniform, Vec3::zeros())], ..Setup::one(shape) };
        let solution = setup.solved_on(&setup.mesh(6, cuts), 1e-7);
        // Far away only the dipole is left, but for the next odd order, (size/distance)²: one in 1e6.
        let (r, n) = (1e3, solution.charge.functions);
        let far = solution.sample(&[Vec3::z() * r]);
        let dipole = far.potential[n - 1] * 4.0 * PI * r * r;
        assert!((dipole / exact - 1.0).abs() < 1e-4, "{dipole} {exact}");
        assert!(solution.totals[0][1].abs() < 1e-9 * solution.totals[0][0], "no charge in all");
    }
}

#[test]
fn a_point_charge_induces_what_reciprocity_demands() {
    // Green: the charge that a point charge at x induces on a grounded conductor is -φ(x), the conductor's unit potential.
    let at = Vec3::new(0.13, 0.07, 0.02);
    let setup = Setup { sources: vec![source(SourceKind::Point, at)], ..Setup::one(plate(1.0, 1.0)) };
    let refined = setup.solved(1e-3);
    let induced = refined.solution.totals[0][1];
    let potential = refined.solution.sample(&[at]).potential[0];
    assert!((induced + potential).abs() < 2e-3, "{induced} {potential}: both to 1e-3");
}

#[test]
fn potentials_inside_a_closed_electrode_are_one_and_fields_outside_right() {
    let setup = Setup::one(sphere(1.0));
    let solution = setup.solved_on(&setup.mesh(6, 1), 1e-8);
    let samples =
        solution.sample(&[Vec3::zeros(), Vec3::new(0.3, 0.5, -0.4), Vec3::new(0.0, 0.999, 0.0), Vec3::x() * 1.001]);
    for k in 0..3 {
        // A charge of degree 5 on elements of 0.8: 1e-7, more where its derivatives count.
        assert!((samples.potential[k] - 1.0).abs() < 1e-6, "{}", samples.potential[k]);
        assert!(samples.gradient[k].norm() < 1e-4, "{}", samples.gradient[k]);
    }
    assert!((samples.potential[3] - 1.0 / 1.001).abs() < 1e-6);
    assert!((samples.gradient[3] + Vec3::x() / 1.001_f64.powi(2)).norm() < 1e-4);
}

#[test]
fn densities_are_those_of_a_sphere_and_a_disc() {
    let per_volt = 1.0 / (4.0 * PI * COULOMB);
    let setup = Setup::one(sphere(2.0));
    let charge = setup.solved_on(&setup.mesh(6, 1), 1e-8).charge;
    for direction in [Vec3::new(1.0, 2.0, 3.0), Vec3::new(-0.1, 0.2, -1.0)] {
        let density = charge.densities(&[(direction.normalize() * 1.98, 0)])[0];
        assert!((density * 2.0 / per_volt - 1.0).abs() < 1e-5, "density {density}: of degree 5");
    }
    let setup = Setup::one(Shape::Disc { radius: 1.0, hole_radius: 0.0, thickness: 0.0 });
    let charge = setup.solved_on(&setup.mesh(6, 1), 1e-8).charge;
    for r in [0.0, 0.3, 0.8, 0.99] {
        // Both sides together: 4 ε0 / (π √(1 - r²)).
        let exact = 4.0 * per_volt / (PI * (1.0_f64 - r * r).sqrt());
        let density = charge.densities(&[(Vec3::new(0.6 * r, 0.8 * r, 0.0), 0)])[0];
        // In the middle charge and area vanish together: 1e-3.
        let tolerance = if r == 0.0 { 1e-3 } else { 1e-4 };
        assert!((density / exact - 1.0).abs() < tolerance, "r {r}: {density} {exact}");
    }
}
