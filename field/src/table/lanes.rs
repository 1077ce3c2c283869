//! Four numbers at a time, on whatever the machine has.
//!
//! *Why not arrays alone:* the compiler does turn loops over arrays into vector instructions, but takes apart what it thinks it can
//! share between lanes and shuffles it together again: five times slower in the kernel of splines.

#[cfg(target_arch = "x86_64")]
use std::arch::x86_64::{__m256d, _CMP_GE_OQ};

#[cfg(target_arch = "x86_64")]
use pulp::x86::V3;

/// A machine with vectors of four numbers.
pub(super) trait Lanes: Copy {
    type V: Copy;
    fn of(self, numbers: [f64; 4]) -> Self::V;
    fn numbers(self, v: Self::V) -> [f64; 4];
    fn splat(self, number: f64) -> Self::V;
    fn sub(self, a: Self::V, b: Self::V) -> Self::V;
    fn mul(self, a: Self::V, b: Self::V) -> Self::V;
    /// a b + c.
    fn mul_add(self, a: Self::V, b: Self::V, c: Self::V) -> Self::V;
    fn min(self, a: Self::V, b: Self::V) -> Self::V;
    /// The largest whole numbers that are not above.
    fn floor(self, a: Self::V) -> Self::V;
    /// Bit k is set where lane k of a is at least that of b, which a NaN never is.
    fn at_least(self, a: Self::V, b: Self::V) -> u32;
    /// The sum of each of four vectors.
    fn sums(self, vectors: [Self::V; 4]) -> Self::V;
    /// The sum of products of lanes.
    fn dot(self, a: Self::V, b: Self::V) -> f64;
}

/// No vectors that are known of.
#[derive(Clone, Copy)]
pub(super) struct Plain;

impl Lanes for Plain {
    type V = [f64; 4];

    fn of(self, numbers: [f64; 4]) -> [f64; 4] {
        numbers
    }

    fn numbers(self, v: [f64; 4]) -> [f64; 4] {
        v
    }

    fn splat(self, number: f64) -> [f64; 4] {
        [number; 4]
    }

    fn sub(self, a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        std::array::from_fn(|k| a[k] - b[k])
    }

    fn mul(self, a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        std::array::from_fn(|k| a[k] * b[k])
    }

    fn mul_add(self, a: [f64; 4], b: [f64; 4], c: [f64; 4]) -> [f64; 4] {
        std::array::from_fn(|k| a[k] * b[k] + c[k])
    }

    fn min(self, a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        std::array::from_fn(|k| a[k].min(b[k]))
    }

    fn floor(self, a: [f64; 4]) -> [f64; 4] {
        a.map(f64::floor)
    }

    fn at_least(self, a: [f64; 4], b: [f64; 4]) -> u32 {
        (0..4).map(|k| u32::from(a[k] >= b[k]) << k).sum()
    }

    fn sums(self, vectors: [[f64; 4]; 4]) -> [f64; 4] {
        vectors.map(|v| (v[0] + v[1]) + (v[2] + v[3]))
    }

    fn dot(self, a: [f64; 4], b: [f64; 4]) -> f64 {
        (a[0] * b[0] + a[2] * b[2]) + (a[1] * b[1] + a[3] * b[3])
    }
}

#[cfg(target_arch = "x86_64")]
impl Lanes for V3 {
    type V = __m256d;

    #[inline(always)]
    fn of(self, numbers: [f64; 4]) -> __m256d {
        bytemuck::cast(numbers)
    }

    #[inline(always)]
    fn numbers(self, v: __m256d) -> [f64; 4] {
        bytemuck::cast(v)
    }

    #[inline(always)]
    fn splat(self, number: f64) -> __m256d {
        self.avx._mm256_set1_pd(number)
    }

    #[inline(always)]
    fn sub(self, a: __m256d, b: __m256d) -> __m256d {
        self.avx._mm256_sub_pd(a, b)
    }

    #[inline(always)]
    fn mul(self, a: __m256d, b: __m256d) -> __m256d {
        self.avx._mm256_mul_pd(a, b)
    }

    #[inline(always)]
    fn mul_add(self, a: __m256d, b: __m256d, c: __m256d) -> __m256d {
        self.fma._mm256_fmadd_pd(a, b, c)
    }

    #[inline(always)]
    fn min(self, a: __m256d, b: __m256d) -> __m256d {
        self.avx._mm256_min_pd(a, b)
    }

    #[inline(always)]
    fn floor(self, a: __m256d) -> __m256d {
        self.avx._mm256_floor_pd(a)
    }

    #[inline(always)]
    fn at_least(self, a: __m256d, b: __m256d) -> u32 {
        self.avx._mm256_movemask_pd(self.avx._mm256_cmp_pd::<_CMP_GE_OQ>(a, b)) as u32
    }

    #[inline(always)]
    fn sums(self, [a, b, c, d]: [__m256d; 4]) -> __m256d {
        let (left, right) = (self.avx._mm256_hadd_pd(a, b), self.avx._mm256_hadd_pd(c, d));
        let lower = self.avx._mm256_permute2f128_pd::<0x20>(left, right);
        let upper = self.avx._mm256_permute2f128_pd::<0x31>(left, right);
        self.avx._mm256_add_pd(lower, upper)
    }

    #[inline(always)]
    fn dot(self, a: __m256d, b: __m256d) -> f64 {
        let product = self.avx._mm256_mul_pd(a, b);
        let upper = self.avx._mm256_extractf128_pd::<1>(product);
        let two = self.sse2._mm_add_pd(self.avx._mm256_castpd256_pd128(product), upper);
        self.sse2._mm_cvtsd_f64(self.sse2._mm_add_sd(two, self.sse2._mm_unpackhi_pd(two, two)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(lanes: impl Lanes) {
        let (a, b) = (lanes.of([1.0, 2.0, 3.0, 4.0]), lanes.of([0.5, -1.25, 3.0, 0.25]));
        assert_eq!(lanes.numbers(lanes.sub(a, b)), [0.5, 3.25, 0.0, 3.75]);
        assert_eq!(lanes.numbers(lanes.mul(a, b)), [0.5, -2.5, 9.0, 1.0]);
        assert_eq!(lanes.numbers(lanes.mul_add(a, b, lanes.splat(1.0))), [1.5, -1.5, 10.0, 2.0]);
        assert_eq!(lanes.numbers(lanes.min(a, b)), [0.5, -1.25, 3.0, 0.25]);
        assert_eq!(lanes.numbers(lanes.floor(b)), [0.0, -2.0, 3.0, 0.0]);
        assert_eq!((lanes.at_least(a, b), lanes.at_least(b, a)), (0b1111, 0b0100));
        assert_eq!(lanes.at_least(lanes.splat(f64::NAN), a), 0);
        assert_eq!(lanes.numbers(lanes.sums([a, b, lanes.splat(3.0), lanes.mul(a, b)])), [10.0, 2.5, 12.0, 8.0]);
        assert_eq!(lanes.dot(a, b), 8.0);
    }

    #[test]
    fn four_numbers_are_what_they_should_be() {
        check(Plain);
        #[cfg(target_arch = "x86_64")]
        if let Some(machine) = V3::try_new() {
            check(machine);
        }
    }
}
