//! The slow, obvious way: cut the panel into ever smaller ones towards the point.

use meshes::Vec3;

use super::{Panel, quadrature};

/// Halvings after which a piece that still holds the point is dropped: it is 2^-40 of the panel's size by then, and so is its
/// share of the potential.
const DEEPEST: u32 = 40;

/// ∫ dS / |x - y| over the panel, m, and its gradient, by quadrature on pieces that are small against their distance.
///
/// Relative error about 1e-12 for points off the panel; on it the potential is good to 1e-10, and the gradient in the plane is
/// not defined by this sum.
pub fn potential_and_gradient(panel: &Panel, x: &Vec3) -> (f64, Vec3) {
    pieces(panel, x, 0)
}

fn pieces(panel: &Panel, x: &Vec3, depth: u32) -> (f64, Vec3) {
    let distance = (meshes::triangle::closest_point(x, &panel.corners) - x).norm();
    // Degree 14 at three radii: (1/4)^15, 1e-9 of what is left at each level, times the small constant of the rule.
    if distance > 3.0 * panel.radius {
        return quadrature::potential_and_gradient(panel, x, 14);
    }
    if depth == DEEPEST {
        return (0.0, Vec3::zeros());
    }
    let [a, b, c] = panel.corners;
    let (ab, bc, ca) = ((a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0);
    [[a, ab, ca], [ab, b, bc], [ca, bc, c], [bc, ca, ab]].into_iter().fold((0.0, Vec3::zeros()), |(p, g), corners| {
        let (dp, dg) = pieces(&Panel::new(corners), x, depth + 1);
        (p + dp, g + dg)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn closed_form_agrees_with_brute_force() {
        let shapes = [
            [Vec3::new(0.0, 0.0, 0.0), Vec3::new(1.0, 0.0, 0.2), Vec3::new(0.3, 0.8, -0.1)],
            // Long and thin, as panels along a free edge are.
            [Vec3::new(0.0, 0.0, 1.0), Vec3::new(1.0, 0.0, 1.0), Vec3::new(1.0, 0.02, 1.0)],
        ];
        for corners in shapes {
            let panel = Panel::new(corners);
            let [a, b, c] = corners;
            for (u, v) in [(0.3, 0.3), (0.01, 0.5), (-0.4, 0.9), (2.0, 2.0), (1.2, -0.1), (-30.0, 8.0)] {
                for h in [1e-3, 0.1, -0.7, 20.0] {
                    let x = a + (b - a) * u + (c - a) * v + panel.normal * h;
                    let (p, g) = panel.potential_and_gradient(&x);
                    let (bp, bg) = potential_and_gradient(&panel, &x);
                    assert!((p / bp - 1.0).abs() < 1e-11, "potential {p} {bp} at {u} {v} {h}");
                    assert!((g - bg).norm() < 1e-10 * bg.norm(), "gradient {g} {bg} at {u} {v} {h}");
                }
            }
            // On the panel, on an edge, at a corner: the potential is continuous.
            for x in [panel.centroid, (a + b) / 2.0, c] {
                let p = panel.potential(&x);
                let bp = potential_and_gradient(&panel, &x).0;
                assert!((p / bp - 1.0).abs() < 1e-9, "potential {p} {bp} at {x}");
                assert!(panel.potential_and_gradient(&x).1.iter().all(|g| g.is_finite()));
            }
        }
    }
}
