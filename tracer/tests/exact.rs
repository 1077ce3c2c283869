//! Flights with a known answer: Mathieu, Penning, drag, Kepler.

mod common;

use common::*;
use std::f64::consts::PI;
use tracer::{Drag, DragLaw, Gas, Method, Options, Outcome, Region, System};

/// The methods that share the deterministic tests, with a step in units of the RF period (or none) and the error that
/// the step gives on the Mathieu trajectories below, relative to the largest excursion.
const METHODS: [(Method, Option<f64>, f64); 8] = [
    // A thousand steps of 1e-13.
    (Method::Dop853, None, 2e-11),
    // (Ω h)² / 24 in the phase of at most 60 rad, and twice that where the motion grows.
    (Method::Verlet, Some(1.0 / 200.0), 5e-3),
    (Method::Boris, Some(1.0 / 200.0), 5e-3),
    // Measured at 40 steps a period: 4.7e-7 and 3.6e-10 at worst; a wrong last digit of a coefficient would show in the
    // second, a wrong coefficient in both.
    (Method::BlanesMoan4, Some(1.0 / 40.0), 1e-6),
    (Method::BlanesMoan6, Some(1.0 / 40.0), 1e-9),
    // At 20 steps.
    (Method::BlanesMoan14, Some(1.0 / 20.0), 2e-9),
    (Method::Stoermer12, Some(1.0 / 60.0), 2e-9),
    (Method::Stoermer, None, 2e-11),
];

#[test]
fn exact_mathieu_trajectories() {
    for case in cases("mathieu", "trajectory.") {
        let (a, q, k) = (case.number("a"), case.number("q"), case.number("k"));
        // u'' + 2 k u' + ...: the rate is 2 k in units where ζ is the time.
        let system = mathieu(a, q).with_drag(Drag::Rate(2.0 * k));
        let (u, du) = (case.list("u"), case.list("du_dzeta"));
        let size = u.iter().fold(case.number("u0").abs(), |m, u| m.max(u.abs()));
        for (method, part, allowed) in METHODS {
            for (n, zeta) in case.list("zeta").into_iter().enumerate() {
                let options = Options { step: part.map(|part| part * PI), ..options(method, zeta) };
                let (r, w) =
                    end(&system, v(case.number("u0"), 0.0, 0.0), v(case.number("du0_dzeta"), 0.0, 0.0), &options);
                let error = (r.x - u[n]).abs().max((w.x - du[n]).abs()) / size;
                assert!(error < allowed, "{} {method:?} at {zeta}: {error:e}", case.id());
                assert!(r.y == 0.0 && r.z == 0.0);
            }
        }
    }
}

#[test]
fn exact_mathieu_trajectories_at_the_default_tolerance() {
    // What a user gets who asks for nothing: tolerance 1e-9 a step, some 10 steps a period, 32 periods.
    for case in cases("mathieu", "trajectory.a=0.q=0.4.k=0") {
        let (zeta, u) = (case.list("zeta"), case.list("u"));
        let last = zeta.len() - 1;
        let options = Options { estimate_error: true, duration: zeta[last], ..Options::default() };
        let grains = ensemble([grain(v(1.0, 0.0, 0.0), v(0.0, 0.0, 0.0), 1.0, 1.0)]);
        let traced = run(&mathieu(0.0, 0.4), &grains, &options);
        let error = (traced.ensemble.positions()[0].x - u[last]).abs();
        let estimate = traced.error.unwrap();
        assert!(error < 1e-7, "{error:e}");
        // The estimate is the first run's error to a few per cent.
        assert!((estimate.position / error - 1.0).abs() < 0.2, "{:e} {error:e}", estimate.position);
        assert_eq!((estimate.otherwise, estimate.grains.len()), (0, 1));
    }
}

