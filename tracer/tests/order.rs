//! Slopes: the error of a flight over its step, against the declared order.

mod common;

use common::*;
use meshes::Vec3;
use tracer::{Drag, Method, Options, System};

/// A flight whose end is known.
struct Problem {
    name: &'static str,
    system: System,
    start: (Vec3, Vec3),
    time: f64,
    end: (Vec3, Vec3),
}

fn problems() -> Vec<Problem> {
    // 1: a Mathieu flight of the reference, 20 / π = 6.4 RF periods.
    let case = &cases("mathieu", "trajectory.a=0.1.q=0.4.k=0")[0];
    let x = |u: f64| v(u, 0.0, 0.0);
    let paul = Problem {
        name: "Paul trap",
        system: mathieu(0.1, 0.4),
        start: (x(1.0), x(0.3)),
        time: 20.0,
        end: (x(case.list("u")[2]), x(case.list("du_dzeta")[2])),
    };
    // 2: the Penning trap of the reference, 4.5 gyrations.
    let case = cases("penning", "grain_toy").remove(0);
    let penning = Problem {
        name: "Penning trap",
        system: System::new()
            .with_field(dc(Quadrupole { l: v(-1.0, -1.0, 2.0), r0: 1.0 }, 0.5))
            .with_magnetic_field(v(0.0, 0.0, 3.0)),
        start: (case.vector("x0"), case.vector("v0")),
        time: 10.0,
        end: (case.vectors("position")[2], case.vectors("velocity")[2]),
    };
    // 3: x'' + 2 g x' + x = 0: x = e^(-g t) (cos wt + (g / w) sin wt), v = -e^(-g t) sin(wt) / w, w² = 1 - g².
    let (g, time) = (0.2_f64, 7.0_f64);
    let w = (1.0 - g * g).sqrt();
    let (decay, (sin, cos)) = ((-g * time).exp(), (w * time).sin_cos());
    let damped = Problem {
        name: "damped oscillator",
        system: System::new().with_field(dc(Well { quartic: 0.0 }, 1.0)).with_drag(Drag::Rate(2.0 * g)),
        start: (x(1.0), x(0.0)),
        time,
        end: (x(decay * (cos + g / w * sin)), x(-decay * sin / w)),
    };
    // 4: everything at once, where splittings could go wrong: a well that is not harmonic under RF, oblique magnetic field
    // and drag. Judged by dop853 at 1e-14.
    let field = rf(Well { quartic: 0.5 }, 1.0, 0.5, 2.3);
    let system = System::new()
        .with_field(field)
        .with_magnetic_field(v(0.4, -0.8, 1.1))
        .with_drag(Drag::Rate(0.3))
        .with_constant_force(v(0.1, 0.2, -0.3));
    let start = (v(0.5, -0.3, 0.4), v(0.2, 0.6, -0.1));
    let tight = Options { tolerance: 1e-14, ..options(Method::Dop853, 6.0) };
    let end = end(&system, start.0, start.1, &tight);
    vec![paul, penning, damped, Problem { name: "everything", system, start, time: 6.0, end }]
}

/// Slope between the two finest runs whose error is still a hundred times the rounding, of runs with so many steps.
fn slope(problem: &Problem, counts: &[f64], options: impl Fn(f64) -> Options) -> f64 {
    let (mut steps, mut errors) = (Vec::new(), Vec::new());
    for h in counts.iter().map(|n| problem.time / n) {
        let (r, u) = end(&problem.system, problem.start.0, problem.start.1, &options(h));
        let error = (r - problem.end.0).norm() + (u - problem.end.1).norm();
        if error > 1e-13 {
            steps.push(h);
            errors.push(error);
        }
    }
    *slopes(&steps, &errors).last().unwrap()
}

/// Each method must show its declared order on each problem to a tenth and a half: the next term of a symmetric method is
/// h² smaller.
fn check(method: Method, counts: &[f64]) {
    for problem in problems() {
        let time = problem.time;
        let slope = slope(&problem, counts, |h| Options { step: Some(h), ..options(method, time) });
        let order = f64::from(method.order());
        assert!((slope - order).abs() < 0.15, "{} {method:?}: slope {slope}", problem.name);
    }
}

#[test]
fn order_verlet() {
    check(Method::Verlet, &[400.0, 800.0, 1600.0]);
}

#[test]
fn order_boris() {
    check(Method::Boris, &[400.0, 800.0, 1600.0]);
}

