//! Solid harmonics: the potential of far charges as a polynomial that obeys Laplace's equation.
//!
//!   R_l^m(r) = (-1)^m r^l P_l^m(cos θ) e^{imφ} / (l + m)!,   I_l^m(r) = (-1)^m (l - m)! P_l^m(cos θ) e^{imφ} / r^{l+1}
//!
//! for m ≥ 0 with positive P_l^m, and R_l^{-m} = (-1)^m conj R_l^m (likewise I). In this normalisation
//!
//!   1/|x - y| = Σ_lm conj R_l^m(x) I_l^m(y)  for |x| < |y|,
//!   R_l^m(x + b) = Σ_λμ R_λ^μ(x) R_{l-λ}^{m-μ}(b),
//!   ∂_z R_l^m = R_{l-1}^m,  (∂_x + i∂_y) R_l^m = R_{l-1}^{m+1},  (∂_x - i∂_y) R_l^m = -R_{l-1}^{m-1}.
//!
//! Source: Dehnen 2014, section 3 (whose signs these are). Checked by the tests below.
//!
//! An **expansion** of degree p about a centre, φ(x) = Σ_lm conj R_l^m((x - c)/s) L_l^m with a length s, is stored as
//! (p + 1)² real numbers: for each l the real part of m = 0, then real and imaginary parts of m = 1 ... l. The length keeps
//! coefficients of all degrees of one size.

use meshes::Vec3;
use nalgebra::Complex;

type C = Complex<f64>;

/// Number of real coefficients of an expansion of that degree.
pub const fn coefficients(degree: usize) -> usize {
    (degree + 1) * (degree + 1)
}

/// Where (l, m), m ≥ 0, stands in a list of complex harmonics.
const fn at(l: usize, m: usize) -> usize {
    l * (l + 1) / 2 + m
}

/// Number of harmonics with m ≥ 0.
const fn harmonics(degree: usize) -> usize {
    (degree + 1) * (degree + 2) / 2
}

/// Harmonics of one point up to a degree, m ≥ 0.
#[derive(Clone, Debug, Default)]
pub struct Harmonics {
    values: Vec<C>,
    degree: usize,
}

impl Harmonics {
    /// R_l^m of a point, for l up to `degree`.
    pub fn regular(x: &Vec3, degree: usize) -> Self {
        let mut h = Self::default();
        h.set_regular(x, degree);
        h
    }

    /// As [`Harmonics::regular`], into what was allocated before.
    pub fn set_regular(&mut self, x: &Vec3, degree: usize) {
        self.reset(degree);
        let (xy, z, r2) = (C::new(x.x, x.y), x.z, x.norm_squared());
        let v = &mut self.values;
        v[0] = C::new(1.0, 0.0);
        for m in 0..=degree {
            if m > 0 {
                v[at(m, m)] = -v[at(m - 1, m - 1)] * xy / (2.0 * m as f64);
            }
            if m < degree {
                v[at(m + 1, m)] = v[at(m, m)] * z;
            }
            for l in m + 2..=degree {
                let scale = 1.0 / ((l * l - m * m) as f64);
                v[at(l, m)] = (v[at(l - 1, m)] * ((2 * l - 1) as f64 * z) - v[at(l - 2, m)] * r2) * scale;
            }
        }
    }

    /// I_l^m of a point, for l up to `degree`, into what was allocated before. The point is not the origin.
    pub fn set_irregular(&mut self, x: &Vec3, degree: usize) {
        self.reset(degree);
        let inverse = 1.0 / x.norm_squared();
        let (xy, z) = (C::new(x.x, x.y) * inverse, x.z * inverse);
        let v = &mut self.values;
        v[0] = C::new(inverse.sqrt(), 0.0);
        for m in 0..=degree {
            if m > 0 {
                v[at(m, m)] = -v[at(m - 1, m - 1)] * xy * (2 * m - 1) as f64;
            }
            if m < degree {
                v[at(m + 1, m)] = v[at(m, m)] * ((2 * m + 1) as f64 * z);
            }
            for l in m + 2..=degree {
                let below = ((l - 1) * (l - 1) - m * m) as f64 * inverse;
                v[at(l, m)] = v[at(l - 1, m)] * ((2 * l - 1) as f64 * z) - v[at(l - 2, m)] * below;
            }
        }
    }

    fn reset(&mut self, degree: usize) {
        self.degree = degree;
        self.values.clear();
        self.values.resize(harmonics(degree), C::new(0.0, 0.0));
    }

    /// The harmonic of any m from -l to l; zero for |m| > l.
    fn get(&self, l: usize, m: isize) -> C {
        let size = m.unsigned_abs();
        if size > l {
            return C::new(0.0, 0.0);
        }
        let value = self.values[at(l, size)];
        match (m < 0, size % 2 == 1) {
            (false, _) => value,
            (true, false) => value.conj(),
            (true, true) => -value.conj(),
        }
    }

