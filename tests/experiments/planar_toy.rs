//! The planar toy: a trap only for who looks at the plane.

use field::constants::COULOMB;
use meshes::Vec3;
use tracer::Outcome;

use crate::flown::{curvature, flown};

#[test]
fn experiment_planar_toy() {
    let run = flown("planar_toy", &[]);
    // 1. The null on the axis: E1 = 2 k q d/(d² + R²)^(3/2) with R = d = 1 m, in the window R/√2 < d < √2 R.
    let (_, dc) = run.fields(&[Vec3::zeros()]);
    let balance = 2.0 * COULOMB * 1e-10 / 2.0_f64.powf(1.5);
    println!("the charges' field {balance:.5} V/m; left at the null {:.1e}", dc[0].norm());
    assert!(dc[0].norm() < 1e-3 * balance);
    // 2. Curvatures of the static potential: up in the plane, down across it, none in all (Laplace).
    let bend = [0, 1, 2].map(|k| curvature(&run, Vec3::zeros(), k, 0.02).1);
    println!("curvatures {bend:.4?} V/m², sum {:.1e}", bend.iter().sum::<f64>());
    assert!(bend[0] > 0.0 && bend[1] > 0.0 && bend[2] < 0.0);
    assert!(bend.iter().sum::<f64>().abs() < 1e-6 * bend[2].abs());
    // 3. Of φ = k q/r each: planar curvatures 2 k q (2d² - R²)/s⁵ along x, 2 k q (2R² - d²)/s⁵ along y, 2 k q (-1)/s³ across.
    let exact = [1.0, 1.0, -2.0].map(|c| 2.0 * COULOMB * 1e-10 * c / 2.0_f64.powf(2.5));
    assert!(bend.iter().zip(exact).all(|(b, e)| (b / e - 1.0).abs() < 1e-5), "{exact:?}");
    // 4. In the plane it stays, a millimetre beside it is lost.
    let farthest = run.track(0).iter().map(|s| s.position.norm()).fold(0.0, f64::max);
    println!("in the plane no farther than {farthest:.3} m; beside it {:?}", run.flights.traced.endings[1]);
    assert_eq!(*run.outcome(0), Outcome::TimeUp);
    assert!(farthest < 0.15);
    assert!(matches!(run.outcome(1), Outcome::LeftRegion { .. }));
    // As cosh(κ t) with κ² = (Q/m)·|φ_zz|, while it is near: to 5 cm from 1 mm.
    let track = run.track(1);
    let escaped = track.iter().find(|s| s.position.z.abs() > 0.05).unwrap().time;
    let expected = 50.0_f64.acosh() / (-bend[2]).sqrt();
    println!("50 times as far after {escaped:.3} s, at the null's own rate {expected:.3} s");
    // It swings through places where the curvature differs by the square of 0.05 m.
    assert!((escaped / expected - 1.0).abs() < 0.05);
    // 5. RF that is uniform has no gradient: it only shakes, by Q E/(m Ω²) = 3.2 mm along y.
    let shaken = run.lines(0, 1, 0.0).into_iter().find(|l| (l.frequency - 2.0).abs() < 0.01).unwrap();
    assert!((shaken.amplitude / (0.5 / (4.0 * std::f64::consts::PI).powi(2)) - 1.0).abs() < 0.02, "{shaken:?}");
    // 6. Outside of the window not even the plane holds: d = 1.6 R (farther than √2) with the plate's field for it.
    let far = [
        "source.upper.center=[1.6, 1, 0]",
        "source.lower.center=[1.6, -1, 0]",
        &format!("source.plate.dc={}", 2.0 * COULOMB * 1e-10 * 1.6 / (1.6_f64 * 1.6 + 1.0).powf(1.5)),
    ];
    let lost = flown("planar_toy", &far);
    assert!(matches!(lost.outcome(0), Outcome::LeftRegion { .. }), "{:?}", lost.outcome(0));
}
