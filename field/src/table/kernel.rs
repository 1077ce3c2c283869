//! Evaluating splines at points, fast: points are found in batches, and a batch's memory is asked for before it is used.

use meshes::Vec3;
#[cfg(target_arch = "x86_64")]
use pulp::{NullaryFnOnce, x86::V3};

use super::lanes::{Lanes, Plain};
use super::octree::{NONE, Octree};
use super::spline::{CELLS, CUBIC, QUINTIC, Splines, edge, per_brick, stride};

/// Points that are found before they are evaluated: enough for their memory to be fetched side by side, few enough to stay in
/// the nearest cache.
const BATCH: usize = 16;

/// The brick is whole: the rest is its slot.
const WHOLE: u32 = 1 << 31;

/// Splines with what finds a point in them.
pub(super) struct Kernel {
    min: Vec3,
    max: Vec3,
    /// Coarsest bricks per metre.
    per_metre: Vec3,
    roots: [u32; 3],
    /// For each brick the first of its parts, or [`WHOLE`] and its slot, or [`NONE`].
    descent: Vec<u32>,
    splines: Splines,
    /// What the machine has.
    #[cfg(target_arch = "x86_64")]
    v3: Option<V3>,
}

/// Where a point lies.
#[derive(Clone, Copy, Default)]
struct Found {
    /// The number of the point.
    point: u32,
    slot: u32,
    /// The cell within the brick.
    cell: [u8; 3],
    /// Where in the cell, from 0 to 1.
    part: [f64; 3],
    /// Cells per metre.
    scale: [f64; 3],
}

/// What is wanted of each point.
enum Wanted<'a> {
    /// Potential and gradient of each channel.
    Channels { potential: &'a mut [f64], gradient: &'a mut [Vec3] },
    /// Potential and gradient of a sum of channels with factors for each point.
    Sum { factors: &'a [f64], potential: &'a mut [f64], gradient: &'a mut [Vec3] },
}

impl Kernel {
    pub fn new(octree: &Octree, splines: Splines) -> Self {
        let grid = octree.grid();
        let descent = octree
            .parts()
            .zip(&splines.slots)
            .map(|(parts, slot)| match (parts, *slot) {
                (NONE, NONE) => NONE,
                (NONE, slot) => WHOLE | slot,
                (parts, _) => parts,
            })
            .collect();
        Self {
            min: grid.min,
            max: grid.max,
            per_metre: grid.spacing().map(f64::recip),
            roots: grid.cells.map(|n| n as u32),
            descent,
            splines,
            #[cfg(target_arch = "x86_64")]
            v3: V3::try_new(),
        }
    }

    pub fn channels(&self) -> usize {
        self.splines.channels
    }

    pub fn bytes(&self) -> u64 {
        size_of_val(self.splines.numbers()) as u64
    }

    /// Potential and gradient of every channel at points, entry `point * channels + channel`; numbers of points that are in no
    /// interpolated brick go to `left`, and nothing is written for them.
    pub fn channels_at(&self, points: &[Vec3], potential: &mut [f64], gradient: &mut [Vec3], left: &mut Vec<usize>) {
        self.dispatch(points, Wanted::Channels { potential, gradient }, left);
    }

    /// Σ_c `factors[point * channels + c]` times channel c at points: one potential and gradient for each.
    pub fn sum_at(
        &self,
        points: &[Vec3],
        factors: &[f64],
        potential: &mut [f64],
        gradient: &mut [Vec3],
        left: &mut Vec<usize>,
    ) {
        self.dispatch(points, Wanted::Sum { factors, potential, gradient }, left);
    }

    fn dispatch(&self, points: &[Vec3], wanted: Wanted, left: &mut Vec<usize>) {
        if self.splines.reach == CUBIC {
            self.dispatch_to::<CUBIC>(points, wanted, left);
        } else {
            self.dispatch_to::<QUINTIC>(points, wanted, left);
        }
    }

    fn dispatch_to<const REACH: usize>(&self, points: &[Vec3], wanted: Wanted, left: &mut Vec<usize>) {
        let (numbers, channels) = (self.splines.numbers(), self.splines.channels);
        #[cfg(target_arch = "x86_64")]
        if let Some(lanes) = self.v3 {
            return lanes.vectorize(Run::<V3, REACH> { lanes, kernel: self, numbers, channels, points, wanted, left });
        }
        Run::<Plain, REACH> { lanes: Plain, kernel: self, numbers, channels, points, wanted, left }.run();
    }

