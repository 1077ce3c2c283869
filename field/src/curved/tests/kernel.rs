use std::f64::consts::PI;

use meshes::Patch;

use super::super::kernel::{Moments, Precision, near_field, near_moments, own_moments};
use super::super::legendre::MAX_ORDER;
use super::*;

fn whole(patch: &Patch) -> (&Patch, Element) {
    (patch, Element { patch: 0, low: [0.0; 2], high: [1.0; 2] })
}

/// Other rules on other rectangles than any accuracy asks for.
const STRICT: Precision = Precision { accept: 4.0, fewer: 30.0, far: 60.0, singular: [24, 30] };

/// ∫∫ dx dy / r over a rectangle in the plane z = 0, in closed form (Durand 1964).
fn rectangle([x0, x1]: [f64; 2], [y0, y1]: [f64; 2], p: &Vec3) -> f64 {
    let corner = |x: f64, y: f64| {
        let (u, v, z) = (x - p.x, y - p.y, p.z.abs());
        let r = (u * u + v * v + z * z).sqrt();
        let logs = [(u, v), (v, u)].map(|(a, b)| {
            // ln(b + r), without cancellation where b is negative.
            let log = if b > 0.0 { (b + r).ln() } else { ((a * a + z * z) / (r - b)).ln() };
            if a == 0.0 { 0.0 } else { a * log }
        });
        let angle = if z > 0.0 { z * (u * v / (z * r)).atan() } else { 0.0 };
        logs[0] + logs[1] - angle
    };
    corner(x1, y1) - corner(x0, y1) - corner(x1, y0) + corner(x0, y0)
}

/// A flat patch without stretching: its sides are smooth.
fn flat() -> Patch {
    let mut patch = patches(&plate(1.0, 0.4)).unwrap()[0];
    patch.sides = [meshes::Side::Smooth; 4];
    patch
}

#[test]
fn the_potential_of_an_even_charge_on_a_rectangle_is_in_closed_form() {
    let patch = flat();
    let (patch, element) = whole(&patch);
    let exact = |p: &Vec3| rectangle([-0.5, 0.5], [-0.2, 0.2], p) / 0.4;
    for accuracy in [1e-3, 1e-5, 1e-8] {
        let precision = Precision::new(5, accuracy);
        for z in [0.5, 1e-1, 1e-3, 1e-6] {
            for (x, y) in [(0.1, 0.07), (0.499, 0.0), (0.6, 0.25)] {
                let point = Vec3::new(x, y, z);
                let mut moments: Moments = [[0.0; MAX_ORDER]; MAX_ORDER];
                near_moments(patch, &element, &point, &precision, &mut moments);
                let error = (moments[0][0] / exact(&point) - 1.0).abs();
                // A twentieth is promised for each rectangle; they add up.
                assert!(error < 0.5 * accuracy, "asked {accuracy:.0e} at {point:?}: {error:.1e}");
            }
        }
        for at in [[0.5, 0.5], [0.02, 0.3], [0.98, 0.97]] {
            let mut moments: Moments = [[0.0; MAX_ORDER]; MAX_ORDER];
            own_moments(patch, &element, at, &precision, &mut moments);
            let error = (moments[0][0] / exact(&patch.at(at[0], at[1])) - 1.0).abs();
            assert!(error < 0.5 * accuracy, "asked {accuracy:.0e} on {at:?}: {error:.1e}");
        }
    }
}

fn curved_patches() -> Vec<Patch> {
    let shapes = [
        sphere(1.0),
        ring(1.0, 0.1),
        plate(1.0, 1.0),
        Shape::Box { size: [1.0, 0.5, 0.02] },
        perforated(2.2, Hole::Round, 0.1),
    ];
    shapes.iter().map(|shape| *patches(shape).unwrap().last().unwrap()).collect()
}

#[test]
fn moments_of_all_orders_agree_with_finer_rules() {
    for patch in curved_patches() {
        let (patch, element) = whole(&patch);
        for (accuracy, order) in [(1e-4, 3), (1e-8, 6)] {
            let precision = Precision::new(order, accuracy);
            let compare = |place: &str, integrate: &dyn Fn(&Precision, &mut Moments)| {
                let [mut moments, mut exact]: [Moments; 2] = [[[0.0; MAX_ORDER]; MAX_ORDER]; 2];
                integrate(&precision, &mut moments);
                integrate(&STRICT, &mut exact);
                for i in 0..order {
                    for j in 0..order {
                        let error = (moments[i][j] - exact[i][j]).abs() / exact[0][0];
                        // A twentieth is promised where tangents are even; next to stretched corners of narrow walls
                        // it is four of it.
                        assert!(
                            error < 5.0 * accuracy,
                            "{place} {i} {j} asked {accuracy:.0e}: {error:.1e} of {patch:?}"
                        );
                    }
                }
            };
            for at in [[0.41, 0.57], [0.1, 0.9], [0.03, 0.5]] {
                compare("own", &|p, m| own_moments(patch, &element, at, p, m));
                let [s, t] = patch.tangents(at[0], at[1]);
                let normal = s.cross(&t).normalize() * (s.norm() + t.norm());
                for height in [0.3, 1e-2, 1e-6] {
                    let point = patch.at(at[0], at[1]) + normal * height;
                    compare("near", &|p, m| near_moments(patch, &element, &point, p, m));
                }
            }
        }
    }
}

#[test]
fn gradients_are_derivatives_and_jump_by_the_charge() {
    let mut charge: Moments = [[0.0; MAX_ORDER]; MAX_ORDER];
    (charge[0][0], charge[1][0], charge[0][2]) = (1.0, 0.3, -0.2);
    for patch in curved_patches() {
        let (patch, element) = whole(&patch);
        let precision = Precision::new(3, 1e-10);
        let field = |point: Vec3| {
            let mut sums = [[0.0; 4]];
            near_field(patch, &element, &point, &precision, &[charge], &mut sums);
            sums[0]
        };
        let at = [0.4, 0.55];
        let [s, t] = patch.tangents(at[0], at[1]);
        let (foot, normal) = (patch.at(at[0], at[1]), s.cross(&t).normalize());
        let size = s.norm().min(t.norm());
        for height in [0.5, 0.1] {
            let (point, h) = (foot + normal * (height * size), 1e-3 * height * size);
            let here = field(point);
            let scale = Vec3::new(here[1], here[2], here[3]).norm();
            for k in 0..3 {
                let step = Vec3::ith(k, h);
                // Fourth order: h⁴ = 1e-12 of the distance.
                let near = field(point + step)[0] - field(point - step)[0];
                let far = field(point + step * 2.0)[0] - field(point - step * 2.0)[0];
                let slope = (8.0 * near - far) / (12.0 * h);
                assert!((slope - here[k + 1]).abs() < 1e-6 * scale, "{slope} {} of {scale}", here[k + 1]);
            }
        }
        // Across the surface the normal part falls by 4π times the density, as far as 1e-6 is no distance.
        let off = normal * (1e-6 * size);
        let (above, below) = (field(foot + off), field(foot - off));
        let jump: f64 = (0..3).map(|k| (above[k + 1] - below[k + 1]) * normal[k]).sum();
        let (x, y) = (2.0 * at[0] - 1.0, 2.0 * at[1] - 1.0);
        let density = (1.0 + 0.3 * x - 0.2 * (1.5 * y * y - 0.5)) / s.cross(&t).norm();
        assert!((jump / (-4.0 * PI * density) - 1.0).abs() < 1e-4, "{jump} {density} of {patch:?}");
    }
}
