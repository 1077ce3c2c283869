//! From values at Gauss's points to Legendre polynomials on [0, 1].

use crate::gauss::{Gauss, gauss};

/// P_0 ... of 2u - 1 into `values`.
#[inline]
pub(crate) fn legendre(u: f64, values: &mut [f64]) {
    let x = 2.0 * u - 1.0;
    let (mut before, mut value) = (0.0, 1.0);
    for (k, out) in values.iter_mut().enumerate() {
        *out = value;
        let k = k as f64;
        (before, value) = (value, ((2.0 * k + 1.0) * x * value - k * before) / (k + 1.0));
    }
}

/// Rules of all sizes in use, and the matrices that take values at their nodes to Legendre coefficients.
#[derive(Debug)]
pub(crate) struct Rules {
    rules: Vec<&'static Gauss>,
    transforms: Vec<Vec<f64>>,
}

impl Rules {
    pub fn new(largest: usize) -> Self {
        let rules: Vec<_> = (0..=largest).map(|n| gauss(n.max(1))).collect();
        let transforms = rules
            .iter()
            .map(|rule| {
                let n = rule.points.len();
                let mut matrix = vec![0.0; n * n];
                let mut values = vec![0.0; n];
                for j in 0..n {
                    legendre(rule.points[j], &mut values);
                    for k in 0..n {
                        matrix[k * n + j] = (2 * k + 1) as f64 * values[k];
                    }
                }
                matrix
            })
            .collect();
        Self { rules, transforms }
    }

    pub fn rule(&self, n: usize) -> &'static Gauss {
        self.rules[n]
    }

    /// `k * n + j`: factor of a polynomial's value at node j *times the weight* in its coefficient of P_k(2u - 1).
    /// Gauss's rule finds the coefficients of polynomials of degree n - 1 exactly.
    pub fn transform(&self, n: usize) -> &[f64] {
        &self.transforms[n]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn transforms_find_the_coefficients() {
        let rules = Rules::new(12);
        let rule = rules.rule(12);
        let mut values = [0.0; 12];
        let density = |u: f64, values: &mut [f64; 12]| {
            legendre(u, values);
            2.0 * values[0] - 3.0 * values[5] + 0.25 * values[11]
        };
        let charges: Vec<f64> =
            rule.points.iter().zip(&rule.weights).map(|(u, w)| w * density(*u, &mut values)).collect();
        for k in 0..12 {
            let got: f64 = (0..12).map(|j| rules.transform(12)[k * 12 + j] * charges[j]).sum();
            let wanted = [2.0, 0.0, 0.0, 0.0, 0.0, -3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.25][k];
            assert!((got - wanted).abs() < 1e-13, "{k}: {got}");
        }
    }
}
