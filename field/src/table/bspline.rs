//! B-splines of degree three and five on cells of size one.

use super::lanes::Lanes;
use super::spline::{CUBIC, QUINTIC};

/// B-splines of degree five that do not vanish in a cell; of degree three there are four.
pub(super) const MOST: usize = 2 * QUINTIC;

/// 6 times the B-splines of degree three that do not vanish in a cell, those of the last node first: entry n of each is the
/// coefficient of t^n (de Boor, A Practical Guide to Splines, 1978).
const OF_DEGREE_3: [[f64; 4]; 4] =
    [[1.0, -3.0, 3.0, -1.0], [4.0, 0.0, -6.0, 3.0], [1.0, 3.0, 3.0, -3.0], [0.0, 0.0, 0.0, 1.0]];

/// 120 times those of degree five.
const OF_DEGREE_5: [[f64; 6]; 6] = [
    [1.0, -5.0, 10.0, -10.0, 5.0, -1.0],
    [26.0, -50.0, 20.0, 20.0, -20.0, 5.0],
    [66.0, 0.0, -60.0, 0.0, 30.0, -10.0],
    [26.0, 50.0, 20.0, -20.0, -20.0, 10.0],
    [1.0, 5.0, 10.0, 10.0, 5.0, -5.0],
    [0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
];

/// Values and slopes (per cell) at places t in [0, 1] of a cell, one in each lane, of the B-splines that do not vanish there: four
/// of degree three, the rest zero, or six of degree five.
#[inline(always)]
pub(super) fn splines<L: Lanes, const REACH: usize>(lanes: L, t: L::V) -> [[L::V; MOST]; 2] {
    let zero = lanes.splat(0.0);
    let (mut values, mut slopes) = ([zero; MOST], [zero; MOST]);
    // Not through iterators: their closures do not know what the machine has.
    for k in 0..2 * REACH {
        [values[k], slopes[k]] = if REACH == CUBIC {
            horner(lanes, t, &OF_DEGREE_3[k % 4], 6.0)
        } else {
            horner(lanes, t, &OF_DEGREE_5[k], 120.0)
        };
    }
    [values, slopes]
}

/// Value and slope of a polynomial over a divisor.
#[inline(always)]
fn horner<L: Lanes, const N: usize>(lanes: L, t: L::V, of: &[f64; N], divisor: f64) -> [L::V; 2] {
    let mut value = lanes.splat(of[N - 1] / divisor);
    let mut slope = value;
    for n in (1..N - 1).rev() {
        value = lanes.mul_add(value, t, lanes.splat(of[n] / divisor));
        slope = lanes.mul_add(slope, t, value);
    }
    [lanes.mul_add(value, t, lanes.splat(of[0] / divisor)), slope]
}

#[cfg(test)]
mod tests {
    use super::super::lanes::Plain;
    use super::*;

    fn check<const REACH: usize>() {
        let splines = |t: f64| splines::<Plain, REACH>(Plain, [t; 4]).map(|all| all.map(|spline| spline[0]));
        for t in [0.0, 0.2, 0.71, 1.0] {
            let [value, slope] = splines(t);
            assert!((value.iter().sum::<f64>() - 1.0).abs() < 1e-15 && slope.iter().sum::<f64>().abs() < 1e-15);
            // The nodes' own places: a spline reproduces them.
            let place: f64 = (0..6).map(|k| (k as f64 - (REACH as f64 - 1.0)) * value[k]).sum();
            assert!((place - t).abs() < 2e-15);
            let (lower, upper) = (splines(t - 1e-5)[0], splines(t + 1e-5)[0]);
            for k in 0..6 {
                assert!(((upper[k] - lower[k]) / 2e-5 - slope[k]).abs() < 1e-9);
            }
        }
        // One spline from cell to cell, up to its last continuous derivative, by differences.
        for k in 1..2 * REACH {
            let (before, after) = (splines(1.0), splines(0.0));
            assert!((before[0][k] - after[0][k - 1]).abs() < 1e-15 && (before[1][k] - after[1][k - 1]).abs() < 1e-15);
        }
    }

    #[test]
    fn the_splines_add_up_to_one_and_slopes_are_slopes() {
        check::<CUBIC>();
        check::<QUINTIC>();
    }
}