#[test]
fn exact_default_in_linear_forces() {
    // The default flies a quadratic field with the symplectic scheme of order 6, its step from the tolerance: after 31.8
    // periods a tenth of the tolerance a period, at q = 0.2 to 0.8, with and without drag.
    for case in cases("mathieu", "trajectory.") {
        let (a, q, k) = (case.number("a"), case.number("q"), case.number("k"));
        let form = field::QuadraticField::quadrupole(v(1.0, -1.0, 0.0), 1.0);
        let system = tracer::System::new().with_field(rf(form, a, 2.0 * q, 2.0)).with_drag(Drag::Rate(2.0 * k));
        let (zeta, u) = (case.list("zeta"), case.list("u"));
        let size = u.iter().fold(case.number("u0").abs(), |m, u| m.max(u.abs()));
        let last = zeta.len() - 1;
        for tolerance in [1e-6, 1e-9, 1e-11] {
            let options = Options { tolerance, estimate_error: true, duration: zeta[last], ..Options::default() };
            let grains =
                ensemble([grain(v(case.number("u0"), 0.0, 0.0), v(case.number("du0_dzeta"), 0.0, 0.0), 1.0, 1.0)]);
            let traced = run(&system, &grains, &options);
            assert_eq!(traced.method, Method::BlanesMoan14);
            let error = (traced.ensemble.positions()[0].x - u[last]).abs();
            // At q = 0.92, which is unstable, errors grow with the motion and a little faster: 2.2 times that.
            let allowed = 0.1 * tolerance * zeta[last] / PI * if q > 0.9 { 3.0 } else { 1.0 };
            assert!(error < allowed * size, "{} at {tolerance:e}: {:e}", case.id(), error / size);
            let told = traced.error.unwrap().position;
            // Half the step leaves a 64th of the error; below 1e-13 both are rounding.
            assert!(
                (told / error - 1.0).abs() < 0.3 || error.max(told) < 1e-12 * size,
                "{}: {told:e} {error:e}",
                case.id()
            );
        }
    }
}

#[test]
fn exact_mathieu_samples_between_steps() {
    // The dense output must be as good as the steps: at 1e-12 a step, 1e-9 of the exact values at times that no step meets.
    for case in cases("mathieu", "trajectory.a=0.q=0.4.k=0") {
        let (zeta, u, du) = (case.list("zeta"), case.list("u"), case.list("du_dzeta"));
        for n in 0..zeta.len() {
            let options =
                Options { every: Some(zeta[n] / 7.0), tolerance: 1e-12, ..options(Method::Dop853, 1.3 * zeta[n]) };
            let grains = ensemble([grain(v(1.0, 0.0, 0.0), v(0.0, 0.0, 0.0), 1.0, 1.0)]);
            let (tracks, endings) = samples(&mathieu(0.0, 0.4), &grains, &options);
            assert_eq!(tracks[0].len(), 11, "0 to 9 sevenths and the end");
            assert_eq!(tracks[0][10].time, endings[0].time);
            let sample = tracks[0][7];
            assert!((sample.position.x - u[n]).abs() < 1e-9, "{:e}", sample.position.x - u[n]);
            assert!((sample.velocity.x - du[n]).abs() < 1e-9);
            // Force and energy at the sample: F = 2q cos(2ζ) u with a = 0, energy of x and y together.
            let drive = -0.8 * (2.0 * sample.time).cos();
            assert!((sample.force.x + drive * sample.position.x).abs() < 1e-14);
            assert!((sample.potential_energy - 0.5 * drive * sample.position.x.powi(2)).abs() < 1e-14);
        }
    }
}

#[test]
fn exact_samples_between_steps_of_a_multistep() {
    // Quintics through the ends of steps: h⁶/46080 of the sixth derivative, 64 at twice the RF's phase, with h = π/60.
    for case in cases("mathieu", "trajectory.a=0.q=0.4.k=0") {
        let (zeta, u, du) = (case.list("zeta"), case.list("u"), case.list("du_dzeta"));
        for n in 0..zeta.len() {
            let step = Some(PI / 60.0);
            let options = Options { every: Some(zeta[n] / 7.0), step, ..options(Method::Stoermer12, 1.3 * zeta[n]) };
            let grains = ensemble([grain(v(1.0, 0.0, 0.0), v(0.0, 0.0, 0.0), 1.0, 1.0)]);
            let (tracks, _) = samples(&mathieu(0.0, 0.4), &grains, &options);
            assert_eq!(tracks[0].len(), 11, "0 to 9 sevenths and the end");
            let sample = tracks[0][7];
            assert!((sample.position.x - u[n]).abs() < 1e-9, "{:e}", sample.position.x - u[n]);
            assert!((sample.velocity.x - du[n]).abs() < 1e-7, "{:e}", sample.velocity.x - du[n]);
        }
    }
    let refused = System::new().with_magnetic_field(v(0.0, 0.0, 1.0));
    let grains = ensemble([grain(v(1.0, 0.0, 0.0), v(0.0, 0.0, 0.0), 1.0, 1.0)]);
    let error = tracer::trace(&refused, &grains, &options(Method::Stoermer12, 1.0), &tracer::Nothing).unwrap_err();
    assert!(error.to_string().contains("there is a magnetic field"), "{error}");
}

