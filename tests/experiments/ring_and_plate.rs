//! One ring over one plate: a null that does not hold, and no null at all.

use meshes::Vec3;
use tracer::Outcome;

use crate::flown::{curvature, flown};

#[test]
fn experiment_ring_and_plate_with_a_null() {
    let run = flown("ring_and_plate", &["field.accuracy=1e-5"]);
    let null = Vec3::x() * 0.25;
    let bend = [0, 1, 2].map(|k| curvature(&run, null, k, 0.01).1);
    let field = run.fields(&[null]).1[0];
    // Two fields of 130 V/m cancel; the voltage is given in five digits.
    println!(
        "field left {:.1e} V/m, null off by {:.1e} m; curvatures {bend:.3?}",
        field.norm(),
        field.norm() / bend[0]
    );
    assert!(field.norm() / bend[0] < 1e-4);
    // The curvatures' sum is the measure of error; one is positive and holds, two are not.
    assert!(bend.iter().sum::<f64>().abs() < 1e-3 * bend[0], "{bend:?}");
    assert!(bend[0] > 0.0 && bend[1] < 0.0 && bend[2] < 0.0);
    // A2 = 0.394 /m² per volt of the ring.
    assert!((bend[0] / (2.0 * 0.394 * 100.0) - 1.0).abs() < 2e-3, "{bend:?}");
    // It escapes along y, where it starts a millimetre off, with the rate sqrt(-φ_yy Q/m): cosh.
    let rate = (-bend[1]).sqrt();
    let sample = run.track(0).iter().find(|s| s.position.y > 0.02).unwrap();
    let expected = (sample.position.y / 1e-3).acosh() / rate;
    println!("rate {rate:.4} /s; 2 cm off after {:.4} s, cosh says {expected:.4} s", sample.time);
    assert!((sample.time / expected - 1.0).abs() < 0.02);
    assert!(matches!(run.outcome(0), Outcome::LeftRegion { .. }));
    let last = run.track(0).last().unwrap().position;
    assert!(last.y.abs() > 10.0 * (last.x - 0.25).abs() || last.y.abs() > 1.0, "{last}");
}

#[test]
fn experiment_ring_and_plate_without_a_null() {
    let run = flown("ring_and_plate_no_null", &[]);
    // All along the axis the field points one way, from the plate on to beyond the ring.
    let points: Vec<Vec3> = (1..100).map(|k| Vec3::x() * (0.01 * f64::from(k))).collect();
    let fields = run.fields(&points).1;
    let weakest = fields.iter().map(|g| -g.x).fold(f64::INFINITY, f64::min);
    println!("weakest field on the axis {weakest:.1} V/m");
    assert!(weakest > 0.0);
    // And the grain goes along it, never back.
    let track = run.track(0);
    assert!(track.windows(2).all(|s| s[1].position.x > s[0].position.x));
    assert!(matches!(run.outcome(0), Outcome::LeftRegion { .. }));
}
