//! A grain's position in a tabulated RF field, over the time step.

use std::sync::Arc;

use field::{DrivenField, Waveform, WaveformPart};
use graintrap_tests::{TwoRings, list, slopes};
use meshes::Vec3;
use tracer::{Ensemble, Grain, Method, Nothing, Options, System, trace};

#[test]
fn order_of_steps_in_a_tabulated_rf_field() {
    let rings = TwoRings::tabulated(24);
    let basis = Arc::new(rings.field(&[vec![1.0, 1.0]]));
    let rf = WaveformPart::Sine { amplitude: 30.0, frequency: 1.0, phase: 0.4 };
    let system = System::new().with_field(DrivenField::new(basis, vec![Waveform { constant: 0.5, parts: vec![rf] }]));
    let mut start = Ensemble::new();
    let (position, velocity) = (Vec3::new(0.15, 0.2, -0.1), Vec3::new(0.1, -0.15, 0.15));
    start.push(Grain { position, velocity, charge: 1.0, mass: 1.0, radius: 0.0, id: 1, group: 0 }).unwrap();
    let after = |duration: f64, options: Options| {
        let options = Options { duration, estimate_error: false, ..options };
        trace(&system, &start, &options, &Nothing).unwrap().ensemble.positions()[0]
    };
    let end = |options: Options| after(6.0, options);
    let exact = end(Options { tolerance: 1e-14, max_step: Some(5e-3), ..Options::default() });
    assert!((exact - position).norm() > 0.5, "it has crossed many cells");
    // Where it would leave the table for the exact sum, a step of 1e-9 V would show in the errors of order six.
    for k in 1..=60 {
        let place = after(0.1 * k as f64, Options::default());
        assert!(place.amax() < rings.half, "it stays in the table: {place}");
    }
    for (method, counts) in [
        (Method::Verlet, [300.0, 600.0, 1200.0]),
        (Method::Boris, [300.0, 600.0, 1200.0]),
        (Method::BlanesMoan4, [120.0, 240.0, 480.0]),
        (Method::BlanesMoan6, [40.0, 80.0, 160.0]),
    ] {
        let steps = counts.map(|n| 6.0 / n);
        let errors = steps.map(|h| (end(Options { method, step: Some(h), ..Options::default() }) - exact).norm());
        let orders = slopes(&steps, &errors);
        println!("{method:?}: errors {}, orders {orders:.2?}", list(&errors));
        // The finest slope to a quarter: the next term of a symmetric method is h² smaller, and where a grain enters a cell
        // the second derivative of the field jumps by the error of the table, too little to show at these errors.
        let order = f64::from(method.order());
        assert!((orders[1] - order).abs() < 0.25, "{method:?}: slope {}", orders[1]);
    }
}
