//! Four numbers at a time, on whatever the machine has.
//!
//! *Why not arrays alone:* the compiler does turn loops over arrays into vector instructions, but takes apart what it thinks it can
//! share between lanes and shuffles it together again: five times slower in the kernel of splines.

#[cfg(target_arch = "x86_64")]
use pulp::{cast, f64x4, x86::V3};

/// A machine with vectors of four numbers.
pub(super) trait Lanes: Copy {
    type V: Copy;
    fn of(self, numbers: [f64; 4]) -> Self::V;
    fn splat(self, number: f64) -> Self::V;
    fn mul(self, a: Self::V, b: Self::V) -> Self::V;
    /// a b + c.
    fn mul_add(self, a: Self::V, b: Self::V, c: Self::V) -> Self::V;
    /// The sum of each of four vectors.
    fn sums(self, vectors: [Self::V; 4]) -> [f64; 4];
    #[cfg(test)]
    fn numbers(self, v: Self::V) -> [f64; 4];
}

/// No vectors that are known of.
#[derive(Clone, Copy)]
pub(super) struct Plain;

impl Lanes for Plain {
    type V = [f64; 4];

    fn of(self, numbers: [f64; 4]) -> [f64; 4] {
        numbers
    }

    fn splat(self, number: f64) -> [f64; 4] {
        [number; 4]
    }

    fn mul(self, a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        [a[0] * b[0], a[1] * b[1], a[2] * b[2], a[3] * b[3]]
    }

    fn mul_add(self, a: [f64; 4], b: [f64; 4], c: [f64; 4]) -> [f64; 4] {
        [a[0] * b[0] + c[0], a[1] * b[1] + c[1], a[2] * b[2] + c[2], a[3] * b[3] + c[3]]
    }

    fn sums(self, vectors: [[f64; 4]; 4]) -> [f64; 4] {
        vectors.map(|v| (v[0] + v[1]) + (v[2] + v[3]))
    }

    #[cfg(test)]
    fn numbers(self, v: [f64; 4]) -> [f64; 4] {
        v
    }
}

#[cfg(target_arch = "x86_64")]
impl Lanes for V3 {
    type V = f64x4;

    #[inline(always)]
    fn of(self, numbers: [f64; 4]) -> f64x4 {
        cast(numbers)
    }

    #[inline(always)]
    fn splat(self, number: f64) -> f64x4 {
        self.splat_f64x4(number)
    }

    #[inline(always)]
    fn mul(self, a: f64x4, b: f64x4) -> f64x4 {
        self.mul_f64x4(a, b)
    }

    #[inline(always)]
    fn mul_add(self, a: f64x4, b: f64x4, c: f64x4) -> f64x4 {
        self.mul_add_f64x4(a, b, c)
    }

    #[inline(always)]
    fn sums(self, [a, b, c, d]: [f64x4; 4]) -> [f64; 4] {
        let (left, right) = (self.avx._mm256_hadd_pd(cast(a), cast(b)), self.avx._mm256_hadd_pd(cast(c), cast(d)));
        let lower = self.avx._mm256_permute2f128_pd::<0x20>(left, right);
        let upper = self.avx._mm256_permute2f128_pd::<0x31>(left, right);
        cast(self.avx._mm256_add_pd(lower, upper))
    }

    #[cfg(test)]
    fn numbers(self, v: f64x4) -> [f64; 4] {
        cast(v)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(lanes: impl Lanes) {
        let (a, b) = (lanes.of([1.0, 2.0, 3.0, 4.0]), lanes.of([0.5, -1.0, 2.0, 0.25]));
        assert_eq!(lanes.numbers(lanes.mul(a, b)), [0.5, -2.0, 6.0, 1.0]);
        assert_eq!(lanes.numbers(lanes.mul_add(a, b, lanes.splat(1.0))), [1.5, -1.0, 7.0, 2.0]);
        assert_eq!(lanes.sums([a, b, lanes.splat(3.0), lanes.mul(a, b)]), [10.0, 1.75, 12.0, 5.5]);
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
