//! Point by point: Σ q / |x - y| and its gradient, a vector of targets at a time.

use std::ops::Range;

use pulp::{Arch, Scalar, Simd};

/// Points as lists of coordinates, in the order of the tree.
#[derive(Clone, Debug, Default)]
pub(super) struct Coordinates {
    pub x: Vec<f64>,
    pub y: Vec<f64>,
    pub z: Vec<f64>,
}

impl Coordinates {
    pub fn new(points: &[meshes::Vec3], order: &[u32]) -> Self {
        let list = |k: usize| order.iter().map(|&i| points[i as usize][k]).collect();
        Self { x: list(0), y: list(1), z: list(2) }
    }

    pub fn lists(&self) -> [&[f64]; 3] {
        [&self.x, &self.y, &self.z]
    }
}

/// Charges that act.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sources<'a> {
    pub at: &'a Coordinates,
    /// Square of the distance up to which a source does nothing; empty for zero.
    pub reach2: &'a [f64],
    /// One list for each column.
    pub charges: &'a [&'a [f64]],
}

/// Vectors with a fast 1/√.
trait InverseRoot: Simd {
    /// 1/√v for v > 0, to 1e-12 of it or better.
    fn inverse_root(self, v: Self::f64s) -> Self::f64s;
}

impl InverseRoot for Scalar {
    #[inline(always)]
    fn inverse_root(self, v: f64) -> f64 {
        1.0 / v.sqrt()
    }
}

#[cfg(target_arch = "x86_64")]
impl InverseRoot for pulp::x86::V3 {
    #[inline(always)]
    fn inverse_root(self, v: Self::f64s) -> Self::f64s {
        self.sqrt_f64s(self.div_f64s(self.splat_f64s(1.0), v))
    }
}

#[cfg(target_arch = "x86_64")]
impl InverseRoot for pulp::x86::V4 {
    /// From 14 bits, y (1 + e/2 + 3e²/8) with e = 1 - v y² leaves 5e³/16 < 6e-13.
    #[inline(always)]
    fn inverse_root(self, v: Self::f64s) -> Self::f64s {
        let start: Self::f64s = pulp::cast(self.avx512f._mm512_rsqrt14_pd(pulp::cast(v)));
        let square = self.mul_f64s(v, start);
        let e = self.negate_mul_add_e_f64s(square, start, self.splat_f64s(1.0));
        let series = self.mul_add_e_f64s(e, self.splat_f64s(0.375), self.splat_f64s(0.5));
        self.mul_add_e_f64s(self.mul_f64s(start, e), series, start)
    }
}

/// Adds the values of all sources in `ranges` at the targets of a range: output `o` of target `t` to `out[o * stride + t - first]`; the
/// outputs of a column are its potential and, with gradients, its three slopes after it.
pub(super) fn add(
    arch: Arch,
    sources: &Sources,
    ranges: &[Range<u32>],
    (targets, range): (&Coordinates, Range<usize>),
    gradients: bool,
    out: &mut [f64],
    stride: usize,
) {
    // Outputs of one pass stay in registers.
    let mut column = 0;
    while column < sources.charges.len() {
        let left = sources.charges.len() - column;
        let per = if gradients { 4 } else { 1 };
        let width = left.min(if gradients { 3 } else { 4 });
        let out = &mut out[column * per * stride..];
        let task = Task { sources, column, ranges, targets, range: range.clone(), out, stride };
        match (width, gradients) {
            (1, false) => task.run::<1, 1, 2>(arch),
            (2, false) => task.run::<2, 2, 2>(arch),
            (3, false) => task.run::<3, 3, 2>(arch),
            (_, false) => task.run::<4, 4, 2>(arch),
            (1, true) => task.run::<1, 4, 2>(arch),
            (2, true) => task.run::<2, 8, 1>(arch),
            (_, true) => task.run::<3, 12, 1>(arch),
        }
        column += width;
    }
}

struct Task<'a> {
    sources: &'a Sources<'a>,
    column: usize,
    ranges: &'a [Range<u32>],
    targets: &'a Coordinates,
    range: Range<usize>,
    out: &'a mut [f64],
    stride: usize,
}

struct Run<'a, S, const C: usize, const O: usize, const V: usize> {
    simd: S,
    task: Task<'a>,
}

