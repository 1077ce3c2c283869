//! Real solid harmonics, a vector of points at a time: points into expansions and expansions into points.
//!
//! The functions are those of [`crate::harmonics`], R_l^m and I_l^m, with their real and imaginary parts as functions of
//! their own: (l, 0) stands at l², the two parts of (l, m) at l² + 2m - 1 and l² + 2m. A **form** is Σ a X with X the parts of
//! R or of I and real numbers a. With M = Σ q R(y) (likewise parts by parts), for |y| < |x|,
//!
//!   Σ q / |x - y| = Σ_l [ M_l^0 I_l^0(x) + 2 Σ_m>0 (Re M Re I + Im M Im I) ],
//!
//! and the same with x and y changing places. Source: Dehnen 2014, section 3.

use meshes::Vec3;
use pulp::{Arch, Simd, WithSimd};

/// Number of parts up to a degree.
pub(super) const fn parts(degree: usize) -> usize {
    (degree + 1) * (degree + 1)
}

/// Where the real part of (l, m), m ≥ 0, stands.
pub(super) const fn place(l: usize, m: usize) -> usize {
    if m == 0 { l * l } else { l * l + 2 * m - 1 }
}

/// Which of the two families of harmonics.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Family {
    /// R, polynomials.
    Regular,
    /// I, falling off.
    Irregular,
}

/// Outputs of a form that are summed at once: four sums keep the multipliers busy, and four are a potential and its gradient.
const TOGETHER: usize = 4;

/// Points, relative to a centre and over a length, in whole vectors.
#[derive(Clone, Debug, Default)]
pub(super) struct Relative {
    x: Vec<f64>,
    y: Vec<f64>,
    z: Vec<f64>,
    count: usize,
}

impl Relative {
    /// Points number `first..end` of three lists of coordinates.
    pub fn set(&mut self, lists: [&[f64]; 3], range: std::ops::Range<usize>, center: &Vec3, length: f64) {
        let inverse = 1.0 / length;
        self.count = range.len();
        for (k, (list, from)) in [&mut self.x, &mut self.y, &mut self.z].into_iter().zip(lists).enumerate() {
            list.clear();
            list.extend(from[range.clone()].iter().map(|v| (v - center[k]) * inverse));
            // Places without a point repeat the last one: it gives no infinities.
            let last = list.last().copied().unwrap_or(1.0);
            list.resize(range.len().next_multiple_of(WIDEST), last);
        }
    }
}

/// Widest vector, numbers.
const WIDEST: usize = 8;

/// All parts of one vector of points.
#[inline(always)]
fn fill<S: Simd>(simd: S, family: Family, degree: usize, [x, y, z]: [S::f64s; 3], out: &mut [S::f64s]) {
    let zero = simd.splat_f64s(0.0);
    let number = |v: f64| simd.splat_f64s(v);
    let r2 = simd.mul_add_e_f64s(x, x, simd.mul_add_e_f64s(y, y, simd.mul_f64s(z, z)));
    let regular = family == Family::Regular;
    let inverse = if regular { zero } else { simd.div_f64s(number(1.0), r2) };
    let [x, y, z] = if regular { [x, y, z] } else { [x, y, z].map(|k| simd.mul_f64s(k, inverse)) };
    let mut seed = if regular { (number(1.0), zero) } else { (simd.sqrt_f64s(inverse), zero) };
    for m in 0..=degree {
        if m > 0 {
            let factor = number(if regular { -0.5 / m as f64 } else { -((2 * m - 1) as f64) });
            let (re, im) = seed;
            let real = simd.negate_mul_add_e_f64s(im, y, simd.mul_f64s(re, x));
            let imaginary = simd.mul_add_e_f64s(re, y, simd.mul_f64s(im, x));
            seed = (simd.mul_f64s(real, factor), simd.mul_f64s(imaginary, factor));
        }
        let (mut below, mut here) = ((zero, zero), seed);
        for l in m..=degree {
            if l > m {
                // (l² - m²) R_l = (2l - 1) z R_{l-1} - r² R_{l-2}; r² I_l = (2l - 1) z I_{l-1} - ((l - 1)² - m²) I_{l-2}.
                let (up, down) = if regular {
                    let norm = 1.0 / (l * l - m * m) as f64;
                    (simd.mul_f64s(z, number((2 * l - 1) as f64 * norm)), simd.mul_f64s(r2, number(-norm)))
                } else {
                    let fall = ((l - 1) * (l - 1)) as f64 - (m * m) as f64;
                    (simd.mul_f64s(z, number((2 * l - 1) as f64)), simd.mul_f64s(inverse, number(-fall)))
                };
                let next = (
                    simd.mul_add_e_f64s(here.0, up, simd.mul_f64s(below.0, down)),
                    simd.mul_add_e_f64s(here.1, up, simd.mul_f64s(below.1, down)),
                );
                (below, here) = (here, next);
            }
            let at = place(l, m);
            out[at] = here.0;
            if m > 0 {
                out[at + 1] = here.1;
            }
        }
    }
}

