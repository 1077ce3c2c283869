//! How good a brick is, before anything is compared with the exact sum.
//!
//! Along one axis quintic Hermite interpolation is off by t³ (1 - t)³ ∂⁶φ/720 (in units of the brick). In the middle of an edge of
//! the brick along that axis the polynomial's second derivative misses 0.375 ∂⁶φ/720, while those across the edge are interpolated
//! along it and are off by far less. What the Laplacian of the polynomial is there, and an exact potential's is not, therefore
//! tells the axis's error: a field off by 0.143 of it, a potential by 0.042. The error of cubic splines follows from the
//! polynomial's fourth derivative: t² (1 - t)² δ⁴ ∂⁴φ/24 in cells of size δ.

use super::hermite::{PER_NODE, at, basis, gather};
use super::spline::{CELLS, CUBIC};

/// Largest slope of (t (1 - t))³ over its second derivative in the middle.
const FIELD: f64 = 0.143;

/// Its value there over the second derivative.
const POTENTIAL: f64 = 0.042;

/// Of cubic splines: largest slope of (t (1 - t))²/24, times the cell's size to the third in bricks.
const SPLINE_FIELD: f64 = 0.00802 / (CELLS * CELLS * CELLS) as f64;

/// Of cubic splines: its largest value, times the cell's size to the fourth.
const SPLINE_POTENTIAL: f64 = 1.0 / 384.0 / (CELLS * CELLS * CELLS * CELLS) as f64;

/// What is known of a function in a brick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Quality {
    /// Estimated error of the potential.
    pub potential: f64,
    /// Estimated error of the field, 1/m per unit.
    pub field: f64,
    /// Largest potential at a corner.
    pub height: f64,
    /// Strongest field at a corner, 1/m per unit.
    pub strength: f64,
}

/// The quality of a brick for one function: what it has at its corners in units in which the brick has this `size`, and its
/// edges, m.
pub(super) fn quality(corners: &[&[f64]; 8], size: f64, edges: [f64; 3], reach: usize) -> Quality {
    let cubic = if reach == CUBIC { 1.0 } else { 0.0 };
    let polynomial = gather(corners, size);
    let derivative =
        |place: [f64; 3], order: [usize; 3]| at(&polynomial, &std::array::from_fn(|k| basis(place[k], order[k])));
    let along = |axis: usize, order: usize| std::array::from_fn(|k| if k == axis { order } else { 0 });
    let mut quality = Quality::default();
    let mut squared = 0.0;
    for (axis, edge) in edges.into_iter().enumerate() {
        let (mut missed, mut fourth) = (0.0_f64, 0.0_f64);
        for across in 0..4 {
            let mut middle = [f64::from(across & 1), f64::from(across >> 1), 0.0];
            middle.swap(axis, 2);
            middle[axis] = 0.5;
            let second = |k: usize| derivative(middle, along(k, 2)) * (edge / edges[k]).powi(2);
            missed = missed.max((0..3).map(second).sum::<f64>().abs());
            for end in [0.0, 0.5, 1.0] {
                middle[axis] = end;
                fourth = fourth.max(derivative(middle, along(axis, 4)).abs());
            }
        }
        squared += ((FIELD * missed + cubic * SPLINE_FIELD * fourth) / edge).powi(2);
        quality.potential += POTENTIAL * missed + cubic * SPLINE_POTENTIAL * fourth;
    }
    quality.field = squared.sqrt();
    for corner in corners {
        let gradient = [corner[1], corner[3], corner[9]];
        let strength: f64 = (0..3).map(|k| (gradient[k] * size / edges[k]).powi(2)).sum();
        quality.strength = quality.strength.max(strength.sqrt());
        quality.height = quality.height.max(corner[0].abs());
    }
    quality
}

/// From units in which a brick's edges are one to units in which they are `size`: what a node holds.
pub(super) fn rescale(numbers: &mut [f64], size: f64) {
    let powers: [f64; 7] = std::array::from_fn(|n| size.powi(-(n as i32)));
    for own in numbers.chunks_exact_mut(PER_NODE) {
        for (d, number) in own.iter_mut().enumerate() {
            *number *= powers[d % 3 + d / 3 % 3 + d / 9];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a node holds of exp(a x + b y + c z) with a² + b² + c² = 0, c imaginary: exp(a x + b y) cos(|c| z).
    fn node(rates: [f64; 3], p: [f64; 3]) -> Vec<f64> {
        let grow = (rates[0] * p[0] + rates[1] * p[1]).exp();
        let (sin, cos) = (rates[2] * p[2]).sin_cos();
        let along_z = [cos, -rates[2] * sin, -rates[2] * rates[2] * cos];
        (0..PER_NODE)
            .map(|d| rates[0].powi((d % 3) as i32) * rates[1].powi((d / 3 % 3) as i32) * grow * along_z[d / 9])
            .collect()
    }

    #[test]
    fn estimates_are_near_the_largest_errors() {
        for rates in [[0.6, 0.8, 1.0], [1.0, 0.0, 1.0], [0.0, 2.0, 2.0]] {
            let corners: Vec<Vec<f64>> =
                (0..8).map(|c| node(rates, [c & 1, c >> 1 & 1, c >> 2].map(f64::from))).collect();
            let corners: [&[f64]; 8] = std::array::from_fn(|c| corners[c].as_slice());
            let told = quality(&corners, 1.0, [1.0; 3], CUBIC);
            // The polynomial alone, on a grid of points; the spline's part from the fourth derivative's bound.
            let polynomial = gather(&corners, 1.0);
            let (mut potential, mut field) = (0.0_f64, 0.0_f64);
            for n in 0..9 * 9 * 9 {
                let p = [n % 9, n / 9 % 9, n / 81].map(|i| i as f64 / 8.0);
                let truth = node(rates, p);
                let off = |order: [usize; 3], d: usize| {
                    at(&polynomial, &std::array::from_fn(|k| basis(p[k], order[k]))) - truth[d]
                };
                potential = potential.max(off([0; 3], 0).abs());
                let slopes = [off([1, 0, 0], 1), off([0, 1, 0], 3), off([0, 0, 1], 9)];
                field = field.max(slopes.iter().map(|s| s * s).sum::<f64>().sqrt());
            }
            let fourth: f64 = rates.iter().map(|r| r.powi(4)).sum();
            let largest = (rates[0] + rates[1]).exp();
            let (most, least) = (told.field, told.field - SPLINE_FIELD * fourth * largest);
            assert!(
                most > field && least < 3.0 * field,
                "{rates:?}: told {least:e} to {most:e}, field off by {field:e}"
            );
            let least = told.potential - SPLINE_POTENTIAL * fourth * largest;
            assert!(
                told.potential > potential && least < 3.0 * potential,
                "{rates:?}: told {least:e}, off by {potential:e}"
            );
        }
    }
}