#[test]
fn exact_tables_three_and_four() {
    for case in cases("mathieu", "trap3d.") {
        let (u, amplitude, omega) = (case.number("U"), case.number("V"), case.number("Omega"));
        let system = System::new().with_field(rf(Quadrupole { l: v(1.0, 1.0, -2.0), r0: 1.0 }, u, amplitude, omega));
        let start = grain(v(0.1, 0.0, 0.05), v(0.0, 0.0, 0.0), case.number("Q"), case.number("m"));
        let (r, z) = (case.list("r_of_t"), case.list("z_of_t"));
        for (n, time) in case.list("times").into_iter().enumerate() {
            let traced = run(&system, &ensemble([start]), &options(Method::Dop853, time));
            let p = traced.ensemble.positions()[0];
            // 1e-9 of the start, 20 RF periods at 1e-13 a step.
            assert!((p.x - r[n]).abs() < 1e-10 && (p.z - z[n]).abs() < 1e-10, "{} at {time}: {p}", case.id());
        }
    }
}

/// The map of (u, u') over one RF period, as a row of four.
fn monodromy(a: f64, q: f64, k: f64) -> [f64; 4] {
    let system = mathieu(a, q).with_drag(Drag::Rate(2.0 * k));
    let (x, u) = (v(1.0, 0.0, 0.0), v(0.0, 0.0, 0.0));
    let (r1, v1) = end(&system, x, u, &options(Method::Dop853, PI));
    let (r2, v2) = end(&system, u, x, &options(Method::Dop853, PI));
    [r1.x, r2.x, v1.x, v2.x]
}

#[test]
fn exact_half_trace_of_one_period() {
    for case in cases("mathieu", "beta.") {
        let m = monodromy(case.number("a"), case.number("q"), 0.0);
        let half_trace = 0.5 * (m[0] + m[3]);
        let exact = case.number("half_trace_cos_pi_beta");
        // A dozen steps at 1e-13.
        assert!((half_trace - exact).abs() < 1e-11 * exact.abs().max(1.0), "{}: {half_trace} {exact}", case.id());
        assert!((m[0] * m[3] - m[1] * m[2] - 1.0).abs() < 1e-11, "area");
    }
}

#[test]
fn exact_stability_by_floquet() {
    use tracer::stability::mathieu_map;
    for case in cases("mathieu", "beta.") {
        let map = mathieu_map(&[case.number("a")], &[case.number("q")], 0.0);
        let exact = case.number("half_trace_cos_pi_beta");
        assert!((map.value[0] - exact).abs() < 1e-9 * exact.abs().max(1.0), "{}: {} {exact}", case.id(), map.value[0]);
        assert_eq!(map.is_stable(0, 0), exact.abs() < 1.0);
    }
    // Limits with drag, by bisection: to the error of the half trace over its slope there, which is near one.
    for case in cases("mathieu", "damped_limit.") {
        let (a, k, exact) = (case.number("a"), case.number("k"), case.number("q_max"));
        let (mut low, mut high) = (0.9 * exact, 1.05 * exact);
        while high - low > 1e-11 {
            let middle = 0.5 * (low + high);
            if mathieu_map(&[a], &[middle], k).is_stable(0, 0) { low = middle } else { high = middle }
        }
        assert!((low - exact).abs() < 1e-8, "{}: {low} {exact}", case.id());
    }
}

#[test]
fn exact_stability_by_flights() {
    use tracer::stability::{mathieu_map, mathieu_map_by_flights};
    // The first region and its surroundings, 200 x 200: the two maps differ where the half trace is so close to one that a
    // hundred periods do not tell, which is along the limits.
    let a: Vec<f64> = (0..200).map(|i| -0.2 + 0.0035 * f64::from(i)).collect();
    let q: Vec<f64> = (0..200).map(|j| 0.005 * (0.5 + f64::from(j))).collect();
    let exact = mathieu_map(&a, &q, 0.0);
    let flown = mathieu_map_by_flights(&a, &q, 100, 1e2);
    let (mut differ, mut stable) = (0, 0);
    for (i, a) in a.iter().enumerate() {
        for (j, q) in q.iter().enumerate() {
            stable += usize::from(exact.is_stable(i, j));
            if exact.is_stable(i, j) != flown.is_stable(i, j) {
                differ += 1;
                // Growth e^(μ π) a period with cosh(μ π) the half trace: e^5 in 100 periods takes 1e-3 above one.
                let excess = exact.value[i * 200 + j].abs() - 1.0;
                assert!((-1e-4..3e-3).contains(&excess), "a = {a}, q = {q}: {excess}");
            }
        }
    }
    assert!(stable > 5000 && differ < 400, "{differ} differ, {stable} of 40000 are stable");
    // The tip of the region along a = 0, as it stands in the tables.
    let tip = mathieu_map(&[0.0], &[0.90804, 0.90805], 0.0);
    assert!(tip.is_stable(0, 0) && !tip.is_stable(0, 1));
}

