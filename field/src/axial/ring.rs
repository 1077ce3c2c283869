//! The thin ring of charge, many at a time: potential and gradient by the arithmetic-geometric mean, in vectors.

use std::ops::Range;

use pulp::{Arch, Simd, WithSimd};

/// Rings whose numbers stand side by side: a multiple of every vector's width.
pub(crate) const GROUP: usize = 8;

/// Largest difference of the two means, as a part of them, at which the next step is exact to rounding: it leaves c⁴/64 and
/// less.
const SETTLED: f64 = 1e-4;

/// Squared distance below which a ring counts as that far, in units of (R + ρ)² + z²: a node that rounding put on the point.
const TOUCHING: f64 = 1e-34;

/// What a unit charge on a ring (R, Z) does at (ρ, z), Coulomb's constant left out.
///
///   a² = (R + ρ)² + (z - Z)²,   b² = (R - ρ)² + (z - Z)²,   m = 1 - b²/a²
///   φ = 1/M(a, b) = (2/π) K(m)/a,   M the arithmetic-geometric mean
///   ∂φ/∂z = -(2/π) (z - Z) E/(a b²),   ∂φ/∂ρ = -(2/π) ρ [(b²/a²) V - s W]/(a b²)
///   s = [(ρ - R)(ρ + 3R) + (z - Z)²]/a²,   W = (b²/a²) V - E
///   E = K (1 - m/2 - m² τ),   V = K (1/2 + (2 + m) τ),   m² τ = Σ_{n≥1} 2^(n-1) c_n²
///
/// c_n = (a_n - b_n)/2 from step to step of the mean, with a_0 = 1, b_0 = b/a; c_1/m = 1/(2 (1 + b/a)) has no cancellation,
/// nor has c_{n+1} = c_n²/(4 a_{n+1}), and so nothing cancels near the axis. Sources: Abramowitz and Stegun 17.6; the ring in
/// Jackson, problem 3.12 and section 5.5; V and W are C and D of `source.rs` combined. Relative error below 1e-14 away from
/// the ring. Checked by `a_ring_is_the_elliptic_integrals`.
#[inline(always)]
fn ring<S: Simd, const GRADIENT: bool>(
    simd: S,
    rho: S::f64s,
    z: S::f64s,
    radius: S::f64s,
    height: S::f64s,
) -> (S::f64s, S::f64s, S::f64s) {
    let number = |x: f64| simd.splat_f64s(x);
    let (plus, minus) = (simd.add_f64s(rho, radius), simd.sub_f64s(rho, radius));
    let along = simd.sub_f64s(z, height);
    let along2 = simd.mul_f64s(along, along);
    let a2 = simd.mul_add_e_f64s(plus, plus, along2);
    let b2 = simd.mul_add_e_f64s(minus, minus, along2);
    let b2 = simd.max_f64s(b2, simd.mul_f64s(a2, number(TOUCHING)));
    let (half, quarter) = (number(0.5), number(0.25));
    if !GRADIENT {
        let (mut a, mut b) = (simd.sqrt_f64s(a2), simd.sqrt_f64s(b2));
        loop {
            let mean = simd.mul_f64s(half, simd.add_f64s(a, b));
            let c = simd.sub_f64s(a, mean);
            if within(simd, c, simd.mul_f64s(mean, number(SETTLED))) {
                // a_{n+2} = a_{n+1} - c_{n+2}, c_{n+2} = c_{n+1}²/(4 a_{n+2}).
                let next = simd.div_f64s(simd.mul_f64s(quarter, simd.mul_f64s(c, c)), mean);
                let potential = simd.div_f64s(number(1.0), simd.sub_f64s(mean, next));
                return (potential, number(0.0), number(0.0));
            }
            b = simd.sqrt_f64s(simd.mul_f64s(a, b));
            a = mean;
        }
    }
    let inverse_a2 = simd.div_f64s(number(1.0), a2);
    let inverse_a = simd.sqrt_f64s(inverse_a2);
    let m1 = simd.mul_f64s(b2, inverse_a2);
    // m = 4 R ρ/a², not 1 - m1.
    let m = simd.mul_f64s(simd.mul_f64s(number(4.0), simd.mul_f64s(rho, radius)), inverse_a2);
    let (mut a, mut b) = (number(1.0), simd.sqrt_f64s(m1));
    // c_n/m and the running sum 2 τ.
    let mut power = number(1.0);
    let mut mean = simd.mul_f64s(half, simd.add_f64s(a, b));
    let mut c = simd.div_f64s(quarter, mean);
    let mut tau = simd.mul_f64s(c, c);
    loop {
        if within(simd, simd.mul_f64s(c, m), simd.mul_f64s(mean, number(SETTLED))) {
            break;
        }
        b = simd.sqrt_f64s(simd.mul_f64s(a, b));
        a = mean;
        mean = simd.mul_f64s(half, simd.add_f64s(a, b));
        let c2m = simd.mul_f64s(m, simd.mul_f64s(c, c));
        c = simd.div_f64s(simd.mul_f64s(quarter, c2m), mean);
        power = simd.add_f64s(power, power);
        tau = simd.mul_add_e_f64s(simd.mul_f64s(power, c), c, tau);
    }
    let last = simd.div_f64s(simd.mul_f64s(quarter, simd.mul_f64s(m, simd.mul_f64s(c, c))), mean);
    mean = simd.sub_f64s(mean, simd.mul_f64s(last, m));
    power = simd.add_f64s(power, power);
    tau = simd.mul_add_e_f64s(simd.mul_f64s(power, last), last, tau);
    // (2/π) K, without 1/a.
    let k = simd.div_f64s(number(1.0), mean);
    let m_tau = simd.mul_f64s(m, tau);
    let e = simd.mul_f64s(k, simd.negate_mul_add_e_f64s(m, simd.add_f64s(half, m_tau), number(1.0)));
    let v = simd.mul_f64s(k, simd.add_f64s(half, simd.mul_add_e_f64s(number(2.0), tau, m_tau)));
    let mv = simd.mul_f64s(m1, v);
    let w = simd.sub_f64s(mv, e);
    let three = simd.mul_add_e_f64s(number(3.0), radius, rho);
    let s = simd.mul_f64s(simd.mul_add_e_f64s(minus, three, along2), inverse_a2);
    let scale = simd.div_f64s(inverse_a, b2);
    let outward = simd.mul_f64s(simd.mul_f64s(rho, scale), simd.negate_mul_add_e_f64s(s, w, mv));
    let upward = simd.mul_f64s(simd.mul_f64s(along, scale), e);
    (simd.mul_f64s(k, inverse_a), simd.neg_f64s(outward), simd.neg_f64s(upward))
}

