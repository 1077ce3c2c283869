//! A ring between two plates or two hemispheres: grains that gather in an annulus, and the same electrodes as a trap for a cloud.

use std::f64::consts::{PI, TAU};

use field::constants::COULOMB;
use meshes::Vec3;

use crate::flown::{Flown, curvature, flown};

/// Ω, rad/s.
const OMEGA: f64 = TAU * 2.0;

/// Where the mean forces on one of N grains spread evenly on a circle in the plane x = 0 balance, per mass with Q/m = 1 C/kg:
///
///   E_dc(ρ) - V²/(4 Ω²) d(E_rf²)/dρ + k Q/(4 ρ²) Σ_{k<N} 1/sin(πk/N) = 0
///
/// (pseudopotential: Dehmelt 1967), outward at smaller radii, inward at larger ones. From the exact field, by bisection.
fn predicted(run: &Flown) -> f64 {
    let (grains, charge) = (run.flights.samples.len(), run.case.grains[0].charge);
    let volts =
        run.driven.field.waveforms().iter().find(|w| !w.is_constant()).map(|w| w.value(0.0) - w.constant).unwrap();
    let spread: f64 = (1..grains).map(|k| 1.0 / (PI * k as f64 / grains as f64).sin()).sum();
    let h = 1e-3;
    let force = |rho: f64| {
        let (rf, dc) = run.fields(&[Vec3::y() * rho, Vec3::y() * (rho + h), Vec3::y() * (rho - h)]);
        let slope = (rf[1].norm_squared() - rf[2].norm_squared()) / (2.0 * h);
        -dc[0].y - (volts / OMEGA).powi(2) / 4.0 * slope + COULOMB * charge * spread / (4.0 * rho * rho)
    };
    let (mut low, mut high) = (0.2, 0.8);
    assert!(force(low) > 0.0 && force(high) < 0.0);
    while high - low > 1e-6 {
        let middle = 0.5 * (low + high);
        if force(middle) > 0.0 { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// Where grains fly: a table without the wire is filled in a fifth of the time.
const INSIDE: [&str; 2] = ["table.min=[-0.3, -0.7, -0.7]", "table.max=[0.3, 0.7, 0.7]"];

fn annulus(name: &str, sets: &[&str]) {
    let run = flown(name, &[&INSIDE[..], sets].concat());
    assert!(run.all_stay(), "{name}");
    // 1. The mechanism: at the centre the static field holds along x and repels across more than the RF holds.
    let (rf_x, dc_x) = curvature(&run, Vec3::zeros(), 0, 0.02);
    let volts = run.driven.field.waveforms()[0].value(0.0) - run.driven.field.waveforms()[0].constant;
    let (a_x, q_x) = (4.0 * dc_x / OMEGA.powi(2), 2.0 * volts * rf_x / OMEGA.powi(2));
    println!("{name}: a_x = {a_x:.4}, a_r = {:.4}, q_r²/2 = {:.4}", -0.5 * a_x, q_x * q_x / 8.0);
    assert!(a_x > 0.0 && -0.5 * a_x < -q_x * q_x / 8.0);
    // 2. The last third, whole periods of it.
    let expected = predicted(&run);
    let radii: Vec<(usize, f64)> = run.late(1.0 / 3.0).map(|(g, s)| (g, s.position.yz().norm())).collect();
    let mean = radii.iter().map(|(_, r)| r).sum::<f64>() / radii.len() as f64;
    let off_plane = run.late(1.0 / 3.0).map(|(_, s)| s.position.x.abs()).fold(0.0, f64::max);
    let grains = run.flights.samples.len();
    let own = |g: usize| {
        let of: Vec<f64> = radii.iter().filter(|(k, _)| *k == g).map(|(_, r)| *r).collect();
        of.iter().sum::<f64>() / of.len() as f64
    };
    let means: Vec<f64> = (0..grains).map(own).collect();
    let spread = means.iter().map(|r| (r / mean - 1.0).abs()).fold(0.0, f64::max);
    println!(
        "  radius {mean:.4} m, predicted {expected:.4} ({:+.2} %), |x| {off_plane:.1e} m, spread {spread:.1e}",
        100.0 * (mean / expected - 1.0)
    );
    assert!((mean / expected - 1.0).abs() < 0.02, "{mean} {expected}");
    assert!(off_plane < 0.01 * mean && spread < 0.1, "{off_plane} {spread}");
    // 3. The limit cycle: at the RF's period, with the amplitude V E/Ω² of forced motion (in the tenth of a period's field).
    let radial: Vec<f64> =
        run.track(0).iter().filter(|s| s.time > 40.0 - 1e-9).map(|s| s.position.yz().norm()).collect();
    let line = tracer::spectrum::spectrum(&radial, run.flights.every).lines(1, 0.1)[0];
    let forced = volts * run.fields(&[Vec3::y() * mean]).0[0].y.abs() / OMEGA.powi(2);
    println!(
        "  breathes at {:.5} Hz by {:.2} mm, forced motion {:.2} mm",
        line.frequency,
        line.amplitude * 1e3,
        forced * 1e3
    );
    assert!((line.frequency - 2.0).abs() < 1e-3, "{line:?}");
    // The next order is the field's slope times the motion, η = 2 V E'/Ω² of about a quarter, squared.
    assert!((line.amplitude / forced - 1.0).abs() < 0.1, "{line:?} {forced}");
    // 4. And they spread: neighbours on the circle are no nearer than half of what an even spread gives.
    let mut angles: Vec<f64> = run.ends().iter().map(|r| r.z.atan2(r.y)).collect();
    angles.sort_by(f64::total_cmp);
    let gaps: Vec<f64> = (0..grains).map(|k| (angles[(k + 1) % grains] - angles[k]).rem_euclid(TAU)).collect();
    let narrowest = gaps.iter().copied().fold(f64::INFINITY, f64::min) / (TAU / grains as f64);
    println!("  narrowest gap {narrowest:.2} of an even one");
    assert!(narrowest > 0.5, "{gaps:?}");
}

#[test]
fn experiment_annulus_between_plates() {
    annulus("annulus_plates", &[]);
    annulus("annulus_plates", &["grains.1.count=15", "drive.main.amplitude=\"11 V\""]);
}

#[test]
fn experiment_annulus_between_hemispheres() {
    annulus("annulus_end_caps", &[]);
    annulus("annulus_end_caps", &["grains.1.count=3", "electrode.ring.dc=\"-0.6 V\""]);
}

#[test]
fn experiment_cloud_between_plates() {
    // With drag: a small cloud at the centre. A cold uniform ball in wells w_x, w_r of the RF would have the volume
    // 4π/3 N k Q²/(m w²) with w² the mean of w_x², w_r², w_r²: its radius tells how large the cloud may be.
    let run = flown("cloud_plates", &INSIDE);
    assert!(run.all_stay());
    let (rf, _) = curvature(&run, Vec3::zeros(), 0, 0.02);
    let q = 2.0 * 22.0 * rf.abs() / OMEGA.powi(2);
    let w2 = (q * OMEGA).powi(2) / 8.0 * (1.0 + 0.5) / 3.0;
    let radius = (15.0 * COULOMB * run.case.grains[0].charge / w2).cbrt();
    let farthest = run.ends().iter().map(|r| r.norm()).fold(0.0, f64::max);
    println!("q_x = {q:.3}; cloud of {farthest:.4} m, uniform ball {radius:.4} m");
    // An oblate cloud is wider than the ball by some (w_x/w_r)^(2/3) = 1.6 at most, and micromotion adds a tenth.
    assert!(farthest < 1.8 * radius && farthest > 0.5 * radius);
    // Without drag: bounded by what they start with, 0.2 m, times what micromotion and exchange between directions can do.
    let free = flown("cloud_plates", &[&INSIDE[..], &["forces.drag=\"0 /s\""]].concat());
    assert!(free.all_stay());
    let farthest = free.late(1.0).map(|(_, s)| s.position.norm()).fold(0.0, f64::max);
    println!("without drag no farther than {farthest:.3} m");
    assert!(farthest > 0.15 && farthest < 0.6);
}
