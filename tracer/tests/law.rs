//! Laws that must hold whatever the numbers: conservation, reversal, drifts, statistics, the same bits for any threads.

mod common;

use std::f64::consts::{PI, TAU};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use common::*;
use field::{BasisField, DrivenField, Quadratic, QuadraticField, Samples, Waveform, WaveformPart};
use meshes::Vec3;
use tracer::constants::BOLTZMANN;
use tracer::{
    Drag, Ensemble, Group, Launch, Method, Nothing, Options, Outcome, Place, Region, Sink, System, TraceError, trace,
};

const SYMPLECTIC: [Method; 5] =
    [Method::Verlet, Method::Boris, Method::BlanesMoan4, Method::BlanesMoan6, Method::BlanesMoan14];

/// Change of the mean energy from the first half of a flight to the second, weighted with Hann windows, so that its
/// wiggles during an oscillation do not show as drift.
fn drift(energy: &[f64]) -> f64 {
    let window = energy.len() / 2;
    let mean = |part: &[f64]| {
        let weight = |k: usize| (PI * (k as f64 + 0.5) / window as f64).sin().powi(2);
        let (sum, all) = part.iter().enumerate().fold((0.0, 0.0), |(s, w), (k, e)| (s + e * weight(k), w + weight(k)));
        sum / all
    };
    (mean(&energy[energy.len() - window..]) - mean(&energy[..window])) / energy[0].abs()
}

#[test]
fn law_energy_in_a_static_field() {
    // 1e4 steps in a well that is not harmonic and couples the axes.
    let system = System::new().with_field(dc(Well { quartic: 0.7 }, 1.0));
    let start = ensemble([grain(v(0.6, -0.4, 0.3), v(0.1, 0.3, -0.2), 1.0, 1.0)]);
    // (method, step, bound on the drift). Steps: the shortest oscillation lasts about 3 s.
    for (method, step, bound) in [
        // Measured: 1.6e-10, the rest of the wiggles.
        (Method::Verlet, 0.02, 1e-9),
        (Method::Boris, 0.02, 1e-9),
        // Rounding: 2e-14.
        (Method::BlanesMoan4, 0.02, 1e-12),
        (Method::BlanesMoan6, 0.02, 1e-12),
        (Method::BlanesMoan14, 0.02, 1e-12),
        // Rounding of the multistep, which adds up: 4e-13.
        (Method::Stoermer12, 0.02, 5e-12),
        // Adaptive and not symplectic: 1e-13 a step over some thousand steps; measured 2e-13.
        (Method::Dop853, 0.02, 1e-11),
        (Method::Stoermer, 0.02, 1e-11),
    ] {
        let options = Options { step: Some(step), every: Some(10.0 * step), ..options(method, 1e4 * step) };
        let (tracks, _) = samples(&system, &start, &options);
        let energy: Vec<f64> = tracks[0].iter().map(|s| 0.5 * s.velocity.norm_squared() + s.potential_energy).collect();
        let drift = drift(&energy);
        assert!(drift.abs() < bound, "{method:?}: {drift:e}");
        let spread = energy.iter().fold(0.0_f64, |m, e| m.max((e / energy[0] - 1.0).abs()));
        // The wiggles themselves, of the method's order.
        let allowed = match method {
            Method::Verlet | Method::Boris => 5e-4,
            Method::BlanesMoan4 => 1e-8,
            // 1e-13 a step, some thousand steps.
            Method::Stoermer => 1e-10,
            _ => 1e-11,
        };
        assert!(spread < allowed, "{method:?}: {spread:e}");
    }
}

#[test]
fn law_time_reversal() {
    // A Paul trap in a magnetic field; cos is even, so flying from -T to 0 with velocity and field turned retraces 0 to T.
    let quadrupole = || rf(Quadrupole { l: v(1.0, 1.0, -2.0), r0: 1.0 }, 0.01, 0.3, 2.0);
    let system = |b: f64| System::new().with_field(quadrupole()).with_magnetic_field(v(0.1, 0.2, 0.3) * b);
    let (r0, u0) = (v(0.3, -0.2, 0.1), v(0.05, 0.1, -0.07));
    for method in SYMPLECTIC.into_iter().chain([Method::Dop853]) {
        let there = Options { step: Some(0.05), ..options(method, 40.0) };
        let (r1, u1) = end(&system(1.0), r0, u0, &there);
        let back = Options { start: -40.0, ..there };
        let (r2, u2) = end(&system(-1.0), r1, -u1, &back);
        // Symmetric methods undo themselves to the rounding of a thousand steps, dop853 to its tolerance.
        let error = (r2 - r0).norm() + (u2 + u0).norm();
        assert!(error < 1e-11, "{method:?}: {error:e}");
        assert!((r1 - r0).norm() > 0.05, "the grain has moved");
    }
}