#[test]
fn exact_damped_limits() {
    for case in cases("mathieu", "damped_limit.") {
        let (a, k) = (case.number("a"), case.number("k"));
        let grows = |q: f64| {
            let m = monodromy(a, q, k);
            let (half, det) = (0.5 * (m[0] + m[3]), m[0] * m[3] - m[1] * m[2]);
            assert!((det - (-2.0 * PI * k).exp()).abs() < 1e-10, "drag alone sets the determinant");
            let root = half * half - det;
            (if root > 0.0 { half.abs() + root.sqrt() } else { det.sqrt() }) > 1.0
        };
        let exact = case.number("q_max");
        let (mut low, mut high) = (0.9 * exact, 1.05 * exact);
        assert!(!grows(low) && grows(high));
        while high - low > 1e-10 {
            let middle = 0.5 * (low + high);
            if grows(middle) { high = middle } else { low = middle }
        }
        assert!((low - exact).abs() < 1e-9, "{}: {low} {exact}", case.id());
    }
}

#[test]
fn exact_ejection_limit_by_flights() {
    // A grain is kept or leaves the region within 600 periods: at 1e-4 above the limit it grows by e^17, at 1e-4 below its
    // excursions beat to some 70 times the start.
    let region = Region { min: v(-1.0, -1.0, -1.0), max: v(1.0, 1.0, 1.0) };
    let leaves = |q: f64| {
        let system = mathieu(0.0, q).with_region(region);
        let grains = ensemble([grain(v(1e-3, 0.0, 0.0), v(0.0, 0.0, 0.0), 1.0, 1.0)]);
        let options = Options { tolerance: 1e-9, ..options(Method::Dop853, 600.0 * PI) };
        match run(&system, &grains, &options).endings[0].outcome {
            Outcome::LeftRegion { point } => {
                assert_eq!(point.x.abs(), 1.0, "on the face");
                true
            }
            Outcome::TimeUp => false,
            other => panic!("{other:?}"),
        }
    };
    let (mut low, mut high) = (0.9, 0.92);
    while high - low > 1e-5 {
        let middle = 0.5 * (low + high);
        if leaves(middle) { high = middle } else { low = middle }
    }
    let limit = 0.5 * (low + high);
    assert!((limit - 0.9080463337).abs() < 1e-4, "{limit}");
}

#[test]
fn exact_penning_positions() {
    for case in cases("penning", "") {
        if !case.has("position") {
            continue;
        }
        let (r0, z0) = (case.number("r0"), case.number("z0"));
        let length = (0.5 * (2.0 * z0 * z0 + r0 * r0)).sqrt();
        let system = System::new()
            .with_field(dc(Quadrupole { l: v(-1.0, -1.0, 2.0), r0: length }, case.number("U")))
            .with_magnetic_field(v(0.0, 0.0, case.number("B")));
        let start = grain(case.vector("x0"), case.vector("v0"), case.number("Q"), case.number("m"));
        let (position, velocity) = (case.vectors("position"), case.vectors("velocity"));
        let size = position.iter().map(|p| p.norm()).fold(0.0, f64::max);
        let speed = velocity.iter().map(|p| p.norm()).fold(0.0, f64::max);
        // Dop853: a thousand steps of 1e-13. The others with 400 steps of the fast gyration: the exact flight leaves to
        // Verlet only the slow motions, Boris errs by (ω h)² / 24 in the phase of the gyration.
        let turn = 2.0 * PI / case.number("omega_plus");
        let methods = [
            (Method::Dop853, 2e-11),
            (Method::Verlet, 1e-4),
            (Method::Boris, 5e-3),
            (Method::BlanesMoan4, 1e-11),
            (Method::BlanesMoan6, 1e-11),
        ];
        for (n, time) in case.list("times").into_iter().enumerate() {
            for (method, allowed) in methods {
                let options = Options { step: Some(turn / 400.0), ..options(method, time) };
                let traced = run(&system, &ensemble([start]), &options);
                let (p, w) = (traced.ensemble.positions()[0], traced.ensemble.velocities()[0]);
                let error = ((p - position[n]).norm() / size).max((w - velocity[n]).norm() / speed);
                assert!(error < allowed, "{} {method:?} at {time}: {error:e}", case.id());
            }
        }
    }
}