    /// Adds `charge` times these (irregular) harmonics to an expansion of the same degree.
    pub fn add_to(&self, charge: f64, expansion: &mut [f64]) {
        let mut k = 0;
        for l in 0..=self.degree {
            expansion[k] += charge * self.values[at(l, 0)].re;
            k += 1;
            for m in 1..=l {
                let v = self.values[at(l, m)];
                expansion[k] += charge * v.re;
                expansion[k + 1] += charge * v.im;
                k += 2;
            }
        }
    }

    /// Weights w of the real coefficients of an expansion for which Σ w L is the expansion's value at the point whose
    /// regular harmonics these are (the point relative to the centre, over the length).
    pub fn value_weights(&self) -> Vec<f64> {
        let mut weights = Vec::with_capacity(coefficients(self.degree));
        for l in 0..=self.degree {
            weights.push(self.values[at(l, 0)].re);
            for m in 1..=l {
                // conj R L and its mirror at -m: twice the real part.
                let r = self.values[at(l, m)];
                weights.extend([2.0 * r.re, 2.0 * r.im]);
            }
        }
        weights
    }
}

/// A derivative ∂_x^a ∂_y^b ∂_z^c as a combination Σ κ_j ∂₊^{n-j} ∂₋^j ∂_z^c, n = a + b, ∂± = ∂_x ± i∂_y.
fn ladder([a, b]: [usize; 2]) -> Vec<C> {
    // (∂₊ + ∂₋)^a / 2^a · (∂₊ - ∂₋)^b / (2i)^b, as polynomials in ∂₋ with ∂₊ set to one.
    let mut polynomial = vec![C::new(1.0, 0.0)];
    let mut times = |sign: f64, factor: C| {
        let mut next = vec![C::new(0.0, 0.0); polynomial.len() + 1];
        for (j, k) in polynomial.iter().enumerate() {
            next[j] += k * factor;
            next[j + 1] += k * factor * sign;
        }
        polynomial = next;
    };
    for _ in 0..a {
        times(1.0, C::new(0.5, 0.0));
    }
    for _ in 0..b {
        times(-1.0, C::new(0.0, -0.5));
    }
    polynomial
}

/// Weights w of the real coefficients of an expansion of that degree for which Σ w L is a derivative ∂_x^a ∂_y^b ∂_z^c of
/// the expansion, in units of its length, at a point (relative to the centre, over the length).
///
/// The derivative of conj R_l^m(x) is, term by term, (-1)^j conj(κ_j) conj R_{l-a-b-c}^{m+n-2j}(x) with n = a + b.
pub fn derivative_weights(x: &Vec3, degree: usize, [a, b, c]: [usize; 3]) -> Vec<f64> {
    let regular = Harmonics::regular(x, degree);
    let (kappa, n, order) = (ladder([a, b]), (a + b) as isize, a + b + c);
    // d_l^m: what multiplies L_l^m, for any sign of m.
    let factor = |l: usize, m: isize| -> C {
        if l < order {
            return C::new(0.0, 0.0);
        }
        let term = |(j, k): (usize, &C)| {
            let sign = if j % 2 == 0 { 1.0 } else { -1.0 };
            k * sign * regular.get(l - order, m + n - 2 * j as isize)
        };
        kappa.iter().enumerate().map(term).sum::<C>().conj()
    };
    let mut weights = Vec::with_capacity(coefficients(degree));
    for l in 0..=degree {
        weights.push(factor(l, 0).re);
        for m in 1..=l as isize {
            // L_l^{-m} = (-1)^m conj L_l^m: both terms together are real.
            let mirrored = factor(l, -m) * if m % 2 == 0 { 1.0 } else { -1.0 };
            let plus = factor(l, m);
            weights.extend([plus.re + mirrored.re, -plus.im + mirrored.im]);
        }
    }
    weights
}

/// Matrix (row-major, `to` coefficients by `from` coefficients) that moves an expansion of degree `degree` about c with length
/// s to the same degree about c' with length s': `shift` = (c' - c)/s, `ratio` = s'/s.
pub fn translation(shift: &Vec3, ratio: f64, degree: usize) -> Vec<f64> {
    let regular = Harmonics::regular(shift, degree);
    let n = coefficients(degree);
    let mut matrix = vec![0.0; n * n];
    // L'_λ^μ = ratio^λ Σ_lm L_l^m conj R_{l-λ}^{m-μ}(shift).
    let mut row = 0;
    for lambda in 0..=degree {
        let scale = ratio.powi(lambda as i32);
        for mu in 0..=lambda as isize {
            let parts = if mu == 0 { 1 } else { 2 };
            let mut column = 0;
            for l in 0..=degree {
                for m in 0..=l as isize {
                    let width = if m == 0 { 1 } else { 2 };
                    if l >= lambda {
                        let plus = regular.get(l - lambda, m - mu).conj() * scale;
                        let sign = if m % 2 == 0 { 1.0 } else { -1.0 };
                        let minus = regular.get(l - lambda, -m - mu).conj() * (scale * sign);
                        // plus · L + minus · conj L for L = a + ib (m > 0); plus · a for m = 0.
                        let entries = if m == 0 {
                            [[plus.re, 0.0], [plus.im, 0.0]]
                        } else {
                            [[plus.re + minus.re, -plus.im + minus.im], [plus.im + minus.im, plus.re - minus.re]]
                        };
                        for (part, values) in entries.iter().enumerate().take(parts) {
                            for (w, value) in values.iter().enumerate().take(width) {
                                matrix[(row + part) * n + column + w] = *value;
                            }
                        }
                    }
                    column += width;
                }
            }
            row += parts;
        }
    }
    matrix
}

