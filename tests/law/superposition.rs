//! Superposition: solutions add, whichever way they are found.

use std::f64::consts::TAU;

use field::{BasisField, BoundaryProblem, Samples, Source, SourceKind, TableOptions, TabulatedField, tabulate};
use graintrap_tests::{clear_points, random, ring_disc_sphere};
use meshes::{SurfaceMesh, Vec3};

/// Largest difference of the channels of two fields of as many channels: potential, and field over the strongest field.
fn apart(one: &dyn BasisField, other: &dyn BasisField, points: &[Vec3]) -> (f64, f64) {
    let (mut a, mut b) = (Samples::default(), Samples::default());
    one.sample(points, &mut a);
    other.sample(points, &mut b);
    let strongest = a.gradient.iter().map(|g| g.norm()).fold(0.0, f64::max);
    let potential = a.potential.iter().zip(&b.potential).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
    let field = a.gradient.iter().zip(&b.gradient).map(|(x, y)| (x - y).norm()).fold(0.0, f64::max);
    (potential, field / strongest)
}

#[test]
fn law_joined_electrodes_are_the_sum_of_their_solutions() {
    // Ring and disc wired together are one electrode of a problem of its own.
    let mesh = ring_disc_sphere(500);
    let joined = SurfaceMesh {
        electrode: mesh.electrode.iter().map(|&e| e.saturating_sub(1)).collect(),
        electrodes: mesh.electrodes[1..].to_vec(),
        ..mesh.clone()
    };
    let (basis, wired) = (BoundaryProblem::new(&mesh).solve().unwrap(), BoundaryProblem::new(&joined).solve().unwrap());
    let (c, w) = (&basis.capacitance.matrix, &wired.capacitance.matrix);
    // Rounding of the right-hand sides throughout: the matrix and its factors are the same. Measured 2e-15.
    assert!((w[0][0] / (c[0][0] + 2.0 * c[0][1] + c[1][1]) - 1.0).abs() < 1e-13);
    assert!((w[0][1] / (c[0][2] + c[1][2]) - 1.0).abs() < 1e-13);
    let points = clear_points(&mesh, 1.6, 0.05, 200, 3);
    let sum = basis.combined(&[vec![1.0, 1.0, 0.0], vec![0.0, 0.0, 1.0]]);
    let (potential, field) = apart(&wired.panel_sum(), &sum, &points);
    println!("potential {potential:.1e} V, field {field:.1e}");
    assert!(potential < 1e-13 && field < 1e-13, "{potential:e} {field:e}");
}

#[test]
fn law_weighted_fields_are_weighted_sums_of_unit_fields() {
    // Rounding of a sum over a thousand panels of charges of both signs; splines of single precision round more.
    for (accuracy, rounding) in [(5e-5, 1e-12), (1e-3, 2.0_f64.powi(-24))] {
        check_weighted_fields(accuracy, rounding);
    }
}

/// With potentials of 100 V.
fn check_weighted_fields(accuracy: f64, rounding: f64) {
    let mesh = ring_disc_sphere(300);
    let basis = BoundaryProblem::new(&mesh).solve().unwrap();
    let options = TableOptions {
        min: Vec3::repeat(-0.5),
        max: Vec3::repeat(0.5),
        accuracy,
        spacing: Some(0.05),
        max_bytes: 1 << 28,
        smooth: false,
    };
    let table = tabulate(&basis, &options, &|_| ()).unwrap().0;
    let identity: Vec<Vec<f64>> = (0..3).map(|k| (0..3).map(|l| f64::from(u8::from(k == l))).collect()).collect();
    let mut next = random(11);
    let points: Vec<Vec3> = (0..300).map(|_| Vec3::from_fn(|_, _| 1.5 * next() - 0.75)).collect();
    assert!(points.iter().filter(|p| table.covers(p)).count() > 5, "the table is asked too");
    for _ in 0..5 {
        let weights = vec![(0..3).map(|_| 200.0 * next() - 100.0).collect::<Vec<f64>>()];
        let pairs: [(Box<dyn BasisField>, Box<dyn BasisField>); 2] = [
            (Box::new(basis.panel_sum()), Box::new(basis.combined(&weights))),
            (
                Box::new(TabulatedField::combined(&basis, &table, &identity)),
                Box::new(TabulatedField::combined(&basis, &table, &weights)),
            ),
        ];
        for (unit, weighted) in &pairs {
            let (mut units, mut got) = (Samples::default(), Samples::default());
            unit.sample(&points, &mut units);
            weighted.sample(&points, &mut got);
            let strongest = got.gradient.iter().map(|g| g.norm()).fold(0.0, f64::max);
            for p in 0..points.len() {
                let sum: f64 = (0..3).map(|k| weights[0][k] * units.potential[3 * p + k]).sum();
                let slope: Vec3 = (0..3).map(|k| units.gradient[3 * p + k] * weights[0][k]).sum();
                assert!((got.potential[p] - sum).abs() < rounding * 100.0, "{} {sum}", got.potential[p]);
                assert!((got.gradient[p] - slope).norm() < rounding * strongest, "{} {slope}", got.gradient[p]);
            }
        }
    }
}

#[test]
fn law_a_ring_of_points_induces_what_a_thin_ring_does() {
    // Sources add: 64 points of 1/64 C on a circle are a charged circle, to exp(-64 × distance / radius).
    let mesh = ring_disc_sphere(300);
    let turn = nalgebra::Rotation3::from_euler_angles(0.3, -0.5, 0.9);
    let frame = [Vec3::x(), Vec3::y(), Vec3::z()].map(|e| turn * e);
    let (center, radius, count) = (Vec3::new(-0.4, 0.5, -0.9), 0.3, 64);
    let mut sources = vec![Source { kind: SourceKind::ThinRing { radius }, center, frame }];
    for k in 0..count {
        let (sin, cos) = (TAU * k as f64 / count as f64).sin_cos();
        let on_circle = center + (frame[0] * cos + frame[1] * sin) * radius;
        sources.push(Source { kind: SourceKind::Point, center: on_circle, frame });
    }
    let basis = BoundaryProblem { sources: &sources, ..BoundaryProblem::new(&mesh) }.solve().unwrap();
    for row in &basis.induced {
        let mean = row[1..].iter().sum::<f64>() / count as f64;
        // Nothing comes nearer to the circle than its radius: e^-64 and rounding.
        assert!((row[0] / mean - 1.0).abs() < 1e-11, "{} {mean}", row[0]);
    }
    let one = [vec![0.0; 3], vec![1.0], vec![0.0; count]].concat();
    let many = [vec![0.0; 4], vec![1.0 / count as f64; count]].concat();
    let points: Vec<Vec3> = clear_points(&mesh, 1.6, 0.05, 400, 5)
        .into_iter()
        .filter(|p| ((p - center).norm() - radius).abs() > 0.5 * radius)
        .collect();
    let (potential, field) = apart(&basis.combined(&[one]), &basis.combined(&[many]), &points);
    // Half a radius away the points still show by (2/3)^64 = 5e-12 of 1/(4πε0 R) = 3e10 V; fields relative.
    println!("potential {potential:.1e} V, field {field:.1e}");
    assert!(potential < 1e-10 * 3e10 && field < 1e-9, "{potential:e} {field:e}");
}
