//! Gauss's rules on [0, 1].

use std::num::NonZeroUsize;
use std::sync::OnceLock;

use gauss_quad::GaussLegendre;

/// Points and weights of a Gauss-Legendre rule on [0, 1].
#[derive(Clone, Debug)]
pub(crate) struct Gauss {
    /// Ascending.
    pub points: Vec<f64>,
    /// Their sum is 1.
    pub weights: Vec<f64>,
}

/// Most points of a rule.
const MOST: usize = 64;

/// The rule of `n` points, exact for degree 2n - 1; up to 64 points. Checked by `rules_integrate_powers`.
///
/// # Panics
/// No points, or more than 64.
pub(crate) fn gauss(n: usize) -> &'static Gauss {
    static RULES: [OnceLock<Gauss>; MOST + 1] = [const { OnceLock::new() }; MOST + 1];
    let count = NonZeroUsize::new(n).expect("a rule has points");
    RULES[n].get_or_init(|| {
        let rule = GaussLegendre::new(count);
        let mut pairs: Vec<(f64, f64)> = rule.nodes().copied().zip(rule.weights().copied()).collect();
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
        // From [-1, 1].
        let points = pairs.iter().map(|(x, _)| 0.5 * (1.0 + x)).collect();
        Gauss { points, weights: pairs.iter().map(|(_, w)| 0.5 * w).collect() }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rules_integrate_powers() {
        for n in 1..=MOST {
            let rule = gauss(n);
            for degree in 0..2 * n {
                let sum: f64 = rule.points.iter().zip(&rule.weights).map(|(x, w)| w * x.powi(degree as i32)).sum();
                // Rounding of n terms.
                assert!((sum * (degree + 1) as f64 - 1.0).abs() < 1e-13, "{n} points, degree {degree}");
            }
        }
    }
}
