//! Coulomb crystals: places and modes against the reference, and grains that find them.

use std::f64::consts::TAU;

use graintrap_tests::{numbers, reference};
use meshes::Vec3;
use tracer::crystal::{Crystal, length};

use crate::flown::{beta, flown};

#[test]
fn exact_chains() {
    for case in reference("crystals.json").iter().filter(|c| c.id.starts_with("chain.")) {
        let n = case.input("N") as usize;
        // Just beyond the zig-zag limit, so that transverse modes are soft.
        let limit = case.output("min_radial_ratio_squared_for_linear_chain");
        let across = 1.01 * limit;
        let start: Vec<Vec3> =
            (0..n).map(|k| Vec3::new(0.0, 0.01 * (k as f64).sin(), 2.0 * k as f64 - (n - 1) as f64)).collect();
        let crystal = Crystal::from(start, Vec3::new(across, across, 1.0)).unwrap();
        let mut places: Vec<f64> = crystal.positions.iter().map(|r| r.z).collect();
        places.sort_by(f64::total_cmp);
        // 1e-11 of force over curvatures of order one, over 0.01 for the softest.
        for (place, exact) in places.iter().zip(numbers(&case.outputs["positions"])) {
            assert!((place - exact).abs() < 1e-9, "{}: {place} {exact}", case.id);
        }
        // Every axial mode is among them, and (w_t/w)² = (w_r/w)² - (μ - 1)/2 twice.
        let mu = numbers(&case.outputs["axial_eigenvalues_mu"]);
        let mut expected: Vec<f64> =
            mu.iter().flat_map(|m| [*m, across - 0.5 * (m - 1.0), across - 0.5 * (m - 1.0)]).collect();
        expected.sort_by(f64::total_cmp);
        for (mode, square) in crystal.modes.iter().zip(expected) {
            assert!((mode * mode - square).abs() < 1e-8, "{}: {mode} {square}", case.id);
        }
        // Below the limit it buckles.
        let bent = Crystal::of(n, Vec3::new(0.97 * limit, 0.99 * limit, 1.0)).unwrap();
        assert!(bent.positions.iter().map(|r| r.x.abs()).fold(0.0, f64::max) > 0.01, "{}", case.id);
    }
}

#[test]
fn exact_planar_rings() {
    for case in reference("crystals.json").iter().filter(|c| c.id.starts_with("planar_ring.")) {
        let n = case.input("N") as usize;
        let crystal = Crystal::of(n, Vec3::new(1.0, 1.0, 20.0)).unwrap();
        for r in &crystal.positions {
            assert!((r.norm() - case.output("radius")).abs() < 1e-9 && r.z.abs() < 1e-9, "{}: {r}", case.id);
        }
    }
    for case in reference("crystals.json").iter().filter(|c| c.id.starts_with("scale.")) {
        let l = length(case.input("Q"), case.input("m"), case.input("omega"));
        assert!((l / case.output("length_l") - 1.0).abs() < 1e-9, "{}", case.id);
    }
}

/// Grains that calm down in the linear trap stand where James (1998) says: the axis has no micromotion.
#[test]
fn experiment_crystal_chain() {
    // Along the axis the source's potential is U x²/r0², hence w² = 2 (Q/m) U/r0².
    let omega = (2.0 * 1e-2 * 0.05 / 1e-4_f64).sqrt();
    for n in [2, 5] {
        let case = reference("crystals.json").into_iter().find(|c| c.id == format!("chain.N={n}")).unwrap();
        let run = flown("crystal_chain", &[&format!("grains.1.count={n}")]);
        assert!(run.all_stay());
        let l = length(1e-15, 1e-13, omega);
        let mut places: Vec<f64> = run.ends().iter().map(|r| r.x / l).collect();
        places.sort_by(f64::total_cmp);
        println!("N = {n}: l = {:.4} mm, places {places:.6?}", l * 1e3);
        // What is left of the motion after 8 s at 2 /s is e^-16 = 1e-7 of some two l.
        for (place, exact) in places.iter().zip(numbers(&case.outputs["positions"])) {
            assert!((place - exact).abs() < 1e-5, "{place} {exact}");
        }
        assert!(run.ends().iter().all(|r| r.yz().norm() < 1e-5 * l));
    }
}

/// Two grains without drag: the centre swings at w, the distance at √3 w.
#[test]
fn experiment_crystal_modes() {
    let (omega, l) = ((2.0 * 1e-2 * 0.05 / 1e-4_f64).sqrt(), length(1e-15, 1e-13, 10.0_f64.sqrt()));
    let (x, shift, stretch) = (0.629_960_525 * l, 0.01 * l, 0.006 * l);
    let place = format!(
        "grains.1.place={{kind=\"points\", points=[[{}, 0, 0], [{}, 0, 0]]}}",
        x + stretch + shift,
        -x - stretch + shift
    );
    let run = flown(
        "crystal_chain",
        &["grains.1.count=2", &place, "forces.drag=\"0 /s\"", "trace.duration=\"60 s\"", "output.every=\"20 ms\""],
    );
    let lines = run.lines(0, 0, 0.0);
    println!("{lines:.5?}");
    let at = |f: f64| lines.iter().take(2).any(|line| (line.frequency / f - 1.0).abs() < 1e-3);
    // 60 s are thirty swings; breathing by 1 % shifts it by 1e-4.
    assert!(at(omega / TAU) && at(3.0_f64.sqrt() * omega / TAU), "{lines:?}");
}

/// Ten grains in a trap whose three secular frequencies are equal: the crystal of the isotropic well, but for what micromotion and
/// the frequencies' remaining difference do.
#[test]
fn experiment_crystal_ball() {
    let run = flown("crystal_ball", &[]);
    assert!(run.all_stay());
    let rf = TAU * 100.0;
    let unit = 1e-2 / (1e-4 * rf * rf);
    let (a_z, q_z) = (-8.0 * unit * 4.935, 4.0 * unit * 197.4);
    let [slow_z, slow_r] = [(a_z, q_z), (-0.5 * a_z, 0.5 * q_z)].map(|(a, q)| beta(a, q).unwrap() * rf / 2.0);
    println!("secular: along z {slow_z:.3}, across {slow_r:.3} rad/s");
    let l = length(1e-15, 1e-13, slow_r);
    let sorted = |mut radii: Vec<f64>| {
        radii.sort_by(f64::total_cmp);
        radii
    };
    // Places averaged over the last ten periods.
    let middle = |g: usize| {
        let late = &run.track(g)[run.track(g).len() - 100..];
        late.iter().map(|s| s.position).sum::<Vec3>() / 100.0
    };
    let places: Vec<Vec3> = (0..10).map(|g| middle(g) / l).collect();
    let stiffness = Vec3::new(1.0, 1.0, (slow_z / slow_r).powi(2));
    // Where they rest is the place of rest downhill from where they are, not always the lowest of all.
    let crystal = Crystal::from(places.clone(), stiffness).unwrap();
    let lowest = Crystal::of(10, stiffness).unwrap();
    println!("energy {:.4}, from an even spread {:.4} k Q²/l", crystal.energy, lowest.energy);
    let found = sorted(places.iter().map(|r| r.norm()).collect());
    let exact = sorted(crystal.positions.iter().map(|r| r.norm()).collect());
    println!("found {found:.4?}\nexact {exact:.4?}");
    // Micromotion is q/2 = 10 % of the distance, and moves mean places by its square.
    for (found, exact) in found.iter().zip(&exact) {
        assert!((found - exact).abs() < 0.02, "{found} {exact}");
    }
}
