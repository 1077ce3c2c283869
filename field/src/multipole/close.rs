//! Potentials of one panel at many points near it, a vector of points at a time.
//!
//! [`Panel::potential_and_gradient`] with its logarithm and arctangent by halving and a polynomial: with u = L/S of an edge
//! (S = R₊ + R₋), f = 2 artanh u and artanh u = 2 artanh[u / (1 + √(1 - u²))]; arctan t = 2 arctan[t / (1 + √(1 + t²))].

use meshes::Vec3;
use pulp::{Arch, Simd, WithSimd};

use crate::panel::Panel;

/// Points in whole vectors, with weights that are zero where a vector is not full.
#[derive(Clone, Debug, Default)]
pub(super) struct Weighted {
    x: Vec<f64>,
    y: Vec<f64>,
    z: Vec<f64>,
    weight: Vec<f64>,
}

/// Widest vector, numbers.
const WIDEST: usize = 8;

impl Weighted {
    pub fn set(&mut self, points: impl Iterator<Item = (Vec3, f64)>) {
        for list in [&mut self.x, &mut self.y, &mut self.z, &mut self.weight] {
            list.clear();
        }
        for (p, weight) in points {
            self.x.push(p.x);
            self.y.push(p.y);
            self.z.push(p.z);
            self.weight.push(weight);
        }
        let whole = self.x.len().next_multiple_of(WIDEST);
        for list in [&mut self.x, &mut self.y, &mut self.z] {
            let last = list.last().copied().unwrap_or(0.0);
            list.resize(whole, last);
        }
        self.weight.resize(whole, 0.0);
    }

    /// Σ weight / |x - y|, 1/m.
    pub fn inverse_distance(&self, arch: Arch, at: &Vec3) -> f64 {
        arch.dispatch(Distances { points: self, at })
    }
}

/// Σ weight ∫ dS / |x - y| over the points, m: relative error 1e-9 of points outside the panel. No point is nearer to it than
/// `gap`, m.
pub(super) fn potential(arch: Arch, panel: &Panel, points: &Weighted, gap: f64) -> f64 {
    // u = 1/√(1 + (2 gap/L)²) at most, and at most twice the radius is L.
    match gap / panel.radius {
        1.0.. => arch.dispatch(Sum::<1> { panel, points }),
        0.4.. => arch.dispatch(Sum::<2> { panel, points }),
        _ => arch.dispatch(Sum::<5> { panel, points }),
    }
}

/// With so many halvings of artanh. With one, 0.71 becomes 0.42; with two, 0.93 becomes 0.39; with five, 1 - 1e-5, a point at
/// 0.002 of an edge's length from it, becomes 0.48: nearer ones lose digits that integrals over them do not see.
struct Sum<'a, const HALVINGS: usize> {
    panel: &'a Panel,
    points: &'a Weighted,
}

struct Distances<'a> {
    points: &'a Weighted,
    at: &'a Vec3,
}

impl WithSimd for Distances<'_> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> f64 {
        let Self { points, at } = self;
        let [x, y, z] = [at.x, at.y, at.z].map(|v| simd.splat_f64s(v));
        let [xs, ys, zs, ws] = [&points.x, &points.y, &points.z, &points.weight].map(|l| S::as_simd_f64s(l).0);
        let mut sum = simd.splat_f64s(0.0);
        for v in 0..xs.len() {
            let (dx, dy, dz) = (simd.sub_f64s(x, xs[v]), simd.sub_f64s(y, ys[v]), simd.sub_f64s(z, zs[v]));
            let r2 = simd.mul_add_e_f64s(dx, dx, simd.mul_add_e_f64s(dy, dy, simd.mul_f64s(dz, dz)));
            // A point on itself does not act.
            let over = simd.div_f64s(ws[v], simd.sqrt_f64s(r2));
            let zero = simd.splat_f64s(0.0);
            sum = simd.add_f64s(sum, simd.select_f64s(simd.greater_than_f64s(r2, zero), over, zero));
        }
        simd.reduce_sum_f64s(sum)
    }
}

/// artanh(√w)/√w up to w = 0.29 and arctan(√w)/√w up to w = 0.18, their Taylor series: what is left out is below 1e-9.
const TERMS: usize = 14;