/// Whether c ≤ limit in every lane.
#[inline(always)]
fn within<S: Simd>(simd: S, c: S::f64s, limit: S::f64s) -> bool {
    simd.first_true_m64s(simd.less_than_f64s(limit, c)) >= S::F64_LANES
}

/// Rings side by side, filled up to whole groups by rings without charge.
#[derive(Clone, Debug, Default)]
pub(crate) struct Rings {
    pub radius: Vec<f64>,
    pub height: Vec<f64>,
}

impl Rings {
    pub fn clear(&mut self) {
        self.radius.clear();
        self.height.clear();
    }

    pub fn push(&mut self, [radius, height]: [f64; 2]) {
        self.radius.push(radius);
        self.height.push(height);
    }

    /// Repeats the last ring until groups are whole.
    pub fn fill(&mut self) {
        let whole = self.radius.len().next_multiple_of(GROUP);
        let (radius, height) = (self.radius.last().copied(), self.height.last().copied());
        self.radius.resize(whole, radius.unwrap_or(1.0));
        self.height.resize(whole, height.unwrap_or(0.0));
    }
}

struct Potentials<'a> {
    at: [f64; 2],
    rings: &'a Rings,
    values: &'a mut [f64],
}

impl WithSimd for Potentials<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let [rho, z] = self.at.map(|x| simd.splat_f64s(x));
        let radius = S::as_simd_f64s(&self.rings.radius).0;
        let height = S::as_simd_f64s(&self.rings.height).0;
        let values = S::as_mut_simd_f64s(self.values).0;
        for ((r, h), value) in radius.iter().zip(height).zip(values) {
            *value = ring::<S, false>(simd, rho, z, *r, *h).0;
        }
    }
}