#[test]
fn law_gyration_over_ten_thousand_turns() {
    // Radius m v / (Q B) and 1e4 turns, back to the start.
    let system = System::new().with_magnetic_field(v(0.0, 0.0, 2.0));
    let turns = 1e4;
    for (method, step, error) in [
        // Exact flights: rounding of 1e5 steps and of the time itself (6e4 rad).
        (Method::Verlet, 0.1, 1e-9),
        (Method::BlanesMoan6, 0.1, 1e-9),
        // The angle is exact, the radius short by (φ/2)/tan(φ/2) = 1 - φ²/12.
        (Method::Boris, 0.1, 1e-9),
        // 1e-13 a step, 2e5 steps, and adding up.
        (Method::Dop853, 0.1, 1e-7),
    ] {
        let options = Options { step: Some(step * PI), ..options(method, turns * PI) };
        let (r, u) = end(&system, v(0.0, 0.0, 0.0), v(1.0, 0.0, 0.25), &options);
        let along = 0.25 * turns * PI;
        assert!((r - v(0.0, 0.0, along)).norm() < f64::max(error, 1e-11 * along), "{method:?}: {r}");
        assert!((u - v(1.0, 0.0, 0.25)).norm() < error, "{method:?}: {u}");
        // Half a turn away stands the far end of the diameter: force Q v × B at the start is -y for Q > 0.
        let half = Options { duration: 0.5 * PI, step: Some(0.05 * PI), ..options };
        let (r, _) = end(&system, v(0.0, 0.0, 0.0), v(1.0, 0.0, 0.0), &half);
        let phi: f64 = 0.05 * PI * 2.0;
        let radius = if method == Method::Boris { 0.25 * phi / (0.5 * phi).tan() } else { 0.5 };
        assert!((r - v(0.0, -2.0 * radius, 0.0)).norm() < 1e-11, "{method:?}: {r}");
    }
}

#[test]
fn law_drift_across_electric_and_magnetic_field() {
    // E × B / B² whatever the charge and mass; after whole gyrations a grain from rest rests again.
    let (e, b) = (v(0.3, -0.2, 0.0), v(0.0, 0.0, 1.5));
    let system = System::new().with_field(dc(Uniform(e), 1.0)).with_magnetic_field(b);
    let expected = e.cross(&b) / b.norm_squared();
    for (charge, mass) in [(1.0, 1.0), (-2.0, 0.5), (1e-15, 3e-14)] {
        let gyration = TAU * mass / (f64::abs(charge) * 1.5);
        let start = ensemble([grain(v(0.0, 0.0, 0.0), v(0.0, 0.0, 0.0), charge, mass)]);
        for method in [Method::Dop853, Method::Verlet, Method::Boris, Method::BlanesMoan4, Method::BlanesMoan6] {
            let options = Options { step: Some(gyration / 100.0), ..options(method, 20.0 * gyration) };
            let traced = run(&system, &start, &options);
            let mean = traced.ensemble.positions()[0] / (20.0 * gyration);
            // A uniform field kicks the exact flight at even times: exact but for rounding. Boris's drift is short by
            // (φ/2)/tan(φ/2) = 1 - φ²/12, the price of the exact angle.
            let phi: f64 = TAU / 100.0;
            let expected = if method == Method::Boris { expected * (0.5 * phi / (0.5 * phi).tan()) } else { expected };
            assert!((mean - expected).norm() < 1e-10, "{method:?}: {mean} {expected}");
            assert!(traced.ensemble.velocities()[0].norm() < 1e-9);
        }
    }
}

