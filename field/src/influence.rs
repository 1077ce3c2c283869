//! The matrix of potential coefficients: what a unit charge on one panel does to the mean potential of another.
//!
//!   P_ij = 1/(A_i A_j) ∫_i ∫_j dS dS' / |x - x'|    (Galerkin)
//!   P_ij = 1/A_j ∫_j dS' / |c_i - x'|                (collocation at the centroid c_i)
//!
//! in 1/m; the potential of panel i is Coulomb's constant times Σ_j P_ij q_j, q_j the charge of panel j. The Galerkin matrix is
//! symmetric and positive definite, and capacitances from it are below the exact ones and converge twice as fast; the
//! collocation matrix is the plain method and stays as the judge.

use std::sync::atomic::{AtomicUsize, Ordering};

use faer::Mat;
use meshes::Vec3;
use rayon::prelude::*;

use crate::panel::{Panel, quadrature};

/// How the boundary condition is imposed on a panel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Testing {
    /// The mean potential of the panel is its electrode's.
    #[default]
    Galerkin,
    /// The potential at its centroid is its electrode's.
    Collocation,
}

/// From this distance on, in units of the sum of both panels' radii, a pair is a pair of points with second moments. What is
/// left out are third moments, at most (1/4) (radius/distance)³ of the entry, and they cancel between the two halves of a
/// quadrilateral.
const MOMENTS_FROM: f64 = 8.0;

/// From this distance on both integrals are by a rule of degree 5; nearer, the inner one is in closed form.
const RULES_FROM: f64 = 3.0;

/// Degree of the outer rule against the closed form when panels are more than their own size apart, and when they are nearer.
const OUTER_APART: usize = 5;
const OUTER_NEAR: usize = 8;

/// Degree of the outer rule when panels touch or nearly touch: the inner potential then has a logarithm in its slope, and
/// the coefficient an error of some 3e-4. Degree 8 changes the capacitance of a disc of 1900 panels by 3e-5, degree 20 by 1e-5,
/// both far below the 2e-4 that constant charges leave there.
const OUTER_TOUCHING: usize = 12;

/// Distance of the panels, in units of the smaller one's radius, below which they count as touching.
const TOUCHING: f64 = 0.25;

/// The matrix of potential coefficients, 1/m. For Galerkin testing only the lower triangle is filled.
pub fn potential_coefficients(panels: &[Panel], testing: Testing) -> Mat<f64> {
    potential_coefficients_telling(panels, None, testing, &|_| ())
}

/// As [`potential_coefficients`]; `progress` hears the fraction of the entries that are done, from any thread. With `images`,
/// one for each panel, each panel's charge goes with one of opposite sign on its image. With mirror images in a plane that no
/// panel touches the Galerkin matrix stays symmetric, and positive definite: it holds the energy of the field above the plane.
///
/// # Panics
/// Another number of images than of panels.
pub fn potential_coefficients_telling(
    panels: &[Panel],
    images: Option<&[Panel]>,
    testing: Testing,
    progress: &(dyn Fn(f64) + Sync),
) -> Mat<f64> {
    assert!(images.is_none_or(|images| images.len() == panels.len()), "an image for each panel");
    let n = panels.len();
    let (done, all) = (AtomicUsize::new(0), (n * (n + 1) / 2) as f64);
    let mut matrix = Mat::<f64>::zeros(n, n);
    let columns: Vec<_> = matrix.col_iter_mut().enumerate().collect();
    columns.into_par_iter().for_each(|(j, mut column)| match testing {
        Testing::Galerkin => {
            for i in j..n {
                column[i] = galerkin(&panels[i], &panels[j], i == j);
                if let Some(images) = images {
                    column[i] -= galerkin(&panels[i], &images[j], false);
                }
            }
            progress((done.fetch_add(n - j, Ordering::Relaxed) + n - j) as f64 / all);
        }
        Testing::Collocation => {
            for i in 0..n {
                column[i] = panels[j].potential(&panels[i].centroid) / panels[j].area;
                if let Some(images) = images {
                    column[i] -= images[j].potential(&panels[i].centroid) / images[j].area;
                }
            }
            progress((done.fetch_add(1, Ordering::Relaxed) + 1) as f64 / n as f64);
        }
    });
    matrix
}

/// The mean of 1 / |x - x'| over two panels, 1/m, to about 1e-6 of its value.
pub fn galerkin(one: &Panel, other: &Panel, same: bool) -> f64 {
    if same {
        return self_coefficient(one);
    }
    let arm = one.centroid - other.centroid;
    let distance = arm.norm();
    let reach = one.radius + other.radius;
    if distance > MOMENTS_FROM * reach {
        return point_like(one, other, &arm, distance);
    }
    if distance > RULES_FROM * reach {
        return by_rules(one, other);
    }
    let small = one.radius.min(other.radius);
    let gap =
        if distance > reach + small { f64::INFINITY } else { meshes::triangle::distance(&one.corners, &other.corners) };
    let degree = match gap / small {
        ..TOUCHING => OUTER_TOUCHING,
        ..1.0 => OUTER_NEAR,
        _ => OUTER_APART,
    };
    let mean = |outer: &Panel, inner: &Panel| {
        let sum: f64 =
            quadrature::rule(degree).on(&outer.corners).map(|(x, weight)| weight * inner.potential(&x)).sum();
        sum / inner.area
    };
    // The potential of the larger panel is the smoother one on the smaller panel. Where both are alike each is the outer one
    // in turn, which keeps the matrix symmetric and lets errors of the rule cancel.
    if one.area > 1.5 * other.area {
        mean(other, one)
    } else if other.area > 1.5 * one.area {
        mean(one, other)
    } else {
        0.5 * (mean(one, other) + mean(other, one))
    }
}

