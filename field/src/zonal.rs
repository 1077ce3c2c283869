//! Multipoles about a point that are round about an axis: the numbers A_l of a trap.
//!
//!   φ(r) = Σ_l A_l r^l P_l(cos θ) + terms that vary round the axis

use std::f64::consts::TAU;

use meshes::Vec3;

use crate::gauss::gauss;
use crate::{BasisField, Samples};

/// Points of the rule in cos θ, and round the axis. On a sphere of half the distance to the next conductor harmonics of degree
/// l have fallen to 2^-l; the first that the rule takes for another one is of degree 32 - l.
const RULE: usize = 16;
const ROUND: usize = 2 * RULE;

/// The highest degree that is told.
pub const HIGHEST: usize = 8;

/// Coefficients of each channel of a field.
#[derive(Clone, Debug, PartialEq)]
pub struct Zonal {
    /// A_0 to A_[`HIGHEST`] of each channel at 1 V, 1/m^l.
    pub coefficients: Vec<[f64; HIGHEST + 1]>,
    /// The strongest gradient of each channel on the sphere, 1/m.
    pub strongest: Vec<f64>,
}

/// The coefficients A_l of a field about a point:
///
///   A_l = (2l + 1)/(4π r^l) ∮ φ P_l(cos θ) dΩ
///
/// over the sphere of radius r (m) about `center`, θ from `axis` (of unit length). There must be no charge within the sphere.
///
/// Source: orthogonality of Legendre polynomials (Jackson 1999, section 3.3). Checked by `coefficients_of_a_point_charge` and, for a
/// whole trap, by `cli_study_tells_the_multipoles_of_a_quadrupole`.
pub fn zonal(field: &dyn BasisField, center: &Vec3, axis: &Vec3, radius: f64) -> Zonal {
    let rule = gauss(RULE);
    let across = axis.cross(&Vec3::ith(axis.iamin(), 1.0)).normalize();
    let along = axis.cross(&across);
    let mut points = Vec::with_capacity(RULE * ROUND);
    for x in &rule.points {
        let cos = 2.0 * x - 1.0;
        let sin = (1.0 - cos * cos).sqrt();
        for k in 0..ROUND {
            let (s, c) = (TAU * k as f64 / ROUND as f64).sin_cos();
            points.push(center + (axis * cos + (across * c + along * s) * sin) * radius);
        }
    }
    let mut samples = Samples::default();
    field.sample(&points, &mut samples);
    let channels = field.channels();
    let mut zonal = Zonal { coefficients: vec![[0.0; HIGHEST + 1]; channels], strongest: vec![0.0; channels] };
    for (p, (potential, gradient)) in
        samples.potential.chunks(channels).zip(samples.gradient.chunks(channels)).enumerate()
    {
        let (x, weight) = (2.0 * rule.points[p / ROUND] - 1.0, rule.weights[p / ROUND] / ROUND as f64);
        let legendre = legendre(x);
        for channel in 0..channels {
            zonal.strongest[channel] = zonal.strongest[channel].max(gradient[channel].norm());
            for (l, p_l) in legendre.iter().enumerate() {
                let scale = (2 * l + 1) as f64 / radius.powi(l as i32);
                zonal.coefficients[channel][l] += scale * weight * p_l * potential[channel];
            }
        }
    }
    zonal
}

/// P_0 to P_HIGHEST.
fn legendre(x: f64) -> [f64; HIGHEST + 1] {
    let mut p = [1.0; HIGHEST + 1];
    p[1] = x;
    for l in 2..=HIGHEST {
        p[l] = ((2 * l - 1) as f64 * x * p[l - 1] - (l - 1) as f64 * p[l - 2]) / l as f64;
    }
    p
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Charge(Vec3);

    impl BasisField for Charge {
        fn channels(&self) -> usize {
            1
        }
        fn sample(&self, points: &[Vec3], samples: &mut Samples) {
            samples.reset(points.len(), 1);
            for (k, p) in points.iter().enumerate() {
                let d = p - self.0;
                samples.potential[k] = 1.0 / d.norm();
                samples.gradient[k] = -d / d.norm().powi(3);
            }
        }
    }

    #[test]
    fn coefficients_of_a_point_charge() {
        // 1/|r - d| = Σ r^l / d^(l+1) P_l(cos of the angle to d), and P_l(angle to d) on average round the axis is
        // P_l(cos θ) P_l(axis · d/|d|), by the addition theorem.
        let (center, d) = (Vec3::new(0.1, -0.3, 0.2), Vec3::new(0.4, 0.9, -1.7));
        let axis = Vec3::new(1.0, 2.0, -0.5).normalize();
        let zonal = zonal(&Charge(center + d), &center, &axis, 0.5 * d.norm());
        let expected = legendre(axis.dot(&d) / d.norm());
        for (l, expected) in expected.iter().enumerate() {
            let exact = expected / d.norm().powi(l as i32 + 1);
            // The first degree that the rule takes for l is 32 - l, where the potential on the sphere of half the distance has
            // fallen to 2^(l - 32) of 1/d; A_l takes (2l + 1)/r^l of that, and of the next degrees together as much again.
            let alias = 2.0 * (2 * l + 1) as f64 * 2.0_f64.powi(l as i32 - 32) / d.norm();
            let scale = (0.5 * d.norm()).powi(-(l as i32));
            assert!((zonal.coefficients[0][l] - exact).abs() < alias * scale, "{l}");
        }
        // Where the sphere comes nearest, 1/(d/2)², at a point of the rule near by.
        let nearest = 4.0 / d.norm_squared();
        assert!(zonal.strongest[0] <= nearest && zonal.strongest[0] > 0.8 * nearest);
    }
}