    /// The brick and cell of a point.
    #[inline(always)]
    fn locate(&self, point: &Vec3) -> Option<Found> {
        let inside = (point.x >= self.min.x)
            & (point.x <= self.max.x)
            & (point.y >= self.min.y)
            & (point.y <= self.max.y)
            & (point.z >= self.min.z)
            & (point.z <= self.max.z);
        if !inside {
            return None;
        }
        let mut at = [0.0; 3];
        let mut root = [0_u32; 3];
        for (k, (at, root)) in at.iter_mut().zip(&mut root).enumerate() {
            let bricks = (point[k] - self.min[k]) * self.per_metre[k];
            // The upper face belongs to the last brick.
            *root = (bricks as i32 as u32).min(self.roots[k] - 1);
            *at = bricks - f64::from(*root as i32);
        }
        let mut number = root[0] + self.roots[0] * (root[1] + self.roots[1] * root[2]);
        let mut size = CELLS as f64;
        let mut next = self.descent[number as usize];
        while next & WHOLE == 0 {
            let mut part = 0;
            for (k, x) in at.iter_mut().enumerate() {
                let upper = *x >= 0.5;
                part |= u32::from(upper) << k;
                *x = 2.0 * *x - if upper { 1.0 } else { 0.0 };
            }
            size *= 2.0;
            number = next + part;
            next = self.descent[number as usize];
        }
        if next == NONE {
            return None;
        }
        let mut found = Found { slot: next & !WHOLE, ..Found::default() };
        for (k, at) in at.into_iter().enumerate() {
            let cells = CELLS as f64 * at;
            let cell = (cells as i32).min(CELLS as i32 - 1);
            found.cell[k] = cell as u8;
            found.part[k] = cells - f64::from(cell);
            found.scale[k] = size * self.per_metre[k];
        }
        Some(found)
    }
}

impl Found {
    /// From slopes per cell to slopes per metre.
    #[inline(always)]
    fn per_metre(&self, slope: [f64; 3]) -> Vec3 {
        Vec3::new(slope[0] * self.scale[0], slope[1] * self.scale[1], slope[2] * self.scale[2])
    }
}

/// A call for some points.
struct Run<'a, L: Lanes, const REACH: usize> {
    lanes: L,
    kernel: &'a Kernel,
    numbers: &'a [f64],
    channels: usize,
    points: &'a [Vec3],
    wanted: Wanted<'a>,
    left: &'a mut Vec<usize>,
}

#[cfg(target_arch = "x86_64")]
impl<const REACH: usize> NullaryFnOnce for Run<'_, V3, REACH> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        self.run();
    }
}

impl<L: Lanes, const REACH: usize> Run<'_, L, REACH> {
    /// Splines along each axis that do not vanish at a point.
    const WINDOW: usize = 2 * REACH;

    #[inline(always)]
    fn run(mut self) {
        let mut found = [Found::default(); BATCH];
        for (batch, points) in self.points.chunks(BATCH).enumerate() {
            let mut count = 0;
            for (p, point) in points.iter().enumerate() {
                let number = batch * BATCH + p;
                match self.kernel.locate(point) {
                    Some(place) => {
                        found[count] = Found { point: number as u32, ..place };
                        self.fetch(&found[count]);
                        count += 1;
                    }
                    None => self.left.push(number),
                }
            }
            for found in &found[..count] {
                self.evaluate(found);
            }
        }
    }

    /// Where the coefficients that a point needs begin, within those of its brick and a channel.
    #[inline(always)]
    fn first(found: &Found) -> usize {
        let [x, y, z] = found.cell.map(usize::from);
        x + stride(REACH) * (y + edge(REACH) * z)
    }

    /// Asks for the lines of memory that a point will need.
    #[inline(always)]
    fn fetch(&self, found: &Found) {
        #[cfg(target_arch = "x86_64")]
        {
            use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
            let first = found.slot as usize * self.channels * per_brick(REACH) + Self::first(found);
            let first: *const f64 = self.numbers.as_ptr().wrapping_add(first);
            for z in 0..Self::WINDOW {
                for y in 0..Self::WINDOW {
                    // Safety: a prefetch reads nothing and never fails, whatever the address.
                    #[allow(unsafe_code)]
                    unsafe {
                        _mm_prefetch::<_MM_HINT_T0>(first.wrapping_add(stride(REACH) * (y + edge(REACH) * z)).cast());
                    }
                }
            }
        }
        #[cfg(not(target_arch = "x86_64"))]
        let _ = found;
    }

    #[inline(always)]
    fn evaluate(&mut self, found: &Found) {
        let (channels, brick) = (self.channels, per_brick(REACH));
        let p = found.point as usize;
        let weights = Weights::<L, REACH>::new(self.lanes, &found.part);
        let first = found.slot as usize * channels * brick;
        let numbers = &self.numbers[first..first + channels * brick];
        let start = Self::first(found);
        match &mut self.wanted {
            Wanted::Channels { potential, gradient } => {
                let (potential, gradient) = (&mut potential[p * channels..], &mut gradient[p * channels..]);
                for (c, numbers) in numbers.chunks_exact(brick).enumerate() {
                    let [value, x, y, z] = weights.contract(self.lanes, &[&numbers[start..]], &[1.0]);
                    (potential[c], gradient[c]) = (value, found.per_metre([x, y, z]));
                }
            }
            Wanted::Sum { factors, potential, gradient } => {
                let factors = &factors[p * channels..(p + 1) * channels];
                let [value, x, y, z] = match *factors {
                    [one] => weights.contract(self.lanes, &[&numbers[start..]], &[one]),
                    [a, b] => {
                        let (first, second) = numbers.split_at(brick);
                        weights.contract(self.lanes, &[&first[start..], &second[start..]], &[a, b])
                    }
                    _ => {
                        let mut sums = [0.0; 4];
                        for (numbers, factor) in numbers.chunks_exact(brick).zip(factors) {
                            let own = weights.contract(self.lanes, &[&numbers[start..]], &[*factor]);
                            (0..4).for_each(|k| sums[k] += own[k]);
                        }
                        sums
                    }
                };
                (potential[p], gradient[p]) = (value, found.per_metre([x, y, z]));
            }
        }
    }
}