/// 1/R + ½ (M₁ + M₂) : ∇∇(1/R), M the second moments.
fn point_like(one: &Panel, other: &Panel, arm: &Vec3, distance: f64) -> f64 {
    let m: [f64; 6] = std::array::from_fn(|k| one.moments[k] + other.moments[k]);
    let [x, y, z] = [arm.x, arm.y, arm.z];
    let quadratic = m[0] * x * x + m[1] * y * y + m[2] * z * z + 2.0 * (m[3] * x * y + m[4] * x * z + m[5] * y * z);
    let r2 = distance * distance;
    (1.0 + 0.5 * (3.0 * quadratic / r2 - (m[0] + m[1] + m[2])) / r2) / distance
}

fn by_rules(one: &Panel, other: &Panel) -> f64 {
    let rule = quadrature::rule(5);
    let points: Vec<(Vec3, f64)> = rule.on(&other.corners).collect();
    rule.on(&one.corners).map(|(x, weight)| weight * points.iter().map(|(y, w)| w / (x - y).norm()).sum::<f64>()).sum()
}

/// The mean of 1 / |x - x'| over one panel twice:
///
///   P = (4/3) Σ_i (1/a_i) ln[s / (s - a_i)]
///
/// a_i the sides, s half their sum. Source: Eibert and Hansen 1995, equation 15. Checked by
/// `self_coefficient_against_quadrature`.
fn self_coefficient(panel: &Panel) -> f64 {
    let [a, b, c] = panel.corners;
    let sides = [(b - a).norm(), (c - b).norm(), (a - c).norm()];
    let s = 0.5 * sides.iter().sum::<f64>();
    4.0 / 3.0 * sides.iter().map(|side| (s / (s - side)).ln() / side).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ∫ over `outer` of the closed form, on pieces refined towards `inner`.
    fn judge(outer: &Panel, inner: &Panel, depth: u32) -> f64 {
        let apart = meshes::triangle::distance(&outer.corners, &inner.corners);
        if depth == 0 || apart > 2.0 * outer.radius {
            return outer.area
                * quadrature::rule(14).on(&outer.corners).map(|(x, w)| w * inner.potential(&x)).sum::<f64>();
        }
        let [a, b, c] = outer.corners;
        let (ab, bc, ca) = ((a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0);
        [[a, ab, ca], [ab, b, bc], [ca, bc, c], [bc, ca, ab]]
            .map(|corners| judge(&Panel::new(corners), inner, depth - 1))
            .iter()
            .sum()
    }

    fn panels() -> (Panel, Vec<(&'static str, Panel, f64)>) {
        let (a, b, c) = (Vec3::new(0.0, 0.0, 0.0), Vec3::new(1.0, 0.0, 0.0), Vec3::new(0.3, 0.7, 0.0));
        let moved = |d: Vec3| Panel::new([a + d, b + d, c + d]);
        let list = vec![
            ("neighbour in the plane", Panel::new([b, a, Vec3::new(0.5, -0.8, 0.0)]), 5e-4),
            ("neighbour at a right angle", Panel::new([b, a, Vec3::new(0.5, 0.0, -0.8)]), 1e-4),
            ("long thin neighbour", Panel::new([b, a, Vec3::new(0.0, -0.03, 0.0)]), 1e-4),
            ("at a corner", Panel::new([b, Vec3::new(1.8, -0.5, 0.1), Vec3::new(1.9, 0.4, 0.0)]), 1e-4),
            ("just above", moved(Vec3::new(0.0, 0.0, 0.05)), 1e-4),
            ("above", moved(Vec3::new(0.2, 0.1, 0.4)), 1e-4),
            ("one size away", moved(Vec3::new(1.5, 0.4, 0.3)), 1e-5),
            ("at the edge of the rules", moved(Vec3::new(4.0, 0.6, 0.5)), 1e-6),
            ("at the edge of the moments", moved(Vec3::new(8.0, 5.4, 4.0)), 1e-5),
        ];
        (Panel::new([a, b, c]), list)
    }

    #[test]
    fn coefficients_against_refined_quadrature() {
        let (one, others) = panels();
        // Tolerances: what the degree of the rule leaves over at that distance; where panels touch, its logarithm.
        for (name, other, tolerance) in others {
            let exact = judge(&one, &other, 12) / (one.area * other.area);
            let error = galerkin(&one, &other, false) / exact - 1.0;
            println!("{name:28} {error:9.1e}");
            assert!(error.abs() < tolerance, "{name}: relative error {error:e}");
            let swapped = galerkin(&other, &one, false);
            assert!((galerkin(&one, &other, false) / swapped - 1.0).abs() < 1e-13, "{name}: symmetric up to rounding");
        }
    }

    #[test]
    fn self_coefficient_against_quadrature() {
        for tip in [Vec3::new(0.3, 0.7, 0.0), Vec3::new(1.0, 0.05, 0.3)] {
            let panel = Panel::new([Vec3::zeros(), Vec3::x(), tip]);
            let exact = judge(&panel, &panel, 8) / (panel.area * panel.area);
            // The judge's own error at depth 8: logarithms on edges of pieces of 1/256 of the panel.
            assert!((self_coefficient(&panel) / exact - 1.0).abs() < 1e-6);
        }
    }
}
