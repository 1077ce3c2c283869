//! Gauss's rule and Legendre polynomials on [0, 1].

use std::f64::consts::PI;

/// Nodes and weights of Gauss's rule on [0, 1]: exact for polynomials of degree 2n - 1.
///
/// By Newton's method from Tricomi's guess; weights 1 / ((1 - x²) P_n'(x)²) for [0, 1]. Checked by
/// `rules_are_exact_for_polynomials`.
#[derive(Clone, Debug)]
pub(crate) struct Rule {
    pub nodes: Vec<f64>,
    pub weights: Vec<f64>,
}

impl Rule {
    pub fn new(n: usize) -> Self {
        let (mut nodes, mut weights) = (vec![0.5; n], vec![1.0; n]);
        for k in 0..n.div_ceil(2) {
            let mut x = (PI * (k as f64 + 0.75) / (n as f64 + 0.5)).cos();
            let mut slope = 1.0;
            for _ in 0..8 {
                let (value, derivative) = legendre_and_slope(n, x);
                slope = derivative;
                let step = value / derivative;
                x -= step;
                if step.abs() < 1e-16 {
                    break;
                }
            }
            if n % 2 == 1 && k == n / 2 {
                x = 0.0;
                slope = legendre_and_slope(n, 0.0).1;
            }
            let weight = 1.0 / ((1.0 - x * x) * slope * slope);
            // The nodes near 0 without cancellation: 1 - x = (1 - x²)/(1 + x) would not be more exact.
            nodes[k] = 0.5 * (1.0 - x);
            nodes[n - 1 - k] = 0.5 * (1.0 + x);
            weights[k] = weight;
            weights[n - 1 - k] = weight;
        }
        Self { nodes, weights }
    }
}

fn legendre_and_slope(n: usize, x: f64) -> (f64, f64) {
    let (mut before, mut value) = (1.0, x);
    if n == 0 {
        return (1.0, 0.0);
    }
    for k in 1..n {
        let k = k as f64;
        (before, value) = (value, ((2.0 * k + 1.0) * x * value - k * before) / (k + 1.0));
    }
    (value, n as f64 * (x * value - before) / (x * x - 1.0))
}

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
    rules: Vec<Rule>,
    transforms: Vec<Vec<f64>>,
}

impl Rules {
    pub fn new(largest: usize) -> Self {
        let rules: Vec<Rule> = (0..=largest).map(|n| Rule::new(n.max(1))).collect();
        let transforms = rules
            .iter()
            .map(|rule| {
                let n = rule.nodes.len();
                let mut matrix = vec![0.0; n * n];
                let mut values = vec![0.0; n];
                for j in 0..n {
                    legendre(rule.nodes[j], &mut values);
                    for k in 0..n {
                        matrix[k * n + j] = (2 * k + 1) as f64 * values[k];
                    }
                }
                matrix
            })
            .collect();
        Self { rules, transforms }
    }

    pub fn rule(&self, n: usize) -> &Rule {
        &self.rules[n]
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
    fn rules_are_exact_for_polynomials() {
        for n in 1..=40 {
            let rule = Rule::new(n);
            for degree in 0..2 * n {
                let sum: f64 = rule.nodes.iter().zip(&rule.weights).map(|(x, w)| w * x.powi(degree as i32)).sum();
                // Rounding of n terms.
                assert!((sum * (degree + 1) as f64 - 1.0).abs() < 1e-13, "{n} {degree}: {sum}");
            }
        }
    }

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
            rule.nodes.iter().zip(&rule.weights).map(|(u, w)| w * density(*u, &mut values)).collect();
        for k in 0..12 {
            let got: f64 = (0..12).map(|j| rules.transform(12)[k * 12 + j] * charges[j]).sum();
            let wanted = [2.0, 0.0, 0.0, 0.0, 0.0, -3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.25][k];
            assert!((got - wanted).abs() < 1e-13, "{k}: {got}");
        }
    }
}