#[test]
fn law_momentum_and_energy_of_a_cloud() {
    // Forty grains of both signs of motion, repelling each other from a ball into a well.
    let mut grains = Ensemble::new();
    let group = Group {
        count: 40,
        charge: 1e-14,
        mass: 1e-13,
        radius: 0.0,
        place: Place::Ball { center: Vec3::zeros(), radius: 1e-3 },
        launch: Launch::Isotropic(0.05),
    };
    grains.add_group(0, &group, 5).unwrap();
    let momentum = |g: &Ensemble| g.velocities().iter().sum::<Vec3>() * 1e-13;
    let free = System::new().with_coulomb();
    let size = 40.0 * 1e-13 * 0.1;
    for (method, step) in [(Method::Dop853, None), (Method::BlanesMoan6, Some(2e-5)), (Method::Stoermer12, Some(5e-6))]
    {
        let options = Options { step, tolerance: 1e-11, ..options(method, 0.01) };
        let traced = run(&free, &grains, &options);
        // Every pair's forces cancel but for the rounding of the sums.
        assert!((momentum(&traced.ensemble) - momentum(&grains)).norm() < 1e-13 * size, "{method:?}");
        let trap = System::new().with_field(dc(Well { quartic: 0.0 }, 5e4)).with_coulomb();
        let options = Options { every: Some(1e-3), ..options };
        let (tracks, _) = samples(&trap, &grains, &options);
        let energy = |k: usize| -> f64 {
            tracks.iter().map(|t| 0.5e-13 * t[k].velocity.norm_squared() + t[k].potential_energy).sum()
        };
        for k in 1..tracks[0].len() {
            assert!((energy(k) / energy(0) - 1.0).abs() < 1e-8, "{method:?}: {:e}", energy(k) / energy(0) - 1.0);
        }
    }
}

/// Grains at rest at the origin, of unit charge and mass.
fn at_rest(count: usize) -> Ensemble {
    ensemble((0..count).map(|_| grain(v(0.0, 0.0, 0.0), v(0.0, 0.0, 0.0), 1.0, 1.0)))
}

#[test]
fn law_noise_makes_the_thermal_speed_and_free_diffusion() {
    // γ = 2, s² = kB T / m = 0.5; for any step, even γ h = 5: <v²> = s² (1 - e^(-2γt)), <x²> = 2 D t - 3 D/γ + ...,
    // D = s²/γ. 20000 grains × 3 axes, seed 1: 5 sigma of a variance of normal numbers, sqrt(2 / 60000).
    let system = System::new().with_drag(Drag::Rate(2.0)).with_noise(0.5 / BOLTZMANN);
    for (step, field) in [(0.05, 0.0), (2.5, 0.0), (0.25, 3.0)] {
        let system = system.clone().with_magnetic_field(v(0.0, 0.0, field));
        let options = Options { step: Some(step), ..options(Method::Auto, 10.0) };
        let traced = run(&system, &at_rest(20_000), &options);
        assert_eq!(traced.method, Method::Langevin);
        // Across the field: the diffusion is cut by γ² / (γ² + ω²).
        let variance = |list: &[Vec3], axis: usize| list.iter().map(|x| x[axis] * x[axis]).sum::<f64>() / 20_000.0;
        for axis in 0..3 {
            let omega = if axis < 2 { field } else { 0.0 };
            let lambda = nalgebra::Complex::new(2.0, -omega);
            // s² [2 Re(t/λ) - 2 Re((1 - e^(-λt)) / λ²)] is the stationary spread; from rest the memory of v = 0 is taken
            // off: |(1 - e^(-λt)) / λ|².
            let s = (1.0 - (-lambda * 10.0).exp()) / lambda;
            let spread = 0.5 * (2.0 * (10.0 / lambda).re - 2.0 * (s / lambda).re - s.norm_sqr());
            let speed = variance(traced.ensemble.velocities(), axis) / 0.5;
            let place = variance(traced.ensemble.positions(), axis) / spread;
            let sigma = (2.0_f64 / 20_000.0).sqrt();
            assert!((speed - 1.0).abs() < 5.0 * sigma, "step {step} axis {axis}: <v²> {speed}");
            assert!((place - 1.0).abs() < 5.0 * sigma, "step {step} axis {axis}: <x²> {place}");
        }
    }
}

