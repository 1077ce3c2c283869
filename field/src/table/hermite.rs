//! The polynomial of a brick, from values and derivatives at its corners.
//!
//! *Why quintic Hermite:* the polynomial of a brick has degree five in each direction and takes the potential and its
//! derivatives ∂_x^a ∂_y^b ∂_z^c, a, b, c ≤ 2, from each of the eight corners. Everything is local: a conductor spoils the bricks
//! it touches and no others, while a spline through values alone would carry its kink a dozen nodes far (a factor 0.43 per
//! node for the quintic one).

/// Derivatives kept at each corner: a + 3 b + 9 c is the place of ∂_x^a ∂_y^b ∂_z^c, times the size of the brick to the power of each.
pub const PER_NODE: usize = 27;

/// What the corners of a brick hold together: entry `x + 6 (y + 6 z)` where x = 3 i + a counts value, slope and curvature at the
/// lower end, then at the upper one, and y and z likewise.
pub(super) type Corners = [f64; 216];

/// The six quintic Hermite polynomials on [0, 1], from t⁰ to t⁵: those that take value, slope and curvature at 0, then at 1.
const POLYNOMIALS: [[f64; 6]; 6] = [
    [1.0, 0.0, 0.0, -10.0, 15.0, -6.0],
    [0.0, 1.0, 0.0, -6.0, 8.0, -3.0],
    [0.0, 0.0, 0.5, -1.5, 1.5, -0.5],
    [0.0, 0.0, 0.0, 10.0, -15.0, 6.0],
    [0.0, 0.0, 0.0, -4.0, 7.0, -3.0],
    [0.0, 0.0, 0.0, 0.5, -1.0, 0.5],
];

/// The derivative of that order of the six polynomials at t.
pub(super) fn basis(t: f64, order: usize) -> [f64; 6] {
    POLYNOMIALS.map(|polynomial| {
        (order..6).rev().fold(0.0, |sum, power| {
            let factor: f64 = (0..order).map(|k| (power - k) as f64).product();
            sum * t + factor * polynomial[power]
        })
    })
}

/// Puts together what eight corners hold; `size` is that of the brick in the units of what they hold.
pub(super) fn gather(corners: &[&[f64]; 8], size: f64) -> Corners {
    let powers: [f64; 7] = std::array::from_fn(|n| size.powi(n as i32));
    let mut all = [0.0; 216];
    for (corner, numbers) in corners.iter().enumerate() {
        let first: [usize; 3] = std::array::from_fn(|k| 3 * (corner >> k & 1));
        for (d, number) in numbers[..PER_NODE].iter().enumerate() {
            let [a, b, c] = [d % 3, d / 3 % 3, d / 9];
            all[first[0] + a + 6 * (first[1] + b + 6 * (first[2] + c))] = number * powers[a + b + c];
        }
    }
    all
}

/// The polynomial, or a derivative of it, where the six have these values along x, y and z.
pub(super) fn at(corners: &Corners, [x, y, z]: &[[f64; 6]; 3]) -> f64 {
    let dot = |a: &[f64; 6], b: &mut dyn FnMut(usize) -> f64| -> f64 { (0..6).map(|i| a[i] * b(i)).sum() };
    dot(z, &mut |k| dot(y, &mut |j| dot(x, &mut |i| corners[i + 6 * (j + 6 * k)])))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_basis_takes_value_slope_and_curvature_at_the_ends() {
        for (end, first) in [(0.0, 0), (1.0, 3)] {
            for order in 0..3 {
                for (k, value) in basis(end, order).into_iter().enumerate() {
                    let expected = f64::from(u8::from(k == first + order));
                    assert!((value - expected).abs() < 1e-14, "{k}, order {order} at {end}: {value}");
                }
            }
        }
    }

    #[test]
    fn derivatives_are_those_of_the_values() {
        let h = 1e-5;
        for (t, order) in [(0.1, 0), (0.37, 1), (0.5, 2), (0.92, 3), (0.3, 4)] {
            let (lower, upper, slope) = (basis(t - h, order), basis(t + h, order), basis(t, order + 1));
            for k in 0..6 {
                // Differences of polynomials of degree five with coefficients up to 720 / 2.
                assert!(((upper[k] - lower[k]) / (2.0 * h) - slope[k]).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn polynomials_of_degree_five_are_reproduced() {
        // f = x^5 y^3 z^2 - 2 x y^4 + z^5 over the unit cell, with its derivatives by the power rule.
        let terms = [(1.0, [5, 3, 2]), (-2.0, [1, 4, 0]), (1.0, [0, 0, 5])];
        let power = |x: f64, n: i32, d: i32| {
            if d > n { 0.0 } else { (0..d).map(|k| f64::from(n - k)).product::<f64>() * x.powi(n - d) }
        };
        let derivative = |p: [f64; 3], d: [i32; 3]| -> f64 {
            terms.iter().map(|(f, n)| f * (0..3).map(|i| power(p[i], n[i], d[i])).product::<f64>()).sum()
        };
        // Corners in units of half a cell: derivatives of order n are smaller by 2^n.
        let corners: Vec<Vec<f64>> = (0..8)
            .map(|corner| {
                let p = [corner & 1, corner >> 1 & 1, corner >> 2].map(f64::from);
                (0..27)
                    .map(|k| [k % 3, k / 3 % 3, k / 9])
                    .map(|d| derivative(p, d) * 0.5_f64.powi(d.iter().sum()))
                    .collect()
            })
            .collect();
        let corners = gather(&std::array::from_fn(|c| corners[c].as_slice()), 2.0);
        let p = [0.3, 0.8, 0.45];
        for d in [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 2], [4, 0, 0], [1, 1, 2]] {
            let weights = std::array::from_fn(|k| basis(p[k], d[k]));
            assert!((at(&corners, &weights) - derivative(p, d.map(|n| n as i32))).abs() < 1e-11);
        }
    }
}