/// Adds Σ q X of the points to `sums`, `parts(degree)` numbers for each column of charges.
pub(super) fn gather(
    arch: Arch,
    family: Family,
    degree: usize,
    points: &Relative,
    charges: &[&[f64]],
    sums: &mut [f64],
) {
    if points.count > 0 {
        arch.dispatch(Gather { family, degree, points, charges, sums });
    }
}

struct Gather<'a> {
    family: Family,
    degree: usize,
    points: &'a Relative,
    charges: &'a [&'a [f64]],
    sums: &'a mut [f64],
}

impl WithSimd for Gather<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { family, degree, points, charges, sums } = self;
        let n = parts(degree);
        let zero = simd.splat_f64s(0.0);
        let mut values = vec![zero; n];
        let mut totals = vec![zero; n * charges.len()];
        let [x, y, z] = [&points.x, &points.y, &points.z].map(|list| S::as_simd_f64s(list).0);
        for v in 0..points.count.div_ceil(S::F64_LANES) {
            fill(simd, family, degree, [x[v], y[v], z[v]], &mut values);
            for (column, totals) in charges.iter().zip(totals.chunks_exact_mut(n)) {
                let from = v * S::F64_LANES;
                let q = simd.partial_load_f64s(&column[from..points.count.min(from + S::F64_LANES)]);
                for (total, value) in totals.iter_mut().zip(&values) {
                    *total = simd.mul_add_e_f64s(*value, q, *total);
                }
            }
        }
        for (sum, total) in sums.iter_mut().zip(totals) {
            *sum += simd.reduce_sum_f64s(total);
        }
    }
}

/// Numbers of outputs as they are stored.
pub(super) const fn padded(outputs: usize) -> usize {
    outputs.next_multiple_of(TOGETHER)
}

/// Values of forms at points, to be added: value `o` of point `p` goes to `out[o * stride + p]`.
pub(super) struct Scatter<'a> {
    pub family: Family,
    pub degree: usize,
    pub points: &'a Relative,
    /// The `outputs` numbers of each part side by side, filled up with zeros to `padded(outputs)`.
    pub forms: &'a [f64],
    pub outputs: usize,
    pub out: &'a mut [f64],
    pub stride: usize,
}

impl Scatter<'_> {
    pub fn run(self, arch: Arch) {
        if self.points.count > 0 {
            arch.dispatch(self);
        }
    }
}

impl WithSimd for Scatter<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { family, degree, points, forms, outputs, out, stride } = self;
        let (n, width) = (parts(degree), padded(outputs));
        let zero = simd.splat_f64s(0.0);
        let mut values = vec![zero; n];
        let [x, y, z] = [&points.x, &points.y, &points.z].map(|list| S::as_simd_f64s(list).0);
        for v in 0..points.count.div_ceil(S::F64_LANES) {
            fill(simd, family, degree, [x[v], y[v], z[v]], &mut values);
            let from = v * S::F64_LANES;
            let to = points.count.min(from + S::F64_LANES);
            for first in (0..outputs).step_by(TOGETHER) {
                let mut sums = [zero; TOGETHER];
                for (value, numbers) in values.iter().zip(forms.chunks_exact(width)) {
                    let numbers = &numbers[first..first + TOGETHER];
                    for k in 0..TOGETHER {
                        sums[k] = simd.mul_add_e_f64s(simd.splat_f64s(numbers[k]), *value, sums[k]);
                    }
                }
                for (o, sum) in (first..outputs).zip(sums) {
                    let place = &mut out[o * stride + from..o * stride + to];
                    let before = simd.partial_load_f64s(place);
                    simd.partial_store_f64s(place, simd.add_f64s(before, sum));
                }
            }
        }
    }
}

/// The parts of one point, X_l^m up to a degree.
pub(super) fn values(family: Family, degree: usize, x: &Vec3) -> Vec<f64> {
    let mut relative = Relative::default();
    relative.set([&[x.x], &[x.y], &[x.z]], 0..1, &Vec3::zeros(), 1.0);
    let mut sums = vec![0.0; parts(degree)];
    gather(Arch::Scalar, family, degree, &relative, &[&[1.0]], &mut sums);
    sums
}

