//! Multipoles of unit potentials about a centre.

use meshes::Vec3;

use super::Space;
use super::expansion::on_sphere;
use crate::harmonics::coefficients;

/// The potentials about a centre as real solid harmonics in Schmidt's semi-normalisation, without the sign (-1)^m:
///
///   φ = Σ_l r^l Σ_m sqrt((2 - δ_m0) (l - m)! / (l + m)!) P_l^m(cosθ) (A_lm cos mφ + B_lm sin mφ)
///
/// θ from the third axis of the frame, φ from the first. For m = 0 that is φ = Σ A_l r^l P_l(cosθ): A_l0 are the multipoles of a
/// round trap, V/m^l per volt.
#[derive(Clone, Debug)]
pub struct Multipoles {
    /// m.
    pub center: Vec3,
    /// Orthonormal.
    pub frame: [Vec3; 3],
    /// Radius of the sphere they were found on, m.
    pub radius: f64,
    /// Largest l.
    pub order: usize,
    /// For each channel A_00, A_10, A_11, B_11, A_20, A_21, B_21, ...; V/m^l.
    pub coefficients: Vec<Vec<f64>>,
    /// Estimated errors of the same.
    pub errors: Vec<Vec<f64>>,
}

/// Radius of the second sphere, from which errors are estimated.
const INNER: f64 = 0.8;

impl Multipoles {
    /// From a sphere of that radius (m) that no charge is in.
    ///
    /// The error of a coefficient is the difference to that from a smaller sphere (aliasing and rounding), and what the relative
    /// error ε of the unit fields does: it comes from charges as far away as all others, so that it makes at most
    /// ε max_k |A_k| R^k / R^l, R the distance of the nearest charge.
    pub fn new(space: &Space, center: Vec3, frame: [Vec3; 3], radius: f64, order: usize) -> Self {
        // Aliases begin at twice the order: 0.5^(2 · 12) = 6e-8 of a potential that is a volt at the nearest charge.
        let nodes = (3 * order / 2 + 4).min(64);
        let outer = on_sphere(space.field, &center, &frame, radius, order, nodes);
        let inner = on_sphere(space.field, &center, &frame, INNER * radius, order, nodes);
        let room = space.room(&center).max(radius);
        let (mut values, mut errors) = (Vec::new(), Vec::new());
        for (outer, inner) in outer.iter().zip(&inner) {
            let (outer, inner) = (schmidt(outer, order, radius), schmidt(inner, order, INNER * radius));
            let strength = degrees(order).skip(1).zip(&outer[1..]).map(|(l, a)| a.abs() * room.powi(l as i32));
            let strength = strength.fold(0.0, f64::max);
            let error = |(l, (a, b)): (usize, (&f64, &f64))| {
                (a - b).abs() + space.error * strength.max(if l == 0 { a.abs() } else { 0.0 }) / room.powi(l as i32)
            };
            errors.push(degrees(order).zip(outer.iter().zip(&inner)).map(error).collect());
            values.push(outer);
        }
        Self { center, frame, radius, order, coefficients: values, errors }
    }

    /// Where A_lm (`sine` false) or B_lm stands in a list.
    ///
    /// # Panics
    /// m is larger than l, or B_l0 is asked for.
    pub fn at(l: usize, m: usize, sine: bool) -> usize {
        assert!(m <= l && !(m == 0 && sine), "there is no such multipole");
        if m == 0 { l * l } else { l * l + 2 * m - 1 + usize::from(sine) }
    }

    /// A_l of a channel, V/m^l, and its error.
    pub fn axial(&self, channel: usize, l: usize) -> (f64, f64) {
        let at = Self::at(l, 0, false);
        (self.coefficients[channel][at], self.errors[channel][at])
    }

    /// Largest size, on the sphere, of what is not round about the third axis against what is, without the constant.
    pub fn roughness(&self, channel: usize) -> f64 {
        let (mut round, mut rough) = (0.0_f64, 0.0_f64);
        for l in 1..=self.order {
            let size = |k: usize| self.coefficients[channel][k].abs() * self.radius.powi(l as i32);
            round = round.max(size(l * l));
            rough = (l * l + 1..(l + 1) * (l + 1)).map(size).fold(rough, f64::max);
        }
        rough / round.max(f64::MIN_POSITIVE)
    }

