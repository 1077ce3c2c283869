//! The ideal quadrupoles: exact trajectories and the edges of stability.

use std::f64::consts::PI;

use graintrap_tests::{numbers, reference};
use tracer::Outcome;

use crate::flown::{beta, flown};

#[test]
fn exact_beta_of_the_reference() {
    for case in reference("mathieu.json").iter().filter(|c| c.id.starts_with("beta.")) {
        let found = beta(case.input("a"), case.input("q"));
        match case.outputs["stable"].as_bool().unwrap() {
            // 1e-11 of the half trace; near its edges β is its root.
            true => assert!((found.unwrap() - case.output("beta")).abs() < 1e-8, "{}", case.id),
            false => assert_eq!(found, None, "{}", case.id),
        }
    }
}

/// Tables 3 and 4: the exact trajectories at the times of the reference, to 1e-6 of the start.
#[test]
fn experiment_mathieu_tables() {
    for (id, frequency) in [("trap3d.table3", "1.1 rad/s"), ("trap3d.table4", "1 rad/s")] {
        let case = reference("mathieu.json").into_iter().find(|c| c.id == id).unwrap();
        let run = flown("mathieu", &[&format!("source.trap.rf.frequency=\"{frequency}\"")]);
        let (r, z) = (numbers(&case.outputs["r_of_t"]), numbers(&case.outputs["z_of_t"]));
        let mut worst = 0.0_f64;
        for (n, time) in numbers(&case.inputs["times"]).into_iter().enumerate() {
            let sample = run.track(0).iter().find(|s| (s.time - time).abs() < 1e-9).unwrap();
            worst = worst.max((sample.position.x - r[n]).abs()).max((sample.position.z - z[n]).abs());
        }
        println!("{id}: {worst:.1e} m");
        assert!(worst < 1e-7, "{id}: {worst}");
        // The secular lines, to what 1200 s tell: 1e-3 of an entry of the spectrum.
        for (k, key) in [(0, "omega_sec_r"), (2, "omega_sec_z")] {
            let line = run.lines(0, k, 0.0)[0].frequency;
            assert!((line / (case.output(key) / (2.0 * PI)) - 1.0).abs() < 1e-4, "{key} {line}");
        }
    }
}

/// (a, q) = (-0.6, 1.2) and (-3.5e-6, 0.095): inside, with the secular frequencies of Floquet's theorem; just beyond, lost.
#[test]
fn experiment_mathieu_points() {
    // a_z = -8 U/Ω², q_z = 4 V/Ω² with Q/m = 1 C/kg, r0 = 1 m, Ω = 1 rad/s.
    for (a, q) in [(-0.6_f64, 1.2_f64), (-3.5e-6, 0.095)] {
        let volts = [format!("source.trap.dc={}", -a / 8.0), format!("source.trap.rf.amplitude={}", q / 4.0)];
        // 6000 s are sixteen of the slowest swings.
        let run = flown("mathieu_corner", &[&volts[0], &volts[1], "trace.duration=\"6000 s\""]);
        assert!(run.all_stay());
        for (k, a, q) in [(2, a, q), (0, -a / 2.0, q / 2.0)] {
            let expected = beta(a, q).unwrap() / (4.0 * PI);
            let line =
                run.lines(0, k, 0.0).into_iter().min_by(|l, m| l.frequency.total_cmp(&m.frequency)).unwrap().frequency;
            println!("a = {a}, q = {q}: {line:.6} Hz, Floquet {expected:.6} Hz");
            assert!((line / expected - 1.0).abs() < 1e-3, "{line} {expected}");
        }
    }
    // a0(1.2) = -0.63343.
    let out = flown("mathieu_corner", &["source.trap.dc=0.0805"]);
    let farthest = out.track(0).iter().map(|s| s.position.z.abs()).fold(0.0, f64::max);
    println!("at a = -0.644: {farthest:.1e} m, {:?}", out.outcome(0));
    assert!(farthest > 1.0);
}

/// Ejection from the ideal trap at a = 0 between q = 0.9078 and 0.9083, after 477 periods at most.
#[test]
fn experiment_ejection_limit() {
    let flight = |q: f64| {
        let volts = format!("source.trap.rf.amplitude={}", q / 4.0);
        let start = "grains.1.place.points=[[1e-4, 0, 1e-4]]";
        flown("mathieu_corner", &["source.trap.dc=0", &volts, start, "trace.duration=\"3000 s\""])
    };
    let (below, above) = (flight(0.9078), flight(0.9083));
    let farthest = below.track(0).iter().map(|s| s.position.z.abs()).fold(0.0, f64::max);
    println!("q = 0.9078: {farthest:.2e} m; q = 0.9083: {:?}", above.outcome(0));
    // Below it beats to 1/sqrt(1 - cos²πβ) of the start, some fifty; above it grows by e in forty periods and leaves.
    assert!(below.all_stay() && farthest < 0.02, "{farthest}");
    assert!(matches!(above.outcome(0), Outcome::LeftRegion { .. }));
}

#[test]
fn experiment_mass_filter() {
    let run = flown("mass_filter", &[]);
    let left = |g: usize| matches!(run.outcome(g), Outcome::LeftRegion { .. });
    assert!(left(0) && !left(1) && left(2));
    // The light one is beyond b1 and leaves along x, the heavy one beyond -a0 and leaves along y.
    let ends = run.ends();
    assert!(ends[0].x.abs() > 9e-3 && ends[0].y.abs() < 5e-3, "{}", ends[0]);
    assert!(ends[2].y.abs() > 9e-3 && ends[2].x.abs() < 5e-3, "{}", ends[2]);
    for (mass, kept) in [(0.95, false), (1.0, true), (1.08, false)] {
        let omega = 2.0 * PI * 60.0;
        let unit = 2.0 * 1e-15 / (mass * 1e-13 * 1e-4 * omega * omega);
        let (a, q) = (2.0 * unit * 81.72, unit * 497.4);
        println!("{mass}: a = {a:.4}, q = {q:.4}, β {:?} {:?}", beta(a, q), beta(-a, q));
        assert_eq!(beta(a, q).is_some() && beta(-a, q).is_some(), kept);
    }
}