/// Potential of each ring (whole groups) at (ρ, z).
pub(crate) fn potentials(arch: Arch, at: [f64; 2], rings: &Rings, values: &mut Vec<f64>) {
    values.resize(rings.radius.len(), 0.0);
    arch.dispatch(Potentials { at, rings, values });
}

struct Sums<'a> {
    at: [f64; 2],
    rings: &'a Rings,
    /// `channel * rings + ring`.
    charge: &'a [f64],
    /// Which rings count, in groups.
    groups: &'a [Range<usize>],
    /// One where a ring counts all the same, zero where it does not; empty where all count.
    counted: &'a [f64],
    sums: &'a mut [[f64; 3]],
}

impl WithSimd for Sums<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let [rho, z] = self.at.map(|x| simd.splat_f64s(x));
        let radius = S::as_simd_f64s(&self.rings.radius).0;
        let height = S::as_simd_f64s(&self.rings.height).0;
        let charge = S::as_simd_f64s(self.charge).0;
        let counted = S::as_simd_f64s(self.counted).0;
        let (n, zero) = (radius.len(), simd.splat_f64s(0.0));
        // Rings in blocks that stay in registers' reach; for each block every channel.
        const BLOCK: usize = 16;
        let mut values = [[zero; 3]; BLOCK];
        let vectors = GROUP / S::F64_LANES;
        let blocks = self.groups.iter().flat_map(|range| {
            let end = vectors * range.end;
            (vectors * range.start..end).step_by(BLOCK).map(move |first| first..(first + BLOCK).min(end))
        });
        for block in blocks {
            for (k, value) in block.clone().zip(&mut values) {
                let (p, outward, upward) = ring::<S, true>(simd, rho, z, radius[k], height[k]);
                *value = [p, outward, upward];
                if !counted.is_empty() {
                    let counts = simd.less_than_f64s(zero, counted[k]);
                    *value = value.map(|x| simd.select_f64s(counts, x, zero));
                }
            }
            for (c, sum) in self.sums.iter_mut().enumerate() {
                let mut total = [zero; 3];
                for (q, value) in charge[c * n..][block.clone()].iter().zip(&values) {
                    for (t, v) in total.iter_mut().zip(value) {
                        *t = simd.mul_add_e_f64s(*q, *v, *t);
                    }
                }
                for (s, t) in sum.iter_mut().zip(total) {
                    *s += simd.reduce_sum_f64s(t);
                }
            }
        }
    }
}

/// Adds potential, ∂/∂ρ and ∂/∂z of charged rings at (ρ, z) for every channel: those of some groups, and of these those that
/// are counted (all, if that is empty).
pub(crate) fn add_sums(
    arch: Arch,
    at: [f64; 2],
    rings: &Rings,
    charge: &[f64],
    (groups, counted): (&[Range<usize>], &[f64]),
    sums: &mut [[f64; 3]],
) {
    arch.dispatch(Sums { at, rings, charge, groups, counted, sums });
}

#[cfg(test)]
mod tests {
    use super::*;
    use ellip::{elliprd, elliprf};
    use std::f64::consts::{FRAC_2_PI, PI};

