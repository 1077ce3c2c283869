//! Energy and reversal in the tabulated field of two rings: what interpolation may do to a grain.

use std::f64::consts::PI;
use std::sync::Arc;

use field::{BasisField, DrivenField, Samples, TableOptions, TabulatedField, Waveform, WaveformPart, tabulate};
use graintrap_tests::{TwoRings, random};
use meshes::Vec3;
use tracer::{Ensemble, Grain, Method, Nothing, Options, Outcome, System, Trajectories, trace};

fn grain(position: Vec3, velocity: Vec3, id: u64) -> Grain {
    Grain { position, velocity, charge: 1.0, mass: 1.0, radius: 0.0, id, group: 0 }
}

fn ensemble(grains: impl IntoIterator<Item = Grain>) -> Ensemble {
    let mut ensemble = Ensemble::new();
    grains.into_iter().for_each(|g| ensemble.push(g).expect("a sound grain"));
    ensemble
}

/// Mean of the second half minus mean of the first, weighted with Hann windows, so that the wiggles of an oscillation do not
/// show as drift.
fn drift(energy: &[f64]) -> f64 {
    let window = energy.len() / 2;
    let mean = |part: &[f64]| {
        let weight = |k: usize| (PI * (k as f64 + 0.5) / window as f64).sin().powi(2);
        let (sum, all) = part.iter().enumerate().fold((0.0, 0.0), |(s, w), (k, e)| (s + e * weight(k), w + weight(k)));
        sum / all
    };
    mean(&energy[energy.len() - window..]) - mean(&energy[..window])
}

#[test]
fn law_energy_in_a_tabulated_static_field() {
    // Rings at 10 V hold the grain along the axis (ω_z = 1.3/s), a magnetic field across it (ω_c = 4/s): it crosses a cell of
    // the table every few steps, for 1e4 steps, 40 axial oscillations.
    let rings = TwoRings::tabulated(8);
    let basis = Arc::new(rings.field(&[vec![1.0, 1.0]]));
    let system = System::new()
        .with_field(DrivenField::new(basis, vec![Waveform::constant(10.0)]))
        .with_magnetic_field(Vec3::z() * 4.0);
    let start = ensemble([grain(Vec3::new(0.2, -0.1, 0.35), Vec3::new(0.1, 0.3, -0.1), 1)]);
    let exact = rings.basis.combined(&[vec![10.0, 10.0]]);
    // The promise: 1e-6 in 1e4 steps. (method, what the method itself lets the energy wiggle by)
    for (method, wiggle) in [
        // Measured 3e-10: 1e-9 a step, and cells between which the second derivative of the field jumps.
        (Method::Auto, 2e-9),
        // Order 2: (ω_z h)²/4 of the energy, measured 1.8e-4.
        (Method::Verlet, 4e-4),
        (Method::Boris, 4e-4),
        // Measured 4e-10 and 5e-11.
        (Method::BlanesMoan4, 2e-9),
        (Method::BlanesMoan6, 2e-9),
    ] {
        let (step, steps) = (0.02, 1e4);
        let options = Options {
            method,
            step: Some(step),
            max_step: Some(step),
            every: Some(10.0 * step),
            duration: steps * step,
            estimate_error: false,
            ..Options::default()
        };
        let kept = Trajectories::default();
        let traced = trace(&system, &start, &options, &kept).unwrap();
        assert!(traced.endings[0].outcome == Outcome::TimeUp && traced.accepted >= 10_000);
        let track = &kept.into_samples()[0];
        let farthest = track.iter().map(|s| s.position.amax()).fold(0.0, f64::max);
        assert!(farthest > 0.3 && farthest < rings.half, "within the table, through many cells: {farthest}");
        let kinetic: Vec<f64> = track.iter().map(|s| 0.5 * s.velocity.norm_squared()).collect();
        // Relative to the kinetic energy, a thirtieth of the potential one.
        let scale = kinetic.iter().copied().fold(0.0, f64::max);
        let energy: Vec<f64> = track.iter().zip(&kinetic).map(|(s, k)| k + s.potential_energy).collect();
        let drift = drift(&energy) / scale;
        let spread = energy.iter().map(|e| (e - energy[0]).abs()).fold(0.0, f64::max) / scale;
        // The same with the potential of the exact sum in place of the table's.
        let mut samples = Samples::default();
        exact.sample(&track.iter().map(|s| s.position).collect::<Vec<_>>(), &mut samples);
        let true_energy: Vec<f64> = samples.potential.iter().zip(&kinetic).map(|(phi, k)| k + phi).collect();
        let true_spread = true_energy.iter().map(|e| (e - true_energy[0]).abs()).fold(0.0, f64::max) / scale;
        println!("{method:?}: drift {drift:9.1e}, spread {spread:.1e}, with the exact potential {true_spread:.1e}");
        assert!(drift.abs() < 1e-6, "{method:?}: drift {drift:e}");
        assert!(spread < wiggle, "{method:?}: spread {spread:e}");
        // The table's potential is off by some 1e-8 V per V (`order_of_the_table`), 1e-7 V here of a kinetic energy of 0.2 J.
        assert!(true_spread < wiggle + 1e-6, "{method:?}: spread {true_spread:e}");
    }
}