#[test]
fn law_noise_in_a_well_is_boltzmann() {
    // <x²> = kT / (m ω²), <v²> = kT / m, no correlation; ω h = 0.1 is biased by 1e-3, below 5 sigma = 6e-3 here.
    let system = System::new()
        .with_field(dc(Quadrupole { l: v(1.0, 4.0, 9.0), r0: 1.0 }, 1.0))
        .with_drag(Drag::Rate(1.0))
        .with_noise(1.0 / BOLTZMANN);
    let options = Options { step: Some(1.0 / 30.0), every: Some(10.0), ..options(Method::Langevin, 150.0) };
    let (tracks, _) = samples(&system, &at_rest(5000), &options);
    let late: Vec<_> = tracks.iter().flat_map(|t| t.iter().skip(2)).collect();
    let count = late.len() as f64;
    for axis in 0..3 {
        let omega2 = [1.0, 4.0, 9.0][axis];
        let mean = |f: &dyn Fn(&tracer::Sample) -> f64| late.iter().map(|s| f(s)).sum::<f64>() / count;
        let place = omega2 * mean(&|s| s.position[axis].powi(2));
        let speed = mean(&|s| s.velocity[axis].powi(2));
        let mixed = omega2.sqrt() * mean(&|s| s.position[axis] * s.velocity[axis]);
        let sigma = (2.0 / count).sqrt();
        assert!((place - 1.0).abs() < 5.0 * sigma, "axis {axis}: <x²> {place} ± {sigma}");
        assert!((speed - 1.0).abs() < 5.0 * sigma, "axis {axis}: <v²> {speed} ± {sigma}");
        assert!(mixed.abs() < 5.0 * sigma, "axis {axis}: <xv> {mixed}");
    }
}

#[test]
fn law_mean_fall_under_noise_does_not_depend_on_the_step() {
    // γ h = 5: the mean speed is g/γ, which BAOAB would miss by a factor of 2.5.
    let system = System::new().with_drag(Drag::Rate(2.0)).with_noise(1e-4 / BOLTZMANN).with_gravity(v(0.0, 0.0, -1.0));
    let options = Options { step: Some(2.5), ..options(Method::Auto, 100.0) };
    let traced = run(&system, &at_rest(2000), &options);
    let mean = traced.ensemble.positions().iter().map(|p| p.z).sum::<f64>() / 2000.0;
    // From rest: g/γ (t - 1/γ (1 - ...)), in kicks at the ends of steps; 5 sigma of sqrt(2 D t / N) = 7e-5.
    let flow = (100.0 - 0.5) / 2.0;
    assert!((mean + flow).abs() < 0.5 * 2.5 * 0.5, "{mean} {flow}");
    let half = run(&system, &at_rest(2000), &Options { duration: 50.0, ..options });
    let late = mean - half.ensemble.positions().iter().map(|p| p.z).sum::<f64>() / 2000.0;
    assert!((late + 25.0).abs() < 5.0 * 1e-4, "{late}");
}

/// Grains of a Paul trap whose flights end in all ways, on electrodes and off the region.
fn mixed(count: usize) -> (System, Ensemble) {
    let mut next = random(3);
    let grains = ensemble((0..count).map(|_| {
        // Q/m near 1, and repulsion of the order of the trap's forces.
        let charge = 1e-12 * (1.0 + 0.5 * next());
        grain(v(next(), next(), next()) * 0.5, v(next(), next(), next()) * 0.2, charge, 1e-12)
    }));
    let region = Region { min: v(-0.7, -0.7, -0.7), max: v(0.7, 0.7, 0.7) };
    let system = System::new()
        .with_field(rf(Quadrupole { l: v(1.0, 1.0, -2.0), r0: 1.0 }, 0.02, 0.45, 2.0))
        .with_drag(Drag::Rate(0.02))
        .with_region(region);
    (system, grains)
}

/// A field that does not say that it is quadratic.
struct Hidden(QuadraticField);

impl BasisField for Hidden {
    fn channels(&self) -> usize {
        self.0.channels()
    }

    fn sample(&self, points: &[Vec3], samples: &mut Samples) {
        self.0.sample(points, samples);
    }
}