/// X_l^m of any sign of m out of its parts, zero where |m| > l; X_l^{-m} = (-1)^m conj X_l^m.
pub(super) fn complex(values: &[f64], l: usize, m: isize) -> (f64, f64) {
    let order = m.unsigned_abs();
    if order > l {
        return (0.0, 0.0);
    }
    let at = place(l, order);
    match m {
        0 => (values[at], 0.0),
        1.. => (values[at], values[at + 1]),
        _ if order.is_multiple_of(2) => (values[at], -values[at + 1]),
        _ => (-values[at], values[at + 1]),
    }
}

/// Forms of the gradient of a form: three forms of one degree less (regular) or more (irregular), `into[axis][part]`, added.
///
///   ∂_x X_l^m = ½ (X_k^{m+1} - X_k^{m-1}),  ∂_y X_l^m = -½ i (X_k^{m+1} + X_k^{m-1}),  ∂_z X_l^m = ±X_k^m
///
/// with k = l - 1 and plus for R, k = l + 1 and minus for I. Checked by `gradients_against_differences`.
pub(super) fn gradient_forms(family: Family, degree: usize, form: &[f64], into: &mut [Vec<f64>; 3]) {
    let regular = family == Family::Regular;
    let mut add = |axis: usize, l: usize, m: usize, (re, im): (f64, f64)| {
        if m <= l {
            // A form Σ Re(c X) with c = a - i b.
            let at = place(l, m);
            into[axis][at] += re;
            if m > 0 {
                into[axis][at + 1] -= im;
            }
        }
    };
    for l in usize::from(regular)..=degree {
        let (k, sign) = if regular { (l - 1, 1.0) } else { (l + 1, -1.0) };
        for m in 0..=l {
            let at = place(l, m);
            let (a, b) = (form[at], if m > 0 { form[at + 1] } else { 0.0 });
            add(2, k, m, (sign * a, -sign * b));
            if m == 0 {
                add(0, k, 1, (a, 0.0));
                add(1, k, 1, (0.0, -a));
            } else {
                let (re, im) = (0.5 * a, -0.5 * b);
                add(0, k, m + 1, (re, im));
                add(0, k, m - 1, (-re, -im));
                // -i c = im - i re.
                add(1, k, m + 1, (im, -re));
                add(1, k, m - 1, (im, -re));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn form_at(family: Family, degree: usize, form: &[f64], x: &Vec3) -> f64 {
        values(family, degree, x).iter().zip(form).map(|(v, a)| v * a).sum()
    }

    #[test]
    fn expansion_is_the_inverse_distance() {
        let (x, y) = (Vec3::new(2.0, -1.0, 1.5), Vec3::new(0.1, 0.2, -0.3));
        let degree = 20;
        let (r, i) = (values(Family::Regular, degree, &y), values(Family::Irregular, degree, &x));
        let mut sum = 0.0;
        for l in 0..=degree {
            for m in 0..=l {
                let at = place(l, m);
                sum += if m == 0 { r[at] * i[at] } else { 2.0 * (r[at] * i[at] + r[at + 1] * i[at + 1]) };
            }
        }
        // (0.37/2.7)^21
        assert!((sum * (x - y).norm() - 1.0).abs() < 1e-14);
    }

    #[test]
    fn gradients_against_differences() {
        let degree = 5;
        let form: Vec<f64> = (0..parts(degree)).map(|k| ((k * 7 + 3) % 11) as f64 - 5.0).collect();
        let x = Vec3::new(0.7, -0.4, 0.9);
        for family in [Family::Regular, Family::Irregular] {
            let other = if family == Family::Regular { degree - 1 } else { degree + 1 };
            let mut forms: [Vec<f64>; 3] = std::array::from_fn(|_| vec![0.0; parts(other)]);
            gradient_forms(family, degree, &form, &mut forms);
            let step = 1e-5;
            for axis in 0..3 {
                let mut d = Vec3::zeros();
                d[axis] = step;
                let slope = (form_at(family, degree, &form, &(x + d)) - form_at(family, degree, &form, &(x - d)))
                    / (2.0 * step);
                let exact = form_at(family, other, &forms[axis], &x);
                // Differences are good to the square of the step.
                assert!((slope / exact - 1.0).abs() < 1e-6, "{family:?} {axis}: {slope} {exact}");
            }
        }
    }
}
