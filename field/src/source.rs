//! Fields in closed form that stand beside electrodes, or instead of them.

use std::f64::consts::{FRAC_2_PI, FRAC_PI_2};

use ellip::{elliprd, elliprf};
use meshes::Vec3;
use nalgebra::Matrix3;
use serde::{Deserialize, Serialize};

use crate::constants::COULOMB;
use crate::plane::Plane;
use crate::quadratic::Quadratic;

/// The form of a closed-form field of strength one, in its local frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum SourceKind {
    /// The field between rods far away along `e3`: φ = (x² - y²) / (2 r0²) for 1 V between the two pairs.
    PlanarQuadrupole {
        /// Distance of the rods from the axis, m.
        r0: f64,
    },
    /// The field of ideal trap electrodes: φ = (x² + y² - 2 z²) / (r0² + 2 z0²) for 1 V between ring and caps.
    Quadrupole {
        /// Distance of the ring, m.
        r0: f64,
        /// Distance of the caps, m; r0/√2 makes it (x² + y² - 2 z²) / (2 r0²).
        z0: f64,
    },
    /// A field of 1 V/m along `e3`, its potential zero at the centre.
    Uniform,
    /// A point charge of 1 C.
    Point,
    /// A charge of 1 C spread evenly on a circle about `e3`.
    ThinRing {
        /// m.
        radius: f64,
    },
}

/// A closed-form field of strength one, in place.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Source {
    /// Its form.
    pub kind: SourceKind,
    /// Where its origin is, m.
    pub center: Vec3,
    /// Local frame `[e1, e2, e3]`, orthonormal.
    pub frame: [Vec3; 3],
}

impl Source {
    /// Potential (V) and its gradient (V/m) at a point (m). Infinite or undefined on a point charge or a thin ring itself.
    pub fn potential_and_gradient(&self, point: &Vec3) -> (f64, Vec3) {
        let d = point - self.center;
        let [e1, e2, e3] = &self.frame;
        let (x, y, z) = (d.dot(e1), d.dot(e2), d.dot(e3));
        match self.kind {
            SourceKind::PlanarQuadrupole { r0 } => {
                let s = 1.0 / (2.0 * r0 * r0);
                ((x * x - y * y) * s, (e1 * x - e2 * y) * (2.0 * s))
            }
            SourceKind::Quadrupole { r0, z0 } => {
                let s = 1.0 / (r0 * r0 + 2.0 * z0 * z0);
                ((x * x + y * y - 2.0 * z * z) * s, (e1 * x + e2 * y - e3 * (2.0 * z)) * (2.0 * s))
            }
            SourceKind::Uniform => (-z, -e3),
            SourceKind::Point => {
                let r = d.norm();
                (COULOMB / r, d * (-COULOMB / (r * r * r)))
            }
            SourceKind::ThinRing { radius } => {
                let rho = x.hypot(y);
                let (potential, [along_rho, along_z]) = thin_ring(radius, rho, z);
                // On the axis the radial part is zero and has no direction.
                let outward = if rho > 0.0 { (e1 * x + e2 * y) / rho } else { Vec3::zeros() };
                (COULOMB * potential, (outward * along_rho + e3 * along_z) * COULOMB)
            }
        }
    }

    /// The same above a grounded plane, if there is one: with the image of opposite sign, and zero below the plane.
    pub fn potential_and_gradient_above(&self, ground: Option<&Plane>, point: &Vec3) -> (f64, Vec3) {
        let Some(plane) = ground else { return self.potential_and_gradient(point) };
        if plane.holds(point) {
            return (0.0, Vec3::zeros());
        }
        let (value, slope) = self.potential_and_gradient(point);
        let (image, image_slope) = self.potential_and_gradient(&plane.image(point));
        (value - image, slope - plane.turned(&image_slope))
    }