/// A quadrupole under RF, a uniform field that turns on, gravity and a constant force, in a region, with or without drag.
fn linear(hidden: bool, rate: f64, pushed: bool) -> System {
    let mut channels = vec![Quadratic::quadrupole(v(1.0, 1.0, -2.0), 1.0)];
    let sine = WaveformPart::Sine { amplitude: -0.45, frequency: 1.0 / PI, phase: 0.3 };
    let mut waveforms = vec![Waveform { constant: 0.02, parts: vec![sine] }];
    let mut system = System::new().with_drag(Drag::Rate(rate));
    if pushed {
        channels.push(Quadratic::uniform(v(0.3, -0.1, 0.2)));
        let ramp = WaveformPart::Ramp { amplitude: 0.01, start: 5.0, duration: 7.0 };
        waveforms.push(Waveform { constant: 0.0, parts: vec![ramp] });
        system = system.with_gravity(v(0.001, 0.002, -0.003)).with_constant_force(v(1e-15, 0.0, -2e-15));
    }
    let field = QuadraticField { channels };
    let basis: Arc<dyn BasisField> = if hidden { Arc::new(Hidden(field)) } else { Arc::new(field) };
    system.with_field(DrivenField::new(basis, waveforms))
}

const SPLIT: [Method; 4] = [Method::Verlet, Method::BlanesMoan4, Method::BlanesMoan6, Method::BlanesMoan14];

#[test]
fn law_linear_forces_fly_as_others_do() {
    // The same schemes, coded apart, a point at a time: rounding of 30 steps a period over ten periods, grown with the motion.
    let (with_region, mut grains) = mixed(60);
    grains.push(grain(v(0.1, 0.2, 0.3), v(0.02, 0.0, -0.03), 0.0, 1e-12)).unwrap();
    for (rate, pushed) in [(0.0, false), (0.3, false), (0.0, true), (0.3, true)] {
        for method in SPLIT {
            for every in [None, Some(1.7)] {
                let options = Options { step: Some(0.1), every, ..options(method, 30.0) };
                let [one, other] = [false, true].map(|hidden| {
                    let system = System { region: with_region.region, ..linear(hidden, rate, pushed) };
                    (run(&system, &grains, &options), samples(&system, &grains, &options).0)
                });
                assert_eq!(one.0.accepted, other.0.accepted, "{method:?}: every grain takes the same steps");
                let mut left = 0;
                for k in 0..grains.len() {
                    let (a, b) = (&one.0.endings[k], &other.0.endings[k]);
                    assert_eq!(std::mem::discriminant(&a.outcome), std::mem::discriminant(&b.outcome));
                    assert!((a.time - b.time).abs() < 1e-11, "{method:?}: {} {}", a.time, b.time);
                    let off = one.0.ensemble.positions()[k] - other.0.ensemble.positions()[k];
                    assert!(off.norm() < 1e-12, "{method:?} grain {k}: {off}");
                    left += usize::from(matches!(a.outcome, Outcome::LeftRegion { .. }));
                    assert_eq!(one.1[k].len(), other.1[k].len());
                    for (a, b) in one.1[k].iter().zip(&other.1[k]) {
                        assert!((a.position - b.position).norm() + (a.velocity - b.velocity).norm() < 1e-12);
                    }
                }
                assert!(left > 5 && left < grains.len(), "{left} have left the region");
            }
        }
    }
}

#[test]
fn law_linear_forces_give_the_same_bits_for_any_threads_and_blocks() {
    let (with_region, grains) = mixed(70);
    let pool = |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    for (rate, pushed) in [(0.0, false), (0.3, true)] {
        let system = System { region: with_region.region, ..linear(false, rate, pushed) };
        for method in SPLIT {
            let options = Options { step: Some(0.1), ..options(method, 30.0) };
            let fly = |threads: usize, block: usize, every: Option<f64>, grains: &Ensemble| {
                let options = Options { block, every, ..options.clone() };
                pool(threads).install(|| run(&system, grains, &options))
            };
            let one = fly(1, 64, None, &grains);
            for (threads, block) in [(2, 64), (2, 3), (1, 1)] {
                assert!(fly(threads, block, None, &grains) == one, "{method:?}, {threads} threads, blocks of {block}");
            }
            for k in [0, 7, 41] {
                assert_eq!(fly(1, 64, None, &grains.subset(&[k])).ensemble.grain(0), one.ensemble.grain(k));
            }
            // Samples at ends of steps cut what is flown at once, and change nothing.
            let sampled = fly(1, 64, Some(1.5), &grains);
            for k in (0..grains.len()).filter(|&k| one.endings[k].outcome == Outcome::TimeUp) {
                let off = sampled.ensemble.positions()[k] - one.ensemble.positions()[k];
                // The ends of steps are counted from the samples: rounding of times.
                assert!(off.norm() < 1e-12, "{method:?}: {off}");
            }
        }
    }
}

