//! The modes of linear motion from its matrix.

use std::f64::consts::{PI, TAU};

use meshes::Vec3;
use nalgebra::{Complex, Matrix6, Vector6};

type C = Complex<f64>;

/// One mode of the motion about an equilibrium: e^(-rate t) cos(2π frequency t).
#[derive(Clone, Copy, Debug)]
pub struct Mode {
    /// Hz; zero for motion that creeps or runs away without a swing.
    pub frequency: f64,
    /// Estimated error of the frequency, Hz.
    pub frequency_error: f64,
    /// How fast it dies away, 1/s, the slower one of two; negative where it grows.
    pub rate: f64,
    /// Direction in which it swings most, of length one.
    pub axis: Vec3,
    /// Swing across that direction against that along it: 0 on a line, 1 on a circle.
    pub roundness: f64,
    /// Rates slower than this are rounding, 1/s.
    pub rounding: f64,
}

impl Mode {
    /// Whether the motion stays bounded.
    pub fn is_held(&self) -> bool {
        self.rate >= -self.rounding
    }
}

/// An eigenvalue as growth and turning per second, with the direction in space of its vector.
struct Turn {
    growth: f64,
    angular: f64,
    vector: [C; 3],
}

/// Modes of the map over a period, frequencies below half of the period's. `rougher`: the same map with a larger error, from which
/// the error of the frequencies is estimated.
pub(super) fn of_period(map: &Matrix6<f64>, rougher: &Matrix6<f64>, period: f64) -> Vec<Mode> {
    let turn = |z: C| (z.norm().ln() / period, z.arg() / period);
    let rounding = (1e-9 + (map - rougher).norm()) / period;
    let mut all = modes(map, turn, rounding);
    let other = modes(rougher, turn, rounding);
    for mode in &mut all {
        let nearest = other.iter().map(|m| (m.frequency - mode.frequency).abs()).fold(f64::INFINITY, f64::min);
        mode.frequency_error = nearest + 1e-12 / period;
    }
    all
}

/// Modes of x' = G x.
pub(super) fn of_generator(generator: &Matrix6<f64>) -> Vec<Mode> {
    let largest = generator.complex_eigenvalues().iter().map(|z| z.norm()).fold(0.0, f64::max);
    let mut all = modes(generator, |z| (z.re, z.im), 1e-11 * largest);
    all.iter_mut().for_each(|mode| mode.frequency_error = 1e-12 * largest / TAU);
    all
}

/// The modes of a matrix whose eigenvalues mean (growth, angular frequency) by `turn`.
pub fn modes(matrix: &Matrix6<f64>, turn: impl Fn(C) -> (f64, f64), rounding: f64) -> Vec<Mode> {
    let values = matrix.complex_eigenvalues();
    let turns: Vec<Turn> = values
        .iter()
        .map(|value| {
            let (growth, angular) = turn(*value);
            let vector = eigenvector(matrix, *value);
            Turn { growth, angular, vector: [vector[0], vector[1], vector[2]] }
        })
        .collect();
    // Rounding of a double root is the square root of that of the matrix.
    let still =
        |t: &Turn| t.angular.abs() < 1e-7 * (turns.iter().map(|t| t.angular.abs()).fold(0.0, f64::max) + rounding);
    let mut all = Vec::new();
    let mut real: Vec<&Turn> = Vec::new();
    for t in &turns {
        if still(t) || is_half(t, &turns) {
            real.push(t);
        } else if t.angular > 0.0 {
            all.push(mode(t, t.angular, -t.growth, rounding));
        }
    }
    // Two of the others make a mode. With forces from a potential, a magnetic field and an even drag γ the motion is conformally
    // symplectic (McLachlan and Perlmutter 2001): growths come in pairs whose sum is -γ, the largest with the smallest.
    real.sort_by(|a, b| b.growth.total_cmp(&a.growth));
    while !real.is_empty() {
        let first = real.remove(0);
        real.pop();
        let angular = if still(first) { 0.0 } else { first.angular.abs() };
        all.push(mode(first, angular, -first.growth, rounding));
    }
    all.sort_by(|a, b| a.frequency.total_cmp(&b.frequency));
    all
}

/// Whether a turn is half a turn a period: the conjugate of a real negative multiplier is itself.
fn is_half(t: &Turn, all: &[Turn]) -> bool {
    t.angular > 0.0 && !all.iter().any(|other| (other.angular + t.angular).abs() < 1e-6 * t.angular)
}

fn mode(turn: &Turn, angular: f64, rate: f64, rounding: f64) -> Mode {
    let (axis, roundness) = swing(&turn.vector);
    Mode { frequency: angular / TAU, frequency_error: 0.0, rate, axis, roundness, rounding }
}

/// The largest axis of the ellipse Re(e^{iα} v), and the other one against it.
fn swing(vector: &[C; 3]) -> (Vec3, f64) {
    let square: C = vector.iter().map(|v| v * v).sum();
    // Turned by half its phase, real and imaginary part are the axes.
    let turn = C::from_polar(1.0, -0.5 * square.arg());
    let part = |pick: fn(C) -> f64| Vec3::from_fn(|k, _| pick(vector[k] * turn));
    let (a, b) = (part(|z| z.re), part(|z| z.im));
    let (long, short) = if a.norm() >= b.norm() { (a, b) } else { (b, a) };
    let axis = long.try_normalize(0.0).unwrap_or_else(Vec3::zeros);
    let axis = if axis[axis.iamax()] < 0.0 { -axis } else { axis };
    (axis, short.norm() / long.norm().max(f64::MIN_POSITIVE))
}

/// By inverse iteration.
fn eigenvector(matrix: &Matrix6<f64>, value: C) -> Vector6<C> {
    let shift = value * (1.0 + 1e-10) + C::new(1e-14, 0.0) * matrix.norm();
    let shifted = matrix.map(|x| C::new(x, 0.0)) - Matrix6::identity() * shift;
    let lu = shifted.lu();
    // No direction that a mode could be orthogonal to by symmetry.
    let mut vector = Vector6::from_fn(|k, _| C::from_polar(1.0, PI * (0.3 + 0.7 * (k * k) as f64)));
    for _ in 0..3 {
        let Some(next) = lu.solve(&vector) else { break };
        let norm = next.norm();
        if !norm.is_finite() || norm == 0.0 {
            break;
        }
        vector = next / C::new(norm, 0.0);
    }
    vector
}