    /// The potential as a quadratic function of position, if it is one.
    pub fn quadratic(&self) -> Option<Quadratic> {
        // About the centre, in the local frame.
        let (slopes, curvatures) = match self.kind {
            SourceKind::PlanarQuadrupole { r0 } => (Vec3::zeros(), Vec3::new(1.0, -1.0, 0.0) / (r0 * r0)),
            SourceKind::Quadrupole { r0, z0 } => {
                (Vec3::zeros(), Vec3::new(1.0, 1.0, -2.0) * (2.0 / (r0 * r0 + 2.0 * z0 * z0)))
            }
            SourceKind::Uniform => (-Vec3::z(), Vec3::zeros()),
            SourceKind::Point | SourceKind::ThinRing { .. } => return None,
        };
        let axes = Matrix3::from_columns(&self.frame);
        let (slope, hessian) = (axes * slopes, axes * Matrix3::from_diagonal(&curvatures) * axes.transpose());
        let pull = hessian * self.center;
        let constant = (pull * 0.5 - slope).dot(&self.center);
        Some(Quadratic { constant, gradient: slope - pull, hessian })
    }

    /// Distance of the nearest point at which the field is infinite, m.
    pub fn distance_of_singularity(&self, point: &Vec3) -> f64 {
        let d = point - self.center;
        match self.kind {
            SourceKind::Point => d.norm(),
            SourceKind::ThinRing { radius } => {
                let [e1, e2, e3] = &self.frame;
                (d.dot(e1).hypot(d.dot(e2)) - radius).hypot(d.dot(e3))
            }
            _ => f64::INFINITY,
        }
    }

    /// Whether a point is where the field is infinite.
    pub fn is_singular_at(&self, point: &Vec3) -> bool {
        match self.kind {
            SourceKind::Point | SourceKind::ThinRing { .. } => {
                let (potential, gradient) = self.potential_and_gradient(point);
                !(potential.is_finite() && gradient.iter().all(|g| g.is_finite()))
            }
            _ => false,
        }
    }
}