impl<const HALVINGS: usize> WithSimd for Sum<'_, HALVINGS> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> f64 {
        let Self { panel, points } = self;
        let number = |v: f64| simd.splat_f64s(v);
        let (one, zero) = (number(1.0), number(0.0));
        let triple = |v: &Vec3| [number(v.x), number(v.y), number(v.z)];
        let minus = |a: [S::f64s; 3], b: [S::f64s; 3]| -> [S::f64s; 3] {
            [simd.sub_f64s(a[0], b[0]), simd.sub_f64s(a[1], b[1]), simd.sub_f64s(a[2], b[2])]
        };
        let dot = |a: [S::f64s; 3], b: [S::f64s; 3]| {
            simd.mul_add_e_f64s(a[0], b[0], simd.mul_add_e_f64s(a[1], b[1], simd.mul_f64s(a[2], b[2])))
        };
        // Of each edge: its vector, its length, and the outward normal in the plane over one.
        let edges: [Vec3; 3] = std::array::from_fn(|i| panel.corners[(i + 1) % 3] - panel.corners[i]);
        let lengths = edges.map(|e| e.norm());
        let outward: [Vec3; 3] = std::array::from_fn(|i| edges[i].cross(&panel.normal) / lengths[i]);
        let corners = panel.corners.map(|c| triple(&c));
        let normal = triple(&panel.normal);
        let [xs, ys, zs, ws] = [&points.x, &points.y, &points.z, &points.weight].map(|l| S::as_simd_f64s(l).0);
        let mut total = zero;
        for v in 0..xs.len() {
            let x = [xs[v], ys[v], zs[v]];
            let r = [minus(corners[0], x), minus(corners[1], x), minus(corners[2], x)];
            let length =
                [simd.sqrt_f64s(dot(r[0], r[0])), simd.sqrt_f64s(dot(r[1], r[1])), simd.sqrt_f64s(dot(r[2], r[2]))];
            let mut value = zero;
            for i in 0..3 {
                let j = (i + 1) % 3;
                let inverse = simd.div_f64s(one, simd.add_f64s(length[i], length[j]));
                let mut u = simd.mul_f64s(number(lengths[i]), inverse);
                for _ in 0..HALVINGS {
                    let rest = simd.max_f64s(simd.negate_mul_add_e_f64s(u, u, one), zero);
                    u = simd.div_f64s(u, simd.add_f64s(one, simd.sqrt_f64s(rest)));
                }
                let w = simd.mul_f64s(u, u);
                let mut series = number(1.0 / (2 * TERMS + 1) as f64);
                for k in (0..TERMS).rev() {
                    series = simd.mul_add_e_f64s(series, w, number(1.0 / (2 * k + 1) as f64));
                }
                let f = simd.mul_f64s(simd.mul_f64s(number(f64::from(1 << (HALVINGS + 1))), u), series);
                value = simd.mul_add_e_f64s(dot(triple(&outward[i]), r[i]), f, value);
            }
            let height = simd.neg_f64s(dot(normal, r[0]));
            let [a, b, c] = length;
            let product = simd.mul_f64s(simd.mul_f64s(a, b), c);
            let across = dot([dot(r[0], r[1]), dot(r[1], r[2]), dot(r[2], r[0])], [c, a, b]);
            let denominator = simd.add_f64s(product, across);
            let numerator = simd.mul_f64s(number(2.0 * panel.area), height);
            let size =
                simd.sqrt_f64s(simd.mul_add_e_f64s(numerator, numerator, simd.mul_f64s(denominator, denominator)));
            let below = simd.max_f64s(simd.add_f64s(size, denominator), number(f64::MIN_POSITIVE));
            let mut t = simd.div_f64s(numerator, below);
            // One radius away, a quarter of the solid angle is below 0.4 already.
            let quarters = if HALVINGS > 1 { 2 } else { 0 };
            for _ in 0..quarters {
                let root = simd.sqrt_f64s(simd.mul_add_e_f64s(t, t, one));
                t = simd.div_f64s(t, simd.add_f64s(one, root));
            }
            let w = simd.neg_f64s(simd.mul_f64s(t, t));
            let mut series = number(1.0 / (2 * TERMS + 1) as f64);
            for k in (0..TERMS).rev() {
                series = simd.mul_add_e_f64s(series, w, number(1.0 / (2 * k + 1) as f64));
            }
            // So many halvings and one more, and the solid angle is twice the angle.
            let angle = simd.mul_f64s(simd.mul_f64s(number(f64::from(4 << quarters)), t), series);
            value = simd.negate_mul_add_e_f64s(height, angle, value);
            total = simd.mul_add_e_f64s(ws[v], value, total);
        }
        simd.reduce_sum_f64s(total)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vectors_agree_with_the_closed_form() {
        let panel = Panel::new([Vec3::new(0.0, 0.0, 0.0), Vec3::new(1.0, 0.0, 0.2), Vec3::new(0.3, 0.8, -0.1)]);
        let [a, b, c] = panel.corners;
        let mut points = Weighted::default();
        for (u, v) in [(0.3, 0.3), (0.01, 0.5), (-0.004, 0.9), (2.0, 2.0), (0.5, -0.01), (0.7, 0.301), (-30.0, 8.0)] {
            for h in [0.0, 1e-3, 0.1, -0.7, 20.0] {
                let x = a + (b - a) * u + (c - a) * v + panel.normal * h;
                let inside = u > 0.0 && v > 0.0 && u + v < 1.0;
                if inside && h == 0.0 {
                    continue;
                }
                let gap = (meshes::triangle::closest_point(&x, &panel.corners) - x).norm();
                points.set([(x, 1.0)].into_iter());
                let (found, exact) = (potential(Arch::new(), &panel, &points, gap), panel.potential(&x));
                // Far points cancel in both.
                assert!((found / exact - 1.0).abs() < 1e-8, "{u} {v} {h}: {found} {exact}");
            }
        }
    }
}
