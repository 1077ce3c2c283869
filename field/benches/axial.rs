//! Solutions of coaxial bodies, and points of their field a second: `cargo bench -p graintrap-field --bench axial`.
//!
//! Two rings of radius 1, 2 apart; points in the cube between them, one thread.

use divan::{Bencher, counter::ItemsCount};
use field::axial::{AxialBody, AxialProblem, AxialSolution, AxialSum, Axis};
use meshes::profile::revolved;
use meshes::{Shape, Vec3};

fn main() {
    divan::main();
}

fn solution(accuracy: f64) -> AxialSolution {
    let ring = Shape::Ring { radius: 1.0, wire_radius: 0.05 };
    let profile = revolved(&ring).expect("it is revolved").swap_remove(0).profile;
    let body = |electrode, height| AxialBody { profile: profile.clone(), electrode, height, flipped: false };
    let bodies = [body(0, -1.0), body(1, 1.0)];
    let problem = AxialProblem { bodies: &bodies, electrodes: 2, sources: &[], ground: None };
    problem.solve(accuracy).expect("two sound rings")
}

#[divan::bench(args = [1e-3, 1e-6, 1e-9])]
fn solve(bencher: Bencher, accuracy: f64) {
    bencher.bench(|| solution(accuracy));
}

#[divan::bench(args = [1e-3, 1e-9])]
fn rings_times_points(bencher: Bencher, accuracy: f64) {
    let solution = solution(accuracy);
    let sum = AxialSum::new(&solution, &[std::sync::Arc::from([1.0, 1.0].as_slice())], Axis::default());
    // The additive recurrence of the plastic number: even and without order.
    let step = [0.819_172_513_396_164_4, 0.671_043_606_703_789_2, 0.549_700_477_901_970_6];
    let points: Vec<Vec3> =
        (0..2000).map(|k| Vec3::from_fn(|i, _| 1.0 * ((k as f64 * step[i]).fract() - 0.5))).collect();
    bencher.counter(ItemsCount::new(points.len() * sum.rings())).bench(|| sum.sum(&points));
}