/// Values and slopes (per cell) of the B-splines along each axis that do not vanish at a point.
struct Weights<L: Lanes, const REACH: usize> {
    /// Along x: values, slopes, in vectors of four; those of degree five end with two zeros.
    x: [[L::V; 2]; 2],
    /// The k-th spline along y and z: values, slopes.
    y: [[f64; 2]; 6],
    z: [[f64; 2]; 6],
}

impl<L: Lanes, const REACH: usize> Weights<L, REACH> {
    #[inline(always)]
    fn new(lanes: L, part: &[f64; 3]) -> Self {
        let [x, y, z] = [splines::<REACH>(part[0]), splines::<REACH>(part[1]), splines::<REACH>(part[2])];
        let mut vectors = [[lanes.splat(0.0); 2]; 2];
        for d in 0..2 {
            vectors[d][0] = lanes.of([x[d][0], x[d][1], x[d][2], x[d][3]]);
            if REACH == QUINTIC {
                vectors[d][1] = lanes.of([x[d][4], x[d][5], 0.0, 0.0]);
            }
        }
        let (mut along_y, mut along_z) = ([[0.0; 2]; 6], [[0.0; 2]; 6]);
        for k in 0..2 * REACH {
            along_y[k] = [y[0][k], y[1][k]];
            along_z[k] = [z[0][k], z[1][k]];
        }
        Self { x: vectors, y: along_y, z: along_z }
    }

    /// Value and slopes along x, y and z of a sum of channels with factors, from the coefficients of each from the first on.
    #[inline(always)]
    fn contract<const N: usize>(&self, lanes: L, numbers: &[&[f64]; N], factors: &[f64; N]) -> [f64; 4] {
        let zero = lanes.splat(0.0);
        let mut sums = [zero; 4];
        for half in 0..REACH - 1 {
            // Along z, then y, then x.
            let mut plain = [zero; 6];
            let mut sloped = [zero; 6];
            for k in 0..2 * REACH {
                let (value, slope) = (lanes.splat(self.z[k][0]), lanes.splat(self.z[k][1]));
                for j in 0..2 * REACH {
                    let place = stride(REACH) * (j + edge(REACH) * k) + 4 * half;
                    let mut row = zero;
                    for n in 0..N {
                        let own = &numbers[n][place..place + 4];
                        let own = lanes.of([own[0], own[1], own[2], own[3]]);
                        row = match n {
                            // A factor of one channel is left for the end.
                            0 if N == 1 => own,
                            0 => lanes.mul(own, lanes.splat(factors[0])),
                            _ => lanes.mul_add(own, lanes.splat(factors[n]), row),
                        };
                    }
                    plain[j] = lanes.mul_add(row, value, plain[j]);
                    sloped[j] = lanes.mul_add(row, slope, sloped[j]);
                }
            }
            let (mut value, mut along_y, mut along_z) = (zero, zero, zero);
            for j in 0..2 * REACH {
                let (y, slope) = (lanes.splat(self.y[j][0]), lanes.splat(self.y[j][1]));
                value = lanes.mul_add(plain[j], y, value);
                along_y = lanes.mul_add(plain[j], slope, along_y);
                along_z = lanes.mul_add(sloped[j], y, along_z);
            }
            let (x, slope) = (self.x[0][half], self.x[1][half]);
            sums[0] = lanes.mul_add(value, x, sums[0]);
            sums[1] = lanes.mul_add(value, slope, sums[1]);
            sums[2] = lanes.mul_add(along_y, x, sums[2]);
            sums[3] = lanes.mul_add(along_z, x, sums[3]);
        }
        let sums = lanes.sums(sums);
        if N == 1 {
            return [factors[0] * sums[0], factors[0] * sums[1], factors[0] * sums[2], factors[0] * sums[3]];
        }
        sums
    }
}