impl<S: InverseRoot, const C: usize, const O: usize, const V: usize> pulp::NullaryFnOnce for Run<'_, S, C, O, V> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        self.task.sum::<S, C, O, V>(self.simd);
    }
}

impl Task<'_> {
    fn run<const C: usize, const O: usize, const V: usize>(self, arch: Arch) {
        match arch {
            #[cfg(target_arch = "x86_64")]
            Arch::V4(simd) => simd.vectorize(Run::<_, C, O, V> { simd, task: self }),
            #[cfg(target_arch = "x86_64")]
            Arch::V3(simd) => simd.vectorize(Run::<_, C, O, V> { simd, task: self }),
            _ => self.sum::<Scalar, C, O, V>(Scalar),
        }
    }

    /// C columns into O outputs for V vectors of targets at a time.
    #[inline(always)]
    fn sum<S: InverseRoot, const C: usize, const O: usize, const V: usize>(self, simd: S) {
        let Self { sources, column, ranges, targets, range, out, stride } = self;
        let zero = simd.splat_f64s(0.0);
        let step = V * S::F64_LANES;
        let charges: [&[f64]; C] = std::array::from_fn(|c| sources.charges[column + c]);
        for from in range.clone().step_by(step) {
            let load = |list: &[f64], v: usize| {
                let first = (from + v * S::F64_LANES).min(range.end);
                simd.partial_load_f64s(&list[first..(first + S::F64_LANES).min(range.end)])
            };
            let x: [S::f64s; V] = std::array::from_fn(|v| load(&targets.x, v));
            let y: [S::f64s; V] = std::array::from_fn(|v| load(&targets.y, v));
            let z: [S::f64s; V] = std::array::from_fn(|v| load(&targets.z, v));
            let mut sums = [[zero; O]; V];
            for part in ranges {
                let part = part.start as usize..part.end as usize;
                let (sx, sy, sz) =
                    (&sources.at.x[part.clone()], &sources.at.y[part.clone()], &sources.at.z[part.clone()]);
                let reach2 = if sources.reach2.is_empty() { &[][..] } else { &sources.reach2[part.clone()] };
                let charges: [&[f64]; C] = std::array::from_fn(|c| &charges[c][part.clone()]);
                for j in 0..sx.len().min(sy.len()).min(sz.len()) {
                    let at = [simd.splat_f64s(sx[j]), simd.splat_f64s(sy[j]), simd.splat_f64s(sz[j])];
                    let least = if reach2.is_empty() { zero } else { simd.splat_f64s(reach2[j]) };
                    let q: [S::f64s; C] = std::array::from_fn(|c| simd.splat_f64s(charges[c][j]));
                    for v in 0..V {
                        let d = [simd.sub_f64s(x[v], at[0]), simd.sub_f64s(y[v], at[1]), simd.sub_f64s(z[v], at[2])];
                        let r2 =
                            simd.mul_add_e_f64s(d[0], d[0], simd.mul_add_e_f64s(d[1], d[1], simd.mul_f64s(d[2], d[2])));
                        let acts = simd.greater_than_f64s(r2, least);
                        let inverse = simd.select_f64s(acts, simd.inverse_root(r2), zero);
                        if O == C {
                            for c in 0..C {
                                sums[v][c] = simd.mul_add_e_f64s(q[c], inverse, sums[v][c]);
                            }
                        } else {
                            let cube = simd.mul_f64s(inverse, simd.mul_f64s(inverse, inverse));
                            let d = d.map(|d| simd.mul_f64s(d, cube));
                            for c in 0..C {
                                sums[v][4 * c] = simd.mul_add_e_f64s(q[c], inverse, sums[v][4 * c]);
                                for k in 0..3 {
                                    let slope = &mut sums[v][4 * c + k + 1];
                                    *slope = simd.negate_mul_add_e_f64s(q[c], d[k], *slope);
                                }
                            }
                        }
                    }
                }
            }
            for (v, sums) in sums.into_iter().enumerate() {
                let first = (from + v * S::F64_LANES).min(range.end);
                let last = (first + S::F64_LANES).min(range.end);
                for (o, sum) in sums.into_iter().enumerate() {
                    let place = &mut out[o * stride + first - range.start..o * stride + last - range.start];
                    let before = simd.partial_load_f64s(place);
                    simd.partial_store_f64s(place, simd.add_f64s(before, sum));
                }
            }
        }
    }
}