#[test]
fn law_same_bits_for_any_threads_and_blocks() {
    let (plain, grains) = mixed(100);
    let noisy = plain.clone().with_noise(1e-16 / BOLTZMANN);
    let coupled = plain.clone().with_coulomb();
    let pool = |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let few = grains.subset(&[0, 7, 11, 40, 41, 77]);
    for (system, method, grains) in [
        (&plain, Method::Dop853, &grains),
        (&plain, Method::BlanesMoan4, &grains),
        (&plain, Method::BlanesMoan14, &grains),
        (&plain, Method::Stoermer12, &grains),
        (&plain, Method::Stoermer, &grains),
        (&plain, Method::Boris, &grains),
        (&noisy, Method::Langevin, &grains),
        (&coupled, Method::Dop853, &few),
        (&coupled, Method::Verlet, &few),
        (&coupled, Method::Stoermer12, &few),
        (&coupled, Method::Stoermer, &few),
    ] {
        let options = Options { tolerance: 1e-8, step: Some(0.05), every: Some(0.7), ..options(method, 30.0) };
        let fly = |threads: usize, block: usize, grains: &Ensemble| {
            let options = Options { block, ..options.clone() };
            pool(threads).install(|| {
                let traced = run(system, grains, &options);
                (samples(system, grains, &options), traced)
            })
        };
        let one = fly(1, 64, grains);
        let counts = |how: fn(&Outcome) -> bool| one.1.endings.iter().filter(|e| how(&e.outcome)).count();
        assert!(counts(|o| matches!(o, Outcome::LeftRegion { .. })) > 0, "{method:?}");
        assert!(counts(|o| matches!(o, Outcome::TimeUp)) > 0, "{method:?}");
        for (threads, block) in [(2, 64), (2, 7), (1, 1), (2, 1000)] {
            assert_eq!(fly(threads, block, grains), one, "{method:?}, {threads} threads, blocks of {block}");
        }
        if !system.nature().couples_grains {
            // A grain alone flies as among others.
            let alone = fly(1, 64, &grains.subset(&[41])).1;
            assert_eq!(alone.ensemble.grain(0), one.1.ensemble.grain(41));
        }
    }
}

#[test]
fn law_observers_see_every_sample_once_and_in_order() {
    let (system, grains) = mixed(70);
    let options = Options { every: Some(0.1), tolerance: 1e-8, ..options(Method::Dop853, 30.0) };
    let last: Vec<std::sync::Mutex<f64>> = (0..70).map(|_| std::sync::Mutex::new(-1.0)).collect();
    let seen = AtomicUsize::new(0);
    let sink = Sink(|grain: usize, samples: &[tracer::Sample]| {
        let mut last = last[grain].lock().unwrap();
        for sample in samples {
            assert!(sample.time > *last);
            *last = sample.time;
        }
        seen.fetch_add(samples.len(), Ordering::Relaxed);
    });
    let traced = trace(&system, &grains, &options, &sink).unwrap();
    for (ending, last) in traced.endings.iter().zip(&last) {
        assert_eq!(ending.time, *last.lock().unwrap(), "the end is sampled");
    }
    let expected: usize = traced.endings.iter().map(|e| (e.time / 0.1 - 1e-9).ceil() as usize + 1).sum();
    assert_eq!(seen.into_inner(), expected);
    // Where nobody asks for forces, grains fly and are sampled as before, and only their first samples have some.
    let (with, ends) = samples(&system, &grains, &options);
    let (without, same_ends) = samples(&system, &grains, &Options { forces: false, ..options.clone() });
    assert_eq!(ends, same_ends);
    for (with, without) in with.iter().zip(&without) {
        assert_eq!(with.first(), without.first());
        assert!(with.len() < 3 || with[1].force != Vec3::zeros());
        let bare = |s: &tracer::Sample| tracer::Sample { force: Vec3::zeros(), potential_energy: 0.0, ..*s };
        assert!(with.iter().skip(1).map(bare).eq(without.iter().skip(1).copied()));
    }
}