#[test]
fn order_langevin_without_noise() {
    check(Method::Langevin, &[400.0, 800.0, 1600.0]);
}

#[test]
fn order_blanes_moan_4() {
    check(Method::BlanesMoan4, &[60.0, 120.0, 240.0]);
}

#[test]
fn order_blanes_moan_6() {
    check(Method::BlanesMoan6, &[15.0, 30.0, 60.0, 120.0]);
}

#[test]
fn order_blanes_moan_14() {
    check(Method::BlanesMoan14, &[15.0, 30.0, 60.0, 120.0]);
}

#[test]
fn order_stoermer() {
    // Mathieu flights of many periods, damped or not, at 26 to 45 steps a period: finer, the steps of order 6 that it starts
    // with show, and then rounding.
    for (q, k) in [(0.4, 0.0), (0.4, 0.05), (0.7, 0.0)] {
        let system = mathieu(0.05, q).with_drag(Drag::Rate(2.0 * k));
        let start = (v(1.0, 0.4, 0.0), v(0.3, -0.2, 0.1));
        let time = 40.0 * std::f64::consts::PI;
        let best = end(&system, start.0, start.1, &options(Method::Dop853, time));
        let (mut steps, mut errors) = (Vec::new(), Vec::new());
        for n in [26.0, 32.0, 38.0, 45.0] {
            let h = std::f64::consts::PI / n;
            let (r, u) =
                end(&system, start.0, start.1, &Options { step: Some(h), ..options(Method::Stoermer12, time) });
            steps.push(h);
            errors.push((r - best.0).norm() + (u - best.1).norm());
        }
        let slope = (errors[0] / errors[3]).ln() / (steps[0] / steps[3]).ln();
        // Two terms of the error, of orders 12 and 13, add or cancel.
        assert!((11.0..16.0).contains(&slope), "q = {q}, k = {k}: {slope}, {errors:?}");
        assert!(errors[3] < 3e-8, "{errors:?}");
    }
}

#[test]
fn order_adaptive_stoermer() {
    // Forty periods of a Paul trap, damped or not: what is left of the tolerance, and how many forces that takes.
    for (q, k) in [(0.4, 0.0), (0.4, 0.05), (0.7, 0.0)] {
        let system = mathieu(0.05, q).with_drag(Drag::Rate(2.0 * k));
        let grains = ensemble([grain(v(1.0, 0.4, 0.0), v(0.3, -0.2, 0.1), 1.0, 1.0)]);
        let time = 40.0 * std::f64::consts::PI;
        let fly = |method, tolerance| run(&system, &grains, &Options { tolerance, ..options(method, time) });
        let best = fly(Method::Dop853, 1e-14);
        let flown: Vec<(f64, u64)> = [1e-7, 1e-9, 1e-11]
            .into_iter()
            .map(|tolerance| {
                let (multiple, single) = (fly(Method::Stoermer, tolerance), fly(Method::Dop853, tolerance));
                let error = (multiple.ensemble.positions()[0] - best.ensemble.positions()[0]).norm();
                // Some 2000 steps, each within the tolerance; velocities in units of a radian of the drive.
                assert!(error < 100.0 * tolerance, "q = {q}, k = {k}: {error:e} at {tolerance:e}");
                // The start takes 300 forces; what follows, a third to a half of what Dop853 takes.
                let forces = multiple.force_evaluations;
                assert!(forces < single.force_evaluations * 2 / 3, "{forces}, {}", single.force_evaluations);
                (error, forces)
            })
            .collect();
        // Order 12: a hundredth of the tolerance takes steps shorter by the thirteenth root of that, 1.43; the start counts too.
        let growth = flown[2].1 as f64 / flown[1].1 as f64;
        assert!((1.1..1.6).contains(&growth), "q = {q}, k = {k}: {flown:?}");
        assert!(flown[2].0 < 0.1 * flown[0].0, "{flown:?}");
    }
}

#[test]
fn order_dop853() {
    // A loose tolerance accepts every step at its longest; the few shorter ones at the start, while the control lets steps
    // grow, move the slope a little, and so does the next term, only h smaller: half.
    for problem in problems() {
        let time = problem.time;
        let loose = |h: f64| Options { max_step: Some(h), tolerance: 1e-2, ..options(Method::Dop853, time) };
        let slope = slope(&problem, &[10.0, 20.0, 40.0, 80.0, 160.0], loose);
        assert!((slope - 8.0).abs() < 0.5, "{}: slope {slope}", problem.name);
    }
}

