//! The way of one grain during one step.

use meshes::Vec3;
use serde::{Deserialize, Serialize};

/// Position and velocity during a step, as polynomials of the seventh degree.
///
/// The variable is θ, 0 at the start of the step and 1 at its end.
#[derive(Clone, Copy, Debug)]
pub struct Path {
    /// s.
    pub start: f64,
    /// s.
    pub step: f64,
    /// Coefficients of 1, θ, θ², ..., m.
    position: [Vec3; 8],
    /// Coefficients of 1, θ, θ², ..., m/s.
    velocity: [Vec3; 8],
}

/// Where a grain is, how fast, how accelerated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Motion {
    /// m.
    pub position: Vec3,
    /// m/s.
    pub velocity: Vec3,
    /// m/s².
    pub acceleration: Vec3,
}

impl Path {
    /// A path with the given polynomials.
    pub(crate) fn new(start: f64, step: f64, position: [Vec3; 8], velocity: [Vec3; 8]) -> Self {
        Self { start, step, position, velocity }
    }

    /// A straight line; the velocity changes linearly.
    pub fn chord(start: f64, step: f64, from: &Motion, to: &Motion) -> Self {
        let (mut position, mut velocity) = ([Vec3::zeros(); 8], [Vec3::zeros(); 8]);
        position[0] = from.position;
        position[1] = to.position - from.position;
        velocity[0] = from.velocity;
        velocity[1] = to.velocity - from.velocity;
        Self { start, step, position, velocity }
    }

    /// The cubic through both positions with both velocities; off by h⁴/384 times the fourth derivative.
    pub fn cubic(start: f64, step: f64, from: &Motion, to: &Motion) -> Self {
        let mut p = [Vec3::zeros(); 8];
        let (d, u, w) = (to.position - from.position, from.velocity * step, to.velocity * step);
        p[0] = from.position;
        p[1] = u;
        p[2] = d * 3.0 - u * 2.0 - w;
        p[3] = u + w - d * 2.0;
        Self { start, step, position: p, velocity: derivative(&p, step) }
    }

    /// The quintic through both positions with both velocities and accelerations; off by h⁶/46080 times the sixth
    /// derivative.
    pub fn quintic(start: f64, step: f64, from: &Motion, to: &Motion) -> Self {
        let mut p = [Vec3::zeros(); 8];
        let d = to.position - from.position;
        let (u, w) = (from.velocity * step, to.velocity * step);
        let (a, b) = (from.acceleration * (0.5 * step * step), to.acceleration * (0.5 * step * step));
        p[0] = from.position;
        p[1] = u;
        p[2] = a;
        p[3] = d * 10.0 - u * 6.0 - w * 4.0 - a * 3.0 + b;
        p[4] = d * -15.0 + u * 8.0 + w * 7.0 + a * 3.0 - b * 2.0;
        p[5] = d * 6.0 - (u + w) * 3.0 - a + b;
        Self { start, step, position: p, velocity: derivative(&p, step) }
    }

    /// Where the grain is at θ, m.
    pub fn position(&self, theta: f64) -> Vec3 {
        value(&self.position, theta)
    }

    /// How fast at θ, m/s.
    pub fn velocity(&self, theta: f64) -> Vec3 {
        value(&self.velocity, theta)
    }

    /// The time at θ, s.
    pub fn time(&self, theta: f64) -> f64 {
        self.start + theta * self.step
    }

    /// Upper bound of the length of the path, m.
    pub fn length(&self) -> f64 {
        self.position.iter().enumerate().map(|(k, c)| k as f64 * c.norm()).sum()
    }

    /// Upper bound of the distance between the path from θ to θ + `part` and its chord, m: |r''| part² / 8.
    pub fn sagitta(&self, part: f64) -> f64 {
        let bend: f64 = self.position.iter().enumerate().skip(2).map(|(k, c)| (k * (k - 1)) as f64 * c.norm()).sum();
        bend * part * part / 8.0
    }
}

fn value(coefficients: &[Vec3; 8], theta: f64) -> Vec3 {
    coefficients.iter().rev().fold(Vec3::zeros(), |sum, c| sum * theta + c)
}

fn derivative(p: &[Vec3; 8], step: f64) -> [Vec3; 8] {
    let mut d = [Vec3::zeros(); 8];
    for k in 1..8 {
        d[k - 1] = p[k] * (k as f64 / step);
    }
    d
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A polynomial of degree `n` and its derivatives at `t`.
    fn motion(n: i32, t: f64) -> Motion {
        let c = |k: i32| Vec3::new(1.0, -0.5 * f64::from(k), 0.3 * f64::from(k * k));
        let mut m = Motion::default();
        for k in 0..=n {
            let x = f64::from(k);
            m.position += c(k) * t.powi(k);
            m.velocity += c(k) * x * t.powi(k - 1);
            m.acceleration += c(k) * x * (x - 1.0) * t.powi(k - 2);
        }
        m
    }

    #[test]
    fn cubic_and_quintic_reproduce_polynomials_of_their_degree() {
        let (start, step) = (0.7, 0.6);
        for (degree, path) in [
            (3, Path::cubic(start, step, &motion(3, 0.7), &motion(3, 1.3))),
            (5, Path::quintic(start, step, &motion(5, 0.7), &motion(5, 1.3))),
        ] {
            for theta in [0.0, 0.3, 0.8, 1.0] {
                let exact = motion(degree, path.time(theta));
                // Rounding of a few dozen operations on numbers of size 30.
                assert!((path.position(theta) - exact.position).norm() < 1e-12);
                assert!((path.velocity(theta) - exact.velocity).norm() < 1e-11);
                let chord = path.position(0.0) * (1.0 - theta) + path.position(1.0) * theta;
                assert!((path.position(theta) - chord).norm() <= path.sagitta(1.0) + 1e-13);
            }
        }
    }
}