/// Values and slopes (per cell) of the B-splines that do not vanish at t in [0, 1] of a cell: four of degree three or six of degree
/// five.
#[inline(always)]
fn splines<const REACH: usize>(t: f64) -> [[f64; 6]; 2] {
    let s = 1.0 - t;
    let (t2, s2) = (t * t, s * s);
    if REACH == CUBIC {
        let sixth = 1.0 / 6.0;
        let value =
            [sixth * s2 * s, (0.5 * t - 1.0) * t2 + 2.0 / 3.0, (0.5 * s - 1.0) * s2 + 2.0 / 3.0, sixth * t2 * t];
        let slope = [-0.5 * s2, t * (1.5 * t - 2.0), s * (2.0 - 1.5 * s), 0.5 * t2];
        return [
            [value[0], value[1], value[2], value[3], 0.0, 0.0],
            [slope[0], slope[1], slope[2], slope[3], 0.0, 0.0],
        ];
    }
    // 120 B and 24 B' in powers of t (de Boor, A Practical Guide to Splines, 1978).
    let (f, g) = (1.0 / 120.0, 1.0 / 24.0);
    let (t4, s4) = (t2 * t2, s2 * s2);
    let second = |t: f64| ((((5.0 * t - 20.0) * t + 20.0) * t + 20.0) * t - 50.0) * t + 26.0;
    let third = |t: f64| ((-10.0 * t + 30.0) * t * t - 60.0) * t * t + 66.0;
    let second_slope = |t: f64| (((5.0 * t - 16.0) * t + 12.0) * t + 8.0) * t - 10.0;
    let third_slope = |t: f64| ((-10.0 * t + 24.0) * t * t - 24.0) * t;
    [
        [f * s4 * s, f * second(t), f * third(t), f * third(s), f * second(s), f * t4 * t],
        [-g * s4, g * second_slope(t), g * third_slope(t), -g * third_slope(s), -g * second_slope(s), g * t4],
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check<const REACH: usize>() {
        for t in [0.0, 0.2, 0.71, 1.0] {
            let [value, slope] = splines::<REACH>(t);
            assert!((value.iter().sum::<f64>() - 1.0).abs() < 1e-15 && slope.iter().sum::<f64>().abs() < 1e-15);
            // The nodes' own places: a spline reproduces them.
            let place: f64 = (0..6).map(|k| (k as f64 - (REACH as f64 - 1.0)) * value[k]).sum();
            assert!((place - t).abs() < 2e-15);
            let (lower, upper) = (splines::<REACH>(t - 1e-5)[0], splines::<REACH>(t + 1e-5)[0]);
            for k in 0..6 {
                assert!(((upper[k] - lower[k]) / 2e-5 - slope[k]).abs() < 1e-9);
            }
        }
        // One spline from cell to cell, up to its last continuous derivative, by differences.
        for k in 1..2 * REACH {
            let (before, after) = (splines::<REACH>(1.0), splines::<REACH>(0.0));
            assert!((before[0][k] - after[0][k - 1]).abs() < 1e-15 && (before[1][k] - after[1][k - 1]).abs() < 1e-15);
        }
    }

    #[test]
    fn the_splines_add_up_to_one_and_slopes_are_slopes() {
        check::<CUBIC>();
        check::<QUINTIC>();
    }
}
