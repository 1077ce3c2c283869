//! Many charges into one expansion, several at a time.

use meshes::Vec3;
use pulp::{Arch, Simd, WithSimd};

use crate::harmonics::coefficients;

/// Charges waiting to be gathered into expansions about one centre: positions relative to the centre over its length, and the
/// charge of each in every function (channel).
#[derive(Clone, Debug, Default)]
pub struct Gather {
    x: Vec<f64>,
    y: Vec<f64>,
    z: Vec<f64>,
    /// One list for each function.
    charge: Vec<Vec<f64>>,
}

impl Gather {
    /// Empty, for that many functions.
    pub fn new(functions: usize) -> Self {
        Self { charge: vec![Vec::new(); functions], ..Self::default() }
    }

    /// Whether nothing waits.
    pub fn is_empty(&self) -> bool {
        self.x.is_empty()
    }

    /// Adds a point, relative to the centre and over its length, with `factor` times `charges` (one for each function).
    pub fn push(&mut self, at: &Vec3, factor: f64, charges: &[f64]) {
        self.x.push(at.x);
        self.y.push(at.y);
        self.z.push(at.z);
        for (list, q) in self.charge.iter_mut().zip(charges) {
            list.push(factor * q);
        }
    }

    /// Adds Σ q I_l^m of all points to the expansions, `coefficients(degree)` numbers for each function one after the other,
    /// and forgets the points. The sum runs over vectors of points: its last bits depend on the width of the machine's
    /// vectors, and on nothing else.
    pub fn flush(&mut self, arch: Arch, degree: usize, expansions: &mut [f64]) {
        if self.is_empty() {
            return;
        }
        // Whole vectors: points of no charge, at a distance that gives no infinities.
        let whole = self.x.len().next_multiple_of(16);
        for list in [&mut self.x, &mut self.y, &mut self.z] {
            list.resize(whole, 1.0);
        }
        for list in &mut self.charge {
            list.resize(whole, 0.0);
        }
        arch.dispatch(Flush { points: self, degree, expansions });
        for list in [&mut self.x, &mut self.y, &mut self.z].into_iter().chain(&mut self.charge) {
            list.clear();
        }
    }
}

struct Flush<'a> {
    points: &'a Gather,
    degree: usize,
    expansions: &'a mut [f64],
}

impl WithSimd for Flush<'_> {
    type Output = ();

    /// The recurrences of [`crate::harmonics::Harmonics::set_irregular`], order by order: for each m all l.
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { points, degree, expansions } = self;
        let n = coefficients(degree);
        let charges: Vec<&[S::f64s]> = points.charge.iter().map(|q| S::as_simd_f64s(q).0).collect();
        let functions = charges.len();
        let zero = simd.splat_f64s(0.0);
        let mut sums = vec![zero; n * functions];
        let (xs, ys, zs) = (S::as_simd_f64s(&points.x).0, S::as_simd_f64s(&points.y).0, S::as_simd_f64s(&points.z).0);
        let mut charge = vec![zero; functions];
        for v in 0..xs.len() {
            for (q, list) in charge.iter_mut().zip(&charges) {
                *q = list[v];
            }
            let (x, y, z) = (xs[v], ys[v], zs[v]);
            let r2 = simd.mul_add_f64s(x, x, simd.mul_add_f64s(y, y, simd.mul_f64s(z, z)));
            let inverse = simd.div_f64s(simd.splat_f64s(1.0), r2);
            let [x, y, z] = [x, y, z].map(|k| simd.mul_f64s(k, inverse));
            // I_m^m, real and imaginary.
            let mut seed = (simd.sqrt_f64s(inverse), zero);
            for m in 0..=degree {
                if m > 0 {
                    let factor = simd.splat_f64s(-((2 * m - 1) as f64));
                    let (re, im) = seed;
                    let real = simd.sub_f64s(simd.mul_f64s(re, x), simd.mul_f64s(im, y));
                    let imaginary = simd.mul_add_f64s(re, y, simd.mul_f64s(im, x));
                    seed = (simd.mul_f64s(real, factor), simd.mul_f64s(imaginary, factor));
                }
                let (mut below, mut here) = ((zero, zero), seed);
                for l in m..=degree {
                    if l > m {
                        let rise = simd.mul_f64s(z, simd.splat_f64s((2 * l - 1) as f64));
                        let fall = simd.mul_f64s(inverse, simd.splat_f64s(-(((l - 1) * (l - 1) - m * m) as f64)));
                        let next = (
                            simd.mul_add_f64s(here.0, rise, simd.mul_f64s(below.0, fall)),
                            simd.mul_add_f64s(here.1, rise, simd.mul_f64s(below.1, fall)),
                        );
                        (below, here) = (here, next);
                    }
                    // (l, 0) stands at l², (l, m) at l² + 2m - 1 and the place after it.
                    let place = if m == 0 { l * l } else { l * l + 2 * m - 1 };
                    for (k, q) in charge.iter().enumerate() {
                        let sum = &mut sums[k * n + place..];
                        sum[0] = simd.mul_add_f64s(here.0, *q, sum[0]);
                        if m > 0 {
                            sum[1] = simd.mul_add_f64s(here.1, *q, sum[1]);
                        }
                    }
                }
            }
        }
        for (out, sum) in expansions.iter_mut().zip(&sums) {
            *out += simd.reduce_sum_f64s(*sum);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::harmonics::Harmonics;

    #[test]
    fn gathered_charges_are_those_added_one_by_one() {
        let points: Vec<Vec3> = (0..37)
            .map(|k| Vec3::new((k as f64).sin(), (1.7 * k as f64).cos(), (0.3 * k as f64).sin()) * 3.0)
            .collect();
        for degree in [0, 1, 6, 15] {
            let n = coefficients(degree);
            let mut gather = Gather::new(2);
            let mut slow = vec![0.0; 2 * n];
            let mut harmonics = Harmonics::default();
            for (k, p) in points.iter().enumerate() {
                let charges = [1.0, 0.1 * k as f64 - 2.0];
                gather.push(p, 0.5, &charges);
                harmonics.set_irregular(p, degree);
                harmonics.add_to(0.5 * charges[0], &mut slow[..n]);
                harmonics.add_to(0.5 * charges[1], &mut slow[n..]);
            }
            let mut fast = vec![0.0; 2 * n];
            gather.flush(Arch::new(), degree, &mut fast);
            assert!(gather.is_empty());
            let scale = slow.iter().fold(0.0_f64, |s, x| s.max(x.abs()));
            for (f, s) in fast.iter().zip(&slow) {
                assert!((f - s).abs() < 1e-13 * scale, "degree {degree}: {f} {s}");
            }
        }
    }
}