fn reference_gas(case: &Case) -> Gas {
    Gas {
        molecule_mass: case.number("m_gas"),
        viscosity: case.number("eta"),
        pressure: case.number("p"),
        temperature: case.number("T"),
    }
}

#[test]
fn exact_drag_of_the_reference_grains() {
    for case in cases("ocp", "drag.") {
        let (gas, radius, mass) = (reference_gas(&case), 0.5 * case.number("diameter"), case.number("mass"));
        let near = |name: &str, value: f64| {
            let exact = case.number(name);
            // The same formula in f64, π and kB to all digits.
            assert!((value / exact - 1.0).abs() < 1e-13, "{} {name}: {value} {exact}", case.id());
        };
        let c = |law| Drag::Sphere { gas, law }.coefficient(radius, mass).unwrap();
        near("mean_free_path", gas.mean_free_path());
        near("stokes_coefficient", c(DragLaw::Stokes));
        near("epstein_coefficient_specular", c(DragLaw::EpsteinSpecular));
        near("epstein_coefficient_diffuse", c(DragLaw::EpsteinDiffuse));
    }
}

#[test]
fn exact_terminal_speed_of_a_water_sphere() {
    let case = &cases("ocp", "drag.lycopodium")[0];
    let mut start = grain(v(0.0, 0.0, 0.0), v(0.0, 0.0, 0.0), 0.0, case.number("mass"));
    start.radius = 0.5 * case.number("diameter");
    let system = System::new()
        .with_gravity(v(0.0, 0.0, -tracer::constants::STANDARD_GRAVITY))
        .with_drag(Drag::Sphere { gas: reference_gas(case), law: DragLaw::Stokes });
    let exact = case.number("terminal_speed_g9.80665");
    assert!((exact - 3.05e-3).abs() < 1e-5, "3.05 mm/s");
    let gamma = case.number("gamma_stokes");
    // Far longer than 1/γ = 0.3 ms: the speed has forgotten its start, exp(-32).
    for method in [Method::Dop853, Method::Verlet, Method::Boris, Method::BlanesMoan4, Method::BlanesMoan6] {
        let options = Options { step: Some(0.02 / gamma), ..options(method, 32.0 / gamma) };
        let traced = run(&system, &ensemble([start]), &options);
        // Order 2 with kicks at its ends sees the speed in the middle of a kick: (γh)²/12.
        let allowed = if method.order() == 2 { 1e-4 } else { 1e-9 };
        let speed = -traced.ensemble.velocities()[0].z;
        assert!((speed / exact - 1.0).abs() < allowed, "{method:?}: {speed} {exact}");
        // The way: v (t - 1/γ), whatever the step for exact flights between kicks.
        let way = -traced.ensemble.positions()[0].z;
        let expected = exact * 31.0 / gamma;
        assert!((way / expected - 1.0).abs() < allowed, "{method:?}: {way} {expected}");
    }
}