    fn one(at: [f64; 2], ring: [f64; 2]) -> [f64; 3] {
        let mut rings = Rings::default();
        rings.push(ring);
        rings.fill();
        let mut charge = vec![0.0; GROUP];
        charge[0] = 1.0;
        let mut sums = [[0.0; 3]];
        add_sums(Arch::new(), at, &rings, &charge, (std::slice::from_ref(&(0..1)), &[]), &mut sums);
        let mut alone = Vec::new();
        potentials(Arch::new(), at, &rings, &mut alone);
        assert!((alone[0] / sums[0][0] - 1.0).abs() < 1e-14, "{at:?}: {} {}", alone[0], sums[0][0]);
        sums[0]
    }

    #[test]
    fn a_ring_is_the_elliptic_integrals() {
        for (radius, rho, z) in
            [(1.0, 0.5, 0.3), (2.0, 1.9, 0.0), (0.3, 5.0, -2.0), (1.0, 1.0, 1e-3), (1.0, 0.2, 0.9), (1.0, 1e-3, 0.1)]
        {
            let (plus, minus): (f64, f64) = (radius + rho, radius - rho);
            // Heights that are exact in binary, or the distance itself would be rounded.
            let got = one([rho, z], [radius, 0.0]);
            let (a2, b2) = (plus * plus + z * z, minus * minus + z * z);
            let carlson = |x: f64, y: f64| elliprd(0.0, x, y).unwrap() / 3.0;
            let (cos, sin) = (carlson(a2, b2), carlson(b2, a2));
            let wanted = [
                FRAC_2_PI * elliprf(0.0, b2, a2).unwrap(),
                FRAC_2_PI * (minus * cos - plus * sin),
                -FRAC_2_PI * z * (cos + sin),
            ];
            let size = [wanted[0], wanted[1].hypot(wanted[2]), wanted[1].hypot(wanted[2])];
            for i in 0..3 {
                // Rounding of some thirty operations on either side.
                assert!((got[i] - wanted[i]).abs() < 1e-14 * size[i], "{i} {got:?} {wanted:?}");
            }
        }
    }

    #[test]
    fn nothing_cancels_near_the_axis_and_far_away() {
        // Near the axis ∂φ/∂ρ = -½ ρ ∂²φ/∂z², with φ = (R² + z²)^(-1/2) on it; the next term is smaller by (ρ/R)².
        for (radius, z) in [(1.0_f64, 0.3_f64), (0.5, 2.0), (1.0, 0.0)] {
            for rho in [1e-12, 1e-7, 1e-5] {
                let a2 = radius * radius + z * z;
                let got = one([rho, z], [radius, 0.0]);
                let wanted = -0.5 * rho * (2.0 * z * z - radius * radius) / a2.powf(2.5);
                assert!((got[1] / wanted - 1.0).abs() < 1e-9, "{got:?} {wanted}");
                assert!((got[0] * a2.sqrt() - 1.0).abs() < 1e-9);
            }
        }
        // Far away a point charge; the quadrupole is (R/r)².
        let got = one([3e6, 4e6], [1.0, 0.0]);
        assert!((got[0] * 5e6 - 1.0).abs() < 1e-13);
        assert!((got[1] * 25e12 / -0.6 - 1.0).abs() < 1e-12 && (got[2] * 25e12 / -0.8 - 1.0).abs() < 1e-12);
    }

    #[test]
    fn close_to_the_ring_it_is_a_straight_wire() {
        // φ → ln(8R/d)/(πR): the next order is (d/R) ln.
        for d in [1e-6, 1e-9] {
            let got = one([1.0 + 0.6 * d, 0.8 * d], [1.0, 0.0]);
            let wire = (8.0_f64 / d).ln() / PI;
            // Rounding of the distance: 1e-16/d.
            let slack = 30.0 * d + 1e-15 / d;
            assert!((got[0] / wire - 1.0).abs() < slack, "{got:?}");
            assert!((got[1] * PI * d / -0.6 - 1.0).abs() < slack && (got[2] * PI * d / -0.8 - 1.0).abs() < slack);
        }
    }
}