#[test]
fn law_a_run_can_be_watched_and_stopped() {
    let (system, grains) = mixed(20);
    let told = Arc::new(std::sync::Mutex::new(Vec::new()));
    let cancel = Arc::new(AtomicBool::new(false));
    let (list, flag) = (told.clone(), cancel.clone());
    let progress: tracer::options::Progress = Arc::new(move |fraction| {
        list.lock().unwrap().push(fraction);
        if fraction > 0.5 {
            flag.store(true, Ordering::Relaxed);
        }
    });
    let options = Options { progress: Some(progress), cancel: Some(cancel), ..options(Method::Dop853, 3000.0) };
    let traced =
        rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap().install(|| run(&system, &grains, &options));
    let stopped = traced.endings.iter().filter(|e| e.outcome == Outcome::Stopped).count();
    assert!(stopped > 0);
    assert!(traced.endings.iter().all(|e| e.time < 3000.0 || e.outcome == Outcome::TimeUp));
    let told = told.lock().unwrap();
    assert!(told.len() > 50 && told.is_sorted() && told.iter().all(|f| (0.0..=1.0).contains(f)), "{told:?}");
}

#[test]
fn law_bad_options_are_refused_in_words() {
    let (system, grains) = mixed(1);
    let refused =
        |system: &System, options: Options| trace(system, &grains, &options, &Nothing).unwrap_err().to_string();
    let good = options(Method::Auto, 1.0);
    let tolerance = Options { tolerance: 1e-20, ..good.clone() };
    assert_eq!(
        refused(&system, tolerance),
        "option tolerance is 0.00000000000000000001; give a number between 1e-14 and 1e-2"
    );
    assert!(refused(&system, Options { every: Some(0.0), ..good.clone() }).starts_with("option every is 0;"));
    assert!(refused(&system, Options { duration: f64::NAN, ..good.clone() }).contains("duration"));
    let noisy = Options { method: Method::Verlet, ..good.clone() };
    assert_eq!(
        refused(&system.clone().with_noise(300.0), noisy),
        "verlet cannot be used: there is noise; use langevin, or leave the noise out"
    );
    assert!(refused(&System::new().with_noise(300.0), good.clone()).contains("there is no drag"));
    let drag = System::new().with_drag(Drag::Coefficient(-1.0));
    assert_eq!(refused(&drag, good.clone()), "grain 0: the drag coefficient is -1; give zero or more, in kg/s");
    // No grains, or no time, is no mistake.
    for system in [&system, &system.clone().with_coulomb()] {
        assert!(trace(system, &Ensemble::new(), &good, &Nothing).unwrap().endings.is_empty());
        let nothing = Options { duration: 0.0, method: Method::Verlet, step: Some(0.1), ..good.clone() };
        assert_eq!(trace(system, &grains, &nothing, &Nothing).unwrap().ensemble, grains);
    }
}

#[test]
fn law_a_singular_pull_is_reported_not_traced_through() {
    // Opposite charges head on: the step shrinks without end. No outcome is right, so the run says where and when.
    let grains = ensemble([
        grain(v(1e-3, 0.0, 0.0), v(0.0, 0.0, 0.0), 1e-14, 1e-13),
        grain(v(-1e-3, 0.0, 0.0), v(0.0, 0.0, 0.0), -1e-14, 1e-13),
    ]);
    let options = Options { tolerance: 1e-9, ..options(Method::Dop853, 1.0) };
    match trace(&System::new().with_coulomb(), &grains, &options, &Nothing) {
        Err(TraceError::StepUnderflow { time, position, .. }) => {
            // Free fall from rest at distance d: π/2 sqrt(μ d³ / (2 κ)).
            let fall = PI / 2.0 * (0.5e-13 * 8e-9 / (2.0 * field::constants::COULOMB * 1e-28_f64)).sqrt();
            assert!((time / fall - 1.0).abs() < 1e-6 && position.norm() < 1e-6, "{time} {fall} {position}");
        }
        other => panic!("{other:?}"),
    }
}

/// A field that is not finite beyond a plane.
struct Edge;

impl field::BasisField for Edge {
    fn channels(&self) -> usize {
        1
    }

    fn sample(&self, points: &[Vec3], samples: &mut field::Samples) {
        samples.reset(points.len(), 1);
        for (p, r) in points.iter().enumerate() {
            if r.x > 1.0 {
                samples.gradient[p] = Vec3::repeat(f64::NAN);
            }
        }
    }
}