    /// A combination of channels, with errors that add up.
    pub fn combined(&self, weights: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let sum = |of: &[Vec<f64>], weight: &dyn Fn(f64) -> f64| {
            let mut sum = vec![0.0; coefficients(self.order)];
            for (list, w) in of.iter().zip(weights) {
                sum.iter_mut().zip(list).for_each(|(s, x)| *s += weight(*w) * x);
            }
            sum
        };
        (sum(&self.coefficients, &|w| w), sum(&self.errors, &f64::abs))
    }
}

/// The degree of each coefficient.
pub fn degrees(order: usize) -> impl Iterator<Item = usize> {
    (0..=order).flat_map(|l| std::iter::repeat_n(l, 2 * l + 1))
}

/// From Dehnen's normalisation, in units of a radius: A_l0 = L_l / l!, A_lm = (-1)^m √2 L_lm / √((l - m)! (l + m)!), over
/// radius^l.
fn schmidt(expansion: &[f64], order: usize, radius: f64) -> Vec<f64> {
    let factorial = |n: usize| (1..=n).map(|k| k as f64).product::<f64>();
    let mut list = Vec::with_capacity(coefficients(order));
    for l in 0..=order {
        let scale = 1.0 / radius.powi(l as i32);
        list.push(expansion[l * l] * scale / factorial(l));
        for m in 1..=l {
            let sign = if m % 2 == 0 { 1.0 } else { -1.0 };
            let factor = sign * scale * (2.0 / (factorial(l - m) * factorial(l + m))).sqrt();
            let first = l * l + 2 * m - 1;
            list.extend([expansion[first] * factor, expansion[first + 1] * factor]);
        }
    }
    list
}

#[cfg(test)]
mod tests {
    use super::super::expansion::tests::Charges;
    use super::*;
    use crate::QuadraticField;

    const FRAME: [Vec3; 3] = [Vec3::new(1.0, 0.0, 0.0), Vec3::new(0.0, 1.0, 0.0), Vec3::new(0.0, 0.0, 1.0)];

    fn of(field: &dyn crate::BasisField, frame: [Vec3; 3]) -> Multipoles {
        let space = Space { field, clearance: &|p| 1.0 - p.norm(), error: 0.0, size: 1.0 };
        Multipoles::new(&space, Vec3::zeros(), frame, 0.5, 12)
    }

    #[test]
    fn a_charge_on_the_axis_has_equal_multipoles() {
        // 1/|r - e| = Σ r^l P_l.
        let multipoles = of(&Charges(vec![Vec3::x()]), [Vec3::y(), Vec3::z(), Vec3::x()]);
        for l in 0..=12 {
            let (value, error) = multipoles.axial(0, l);
            // Aliases of degree 44 - l: 0.5^(44 - 2l) = 1e-6 for l = 12, less below; the estimate must cover it.
            assert!((value - 1.0).abs() < 1e-9 * 4.0_f64.powi(l as i32) && error < 1e-4, "{l}: {value} {error}");
            assert!((value - 1.0).abs() < 2.0 * error + 1e-12, "{l}: {value} {error}");
        }
        assert!(multipoles.roughness(0) < 1e-12);
    }

    #[test]
    fn quadrupoles_are_where_they_belong() {
        // x² - y² is A_22 √(1/12) · 3 (x² - y²): A_22 = 2/√3; and 2 xy is B_22 of the same size.
        let field = QuadraticField::quadrupole(Vec3::new(1.0, -1.0, 0.0), 0.5_f64.sqrt());
        let multipoles = of(&field, FRAME);
        let list = &multipoles.coefficients[0];
        assert!((list[Multipoles::at(2, 2, false)] - 2.0 / 3.0_f64.sqrt()).abs() < 1e-13);
        let rest: f64 = list
            .iter()
            .enumerate()
            .filter(|(k, _)| *k != Multipoles::at(2, 2, false))
            .map(|(k, a)| {
                let l = (k as f64).sqrt() as i32;
                a.abs() * 0.5_f64.powi(l)
            })
            .sum();
        assert!(rest < 1e-12, "{rest}");
    }
}
