//! Legendre polynomials as the basis of a charge.

use crate::gauss::gauss;

/// Highest order of a charge: polynomials of degree `MAX_ORDER - 1`.
pub const MAX_ORDER: usize = 8;

/// P_0 to P_(MAX_ORDER - 1) at 2x - 1.
#[inline(always)]
pub fn legendre(x: f64) -> [f64; MAX_ORDER] {
    let y = 2.0 * x - 1.0;
    let mut p = [1.0; MAX_ORDER];
    p[1] = y;
    for l in 2..MAX_ORDER {
        let n = l as f64;
        p[l] = ((2.0 * n - 1.0) * y * p[l - 1] - (n - 1.0) * p[l - 2]) / n;
    }
    p
}

/// From values at the Gauss points of an order to Legendre coefficients: `[coefficient][point]`, exact for polynomials of
/// degree order - 1.
#[derive(Clone, Debug)]
pub struct Transform {
    /// Number of points and of coefficients.
    pub order: usize,
    /// `[coefficient][point]`.
    pub matrix: [[f64; MAX_ORDER]; MAX_ORDER],
}

impl Transform {
    /// For an order from 1 to [`MAX_ORDER`].
    pub fn new(order: usize) -> Self {
        let rule = gauss(order);
        let mut matrix = [[0.0; MAX_ORDER]; MAX_ORDER];
        for (k, (x, w)) in rule.points.iter().zip(&rule.weights).enumerate() {
            let p = legendre(*x);
            for (l, row) in matrix.iter_mut().enumerate().take(order) {
                row[k] = (2 * l + 1) as f64 * w * p[l];
            }
        }
        Self { order, matrix }
    }

    /// Coefficients `[u][v]` of the polynomial with these values, `values[u * order + v]`.
    pub fn coefficients(&self, values: &[f64]) -> [[f64; MAX_ORDER]; MAX_ORDER] {
        let p = self.order;
        let mut half = [[0.0; MAX_ORDER]; MAX_ORDER];
        for i in 0..p {
            for j in 0..p {
                half[i][j] = (0..p).map(|b| values[i * p + b] * self.matrix[j][b]).sum();
            }
        }
        let mut out = [[0.0; MAX_ORDER]; MAX_ORDER];
        for i in 0..p {
            for j in 0..p {
                out[i][j] = (0..p).map(|a| self.matrix[i][a] * half[a][j]).sum();
            }
        }
        out
    }

    /// From integrals against Legendre products to integrals against the polynomials that are one at one point and zero at
    /// the others.
    #[inline(always)]
    pub fn to_points(&self, moments: &[[f64; MAX_ORDER]; MAX_ORDER], out: &mut [f64]) {
        let p = self.order;
        let mut half = [[0.0; MAX_ORDER]; MAX_ORDER];
        for i in 0..p {
            for j in 0..p {
                for b in 0..MAX_ORDER {
                    half[i][b] += moments[i][j] * self.matrix[j][b];
                }
            }
        }
        for a in 0..p {
            let mut row = [0.0; MAX_ORDER];
            for i in 0..p {
                for b in 0..MAX_ORDER {
                    row[b] += self.matrix[i][a] * half[i][b];
                }
            }
            out[a * p..(a + 1) * p].copy_from_slice(&row[..p]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coefficients_give_the_values_back() {
        for order in 1..=MAX_ORDER {
            let transform = Transform::new(order);
            let values: Vec<f64> = (0..order * order).map(|k| (1.3 * k as f64).sin()).collect();
            let c = transform.coefficients(&values);
            for (a, x) in gauss(order).points.iter().enumerate() {
                for (b, y) in gauss(order).points.iter().enumerate() {
                    let (p, q) = (legendre(*x), legendre(*y));
                    let sum: f64 = (0..order).map(|i| (0..order).map(|j| c[i][j] * p[i] * q[j]).sum::<f64>()).sum();
                    assert!((sum - values[a * order + b]).abs() < 1e-12);
                }
            }
        }
    }
}
