//! Coefficients of splines as they are read: in single precision where that is enough.
//!
//! Each brick has for each channel a plane, in double precision, and what its coefficients are beside it: a spline of the
//! coefficients of a plane is that plane. What is left is small where the field is smooth, and so is what single precision rounds
//! off: measured by `single_precision_is_enough`.

use bytemuck::{Pod, Zeroable};
use rayon::prelude::*;

use super::lanes::Lanes;
use super::spline::{CELLS, Splines, edge, per_brick, stride};

/// A line of memory.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C, align(64))]
struct Line([f64; 8]);

/// How numbers are kept.
pub(super) trait Number: Pod + Send + Sync {
    /// The nearest one.
    fn nearest(number: f64) -> Self;
    /// Four of them as vectors.
    fn four<L: Lanes>(lanes: L, numbers: [Self; 4]) -> L::V;
}

impl Number for f64 {
    fn nearest(number: f64) -> Self {
        number
    }

    #[inline(always)]
    fn four<L: Lanes>(lanes: L, numbers: [Self; 4]) -> L::V {
        lanes.of(numbers)
    }
}

impl Number for f32 {
    fn nearest(number: f64) -> Self {
        number as f32
    }

    #[inline(always)]
    fn four<L: Lanes>(lanes: L, numbers: [Self; 4]) -> L::V {
        lanes.of_single(numbers)
    }
}

/// Coefficients of all channels.
pub(super) struct Rows<N> {
    pub reach: usize,
    channels: usize,
    lines: Vec<Line>,
    /// For each brick and channel the plane: its value in the middle of the brick, and slopes per cell.
    pub planes: Vec<[f64; 4]>,
    number: std::marker::PhantomData<N>,
}

impl<N: Number> Rows<N> {
    /// Numbers of a brick for one channel, in whole lines of memory.
    pub const fn per_brick(reach: usize) -> usize {
        per_brick(reach).next_multiple_of(size_of::<Line>() / size_of::<N>())
    }

    /// Bytes of so many bricks and channels.
    pub fn bytes_for(reach: usize, bricks: usize, channels: usize) -> u64 {
        let own = size_of::<N>() * Self::per_brick(reach) + size_of::<[f64; 4]>();
        (own as u64).saturating_mul(channels as u64).saturating_mul(bricks as u64)
    }

    pub fn new(reach: usize, bricks: usize, channels: usize) -> Self {
        let lines = bricks * channels * Self::per_brick(reach) * size_of::<N>() / size_of::<Line>();
        Self {
            reach,
            channels,
            lines: vec![Line::default(); lines],
            planes: vec![[0.0; 4]; bricks * channels],
            number: std::marker::PhantomData,
        }
    }

    /// Bytes that are kept.
    pub fn bytes(&self) -> u64 {
        (size_of_val(self.lines.as_slice()) + size_of_val(self.planes.as_slice())) as u64
    }

    /// What coefficients are beside the planes: entry `(slot * channels + channel) * per_brick + x + stride (y + edge z)`.
    pub fn numbers(&self) -> &[N] {
        bytemuck::cast_slice(&self.lines)
    }

    /// Takes in the splines of a channel.
    pub fn fill(&mut self, channel: usize, splines: &Splines) {
        let (reach, channels, len) = (self.reach, self.channels, Self::per_brick(self.reach));
        let numbers: &mut [N] = bytemuck::cast_slice_mut(&mut self.lines);
        let own = numbers.par_chunks_mut(channels * len).zip(self.planes.par_chunks_mut(channels));
        own.zip(splines.numbers.par_chunks(per_brick(reach))).for_each(|((numbers, planes), of)| {
            let plane = plane(reach, of);
            planes[channel] = plane;
            let numbers = &mut numbers[channel * len..][..len];
            each(reach, |place, from_middle| {
                let beside = (0..3).fold(of[place] - plane[0], |rest, k| rest - plane[k + 1] * from_middle[k]);
                numbers[place] = N::nearest(beside);
            });
        });
    }
}

/// Calls for each coefficient of a brick: where it is, and how many cells from the brick's middle its node lies.
fn each(reach: usize, mut call: impl FnMut(usize, [f64; 3])) {
    let middle = (CELLS / 2 + reach - 1) as f64;
    let edge = edge(reach);
    for (z, y, x) in (0..edge * edge * edge).map(|n| (n / (edge * edge), n / edge % edge, n % edge)) {
        call(x + stride(reach) * (y + edge * z), [x, y, z].map(|i| i as f64 - middle));
    }
}

/// The plane nearest to a brick's coefficients, by least squares: nodes lie evenly around the middle, so that its four numbers
/// are independent.
fn plane(reach: usize, numbers: &[f64]) -> [f64; 4] {
    let (mut sums, mut squares) = ([0.0; 4], 0.0);
    each(reach, |place, from_middle| {
        sums[0] += numbers[place];
        (0..3).for_each(|k| sums[k + 1] += numbers[place] * from_middle[k]);
        squares += from_middle[0].powi(2);
    });
    [sums[0] / edge(reach).pow(3) as f64, sums[1] / squares, sums[2] / squares, sums[3] / squares]
}