#[test]
fn law_energy_gained_is_charge_times_voltage() {
    // Fifty grains on their ways through the table, rings at 5 V and -3 V; judged by the exact sum at both ends.
    let rings = TwoRings::tabulated(8);
    let volts = vec![5.0, -3.0];
    let basis = Arc::new(rings.field(std::slice::from_ref(&volts)));
    let system = System::new().with_field(DrivenField::new(basis, vec![Waveform::constant(1.0)]));
    let mut next = random(41);
    let mut anywhere = |half: f64| Vec3::from_fn(|_, _| half * (2.0 * next() - 1.0));
    let start = ensemble((0..50).map(|k| {
        let mut one = grain(anywhere(0.3), anywhere(0.1), k);
        one.charge = if k % 2 == 0 { 1.0 } else { -0.7 };
        one
    }));
    let options = Options { duration: 0.3, estimate_error: false, ..Options::default() };
    let traced = trace(&system, &start, &options, &Nothing).unwrap();
    let exact = rings.basis.combined(&[volts]);
    let (mut before, mut after) = (Samples::default(), Samples::default());
    exact.sample(start.positions(), &mut before);
    exact.sample(traced.ensemble.positions(), &mut after);
    let (mut worst, mut largest) = (0.0_f64, 0.0_f64);
    for k in 0..start.len() {
        let (a, b) = (start.grain(k), traced.ensemble.grain(k));
        let gained = 0.5 * (b.velocity.norm_squared() - a.velocity.norm_squared());
        let work = a.charge * (before.potential[k] - after.potential[k]);
        assert!(b.position.amax() < rings.half);
        worst = worst.max((gained - work).abs());
        largest = largest.max(gained);
    }
    println!("gained up to {largest:.2} J, off by {worst:.1e} J");
    // The table is off by some 1e-8 V per V (`order_of_the_table`) at both ends, 5 V on the rings; steps of 1e-9 leave less.
    assert!(worst < 2e-7, "{worst:e}");
    assert!(largest > 0.1, "they have moved");
}

#[test]
fn law_time_reversal_in_a_tabulated_rf_field() {
    // cos is even: from -T to 0 with the velocity turned retraces 0 to T. Interpolation must not know the direction.
    let rings = TwoRings::tabulated(8);
    let basis = Arc::new(rings.field(&[vec![1.0, 1.0]]));
    let rf = WaveformPart::Sine { amplitude: 20.0, frequency: 1.0, phase: 0.0 };
    let system = System::new().with_field(DrivenField::new(basis, vec![Waveform { constant: 1.0, parts: vec![rf] }]));
    let start = ensemble([grain(Vec3::new(0.1, 0.2, -0.15), Vec3::new(0.2, -0.1, 0.3), 1)]);
    for method in [Method::Verlet, Method::Boris, Method::BlanesMoan4, Method::BlanesMoan6] {
        let there = Options { method, step: Some(0.01), duration: 5.0, estimate_error: false, ..Options::default() };
        let far = trace(&system, &start, &there, &Nothing).unwrap().ensemble.grain(0);
        let turned = ensemble([Grain { velocity: -far.velocity, ..far }]);
        let back = trace(&system, &turned, &Options { start: -5.0, ..there }, &Nothing).unwrap().ensemble.grain(0);
        let error = (back.position - start.positions()[0]).norm() + (back.velocity + start.velocities()[0]).norm();
        println!("{method:?}: {error:.1e}");
        // Symmetric methods undo themselves to the rounding of a thousand steps.
        assert!(error < 1e-10, "{method:?}: {error:e}");
        assert!((far.position - start.positions()[0]).norm() > 0.05, "the grain has moved");
    }
}

#[test]
fn law_energy_across_the_edge_of_the_table() {
    // A grain held beside a wire, by the wire's pull along z and a magnetic field across it, passes in and out of the layer
    // that the table leaves to the exact sum. At each passage the potential steps by the table's error: an energy is known
    // to that and no better, and the steps do not add up to more.
    let rings = TwoRings::tabulated(4);
    let (min, max) = (Vec3::repeat(-1.2), Vec3::repeat(1.2));
    // Cells of one size: with smaller ones beside the wire the grain would not leave them.
    let options = TableOptions { min, max, accuracy: 1e-4, spacing: Some(0.02), max_bytes: 1 << 30, smooth: false };
    let (table, report) = tabulate(&rings.basis, &options, &|_| ()).unwrap();
    let basis = Arc::new(TabulatedField::combined(&rings.basis, &table, &[vec![1.0, 1.0]]));
    let system = System::new()
        .with_field(DrivenField::new(basis.clone(), vec![Waveform::constant(-3.0)]))
        .with_surface(basis.exact.tree().clone())
        .with_magnetic_field(Vec3::z() * 16.0);
    let start = ensemble([grain(Vec3::new(0.8, 0.0, 1.1), Vec3::new(0.1, 0.0, 0.0), 1)]);
    let (method, step) = (Method::BlanesMoan4, Some(0.01));
    let options = Options { method, step, every: step, duration: 20.0, estimate_error: false, ..Options::default() };
    let kept = Trajectories::default();
    assert_eq!(trace(&system, &start, &options, &kept).unwrap().endings[0].outcome, Outcome::TimeUp);
    let track = &kept.into_samples()[0];
    let covered = |p: &Vec3| table.covers(p);
    let passages = track.windows(2).filter(|w| covered(&w[0].position) != covered(&w[1].position)).count();
    let energy: Vec<f64> = track.iter().map(|s| 0.5 * s.velocity.norm_squared() + s.potential_energy).collect();
    let spread = energy.iter().map(|e| (e - energy[0]).abs()).fold(0.0, f64::max);
    let step = 3.0 * report.potential_error;
    println!("{passages} passages: energy off by {spread:.1e} J, the table by {step:.1e} V");
    assert!(passages > 10, "{passages} passages");
    assert!(spread < 5.0 * step, "{spread:e} J");
}
