//! The Penning trap: exact motion, the invariance theorem, magnetrons that grow.

use std::f64::consts::TAU;

use graintrap_tests::{number, reference, vector};
use nalgebra::Complex;

use crate::flown::{Flown, flown};

#[test]
fn experiment_penning_trajectories() {
    let right = [
        "source.trap.r0=\"1 mm\"",
        "source.trap.z0=\"0.7071067811865476 mm\"",
        "forces.magnetic_field=[0, 0, 5]",
        "grains.1.place.points=[[0.0002, 0, 0.0002]]",
        "grains.1.speed.velocity=[0, 100, 0]",
        "output.every=\"0.02 us\"",
        "trace.duration=\"80 us\"",
    ];
    for (id, sets) in [("ghosh_left_Ca40", &[][..]), ("ghosh_right_Ca40", &right[..])] {
        let case = reference("penning.json").into_iter().find(|c| c.id == id).unwrap();
        let run = flown("penning", sets);
        let amplitude = vector(&case.inputs["x0"]).norm();
        let (times, places) = (&case.inputs["times"], case.outputs["position"].as_array().unwrap());
        let mut worst = 0.0_f64;
        for (time, place) in times.as_array().unwrap().iter().map(number).zip(places) {
            let sample = run.track(0).iter().find(|s| (s.time - time).abs() < 1e-12).unwrap();
            worst = worst.max((sample.position - vector(place)).norm() / amplitude);
        }
        println!("{id}: {worst:.1e} of the amplitude");
        // The reference's own mark is 1e-8; e has ten digits there and all here.
        assert!(worst < 1e-7, "{id}: {worst}");
        for (k, key) in [(2, "omega_z"), (0, "omega_minus"), (0, "omega_plus")] {
            let exact = case.output(key) / TAU;
            let line = nearest(&run, k, exact);
            println!("  {key}: {line:.6e} Hz, {:.1e} off", line / exact - 1.0);
            // The slow circle turns but twenty times in the record: lines are placed to some thousandth of an entry.
            assert!(
                (line - exact).abs() < 0.02 / (run.flights.every * run.track(0).len() as f64),
                "{key} {line} {exact}"
            );
        }
    }
}

/// The line nearest to a frequency.
fn nearest(run: &Flown, k: usize, frequency: f64) -> f64 {
    let lines = run.lines(0, k, 0.0).into_iter().map(|line| line.frequency);
    lines.min_by(|a, b| (a - frequency).abs().total_cmp(&(b - frequency).abs())).unwrap()
}

/// f₊² + f₋² + f_z² = f_c², with the field tilted by 20° as well (Brown and Gabrielse 1986, eq. 2.79), though each of the three
/// moves.
#[test]
fn experiment_penning_invariance() {
    let cyclotron = 1.602176634e-19 / 6.6359e-26 / TAU;
    let squares = |tilt_deg: f64| {
        let (sin, cos) = tilt_deg.to_radians().sin_cos();
        let field = format!("forces.magnetic_field=[{sin}, 0, {cos}]");
        let run = flown("penning", &[&field, "trace.duration=\"4 ms\"", "output.every=\"0.5 us\""]);
        let strongest = |k: usize, low: f64, high: f64| {
            let lines = run.lines(0, k, 0.0);
            lines.iter().find(|l| (low..high).contains(&l.frequency)).unwrap_or_else(|| panic!("{lines:?}")).frequency
        };
        let three = [strongest(0, 1e3, 3e4), strongest(2, 4e4, 1.2e5), strongest(0, 2e5, 6e5)];
        println!(
            "tilt {tilt_deg}°: {three:.1?} Hz, sum of squares over f_c² {:.8}",
            three.map(|f| f * f).iter().sum::<f64>() / cyclotron.powi(2)
        );
        (three, three.map(|f| f * f).iter().sum::<f64>() / (cyclotron * cyclotron))
    };
    let (straight, sum) = squares(0.0);
    assert!((sum - 1.0).abs() < 1e-5, "{sum}");
    let (tilted, sum) = squares(20.0);
    assert!((sum - 1.0).abs() < 1e-5, "{sum}");
    assert!((tilted[1] / straight[1] - 1.0).abs() > 1e-2 && (tilted[0] / straight[0] - 1.0).abs() > 1e-2);
}

/// Drag at the rate C makes the slow circle grow and the fast one shrink: u = e^(λt) with λ² + (C + i w_c) λ - w_z²/2 = 0.
#[test]
fn experiment_penning_drag() {
    let run = flown("penning_drag", &[]);
    let (rate, cyclotron) = (1e3, 1.602176634e-19 / 6.6359e-26);
    let axial = 4.0 * 1.602176634e-19 / (6.6359e-26 * 2.0 * 25e-6);
    let b = Complex::new(rate, cyclotron);
    let root = (b * b + Complex::new(2.0 * axial, 0.0)).sqrt();
    let both = [(-b + root) * 0.5, (-b - root) * 0.5];
    let (slow, fast) = if both[0].re > both[1].re { (both[0], both[1]) } else { (both[1], both[0]) };
    assert!(slow.re > 0.0 && fast.re < 0.0);
    let first = run.track(0)[0];
    let (u0, v0) = (Complex::new(first.position.x, first.position.y), Complex::new(first.velocity.x, first.velocity.y));
    let grow = (v0 - fast * u0) / (slow - fast);
    let shrink = u0 - grow;
    let mut worst = 0.0_f64;
    for s in run.track(0) {
        let exact = grow * (slow * s.time).exp() + shrink * (fast * s.time).exp();
        worst = worst.max((Complex::new(s.position.x, s.position.y) - exact).norm());
    }
    let last = run.track(0).last().unwrap();
    let radius = last.position.xy().norm();
    println!(
        "magnetron grows at {:.4} /s: {:.4} mm to {:.4} mm, {worst:.1e} m off",
        slow.re,
        grow.norm() * 1e3,
        radius * 1e3
    );
    assert!(radius > 1.05 * grow.norm());
    assert!(worst < 1e-9, "{worst}");
}
