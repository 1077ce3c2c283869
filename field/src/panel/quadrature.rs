//! Gauss rules on triangles.

use std::sync::LazyLock;

use meshes::Vec3;
use quadraturerules::{Domain, QuadratureRule, single_integral_quadrature};

use super::Panel;

/// A rule on the triangle: barycentric coordinates and weights that sum to one.
#[derive(Clone, Debug)]
pub struct Rule {
    /// Barycentric coordinates of each point.
    pub points: Vec<[f64; 3]>,
    /// Weights.
    pub weights: Vec<f64>,
}

/// Highest degree of the tabulated rules.
const HIGHEST: usize = 20;

static RULES: LazyLock<Vec<Rule>> = LazyLock::new(|| {
    (0..=HIGHEST)
        .map(|degree| {
            let (points, weights) =
                single_integral_quadrature(QuadratureRule::XiaoGimbutas, Domain::Triangle, degree.max(1))
                    .expect("the tables hold this rule");
            let total: f64 = weights.iter().sum();
            Rule {
                points: points.chunks_exact(3).map(|b| [b[0], b[1], b[2]]).collect(),
                weights: weights.iter().map(|w| w / total).collect(),
            }
        })
        .collect()
});

/// The rule that integrates polynomials up to this degree exactly (Xiao and Gimbutas 2010).
///
/// # Panics
/// The degree is above 20.
pub fn rule(degree: usize) -> &'static Rule {
    &RULES[degree]
}

impl Rule {
    /// Its points on a panel, m.
    pub fn on<'a>(&'a self, corners: &'a [Vec3; 3]) -> impl Iterator<Item = (Vec3, f64)> + 'a {
        let [a, b, c] = corners;
        self.points.iter().zip(&self.weights).map(move |(l, w)| (a * l[0] + b * l[1] + c * l[2], *w))
    }
}

/// ∫ dS / |x - y| over the panel, m, and its gradient, by the rule of that degree. Good at a distance: the error falls as
/// (size / distance)^(degree + 1).
pub fn potential_and_gradient(panel: &Panel, x: &Vec3, degree: usize) -> (f64, Vec3) {
    let (mut potential, mut gradient) = (0.0, Vec3::zeros());
    for (y, weight) in rule(degree).on(&panel.corners) {
        let d = x - y;
        let r = d.norm();
        potential += weight / r;
        gradient -= d * (weight / (r * r * r));
    }
    (potential * panel.area, gradient * panel.area)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rules_integrate_polynomials_of_their_degree() {
        // ∫ λ0^i λ1^j dS / area = 2 i! j! / (i + j + 2)!
        let factorial = |n: usize| (1..=n).map(|k| k as f64).product::<f64>();
        for degree in 0..=HIGHEST {
            let rule = rule(degree);
            for i in 0..=degree {
                for j in 0..=degree - i {
                    let exact = 2.0 * factorial(i) * factorial(j) / factorial(i + j + 2);
                    let sum: f64 = rule
                        .points
                        .iter()
                        .zip(&rule.weights)
                        .map(|(l, w)| w * l[0].powi(i as i32) * l[1].powi(j as i32))
                        .sum();
                    // The published tables carry some fifteen digits.
                    assert!((sum - exact).abs() < 1e-13, "degree {degree}, λ0^{i} λ1^{j}: {sum} instead of {exact}");
                }
            }
        }
    }
}
