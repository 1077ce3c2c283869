//! Results do not depend on the number of threads.

use field::{BasisField, BoundaryProblem, Samples};
use graintrap_tests::{at, several};
use meshes::{Shape, Vec3};

#[test]
fn law_same_bits_with_any_number_of_threads() {
    let mesh = several(&[
        (Shape::Ring { radius: 1.0, wire_radius: 0.1 }, at(Vec3::zeros()), 1100),
        (Shape::Disc { radius: 0.8, hole_radius: 0.0, thickness: 0.0 }, at(Vec3::z()), 700),
    ]);
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let basis = BoundaryProblem::new(&mesh).solve().unwrap();
            let mut samples = Samples::default();
            basis.panel_sum().sample(&[Vec3::new(0.1, 0.2, 0.3)], &mut samples);
            (basis.charge, basis.capacitance, samples)
        })
    };
    let one = run(1);
    for threads in [2, 3, 4] {
        let other = run(threads);
        assert!(one.0 == other.0, "charges with {threads} threads");
        assert_eq!((&one.1, &one.2), (&other.1, &other.2), "{threads} threads");
    }
}