/// Potential of a unit charge on a circle of that radius, and its derivatives along ρ and z, Coulomb's constant left out.
///
///   φ = (2/π) R_F(0, b², a²),   a² = (R + ρ)² + z²,   b² = (R - ρ)² + z²
///   ∂φ/∂z = -(2/π) z (C + S),   ∂φ/∂ρ = -(2/π) [(ρ - R) C + (ρ + R) S]
///   C = ∫ cos²θ dθ / (b² cos²θ + a² sin²θ)^(3/2) = R_D(0, a², b²)/3,   S the same with sin²θ, R_D(0, b², a²)/3
///
/// R_F, R_D Carlson's integrals; θ half the angle round the ring, from 0 to π/2. Near the axis C and S cancel, and the
/// difference is summed as a series in m = 4 R ρ / a². Relative error below 1e-12 off the ring itself.
/// Source: Carlson 1979; the series from Abramowitz and Stegun 17.3.11 and 17.3.12. Checked by `exact_thin_ring`.
fn thin_ring(radius: f64, rho: f64, z: f64) -> (f64, [f64; 2]) {
    let a2 = (radius + rho).powi(2) + z * z;
    let b2 = (radius - rho).powi(2) + z * z;
    let m = 4.0 * radius * rho / a2;
    let a = a2.sqrt();
    if m < 0.1 {
        // K = (π/2) Σ c_n mⁿ and E = -(π/2) Σ c_n mⁿ / (2n - 1), c_n = [(2n-1)!!/(2n)!!]². From them D = (K - E)/m and
        // C = [(2 - m) K - 2 E]/m² = (π/2) Σ c_n n/(n + 1) m^(n-1), n from 1. ∂φ/∂ρ ∝ -ρ [E + 4 (R²/a²)(C - D)] / (1 - m).
        let (mut k, mut e, mut d, mut c) = (1.0, 1.0, 0.0, 0.0);
        let (mut coefficient, mut power) = (1.0, 1.0);
        for n in 1..40 {
            let n = f64::from(n);
            coefficient *= ((2.0 * n - 1.0) / (2.0 * n)).powi(2);
            d += coefficient * power * 2.0 * n / (2.0 * n - 1.0);
            c += coefficient * power * n / (n + 1.0);
            power *= m;
            k += coefficient * power;
            e -= coefficient * power / (2.0 * n - 1.0);
        }
        let scale = 1.0 / (a * b2);
        let radial = -rho * (e + 4.0 * radius * radius / a2 * (c - d)) * scale;
        return (k / a, [radial, -z * e * scale]);
    }
    let carlson = |x: f64, y: f64| elliprd(0.0, x, y).unwrap_or(f64::NAN) / 3.0;
    let (cos, sin) = (carlson(a2, b2), carlson(b2, a2));
    let potential = elliprf(0.0, b2, a2).unwrap_or(f64::INFINITY);
    let radial = (rho - radius) * cos + (rho + radius) * sin;
    debug_assert!((0.0..=FRAC_PI_2 * 1.01).contains(&(potential * b2.sqrt())));
    (FRAC_2_PI * potential, [-FRAC_2_PI * radial, -FRAC_2_PI * z * (cos + sin)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quadratic_sources_say_so() {
        let point = Vec3::new(-0.4, 0.7, 0.2);
        for source in sources() {
            let singular = matches!(source.kind, SourceKind::Point | SourceKind::ThinRing { .. });
            assert_eq!(source.quadratic().is_none(), singular);
            let Some(form) = source.quadratic() else { continue };
            let ((a, da), (b, db)) = (form.potential_and_gradient(&point), source.potential_and_gradient(&point));
            // Rounding of a dozen operations on numbers of size 10.
            assert!((a - b).abs() < 1e-14 && (da - db).norm() < 1e-14, "{:?}: {a} {b}", source.kind);
        }
    }

    fn sources() -> Vec<Source> {
        let frame = [Vec3::y(), Vec3::z(), Vec3::x()];
        let center = Vec3::new(0.1, -0.2, 0.3);
        [
            SourceKind::PlanarQuadrupole { r0: 0.4 },
            SourceKind::Quadrupole { r0: 0.4, z0: 0.5 },
            SourceKind::Uniform,
            SourceKind::Point,
            SourceKind::ThinRing { radius: 0.7 },
        ]
        .map(|kind| Source { kind, center, frame })
        .to_vec()
    }

    #[test]
    fn gradients_are_those_of_the_potentials_and_all_are_harmonic() {
        for source in sources() {
            for p in [Vec3::new(0.5, 0.1, 0.2), Vec3::new(0.1, 0.3, 0.35), Vec3::new(-1.0, 2.0, 0.7)] {
                let h = 1e-4;
                let at = |d: Vec3| source.potential_and_gradient(&(p + d * h)).0;
                let (value, gradient) = source.potential_and_gradient(&p);
                let numeric = Vec3::from_fn(|k, _| (at(Vec3::ith(k, 1.0)) - at(-Vec3::ith(k, 1.0))) / (2.0 * h));
                let scale = gradient.norm().max(value.abs());
                // Central differences: h² times a third derivative, and rounding over h.
                assert!((gradient - numeric).norm() < 1e-6 * scale, "{source:?} at {p}: {gradient} {numeric}");
                let laplacian: f64 =
                    (0..3).map(|k| (at(Vec3::ith(k, 1.0)) + at(-Vec3::ith(k, 1.0)) - 2.0 * value) / (h * h)).sum();
                assert!(laplacian.abs() < 1e-5 * scale / (h * 1e2), "{source:?} at {p}: Laplacian {laplacian}");
            }
        }
    }

    #[test]
    fn both_forms_of_the_thin_ring_meet() {
        // m crosses 0.1 between these two radii: the values are continuous there.
        let (r, z) = (1.0, 0.3);
        let rho = |m: f64| {
            // Solves m = 4 r ρ / ((r + ρ)² + z²).
            let b = 2.0 * r - 4.0 * r / m;
            let c = r * r + z * z;
            (-b - (b * b - 4.0 * c).sqrt()) / 2.0
        };
        let (below, above) = (thin_ring(r, rho(0.1 - 1e-13), z), thin_ring(r, rho(0.1 + 1e-13), z));
        assert!((below.0 / above.0 - 1.0).abs() < 1e-12);
        for k in 0..2 {
            assert!((below.1[k] / above.1[k] - 1.0).abs() < 1e-11, "{below:?} {above:?}");
        }
    }
}