#[test]
fn order_dop853_dense_output() {
    // Position at a time inside steps of fixed length: order 7 and one for the step it is an error of. Steps of 0.4, 0.2
    // and 0.1 of a grain on a circle, sampled 0.03 after some step.
    let system = System::new().with_field(dc(Well { quartic: 0.0 }, 1.0));
    let errors: Vec<f64> = [0.4, 0.2, 0.1]
        .into_iter()
        .map(|h| {
            let options =
                Options { max_step: Some(h), tolerance: 1e-2, every: Some(0.0137), ..options(Method::Dop853, 4.0) };
            let grains = ensemble([grain(v(1.0, 0.0, 0.0), v(0.0, 0.0, 0.0), 1.0, 1.0)]);
            let (tracks, _) = samples(&system, &grains, &options);
            tracks[0].iter().map(|s| (s.position.x - s.time.cos()).abs()).fold(0.0, f64::max)
        })
        .collect();
    let mean = (errors[0] / errors[2]).log2() / 2.0;
    assert!((6.8..8.5).contains(&mean), "slope {mean}, errors {errors:?}");
    assert!(errors[2] < 1e-10, "{errors:?}");
}

#[test]
fn order_is_kept_across_corners_of_a_waveform() {
    // A square wave turns the force of a uniform field at known times: x'' = ±1, a chain of parabolas. Every integrator is
    // exact when it stops at the jumps, and off by h where it steps over one.
    use field::{DrivenField, Waveform, WaveformPart};
    let square = WaveformPart::Square { amplitude: 1.0, frequency: 0.7, phase: 0.4, duty: 0.3 };
    let waveform = Waveform { constant: 0.0, parts: vec![square.clone()] };
    let basis = std::sync::Arc::new(Uniform(v(1.0, 0.0, 0.0)));
    let system = System::new().with_field(DrivenField::new(basis, vec![waveform]));
    let (mut t, mut x, mut u) = (0.0, 0.0, 0.0);
    while t < 20.0 {
        let next = square.next_corner(t + 1e-12).min(20.0);
        let (h, a) = (next - t, square.value(0.5 * (t + next)));
        x += u * h + 0.5 * a * h * h;
        u += a * h;
        t = next;
    }
    for method in [
        Method::Dop853,
        Method::Verlet,
        Method::Boris,
        Method::BlanesMoan4,
        Method::BlanesMoan6,
        Method::BlanesMoan14,
        Method::Stoermer12,
        Method::Stoermer,
    ] {
        let options = Options { step: Some(0.3), ..options(method, 20.0) };
        let (r, w) = end(&system, v(0.0, 0.0, 0.0), v(0.0, 0.0, 0.0), &options);
        // Rounding of some hundred steps.
        assert!((r.x - x).abs() < 1e-12 && (w.x - u).abs() < 1e-12, "{method:?}: {} {x}", r.x);
    }
}

#[test]
fn order_langevin_in_a_well() {
    // The stationary <x²> ω²/s² of a grain in a harmonic well with γ = 0.2 ω is 1.1109 at ω h = 1 and 1.0222 at 1/2 (the
    // covariance of the scheme's linear map, computed apart): (ω h)²/12 and a fourth-order rest. 5000 grains, 55 samples
    // each, 3 axes: the estimator is good to 0.0016.
    let system = System::new()
        .with_field(dc(Quadrupole { l: v(1.0, 1.0, 1.0), r0: 1.0 }, 1.0))
        .with_drag(Drag::Rate(0.2))
        .with_noise(1.0 / tracer::constants::BOLTZMANN);
    let excess = |h: f64| {
        let mut next = random(11);
        let mut gauss = || (0..12).map(|_| 0.5 * next()).sum::<f64>();
        let grains =
            ensemble((0..5000).map(|_| grain(v(gauss(), gauss(), gauss()), v(gauss(), gauss(), gauss()), 1.0, 1.0)));
        let every = h * (8.0 / h).round();
        let options = Options { step: Some(h), every: Some(every), ..options(Method::Langevin, 60.0 * every) };
        let (tracks, _) = samples(&system, &grains, &options);
        let late = tracks.iter().flat_map(|t| t.iter().skip(6));
        let (sum, count) = late.fold((0.0, 0.0), |(s, n), x| (s + x.position.norm_squared(), n + 3.0));
        sum / count - 1.0
    };
    let errors = [excess(1.0), excess(0.5)];
    assert!((errors[0] - 0.1109).abs() < 0.008 && (errors[1] - 0.0222).abs() < 0.008, "{errors:?}");
}
