//! Fields whose potential is a quadratic function of position: the ideal quadrupole, wells, uniform fields.

use meshes::Vec3;
use nalgebra::Matrix3;

use crate::{BasisField, Samples};

/// A quadratic potential at 1 V:
///
///   φ(r) = φ₀ + g·r + ½ r·H r
///
/// φ₀ a pure number, g in 1/m, H symmetric, in 1/m². Harmonic (a field in free space) where H has no trace; that is not
/// asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quadratic {
    /// φ₀.
    pub constant: f64,
    /// g, 1/m.
    pub gradient: Vec3,
    /// H, 1/m²; symmetric.
    pub hessian: Matrix3<f64>,
}

impl Quadratic {
    /// φ = (l_x x² + l_y y² + l_z z²) / (2 r0²), r0 in m: (1, -1, 0) for four rods, (1, 1, -2) for a ring and two caps.
    pub fn quadrupole(l: Vec3, r0: f64) -> Self {
        Self { constant: 0.0, gradient: Vec3::zeros(), hessian: Matrix3::from_diagonal(&(l / (r0 * r0))) }
    }

    /// A uniform field (1/m), its potential zero at the origin.
    pub fn uniform(field: Vec3) -> Self {
        Self { constant: 0.0, gradient: -field, hessian: Matrix3::zeros() }
    }

    /// The potential, a pure number, and its gradient, 1/m, at a point (m).
    pub fn potential_and_gradient(&self, point: &Vec3) -> (f64, Vec3) {
        let pull = self.hessian * point;
        (self.constant + (self.gradient + pull * 0.5).dot(point), self.gradient + pull)
    }

    /// Adds another, so many times.
    pub(crate) fn add(&mut self, other: &Self, factor: f64) {
        self.constant += other.constant * factor;
        self.gradient += other.gradient * factor;
        self.hessian += other.hessian * factor;
    }
}

impl Default for Quadratic {
    fn default() -> Self {
        Self { constant: 0.0, gradient: Vec3::zeros(), hessian: Matrix3::zeros() }
    }
}

/// A field of quadratic potentials, one for each channel. Integrators that know them fly grains without asking for the field
/// point by point.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct QuadraticField {
    /// The channels.
    pub channels: Vec<Quadratic>,
}

impl QuadraticField {
    /// A field of one channel, [`Quadratic::quadrupole`].
    pub fn quadrupole(l: Vec3, r0: f64) -> Self {
        Self { channels: vec![Quadratic::quadrupole(l, r0)] }
    }
}

impl BasisField for QuadraticField {
    fn channels(&self) -> usize {
        self.channels.len()
    }

    fn sample(&self, points: &[Vec3], samples: &mut Samples) {
        let n = self.channels.len();
        samples.reset(points.len(), n);
        for (p, point) in points.iter().enumerate() {
            for (c, channel) in self.channels.iter().enumerate() {
                (samples.potential[p * n + c], samples.gradient[p * n + c]) = channel.potential_and_gradient(point);
            }
        }
    }

    fn quadratics(&self) -> Option<Vec<Quadratic>> {
        Some(self.channels.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gradients_are_the_slopes_of_potentials() {
        let hessian = Matrix3::new(1.0, 0.5, -0.3, 0.5, 2.0, 0.7, -0.3, 0.7, -3.0);
        let mixed = Quadratic { constant: 0.4, gradient: Vec3::new(0.1, -0.2, 0.3), hessian };
        let point = Vec3::new(0.3, -0.5, 0.7);
        for form in [mixed, Quadratic::quadrupole(Vec3::new(1.0, 1.0, -2.0), 0.5), Quadratic::uniform(Vec3::y())] {
            let (_, gradient) = form.potential_and_gradient(&point);
            for k in 0..3 {
                let at = |s: f64| form.potential_and_gradient(&(point + Vec3::ith(k, s))).0;
                // Central differences are exact for a quadratic; rounding over the step.
                assert!((0.5 * (at(1.0) - at(-1.0)) - gradient[k]).abs() < 1e-14);
            }
        }
        let (value, slope) = Quadratic::quadrupole(Vec3::new(1.0, 1.0, -2.0), 0.5).potential_and_gradient(&point);
        assert!((value - (0.09 + 0.25 - 0.98) / 0.5).abs() < 1e-15);
        assert!((slope - Vec3::new(1.2, -2.0, -5.6)).norm() < 1e-15);
    }
}