#[test]
fn exact_two_grains_collide_as_kepler_says() {
    // Two grains of 1e-14 C and 1e-13 kg, relative speed 0.3 m/s from afar, with an impact parameter: the hyperbola
    //   r = a (e cosh F + 1), t = sqrt(μ a³ / κ) (e sinh F + F), x = a (e + cosh F), y = a sqrt(e² - 1) sinh F,
    // κ = k Q², μ = m / 2, run from F = -3 to F = 3.
    let (charge, mass, e) = (1e-14_f64, 1e-13_f64, 1.4_f64);
    let strength = field::constants::COULOMB * charge * charge;
    let reduced = 0.5 * mass;
    let a = strength / (reduced * 0.3 * 0.3);
    let unit = (reduced * a.powi(3) / strength).sqrt();
    let at = |f: f64| {
        let rate = 1.0 / (unit * (e * f.cosh() + 1.0));
        let b = a * (e * e - 1.0).sqrt();
        (v(a * (e + f.cosh()), b * f.sinh(), 0.0), v(a * f.sinh(), b * f.cosh(), 0.0) * rate)
    };
    let ((r0, u0), (r1, u1)) = (at(-3.0), at(3.0));
    let time = 2.0 * unit * (e * 3.0_f64.sinh() + 3.0);
    let drift = v(0.01, -0.02, 0.03);
    let grains =
        ensemble([grain(r0 * 0.5, u0 * 0.5 + drift, charge, mass), grain(-r0 * 0.5, -u0 * 0.5 + drift, charge, mass)]);
    let system = System::new().with_coulomb();
    for (method, steps, allowed) in [
        (Method::Dop853, 1.0, 1e-10),
        (Method::Verlet, 2e4, 1e-5),
        (Method::BlanesMoan6, 2e3, 1e-8),
        (Method::Stoermer12, 4e3, 1e-8),
        (Method::Stoermer, 1.0, 1e-10),
    ] {
        let options = Options { step: Some(time / steps), ..options(method, time) };
        let traced = run(&system, &grains, &options);
        let (p, w) = (traced.ensemble.positions(), traced.ensemble.velocities());
        assert!(((p[0] - p[1]) - r1).norm() < allowed * r1.norm(), "{method:?} {:e}", ((p[0] - p[1]) - r1).norm());
        assert!(((w[0] - w[1]) - u1).norm() < allowed * u1.norm(), "{method:?}");
        // Momentum: rounding. Energy: as the trajectory.
        assert!((w[0] + w[1] - drift * 2.0).norm() < 1e-13, "{method:?}");
        let energy =
            |r: f64, w: [&meshes::Vec3; 2]| strength / r + 0.5 * mass * (w[0].norm_squared() + w[1].norm_squared());
        let before = energy(r0.norm(), [&grains.velocities()[0], &grains.velocities()[1]]);
        let after = energy((p[0] - p[1]).norm(), [&w[0], &w[1]]);
        assert!((after / before - 1.0).abs() < allowed, "{method:?}");
    }
}

#[test]
fn exact_opposite_charges_on_a_circle() {
    // Attraction: circular orbit of two grains, ten turns, back to the start.
    let (charge, mass, r) = (1e-14_f64, 1e-13_f64, 1e-3_f64);
    let omega = (field::constants::COULOMB * charge * charge / (0.5 * mass * r.powi(3))).sqrt();
    let grains = ensemble([
        grain(v(0.5 * r, 0.0, 0.0), v(0.0, 0.5 * r * omega, 0.0), charge, mass),
        grain(v(-0.5 * r, 0.0, 0.0), v(0.0, -0.5 * r * omega, 0.0), -charge, mass),
    ]);
    let traced = run(&System::new().with_coulomb(), &grains, &options(Method::Dop853, 20.0 * PI / omega));
    for k in 0..2 {
        // Ten turns at 1e-13 a step; the phase runs away with the energy, 60 radians of it.
        assert!((traced.ensemble.positions()[k] - grains.positions()[k]).norm() < 1e-9 * r);
    }
}

/// Drag by the square of the speed, F = -m v |v|: a force that depends on the velocity.
struct Quadratic;

impl tracer::Force for Quadratic {
    fn nature(&self) -> tracer::Nature {
        tracer::Nature { needs_velocity: true, ..tracer::Nature::default() }
    }

    fn add(&self, batch: &tracer::Batch, _: &mut tracer::Scratch, force: &mut [meshes::Vec3]) {
        for (i, f) in force.iter_mut().enumerate() {
            *f -= batch.velocity[i] * (batch.mass[i] * batch.velocity[i].norm());
        }
    }
}

#[test]
fn exact_force_that_depends_on_the_velocity() {
    // v = v0 / (1 + v0 t), x = ln(1 + v0 t).
    let system = System::new().with_force(Quadratic);
    let (r, u) = end(&system, v(0.0, 0.0, 0.0), v(0.0, 2.0, 0.0), &options(Method::Auto, 5.0));
    // Dozens of steps at 1e-13.
    assert!((r.y - 11.0_f64.ln()).abs() < 1e-11 && (u.y - 2.0 / 11.0).abs() < 1e-11);
    let grains = ensemble([grain(v(0.0, 0.0, 0.0), v(0.0, 2.0, 0.0), 1.0, 1.0)]);
    let refused = tracer::trace(&system, &grains, &options(Method::Verlet, 5.0), &tracer::Nothing).unwrap_err();
    assert_eq!(refused.to_string(), "verlet cannot be used: a force depends on the velocity; use dop853");
}