#[test]
fn law_a_field_that_is_not_finite_ends_the_flight_at_the_last_good_place() {
    let grains = ensemble([
        grain(v(0.0, 0.0, 0.0), v(1.0, 0.0, 0.0), 1.0, 1.0),
        grain(v(0.0, 5e4, 0.0), v(-1.0, 0.0, 0.0), 1.0, 1.0),
    ]);
    let field = System::new().with_field(dc(Edge, 1.0));
    for (system, methods) in [
        (field.clone(), &[Method::Dop853, Method::Verlet, Method::Boris, Method::BlanesMoan6][..]),
        (field.with_force(WeakPair), &[Method::Dop853, Method::Verlet, Method::BlanesMoan6][..]),
    ] {
        for &method in methods {
            let options = Options { step: Some(0.01), every: Some(0.1), ..options(method, 3.0) };
            let traced = run(&system, &grains, &options);
            let Outcome::Unstable { point } = traced.endings[0].outcome else { panic!("{:?}", traced.endings) };
            // Boris asks for forces in the middle of a step only: half a step beyond the edge it has not noticed.
            let beyond = if method == Method::Boris { 0.005 } else { 0.0 };
            assert!(point.x <= 1.0 + beyond && point.x > 0.97, "{method:?}: {point}");
            assert_eq!(traced.endings[1].outcome, Outcome::TimeUp, "{method:?}: the other flies on");
            let (tracks, _) = samples(&system, &grains, &options);
            assert!(tracks[0].iter().all(|s| s.force.x.is_finite()));
        }
    }
}

/// Couples grains, without doing much.
struct WeakPair;

impl tracer::Force for WeakPair {
    fn nature(&self) -> tracer::Nature {
        tracer::Nature { couples_grains: true, ..tracer::Nature::default() }
    }

    fn add(&self, batch: &tracer::Batch, _: &mut tracer::Scratch, force: &mut [Vec3]) {
        let mean = batch.position.iter().sum::<Vec3>() / batch.len() as f64;
        for f in force {
            *f += mean * 1e-12;
        }
    }
}

#[test]
fn law_default_steps_and_error_estimates_tell_the_truth() {
    // Without a step the methods choose one from the forces; the estimate must then be near the true error: of Verlet and
    // Boris (order 2) three quarters of it, of the higher orders nearly all. Paul trap, well, magnetic field, and a cloud that
    // repels itself weakly enough not to be chaotic.
    let region = Region { min: v(-2.0, -2.0, -2.0), max: v(2.0, 2.0, 2.0) };
    let (paul, _) = mixed(1);
    let well = System::new().with_field(dc(Well { quartic: 0.3 }, 1.0)).with_region(region);
    let gyration = well.clone().with_magnetic_field(v(0.0, 0.0, 20.0));
    let mut next = random(21);
    let grains = ensemble(
        (0..5).map(|_| grain(v(next(), next(), next()) * 0.1, v(next(), next(), next()) * 0.02, 1e-15, 1e-15)),
    );
    for (name, system) in
        [("Paul", &paul), ("well", &well), ("gyration", &gyration), ("cloud", &well.clone().with_coulomb())]
    {
        let best = run(system, &grains, &options(Method::Dop853, 20.0));
        for method in SYMPLECTIC.into_iter().chain([Method::Dop853]) {
            let options = Options { method, duration: 20.0, ..Options::default() };
            let traced = run(system, &grains, &options);
            let estimate = traced.error.clone().unwrap();
            let off = (0..5).map(|k| (traced.ensemble.positions()[k] - best.ensemble.positions()[k]).norm());
            let error = off.fold(0.0, f64::max);
            // What the defaults promise, over a few periods: relative to an excursion of 0.1.
            let allowed = if method.order() == 2 { 2e-3 } else { 2e-7 };
            assert!(error < 0.1 * allowed, "{name} {method:?}: {error:e} with step {:?}", traced.step);
            let part = if method.order() == 2 { 0.75 } else { 1.0 };
            // Below 1e-13 both are rounding.
            let near = (estimate.position / (part * error) - 1.0).abs() < 0.2 || estimate.position.max(error) < 1e-13;
            assert!(near, "{name} {method:?}: estimate {:e}, error {error:e}", estimate.position);
            assert_eq!(estimate.otherwise, 0);
        }
    }
}
