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
    /// Four numbers of single precision.
    fn of_single(self, numbers: [f32; 4]) -> Self::V;
    fn numbers(self, v: Self::V) -> [f64; 4];
    fn splat(self, number: f64) -> Self::V;
    fn add(self, a: Self::V, b: Self::V) -> Self::V;
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
    /// The first, second and third numbers of four triples that follow each other.
    fn triples(self, vectors: [Self::V; 3]) -> [Self::V; 3];
    /// Lane k of vector n becomes lane n of vector k.
    fn transposed(self, vectors: [Self::V; 4]) -> [Self::V; 4];
}

/// No vectors that are known of.
#[derive(Clone, Copy)]
pub(super) struct Plain;

impl Lanes for Plain {
    type V = [f64; 4];

    fn of(self, numbers: [f64; 4]) -> [f64; 4] {
        numbers
    }

    fn of_single(self, numbers: [f32; 4]) -> [f64; 4] {
        numbers.map(f64::from)
    }

    fn numbers(self, v: [f64; 4]) -> [f64; 4] {
        v
    }

    fn splat(self, number: f64) -> [f64; 4] {
        [number; 4]
    }

    fn add(self, a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        std::array::from_fn(|k| a[k] + b[k])
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

    fn triples(self, [a, b, c]: [[f64; 4]; 3]) -> [[f64; 4]; 3] {
        [[a[0], a[3], b[2], c[1]], [a[1], b[0], b[3], c[2]], [a[2], b[1], c[0], c[3]]]
    }

    fn transposed(self, v: [[f64; 4]; 4]) -> [[f64; 4]; 4] {
        std::array::from_fn(|k| std::array::from_fn(|n| v[n][k]))
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
    fn of_single(self, numbers: [f32; 4]) -> __m256d {
        self.avx._mm256_cvtps_pd(bytemuck::cast(numbers))
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
    fn add(self, a: __m256d, b: __m256d) -> __m256d {
        self.avx._mm256_add_pd(a, b)
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
    fn triples(self, [a, b, c]: [__m256d; 3]) -> [__m256d; 3] {
        let first = self.avx._mm256_permute2f128_pd::<0x30>(a, b);
        let middle = self.avx._mm256_permute2f128_pd::<0x21>(a, c);
        let last = self.avx._mm256_permute2f128_pd::<0x30>(b, c);
        [
            self.avx._mm256_shuffle_pd::<0b1010>(first, middle),
            self.avx._mm256_shuffle_pd::<0b0101>(first, last),
            self.avx._mm256_shuffle_pd::<0b1010>(middle, last),
        ]
    }

    #[inline(always)]
    fn transposed(self, [a, b, c, d]: [__m256d; 4]) -> [__m256d; 4] {
        let (even, odd) = (self.avx._mm256_unpacklo_pd(a, b), self.avx._mm256_unpackhi_pd(a, b));
        let (even_2, odd_2) = (self.avx._mm256_unpacklo_pd(c, d), self.avx._mm256_unpackhi_pd(c, d));
        [
            self.avx._mm256_permute2f128_pd::<0x20>(even, even_2),
            self.avx._mm256_permute2f128_pd::<0x20>(odd, odd_2),
            self.avx._mm256_permute2f128_pd::<0x31>(even, even_2),
            self.avx._mm256_permute2f128_pd::<0x31>(odd, odd_2),
        ]
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
        let turned = lanes.transposed([a, b, lanes.splat(3.0), lanes.of_single([5.0, 6.0, 7.0, 8.0])]);
        let rows = [[1.0, 0.5, 3.0, 5.0], [2.0, -1.25, 3.0, 6.0], [3.0, 3.0, 3.0, 7.0], [4.0, 0.25, 3.0, 8.0]];
        assert_eq!(turned.map(|v| lanes.numbers(v)), rows);
        let points = [[1.0, 2.0, 3.0, 11.0], [12.0, 13.0, 21.0, 22.0], [23.0, 31.0, 32.0, 33.0]];
        let rows = [[1.0, 11.0, 21.0, 31.0], [2.0, 12.0, 22.0, 32.0], [3.0, 13.0, 23.0, 33.0]];
        assert_eq!(lanes.triples(points.map(|v| lanes.of(v))).map(|v| lanes.numbers(v)), rows);
        assert_eq!(lanes.numbers(lanes.add(a, b)), [1.5, 0.75, 6.0, 4.25]);
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