#[cfg(test)]
mod tests {
    use super::*;

    const DEGREE: usize = 24;

    fn charges() -> Vec<(Vec3, f64)> {
        vec![(Vec3::new(2.0, -1.5, 1.0), 1.3), (Vec3::new(-1.0, 0.4, 3.0), -0.7), (Vec3::new(0.1, -2.9, -0.2), 2.0)]
    }

    fn exact(x: &Vec3) -> f64 {
        charges().iter().map(|(y, q)| q / (x - y).norm()).sum()
    }

    fn expansion(center: &Vec3, length: f64, degree: usize) -> Vec<f64> {
        let (mut sum, mut h) = (vec![0.0; coefficients(degree)], Harmonics::default());
        for (y, q) in charges() {
            h.set_irregular(&((y - center) / length), degree);
            h.add_to(q / length, &mut sum);
        }
        sum
    }

    fn dot(a: &[f64], b: &[f64]) -> f64 {
        a.iter().zip(b).map(|(a, b)| a * b).sum()
    }

    #[test]
    fn an_expansion_is_the_potential() {
        let (center, length) = (Vec3::new(0.1, 0.2, -0.1), 0.7);
        let local = expansion(&center, length, DEGREE);
        for x in [Vec3::new(0.3, -0.2, 0.1), Vec3::new(0.1, 0.2, -0.1), Vec3::new(-0.4, 0.5, -0.6)] {
            let weights = Harmonics::regular(&((x - center) / length), DEGREE).value_weights();
            // (0.9/2.5)^25 is below 1e-11.
            assert!((dot(&weights, &local) / exact(&x) - 1.0).abs() < 1e-10);
        }
    }

    #[test]
    fn derivatives_are_those_of_the_potential() {
        let (center, length) = (Vec3::new(0.1, 0.2, -0.1), 0.7);
        let local = expansion(&center, length, DEGREE);
        let x = Vec3::new(0.25, -0.1, 0.05);
        let at = (x - center) / length;
        let derivative = |order: [usize; 3], x: &Vec3| dot(&derivative_weights(x, DEGREE, order), &local);
        assert!((derivative([0, 0, 0], &at) / exact(&x) - 1.0).abs() < 1e-12);
        for order in [[1, 0, 0], [0, 1, 0], [0, 0, 1], [2, 1, 0], [1, 1, 1], [2, 2, 2], [0, 2, 1], [1, 0, 2]] {
            // Central difference of one derivative less, h² of the next but one: relative 1e-6.
            let axis = order.iter().position(|&k| k > 0).unwrap();
            let mut less = order;
            less[axis] -= 1;
            let h = 1e-3;
            let e = Vec3::ith(axis, h);
            let numeric = (derivative(less, &(at + e)) - derivative(less, &(at - e))) / (2.0 * h);
            let got = derivative(order, &at);
            assert!((got - numeric).abs() < 1e-4 * got.abs().max(0.1), "{order:?}: {got} {numeric}");
        }
        let laplacian: f64 = [[2, 0, 0], [0, 2, 0], [0, 0, 2]].map(|o| derivative(o, &at)).iter().sum();
        assert!(laplacian.abs() < 1e-12);
    }

    #[test]
    fn a_translated_expansion_is_the_same_function() {
        let (center, length) = (Vec3::new(0.1, 0.2, -0.1), 0.9);
        let (moved, shorter) = (Vec3::new(0.3, 0.1, 0.05), 0.4);
        let n = coefficients(DEGREE);
        let local = expansion(&center, length, DEGREE);
        let matrix = translation(&((moved - center) / length), shorter / length, DEGREE);
        let there: Vec<f64> = matrix.chunks_exact(n).map(|row| dot(row, &local)).collect();
        for d in [Vec3::new(0.1, 0.2, -0.1), Vec3::zeros()] {
            let weights = Harmonics::regular(&(d / shorter), DEGREE).value_weights();
            assert!((dot(&weights, &there) / exact(&(moved + d)) - 1.0).abs() < 1e-10);
        }
    }
}
